! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Quantities with units: "12.5 mm" becomes 0.0125 m.
module units
  use composed_units, only: composed_unit_t, read_unit, unit_in_ascii
  use constants, only: pi
  use kinds, only: wp
  use text, only: join, number_length, read_number, replace_all
  implicit none
  private

  public :: read_quantity, allowed_units

  !> A spelling of a unit: SI value = number*multiplier/divisor. Dividing by a power of ten keeps
  !> "12.5 mm" equal to 0.0125 to the bit.
  type :: unit_row_t
    character(len=10) :: spelling
    !> The SI unit that names the dimension.
    character(len=9) :: si
    real(wp) :: multiplier, divisor
  end type unit_row_t

  type(unit_row_t), parameter :: rows(69) = [ &
    unit_row_t('m', 'm', 1.0_wp, 1.0_wp), &
    unit_row_t('mm', 'm', 1.0_wp, 1e3_wp), &
    unit_row_t('cm', 'm', 1.0_wp, 1e2_wp), &
    unit_row_t('um', 'm', 1.0_wp, 1e6_wp), &
    unit_row_t('km', 'm', 1e3_wp, 1.0_wp), &
    unit_row_t('m/s', 'm/s', 1.0_wp, 1.0_wp), &
    unit_row_t('mm/s', 'm/s', 1.0_wp, 1e3_wp), &
    unit_row_t('cm/s', 'm/s', 1.0_wp, 1e2_wp), &
    unit_row_t('km/h', 'm/s', 1.0_wp, 3.6_wp), &
    unit_row_t('m/s^2', 'm/s^2', 1.0_wp, 1.0_wp), &
    unit_row_t('mm/s^2', 'm/s^2', 1.0_wp, 1e3_wp), &
    unit_row_t('cm/s^2', 'm/s^2', 1.0_wp, 1e2_wp), &
    unit_row_t('rad', 'rad', 1.0_wp, 1.0_wp), &
    unit_row_t('mrad', 'rad', 1.0_wp, 1e3_wp), &
    unit_row_t('deg', 'rad', pi, 180.0_wp), &
    unit_row_t('turn', 'rad', 2*pi, 1.0_wp), &
    unit_row_t('rad/s', 'rad/s', 1.0_wp, 1.0_wp), &
    unit_row_t('Hz', 'rad/s', 2*pi, 1.0_wp), &
    unit_row_t('Hz', 'Hz', 1.0_wp, 1.0_wp), &
    unit_row_t('kHz', 'Hz', 1e3_wp, 1.0_wp), &
    unit_row_t('s', 's', 1.0_wp, 1.0_wp), &
    unit_row_t('ms', 's', 1.0_wp, 1e3_wp), &
    unit_row_t('us', 's', 1.0_wp, 1e6_wp), &
    unit_row_t('min', 's', 60.0_wp, 1.0_wp), &
    unit_row_t('h', 's', 3600.0_wp, 1.0_wp), &
    unit_row_t('kg', 'kg', 1.0_wp, 1.0_wp), &
    unit_row_t('g', 'kg', 1.0_wp, 1e3_wp), &
    unit_row_t('mg', 'kg', 1.0_wp, 1e6_wp), &
    unit_row_t('t', 'kg', 1e3_wp, 1.0_wp), &
    unit_row_t('N/m', 'N/m', 1.0_wp, 1.0_wp), &
    unit_row_t('N/mm', 'N/m', 1e3_wp, 1.0_wp), &
    unit_row_t('kN/m', 'N/m', 1e3_wp, 1.0_wp), &
    unit_row_t('mN/m', 'N/m', 1.0_wp, 1e3_wp), &
    unit_row_t('MN/m', 'N/m', 1e6_wp, 1.0_wp), &
    unit_row_t('N s/m', 'N s/m', 1.0_wp, 1.0_wp), &
    unit_row_t('Ns/m', 'N s/m', 1.0_wp, 1.0_wp), &
    unit_row_t('N s/mm', 'N s/m', 1e3_wp, 1.0_wp), &
    unit_row_t('kN s/m', 'N s/m', 1e3_wp, 1.0_wp), &
    unit_row_t('mN s/m', 'N s/m', 1.0_wp, 1e3_wp), &
    unit_row_t('kg/s', 'N s/m', 1.0_wp, 1.0_wp), &
    unit_row_t('N', 'N', 1.0_wp, 1.0_wp), &
    unit_row_t('mN', 'N', 1.0_wp, 1e3_wp), &
    unit_row_t('kN', 'N', 1e3_wp, 1.0_wp), &
    unit_row_t('MN', 'N', 1e6_wp, 1.0_wp), &
    unit_row_t('rpm', 'rad/s', 2*pi, 60.0_wp), &
    unit_row_t('N m', 'N m', 1.0_wp, 1.0_wp), &
    unit_row_t('mN m', 'N m', 1.0_wp, 1e3_wp), &
    unit_row_t('kN m', 'N m', 1e3_wp, 1.0_wp), &
    unit_row_t('deg/s', 'rad/s', pi, 180.0_wp), &
    unit_row_t('mrad/s', 'rad/s', 1.0_wp, 1e3_wp), &
    unit_row_t('N m/rad', 'N m/rad', 1.0_wp, 1.0_wp), &
    unit_row_t('mN m/rad', 'N m/rad', 1.0_wp, 1e3_wp), &
    unit_row_t('kN m/rad', 'N m/rad', 1e3_wp, 1.0_wp), &
    unit_row_t('N m/deg', 'N m/rad', 180.0_wp, pi), &
    unit_row_t('N m s/rad', 'N m s/rad', 1.0_wp, 1.0_wp), &
    unit_row_t('kN m s/rad', 'N m s/rad', 1e3_wp, 1.0_wp), &
    unit_row_t('N m s', 'N m s/rad', 1.0_wp, 1.0_wp), &
    unit_row_t('N m s', 'N m s', 1.0_wp, 1.0_wp), &
    unit_row_t('kg m^2/s', 'N m s', 1.0_wp, 1.0_wp), &
    unit_row_t('kg m^2', 'kg m^2', 1.0_wp, 1.0_wp), &
    unit_row_t('kg cm^2', 'kg m^2', 1.0_wp, 1e4_wp), &
    unit_row_t('g cm^2', 'kg m^2', 1.0_wp, 1e7_wp), &
    unit_row_t('V', 'V', 1.0_wp, 1.0_wp), &
    unit_row_t('mV', 'V', 1.0_wp, 1e3_wp), &
    unit_row_t('ohm', 'ohm', 1.0_wp, 1.0_wp), &
    unit_row_t('mohm', 'ohm', 1.0_wp, 1e3_wp), &
    unit_row_t('H', 'H', 1.0_wp, 1.0_wp), &
    unit_row_t('mH', 'H', 1.0_wp, 1e3_wp), &
    unit_row_t('%', '1', 1.0_wp, 1e2_wp)]

