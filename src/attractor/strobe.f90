! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine of one body, two or several as the stroboscopic map sees it: a state that moves from section to section, and the
!> coordinates that fix it there. Those of one body are x and v, and what its laws remember: the force of Dahl's friction, the speed
!> at which a contact that lasts began. Of two, what nothing depends on is left out: the driving
!> body where its motion is given, the position of one that nothing ties and of the driven one where no stop bounds it, the
!> velocity of both where nothing ties either to the ground. With `by_event` the section is where the motion of a machine without a
!> clock turns round, see `turn_section`.
module strobe
  use attractors, only: features_t, most_coordinates, regime_at_rest, regime_of, regime_stuck, wrap_range
  use contact_law, only: contact_t
  use energy, only: energy_of_body, record_with_book
  use event_words, only: canonical_word
  use jointed_log, only: energy_of_jointed, log_sample, watched_state
  use jointed_motion, only: advance_jointed, advance_jointed_period, start_jointed
  use jointed_section, only: coordinates_of_jointed, fits_section, jointed_at, jointed_point, scales_of_jointed, &
    start_of_jointed
  use jointed_state, only: jointed_state_t
  use kinds, only: int64, wp
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: log_t, record_sample, reset_tally, state_t, take_turns, tally_t
  use pair, only: driven_by_controller, driven_by_force, driven_by_motion
  use pair_flight, only: body_state, driver_of, energy_of
  use pair_modes, only: at_integral, at_ramp, at_v1, at_v2, at_x1, at_x2, pair_state_t
  use pair_motion, only: advance_pair, advance_pair_period, start_pair
  use turn_section, only: advance_body_to_turn, advance_jointed_to_turn, body_at_turn, body_turn_point, coordinates_of_turn, &
    jointed_at_turn, jointed_turn_point, scales_of_turn
  implicit none
  private

  public :: strobe_t, coordinates_of, has_section, start_strobe, resume_strobe, strobe_at, section_point, section_state, &
    scales_of, without_stops, advance_strobe, advance_strobe_period, features_over, cycle_word, rest_lasts, energy_now, &
    record_end, advance_to_section, turn_point, turn_of

  !> Coordinates of two bodies.
  integer, parameter :: of_place = 1, of_v2 = 2, of_x1 = 3, of_v1 = 4, of_integral = 5, of_two = 5

  !> `state` is that of the body, or of the driven one of two.
  type :: strobe_t
    type(state_t) :: state
    type(pair_state_t) :: pair
    type(jointed_state_t) :: jointed
    !> Time from the last section to this one [s].
    real(wp) :: lasted = 0
  end type strobe_t

