! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Work of a foot whose position jumps: the energy that the spring stores changes at once, the body standing still meanwhile.
module stored_jumps
  use kinds, only: wp
  use motion_state, only: log_t, state_t
  use motor_now, only: node_values
  use motor_state, only: motor_state_t
  use motor_system, only: motor_system_t
  use series_flight, only: flight_t, value_in_flight
  implicit none
  private

  public :: add_jump, keep_stored, jump_until_now

contains

  !> Adds the work of a jump between the end of a flight and the beginning of the next one, or of its next branches.
  pure subroutine add_jump(system, flight, state, crank, log)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(in) :: flight
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(log_t), intent(inout), optional :: log
    real(wp) :: values(system%sheet%tape%count)
    if (.not. present(log)) return
    if (.not. (may_jump(system) .and. log%balance%kept)) return
    if (.not. log%has_stored) then
      values = node_values(system, state, crank)
      log%stored = values(system%stored)
      log%has_stored = .true.
    end if
    log%balance%work = log%balance%work + value_in_flight(flight, system%stored) - log%stored
    call keep_stored(system, flight, log)
  end subroutine add_jump

  !> Keeps the energy of the spring at the end of a part of a flight.
  pure subroutine keep_stored(system, flight, log)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(in) :: flight
    type(log_t), intent(inout) :: log
    if (may_jump(system)) log%stored = value_in_flight(flight, system%stored)
  end subroutine keep_stored

  !> Work of a jump at this instant that no flight has begun with [J].
  pure real(wp) function jump_until_now(system, state, crank, log) result(work)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(log_t), intent(in) :: log
    real(wp) :: values(system%sheet%tape%count)
    work = 0
    if (.not. log%has_stored) return
    values = node_values(system, state, crank)
    work = values(system%stored) - log%stored
  end function jump_until_now

  pure logical function may_jump(system)
    type(motor_system_t), intent(in) :: system
    may_jump = .false.
    if (system%stored > 0 .and. allocated(system%sheet%tape%switches)) may_jump = size(system%sheet%tape%switches) > 0
  end function may_jump

end module stored_jumps
