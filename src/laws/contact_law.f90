! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Barriers. A rigid one turns the velocity round at once, with a restitution that may depend on the speed. A
!> soft one pushes back over the penetration p >= 0,
!>   K p^n (1 + a p')  or  K p^n + D p'  or  q(p) (1 + a p')  with a table q,
!> and never pulls unless the law allows it.
module contact_law
  use contact_rows, only: restitution_formulas
  use curve_law, only: continued_at, curve_of, curve_t, integral_of, slope_of, value_at
  use elementary, only: exponential, logarithm
  use kinds, only: wp
  use law_table, only: effect_family, law_choice_t, list_of, value_of
  use restitution_law, only: formula_damping, kelvin_voigt_ratio
  implicit none
  private

  public :: contact_of, add_to_contact, compliant_contact, hardened_contact, force_table, contact_at_speed, barrier_positions, &
    beyond_barrier, barriers_are_soft, &
    velocity_after_impact, restitution_at, contact_force, contact_force_slopes, contact_energy, contact_margin, contact_pushes, &
    margin_is_curved, force_on_body

  integer, parameter, public :: contact_constant = 0, contact_linear = 1, contact_power = 2, &
    contact_viscoelastic = 3, contact_kelvin_voigt = 4, contact_hunt_crossley = 5, contact_curve = 6, contact_table = 7, &
    contact_hardened = 8

  !> Effects that make rigid barriers soft.
  character(len=20), parameter, public :: softening(3) = [character(len=20) :: 'compliant_contact', 'kelvin_voigt_contact', &
    'contact_curve']

  type, public :: contact_t
    integer :: kind = contact_constant
    !> Ratio of the speeds after and before an impact; at low speed where it depends on the speed.
    real(wp) :: restitution = 1
    !> Positions of rigid barriers [m]; huge means none.
    real(wp) :: upper = huge(1.0_wp)
    real(wp) :: lower = -huge(1.0_wp)
    !> Two coefficients of a restitution that depends on the speed.
    real(wp) :: coefficients(2) = 0
    !> Change of the restitution over the speed; q [N] over the penetration [m].
    type(curve_t) :: change
    !> A barrier with a force over penetration: positions of its surfaces [m], huge means none.
    logical :: soft = .false.
    real(wp) :: soft_upper = huge(1.0_wp)
    real(wp) :: soft_lower = -huge(1.0_wp)
    !> K [N/m^n], n, and a [s/m] or D [N s/m].
    real(wp) :: stiffness = 0, exponent = 1, damping = 0
    !> The force may pull.
    logical :: tension = .false.
    !> `damping` is d, to be divided by the speed of each impact.
    logical :: by_impact = .false.
  end type contact_t

contains

  !> The law that a choice of the family `contact` names, for a body of `mass` [kg].
  pure function contact_of(choice, mass) result(law)
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: mass
    type(contact_t) :: law
    select case (choice%name)
    case ('none')
      return
    case ('newton')
      law%restitution = value_of(choice, 'restitution')
    case ('expression')
      ! Its restitution is an expression of the case.
      law%restitution = 0
    case ('newton_linear')
      law%kind = contact_linear
      law%coefficients(1) = value_of(choice, 'slope')
    case ('newton_power')
      law%kind = contact_power
      law%restitution = value_of(choice, 'restitution')
      law%coefficients = [value_of(choice, 'yield_speed'), value_of(choice, 'falloff')]
    case ('newton_viscoelastic')
      law%kind = contact_viscoelastic
      law%coefficients = [value_of(choice, 'first'), value_of(choice, 'second')]
    case default
      law = soft_of(choice, mass)
      law%soft_upper = value_of(choice, 'upper')
      law%soft_lower = value_of(choice, 'lower')
      return
    end select
    law%upper = value_of(choice, 'upper')
    law%lower = value_of(choice, 'lower')
  end function contact_of

  !> Adds the effect of a choice of the family `effect`, if it is one of a contact. Which laws it fits is checked elsewhere.
  pure subroutine add_to_contact(law, choice)
    type(contact_t), intent(inout) :: law
    type(law_choice_t), intent(in) :: choice
    real(wp) :: position, given
    select case (choice%name)
    case ('restitution_slope')
      if (.not. value_of(choice, 'slope') > 0) return
      law%kind = contact_linear
      law%coefficients(1) = value_of(choice, 'slope')
    case ('restitution_curve')
      if (.not. any(abs(list_of(choice, 'change')) > 0)) return
      law%kind = contact_curve
      ! What is left at low speed is the restitution that chatter ends with.
      given = law%restitution
      law%change = curve_of(list_of(choice, 'speed'), list_of(choice, 'change'))
      law%restitution = min(1.0_wp, max(0.0_wp, given + law%change%value(1)))
      law%change = curve_of(list_of(choice, 'speed'), list_of(choice, 'change') - (law%restitution - given))
    case ('second_barrier')
      position = value_of(choice, 'position')
      if (law%upper < huge(1.0_wp)) then
        law%lower = position
      else if (law%lower > -huge(1.0_wp)) then
        law%upper = position
      else if (law%soft_upper < huge(1.0_wp)) then
        law%soft_lower = position
      else
        law%soft_upper = position
      end if
    end select
  end subroutine add_to_contact

  !> The rigid barriers of a law made soft, at the same positions, by the effect `choice`.
  pure type(contact_t) function compliant_contact(rigid, choice) result(law)
    type(contact_t), intent(in) :: rigid
    type(law_choice_t), intent(in) :: choice
    law = contact_t(soft=.true., soft_upper=rigid%upper, soft_lower=rigid%lower, damping=value_of(choice, 'damping'))
    select case (choice%name)
    case ('contact_curve')
      law%kind = contact_table
      law%change = force_table(choice)
      ! Its mean gives its size.
      law%stiffness = maxval(law%change%value)/law%change%at(law%change%count)
    case ('kelvin_voigt_contact')
      law%kind = contact_kelvin_voigt
      law%stiffness = value_of(choice, 'stiffness')
    case default
      law%kind = contact_hunt_crossley
      law%stiffness = value_of(choice, 'stiffness')
      law%exponent = value_of(choice, 'exponent')
    end select
  end function compliant_contact

  !> A soft law whose force over the penetration has the exponent n + `change` and is the same at the depth `penetration`.
  pure type(contact_t) function hardened_contact(soft, choice) result(law)
    type(contact_t), intent(in) :: soft
    type(law_choice_t), intent(in) :: choice
    real(wp) :: change
    law = soft
    change = value_of(choice, 'change')
    if (.not. abs(change) > 0) return
    law%exponent = soft%exponent + change
    law%stiffness = soft%stiffness*exponential(-change*logarithm(value_of(choice, 'penetration')))
    if (soft%kind == contact_kelvin_voigt) law%kind = contact_hardened
  end function hardened_contact

  !> The force over the penetration of a choice of `contact_curve`, with q(0) = 0. The polynomial through the knots may
  !> begin downwards where the force grows steeply: then it begins level.
  pure type(curve_t) function force_table(choice) result(table)
    type(law_choice_t), intent(in) :: choice
    table = curve_of([0.0_wp, list_of(choice, 'penetration')], [0.0_wp, list_of(choice, 'force')])
    table%slope(1) = max(0.0_wp, table%slope(1))
  end function force_table

  !> The part of a soft law that is not its position.
  pure function soft_of(choice, mass) result(law)
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: mass
    type(contact_t) :: law
    real(wp) :: zeta
    law%soft = .true.
    law%stiffness = value_of(choice, 'stiffness')
    select case (choice%name)
    case ('kelvin_voigt', 'kelvin_voigt_restitution')
      law%kind = contact_kelvin_voigt
      law%tension = value_of(choice, 'tension') > 0.5_wp
      if (choice%name == 'kelvin_voigt') then
        law%damping = value_of(choice, 'damping')
      else
        zeta = kelvin_voigt_ratio(value_of(choice, 'restitution'), law%tension)
        law%damping = 2*zeta*sqrt(law%stiffness*mass)
      end if
    case default
      law%kind = contact_hunt_crossley
      law%exponent = value_of(choice, 'exponent')
      if (any(restitution_formulas == choice%name)) then
        law%damping = formula_damping(choice%name, value_of(choice, 'restitution'))
        law%by_impact = .not. value_of(choice, 'speed') > 0
        if (.not. law%by_impact) law%damping = law%damping/value_of(choice, 'speed')
      else
        law%damping = value_of(choice, 'damping')
      end if
    end select
  end function soft_of

  !> The law of a contact that began with an impact at `speed` [m/s]; one that began without has no damping where each
  !> impact sets its own.
  pure elemental type(contact_t) function contact_at_speed(law, speed) result(now)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: speed
    now = law
    if (.not. law%by_impact) return
    now%damping = 0
    if (speed > 0) now%damping = law%damping/speed
  end function contact_at_speed

  !> Upper and lower barrier, rigid or soft [m]; huge means none.
  pure function barrier_positions(law) result(positions)
    type(contact_t), intent(in) :: law
    real(wp) :: positions(2)
    positions = [min(law%upper, law%soft_upper), max(law%lower, law%soft_lower)]
  end function barrier_positions

  !> Whether a body cannot be at `x` [m]: beyond a rigid barrier. Inside a soft one it may be.
  pure elemental logical function beyond_barrier(law, x)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: x
    beyond_barrier = x > law%upper .or. x < law%lower
  end function beyond_barrier

  !> Whether the contact law and the effects of a case make its barriers soft.
  pure logical function barriers_are_soft(choices) result(soft)
    type(law_choice_t), intent(in) :: choices(:)
    type(contact_t) :: law
    integer :: i
    soft = .false.
    do i = 1, size(choices)
      if (choices(i)%family == 'contact') law = contact_of(choices(i), mass=1.0_wp)
      soft = soft .or. law%soft .or. (choices(i)%family == effect_family .and. any(softening == choices(i)%name))
    end do
  end function barriers_are_soft

  !> v+ = -k v- [m/s].
  pure elemental real(wp) function velocity_after_impact(law, v)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: v
    if (law%kind == contact_constant) then
      velocity_after_impact = -law%restitution*v
    else
      velocity_after_impact = -restitution_at(law, abs(v))*v
    end if
  end function velocity_after_impact

  !> Restitution of a rigid barrier at an impact speed [m/s].
  pure elemental real(wp) function restitution_at(law, speed) result(k)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: speed
    real(wp) :: root
    k = law%restitution
    select case (law%kind)
    case (contact_linear)
      k = max(0.0_wp, law%restitution - law%coefficients(1)*speed)
    case (contact_curve)
      k = min(1.0_wp, max(0.0_wp, law%restitution + value_at(law%change, speed)))
    case (contact_power)
      if (speed > law%coefficients(1)) k = k*exponential(-law%coefficients(2)*logarithm(speed/law%coefficients(1)))
    case (contact_viscoelastic)
      if (speed > tiny(speed)) then
        root = exponential(logarithm(speed)/5)
        k = min(1.0_wp, max(0.0_wp, 1 - law%coefficients(1)*root + law%coefficients(2)*root**2))
      end if
    end select
  end function restitution_at

  !> Force of a soft barrier on the body [N], away from it, at the penetration `p` [m] that grows at `rate` [m/s], as the
  !> formula has it: cut off where `contact_margin` is negative. Continued smoothly to p < 0, where a contact ends.
  pure elemental real(wp) function contact_force(law, p, rate) result(force)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: p, rate
    if (law%kind == contact_kelvin_voigt) then
      force = law%stiffness*p + law%damping*rate
    else if (law%kind == contact_table) then
      force = continued_at(law%change, p)*(1 + law%damping*rate)
    else if (law%kind == contact_hardened) then
      force = law%stiffness*signed_power(p, law%exponent) + law%damping*rate
    else
      force = law%stiffness*signed_power(p, law%exponent)*(1 + law%damping*rate)
    end if
  end function contact_force

  !> Derivatives of `contact_force` by the penetration [N/m] and by its rate [N s/m].
  pure function contact_force_slopes(law, p, rate) result(slopes)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: p, rate
    real(wp) :: slopes(2)
    slopes = [law%stiffness, law%damping]
    if (law%kind == contact_kelvin_voigt) return
    if (law%kind == contact_table) then
      slopes = [slope_of(law%change, p)*(1 + law%damping*rate), continued_at(law%change, p)*law%damping]
      return
    end if
    slopes(1) = law%stiffness
    if (law%kind /= contact_hardened) slopes(1) = slopes(1)*(1 + law%damping*rate)
    if (law%exponent /= 1) slopes(1) = slopes(1)*law%exponent*abs(signed_power(p, law%exponent - 1))
    if (law%kind == contact_hardened) return
    slopes(2) = law%stiffness*signed_power(p, law%exponent)*law%damping
  end function contact_force_slopes

  !> Energy that the surface of a soft barrier holds at the penetration `p` [m], in J.
  pure elemental real(wp) function contact_energy(law, p) result(energy)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: p
    if (law%kind == contact_kelvin_voigt) then
      energy = 0.5_wp*law%stiffness*p**2
    else if (law%kind == contact_table) then
      energy = integral_of(law%change, p)
    else
      energy = law%stiffness*signed_power(p, law%exponent)*p/(law%exponent + 1)
    end if
  end function contact_energy

  !> Force of soft barriers on a body at `x` [m] with `v` [m/s], in N.
  pure elemental real(wp) function force_on_body(law, x, v) result(force)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: x, v
    force = 0
    if (.not. law%soft) return
    if (x > law%soft_upper) force = -allowed_force(law, x - law%soft_upper, v)
    if (x < law%soft_lower) force = allowed_force(law, law%soft_lower - x, -v)
  end function force_on_body

  pure elemental real(wp) function allowed_force(law, p, rate) result(force)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: p, rate
    force = contact_force(law, p, rate)
    if (.not. law%tension) force = max(0.0_wp, force)
  end function allowed_force

  !> A linear function of p and p' that is positive where the formula of a soft law pushes: its coefficients with
  !> 1, p and p'. There is none where `margin_is_curved`: then the force itself is that margin.
  pure function contact_margin(law) result(margin)
    type(contact_t), intent(in) :: law
    real(wp) :: margin(3)
    margin = [1.0_wp, 0.0_wp, law%damping]
    if (law%kind == contact_kelvin_voigt) margin = [0.0_wp, law%stiffness, law%damping]
  end function contact_margin

  !> Whether the line on which the force of a soft law is zero is a curve over p and p'.
  pure elemental logical function margin_is_curved(law)
    type(contact_t), intent(in) :: law
    margin_is_curved = law%kind == contact_hardened
  end function margin_is_curved

  !> Whether the formula of a soft law pushes at the penetration `p` [m] that grows at `rate` [m/s].
  pure elemental logical function contact_pushes(law, p, rate)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: p, rate
    if (margin_is_curved(law)) then
      contact_pushes = contact_force(law, p, rate) >= 0
    else
      contact_pushes = sum(contact_margin(law)*[1.0_wp, p, rate]) >= 0
    end if
  end function contact_pushes

  !> |p|^n with the sign of p, in reproducible arithmetic.
  pure elemental real(wp) function signed_power(p, n)
    real(wp), intent(in) :: p, n
    real(wp) :: size_p
    size_p = abs(p)
    if (n == 1) then
      signed_power = p
    else if (size_p < tiny(1.0_wp)) then
      signed_power = 0
    else if (n == 1.5_wp) then
      signed_power = p*sqrt(size_p)
    else if (n == 2) then
      signed_power = p*size_p
    else
      signed_power = sign(exponential(n*logarithm(size_p)), p)
    end if
  end function signed_power

end module contact_law