contains

  !> The value in the SI unit `unit` of a text such as "12.5 mm". If the text is not a number with a
  !> unit of this quantity, `problem` is allocated and states what is allowed.
  pure subroutine read_quantity(string, unit, value, problem)
    character(len=*), intent(in) :: string, unit
    real(wp), intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: spelling, trimmed
    integer :: length, row, status
    value = 0
    trimmed = trim(adjustl(string))
    length = number_length(trimmed)
    status = 1
    if (length > 0) call read_number(trimmed(1:length), value, status)
    if (status /= 0) then
      problem = 'allowed '//allowed_units(unit)
      return
    end if
    spelling = normal_form(trimmed(length + 1:))
    do row = 1, size(rows)
      if (rows(row)%si /= unit .or. rows(row)%spelling /= spelling) cycle
      value = value*rows(row)%multiplier/rows(row)%divisor
      return
    end do
    if (spelling == unit .and. unit /= '1') return
    call read_composed(spelling, unit, value, status)
    if (status == 0) return
    problem = 'allowed '//allowed_units(unit)
    if (len(spelling) == 0) problem = 'a number in quotes needs a unit; '//problem
  end subroutine read_quantity

  !> A value in a composed unit of the quantity of `unit`, made one of `unit`; `status` is 0 if it is one. An angle is a pure
  !> number and a frequency one per time, but neither stands for the other here.
  pure subroutine read_composed(spelling, unit, value, status)
    character(len=*), intent(in) :: spelling, unit
    real(wp), intent(inout) :: value
    integer, intent(out) :: status
    type(composed_unit_t) :: given, wanted
    integer :: columns(2)
    status = 1
    if (unit == '1') return
    call read_unit(spelling, given, columns(1))
    call read_unit(unit, wanted, columns(2))
    if (any(columns > 0)) return
    if (any(given%exponents /= wanted%exponents)) return
    if (given%angle /= wanted%angle .or. given%hertz /= wanted%hertz) return
    value = value*given%multiplier/given%divisor
    status = 0
  end subroutine read_composed

  !> What may be written for a quantity of the SI unit `unit`, for messages.
  pure function allowed_units(unit) result(text)
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: text
    if (unit == '1') then
      text = 'a number, or a text with %'
    else if (any(rows%si == unit)) then
      text = 'a number in '//trim(unit)//', or a text with one of the units '// &
             join(pack(rows%spelling, rows%si == unit), ', ')//', or another of this dimension'
    else
      text = 'a number in '//trim(unit)
    end if
  end function allowed_units

  !> One blank between the factors of a unit: 'N*s/m' and 'N  s/m' become 'N s/m'.
  pure function normal_form(string) result(spelling)
    character(len=*), intent(in) :: string
    character(len=:), allocatable :: spelling
    spelling = trim(adjustl(replace_all(unit_in_ascii(string), '*', ' ')))
    do while (index(spelling, '  ') > 0)
      spelling = replace_all(spelling, '  ', ' ')
    end do
  end function normal_form

end module units
