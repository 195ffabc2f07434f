! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The event loop of a jointed structure: fly to the first guard, make the transition, until a time.
module jointed_motion
  use blow, only: strike
  use constants, only: two_pi
  use guards, only: force_ends, force_returns, joint_guard_t, leaves, lets_go, meets_lower, meets_upper, most_guards, &
    slide_ends, slides_down, slides_up
  use jointed, only: joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, jointed_t, most_joints
  use jointed_state, only: free_force, is_held, joint_motion, jointed_state_t, key_of, turning_at
  use jointed_flight, only: fly
  use jointed_log, only: book_change, log_event
  use kinds, only: wp
  use linear_flight, only: watch_t
  use mode_choice, only: accelerations_of, choose_mode, project
  use mode_flow, only: build_flow, harmonics_of, mode_flow_t
  use motion_state, only: append_word, event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, &
    event_turning_point, flight_adaptive, log_t, options_t, tally_t, word_chatter_lower, word_chatter_upper, word_lower, &
    word_period, word_stick, word_upper
  use status, only: reason_event_budget, reason_left_domain, reason_not_finite, reason_step_budget, reason_step_failed
  implicit none
  private

  public :: prepare_jointed, start_jointed, advance_jointed, advance_jointed_period

  !> Events without progress in time after which the phases are held for an instant, and how often that may be.
  integer, parameter :: most_stalls = 8, most_holds = 100
  !> Machines with no more joints have the flows of all their modes ready.
  integer, parameter :: few_joints = 4
  !> So many impacts, each within this share of a period after the last, are the end of a chatter of several contacts.
  integer, parameter :: long_burst = 60
  real(wp), parameter :: burst_gap = 1e-6_wp

  type, public :: jointed_motion_t
    type(jointed_t) :: machine
    type(options_t) :: options
    type(mode_flow_t), allocatable :: flows(:)
    integer :: harmonics = 0
    !> Share by which the acceleration of a gap may change until its chatter has died away; 0: no chatter is completed.
    real(wp) :: chatter_share = 1e-5_wp
  end type jointed_motion_t

