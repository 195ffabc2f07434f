! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a result on a tape depends on.
module tape_parts
  use operations, only: op_select, operation_table
  use tape, only: node_t, tape_t, append, new_tape, switch_t
  implicit none
  private

  public :: needed, prune

contains

  !> The nodes that `wanted` need, with what their series need. `branches`: sign per switching function; the other branches are
  !> then left out.
  pure function needed(tape, wanted, branches) result(is_needed)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: wanted(:)
    integer, intent(in), optional :: branches(:)
    logical :: is_needed(tape%count)
    integer :: i, before
    is_needed = .false.
    is_needed(wanted) = .true.
    ! A partner may come later on the tape; what it needs beside its node is marked by the next pass.
    do
      before = count(is_needed)
      do i = tape%count, 1, -1
        if (is_needed(i)) call mark_arguments(tape, tape%nodes(i), is_needed, branches)
      end do
      if (count(is_needed) == before) exit
    end do
  end function needed

  pure subroutine mark_arguments(tape, node, is_needed, branches)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    logical, intent(inout) :: is_needed(:)
    integer, intent(in), optional :: branches(:)
    if (node%partner > 0) is_needed(node%partner) = .true.
    if (node%operation == op_select) then
      is_needed(tape%switches(node%first)%argument) = .true.
      if (present(branches)) then
        is_needed(merge(node%second, node%third, branches(node%first) > 0)) = .true.
      else
        is_needed([node%second, node%third]) = .true.
      end if
      return
    end if
    if (operation_table(node%operation)%arguments > 0) is_needed(node%first) = .true.
    if (operation_table(node%operation)%arguments > 1) is_needed(node%second) = .true.
  end subroutine mark_arguments

  !> Leaves on a tape what the nodes `wanted` need, which get new numbers.
  pure subroutine prune(tape, wanted)
    type(tape_t), intent(inout) :: tape
    integer, intent(inout) :: wanted(:)
    type(tape_t) :: small
    type(node_t) :: moved
    integer :: number(0:tape%count), switch(size(tape%switches)), i, k
    logical :: is_needed(tape%count)
    is_needed = needed(tape, wanted)
    number = 0
    switch = 0
    k = 0
    do i = 1, tape%count
      if (.not. is_needed(i)) cycle
      k = k + 1
      number(i) = k
    end do
    call new_tape(small)
    do i = 1, tape%count
      if (.not. is_needed(i)) cycle
      moved = tape%nodes(i)
      moved%next = 0
      moved%partner = number(moved%partner)
      if (moved%operation == op_select) then
        if (switch(moved%first) == 0) then
          small%switches = [small%switches, switch_t(number(tape%switches(moved%first)%argument), &
                                                     tape%switches(moved%first)%at_zero)]
          switch(moved%first) = size(small%switches)
        end if
        moved%first = switch(moved%first)
        moved%second = number(moved%second)
        moved%third = number(moved%third)
      else if (operation_table(moved%operation)%arguments > 0) then
        moved%first = number(moved%first)
        moved%second = number(moved%second)
      end if
      call append(small, moved, k)
    end do
    wanted = number(wanted)
    tape = small
  end subroutine prune

end module tape_parts
