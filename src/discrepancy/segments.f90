! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many short segments of a motion, each from a start of its own, sampled at given times, with the derivatives of the samples along
!> directions in the space of the machine's parameters and by the start. A record is compared with them segment by segment, so that
!> a small error of the model does not grow into another motion.
module segments
  use effect_law, only: observed
  use kinds, only: wp
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: event_impact_lower, event_impact_upper, event_separation, event_touch_lower, event_touch_upper, log_t, &
    state_t, tally_t
  use segment_flight, only: add_differences, differentiate_sensor, flight_t, grazes, moved_start, start_allowed, untouched
  use segments_in_lanes, only: fly_base_in_lanes, lane_segments_t, differentiate_in_lanes
  use status, only: exit_bad_case
  use variants, only: family_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: propagate

  !> Samples of all segments, one after the other.
  type, public :: samples_t
    real(wp), allocatable :: x(:), v(:)
    !> Derivatives: row = directions, then x, v and crank angle of the start; column = sample.
    real(wp), allocatable :: x_slope(:, :), v_slope(:, :)
  end type samples_t

  !> What happened in each segment, and every impact.
  type, public :: report_t
    integer, allocatable :: impacts(:), reason(:)
    logical, allocatable :: steady(:)
    !> Segment of each impact; rows of `impact`: time since the start of the segment [s], speeds before and after [m/s] (after
    !> a soft contact: when it ends, not a number if it lasts), +1 upper or -1 lower barrier.
    integer, allocatable :: impact_segment(:)
    real(wp), allocatable :: impact(:, :)
    !> Segments that flew in lanes with all their neighbours.
    integer :: in_lanes = 0
  end type report_t

  !> A flight in the event loop.
  type :: run_t
    type(log_t) :: log
    type(tally_t) :: tally
    type(flight_t) :: flight
  end type run_t

