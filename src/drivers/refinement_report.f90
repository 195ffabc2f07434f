! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The report on a refined map: how much of it was computed, what the probes found, and how much of it can be wrong.
module refinement_report
  use kinds, only: int64, wp
  use map_schema, only: schema_t
  use point_work, only: point_work_t
  use refined_tile, only: layers_of
  use refinement, only: last_origin, origin_agreed, origin_computed, origin_contradicted, probes_drawn, wrong_share_factor
  use session, only: session_t
  use statistics, only: share_upper_limit
  use text, only: to_text
  implicit none
  private

  public :: add_refinement, report_refinement

  !> Confidence of the limit of what can be wrong.
  real(wp), parameter :: confidence = 0.95_wp

contains

  !> Probability-bounded share of the points of a map of `lengths` whose labels may be wrong.
  function wrong_share(work, lengths, origins) result(limit)
    class(point_work_t), intent(in) :: work
    integer, intent(in) :: lengths(:)
    integer(int64), intent(in) :: origins(0:)
    real(wp) :: limit
    limit = min(1.0_wp, wrong_share_factor(work%refine, lengths(work%refined_axes))* &
                share_upper_limit(origins(origin_contradicted), drawn(work, lengths), confidence))
  end function wrong_share

  integer(int64) function drawn(work, lengths)
    class(point_work_t), intent(in) :: work
    integer, intent(in) :: lengths(:)
    associate (axes => work%refined_axes)
      drawn = probes_drawn(work%refine, lengths(axes), layers_of(lengths, axes))
    end associate
  end function drawn

  !> Attributes of the group `refinement`. `origins`: points per origin.
  subroutine add_refinement(schema, work, lengths, origins)
    type(schema_t), intent(inout) :: schema
    class(point_work_t), intent(in) :: work
    integer, intent(in) :: lengths(:)
    integer(int64), intent(in) :: origins(0:last_origin)
    call schema%add_attribute('refinement', 'points_computed', sum(origins(:origin_contradicted)))
    call schema%add_attribute('refinement', 'points_inferred', sum(origins(origin_contradicted + 1:)))
    call schema%add_attribute('refinement', 'probes_drawn', drawn(work, lengths))
    call schema%add_attribute('refinement', 'probes_agreed', origins(origin_agreed))
    call schema%add_attribute('refinement', 'probes_contradicted', origins(origin_contradicted))
    call schema%add_attribute('refinement', 'wrong_share_upper_limit', wrong_share(work, lengths, origins))
    call schema%add_attribute('refinement', 'confidence', confidence)
  end subroutine add_refinement

  !> The same in the log.
  subroutine report_refinement(session, work, lengths, origins)
    type(session_t), intent(inout) :: session
    class(point_work_t), intent(in) :: work
    integer, intent(in) :: lengths(:)
    integer(int64), intent(in) :: origins(0:last_origin)
    integer(int64) :: computed, run(1)
    run = work%computed
    call session%team%sum(run)
    computed = sum(origins(:origin_contradicted))
    call session%journal%line('refined', '  computed: '//to_text(100*real(computed, wp)/sum(origins), 4)//' % ('// &
      to_text(computed)//' points; '//to_text(run(1))//' trajectories in this run, some of them for two blocks)', &
      '"computed": '//to_text(computed)//', "points": '//to_text(sum(origins))//', "trajectories": '//to_text(run(1)))
    call session%journal%line('probes', '  probes: '//to_text(drawn(work, lengths))//' drawn, '// &
      to_text(origins(origin_agreed))//' found what had been inferred, '//to_text(origins(origin_contradicted))// &
      ' something else (mended)', '"drawn": '//to_text(drawn(work, lengths))//', "agreed": '// &
      to_text(origins(origin_agreed))//', "contradicted": '//to_text(origins(origin_contradicted)))
    call session%journal%line('wrong', '  so, with '//to_text(100*confidence, 2)//' % confidence, at most '// &
      to_text(100*wrong_share(work, lengths, origins), 3)//' % of the points were inferred wrongly', &
      '"share_upper_limit": '//to_text(wrong_share(work, lengths, origins))//', "confidence": '//to_text(confidence))
  end subroutine report_refinement

end module refinement_report
