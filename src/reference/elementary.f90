! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Elementary functions of the reference library: the compiler's own in quadruple precision. Stands in
!> for src/core/elementary.f90.
module elementary
  use kinds, only: wp
  implicit none
  private

  public :: sine_cosine, exponential, exponential_minus_one, logarithm, tangent, arc_sine, arc_cosine, arc_tangent, &
    hyperbolic_sine, hyperbolic_cosine, hyperbolic_tangent

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

  !> Tangent of an angle [rad].
  pure elemental real(wp) function tangent(x)
    real(wp), intent(in) :: x
    tangent = tan(x)
  end function tangent

  !> Arc sine [rad].
  pure elemental real(wp) function arc_sine(x)
    real(wp), intent(in) :: x
    arc_sine = asin(x)
  end function arc_sine

  !> Arc cosine [rad].
  pure elemental real(wp) function arc_cosine(x)
    real(wp), intent(in) :: x
    arc_cosine = acos(x)
  end function arc_cosine

  !> (e**x - e**-x)/2.
  pure elemental real(wp) function hyperbolic_sine(x)
    real(wp), intent(in) :: x
    hyperbolic_sine = sinh(x)
  end function hyperbolic_sine

  !> (e**x + e**-x)/2.
  pure elemental real(wp) function hyperbolic_cosine(x)
    real(wp), intent(in) :: x
    hyperbolic_cosine = cosh(x)
  end function hyperbolic_cosine

  !> Hyperbolic tangent.
  pure elemental real(wp) function hyperbolic_tangent(x)
    real(wp), intent(in) :: x
    hyperbolic_tangent = tanh(x)
  end function hyperbolic_tangent

  !> Angle [rad] of the point (x, y), from -pi to pi; 0 at the origin.
  pure elemental real(wp) function arc_tangent(y, x)
    real(wp), intent(in) :: y, x
    arc_tangent = 0
    if (max(abs(x), abs(y)) > 0) arc_tangent = atan2(y, x)
  end function arc_tangent

end module elementary
