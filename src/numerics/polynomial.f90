! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Polynomials of degree 7 on [0, 1], the continuous extension of the adaptive flight: first zero
!> from above and maximum, certified by Bernstein coefficients (a polynomial lies within the hull of them,
!> and has no more roots than they have changes of sign).
module polynomial
  use kinds, only: wp
  implicit none
  private

  public :: first_zero, interpolate, maximum_until, value_at

  integer, parameter, public :: degree = 7
  !> Halvings until an interval is a point to rounding.
  integer, parameter :: deepest = 60

contains

  !> p(t), coefficients by rising power.
  pure real(wp) function value_at(p, t)
    real(wp), intent(in) :: p(0:degree), t
    integer :: i
    value_at = p(degree)
    do i = degree - 1, 0, -1
      value_at = value_at*t + p(i)
    end do
  end function value_at

  !> First t in (0, 1] where a polynomial that is positive (or leaves zero upwards) at 0 has dropped to zero;
  !> 2 if it stays positive.
  pure real(wp) function first_zero(p) result(t)
    real(wp), intent(in) :: p(0:degree)
    real(wp) :: b(0:degree, deepest + 1), right(0:degree), from(deepest + 1), width(deepest + 1)
    integer :: top, changes
    logical :: low
    t = 2
    ! What falls is outweighed by what it begins with; twice, for rounding.
    if (p(0) + 2*sum(min(p(1:), 0.0_wp)) > 0) return
    b(:, 1) = bernstein(p)
    from(1) = 0
    width(1) = 1
    top = 1
    do while (top > 0)
      changes = sign_changes(b(:, top))
      low = changes == 1 .and. b(0, top) <= 0 .and. b(degree, top) > 0
      if ((changes == 0 .and. maxval(b(:, top)) > 0) .or. (low .and. from(top) <= 0)) then
        ! Positive throughout, or rising from zero at the start.
        top = top - 1
      else if (low .or. changes == 0) then
        ! Already triggered where the interval begins.
        t = from(top)
        return
      else if ((changes == 1 .and. b(0, top) >= 0) .or. top > deepest) then
        t = zero_between(p, from(top), from(top) + width(top))
        return
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
  end function first_zero

  !> The one zero in [low, high], by bisection that ends in Newton's step.
  pure real(wp) function zero_between(p, low, high) result(t)
    real(wp), intent(in) :: p(0:degree), low, high
    real(wp) :: a, b
    integer :: i
    a = low
    b = high
    do i = 1, deepest
      t = 0.5_wp*(a + b)
      if (value_at(p, t) > 0) then
        a = t
      else
        b = t
      end if
    end do
    t = b
  end function zero_between

  !> Largest value on [0, last], to a relative 1e-14 of the spread, by branch and bound; `least`, where that is more.
  pure real(wp) function maximum_until(p, last, least) result(best)
    real(wp), intent(in) :: p(0:degree), last, least
    real(wp) :: b(0:degree, deepest + 1), right(0:degree), scaled(0:degree), slack
    integer :: top, i
    scaled = p
    if (last < 1) scaled = [(p(i)*last**i, i=0, degree)]
    b(:, 1) = bernstein(scaled)
    best = least
    if (maxval(b(:, 1)) <= least) return
    best = max(b(0, 1), b(degree, 1))
    slack = 1e-14_wp*(maxval(b(:, 1)) - minval(b(:, 1)))
    top = 1
    do while (top > 0)
      best = max(best, b(0, top), b(degree, top))
      if (maxval(b(:, top)) <= best + slack .or. top > deepest) then
        top = top - 1
        cycle
      end if
      call halve(b(:, top), right)
      b(:, top + 1) = b(:, top)
      b(:, top) = right
      top = top + 1
    end do
    best = max(best, least)
  end function maximum_until

  !> The polynomial with given values at given fractions (Newton's divided differences).
  pure function interpolate(fractions, value) result(p)
    real(wp), intent(in) :: fractions(0:degree), value(0:degree)
    real(wp) :: p(0:degree), difference(0:degree)
    integer :: i, k
    difference = value
    do k = 1, degree
      do i = degree, k, -1
        difference(i) = (difference(i) - difference(i - 1))/(fractions(i) - fractions(i - k))
      end do
    end do
    p = 0
    do k = degree, 0, -1
      p = eoshift(p, -1) - fractions(k)*p
      p(0) = p(0) + difference(k)
    end do
  end function interpolate

  !> Bernstein coefficients on [0, 1].
  pure function bernstein(p) result(b)
    real(wp), intent(in) :: p(0:degree)
    real(wp) :: b(0:degree), ratio
    integer :: i, k
    do i = 0, degree
      b(i) = 0
      ratio = 1
      do k = 0, i
        b(i) = b(i) + ratio*p(k)
        if (k == degree) exit
        ratio = ratio*real(i - k, wp)/real(degree - k, wp)
      end do
    end do
  end function bernstein

  !> De Casteljau at the middle: `b` becomes the left half.
  pure subroutine halve(b, right)
    real(wp), intent(inout) :: b(0:degree)
    real(wp), intent(out) :: right(0:degree)
    integer :: i
    right = b
    do i = 1, degree
      b(i - 1) = right(0)
      right(0:degree - i) = 0.5_wp*(right(0:degree - i) + right(1:degree - i + 1))
    end do
    b(degree) = right(0)
  end subroutine halve

  pure integer function sign_changes(b)
    real(wp), intent(in) :: b(0:degree)
    real(wp) :: before
    integer :: i
    sign_changes = 0
    before = 0
    do i = 0, degree
      if (b(i) == 0) cycle
      if (before*b(i) < 0) sign_changes = sign_changes + 1
      before = sign(1.0_wp, b(i))
    end do
  end function sign_changes

end module polynomial
