! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Powers, and the functions that an expression may name: most are one operation of the tape, others a few.
module tape_functions
  use kinds, only: wp
  use operations, only: op_acos, op_add, op_arc_tangent, op_asin, op_atan, op_constant, op_cos, op_cosh, op_divide, op_exp, &
    op_log, op_multiply, op_negative, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh
  use tape, only: constant, tape_t
  use tape_algebra, only: binary, choice, unary
  implicit none
  private

  public :: power, apply_function, function_number, argument_counts, name_length

  integer, parameter :: name_length = 8

  !> Functions that are one operation, with its code; then the others.
  character(len=*), parameter, public :: function_names(19) = [character(len=name_length) :: &
    'sqrt', 'exp', 'log', 'sin', 'cos', 'tan', 'asin', 'acos', 'atan', 'sinh', 'cosh', 'tanh', &
    'abs', 'sign', 'min', 'max', 'atan2', 'hypot', 'if']
  integer, parameter :: codes(12) = [op_sqrt, op_exp, op_log, op_sin, op_cos, op_tan, op_asin, op_acos, op_atan, op_sinh, &
    op_cosh, op_tanh]
  !> Number of arguments; min and max take at least two.
  integer, parameter :: argument_counts(19) = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 3]

  !> Largest whole exponent that is computed by multiplications.
  integer, parameter :: largest_exponent = 1024
  !> A root or a positive power that is not whole is zero within this distance of a base of zero, where it has no Taylor series:
  !> of x^p the impulse on a body that passes with amplitude A is that of the exact force but for the share (distance/A)^(p + 1).
  real(wp), parameter :: zero_of_root = 1e-10_wp

contains

  !> Row of a name in `function_names`; 0 if it is no function.
  pure integer function function_number(name)
    character(len=*), intent(in) :: name
    function_number = findloc(function_names == name, .true., 1)
  end function function_number

  !> Node of a function, by its number. The condition of `if` is not an argument: see `choice`.
  pure subroutine apply_function(tape, number, arguments, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: number, arguments(:)
    integer, intent(out) :: node
    integer :: opposite, i, before, difference, ends(2)
    if (number <= size(codes)) then
      call unary(tape, codes(number), arguments(1), node)
      ! The argument has corners, as abs(x) has at zero.
      if (codes(number) == op_sqrt .and. tape%nodes(arguments(1))%operation == op_select) then
        call constant(tape, 0.5_wp, ends(1))
        call leave_out_zero(tape, arguments(1), ends(1), node)
      end if
      return
    end if
    node = arguments(1)
    select case (function_names(number))
    case ('abs')
      call unary(tape, op_negative, arguments(1), opposite)
      call choice(tape, arguments(1), 1, arguments(1), opposite, node)
    case ('sign')
      call constant(tape, 1.0_wp, ends(1))
      call constant(tape, -1.0_wp, ends(2))
      call choice(tape, arguments(1), 0, ends(1), ends(2), node)
    case ('min', 'max')
      do i = 2, size(arguments)
        before = node
        ends = [before, arguments(i)]
        if (function_names(number) == 'max') ends = ends([2, 1])
        call binary(tape, op_subtract, arguments(i), before, difference)
        call choice(tape, difference, 1, ends(1), ends(2), node)
      end do
    case ('atan2')
      call binary(tape, op_arc_tangent, arguments(1), arguments(2), node)
    case ('hypot')
      call unary(tape, op_square, arguments(1), ends(1))
      call unary(tape, op_square, arguments(2), ends(2))
      call binary(tape, op_add, ends(1), ends(2), before)
      call unary(tape, op_sqrt, before, node)
    end select
  end subroutine apply_function

  !> Node of base^exponent. Whole exponents multiply, so that the base may have any sign, and halves of odd numbers multiply by a
  !> root. Another exponent without variables needs a base of at least zero, or a positive one if it is negative, and so does
  !> exp(exponent log(base)) with variables in the exponent.
  pure recursive subroutine power(tape, base, exponent, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: base, exponent
    integer, intent(out) :: node
    integer :: logarithm, factor, whole, root
    real(wp) :: value
    if (tape%nodes(exponent)%operation == op_constant) then
      value = tape%nodes(exponent)%value
      if (abs(value) <= largest_exponent) then
        whole = nint(value)
        if (.not. abs(value - whole) > 0) then
          call whole_power(tape, base, whole, node)
          return
        else if (.not. abs(2*value - nint(2*value)) > 0) then
          call unary(tape, op_sqrt, base, root)
          call whole_power(tape, base, nint(value - 0.5_wp), factor)
          call binary(tape, op_multiply, factor, root, node)
          call leave_out_zero(tape, base, exponent, node)
          return
        end if
      end if
    end if
    if (tape%nodes(exponent)%is_steady) then
      call binary(tape, op_power, base, exponent, node)
      call leave_out_zero(tape, base, exponent, node)
    else
      call unary(tape, op_log, base, logarithm)
      call binary(tape, op_multiply, exponent, logarithm, factor)
      call unary(tape, op_exp, factor, node)
    end if
  end subroutine power

  !> Makes the power in `node` zero where its base is zero but for `zero_of_root`, if the exponent is positive.
  pure subroutine leave_out_zero(tape, base, exponent, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: base, exponent
    integer, intent(inout) :: node
    integer :: small, above, below, zero, quiet, inner, power
    if (tape%nodes(base)%is_steady) return
    if (tape%nodes(exponent)%operation == op_constant .and. .not. tape%nodes(exponent)%value > 0) return
    power = node
    call constant(tape, zero_of_root, small)
    call constant(tape, 0.0_wp, zero)
    call binary(tape, op_subtract, base, small, above)
    call binary(tape, op_add, base, small, below)
    call choice(tape, exponent, -1, zero, power, quiet)
    call choice(tape, below, 1, quiet, power, inner)
    call choice(tape, above, -1, power, inner, node)
  end subroutine leave_out_zero

  !> base^n by squares and products.
  pure recursive subroutine whole_power(tape, base, n, node)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: base, n
    integer, intent(out) :: node
    integer :: half, square, one
    if (n < 0) then
      call whole_power(tape, base, -n, half)
      call constant(tape, 1.0_wp, one)
      call binary(tape, op_divide, one, half, node)
    else if (n == 0) then
      call constant(tape, 1.0_wp, node)
    else if (n == 1) then
      node = base
    else
      call whole_power(tape, base, n/2, half)
      call unary(tape, op_square, half, square)
      node = square
      if (modulo(n, 2) == 1) call binary(tape, op_multiply, base, square, node)
    end if
  end subroutine whole_power

end module tape_functions
