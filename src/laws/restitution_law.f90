! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Restitution of a free body on a soft barrier, and the damping that gives one.
!>
!> K p^n (1 + a p'), n > 0: m v dv/dp = -K p^n (1 + a v) makes the integral of v/(1 + a v) over compression
!> and expansion the same, so with d = a v_in and r(u) = ln(1 + u) - u
!>   r(d) = r(-e d),
!> whatever n, K and m are. K p + D p': damped oscillation, zeta = D/(2 sqrt(K m)).
module restitution_law
  use constants, only: pi
  use elementary, only: exponential, logarithm, sine_cosine
  use kinds, only: wp
  implicit none
  private

  public :: restitution_of_damping, damping_of_restitution, formula_damping, kelvin_voigt_restitution, &
    kelvin_voigt_ratio

  !> Below this the series of ln(1 + u) - u is used.
  real(wp), parameter :: small = 0.125_wp

contains

  !> e of the law K p^n (1 + a p') at d = a v_in >= 0.
  pure elemental real(wp) function restitution_of_damping(d) result(e)
    real(wp), intent(in) :: d
    real(wp) :: low, high, middle, aim
    e = 1
    if (d <= 0) return
    aim = log_excess(d)
    low = 0
    high = min(d, 1.0_wp)
    do
      middle = 0.5_wp*(low + high)
      if (middle <= low .or. middle >= high) exit
      if (log_excess(-middle) > aim) then
        low = middle
      else
        high = middle
      end if
    end do
    e = middle/d
  end function restitution_of_damping

  !> d = a v_in that gives the restitution e, 0 < e <= 1.
  pure elemental real(wp) function damping_of_restitution(e) result(d)
    real(wp), intent(in) :: e
    real(wp) :: low, high
    d = 0
    if (e >= 1) return
    low = 1 - e
    high = 1/e
    do
      d = 0.5_wp*(low + high)
      if (d <= low .or. d >= high) exit
      if (log_excess(d) < log_excess(-e*d)) then
        low = d
      else
        high = d
      end if
    end do
  end function damping_of_restitution

  !> ln(1 + u) - u for u > -1, without cancellation near zero.
  pure elemental real(wp) function log_excess(u)
    real(wp), intent(in) :: u
    real(wp) :: term, power
    integer :: k
    if (abs(u) >= small) then
      log_excess = -huge(1.0_wp)
      if (1 + u > tiny(1.0_wp)) log_excess = logarithm(1 + u) - u
      return
    end if
    log_excess = 0
    power = -u
    do k = 2, 64
      power = -power*u
      term = -power/k
      log_excess = log_excess + term
      if (abs(term) <= 0.01_wp*epsilon(1.0_wp)*abs(log_excess)) exit
    end do
  end function log_excess

  !> d = a v_in by which a published formula means to give the restitution e; the exact one by default.
  pure real(wp) function formula_damping(formula, e) result(d)
    character(len=*), intent(in) :: formula
    real(wp), intent(in) :: e
    select case (formula)
    case ('hunt_crossley_1975')
      d = 3*(1 - e)/2
    case ('lankarani_nikravesh')
      d = 3*(1 - e**2)/4
    case ('herbert_mcwhannell')
      d = 6*(1 - e)/((2*e - 1)**2 + 3)
    case ('gonthier')
      d = (1 - e**2)/e
    case ('flores')
      d = 8*(1 - e)/(5*e)
    case ('hu_guo')
      d = 3*(1 - e)/(2*e)
    case default
      d = damping_of_restitution(e)
    end select
  end function formula_damping

  !> e of the law K p + D p' at zeta = D/(2 sqrt(K m)). With `tension` the body leaves at p = 0 (0 if it never does),
  !> without where the force has dropped to zero.
  pure elemental real(wp) function kelvin_voigt_restitution(zeta, tension) result(e)
    real(wp), intent(in) :: zeta
    logical, intent(in) :: tension
    real(wp) :: s, angle
    s = sqrt(abs((1 - zeta)*(1 + zeta)))
    if (tension) then
      e = 0
      if (zeta < 1) e = exponential(-pi*zeta/s)
    else if (s <= sqrt(epsilon(1.0_wp))) then
      e = exponential(-2.0_wp)
    else
      ! The force is zero at twice the angle whose cosine is zeta.
      angle = merge(arc(zeta, s), logarithm(zeta + s), zeta < 1)
      e = exponential(-2*zeta*angle/s)
    end if
  end function kelvin_voigt_restitution

  !> Angle in [0, pi/2] with cosine c and sine s.
  pure elemental real(wp) function arc(c, s)
    real(wp), intent(in) :: c, s
    real(wp) :: low, high, sine, cosine
    low = 0
    high = pi/2
    do
      arc = 0.5_wp*(low + high)
      if (arc <= low .or. arc >= high) exit
      call sine_cosine(arc, sine, cosine)
      if (sine*c < cosine*s) then
        low = arc
      else
        high = arc
      end if
    end do
  end function arc

  !> zeta that gives the restitution e, 0 < e <= 1.
  pure elemental real(wp) function kelvin_voigt_ratio(e, tension) result(zeta)
    real(wp), intent(in) :: e
    logical, intent(in) :: tension
    real(wp) :: low, high
    low = 0
    high = 1
    if (.not. tension) high = 2/sqrt(e)
    if (e >= 1) high = 0
    do
      zeta = 0.5_wp*(low + high)
      if (zeta <= low .or. zeta >= high) exit
      if (kelvin_voigt_restitution(zeta, tension) > e) then
        low = zeta
      else
        high = zeta
      end if
    end do
  end function kelvin_voigt_ratio

end module restitution_law
