! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction as a jointed structure. `flown_structure` is what flies: the places of both bodies on the
!> ground, or that of the driven one alone. `structure_of_pair` is what is varied, of as few coordinates as its section has: the
!> place of the driving body, where it is free and anything ties it to the ground, and that of the driven one, relative to the
!> driving one where that carries the stops or nothing ties either to the ground.
module pair_as_structure
  use assembly, only: add_body, add_force, add_joint, add_link, finish, give_motion, index_of, &
    set_sizes
  use constants, only: two_pi, unreachable
  use elementary, only: sine_cosine
  use control, only: add_controller, add_impulse
  use errors, only: error_t, fail
  use jointed, only: controller_t, impulse_t, joint_contact, joint_friction, joint_soft, joint_t, jointed_t, wave_t
  use kinds, only: wp
  use pair, only: driven_by_controller, driven_by_force, driven_by_motion, pair_t
  use status, only: exit_bad_case
  implicit none
  private

  public :: structure_of_pair, start_as_structure, start_of_section, flown_structure

contains

  !> The structure of two bodies. Code 65, the message beginning with the key, for what a structure has no law of.
  pure subroutine structure_of_pair(pair, machine, error)
    type(pair_t), intent(in) :: pair
    type(jointed_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    complex(wp) :: harmonic(1)
    real(wp) :: driving_row(2)
    call refuse(pair, error)
    if (allocated(error)) return
    harmonic = cmplx(pair%amplitude, -pair%quadrature, wp)
    if (floats(pair)) then
      call add_body(machine, 'driven', pair%mass*pair%driven_mass/(pair%mass + pair%driven_mass), 0.0_wp)
      associate (share => pair%driven_mass/(pair%mass + pair%driven_mass))
        call add_force(machine, [1.0_wp], -share*pair%mean, -share*harmonic)
      end associate
      machine%frequency = pair%frequency
      call add_joints(pair, [1.0_wp], [1.0_wp], machine)
    else
      driving_row = [1.0_wp, 0.0_wp]
      call add_body(machine, 'driving', pair%mass, 0.0_wp)
      call add_body(machine, 'driven', pair%driven_mass, 0.0_wp)
      machine%watched = 2
      machine%frequency = pair%frequency
      call add_link(machine, driving_row, pair%stiffness, pair%damping, pair%free_length)
      if (pair%carried) then
        machine%mass(1, 1) = pair%mass + pair%driven_mass
        machine%mass(1, 2) = pair%driven_mass
        machine%mass(2, 1) = pair%driven_mass
      end if
      call add_joints(pair, [merge(0.0_wp, -1.0_wp, pair%carried), 1.0_wp], [0.0_wp, 1.0_wp], machine)
      if (pair%drive == driven_by_motion) then
        call give_motion(machine, 'driving', wave_t(mean=pair%mean, harmonic=harmonic))
      else
        call add_force(machine, driving_row, pair%mean, harmonic)
      end if
    end if
    call finish(machine, error)
  end subroutine structure_of_pair

  !> The structure of any two bodies, for flights: coordinates are the places of both on the ground, or of the driven one where the
  !> motion of the other is given.
  pure subroutine flown_structure(pair, machine, error)
    type(pair_t), intent(in) :: pair
    type(jointed_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(controller_t) :: controller
    type(wave_t) :: wave
    real(wp), parameter :: driving(2) = [1.0_wp, 0.0_wp], driven(2) = [0.0_wp, 1.0_wp]
    logical :: given
    given = pair%drive == driven_by_motion
    allocate (wave%harmonic(1))
    wave%mean = pair%mean
    wave%rate = pair%velocity
    wave%harmonic = cmplx(pair%amplitude, -pair%quadrature, wp)
    machine%frequency = pair%frequency
    machine%section_time = pair%period
    call add_body(machine, 'driving', pair%mass, 0.0_wp)
    call add_body(machine, 'driven', pair%driven_mass, 0.0_wp)
    machine%watched = 2
    call add_joints(pair, driven - driving, merge(driven - driving, driven, pair%carried), machine)
    if (given) then
      call give_motion(machine, 'driving', wave)
    else
      call add_link(machine, driving, pair%stiffness, pair%damping, pair%free_length)
      if (pair%drive == driven_by_force) then
        call add_force(machine, driving, wave%mean, wave%harmonic)
      else
        controller = controller_t(row=driving, reference=wave, proportional=pair%proportional, integral=pair%integral, &
                                  derivative=pair%derivative, sample_time=pair%sample_time)
        call add_controller(machine, controller, 'integral.1', error)
        if (allocated(error)) return
      end if
    end if
    call finish(machine, error)
    if (allocated(error)) return
    call name_driver(pair, wave, machine)
    if (.not. abs(pair%blow) > 0) return
    call add_impulse(machine, impulse_t(row=merge(1.0_wp, 0.0_wp, machine%names == 'driven'), amount=pair%blow, &
                                        time=pair%blow_time))
  end subroutine flown_structure

  !> What is told of the driving body, and where it starts.
  pure subroutine name_driver(pair, wave, machine)
    type(pair_t), intent(in) :: pair
    type(wave_t), intent(in) :: wave
    type(jointed_t), intent(inout) :: machine
    allocate (machine%driver)
    associate (driver => machine%driver)
      driver%at = index_of(machine, 'driving')
      driver%carries = pair%carried
      allocate (driver%running(machine%n), driver%push(machine%n), source=0.0_wp)
      if (driver%at == 0) then
        driver%motion = wave
        if (pair%carried) driver%stops_run = pair%velocity
        call set_sizes(machine, pair%driven_mass*(abs(pair%amplitude) + abs(pair%quadrature))*pair%frequency**2)
        return
      end if
      machine%start(:, driver%at) = [pair%driver_x0, pair%driver_v0]
      driver%rest_energy = 0.5_wp*pair%stiffness*pair%free_length**2
      if (pair%drive == driven_by_force) driver%push(driver%at) = pair%mean
      if (pair%drive /= driven_by_controller) return
      driver%running(driver%at) = pair%velocity
      if (pair%carried) driver%running(machine%watched) = pair%velocity
    end associate
  end subroutine name_driver

  !> What a structure cannot be, or what has no section by the drive.
  pure subroutine refuse(pair, error)
    type(pair_t), intent(in) :: pair
    type(error_t), allocatable, intent(out) :: error
    if (pair%drive == driven_by_controller) then
      call fail(error, exit_bad_case, 'drive.law: found a controller, allowed force, sine: variations of two bodies have no '// &
                'law for its integral and samples')
    else if (.not. pair%frequency > 0) then
      call fail(error, exit_bad_case, 'drive.law: found two bodies without a periodic drive, allowed force, sine: their '// &
                'variations are known from one drive period to the next')
    else if (abs(pair%blow) > 0) then
      call fail(error, exit_bad_case, 'body.blow: found a blow, allowed 0 N s: variations of two bodies have no law for it')
    end if
  end subroutine refuse

  !> Whether nothing ties either body to the ground: then only their relative motion counts.
  pure logical function floats(pair)
    type(pair_t), intent(in) :: pair
    floats = pair%drive == driven_by_force .and. .not. pair%stiffness > 0 .and. .not. pair%damping > 0 .and. &
             (pair%carried .or. (pair%upper >= unreachable .and. pair%lower <= -unreachable))
  end function floats

  !> Friction along one row, stops along another.
  pure subroutine add_joints(pair, friction_row, contact_row, machine)
    type(pair_t), intent(in) :: pair
    real(wp), intent(in) :: friction_row(:), contact_row(:)
    type(jointed_t), intent(inout) :: machine
    type(joint_t) :: friction, contact
    ! Stops without room leave friction along them nothing to do.
    if (pair%friction > 0 .and. .not. (pair%carried .and. .not. pair%contact%soft .and. .not. pair%upper > pair%lower)) then
      friction%name = 'body.friction'
      friction%kind = joint_friction
      friction%row = friction_row
      friction%friction%kinetic = pair%friction
      ! A tie of forces sticks.
      friction%friction%break_away = pair%friction*(1 + 32*epsilon(1.0_wp))
      call add_joint(machine, friction)
    end if
    if (pair%upper >= unreachable .and. pair%lower <= -unreachable) return
    contact%name = 'contact'
    contact%kind = merge(joint_soft, joint_contact, pair%contact%soft)
    contact%row = contact_row
    contact%contact = pair%contact
    if (pair%upper < unreachable) contact%upper = pair%upper
    if (pair%lower > -unreachable) contact%lower = pair%lower
    call add_joint(machine, contact)
  end subroutine add_joints

  !> Place and velocity of the driving body where its motion is given, at an angle of the drive [rad].
  pure function given_motion(pair, angle) result(driver)
    type(pair_t), intent(in) :: pair
    real(wp), intent(in) :: angle
    real(wp) :: driver(2), sine, cosine
    call sine_cosine(modulo(angle, two_pi), sine, cosine)
    driver(1) = pair%mean + pair%amplitude*cosine + pair%quadrature*sine
    driver(2) = pair%velocity + pair%frequency*(pair%quadrature*cosine - pair%amplitude*sine)
  end function given_motion

  !> A start of two bodies (`x` [m], `v` [m/s] of the driven one, crank angle [rad]) as one of their structure, see `start_strobe`.
  pure function start_as_structure(pair, start) result(other)
    type(pair_t), intent(in) :: pair
    real(wp), intent(in) :: start(:)
    real(wp), allocatable :: other(:)
    real(wp) :: driver(2), driven(2)
    driver = [pair%driver_x0, pair%driver_v0]
    if (pair%drive == driven_by_motion) driver = given_motion(pair, start(3))
    driven = start(:2)
    if (pair%carried .or. floats(pair)) driven = driven - driver
    other = [driven, start(3)]
    if (pair%drive == driven_by_force .and. .not. floats(pair)) other = [other, driver, driven]
  end function start_as_structure

  !> The start, see `start_strobe`, of two bodies on the section with the places `q` and velocities `v` of their structure.
  pure function start_of_section(pair, q, v) result(start)
    type(pair_t), intent(in) :: pair
    real(wp), intent(in) :: q(:), v(:)
    real(wp), allocatable :: start(:)
    real(wp) :: driver(2), driven(2)
    driver = 0
    if (pair%drive == driven_by_motion) then
      driver = given_motion(pair, 0.0_wp)
    else if (.not. floats(pair)) then
      driver = [q(1), v(1)]
    end if
    driven = [q(size(q)), v(size(v))]
    if (pair%carried .or. floats(pair)) driven = driven + driver
    start = [driven, 0.0_wp]
    if (pair%drive == driven_by_force) start = [start, driver, driven]
  end function start_of_section

end module pair_as_structure
