! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One axis of a map: the values of a start or of a law's parameter.
module axis
  use kinds, only: wp
  implicit none
  private

  public :: linear_values

  integer, parameter, public :: name_length = 48

  type, public :: axis_t
    !> 'x0', 'v0', 'crank_angle' or 'family.parameter'.
    character(len=name_length) :: name = ''
    !> SI unit, '1' for none.
    character(len=:), allocatable :: unit
    !> Ascending values in that unit.
    real(wp), allocatable :: values(:)
  end type axis_t

contains

  !> `count` evenly spaced values; the first is `from` and the last is `to`, to the bit.
  pure function linear_values(from, to, count) result(values)
    real(wp), intent(in) :: from, to
    integer, intent(in) :: count
    real(wp), allocatable :: values(:)
    integer :: i
    allocate (values(count))
    do i = 1, count - 1
      values(i) = from + (to - from)*(real(i - 1, wp)/real(count - 1, wp))
    end do
    if (count > 0) values(count) = to
  end function linear_values

end module axis
