! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event loop of two bodies coupled by dry friction: slip, stick, impact, chatter, rest on a stop, blow and samples
!> of a controller, until a time.
module pair_motion
  use constants, only: two_pi
  use kinds, only: int64, wp
  use motion_state, only: append_word, event_barrier_release, event_blow, event_release, event_stick, &
    event_separation, event_turning_point, log_t, mode_held, mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, &
    mode_upper_barrier, record_event, sticks_in, tally_t, word_period, word_stick
  use pair, only: driven_by_controller, driven_by_motion
  use pair_contact, only: fly_pressed, mode_pressed, touch_stop
  use pair_damper, only: fly_damped, is_damper
  use pair_flight, only: body_state, driver_of, fly_pair, guard_failed, guard_leave, guard_lower, guard_minus, guard_plus, &
    guard_press, guard_separate, guard_slip, guard_upper
  use pair_impact, only: collide_pair, rest_on_stop
  use pair_modes, only: at_control, at_integral, at_v1, at_v2, at_x1, at_x2, control_now, mode_of_slip, &
    mode_together, pair_motion_t, pair_state_t, refresh, stands
  use status, only: reason_event_budget, reason_left_domain, reason_not_finite, reason_step_budget, reason_step_failed
  implicit none
  private

  public :: start_pair, advance_pair, advance_pair_period

  !> Events without progress in time after which the bodies are held together for an instant, and after which the
  !> motion is given up.
  integer, parameter :: most_stalls = 16, last_stall = 64

