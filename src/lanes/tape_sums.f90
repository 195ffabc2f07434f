! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Sums, differences and multiples on a tape that only serve one another, as one operation each: a sum of nodes times what does not
!> vary.
module tape_sums
  use kinds, only: wp
  use operations, only: op_add, op_divide, op_multiply, op_negative, op_select, op_subtract, operation_table
  use tape, only: constant, tape_t
  use tape_algebra, only: binary, unary
  implicit none
  private

  public :: find_sums

  !> A sum of `nodes` times `factors`, and of what does not vary (0: nothing).
  type, public :: tape_sum_t
    integer, allocatable :: nodes(:), factors(:)
    integer :: steady = 0
  end type tape_sum_t

contains

  !> The sums among the nodes in use; `number` of each node is its sum, 0 of others. `wanted` nodes stay. What sums take up is no
  !> longer in use; the tape gets nodes for the factors, which are in use.
  pure subroutine find_sums(tape, wanted, is_used, sums, number)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: wanted(:)
    logical, allocatable, intent(inout) :: is_used(:)
    type(tape_sum_t), allocatable, intent(out) :: sums(:)
    integer, allocatable, intent(out) :: number(:)
    type(tape_sum_t) :: made
    integer :: uses(tape%count), i, one, before
    logical :: absorbed(tape%count)
    uses = count_uses(tape, wanted, is_used)
    before = tape%count
    absorbed = .false.
    allocate (sums(0), number(before))
    number = 0
    call constant(tape, 1.0_wp, one)
    do i = before, 1, -1
      if (.not. is_used(i) .or. absorbed(i) .or. .not. is_linear(tape, i)) cycle
      made = tape_sum_t([integer ::], [integer ::])
      call add_terms(tape, i, one, uses, made, absorbed)
      absorbed(i) = .false.
      sums = [sums, made]
      number(i) = size(sums)
    end do
    is_used = [is_used .and. .not. absorbed, (.false., i=before + 1, tape%count)]
    number = [number, (0, i=before + 1, tape%count)]
    do i = 1, size(sums)
      call mark_steady(tape, [sums(i)%factors, pack([sums(i)%steady], [sums(i)%steady > 0])], is_used)
    end do
  end subroutine find_sums

  !> How many nodes in use need each node; those that must stay count twice.
  pure function count_uses(tape, wanted, is_used) result(uses)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: wanted(:)
    logical, intent(in) :: is_used(:)
    integer :: uses(tape%count), i
    uses = 0
    uses(wanted) = 2
    uses(tape%switches%argument) = 2
    do i = 1, tape%count
      if (.not. is_used(i)) cycle
      associate (node => tape%nodes(i))
        if (node%partner > 0) uses(node%partner) = uses(node%partner) + 1
        if (node%operation == op_select) then
          uses(node%second) = uses(node%second) + 1
          uses(node%third) = uses(node%third) + 1
          cycle
        end if
        if (operation_table(node%operation)%arguments > 0) uses(node%first) = uses(node%first) + 1
        if (operation_table(node%operation)%arguments > 1) uses(node%second) = uses(node%second) + 1
      end associate
    end do
  end function count_uses

  !> Whether a node varies and is a sum, a difference, an opposite or a multiple.
  pure logical function is_linear(tape, i)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i
    associate (node => tape%nodes(i), nodes => tape%nodes)
      is_linear = .not. node%is_steady
      if (.not. is_linear) return
      select case (node%operation)
      case (op_add, op_subtract, op_negative)
        is_linear = .true.
      case (op_multiply)
        is_linear = nodes(node%first)%is_steady .or. nodes(node%second)%is_steady
      case (op_divide)
        is_linear = nodes(node%second)%is_steady
      case default
        is_linear = .false.
      end select
    end associate
  end function is_linear

  !> Adds the terms of a linear node times a factor.
  pure recursive subroutine add_terms(tape, i, factor, uses, made, absorbed)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: i, factor, uses(:)
    type(tape_sum_t), intent(inout) :: made
    logical, intent(inout) :: absorbed(:)
    integer :: first, second, other
    first = tape%nodes(i)%first
    second = tape%nodes(i)%second
    absorbed(i) = .true.
    other = factor
    select case (tape%nodes(i)%operation)
    case (op_add)
      call add_term(tape, second, other, uses, made, absorbed)
    case (op_subtract)
      call unary(tape, op_negative, factor, other)
      call add_term(tape, second, other, uses, made, absorbed)
      other = factor
    case (op_negative)
      call unary(tape, op_negative, factor, other)
    case (op_divide)
      call binary(tape, op_divide, factor, second, other)
    case (op_multiply)
      if (tape%nodes(first)%is_steady) then
        call binary(tape, op_multiply, factor, first, other)
        first = second
      else
        call binary(tape, op_multiply, factor, second, other)
      end if
    end select
    call add_term(tape, first, other, uses, made, absorbed)
  end subroutine add_terms

  !> Adds a node times a factor, or its terms if nothing else needs it.
  pure recursive subroutine add_term(tape, i, factor, uses, made, absorbed)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: i, factor, uses(:)
    type(tape_sum_t), intent(inout) :: made
    logical, intent(inout) :: absorbed(:)
    integer :: product, total
    if (tape%nodes(i)%is_steady) then
      call binary(tape, op_multiply, factor, i, product)
      total = product
      if (made%steady > 0) call binary(tape, op_add, made%steady, product, total)
      made%steady = total
    else if (is_linear(tape, i) .and. uses(i) == 1) then
      call add_terms(tape, i, factor, uses, made, absorbed)
    else
      made%nodes = [made%nodes, i]
      made%factors = [made%factors, factor]
    end if
  end subroutine add_term

  !> Marks nodes that do not vary, with what they need.
  pure subroutine mark_steady(tape, nodes, is_used)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: nodes(:)
    logical, intent(inout) :: is_used(:)
    integer :: i, k
    is_used(nodes) = .true.
    do i = tape%count, 1, -1
      if (.not. is_used(i) .or. .not. tape%nodes(i)%is_steady .or. tape%nodes(i)%operation == op_select) cycle
      associate (node => tape%nodes(i))
        do k = 1, operation_table(node%operation)%arguments
          is_used(merge(node%first, node%second, k == 1)) = .true.
        end do
      end associate
    end do
  end subroutine mark_steady

end module tape_sums
