! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a trajectory of this length ends within a human's time: a stop is noticed only between trajectories.
module span_check
  use errors, only: error_t, fail
  use kinds, only: wp
  use status, only: exit_bad_case
  use text, only: to_text
  use single_trajectory, only: span_t
  implicit none
  private

  public :: check_periods

  !> Periods that a trajectory may last.
  real(wp), parameter :: most_periods = 1e9_wp

contains

  !> Code 65 if the trajectory would last more than 1e9 times the `period` [s] of the drive or, without one, of the machine.
  subroutine check_periods(span, period, error)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: period
    type(error_t), allocatable, intent(out) :: error
    if (span%duration <= most_periods*period) return
    call fail(error, exit_bad_case, "key 'run.duration': found "//to_text(span%duration)//' s, allowed at most '// &
              to_text(most_periods)//' periods of the drive, or its own, of '//to_text(period, 6)//' s each')
  end subroutine check_periods

end module span_check
