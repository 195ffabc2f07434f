! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The natural size of a quantity for a machine: what its unit is worth in the length, time and mass that the machine itself
!> sets. Steps of finite differences are shares of it, so that a parameter whose value is 0 has one too.
module natural_scale
  use kinds, only: wp
  use machine_type, only: scales_t
  implicit none
  private

  public :: natural_size

contains

  !> Natural size of the SI unit `unit`, as the law table writes it: factors parted by blanks, '/' before those below,
  !> '^' before an exponent, which is the exponent of Hertz where it is a letter.
  pure real(wp) function natural_size(unit, scales) result(total)
    character(len=*), intent(in) :: unit
    type(scales_t), intent(in) :: scales
    integer :: at, last
    real(wp) :: side
    total = 1
    side = 1
    at = 1
    do while (at <= len_trim(unit))
      last = scan(unit(at:)//' ', ' /')
      total = total*factor(unit(at:at + last - 2), scales, side)
      at = at + last - 1
      if (at > len_trim(unit)) exit
      if (unit(at:at) == '/') side = -1
      at = at + 1
    end do
  end function natural_size

  !> One factor to the power `side` times its exponent.
  pure real(wp) function factor(word, scales, side)
    character(len=*), intent(in) :: word
    type(scales_t), intent(in) :: scales
    real(wp), intent(in) :: side
    integer :: mark, halves
    mark = index(word//'^', '^')
    halves = 2
    if (mark < len(word)) then
      select case (word(mark + 1:))
      case ('2')
        halves = 4
      case ('3')
        halves = 6
      case default
        halves = 3
      end select
    end if
    select case (word(:mark - 1))
    case ('m')
      factor = scales%length
    case ('s')
      factor = scales%time
    case ('kg')
      factor = scales%mass
    case ('N')
      factor = scales%mass*scales%length/scales%time**2
    case default
      factor = 1
    end select
    factor = sqrt(factor)**(nint(side)*halves)
  end function factor

end module natural_scale
