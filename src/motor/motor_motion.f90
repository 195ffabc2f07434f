! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event loop of a body driven by a motor: slip, turning point, stick, release, impact, chatter, rest on a stop; the crank
!> passing through zero, coming to a standstill, held by its bearing, and turning again.
module motor_motion
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use errors, only: error_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motion_state, only: append_word, event_barrier_release, event_chatter_lower, event_chatter_upper, &
    event_impact_lower, event_impact_upper, event_release, event_stick, event_turning_point, log_t, mode_lower_barrier, &
    mode_slip_minus, mode_slip_plus, mode_stick, mode_upper_barrier, note_position, options_t, sample_due, sample_time, &
    state_t, tally_t, word_chatter_lower, word_chatter_upper, word_lower, word_period, word_stick, word_upper
  use motor_choices, only: has_motor
  use motor_equations, only: build_motor_equations
  use half_turn, only: pass_half_turn
  use motor_limits, only: change_limits, start_limits
  use motor_log, only: add_sample, motor_energy, record_motor_event
  use motor_modes, only: begin_mode, end_mode, keep_angle
  use motor_now, only: restitution_of
  use motor_reason, only: reason_of_flight
  use motor_rest, only: chatter_dies_out, choose_body, choose_crank, enters_stop, hold_without_room, slips, turns_at_section
  use motor_state, only: motor_state_t
  use motor_system, only: guard_back, guard_body_down, guard_body_up, guard_count, guard_crank_down, guard_crank_up, &
    guard_fastest, guard_lower, guard_section, guard_standstill, guard_turning, guard_upper, motor_system_t, y_at
  use own_equations, only: build_own_equations
  use series_flight, only: advance_flight, flight_crossed, flight_left_domain, flight_reached, flight_step_budget, flight_t, &
    flight_wrong_branch
  use status, only: reason_event_budget, reason_left_domain, reason_mode_cycle, reason_not_finite, reason_step_budget, &
    reason_step_failed
  use stored_jumps, only: add_jump, keep_stored
  use switch_branches, only: most_idle_events, pass_switches
  implicit none
  private

  public :: prepare_motor, start_motor, start_own, advance_motor, check_hold, do_events, most_idle_events

  !> A machine with a motor, ready to move.
  type, public :: motor_motion_t
    type(motor_system_t) :: system
    type(options_t) :: options
  end type motor_motion_t

