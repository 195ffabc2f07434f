! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> State of a multibody structure and of each of its joints, and the forces of the joints that follow from the state.
module multibody_state
  use contact_law, only: contact_at_speed, contact_energy, contact_force, contact_force_slopes, contact_kelvin_voigt, contact_t
  use elementary, only: sine_cosine
  use friction_law, only: falls, sliding_friction, sliding_slope
  use multibody, only: controller_t, joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, joint_t, multibody_t, &
    most_degrees, most_joints, wave_value
  use kinds, only: wp
  implicit none
  private

  public :: turning_at, joint_motion, joint_force, spring_force, spring_terms, strength_now, joint_energy, free_force, &
    running_control, rounding_of_speed, key_of, is_held, acts_as_spring, is_curved, is_marched

  !> Phases of a joint. Friction, elastic or not: sticks (0), slides up or down (+1, -1). Contact: open (0), closed at its
  !> upper or lower stop (+1, -1). Soft contact: open (0), pressed (+1, -1), without force but not yet free (+2, -2). Section: not
  !> looked for (0), the watched coordinate moves towards it (+1) or away (-1).
  type, public :: multibody_state_t
    real(wp) :: q(most_degrees) = 0, v(most_degrees) = 0
    !> Since the section [s].
    real(wp) :: time = 0
    integer :: phase(most_joints) = 0
    !> Position of the slider of elastic friction [m]; speed at which a soft contact began [m/s].
    real(wp) :: slider(most_joints) = 0, touch_speed(most_joints) = 0
    !> The joint has just changed its phase: the guard of its new phase starts at zero. +1, -1: the stop it has left.
    integer :: left(most_joints) = 0
    !> Impacts in a row with next to no time between them; lanes and the event loop hand it to each other.
    integer :: burst = 0
    !> Fastest impact of the burst, the first excepted [m/s].
    real(wp) :: burst_speed = 0
    !> Time of the section since the start [s]; impulses given, samples of a controller taken, the force that it holds [N] and
    !> the integral of what it has seen [m s].
    real(wp) :: clock = 0, control = 0, integral = 0
    integer :: struck = 0, samples = 0
    !> The motion without a clock has just reached the section.
    logical :: at_section = .false.
  end type multibody_state_t

contains

  !> exp(i m Omega t) for m = 1, 2, ... at `time` [s].
  pure function turning_at(frequency, time, harmonics) result(turning)
    real(wp), intent(in) :: frequency, time
    integer, intent(in) :: harmonics
    complex(wp) :: turning(harmonics)
    real(wp) :: sine, cosine
    integer :: m
    do m = 1, harmonics
      call sine_cosine(m*frequency*time, sine, cosine)
      turning(m) = cmplx(cosine, sine, wp)
    end do
  end function turning_at

  !> Coordinate, speed and the given part of the acceleration of a joint.
  pure subroutine joint_motion(machine, j, q, v, time, turning, s, u, given)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    real(wp), intent(in) :: q(:), v(:), time
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: s, u
    real(wp), intent(out), optional :: given
    real(wp) :: value, rate
    associate (joint => machine%joints(j))
      call wave_value(joint%offset, machine%frequency, time, turning, value, rate, given)
      s = sum(joint%row*q(:machine%n)) + value
      u = sum(joint%row*v(:machine%n)) + rate
    end associate
  end subroutine joint_motion

  !> Rounding of the speed of a joint [m/s].
  pure real(wp) function rounding_of_speed(machine, j, state) result(negligible)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(multibody_state_t), intent(in) :: state
    associate (joint => machine%joints(j), n => machine%n)
      negligible = 64*epsilon(1.0_wp)*(sum(abs(joint%row*state%v(:n))) + abs(joint%offset%rate))
    end associate
  end function rounding_of_speed

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
      is_curved = phase /= 0 .and. falls(joint%friction)
    case (joint_soft)
      is_curved = abs(phase) == 1 .and. joint%contact%kind /= contact_kelvin_voigt
    case (joint_spring)
      is_curved = .true.
    end select
  end function is_curved

  !> Whether a mode has a joint whose force is not linear.
  pure logical function is_marched(machine, phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    integer :: j
    is_marched = .false.
    if (machine%linear) return
    do j = 1, size(machine%joints)
      if (is_curved(machine%joints(j), phase(j))) is_marched = .true.
    end do
  end function is_marched

  !> One bit for each joint that is a constraint or a spring.
  pure integer function key_of(machine, phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    integer :: j
    key_of = 0
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), phase(j)) .or. acts_as_spring(machine%joints(j), phase(j))) key_of = ibset(key_of, j - 1)
    end do
  end function key_of

  !> Force of a joint along its row [N], that of a constraint excepted, and its derivatives with respect to s and u; the force of a
  !> spring is multiplied by `strength`.
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
      force = sliding_friction(joint%friction, u, direction)
      if (present(by_speed)) by_speed = sliding_slope(joint%friction, u, direction)
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
    end select
  end subroutine joint_force

  !> Force of a spring [N] and its derivative with respect to s.
  pure subroutine spring_force(joint, s, strength, force, by_position)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: s, strength
    real(wp), intent(out) :: force
    real(wp), intent(out), optional :: by_position
    real(wp) :: sine, cosine, pull
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
      if (allocated(joint%strength)) return
      call sine_cosine(s/2, sine, cosine)
      energy = s**2*(joint%stiffness/2 + s*(joint%quadratic/3 + s*joint%cubic/4)) + 2*joint%moment*sine**2
      if (abs(joint%attraction) > 0) energy = energy - joint%attraction/(joint%gap - s)
    end select
  end function joint_energy

  !> All forces on the coordinates but those of constraints [N]; with `rate` their rates of change for the accelerations
  !> `a` [N/s].
  pure subroutine free_force(machine, state, turning, force, a, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: force(:)
    real(wp), intent(in), optional :: a(:)
    real(wp), intent(out), optional :: rate(:)
    real(wp) :: s, u, given, r, by_position, by_speed, strength, growth, gained
    integer :: j, m, n
    n = machine%n
    force = machine%load - matmul(machine%damping, state%v(:n)) - matmul(machine%stiffness, state%q(:n))
    if (present(rate)) rate = -matmul(machine%damping, a) - matmul(machine%stiffness, state%v(:n))
    if (allocated(machine%controller)) then
      call running_control(machine%controller, state, s, u)
      force = force + s*machine%controller%row
      if (present(rate)) rate = rate + u*machine%controller%row
    end if
    do m = 1, size(machine%force, 2)
      force = force + real(machine%force(:, m)*turning(m))
      if (present(rate)) rate = rate - m*machine%frequency*aimag(machine%force(:, m)*turning(m))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
        call strength_now(joint, machine%frequency, turning, strength, growth)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, strength, r, by_position, by_speed)
        force = force + r*joint%row
        if (.not. present(rate)) cycle
        rate = rate + (by_position*u + by_speed*(sum(joint%row*a) + given))*joint%row
        if (.not. allocated(joint%strength)) cycle
        call spring_force(joint, s, growth, gained)
        rate = rate + gained*joint%row
      end associate
    end do
  end subroutine free_force

  !> What a controller holds, and what is in its force because its reference runs on; and the rate [N, N/s].
  pure subroutine running_control(controller, state, force, rate)
    type(controller_t), intent(in) :: controller
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: force, rate
    force = state%control
    rate = 0
    if (controller%sample_time > 0) return
    rate = controller%proportional*controller%reference%rate
    force = force + rate*(state%clock + state%time)
  end subroutine running_control

end module multibody_state
