! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Taylor coefficients in time of every node, along the solution of z' = f(z) whose rates are nodes of the tape. A time that
!> occurs in f is a state with the rate 1.
module tape_series
  use kinds, only: wp
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_cos, op_cosh, op_divide, op_exp, op_log, &
    op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh, op_variable
  use tape, only: node_t, tape_t
  use tape_parts, only: needed
  use tape_value, only: evaluate
  implicit none
  private

  public :: prepare_series, expand, raise_orders

  !> What a series is made of: the nodes in use with the given branches, and where it is stored.
  type, public :: series_t
    integer :: order = 0
    !> Coefficients of powers of the time: (0:order, node).
    real(wp), allocatable :: c(:, :)
    !> Nodes in use; those of them that vary.
    logical, allocatable :: is_used(:)
    integer, allocatable :: varying(:)
    !> Node of the rate of each variable.
    integer, allocatable :: rates(:)
    integer, allocatable :: branches(:)
  end type series_t

contains

  !> Makes room for the series of a system up to `order`: `rates` are the nodes of the rates of its variables, `wanted` other
  !> nodes whose series will be needed, `branches` the sign of every switching function.
  pure subroutine prepare_series(tape, order, rates, wanted, branches, series)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order, rates(:), wanted(:), branches(:)
    type(series_t), intent(inout) :: series
    integer :: i
    series%order = order
    series%rates = rates
    series%branches = branches
    series%is_used = needed(tape, [rates, wanted], branches)
    do i = 1, tape%count
      if (tape%nodes(i)%operation == op_variable) series%is_used(i) = .true.
    end do
    series%varying = pack([(i, i=1, tape%count)], series%is_used .and. .not. tape%nodes(:tape%count)%is_steady)
    if (allocated(series%c)) then
      if (ubound(series%c, 1) /= order .or. size(series%c, 2) /= tape%count) deallocate (series%c)
    end if
    if (.not. allocated(series%c)) allocate (series%c(0:order, tape%count))
    series%c = 0
  end subroutine prepare_series

  !> Coefficients at a point. `fault` is 0, or the node whose operation, or series, is not defined there.
  pure subroutine expand(tape, variables, parameters, series, fault)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    real(wp) :: value(tape%count)
    integer :: faults(tape%count)
    call evaluate(tape, variables, parameters, value, faults, series%branches)
    fault = maxval(faults, mask=series%is_used)
    if (fault > 0) return
    series%c(0, :) = value
    call raise_orders(tape, -1.0_wp, value, series, fault)
  end subroutine expand

  !> Coefficients from order 1 on, from those of order 0. `sign` -1: coefficients. 1: bounds on their magnitudes, from bounds in
  !> `c(0, :)` and lower bounds of the magnitudes of divisors in `divisor`.
  pure subroutine raise_orders(tape, sign, divisor, series, fault)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: sign, divisor(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    integer :: k, i, at
    fault = 0
    do at = 1, size(series%varying)
      i = divisor_of(tape%nodes(series%varying(at)), series%varying(at))
      if (i > 0) then
        if (.not. abs(divisor(i)) > 0) fault = series%varying(at)
      end if
    end do
    if (fault > 0) return
    do k = 1, series%order
      do at = 1, size(series%varying)
        i = series%varying(at)
        if (tape%nodes(i)%operation == op_variable) then
          series%c(k, i) = series%c(k - 1, series%rates(tape%nodes(i)%first))/k
        else
          series%c(k, i) = coefficient(tape, i, k, sign, divisor, series)
        end if
      end do
    end do
  end subroutine raise_orders

  !> The node by which the series of a node divides; 0 if it divides by none.
  pure integer function divisor_of(node, i) result(divisor)
    type(node_t), intent(in) :: node
    integer, intent(in) :: i
    select case (node%operation)
    case (op_divide)
      divisor = node%second
    case (op_log, op_power)
      divisor = node%first
    case (op_sqrt)
      divisor = i
    case (op_asin, op_acos, op_atan, op_arc_tangent)
      divisor = node%partner
    case default
      divisor = 0
    end select
  end function divisor_of

  !> Coefficient k > 0 of node i from lower ones, and those of its arguments.
  pure real(wp) function coefficient(tape, i, k, sign, divisor, series) result(y)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i, k
    real(wp), intent(in) :: sign, divisor(:)
    type(series_t), intent(in) :: series
    integer :: branch
    associate (node => tape%nodes(i), a => series%c(:, tape%nodes(i)%first), c => series%c)
      select case (node%operation)
      case (op_add)
        y = a(k + 1) + c(k, node%second)
      case (op_subtract)
        y = a(k + 1) + sign*c(k, node%second)
      case (op_negative)
        y = sign*a(k + 1)
      case (op_multiply)
        if (tape%nodes(node%first)%is_steady) then
          y = a(1)*c(k, node%second)
        else if (tape%nodes(node%second)%is_steady) then
          y = a(k + 1)*c(0, node%second)
        else
          y = product_term(a, c(:, node%second), k)
        end if
      case (op_square)
        y = square_term(a, k)
      case (op_divide)
        y = a(k + 1)
        if (.not. tape%nodes(node%second)%is_steady) y = y + sign*inner_products(c(:, i), c(:, node%second), k)
        y = y/divisor(node%second)
      case (op_select)
        branch = merge(node%second, node%third, series%branches(node%first) > 0)
        y = c(k, branch)
      case default
        y = function_term(node, i, k, sign, divisor, series)
      end select
    end associate
  end function coefficient

  !> The same for roots, powers, exponentials and functions of angles: solutions of linear differential equations of first order
  !> in the argument.
  pure real(wp) function function_term(node, i, k, sign, divisor, series) result(y)
    type(node_t), intent(in) :: node
    integer, intent(in) :: i, k
    real(wp), intent(in) :: sign, divisor(:)
    type(series_t), intent(in) :: series
    real(wp) :: weight
    integer :: j
    associate (a => series%c(:, node%first), own => series%c(:, i), c => series%c)
      select case (node%operation)
      case (op_sqrt)
        y = 0
        do j = 1, k - 1
          y = y + own(j + 1)*own(k - j + 1)
        end do
        y = (a(k + 1) + sign*y)/(2*divisor(i))
      case (op_power)
        y = 0
        do j = 1, k
          weight = c(0, node%second)*j
          if (sign > 0) weight = abs(weight) + (k - j)
          if (sign < 0) weight = weight - (k - j)
          y = y + weight*a(j + 1)*own(k - j + 1)
        end do
        y = y/(k*divisor(node%first))
      case (op_exp)
        y = rate_products(a, own, k, k)/k
      case (op_sin, op_sinh, op_cosh, op_tan, op_tanh)
        y = rate_products(a, c(:, node%partner), k, k)/k
      case (op_cos)
        y = sign*rate_products(a, c(:, node%partner), k, k)/k
      case (op_log)
        y = (k*a(k + 1) + sign*rate_products(own, a, k, k - 1))/(k*divisor(node%first))
      case (op_asin, op_atan)
        y = (k*a(k + 1) + sign*rate_products(own, c(:, node%partner), k, k - 1))/(k*divisor(node%partner))
      case (op_acos)
        y = sign*(k*a(k + 1) + rate_products(own, c(:, node%partner), k, k - 1))/(k*divisor(node%partner))
      case (op_arc_tangent)
        y = rate_products(a, c(:, node%second), k, k) + sign*rate_products(c(:, node%second), a, k, k)
        y = (y + sign*rate_products(own, c(:, node%partner), k, k - 1))/(k*divisor(node%partner))
      case default
        y = 0
      end select
    end associate
  end function function_term

  !> Sum of a(i) b(k - i), i = 0 ... k; arrays begin with order 0 at element 1. In two parts, so that additions need not wait for
  !> each other.
  pure real(wp) function product_term(a, b, k) result(total)
    real(wp), intent(in), contiguous :: a(:), b(:)
    integer, intent(in) :: k
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 1, k, 2
      total = total + a(i)*b(k + 2 - i)
      other = other + a(i + 1)*b(k + 1 - i)
    end do
    total = total + other
    if (modulo(k, 2) == 0) total = total + a(k + 1)*b(1)
  end function product_term

  pure real(wp) function square_term(a, k) result(total)
    real(wp), intent(in), contiguous :: a(:)
    integer, intent(in) :: k
    integer :: i
    total = 0
    do i = 1, (k + 1)/2
      total = total + a(i)*a(k + 2 - i)
    end do
    total = 2*total
    if (modulo(k, 2) == 0) total = total + a(k/2 + 1)**2
  end function square_term

  !> Sum of y(i) b(k - i), i = 0 ... k - 1.
  pure real(wp) function inner_products(y, b, k) result(total)
    real(wp), intent(in), contiguous :: y(:), b(:)
    integer, intent(in) :: k
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 1, k - 1, 2
      total = total + y(i)*b(k + 2 - i)
      other = other + y(i + 1)*b(k + 1 - i)
    end do
    total = total + other
    if (modulo(k, 2) == 1) total = total + y(k)*b(2)
  end function inner_products

  !> Sum of j a(j) u(k - j), j = 1 ... last.
  pure real(wp) function rate_products(a, u, k, last) result(total)
    real(wp), intent(in), contiguous :: a(:), u(:)
    integer, intent(in) :: k, last
    real(wp) :: other
    integer :: j
    total = 0
    other = 0
    do j = 1, last - 1, 2
      total = total + j*a(j + 1)*u(k - j + 1)
      other = other + (j + 1)*a(j + 2)*u(k - j)
    end do
    total = total + other
    if (modulo(last, 2) == 1) total = total + last*a(last + 1)*u(k - last + 1)
  end function rate_products

end module tape_series
