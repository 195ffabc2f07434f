! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a log holds of a machine with a motor: beside the body crank angle and speed, torques, power and current.
module motor_log
  use constants, only: two_pi
  use kinds, only: wp
  use motion_state, only: energy_balance_t, log_t, put_column, record_event, record_sample, state_t
  use motor_now, only: node_values
  use motor_system, only: motor_system_t
  use motor_state, only: motor_state_t
  use stored_jumps, only: jump_until_now
  implicit none
  private

  public :: add_sample, motor_energy, record_motor_event

  !> Row of the position of the foot among the columns of a sample.
  integer, parameter, public :: foot_row = 6

contains

  !> Torque of the motor, torque against it [N m], power of the motor [W], current or integral, kinetic energy, energy [J], position
  !> of the foot [m].
  pure function motor_values(system, state, crank) result(values)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: values(7)
    real(wp) :: node(system%sheet%tape%count)
    node = node_values(system, state, crank)
    values = [node(system%torque), node(system%load), node(system%torque)*crank%w, crank%own(1), node(system%kinetic), &
              node(system%energy), node(system%foot)]
    if (system%current > 0) values(4) = node(system%current)
  end function motor_values

  !> Energy of the machine [J]: kinetic, and of the spring. That of a current is the motor's.
  pure real(wp) function motor_energy(system, state, crank) result(energy)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: values(7)
    values = motor_values(system, state, crank)
    energy = values(6)
  end function motor_energy

  !> Crank angle since the start and crank speed.
  pure function crank_of(crank) result(motion)
    type(motor_state_t), intent(in) :: crank
    real(wp) :: motion(2)
    motion = [crank%phi + two_pi*crank%turns, crank%w]
  end function crank_of

  !> Writes a sample down.
  pure subroutine add_sample(system, state, crank, log)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(log_t), intent(inout) :: log
    type(energy_balance_t) :: balance
    real(wp) :: values(7)
    values = motor_values(system, state, crank)
    balance = log%balance
    balance%at_end = values(6)
    balance%work = balance%work + jump_until_now(system, state, crank, log)
    call put_column(log%sample_coordinates, log%samples + 1, [values(:5), values(7), crank%own(:system%variables - 4)])
    call record_sample(log, state, driver=crank_of(crank), balance=balance)
  end subroutine add_sample

  !> Writes an event down: the state before it and the velocity after it.
  pure subroutine record_motor_event(kind, state, crank, v_after, log)
    integer, intent(in) :: kind
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp), intent(in) :: v_after
    type(log_t), intent(inout) :: log
    call record_event(log, kind, state, v_after, driver=crank_of(crank))
  end subroutine record_motor_event

end module motor_log