contains

  !> State of m2 at `x` [m], `v` [m/s] and m1 at `driver` (position, velocity), with the drive at `angle` [rad]. Where
  !> the motion of m1 is given, `driver` is not looked at. `integral` [ms] is that of the error which a controller has
  !> added up.
  pure function start_pair(moving, x, v, driver, angle, integral) result(state)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: x, v, driver(2), angle
    real(wp), intent(in), optional :: integral
    type(pair_state_t) :: state
    real(wp) :: place, w
    associate (machine => moving%machine)
      if (machine%frequency > 0) state%time = modulo(angle, two_pi)/machine%frequency
      state%clock = -state%time
      state%y(at_x1) = driver(1)
      state%y(at_v1) = driver(2)
      state%y(at_x2) = x
      state%y(at_v2) = v
      if (present(integral)) state%y(at_integral) = integral
      call refresh(moving, state)
      place = x
      if (machine%carried) place = x - state%y(at_x1)
      if (place >= machine%upper) state%touch = 1
      if (place <= machine%lower) state%touch = -1
      if (machine%contact%soft .and. (place > machine%upper .or. place < machine%lower)) then
        state%pressed = state%touch
        state%penetration = max(place - machine%upper, machine%lower - place)
        state%touch_speed = abs(v - merge(state%y(at_v1), 0.0_wp, machine%carried))
      end if
      w = state%y(at_v1) - state%y(at_v2)
      if (state%touch /= 0 .and. .not. machine%carried .and. .not. abs(v) > 0 .and. .not. machine%contact%soft) then
        call rest_on_stop(moving, state)
      else if (abs(w) > 0) then
        state%mode = mode_of_slip(nint(sign(1.0_wp, w)))
      else
        call start_together(moving, state)
      end if
    end associate
  end function start_pair

  !> Mode of bodies with equal velocities; a rigid stop on the ground only counts where they rest on it.
  pure subroutine start_together(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer :: touch
    logical :: rests
    if (state%pressed /= 0) then
      call mode_pressed(moving, state)
      return
    end if
    touch = state%touch
    rests = .not. moving%machine%contact%soft .and. (moving%machine%carried .or. stands(moving, state, state%y(at_v2)))
    if (.not. rests) state%touch = 0
    call mode_together(moving, state)
    if (.not. rests) state%touch = touch
  end subroutine start_together

  !> Moves to `time_end` [s after the section, at most one period]. `reason` stays 0 unless the
  !> trajectory had to be given up (codes of module `status`).
  pure subroutine advance_pair(moving, state, time_end, tally, reason, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: before
    integer :: stalls
    reason = 0
    stalls = 0
    do while (state%time < time_end)
      tally%events = tally%events + 1
      if (tally%events > moving%options%event_budget) reason = reason_event_budget
      if (stalls >= last_stall) reason = reason_step_failed
      if (reason /= 0) return
      before = state%time
      call move_once(moving, state, time_end, stalls >= most_stalls, tally, reason, log)
      if (tally%steps > moving%options%step_budget) reason = reason_step_budget
      if (any(state%y /= state%y)) reason = reason_not_finite
      if (.not. abs(state%y(at_x2)) <= moving%options%domain) reason = reason_left_domain
      ! A motion that is given may well run away.
      if (moving%machine%drive /= driven_by_motion) then
        if (.not. abs(state%y(at_x1)) <= moving%options%domain) reason = reason_left_domain
      end if
      stalls = merge(0, stalls + 1, state%time > before)
    end do
  end subroutine advance_pair

  !> Moves to the next section and starts the clock anew.
  pure subroutine advance_pair_period(moving, state, tally, reason, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call advance_pair(moving, state, moving%machine%period, tally, reason, log)
    if (reason /= 0) return
    state%time = 0
    state%clock = state%clock + moving%machine%period
    call append_word(tally, word_period)
    if (present(log)) then
      log%origin = log%origin + moving%machine%period
      log%next_sample = 0
    end if
  end subroutine advance_pair_period

  !> One flight and the event at its end. `stalled`: the bodies are held together for an instant.
  pure subroutine move_once(moving, state, time_end, stalled, tally, reason, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    logical, intent(in) :: stalled
    type(tally_t), intent(inout) :: tally
    integer, intent(inout) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: stop_time, blow, sample, before
    integer :: fallen, mode
    integer(int64) :: chatters
    logical :: slips, held, presses
    call take_sample(moving, state, sample)
    blow = huge(blow)
    if (abs(moving%machine%blow) > 0 .and. .not. state%struck) blow = moving%machine%blow_time - state%clock
    if (blow <= state%time) then
      call strike(moving, state, tally, log)
      return
    end if
    stop_time = min(time_end, blow, sample)
    held = stalled .and. abs(state%y(at_v1) - state%y(at_v2)) <= moving%negligible_speed
    if (held) call hold_for_an_instant(moving, state, stop_time)
    before = state%time
    chatters = tally%chatters
    mode = state%mode
    slips = .not. sticks_in(mode, .true.)
    presses = state%pressed /= 0
    if (presses .and. is_damper(moving)) then
      call fly_damped(moving, state, stop_time, held, fallen, tally, log)
    else if (presses) then
      call fly_pressed(moving, state, stop_time, held, fallen, tally, log)
    else
      call fly_pair(moving, state, stop_time, held, fallen, tally, log)
    end if
    if (state%time > before) then
      if (slips) tally%slips = tally%slips + 1
      if (.not. presses .and. (mode == mode_slip_plus .or. mode == mode_slip_minus .or. &
                               (mode == mode_stick .and. .not. moving%machine%carried))) state%touch = 0
    end if
    select case (fallen)
    case (guard_upper, guard_lower)
      if (moving%machine%contact%soft) then
        call touch_stop(moving, state, merge(1, -1, fallen == guard_upper), tally, log)
      else
        call collide_pair(moving, state, merge(1, -1, fallen == guard_upper), tally, log)
      end if
    case (guard_separate)
      if (present(log)) call record_event(log, event_separation, body_state(state), state%y(at_v2), driver_of(state))
    case (guard_failed)
      reason = reason_step_failed
    case (guard_slip)
      call come_together(moving, state, log)
    case (guard_plus, guard_minus)
      state%mode = mode_of_slip(merge(1, -1, fallen == guard_plus))
      if (present(log)) call record_event(log, event_release, body_state(state), state%y(at_v2), driver_of(state))
    case (guard_press)
      state%mode = merge(mode_upper_barrier, mode_lower_barrier, state%touch > 0)
      if (present(log)) call record_event(log, event_release, body_state(state), state%y(at_v2), driver_of(state))
    case (guard_leave)
      call mode_together(moving, state)
      if (present(log)) call record_event(log, event_barrier_release, body_state(state), state%y(at_v2), driver_of(state))
    end select
    if (slips .and. sticks_in(state%mode, .true.)) then
      tally%sticks = tally%sticks + 1
      if (tally%chatters == chatters) call append_word(tally, word_stick)
    end if
  end subroutine move_once

  !> A tie of forces to the last bit: the bodies move together, or m2 stays on its stop, for an instant.
  pure subroutine hold_for_an_instant(moving, state, stop_time)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(inout) :: stop_time
    stop_time = min(stop_time, state%time + 1e-9_wp*moving%machine%period)
    if (state%touch /= 0 .and. .not. moving%machine%carried) then
      state%y(at_v2) = 0
      state%mode = mode_held
    else
      state%y(at_v2) = state%y(at_v1)
      state%mode = mode_stick
    end if
  end subroutine hold_for_an_instant

  !> The relative velocity is zero: the forces choose the next mode.
  pure subroutine come_together(moving, state, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    type(log_t), intent(inout), optional :: log
    integer :: kind
    if (state%mode == mode_slip_plus .or. state%mode == mode_slip_minus) then
      kind = event_turning_point
      state%y(at_v2) = state%y(at_v1)
      call start_together(moving, state)
    else
      kind = event_barrier_release
      if (moving%machine%drive /= driven_by_motion) state%y(at_v1) = 0
      call mode_together(moving, state)
    end if
    if (sticks_in(state%mode, .true.) .and. (kind == event_turning_point .or. state%mode == mode_held)) kind = event_stick
    if (present(log)) call record_event(log, kind, body_state(state), state%y(at_v2), driver_of(state))
  end subroutine come_together

  !> The blow on m2.
  pure subroutine strike(moving, state, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(pair_state_t) :: before
    real(wp) :: w
    before = state
    state%struck = .true.
    state%y(at_v2) = state%y(at_v2) + moving%machine%blow/moving%machine%driven_mass
    tally%v_max = max(tally%v_max, state%y(at_v2))
    w = state%y(at_v1) - state%y(at_v2)
    if (abs(w) > 0) then
      state%mode = mode_of_slip(nint(sign(1.0_wp, w)))
    else
      call start_together(moving, state)
    end if
    if (.not. present(log)) return
    log%book%work = log%book%work &
      + 0.5_wp*moving%machine%driven_mass*(state%y(at_v2)**2 - before%y(at_v2)**2)
    call record_event(log, event_blow, body_state(before), state%y(at_v2), driver_of(before))
  end subroutine strike

  !> Lets a sampled controller act if its time has come; `next` is its next sample [s after the section].
  pure subroutine take_sample(moving, state, next)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(out) :: next
    next = huge(next)
    associate (machine => moving%machine)
      if (machine%drive /= driven_by_controller .or. .not. machine%sample_time > 0) return
      next = state%samples*machine%sample_time - state%clock
      if (next > state%time) return
      state%samples = state%samples + 1
      next = state%samples*machine%sample_time - state%clock
      call refresh(moving, state)
      state%y(at_control) = control_now(moving, state)
      state%y(at_integral) = state%y(at_integral) &
        + machine%sample_time*(sum(moving%reference*state%y) - state%y(at_x1))
      if (state%mode == mode_stick) call start_together(moving, state)
      if (state%mode == mode_held) call mode_together(moving, state)
    end associate
  end subroutine take_sample

end module pair_motion
