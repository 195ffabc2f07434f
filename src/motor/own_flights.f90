! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The motions of a body of equations by expressions: it slips, or is held.
module own_flights
  use equation_sheet, only: define, node_of
  use motor_system, only: body_held, both_move, guard_back, guard_body_down, guard_body_up, guard_count, guard_fastest, &
    guard_lower, guard_section, guard_turning, guard_upper, motor_system_t, stays_within_half_turn, phi_at, v_at, w_at, x_at
  use series_flight, only: guard_t, start_flight
  use text, only: to_text
  implicit none
  private

  public :: add_own_flights

contains

  !> A motion per mode, without and with work and losses. The equations are complete.
  pure subroutine add_own_flights(system)
    type(motor_system_t), intent(inout) :: system
    type(guard_t) :: guards(guard_count), watched(guard_count)
    integer :: rates(system%variables), powers(3), mode, i
    call add_guards(system, guards)
    associate (sheet => system%sheet)
      powers = node_of(sheet, [character(len=12) :: 'power', 'dry_loss', 'viscous_loss'])
      do mode = both_move, body_held
        rates = node_of(sheet, 'zero')
        rates(phi_at) = node_of(sheet, 'one')
        rates(w_at) = node_of(sheet, 'clock_speed')
        if (mode == both_move) then
          rates(x_at) = node_of(sheet, 'v')
          rates(v_at) = node_of(sheet, 'v_rate')
        end if
        do i = 1, system%variables - v_at
          rates(v_at + i) = node_of(sheet, 'rate '//to_text(i))
        end do
        watched = guards
        if (mode == both_move) watched([guard_body_up, guard_body_down])%node = node_of(sheet, 'zero')
        call start_flight(system%flights(mode, 0), sheet%tape, rates, watched, sheet%parameters)
        call start_flight(system%flights(mode, 1), sheet%tape, [rates, powers], watched, sheet%parameters)
      end do
    end associate
  end subroutine add_own_flights

  !> The stops, rest, what friction holds, and the largest velocity; there is no crank.
  pure subroutine add_guards(system, guards)
    type(motor_system_t), intent(inout) :: system
    type(guard_t), intent(out) :: guards(guard_count)
    associate (sheet => system%sheet)
      call define(sheet, 'above', 'x - upper')
      call define(sheet, 'below', 'x - lower')
      call define(sheet, 'up', 'hold - static')
      call define(sheet, 'down', 'hold + static')
      guards%node = node_of(sheet, 'zero')
      guards(guard_upper)%node = node_of(sheet, 'above')
      guards(guard_lower)%node = node_of(sheet, 'below')
      guards(guard_turning)%node = node_of(sheet, 'v')
      guards(guard_body_up)%node = node_of(sheet, 'up')
      guards(guard_body_down)%node = node_of(sheet, 'down')
      guards(guard_fastest)%node = node_of(sheet, 'v_rate')
      if (.not. stays_within_half_turn(system)) return
      call define(sheet, 'over_half', 'x - half_turn')
      call define(sheet, 'under_half', 'x + half_turn')
      guards(guard_section)%node = node_of(sheet, 'over_half')
      guards(guard_back)%node = node_of(sheet, 'under_half')
    end associate
  end subroutine add_guards

end module own_flights
