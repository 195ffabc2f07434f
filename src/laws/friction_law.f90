! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Dry and viscous friction. While sliding in direction s = +1 or -1 the force on the body is
!>   -s (K + E exp(-|v/v_s|^delta)) - b v,
!> or, where it fades, -s (K + (F - K)/(1 + |v|/v_f)) - b v with the break-away force F, or, in a fluid, -s (K + d v^2) - b v; at
!> rest it is whatever holds the body, up to the break-away force. Nothing is smoothed.
module friction_law
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use elementary, only: exponential, logarithm
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use memory_rows, only: memory_names
  implicit none
  private

  public :: friction_of, friction_of_part, add_to_friction, sliding_friction, sliding_slope, stribeck_excess, power, falls, &
    same_shape

  !> Exponent at which the Stribeck excess is below the rounding of the sliding friction.
  real(wp), parameter :: negligible_exponent = -log(0.01_wp*epsilon(1.0_wp))

  type, public :: friction_t
    !> Sliding friction at high speed, K [N].
    real(wp) :: kinetic = 0
    !> Largest force that friction holds at rest [N].
    real(wp) :: break_away = 0
    !> b [N s/m].
    real(wp) :: damping = 0
    !> E [N].
    real(wp) :: excess = 0
    !> v_s [m/s] and delta.
    real(wp) :: stribeck_velocity = 1
    real(wp) :: stribeck_exponent = 1
    !> Speed above which the Stribeck excess is nil to rounding [m/s]; 0 without excess.
    real(wp) :: layer_speed = 0
    !> The same of a second excess, where an effect adds one to a law that has one.
    real(wp) :: second_excess = 0, second_velocity = 1, second_exponent = 1
    !> v_f [m/s]; 0: it does not fade.
    real(wp) :: fading_speed = 0
    !> d [N s^2/m^2].
    real(wp) :: drag = 0
  end type friction_t

