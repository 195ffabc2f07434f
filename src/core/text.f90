! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Numbers to text and small string helpers.
module text
  use kinds, only: int32, int64, real64
  implicit none
  private

  public :: to_text, join, lower_case, replace_all, starts_with

  !> Shortest common form of a number: integers plain, reals with up to 17 significant digits so
  !> that reading them back gives the same bits.
  interface to_text
    module procedure integer_to_text, long_to_text, real_to_text, logical_to_text
  end interface to_text

contains

  pure function integer_to_text(value) result(text)
    integer(int32), intent(in) :: value
    character(len=:), allocatable :: text
    text = long_to_text(int(value, int64))
  end function integer_to_text

  pure function long_to_text(value) result(text)
    integer(int64), intent(in) :: value
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    write (buffer, '(i0)') value
    text = trim(buffer)
  end function long_to_text

  !> Digits are added until the text reads back to the same bits; `digits` fixes their number.
  pure function real_to_text(value, digits) result(text)
    real(real64), intent(in) :: value
    integer, intent(in), optional :: digits
    character(len=:), allocatable :: text
    integer :: count, status, first
    real(real64) :: back
    if (value /= value) then
      text = 'nan'
      return
    else if (abs(value) > huge(value)) then
      text = merge('inf ', '-inf', value > 0)
      text = trim(text)
      return
    end if
    first = 1
    if (present(digits)) first = digits
    do count = first, 17
      text = with_digits(value, count)
      if (present(digits)) return
      read (text, *, iostat=status) back
      if (status == 0 .and. back == value) return
    end do
  end function real_to_text

  pure function with_digits(value, digits) result(text)
    real(real64), intent(in) :: value
    integer, intent(in) :: digits
    character(len=:), allocatable :: text
    character(len=40) :: buffer, form
    integer :: exponent, mark
    if (value == 0) then
      text = trim(adjustl(merge('-0.0', ' 0.0', sign(1.0_real64, value) < 0)))
      return
    end if
    write (form, '(a,i0,a,i0,a)') '(es', digits + 10, '.', max(digits - 1, 0), 'e3)'
    write (buffer, form) value
    buffer = adjustl(buffer)
    mark = index(buffer, 'E')
    read (buffer(mark + 1:), *) exponent
    if (exponent >= -5 .and. exponent <= 15) then
      write (form, '(a,i0,a)') '(f40.', max(digits - 1 - exponent, 1), ')'
      write (buffer, form) value
      text = trim(adjustl(buffer))
      if (text(1:1) == '.') text = '0'//text
      if (len(text) > 1) then
        if (text(1:2) == '-.') text = '-0'//text(2:)
      end if
    else
      text = buffer(1:mark - 1)
      if (text(len(text):) == '.') text = text//'0'
      text = text//'e'//integer_to_text(exponent)
    end if
  end function with_digits

  pure function logical_to_text(value) result(text)
    logical, intent(in) :: value
    character(len=:), allocatable :: text
    text = trim(merge('true ', 'false', value))
  end function logical_to_text

  !> The trimmed words with `separator` between them.
  pure function join(words, separator) result(text)
    character(len=*), intent(in) :: words(:)
    character(len=*), intent(in) :: separator
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, size(words)
      if (i > 1) text = text//separator
      text = text//trim(words(i))
    end do
  end function join

  !> ASCII letters in lower case.
  pure function lower_case(string) result(text)
    character(len=*), intent(in) :: string
    character(len=len(string)) :: text
    integer :: i, code
    do i = 1, len(string)
      code = iachar(string(i:i))
      if (code >= iachar('A') .and. code <= iachar('Z')) code = code + 32
      text(i:i) = achar(code)
    end do
  end function lower_case

  !> Every `old` in `string` replaced by `new`.
  pure function replace_all(string, old, new) result(text)
    character(len=*), intent(in) :: string, old, new
    character(len=:), allocatable :: text
    integer :: from, found
    text = ''
    from = 1
    do
      found = index(string(from:), old)
      if (found == 0 .or. len(old) == 0) exit
      text = text//string(from:from + found - 2)//new
      from = from + found - 1 + len(old)
    end do
    text = text//string(from:)
  end function replace_all

  !> Whether `string` begins with `prefix`.
  pure logical function starts_with(string, prefix)
    character(len=*), intent(in) :: string, prefix
    starts_with = len(string) >= len(prefix)
    if (starts_with) starts_with = string(1:len(prefix)) == prefix
  end function starts_with

end module text
