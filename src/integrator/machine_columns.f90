! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a log of a motion holds beside time, position and velocity of the watched body, one column each.
module machine_columns
  use kinds, only: wp
  implicit none
  private

  public :: set_column, values_named

  !> A quantity at the samples, or at the events.
  type, public :: machine_column_t
    character(len=:), allocatable :: name, units, text
    real(wp), allocatable :: values(:)
    !> Meanings of the numbers 1, 2, ..., separated by spaces; '' of a quantity.
    character(len=:), allocatable :: meanings
  end type machine_column_t

contains

  pure subroutine set_column(column, name, units, text, values)
    type(machine_column_t), intent(out) :: column
    character(len=*), intent(in) :: name, units, text
    real(wp), intent(in) :: values(:)
    column%name = name
    column%units = units
    column%text = text
    column%values = values
    column%meanings = ''
  end subroutine set_column

  !> The first `count` values of the column with a name; zeros where the machine has none.
  pure function values_named(columns, name, count) result(values)
    type(machine_column_t), intent(in) :: columns(:)
    character(len=*), intent(in) :: name
    integer, intent(in) :: count
    real(wp) :: values(count)
    integer :: i
    values = 0
    do i = 1, size(columns)
      if (columns(i)%name == name) values = columns(i)%values(:count)
    end do
  end function values_named

end module machine_columns
