! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a kernel for tapes does order by order, with the indices of all operands worked out: an operation for every node whose
!> coefficients feed back into the variables' rates, and apart those of arguments that grow evenly in time, whose series are known
!> from the state at once.
module tape_program
  use operations, only: op_select, op_variable
  use tape_lane_types, only: lane_change_t, lane_even_t, lane_operand_t, lane_tape_order, most_tape_nodes, op_cos_even, op_scale, &
    op_sin_even, op_sum, tape_machine_t
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private

  public :: set_program

  !> The index of the first series in `tape_values`.
  integer, parameter :: series_at = 3*most_tape_nodes + 1, orders = lane_tape_order + 1

contains

  !> Sets what `machine` does in every order, from its nodes.
  pure subroutine set_program(machine)
    type(tape_machine_t), intent(inout) :: machine
    logical :: is_even(0:machine%nodes - 1), is_read(0:machine%nodes - 1), skips(0:machine%nodes - 1)
    integer :: i
    call find_even(machine, is_even)
    call find_read(machine, is_even, is_read)
    skips = is_even
    skips(:machine%varying - 1) = .true.
    do i = machine%varying, machine%nodes - 1
      if (machine%node(i + 1)%operation == op_variable) skips(i) = .true.
    end do
    call set_rates(machine, is_read, skips)
    do i = machine%varying + 1, machine%nodes
      if (machine%node(i)%operation == op_sum) call set_parts(machine, machine%node(i)%first, machine%node(i)%second)
    end do
    machine%evens = 0
    machine%operations = 0
    do i = machine%varying, machine%nodes - 1
      if (is_even(i)) call add_even(machine, i)
      if (.not. skips(i)) call add_operation(machine, i)
    end do
  end subroutine set_program

  !> Nodes whose first coefficient alone is not zero, beside sines and cosines of them; all of them have series.
  pure subroutine find_even(machine, is_even)
    type(tape_machine_t), intent(in) :: machine
    logical, intent(out) :: is_even(0:)
    integer :: i
    is_even = .false.
    do i = machine%varying, machine%nodes - 1
      associate (node => machine%node(i + 1))
        select case (node%operation)
        case (op_variable)
          is_even(i) = machine%rate(node%first + 1) < machine%varying
        case (op_sum)
          is_even(i) = node%series >= 0 .and. all(grows(machine%term(node%first + 1:node%first + node%second)%node))
        case (op_sin_even, op_cos_even)
          is_even(i) = is_even(node%first)
        end select
      end associate
    end do

  contains

    elemental logical function grows(i)
      integer, intent(in) :: i
      grows = is_even(i) .and. all(machine%node(i + 1)%operation /= [op_sin_even, op_cos_even])
    end function grows

  end subroutine find_even

  !> Nodes whose coefficients others read one by one.
  pure subroutine find_read(machine, is_even, is_read)
    type(tape_machine_t), intent(in) :: machine
    logical, intent(in) :: is_even(0:)
    logical, intent(out) :: is_read(0:)
    integer :: i
    is_read = .false.
    do i = machine%varying, machine%nodes - 1
      if (is_even(i)) cycle
      associate (node => machine%node(i + 1))
        if (node%operation == op_sum) then
          is_read(machine%term(node%first + 1:node%first + node%second)%node) = .true.
        else if (node%operation /= op_variable) then
          is_read([node%first, node%second]) = .true.
        end if
      end associate
    end do
  end subroutine find_read

  !> How the coefficients of the variables follow. A rate that is a multiple and serves nothing else needs no operation.
  pure subroutine set_rates(machine, is_read, skips)
    type(tape_machine_t), intent(inout) :: machine
    logical, intent(in) :: is_read(0:)
    logical, intent(inout) :: skips(0:)
    integer :: i, k, rate
    machine%change = lane_change_t()
    do i = 1, machine%variables
      rate = machine%rate(i)
      if (rate < machine%varying) cycle
      associate (node => machine%node(rate + 1), change => machine%change(i))
        change%from = operand(machine, rate)
        do k = machine%varying + 1, machine%nodes
          if (machine%node(k)%operation == op_variable .and. machine%node(k)%first == i - 1) change%slopes = machine%node(k)%slopes
        end do
        if (node%operation /= op_sum .or. node%second /= 1) cycle
        if (is_read(rate) .or. node%series >= 0 .or. node%slopes >= 0) cycle
        change%from = operand(machine, machine%term(node%first + 1)%node)
        change%factor = machine%term(node%first + 1)%factor
        skips(rate) = .true.
      end associate
    end do
  end subroutine set_rates

  !> Where the coefficients of a node are.
  pure type(lane_operand_t) function operand(machine, i)
    type(tape_machine_t), intent(in) :: machine
    integer, intent(in) :: i
    integer(c_int) :: series
    series = machine%node(i + 1)%series
    operand = lane_operand_t(i, 0)
    if (series >= 0) operand = lane_operand_t(series_at + orders*series, -1)
  end function operand

  !> Where the coefficients of the terms of a sum are.
  pure subroutine set_parts(machine, first, count)
    type(tape_machine_t), intent(inout) :: machine
    integer(c_int), intent(in) :: first, count
    integer :: k
    do k = first + 1, first + count
      machine%part(k) = operand(machine, machine%term(k)%node)
    end do
  end subroutine set_parts

  pure subroutine add_even(machine, i)
    type(tape_machine_t), intent(inout) :: machine
    integer, intent(in) :: i
    associate (node => machine%node(i + 1))
      if (node%operation == op_cos_even) return
      machine%evens = machine%evens + 1
      associate (even => machine%even(machine%evens))
        even = lane_even_t(node%operation, i, node%series, node%slopes)
        if (node%operation == op_variable) even%other = machine%rate(node%first + 1)
        if (node%operation /= op_sin_even) return
        even%slopes = node%first_series
        even%other = node%second_series
      end associate
    end associate
  end subroutine add_even

  pure subroutine add_operation(machine, i)
    type(tape_machine_t), intent(inout) :: machine
    integer, intent(in) :: i
    machine%operations = machine%operations + 1
    associate (node => machine%node(i + 1), made => machine%operation(machine%operations))
      made%operation = node%operation
      made%node = i
      made%to = operand(machine, i)
      made%slopes = node%slopes
      if (node%operation == op_sum) then
        made%first = node%first
        made%count = node%second
        return
      end if
      made%a = operand(machine, node%first)
      made%b = operand(machine, node%second)
      made%steady = merge(node%first, node%second, node%operation == op_scale)
      made%first = node%first_series
      made%second = node%second_series
      made%own = node%series
      if (node%operation == op_select) made%steady = nint(node%value)
    end associate
  end subroutine add_operation

end module tape_program
