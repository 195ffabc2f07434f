! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Length of a Taylor step from its last coefficients (Jorba & Zou 2005), and sizes of what a function is a sum of.
module step_length
  use elementary, only: exponential
  use kinds, only: int64, real64, wp
  use operations, only: op_add, op_subtract, op_variable
  use tape, only: tape_t
  use tape_series, only: series_t
  implicit none
  private

  public :: natural_step, is_plain, size_of_arguments, sum_of_sizes

  integer :: i
  !> Products cost less than quotients.
  integer, parameter :: most_order = 64
  real(wp), parameter :: inverse(most_order) = [(1.0_wp/i, i=1, most_order)]
  !> Logarithms are rough: double precision serves them in quadruple precision, too, where its arithmetic is slow. From 1/most_order
  !> to 1.
  real(real64), parameter :: rising_inverse(0:most_order - 1) = [(1.0_real64/(most_order - i), i=0, most_order - 1)]
  real(real64), parameter :: log_epsilon = (exponent(epsilon(1.0_wp)) - 1)*0.693147180559945_real64
  !> Of zero.
  real(real64), parameter :: none = -1e30_real64

contains

  !> Length of a step whose last term is epsilon times one of the first terms, in every variable and in the nodes `others`.
  pure real(wp) function natural_step(series, state, others) result(step)
    type(series_t), intent(in) :: series
    real(wp), intent(in) :: state(:)
    integer, intent(in) :: others(:)
    real(wp) :: terms(0:series%order)
    real(real64) :: reach
    integer :: i, k
    ! Its powers must not overflow.
    real(real64), parameter :: most = 30
    reach = most
    do i = 1, size(others)
      call shorten(series%c(:, others(i)), series%order, reach)
    end do
    do i = 1, size(state)
      associate (rate => series%c(:, series%rates(i)), n => series%order)
        if (all(abs(rate(n - 4:n)) <= 0)) cycle
        terms(0) = state(i)
        do k = 1, n
          terms(k) = (series%unit*rate(k))*inverse(k)
        end do
      end associate
      call shorten(terms, series%order, reach)
    end do
    step = exponential(real(reach, wp))*series%unit
  end function natural_step

  !> Shortens the logarithm of a length to that for one series. Symmetric motions lack some of the last orders: those before count
  !> as if terms shrank evenly.
  pure subroutine shorten(terms, order, reach)
    integer, intent(in) :: order
    real(wp), intent(in) :: terms(0:order)
    real(real64), intent(inout) :: reach
    real(real64) :: size_of(0:most_order/2), last, longest
    integer :: k, j, known
    known = -1
    do k = order - 4, order
      last = rough_logarithm(abs(terms(k)))
      if (last <= none) cycle
      longest = none
      do j = 0, order/2
        if (j > known) size_of(j) = rough_logarithm(abs(terms(j)))
        known = max(known, j)
        longest = max(longest, log_epsilon*rising_inverse(most_order - order + j) + &
                      (size_of(j) - last)*rising_inverse(most_order - k + j))
        if (longest >= reach) exit
      end do
      if (longest < reach) then
        if (all(size_of(:order/2) <= none)) return
      end if
      reach = min(reach, longest)
    end do
  end subroutine shorten

  !> Whether a node is a variable, or the sum or difference of one and what is constant in time.
  pure logical function is_plain(tape, node)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: node
    logical :: is_variable(2), is_steady(2)
    is_plain = tape%nodes(node)%operation == op_variable
    if (tape%nodes(node)%operation /= op_add .and. tape%nodes(node)%operation /= op_subtract) return
    associate (both => tape%nodes([tape%nodes(node)%first, tape%nodes(node)%second]))
      is_variable = both%operation == op_variable
      is_steady = both%is_steady
    end associate
    is_plain = (is_variable(1) .and. is_steady(2)) .or. (is_steady(1) .and. is_variable(2))
  end function is_plain

  !> Sum of the magnitudes of all terms but the first, in four parts: additions need not wait for each other.
  pure real(wp) function sum_of_sizes(p) result(total)
    real(wp), intent(in) :: p(0:)
    real(wp) :: parts(4)
    integer :: k
    parts = 0
    do k = 1, ubound(p, 1) - 3, 4
      parts = parts + abs(p(k:k + 3))
    end do
    total = (parts(1) + parts(2)) + (parts(3) + parts(4))
    do k = ubound(p, 1) - modulo(ubound(p, 1), 4) + 1, ubound(p, 1)
      total = total + abs(p(k))
    end do
  end function sum_of_sizes

  !> Magnitude of what a node is a sum of, from those of all nodes: it may be far larger than the sum.
  pure real(wp) function size_of_arguments(tape, size_of, node)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: size_of(:)
    integer, intent(in) :: node
    associate (it => tape%nodes(node))
      size_of_arguments = abs(size_of(node))
      if (it%operation == op_add .or. it%operation == op_subtract) then
        size_of_arguments = abs(size_of(it%first)) + abs(size_of(it%second))
      end if
    end associate
  end function size_of_arguments

  !> Logarithm of x >= 0 to 0.06, by the exponent and a line; in double precision from the bits, which rise with it, without a call.
  pure elemental real(real64) function rough_logarithm(x)
    real(wp), intent(in) :: x
    real(real64) :: binary
    if (digits(x) == 53) then
      binary = real(transfer(real(x, real64), 0_int64), real64)*2.0_real64**(-52) - 1023
    else
      binary = exponent(x) + 2*real(fraction(x), real64) - 2
    end if
    rough_logarithm = merge(binary*0.693147180559945_real64, none, x > 0)
  end function rough_logarithm

end module step_length
