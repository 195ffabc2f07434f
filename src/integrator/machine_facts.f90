! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What those who look at a motion have to know of the machine, whatever it is: one body, two or several.
module machine_facts
  use constants, only: unreachable
  use contact_law, only: barrier_positions, contact_t
  use eigen, only: undamped_modes
  use multibody, only: is_stop, multibody_t
  use multibody_state, only: acts_as_spring
  use kinds, only: wp
  use motion, only: motion_t
  use two_bodies, only: contact_at
  implicit none
  private

  public :: is_one_body, structure_in, has_drive_period, has_mode, has_driver, has_stops, rides_along, rest_lasts, &
    smallest_motion, stops_of, contact_sizes

contains

  !> Whether `moving%machine` describes all of the machine.
  pure logical function is_one_body(moving)
    type(motion_t), intent(in) :: moving
    is_one_body = .not. allocated(moving%multibody)
  end function is_one_body

  !> The structure that moves; that of one body has no coordinates.
  pure type(multibody_t) function structure_in(moving) result(machine)
    type(motion_t), intent(in) :: moving
    allocate (machine%joints(0))
    if (allocated(moving%multibody)) machine = moving%multibody%machine
  end function structure_in

  !> Whether a drive repeats, so that its period is the time between two sections.
  pure logical function has_drive_period(moving)
    type(motion_t), intent(in) :: moving
    if (allocated(moving%multibody)) then
      has_drive_period = moving%multibody%machine%driven
    else
      has_drive_period = moving%machine%drive%ratio > 0 .or. moving%machine%drive%interval > 0
    end if
  end function has_drive_period

  !> Whether the section of a machine without a drive is a period of its slowest mode; else it is only a unit of time. Springs
  !> that are not in the stiffness matrix may make modes that nobody has computed.
  pure logical function has_mode(moving)
    type(motion_t), intent(in) :: moving
    real(wp), allocatable :: squares(:), shapes(:, :)
    if (.not. allocated(moving%multibody)) then
      has_mode = moving%machine%natural_frequency > 0
      return
    end if
    associate (machine => moving%multibody%machine)
      allocate (squares(machine%n), shapes(machine%n, machine%n))
      call undamped_modes(machine%stiffness, machine%mass, squares, shapes)
      has_mode = squares(machine%n) > 0 .and. all(.not. (abs(machine%joints%moment) > 0 .or. abs(machine%joints%attraction) > 0))
    end associate
  end function has_mode

  !> Whether there is anything to hit.
  pure logical function has_stops(moving)
    type(motion_t), intent(in) :: moving
    if (allocated(moving%multibody)) then
      has_stops = any(is_stop(moving%multibody%machine%joints%kind))
    else
      has_stops = any(abs(barrier_positions(moving%machine%contact)) < unreachable)
    end if
  end function has_stops

  !> Whether there is a driving body beside the one that is looked at.
  pure logical function has_driver(moving)
    type(motion_t), intent(in) :: moving
    has_driver = .false.
    if (allocated(moving%multibody)) has_driver = allocated(moving%multibody%machine%driver)
  end function has_driver

  !> Whether bodies that do not slip may well move: they ride along.
  pure logical function rides_along(moving)
    type(motion_t), intent(in) :: moving
    rides_along = has_driver(moving)
  end function rides_along

  !> Whether a period without slip is followed by none with any: a body at rest under periodic forces, or two that move
  !> as one in a way that is given.
  pure logical function rest_lasts(moving)
    type(motion_t), intent(in) :: moving
    rest_lasts = .true.
    if (has_driver(moving)) rest_lasts = moving%multibody%machine%driver%at == 0
  end function rest_lasts

  !> Amplitude [m] of a motion below which it is rounding: a thousandth of what the forces do.
  pure real(wp) function smallest_motion(moving) result(smallest)
    type(motion_t), intent(in) :: moving
    smallest = 1e-3_wp
    if (moving%machine%restoring%stiffness > 0 .and. moving%machine%force_scale > 0) then
      smallest = 1e-3_wp*moving%machine%force_scale/moving%machine%restoring%stiffness
    end if
    if (has_driver(moving)) then
      smallest = 1e-3_wp*moving%multibody%machine%force_scale/(moving%machine%mass*moving%machine%drive_frequency**2)
    end if
  end function smallest_motion

  !> The stops of the one body that is looked at, or of two; those of other structures belong to their joints.
  pure type(contact_t) function stops_of(moving) result(stops)
    type(motion_t), intent(in) :: moving
    integer :: stop
    stops = moving%machine%contact
    if (.not. has_driver(moving)) return
    stop = contact_at(moving%multibody%machine)
    if (stop > 0) stops = moving%multibody%machine%joints(stop)%contact
  end function stops_of

  !> What presses a contact: the mass that an impact feels [kg], the size of the forces [N], and whether it is flown in closed form.
  pure subroutine contact_sizes(moving, mass, force, closed_form)
    type(motion_t), intent(in) :: moving
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    integer :: stop
    mass = moving%machine%mass
    force = moving%machine%force_scale
    closed_form = moving%pressed%available
    if (.not. has_driver(moving)) return
    associate (machine => moving%multibody%machine)
      stop = contact_at(machine)
      mass = 1/sum(machine%joints(stop)%row*matmul(machine%mobility, machine%joints(stop)%row))
      force = machine%force_scale
      closed_form = acts_as_spring(machine%joints(stop), 1)
    end associate
  end subroutine contact_sizes

end module machine_facts
