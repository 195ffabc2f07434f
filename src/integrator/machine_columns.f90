! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a log of a motion holds beside time, position and velocity of the watched body, one column each.
module machine_columns
  use kinds, only: wp
  implicit none
  private

  public :: set_column

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

end module machine_columns
