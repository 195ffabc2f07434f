! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The order in which items are handed out. Neighbouring tiles of a map cost alike, so a block of
!> neighbours may cost a multiple of the mean. Every run of this order lies evenly over the whole list:
!> steps near the golden section of its length, which meet each item once.
module spread_order
  use kinds, only: int64, real64
  implicit none
  private

  public :: new_spread_order, spread_subscripts

  type, public :: spread_order_t
    integer(int64), private :: length = 0, step = 1, back = 1
  contains
    procedure :: item
    procedure :: number_of
  end type spread_order_t

  real(real64), parameter :: golden = 0.6180339887498949_real64

contains

  !> The order of the items 1..n.
  pure function new_spread_order(n) result(order)
    integer, intent(in) :: n
    type(spread_order_t) :: order
    order%length = n
    order%step = max(1_int64, int(golden*n, int64))
    do while (common_divisor(order%step, order%length) > 1)
      order%step = order%step + 1
    end do
    order%back = inverse(order%step, order%length)
  end function new_spread_order

  !> The item that is handed out as number `number` (from 1).
  pure integer function item(self, number)
    class(spread_order_t), intent(in) :: self
    integer, intent(in) :: number
    item = 1 + int(modulo((number - 1)*self%step, self%length))
  end function item

  !> The number (from 1) as which an item is handed out.
  pure integer function number_of(self, item)
    class(spread_order_t), intent(in) :: self
    integer, intent(in) :: item
    number_of = 1 + int(modulo((item - 1)*self%back, self%length))
  end function number_of

  !> Point number `number` of a sample of a grid of so many points along each axis, from 1 along each: the additive recurrence with
  !> square roots of primes. Axes after the eighth repeat the others.
  pure function spread_subscripts(number, lengths) result(subscripts)
    integer, intent(in) :: number, lengths(:)
    integer :: subscripts(size(lengths)), k
    real(real64), parameter :: roots(8) = sqrt([2, 3, 5, 7, 11, 13, 17, 19]*1.0_real64)
    do k = 1, size(lengths)
      subscripts(k) = 1 + int(modulo(0.5_real64 + number*roots(1 + modulo(k - 1, size(roots))), 1.0_real64)*lengths(k))
    end do
  end function spread_subscripts

  !> What times `step` is 1 modulo `length`, by Euclid's extended algorithm; both have no common divisor.
  pure integer(int64) function inverse(step, length)
    integer(int64), intent(in) :: step, length
    integer(int64) :: rest, other, factor, next
    inverse = 1
    if (length <= 1) return
    rest = step
    other = length
    factor = 0
    do while (other > 0)
      next = inverse - rest/other*factor
      inverse = factor
      factor = next
      next = modulo(rest, other)
      rest = other
      other = next
    end do
    inverse = modulo(inverse, length)
  end function inverse

  pure integer(int64) function common_divisor(a, b)
    integer(int64), intent(in) :: a, b
    integer(int64) :: rest, other
    common_divisor = a
    other = b
    do while (other > 0)
      rest = modulo(common_divisor, other)
      common_divisor = other
      other = rest
    end do
  end function common_divisor

end module spread_order
