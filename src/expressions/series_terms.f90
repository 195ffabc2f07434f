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
        c(1:, i) = c(1:, a)/divisor(b)
      case (larger)
        c(1:, i) = max(c(1:, a), c(1:, b))
      end select
    end associate
  end subroutine raise_termwise

  !> The coefficients of nodes that need each other, order by order.
  pure subroutine raise_together(count, program, order, unit, sign, divisor, c, fault)
    integer, intent(in) :: count, order
    type(instruction_t), intent(in) :: program(count)
    real(wp), intent(in) :: unit, sign, divisor(:)
    real(wp), intent(inout) :: c(0:size(divisor)*(order + 1) - 1)
    integer, intent(out) :: fault
    real(wp) :: y, factor_a(count), factor_b(count)
    integer :: k, at
    fault = 0
    do at = 1, count
      factor_a(at) = factor_of(program(at)%factor_a, program(at)%minus_a)
      factor_b(at) = factor_of(program(at)%factor_b, program(at)%minus_b)
    end do
    do k = 1, order
      do at = 1, count
        associate (it => program(at), a => program(at)%at_a, b => program(at)%at_b)
          select case (it%kind)
          case (larger)
            y = max(c(a + k), c(b + k))
          case (of_rate)
            y = unit*c(a + k - 1)/k
          case (one_term)
            y = factor_a(at)*c(a + k)
          case (two_terms)
            y = factor_a(at)*c(a + k) + factor_b(at)*c(b + k)
          case (one_over)
            y = factor_a(at)*c(a + k)/divisor(it%divisor)
          case (two_over)
            y = (factor_a(at)*c(a + k) + factor_b(at)*c(b + k))/divisor(it%divisor)
          case (by_linear)
            y = c(a)*c(b + k) + c(a + 1)*c(b + k - 1)
          case (multiply)
            y = product_term(c(a), c(b), k)
          case (square)
            y = square_term(c(a), k)
          case (divide)
            y = (c(a + k) + sign*inner_products(c(it%at_node), c(b), k))/divisor(it%b)
          case (turn)
            y = c(a + 1)*c(b + k - 1)/k
          case (turn_back)
            y = sign*(c(a + 1)*c(b + k - 1))/k
          case (by_rate)
            y = rate_products(c(a), c(b), k, k)/k
          case (by_rate_back)
            y = sign*rate_products(c(a), c(b), k, k)/k
          case (by_variable)
            y = unit*product_term(c(it%at_partner), c(b), k - 1)/k
          case (by_variable_back)
            y = sign*unit*product_term(c(it%at_partner), c(b), k - 1)/k
          case default
            y = function_term(it, k, sign, divisor, order, c)
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
  pure real(wp) function function_term(it, k, sign, divisor, order, c) result(y)
    type(instruction_t), intent(in) :: it
    integer, intent(in) :: k, order
    real(wp), intent(in) :: sign, divisor(:), c(0:order, size(divisor))
    real(wp) :: weight
    integer :: j
    y = 0
    associate (i => it%node, a => it%a, b => it%b)
      select case (it%kind)
      case (root)
        do j = 1, k - 1
          y = y + c(j, i)*c(k - j, i)
        end do
        y = (c(k, a) + sign*y)/(2*divisor(i))
      case (power)
        do j = 1, k
          weight = c(0, b)*j
          if (sign > 0) weight = abs(weight) + (k - j)
          if (sign < 0) weight = weight - (k - j)
          y = y + weight*c(j, a)*c(k - j, i)
        end do
        y = y/(k*divisor(a))
      case (log_of, arc)
        y = (k*c(k, a) + sign*rate_products(c(0, i), c(0, b), k, k - 1))/(k*divisor(it%divisor))
      case (arc_back)
        y = sign*(k*c(k, a) + rate_products(c(0, i), c(0, b), k, k - 1))/(k*divisor(b))
      case (angle)
        y = rate_products(c(0, a), c(0, b), k, k) + sign*rate_products(c(0, b), c(0, a), k, k)
        y = (y + sign*rate_products(c(0, i), c(0, it%partner), k, k - 1))/(k*divisor(it%partner))
      end select
    end associate
  end function function_term

  !> Sum of a(i) b(k - i), i = 0 ... k. In two parts, so that additions need not wait for each other.
  pure real(wp) function product_term(a, b, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(0:k), b(0:k)
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 0, k - 1, 2
      total = total + a(i)*b(k - i)
      other = other + a(i + 1)*b(k - i - 1)
    end do
    total = total + other
    if (modulo(k, 2) == 0) total = total + a(k)*b(0)
  end function product_term

  pure real(wp) function square_term(a, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: a(0:k)
    integer :: i
    total = 0
    do i = 0, (k - 1)/2
      total = total + a(i)*a(k - i)
    end do
    total = 2*total
    if (modulo(k, 2) == 0) total = total + a(k/2)**2
  end function square_term

  !> Sum of y(i) b(k - i), i = 0 ... k - 1.
  pure real(wp) function inner_products(y, b, k) result(total)
    integer, intent(in) :: k
    real(wp), intent(in) :: y(0:k), b(0:k)
    real(wp) :: other
    integer :: i
    total = 0
    other = 0
    do i = 0, k - 2, 2
      total = total + y(i)*b(k - i)
      other = other + y(i + 1)*b(k - i - 1)
    end do
    total = total + other
    if (modulo(k, 2) == 1) total = total + y(k - 1)*b(1)
  end function inner_products

  !> Sum of j a(j) u(k - j), j = 1 ... last.
  pure real(wp) function rate_products(a, u, k, last) result(total)
    integer, intent(in) :: k, last
    real(wp), intent(in) :: a(0:k), u(0:k)
    real(wp) :: other
    integer :: j
    total = 0
    other = 0
    do j = 1, last - 1, 2
      total = total + j*a(j)*u(k - j)
      other = other + (j + 1)*a(j + 1)*u(k - j - 1)
    end do
    total = total + other
    if (modulo(last, 2) == 1) total = total + last*a(last)*u(k - last)
  end function rate_products

end module series_terms
