! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies on the stroboscopic section: place and velocity of the driven and of the driving one, and the integral of a
!> controller. What nothing depends on is left out: the driving body where its motion is given, the position of one that nothing
!> ties and of the driven one where no stop bounds it, the velocity of both where nothing ties either to the ground.
module pair_section
  use constants, only: two_pi, unreachable
  use contact_law, only: contact_t
  use kinds, only: wp
  use pair, only: driven_by_controller, driven_by_force, driven_by_motion
  use pair_modes, only: at_integral, at_ramp, at_v1, at_v2, at_x1, at_x2, pair_motion_t, pair_state_t
  use pair_motion, only: start_pair
  use section_size, only: most_coordinates
  implicit none
  private

  public :: coordinates_of_pair, free_pair, tells_what_follows, start_of_pair, resumed_pair, pair_at, pair_point, scales_of_pair

  integer, parameter :: of_place = 1, of_v2 = 2, of_x1 = 3, of_v1 = 4, of_integral = 5, of_two = 5

contains

  !> Which coordinates count.
  pure function counts_of(moving) result(counts)
    type(pair_motion_t), intent(in) :: moving
    logical :: counts(of_two)
    associate (machine => moving%machine)
      counts = .false.
      counts(of_place) = machine%upper < unreachable .or. machine%lower > -unreachable
      counts(of_v2) = .true.
      if (machine%drive == driven_by_motion) return
      counts(of_x1) = machine%stiffness > 0 .or. machine%drive == driven_by_controller
      counts(of_v1) = .not. floats(moving)
      counts(of_integral) = abs(machine%integral) > 0
    end associate
  end function counts_of

  !> Whether two bodies may as well be looked at from a frame that moves along.
  pure logical function floats(moving)
    type(pair_motion_t), intent(in) :: moving
    associate (machine => moving%machine)
      floats = machine%drive == driven_by_force .and. .not. machine%stiffness > 0 .and. .not. machine%damping > 0 .and. &
               (machine%carried .or. (machine%upper >= unreachable .and. machine%lower <= -unreachable))
    end associate
  end function floats

  !> Number of coordinates on the section.
  pure integer function coordinates_of_pair(moving) result(n)
    type(pair_motion_t), intent(in) :: moving
    n = count(counts_of(moving))
  end function coordinates_of_pair

  !> The same two bodies without stops, if that takes away just the first coordinate, the place; else nothing.
  pure subroutine free_pair(moving, free, found)
    type(pair_motion_t), intent(in) :: moving
    type(pair_motion_t), intent(out) :: free
    logical, intent(out) :: found
    free = moving
    associate (machine => free%machine)
      machine%contact = contact_t()
      machine%upper = huge(1.0_wp)
      machine%lower = -huge(1.0_wp)
    end associate
    associate (before => counts_of(moving), after => counts_of(free))
      found = before(of_place) .and. .not. after(of_place) .and. all(before(of_v2:) .eqv. after(of_v2:))
    end associate
  end subroutine free_pair

  !> Whether the state on the section tells what follows: not with a controller that acts at times of its own, nor before
  !> a blow.
  pure logical function tells_what_follows(moving)
    type(pair_motion_t), intent(in) :: moving
    tells_what_follows = .not. moving%machine%sample_time > 0 .and. .not. abs(moving%machine%blow) > 0
  end function tells_what_follows

  !> A state of the driven body at x [m], v [m/s] and the drive at an angle [rad]; the driving body as the machine says.
  pure type(pair_state_t) function start_of_pair(moving, start) result(state)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    state = start_pair(moving, start(1), start(2), [moving%machine%driver_x0, moving%machine%driver_v0], start(3))
  end function start_of_pair

  !> The state of one machine given to another, with the drive at `angle` [rad]; a driving body whose motion is given has that of
  !> the new one.
  pure type(pair_state_t) function resumed_pair(moving, before, angle) result(state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    associate (y => before%y)
      state = start_pair(moving, y(at_x2) - merge(y(at_ramp), 0.0_wp, moving%machine%carried), y(at_v2), &
                         [y(at_x1) - y(at_ramp), y(at_v1)], angle, y(at_integral))
    end associate
  end function resumed_pair

  !> The state on the section with the coordinates `point`; what they leave open is zero.
  pure type(pair_state_t) function pair_at(moving, point) result(state)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp) :: all_of_them(of_two)
    all_of_them = unpack(point(:coordinates_of_pair(moving)), counts_of(moving), 0.0_wp)
    associate (machine => moving%machine)
      if (machine%carried) then
        if (machine%drive == driven_by_motion) all_of_them(of_x1) = machine%mean + machine%amplitude
        all_of_them(of_place) = all_of_them(of_place) + all_of_them(of_x1)
      end if
    end associate
    state = start_pair(moving, all_of_them(of_place), all_of_them(of_v2), all_of_them([of_x1, of_v1]), 0.0_wp, &
                       all_of_them(of_integral))
  end function pair_at

  !> Coordinates of a state on the section, zeros after the last.
  pure function pair_point(moving, state) result(point)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    real(wp) :: point(most_coordinates), all_of_them(of_two)
    all_of_them = state%y([at_x2, at_v2, at_x1, at_v1, at_integral])
    if (moving%machine%carried) all_of_them(of_place) = all_of_them(of_place) - all_of_them(of_x1)
    if (floats(moving)) all_of_them(of_v2) = all_of_them(of_v2) - all_of_them(of_v1)
    ! A reference that runs away takes the driving body along.
    all_of_them(of_x1) = all_of_them(of_x1) - state%y(at_ramp)
    point = 0
    point(:coordinates_of_pair(moving)) = pack(all_of_them, counts_of(moving))
  end function pair_point

  !> Sizes of the coordinates in a motion over `half_range` [m] of the position. The bodies may drift: then they are those of what
  !> the stops or the forces allow.
  pure function scales_of_pair(moving, half_range) result(scales)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp), allocatable :: scales(:)
    real(wp) :: w, length
    logical :: counts(of_two)
    counts = counts_of(moving)
    w = two_pi/moving%machine%period
    length = half_range
    if (moving%machine%carried) length = min(length, (moving%machine%upper - moving%machine%lower)/2)
    if (.not. counts(of_place)) length = min(length, moving%force_scale/(moving%machine%driven_mass*w**2))
    scales = pack(length*[1.0_wp, w, 1.0_wp, w, 1/w], counts)
  end function scales_of_pair

end module pair_section
