! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Elementary functions of the reference library: the compiler's own in quadruple precision. Stands in
!> for src/core/elementary.f90.
module elementary
  use kinds, only: wp
  implicit none
  private

  public :: sine_cosine, exponential, exponential_minus_one, logarithm

contains

  !> Sine and cosine of `angle` [rad].
  pure elemental subroutine sine_cosine(angle, sine, cosine)
    real(wp), intent(in) :: angle
    real(wp), intent(out) :: sine, cosine
    sine = sin(angle)
    cosine = cos(angle)
  end subroutine sine_cosine

  !> e**x.
  pure elemental function exponential(x) result(y)
    real(wp), intent(in) :: x
    real(wp) :: y
    y = exp(x)
  end function exponential

  !> e**x - 1 without cancellation near zero.
  pure elemental function exponential_minus_one(x) result(y)
    real(wp), intent(in) :: x
    real(wp) :: y
    y = 2*exp(x/2)*sinh(x/2)
  end function exponential_minus_one

  !> Natural logarithm.
  pure elemental function logarithm(x) result(y)
    real(wp), intent(in) :: x
    real(wp) :: y
    y = log(x)
  end function logarithm

end module elementary
