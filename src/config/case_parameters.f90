! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Parameters by name: 'x0', 'v0', 'crank_angle' of the start, 'family.parameter' of a law and 'effect.NAME.parameter'.
module case_parameters
  use angle_units, only: unit_of
  use case_values, only: allowed_range, any_number, between, bounds_t
  use drive_law, only: is_given, is_speed, moves_foot
  use errors, only: error_t, fail
  use old_keys, only: current_key
  use kinds, only: wp
  use law_table, only: added_families, change_parameter, is_hidden, largest_angle, law_choice_t, parameter_row_t, rows_of, &
    part_family, path_of, split_element
  use motor_choices, only: has_motor
  use part_angles, only: is_of_angle, turns
  use restoring_law, only: position_is_angle
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: canonical_name, find_parameter, is_of_position, is_start, parameter_bounds, parameter_names, parameter_value, &
    row_bounds, set_parameter

contains

  !> The full name of a parameter as it is called today: 'ratio' is short for 'drive.ratio'.
  pure function canonical_name(name) result(path)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path
    path = current_key(trim(name))
    if (path == 'ratio') path = 'drive.ratio'
  end function canonical_name

  !> Whether a name belongs to the start and not to a law.
  pure logical function is_start(path)
    character(len=*), intent(in) :: path
    is_start = path == 'x0' .or. path == 'v0' .or. path == 'crank_angle'
  end function is_start

  !> Positions of the parameter `path` of the chosen laws: law in `laws`, row in its parameters, and of an element of a list
  !> ('drive.sine[2]') its number. All 0 if the laws have no such parameter, or it is a list as a whole.
  pure subroutine find_parameter(laws, path, law, row, element)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: path
    integer, intent(out) :: law, row
    integer, intent(out), optional :: element
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: name
    integer :: i, j, number
    law = 0
    row = 0
    call split_element(canonical_name(path), name, number)
    if (present(element)) element = max(number, 0)
    do i = 1, size(laws)
      rows = rows_of(laws(i))
      do j = 1, size(rows)
        if (path_of(laws(i))//'.'//trim(rows(j)%name) /= name .or. is_hidden(rows(j))) cycle
        if (is_left_out(laws, i, trim(rows(j)%name))) cycle
        if (rows(j)%list .neqv. number > 0) cycle
        if (number > size(laws(i)%parameters(j)%values)) cycle
        law = i
        row = j
      end do
    end do
  end subroutine find_parameter

  !> Whether law number `i` goes without the parameter: a body has a mass or an inertia, a drive a ratio or a frequency, and a motor
  !> sets the speed of its crank.
  pure logical function is_left_out(laws, i, name)
    type(law_choice_t), intent(in) :: laws(:)
    integer, intent(in) :: i
    character(len=*), intent(in) :: name
    is_left_out = .false.
    if (any(laws(i)%name == [character(len=12) :: 'body:watched', 'body:mass'])) then
      is_left_out = name == trim(merge('mass   ', 'inertia', turns(laws(i))))
      return
    end if
    if (.not. (moves_foot(laws(i)%name) .and. is_speed(name))) return
    ! Neither is given where the value of one of them is refused.
    is_left_out = has_motor(laws)
    if (is_given(laws(i), 'ratio') .or. is_given(laws(i), 'frequency')) then
      is_left_out = is_left_out .or. .not. is_given(laws(i), name)
    end if
  end function is_left_out

  !> Bounds and unit of a row of the law table, where a position is an angle or not.
  pure type(bounds_t) function row_bounds(row, is_angle)
    type(parameter_row_t), intent(in) :: row
    logical, intent(in) :: is_angle
    row_bounds = bounds_t(lower=row%range%lower, upper=row%range%upper, lower_open=row%range%lower_open, unit=row%unit)
    if (all(row%family /= added_families)) row_bounds%unit = unit_of(row%unit, is_angle)
  end function row_bounds

  !> Whether a parameter is a position or a velocity.
  pure logical function is_of_position(row)
    type(parameter_row_t), intent(in) :: row
    is_of_position = row%unit == 'm' .or. row%unit == 'm/s'
  end function is_of_position

  !> Bounds and unit of the parameter `path`; `found` is false if there is none.
  pure subroutine parameter_bounds(laws, path, bounds, found)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: path
    type(bounds_t), intent(out) :: bounds
    logical, intent(out) :: found
    type(parameter_row_t), allocatable :: rows(:)
    integer :: law, row
    found = .true.
    select case (path)
    case ('x0')
      bounds = any_number(unit_of('m', position_is_angle(laws)))
    case ('v0')
      bounds = any_number(unit_of('m/s', position_is_angle(laws)))
    case ('crank_angle')
      bounds = between(-largest_angle, largest_angle, 'rad')
    case default
      call find_parameter(laws, path, law, row)
      found = law > 0
      if (.not. found) return
      rows = rows_of(laws(law))
      if (laws(law)%family == part_family) then
        if (is_of_position(rows(row))) then
          bounds = row_bounds(rows(row), is_of_angle(laws, law))
        else
          bounds = row_bounds(rows(row), is_of_angle(laws, law, by_inertia=.true.))
        end if
      else
        bounds = row_bounds(rows(row), position_is_angle(laws))
      end if
    end select
  end subroutine parameter_bounds

  !> Names of the scalar parameters of the chosen laws, and of the elements of lists, for messages.
  pure function parameter_names(laws) result(names)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=:), allocatable :: names
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, j
    names = ''
    do i = 1, size(laws)
      rows = rows_of(laws(i))
      do j = 1, size(rows)
        if (is_hidden(rows(j)) .or. size(laws(i)%parameters(j)%values) == 0) cycle
        if (is_left_out(laws, i, trim(rows(j)%name))) cycle
        if (len(names) > 0) names = names//', '
        names = names//path_of(laws(i))//'.'//trim(rows(j)%name)
        if (rows(j)%list) names = names//'[1]'
        if (rows(j)%list .and. size(laws(i)%parameters(j)%values) > 1) names = names//' to ['// &
          to_text(size(laws(i)%parameters(j)%values))//']'
      end do
    end do
  end function parameter_names

  !> Value of the parameter `path` of a law; `absent` if the chosen laws have none.
  pure real(wp) function parameter_value(laws, path, absent)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: absent
    integer :: law, row, element
    parameter_value = absent
    call find_parameter(laws, path, law, row, element)
    if (law > 0) parameter_value = laws(law)%parameters(row)%values(max(element, 1))
  end function parameter_value

  !> Replaces the scalar parameter `path` ('family.parameter', 'effect.NAME.parameter' or 'ratio') in the laws. An unknown
  !> name or a value out of bounds gives code 65 and changes nothing. Where break-away friction
  !> equals sliding friction, setting the kinetic coefficient moves the static one with it.
  pure subroutine set_parameter(case_laws, path, value, error)
    type(law_choice_t), intent(inout) :: case_laws(:)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    type(error_t), allocatable, intent(out) :: error
    type(bounds_t) :: bounds
    character(len=:), allocatable :: problem
    integer :: law, row
    logical :: found
    call find_parameter(case_laws, path, law, row)
    if (law == 0) then
      call fail(error, exit_bad_case, 'parameter '''//trim(path)//''': unknown; allowed '//parameter_names(case_laws))
      return
    end if
    call parameter_bounds(case_laws, path, bounds, found)
    problem = allowed_range(value, bounds)
    if (len(problem) > 0) then
      call fail(error, exit_bad_case, 'parameter '''//trim(path)//''': '//problem)
      return
    end if
    call change_parameter(case_laws, canonical_name(path), value, found)
  end subroutine set_parameter

end module case_parameters