contains

  !> The law that a choice of the family `friction` names, for a normal force [N].
  pure function friction_of(choice, normal_force) result(law)
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: normal_force
    type(friction_t) :: law
    real(wp) :: static
    ! That is a force by an expression.
    if (any(memory_names == choice%name)) return
    select case (choice%name)
    case ('none')
    case ('coulomb', 'coulomb_viscous')
      law%kinetic = value_of(choice, 'kinetic_coefficient')*normal_force
      static = value_of(choice, 'static_coefficient')*normal_force
      law%break_away = max(static, law%kinetic)
      if (choice%name == 'coulomb_viscous') law%damping = value_of(choice, 'damping')
    case ('viscous')
      law%damping = value_of(choice, 'damping')
    case ('coulomb_stribeck')
      law%kinetic = value_of(choice, 'kinetic_coefficient')*normal_force
      law%break_away = value_of(choice, 'static_coefficient')*normal_force
      law%excess = law%break_away - law%kinetic
      law%stribeck_velocity = value_of(choice, 'stribeck_velocity')
      law%stribeck_exponent = value_of(choice, 'stribeck_exponent')
      law%damping = value_of(choice, 'damping')
      if (law%excess > 0) law%layer_speed = edge_of_layer(law%stribeck_velocity, law%stribeck_exponent)
    case default
      law%kinetic = no_force()
    end select
  end function friction_of

  !> The law that a part of a machine of several bodies names: forces, or coefficients of a normal force of its own. A static force
  !> below that of sliding is as given.
  pure function friction_of_part(choice) result(law)
    type(law_choice_t), intent(in) :: choice
    type(friction_t) :: law
    logical :: by_load
    law%kinetic = 1
    law%break_away = 1
    if (choice%name == 'friction:expression') return
    by_load = choice%name == 'friction:coulomb_load'
    law%kinetic = value_of(choice, merge('kinetic_coefficient', 'force              ', by_load))
    law%break_away = value_of(choice, merge('static_coefficient', 'static_force      ', by_load))
    if (law%break_away < 0) law%break_away = law%kinetic
    select case (choice%name)
    case ('friction:coulomb', 'friction:elastic_coulomb')
    case ('friction:coulomb_viscous')
      law%damping = value_of(choice, 'damping')
    case ('friction:coulomb_stribeck')
      law%excess = law%break_away - law%kinetic
      law%stribeck_velocity = value_of(choice, 'stribeck_velocity')
      law%stribeck_exponent = value_of(choice, 'stribeck_exponent')
      law%damping = value_of(choice, 'damping')
    case ('friction:coulomb_load')
      law%damping = value_of(choice, 'damping')
      if (.not. value_of(choice, 'stribeck_velocity') > 0) return
      law%excess = law%break_away - law%kinetic
      law%stribeck_velocity = value_of(choice, 'stribeck_velocity')
      law%stribeck_exponent = value_of(choice, 'stribeck_exponent')
    case ('friction:coulomb_hyperbolic')
      if (law%break_away > law%kinetic) law%fading_speed = value_of(choice, 'fading_velocity')
    case ('friction:coulomb_quadratic')
      law%drag = value_of(choice, 'drag')
    case default
      law%kinetic = no_force()
    end select
  end function friction_of_part

  !> The force of a law of the table that has none here: not a number, so that a motion with it is given up.
  pure real(wp) function no_force()
    no_force = ieee_value(1.0_wp, ieee_quiet_nan)
  end function no_force

  !> Whether sliding friction depends on the speed other than linearly.
  pure elemental logical function falls(law)
    type(friction_t), intent(in) :: law
    falls = law%excess > 0 .or. law%fading_speed > 0 .or. law%drag > 0
  end function falls

  !> Whether the forces of two laws add up to one law of their kind.
  pure logical function same_shape(a, b)
    type(friction_t), intent(in) :: a, b
    same_shape = .not. (falls(a) .or. falls(b))
  end function same_shape

  !> Adds the effect of a choice of the family `effect`, if it is one of those that are friction like the law's own.
  pure subroutine add_to_friction(law, choice)
    type(friction_t), intent(inout) :: law
    type(law_choice_t), intent(in) :: choice
    select case (choice%name)
    case ('viscous')
      law%damping = law%damping + value_of(choice, 'damping')
    case ('coulomb')
      law%kinetic = law%kinetic + value_of(choice, 'force')
      law%break_away = law%break_away + value_of(choice, 'force')
    case ('static_excess')
      law%break_away = law%break_away + value_of(choice, 'force')
    case ('stribeck')
      if (.not. value_of(choice, 'excess') > 0) return
      law%break_away = law%break_away + value_of(choice, 'excess')
      law%layer_speed = max(law%layer_speed, edge_of_layer(value_of(choice, 'velocity'), value_of(choice, 'exponent')))
      if (law%excess > 0) then
        law%second_excess = value_of(choice, 'excess')
        law%second_velocity = value_of(choice, 'velocity')
        law%second_exponent = value_of(choice, 'exponent')
      else
        law%excess = value_of(choice, 'excess')
        law%stribeck_velocity = value_of(choice, 'velocity')
        law%stribeck_exponent = value_of(choice, 'exponent')
      end if
    end select
  end subroutine add_to_friction

  !> Speed [m/s] above which exp(-(v/velocity)^exponent) is nil to rounding.
  pure real(wp) function edge_of_layer(velocity, exponent) result(speed)
    real(wp), intent(in) :: velocity, exponent
    speed = velocity*exponential(logarithm(negligible_exponent)/exponent)
  end function edge_of_layer

  !> Force on the body [N] while sliding at velocity `v` [m/s] in `direction` +1 or -1. Continued smoothly
  !> beyond v = 0, where a flight in that direction ends: a trial step may look there.
  pure elemental real(wp) function sliding_friction(law, v, direction)
    type(friction_t), intent(in) :: law
    real(wp), intent(in) :: v, direction
    sliding_friction = -direction*(law%kinetic + stribeck_excess(law, direction*v)) - law%damping*v
    if (law%fading_speed > 0) sliding_friction = sliding_friction &
      - direction*(law%break_away - law%kinetic)/(1 + max(direction*v, -law%fading_speed/2)/law%fading_speed)
    if (law%drag > 0) sliding_friction = sliding_friction - direction*law%drag*v**2
  end function sliding_friction

  !> E exp(-(v/v_s)^delta) [N] at the sliding speed `speed` [m/s]; smooth continuation below zero.
  pure elemental real(wp) function stribeck_excess(law, speed)
    type(friction_t), intent(in) :: law
    real(wp), intent(in) :: speed
    real(wp) :: u
    stribeck_excess = 0
    if (law%excess > 0) then
      u = max(speed/law%stribeck_velocity, -1.0_wp)
      stribeck_excess = law%excess*exponential(-power(u, law%stribeck_exponent))
      if (law%second_excess > 0) then
        u = max(speed/law%second_velocity, -1.0_wp)
        stribeck_excess = stribeck_excess + law%second_excess*exponential(-power(u, law%second_exponent))
      end if
    end if
  end function stribeck_excess

  !> Derivative of `sliding_friction` by the velocity [N s/m].
  pure elemental real(wp) function sliding_slope(law, v, direction) result(slope)
    type(friction_t), intent(in) :: law
    real(wp), intent(in) :: v, direction
    slope = -law%damping
    if (law%fading_speed > 0) slope = slope + (law%break_away - law%kinetic)/ &
      (law%fading_speed*(1 + max(direction*v, -law%fading_speed/2)/law%fading_speed)**2)
    if (law%drag > 0) slope = slope - 2*direction*law%drag*v
    if (.not. law%excess > 0) return
    slope = slope + law%excess*falloff(direction*v/law%stribeck_velocity, law%stribeck_exponent)/law%stribeck_velocity
    if (law%second_excess > 0) slope = slope &
      + law%second_excess*falloff(direction*v/law%second_velocity, law%second_exponent)/law%second_velocity
  end function sliding_slope

  !> -d/du exp(-u^delta); finite where u = 0.
  pure elemental real(wp) function falloff(u, delta)
    real(wp), intent(in) :: u, delta
    real(wp) :: at
    at = max(u, -1.0_wp)
    falloff = delta*exponential(-power(at, delta))
    if (delta /= 1) falloff = falloff*power(abs(at), delta - 1)
  end function falloff

  !> u**p for u >= 0 and its continuation to negative u, in reproducible arithmetic.
  pure elemental real(wp) function power(u, p)
    real(wp), intent(in) :: u, p
    if (p == 1) then
      power = u
    else if (p == 2) then
      power = u*u
    else if (abs(u) < tiny(1.0_wp)) then
      power = 0
    else
      power = sign(exponential(p*logarithm(abs(u))), u)
    end if
  end function power

end module friction_law
