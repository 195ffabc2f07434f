! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Random points of a list of starts run again, for `separatrix verify`.
module list_audit
  use audit, only: audit_t, note_deviation, sampled
  use axis, only: axis_t
  use basin, only: catalogue_t
  use case_setup, only: grid_of, options_of
  use case_type, only: case_t
  use errors, only: error_t, fail
  use grid, only: grid_t, slice_laws
  use kinds, only: int64, wp
  use law_table, only: change_parameter
  use map_reader, only: reader_t
  use point_list, only: point_list_t
  use list_work, only: open_list_ensemble, read_further
  use reference, only: run_reference
  use span_check, only: check_periods
  use status, only: exit_io
  use text, only: to_text
  use trajectories, only: run_trajectories
  use trajectory_slots, only: ensemble_t
  use single_trajectory, only: outcome_t
  implicit none
  private

  public :: audit_points

contains

  !> Runs `sample` random points of a list again, chosen by `seed`, or all where it has no more. Code 74 where a start is none.
  subroutine audit_points(reader, the_case, sample, seed, audit, error)
    type(reader_t), intent(in) :: reader
    type(case_t), intent(in) :: the_case
    integer, intent(in) :: sample, seed
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    type(grid_t) :: grid
    type(ensemble_t) :: ensemble
    type(catalogue_t) :: none
    type(outcome_t) :: outcomes(1)
    type(point_list_t) :: list
    real(wp), allocatable :: table(:, :)
    real(wp) :: results(6, 1), start(3, 1)
    character(len=*), parameter :: names(7) = [character(len=8) :: 'x0', 'v0', 'ratio', 'x', 'v', 'impacts', 'reason']
    integer :: i, drawn(1), point
    call reader%read_columns('/'//names, table, error)
    if (.not. allocated(error)) list%x0 = table(:, 1)
    if (.not. allocated(error)) call read_further(reader, list, error)
    if (allocated(error)) return
    allocate (none%attractors(0))
    audit%whole = size(table, 1) <= sample
    do i = 1, min(sample, size(table, 1))
      drawn = sampled([size(table, 1)], audit%whole, seed, i)
      point = drawn(1)
      if (.not. all(abs(table(point, :3)) <= huge(1.0_wp))) then
        call fail(error, exit_io, "'"//reader%path//"', point "//to_text(point - 1)//': the start is not finite')
        return
      end if
      call open_point(the_case, list, point, table(point, 3), grid, ensemble, error)
      if (allocated(error)) then
        error%code = exit_io
        error%message = "'"//reader%path//"', point "//to_text(point - 1)//': '//error%message
        return
      end if
      start(:, 1) = [table(point, 1), table(point, 2), grid%start(3)]
      call run_trajectories(ensemble, none%attractors, start, outcomes)
      associate (outcome => outcomes(1))
        audit%points = audit%points + 1
        if (abs(outcome%x - table(point, 4)) > 0 .or. abs(outcome%v - table(point, 5)) > 0 &
            .or. outcome%impacts /= nint(table(point, 6)) .or. outcome%reason /= nint(table(point, 7))) then
          audit%differing = audit%differing + 1
          if (audit%differing == 1) audit%first_difference = 'point '//to_text(point - 1)
        end if
      end associate
      call run_reference(slice_laws(grid, 0_int64), options_of(the_case), ensemble%span, none%attractors, start, results, error)
      if (allocated(error)) return
      if (nint(results(3, 1)) /= outcomes(1)%features%regime) audit%flips = audit%flips + 1
      call note_deviation(outcomes(1), results(:, 1), audit)
    end do
    audit%changes = audit%flips
  end subroutine audit_points

  !> The machine of a point of a list, with its own drive `ratio`, where that is above 0, and starts of further bodies.
  subroutine open_point(the_case, list, point, ratio, grid, ensemble, error)
    type(case_t), intent(in) :: the_case
    type(point_list_t), intent(in) :: list
    integer, intent(in) :: point
    real(wp), intent(in) :: ratio
    type(grid_t), intent(out) :: grid
    type(ensemble_t), intent(out) :: ensemble
    type(error_t), allocatable, intent(out) :: error
    type(axis_t) :: axes(3)
    type(case_t) :: own
    integer :: k
    logical :: known
    axes(1) = axis_t('drive.ratio', '1', [ratio])
    own = the_case
    do k = 1, size(list%names)
      call change_parameter(own%laws, list%names(k), list%further(k, point), known)
    end do
    grid = grid_of(own, axes(:merge(1, 0, ratio > 0)))
    call open_list_ensemble(grid, the_case, ensemble, error)
    if (.not. allocated(error)) call check_periods(ensemble%span, ensemble%moving%period, error)
  end subroutine open_point

end module list_audit
