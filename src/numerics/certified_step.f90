! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Steps over which a function is proven to stay positive, from its derivatives here and a bound on
!> a higher one everywhere. A search made of them cannot jump over a root, however close the next is.
module certified_step
  use kinds, only: wp
  implicit none
  private

  public :: positive_step, departure_step, single_root_limit, taylor_root

contains

  !> Largest s with w + rate s - bound s^2/2 >= 0, for w > 0 and |w''| <= bound.
  pure elemental real(wp) function positive_step(w, rate, bound) result(step)
    real(wp), intent(in) :: w, rate, bound
    real(wp) :: root
    if (bound <= 0) then
      step = huge(1.0_wp)
      if (rate < 0) step = -w/rate
      return
    end if
    root = sqrt(rate**2 + 2*bound*w)
    if (rate >= 0) then
      step = (rate + root)/bound
    else
      step = 2*w/(root - rate)
    end if
  end function positive_step

  !> A step on which a function that starts at zero stays positive: rate >= 0 and |w''| <= bound, or, where it
  !> reaches further, from the curvature and |w'''| <= third_bound. 0 if neither proves any.
  pure elemental real(wp) function departure_step(rate, curvature, bound, third_bound) result(step)
    real(wp), intent(in) :: rate, curvature, bound, third_bound
    real(wp) :: discriminant, longer
    step = 0
    if (rate >= 0) then
      if (bound <= 0) then
        step = huge(1.0_wp)
        return
      end if
      step = 2*rate/bound
      discriminant = curvature**2/4 + 2*third_bound*rate/3
      if (third_bound > 0 .and. discriminant >= 0) then
        if (curvature >= 0) then
          longer = 3*(curvature/2 + sqrt(discriminant))/third_bound
        else
          longer = 2*rate/(sqrt(discriminant) - curvature/2)
        end if
        step = max(step, longer)
      else if (third_bound <= 0 .and. curvature > 0) then
        ! A parabola that rises from zero.
        step = huge(1.0_wp)
        return
      end if
    end if
    step = 0.99_wp*step
  end function departure_step

  !> Distance within which a root must lie and is the only one: a falling function that stays falling there.
  !> Huge if that is not proven.
  pure elemental real(wp) function single_root_limit(w, rate, bound) result(limit)
    real(wp), intent(in) :: w, rate, bound
    real(wp) :: discriminant
    limit = huge(1.0_wp)
    discriminant = rate**2 - 2*bound*w
    if (rate < 0 .and. discriminant > 0) limit = 2*w/(sqrt(discriminant) - rate)
  end function single_root_limit

  !> Root of w + rate s + curvature s^2/2 next to s = 0 on a falling branch; Newton's where the
  !> parabola has none.
  pure elemental real(wp) function taylor_root(w, rate, curvature) result(step)
    real(wp), intent(in) :: w, rate, curvature
    real(wp) :: discriminant
    discriminant = rate**2 - 2*curvature*w
    if (discriminant > 0) then
      step = 2*w/(sqrt(discriminant) - rate)
    else
      step = -w/rate
    end if
  end function taylor_root

end module certified_step
