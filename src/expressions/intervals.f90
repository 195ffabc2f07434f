! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Intervals, and the operations of a tape on them: what an operation gives anywhere in its arguments lies in the result.
module intervals
  use elementary, only: arc_cosine, arc_sine, arc_tangent, exponential, hyperbolic_cosine, hyperbolic_sine, &
    hyperbolic_tangent, logarithm, sine_cosine, tangent
  use kinds, only: wp
  use operations, only: largest_angle, op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_cos, op_cosh, op_divide, op_exp, &
    op_log, op_multiply, op_negative, op_power, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh
  implicit none
  private

  public :: operate_on_intervals, magnitude, least_magnitude, hull

  type, public :: interval_t
    real(wp) :: low = 0, high = 0
  end type interval_t

  real(wp), parameter :: pi = 3.14159265358979323846264338327950288_wp
  !> Elementary functions are right to two units in the last digit.
  real(wp), parameter :: rounding = 4*epsilon(1.0_wp)

contains

  !> Largest absolute value.
  pure elemental real(wp) function magnitude(a)
    type(interval_t), intent(in) :: a
    magnitude = max(abs(a%low), abs(a%high))
  end function magnitude

  !> Smallest absolute value.
  pure elemental real(wp) function least_magnitude(a)
    type(interval_t), intent(in) :: a
    least_magnitude = max(a%low, -a%high, 0.0_wp)
  end function least_magnitude

  !> The smallest interval around two.
  pure elemental type(interval_t) function hull(a, b)
    type(interval_t), intent(in) :: a, b
    hull = interval_t(min(a%low, b%low), max(a%high, b%high))
  end function hull

  !> Result of an operation; `is_defined` is false if it is not proven to be defined and finite all over the arguments.
  pure subroutine operate_on_intervals(operation, a, b, result, is_defined)
    integer, intent(in) :: operation
    type(interval_t), intent(in) :: a, b
    type(interval_t), intent(out) :: result
    logical, intent(out) :: is_defined
    is_defined = .true.
    select case (operation)
    case (op_add)
      result = interval_t(a%low + b%low, a%high + b%high)
    case (op_subtract)
      result = interval_t(a%low - b%high, a%high - b%low)
    case (op_negative)
      result = interval_t(-a%high, -a%low)
      return
    case (op_multiply)
      result = product_of(a, b)
    case (op_divide)
      is_defined = least_magnitude(b) > 0
      if (is_defined) result = product_of(a, interval_t(1/b%high, 1/b%low))
    case (op_square)
      result = interval_t(least_magnitude(a)**2, magnitude(a)**2)
    case (op_power)
      is_defined = a%low > 0
      if (is_defined) result = exponential_of(product_of(b, interval_t(logarithm(a%low), logarithm(a%high))))
    case (op_arc_tangent)
      call angle_of(a, b, result, is_defined)
    case (op_sin, op_cos, op_tan)
      is_defined = magnitude(a) <= largest_angle
      if (is_defined) call circular(operation, a, result, is_defined)
    case default
      call monotone(operation, a, result, is_defined)
    end select
    result = interval_t(result%low - rounding*abs(result%low) - tiny(1.0_wp), &
                        result%high + rounding*abs(result%high) + tiny(1.0_wp))
    is_defined = is_defined .and. magnitude(result) <= huge(1.0_wp)
  end subroutine operate_on_intervals

  pure type(interval_t) function product_of(a, b)
    type(interval_t), intent(in) :: a, b
    real(wp) :: corners(4)
    corners = [a%low*b%low, a%low*b%high, a%high*b%low, a%high*b%high]
    product_of = interval_t(minval(corners), maxval(corners))
  end function product_of

  !> The exponent is rounded, too.
  pure type(interval_t) function exponential_of(a)
    type(interval_t), intent(in) :: a
    real(wp) :: margin
    margin = rounding*magnitude(a)
    exponential_of = interval_t(exponential(a%low - margin), exponential(a%high + margin))
  end function exponential_of

  !> Functions that rise, or fall, all over their domain, and the hyperbolic cosine.
  pure subroutine monotone(operation, a, result, is_defined)
    integer, intent(in) :: operation
    type(interval_t), intent(in) :: a
    type(interval_t), intent(out) :: result
    logical, intent(out) :: is_defined
    is_defined = .true.
    select case (operation)
    case (op_sqrt)
      is_defined = a%low >= 0
      if (is_defined) result = interval_t(sqrt(a%low), sqrt(a%high))
    case (op_exp)
      result = interval_t(exponential(a%low), exponential(a%high))
    case (op_log)
      is_defined = a%low > 0
      if (is_defined) result = interval_t(logarithm(a%low), logarithm(a%high))
    case (op_asin, op_acos)
      is_defined = magnitude(a) <= 1
      if (.not. is_defined) return
      result = interval_t(arc_sine(a%low), arc_sine(a%high))
      if (operation == op_acos) result = interval_t(arc_cosine(a%high), arc_cosine(a%low))
    case (op_atan)
      result = interval_t(arc_tangent(a%low, 1.0_wp), arc_tangent(a%high, 1.0_wp))
    case (op_sinh)
      result = interval_t(hyperbolic_sine(a%low), hyperbolic_sine(a%high))
    case (op_cosh)
      result = interval_t(hyperbolic_cosine(least_magnitude(a)), hyperbolic_cosine(magnitude(a)))
    case (op_tanh)
      result = interval_t(hyperbolic_tangent(a%low), hyperbolic_tangent(a%high))
    case default
      is_defined = .false.
    end select
  end subroutine monotone

  !> Sine, cosine or tangent.
  pure subroutine circular(operation, a, result, is_defined)
    integer, intent(in) :: operation
    type(interval_t), intent(in) :: a
    type(interval_t), intent(out) :: result
    logical, intent(out) :: is_defined
    real(wp) :: sines(2), cosines(2), ends(2), peak
    call sine_cosine([a%low, a%high], sines, cosines)
    is_defined = .true.
    if (operation == op_tan) then
      is_defined = .not. contains_multiple(a, pi/2, pi)
      if (is_defined) result = interval_t(tangent(a%low), tangent(a%high))
      return
    end if
    ends = merge(sines, cosines, operation == op_sin)
    peak = merge(pi/2, 0.0_wp, operation == op_sin)
    result = interval_t(minval(ends), maxval(ends))
    if (contains_multiple(a, peak, 2*pi)) result%high = 1
    if (contains_multiple(a, peak + pi, 2*pi)) result%low = -1
  end subroutine circular

  !> Whether first + n period may lie in the interval for a whole number n.
  pure logical function contains_multiple(a, first, period)
    type(interval_t), intent(in) :: a
    real(wp), intent(in) :: first, period
    real(wp) :: margin
    margin = rounding*(magnitude(a) + period)
    contains_multiple = ceiling((a%low - margin - first)/period) <= floor((a%high + margin - first)/period)
  end function contains_multiple

  !> Angle of the point (x, y) where the box is clear of the negative x axis.
  pure subroutine angle_of(y, x, angle, is_defined)
    type(interval_t), intent(in) :: y, x
    type(interval_t), intent(out) :: angle
    logical, intent(out) :: is_defined
    real(wp) :: corners(4)
    is_defined = x%low > 0 .or. y%low > 0 .or. y%high < 0
    if (.not. is_defined) return
    corners = arc_tangent([y%low, y%low, y%high, y%high], [x%low, x%high, x%low, x%high])
    angle = interval_t(minval(corners), maxval(corners))
  end subroutine angle_of

end module intervals