contains

  !> Flies every segment: `start` = x [m], v [m/s], crank angle [rad] by column, its samples are at
  !> `times(first(i) + 1:first(i + 1))` [s], ascending from 0. The sensor shows the start at time 0; if it is late, the body
  !> was there `delay` before, when the crank was that much behind the angle given. A segment that cannot be flown has
  !> samples that are not numbers and a reason (module `status`; `exit_bad_case`: its start is not finite or beyond a rigid
  !> barrier). It is steady if its neighbours meet the same barriers in the same order and none is grazed. A segment flies with
  !> all its neighbours in lanes, or in the event loop, so that they share their errors.
  pure subroutine propagate(family, start, first, times, derivatives, samples, report)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(in) :: derivatives
    type(samples_t), intent(out) :: samples
    type(report_t), intent(out) :: report
    type(lane_segments_t) :: lanes
    type(run_t) :: base, adaptive, other
    integer :: i, total
    allocate (samples%x(size(times)), samples%v(size(times)))
    if (derivatives) allocate (samples%x_slope(size(family%further) + 3, size(times)), &
                               samples%v_slope(size(family%further) + 3, size(times)))
    allocate (report%impacts(size(start, 2)), report%reason(size(start, 2)), report%steady(size(start, 2)))
    allocate (report%impact_segment(size(start, 2)), report%impact(4, size(start, 2)))
    call fly_base_in_lanes(family, start, first, times, lanes)
    if (derivatives .and. any(lanes%flown)) then
      call differentiate_in_lanes(family, start, first, times, lanes, samples%x_slope, samples%v_slope)
    end if
    report%in_lanes = count(lanes%flown)
    call open_run(base)
    call open_run(adaptive)
    call open_run(other)
    total = 0
    do i = 1, size(start, 2)
      associate (from => first(i) + 1, to => first(i + 1))
        if (lanes%flown(i)) then
          report%steady(i) = lanes%steady(i)
          call keep(family, lanes%base(i), i, from, to, total, samples, report)
          cycle
        end if
        call fly(family%moving, start(:, i), times(from:to), base)
        report%steady(i) = base%flight%reason == 0 .and. .not. (derivatives .and. grazes(family, base%flight))
        if (derivatives .and. allocated(family%adaptive)) call fly(family%adaptive%moving, start(:, i), times(from:to), adaptive)
        if (derivatives) call differentiate(family, start(:, i), times(from:to), base%flight, adaptive%flight, other, &
                                            samples%x_slope(:, from:to), samples%v_slope(:, from:to), report%steady(i))
        call keep(family, base%flight, i, from, to, total, samples, report)
      end associate
    end do
    report%impact_segment = report%impact_segment(:total)
    report%impact = report%impact(:, :total)
  end subroutine propagate

  !> Puts the flight of a segment into samples and report; `total` impacts are there.
  pure subroutine keep(family, flight, segment, from, to, total, samples, report)
    type(family_t), intent(in) :: family
    type(flight_t), intent(in) :: flight
    integer, intent(in) :: segment, from, to
    integer, intent(inout) :: total
    type(samples_t), intent(inout) :: samples
    type(report_t), intent(inout) :: report
    integer :: i
    samples%x(from:to) = observed(family%moving%machine%sensor, flight%x(:to - from + 1))
    samples%v(from:to) = flight%v(:to - from + 1)
    report%impacts(segment) = flight%count
    report%reason(segment) = flight%reason
    if (total + flight%count > size(report%impact_segment)) then
      report%impact_segment = [report%impact_segment, (0, i=1, total + flight%count)]
      report%impact = reshape(report%impact, [4, size(report%impact_segment)], pad=[0.0_wp])
    end if
    report%impact_segment(total + 1:total + flight%count) = segment
    report%impact(:, total + 1:total + flight%count) = flight%impact(:, :flight%count)
    total = total + flight%count
  end subroutine keep

  pure subroutine open_run(run)
    type(run_t), intent(out) :: run
    run%log%sample_interval = 1
    run%log%balance%kept = .false.
    allocate (run%flight%impact(4, 16), run%flight%x(0), run%flight%v(0))
  end subroutine open_run

  !> One segment of one machine.
  pure subroutine fly(moving, start, times, run)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    type(run_t), intent(inout) :: run
    type(state_t) :: state
    run%tally = tally_t()
    run%log%origin = 0
    run%log%events = 0
    run%log%samples = 0
    run%log%next_sample = 0
    associate (flight => run%flight)
      flight%count = 0
      flight%reason = 0
      if (size(flight%x) < size(times)) then
        deallocate (flight%x, flight%v)
        allocate (flight%x(size(times)), flight%v(size(times)))
      end if
      if (start_allowed(moving, start)) then
        associate (machine => moving%machine)
          state = start_state(moving, start(1), start(2), start(3) - machine%drive_frequency*machine%sensor%delay)
        end associate
        run%tally%x_max = start(1)
        run%tally%x_min = start(1)
        flight%origin = state%time
        run%log%instants = state%time + times
        if (size(times) > 0) call fly_to(moving, run%log%instants(size(times)), state, run)
      else
        flight%reason = exit_bad_case
      end if
      if (flight%reason /= 0) then
        flight%x = not_a_number()
        flight%v = flight%x
      else
        associate (done => run%log%samples)
          if (done > 0) flight%x(:done) = run%log%sample_data(2, :done)
          if (done > 0) flight%v(:done) = run%log%sample_data(3, :done)
          flight%x(done + 1:size(times)) = state%x
          flight%v(done + 1:size(times)) = state%v
        end associate
      end if
      flight%grazing_margin = run%tally%grazing_margin
      flight%x_max = run%tally%x_max
      flight%x_min = run%tally%x_min
      call read_impacts(run%log, flight)
    end associate
  end subroutine fly

  pure real(wp) function not_a_number()
    not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
  end function not_a_number

  !> Moves to `until` [s on the clock of the log].
  pure subroutine fly_to(moving, until, state, run)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: until
    type(state_t), intent(inout) :: state
    type(run_t), intent(inout) :: run
    do while (until - run%log%origin >= moving%machine%period)
      call advance_period(moving, state, run%tally, run%flight%reason, run%log)
      if (run%flight%reason /= 0) return
      ! Budgets are of one period.
      run%tally%events = 0
      run%tally%steps = 0
    end do
    call advance(moving, state, until - run%log%origin, run%tally, run%flight%reason, run%log)
  end subroutine fly_to

  !> Takes the impacts out of the events.
  pure subroutine read_impacts(log, flight)
    type(log_t), intent(in) :: log
    type(flight_t), intent(inout) :: flight
    real(wp) :: side
    integer :: i
    do i = 1, log%events
      select case (log%event_kind(i))
      case (event_impact_upper, event_touch_upper)
        side = 1
      case (event_impact_lower, event_touch_lower)
        side = -1
      case (event_separation)
        if (flight%count > 0) flight%impact(3, flight%count) = abs(log%event_data(3, i))
        cycle
      case default
        cycle
      end select
      if (flight%count == size(flight%impact, 2)) flight%impact = reshape(flight%impact, [4, 2*flight%count], pad=[0.0_wp])
      flight%count = flight%count + 1
      associate (event => log%event_data(:, i))
        flight%impact(:, flight%count) = [event(1) - flight%origin, abs(event(3)), abs(event(4)), side]
        if (any(log%event_kind(i) == [event_touch_upper, event_touch_lower])) flight%impact(3, flight%count) = not_a_number()
      end associate
    end do
  end subroutine read_impacts

  !> Derivatives of the samples of one segment by differences between its neighbours and itself.
  pure subroutine differentiate(family, start, times, base, adaptive, other, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(3), times(:)
    type(flight_t), intent(in) :: base, adaptive
    type(run_t), intent(inout) :: other
    real(wp), intent(inout) :: x_slope(:, :), v_slope(:, :)
    logical, intent(inout) :: steady
    logical :: open(size(times))
    integer :: k, row, turn
    x_slope = merge(0.0_wp, not_a_number(), base%reason == 0)
    v_slope = x_slope
    if (base%reason /= 0) return
    do k = 1, 3
      open = .true.
      row = size(family%further) + k
      do turn = 1, 2
        call step_start(family, start, k, turn, times, base, other, open, x_slope(row, :), v_slope(row, :), steady)
        if (.not. any(open)) exit
      end do
      if (any(open)) steady = .false.
    end do
    do row = 1, size(family%further)
      if (.not. abs(family%further(row)%step) > 0) cycle
      if (untouched(family%moving, family%further(row), base)) cycle
      open = .true.
      if (family%further(row)%leaves_exact) then
        call step_along(family, row, start, times, adaptive, other, open, x_slope(row, :), v_slope(row, :), steady)
      else
        call step_along(family, row, start, times, base, other, open, x_slope(row, :), v_slope(row, :), steady)
      end if
      if (any(open)) steady = .false.
    end do
    call differentiate_sensor(family, base, x_slope, v_slope)
  end subroutine differentiate

  !> The difference that a step along direction `k` makes.
  pure subroutine step_along(family, k, start, times, base, other, open, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    integer, intent(in) :: k
    real(wp), intent(in) :: start(3), times(:)
    type(flight_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    associate (further => family%further(k), back => family%back(k))
      call fly(further%moving, start, times, other)
      call add_differences(base, other%flight, further%step, times, open, x_slope, v_slope, steady)
      if (.not. any(open) .or. .not. abs(back%step) > 0) return
      call fly(back%moving, start, times, other)
      call add_differences(base, other%flight, back%step, times, open, x_slope, v_slope, steady)
    end associate
  end subroutine step_along

  !> The difference that a step of the start in coordinate `k`, forth or back, makes, where the barriers allow it.
  pure subroutine step_start(family, start, k, turn, times, base, other, open, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(3), times(:)
    integer, intent(in) :: k, turn
    type(flight_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    real(wp) :: moved(3)
    moved = moved_start(family, start, k, turn)
    if (.not. start_allowed(family%moving, moved) .or. .not. abs(moved(k) - start(k)) > 0) return
    call fly(family%moving, moved, times, other)
    call add_differences(base, other%flight, moved(k) - start(k), times, open, x_slope, v_slope, steady)
  end subroutine step_start

end module segments
