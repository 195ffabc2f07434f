! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The one interface to machines of one body or of several with joints: a state that moves from section to section, and the
!> coordinates that fix it there. Which of the two a machine is, is asked here, in `machine_facts` and in the
!> other modules of this folder; nowhere above it. With `by_event` the section is where the motion of a machine without a clock
!> turns round, see `turn_section`.
module section
  use body_section, only: body_at, body_point, coordinates_of_body, resumed_body, scales_of_body, start_of_body
  use contact_law, only: beyond_barrier
  use energy, only: energy_of_body, record_with_balance
  use multibody_log, only: energy_of_multibody, log_sample, watched_state
  use multibody_motion, only: advance_multibody, advance_multibody_period, start_multibody
  use multibody_section, only: coordinates_of_multibody, fits_section, free_multibody, multibody_at, multibody_point, keeps_clear, &
    scales_of_multibody, start_of_multibody
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use machine_facts, only: has_driver
  use motion, only: advance, advance_period, motion_t
  use motion_state, only: log_t, reset_tally, state_t, take_turns, tally_t
  use section_size, only: most_coordinates
  use text, only: to_text
  use timed_actions, only: acts_on_time
  use turn_section, only: advance_body_to_turn, advance_multibody_to_turn, body_at_turn, body_turn_point, coordinates_of_turn, &
    multibody_at_turn, multibody_turn_point, scales_of_turn
  use two_bodies, only: driver_of => driver_now, keeps_within
  implicit none
  private

  public :: section_state_t, coordinates_of, has_section, section_obstacle, start_section, start_is_allowed, resume_section, &
    section_at, &
    section_point, section_state, scales_of, without_stops, stays_clear, speed_number, advance_section, advance_section_period, &
    advance_past_event, begin_tally, driver_now, energy_now, record_end, advance_to_section, copy_of, turn_point, turn_of

  !> `state` is that of the body, or of the watched one of several.
  type :: section_state_t
    type(state_t) :: state
    type(multibody_state_t) :: multibody
    !> Time from the last section to this one [s].
    real(wp) :: lasted = 0
  end type section_state_t

