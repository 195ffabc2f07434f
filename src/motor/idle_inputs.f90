! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Parameters that are given and change nothing: of parts that a mechanism does not have, and those that no expression names.
module idle_inputs
  use expression_names, only: has_name
  use law_table, only: law_choice_t, motor_family, path_of, state_family, value_of
  use motor_choices, only: has_motor, number_of_family
  implicit none
  private

  public :: idle_input_t, idle_inputs_of

  type :: idle_input_t
    character(len=160) :: key = ''
    character(len=80) :: reason = ''
  end type idle_input_t

contains

  !> Every such parameter of `choices`, with its key in the case and the reason.
  pure function idle_inputs_of(choices) result(idle)
    type(law_choice_t), intent(in) :: choices(:)
    type(idle_input_t), allocatable :: idle(:)
    character(len=:), allocatable :: name, key
    integer :: i, k
    allocate (idle(0))
    if (has_motor(choices)) call add_parts(choices(number_of_family(choices, 'drive')), &
                                           choices(number_of_family(choices, motor_family)), idle)
    do i = 1, size(choices)
      if (.not. allocated(choices(i)%own)) cycle
      do k = 1, size(choices(i)%own)
        name = trim(choices(i)%own(k)%name)
        if (is_key(choices(i)%family, name) .or. is_named(choices, i, name)) cycle
        key = path_of(choices(i))//'.'//name
        call add(key, 'no expression contains it', idle)
      end do
    end do
  end function idle_inputs_of

  !> Parts that the mechanism of a drive does not have, and a current without an inductance.
  pure subroutine add_parts(drive, motor, idle)
    type(law_choice_t), intent(in) :: drive, motor
    type(idle_input_t), allocatable, intent(inout) :: idle(:)
    character(len=13), parameter :: of_lever(3) = [character(len=13) :: 'lever_inertia', 'rod_mass', 'rod_inertia']
    integer :: k
    do k = 1, size(of_lever)
      if (drive%name == 'crank_lever_rod' .or. .not. abs(value_of(motor, trim(of_lever(k)))) > 0) cycle
      call add('motor.'//trim(of_lever(k)), 'drive.law = "'//trim(drive%name)//'" has no lever', idle)
    end do
    if (drive%name == 'unbalance' .and. abs(value_of(motor, 'foot_mass')) > 0) then
      call add('motor.foot_mass', 'with an unbalance the foot of the spring is fixed', idle)
    end if
    if (motor%name /= 'dc') return
    if (abs(value_of(motor, 'start_current')) > 0 .and. .not. abs(value_of(motor, 'inductance')) > 0) then
      call add('motor.start_current', 'without motor.inductance the current follows the speed', idle)
    end if
  end subroutine add_parts

  pure subroutine add(key, reason, idle)
    character(len=*), intent(in) :: key, reason
    type(idle_input_t), allocatable, intent(inout) :: idle(:)
    type(idle_input_t) :: one
    one%key = key
    one%reason = reason
    idle = [idle, one]
  end subroutine add

  !> Whether a law by expressions uses the number itself: the start of a state, the period of a drive.
  pure logical function is_key(family, name)
    character(len=*), intent(in) :: family, name
    is_key = (family == state_family .and. name == 'start') .or. (family == 'drive' .and. name == 'period')
  end function is_key

  !> Whether a parameter of choice number `own` stands in an expression: of its own table by its name, of any by its path.
  pure logical function is_named(choices, own, name)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: own
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    integer :: i, k
    is_named = .false.
    path = path_of(choices(own))//'.'//name
    do i = 1, size(choices)
      if (.not. allocated(choices(i)%texts)) cycle
      do k = 1, size(choices(i)%texts)
        associate (text => choices(i)%texts(k)%text)
          is_named = is_named .or. has_name(text, path)
          if (i == own) is_named = is_named .or. has_name(text, name)
        end associate
      end do
    end do
  end function is_named

end module idle_inputs
