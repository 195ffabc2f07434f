! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A parameter of a law as its row of the law table describes it.
module row_reader
  use case_parameters, only: row_bounds
  use case_source, only: case_source_t
  use case_values, only: take_real, take_reals
  use kinds, only: wp
  use law_table, only: parameter_row_t
  implicit none
  private

  public :: take_row

contains

  !> Values of a parameter in the table `table`, where a position is an angle or not; unchanged if they are not there.
  subroutine take_row(source, table, row, is_angle, values)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: table
    type(parameter_row_t), intent(in) :: row
    logical, intent(in) :: is_angle
    real(wp), allocatable, intent(inout) :: values(:)
    if (row%list) then
      call take_reals(source, table//'.'//trim(row%name), row_bounds(row, is_angle), values, required=.not. row%optional)
    else
      call take_real(source, table//'.'//trim(row%name), row_bounds(row, is_angle), values(1), required=.not. row%optional)
    end if
  end subroutine take_row

end module row_reader
