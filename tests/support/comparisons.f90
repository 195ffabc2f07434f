! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The comparisons behind the assertions, on values converted to the widest kind and laid out in a
!> row. `form` is the shape of the arrays, empty for scalars.
module comparisons
  use, intrinsic :: iso_fortran_env, only: int64, real64
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use test_outcome, only: SourceLocation, record
  implicit none
  private

  public :: same_shape, compare, compare_relatively, compare_order, check_all, check_nan, check_finite

  interface compare
    module procedure compare_integers, compare_reals, compare_logicals, compare_strings
  end interface compare

  interface compare_order
    module procedure order_integers, order_reals
  end interface compare_order

contains

  !> Whether two arrays can be compared; a failed assertion if not.
  logical function same_shape(expected, found, message, location)
    integer, intent(in) :: expected(:), found(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    same_shape = size(expected) == size(found)
    if (same_shape) same_shape = all(expected == found)
    if (.not. same_shape) then
      call record(.false., 'expected shape '//shape_text(expected)//', found '//shape_text(found), message, location)
    end if
  end function same_shape

  subroutine compare_integers(expected, found, form, message, location)
    integer(int64), intent(in) :: expected(:), found(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    i = findloc(expected == found, .false., dim=1)
    if (i == 0) then
      call record(.true., '')
    else
      call record(.false., differs(text_of_integer(expected(i)), text_of_integer(found(i)), i, form), message, location)
    end if
  end subroutine compare_integers

  !> |found - expected| <= tolerance. Equal infinities are equal, NaN equals nothing.
  subroutine compare_reals(expected, found, form, tolerance, message, location)
    real(real64), intent(in) :: expected(:), found(:), tolerance
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    call compare_within(expected, found, form, spread(tolerance, 1, size(found)), message, location)
  end subroutine compare_reals

  !> |found - expected| <= tolerance |expected|.
  subroutine compare_relatively(expected, found, form, tolerance, message, location)
    real(real64), intent(in) :: expected(:), found(:), tolerance
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    call compare_within(expected, found, form, tolerance*abs(expected), message, location)
  end subroutine compare_relatively

  subroutine compare_within(expected, found, form, allowed, message, location)
    real(real64), intent(in) :: expected(:), found(:), allowed(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    character(len=:), allocatable :: what
    do i = 1, size(found)
      if (expected(i) == found(i)) cycle
      if (ieee_is_finite(expected(i)) .and. ieee_is_finite(found(i))) then
        if (abs(found(i) - expected(i)) <= allowed(i)) cycle
      end if
      what = differs(text_of_real(expected(i)), text_of_real(found(i)), i, form)
      if (ieee_is_finite(expected(i)) .and. ieee_is_finite(found(i))) then
        what = what//', difference '//short_text(abs(found(i) - expected(i)))//', allowed '//short_text(allowed(i))
      end if
      call record(.false., what, message, location)
      return
    end do
    call record(.true., '')
  end subroutine compare_within

  subroutine compare_logicals(expected, found, form, message, location)
    logical, intent(in) :: expected(:), found(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    i = findloc(expected .eqv. found, .false., dim=1)
    if (i == 0) then
      call record(.true., '')
    else
      call record(.false., differs(truth(expected(i)), truth(found(i)), i, form), message, location)
    end if
  end subroutine compare_logicals

  subroutine compare_strings(expected, found, form, message, location)
    character(len=*), intent(in) :: expected(:), found(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    do i = 1, size(found)
      if (expected(i) == found(i)) cycle
      call record(.false., differs('"'//trim(expected(i))//'"', '"'//trim(found(i))//'"', i, form), message, location)
      return
    end do
    call record(.true., '')
  end subroutine compare_strings

  !> a `relation` b, where relation is one of <, <=, >, >=.
  subroutine order_integers(a, b, form, relation, message, location)
    integer(int64), intent(in) :: a(:), b(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in) :: relation
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    do i = 1, size(a)
      if (ordered(a(i) < b(i), a(i) == b(i), a(i) > b(i), relation)) cycle
      call record(.false., not_ordered(text_of_integer(a(i)), relation, text_of_integer(b(i)), i, form), message, location)
      return
    end do
    call record(.true., '')
  end subroutine order_integers

  subroutine order_reals(a, b, form, relation, message, location)
    real(real64), intent(in) :: a(:), b(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in) :: relation
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    do i = 1, size(a)
      if (ordered(a(i) < b(i), a(i) == b(i), a(i) > b(i), relation)) cycle
      call record(.false., not_ordered(text_of_real(a(i)), relation, text_of_real(b(i)), i, form), message, location)
      return
    end do
    call record(.true., '')
  end subroutine order_reals

  !> Every condition has the value wanted.
  subroutine check_all(wanted, conditions, form, message, location)
    logical, intent(in) :: wanted, conditions(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    call compare_logicals(spread(wanted, 1, size(conditions)), conditions, form, message, location)
  end subroutine check_all

  subroutine check_nan(values, form, message, location)
    real(real64), intent(in) :: values(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    call check_kind(ieee_is_nan(values), 'NaN', values, form, message, location)
  end subroutine check_nan

  subroutine check_finite(values, form, message, location)
    real(real64), intent(in) :: values(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    call check_kind(ieee_is_finite(values), 'a finite number', values, form, message, location)
  end subroutine check_finite

  subroutine check_kind(holds, wanted, values, form, message, location)
    logical, intent(in) :: holds(:)
    character(len=*), intent(in) :: wanted
    real(real64), intent(in) :: values(:)
    integer, intent(in) :: form(:)
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    integer :: i
    i = findloc(holds, .false., dim=1)
    if (i == 0) then
      call record(.true., '')
    else
      call record(.false., differs(wanted, text_of_real(values(i)), i, form), message, location)
    end if
  end subroutine check_kind

  pure logical function ordered(less, equal, greater, relation)
    logical, intent(in) :: less, equal, greater
    character(len=*), intent(in) :: relation
    select case (relation)
    case ('<')
      ordered = less
    case ('<=')
      ordered = less .or. equal
    case ('>')
      ordered = greater
    case default
      ordered = greater .or. equal
    end select
  end function ordered

  pure function differs(expected, found, i, form) result(text)
    character(len=*), intent(in) :: expected, found
    integer, intent(in) :: i, form(:)
    character(len=:), allocatable :: text
    text = 'expected '//expected//', found '//found//position(i, form)
  end function differs

  pure function not_ordered(a, relation, b, i, form) result(text)
    character(len=*), intent(in) :: a, relation, b
    integer, intent(in) :: i, form(:)
    character(len=:), allocatable :: text
    text = 'expected '//a//' '//relation//' '//b//position(i, form)
  end function not_ordered

  !> ' at (i,j)' for element number i of an array of this shape, nothing for a scalar.
  pure function position(i, form) result(text)
    integer, intent(in) :: i, form(:)
    character(len=:), allocatable :: text
    integer :: rest, d, subscripts(size(form))
    text = ''
    if (size(form) == 0) return
    rest = i - 1
    do d = 1, size(form)
      subscripts(d) = mod(rest, form(d)) + 1
      rest = rest/form(d)
    end do
    text = ' at '//shape_text(subscripts)
  end function position

  pure function shape_text(form) result(text)
    integer, intent(in) :: form(:)
    character(len=:), allocatable :: text
    integer :: d
    text = '('
    do d = 1, size(form)
      if (d > 1) text = text//','
      text = text//text_of_integer(int(form(d), int64))
    end do
    text = text//')'
  end function shape_text

  pure function text_of_integer(value) result(text)
    integer(int64), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function text_of_integer

  pure function text_of_real(value) result(text)
    real(real64), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=32) :: buffer
    write (buffer, '(es24.16e3)') value
    text = trim(adjustl(buffer))
  end function text_of_real

  pure function short_text(value) result(text)
    real(real64), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=16) :: buffer
    write (buffer, '(es10.2e3)') value
    text = trim(adjustl(buffer))
  end function short_text

  pure function truth(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    text = trim(merge('true ', 'false', value))
  end function truth

end module comparisons
