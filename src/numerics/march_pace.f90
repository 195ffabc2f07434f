! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a flight that is integrated step by step gets on: at the pace of its last steps, does its budget last to its end?
module march_pace
  use kinds, only: int64, wp
  implicit none
  private

  public :: watch_pace

  !> Share of the budget after which the pace is looked at, and again after as many steps more; no fewer steps.
  integer(int64), parameter :: looks = 20, fewest_steps = 1000

  !> Steps of the flight, and what they were when the pace was last looked at, with the time then [s].
  type, public :: pace_t
    integer(int64) :: steps = 0, looked_at = 0
    real(wp) :: time = -huge(1.0_wp)
  end type pace_t

contains

  !> Counts one step to `time` of a flight to `until` [s]; `hopeless` if more steps than `budget` are left to go at this pace.
  pure subroutine watch_pace(time, until, budget, pace, hopeless)
    real(wp), intent(in) :: time, until
    integer(int64), intent(in) :: budget
    type(pace_t), intent(inout) :: pace
    logical, intent(out) :: hopeless
    hopeless = .false.
    if (pace%steps == 0) pace%time = time
    pace%steps = pace%steps + 1
    if (pace%steps - pace%looked_at < max(fewest_steps, budget/looks)) return
    hopeless = (time - pace%time)*budget < (until - time)*(pace%steps - pace%looked_at)
    pace%looked_at = pace%steps
    pace%time = time
  end subroutine watch_pace

end module march_pace
