! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A parameter of a law as its row of the law table describes it.
module row_reader
  use case_parameters, only: row_bounds
  use case_source, only: case_source_t, find
  use case_values, only: bounds_t, take_real, take_reals
  use kinds, only: wp
  use law_table, only: parameter_row_t
  use text, only: to_text
  use toml_bindings, only: toml_float, toml_integer
  implicit none
  private

  public :: take_row

  !> The exponent of a soft contact where none is stated.
  real(wp), parameter :: hertz = 1.5_wp

contains

  !> Values of a parameter in the table `table`, where a position is an angle or not; unchanged if they are not there.
  subroutine take_row(source, table, row, is_angle, values)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: table
    type(parameter_row_t), intent(in) :: row
    logical, intent(in) :: is_angle
    real(wp), allocatable, intent(inout) :: values(:)
    type(bounds_t) :: bounds
    bounds = row_bounds(row, is_angle)
    bounds%unit = with_exponent(source, table, trim(bounds%unit))
    if (row%list) then
      call take_reals(source, table//'.'//trim(row%name), bounds, values, required=.not. row%optional)
    else
      call take_real(source, table//'.'//trim(row%name), bounds, values(1), required=.not. row%optional)
    end if
  end subroutine take_row

  !> The unit of a stiffness K of a force K p^n with the exponent of the table in it: N/m^1.5 for N/m^n.
  pure function with_exponent(source, table, unit) result(name)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: table, unit
    character(len=:), allocatable :: name
    real(wp) :: exponent
    integer :: mark, at
    name = unit
    mark = index(unit, '^n')
    if (mark == 0) return
    exponent = hertz
    at = find(source, table//'.exponent')
    if (at > 0) then
      ! Its own reader notes what is no number.
      if (all(source%entries(at)%entry%kind /= [toml_integer, toml_float])) return
      exponent = source%entries(at)%entry%real
    end if
    name = unit(:mark - 1)
    if (abs(exponent - anint(exponent)) > 0) then
      name = name//'^'//to_text(exponent)
    else if (nint(exponent) /= 1) then
      name = name//'^'//to_text(nint(exponent))
    end if
  end function with_exponent

end module row_reader
