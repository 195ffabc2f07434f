! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The operations of a tape: their table, and the value of each.
module operations
  use elementary, only: arc_cosine, arc_sine, arc_tangent, exponential, hyperbolic_cosine, hyperbolic_sine, &
    hyperbolic_tangent, logarithm, sine_cosine, tangent
  use kinds, only: wp
  implicit none
  private

  public :: operate

  integer, parameter, public :: op_constant = 1, op_variable = 2, op_parameter = 3, op_add = 4, op_subtract = 5, &
    op_multiply = 6, op_divide = 7, op_power = 8, op_arc_tangent = 9, op_negative = 10, op_square = 11, op_sqrt = 12, op_exp = 13, &
    op_log = 14, op_sin = 15, op_cos = 16, op_tan = 17, op_asin = 18, op_acos = 19, op_atan = 20, op_sinh = 21, op_cosh = 22, &
    op_tanh = 23, op_select = 24

  !> Sine, cosine and tangent of larger angles [rad] would lose digits.
  real(wp), parameter, public :: largest_angle = 1.6e6_wp

  type, public :: operation_t
    character(len=8) :: name
    !> Number of arguments that are nodes of a tape.
    integer :: arguments
    !> What its arguments must be.
    character(len=44) :: domain
  end type operation_t

  character(len=*), parameter :: finite = 'a finite result', angle = 'an angle of at most 1.6e6 rad', &
    unit = 'an argument from -1 to 1'

  !> Row: code of the operation.
  type(operation_t), parameter, public :: operation_table(24) = [ &
                                          operation_t('constant', 0, finite), &
                                          operation_t('variable', 0, finite), &
                                          operation_t('param.', 0, finite), &
                                          operation_t('+', 2, finite), &
                                          operation_t('-', 2, finite), &
                                          operation_t('*', 2, finite), &
                                          operation_t('/', 2, 'a divisor other than zero, a finite result'), &
                                          operation_t('^', 2, 'a positive base, a finite result'), &
                                          operation_t('atan2', 2, 'two arguments that are not both zero'), &
                                          operation_t('-', 1, finite), &
                                          operation_t('^2', 1, finite), &
                                          operation_t('sqrt', 1, 'an argument of at least zero'), &
                                          operation_t('exp', 1, finite), &
                                          operation_t('log', 1, 'a positive argument'), &
                                          operation_t('sin', 1, angle), &
                                          operation_t('cos', 1, angle), &
                                          operation_t('tan', 1, angle), &
                                          operation_t('asin', 1, unit), &
                                          operation_t('acos', 1, unit), &
                                          operation_t('atan', 1, finite), &
                                          operation_t('sinh', 1, finite), &
                                          operation_t('cosh', 1, finite), &
                                          operation_t('tanh', 1, finite), &
                                          operation_t('if', 2, finite)]

contains

  !> Result of an operation on one or two numbers; `is_defined` is false outside the domain and at an overflow, and the
  !> result is then 0. Constants, variables, parameters and branches have no result here.
  pure subroutine operate(operation, a, b, result, is_defined)
    integer, intent(in) :: operation
    real(wp), intent(in) :: a, b
    real(wp), intent(out) :: result
    logical, intent(out) :: is_defined
    result = 0
    is_defined = is_in_domain(operation, a, b)
    if (.not. is_defined) return
    select case (operation)
    case (op_add)
      result = a + b
    case (op_subtract)
      result = a - b
    case (op_multiply)
      result = a*b
    case (op_divide)
      result = a/b
    case (op_power)
      if (a > 0) result = exponential(b*logarithm(a))
    case (op_arc_tangent)
      result = arc_tangent(a, b)
    case (op_negative)
      result = -a
    case (op_square)
      result = a*a
    case default
      result = function_value(operation, a)
    end select
    is_defined = abs(result) <= huge(result)
    if (.not. is_defined) result = 0
  end subroutine operate

  pure real(wp) function function_value(operation, a) result(value)
    integer, intent(in) :: operation
    real(wp), intent(in) :: a
    real(wp) :: other
    select case (operation)
    case (op_sqrt)
      value = sqrt(a)
    case (op_exp)
      value = exponential(a)
    case (op_log)
      value = logarithm(a)
    case (op_sin)
      call sine_cosine(a, value, other)
    case (op_cos)
      call sine_cosine(a, other, value)
    case (op_tan)
      value = tangent(a)
    case (op_asin)
      value = arc_sine(a)
    case (op_acos)
      value = arc_cosine(a)
    case (op_atan)
      value = arc_tangent(a, 1.0_wp)
    case (op_sinh)
      value = hyperbolic_sine(a)
    case (op_cosh)
      value = hyperbolic_cosine(a)
    case (op_tanh)
      value = hyperbolic_tangent(a)
    case default
      value = 0
    end select
  end function function_value

  pure logical function is_in_domain(operation, a, b)
    integer, intent(in) :: operation
    real(wp), intent(in) :: a, b
    select case (operation)
    case (op_divide)
      is_in_domain = abs(b) > 0
    case (op_power)
      is_in_domain = a > 0 .or. (a >= 0 .and. b > 0)
    case (op_arc_tangent)
      is_in_domain = max(abs(a), abs(b)) > 0
    case (op_sqrt)
      is_in_domain = a >= 0
    case (op_log)
      is_in_domain = a > 0
    case (op_sin, op_cos, op_tan)
      is_in_domain = abs(a) <= largest_angle
    case (op_asin, op_acos)
      is_in_domain = abs(a) <= 1
    case default
      is_in_domain = .true.
    end select
  end function is_in_domain

end module operations
