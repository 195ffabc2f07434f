! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a whole turn of an angle does to the nodes of a tape.
module tape_turns
  use kinds, only: wp
  use operations, only: op_add, op_constant, op_cos, op_divide, op_multiply, op_negative, op_parameter, op_select, op_sin, &
    op_subtract, op_tan, op_variable, operation_table
  use tape, only: tape_t
  implicit none
  private

  public :: growth_over_a_turn

  !> A node that is neither the same nor so many turns larger.
  real(wp), parameter :: other = huge(1.0_wp)

contains

  !> By how many turns each node is larger where the variable `number` is a turn larger; 0 of one that is the same, `huge` of
  !> any other. `values`: those of nodes that depend on no variable.
  pure function growth_over_a_turn(tape, number, values) result(growth)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: number
    real(wp), intent(in) :: values(:)
    real(wp) :: growth(tape%count)
    integer :: i
    do i = 1, tape%count
      growth(i) = growth_of(tape, number, values, growth(:i - 1), i)
    end do
  end function growth_over_a_turn

  pure real(wp) function growth_of(tape, number, values, growth, i) result(turns)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: number, i
    real(wp), intent(in) :: values(:), growth(:)
    real(wp) :: a, b
    associate (node => tape%nodes(i))
      turns = 0
      if (node%is_steady .or. node%operation == op_constant .or. node%operation == op_parameter) return
      if (node%operation == op_variable) then
        if (node%first == number) turns = 1
        return
      end if
      if (node%operation == op_select) then
        turns = other
        if (.not. abs(growth(tape%switches(node%first)%argument)) > 0 .and. &
            .not. abs(growth(node%second) - growth(node%third)) > 0) turns = growth(node%second)
        return
      end if
      a = growth(node%first)
      b = 0
      if (operation_table(node%operation)%arguments > 1) b = growth(node%second)
      if (.not. abs(a) + abs(b) > 0) return
      turns = other
      if (.not. max(abs(a), abs(b)) < other) return
      select case (node%operation)
      case (op_add)
        turns = a + b
      case (op_subtract)
        turns = a - b
      case (op_negative)
        turns = -a
      case (op_multiply)
        if (tape%nodes(node%first)%is_steady) turns = values(node%first)*b
        if (tape%nodes(node%second)%is_steady) turns = a*values(node%second)
      case (op_divide)
        if (tape%nodes(node%second)%is_steady) turns = a/values(node%second)
      case (op_sin, op_cos, op_tan)
        if (abs(a - anint(a)) <= 1e-12_wp*abs(a)) turns = 0
      end select
    end associate
  end function growth_of

end module tape_turns
