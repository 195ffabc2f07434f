! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine composed of laws: m x'' = restoring(l0 + x_A(phi) - x) + friction(x') + effects, barriers at
!> fixed positions, crank angle phi = Omega t + phi_0.
module oscillator
  use constants, only: two_pi, unreachable
  use contact_law, only: add_to_contact, barrier_positions, compliant_contact, contact_of, contact_t, force_on_body, &
    hardened_contact
  use drive_law, only: add_harmonics, add_ripple, drive_of, drive_t, foot_motion, measured_force
  use effect_check, only: refuse_effects
  use effect_law, only: add_to_effects, add_to_sensor, effect_force, effects_t, finish_effects, position_force, replace_friction, &
    sensor_t, slip_in_series, slip_memory_t, extension_bounds, extension_force, extension_slope
  use errors, only: error_t, fail
  use friction_law, only: add_to_friction, friction_of, friction_t
  use kinds, only: wp
  use law_table, only: added_families, effect_family, law_choice_t, own_law, path_of, value_of
  use law_texts, only: is_own
  use restoring_law, only: restoring_force, restoring_of, restoring_stiffness, restoring_t
  use status, only: exit_bad_case
  implicit none
  private

  public :: build_oscillator, refuse_pair, holding_force, extra_force

  type, public :: oscillator_t
    !> Mass [kg].
    real(wp) :: mass = 1
    type(restoring_t) :: restoring
    type(friction_t) :: friction
    type(contact_t) :: contact
    type(drive_t) :: drive
    type(effects_t) :: effects
    !> Forces beyond those of the laws: effects, or a measured force.
    logical :: extra = .false.
    !> What a record of the motion shows.
    type(sensor_t) :: sensor
    !> sqrt(stiffness/mass) [rad/s]; 0 without a spring.
    real(wp) :: natural_frequency = 0
    !> Angular frequency of the section: the drive's, or the natural one without a drive [rad/s].
    real(wp) :: drive_frequency = 0
    !> Period of the section [s].
    real(wp) :: period = 0
    !> Bounds on |x_A'| and |x_A''| with respect to time [m/s, m/s^2].
    real(wp) :: foot_speed_bound = 0
    real(wp) :: foot_acceleration_bound = 0
    !> Largest spring force in magnitude that the foot alone can change by [N]; scale of rounding.
    real(wp) :: force_scale = 0
    !> After this change of x nothing of the machine is different [rad]: x lies on a circle; 0 = on a line.
    real(wp) :: turn = 0
  end type oscillator_t

contains

  !> The machine of one law per family: body, restoring, friction, contact, drive, and any number of effects, in any order.
  !> Parameters are taken as they are (the case reader checks bounds); what only the whole shows is
  !> refused: a drive without a natural frequency, a series that does not converge, an effect that the laws do not admit.
  pure subroutine build_oscillator(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(oscillator_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: normal_force
    integer :: i
    normal_force = 0
    call refuse_pair(choices, error)
    if (.not. allocated(error)) call refuse_effects(choices, error)
    if (allocated(error)) return
    do i = 1, size(choices)
      if (choices(i)%family /= 'body') cycle
      machine%mass = value_of(choices(i), 'mass')
      normal_force = machine%mass*value_of(choices(i), 'gravity')
    end do
    do i = 1, size(choices)
      select case (choices(i)%family)
      case ('restoring')
        machine%restoring = restoring_of(choices(i))
      case ('friction')
        machine%friction = friction_of(choices(i), normal_force)
      case ('contact')
        machine%contact = contact_of(choices(i), machine%mass)
      case ('drive')
        machine%drive = drive_of(choices(i))
      end select
    end do
    if (.not. allocated(machine%drive%cosine)) allocate (machine%drive%cosine(0), machine%drive%sine(0))
    if (.not. machine%drive%converged) then
      call fail(error, exit_bad_case, 'drive crank_lever_rod: the mechanism passes too close to a dead '// &
                'point (its Fourier series does not converge); move the guide or lengthen the rod')
      return
    end if
    call add_effects(choices, machine, error)
    if (.not. allocated(error)) call set_section(machine, error)
    if (allocated(error)) return
    call set_bounds(machine)
  end subroutine build_oscillator

  !> Puts the effects among the choices on top of the laws.
  pure subroutine add_effects(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(oscillator_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family /= effect_family) cycle
      call add_to_friction(machine%friction, choices(i))
      call add_to_contact(machine%contact, choices(i))
      call add_to_effects(machine%effects, choices(i))
      call add_to_sensor(machine%sensor, choices(i))
      if (choices(i)%name == 'drive_ripple') call add_ripple(machine%drive, choices(i))
    end do
    do i = 1, size(choices)
      if (choices(i)%family /= effect_family) cycle
      ! After the second barrier, which is to be soft too; after the ripple, which these harmonics have no part in.
      select case (choices(i)%name)
      case ('compliant_contact', 'kelvin_voigt_contact', 'contact_curve')
        machine%contact = compliant_contact(machine%contact, choices(i))
      case ('contact_hardening')
        machine%contact = hardened_contact(machine%contact, choices(i))
      case ('drive_harmonics')
        call add_harmonics(machine%drive, choices(i))
      end select
    end do
    call replace_friction(machine%effects, machine%friction)
    call slip_in_series(machine%effects, machine%restoring%stiffness)
    call finish_effects(machine%effects)
    if (.not. machine%drive%converged) call fail(error, exit_bad_case, 'effect.drive_ripple: too large: the Fourier series of '// &
                                                 'the drive does not converge')
  end subroutine add_effects

  !> Frequencies and the period of the section.
  pure subroutine set_section(machine, error)
    type(oscillator_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    machine%natural_frequency = sqrt(machine%restoring%stiffness/machine%mass)
    if (machine%drive%interval > 0) then
      if (size(machine%drive%force) < 2) then
        call fail(error, exit_bad_case, 'drive.force: found less than two samples')
        return
      end if
      machine%period = (size(machine%drive%force) - 1)*machine%drive%interval
      machine%drive_frequency = two_pi/machine%period
      return
    end if
    machine%drive_frequency = machine%natural_frequency
    if (machine%drive%ratio > 0) machine%drive_frequency = machine%drive%ratio*machine%natural_frequency
    if (machine%drive%frequency > 0) then
      machine%drive_frequency = machine%drive%frequency
      machine%drive%ratio = 1
      if (machine%natural_frequency > 0) machine%drive%ratio = machine%drive_frequency/machine%natural_frequency
    end if
    if (machine%drive_frequency > 0) then
      machine%period = two_pi/machine%drive_frequency
    else if (machine%drive%ratio > 0) then
      call fail(error, exit_bad_case, 'drive.ratio needs a restoring law with a stiffness: it is relative '// &
                'to the natural frequency sqrt(c/m)')
    else
      machine%period = 1
      machine%drive_frequency = two_pi
    end if
  end subroutine set_section

  !> The turn of the restoring law, unless a barrier or an effect knows the position.
  pure real(wp) function turn_of(machine) result(turn)
    type(oscillator_t), intent(in) :: machine
    real(wp) :: barriers(2)
    barriers = barrier_positions(machine%contact)
    turn = 0
    if (machine%effects%by_position) return
    if (barriers(1) >= unreachable .and. barriers(2) <= -unreachable) turn = machine%restoring%turn
  end function turn_of

  !> Bounds on the motion of the foot and the scale of the forces.
  pure subroutine set_bounds(machine)
    type(oscillator_t), intent(inout) :: machine
    integer :: n
    machine%turn = turn_of(machine)
    machine%extra = machine%effects%present .or. machine%drive%interval > 0
    do n = 1, size(machine%drive%cosine)
      associate (size_n => sqrt(machine%drive%cosine(n)**2 + machine%drive%sine(n)**2))
        machine%foot_speed_bound = machine%foot_speed_bound + size_n*n*machine%drive_frequency
        machine%foot_acceleration_bound = machine%foot_acceleration_bound &
                                          + size_n*(n*machine%drive_frequency)**2
      end associate
    end do
    associate (length => abs(machine%restoring%free_length) + abs(machine%drive%mean) + sum(abs(machine%drive%cosine)) &
               + sum(abs(machine%drive%sine)), effects => machine%effects)
      machine%force_scale = machine%restoring%stiffness*length + machine%friction%break_away
      ! A pendulum has no length to compare with but the radian.
      if (.not. machine%restoring%is_linear) machine%force_scale = machine%force_scale + machine%restoring%stiffness
      if (machine%drive%interval > 0) machine%force_scale = machine%force_scale + maxval(abs(machine%drive%force))
      if (effects%present) machine%force_scale = machine%force_scale + abs(effects%offset) + abs(effects%asymmetric_coulomb) &
                                                 + effects%dahl_sliding + abs(effects%cubic)*length**3 &
                                                 + maxval(abs([effects%upwards%value, effects%downwards%value]))
      if (effects%by_position_table) machine%force_scale = machine%force_scale + maxval(abs(effects%spring%value)) &
                                                     + maxval(abs(effects%force%value)) + &
                                                     effects%series_stiffness*maxval(abs(effects%play%value))
    end associate
  end subroutine set_bounds

  !> Refuses the laws of two bodies, and those that a motor drives, for one body without. The message begins with the key.
  pure subroutine refuse_pair(choices, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      if (allocated(error)) return
      if (any(choices(i)%family == added_families)) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "'//trim(choices(i)%name)//'", allowed in the '// &
                  'commands trajectory, basin and sweep')
        return
      end if
      if (choices(i)%name /= own_law .and. is_own(choices(i))) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.load: allowed in the commands trajectory, basin and sweep')
        return
      end if
      select case (choices(i)%name)
      case (own_law)
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "expression", allowed in the commands trajectory, '// &
                  'basin and sweep')
      case ('friction_pair', 'backlash_pair')
        call fail(error, exit_bad_case, 'body.law: found "'//trim(choices(i)%name)//'", allowed here point_mass')
      case ('force')
        if (any(choices%family == 'body' .and. choices%name == 'point_mass')) then
          call fail(error, exit_bad_case, 'drive.law: found "force", allowed in the commands trajectory, basin and sweep')
        else
          call fail(error, exit_bad_case, 'drive.law: found "force", allowed with two bodies '// &
                    '(body.law = "friction_pair" or "backlash_pair")')
        end if
      case ('velocity', 'sine', 'pid_velocity', 'pid_sine')
        call fail(error, exit_bad_case, 'drive.law: found "'//trim(choices(i)%name)//'", allowed with two bodies '// &
                  '(body.law = "friction_pair" or "backlash_pair")')
      case ('slider_crank', 'unbalance')
        call fail(error, exit_bad_case, 'drive.law: found "'//trim(choices(i)%name)//'", allowed with a table [motor]')
      end select
    end do
  end subroutine refuse_pair

  !> Force [N] that friction or a barrier must hold to keep the body at rest at `x` [m] with the
  !> crank at `phi` [rad], its rate of change [N/s], and a bound on the magnitude of its second time
  !> derivative [N/s^2] over all angles, where a play has sharp corners up to the next of them. Dahl's friction and a
  !> measured force are not in it.
  pure subroutine holding_force(machine, x, phi, force, rate, curvature_bound)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: x, phi
    real(wp), intent(out) :: force, rate, curvature_bound
    real(wp) :: foot, foot_rate, extension, longest, bounds(2)
    call foot_motion(machine%drive, phi, foot, foot_rate)
    extension = machine%restoring%free_length + foot - x
    force = restoring_force(machine%restoring, extension)
    rate = restoring_stiffness(machine%restoring, extension)*foot_rate*machine%drive_frequency
    if (machine%contact%soft) force = force + force_on_body(machine%contact, x, 0.0_wp)
    curvature_bound = machine%restoring%stiffness*machine%foot_acceleration_bound
    if (.not. machine%effects%present) return
    force = force + machine%effects%offset + extension_force(machine%effects, extension)
    rate = rate + extension_slope(machine%effects, extension)*foot_rate*machine%drive_frequency
    associate (cubic => machine%effects%cubic, speed => machine%foot_speed_bound)
      longest = abs(machine%restoring%free_length + machine%drive%mean - x) + sum(abs(machine%drive%cosine)) &
                + sum(abs(machine%drive%sine))
      curvature_bound = curvature_bound + abs(cubic)*longest*(3*longest*machine%foot_acceleration_bound + 6*speed**2)
      if (.not. machine%effects%by_position_table) return
      force = force + position_force(machine%effects, x)
      bounds = extension_bounds(machine%effects, extension)
      curvature_bound = curvature_bound + bounds(1)*machine%foot_acceleration_bound + bounds(2)*speed**2
    end associate
  end subroutine holding_force

  !> Force [N] on a slipping body at `x` [m], `v` [m/s] at `time` [s after the section] beyond those of the laws, the
  !> spring being stretched by `extension` [m].
  pure real(wp) function extra_force(machine, slip, time, x, v, extension) result(force)
    type(oscillator_t), intent(in) :: machine
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: time, x, v, extension
    real(wp) :: measured, rate
    force = 0
    if (machine%effects%present) force = effect_force(machine%effects, machine%friction, slip, x, v, extension)
    if (machine%drive%interval > 0) then
      call measured_force(machine%drive, time, measured, rate)
      force = force + measured
    end if
  end function extra_force

end module oscillator
