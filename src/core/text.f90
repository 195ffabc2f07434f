! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Numbers to text and small string helpers.
module text
  use kinds, only: int32, int64, real64
  implicit none
  private

  public :: to_text, interval_text, read_number, parse_number, parse_integer, split, join, number_length, replace_all, &
    starts_with, number_in

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
    if (present(digits)) then
      first = digits
    else
      ! What 15 digits do not give, no fewer do.
      text = with_digits(value, 15)
      call read_number(text, back, status)
      if (status == 0 .and. abs(back - value) > 0) first = 16
    end if
    do count = first, 17
      text = with_digits(value, count)
      if (present(digits)) return
      call read_number(text, back, status)
      if (status == 0 .and. back == value) return
    end do
  end function real_to_text

  !> Both ends of an interval, to a tenth of its width or six digits.
  pure function interval_text(interval, between) result(text)
    real(real64), intent(in) :: interval(2)
    character(len=*), intent(in) :: between
    character(len=:), allocatable :: text
    real(real64) :: largest, width
    integer :: digits
    largest = max(maxval(abs(interval)), tiny(largest))
    width = max(abs(interval(2) - interval(1)), epsilon(largest)*largest)
    digits = min(17, max(6, 2 + ceiling(log10(largest/width))))
    text = to_text(interval(1), digits)//between//to_text(interval(2), digits)
  end function interval_text

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

  !> Reads a number by Fortran's list-directed rules; `status` is 0 if it is one. One that is too large is infinite, also
  !> where the program stops at an overflow.
  pure subroutine read_number(text, value, status)
    ! Here and not above: gfortran 12 gives the halting mode back only where the procedure itself uses the module.
    use, intrinsic :: ieee_exceptions, only: ieee_set_flag, ieee_set_halting_mode, ieee_usual
    character(len=*), intent(in) :: text
    real(real64), intent(out) :: value
    integer, intent(out) :: status
    call ieee_set_halting_mode(ieee_usual, .false.)
    value = 0
    read (text, *, iostat=status) value
    if (status /= 0) value = 0
    ! With a flag up the return to the halting mode of before would stop the program.
    call ieee_set_flag(ieee_usual, .false.)
  end subroutine read_number

  !> Reads a word of a user that is one finite number and nothing else: decimal digits with a point, and an exponent behind E or,
  !> of Fortran programs, D. A list-directed read takes more: '2,75' as 2, '/' as the number before, '2*5', '1-5' and 'inf'.
  pure subroutine parse_number(word, value, status)
    character(len=*), intent(in) :: word
    real(real64), intent(out) :: value
    integer, intent(out) :: status
    character(len=len(word)) :: plain
    integer :: exponent
    value = 0
    status = 1
    if (len(word) == 0) return
    plain = word
    exponent = scan(plain, 'dD')
    if (exponent > 0) plain(exponent:exponent) = 'e'
    if (number_length(plain) /= len(word)) return
    call read_number(plain, value, status)
    if (status == 0 .and. abs(value) <= huge(value)) return
    value = 0
    status = 1
  end subroutine parse_number

  !> Reads a word of a user that is one whole number and nothing else.
  pure subroutine parse_integer(word, value, status)
    character(len=*), intent(in) :: word
    integer, intent(out) :: value
    integer, intent(out) :: status
    integer :: first
    value = 0
    status = 1
    first = 1
    if (len(word) > 1) first = 1 + min(1, scan(word(1:1), '+-'))
    if (len(word) == 0 .or. verify(word(first:), '0123456789') > 0) return
    read (word, *, iostat=status) value
    if (status /= 0) value = 0
  end subroutine parse_integer

  !> The words of a line between blanks and tabs: the first ones in `words`, `count` of them in all.
  pure subroutine split(line, words, count)
    character(len=*), intent(in) :: line
    ! The caller knows how long words are.
    ! allow(C072)
    character(len=*), intent(out) :: words(:)
    integer, intent(out) :: count
    character(len=*), parameter :: gaps = ' '//achar(9)
    integer :: from, length
    words = ''
    count = 0
    from = 1
    do
      length = verify(line(from:), gaps)
      if (length == 0) exit
      from = from + length - 1
      length = scan(line(from:)//' ', gaps) - 1
      count = count + 1
      if (count <= size(words)) words(count) = line(from:from + length - 1)
      from = from + length
    end do
  end subroutine split

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

  !> Length of the decimal number at the beginning of a text ('-1.5e3', '.5', '2.'), 0 if there is none. What is no
  !> number to the eye is none here, although a list-directed read takes it: '1-5', '1d5', '2*3', 'inf'.
  pure integer function number_length(string)
    character(len=*), intent(in) :: string
    character(len=:), allocatable :: padded
    integer :: at, whole, fraction, mark
    padded = string//'   '
    at = 1
    if (scan(padded(1:1), '+-') == 1) at = 2
    whole = digits_in(padded(at:))
    at = at + whole
    fraction = 0
    if (padded(at:at) == '.') then
      fraction = digits_in(padded(at + 1:))
      at = at + 1 + fraction
    end if
    number_length = 0
    if (whole + fraction == 0) return
    number_length = at - 1
    if (scan(padded(at:at), 'eE') == 0) return
    mark = at + 1
    if (scan(padded(mark:mark), '+-') == 1) mark = mark + 1
    if (digits_in(padded(mark:)) > 0) number_length = mark - 1 + digits_in(padded(mark:))
  end function number_length

  !> Number of digits at the beginning of a text that ends with a blank.
  pure integer function digits_in(string)
    character(len=*), intent(in) :: string
    digits_in = verify(string, '0123456789') - 1
  end function digits_in

  !> Number of a name in a list, 0 if it is not there. The names are compared first: `findloc` of gfortran 12 finds no text among
  !> elements of another length.
  pure integer function number_in(names, name) result(number)
    character(len=*), intent(in) :: names(:), name
    logical :: has_first
    has_first = len(names) > 0 .and. len(name) > 0
    do number = 1, size(names)
      ! Most names differ at once.
      if (has_first) then
        if (names(number)(1:1) /= name(1:1)) cycle
      end if
      if (names(number) == name) return
    end do
    number = 0
  end function number_in

end module text
