! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Units composed of others by products, quotients and whole powers: 'N/m^3', 'kN s^2/m^2', '1/s'; also 'rpm'.
module composed_units
  use constants, only: two_pi
  use kinds, only: wp
  use text, only: join, replace_all, to_text
  implicit none
  private

  public :: read_unit, unit_in_ascii, known_units

  !> Exponents of m, kg, s, A and K.
  integer, parameter, public :: base_count = 5

  type, public :: composed_unit_t
    !> The same in SI units.
    character(len=:), allocatable :: si
    !> SI value = number*multiplier/divisor. Dividing by powers of ten keeps "12.5 mm" equal to 0.0125 to the bit.
    real(wp) :: multiplier = 1, divisor = 1
    integer :: exponents(base_count) = 0
    !> Powers of an angle and of Hz, which count as pure numbers and 1/s in the exponents.
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
    integer :: at, length, power
    logical :: below
    text = unit_in_ascii(spelling)
    unit%si = ''
    at = 1
    column = 0
    below = .false.
    if (text == ' rpm' .or. text == 'rpm') then
      ! Alone: a product with a quotient would be ambiguous.
      unit = composed_unit_t('rad/s', two_pi, 60.0_wp, [0, 0, -1, 0, 0], 1)
      return
    end if
    do
      do while (at <= len(text))
        if (text(at:at) /= ' ') exit
        at = at + 1
      end do
      length = scan(text(at:)//' ', ' */') - 1
      column = at
      if (length < 1) return
      factor = text(at:at + length - 1)
      call read_factor(factor, below, unit, power)
      if (power == 0) return
      at = at + length
      do while (at <= len(text))
        if (text(at:at) /= ' ') exit
        at = at + 1
      end do
      if (at > len(text)) exit
      below = text(at:at) == '/'
      if (below .or. text(at:at) == '*') at = at + 1
    end do
    column = 0
    if (len(unit%si) == 0) unit%si = '1'
    if (unit%si(1:1) == '/') unit%si = '1'//unit%si
  end subroutine read_unit

  !> One factor with its exponent; `power` is 0 if it is not known.
  pure subroutine read_factor(text, below, unit, power)
    character(len=*), intent(in) :: text
    logical, intent(in) :: below
    type(composed_unit_t), intent(inout) :: unit
    integer, intent(out) :: power
    type(symbol_t) :: symbol
    character(len=:), allocatable :: shown
    integer :: mark, status, i
    mark = index(text, '^')
    power = 1
    if (mark == 0) mark = len(text) + 1
    if (mark < len(text)) then
      read (text(mark + 1:), *, iostat=status) power
      if (status /= 0 .or. verify(text(mark + 1:), '-0123456789') > 0) power = 0
      if (abs(power) > largest_exponent) power = 0
    else if (mark == len(text)) then
      power = 0
    end if
    if (power == 0) return
    call find_symbol(text(:mark - 1), symbol)
    if (len_trim(symbol%spelling) == 0) then
      power = 0
      return
    end if
    shown = trim(symbol%si)
    if (power /= 1) shown = shown//'^'//to_text(power)
    if (below) then
      unit%si = unit%si//'/'//shown
      power = -power
    else if (symbol%si /= '1') then
      if (len(unit%si) > 0) unit%si = unit%si//' '
      unit%si = unit%si//shown
    end if
    do i = 1, abs(power)
      if (power > 0) then
        unit%multiplier = unit%multiplier*symbol%multiplier
        unit%divisor = unit%divisor*symbol%divisor
      else
        unit%multiplier = unit%multiplier*symbol%divisor
        unit%divisor = unit%divisor*symbol%multiplier
      end if
    end do
    unit%exponents = unit%exponents + power*symbol%exponents
    if (symbol%si == 'rad') unit%angle = unit%angle + power
    if (symbol%si == 'Hz') unit%hertz = unit%hertz + power
  end subroutine read_factor

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
