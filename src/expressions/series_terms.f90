! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Recurrences of the Taylor coefficients of nodes: which one each node has, chosen once, and their terms, order by order.
module series_terms
  use kinds, only: wp
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_cos, op_cosh, op_divide, op_exp, op_log, &
    op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh, op_variable
  use tape, only: node_t, tape_t
  implicit none
  private

  public :: compile, put_termwise_last, raise_all

  !> Kinds of recurrences: the integral of a rate; a copy; sums; products with something steady, with something linear in time, of
  !> two series; quotients; functions with the derivative a' b, a being linear in time or not; the other functions; of two
  !> branches, where none is chosen, the larger bound; functions with the derivative a' b of a variable a.
  integer, parameter :: of_rate = 1, copy = 2, minus = 3, add = 4, subtract = 5, scaled = 6, by_linear = 7, multiply = 8, &
    square = 9, over_steady = 10, divide = 11, turn = 12, by_rate = 13, turn_back = 14, by_rate_back = 15, root = 16, power = 17, &
    log_of = 18, arc = 19, arc_back = 20, angle = 21, larger = 22, by_variable = 23, by_variable_back = 24

  !> What gives the coefficients of a node: those of nodes a and b.
  type, public :: instruction_t
    integer :: kind = copy, node = 0, a = 0, b = 0
    !> The partner of a function of two arguments, or the rate of a variable; the node that is divided by, 0 for none.
    integer :: partner = 0, divisor = 0
    !> Number of the variable that the node is, 0 for none.
    integer :: variable = 0
    !> Where the coefficients of the node, of a, b and the partner begin.
    integer :: at_node = 0, at_a = 0, at_b = 0, at_partner = 0
  end type instruction_t