contains

  !> Which coordinates of two bodies count.
  pure function counts_of(moving) result(counts)
    type(motion_t), intent(in) :: moving
    logical :: counts(of_two)
    real(wp), parameter :: unreachable = sqrt(huge(1.0_wp))
    associate (machine => moving%pair%machine)
      counts = .false.
      counts(of_place) = machine%upper < unreachable .or. machine%lower > -unreachable
      counts(of_v2) = .true.
      if (machine%drive == driven_by_motion) return
      counts(of_x1) = machine%stiffness > 0 .or. machine%drive == driven_by_controller
      counts(of_v1) = .not. floats(moving)
      counts(of_integral) = abs(machine%integral) > 0
    end associate
  end function counts_of

  !> The same two bodies without stops, if that takes away just the first coordinate, the place; else nothing.
  pure subroutine without_stops(moving, free, found)
    type(motion_t), intent(in) :: moving
    type(motion_t), intent(out) :: free
    logical, intent(out) :: found
    found = .false.
    if (.not. allocated(moving%pair)) return
    free = moving
    free%machine%contact = contact_t()
    associate (machine => free%pair%machine)
      machine%contact = contact_t()
      machine%upper = huge(1.0_wp)
      machine%lower = -huge(1.0_wp)
    end associate
    associate (before => counts_of(moving), after => counts_of(free))
      found = before(of_place) .and. .not. after(of_place) .and. all(before(of_v2:) .eqv. after(of_v2:))
    end associate
  end subroutine without_stops

  !> Whether two bodies may as well be looked at from a frame that moves along.
  pure logical function floats(moving)
    type(motion_t), intent(in) :: moving
    real(wp), parameter :: unreachable = sqrt(huge(1.0_wp))
    associate (machine => moving%pair%machine)
      floats = machine%drive == driven_by_force .and. .not. machine%stiffness > 0 .and. .not. machine%damping > 0 .and. &
               (machine%carried .or. (machine%upper >= unreachable .and. machine%lower <= -unreachable))
    end associate
  end function floats

  !> Number of coordinates on the section.
  pure integer function coordinates_of(moving) result(n)
    type(motion_t), intent(in) :: moving
    if (moving%by_event) then
      n = coordinates_of_turn(moving)
    else if (allocated(moving%jointed)) then
      n = coordinates_of_jointed(moving%jointed)
    else if (allocated(moving%pair)) then
      n = count(counts_of(moving))
    else
      n = 2 + count(remembers(moving))
    end if
  end function coordinates_of

  !> What the laws of one body remember: the force of Dahl's friction, the speed at which a contact began.
  pure function remembers(moving)
    type(motion_t), intent(in) :: moving
    logical :: remembers(2)
    associate (machine => moving%machine)
      remembers = [machine%effects%dahl_stiffness > 0, machine%contact%soft .and. machine%contact%by_impact]
    end associate
  end function remembers

  !> A body at a point of the section.
  pure type(state_t) function body_at(moving, point) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp) :: memory(2)
    memory = unpack(point(3:), remembers(moving), [0.0_wp, abs(point(2))])
    state = start_state(moving, point(1), point(2), 0.0_wp, z=memory(1), touch_speed=abs(memory(2)))
    call take_turns(moving%machine%turn, state)
  end function body_at

  !> The coordinates of a body on the section; the speed of a contact that is over is zero.
  pure function body_point(moving, state) result(point)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    real(wp), allocatable :: point(:)
    logical :: lasts
    associate (contact => moving%machine%contact)
      lasts = state%x > contact%soft_upper .or. state%x < contact%soft_lower
    end associate
    point = [state%x, state%v, pack([state%z, merge(state%touch_speed, 0.0_wp, lasts)], remembers(moving))]
  end function body_point

  !> Whether the state on the section tells what follows: not with a controller that acts at times of its own, nor before
  !> a blow.
  pure logical function has_section(moving)
    type(motion_t), intent(in) :: moving
    has_section = .true.
    if (allocated(moving%jointed)) has_section = fits_section(moving%jointed)
    if (.not. allocated(moving%pair)) return
    associate (machine => moving%pair%machine)
      has_section = .not. machine%sample_time > 0 .and. .not. abs(machine%blow) > 0
    end associate
  end function has_section

  !> A state at x [m], v [m/s] and the crank at an angle [rad]; a driving body as its machine says. What follows in `start`
  !> are places and velocities of the coordinates of several bodies, in the place of those that the machine says.
  pure function start_strobe(moving, start) result(strobe)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    type(strobe_t) :: strobe
    if (allocated(moving%jointed)) then
      strobe%jointed = start_of_jointed(moving%jointed, start(1), start(2), start(3), start(4:))
      strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
    else if (allocated(moving%pair)) then
      associate (machine => moving%pair%machine)
        strobe%pair = start_pair(moving%pair, start(1), start(2), [machine%driver_x0, machine%driver_v0], start(3))
      end associate
      strobe%state = body_state(strobe%pair)
    else
      strobe%state = start_state(moving, start(1), start(2), start(3))
      call take_turns(moving%machine%turn, strobe%state)
    end if
  end function start_strobe

  !> The state of one machine given to another, on the section with the crank at an angle [rad]; a driving body whose motion
  !> is given has that of the new one. What was never moved starts as the new machine says.
  pure function resume_strobe(moving, before, angle) result(strobe)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(strobe_t) :: strobe
    if (allocated(moving%jointed) .and. before%jointed%time >= 0) then
      strobe = resume_jointed(moving, before, angle)
      return
    end if
    if (.not. allocated(moving%pair) .or. before%pair%mode == 0) then
      strobe = start_strobe(moving, [before%state%x, before%state%v, angle])
      if (allocated(moving%pair) .or. allocated(moving%jointed) .or. before%state%mode == 0) return
      associate (state => before%state)
        strobe%state = start_state(moving, state%x, state%v, angle, z=state%z, touch_speed=state%touch_speed)
      end associate
      call take_turns(moving%machine%turn, strobe%state)
      return
    end if
    associate (y => before%pair%y)
      strobe%pair = start_pair(moving%pair, y(at_x2) - merge(y(at_ramp), 0.0_wp, moving%pair%machine%carried), y(at_v2), &
                               [y(at_x1) - y(at_ramp), y(at_v1)], angle, y(at_integral))
    end associate
    strobe%state = body_state(strobe%pair)
  end function resume_strobe

  !> The same of several bodies: all keep their places and velocities.
  pure function resume_jointed(moving, before, angle) result(strobe)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(strobe_t) :: strobe
    logical :: ok
    associate (n => moving%jointed%machine%n)
      call start_jointed(moving%jointed, before%jointed%q(:n), before%jointed%v(:n), angle, strobe%jointed, ok)
    end associate
    strobe%jointed%slider = before%jointed%slider
    strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
    if (.not. ok) strobe = start_strobe(moving, [before%state%x, before%state%v, angle])
  end function resume_jointed

  !> The state on the section with the coordinates `point`; what they leave open is zero.
  pure function strobe_at(moving, point) result(strobe)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(strobe_t) :: strobe
    real(wp) :: all_of_them(of_two)
    integer :: n
    if (allocated(moving%jointed)) then
      if (moving%by_event) then
        strobe%jointed = jointed_at_turn(moving%jointed, point)
      else
        strobe%jointed = jointed_at(moving%jointed, point)
      end if
      strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
      return
    else if (moving%by_event) then
      strobe%state = body_at_turn(moving, point(1))
      return
    else if (.not. allocated(moving%pair)) then
      strobe%state = body_at(moving, point)
      return
    end if
    n = coordinates_of(moving)
    all_of_them = unpack(point(:n), counts_of(moving), 0.0_wp)
    associate (machine => moving%pair%machine)
      if (machine%carried) then
        if (machine%drive == driven_by_motion) all_of_them(of_x1) = machine%mean + machine%amplitude
        all_of_them(of_place) = all_of_them(of_place) + all_of_them(of_x1)
      end if
      strobe%pair = start_pair(moving%pair, all_of_them(of_place), all_of_them(of_v2), all_of_them([of_x1, of_v1]), 0.0_wp, &
                               all_of_them(of_integral))
    end associate
    strobe%state = body_state(strobe%pair)
  end function strobe_at

  !> Coordinates of a state on the section, zeros after the last.
  pure function section_point(moving, strobe) result(point)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(in) :: strobe
    real(wp) :: point(most_coordinates), all_of_them(of_two)
    integer :: n
    point = 0
    if (moving%by_event) then
      point = turn_point(moving, strobe)
      return
    else if (allocated(moving%jointed)) then
      point = jointed_point(moving%jointed, strobe%jointed)
      return
    else if (.not. allocated(moving%pair)) then
      n = coordinates_of(moving)
      point(:n) = body_point(moving, strobe%state)
      return
    end if
    all_of_them = strobe%pair%y([at_x2, at_v2, at_x1, at_v1, at_integral])
    if (moving%pair%machine%carried) all_of_them(of_place) = all_of_them(of_place) - all_of_them(of_x1)
    if (floats(moving)) all_of_them(of_v2) = all_of_them(of_v2) - all_of_them(of_v1)
    ! A reference that runs away takes the driving body along.
    all_of_them(of_x1) = all_of_them(of_x1) - strobe%pair%y(at_ramp)
    n = coordinates_of(moving)
    point(:n) = pack(all_of_them, counts_of(moving))
  end function section_point

  !> x, v at a point of the section, and those of the driving body of two (0 of one).
  pure function section_state(moving, point) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp) :: state(4)
    type(strobe_t) :: strobe
    strobe = strobe_at(moving, point)
    state = 0
    if (allocated(moving%pair)) state(3:) = driver_of(strobe%pair)
    state(:2) = [strobe%state%x, strobe%state%v]
  end function section_state

  !> Sizes of the coordinates in a motion over `half_range` [m] of the position. Two bodies may drift: then they are those of
  !> what the stops or the forces allow.
  pure function scales_of(moving, half_range) result(scales)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates), w, length
    logical :: counts(of_two)
    integer :: n
    w = moving%machine%drive_frequency
    scales = 1
    if (moving%by_event) then
      scales = scales_of_turn(moving, half_range)
    else if (allocated(moving%jointed)) then
      scales = scales_of_jointed(moving%jointed, half_range)
    else if (.not. allocated(moving%pair)) then
      length = half_range
      if (moving%machine%turn > 0) length = min(length, moving%machine%turn/2)
      n = coordinates_of(moving)
      scales(:n) = [length*[1.0_wp, w], pack([moving%machine%effects%dahl_sliding, length*w], remembers(moving))]
    else
      counts = counts_of(moving)
      n = count(counts)
      length = half_range
      if (moving%pair%machine%carried) length = min(length, (moving%pair%machine%upper - moving%pair%machine%lower)/2)
      if (.not. counts(of_place)) length = min(length, moving%pair%force_scale/(moving%machine%mass*w**2))
      scales(:n) = pack(length*[1.0_wp, w, 1.0_wp, w, 1/w], counts)
    end if
  end function scales_of

  !> What the first coordinate repeats after on the section.
  pure real(wp) function turn_of(moving)
    type(motion_t), intent(in) :: moving
    turn_of = merge(0.0_wp, moving%machine%turn, moving%by_event)
  end function turn_of

  !> Moves to `time_end` [s after the section, at most one period]; `reason` as in `advance`.
  pure subroutine advance_strobe(moving, strobe, time_end, tally, reason, log)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(inout) :: strobe
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (allocated(moving%jointed)) then
      call advance_jointed(moving%jointed, strobe%jointed, time_end, tally, reason, log)
      strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
    else if (allocated(moving%pair)) then
      call advance_pair(moving%pair, strobe%pair, time_end, tally, reason, log)
      strobe%state = body_state(strobe%pair)
    else
      call advance(moving, strobe%state, time_end, tally, reason, log)
    end if
  end subroutine advance_strobe

  !> Moves to the next section and starts the clock anew.
  pure subroutine advance_strobe_period(moving, strobe, tally, reason, log)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(inout) :: strobe
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (moving%by_event) then
      call advance_to_section(moving, strobe, tally, reason)
      return
    end if
    strobe%lasted = moving%machine%period
    if (allocated(moving%jointed)) then
      call advance_jointed_period(moving%jointed, strobe%jointed, tally, reason, log)
      strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
    else if (allocated(moving%pair)) then
      call advance_pair_period(moving%pair, strobe%pair, tally, reason, log)
      strobe%state = body_state(strobe%pair)
    else
      call advance_period(moving, strobe%state, tally, reason, log)
      call take_turns(moving%machine%turn, strobe%state, tally)
    end if
  end subroutine advance_strobe_period

  !> Moves a machine without a clock to where it turns round; `reason` is `reason_time_over` if it does not.
  pure subroutine advance_to_section(moving, strobe, tally, reason)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(inout) :: strobe
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    if (allocated(moving%jointed)) then
      call advance_jointed_to_turn(moving%jointed, strobe%jointed, strobe%lasted, tally, reason)
      strobe%state = watched_state(moving%jointed%machine, strobe%jointed)
    else
      call advance_body_to_turn(moving, strobe%state, strobe%lasted, tally, reason)
    end if
  end subroutine advance_to_section

  !> Coordinates of a state there, zeros after the last.
  pure function turn_point(moving, strobe) result(point)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(in) :: strobe
    real(wp) :: point(most_coordinates)
    point = 0
    if (allocated(moving%jointed)) then
      point = jointed_turn_point(moving%jointed, strobe%jointed)
    else
      point(1) = body_turn_point(moving, strobe%state)
    end if
  end function turn_point

  !> Features of what was counted over `periods` drive periods. Two bodies that do not slip may well move.
  pure function features_over(moving, tally, periods) result(features)
    type(motion_t), intent(in) :: moving
    type(tally_t), intent(in) :: tally
    real(wp), intent(in) :: periods
    type(features_t) :: features
    features = regime_of(tally, periods)
    features%rotation = real(tally%turns, wp)/periods
    call wrap_range(features, moving%machine%turn)
    if (allocated(moving%pair) .and. features%regime == regime_at_rest) features%regime = regime_stuck
  end function features_over

  !> Event word of the cycle of `periods` drive periods that a state on the section has reached, wherever on it that is.
  pure integer(int64) function cycle_word(moving, strobe, periods) result(word)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: strobe
    integer, intent(in) :: periods
    integer(int64) :: words(periods)
    type(strobe_t) :: later
    type(tally_t) :: tally
    integer :: i, reason
    later = strobe
    words = 0
    do i = 1, periods
      call reset_tally(tally, later%state, allocated(moving%pair))
      call advance_strobe_period(moving, later, tally, reason)
      if (reason /= 0) exit
      words(i) = tally%word
    end do
    word = canonical_word(words)
  end function cycle_word

  !> Whether a period without slip is followed by none with any: a body at rest under periodic forces, or two that move
  !> as one in a way that is given.
  pure logical function rest_lasts(moving)
    type(motion_t), intent(in) :: moving
    rest_lasts = .true.
    if (allocated(moving%pair)) rest_lasts = moving%pair%machine%drive == driven_by_motion
  end function rest_lasts

  !> Energy of the machine [J].
  pure real(wp) function energy_now(moving, strobe) result(energy)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(in) :: strobe
    if (allocated(moving%jointed)) then
      energy = energy_of_jointed(moving%jointed%machine, strobe%jointed)
    else if (allocated(moving%pair)) then
      energy = energy_of(moving%pair, strobe%pair)
    else
      energy = energy_of_body(moving%machine, strobe%state)
    end if
  end function energy_now

  !> Closes the book of a log, with a last sample if it has any.
  pure subroutine record_end(moving, strobe, sampled, log)
    type(motion_t), intent(in) :: moving
    class(strobe_t), intent(in) :: strobe
    logical, intent(in) :: sampled
    type(log_t), intent(inout) :: log
    log%book%at_end = energy_now(moving, strobe)
    if (.not. sampled) return
    if (allocated(moving%jointed)) then
      call log_sample(moving%jointed%machine, strobe%jointed, log)
    else if (allocated(moving%pair)) then
      call record_sample(log, strobe%state, driver_of(strobe%pair), log%book)
    else
      call record_with_book(moving%machine, strobe%state, log)
    end if
  end subroutine record_end

end module strobe
