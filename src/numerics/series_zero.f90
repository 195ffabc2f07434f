! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The first zero of an exponential series over an interval no longer than 1/rate, the rate being that of the fastest motion in it:
!> rounded at `order` it is a polynomial, whose derivatives certify its zeros.
module series_zero
  use certified_step, only: departure_step, positive_step, single_root_limit, taylor_root
  use kinds, only: wp
  implicit none
  private

  public :: first_zero

  !> 1/21! is below the rounding of doubles by far; quadruple precision takes more terms.
  integer, parameter, public :: order = merge(20, 30, epsilon(1.0_wp) > 1e-20_wp)

  integer, parameter :: most_polish = 60

contains

  !> First fraction in (0, 1] at which a series that is positive at 0, or leaves zero upwards there, has dropped to zero;
  !> 2 if it stays positive or is zero throughout, 0 if it falls at once. Nothing can hide: the steps are certified by
  !> bounds on the second and third derivative over the interval, and from zero also by the first term of the series.
  pure real(wp) function first_zero(p) result(t)
    real(wp), intent(in) :: p(0:order)
    real(wp) :: value, rate, curvature, second_bound, third_bound, step, limit
    integer :: k
    real(wp), parameter :: smallest = 4*epsilon(1.0_wp)
    second_bound = 0
    third_bound = 0
    do k = 2, order
      second_bound = second_bound + k*(k - 1)*abs(p(k))
      third_bound = third_bound + k*(k - 1)*(k - 2)*abs(p(k))
    end do
    t = 2
    if (.not. any(abs(p) > 0)) return
    t = 0
    value = p(0)
    rate = p(1)
    curvature = 2*p(2)
    if (value > 0) then
      step = positive_step(value, rate, second_bound)
    else
      step = leading_step(p)
      if (step > 0) step = max(step, departure_step(rate, curvature, second_bound, third_bound))
    end if
    do
      if (step <= smallest) return
      if (value > 0) then
        limit = single_root_limit(value, rate, second_bound)
        if (t + limit <= 1) then
          call polish(p, t, t + limit)
          return
        end if
      end if
      if (t >= 1) exit
      t = min(t + step, 1.0_wp)
      call series_value(p, t, value, rate, curvature)
      step = 0
      if (value > 0) step = positive_step(value, rate, second_bound)
    end do
    t = 2
  end function first_zero

  !> A fraction up to which a series that is zero at 0 stays positive, as one of its terms before the first negative one
  !> outweighs all negative ones; 0 if there is none.
  pure real(wp) function leading_step(p) result(step)
    real(wp), intent(in) :: p(0:order)
    real(wp) :: against
    integer :: k
    step = 0
    against = sum(max(-p, 0.0_wp))
    do k = 0, order
      if (p(k) < 0) return
      if (p(k) > 0) step = max(step, min(1.0_wp, 0.99_wp*p(k)/max(against, tiny(against))))
    end do
  end function leading_step

  !> The one root between `t`, where the series is positive, and `last`.
  pure subroutine polish(p, t, last)
    real(wp), intent(in) :: p(0:order), last
    real(wp), intent(inout) :: t
    real(wp) :: low, high, next, step, value, rate, curvature
    integer :: i
    low = t
    high = last
    do i = 1, most_polish
      call series_value(p, t, value, rate, curvature)
      if (value > 0) then
        low = t
      else
        high = t
      end if
      next = t + taylor_root(value, rate, curvature)
      if (.not. (next >= low .and. next <= high)) next = 0.5_wp*(low + high)
      step = next - t
      t = next
      if (abs(step) <= epsilon(1.0_wp)*t .or. high - low <= 0) exit
    end do
  end subroutine polish

  !> Value of a series at a fraction, and its first two derivatives.
  pure subroutine series_value(p, t, value, rate, curvature)
    real(wp), intent(in) :: p(0:order), t
    real(wp), intent(out) :: value
    real(wp), intent(out), optional :: rate, curvature
    real(wp) :: first, half_second
    integer :: k
    value = p(order)
    first = 0
    half_second = 0
    do k = order - 1, 0, -1
      half_second = half_second*t + first
      first = first*t + value
      value = value*t + p(k)
    end do
    if (present(rate)) rate = first
    if (present(curvature)) curvature = 2*half_second
  end subroutine series_value

end module series_zero
