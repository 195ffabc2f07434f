! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event loop: slip, impact, chatter, stick, rest on a barrier, release, in any order, until a
!> time. One loop serves every machine; the modes decide what comes next.
module motion
  use adaptive_flight, only: fly_adaptive
  use constants, only: two_pi
  use contact_flight, only: contact_side
  use contact_law, only: contact_hardened, contact_table, velocity_after_impact
  use effect_law, only: dahl_level
  use energy, only: balance_exact, balance_rest
  use errors, only: error_t, fail
  use exact_flight, only: flight_barrier, flight_failed, flight_layer_left, flight_speed_reached, &
    fly_exact
  use exact_flow, only: flow_t, prepare_flow
  use kinds, only: wp
  use layer_transit, only: cross_layer, prepare_transit, transit_t
  use motion_state, only: append_word, event_chatter_lower, &
    event_chatter_upper, event_impact_lower, event_impact_upper, event_separation, event_stick, &
    event_touch_lower, event_touch_upper, event_turning_point, flight_adaptive, flight_exact, log_t, &
    mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_upper_barrier, note_position, options_t, record_event, &
    state_t, tally_t, word_chatter_lower, word_chatter_upper, word_lower, word_period, &
    watches_between_events, word_stick, word_upper
  use oscillator, only: oscillator_t
  use pressed_flight, only: fly_pressed_body, prepare_pressed, pressed_flow_t
  use rest, only: chatter_time, mode_from_rest
  use rest_flight, only: rest_on
  use status, only: exit_bad_case, reason_event_budget, reason_left_domain, reason_not_finite, &
    reason_step_budget, reason_step_failed
  implicit none
  private

  public :: prepare_motion, start_state, advance, advance_period

  !> The Stribeck layer is entered from outside at its edge and left at this multiple of it, so that a
  !> motion along the edge does not switch back and forth.
  real(wp), parameter :: layer_exit = 1.25_wp

  !> Events without progress in time after which the body is held for an instant: only a tie of forces
  !> to the last bit can bring this about.
  integer, parameter :: most_idle_steps = 8

  !> A body ready to move: all that does not change along a trajectory.
  type, public :: motion_t
    type(oscillator_t) :: machine
    type(options_t) :: options
    type(flow_t) :: flow
    type(pressed_flow_t) :: pressed
    !> Passage through the Stribeck layer, where it can be made in one stroke.
    type(transit_t) :: transit
    !> Slips outside the Stribeck layer are flown on the closed form.
    logical :: exact = .false.
    !> Edge of the Stribeck layer [m/s], 0 without one.
    real(wp) :: layer = 0
  end type motion_t

