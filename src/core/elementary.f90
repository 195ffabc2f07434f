! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Elementary functions in plain IEEE arithmetic: the C library's own give other bits on other processors, and labels of basin
!> maps change with them. Errors stay within one ulp, for arguments of sine and cosine up to 1e5; within two for tangent, arcs and
!> hyperbolic functions. Method and coefficients of sine, exponential and logarithm: fdlibm (Sun, 1993).
module elementary
  use kinds, only: int64, real64
  implicit none
  private

  public :: sine_cosine, exponential, exponential_minus_one, logarithm, tangent, arc_sine, arc_cosine, arc_tangent, &
    hyperbolic_sine, hyperbolic_cosine, hyperbolic_tangent

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
  ! Angles in two parts: pi, half of it, and the arcs whose tangents are eighths.
  real(real64), parameter :: &
    pi_parts(2) = [3.141592653589793_real64, 1.2246467991473532e-16_real64], &
    right_angle(2) = [1.5707963267948966_real64, 6.123233995736766e-17_real64], &
    arc_high(0:8) = [0.0_real64, &
      0.12435499454676144_real64, 0.24497866312686414_real64, 0.35877067027057225_real64, &
      0.4636476090008061_real64, 0.5585993153435624_real64, 0.6435011087932844_real64, &
      0.7188299996216245_real64, 0.7853981633974483_real64], &
    arc_low(0:8) = [0.0_real64, &
      -3.1253241424539383e-18_real64, 1.0698755618734451e-17_real64, -2.4623815582638635e-17_real64, &
      2.2698777452961687e-17_real64, -5.4556305485916264e-18_real64, 1.5834785051444286e-17_real64, &
      -2.1478388444456983e-17_real64, 3.061616997868383e-17_real64]
  !> Coefficients of z**n in atan(t) = t + t z (...), sinh(x) = x + x z (...) and cosh(x) = 1 + z (...), z the square.
  integer, private :: n
  real(real64), parameter :: &
    arc_series(10) = [(real(1 - 2*modulo(n, 2), real64)/(2*n + 1), n=1, 10)], &
    sine_series(9) = [&
      0.16666666666666666_real64, 0.008333333333333333_real64, 0.0001984126984126984_real64, &
      2.7557319223985893e-06_real64, 2.505210838544172e-08_real64, 1.6059043836821613e-10_real64, &
      7.647163731819816e-13_real64, 2.8114572543455206e-15_real64, 8.22063524662433e-18_real64], &
    cosine_series(9) = [&
      0.5_real64, 0.041666666666666664_real64, 0.001388888888888889_real64, &
      2.48015873015873e-05_real64, 2.755731922398589e-07_real64, 2.08767569878681e-09_real64, &
      1.1470745597729725e-11_real64, 4.779477332387385e-14_real64, 1.5619206968586225e-16_real64]

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

  !> Tangent of `angle` [rad].
  pure elemental real(real64) function tangent(angle)
    real(real64), intent(in) :: angle
    real(real64) :: sine, cosine
    call sine_cosine(angle, sine, cosine)
    tangent = sine/cosine
  end function tangent

  !> Arc sine [rad] of |x| <= 1.
  pure elemental real(real64) function arc_sine(x)
    real(real64), intent(in) :: x
    real(real64) :: parts(2)
    parts = angle_of([abs(x), 0.0_real64], complement(abs(x)))
    arc_sine = sign(parts(1) + parts(2), x)
  end function arc_sine

  !> Arc cosine [rad] of |x| <= 1.
  pure elemental real(real64) function arc_cosine(x)
    real(real64), intent(in) :: x
    real(real64) :: parts(2)
    parts = angle_of(complement(abs(x)), [abs(x), 0.0_real64])
    if (x < 0) parts = difference(pi_parts, parts)
    arc_cosine = parts(1) + parts(2)
  end function arc_cosine

  !> Angle [rad] of the point (x, y), from -pi to pi; 0 at the origin.
  pure elemental real(real64) function arc_tangent(y, x)
    real(real64), intent(in) :: y, x
    real(real64) :: parts(2)
    integer :: shift
    arc_tangent = 0
    if (.not. max(abs(x), abs(y)) > 0) return
    shift = -exponent(max(abs(x), abs(y)))
    parts = angle_of([scale(abs(y), shift), 0.0_real64], [scale(abs(x), shift), 0.0_real64])
    if (x < 0) parts = difference(pi_parts, parts)
    arc_tangent = sign(parts(1) + parts(2), y)
  end function arc_tangent

  !> Angle of a point in the first quadrant; coordinates and angle in two parts.
  pure function angle_of(y, x) result(angle)
    real(real64), intent(in) :: y(2), x(2)
    real(real64) :: angle(2), t(2), z, rest
    integer :: k
    if (y(1) <= x(1)) then
      t = quotient(y, x)
    else
      t = quotient(x, y)
    end if
    ! The nearest eighth leaves tangents up to 1/16; below the second bound the series serves alone.
    k = nint(8*t(1))
    if (t(1) < 0.15_real64) k = 0
    if (k > 0) t = [(t(1) - k/8.0_real64)/(1 + t(1)*(k/8.0_real64)), t(2)/(1 + t(1)**2)]
    z = t(1)*t(1)
    rest = t(1)*z*horner(arc_series, z) + t(2)
    angle = [arc_high(k), arc_low(k) + (t(1) + rest)]
    if (k == 0) angle = [t(1), rest]
    call normalise(angle)
    if (y(1) > x(1)) angle = difference(right_angle, angle)
  end function angle_of

  !> sqrt(1 - x**2) in two parts, 0 <= x <= 1.
  pure function complement(x) result(root)
    real(real64), intent(in) :: x
    real(real64) :: root(2), square(2), rest(2)
    square = product_of(x, x)
    rest = difference([1.0_real64, 0.0_real64], square)
    root = [sqrt(rest(1)), 0.0_real64]
    if (.not. root(1) > 0) return
    square = product_of(root(1), root(1))
    root(2) = (((rest(1) - square(1)) - square(2)) + rest(2))/(2*root(1))
  end function complement

  !> (e**x - e**-x)/2; infinite beyond the range of the exponential.
  pure elemental real(real64) function hyperbolic_sine(x)
    real(real64), intent(in) :: x
    real(real64) :: growth
    if (abs(x) < 1) then
      hyperbolic_sine = x + x*x*x*horner(sine_series, x*x)
    else
      growth = exponential(abs(x))
      hyperbolic_sine = sign(0.5_real64*(growth - 1/growth), x)
    end if
  end function hyperbolic_sine

  !> (e**x + e**-x)/2; infinite beyond the range of the exponential.
  pure elemental real(real64) function hyperbolic_cosine(x)
    real(real64), intent(in) :: x
    real(real64) :: growth
    growth = exponential(abs(x))
    hyperbolic_cosine = 0.5_real64*(growth + 1/growth)
  end function hyperbolic_cosine

  !> Hyperbolic tangent.
  pure elemental real(real64) function hyperbolic_tangent(x)
    real(real64), intent(in) :: x
    real(real64) :: sine(2), cosine(2), parts(2), z
    if (abs(x) > 0.6_real64) then
      hyperbolic_tangent = sign(1 - 2/(exponential(2*min(abs(x), 30.0_real64)) + 1), x)
    else
      z = x*x
      sine = [x, x*z*horner(sine_series, z)]
      cosine = [1.0_real64, z*horner(cosine_series, z)]
      call normalise(sine)
      call normalise(cosine)
      parts = quotient(sine, cosine)
      hyperbolic_tangent = parts(1) + parts(2)
    end if
  end function hyperbolic_tangent

  !> c(1) + z c(2) + ...
  pure real(real64) function horner(c, z)
    real(real64), intent(in) :: c(:), z
    integer :: i
    horner = c(size(c))
    do i = size(c) - 1, 1, -1
      horner = horner*z + c(i)
    end do
  end function horner

  !> The same sum, its first part rounded; the first part is the larger one.
  pure subroutine normalise(parts)
    real(real64), intent(inout) :: parts(2)
    real(real64) :: total
    total = parts(1) + parts(2)
    parts = [total, parts(2) - (total - parts(1))]
  end subroutine normalise

  !> a - b, |a| >= |b|, all in two parts.
  pure function difference(a, b) result(parts)
    real(real64), intent(in) :: a(2), b(2)
    real(real64) :: parts(2)
    parts(1) = a(1) - b(1)
    parts(2) = ((a(1) - parts(1)) - b(1)) + (a(2) - b(2))
  end function difference

  !> a b without rounding (Dekker 1971), for products far from the ends of the range.
  pure function product_of(a, b) result(parts)
    real(real64), intent(in) :: a, b
    real(real64) :: parts(2), a_high, b_high
    real(real64), parameter :: splitter = 134217729.0_real64 ! 2**27 + 1
    a_high = splitter*a - (splitter*a - a)
    b_high = splitter*b - (splitter*b - b)
    parts(1) = a*b
    parts(2) = ((a_high*b_high - parts(1)) + a_high*(b - b_high) + (a - a_high)*b_high) + (a - a_high)*(b - b_high)
  end function product_of

  !> a/b, all in two parts.
  pure function quotient(a, b) result(parts)
    real(real64), intent(in) :: a(2), b(2)
    real(real64) :: parts(2), back(2)
    parts(1) = a(1)/b(1)
    back = product_of(parts(1), b(1))
    parts(2) = (((a(1) - back(1)) - back(2)) + (a(2) - parts(1)*b(2)))/b(1)
  end function quotient

end module elementary
