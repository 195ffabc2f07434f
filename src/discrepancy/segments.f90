! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many short stretches of a motion, each from a start of its own, sampled at given times, with the derivatives of the samples
!> along directions in the space of the machine's parameters and by the start. This is what a record is compared with, stretch
!> by stretch, so that a small error of the model does not grow into another motion.
module segments
  use contact_law, only: barrier_positions
  use effect_law, only: observed
  use kinds, only: wp
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: event_impact_lower, event_impact_upper, event_separation, event_touch_lower, event_touch_upper, log_t, &
    state_t, tally_t
  use status, only: exit_bad_case
  use variants, only: family_t, sensor_bias, sensor_delay, sensor_gain, variant_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
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
  end type report_t

  !> One flight of one segment.
  type :: run_t
    type(log_t) :: log
    type(tally_t) :: tally
    integer :: reason = 0, count = 0
    !> Start of the segment on the clock of the log [s].
    real(wp) :: origin = 0
    !> Rows of `impact` in `report_t`.
    real(wp), allocatable :: impact(:, :)
    real(wp), allocatable :: x(:), v(:)
  end type run_t

contains

  !> Flies every segment: `start` = x [m], v [m/s], crank angle [rad] by column, its samples are at
  !> `times(first(i) + 1:first(i + 1))` [s], ascending from 0. The sensor shows the start at time 0; if it is late, the body
  !> was there `delay` before, when the crank was that much behind the angle given. A segment that cannot be flown has
  !> samples that are not numbers and a reason (module `status`; `exit_bad_case`: its start is not finite or beyond a rigid
  !> barrier). It is steady if its neighbours meet the same barriers in the same order and none is grazed.
  pure subroutine propagate(family, start, first, times, derivatives, samples, report)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(in) :: derivatives
    type(samples_t), intent(out) :: samples
    type(report_t), intent(out) :: report
    type(run_t) :: base, adaptive, other
    integer :: i, total
    allocate (samples%x(size(times)), samples%v(size(times)))
    if (derivatives) allocate (samples%x_slope(size(family%further) + 3, size(times)), &
                               samples%v_slope(size(family%further) + 3, size(times)))
    allocate (report%impacts(size(start, 2)), report%reason(size(start, 2)), report%steady(size(start, 2)))
    allocate (report%impact_segment(size(start, 2)), report%impact(4, size(start, 2)))
    call open_run(base)
    call open_run(adaptive)
    call open_run(other)
    total = 0
    do i = 1, size(start, 2)
      associate (from => first(i) + 1, to => first(i + 1))
        call fly(family%moving, start(:, i), times(from:to), base)
        samples%x(from:to) = observed(family%moving%machine%sensor, base%x(:to - from + 1))
        samples%v(from:to) = base%v(:to - from + 1)
        report%impacts(i) = base%count
        report%reason(i) = base%reason
        report%steady(i) = base%reason == 0 .and. .not. (derivatives .and. grazes(family, base))
        if (derivatives .and. allocated(family%adaptive)) call fly(family%adaptive, start(:, i), times(from:to), adaptive)
        if (derivatives) call differentiate(family, start(:, i), times(from:to), base, adaptive, other, &
                                            samples%x_slope(:, from:to), samples%v_slope(:, from:to), report%steady(i))
      end associate
      call note_impacts(i, base, total, report)
    end do
    report%impact_segment = report%impact_segment(:total)
    report%impact = report%impact(:, :total)
  end subroutine propagate

  pure subroutine open_run(run)
    type(run_t), intent(out) :: run
    run%log%sample_interval = 1
    run%log%book%kept = .false.
    allocate (run%impact(4, 16), run%x(0), run%v(0))
  end subroutine open_run

  pure subroutine note_impacts(segment, run, total, report)
    integer, intent(in) :: segment
    type(run_t), intent(in) :: run
    integer, intent(inout) :: total
    type(report_t), intent(inout) :: report
    integer :: i
    if (total + run%count > size(report%impact_segment)) then
      report%impact_segment = [report%impact_segment, (0, i=1, total + run%count)]
      report%impact = reshape(report%impact, [4, size(report%impact_segment)], pad=[0.0_wp])
    end if
    report%impact_segment(total + 1:total + run%count) = segment
    report%impact(:, total + 1:total + run%count) = run%impact(:, :run%count)
    total = total + run%count
  end subroutine note_impacts

  !> One segment of one machine.
  pure subroutine fly(moving, start, times, run)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    type(run_t), intent(inout) :: run
    type(state_t) :: state
    run%tally = tally_t()
    run%count = 0
    run%reason = 0
    if (size(run%x) < size(times)) then
      deallocate (run%x, run%v)
      allocate (run%x(size(times)), run%v(size(times)))
    end if
    run%log%origin = 0
    run%log%events = 0
    run%log%samples = 0
    run%log%next_sample = 0
    if (start_allowed(moving, start)) then
      associate (machine => moving%machine)
        state = start_state(moving, start(1), start(2), start(3) - machine%drive_frequency*machine%sensor%delay)
      end associate
      run%tally%x_max = start(1)
      run%tally%x_min = start(1)
      run%origin = state%time
      run%log%instants = state%time + times
      if (size(times) > 0) call fly_to(moving, run%log%instants(size(times)), state, run)
    else
      run%reason = exit_bad_case
    end if
    if (run%reason /= 0) then
      run%x = not_a_number()
      run%v = run%x
    else
      associate (done => run%log%samples)
        if (done > 0) run%x(:done) = run%log%sample_data(2, :done)
        if (done > 0) run%v(:done) = run%log%sample_data(3, :done)
        run%x(done + 1:size(times)) = state%x
        run%v(done + 1:size(times)) = state%v
      end associate
    end if
    call read_impacts(run)
  end subroutine fly

  pure real(wp) function not_a_number()
    not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
  end function not_a_number

  !> Whether a start is finite and not beyond a rigid barrier.
  pure logical function start_allowed(moving, start)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3)
    start_allowed = all(ieee_is_finite(start))
    if (start_allowed) start_allowed = start(1) <= moving%machine%contact%upper &
                                       .and. start(1) >= moving%machine%contact%lower
  end function start_allowed

  !> Moves to `until` [s on the clock of the log].
  pure subroutine fly_to(moving, until, state, run)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: until
    type(state_t), intent(inout) :: state
    type(run_t), intent(inout) :: run
    do while (until - run%log%origin >= moving%machine%period)
      call advance_period(moving, state, run%tally, run%reason, run%log)
      if (run%reason /= 0) return
      ! Budgets are of one period.
      run%tally%events = 0
      run%tally%steps = 0
    end do
    call advance(moving, state, until - run%log%origin, run%tally, run%reason, run%log)
  end subroutine fly_to

  !> Takes the impacts out of the events.
  pure subroutine read_impacts(run)
    type(run_t), intent(inout) :: run
    real(wp) :: side
    integer :: i
    do i = 1, run%log%events
      select case (run%log%event_kind(i))
      case (event_impact_upper, event_touch_upper)
        side = 1
      case (event_impact_lower, event_touch_lower)
        side = -1
      case (event_separation)
        if (run%count > 0) run%impact(3, run%count) = abs(run%log%event_data(3, i))
        cycle
      case default
        cycle
      end select
      if (run%count == size(run%impact, 2)) run%impact = reshape(run%impact, [4, 2*run%count], pad=[0.0_wp])
      run%count = run%count + 1
      associate (event => run%log%event_data(:, i))
        run%impact(:, run%count) = [event(1) - run%origin, abs(event(3)), abs(event(4)), side]
        if (any(run%log%event_kind(i) == [event_touch_upper, event_touch_lower])) run%impact(3, run%count) = not_a_number()
      end associate
    end do
  end subroutine read_impacts

  !> Derivatives of the samples of one segment by differences between its neighbours and itself.
  pure subroutine differentiate(family, start, times, base, adaptive, other, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(3), times(:)
    type(run_t), intent(in) :: base, adaptive
    type(run_t), intent(inout) :: other
    real(wp), intent(inout) :: x_slope(:, :), v_slope(:, :)
    logical, intent(inout) :: steady
    logical :: open(size(times))
    integer :: k, row, sense
    x_slope = merge(0.0_wp, not_a_number(), base%reason == 0)
    v_slope = x_slope
    if (base%reason /= 0) return
    do k = 1, 3
      open = .true.
      row = size(family%further) + k
      ! A velocity is made larger, so that a slow body does not turn round.
      sense = merge(-1, 1, k == 2 .and. start(2) < 0)
      call step_start(family, start, k, sense, times, base, other, open, x_slope(row, :), v_slope(row, :), steady)
      if (any(open)) call step_start(family, start, k, -sense, times, base, other, open, x_slope(row, :), v_slope(row, :), steady)
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

  !> From derivatives of the position to those of what the sensor shows, and those by the sensor's own parameters. A delay
  !> is an angle by which the crank was behind.
  pure subroutine differentiate_sensor(family, base, x_slope, v_slope)
    type(family_t), intent(in) :: family
    type(run_t), intent(in) :: base
    real(wp), intent(inout) :: x_slope(:, :), v_slope(:, :)
    real(wp) :: behind
    integer :: row, crank
    crank = size(x_slope, 1)
    if (abs(family%moving%machine%sensor%gain) > 0) x_slope = (1 + family%moving%machine%sensor%gain)*x_slope
    do row = 1, size(family%further)
      associate (along => family%of_sensor(:, row))
        if (.not. any(abs(along) > 0)) cycle
        behind = along(sensor_delay)*family%moving%machine%drive_frequency
        x_slope(row, :) = x_slope(row, :) + along(sensor_bias) + along(sensor_gain)*base%x(:size(x_slope, 2)) &
                          - behind*x_slope(crank, :)
        v_slope(row, :) = v_slope(row, :) - behind*v_slope(crank, :)
      end associate
    end do
  end subroutine differentiate_sensor

  !> The difference that a step along direction `k` makes.
  pure subroutine step_along(family, k, start, times, base, other, open, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    integer, intent(in) :: k
    real(wp), intent(in) :: start(3), times(:)
    type(run_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    associate (further => family%further(k), back => family%back(k))
      call compare(further%moving, start, further%step, times, base, other, open, x_slope, v_slope, steady)
      if (any(open)) call compare(back%moving, start, back%step, times, base, other, open, x_slope, v_slope, steady)
    end associate
  end subroutine step_along

  !> The difference that a step of the start in coordinate `k`, forth or back, makes, where the barriers allow it.
  pure subroutine step_start(family, start, k, sense, times, base, other, open, x_slope, v_slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(3), times(:)
    integer, intent(in) :: k, sense
    type(run_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    real(wp) :: moved(3)
    moved = start
    moved(k) = start(k) + sense*family%start_step(k)
    if (.not. start_allowed(family%moving, moved)) return
    call compare(family%moving, moved, moved(k) - start(k), times, base, other, open, x_slope, v_slope, steady)
  end subroutine step_start

  !> Flies a neighbour that is `step` away and fills in its differences at the samples that are still open, but for those
  !> between an impact of the base and the same impact of the neighbour: there a velocity before it would be compared with
  !> one after it. A neighbour that cannot be flown fills in none. Takes the steadiness away if the two do not meet the same
  !> barriers.
  pure subroutine compare(moving, start, step, times, base, other, open, x_slope, v_slope, steady)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), step, times(:)
    type(run_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    logical :: between(size(times))
    real(wp) :: rounding
    integer :: i
    if (.not. abs(step) > 0) return
    call fly(moving, start, times, other)
    if (other%reason /= 0) return
    if (other%count /= base%count) then
      steady = .false.
    else if (any(abs(other%impact(4, :base%count) - base%impact(4, :base%count)) > 0)) then
      steady = .false.
    end if
    between = .false.
    do i = 1, min(base%count, other%count)
      rounding = 32*epsilon(1.0_wp)*(base%origin + base%impact(1, i))
      between = between .or. (times >= min(base%impact(1, i), other%impact(1, i)) - rounding &
                              .and. times <= max(base%impact(1, i), other%impact(1, i)) + rounding)
    end do
    do i = 1, size(times)
      if (.not. open(i) .or. between(i)) cycle
      x_slope(i) = (other%x(i) - base%x(i))/step
      v_slope(i) = (other%v(i) - base%v(i))/step
    end do
    open = open .and. between
  end subroutine compare

  !> Whether a motion turns round so close to a barrier, or meets one so slowly, that the steps are not small against it.
  pure logical function grazes(family, run)
    type(family_t), intent(in) :: family
    type(run_t), intent(in) :: run
    grazes = run%tally%grazing_margin < family%least_clearance .or. any(run%impact(2, :run%count) < family%least_speed)
  end function grazes

  !> Whether a variant that differs at the barriers only cannot differ on a motion.
  pure logical function untouched(moving, variant, run)
    type(motion_t), intent(in) :: moving
    type(variant_t), intent(in) :: variant
    type(run_t), intent(in) :: run
    real(wp) :: here(2), there(2)
    untouched = .false.
    if (.not. variant%contact_only .or. run%count > 0) return
    here = barrier_positions(moving%machine%contact)
    there = barrier_positions(variant%moving%machine%contact)
    untouched = run%tally%x_max < min(here(1), there(1)) .and. run%tally%x_min > max(here(2), there(2))
  end function untouched

end module segments
