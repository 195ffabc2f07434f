! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A tape: the operations of one or several expressions in the order of their evaluation. Every node is computed once from
!> earlier nodes. An operation that is there already is found again instead of added.
module tape
  use kinds, only: int64, real64, wp
  use operations, only: op_constant, op_parameter, op_select, op_variable, operation_table
  implicit none
  private

  public :: new_tape, append, constant, variable, parameter_node, is_constant

  !> Most nodes of a tape.
  integer, parameter, public :: most_nodes = 20000
  integer, parameter :: buckets = 1024

  type, public :: node_t
    integer :: operation = 0
    !> Nodes of the arguments; number of the variable, the parameter or, of a branch, the switching function.
    integer :: first = 0, second = 0, third = 0
    !> Node that the Taylor series needs beside the arguments: the other one of sine and cosine, 1 + tan^2, sqrt(1 - a^2), ...
    integer :: partner = 0
    real(wp) :: value = 0
    !> It depends on no variable.
    logical :: is_steady = .false.
    !> Next node with the same hash.
    integer :: next = 0
  end type node_t

  !> A function whose sign selects a branch: the first one where it is positive.
  type, public :: switch_t
    integer :: argument = 0
    !> The branch where the argument is zero: 1, -1, or 0 for the mean of both, as in sign(0) = 0.
    integer :: at_zero = 1
  end type switch_t

  type, public :: tape_t
    integer :: count = 0
    type(node_t), allocatable :: nodes(:)
    type(switch_t), allocatable :: switches(:)
    !> More than `most_nodes` were needed: the tape must not be used.
    logical :: is_full = .false.
    integer, private :: head(0:buckets - 1) = 0
  end type tape_t

contains

  !> A tape without nodes.
  pure subroutine new_tape(tape)
    type(tape_t), intent(out) :: tape
    allocate (tape%nodes(64), tape%switches(0))
  end subroutine new_tape

  !> Node of a number.
  pure subroutine constant(tape, value, node)
    type(tape_t), intent(inout) :: tape
    real(wp), intent(in) :: value
    integer, intent(out) :: node
    call append(tape, node_t(op_constant, value=value, is_steady=.true.), node)
  end subroutine constant

  !> Node of variable `number`.
  pure subroutine variable(tape, number, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: number
    integer, intent(out) :: node
    call append(tape, node_t(op_variable, first=number), node)
  end subroutine variable

  !> Node of parameter `number`.
  pure subroutine parameter_node(tape, number, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: number
    integer, intent(out) :: node
    call append(tape, node_t(op_parameter, first=number, is_steady=.true.), node)
  end subroutine parameter_node

  !> Whether a node is the given number.
  pure logical function is_constant(tape, node, value)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: node
    real(wp), intent(in) :: value
    is_constant = tape%nodes(node)%operation == op_constant
    if (is_constant) is_constant = abs(tape%nodes(node)%value - value) <= 0
  end function is_constant

  !> Finds a node or adds it.
  pure subroutine append(tape, made, node)
    type(tape_t), intent(inout) :: tape
    type(node_t), intent(in) :: made
    integer, intent(out) :: node
    type(node_t), allocatable :: longer(:)
    integer :: hash
    hash = hash_of(made)
    node = tape%head(hash)
    do while (node > 0)
      if (is_same(tape%nodes(node), made)) return
      node = tape%nodes(node)%next
    end do
    if (tape%count >= most_nodes) then
      tape%is_full = .true.
      node = 1
      return
    end if
    if (tape%count == size(tape%nodes)) then
      allocate (longer(2*tape%count))
      longer(:tape%count) = tape%nodes
      call move_alloc(longer, tape%nodes)
    end if
    tape%count = tape%count + 1
    node = tape%count
    tape%nodes(node) = made
    tape%nodes(node)%next = tape%head(hash)
    tape%head(hash) = node
    tape%nodes(node)%is_steady = is_steady(tape, made)
  end subroutine append

  pure logical function is_steady(tape, made)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: made
    is_steady = made%is_steady
    if (made%operation == op_select) then
      is_steady = tape%nodes(made%second)%is_steady .and. tape%nodes(made%third)%is_steady &
        .and. tape%nodes(tape%switches(made%first)%argument)%is_steady
    else if (operation_table(made%operation)%arguments > 0) then
      is_steady = tape%nodes(made%first)%is_steady
      if (operation_table(made%operation)%arguments > 1) is_steady = is_steady .and. tape%nodes(made%second)%is_steady
    end if
  end function is_steady

  pure integer function hash_of(made)
    type(node_t), intent(in) :: made
    integer(int64) :: mixed
    mixed = iand(transfer(real(made%value, real64), 0_int64), 1125899906842623_int64)
    mixed = modulo(mixed, 1000003_int64) + 31*made%operation + 1009*made%first
    mixed = mixed + 100003_int64*made%second + 7919*made%third
    hash_of = int(modulo(mixed, int(buckets, int64)))
  end function hash_of

  pure logical function is_same(a, b)
    type(node_t), intent(in) :: a, b
    is_same = a%operation == b%operation .and. a%first == b%first .and. a%second == b%second .and. a%third == b%third &
      .and. abs(a%value - b%value) <= 0
  end function is_same

end module tape
