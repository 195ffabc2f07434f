! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Polynomials of any degree on [0, 1] by their Bernstein coefficients, whose hull contains them; and their first crossing of
!> zero in a given direction, where they are known up to a bound.
module bernstein
  use kinds, only: wp
  implicit none
  private

  public :: bernstein_of, first_crossing

  !> Halvings of [0, 1] until an interval is a point to rounding.
  integer, parameter :: deepest = 50

contains

  !> Bernstein coefficients of the polynomial with coefficients `p` by rising power.
  pure function bernstein_of(p) result(b)
    real(wp), intent(in) :: p(0:)
    real(wp) :: b(0:ubound(p, 1)), inverse
    integer :: n, i, k
    n = ubound(p, 1)
    ! One over the binomial coefficient.
    inverse = 1
    do k = 0, n
      b(k) = p(k)*inverse
      if (k < n) inverse = inverse*(k + 1)/(n - k)
    end do
    do k = 1, n
      do i = n, k, -1
        b(i) = b(i) + b(i - 1)
      end do
    end do
  end function bernstein_of

  !> First t in (0, 1] at which the function p + r crosses zero; 2 if it does not. |r| <= value_bound, and |r'| <= slope_bound.
  !> `direction`: 1 upwards, -1 downwards, 0 either. `is_certain` is false if a zero, or a crossing before the one that is
  !> returned, can be neither proven nor excluded.
  pure subroutine first_crossing(p, value_bound, slope_bound, direction, t, is_certain)
    real(wp), intent(in) :: p(0:), value_bound, slope_bound
    integer, intent(in) :: direction
    real(wp), intent(out) :: t
    logical, intent(out) :: is_certain
    real(wp) :: b(0:ubound(p, 1), deepest + 1), right(0:ubound(p, 1)), from(deepest + 1), width(deepest + 1), rates(2)
    integer :: top, n
    n = ubound(p, 1)
    b(:, 1) = bernstein_of(p)
    from(1) = 0
    width(1) = 1
    top = 1
    is_certain = .true.
    do while (top > 0)
      if (minval(b(:, top)) > value_bound .or. maxval(b(:, top)) < -value_bound) then
        top = top - 1
        cycle
      end if
      rates = n*[minval(b(1:, top) - b(:n - 1, top)), maxval(b(1:, top) - b(:n - 1, top))]
      rates = rates + width(top)*slope_bound*[-1, 1]
      if (rates(1) > 0 .or. rates(2) < 0) then
        ! Monotone: one crossing at most, upwards if the slope is positive.
        if (has_crossing(b(0, top), b(n, top), rates(1) > 0, direction)) then
          t = zero_between(p, from(top), from(top) + width(top), rates(1) > 0)
          return
        end if
        top = top - 1
      else if (maxval(abs(b(:, top))) <= 2*value_bound .or. top > deepest) then
        ! A double zero within the bound: the polynomial decides.
        is_certain = .false.
        if (has_crossing(b(0, top), b(n, top), b(n, top) > b(0, top), direction)) then
          t = from(top) + width(top)
          return
        end if
        top = top - 1
      else
        width(top) = width(top)/2
        call halve(b(:, top), right)
        b(:, top + 1) = b(:, top)
        from(top + 1) = from(top)
        width(top + 1) = width(top)
        b(:, top) = right
        from(top) = from(top) + width(top)
        top = top + 1
      end if
    end do
    t = 2
  end subroutine first_crossing

  !> Whether the ends of an interval have different signs, in a direction that counts; a zero belongs to the interval that ends
  !> there.
  pure logical function has_crossing(first, last, is_rising, direction)
    real(wp), intent(in) :: first, last
    logical, intent(in) :: is_rising
    integer, intent(in) :: direction
    if (is_rising) then
      has_crossing = first < 0 .and. last >= 0 .and. direction >= 0
    else
      has_crossing = first > 0 .and. last <= 0 .and. direction <= 0
    end if
  end function has_crossing

  !> The one zero in [low, high], by Newton's steps within halvings.
  pure real(wp) function zero_between(p, low, high, is_rising) result(t)
    real(wp), intent(in) :: p(0:), low, high
    logical, intent(in) :: is_rising
    real(wp) :: a, b, value, slope, next
    integer :: i, k
    a = low
    b = high
    t = 0.5_wp*(a + b)
    do i = 1, 200
      value = p(ubound(p, 1))
      slope = 0
      do k = ubound(p, 1) - 1, 0, -1
        slope = slope*t + value
        value = value*t + p(k)
      end do
      if ((value >= 0) .eqv. is_rising) then
        b = t
      else
        a = t
      end if
      next = 0.5_wp*(a + b)
      if (abs(slope) > 0) then
        if (t - value/slope >= a .and. t - value/slope <= b) next = t - value/slope
      end if
      if (abs(next - t) <= epsilon(1.0_wp)*abs(t)) exit
      t = next
    end do
    t = min(max(next, low), high)
  end function zero_between

  !> De Casteljau at the middle: `b` becomes the left half.
  pure subroutine halve(b, right)
    real(wp), intent(inout) :: b(0:)
    real(wp), intent(out) :: right(0:)
    integer :: i, n
    n = ubound(b, 1)
    right = b
    do i = 1, n
      b(i - 1) = right(0)
      right(0:n - i) = 0.5_wp*(right(0:n - i) + right(1:n - i + 1))
    end do
    b(n) = right(0)
  end subroutine halve

end module bernstein
