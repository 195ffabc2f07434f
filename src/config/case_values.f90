! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Typed values out of a case's text. Each reader declares its key as known, leaves `value` (the
!> default) as it is when the key is absent, and notes a wrong type, unit or bound.
module case_values
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use case_source, only: case_source_t, description, find, know, list_size, report
  use kinds, only: wp
  use text, only: join, to_text
  use toml_bindings, only: toml_array, toml_entry_t, toml_float, toml_integer, toml_string
  use units, only: allowed_units, read_quantity
  implicit none
  private

  public :: any_number, at_least, more_than, between, allowed_range
  public :: take_real, take_reals, take_range, take_integer, take_integers, take_text, take_choice

  !> Allowed values of a quantity in its SI unit.
  type, public :: bounds_t
    real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
    logical :: lower_open = .false.
    character(len=20) :: unit = '1'
  end type bounds_t

contains

  !> Every finite number in `unit`.
  pure type(bounds_t) function any_number(unit)
    character(len=*), intent(in) :: unit
    any_number = bounds_t(unit=unit)
  end function any_number

  !> lower <= value.
  pure type(bounds_t) function at_least(lower, unit)
    real(wp), intent(in) :: lower
    character(len=*), intent(in) :: unit
    at_least = bounds_t(lower=lower, unit=unit)
  end function at_least

  !> lower < value.
  pure type(bounds_t) function more_than(lower, unit)
    real(wp), intent(in) :: lower
    character(len=*), intent(in) :: unit
    more_than = bounds_t(lower=lower, lower_open=.true., unit=unit)
  end function more_than

  !> lower <= value <= upper.
  pure type(bounds_t) function between(lower, upper, unit)
    real(wp), intent(in) :: lower, upper
    character(len=*), intent(in) :: unit
    between = bounds_t(lower=lower, upper=upper, unit=unit)
  end function between

  !> Whether a value is inside; NaN and infinities never are.
  pure logical function inside(value, bounds)
    real(wp), intent(in) :: value
    type(bounds_t), intent(in) :: bounds
    ! Comparing the order of NaN would stop a program with floating-point traps.
    inside = .false.
    if (.not. ieee_is_finite(value)) return
    inside = value >= bounds%lower .and. value <= bounds%upper
    if (bounds%lower_open) inside = inside .and. value > bounds%lower
  end function inside

  !> 'found 2.0, allowed from 0.0 to 1.0 m' if a value is out of bounds, otherwise ''.
  pure function allowed_range(value, bounds) result(problem)
    real(wp), intent(in) :: value
    type(bounds_t), intent(in) :: bounds
    character(len=:), allocatable :: problem, unit, range
    problem = ''
    if (inside(value, bounds)) return
    unit = ''
    if (bounds%unit /= '1') unit = ' '//trim(bounds%unit)
    if (bounds%upper < huge(1.0_wp)) then
      range = 'from '//to_text(bounds%lower)//' to '//to_text(bounds%upper)
      if (bounds%lower_open) range = 'more than '//to_text(bounds%lower)//', at most '//to_text(bounds%upper)
    else if (bounds%lower > -huge(1.0_wp)) then
      range = 'at least '//to_text(bounds%lower)
      if (bounds%lower_open) range = 'more than '//to_text(bounds%lower)
    else
      range = 'a finite number'
    end if
    problem = 'found '//to_text(value)//unit//', allowed '//range//unit
    if (range /= 'a finite number' .and. .not. ieee_is_finite(value)) problem = problem//', a finite number'
  end function allowed_range

  !> The entry's number in the SI unit of `bounds`, or what is wrong with it.
  pure subroutine quantity_of(entry, bounds, value, problem)
    type(toml_entry_t), intent(in) :: entry
    type(bounds_t), intent(in) :: bounds
    real(wp), intent(inout) :: value
    character(len=:), allocatable, intent(out) :: problem
    real(wp) :: found
    select case (entry%kind)
    case (toml_integer, toml_float)
      found = entry%real
    case (toml_string)
      call read_quantity(entry%string, trim(bounds%unit), found, problem)
    case default
      problem = 'allowed '//allowed_units(trim(bounds%unit))
    end select
    if (allocated(problem)) then
      problem = 'found '//description(entry)//', '//problem
      return
    end if
    problem = allowed_range(found, bounds)
    ! Adding zero turns -0 into +0, which the resolved text writes.
    if (len(problem) == 0) value = found + 0.0_wp
  end subroutine quantity_of

  !> Whether `path` is there; notes it as missing if it is required.
  subroutine look_up(source, path, required, at)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    logical, intent(in), optional :: required
    integer, intent(out) :: at
    call know(source, path)
    at = find(source, path)
    if (at > 0 .or. .not. present(required)) return
    if (required) call report(source, path, 'missing', missing=.true.)
  end subroutine look_up

  !> One number with its unit.
  subroutine take_real(source, path, bounds, value, required)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bounds_t), intent(in) :: bounds
    real(wp), intent(inout) :: value
    logical, intent(in), optional :: required
    character(len=:), allocatable :: problem
    integer :: at
    call look_up(source, path, required, at)
    if (at == 0) return
    call quantity_of(source%entries(at)%entry, bounds, value, problem)
    if (len(problem) > 0) call report(source, path, problem)
  end subroutine take_real

  !> A list of at least one number; problems are noted under their element. Without default and key, or with something else instead
  !> of the list, `values` is empty.
  subroutine take_reals(source, path, bounds, values, required)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bounds_t), intent(in) :: bounds
    real(wp), allocatable, intent(inout) :: values(:)
    logical, intent(in), optional :: required
    character(len=:), allocatable :: element, problem
    integer :: at, i
    if (.not. allocated(values)) allocate (values(0))
    call look_up(source, path, required, at)
    if (at == 0) return
    if (list_size(source, path) == 0) then
      call report(source, path, 'found '//description_of_list(source%entries(at)%entry)// &
                  ', allowed a list of numbers')
      return
    end if
    values = [(0.0_wp, i=1, list_size(source, path))]
    do i = 1, size(values)
      element = path//'['//to_text(i)//']'
      at = find(source, element, at)
      call quantity_of(source%entries(at)%entry, bounds, values(i), problem)
      if (len(problem) > 0) call report(source, element, problem)
    end do
  end subroutine take_reals

  pure function description_of_list(entry) result(text)
    type(toml_entry_t), intent(in) :: entry
    character(len=:), allocatable :: text
    text = description(entry)
    if (entry%kind == toml_array) text = 'an empty list'
  end function description_of_list

  !> A list [lowest, highest] in ascending order.
  subroutine take_range(source, path, bounds, range, required)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bounds_t), intent(in) :: bounds
    real(wp), intent(inout) :: range(2)
    logical, intent(in), optional :: required
    real(wp), allocatable :: values(:)
    integer :: problems
    values = range
    problems = size(source%problems)
    call take_reals(source, path, bounds, values, required)
    if (size(source%problems) > problems) return
    if (size(values) /= 2) then
      call report(source, path, 'found '//to_text(size(values))//' numbers, allowed [lowest, highest]')
    else if (values(1) > values(2)) then
      call report(source, path, 'found '//to_text(values(1))//' before '//to_text(values(2))// &
                  ', allowed [lowest, highest]')
    else
      range = values
    end if
  end subroutine take_range

  !> An integer of at least `lowest` and at most `highest` (the largest integer if absent).
  subroutine take_integer(source, path, lowest, value, required, highest)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    integer, intent(in) :: lowest
    integer, intent(inout) :: value
    logical, intent(in), optional :: required
    integer, intent(in), optional :: highest
    integer :: at, limit
    limit = huge(value)
    if (present(highest)) limit = highest
    call look_up(source, path, required, at)
    if (at > 0) call convert(source, path, at, lowest, limit, value)
  end subroutine take_integer

  !> A list of exactly size(values) integers of at least `lowest`.
  subroutine take_integers(source, path, lowest, values)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    integer, intent(in) :: lowest
    integer, intent(inout) :: values(:)
    character(len=:), allocatable :: element
    integer :: at, i
    call look_up(source, path, at=at)
    if (at == 0) return
    if (list_size(source, path) /= size(values) .or. source%entries(at)%entry%kind /= toml_array) then
      call report(source, path, 'found '//description(source%entries(at)%entry)//' of '// &
                  to_text(list_size(source, path))//', allowed a list of '//to_text(size(values))//' integers')
      return
    end if
    do i = 1, size(values)
      element = path//'['//to_text(i)//']'
      at = find(source, element, at)
      call convert(source, element, at, lowest, huge(lowest), values(i))
    end do
  end subroutine take_integers

  subroutine convert(source, path, at, lowest, highest, value)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    integer, intent(in) :: at, lowest, highest
    integer, intent(inout) :: value
    associate (entry => source%entries(at)%entry)
      if (entry%kind == toml_integer .and. entry%integer >= lowest .and. entry%integer <= highest) then
        value = int(entry%integer)
      else
        call report(source, path, 'found '//description(entry)//', allowed an integer from '//to_text(lowest)// &
                    ' to '//to_text(highest))
      end if
    end associate
  end subroutine convert

  !> A text.
  subroutine take_text(source, path, value, required)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(inout) :: value
    logical, intent(in), optional :: required
    integer :: at
    call look_up(source, path, required, at)
    if (at == 0) return
    associate (entry => source%entries(at)%entry)
      if (entry%kind /= toml_string) then
        call report(source, path, 'found '//description(entry)//', allowed a text in quotes')
      else if (has_control_characters(entry%string)) then
        call report(source, path, 'found a control character, allowed a text without')
      else
        value = entry%string
      end if
    end associate
  end subroutine take_text

  !> Whether a text would end early in the file or spoil a terminal; tabs and ends of lines do neither.
  pure logical function has_control_characters(string)
    character(len=*), intent(in) :: string
    integer :: i
    has_control_characters = .true.
    do i = 1, len(string)
      if (any(iachar(string(i:i)) == [9, 10, 13])) cycle
      if (iachar(string(i:i)) < 32 .or. iachar(string(i:i)) == 127) return
    end do
    has_control_characters = .false.
  end function has_control_characters

  !> One of a few words, blank-padded.
  subroutine take_choice(source, path, words, value)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, words(:)
    ! The settings have several lengths.
    ! allow(C072)
    character(len=*), intent(inout) :: value
    integer :: at
    call look_up(source, path, at=at)
    if (at == 0) return
    associate (entry => source%entries(at)%entry)
      if (entry%kind == toml_string .and. any(words == entry%string)) then
        value = entry%string
      else
        call report(source, path, 'found '//description(entry)//', allowed '//join(words, ', '))
      end if
    end associate
  end subroutine take_choice

end module case_values