contains

  !> Prepares a machine. Refuses flight `exact` where a mode has no closed form.
  pure subroutine prepare_motion(machine, options, moving, error)
    type(oscillator_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    moving%machine = machine
    moving%options = options
    if (machine%effects%unknown_to_lanes) moving%options%lane_width = 0
    if (any(machine%contact%kind == [contact_table, contact_hardened])) moving%options%lane_width = 0
    moving%layer = machine%friction%layer_speed
    call prepare_flow(machine, moving%flow)
    moving%exact = moving%flow%available .and. options%flight /= flight_adaptive
    if (moving%exact .and. moving%flow%overdamped) moving%options%lane_width = 0
    if (moving%exact) call prepare_transit(machine, moving%flow, layer_exit*moving%layer, moving%transit)
    if (options%flight /= flight_adaptive) call prepare_pressed(machine, moving%pressed)
    if (options%flight == flight_exact .and. .not. (moving%exact .and. moving%layer <= 0 .and. &
                                                    (moving%pressed%available .or. .not. machine%contact%soft))) then
      call fail(error, exit_bad_case, 'integrator.flight = "exact": this machine has modes without a '// &
                'closed form (Stribeck layer, nonlinear or missing spring, effect, damping ratio between 0.9 and 4, soft '// &
                'barrier other than kelvin_voigt that pulls); use "auto"')
    end if
  end subroutine prepare_motion

  !> State of a body set off at `x` [m], `v` [m/s] with the crank at `crank_angle` [rad]. Dahl's friction, if it has that, is
  !> `z` [N], or what it is after a long slip this way; a contact that lasts has begun with `touch_speed` [m/s], or with |v|.
  pure function start_state(moving, x, v, crank_angle, z, touch_speed) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: x, v, crank_angle
    real(wp), intent(in), optional :: z, touch_speed
    type(state_t) :: state
    state = state_t(x=x, v=v, mode=mode_slip_plus, touch_speed=abs(v))
    if (present(touch_speed)) state%touch_speed = touch_speed
    state%time = modulo(crank_angle, two_pi)/moving%machine%drive_frequency
    if (v < 0) state%mode = mode_slip_minus
    if (abs(v) > 0) state%z = dahl_level(moving%machine%effects, sign(1.0_wp, v))
    if (present(z) .and. moving%machine%effects%dahl_stiffness > 0) state%z = z
    if (v == 0) state%mode = mode_from_rest(moving%machine, state)
  end function start_state

  !> Moves to `time_end` [s after the section, at most one period]. `reason` stays 0 unless the
  !> trajectory had to be given up (codes of module `status`). With `slip_speed` no further than to a slip in the other
  !> direction that is so fast [m/s], with `matching_point` no further than to a slip through that position [m], or its opposite.
  pure subroutine advance(moving, state, time_end, tally, reason, log, slip_speed, matching_point)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp), intent(in), optional :: slip_speed, matching_point
    real(wp) :: before
    integer :: idle_steps, other
    reason = 0
    idle_steps = 0
    other = merge(mode_slip_minus, mode_slip_plus, state%mode == mode_slip_plus)
    do while (state%time < time_end)
      tally%events = tally%events + 1
      if (tally%events > moving%options%event_budget) reason = reason_event_budget
      if (reason /= 0) return
      before = state%time
      select case (state%mode)
      case (mode_slip_plus, mode_slip_minus)
        call slip_on(moving, state, time_end, tally, reason, log, matching_point)
      case default
        call rest_on(moving%machine, state, time_end, tally, log)
      end select
      if (tally%steps > moving%options%step_budget) reason = reason_step_budget
      if (.not. (abs(state%x) <= moving%options%domain)) reason = reason_left_domain
      if (state%x /= state%x .or. state%v /= state%v .or. state%time /= state%time) reason = reason_not_finite
      idle_steps = merge(0, idle_steps + 1, state%time > before)
      if (idle_steps >= most_idle_steps) call break_tie(moving, state, time_end)
      if (present(matching_point)) then
        if (abs(state%x) >= matching_point .and. abs(state%v) > 0) exit
      end if
      if (.not. present(slip_speed) .or. reason /= 0) cycle
      if (state%mode == other .and. abs(state%v) >= slip_speed) exit
    end do
  end subroutine advance

  !> Moves to the next stroboscopic section and starts the clock anew.
  pure subroutine advance_period(moving, state, tally, reason, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call advance(moving, state, moving%machine%period, tally, reason, log)
    if (reason /= 0) return
    state%time = 0
    call append_word(tally, word_period)
    if (present(log)) then
      log%origin = log%origin + moving%machine%period
      if (.not. allocated(log%instants)) log%next_sample = 0
    end if
  end subroutine advance_period

  !> One flight and the event at its end, none at a `matching_point`.
  pure subroutine slip_on(moving, state, time_end, tally, reason, log, matching_point)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp), intent(in), optional :: matching_point
    type(state_t) :: start
    real(wp) :: barrier, before
    integer :: outcome, direction, first_sample
    logical :: inside
    direction = merge(1, -1, state%mode == mode_slip_plus)
    barrier = merge(moving%machine%contact%upper, moving%machine%contact%lower, direction > 0)
    if (moving%machine%contact%soft) then
      if (contact_side(moving%machine%contact, state%x, direction) /= 0) then
        call press_on(moving, state, time_end, tally, reason, log)
        return
      end if
      barrier = merge(moving%machine%contact%soft_upper, moving%machine%contact%soft_lower, direction > 0)
    end if
    if (present(matching_point)) barrier = direction*matching_point
    before = state%time
    inside = moving%layer > 0 .and. abs(state%v) <= moving%layer
    outcome = flight_barrier
    if (direction*(state%x - barrier) < 0) then
      if (moving%exact .and. .not. inside) then
        start = state
        if (present(log)) first_sample = log%samples + 1
        call fly_exact(moving%flow, state, time_end, moving%layer, barrier, tally, outcome, log)
        if (present(log)) call balance_exact(moving%machine, moving%flow, start, direction, state%time, first_sample, log)
        if (outcome == flight_speed_reached .and. moving%layer > 0) outcome = flight_layer_left
      else
        call cross(moving, state, direction, time_end, barrier, tally, outcome, log)
      end if
    end if
    if (state%time > before) tally%slips = tally%slips + 1
    ! Rounding may carry a body that leaves a barrier a bit beyond it.
    state%x = min(max(state%x, moving%machine%contact%lower), moving%machine%contact%upper)
    call note_position(tally, state)
    select case (outcome)
    case (flight_barrier)
      tally%v_max = max(tally%v_max, state%v)
      if (present(matching_point)) then
        state%x = barrier
      else if (moving%machine%contact%soft) then
        call touch(state, direction, tally, log)
      else
        call collide(moving, state, direction, time_end, tally, log)
      end if
    case (flight_speed_reached)
      if (.not. present(matching_point)) tally%grazing_margin = min(tally%grazing_margin, direction*(barrier - state%x))
      call come_to_rest(moving, state, event_turning_point, tally, log)
    case (flight_failed)
      reason = reason_step_failed
    end select
  end subroutine slip_on

  !> A soft barrier is reached: nothing changes but the forces from here on.
  pure subroutine touch(state, direction, tally, log)
    type(state_t), intent(inout) :: state
    integer, intent(in) :: direction
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    call count_impact(tally, state, direction)
    state%touch_speed = abs(state%v)
    if (present(log)) call record_event(log, merge(event_touch_upper, event_touch_lower, direction > 0), state, state%v)
  end subroutine touch

  !> One slip against a soft barrier.
  pure subroutine press_on(moving, state, time_end, tally, reason, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: before
    integer :: outcome, direction
    before = state%time
    direction = merge(1, -1, state%mode == mode_slip_plus)
    call fly_pressed_body(moving%pressed, moving%machine, moving%options, &
                          contact_side(moving%machine%contact, state%x, direction), state, time_end, tally, outcome, log)
    if (state%time > before) tally%slips = tally%slips + 1
    call note_position(tally, state)
    select case (outcome)
    case (flight_barrier)
      if (present(log)) call record_event(log, event_separation, state, state%v)
    case (flight_speed_reached)
      call come_to_rest(moving, state, event_turning_point, tally, log)
    case (flight_failed)
      reason = reason_step_failed
    end select
  end subroutine press_on

  !> A slip within the Stribeck layer, or of a machine without closed form: in one stroke if the body passes straight
  !> through the layer, else by the adaptive flight.
  pure subroutine cross(moving, state, direction, time_end, barrier, tally, outcome, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    integer, intent(in) :: direction
    real(wp), intent(in) :: time_end, barrier
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(state_t) :: crossed
    real(wp) :: exit_speed
    logical :: inward, straight
    inward = abs(state%v) >= moving%layer
    straight = moving%transit%available .and. (inward .or. .not. abs(state%v) > 0)
    crossed = state
    if (straight) call cross_layer(moving%transit, moving%flow, direction, inward, time_end, crossed%time, crossed%x, &
                                   straight)
    if (straight) straight = direction*(crossed%x - barrier) < 0
    exit_speed = huge(1.0_wp)
    if (moving%exact) exit_speed = layer_exit*moving%layer
    if (.not. straight) then
      call fly_adaptive(moving%machine, moving%options, state, time_end, exit_speed, barrier, tally, outcome, log)
      return
    end if
    if (present(log)) then
      if (watches_between_events(log)) call sample_crossing(moving, state, crossed%time, barrier, log)
    end if
    state = crossed
    state%v = merge(0.0_wp, direction*exit_speed, inward)
    outcome = merge(flight_speed_reached, flight_layer_left, inward)
    if (direction > 0) tally%v_max = max(tally%v_max, state%v)
  end subroutine cross

  !> Writes down the samples and the energy of a crossing, from a copy flown adaptively.
  pure subroutine sample_crossing(moving, state, time_end, barrier, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: time_end, barrier
    type(log_t), intent(inout) :: log
    type(state_t) :: copy
    type(tally_t) :: unused
    integer :: outcome
    copy = state
    call fly_adaptive(moving%machine, moving%options, copy, time_end, huge(1.0_wp), barrier, unused, outcome, log)
  end subroutine sample_crossing

  !> Impact: Newton's law, then away from the barrier, at rest on it, or the end of a chatter sequence.
  pure subroutine collide(moving, state, direction, time_end, tally, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    integer, intent(in) :: direction
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: before
    real(wp) :: after, left
    after = velocity_after_impact(moving%machine%contact, state%v)
    call count_impact(tally, state, direction)
    if (present(log)) then
      log%balance%contact = log%balance%contact + 0.5_wp*moving%machine%mass*(state%v**2 - after**2)
      call record_event(log, merge(event_impact_upper, event_impact_lower, direction > 0), state, after)
    end if
    state%v = after
    state%mode = merge(mode_slip_minus, mode_slip_plus, direction > 0)
    if (.not. abs(after) > 0) then
      call come_to_rest(moving, state, event_turning_point, tally, log)
      return
    end if
    left = chatter_time(moving%machine, state, direction, abs(after))
    if (left < 0) return
    tally%chatters = tally%chatters + 1
    tally%sticks = tally%sticks + 1
    ! The log has the instant of accumulation even where the clock stops before it.
    if (present(log)) log%balance%contact = log%balance%contact + 0.5_wp*moving%machine%mass*after**2
    before = state
    state%time = state%time + left
    state%v = 0
    state%mode = merge(mode_upper_barrier, mode_lower_barrier, direction > 0)
    call append_word(tally, merge(word_chatter_upper, word_chatter_lower, direction > 0))
    if (present(log)) call record_event(log, merge(event_chatter_upper, event_chatter_lower, direction > 0), &
                                        state, 0.0_wp)
    state%time = min(state%time, time_end)
    if (present(log)) call balance_rest(moving%machine, before, state, log%balance)
  end subroutine collide

  pure subroutine count_impact(tally, state, direction)
    type(tally_t), intent(inout) :: tally
    type(state_t), intent(in) :: state
    integer, intent(in) :: direction
    tally%impacts = tally%impacts + 1
    tally%last_impact_speed = abs(state%v)
    tally%impact_speed_sum = tally%impact_speed_sum + abs(state%v)
    call append_word(tally, merge(word_upper, word_lower, direction > 0))
  end subroutine count_impact

  !> Zero velocity: the forces choose the next mode. `passing` is the event written down if the body does not stay.
  pure subroutine come_to_rest(moving, state, passing, tally, log)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    integer, intent(in) :: passing
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    logical :: slips
    state%v = 0
    state%mode = mode_from_rest(moving%machine, state)
    slips = state%mode == mode_slip_plus .or. state%mode == mode_slip_minus
    if (.not. slips) then
      tally%sticks = tally%sticks + 1
      call append_word(tally, word_stick)
    end if
    if (present(log)) call record_event(log, merge(passing, event_stick, slips), state, 0.0_wp)
  end subroutine come_to_rest

  !> A tie of forces to the last bit: the body is held where it is for an instant.
  pure subroutine break_tie(moving, state, time_end)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    state%time = min(state%time + 1e-9_wp*moving%machine%period, time_end)
    state%v = 0
    state%mode = mode_from_rest(moving%machine, state)
  end subroutine break_tie

end module motion
