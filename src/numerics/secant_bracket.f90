! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A bracket of a change of sign, narrowed by the Illinois form of the secant rule.
module secant_bracket
  use kinds, only: wp
  implicit none
  private

  public :: next_trial, narrow

  !> Ends with the values there, of opposite signs. `side`: the end that the last trial replaced, 1 the lower, -1 the upper.
  type, public :: bracket_t
    real(wp) :: low, high, at_low, at_high
    integer :: side = 0
  end type bracket_t

contains

  !> Where the straight line through both ends is zero; the middle where that is not inside.
  pure real(wp) function next_trial(bracket) result(t)
    type(bracket_t), intent(in) :: bracket
    associate (a => bracket%low, b => bracket%high)
      t = b - bracket%at_high*((b - a)/(bracket%at_high - bracket%at_low))
      if (.not. (t > a .and. t < b)) t = a + (b - a)/2
    end associate
  end function next_trial

  !> Takes a trial `t` with the value `f` as an end; the value at an end that stays for the second time is halved.
  pure subroutine narrow(bracket, t, f)
    type(bracket_t), intent(inout) :: bracket
    real(wp), intent(in) :: t, f
    if (f*bracket%at_high > 0) then
      bracket%high = t
      bracket%at_high = f
      if (bracket%side < 0) bracket%at_low = bracket%at_low/2
      bracket%side = -1
    else
      bracket%low = t
      bracket%at_low = f
      if (bracket%side > 0) bracket%at_high = bracket%at_high/2
      bracket%side = 1
    end if
  end subroutine narrow

end module secant_bracket
