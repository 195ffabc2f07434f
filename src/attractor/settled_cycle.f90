! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The cycle that one motion has come to by its end.
module settled_cycle
  use attractors, only: attractor_t, kind_cycle, kind_rest
  use discover, only: discover_attractors, sort_attractors
  use kinds, only: wp
  use machine_type, only: machine_t
  use status, only: reason_settled, reason_time_over
  use single_trajectory, only: outcome_t, run_trajectory, span_t
  implicit none
  private

  public :: describe_cycle

  !> The search may take, beside the extension, so many times the events and steps of the motion, and so many more of each.
  integer, parameter :: more_times = 2, more_events = 10000, more_steps = 20000

contains

  !> The cycle that the motion of `outcome` has come to by its end, period 0 if none; then the steady values are those of the
  !> cycle. Not where they are asked for over the window as it is. A cycle that the motion comes to later, or that is longer than
  !> the motion, does not count, so that chaos is not searched for long; nor is one sought with far more events or steps than those
  !> of the motion and its extension. `patience`: span of the case, with its extension; `start`: x [m], v [m/s], crank angle [rad].
  pure subroutine describe_cycle(moving, patience, span, max_period, start, outcome, cycle)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: patience, span
    integer, intent(in) :: max_period
    real(wp), intent(in) :: start(3)
    type(outcome_t), intent(inout) :: outcome
    type(attractor_t), intent(out) :: cycle
    type(attractor_t), allocatable :: own(:)
    class(machine_t), allocatable :: searching
    type(outcome_t) :: again
    integer :: most_periods, times
    if (.not. span%whole_periods .or. outcome%reason /= reason_time_over) return
    most_periods = min(max_period, max(1, int(min(span%duration/moving%period*(1 + 8*epsilon(1.0_wp)), 1e6_wp))))
    allocate (searching, source=moving)
    times = more_times + ceiling(patience%extension)
    call searching%limit_budgets(times*outcome%events + more_events, times*outcome%steps + more_steps)
    call discover_attractors(searching, patience, reshape(start, [3, 1]), most_periods, own, within_span=.true.)
    if (size(own) == 0) return
    call sort_attractors(own)
    call run_trajectory(moving, own, span, start, again)
    if (again%reason /= reason_settled) return
    cycle = own(again%attractor)
    if (cycle%kind == kind_cycle .or. (cycle%kind == kind_rest .and. .not. cycle%rests)) outcome%window = cycle%features
  end subroutine describe_cycle

end module settled_cycle
