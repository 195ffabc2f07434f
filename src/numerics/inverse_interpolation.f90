! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Zeros by inverse interpolation: where a function is steep or cannot be evaluated next to its zero, what belongs to the zero is
!> a weighted sum of what belongs to points on both sides of it.
module inverse_interpolation
  use kinds, only: wp
  implicit none
  private

  public :: weights_at_zero

contains

  !> The weights of points with the values `value`, by the polynomial in the value through all of them (Lagrange). `ok` is false
  !> where two values are the same or one is not finite.
  pure subroutine weights_at_zero(value, weight, ok)
    real(wp), intent(in) :: value(:)
    real(wp), intent(out) :: weight(size(value))
    logical, intent(out) :: ok
    integer :: i, k
    do k = 1, size(value)
      weight(k) = product(value/(value - value(k)), mask=[(i /= k, i=1, size(value))])
    end do
    ok = sum(abs(value)) + sum(abs(weight)) < huge(1.0_wp)
  end subroutine weights_at_zero

end module inverse_interpolation
