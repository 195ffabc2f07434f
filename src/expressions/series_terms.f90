! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Terms of the recurrences of `series_program`, order by order.
module series_terms
  use kinds, only: wp
  use series_program, only: add, angle, arc, arc_back, by_linear, by_rate, by_rate_back, by_variable, by_variable_back, copy, &
    divide, instruction_t, larger, log_of, minus, multiply, of_rate, one_over, one_term, over_steady, power, root, scaled, square, &
    subtract, turn, turn_back, two_over, two_terms
  implicit none
  private

  public :: raise_all

  integer :: i
  !> Products cost less than quotients.
  integer, parameter :: most_order = 64
  real(wp), parameter :: inverse(most_order) = [(1.0_wp/i, i=1, most_order)], whole(most_order) = [(1.0_wp*i, i=1, most_order)]

contains

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
        c(1:, i) = c(1:, a)*(1/divisor(b))
      case (larger)
        c(1:, i) = max(c(1:, a), c(1:, b))
      end select
    end associate
  end subroutine raise_termwise

  !> The coefficients of nodes that need each other, order by order. What was found last enters each sum last: processors then work
  !> on the rest of the sum while they wait for it.
  pure subroutine raise_together(count, program, order, unit, sign, divisor, c, fault)
    integer, intent(in) :: count, order
    type(instruction_t), intent(in) :: program(count)
    real(wp), intent(in) :: unit, sign, divisor(:)
    real(wp), intent(inout) :: c(0:size(divisor)*(order + 1) - 1)
    integer, intent(out) :: fault
    real(wp) :: y, factor_a(count), factor_b(count), over(count)
    integer :: k, at
    fault = 0
    do at = 1, count
      factor_a(at) = factor_of(program(at)%factor_a, program(at)%minus_a)
      factor_b(at) = factor_of(program(at)%factor_b, program(at)%minus_b)
      over(at) = 1
      if (program(at)%divisor > 0) over(at) = 1/divisor(program(at)%divisor)
    end do
    do k = 1, order
      do at = 1, count
        associate (it => program(at), a => program(at)%at_a, b => program(at)%at_b)
          select case (it%kind)
          case (larger)
            y = max(c(a + k), c(b + k))
          case (of_rate)
            y = (unit*inverse(k))*c(a + k - 1)
          case (one_term)
            y = factor_a(at)*c(a + k)
          case (two_terms)
            y = factor_a(at)*c(a + k) + factor_b(at)*c(b + k)
          case (one_over)
            y = factor_a(at)*c(a + k)*over(at)
          case (two_over)
            y = (factor_a(at)*c(a + k) + factor_b(at)*c(b + k))*over(at)
          case (by_linear)
            y = c(a + 1)*c(b + k - 1) + c(a)*c(b + k)
          case (multiply)
            y = inner_products(c(a + 1), c(b), k) + c(a)*c(b + k) + c(a + k)*c(b)
          case (square)
            y = inner_squares(c(a), k) + 2*c(a)*c(a + k)
          case (divide)
            y = inner_products(c(it%at_node + 1), c(b), k) + c(it%at_node)*c(b + k)
            y = (c(a + k) + sign*y)*over(at)
          case (turn, turn_back)
            y = inverse(k)*c(a + 1)*c(b + k - 1)
            if (it%kind == turn_back) y = sign*y
          case (by_rate, by_rate_back)
            y = inverse(k)*(rate_products(c(a + 1), c(b), k) + whole(k)*c(a + k)*c(b))
            if (it%kind == by_rate_back) y = sign*y
          case (by_variable, by_variable_back)
            y = unit*inverse(k)*(inner_products(c(it%at_partner), c(b), k) + c(it%at_partner + k - 1)*c(b))
            if (it%kind == by_variable_back) y = sign*y
          case default
            y = function_term(it, k, sign, over(at), [order, size(divisor)], c)
          end select
          c(it%at_node + k) = y
          if (abs(y) <= huge(1.0_wp)) cycle
          fault = -it%node
        end associate
        return
      end do
    end do

  contains

    pure real(wp) function factor_of(node, is_minus) result(factor)
      integer, intent(in) :: node
      logical, intent(in) :: is_minus
      factor = 1
      if (node > 0) factor = c((node - 1)*(order + 1))
      if (is_minus) factor = sign*factor
    end function factor_of

  end subroutine raise_together

  !> The same for roots, powers, logarithms and angles: solutions of linear differential equations of first order in the argument.
  !> `over`: one over the divisor. `extent`: highest order and number of nodes.
  pure real(wp) function function_term(it, k, sign, over, extent, c) result(y)
    type(instruction_t), intent(in) :: it
    integer, intent(in) :: k, extent(2)
    real(wp), intent(in) :: sign, over, c(0:extent(1), extent(2))
    real(wp) :: weight
    integer :: j
    y = 0
    associate (i => it%node, a => it%a, b => it%b)
      select case (it%kind)
      case (root)
        y = (c(k, a) + sign*inner_products(c(1, i), c(0, i), k))*(0.5_wp*over)
      case (power)
        do j = 1, k
          weight = c(0, b)*j
          if (sign > 0) weight = abs(weight) + (k - j)
          if (sign < 0) weight = weight - (k - j)
          y = y + weight*c(j, a)*c(k - j, i)
        end do
        y = y*(inverse(k)*over)
      case (log_of, arc)
        y = (k*c(k, a) + sign*rate_products(c(1, i), c(0, b), k))*(inverse(k)*over)
      case (arc_back)
        y = sign*(k*c(k, a) + rate_products(c(1, i), c(0, b), k))*(inverse(k)*over)
      case (angle)
        y = rate_products(c(1, a), c(0, b), k) + k*c(k, a)*c(0, b)
        y = y + sign*(rate_products(c(1, b), c(0, a), k) + k*c(k, b)*c(0, a))
        y = (y + sign*rate_products(c(1, i), c(0, it%partner), k))*(inverse(k)*over)
      end select
    end associate
  end function function_term

  !> Sum of a(i) b(k - i), i = 1 ... k - 1. In four parts, so that additions need not wait for each other.
  pure real(wp) function inner_products(a, b, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(k), b(0:k)
    real(wp) :: parts(4)
    integer :: i, j
    parts = 0
    do i = 1, k - 4, 4
      do j = 0, 3
        parts(j + 1) = parts(j + 1) + a(i + j)*b(k - i - j)
      end do
    end do
    do j = k - modulo(k - 1, 4), k - 1
      parts(1) = parts(1) + a(j)*b(k - j)
    end do
    total = (parts(1) + parts(2)) + (parts(3) + parts(4))
  end function inner_products

  !> Sum of a(i) a(k - i), i = 1 ... k - 1.
  pure real(wp) function inner_squares(a, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(0:k)
    real(wp) :: other
    integer :: i, half
    total = 0
    other = 0
    half = (k - 1)/2
    do i = 1, half - 1, 2
      total = total + a(i)*a(k - i)
      other = other + a(i + 1)*a(k - i - 1)
    end do
    if (modulo(half, 2) == 1) total = total + a(half)*a(k - half)
    total = 2*(total + other)
    if (modulo(k, 2) == 0) total = total + a(k/2)**2
  end function inner_squares

  !> Sum of j a(j) u(k - j), j = 1 ... k - 1.
  pure real(wp) function rate_products(a, u, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(k), u(0:k)
    real(wp) :: parts(4)
    integer :: i, j
    parts = 0
    do i = 1, k - 4, 4
      do j = 0, 3
        parts(j + 1) = parts(j + 1) + whole(i + j)*a(i + j)*u(k - i - j)
      end do
    end do
    do j = k - modulo(k - 1, 4), k - 1
      parts(1) = parts(1) + whole(j)*a(j)*u(k - j)
    end do
    total = (parts(1) + parts(2)) + (parts(3) + parts(4))
  end function rate_products

end module series_terms
