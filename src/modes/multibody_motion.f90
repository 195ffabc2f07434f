! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event loop of a multibody structure: fly to the first guard, make the transition, until a time.
module multibody_motion
  use constants, only: two_pi
  use control, only: error_of
  use guards, only: joint_guard_t, room_for_guards, turns_round
  use multibody, only: integral_of, joint_bristle, joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, &
    most_joints
  use multibody_flight, only: fly
  use multibody_flows, only: multibody_motion_t, prepare_multibody, ready, with_matrix
  use multibody_state, only: joint_motion, multibody_state_t, key_of, rounding_of_speed, turning_at
  use multibody_transition, only: settle, transition
  use kinds, only: int64, wp
  use linear_flight, only: watch_t
  use mode_flow, only: build_flow, mode_flow_t
  use motion_state, only: append_word, log_t, tally_t, word_period
  use progress_watch, only: goes_round, note_flight, note_hold, progress_watch_t
  use status, only: reason_event_budget, reason_left_domain, reason_mode_cycle, reason_not_finite, reason_step_budget, &
    reason_step_failed, reason_time_over
  use timed_actions, only: act, acts_on_time, next_action
  use transition_list, only: note_transition, transition_t, transitions_t
  use transition_log, only: log_action, log_transition
  use two_bodies, only: slides_on
  implicit none
  private

  public :: multibody_motion_t, prepare_multibody, start_multibody, advance_multibody, advance_multibody_period, advance_to_turn

  !> An impact within this share of a period after the last belongs to a burst.
  real(wp), parameter :: burst_gap = 1e-6_wp
  !> After a flight of so many gaps no burst goes on.
  real(wp), parameter :: shortest_pause = 10