contains

  !> Prepares a machine.
  pure subroutine prepare_jointed(machine, options, moving)
    type(jointed_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(jointed_motion_t), intent(out) :: moving
    integer :: key, joints, i
    moving%machine = machine
    moving%options = options
    moving%harmonics = harmonics_of(machine)
    joints = size(machine%joints)
    if (joints <= few_joints) then
      allocate (moving%flows(2**joints))
      do key = 0, 2**joints - 1
        call build_flow(machine, key, with_matrix(moving), moving%flows(key + 1))
      end do
    else
      allocate (moving%flows(joints + 1))
      call build_flow(machine, 0, with_matrix(moving), moving%flows(1))
      do i = 1, joints
        call build_flow(machine, ibset(0, i - 1), with_matrix(moving), moving%flows(i + 1))
      end do
    end if
  end subroutine prepare_jointed

  !> Whether a flight may be marched: it needs the rows of the exponential series.
  pure logical function with_matrix(moving)
    type(jointed_motion_t), intent(in) :: moving
    with_matrix = moving%options%flight == flight_adaptive .or. .not. moving%machine%linear
  end function with_matrix

  !> State with the coordinates `q` and speeds `v` and the drive at `angle` [rad]. A contact beyond its stop starts at it.
  pure subroutine start_jointed(moving, q, v, angle, state, ok)
    type(jointed_motion_t), intent(in) :: moving
    real(wp), intent(in) :: q(:), v(:), angle
    type(jointed_state_t), intent(out) :: state
    logical, intent(out) :: ok
    complex(wp) :: turning(moving%harmonics)
    integer :: touching(most_joints), j
    logical :: at_rest(most_joints)
    real(wp) :: s, u, near
    associate (machine => moving%machine)
      state%q(:machine%n) = q(:machine%n)
      state%v(:machine%n) = v(:machine%n)
      if (machine%driven) state%time = modulo(angle, two_pi)/machine%frequency
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
            if (touching(j) /= 0) state%left(j) = touching(j)
            touching(j) = 0
          case (joint_spring)
            state%phase(j) = 1
          end select
        end associate
      end do
      call settle(moving, state, turning, at_rest, touching, ok)
    end associate
  end subroutine start_jointed

  !> Rounding of the sliding speed of a joint [m/s].
  pure real(wp) function rounding_of_speed(machine, j, state) result(negligible)
    type(jointed_t), intent(in) :: machine
    integer, intent(in) :: j
    type(jointed_state_t), intent(in) :: state
    associate (joint => machine%joints(j), n => machine%n)
      negligible = 64*epsilon(1.0_wp)*(sum(abs(joint%row*state%v(:n))) + abs(joint%offset%rate))
    end associate
  end function rounding_of_speed

  !> Rigid contacts in `touching` that do not open stay closed if the forces say so; joints at rest stick or slide.
  pure subroutine settle(moving, state, turning, at_rest, touching, ok)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    logical, intent(out) :: ok
    integer :: slow(most_joints), j
    real(wp) :: s, u
    associate (machine => moving%machine)
      slow = 0
      do j = 1, size(machine%joints)
        if (touching(j) == 0 .or. machine%joints(j)%kind /= joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        state%phase(j) = 0
        state%left(j) = touching(j)
        if (abs(u) <= machine%negligible_speed + rounding_of_speed(machine, j, state)) slow(j) = touching(j)
      end do
      call choose_mode(machine, state, turning, at_rest, slow, ok)
      do j = 1, size(machine%joints)
        if (at_rest(j)) state%left(j) = abs(state%phase(j))
        if (slow(j) /= 0 .and. state%phase(j) /= 0) state%left(j) = 0
      end do
      call project(machine, state, turning)
    end associate
  end subroutine settle

  !> Moves to `time_end` [s after the section, at most one period]. `reason` stays 0 unless the trajectory had to be given
  !> up (codes of module `status`).
  pure subroutine advance_jointed(moving, state, time_end, tally, reason, log)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    type(jointed_state_t) :: start
    type(mode_flow_t) :: spare
    type(joint_guard_t) :: list(most_guards)
    type(watch_t) :: watch
    real(wp) :: before
    integer :: count_guards, stalls, holds, burst, key
    logical :: fallen(most_guards), ok
    reason = 0
    stalls = 0
    holds = 0
    burst = 0
    watch%extremes = [tally%x_min, tally%x_max]
    watch%top_speed = tally%v_max
    watch%wants_speed = tally%wants_v_max
    associate (machine => moving%machine)
      do while (state%time < time_end)
        tally%events = tally%events + 1
        if (tally%events > moving%options%event_budget) reason = reason_event_budget
        if (holds >= most_holds) reason = reason_step_failed
        if (reason /= 0) exit
        before = state%time
        key = key_of(machine, state%phase)
        call note_slip(moving, state, key, tally)
        if (ready(moving, key) > 0) then
          call fly(machine, moving%flows(ready(moving, key)), moving%options, state, time_end, list, count_guards, fallen, watch, &
                   tally%steps, reason, log)
        else
          if (spare%key /= key) call build_flow(machine, key, with_matrix(moving), spare)
          call fly(machine, spare, moving%options, state, time_end, list, count_guards, fallen, watch, tally%steps, reason, log)
        end if
        if (reason /= 0) exit
        if (state%time > before) state%left = 0
        stalls = merge(0, stalls + 1, state%time > before)
        burst = merge(burst, 0, state%time - before < burst_gap*machine%period)
        if (any(fallen)) then
          start = state
          call transition(moving, state, list, fallen, stalls >= most_stalls, burst, tally, ok)
          if (present(log) .and. ok) call log_transition(moving, start, state, list, fallen, log)
          if (.not. ok) reason = reason_step_failed
          if (stalls >= most_stalls) then
            stalls = 0
            holds = holds + 1
          end if
        end if
        if (tally%steps > moving%options%step_budget) reason = reason_step_budget
        if (.not. all(abs(state%q(:machine%n)) <= moving%options%domain)) reason = reason_left_domain
        if (any(state%q /= state%q) .or. any(state%v /= state%v)) reason = reason_not_finite
      end do
      tally%x_min = watch%extremes(1)
      tally%x_max = watch%extremes(2)
      tally%v_max = watch%top_speed
    end associate
  end subroutine advance_jointed

  !> Events and losses of a transition.
  pure subroutine log_transition(moving, before, after, list, fallen, log)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(in) :: before, after
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: fallen(:)
    type(log_t), intent(inout) :: log
    type(jointed_state_t) :: struck
    logical :: told(most_joints)
    integer :: g, j, kind
    associate (machine => moving%machine)
      struck = after
      struck%time = before%time
      call book_change(machine, before, struck, log)
      told = .false.
      do g = 1, size(list)
        if (.not. fallen(g)) cycle
        j = list(g)%joint
        select case (list(g)%meaning)
        case (slide_ends)
          kind = merge(event_stick, event_turning_point, after%phase(j) == 0)
        case (slides_up, slides_down)
          kind = event_release
        case (meets_upper, meets_lower)
          kind = merge(event_impact_upper, event_impact_lower, list(g)%meaning == meets_upper)
          if (machine%joints(j)%kind == joint_soft) then
            kind = merge(event_touch_upper, event_touch_lower, list(g)%meaning == meets_upper)
          end if
        case (lets_go)
          kind = event_barrier_release
        case (leaves)
          kind = event_separation
        case default
          cycle
        end select
        told(j) = .true.
        call log_event(machine, kind, j, before, struck, log)
        if (machine%joints(j)%kind == joint_contact .and. after%phase(j) /= 0 .and. before%phase(j) == 0) then
          kind = merge(event_chatter_upper, event_chatter_lower, after%phase(j) > 0)
          call log_event(machine, kind, j, before, struck, log)
        end if
      end do
      ! What an impact or a cascade does to other joints.
      do j = 1, size(machine%joints)
        if (told(j) .or. machine%joints(j)%kind /= joint_friction .or. (before%phase(j) == 0 .eqv. after%phase(j) == 0)) cycle
        call log_event(machine, merge(event_stick, event_release, after%phase(j) == 0), j, before, struck, log)
      end do
    end associate
  end subroutine log_transition

  !> Number of the flow that is ready for a mode, 0 if there is none.
  pure integer function ready(moving, key)
    type(jointed_motion_t), intent(in) :: moving
    integer, intent(in) :: key
    ready = 0
    if (key + 1 <= size(moving%flows)) then
      if (moving%flows(key + 1)%key == key) ready = key + 1
    end if
    if (ready == 0) ready = findloc(moving%flows%key, key, 1)
  end function ready

  !> Moves to the next section and starts the clock anew.
  pure subroutine advance_jointed_period(moving, state, tally, reason, log)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    integer :: j
    call advance_jointed(moving, state, moving%machine%period, tally, reason, log)
    if (reason /= 0) return
    state%time = 0
    if (present(log)) then
      log%origin = log%origin + moving%machine%period
      if (.not. allocated(log%instants)) log%next_sample = 0
    end if
    do j = 1, size(moving%machine%joints)
      ! Sliders are placed on surfaces that run on.
      if (moving%machine%joints(j)%kind == joint_elastic) state%slider(j) = &
        state%slider(j) - moving%machine%joints(j)%offset%rate*moving%machine%period
    end do
    call append_word(tally, word_period)
  end subroutine advance_jointed_period

  !> Counts a flight in which anything moves.
  pure subroutine note_slip(moving, state, key, tally)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(in) :: state
    integer, intent(in) :: key
    type(tally_t), intent(inout) :: tally
    integer :: at
    logical :: still
    at = ready(moving, key)
    still = .false.
    if (at > 0) still = size(moving%flows(at)%independent) == moving%machine%n
    if (still) still = .not. any(abs(state%v) > moving%machine%negligible_speed)
    if (.not. still) tally%slips = tally%slips + 1
  end subroutine note_slip

  !> What the guards that have fallen bring about. `stalled`: what cannot be decided is held for an instant.
  pure subroutine transition(moving, state, list, fallen, stalled, burst, tally, ok)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(inout) :: state
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: fallen(:), stalled
    integer, intent(inout) :: burst
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    complex(wp) :: turning(moving%harmonics)
    type(jointed_state_t) :: start
    integer :: touching(most_joints), hit(most_joints), g, j
    logical :: at_rest(most_joints), plastic
    real(wp) :: s, u, speed(most_joints), lost
    associate (machine => moving%machine)
      turning = turning_at(machine%frequency, state%time, moving%harmonics)
      start = state
      at_rest = .false.
      touching = 0
      hit = 0
      do g = 1, size(list)
        if (.not. fallen(g)) cycle
        j = list(g)%joint
        select case (list(g)%meaning)
        case (slide_ends)
          if (machine%joints(j)%kind == joint_elastic) then
            call stop_slider(machine, j, state, turning)
            call append_word(tally, word_stick)
            tally%sticks = tally%sticks + 1
          else
            at_rest(j) = .true.
          end if
        case (slides_up, slides_down)
          if (machine%joints(j)%kind == joint_elastic) then
            state%phase(j) = merge(1, -1, list(g)%meaning == slides_up)
            state%left(j) = 1
          end if
        case (meets_upper, meets_lower)
          touching(j) = merge(1, -1, list(g)%meaning == meets_upper)
          if (machine%joints(j)%kind == joint_soft) then
            call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
            state%phase(j) = touching(j)
            state%left(j) = touching(j)
            state%touch_speed(j) = abs(u)
            call count_impact(tally, touching(j), abs(u))
            touching(j) = 0
          else
            hit(j) = touching(j)
          end if
        case (lets_go)
          touching(j) = state%phase(j)
        case (leaves)
          state%left(j) = sign(1, state%phase(j))
          state%phase(j) = 0
        case (force_ends)
          state%phase(j) = 2*state%phase(j)
          state%left(j) = sign(1, state%phase(j))
        case (force_returns)
          state%phase(j) = state%phase(j)/2
          state%left(j) = sign(1, state%phase(j))
        end select
      end do
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind == joint_contact .and. state%phase(j) /= 0) touching(j) = state%phase(j)
      end do
      ok = .true.
      if (any(hit /= 0)) then
        burst = burst + 1
        plastic = burst > long_burst
        if (plastic) call add_near(moving, state, turning, touching)
        call strike(machine, state, turning, touching, plastic, speed, lost, ok)
        do j = 1, size(machine%joints)
          if (hit(j) /= 0) call count_impact(tally, hit(j), abs(speed(j)))
        end do
      end if
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind /= joint_friction) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        if (start%phase(j) == 0) at_rest(j) = .not. any(hit /= 0) .or. &
          abs(u) <= rounding_of_speed(machine, j, state) + rounding_of_speed(machine, j, start)
        if (abs(u) <= rounding_of_speed(machine, j, state)) at_rest(j) = .true.
        if (.not. at_rest(j)) state%phase(j) = merge(1, -1, u > 0)
      end do
      if (stalled) then
        call hold(moving, state, turning, at_rest, touching)
        return
      end if
      if (ok) call settle(moving, state, turning, at_rest, touching, ok)
      if (ok .and. any(hit /= 0)) call end_chatter(moving, start, touching, hit, turning, state, tally)
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind == joint_friction .and. start%phase(j) /= 0 .and. state%phase(j) == 0) then
          tally%sticks = tally%sticks + 1
          call append_word(tally, word_stick)
        end if
      end do
    end associate
  end subroutine transition

  !> The slider of elastic friction stops: its spring holds what friction was.
  pure subroutine stop_slider(machine, j, state, turning)
    type(jointed_t), intent(in) :: machine
    integer, intent(in) :: j
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: s, u
    call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
    state%slider(j) = s - state%phase(j)*machine%joints(j)%friction%kinetic/machine%joints(j)%stiffness
    state%left(j) = 0
    if (machine%joints(j)%friction%break_away <= machine%joints(j)%friction%kinetic) state%left(j) = state%phase(j)
    state%phase(j) = 0
  end subroutine stop_slider

  pure subroutine count_impact(tally, side, speed)
    type(tally_t), intent(inout) :: tally
    integer, intent(in) :: side
    real(wp), intent(in) :: speed
    tally%impacts = tally%impacts + 1
    tally%impact_speed_sum = tally%impact_speed_sum + speed
    tally%last_impact_speed = speed
    call append_word(tally, merge(word_upper, word_lower, side > 0))
  end subroutine count_impact

  !> Contacts that are all but closed take part in the end of a chatter of several.
  pure subroutine add_near(moving, state, turning, touching)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(inout) :: touching(:)
    real(wp) :: s, u
    integer :: j
    do j = 1, size(moving%machine%joints)
      associate (joint => moving%machine%joints(j))
        if (joint%kind /= joint_contact) cycle
        call joint_motion(moving%machine, j, state%q, state%v, state%time, turning, s, u)
        if (joint%upper - s < 1e-9_wp*moving%machine%length_scale) touching(j) = 1
        if (s - joint%lower < 1e-9_wp*moving%machine%length_scale) touching(j) = -1
      end associate
    end do
  end subroutine add_near

  !> Completes the chatter of one contact that has just rebounded from the state `before`, if the forces do not change until
  !> its end: then the state there is that of an impact without rebound now, and of the closed contact from then on, in all
  !> coordinates and for
  !> every restitution (the impulses act along one direction, and the conditions of a closed gap fix them).
  pure subroutine end_chatter(moving, before, touching, hit, turning, state, tally)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(in) :: before
    integer, intent(in) :: touching(:), hit(:)
    complex(wp), intent(in) :: turning(:)
    type(jointed_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    type(jointed_state_t) :: closed
    real(wp) :: a(moving%machine%n), jerk(moving%machine%n), s, u, given, opening, change, last, speed(most_joints), lost, e
    integer :: j, i
    logical :: at_rest(most_joints), ok
    associate (machine => moving%machine)
      j = findloc(hit /= 0, .true., 1)
      if (count(hit /= 0) /= 1 .or. state%phase(j) /= 0) return
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
      call accelerations_of(machine, state, turning, a, jerk)
      opening = -hit(j)*(sum(machine%joints(j)%row*a) + given)
      change = abs(sum(machine%joints(j)%row*jerk)) + abs(given)*machine%frequency
      if (.not. opening < 0 .or. .not. -hit(j)*u > 0) return
      e = machine%joints(j)%contact%restitution
      if (e >= 1) return
      last = 2*abs(u)/(-opening*(1 - e))
      if (last*change > -opening*moving%chatter_share .or. last > 1e-2_wp*machine%period) return
      closed = before
      call strike(machine, closed, turning, touching, .true., speed, lost, ok)
      if (.not. ok) return
      ! No speed goes through zero on the way.
      at_rest = .false.
      do i = 1, size(machine%joints)
        if (machine%joints(i)%kind /= joint_friction) cycle
        call joint_motion(machine, i, state%q, state%v, state%time, turning, s, u, given)
        at_rest(i) = state%phase(i) == 0
        closed%phase(i) = state%phase(i)
        if (state%phase(i) /= 0 .and. abs(u) <= 2*last*abs(sum(machine%joints(i)%row*a) + given)) return
      end do
      call settle(moving, closed, turning, at_rest, touching, ok)
      if (.not. ok .or. closed%phase(j) /= hit(j)) return
      do i = 1, size(machine%joints)
        if (i /= j .and. closed%phase(i) /= state%phase(i)) return
      end do
      state = closed
      tally%chatters = tally%chatters + 1
      call append_word(tally, merge(word_chatter_upper, word_chatter_lower, hit(j) > 0))
    end associate
  end subroutine end_chatter

  !> What cannot be told apart by rounding is held, for a billionth of a period.
  pure subroutine hold(moving, state, turning, at_rest, touching)
    type(jointed_motion_t), intent(in) :: moving
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    integer :: j
    do j = 1, size(moving%machine%joints)
      if (at_rest(j)) state%phase(j) = 0
      if (touching(j) /= 0) state%phase(j) = touching(j)
      state%left(j) = 0
    end do
    call project(moving%machine, state, turning)
    state%time = state%time + 1e-9_wp*moving%machine%period
  end subroutine hold

end module jointed_motion
