! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Operations on nodes of a tape: constants are folded, and sums, products and quotients with 0, 1 and -1 simplified.
module tape_algebra
  use kinds, only: wp
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_constant, op_cos, op_cosh, op_divide, &
    op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh, operate
  use tape, only: append, constant, is_constant, node_t, switch_t, tape_t
  implicit none
  private

  public :: unary, binary, choice

contains

  !> Node of an operation with one argument.
  pure recursive subroutine unary(tape, operation, a, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: operation, a
    integer, intent(out) :: node
    type(node_t) :: argument
    integer :: partner
    call fold(tape, operation, a, a, node)
    if (node > 0) return
    argument = tape%nodes(a)
    partner = 0
    select case (operation)
    case (op_negative)
      if (argument%operation == op_negative) then
        node = argument%first
        return
      else if (argument%operation == op_subtract) then
        call append(tape, node_t(op_subtract, argument%second, argument%first), node)
        return
      end if
    case (op_square)
      if (argument%operation == op_negative) then
        call append(tape, node_t(op_square, argument%first), node)
        return
      end if
    case (op_cos, op_cosh)
      ! Its sine comes first and makes it.
      call unary(tape, merge(op_sin, op_sinh, operation == op_cos), a, partner)
      node = max(1, tape%nodes(partner)%partner)
      return
    case (op_asin, op_acos, op_atan)
      call arc_partner(tape, operation, a, partner)
    end select
    call append(tape, node_t(operation, a, partner=partner), node)
    call add_partner(tape, node)
  end subroutine unary

  !> sqrt(1 - a^2) or 1 + a^2, over which the rate of an arc is divided.
  pure recursive subroutine arc_partner(tape, operation, a, partner)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: operation, a
    integer, intent(out) :: partner
    integer :: one, square, rest
    call constant(tape, 1.0_wp, one)
    call unary(tape, op_square, a, square)
    if (operation == op_atan) then
      call binary(tape, op_add, one, square, partner)
    else
      call binary(tape, op_subtract, one, square, rest)
      call unary(tape, op_sqrt, rest, partner)
    end if
  end subroutine arc_partner

  !> What the series of a new node needs and comes after it: cosine, hyperbolic cosine, 1 + tan^2, 1 - tanh^2.
  pure subroutine add_partner(tape, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: node
    integer :: one, square, partner
    if (tape%nodes(node)%partner > 0) return
    select case (tape%nodes(node)%operation)
    case (op_sin)
      call append(tape, node_t(op_cos, tape%nodes(node)%first, partner=node), partner)
    case (op_sinh)
      call append(tape, node_t(op_cosh, tape%nodes(node)%first, partner=node), partner)
    case (op_tan, op_tanh)
      call constant(tape, 1.0_wp, one)
      call append(tape, node_t(op_square, node), square)
      call append(tape, node_t(merge(op_add, op_subtract, tape%nodes(node)%operation == op_tan), one, square), partner)
    case default
      return
    end select
    tape%nodes(node)%partner = partner
  end subroutine add_partner

  !> Node of an operation with two arguments.
  pure recursive subroutine binary(tape, operation, a, b, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: operation, a, b
    integer, intent(out) :: node
    integer :: squares(2), partner
    call fold(tape, operation, a, b, node)
    if (node > 0) return
    select case (operation)
    case (op_add, op_subtract)
      call sum_of(tape, operation, a, b, node)
    case (op_multiply)
      call product_of(tape, a, b, node)
    case (op_divide)
      call quotient_of(tape, a, b, node)
    case (op_power)
      call append(tape, node_t(op_power, a, b), node)
    case (op_arc_tangent)
      call unary(tape, op_square, a, squares(1))
      call unary(tape, op_square, b, squares(2))
      call binary(tape, op_add, squares(1), squares(2), partner)
      call append(tape, node_t(op_arc_tangent, a, b, partner=partner), node)
    end select
  end subroutine binary

  pure recursive subroutine sum_of(tape, operation, a, b, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: operation, a, b
    integer, intent(out) :: node
    type(node_t) :: first, second
    first = tape%nodes(a)
    second = tape%nodes(b)
    if (is_constant(tape, b, 0.0_wp)) then
      node = a
    else if (is_constant(tape, a, 0.0_wp)) then
      node = b
      if (operation == op_subtract) call unary(tape, op_negative, b, node)
    else if (second%operation == op_negative) then
      call binary(tape, merge(op_subtract, op_add, operation == op_add), a, second%first, node)
    else if (operation == op_subtract) then
      if (a == b) then
        call constant(tape, 0.0_wp, node)
      else
        call append(tape, node_t(op_subtract, a, b), node)
      end if
    else if (first%operation == op_negative) then
      call binary(tape, op_subtract, b, first%first, node)
    else
      call append(tape, node_t(op_add, min(a, b), max(a, b)), node)
    end if
  end subroutine sum_of

  pure recursive subroutine product_of(tape, a, b, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: a, b
    integer, intent(out) :: node
    type(node_t) :: first, second
    integer :: opposite
    first = tape%nodes(a)
    second = tape%nodes(b)
    if (is_constant(tape, a, 0.0_wp) .or. is_constant(tape, b, 0.0_wp)) then
      call constant(tape, 0.0_wp, node)
    else if (is_constant(tape, a, 1.0_wp)) then
      node = b
    else if (is_constant(tape, b, 1.0_wp)) then
      node = a
    else if (is_constant(tape, a, -1.0_wp)) then
      call unary(tape, op_negative, b, node)
    else if (is_constant(tape, b, -1.0_wp)) then
      call unary(tape, op_negative, a, node)
    else if (a == b) then
      call unary(tape, op_square, a, node)
    else if (first%operation == op_negative) then
      call binary(tape, op_multiply, first%first, b, opposite)
      call unary(tape, op_negative, opposite, node)
    else if (second%operation == op_negative) then
      call binary(tape, op_multiply, a, second%first, opposite)
      call unary(tape, op_negative, opposite, node)
    else
      call append(tape, node_t(op_multiply, min(a, b), max(a, b)), node)
    end if
  end subroutine product_of

  pure recursive subroutine quotient_of(tape, a, b, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: a, b
    integer, intent(out) :: node
    integer :: opposite
    if (is_constant(tape, b, 1.0_wp)) then
      node = a
    else if (is_constant(tape, a, 0.0_wp) .and. .not. is_constant(tape, b, 0.0_wp)) then
      node = a
    else if (tape%nodes(a)%operation == op_negative) then
      call binary(tape, op_divide, tape%nodes(a)%first, b, opposite)
      call unary(tape, op_negative, opposite, node)
    else
      call append(tape, node_t(op_divide, a, b), node)
    end if
  end subroutine quotient_of

  !> Node that is `above` where `argument` is positive, else `below`; where it is zero, by `at_zero` as in `switch_t`.
  pure recursive subroutine choice(tape, argument, at_zero, above, below, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: argument, at_zero, above, below
    integer, intent(out) :: node
    type(node_t) :: inner
    integer :: k, half, total
    inner = tape%nodes(argument)
    if (above == below) then
      node = above
      return
    else if (inner%operation == op_constant) then
      node = merge(above, below, inner%value > 0 .or. (.not. abs(inner%value) > 0 .and. at_zero > 0))
      if (abs(inner%value) > 0 .or. at_zero /= 0) return
      call binary(tape, op_add, above, below, total)
      call constant(tape, 0.5_wp, half)
      call binary(tape, op_multiply, half, total, node)
      return
    else if (inner%operation == op_negative) then
      call choice(tape, inner%first, -at_zero, below, above, node)
      return
    else if (inner%operation == op_subtract .and. inner%first > inner%second) then
      ! One orientation, so that a < b and b < a are the same switching function.
      call append(tape, node_t(op_subtract, inner%second, inner%first), k)
      call choice_of_switch(tape, k, -at_zero, [below, above], node)
      return
    end if
    call choice_of_switch(tape, argument, at_zero, [above, below], node)
  end subroutine choice

  pure subroutine choice_of_switch(tape, argument, at_zero, branches, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: argument, at_zero, branches(2)
    integer, intent(out) :: node
    integer :: k
    do k = 1, size(tape%switches)
      if (tape%switches(k)%argument == argument .and. tape%switches(k)%at_zero == at_zero) exit
    end do
    if (k > size(tape%switches)) tape%switches = [tape%switches, switch_t(argument, at_zero)]
    call append(tape, node_t(op_select, k, branches(1), branches(2)), node)
  end subroutine choice_of_switch

  !> The constant that an operation on constants gives; 0 where they are none, or the operation is not defined for them and
  !> will be reported when it is computed.
  pure subroutine fold(tape, operation, a, b, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: operation, a, b
    integer, intent(out) :: node
    real(wp) :: value
    logical :: is_defined
    node = 0
    if (tape%nodes(a)%operation /= op_constant .or. tape%nodes(b)%operation /= op_constant) return
    call operate(operation, tape%nodes(a)%value, tape%nodes(b)%value, value, is_defined)
    if (is_defined) call constant(tape, value, node)
  end subroutine fold

end module tape_algebra
