! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The sign of expressions, as far as their form shows it.
module tape_sign
  use kinds, only: wp
  use operations, only: op_add, op_constant, op_cosh, op_divide, op_exp, op_multiply, op_negative, op_parameter, op_select, &
    op_sqrt, op_square
  use tape, only: constant, tape_t
  use tape_algebra, only: choice
  implicit none
  private

  public :: positive_part

contains

  !> max(0, a) of node `a`; `a` itself where its form shows that it is never negative: a switching function that is zero all the
  !> time has no branch.
  pure subroutine positive_part(tape, parameters, a, node)
    type(tape_t), intent(inout) :: tape
    real(wp), intent(in) :: parameters(:)
    integer, intent(in) :: a
    integer, intent(out) :: node
    integer :: zero
    node = a
    if (is_nonnegative(tape, parameters, a)) return
    call constant(tape, 0.0_wp, zero)
    call choice(tape, a, 1, a, zero, node)
  end subroutine positive_part

  !> Whether the form of a node shows that it is nowhere negative, with these values of the parameters.
  pure recursive logical function is_nonnegative(tape, parameters, node) result(is)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:)
    integer, intent(in) :: node
    associate (it => tape%nodes(node))
      select case (it%operation)
      case (op_constant)
        is = it%value >= 0
      case (op_parameter)
        is = parameters(it%first) >= 0
      case (op_square, op_sqrt, op_exp, op_cosh)
        is = .true.
      case (op_multiply)
        is = it%first == it%second
        if (.not. is) is = is_nonnegative(tape, parameters, it%first) .and. is_nonnegative(tape, parameters, it%second)
      case (op_add, op_divide)
        is = is_nonnegative(tape, parameters, it%first) .and. is_nonnegative(tape, parameters, it%second)
      case (op_select)
        ! A branch is taken where the switching function is positive, the other one where it is negative.
        associate (argument => tape%switches(it%first)%argument)
          is = it%second == argument .or. is_nonnegative(tape, parameters, it%second)
          if (is) is = is_opposite(tape, it%third, argument) .or. is_nonnegative(tape, parameters, it%third)
        end associate
      case default
        is = .false.
      end select
    end associate
  end function is_nonnegative

  !> Whether one node is the other one with the opposite sign.
  pure logical function is_opposite(tape, a, b)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: a, b
    is_opposite = tape%nodes(a)%operation == op_negative .and. tape%nodes(a)%first == b
    if (.not. is_opposite) is_opposite = tape%nodes(b)%operation == op_negative .and. tape%nodes(b)%first == a
  end function is_opposite

end module tape_sign
