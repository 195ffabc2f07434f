! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The laws of a machine with a motor, and those that do not go with one.
module motor_choices
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, law_choice_t, motor_family, value_of
  use status, only: exit_bad_case
  implicit none
  private

  public :: has_motor, number_of_family, refuse_laws, start_of_motor

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
      end if
    end do
    if (all(drive%name /= [character(len=15) :: 'harmonic', 'fourier', 'slider_crank', 'crank_lever_rod', 'unbalance'])) then
      call fail(error, exit_bad_case, 'drive.law: found "'//trim(drive%name)// &
                '", allowed with a motor: harmonic, fourier, slider_crank, crank_lever_rod, unbalance')
    else if (.not. value_of(motor, 'inertia') > 0) then
      call fail(error, exit_bad_case, 'motor.inertia: allowed above 0')
    else if (drive%name == 'slider_crank') then
      if (.not. value_of(drive, 'rod') > value_of(drive, 'crank')) then
        call fail(error, exit_bad_case, 'drive.rod: allowed above drive.crank: a shorter rod cannot go round')
      end if
    end if
  end subroutine refuse_laws

end module motor_choices
