! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> An angle without a drive passes half a turn by an event.
module half_turn
  use kinds, only: wp
  use motion_state, only: move_turn, state_t, tally_t
  use motor_system, only: guard_back, guard_section, motor_system_t
  use series_flight, only: flight_t
  implicit none
  private

  public :: pass_half_turn

contains

  !> An angle without a drive that comes to half a turn goes on from the other side of it.
  pure subroutine pass_half_turn(system, flight, state, tally, passed)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(inout) :: flight
    type(state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: passed
    passed = any(flight%crossed([guard_section, guard_back]))
    if (.not. passed) return
    state%x = merge(0.5_wp, -0.5_wp, flight%crossed(guard_section))*system%turn
    call move_turn(system%turn, 2*state%x, state, tally)
    flight%crossed([guard_section, guard_back]) = .false.
  end subroutine pass_half_turn

end module half_turn
