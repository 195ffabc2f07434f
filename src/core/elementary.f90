! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Sine, cosine, exponential and logarithm in plain IEEE arithmetic: the C library's own give other bits on other processors, and
!> labels of basin maps change with them. Errors stay within one ulp for arguments up to 1e5. Method and coefficients: fdlibm (Sun,
!> 1993).
module elementary
  use kinds, only: int64, real64
  implicit none
  private

  public :: sine_cosine, exponential, exponential_minus_one, logarithm

  real(real64), parameter :: &
    half_pi_high = 1.57079632673412561417e+00_real64, half_pi_low = 6.07710050650619224932e-11_real64, &
    two_over_pi = 6.36619772367581382433e-01_real64, &
    ln2_high = 6.93147180369123816490e-01_real64, ln2_low = 1.90821492927058770002e-10_real64, &
    one_over_ln2 = 1.44269504088896338700e+00_real64, &
    to_integer = 6755399441055744.0_real64 ! 1.5 * 2**52: adding it rounds to the nearest integer

  real(real64), parameter :: &
    s1 = -1.66666666666666324348e-01_real64, s2 = 8.33333333332248946124e-03_real64, &
    s3 = -1.98412698298579493134e-04_real64, s4 = 2.75573137070700676789e-06_real64, &
    s5 = -2.50507602534068634195e-08_real64, s6 = 1.58969099521155010221e-10_real64
  real(real64), parameter :: &
    c1 = 4.16666666666666019037e-02_real64, c2 = -1.38888888888741095749e-03_real64, &
    c3 = 2.48015872894767294178e-05_real64, c4 = -2.75573143513906633035e-07_real64, &
    c5 = 2.08757232129817482790e-09_real64, c6 = -1.13596475577881948265e-11_real64
  real(real64), parameter :: &
    p1 = 1.66666666666666019037e-01_real64, p2 = -2.77777777770155933842e-03_real64, &
    p3 = 6.61375632143793436117e-05_real64, p4 = -1.65339022054652515390e-06_real64, &
    p5 = 4.13813679705723846039e-08_real64
  real(real64), parameter :: &
    l1 = 6.666666666666735130e-01_real64, l2 = 3.999999999940941908e-01_real64, &
    l3 = 2.857142874366239149e-01_real64, l4 = 2.222219843214978396e-01_real64, &
    l5 = 1.818357216161805012e-01_real64, l6 = 1.531383769920937332e-01_real64, &
    l7 = 1.479819860511658591e-01_real64

contains

  !> Sine and cosine of `angle` [rad].
  pure elemental subroutine sine_cosine(angle, sine, cosine)
    real(real64), intent(in) :: angle
    real(real64), intent(out) :: sine, cosine
    real(real64) :: quarters, high, low, tail, r, z, half, w, sin_r, cos_r, sin_sign, cos_sign
    integer(int64) :: quadrant
    quarters = (angle*two_over_pi + to_integer) - to_integer
    high = angle - quarters*half_pi_high
    low = quarters*half_pi_low
    r = high - low
    tail = (high - r) - low
    z = r*r
    sin_r = r + (r*z*(s1 + z*(s2 + z*(s3 + z*(s4 + z*(s5 + z*s6))))) + tail*(1.0_real64 - 0.5_real64*z))
    half = 0.5_real64*z
    w = 1.0_real64 - half
    cos_r = w + (((1.0_real64 - w) - half) + (z*z*(c1 + z*(c2 + z*(c3 + z*(c4 + z*(c5 + z*c6))))) - r*tail))
    quadrant = iand(int(quarters, int64), 3_int64)
    sin_sign = merge(-1.0_real64, 1.0_real64, quadrant >= 2)
    cos_sign = merge(-1.0_real64, 1.0_real64, quadrant == 1 .or. quadrant == 2)
    sine = sin_sign*merge(cos_r, sin_r, iand(quadrant, 1_int64) == 1)
    cosine = cos_sign*merge(sin_r, cos_r, iand(quadrant, 1_int64) == 1)
  end subroutine sine_cosine

  !> e**x; 0 and infinity beyond the range of doubles.
  pure elemental function exponential(x) result(y)
    real(real64), intent(in) :: x
    real(real64) :: y, twos, bounded
    integer(int64) :: half
    bounded = max(-746.0_real64, min(710.0_real64, x))
    twos = (bounded*one_over_ln2 + to_integer) - to_integer
    y = 1.0_real64 + reduced_minus_one((bounded - twos*ln2_high) - twos*ln2_low)
    ! In two halves, so that neither factor leaves the range of normal numbers.
    half = int(twos, int64)/2
    y = (y*power_of_two(half))*power_of_two(int(twos, int64) - half)
    if (x /= x) y = x
  end function exponential

  !> 2**n for |n| <= 1022, made of its exponent bits.
  pure elemental real(real64) function power_of_two(n)
    integer(int64), intent(in) :: n
    power_of_two = transfer(ishft(n + 1023_int64, 52), 1.0_real64)
  end function power_of_two

  !> e**x - 1 without cancellation near zero.
  pure elemental function exponential_minus_one(x) result(y)
    real(real64), intent(in) :: x
    real(real64) :: y
    if (abs(x) < 0.34_real64) then
      y = reduced_minus_one(x)
    else
      y = exponential(x) - 1.0_real64
    end if
  end function exponential_minus_one

  !> e**r - 1 for |r| <= ln(2)/2.
  pure elemental function reduced_minus_one(r) result(y)
    real(real64), intent(in) :: r
    real(real64) :: y, t, c
    t = r*r
    c = r - t*(p1 + t*(p2 + t*(p3 + t*(p4 + t*p5))))
    y = r - (r*c)/(c - 2.0_real64)
  end function reduced_minus_one

  !> Natural logarithm of x > 0 (normal numbers).
  pure elemental function logarithm(x) result(y)
    real(real64), intent(in) :: x
    real(real64) :: y, f, s, z, r, half_square, twos
    integer :: k
    k = exponent(x)
    f = fraction(x)
    if (f < 0.70710678118654752440_real64) then
      f = 2.0_real64*f
      k = k - 1
    end if
    f = f - 1.0_real64
    twos = real(k, real64)
    s = f/(2.0_real64 + f)
    z = s*s
    r = z*(l1 + z*(l2 + z*(l3 + z*(l4 + z*(l5 + z*(l6 + z*l7))))))
    half_square = 0.5_real64*f*f
    y = twos*ln2_high - ((half_square - (s*(half_square + r) + twos*ln2_low)) - f)
  end function logarithm

end module elementary
