! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One slip on the closed form, from its start to the first of: the speed falls to a level (zero, or the
!> edge of the Stribeck layer), the barrier ahead, the end of the time. The position is monotone while
!> the velocity keeps its sign, so the barrier is crossed at most once and a crossing cannot hide.
module exact_flight
  use certified_step, only: departure_step, positive_step, single_root_limit, taylor_root
  use exact_flow, only: begin_segment, evaluate, flow_t, jerk_bound_at, kinematics_t, segment_t, snap_bound_at
  use exact_samples, only: evaluate_row
  use kinds, only: wp
  use motion_state, only: log_t, make_room, mode_slip_plus, record_sample, sample_due, sample_time, samples_before, state_t, &
    tally_t
  implicit none
  private

  public :: fly_exact

  !> How a flight ended. `flight_layer_left`: the speed rose out of the Stribeck layer (adaptive
  !> flight only).
  integer, parameter, public :: flight_time_over = 0, flight_speed_reached = 1, &
    flight_barrier = 2, flight_layer_left = 3, flight_failed = 4

  integer, parameter :: most_polish = 60
  !> Samples from which on a row is cheaper than one by one.
  integer, parameter :: shortest_row = 4

contains

  !> Flies from `state` (mode slip_plus or slip_minus) up to `time_end` [s after the section].
  !> `level` [m/s] >= 0 is the speed at which the flight ends, `barrier` [m] the barrier ahead. The state
  !> returned is that just before the event; at the barrier x is set to it, at level zero v is set to 0.
  pure subroutine fly_exact(flow, state, time_end, level, barrier, tally, outcome, log)
    type(flow_t), intent(in) :: flow
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end, level, barrier
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(segment_t) :: segment
    type(kinematics_t) :: now
    real(wp) :: elapsed, before, span
    integer :: direction
    direction = merge(1, -1, state%mode == mode_slip_plus)
    span = time_end - state%time
    call begin_segment(flow, state%time, state%x, state%v, direction, segment)
    call find_level(flow, segment, state, direction, span, level, barrier, before, elapsed, now, outcome)
    if (outcome == flight_barrier) call find_barrier(flow, segment, direction, barrier, before, elapsed, now)
    if (tally%needs_v_max .and. direction > 0) call raise_v_max(flow, segment, elapsed, tally%v_max)
    if (present(log)) call sample_segment(flow, segment, state, elapsed, log)
    state%time = state%time + elapsed
    if (outcome == flight_time_over) state%time = time_end
    state%x = now%x
    state%v = now%v
    if (outcome == flight_barrier) state%x = barrier
    if (outcome == flight_speed_reached) state%v = direction*level
    if (direction*state%v < 0) state%v = 0
  end subroutine fly_exact

  !> Marches in certified steps until the speed is at the level, the body is beyond the barrier, or the span
  !> is over. Returns the last point short of the barrier in `before`.
  pure subroutine find_level(flow, segment, state, direction, span, level, barrier, before, elapsed, &
                             now, outcome)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    type(state_t), intent(in) :: state
    integer, intent(in) :: direction
    real(wp), intent(in) :: span, level, barrier
    real(wp), intent(out) :: before, elapsed
    type(kinematics_t), intent(out) :: now
    integer, intent(out) :: outcome
    real(wp) :: w, step, limit, smallest, jerk_bound
    logical :: falls
    smallest = 4*epsilon(1.0_wp)*max(span, abs(segment%start))
    elapsed = 0
    before = 0
    call evaluate(flow, segment, elapsed, now)
    now%x = state%x
    now%v = state%v
    w = direction*now%v - level
    jerk_bound = segment%jerk_bound
    if (w <= 0) then
      step = departure_step(max(0.0_wp, direction*now%a), direction*now%j, jerk_bound, segment%snap_bound)
    else
      step = positive_step(w, direction*now%a, jerk_bound)
    end if
    do
      outcome = flight_speed_reached
      if (step <= smallest) return
      before = elapsed
      falls = .false.
      if (w > 0) then
        limit = single_root_limit(w, direction*now%a, jerk_bound)
        falls = elapsed + limit <= span
      end if
      if (falls) then
        call polish_level(flow, segment, direction, level, elapsed, elapsed + limit, now)
        if (direction*(now%x - barrier) >= 0) outcome = flight_barrier
        return
      end if
      outcome = flight_time_over
      elapsed = min(elapsed + step, span)
      call evaluate(flow, segment, elapsed, now)
      w = direction*now%v - level
      if (direction*(now%x - barrier) >= 0) then
        outcome = flight_barrier
        return
      end if
      if (elapsed >= span) return
      step = 0
      if (flow%overdamped) jerk_bound = jerk_bound_at(flow, segment, elapsed)
      if (w > 0) step = positive_step(w, direction*now%a, jerk_bound)
    end do
  end subroutine find_level

  !> The one root of the speed against the level between `elapsed` (above the level) and `last`.
  pure subroutine polish_level(flow, segment, direction, level, elapsed, last, now)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    integer, intent(in) :: direction
    real(wp), intent(in) :: level, last
    real(wp), intent(inout) :: elapsed
    type(kinematics_t), intent(inout) :: now
    real(wp) :: low, high, next, w, step
    integer :: i
    low = elapsed
    high = last
    do i = 1, most_polish
      w = direction*now%v - level
      if (w > 0) low = elapsed
      if (w <= 0) high = elapsed
      step = taylor_root(w, direction*now%a, direction*now%j)
      next = elapsed + step
      if (.not. (next >= low .and. next <= high)) next = 0.5_wp*(low + high)
      step = next - elapsed
      elapsed = next
      call evaluate(flow, segment, elapsed, now)
      if (abs(step) <= 4*epsilon(1.0_wp)*(segment%start + elapsed) .or. high - low <= 0) exit
    end do
  end subroutine polish_level

  !> The one crossing of the barrier between `before` (short of it) and `elapsed` (beyond).
  pure subroutine find_barrier(flow, segment, direction, barrier, before, elapsed, now)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    integer, intent(in) :: direction
    real(wp), intent(in) :: barrier, before
    real(wp), intent(inout) :: elapsed
    type(kinematics_t), intent(inout) :: now
    real(wp) :: low, high, next, gap, step, discriminant
    integer :: i
    low = before
    high = elapsed
    do i = 1, most_polish
      gap = direction*(barrier - now%x)
      if (gap > 0) low = elapsed
      if (gap <= 0) high = elapsed
      discriminant = now%v**2 + 2*direction*now%a*gap
      next = low - 1
      if (discriminant > 0) next = elapsed + 2*gap/(direction*now%v + sqrt(discriminant))
      if (.not. (next >= low .and. next <= high)) next = 0.5_wp*(low + high)
      step = next - elapsed
      elapsed = next
      call evaluate(flow, segment, elapsed, now)
      if (abs(step) <= 4*epsilon(1.0_wp)*(segment%start + elapsed) .or. high - low <= 0) exit
    end do
  end subroutine find_barrier

  !> Raises `v_max` to the largest velocity of the flight up to `last`: its ends and every zero of the
  !> acceleration between. The acceleration keeps its sign over a certified step.
  pure subroutine raise_v_max(flow, segment, last, v_max)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: last
    real(wp), intent(inout) :: v_max
    type(kinematics_t) :: now
    real(wp) :: elapsed, step, smallest
    smallest = 1e-9_wp*last
    elapsed = 0
    do
      call evaluate(flow, segment, elapsed, now)
      v_max = max(v_max, now%v)
      if (elapsed >= last) exit
      step = positive_step(abs(now%a), sign(1.0_wp, now%a)*now%j, snap_bound_at(flow, segment, elapsed))
      elapsed = min(elapsed + max(step, smallest), last)
    end do
  end subroutine raise_v_max

  !> Writes down the samples that fall into the flight.
  pure subroutine sample_segment(flow, segment, state, elapsed, log)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: elapsed
    type(log_t), intent(inout) :: log
    type(kinematics_t) :: now
    type(state_t) :: sample
    if (log%sample_interval <= 0) return
    if (allocated(log%instants)) call sample_row(flow, segment, state, elapsed, log)
    do
      sample = state
      sample%time = sample_time(log)
      if (.not. sample_due(log, state%time + elapsed)) exit
      if (sample%time > state%time) then
        call evaluate(flow, segment, sample%time - state%time, now)
        sample%x = now%x
        sample%v = now%v
      end if
      call record_sample(log, sample)
    end do
  end subroutine sample_segment

  !> Writes down those samples that are equidistant to rounding, from the next one on.
  pure subroutine sample_row(flow, segment, state, elapsed, log)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: elapsed
    type(log_t), intent(inout) :: log
    real(wp) :: from, interval, rounding
    integer :: first, last, i
    first = log%next_sample + 1
    last = samples_before(log, state%time + elapsed)
    if (last - first + 1 < shortest_row) return
    from = log%instants(first) - log%origin - state%time
    interval = (log%instants(last) - log%instants(first))/(last - first)
    rounding = 4*epsilon(1.0_wp)*log%instants(last)
    if (from < 0) return
    do i = first, last
      if (abs(log%instants(first) + (i - first)*interval - log%instants(i)) > rounding) return
    end do
    call make_room(log, last)
    call evaluate_row(flow, segment, from, interval, log%sample_data(2, first:last), log%sample_data(3, first:last))
    log%sample_data(1, first:last) = log%instants(first:last)
    log%sample_mode(first:last) = state%mode
    log%samples = last
    log%next_sample = last
  end subroutine sample_row

end module exact_flight
