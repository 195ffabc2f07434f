! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The laws of a machine with a motor, and those that do not go with one.
module motor_choices
  use constants, only: two_pi
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, law_choice_t, motor_family, own_law, path_of, value_of
  use status, only: exit_bad_case
  implicit none
  private

  !> Largest decay of a difference of speeds over a turn, as an exponent.
  real(wp), parameter :: steepest = 1e4_wp

  public :: has_motor, number_of_family, refuse_laws, speed_of, start_of_motor

contains

  !> Whether a motor is among the choices.
  pure logical function has_motor(choices)
    type(law_choice_t), intent(in) :: choices(:)
    has_motor = number_of_family(choices, motor_family) > 0
  end function has_motor

  !> Number of the choice of a family; 0 if there is none.
  pure integer function number_of_family(choices, family) result(number)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: family
    integer :: i
    number = 0
    do i = 1, size(choices)
      if (choices(i)%family == family) number = i
    end do
  end function number_of_family

  !> Speed of the crank [rad/s] and current [A] or integral [rad] at the start.
  pure function start_of_motor(choices) result(start)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp) :: start(2)
    start = 0
    associate (motor => choices(number_of_family(choices, motor_family)))
      start(1) = value_of(motor, 'crank_speed')
      if (motor%name == 'dc') start(2) = value_of(motor, 'start_current')
      if (motor%name == 'pi') start(2) = value_of(motor, 'start_integral')
    end associate
  end function start_of_motor

  !> Laws that a motor does not go with.
  pure subroutine refuse_laws(choices, drive, motor, error)
    type(law_choice_t), intent(in) :: choices(:), drive, motor
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family == effect_family) then
        call fail(error, exit_bad_case, 'effect.'//trim(choices(i)%name)//': not allowed with a motor')
        return
      else if (choices(i)%name == own_law) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "expression", allowed without a table [motor]')
        return
      end if
    end do
    if (all(drive%name /= [character(len=15) :: 'harmonic', 'fourier', 'slider_crank', 'crank_lever_rod', 'unbalance'])) then
      call fail(error, exit_bad_case, 'drive.law: found "'//trim(drive%name)// &
                '", allowed with a motor: harmonic, fourier, slider_crank, crank_lever_rod, unbalance')
    else if (.not. value_of(motor, 'inertia') > 0) then
      call fail(error, exit_bad_case, 'motor.inertia: allowed above 0')
    else if (.not. abs(speed_of(motor)) > 0) then
      call fail(error, exit_bad_case, 'motor.voltage: found 0.0 V, allowed other than 0: a turn without load is the unit of time')
    else if (slope_of(motor)*two_pi/abs(speed_of(motor)) > steepest*value_of(motor, 'inertia')) then
      call fail(error, exit_bad_case, 'motor.inertia: so little that the speed follows the torque within 1e-4 of a turn; '// &
                'allowed more, or a drive without a motor, whose speed is given')
    else if (drive%name == 'slider_crank') then
      if (.not. value_of(drive, 'rod') > value_of(drive, 'crank')) then
        call fail(error, exit_bad_case, 'drive.rod: allowed above drive.crank: a shorter rod cannot go round')
      end if
    end if
  end subroutine refuse_laws

  !> Speed of the crank without torque [rad/s].
  pure real(wp) function speed_of(motor) result(speed)
    type(law_choice_t), intent(in) :: motor
    select case (motor%name)
    case ('linear')
      speed = value_of(motor, 'no_load_speed')
    case ('kloss')
      speed = value_of(motor, 'synchronous_speed')
    case ('dc')
      speed = value_of(motor, 'voltage')/value_of(motor, 'torque_constant')
    case default
      speed = value_of(motor, 'reference')
    end select
  end function speed_of

  !> Torque over the difference of the speed to that without torque [N m s].
  pure real(wp) function slope_of(motor) result(slope)
    type(law_choice_t), intent(in) :: motor
    select case (motor%name)
    case ('linear')
      slope = value_of(motor, 'stall_torque')/speed_of(motor)
    case ('kloss')
      slope = 2*value_of(motor, 'breakdown_torque')/(value_of(motor, 'breakdown_slip')*speed_of(motor))
    case ('dc')
      slope = value_of(motor, 'torque_constant')**2/value_of(motor, 'resistance')
    case default
      slope = value_of(motor, 'proportional')
    end select
  end function slope_of

end module motor_choices
