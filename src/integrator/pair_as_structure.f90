! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction as a multibody structure.
module pair_as_structure
  use assembly, only: add_body, add_force, add_joint, add_link, finish, give_motion, index_of, &
    set_sizes
  use constants, only: unreachable
  use control, only: add_controller, add_impulse
  use errors, only: error_t
  use multibody, only: controller_t, impulse_t, joint_contact, joint_friction, joint_soft, joint_t, multibody_t, wave_t
  use kinds, only: wp
  use pair, only: driven_by_controller, driven_by_force, driven_by_motion, pair_t
  implicit none
  private

  public :: structure_of_pair

contains

  !> The structure of two bodies: coordinates are the positions of both on the ground, or of the driven one where the motion
  !> of the other is given.
  pure subroutine structure_of_pair(pair, machine, error)
    type(pair_t), intent(in) :: pair
    type(multibody_t), intent(out) :: machine
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
    if (.not. abs(pair%impulse) > 0) return
    call add_impulse(machine, impulse_t(row=merge(1.0_wp, 0.0_wp, machine%names == 'driven'), amount=pair%impulse, &
                                        time=pair%impulse_time))
  end subroutine structure_of_pair

  !> What is reported of the driving body, and where it starts.
  pure subroutine name_driver(pair, wave, machine)
    type(pair_t), intent(in) :: pair
    type(wave_t), intent(in) :: wave
    type(multibody_t), intent(inout) :: machine
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
      if (pair%drive == driven_by_force) driver%push(driver%at) = pair%mean
      if (pair%drive /= driven_by_controller) return
      driver%running(driver%at) = pair%velocity
      if (pair%carried) driver%running(machine%watched) = pair%velocity
    end associate
  end subroutine name_driver

  !> Friction along one row, stops along another.
  pure subroutine add_joints(pair, friction_row, contact_row, machine)
    type(pair_t), intent(in) :: pair
    real(wp), intent(in) :: friction_row(:), contact_row(:)
    type(multibody_t), intent(inout) :: machine
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

end module pair_as_structure