contains

  !> The instructions for the nodes in use that vary, in their order. `rates`: node of the rate of each variable.
  pure subroutine compile(tape, rates, branches, is_used, program)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: rates(:), branches(:)
    logical, intent(in) :: is_used(:)
    type(instruction_t), allocatable, intent(out) :: program(:)
    logical :: is_linear(tape%count)
    integer :: i, k
    allocate (program(count(is_used .and. .not. tape%nodes(:tape%count)%is_steady)))
    do i = 1, tape%count
      is_linear(i) = tape%nodes(i)%is_steady
      if (tape%nodes(i)%operation == op_variable) is_linear(i) = tape%nodes(rates(tape%nodes(i)%first))%is_steady
    end do
    k = 0
    do i = 1, tape%count
      if (.not. is_used(i) .or. tape%nodes(i)%is_steady) cycle
      k = k + 1
      call choose(tape, i, rates, branches, is_linear, program(k))
      program(k)%node = i
    end do
  end subroutine compile

  !> The recurrence of a node, and whether it is linear in time.
  pure subroutine choose(tape, i, rates, branches, is_linear, chosen)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i, rates(:), branches(:)
    logical, intent(inout) :: is_linear(:)
    type(instruction_t), intent(inout) :: chosen
    associate (node => tape%nodes(i))
      chosen%a = node%first
      select case (node%operation)
      case (op_variable)
        chosen = instruction_t(of_rate, a=rates(node%first), variable=node%first)
      case (op_select)
        if (node%first <= size(branches)) then
          chosen%a = merge(node%second, node%third, branches(node%first) > 0)
          is_linear(i) = is_linear(chosen%a)
        else
          chosen = instruction_t(larger, a=node%second, b=node%third)
        end if
      case (op_add, op_subtract, op_negative)
        call choose_sum(tape, node, chosen)
        is_linear(i) = is_linear(chosen%a)
        if (chosen%b > 0) is_linear(i) = is_linear(i) .and. is_linear(chosen%b)
      case (op_multiply)
        call choose_product(tape, node, is_linear, chosen)
        is_linear(i) = chosen%kind == scaled .and. is_linear(chosen%b)
      case (op_divide)
        chosen = instruction_t(divide, a=node%first, b=node%second, divisor=node%second)
        if (tape%nodes(node%second)%is_steady) chosen%kind = over_steady
        is_linear(i) = chosen%kind == over_steady .and. is_linear(node%first)
      case default
        call choose_function(node, i, is_linear(node%first), chosen)
        if (tape%nodes(node%first)%operation == op_variable) call choose_variable(rates(tape%nodes(node%first)%first), chosen)
      end select
    end associate
  end subroutine choose

  !> Of a variable the rate is at hand: its series, not the derivative of that of the variable.
  pure subroutine choose_variable(rate, chosen)
    integer, intent(in) :: rate
    type(instruction_t), intent(inout) :: chosen
    select case (chosen%kind)
    case (by_rate)
      chosen%kind = by_variable
    case (by_rate_back)
      chosen%kind = by_variable_back
    case default
      return
    end select
    chosen%partner = rate
  end subroutine choose_variable

  !> A sum or difference: of what is steady only the first coefficient is not zero.
  pure subroutine choose_sum(tape, node, chosen)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    type(instruction_t), intent(inout) :: chosen
    if (node%operation == op_negative) then
      chosen%kind = minus
    else if (tape%nodes(node%second)%is_steady) then
      chosen%kind = copy
    else if (tape%nodes(node%first)%is_steady) then
      chosen%kind = merge(minus, copy, node%operation == op_subtract)
      chosen%a = node%second
    else
      chosen%kind = merge(subtract, add, node%operation == op_subtract)
      chosen%b = node%second
    end if
  end subroutine choose_sum

  pure subroutine choose_product(tape, node, is_linear, chosen)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    logical, intent(in) :: is_linear(:)
    type(instruction_t), intent(inout) :: chosen
    chosen%kind = multiply
    if (is_linear(node%first) .or. is_linear(node%second)) chosen%kind = by_linear
    if (tape%nodes(node%first)%is_steady .or. tape%nodes(node%second)%is_steady) chosen%kind = scaled
    chosen%b = node%second
    if (chosen%kind == multiply) return
    if (chosen%kind == by_linear .and. is_linear(node%first)) return
    if (tape%nodes(node%first)%is_steady) return
    chosen%a = node%second
    chosen%b = node%first
  end subroutine choose_product

  !> A function of one argument, or the angle of two.
  pure subroutine choose_function(node, i, turns, chosen)
    type(node_t), intent(in) :: node
    integer, intent(in) :: i
    logical, intent(in) :: turns
    type(instruction_t), intent(inout) :: chosen
    chosen%b = node%partner
    select case (node%operation)
    case (op_square)
      chosen%kind = square
    case (op_sqrt)
      chosen%kind = root
      chosen%divisor = i
    case (op_power)
      chosen%kind = power
      chosen%b = node%second
      chosen%divisor = node%first
    case (op_exp)
      chosen%kind = merge(turn, by_rate, turns)
      chosen%b = i
    case (op_sin, op_sinh, op_cosh, op_tan, op_tanh)
      chosen%kind = merge(turn, by_rate, turns)
    case (op_cos)
      chosen%kind = merge(turn_back, by_rate_back, turns)
    case (op_log)
      chosen%kind = log_of
      chosen%b = node%first
      chosen%divisor = node%first
    case (op_asin, op_atan)
      chosen%kind = arc
      chosen%divisor = node%partner
    case (op_acos)
      chosen%kind = arc_back
      chosen%divisor = node%partner
    case (op_arc_tangent)
      chosen%kind = angle
      chosen%b = node%second
      chosen%partner = node%partner
      chosen%divisor = node%partner
    end select
  end subroutine choose_function

  !> Puts the instructions last whose coefficients depend on those of the same order alone, and which no others need: for them,
  !> orders need not be raised in turn. `together` is the number of the others.
  pure subroutine put_termwise_last(program, nodes, order, together)
    type(instruction_t), intent(inout) :: program(:)
    integer, intent(in) :: nodes, order
    integer, intent(out) :: together
    logical :: is_needed(0:nodes), is_first(size(program))
    integer :: source(0:nodes), at, before
    source = [(at, at=0, nodes)]
    is_needed = .false.
    do at = 1, size(program)
      associate (it => program(at))
        ! Beyond order 0 a copy is its original.
        if (it%kind == copy) source(it%node) = source(it%a)
        if (any(it%kind == [copy, minus, add, subtract, over_steady])) it%a = source(it%a)
        if (any(it%kind == [add, subtract, scaled])) it%b = source(it%b)
        if (.not. is_termwise(it%kind)) is_needed(it%node) = .true.
      end associate
    end do
    do
      before = count(is_needed)
      do at = size(program), 1, -1
        if (is_needed(program(at)%node)) is_needed([program(at)%a, program(at)%b, program(at)%partner]) = .true.
      end do
      if (count(is_needed) == before) exit
    end do
    is_first = is_needed(program%node)
    together = count(is_first)
    program = [pack(program, is_first), pack(program, .not. is_first)]
    program%at_node = (program%node - 1)*(order + 1)
    program%at_a = (program%a - 1)*(order + 1)
    program%at_b = (program%b - 1)*(order + 1)
    program%at_partner = (program%partner - 1)*(order + 1)
  end subroutine put_termwise_last

  pure logical function is_termwise(kind)
    integer, intent(in) :: kind
    is_termwise = any(kind == [copy, minus, add, subtract, scaled, over_steady, larger])
  end function is_termwise

  !> Coefficients from order 1 on, from those of order 0; see `raise_orders`. `fault` is 0, or minus the node whose coefficient
  !> is too large.
  pure subroutine raise_all(program, together, order, unit, sign, divisor, c, fault)
    type(instruction_t), intent(in) :: program(:)
    integer, intent(in) :: together, order
    real(wp), intent(in) :: unit, sign, divisor(:)
    real(wp), intent(inout) :: c(0:order, size(divisor))
    integer, intent(out) :: fault
    integer :: at
    call raise_together(together, program, order, unit, sign, divisor, c, fault)
    do at = together + 1, size(program)
      if (fault /= 0) return
      call raise_termwise(program(at), order, sign, divisor, c)
      if (.not. all(abs(c(1:, program(at)%node)) <= huge(1.0_wp))) fault = -program(at)%node
    end do
  end subroutine raise_all

  !> All orders of a node whose coefficients depend on those of the same order alone.
  pure subroutine raise_termwise(it, order, sign, divisor, c)
    type(instruction_t), intent(in) :: it
    integer, intent(in) :: order
    real(wp), intent(in) :: sign, divisor(:)
    real(wp), intent(inout) :: c(0:order, size(divisor))
    associate (a => it%a, b => it%b, i => it%node)
      select case (it%kind)
      case (copy)
        c(1:, i) = c(1:, a)
      case (minus)
        c(1:, i) = sign*c(1:, a)
      case (add)
        c(1:, i) = c(1:, a) + c(1:, b)
      case (subtract)
        c(1:, i) = c(1:, a) + sign*c(1:, b)
      case (scaled)
        c(1:, i) = c(0, a)*c(1:, b)
      case (over_steady)
        c(1:, i) = c(1:, a)/divisor(b)
      case (larger)
        c(1:, i) = max(c(1:, a), c(1:, b))
      end select
    end associate
  end subroutine raise_termwise

  !> The coefficients of nodes that need each other, order by order.
  pure subroutine raise_together(count, program, order, unit, sign, divisor, c, fault)
    integer, intent(in) :: count, order
    type(instruction_t), intent(in) :: program(count)
    real(wp), intent(in) :: unit, sign, divisor(:)
    real(wp), intent(inout) :: c(0:size(divisor)*(order + 1) - 1)
    integer, intent(out) :: fault
    real(wp) :: y
    integer :: k, at
    fault = 0
    do k = 1, order
      do at = 1, count
        associate (it => program(at), a => program(at)%at_a, b => program(at)%at_b)
          select case (it%kind)
          case (larger)
            y = max(c(a + k), c(b + k))
          case (of_rate)
            y = unit*c(a + k - 1)/k
          case (copy)
            y = c(a + k)
          case (minus)
            y = sign*c(a + k)
          case (add)
            y = c(a + k) + c(b + k)
          case (subtract)
            y = c(a + k) + sign*c(b + k)
          case (scaled)
            y = c(a)*c(b + k)
          case (by_linear)
            y = c(a)*c(b + k) + c(a + 1)*c(b + k - 1)
          case (multiply)
            y = product_term(c(a), c(b), k)
          case (square)
            y = square_term(c(a), k)
          case (over_steady)
            y = c(a + k)/divisor(it%b)
          case (divide)
            y = (c(a + k) + sign*inner_products(c(it%at_node), c(b), k))/divisor(it%b)
          case (turn)
            y = c(a + 1)*c(b + k - 1)/k
          case (turn_back)
            y = sign*(c(a + 1)*c(b + k - 1))/k
          case (by_rate)
            y = rate_products(c(a), c(b), k, k)/k
          case (by_rate_back)
            y = sign*rate_products(c(a), c(b), k, k)/k
          case (by_variable)
            y = unit*product_term(c(it%at_partner), c(b), k - 1)/k
          case (by_variable_back)
            y = sign*unit*product_term(c(it%at_partner), c(b), k - 1)/k
          case default
            y = function_term(it, k, sign, divisor, order, c)
          end select
          c(it%at_node + k) = y
          if (abs(y) <= huge(1.0_wp)) cycle
          fault = -it%node
        end associate
        return
      end do
    end do
  end subroutine raise_together

  !> The same for roots, powers, logarithms and angles: solutions of linear differential equations of first order in the argument.
  pure real(wp) function function_term(it, k, sign, divisor, order, c) result(y)
    type(instruction_t), intent(in) :: it
    integer, intent(in) :: k, order
    real(wp), intent(in) :: sign, divisor(:), c(0:order, size(divisor))
    real(wp) :: weight
    integer :: j
    y = 0
    associate (i => it%node, a => it%a, b => it%b)
      select case (it%kind)
      case (root)
        do j = 1, k - 1
          y = y + c(j, i)*c(k - j, i)
        end do
        y = (c(k, a) + sign*y)/(2*divisor(i))
      case (power)
        do j = 1, k
          weight = c(0, b)*j
          if (sign > 0) weight = abs(weight) + (k - j)
          if (sign < 0) weight = weight - (k - j)
          y = y + weight*c(j, a)*c(k - j, i)
        end do
        y = y/(k*divisor(a))
      case (log_of, arc)
        y = (k*c(k, a) + sign*rate_products(c(0, i), c(0, b), k, k - 1))/(k*divisor(it%divisor))
      case (arc_back)
        y = sign*(k*c(k, a) + rate_products(c(0, i), c(0, b), k, k - 1))/(k*divisor(b))
      case (angle)
        y = rate_products(c(0, a), c(0, b), k, k) + sign*rate_products(c(0, b), c(0, a), k, k)
        y = (y + sign*rate_products(c(0, i), c(0, it%partner), k, k - 1))/(k*divisor(it%partner))
      end select
    end associate
  end function function_term

  !> Sum of a(i) b(k - i), i = 0 ... k. In two parts, so that additions need not wait for each other.
  pure real(wp) function product_term(a, b, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(0:k), b(0:k)
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 0, k - 1, 2
      total = total + a(i)*b(k - i)
      other = other + a(i + 1)*b(k - i - 1)
    end do
    total = total + other
    if (modulo(k, 2) == 0) total = total + a(k)*b(0)
  end function product_term

  pure real(wp) function square_term(a, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(0:k)
    integer :: i
    total = 0
    do i = 0, (k - 1)/2
      total = total + a(i)*a(k - i)
    end do
    total = 2*total
    if (modulo(k, 2) == 0) total = total + a(k/2)**2
  end function square_term

  !> Sum of y(i) b(k - i), i = 0 ... k - 1.
  pure real(wp) function inner_products(y, b, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: y(0:k), b(0:k)
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 0, k - 2, 2
      total = total + y(i)*b(k - i)
      other = other + y(i + 1)*b(k - i - 1)
    end do
    total = total + other
    if (modulo(k, 2) == 1) total = total + y(k - 1)*b(1)
  end function inner_products

  !> Sum of j a(j) u(k - j), j = 1 ... last.
  pure real(wp) function rate_products(a, u, k, last) result(total)
    integer, intent(in) :: k, last
    real(wp), intent(in) :: a(0:k), u(0:k)
    real(wp) :: other
    integer :: j
    total = 0
    other = 0
    do j = 1, last - 1, 2
      total = total + j*a(j)*u(k - j)
      other = other + (j + 1)*a(j + 1)*u(k - j - 1)
    end do
    total = total + other
    if (modulo(last, 2) == 1) total = total + last*a(last)*u(k - last)
  end function rate_products

end module series_terms