contains

  !> State with the coordinates `q` and speeds `v` and the drive at `angle` [rad]. A contact beyond its stop starts at it.
  pure subroutine start_multibody(moving, q, v, angle, state, ok)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: q(:), v(:), angle
    type(multibody_state_t), intent(out) :: state
    logical, intent(out) :: ok
    complex(wp) :: turning(moving%harmonics)
    integer :: touching(most_joints), j
    logical :: at_rest(most_joints)
    real(wp) :: s, u, near
    associate (machine => moving%machine)
      state%q(:machine%n) = q(:machine%n)
      state%v(:machine%n) = v(:machine%n)
      if (machine%driven) state%time = modulo(angle, two_pi)/machine%frequency
      state%clock = -state%time
      turning = turning_at(machine%frequency, state%time, moving%harmonics)
      at_rest = .false.
      touching = 0
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
          select case (joint%kind)
          case (joint_friction)
            at_rest(j) = .not. abs(u) > rounding_of_speed(machine, j, state)
            state%phase(j) = merge(0, nint(sign(1.0_wp, u)), at_rest(j))
          case (joint_elastic)
            state%slider(j) = s
          case (joint_contact, joint_soft)
            ! Bodies placed against each other touch.
            near = 16*epsilon(1.0_wp)*(sum(abs(joint%row*state%q(:machine%n))) + abs(joint%offset%mean))
            if (s >= joint%upper - near) touching(j) = 1
            if (s <= joint%lower + near) touching(j) = -1
            if (joint%kind == joint_contact) cycle
            state%phase(j) = touching(j)
            state%touch_speed(j) = abs(u)
            ! One that is pressed already has no guard at zero.
            if (touching(j) /= 0 .and. min(abs(s - joint%upper), abs(s - joint%lower)) <= near) state%left(j) = touching(j)
            touching(j) = 0
          case (joint_spring, joint_bristle)
            state%phase(j) = 1
          end select
        end associate
      end do
      ! The integral of a controller grows by what that sees.
      if (integral_of(machine) > 0) call error_of(machine, state, turning, state%v(integral_of(machine)), u)
      call settle(moving, state, turning, at_rest, touching, ok)
    end associate
  end subroutine start_multibody

  !> Moves to `time_end` [s after the section, at most one period]. `reason` stays 0 unless the trajectory had to be given
  !> up (codes of module `status`). With `one_event` it stops after the first event that no burst of impacts contains,
  !> and goes on with a burst; steps without progress are counted from the call.
  pure subroutine advance_multibody(moving, state, time_end, tally, reason, log, transitions, one_event)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    type(transitions_t), intent(inout), optional :: transitions
    logical, intent(in), optional :: one_event
    type(multibody_state_t) :: start
    type(mode_flow_t) :: spare
    type(joint_guard_t) :: list(room_for_guards(moving%machine))
    type(watch_t) :: watch
    real(wp) :: before, until, from
    type(progress_watch_t) :: idle_steps
    integer(int64) :: key
    logical :: triggered(room_for_guards(moving%machine)), turned, counts_on, timed, slips, held
    reason = 0
    counts_on = .false.
    if (present(one_event)) counts_on = one_event
    if (.not. counts_on) state%burst = 0
    state%at_section = .false.
    from = 0
    if (allocated(moving%machine%driver)) from = moving%machine%driver%stops_run*state%clock
    watch%extremes = [tally%x_min, tally%x_max] - from
    watch%top_speed = tally%v_max
    watch%needs_speed = tally%needs_v_max
    watch%needs_margin = moving%notes_misses
    timed = acts_on_time(moving%machine)
    associate (machine => moving%machine)
      do while (state%time < time_end .and. .not. state%at_section)
        tally%events = tally%events + 1
        if (tally%events > moving%options%event_budget) reason = reason_event_budget
        if (goes_round(idle_steps)) reason = reason_mode_cycle
        if (reason /= 0) exit
        before = state%time
        until = time_end
        if (timed) then
          until = min(until, next_action(machine, state))
          if (until <= state%time) then
            call act_and_log(moving, state, reason, log)
            if (reason /= 0) exit
            cycle
          end if
        end if
        key = key_of(machine, state%phase)
        slips = moves(moving, state, key)
        call fly_in_mode(moving, key, spare, state, until, list, triggered, watch, tally%steps, reason, log)
        if (reason /= 0) exit
        if (slips .and. state%time > before) tally%slips = tally%slips + 1
        if (state%time > before) state%left = 0
        call note_flight(idle_steps, machine, before, state, held)
        if (.not. state%time - before < burst_gap*machine%period) state%burst = 0
        turned = any(triggered .and. list%meaning == turns_round)
        triggered = triggered .and. list%meaning /= turns_round
        if (any(triggered)) then
          call change_mode(moving, state, list, triggered, held, tally, reason, log, transitions)
          if (held) call note_hold(idle_steps, machine, state%time)
        end if
        if (present(transitions)) start = state
        if (moving%section > 0) call follow_section(moving, turned, state)
        if (state%at_section .and. present(transitions)) call note_transition(transitions, transition_t(start, state, &
                                                                       moving%section, turns_round, .not. any(triggered)))
        call check_limits(moving, state, watch, tally, reason)
        if (.not. present(one_event) .or. reason /= 0) cycle
        if (one_event .and. state%time - before > shortest_pause*burst_gap*machine%period) exit
      end do
      tally%x_min = watch%extremes(1) + from
      tally%x_max = watch%extremes(2) + from
      tally%v_max = watch%top_speed
      tally%grazing_margin = min(tally%grazing_margin, watch%margin)
    end associate
  end subroutine advance_multibody

  !> One flight in the mode `key`, by the flow that is ready for it or else by `spare`, which is made for it.
  pure subroutine fly_in_mode(moving, key, spare, state, until, list, triggered, watch, steps, reason, log)
    type(multibody_motion_t), intent(in) :: moving
    integer(int64), intent(in) :: key
    type(mode_flow_t), intent(inout) :: spare
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: until
    type(joint_guard_t), intent(inout) :: list(:)
    logical, intent(out) :: triggered(:)
    type(watch_t), intent(inout) :: watch
    integer(int64), intent(inout) :: steps
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    integer :: at, count_guards
    at = ready(moving, key)
    associate (machine => moving%machine, options => moving%options)
      if (at > 0) then
        call fly(machine, moving%flows(at), options, state, until, list, count_guards, triggered, watch, steps, reason, log)
      else
        if (spare%key /= key) call build_flow(machine, key, with_matrix(moving), spare)
        call fly(machine, spare, options, state, until, list, count_guards, triggered, watch, steps, reason, log)
      end if
    end associate
  end subroutine fly_in_mode

  !> What comes at its time: the sample of a controller, or an impulse.
  pure subroutine act_and_log(moving, state, reason, log)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    type(multibody_state_t) :: start
    logical :: ok
    start = state
    call act(moving, state, ok, log)
    if (.not. ok) reason = reason_step_failed
    if (present(log) .and. ok) call log_action(moving, start, state, log)
  end subroutine act_and_log

  !> The transition at guards that have `triggered`; phases are `held` for an instant where the motion makes no progress.
  pure subroutine change_mode(moving, state, list, triggered, held, tally, reason, log, transitions)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: triggered(:), held
    type(tally_t), intent(inout) :: tally
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    type(transitions_t), intent(inout), optional :: transitions
    type(multibody_state_t) :: start
    logical :: ok
    if (present(log) .or. present(transitions)) start = state
    call transition(moving, state, list, triggered, held, tally, ok)
    if (.not. ok) reason = reason_step_failed
    if (present(log) .and. ok) call log_transition(moving, start, state, list, triggered, log)
    if (present(transitions)) call keep(start, state, list, triggered, held, transitions)
  end subroutine change_mode

  !> Budgets and the domain. Numbers that end in a flight on which what is watched was outside ended there.
  pure subroutine check_limits(moving, state, watch, tally, reason)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    type(watch_t), intent(in) :: watch
    type(tally_t), intent(in) :: tally
    integer, intent(inout) :: reason
    if (tally%steps > moving%options%step_budget) reason = reason_step_budget
    if (.not. all(abs(state%q(:moving%machine%n)) <= moving%options%domain)) reason = reason_left_domain
    associate (q => state%q(:moving%machine%n), v => state%v(:moving%machine%n))
      if (.not. (any(q /= q) .or. any(v /= v))) return
      if (.not. max(-watch%extremes(1), watch%extremes(2)) > moving%options%domain) reason = reason_not_finite
    end associate
  end subroutine check_limits

  !> Notes a transition; what was `held` for an instant, or several at once, is not certain.
  pure subroutine keep(before, after, list, triggered, held, transitions)
    type(multibody_state_t), intent(in) :: before, after
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: triggered(:), held
    type(transitions_t), intent(inout) :: transitions
    integer :: g
    g = findloc(triggered, .true., 1)
    call note_transition(transitions, transition_t(before, after, list(g)%joint, list(g)%meaning, &
                                                   count(triggered) == 1 .and. .not. held))
  end subroutine keep

  !> The watched coordinate has `turned` round, or an impact may have turned it: the section is behind it then, not reached.
  pure subroutine follow_section(moving, turned, state)
    type(multibody_motion_t), intent(in) :: moving
    logical, intent(in) :: turned
    type(multibody_state_t), intent(inout) :: state
    real(wp) :: u
    associate (phase => state%phase(moving%section))
      if (phase == 0) return
      if (turned) then
        state%at_section = phase > 0
        phase = -phase
        state%left(moving%section) = 1
        return
      end if
      u = sum(moving%machine%joints(moving%section)%row*state%v(:moving%machine%n))
      if (abs(u) > moving%machine%negligible_speed .and. phase*u < 0) then
        phase = -phase
        state%left(moving%section) = 0
      end if
    end associate
  end subroutine follow_section

  !> Moves to the next section and starts the clock anew.
  pure subroutine advance_multibody_period(moving, state, tally, reason, log, transitions)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    type(transitions_t), intent(inout), optional :: transitions
    integer :: j
    call advance_multibody(moving, state, moving%machine%period, tally, reason, log, transitions)
    if (reason /= 0) return
    state%time = 0
    state%clock = state%clock + moving%machine%period
    if (present(log)) then
      log%origin = log%origin + moving%machine%period
      if (.not. allocated(log%instants)) log%next_sample = 0
    end if
    do j = 1, size(moving%machine%joints)
      ! Sliders are placed on surfaces that run on.
      if (moving%machine%joints(j)%kind == joint_elastic) state%slider(j) = &
        state%slider(j) - moving%machine%joints(j)%offset%rate*moving%machine%period
    end do
    if (allocated(moving%machine%driver)) then
      associate (machine => moving%machine)
        state%q(machine%watched) = state%q(machine%watched) - machine%driver%stops_run*machine%period
      end associate
    end if
    call append_word(tally, word_period)
  end subroutine advance_multibody_period

  !> Moves a machine without a clock to its next section, within `longest` [s], and starts the clock anew; `lasted` [s] is the time
  !> that it took. `reason` is `reason_time_over` where it does not come to the section.
  pure subroutine advance_to_turn(moving, longest, state, lasted, tally, reason, transitions)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: longest
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(out) :: lasted
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(transitions_t), intent(inout), optional :: transitions
    real(wp) :: start, u
    integer :: j
    start = state%time
    associate (phase => state%phase(moving%section))
      if (phase == 0) then
        u = sum(moving%machine%joints(moving%section)%row*state%v(:moving%machine%n))
        phase = merge(1, -1, u > 0)
        state%left(moving%section) = 0
      end if
    end associate
    call advance_multibody(moving, state, start + longest, tally, reason, transitions=transitions)
    if (reason == 0 .and. .not. state%at_section) reason = reason_time_over
    lasted = state%time - start
    do j = 1, size(moving%machine%joints)
      ! Sliders are placed on surfaces that run on.
      if (moving%machine%joints(j)%kind == joint_elastic) state%slider(j) = &
        state%slider(j) - moving%machine%joints(j)%offset%rate*state%time
    end do
    state%clock = state%clock + state%time
    state%time = 0
    call append_word(tally, word_period)
  end subroutine advance_to_turn

  !> Whether anything moves in a flight, or the one of two bodies slides over the other.
  pure logical function moves(moving, state, key)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    integer(int64), intent(in) :: key
    integer :: at
    if (allocated(moving%machine%driver)) then
      moves = slides_on(moving%machine, state)
      return
    end if
    at = ready(moving, key)
    moves = .true.
    if (at > 0) moves = size(moving%flows(at)%independent) < moving%machine%n
    if (.not. moves) moves = any(abs(state%v) > moving%machine%negligible_speed)
  end function moves

end module multibody_motion
