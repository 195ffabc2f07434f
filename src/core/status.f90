! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Exit codes of the program and reason codes of trajectories, with their texts, in one table each.
module status
  implicit none
  private

  public :: reason_name, reason_code, is_given_up

  ! Exit codes (sysexits style).
  integer, parameter, public :: exit_done = 0, exit_usage = 64, exit_bad_case = 65, &
    exit_no_input = 66, exit_internal = 70, exit_cannot_create = 73, exit_io = 74, &
    exit_resumable = 75, exit_other_case = 76, exit_uncertain = 77, exit_given_up = 78

  ! Why a trajectory ended. The codes add up to the number of points; there is no catch-all.
  integer, parameter, public :: reason_not_run = 0, reason_settled = 1, reason_time_over = 2, &
    reason_left_domain = 3, reason_not_finite = 4, reason_event_budget = 5, &
    reason_step_failed = 6, reason_step_budget = 7, reason_mode_cycle = 8, last_reason = 8

  !> No end of a trajectory: it went on, but how it changes with its start is not known.
  integer, parameter, public :: reason_not_smooth = -1

  !> Texts of the reason codes, index = code.
  character(len=*), parameter, public :: reason_names(0:last_reason) = [character(len=14) :: &
    'not_run', 'settled', 'time_over', 'left_domain', 'not_finite', 'event_budget', 'step_failed', &
    'step_budget', 'mode_cycle']

contains

  !> The text of a reason code; 'unknown' outside the table.
  pure function reason_name(code) result(name)
    integer, intent(in) :: code
    character(len=:), allocatable :: name
    if (code >= lbound(reason_names, 1) .and. code <= ubound(reason_names, 1)) then
      name = trim(reason_names(code))
    else
      name = 'unknown'
    end if
  end function reason_name

  !> The code of a reason; -1 for a text outside the table.
  pure integer function reason_code(name) result(code)
    character(len=*), intent(in) :: name
    do code = 0, last_reason
      if (reason_names(code) == name) return
    end do
    code = -1
  end function reason_code

  !> Whether a motion that ended for this reason was given up. One that left its domain was not: that it leaves is known.
  pure elemental logical function is_given_up(code)
    integer, intent(in) :: code
    is_given_up = any(code == [reason_not_finite, reason_event_budget, reason_step_failed, reason_step_budget, &
                               reason_mode_cycle])
  end function is_given_up

end module status
