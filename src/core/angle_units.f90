! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Units of a coordinate that is an angle.
module angle_units
  implicit none
  private

  public :: unit_of

contains

  !> The unit of a quantity of a motion, given as that of a position on a line: rad for m, rad/s for m/s and N m for N where the
  !> position is an angle.
  pure function unit_of(unit, is_angle) result(name)
    character(len=*), intent(in) :: unit
    logical, intent(in) :: is_angle
    character(len=:), allocatable :: name
    name = trim(unit)
    if (.not. is_angle) return
    select case (unit)
    case ('m')
      name = 'rad'
    case ('m/s')
      name = 'rad/s'
    case ('N')
      name = 'N m'
    end select
  end function unit_of

end module angle_units
