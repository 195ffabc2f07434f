! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Length of a Taylor step from its last coefficients (Jorba & Zou 2005).
module step_length
  use elementary, only: exponential
  use kinds, only: int64, real64, wp
  use operations, only: op_add, op_subtract, op_variable
  use tape, only: tape_t
  use tape_series, only: series_t
  implicit none
  private

  public :: natural_step, is_plain

  integer :: i
  !> Products cost less than quotients.
  integer, parameter :: most_order = 64
  real(wp), parameter :: inverse(most_order) = [(1.0_wp/i, i=1, most_order)]
  !> Logarithms are rough: double precision serves them in quadruple precision, too, where its arithmetic is slow.
  real(real64), parameter :: rough_inverse(most_order) = [(1.0_real64/i, i=1, most_order)]
  real(real64), parameter :: log_epsilon = (exponent(epsilon(1.0_wp)) - 1)*0.693147180559945_real64

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
    do i = 1, size(state)
      associate (rate => series%c(:, series%rates(i)), n => series%order)
        if (all(abs(rate(n - 4:n)) <= 0)) cycle
        terms(0) = state(i)
        do k = 1, n
          terms(k) = series%unit*rate(k)*inverse(k)
        end do
      end associate
      call shorten(terms, series%order, reach)
    end do
    do i = 1, size(others)
      call shorten(series%c(:, others(i)), series%order, reach)
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
    real(real64), parameter :: none = -1e30_real64
    known = -1
    do k = order - 4, order
      if (.not. abs(terms(k)) > 0) cycle
      last = rough_logarithm(abs(terms(k)))
      longest = -huge(longest)
      do j = 0, order/2
        if (j > known) then
          known = j
          size_of(j) = none
          if (abs(terms(j)) > 0) size_of(j) = rough_logarithm(abs(terms(j)))
        end if
        longest = max(longest, log_epsilon*rough_inverse(order - j) + (size_of(j) - last)*rough_inverse(k - j))
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

  !> Logarithm of x > 0 to 0.06, by the exponent and a line; in double precision from the bits of normal numbers, without a call.
  pure elemental real(real64) function rough_logarithm(x)
    real(wp), intent(in) :: x
    integer(int64) :: bits
    real(real64) :: mantissa
    integer :: power
    if (digits(x) == 53) then
      bits = transfer(real(x, real64), 0_int64)
      mantissa = transfer(ior(iand(bits, ishft(1_int64, 52) - 1), ishft(1022_int64, 52)), 0.0_real64)
      power = int(ishft(bits, -52)) - 1022
    else
      mantissa = real(fraction(x), real64)
      power = exponent(x)
    end if
    rough_logarithm = (power + 2*mantissa - 2)*0.693147180559945_real64
  end function rough_logarithm

end module step_length