contains

  !> The same machine without stops, if that takes away just the first `positions` coordinates, positions; else 0.
  pure subroutine without_stops(moving, free, positions)
    type(motion_t), intent(in) :: moving
    type(motion_t), intent(out) :: free
    integer, intent(out) :: positions
    positions = 0
    free = moving
    if (allocated(moving%multibody)) call free_multibody(moving%multibody, free%multibody, positions)
  end subroutine without_stops

  !> Number of a coordinate that is a velocity, of machines of several bodies.
  pure integer function speed_number(moving)
    type(motion_t), intent(in) :: moving
    speed_number = 2
    if (allocated(moving%multibody)) speed_number = size(moving%multibody%directions, 2) + 1
  end function speed_number

  !> Whether a motion on the section comes no nearer to a stop than `distance` [m] in the next `periods`; of one body the tally
  !> knows by how much it missed them.
  pure logical function stays_clear(moving, section, tally, periods, distance)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    integer, intent(in) :: periods
    real(wp), intent(in) :: distance
    if (allocated(moving%multibody)) then
      stays_clear = keeps_clear(moving%multibody, section%multibody, periods, distance)
    else
      stays_clear = distance < tally%grazing_margin
    end if
  end function stays_clear

  !> Number of coordinates on the section.
  pure integer function coordinates_of(moving) result(n)
    type(motion_t), intent(in) :: moving
    if (moving%by_event) then
      n = coordinates_of_turn(moving)
    else if (allocated(moving%multibody)) then
      n = coordinates_of_multibody(moving%multibody)
    else
      n = coordinates_of_body(moving)
    end if
  end function coordinates_of

  !> Whether the state on the section determines what follows: not with a controller that acts at times of its own, nor before an
  !> impulse.
  pure logical function has_section(moving)
    type(motion_t), intent(in) :: moving
    has_section = .true.
    if (allocated(moving%multibody)) has_section = fits_section(moving%multibody)
  end function has_section

  !> Why it does not, '' if it does.
  pure function section_obstacle(moving) result(text)
    type(motion_t), intent(in) :: moving
    character(len=:), allocatable :: text
    text = ''
    if (has_section(moving)) return
    if (allocated(moving%multibody)) then
      text = 'the section has '//to_text(coordinates_of_multibody(moving%multibody))//' coordinates, more than '// &
             to_text(most_coordinates)
      if (acts_on_time(moving%multibody%machine)) text = &
        'with impulses, or samples of a controller, the state at crank angle 0 '// &
                                                       'does not determine what follows'
    end if
    if (has_driver(moving)) text = 'with '//trim(merge('body.impulse     ', 'drive.sample_time', &
                                                       allocated(moving%multibody%machine%impulses)))// &
                                   ' the state at crank angle 0 does not determine what follows'
  end function section_obstacle

  !> A state at x [m], v [m/s] and the crank at an angle [rad]; a driving body as in its machine. What follows in `start` are
  !> positions and velocities of the coordinates of several bodies, in place of those of the machine.
  pure function start_section(moving, start) result(section)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    type(section_state_t) :: section
    if (allocated(moving%multibody)) then
      section%multibody = start_of_multibody(moving%multibody, start(1), start(2), start(3), start(4:))
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else
      section%state = start_of_body(moving, start)
    end if
  end function start_section

  !> Whether no body starts beyond a rigid stop: x [m], v [m/s], crank angle [rad], and what may follow as in `start_section`.
  pure logical function start_is_allowed(moving, start)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    type(section_state_t) :: section
    if (allocated(moving%multibody)) then
      section = start_section(moving, start)
      start_is_allowed = .not. any(section%multibody%q /= section%multibody%q)
      if (start_is_allowed .and. has_driver(moving)) start_is_allowed = keeps_within(moving%multibody%machine, section%multibody)
    else
      start_is_allowed = .not. beyond_barrier(moving%machine%contact, start(1))
    end if
  end function start_is_allowed

  !> The state of one machine given to another, on the section with the crank at an angle [rad]; a driving body whose motion is
  !> given has that of the new one. What was never moved starts as in the new machine.
  pure function resume_section(moving, before, angle) result(section)
    type(motion_t), intent(in) :: moving
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    if (allocated(moving%multibody) .and. before%multibody%time >= 0) then
      section = resume_multibody(moving, before, angle)
      return
    end if
    section = start_section(moving, [before%state%x, before%state%v, angle])
    if (allocated(moving%multibody) .or. before%state%mode == 0) return
    section%state = resumed_body(moving, before%state, angle)
  end function resume_section

  !> The same of several bodies: all keep their positions and velocities.
  pure function resume_multibody(moving, before, angle) result(section)
    type(motion_t), intent(in) :: moving
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    logical :: ok
    type(multibody_state_t) :: from
    from = before%multibody
    associate (n => moving%multibody%machine%n)
      if (has_driver(moving)) from%q(:n) = from%q(:n) - moving%multibody%machine%driver%running*from%clock
      call start_multibody(moving%multibody, from%q(:n), from%v(:n), angle, section%multibody, ok)
    end associate
    section%multibody%slider = before%multibody%slider
    section%multibody%integral = before%multibody%integral
    section%state = watched_state(moving%multibody%machine, section%multibody)
    if (.not. ok) section = start_section(moving, [before%state%x, before%state%v, angle])
  end function resume_multibody

  !> The state on the section with the coordinates `point`; what they leave open is zero.
  pure function section_at(moving, point) result(section)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    if (allocated(moving%multibody)) then
      if (moving%by_event) then
        section%multibody = multibody_at_turn(moving%multibody, point)
      else
        section%multibody = multibody_at(moving%multibody, point)
      end if
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else if (moving%by_event) then
      section%state = body_at_turn(moving, point(1))
    else
      section%state = body_at(moving, point)
    end if
  end function section_at

  !> Coordinates of a state on the section, zeros after the last.
  pure function section_point(moving, section) result(point)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = 0
    if (moving%by_event) then
      point = turn_point(moving, section)
    else if (allocated(moving%multibody)) then
      point = multibody_point(moving%multibody, section%multibody)
    else
      associate (n => coordinates_of_body(moving))
        point(:n) = body_point(moving, section%state)
      end associate
    end if
  end function section_point

  !> x, v at a point of the section, and those of the driving body of two (0 of one).
  pure function section_state(moving, point) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp) :: state(4)
    type(section_state_t) :: section
    section = section_at(moving, point)
    state = [section%state%x, section%state%v, driver_now(moving, section)]
  end function section_state

  !> Sizes of the coordinates in a motion over `half_range` [m] of the position.
  pure function scales_of(moving, half_range) result(scales)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    scales = 1
    if (moving%by_event) then
      scales = scales_of_turn(moving, half_range)
    else if (allocated(moving%multibody)) then
      scales = scales_of_multibody(moving%multibody, half_range)
    else
      scales(:coordinates_of_body(moving)) = scales_of_body(moving, half_range)
    end if
  end function scales_of

  !> What the first coordinate repeats after on the section.
  pure real(wp) function turn_of(moving)
    type(motion_t), intent(in) :: moving
    turn_of = merge(0.0_wp, moving%machine%turn, moving%by_event)
  end function turn_of

  !> Moves to `time_end` [s after the section, at most one period]; `reason` as in `advance`.
  pure subroutine advance_section(moving, section, time_end, tally, reason, log)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (allocated(moving%multibody)) then
      call advance_multibody(moving%multibody, section%multibody, time_end, tally, reason, log)
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else
      call advance(moving, section%state, time_end, tally, reason, log)
    end if
  end subroutine advance_section

  !> Moves past one event, if that comes before `time_end`; one body past a turn to a slip at `speed` [m/s] or faster.
  pure subroutine advance_past_event(moving, section, speed, time_end, tally, reason)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: speed, time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    if (allocated(moving%multibody)) then
      call advance_multibody(moving%multibody, section%multibody, time_end, tally, reason, one_event=.true.)
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else
      call advance(moving, section%state, time_end, tally, reason, slip_speed=speed)
    end if
  end subroutine advance_past_event

  !> Moves to the next section and starts the clock anew.
  pure subroutine advance_section_period(moving, section, tally, reason, log)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (moving%by_event) then
      call advance_to_section(moving, section, tally, reason)
      return
    end if
    section%lasted = moving%machine%period
    if (allocated(moving%multibody)) then
      call advance_multibody_period(moving%multibody, section%multibody, tally, reason, log)
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else
      call advance_period(moving, section%state, tally, reason, log)
      call take_turns(moving%machine%turn, section%state, tally)
    end if
  end subroutine advance_section_period

  !> Moves a machine without a clock to where it turns round; `reason` is `reason_time_over` if it does not.
  pure subroutine advance_to_section(moving, section, tally, reason)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    if (allocated(moving%multibody)) then
      call advance_multibody_to_turn(moving%multibody, section%multibody, section%lasted, tally, reason)
      section%state = watched_state(moving%multibody%machine, section%multibody)
    else
      call advance_body_to_turn(moving, section%state, section%lasted, tally, reason)
    end if
  end subroutine advance_to_section

  !> A copy of a state, to be moved on its own.
  pure type(section_state_t) function copy_of(section) result(copy)
    class(section_state_t), intent(in) :: section
    copy%state = section%state
    copy%multibody = section%multibody
    copy%lasted = section%lasted
  end function copy_of

  !> Coordinates of a state there, zeros after the last.
  pure function turn_point(moving, section) result(point)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = 0
    if (allocated(moving%multibody)) then
      point = multibody_turn_point(moving%multibody, section%multibody)
    else
      point(1) = body_turn_point(moving, section%state)
    end if
  end function turn_point

  !> Begins the counts of a motion anew where it is now.
  pure subroutine begin_tally(moving, section, tally)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(inout) :: tally
    call reset_tally(tally, section%state, has_driver(moving))
  end subroutine begin_tally

  !> Position and velocity of the driving body of two [m, m/s], zeros without one.
  pure function driver_now(moving, section) result(driver)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    real(wp) :: driver(2)
    driver = 0
    if (has_driver(moving)) driver = driver_of(moving%multibody%machine, section%multibody)
  end function driver_now

  !> Energy of the machine [J].
  pure real(wp) function energy_now(moving, section) result(energy)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    if (allocated(moving%multibody)) then
      energy = energy_of_multibody(moving%multibody%machine, section%multibody)
    else
      energy = energy_of_body(moving%machine, section%state)
    end if
  end function energy_now

  !> Closes the balance of a log, with a last sample if it has any.
  pure subroutine record_end(moving, section, sampled, log)
    type(motion_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    logical, intent(in) :: sampled
    type(log_t), intent(inout) :: log
    log%balance%at_end = energy_now(moving, section)
    if (.not. sampled) return
    if (allocated(moving%multibody)) then
      call log_sample(moving%multibody%machine, section%multibody, log)
    else
      call record_with_balance(moving%machine, section%state, log)
    end if
  end subroutine record_end

end module section
