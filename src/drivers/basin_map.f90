! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The map of `separatrix basin`, also from shares: its grid and tiles, its file, and its end.
module basin_map
  use attractors, only: last_regime, regime_names
  use basin_work, only: basin_work_t, sum_counts
  use case_setup, only: automatic_tile, grid_of, points_of_tile, span_of, tile_of_blocks
  use case_type, only: case_t
  use crank_catalogue, only: add_crank_catalogue
  use derived_report, only: add_derived_catalogue
  use endings, only: assess_reasons, report_reasons
  use errors, only: error_t
  use file_layout, only: add_axes, add_catalogue, add_map_variables, add_refined_variables
  use grid, only: grid_t, two_axes
  use journal, only: json_text
  use kinds, only: int64, wp
  use map_file, only: map_file_t
  use map_schema, only: name_length, schema_t
  use build_pair, only: is_pair
  use point_columns, only: map_values, marks_of_attractor, point_values
  use refined_tile, only: layers_of
  use refinement, only: automatic_block
  use refinement_report, only: add_refinement, report_refinement
  use restoring_law, only: position_is_angle
  use sample_shares, only: add_sample_shares, add_samples, share_with_interval
  use second_look, only: offer_second_look
  use session, only: describe_file, session_t
  use status, only: exit_done
  use text, only: to_text
  use tiled_run, only: finish_tiles
  implicit none
  private

  public :: prepare_basin, describe_basin, end_basin

contains

  !> Grid, span and tiles of a case, for so many ranks of which so many have a GPU. Shares of a map are to have the same tiles,
  !> whoever computes them: for these `gpus` is 0.
  subroutine prepare_basin(the_case, work, tile, ranks, gpus)
    type(case_t), intent(in) :: the_case
    type(basin_work_t), intent(inout) :: work
    integer, allocatable, intent(out) :: tile(:)
    integer, intent(in) :: ranks, gpus
    work%variables = map_values(the_case%laws)
    if (the_case%refine%active) work%variables = point_values
    work%grid = grid_of(the_case, the_case%axes)
    work%span = span_of(the_case)
    work%max_period = the_case%attractors%max_period
    call prepare_refinement(the_case, work)
    tile = automatic_tile(work%grid, the_case%tile, points_of_tile(product(int(work%grid%shape, int64)), ranks, gpus))
    if (work%refine%active) tile = tile_of_blocks(work%grid, work%refine, the_case%tile)
  end subroutine prepare_basin

  !> Attributes, axes and variables of the file; returns the names of its dimensions.
  subroutine describe_basin(session, work, schema, dimensions)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(in) :: work
    type(schema_t), intent(inout) :: schema
    character(len=name_length), allocatable, intent(out) :: dimensions(:)
    call describe_file(session, 'basin', schema)
    call add_axes(schema, work%grid%axes, dimensions)
    call add_samples(schema, session%the_case%sample)
    if (work%refine%active) then
      call add_refined_variables(schema, dimensions)
    else
      call add_map_variables(schema, '', dimensions, session%the_case%laws)
    end if
    if (size(work%catalogues) > 0) call offer_second_look(session%the_case%attractors%second_look, schema)
  end subroutine describe_basin

  !> The final file with its catalogue, the shares of the regimes, and the end of the program.
  subroutine end_basin(session, work, file, complete)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(inout) :: work
    type(map_file_t), intent(inout) :: file
    logical, intent(in) :: complete
    type(schema_t) :: extra
    type(error_t), allocatable :: error
    call sum_counts(session, work)
    extra%positions_are_angles = position_is_angle(session%the_case%laws)
    call add_catalogue(extra, work%catalogues, work%captured, is_pair(session%the_case%laws))
    call add_crank_catalogue(session%team, work%grid, work%catalogues, extra)
    if (complete) call add_derived_catalogue(session%team, work%grid, work%catalogues, work%span, extra)
    if (allocated(work%grid%drawn)) call add_sample_shares(extra, work%captured, points_of_slice(work%grid))
    if (work%refine%active) call add_refinement(extra, work, work%grid%shape, work%origins)
    call finish_tiles(session, file, complete, extra)
    call report_shares(session, work)
    if (work%refine%active) call report_refinement(session, work, work%grid%shape, work%origins)
    call assess_reasons(session%journal, work%reasons, session%command%partial, error)
    call session%stop_if(error)
    call session%end_with(exit_done)
  end subroutine end_basin

  subroutine prepare_refinement(the_case, work)
    type(case_t), intent(in) :: the_case
    type(basin_work_t), intent(inout) :: work
    work%refine = the_case%refine
    work%marks = marks_of_attractor
    if (.not. work%refine%active) return
    work%refined_axes = two_axes(work%grid)
    work%refine%block = automatic_block(work%refine, work%grid%shape(work%refined_axes), layers_of(work%grid%shape, &
                                                                                                   work%refined_axes))
  end subroutine prepare_refinement

  subroutine report_shares(session, work)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(in) :: work
    integer :: i
    real(wp) :: share
    do i = 0, last_regime
      if (work%regimes(i) == 0) cycle
      share = 100*real(work%regimes(i), wp)/sum(work%regimes)
      call session%journal%line('share', '  '//trim(regime_names(i))//': '//to_text(share, 6)//' % ('// &
        to_text(work%regimes(i))//' points)', '"regime": '//json_text(trim(regime_names(i)))//', "percent": '// &
        to_text(share)//', "points": '//to_text(work%regimes(i)))
    end do
    call report_reasons(session%journal, work%reasons)
    if (allocated(work%grid%drawn) .and. size(work%catalogues) == 1) call report_sample_shares(session, work)
  end subroutine report_shares

  !> Points of one slice.
  pure integer(int64) function points_of_slice(grid)
    type(grid_t), intent(in) :: grid
    points_of_slice = product(int(grid%shape, int64))/grid%slices
  end function points_of_slice

  !> Shares of the attractors of starts drawn at random.
  subroutine report_sample_shares(session, work)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(in) :: work
    real(wp) :: share(3)
    integer :: k
    do k = 1, size(work%catalogues(1)%attractors)
      share = share_with_interval(work%captured(k), points_of_slice(work%grid))
      call session%journal%line('basin_share', '  attractor '//to_text(work%catalogues(1)%attractors(k)%id)//': '// &
        to_text(100*share(1), 4)//' % of the starts, between '//to_text(100*share(2), 4)//' % and '// &
        to_text(100*share(3), 4)//' % with 95 % confidence', '"attractor": '// &
        to_text(work%catalogues(1)%attractors(k)%id)//', "share": '//to_text(share(1))//', "lower": '// &
        to_text(share(2))//', "upper": '//to_text(share(3)))
    end do
  end subroutine report_sample_shares

end module basin_map
