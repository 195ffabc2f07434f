! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Variables, parameters and nodes of the equations, as the state sets them.
module motor_now
  use constants, only: two_pi
  use kinds, only: wp
  use motion_state, only: mode_slip_minus, state_t
  use motor_state, only: motor_state_t
  use motor_system, only: motor_system_t, y_at
  use motor_torque, only: set_limits, set_piece
  use tape_value, only: evaluate
  implicit none
  private

  public :: node_values, parameters_now, restitution_of, state_vector

contains

  !> The variables of the equations.
  pure function state_vector(system, state, crank) result(z)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: z(system%variables)
    z(:4) = [crank%phi, crank%w, state%x, state%v]
    if (system%clock) then
      z(:2) = [crank%phi + state%time, 0.0_wp]
      if (system%period > 0) z(2) = state%time*two_pi/system%period
      z(5:) = crank%own(:system%variables - 4)
    end if
    if (system%control%has_own) z(y_at) = crank%own(1)
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
      if (control%torque_limit > 0) call set_limits(control, crank%limited, crank%held, parameters)
      if (control%curve%count > 0) call set_piece(control, crank%piece, parameters)
    end associate
  end function parameters_now

  !> Values of the nodes, those that are not defined being zero.
  pure function node_values(system, state, crank) result(values)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: values(system%sheet%tape%count)
    integer :: fault(system%sheet%tape%count)
    call evaluate(system%sheet%tape, state_vector(system, state, crank), parameters_now(system, state, crank), values, fault)
  end function node_values

  !> Ratio of the speeds after and before an impact, the body arriving; -1 where it is not defined.
  pure real(wp) function restitution_of(system, state, crank) result(restitution)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: values(system%sheet%tape%count)
    integer :: fault(system%sheet%tape%count)
    restitution = system%contact%restitution
    if (system%restitution == 0) return
    call evaluate(system%sheet%tape, state_vector(system, state, crank), parameters_now(system, state, crank), values, fault)
    restitution = values(system%restitution)
    if (fault(system%restitution) > 0) restitution = -1
  end function restitution_of

end module motor_now
