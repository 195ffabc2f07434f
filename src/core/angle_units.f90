! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Units of a coordinate that is an angle.
module angle_units
  implicit none
  private

  public :: unit_of

contains

  !> The unit of a quantity of a motion, given as that of a position on a line, where the position is an angle: rad for m, N m for
  !> N, kg m^2 for kg.
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
    case ('kg')
      name = 'kg m^2'
    case ('N s')
      name = 'N m s'
    case ('N/m')
      name = 'N m/rad'
    case ('N/m^2')
      name = 'N m/rad^2'
    case ('N/m^3')
      name = 'N m/rad^3'
    case ('N/m^n')
      name = 'N m/rad^n'
    case ('N s/m')
      name = 'N m s/rad'
    case ('N s^3/m^3')
      name = 'N m s^3/rad^3'
    case ('1/m')
      name = '1/rad'
    case ('N s^2/m^2')
      name = 'N m s^2/rad^2'
    case ('N/(m s)')
      name = 'N m/(rad s)'
    case ('s/m')
      name = 's/rad'
    end select
  end function unit_of

end module angle_units
