! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Units composed of others by products, quotients and powers, whole or half: 'N/m^3', 'kN s^2/m^2', 'N/(m s)', 'N/m^1.5'; also
!> 'rpm'.
module composed_units
  use constants, only: two_pi
  use kinds, only: wp
  use text, only: join, parse_number, replace_all, to_text
  implicit none
  private

  public :: read_unit, unit_in_ascii, known_units

  !> Number of base units: m, kg, s, A and K.
  integer, parameter, public :: base_count = 5

  type, public :: composed_unit_t
    !> The same in SI units.
    character(len=:), allocatable :: si
    !> SI value = number*multiplier/divisor. Dividing by powers of ten keeps "12.5 mm" equal to 0.0125 to the bit.
    real(wp) :: multiplier = 1, divisor = 1
    !> Twice the exponents of the base units.
    integer :: exponents(base_count) = 0
    !> Twice the powers of an angle and of Hz, which count as pure numbers and 1/s in the exponents.
    integer :: angle = 0, hertz = 0
  end type composed_unit_t

  type :: symbol_t
    character(len=4) :: spelling, si
    real(wp) :: multiplier, divisor
    integer :: exponents(base_count)
    !> It may have a prefix such as k.
    logical :: scales = .true.
  end type symbol_t

  real(wp), parameter :: one = 1
  type(symbol_t), parameter :: symbols(*) = [ &
    symbol_t('1', '1', one, one, [0, 0, 0, 0, 0], .false.), symbol_t('%', '1', one, 1e2_wp, [0, 0, 0, 0, 0], .false.), &
    symbol_t('m', 'm', one, one, [1, 0, 0, 0, 0]), symbol_t('kg', 'kg', one, one, [0, 1, 0, 0, 0], .false.), &
    symbol_t('g', 'kg', one, 1e3_wp, [0, 1, 0, 0, 0]), symbol_t('t', 'kg', 1e3_wp, one, [0, 1, 0, 0, 0], .false.), &
    symbol_t('s', 's', one, one, [0, 0, 1, 0, 0]), symbol_t('min', 's', 60.0_wp, one, [0, 0, 1, 0, 0], .false.), &
    symbol_t('h', 's', 3600.0_wp, one, [0, 0, 1, 0, 0], .false.), symbol_t('A', 'A', one, one, [0, 0, 0, 1, 0]), &
    symbol_t('K', 'K', one, one, [0, 0, 0, 0, 1]), symbol_t('N', 'N', one, one, [1, 1, -2, 0, 0]), &
    symbol_t('Pa', 'Pa', one, one, [-1, 1, -2, 0, 0]), symbol_t('bar', 'Pa', 1e5_wp, one, [-1, 1, -2, 0, 0], .false.), &
    symbol_t('J', 'J', one, one, [2, 1, -2, 0, 0]), symbol_t('W', 'W', one, one, [2, 1, -3, 0, 0]), &
    symbol_t('V', 'V', one, one, [2, 1, -3, -1, 0]), symbol_t('ohm', 'ohm', one, one, [2, 1, -3, -2, 0]), &
    symbol_t('H', 'H', one, one, [2, 1, -2, -2, 0]), symbol_t('F', 'F', one, one, [-2, -1, 4, 2, 0]), &
    symbol_t('C', 'C', one, one, [0, 0, 1, 1, 0]), symbol_t('Hz', 'Hz', one, one, [0, 0, -1, 0, 0]), &
    symbol_t('l', 'm^3', one, 1e3_wp, [3, 0, 0, 0, 0], .false.), symbol_t('rad', 'rad', one, one, [0, 0, 0, 0, 0]), &
    symbol_t('deg', 'rad', two_pi, 360.0_wp, [0, 0, 0, 0, 0], .false.), &
    symbol_t('turn', 'rad', two_pi, one, [0, 0, 0, 0, 0], .false.)]

  character(len=1), parameter :: prefixes(7) = ['n', 'u', 'm', 'c', 'k', 'M', 'G']
  real(wp), parameter :: enlarges(7) = [one, one, one, one, 1e3_wp, 1e6_wp, 1e9_wp], &
    divides(7) = [1e9_wp, 1e6_wp, 1e3_wp, 1e2_wp, one, one, one]
  integer, parameter :: largest_exponent = 9

  !> Signs beyond ASCII, as bytes of UTF-8, and what they stand for.
  character(len=1), parameter :: c2 = char(194), ce = char(206)
  character(len=3), parameter :: signs(*) = [character(len=3) :: ce//char(169), char(226)//char(132)//char(166), 'Ohm', &
                                             c2//char(181), ce//char(188), c2//char(178), c2//char(179), c2//char(176)]
  character(len=3), parameter :: stand_for(*) = [character(len=3) :: 'ohm', 'ohm', 'ohm', 'u', 'u', '^2', '^3', 'deg']
  character(len=2), parameter :: raised_point = c2//char(183)

contains

  !> The unit that `spelling` stands for. `column`: where it is not understood, 0 if it is.
  pure subroutine read_unit(spelling, unit, column)
    character(len=*), intent(in) :: spelling
    type(composed_unit_t), intent(out) :: unit
    integer, intent(out) :: column
    character(len=:), allocatable :: factor, text
    integer :: at, length, halves
    logical :: below, in_parentheses
    text = unit_in_ascii(spelling)
    unit%si = ''
    at = 1
    column = 0
    below = .false.
    in_parentheses = .false.
    if (text == ' rpm' .or. text == 'rpm') then
      ! Alone: a product with a quotient would be ambiguous.
      unit = composed_unit_t('rad/s', two_pi, 60.0_wp, [0, 0, -2, 0, 0], 2)
      return
    end if
    do
      call skip_blanks(text, at)
      if (below .and. .not. in_parentheses .and. text(at:min(at, len(text))) == '(') then
        in_parentheses = .true.
        at = at + 1
        call skip_blanks(text, at)
      end if
      length = scan(text(at:)//' ', ' */()') - 1
      column = at
      if (length < 1) return
      factor = text(at:at + length - 1)
      call read_factor(factor, below, unit, halves)
      if (halves == 0) return
      at = at + length
      call skip_blanks(text, at)
      if (in_parentheses .and. text(at:min(at, len(text))) == ')') then
        in_parentheses = .false.
        at = at + 1
        call skip_blanks(text, at)
      end if
      if (at > len(text)) exit
      column = at
      if (in_parentheses .and. text(at:at) == '/') return
      if (.not. in_parentheses) below = text(at:at) == '/'
      if (scan(text(at:at), '/*') > 0) at = at + 1
    end do
    column = at
    if (in_parentheses) return
    column = 0
    if (len(unit%si) == 0) unit%si = '1'
    if (unit%si(1:1) == '/') unit%si = '1'//unit%si
  end subroutine read_unit

  pure subroutine skip_blanks(text, at)
    character(len=*), intent(in) :: text
    integer, intent(inout) :: at
    do while (at <= len(text))
      if (text(at:at) /= ' ') exit
      at = at + 1
    end do
  end subroutine skip_blanks

  !> One factor with twice its exponent, `halves`, which is 0 if it is not known.
  pure subroutine read_factor(text, below, unit, halves)
    character(len=*), intent(in) :: text
    logical, intent(in) :: below
    type(composed_unit_t), intent(inout) :: unit
    integer, intent(out) :: halves
    type(symbol_t) :: symbol
    character(len=:), allocatable :: shown
    integer :: mark
    mark = index(text//'^', '^')
    call read_exponent(text(mark:), halves)
    if (halves == 0) return
    call find_symbol(text(:mark - 1), symbol)
    if (len_trim(symbol%spelling) == 0) then
      halves = 0
      return
    end if
    shown = trim(symbol%si)
    if (modulo(halves, 2) /= 0) then
      shown = shown//'^'//to_text(real(halves, kind(1.0d0))/2)
    else if (halves /= 2) then
      shown = shown//'^'//to_text(halves/2)
    end if
    if (below) then
      unit%si = unit%si//'/'//shown
      halves = -halves
    else if (symbol%si /= '1') then
      if (len(unit%si) > 0) unit%si = unit%si//' '
      unit%si = unit%si//shown
    end if
    call multiply(unit, symbol, halves)
  end subroutine read_factor

  !> Twice the exponent that `text` states, '^2' or '^1.5'; 0 if that is none. Without a text it is 1.
  pure subroutine read_exponent(text, halves)
    character(len=*), intent(in) :: text
    integer, intent(out) :: halves
    real(kind(1.0d0)) :: power
    integer :: status
    halves = 2
    if (len(text) == 0) return
    halves = 0
    if (len(text) == 1 .or. verify(text, '^-.0123456789') > 0) return
    call parse_number(text(2:), power, status)
    if (status /= 0) return
    if (abs(power) <= largest_exponent .and. .not. abs(2*power - anint(2*power)) > 0) halves = nint(2*power)
  end subroutine read_exponent

  pure subroutine multiply(unit, symbol, halves)
    type(composed_unit_t), intent(inout) :: unit
    type(symbol_t), intent(in) :: symbol
    integer, intent(in) :: halves
    real(wp) :: above, under
    integer :: i
    above = merge(symbol%multiplier, symbol%divisor, halves > 0)
    under = merge(symbol%divisor, symbol%multiplier, halves > 0)
    do i = 1, abs(halves)/2
      unit%multiplier = unit%multiplier*above
      unit%divisor = unit%divisor*under
    end do
    if (modulo(halves, 2) /= 0) then
      unit%multiplier = unit%multiplier*sqrt(above)
      unit%divisor = unit%divisor*sqrt(under)
    end if
    unit%exponents = unit%exponents + halves*symbol%exponents
    if (symbol%si == 'rad') unit%angle = unit%angle + halves
    if (symbol%si == 'Hz') unit%hertz = unit%hertz + halves
  end subroutine multiply

  !> A symbol, perhaps with a prefix; blank if there is none of the name.
  pure subroutine find_symbol(name, symbol)
    character(len=*), intent(in) :: name
    type(symbol_t), intent(out) :: symbol
    integer :: i, k
    symbol = symbol_t('', '', one, one, [0, 0, 0, 0, 0])
    i = findloc(symbols%spelling == name, .true., dim=1)
    if (i > 0) then
      symbol = symbols(i)
    else if (len(name) > 1) then
      k = findloc(prefixes == name(1:1), .true., dim=1)
      i = findloc(symbols%spelling == name(2:) .and. symbols%scales, .true., dim=1)
      if (i == 0 .or. k == 0) return
      symbol = symbols(i)
      symbol%multiplier = symbol%multiplier*enlarges(k)
      symbol%divisor = symbol%divisor*divides(k)
    end if
  end subroutine find_symbol

  !> A unit in the letters of ASCII: 'ohm' for both Greek signs, 'u' for both signs of micro, '^2', '^3', 'deg', a blank for a
  !> raised point.
  pure function unit_in_ascii(text) result(plain)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: plain
    integer :: i
    plain = text
    do i = 1, size(signs)
      if (index(plain, trim(signs(i))) > 0) plain = replace_all(plain, trim(signs(i)), trim(stand_for(i)))
    end do
    ! trim leaves nothing of a blank
    plain = replace_all(plain, raised_point, ' ')
  end function unit_in_ascii

  !> The symbols and prefixes, for messages.
  pure function known_units() result(text)
    character(len=:), allocatable :: text
    text = 'a unit such as kN s/m, composed of '//join(symbols(2:)%spelling, ', ')//'; prefixes: '//join(prefixes, ', ')
  end function known_units

end module composed_units
