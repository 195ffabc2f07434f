! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Variables and parameters of the equations of a machine with a motor, as its state sets them.
module motor_now
  use kinds, only: wp
  use motion_state, only: mode_slip_minus, state_t
  use motor_equations, only: motor_system_t, y_at
  use motor_state, only: motor_state_t
  use motor_torque, only: set_piece
  implicit none
  private

  public :: parameters_now, state_vector

contains

  !> The variables of the equations.
  pure function state_vector(system, state, crank) result(z)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: z(system%variables)
    z(:4) = [crank%phi, crank%w, state%x, state%v]
    if (system%control%has_own) z(y_at) = crank%y
    if (system%control%supply > 0) z(system%control%supply) = crank%supply
  end function state_vector

  !> The parameters: signs of slip and of turning, and what limits of the motor, a table and a ramp set.
  pure function parameters_now(system, state, crank) result(parameters)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: parameters(size(system%sheet%parameters))
    parameters = system%sheet%parameters
    parameters(system%slip) = merge(-1, 1, state%mode == mode_slip_minus)
    parameters(system%turning) = crank%turning
    associate (control => system%control)
      if (control%supply > 0 .and. .not. crank%ramps) parameters(control%ramp_rate) = 0
      if (control%torque_limit > 0) then
        parameters(control%follows) = merge(1, 0, crank%limited == 0)
        parameters(control%limited) = crank%limited
        parameters(control%integrates) = merge(1, 0, crank%held == 0)
      end if
      if (control%curve%count > 0) call set_piece(control, crank%piece, parameters)
    end associate
  end function parameters_now

end module motor_now
