! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which recurrence of Taylor coefficients each node has, chosen once, and in what order they are evaluated.
module series_program
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_cos, op_cosh, op_divide, op_exp, op_log, &
    op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh, op_variable
  use tape, only: node_t, tape_t
  implicit none
  private

  public :: compile, put_termwise_last

  !> Kinds of recurrences: the integral of a rate; a copy; sums; products with something steady, with something linear in time, of
  !> two series; quotients; functions with the derivative a' b, a being linear in time or not; the other functions; of two
  !> branches, where none is chosen, the larger bound; functions with the derivative a' b of a variable a; one series or the sum of
  !> two, each with a steady factor, and the same over something steady.
  integer, parameter, public :: of_rate = 1, copy = 2, minus = 3, add = 4, subtract = 5, scaled = 6, by_linear = 7, multiply = 8, &
    square = 9, over_steady = 10, divide = 11, turn = 12, by_rate = 13, turn_back = 14, by_rate_back = 15, root = 16, power = 17, &
    log_of = 18, arc = 19, arc_back = 20, angle = 21, larger = 22, by_variable = 23, by_variable_back = 24, one_term = 25, &
    two_terms = 26, one_over = 27, two_over = 28

  !> What gives the coefficients of a node: those of nodes a and b.
  type, public :: instruction_t
    integer :: kind = copy, node = 0, a = 0, b = 0
    !> The partner of a function of two arguments, or the rate of a variable; the node that is divided by, 0 for none.
    integer :: partner = 0, divisor = 0
    !> Number of the variable that the node is, 0 for none.
    integer :: variable = 0
    !> Of terms: the nodes of their factors, 0 for none, and whether they change sign.
    integer :: factor_a = 0, factor_b = 0
    logical :: minus_a = .false., minus_b = .false.
    !> Where the coefficients of the node, of a, b and the partner begin.
    integer :: at_node = 0, at_a = 0, at_b = 0, at_partner = 0
  end type instruction_t

  !> Beyond order 0 a node is this one, with a steady factor, 0 for none, and a sign.
  type :: term_t
    integer :: node = 0, factor = 0
    logical :: is_minus = .false.
  end type term_t

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
  !> orders need not be raised in turn. `together` is the number of the others; of these, terms of sums are not kept.
  pure subroutine put_termwise_last(program, nodes, order, together)
    type(instruction_t), intent(inout) :: program(:)
    integer, intent(in) :: nodes, order
    integer, intent(out) :: together
    type(instruction_t) :: combined(size(program))
    type(term_t) :: terms(0:nodes)
    logical :: is_needed(0:nodes), is_first(size(program))
    integer :: number(0:nodes), at, before
    terms%node = [(at, at=0, nodes)]
    number = 0
    do at = 1, size(program)
      number(program(at)%node) = at
      terms(program(at)%node) = term_of(program(at), terms)
      combined(at) = combination_of(program(at), program, number, terms)
    end do
    is_needed = .false.
    do at = 1, size(program)
      if (.not. is_termwise(program(at)%kind)) is_needed(program(at)%node) = .true.
    end do
    do
      before = count(is_needed)
      do at = size(program), 1, -1
        if (is_needed(combined(at)%node)) is_needed([combined(at)%a, combined(at)%b, combined(at)%partner]) = .true.
      end do
      if (count(is_needed) == before) exit
    end do
    is_first = is_needed(program%node)
    together = count(is_first)
    program = [pack(combined, is_first), pack(program, .not. is_first)]
    program%at_node = (program%node - 1)*(order + 1)
    program%at_a = (program%a - 1)*(order + 1)
    program%at_b = (program%b - 1)*(order + 1)
    program%at_partner = (program%partner - 1)*(order + 1)
  end subroutine put_termwise_last

  pure logical function is_termwise(kind)
    integer, intent(in) :: kind
    is_termwise = any(kind == [copy, minus, add, subtract, scaled, over_steady, larger])
  end function is_termwise

  !> A node as a term of another: two factors would not round as they do one by one.
  pure type(term_t) function term_of(it, terms) result(term)
    type(instruction_t), intent(in) :: it
    type(term_t), intent(in) :: terms(0:)
    term = term_t(it%node)
    select case (it%kind)
    case (copy)
      term = terms(it%a)
    case (minus)
      term = terms(it%a)
      term%is_minus = .not. term%is_minus
    case (scaled)
      if (terms(it%b)%factor == 0) term = term_t(terms(it%b)%node, it%a, terms(it%b)%is_minus)
    end select
  end function term_of

  !> The same coefficients, to the last bit, from terms that need not be kept.
  pure type(instruction_t) function combination_of(it, program, number, terms) result(made)
    type(instruction_t), intent(in) :: it, program(:)
    integer, intent(in) :: number(0:)
    type(term_t), intent(in) :: terms(0:)
    integer :: sum_at
    made = it
    select case (it%kind)
    case (copy, minus)
      call set_terms(one_term, term_of(it, terms), term_t(), made)
    case (scaled)
      call set_terms(one_term, term_t(it%b, it%a), term_t(), made)
      if (terms(it%b)%factor == 0) call set_terms(one_term, term_of(it, terms), term_t(), made)
    case (add, subtract)
      call set_terms(two_terms, terms(it%a), terms(it%b), made)
      if (it%kind == subtract) made%minus_b = .not. made%minus_b
    case (over_steady)
      call set_terms(one_over, terms(it%a), term_t(), made)
      if (made%factor_a > 0 .or. made%minus_a) return
      sum_at = number(made%a)
      if (sum_at == 0) return
      if (all(program(sum_at)%kind /= [add, subtract])) return
      call set_terms(two_over, terms(program(sum_at)%a), terms(program(sum_at)%b), made)
      if (program(sum_at)%kind == subtract) made%minus_b = .not. made%minus_b
    end select
  end function combination_of

  pure subroutine set_terms(kind, first, second, made)
    integer, intent(in) :: kind
    type(term_t), intent(in) :: first, second
    type(instruction_t), intent(inout) :: made
    made%kind = kind
    made%a = first%node
    made%factor_a = first%factor
    made%minus_a = first%is_minus
    made%b = second%node
    made%factor_b = second%factor
    made%minus_b = second%is_minus
  end subroutine set_terms

end module series_program
