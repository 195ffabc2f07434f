! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where dry friction holds joints at rest: what `separatrix branches` reports of it, and what the file has.
module branch_rest
  use search_state, only: search_t
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use map_schema, only: name_length, schema_t, type_float64
  use rest_family, only: find_rest_family, rest_family_t
  use session, only: session_t
  use text, only: to_text
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: find_rest, report_rest, describe_rest

  !> The family at a value of the parameter.
  type, public :: rest_at_t
    real(wp) :: parameter = 0
    type(rest_family_t) :: family
  end type rest_at_t

contains

  !> What dry friction holds at the first and the last value that was searched, and where the machine may rest.
  subroutine find_rest(search, found)
    type(search_t), intent(in) :: search
    type(rest_at_t), allocatable, intent(out) :: found(:)
    type(rest_at_t) :: here
    integer :: i, last
    allocate (found(0))
    last = size(search%values)
    do i = 1, last, max(1, last - 1)
      here%parameter = search%values(i)
      call find_rest_family(search%family, here%parameter, here%family)
      if (len(here%family%joints) > 0) found = [found, here]
    end do
  end subroutine find_rest

  subroutine report_rest(session, found, path, unit)
    type(session_t), intent(inout) :: session
    type(rest_at_t), intent(in) :: found(:)
    character(len=*), intent(in) :: path, unit
    character(len=:), allocatable :: shown, data
    integer :: i
    do i = 1, size(found)
      associate (rest => found(i)%family)
        shown = path//' = '//to_text(found(i)%parameter)
        if (unit /= '1') shown = shown//' '//unit
        shown = 'at '//shown//' dry friction holds '//rest%joints//': positions of rest are a family, not followed'
        data = '"parameter": '//json_number(found(i)%parameter)//', "joints": '//json_text(rest%joints)
        if (rest%known) then
          shown = shown//'; x from '//to_text(rest%low, 10)//' to '//to_text(rest%high, 10)//' as far as no stop is in the way'
          data = data//', "x_low": '//json_number(rest%low)//', "x_high": '//json_number(rest%high)
        end if
        call session%journal%line('rest_family', shown, data)
      end associate
    end do
  end subroutine report_rest

  !> The families, one after the other.
  subroutine describe_rest(found, path, unit, schema)
    type(rest_at_t), intent(in) :: found(:)
    character(len=*), intent(in) :: path, unit
    type(schema_t), intent(inout) :: schema
    character(len=*), parameter :: where_rest = ' position at which it may rest, as far as no stop is in the way'
    character(len=:), allocatable :: joints
    real(wp) :: ends(2, size(found))
    integer :: i
    if (size(found) == 0) return
    ends = ieee_value(1.0_wp, ieee_quiet_nan)
    joints = found(1)%family%joints
    do i = 1, size(found)
      if (i > 1) joints = joints//'; '//found(i)%family%joints
      if (found(i)%family%known) ends(:, i) = [found(i)%family%low, found(i)%family%high]
    end do
    call schema%add_attribute('', 'rest_joints', joints)
    call schema%add_dimension('rest', size(found, kind=int64))
    call add('rest_parameter', unit, path, found%parameter)
    call add('rest_x_low', 'm', 'lowest'//where_rest, ends(1, :))
    call add('rest_x_high', 'm', 'highest'//where_rest, ends(2, :))

  contains

    subroutine add(name, units, long_name, values)
      character(len=*), intent(in) :: name, units, long_name
      real(wp), intent(in) :: values(:)
      character(len=name_length) :: along(1)
      along = 'rest'
      call schema%add_variable(name, type_float64, along, units=units, long_name=long_name, data=values)
    end subroutine add

  end subroutine describe_rest

end module branch_rest
