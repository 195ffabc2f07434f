! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Values of all nodes of a tape.
module tape_value
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use kinds, only: wp
  use operations, only: op_add, op_constant, op_divide, op_multiply, op_negative, op_parameter, op_select, op_subtract, &
    op_variable, operate, operation_table
  use tape, only: node_t, tape_t
  use text, only: to_text
  implicit none
  private

  public :: evaluate, evaluate_some, fault_text, sizes_of_nodes, starting_branches

contains

  !> Values of the nodes. `fault(i)` is the node whose operation was not defined, or too large, on which node i depends; its
  !> value is then 0. A branch that is not taken causes no fault. `branches`: sign of each switching function, otherwise that
  !> of its value.
  pure subroutine evaluate(tape, variables, parameters, value, fault, branches)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    real(wp), intent(out) :: value(tape%count)
    integer, intent(out) :: fault(tape%count)
    integer, intent(in), optional :: branches(:)
    integer :: i
    do i = 1, tape%count
      call take_node(tape, i, variables, parameters, value, fault, branches)
    end do
  end subroutine evaluate

  !> The same of the nodes `these` alone, in their order; those that they are made of have their values.
  pure subroutine evaluate_some(tape, these, variables, parameters, value, fault, branches)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: these(:)
    real(wp), intent(in) :: variables(:), parameters(:)
    real(wp), intent(inout) :: value(tape%count)
    integer, intent(inout) :: fault(tape%count)
    integer, intent(in) :: branches(:)
    real(wp) :: y
    integer :: at
    do at = 1, size(these)
      associate (i => these(at), it => tape%nodes(these(at)))
        ! Most operations are these, and defined.
        if (any(it%operation == [op_add, op_subtract, op_multiply])) then
          if (fault(it%first) == 0 .and. fault(it%second) == 0) then
            if (it%operation == op_add) then
              y = value(it%first) + value(it%second)
            else if (it%operation == op_subtract) then
              y = value(it%first) - value(it%second)
            else
              y = value(it%first)*value(it%second)
            end if
            if (abs(y) <= huge(y)) then
              value(i) = y
              fault(i) = 0
              cycle
            end if
          end if
        end if
        call take_node(tape, i, variables, parameters, value, fault, branches)
      end associate
    end do
  end subroutine evaluate_some

  pure subroutine take_node(tape, i, variables, parameters, value, fault, branches)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i
    real(wp), intent(in) :: variables(:), parameters(:)
    real(wp), intent(inout) :: value(tape%count)
    integer, intent(inout) :: fault(tape%count)
    integer, intent(in), optional :: branches(:)
    real(wp) :: chosen
    integer :: origin
    logical :: is_finite
    fault(i) = 0
    select case (tape%nodes(i)%operation)
    case (op_constant)
      value(i) = tape%nodes(i)%value
    case (op_variable)
      call take_number(variables(tape%nodes(i)%first), value(i), is_finite)
      if (.not. is_finite) fault(i) = i
    case (op_parameter)
      call take_number(parameters(tape%nodes(i)%first), value(i), is_finite)
      if (.not. is_finite) fault(i) = i
    case (op_select)
      call take_branch(tape, tape%nodes(i), value(:i - 1), fault(:i - 1), chosen, origin, branches)
      value(i) = chosen
      fault(i) = origin
    case default
      call take_operation(tape, i, value, fault)
    end select
  end subroutine take_node

  pure subroutine take_number(given, value, is_finite)
    real(wp), intent(in) :: given
    real(wp), intent(out) :: value
    logical, intent(out) :: is_finite
    is_finite = ieee_is_finite(given)
    value = 0
    if (is_finite) value = given
  end subroutine take_number

  pure subroutine take_operation(tape, i, value, fault)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i
    real(wp), intent(inout) :: value(:)
    integer, intent(inout) :: fault(:)
    integer :: a, b
    logical :: is_defined
    a = tape%nodes(i)%first
    b = a
    if (operation_table(tape%nodes(i)%operation)%arguments > 1) b = tape%nodes(i)%second
    fault(i) = fault(a)
    if (fault(i) == 0) fault(i) = fault(b)
    value(i) = 0
    if (fault(i) > 0) return
    call operate(tape%nodes(i)%operation, value(a), value(b), value(i), is_defined)
    if (.not. is_defined) fault(i) = i
  end subroutine take_operation

  pure subroutine take_branch(tape, node, value, fault, branch_value, branch_fault, branches)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    real(wp), intent(in) :: value(:)
    integer, intent(in) :: fault(:)
    real(wp), intent(out) :: branch_value
    integer, intent(out) :: branch_fault
    integer, intent(in), optional :: branches(:)
    integer :: argument, side
    logical :: is_given
    argument = tape%switches(node%first)%argument
    branch_value = 0
    is_given = .false.
    if (present(branches)) is_given = node%first <= size(branches)
    if (is_given) then
      side = branches(node%first)
    else
      branch_fault = fault(argument)
      if (branch_fault > 0) return
      side = tape%switches(node%first)%at_zero
      if (abs(value(argument)) > 0) side = merge(1, -1, value(argument) > 0)
    end if
    if (side > 0) then
      branch_fault = fault(node%second)
      branch_value = value(node%second)
    else if (side < 0) then
      branch_fault = fault(node%third)
      branch_value = value(node%third)
    else
      branch_fault = max(fault(node%second), fault(node%third))
      branch_value = 0.5_wp*(value(node%second) + value(node%third))
    end if
    ! A step that goes past the switch, as those do by which it is found, may leave where its branch is defined.
    if (.not. present(branches) .or. branch_fault == 0 .or. side*value(argument) >= 0 .or. fault(argument) > 0) return
    branch_fault = fault(merge(node%third, node%second, side > 0))
    branch_value = value(merge(node%third, node%second, side > 0))
  end subroutine take_branch

  !> Sizes of what the nodes are sums of, for their rounding; `of_variables` those of the variables.
  pure function sizes_of_nodes(tape, value, of_variables) result(sizes)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: value(:), of_variables(:)
    real(wp) :: sizes(tape%count)
    integer :: i
    do i = 1, tape%count
      sizes(i) = abs(value(i))
      associate (a => tape%nodes(i)%first, b => tape%nodes(i)%second, c => tape%nodes(i)%third)
        select case (tape%nodes(i)%operation)
        case (op_variable)
          sizes(i) = max(sizes(i), of_variables(a))
        case (op_add, op_subtract)
          sizes(i) = sizes(a) + sizes(b)
        case (op_negative)
          sizes(i) = sizes(a)
        case (op_multiply)
          sizes(i) = abs(value(a))*sizes(b) + sizes(a)*abs(value(b))
        case (op_divide)
          if (abs(value(b)) > 0) sizes(i) = (sizes(a) + abs(value(i))*sizes(b))/abs(value(b))
        case (op_select)
          sizes(i) = max(sizes(b), sizes(c))
        end select
      end associate
    end do
  end function sizes_of_nodes

  !> The branch of each switching function at a point, 1 or -1; 0 where its argument is zero or not defined.
  pure subroutine starting_branches(tape, variables, parameters, branches)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    integer, intent(out) :: branches(:)
    real(wp) :: value(tape%count)
    integer :: fault(tape%count), k, argument
    call evaluate(tape, variables, parameters, value, fault)
    do k = 1, size(branches)
      argument = tape%switches(k)%argument
      branches(k) = 0
      if (abs(value(argument)) > 0) branches(k) = merge(1, -1, value(argument) > 0)
    end do
  end subroutine starting_branches

  !> Reason of a fault: the operation and what it allows, and the value of its last argument.
  pure function fault_text(tape, node, value) result(text)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: node
    real(wp), intent(in) :: value(:)
    character(len=:), allocatable :: text
    integer :: operation, last
    operation = tape%nodes(node)%operation
    if (operation_table(operation)%arguments == 0) then
      text = trim(operation_table(operation)%name)//' '//to_text(tape%nodes(node)%first)//': found a number that is not finite'
      return
    end if
    last = tape%nodes(node)%first
    if (operation_table(operation)%arguments > 1) last = tape%nodes(node)%second
    text = trim(operation_table(operation)%name)//': found '//to_text(real(value(last), kind(1.0d0)))//', allowed: '// &
      trim(operation_table(operation)%domain)
  end function fault_text

end module tape_value
