! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where the mark of a motion, see `mark_of`, changes along a parameter: as an experiment sees it that moves in steps, and where the
!> settled motion itself comes to an end. A step disturbs a motion; near the end of its branch the smallest disturbance is
!> enough to throw it off, so that the two differ by more than the step.
module sweep_limits
  use circle, only: point_near
  use errors, only: error_t
  use grid, only: grid_t, machine_with
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use settling, only: same_mark, settle, settled_t
  use status, only: reason_time_over
  use sweep, only: hold_parameter, hold_t
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: observe_limit, branch_end, follow_limit

  !> What became of a settled motion that was followed.
  integer, parameter, public :: limit_not_known = 0, limit_bracketed = 1, limit_beyond_range = 2
  character(len=*), parameter, public :: limit_outcomes(0:2) = [character(len=12) :: 'not_known', 'bracketed', 'beyond_range']

  !> Drive periods for which a motion that neither settles nor changes its mark is watched.
  integer, parameter :: patience = 16384
  !> Steps are halved down to this share of the tolerance: what a step disturbs must be small beside what is asked.
  real(wp), parameter :: least_step = 0.125_wp
  !> Most steps along a branch.
  integer, parameter :: most_steps = 1000

contains

  !> Halves the interval in which the mark of a hold changes from `mark` while the parameter moves from `value` (state given)
  !> to `beyond`, until it is at most `tolerance` wide or a hold has to be given up. Every hold starts from the last state
  !> before the change and lasts as long as those of the sweep, settled or not. `next` comes in as the mark at `beyond` and goes
  !> out as that behind the limit.
  subroutine observe_limit(grid, span, path, value, beyond, state, mark, tolerance, next, bracket, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value, beyond, tolerance
    type(section_state_t), intent(in) :: state
    integer, intent(in) :: mark
    integer, intent(inout) :: next
    real(wp), intent(out) :: bracket(2)
    type(error_t), allocatable, intent(out) :: error
    type(hold_t) :: held
    type(section_state_t) :: last
    real(wp) :: near, far, middle
    near = value
    far = beyond
    last = state
    do while (abs(far - near) > tolerance)
      middle = 0.5_wp*(near + far)
      if (.not. (abs(middle - near) > 0 .and. abs(middle - far) > 0)) exit
      call hold_parameter(grid, span, path, middle, 0, 0, held, error, last)
      if (allocated(error)) return
      if (held%reason /= reason_time_over) exit
      if (same_mark(held%mark, mark)) then
        near = middle
        last = held%state
      else
        far = middle
        next = held%mark
      end if
    end do
    bracket = [min(near, far), max(near, far)]
  end subroutine observe_limit

  !> Follows the motion with `mark`, whose mark has changed behind the last of the `values` for which there is a `settled`, where
  !> the state was `state`, from the last of them at which it had settled. A motion may have left its branch long before its mark
  !> shows it; one that has not settled, and does not even when it is watched for long, cannot be followed. `last` is the last one
  !> that has settled, `at` its value.
  subroutine branch_end(grid, path, values, settled, state, mark, longest, tolerance, bracket, outcome, error, last, at)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(:), tolerance
    type(settled_t), intent(in) :: settled(:)
    type(section_state_t), intent(in) :: state
    integer, intent(in) :: mark, longest
    real(wp), intent(out) :: bracket(2)
    integer, intent(out) :: outcome
    type(error_t), allocatable, intent(out) :: error
    type(settled_t), intent(out) :: last
    real(wp), intent(out) :: at
    type(settled_t) :: there, next
    integer :: from
    at = values(size(settled))
    bracket = ieee_value(1.0_wp, ieee_quiet_nan)
    outcome = limit_not_known
    from = size(settled)
    there = settled(from)
    if (there%period == 0) then
      there%state = state
      call settle_at(grid, path, values(from), there, longest, patience, next, error)
      if (.not. allocated(error)) there = next
    end if
    if (allocated(error)) return
    if (there%period == 0 .and. same_mark(there%mark, mark)) return
    do while (there%period == 0 .or. .not. same_mark(there%mark, mark))
      from = from - 1
      if (from == 0) return
      there = settled(from)
    end do
    call follow_limit(grid, path, values(from), values(size(values)), abs(values(from + 1) - values(from)), there, longest, &
                      tolerance, bracket, outcome, error, last, at)
  end subroutine branch_end

  !> Follows a motion that has settled at `value` of the parameter `path` towards `last`, its settled motions being cycles of at
  !> most `longest` drive periods. Steps begin as `step` and are halved where the motion does not settle with the same mark. The
  !> end of the branch is between the last value at which it did and one, at most `tolerance` away where possible, at which
  !> the mark is another. `outcome` is `limit_bracketed` then; else `bracket` is not numbers. `here` is the last motion that has
  !> settled with the same mark, at the value `near`.
  subroutine follow_limit(grid, path, value, last, step, settled, longest, tolerance, bracket, outcome, error, here, near)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value, last, step, tolerance
    type(settled_t), intent(in) :: settled
    integer, intent(in) :: longest
    real(wp), intent(out) :: bracket(2)
    integer, intent(out) :: outcome
    type(error_t), allocatable, intent(out) :: error
    type(settled_t), intent(out) :: here
    real(wp), intent(out) :: near
    type(settled_t) :: next, before
    real(wp) :: far, behind, h, smallest, ahead
    integer :: i
    bracket = ieee_value(1.0_wp, ieee_quiet_nan)
    outcome = limit_not_known
    near = value
    behind = value
    here = settled
    before = settled
    h = sign(step, last - value)
    do i = 1, most_steps
      if (.not. abs(last - near) > 0) then
        outcome = limit_beyond_range
        return
      end if
      smallest = max(least_step*tolerance, 4*spacing(near))
      far = near + h
      if (abs(h) >= abs(last - near)) far = last
      ahead = 0
      if (abs(near - behind) > 0) ahead = (far - near)/(near - behind)
      call settle_at(grid, path, far, here, longest, 0, next, error, before, ahead)
      if (allocated(error)) return
      if (.not. keeps(next, here) .and. abs(far - near) <= smallest) then
        call look_beyond(grid, path, near, last, step, here, longest, tolerance, far, next, error)
        if (allocated(error)) return
        if (same_mark(next%mark, here%mark) .and. next%period == 0) return
        if (.not. same_mark(next%mark, here%mark)) then
          bracket = [min(near, far), max(near, far)]
          outcome = limit_bracketed
          return
        end if
      end if
      if (keeps(next, here)) then
        behind = near
        before = here
        near = far
        here = next
        h = sign(min(2*abs(h), step), h)
      else
        h = (far - near)/2
      end if
    end do
  end subroutine follow_limit

  !> Whether a motion has settled with the mark of another.
  pure logical function keeps(next, here)
    type(settled_t), intent(in) :: next, here
    keeps = next%period > 0 .and. same_mark(next%mark, here%mark)
  end function keeps

  !> What becomes of the motion that has settled at `near` where it can no longer be followed: goes `tolerance` further, or where
  !> it settles too slowly for that, beside a fold, as far as it takes, up to `step`.
  subroutine look_beyond(grid, path, near, last, step, here, longest, tolerance, far, next, error)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: near, last, step, tolerance
    type(settled_t), intent(in) :: here
    integer, intent(in) :: longest
    real(wp), intent(out) :: far
    type(settled_t), intent(out) :: next
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: width
    ! A little less than the tolerance: sums are rounded.
    width = max(min((1 - least_step)*tolerance, step), 4*spacing(near))
    do
      far = near + sign(min(width, abs(last - near)), last - near)
      call settle_at(grid, path, far, here, longest, patience, next, error)
      if (allocated(error)) return
      if (next%period > 0 .or. .not. same_mark(next%mark, here%mark) .or. .not. next%near_cycle) return
      if (width >= min(step, abs(last - near))) return
      width = min(2*width, step)
    end do
  end subroutine look_beyond

  !> Where the motion at `value` ends that starts from a settled one, `from`; with `ahead` from the section point at which the
  !> branch should be, `ahead` times as far from `from` as that is from `before`, if both have the same period.
  subroutine settle_at(grid, path, value, from, longest, patience, settled, error, before, ahead)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    type(settled_t), intent(in) :: from
    integer, intent(in) :: longest, patience
    type(settled_t), intent(out) :: settled
    type(error_t), allocatable, intent(out) :: error
    type(settled_t), intent(in), optional :: before
    real(wp), intent(in), optional :: ahead
    class(machine_t), allocatable :: moving
    type(section_state_t) :: start
    real(wp) :: here(2), behind(2)
    call machine_with(grid, path, value, moving, error)
    if (allocated(error)) return
    start = moving%resume(from%state, 0.0_wp)
    if (present(ahead) .and. .not. moving%has_driver .and. moving%coordinates() == 2) then
      if (before%period == from%period) then
        here = [from%state%state%x, from%state%state%v]
        behind = point_near([before%state%state%x, before%state%state%v], here, moving%turn)
        here = here + ahead*(here - behind)
        here(1) = min(max(here(1), moving%lower), moving%upper)
        start = moving%state_at(here)
      end if
    end if
    call settle(moving, start, longest, patience, settled)
  end subroutine settle_at

end module sweep_limits
