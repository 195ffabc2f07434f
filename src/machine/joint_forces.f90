! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Forces and energies of the joints of a multibody structure, each from its own coordinate, speed and phase.
module joint_forces
  use bristle_law, only: bristle_force, bristle_rate
  use contact_law, only: contact_at_speed, contact_energy, contact_force, contact_force_slopes, contact_kelvin_voigt, contact_t
  use elementary, only: sine_cosine
  use friction_law, only: falls, sliding_friction, sliding_slope
  use kinds, only: wp
  use multibody, only: joint_bristle, joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, joint_t, memory_t, &
    wave_value
  implicit none
  private

  public :: joint_force, spring_force, spring_terms, strength_now, joint_energy, is_held, acts_as_spring, is_curved

contains

  !> Whether a joint is a constraint: friction that sticks, a contact that is closed.
  pure logical function is_held(joint, phase)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    is_held = (joint%kind == joint_friction .and. phase == 0) .or. (joint%kind == joint_contact .and. phase /= 0)
  end function is_held

  !> Whether a joint is a linear spring: elastic friction that sticks, a pressed contact with a linear law.
  pure logical function acts_as_spring(joint, phase)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    acts_as_spring = (joint%kind == joint_elastic .and. phase == 0) .or. &
      (joint%kind == joint_soft .and. abs(phase) == 1 .and. joint%contact%kind == contact_kelvin_voigt)
  end function acts_as_spring

  !> Whether the force of a joint is not linear in its coordinate and speed.
  pure logical function is_curved(joint, phase)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    is_curved = .false.
    select case (joint%kind)
    case (joint_friction)
      is_curved = allocated(joint%load) .or. (phase /= 0 .and. falls(joint%friction))
    case (joint_soft)
      is_curved = abs(phase) == 1 .and. joint%contact%kind /= contact_kelvin_voigt
    case (joint_spring, joint_bristle)
      is_curved = .true.
    end select
  end function is_curved

  !> Force of a joint along its row [N], that of a constraint excepted, and its derivatives with respect to s and u; the force of a
  !> spring, and friction, are multiplied by `strength`.
  pure subroutine joint_force(joint, phase, slider, touch_speed, s, u, strength, force, by_position, by_speed)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    real(wp), intent(in) :: slider, touch_speed, s, u, strength
    real(wp), intent(out) :: force
    real(wp), intent(out), optional :: by_position, by_speed
    real(wp) :: direction, p, rate
    force = 0
    if (present(by_position)) by_position = 0
    if (present(by_speed)) by_speed = 0
    select case (joint%kind)
    case (joint_friction)
      if (phase == 0) return
      direction = phase
      force = strength*sliding_friction(joint%friction, u, direction)
      if (present(by_speed)) by_speed = strength*sliding_slope(joint%friction, u, direction)
    case (joint_elastic)
      if (phase == 0) then
        force = -joint%stiffness*(s - slider)
        if (present(by_position)) by_position = -joint%stiffness
      else
        direction = phase
        force = sliding_friction(joint%friction, u, direction)
        if (present(by_speed)) by_speed = sliding_slope(joint%friction, u, direction)
      end if
    case (joint_soft)
      if (abs(phase) /= 1) return
      direction = phase
      p = merge(s - joint%upper, joint%lower - s, phase > 0)
      rate = direction*u
      if (joint%contact%by_impact) then
        call press(contact_at_speed(joint%contact, touch_speed), direction, p, rate, force, by_position, by_speed)
      else
        call press(joint%contact, direction, p, rate, force, by_position, by_speed)
      end if
    case (joint_spring)
      call spring_force(joint, s, strength, force, by_position)
    case (joint_bristle)
      call memory_force(joint%memory, s, u, force, by_position, by_speed)
    end select
  end subroutine joint_force

  !> Force of friction with memory at the deflection `z` and the sliding speed `u`, or of its bristles on the deflection.
  pure subroutine memory_force(memory, z, u, force, by_deflection, by_speed)
    type(memory_t), intent(in) :: memory
    real(wp), intent(in) :: z, u
    real(wp), intent(out) :: force
    real(wp), intent(out), optional :: by_deflection, by_speed
    real(wp) :: slopes(2)
    if (memory%on_deflection) then
      call bristle_rate(memory%law, z, u, force, slopes(1), slopes(2))
      force = memory%law%stiffness*force
      slopes = memory%law%stiffness*slopes
    else
      call bristle_force(memory%law, z, u, force, slopes(1), slopes(2))
    end if
    if (present(by_deflection)) by_deflection = slopes(1)
    if (present(by_speed)) by_speed = slopes(2)
  end subroutine memory_force

  !> Force of a spring [N] and its derivative with respect to s.
  pure subroutine spring_force(joint, s, strength, force, by_position)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: s, strength
    real(wp), intent(out) :: force
    real(wp), intent(out), optional :: by_position
    real(wp) :: sine, cosine, pull
    if (allocated(joint%load)) then
      ! An expression: its rate is that of the strength.
      force = strength
      if (present(by_position)) by_position = 0
      return
    end if
    call sine_cosine(s, sine, cosine)
    pull = 0
    if (abs(joint%attraction) > 0) pull = joint%attraction/(joint%gap - s)**2
    force = strength*(pull - s*(joint%stiffness + s*(joint%quadratic + s*joint%cubic)) - joint%moment*sine)
    if (.not. present(by_position)) return
    by_position = -joint%stiffness - s*(2*joint%quadratic + 3*s*joint%cubic) - joint%moment*cosine
    if (abs(joint%attraction) > 0) by_position = by_position + 2*pull/(joint%gap - s)
    by_position = strength*by_position
  end subroutine spring_force

  !> The terms of the force of a spring without their signs, of which rounding takes a share [N].
  pure real(wp) function spring_terms(joint, s, strength) result(terms)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: s, strength
    real(wp) :: sine, cosine
    call sine_cosine(s, sine, cosine)
    if (allocated(joint%load)) then
      terms = abs(strength)
      return
    end if
    terms = abs(s)*(abs(joint%stiffness) + abs(s)*(abs(joint%quadratic) + abs(s*joint%cubic))) + abs(joint%moment*sine)
    if (abs(joint%attraction) > 0) terms = terms + abs(joint%attraction)/(joint%gap - s)**2
    terms = abs(strength)*terms
  end function spring_terms

  !> What the force of a spring is multiplied by, with its first two derivatives by the time.
  pure subroutine strength_now(joint, frequency, turning, strength, rate, curvature)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: frequency
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: strength
    real(wp), intent(out), optional :: rate, curvature
    real(wp) :: change
    strength = 1
    change = 0
    if (present(curvature)) curvature = 0
    if (allocated(joint%strength)) call wave_value(joint%strength, frequency, 0.0_wp, turning, strength, change, curvature)
    if (present(rate)) rate = change
  end subroutine strength_now

  !> Force of a pressed contact and its derivatives.
  pure subroutine press(law, direction, p, rate, force, by_position, by_speed)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: direction, p, rate
    real(wp), intent(out) :: force
    real(wp), intent(out), optional :: by_position, by_speed
    real(wp) :: slopes(2)
    force = -direction*contact_force(law, p, rate)
    if (.not. (present(by_position) .and. present(by_speed))) return
    slopes = contact_force_slopes(law, p, rate)
    by_position = -slopes(1)
    by_speed = -slopes(2)
  end subroutine press

  !> Energy that a joint holds as a spring [J]: that of elastic friction and of soft contacts, too.
  pure real(wp) function joint_energy(joint, phase, slider, s) result(energy)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    real(wp), intent(in) :: slider, s
    real(wp) :: sine, cosine
    energy = 0
    select case (joint%kind)
    case (joint_elastic)
      ! While it slides the spring is stretched by the friction.
      if (phase == 0) energy = 0.5_wp*joint%stiffness*(s - slider)**2
      if (phase /= 0) energy = 0.5_wp*joint%friction%kinetic**2/joint%stiffness
    case (joint_soft)
      if (abs(phase) == 1) energy = contact_energy(joint%contact, merge(s - joint%upper, joint%lower - s, phase > 0))
    case (joint_spring)
      ! Where the strength is given, all its work is the drive's.
      if (allocated(joint%strength) .or. allocated(joint%load)) return
      call sine_cosine(s/2, sine, cosine)
      energy = s**2*(joint%stiffness/2 + s*(joint%quadratic/3 + s*joint%cubic/4)) + 2*joint%moment*sine**2
      if (abs(joint%attraction) > 0) energy = energy - joint%attraction/(joint%gap - s)
    end select
  end function joint_energy

end module joint_forces
