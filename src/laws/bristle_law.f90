! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction with memory: a deflection z [m] that follows the sliding speed u, and the force
!>   r = -(s0 z + s1 z' + s2 u).
!> Dahl: z' = u |1 - sgn(u) z/z_m|^n sgn(1 - sgn(u) z/z_m). Bouc-Wen: z' = u (1 - (a sgn(u z) + 1 - a) |z/z_m|^n). LuGre:
!> z' = u - |u| s0 z/g(u), g = F + (F_s - F) exp(-|u/v_s|^delta). Here z_m = F/s0.
module bristle_law
  use elementary, only: exponential
  use friction_law, only: power
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  implicit none
  private

  public :: bristle_of, bristle_rate, bristle_force

  integer, parameter :: dahl = 1, bouc_wen = 2, lugre = 3

  type, public :: bristle_t
    integer :: law = dahl
    !> s0 [N/m], F [N], s1 and s2 [N s/m].
    real(wp) :: stiffness = 1, level = 0, bristle_damping = 0, damping = 0
    !> n; a; F_s - F [N], v_s [m/s] and delta.
    real(wp) :: exponent = 1, shape = 1, excess = 0, stribeck_velocity = 1, stribeck_exponent = 2
  end type bristle_t

contains

  !> The law of a part.
  pure function bristle_of(choice) result(law)
    type(law_choice_t), intent(in) :: choice
    type(bristle_t) :: law
    law%stiffness = value_of(choice, 'stiffness')
    law%level = value_of(choice, 'force')
    select case (choice%name)
    case ('friction:dahl')
      law%exponent = value_of(choice, 'exponent')
    case ('friction:bouc_wen')
      law%law = bouc_wen
      law%exponent = value_of(choice, 'exponent')
      law%shape = value_of(choice, 'shape')
    case ('friction:lugre')
      law%law = lugre
      if (value_of(choice, 'static_force') > law%level) law%excess = value_of(choice, 'static_force') - law%level
      law%stribeck_velocity = value_of(choice, 'stribeck_velocity')
      law%stribeck_exponent = value_of(choice, 'stribeck_exponent')
      law%bristle_damping = value_of(choice, 'bristle_damping')
      law%damping = value_of(choice, 'damping')
    end select
  end function bristle_of

  !> z' [m/s] and its derivatives by z and u.
  pure subroutine bristle_rate(law, z, u, rate, by_deflection, by_speed)
    type(bristle_t), intent(in) :: law
    real(wp), intent(in) :: z, u
    real(wp), intent(out) :: rate, by_deflection, by_speed
    real(wp) :: side, relative, weight, level, slope, fall
    side = sign(1.0_wp, u)
    relative = law%stiffness*z/law%level
    select case (law%law)
    case (dahl)
      weight = 1 - side*relative
      by_speed = sign(power(abs(weight), law%exponent), weight)
      rate = u*by_speed
      by_deflection = -abs(u)*law%stiffness/law%level*law%exponent
      if (law%exponent /= 1) by_deflection = by_deflection*power(max(abs(weight), tiny(weight)), law%exponent - 1)
    case (bouc_wen)
      weight = law%shape*sign(1.0_wp, u*z) + 1 - law%shape
      by_speed = 1 - weight*power(abs(relative), law%exponent)
      rate = u*by_speed
      by_deflection = -u*weight*law%exponent*sign(1.0_wp, z)*law%stiffness/law%level
      if (law%exponent /= 1) by_deflection = by_deflection*power(max(abs(relative), tiny(relative)), law%exponent - 1)
    case default
      fall = 0
      level = law%level
      slope = 0
      if (law%excess > 0) then
        fall = law%excess*exponential(-power(abs(u)/law%stribeck_velocity, law%stribeck_exponent))
        level = level + fall
        if (abs(u) > 0) slope = -fall*law%stribeck_exponent*power(abs(u)/law%stribeck_velocity, law%stribeck_exponent)/u
      end if
      rate = u - abs(u)*law%stiffness*z/level
      by_deflection = -abs(u)*law%stiffness/level
      by_speed = 1 - (side - abs(u)*slope/level)*law%stiffness*z/level
    end select
  end subroutine bristle_rate

  !> r [N] and its derivatives by z and u.
  pure subroutine bristle_force(law, z, u, force, by_deflection, by_speed)
    type(bristle_t), intent(in) :: law
    real(wp), intent(in) :: z, u
    real(wp), intent(out) :: force, by_deflection, by_speed
    real(wp) :: rate
    call bristle_rate(law, z, u, rate, by_deflection, by_speed)
    force = -(law%stiffness*z + law%bristle_damping*rate + law%damping*u)
    by_deflection = -(law%stiffness + law%bristle_damping*by_deflection)
    by_speed = -(law%bristle_damping*by_speed + law%damping)
  end subroutine bristle_force

end module bristle_law
