! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Derivatives of nodes by a variable or a parameter, as nodes of the same tape.
module tape_derivative
  use kinds, only: wp
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_cos, op_cosh, op_divide, op_exp, op_log, &
    op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh
  use tape, only: append, constant, node_t, tape_t
  use tape_algebra, only: binary, unary
  use tape_functions, only: power
  use tape_parts, only: needed
  implicit none
  private

  public :: differentiate

contains

  !> Derivatives of the nodes `wanted` by the variable or parameter whose node is `by`. A branch has that of the branch that
  !> is active; its jump where the branches differ is not part of it.
  pure subroutine differentiate(tape, wanted, by, derivative)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: wanted(:), by
    integer, intent(out) :: derivative(size(wanted))
    integer :: rate(tape%count), zero, i
    logical :: is_needed(tape%count)
    is_needed = needed(tape, wanted)
    call constant(tape, 0.0_wp, zero)
    rate = zero
    do i = 1, size(rate)
      if (i == by) then
        call constant(tape, 1.0_wp, rate(i))
      else if (is_needed(i)) then
        call rate_of(tape, i, rate, zero)
      end if
    end do
    derivative = rate(wanted)
  end subroutine differentiate

  !> Derivative of node i from those of its arguments.
  pure subroutine rate_of(tape, i, rate, zero)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: i, zero
    integer, intent(inout) :: rate(:)
    type(node_t) :: node
    integer :: inner, other
    node = tape%nodes(i)
    select case (node%operation)
    case (op_add, op_subtract)
      call binary(tape, node%operation, rate(node%first), rate(node%second), rate(i))
    case (op_multiply, op_divide, op_power, op_arc_tangent)
      call rate_of_two(tape, i, rate(node%first), rate(node%second), rate(i))
    case (op_select)
      rate(i) = rate(node%second)
      if (rate(i) /= rate(node%third)) call append(tape, node_t(op_select, node%first, rate(i), rate(node%third)), rate(i))
    case (op_negative)
      call unary(tape, op_negative, rate(node%first), rate(i))
    case (op_square, op_sqrt, op_exp, op_log, op_sin, op_cos, op_tan, op_asin, op_acos, op_atan, op_sinh, op_cosh, op_tanh)
      inner = rate(node%first)
      if (inner == zero) return
      call outer_rate(tape, i, other)
      if (any(node%operation == [op_sqrt, op_log, op_asin, op_acos, op_atan])) then
        call binary(tape, op_divide, inner, other, rate(i))
      else
        call binary(tape, op_multiply, inner, other, rate(i))
      end if
      other = rate(i)
      if (any(node%operation == [op_cos, op_acos])) call unary(tape, op_negative, other, rate(i))
    end select
  end subroutine rate_of

  !> The factor, or the divisor, that turns the derivative of the argument into that of a function of it, up to the sign.
  pure subroutine outer_rate(tape, i, outer)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: i
    integer, intent(out) :: outer
    type(node_t) :: node
    integer :: two
    node = tape%nodes(i)
    outer = node%partner
    select case (node%operation)
    case (op_square)
      call constant(tape, 2.0_wp, two)
      call binary(tape, op_multiply, two, node%first, outer)
    case (op_sqrt)
      call constant(tape, 2.0_wp, two)
      call binary(tape, op_multiply, two, i, outer)
    case (op_exp)
      outer = i
    case (op_log)
      outer = node%first
    end select
  end subroutine outer_rate

  !> Derivative of a product, quotient, power or angle.
  pure subroutine rate_of_two(tape, i, first, second, derivative)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: i, first, second
    integer, intent(out) :: derivative
    type(node_t) :: node
    integer :: left, right, whole
    node = tape%nodes(i)
    select case (node%operation)
    case (op_multiply)
      call binary(tape, op_multiply, first, node%second, left)
      call binary(tape, op_multiply, node%first, second, right)
      call binary(tape, op_add, left, right, derivative)
    case (op_divide)
      call binary(tape, op_multiply, i, second, right)
      call binary(tape, op_subtract, first, right, left)
      call binary(tape, op_divide, left, node%second, derivative)
    case (op_power)
      call rate_of_power(tape, node, first, left)
      call unary(tape, op_log, node%first, whole)
      call binary(tape, op_multiply, i, whole, right)
      call binary(tape, op_multiply, right, second, whole)
      call binary(tape, op_add, left, whole, derivative)
    case default
      call binary(tape, op_multiply, node%second, first, left)
      call binary(tape, op_multiply, node%first, second, right)
      call binary(tape, op_subtract, left, right, whole)
      call binary(tape, op_divide, whole, node%partner, derivative)
    end select
  end subroutine rate_of_two

  !> p a^(p - 1) times the derivative of the base a.
  pure subroutine rate_of_power(tape, node, first, derivative)
    type(tape_t), intent(inout) :: tape
    type(node_t), intent(in) :: node
    integer, intent(in) :: first
    integer, intent(out) :: derivative
    integer :: one, less, lower, scaled
    call constant(tape, 1.0_wp, one)
    call binary(tape, op_subtract, node%second, one, less)
    call power(tape, node%first, less, lower)
    call binary(tape, op_multiply, node%second, lower, scaled)
    call binary(tape, op_multiply, scaled, first, derivative)
  end subroutine rate_of_power

end module tape_derivative
