! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Length of a Taylor step from its last coefficients (Jorba & Zou 2005).
module step_length
  use elementary, only: exponential
  use kinds, only: wp
  use operations, only: op_add, op_subtract, op_variable
  use tape, only: tape_t
  use tape_series, only: series_t
  implicit none
  private

  public :: natural_step, is_plain

  integer :: i
  !> Products cost less than quotients.
  real(wp), parameter :: inverse(64) = [(1.0_wp/i, i=1, 64)]

contains

  !> Length of a step whose last term is epsilon times one of the first terms, in every variable and in the nodes `others`.
  pure real(wp) function natural_step(series, state, others) result(step)
    type(series_t), intent(in) :: series
    real(wp), intent(in) :: state(:)
    integer, intent(in) :: others(:)
    real(wp) :: terms(0:series%order), reach
    integer :: i, k, rate
    ! Its powers must not overflow.
    real(wp), parameter :: most = 30
    reach = most
    do i = 1, size(state)
      terms(0) = state(i)
      rate = series%rates(i)
      do k = 1, series%order
        terms(k) = series%unit*series%c(k - 1, rate)*inverse(k)
      end do
      reach = min(reach, reach_of(terms))
    end do
    do i = 1, size(others)
      reach = min(reach, reach_of(series%c(:, others(i))))
    end do
    step = exponential(reach)*series%unit
  end function natural_step

  !> Logarithm of that length for one series. Symmetric motions lack some of the last orders: those before count as if terms
  !> shrank evenly.
  pure real(wp) function reach_of(terms) result(reach)
    real(wp), intent(in) :: terms(0:)
    real(wp) :: size_of(0:ubound(terms, 1)), share(0:ubound(terms, 1)/2), longest
    integer :: k, j, order
    real(wp), parameter :: none = -huge(1.0_wp)
    order = ubound(terms, 1)
    size_of = none
    do k = 0, order
      if ((k <= order/2 .or. k >= order - 4) .and. abs(terms(k)) > 0) size_of(k) = rough_logarithm(abs(terms(k)))
    end do
    share = rough_logarithm(epsilon(1.0_wp))*inverse(order:order - order/2:-1)
    reach = huge(1.0_wp)
    do k = order - 4, order
      if (size_of(k) <= none) cycle
      longest = none
      do j = 0, order/2
        if (size_of(j) > none) longest = max(longest, share(j) + (size_of(j) - size_of(k))*inverse(k - j))
      end do
      if (longest > none) reach = min(reach, longest)
    end do
  end function reach_of

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

  !> Logarithm to 0.06, by the exponent and a line.
  pure elemental real(wp) function rough_logarithm(x)
    real(wp), intent(in) :: x
    rough_logarithm = (exponent(x) + 2*fraction(x) - 2)*0.693147180559945_wp
  end function rough_logarithm

end module step_length