contains

  !> The machine of `choices`, ready to move.
  pure subroutine prepare_motor(choices, options, moving, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(options_t), intent(in) :: options
    type(motor_motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    if (has_motor(choices)) then
      call build_motor_equations(choices, moving%system, error)
    else
      call build_own_equations(choices, moving%system, error)
    end if
    moving%options = options
  end subroutine prepare_motor

  !> A body at x [m], v [m/s], the crank at an angle [rad] with a speed [rad/s], current [A] or integral: the `values`. `settled`: a
  !> ramp is over.
  pure subroutine start_motor(moving, values, state, crank, settled)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: values(5)
    type(state_t), intent(out) :: state
    type(motor_state_t), intent(out) :: crank
    logical, intent(in), optional :: settled
    integer :: i
    logical :: over
    over = .false.
    if (present(settled)) over = settled
    state = state_t(x=values(1), v=values(2), mode=merge(mode_slip_minus, mode_slip_plus, values(2) < 0))
    crank%phi = modulo(values(3), two_pi)
    crank%w = values(4)
    crank%own(1) = values(5)
    crank%turning = merge(-1, 1, crank%w < 0)
    crank%passed_last = crank%turning
    call hold_without_room(moving%system, state)
    call start_limits(moving%system, over, state, crank)
    ! Of an unbalance, what holds the one depends on whether the other moves.
    do i = 1, 2
      if (.not. abs(crank%w) > 0) call choose_crank(moving%system, state, crank)
      if (.not. abs(state%v) > 0) call choose_body(moving%system, state, crank)
    end do
  end subroutine start_motor

  !> A body of equations by expressions at `x` [m], `v` [m/s], `time` [s after the section], with its own states.
  pure subroutine start_own(moving, values, time, state, crank)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: values(:), time
    type(state_t), intent(out) :: state
    type(motor_state_t), intent(out) :: crank
    state = state_t(x=values(1), v=values(2), time=time, mode=merge(mode_slip_minus, mode_slip_plus, values(2) < 0))
    crank%own(:size(values) - 2) = values(3:)
    call hold_without_room(moving%system, state)
    if (.not. abs(state%v) > 0) call choose_body(moving%system, state, crank)
  end subroutine start_own

  !> Moves to `time_end` [s], or only to the next section, `at_section` then being true: the crank passes through zero;
  !> without a motor the body turns round at a maximum, at a minimum where a stop cuts off the maxima alone.
  !> `reason` stays 0 unless the motion had to be given up. With `one_event` it ends after the next event.
  pure subroutine advance_motor(moving, state, crank, time_end, at_section, tally, reason, log, one_event)
    type(motor_motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    real(wp), intent(in) :: time_end
    logical, intent(inout) :: at_section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    logical, intent(in), optional :: one_event
    type(flight_t) :: flight
    real(wp) :: before
    integer :: idle, mode
    logical :: stops, passed
    stops = at_section
    at_section = .false.
    idle = 0
    reason = 0
    if (enters_stop(moving%system, state)) then
      if (abs(restitution_of(moving%system, state, crank) - 0.5_wp) > 0.5_wp) reason = reason_step_failed
      if (reason == 0) call hit_stop(moving%system, merge(1, -1, state%v > 0), state, crank, tally, log)
      if (reason /= 0 .or. present(one_event)) return
    end if
    do while (state%time < time_end)
      tally%events = tally%events + 1
      if (tally%events > moving%options%event_budget) reason = reason_event_budget
      if (reason /= 0) return
      before = state%time
      mode = state%mode
      call fly(moving, state, crank, time_end, flight, tally, reason, log)
      if (reason /= 0) return
      if (slips(state%mode)) tally%slips = tally%slips + 1
      call note_position(tally, state)
      if (any(flight%crossed([guard_upper, guard_lower])) .and. &
          abs(restitution_of(moving%system, state, crank) - 0.5_wp) > 0.5_wp) reason = reason_step_failed
      if (reason /= 0) return
      if (moving%system%clock) then
        call pass_half_turn(moving%system, flight, state, tally, passed)
        call do_events(moving, flight%crossed, state, crank, at_section, tally, log)
        passed = passed .or. (flight%crossed(guard_turning) .and. turns_at_section(moving%system, mode, state%mode))
      else
        call do_events(moving, flight%crossed, state, crank, passed, tally, log)
      end if
      idle = merge(0, idle + 1, state%time > before)
      if (idle >= most_idle_events) reason = reason_mode_cycle
      if (.not. abs(state%x) <= moving%options%domain) reason = reason_left_domain
      if (state%x /= state%x .or. state%v /= state%v .or. crank%w /= crank%w) reason = reason_not_finite
      if (tally%steps > moving%options%step_budget) reason = reason_step_budget
      if (reason /= 0) return
      at_section = passed .and. stops
      if (at_section) return
      if (present(one_event)) return
    end do
  end subroutine advance_motor

  !> One mode, to its next event or `time_end`, with its samples.
  pure subroutine fly(moving, state, crank, time_end, flight, tally, reason, log)
    type(motor_motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    real(wp), intent(in) :: time_end
    type(flight_t), intent(inout) :: flight
    type(tally_t), intent(inout) :: tally
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: until, at_switch
    integer :: status, fault, idle, kept
    kept = 0
    if (present(log)) kept = merge(1, 0, log%balance%kept)
    call begin_mode(moving%system, state, crank, tally%needs_v_max, kept, flight, fault)
    status = merge(flight_left_domain, flight_reached, fault > 0)
    if (fault < 0) status = flight_wrong_branch
    if (fault == 0) call add_jump(moving%system, flight, state, crank, log)
    at_switch = flight%time
    idle = 0
    do while (status == flight_reached .or. status == flight_crossed)
      until = time_end
      if (present(log)) then
        if (log%sample_interval > 0 .or. allocated(log%instants)) then
          do while (sample_due(log, time_end) .and. sample_time(log) <= flight%time)
            call add_sample(moving%system, state, crank, log)
          end do
          if (sample_due(log, time_end)) until = min(time_end, sample_time(log))
        end if
      end if
      call advance_flight(flight, until, status)
      call take_state(moving%system, flight, state, crank, log)
      if (status == flight_crossed) then
        tally%v_max = max(tally%v_max, state%v)
        if (any(flight%crossed(:guard_fastest - 1)) .or. any(flight%crossed(guard_fastest + 1:guard_count))) exit
        call pass_switches(flight, at_switch, idle, status)
        call add_jump(moving%system, flight, state, crank, log)
        ! A jump of the forces may release what was held.
        if (any(flight%crossed(guard_count + 1:)) .and. .not. slips(state%mode)) exit
      end if
      if (flight%steps > moving%options%step_budget) status = flight_step_budget
      if (status == flight_reached .and. until >= time_end) exit
    end do
    call end_mode(state, flight, crank)
    tally%steps = tally%steps + flight%steps
    tally%v_max = max(tally%v_max, state%v)
    reason = reason_of_flight(status, flight)
  end subroutine fly

  !> State and losses after a part of a flight.
  pure subroutine take_state(system, flight, state, crank, log)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(inout) :: flight
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(log_t), intent(inout), optional :: log
    integer :: n
    n = system%variables
    state%time = flight%time
    if (.not. system%clock) crank%phi = flight%state(1)
    if (.not. system%clock) crank%w = flight%state(2)
    state%x = flight%state(3)
    state%v = flight%state(4)
    if (system%clock) crank%own(:n - 4) = flight%state(5:n)
    if (system%control%has_own) crank%own(1) = flight%state(y_at)
    if (system%control%supply > 0) crank%supply = flight%state(system%control%supply)
    if (.not. present(log)) return
    if (.not. log%balance%kept) return
    log%balance%work = log%balance%work + flight%state(n + 1)
    log%balance%friction = log%balance%friction + flight%state(n + 2)
    log%balance%damping = log%balance%damping + flight%state(n + 3)
    flight%state(n + 1:) = 0
    call keep_stored(system, flight, log)
  end subroutine take_state

  !> What happens where guards crossed zero; `passed`: the section.
  pure subroutine do_events(moving, crossed, state, crank, passed, tally, log)
    type(motor_motion_t), intent(in) :: moving
    logical, intent(in) :: crossed(:)
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    logical, intent(out) :: passed
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    associate (system => moving%system)
      passed = crossed(guard_section) .or. (crossed(guard_back) .and. crank%passed_last < 0)
      call change_limits(system, crossed, state, crank)
      if (passed) call append_word(tally, word_period)
      if (crossed(guard_section) .or. crossed(guard_back)) then
        crank%passed_last = merge(1, -1, crossed(guard_section))
        crank%phi = merge(two_pi, 0.0_wp, crossed(guard_section))
        call keep_angle(crank)
      end if
      if (crossed(guard_standstill)) then
        crank%w = 0
        call choose_crank(system, state, crank)
        if (crank%turning == 0) crank%held_since = state%time
      else if (crossed(guard_crank_up) .or. crossed(guard_crank_down)) then
        crank%turning = merge(1, -1, crossed(guard_crank_up))
      end if
      if (crossed(guard_upper) .or. crossed(guard_lower)) then
        call hit_stop(system, merge(1, -1, crossed(guard_upper)), state, crank, tally, log)
      else if (crossed(guard_turning)) then
        call come_to_rest(system, state, crank, tally, log)
      else if (crossed(guard_body_up) .or. crossed(guard_body_down)) then
        call release(merge(mode_slip_plus, mode_slip_minus, crossed(guard_body_up)), state, crank, log)
      end if
      if (any(crossed) .and. system%moment > 0) call check_holds(system, state, crank, log)
      if (any(crossed(guard_count + 1:))) call check_hold(system, state, crank, log)
    end associate
  end subroutine do_events

  !> Of an unbalance: what was held may be so no longer where the other one begins or ceases to move.
  pure subroutine check_holds(system, state, crank, log)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(log_t), intent(inout), optional :: log
    if (crank%turning == 0) call choose_crank(system, state, crank)
    call check_hold(system, state, crank, log)
  end subroutine check_holds

  !> What holds the body may not do so where a force has jumped.
  pure subroutine check_hold(system, state, crank, log)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(in) :: crank
    type(log_t), intent(inout), optional :: log
    type(state_t) :: free
    if (slips(state%mode)) return
    free = state
    call choose_body(system, free, crank)
    if (slips(free%mode)) call release(free%mode, state, crank, log)
  end subroutine check_hold

  !> Friction or a stop no longer holds the body.
  pure subroutine release(mode, state, crank, log)
    integer, intent(in) :: mode
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(in) :: crank
    type(log_t), intent(inout), optional :: log
    integer :: event
    event = merge(event_release, event_barrier_release, state%mode == mode_stick)
    state%mode = mode
    if (present(log)) call record_motor_event(event, state, crank, state%v, log)
  end subroutine release

  !> Zero velocity: the forces choose the next mode.
  pure subroutine come_to_rest(system, state, crank, tally, log)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(in) :: crank
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    associate (upper => system%contact%upper, lower => system%contact%lower)
      if (state%x < upper .and. state%x > lower) then
        tally%grazing_margin = min(tally%grazing_margin, merge(upper - state%x, state%x - lower, state%mode == mode_slip_plus))
      end if
    end associate
    state%v = 0
    call choose_body(system, state, crank)
    if (.not. slips(state%mode)) then
      tally%sticks = tally%sticks + 1
      call append_word(tally, word_stick)
    end if
    if (present(log)) call record_motor_event(merge(event_turning_point, event_stick, slips(state%mode)), state, &
                                              crank, 0.0_wp, log)
  end subroutine come_to_rest

  !> Impact: Newton's law for the body; an unbalance throws the crank. Then away, at rest, or the end of a chatter sequence.
  pure subroutine hit_stop(system, direction, state, crank, tally, log)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: direction
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    real(wp) :: after, left, energy
    logical :: over
    state%x = merge(system%contact%upper, system%contact%lower, direction > 0)
    after = -restitution_of(system, state, crank)*state%v
    tally%impacts = tally%impacts + 1
    tally%last_impact_speed = abs(state%v)
    tally%impact_speed_sum = tally%impact_speed_sum + abs(state%v)
    call append_word(tally, merge(word_upper, word_lower, direction > 0))
    if (present(log)) call record_motor_event(merge(event_impact_upper, event_impact_lower, direction > 0), state, &
                                              crank, after, log)
    energy = motor_energy(system, state, crank)
    call set_velocity(system, after, state, crank)
    state%mode = merge(mode_slip_minus, mode_slip_plus, direction > 0)
    if (.not. abs(after) > 0) then
      call come_to_rest(system, state, crank, tally, log)
    else
      call chatter_dies_out(system, state, crank, direction, left, over)
      if (over) call end_chatter(system, direction, left, state, crank, tally, log)
    end if
    if (present(log)) log%balance%contact = log%balance%contact + energy - motor_energy(system, state, crank)
  end subroutine hit_stop

  !> A new velocity of the body; the momentum of the crank about its axis, with that of an unbalance, stays.
  pure subroutine set_velocity(system, v, state, crank)
    type(motor_system_t), intent(in) :: system
    real(wp), intent(in) :: v
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    real(wp) :: sine, cosine
    if (system%moment > 0) then
      call sine_cosine(crank%phi, sine, cosine)
      crank%w = crank%w + system%moment*sine*(v - state%v)/system%rotor_inertia
      if (abs(crank%w) > 0) crank%turning = merge(1, -1, crank%w > 0)
    end if
    state%v = v
  end subroutine set_velocity

  !> The body rests on the stop; the log has the instant of accumulation.
  pure subroutine end_chatter(system, direction, left, state, crank, tally, log)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: direction
    real(wp), intent(in) :: left
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: ended
    call set_velocity(system, 0.0_wp, state, crank)
    state%mode = merge(mode_upper_barrier, mode_lower_barrier, direction > 0)
    tally%chatters = tally%chatters + 1
    tally%sticks = tally%sticks + 1
    call append_word(tally, merge(word_chatter_upper, word_chatter_lower, direction > 0))
    ended = state
    ended%time = state%time + left
    if (present(log)) call record_motor_event(merge(event_chatter_upper, event_chatter_lower, direction > 0), ended, &
                                              crank, 0.0_wp, log)
  end subroutine end_chatter

end module motor_motion
