! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> As `segments`, of a body with a motor: segments of the motion of body and crank, each from a start of its own, with the
!> derivatives of the samples along directions in the space of the parameters and by the start.
module crank_segments
  use constants, only: two_pi
  use contact_law, only: beyond_barrier
  use kinds, only: wp
  use motion_state, only: event_impact_lower, event_impact_upper, log_t, state_t, tally_t
  use motor_equations, only: foot_half_range
  use motor_march, only: march_mode
  use motor_modes, only: begin_mode
  use motor_motion, only: do_events, most_idle_events, motor_motion_t, start_motor
  use motor_now, only: node_values
  use motor_rest, only: equation_mode, slips
  use motor_state, only: motor_state_t
  use motor_system, only: motor_system_t, phi_at, v_at, w_at, x_at, y_at
  use segment_flight, only: between_impacts
  use series_flight, only: flight_t
  use status, only: exit_bad_case, reason_event_budget, reason_left_domain, reason_mode_cycle, reason_step_failed
  use variants, only: family_t, variant_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: propagate_crank

  !> Position [m], crank angle [rad], velocity [m/s], crank speed [rad/s], current [A] or integral of a speed control [rad].
  integer, parameter, public :: crank_rows = 5
  integer, parameter :: x_row = 1, angle_row = 2, v_row = 3, speed_row = 4, own_row = 5

  !> Samples of all segments, one after the other.
  type, public :: crank_samples_t
    real(wp), allocatable :: motion(:, :)
    !> Derivatives: first directions, then the numbers of the start; then as `motion`.
    real(wp), allocatable :: slope(:, :, :)
  end type crank_samples_t

  !> What happened in each segment, and every impact: as in `report_t` of `segments`.
  type, public :: crank_report_t
    integer, allocatable :: impacts(:), reason(:)
    logical, allocatable :: steady(:)
    integer, allocatable :: impact_segment(:)
    real(wp), allocatable :: impact(:, :)
  end type crank_report_t

  !> One flight of one segment.
  type :: run_t
    integer :: reason = 0, count = 0
    real(wp), allocatable :: impact(:, :), motion(:, :)
  end type run_t

contains

  !> Flies every segment of a machine with a motor: `start` has a column of `crank_rows` numbers for each, its samples are at
  !> `times(first(i) + 1:first(i + 1))` [s], ascending from 0. Segments that cannot be flown, and steady ones: as in
  !> `propagate`.
  pure subroutine propagate_crank(family, start, first, times, derivatives, samples, report)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(in) :: derivatives
    type(crank_samples_t), intent(out) :: samples
    type(crank_report_t), intent(out) :: report
    type(run_t) :: base
    integer :: i, total
    allocate (samples%motion(crank_rows, size(times)))
    if (derivatives) allocate (samples%slope(size(family%further) + crank_rows, crank_rows, size(times)))
    allocate (report%impacts(size(start, 2)), report%reason(size(start, 2)), report%steady(size(start, 2)))
    allocate (report%impact_segment(0), report%impact(4, 0))
    total = 0
    do i = 1, size(start, 2)
      associate (from => first(i) + 1, to => first(i + 1))
        call fly(family%driven, start(:, i), times(from:to), base)
        samples%motion(:, from:to) = base%motion
        report%impacts(i) = base%count
        report%reason(i) = base%reason
        report%steady(i) = base%reason == 0
        if (derivatives) then
          if (any(base%impact(2, :) < family%least_speed)) report%steady(i) = .false.
          call differentiate(family, start(:, i), times(from:to), base, samples%slope(:, :, from:to), report%steady(i))
        end if
      end associate
      report%impact_segment = [report%impact_segment, spread(i, 1, base%count)]
      report%impact = reshape([report%impact, base%impact], [4, total + base%count])
      total = total + base%count
    end do
  end subroutine propagate_crank

  !> One segment of one machine.
  pure subroutine fly(moving, start, times, run)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(out) :: run
    type(log_t) :: log
    type(state_t) :: state
    type(motor_state_t) :: crank
    real(wp) :: own
    allocate (run%motion(crank_rows, size(times)))
    log%balance%kept = .false.
    if (.not. all(ieee_is_finite(start(:own_row - 1)))) then
      run%reason = exit_bad_case
    else if (.not. (ieee_is_finite(start(own_row)) .or. follows(moving))) then
      run%reason = exit_bad_case
    else if (beyond_barrier(moving%system%contact, start(x_row))) then
      run%reason = exit_bad_case
    else
      own = start(own_row)
      if (.not. ieee_is_finite(own)) own = current_that_follows(moving, start)
      call start_motor(moving, [start([x_row, v_row, angle_row, speed_row]), own], state, crank)
      call fly_samples(moving, start(angle_row) - crank%phi, times, state, crank, log, run)
    end if
    if (run%reason /= 0) run%motion = ieee_value(1.0_wp, ieee_quiet_nan)
    call read_impacts(log, times, run)
  end subroutine fly

  !> Whether the motor's own state may be one that follows the speed: a current.
  pure logical function follows(moving)
    type(motor_motion_t), intent(in) :: moving
    follows = moving%system%current > 0 .or. .not. moving%system%control%has_own
  end function follows

  !> Current [A] some time after the start: over its time constant it follows the speed, whatever it was. Its rate there is that
  !> which the torque gives the crank.
  pure real(wp) function current_that_follows(moving, start) result(current)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    integer, parameter :: rounds = 4
    type(state_t) :: state
    type(motor_state_t) :: crank
    real(wp) :: value(moving%system%sheet%tape%count), rate, slope
    integer :: i, mode
    current = 0
    associate (system => moving%system)
      if (.not. system%control%has_own) return
      do i = 1, rounds
        call start_motor(moving, [start([x_row, v_row, angle_row, speed_row]), current], state, crank)
        mode = equation_mode(slips(state%mode), crank%turning /= 0)
        value = node_values(system, state, crank)
        rate = value(system%flights(mode, 0)%rates(y_at))
        ! Of i' = (U - R i - k w)/L: its slopes over current and speed, by differences that are exact.
        crank%own(1) = current + 1
        value = node_values(system, state, crank)
        slope = value(system%flights(mode, 0)%rates(y_at)) - rate
        crank%own(1) = current
        current = current - rate/slope - lag_of(moving, state, crank, mode, slope)
      end do
    end associate
  end function current_that_follows

  !> What the current is behind the one that the speed now would have [A], from the rate of the speed.
  pure real(wp) function lag_of(moving, state, crank, mode, slope) result(lag)
    type(motor_motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    integer, intent(in) :: mode
    real(wp), intent(in) :: slope
    type(motor_state_t) :: other
    real(wp) :: value(moving%system%sheet%tape%count), rate, by_speed
    associate (rates => moving%system%flights(mode, 0)%rates)
      value = node_values(moving%system, state, crank)
      rate = value(rates(w_at))
      by_speed = value(rates(y_at))
      other = crank
      other%w = crank%w + 1
      value = node_values(moving%system, state, other)
      by_speed = value(rates(y_at)) - by_speed
      ! i = i_w + (i_w)'/slope with i_w = -by_speed/slope w + ...
      lag = by_speed*rate/slope**2
    end associate
  end function lag_of

  !> The samples of a flight from mode to mode.
  pure subroutine fly_samples(moving, turned, times, state, crank, log, run)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: turned, times(:)
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(log_t), intent(inout) :: log
    type(run_t), intent(inout) :: run
    type(flight_t) :: flight
    type(tally_t) :: tally
    real(wp) :: samples(moving%system%variables + 1, size(times)), sizes(moving%system%variables), before
    integer :: next, first, idle, fault
    logical :: failed, passed
    next = 1
    idle = 0
    associate (system => moving%system)
      sizes = sizes_of(moving)
      samples = 0
      do while (next <= size(times))
        tally%events = tally%events + 1
        run%reason = merge(reason_event_budget, 0, tally%events > moving%options%event_budget)
        if (run%reason /= 0) return
        before = state%time
        first = next
        call begin_mode(system, state, crank, .false., 0, flight, fault)
        run%reason = merge(reason_step_failed, 0, fault /= 0)
        if (run%reason /= 0) return
        if (times(size(times)) > state%time) then
          call march_mode(system, flight, sizes, moving%options%tolerance, times(size(times)), times, next, samples, failed)
        else
          ! Samples at the very start.
          samples(:system%variables, next:) = spread(flight%state(:system%variables), 2, size(times) - next + 1)
          if (system%current > 0) samples(system%variables + 1, next:) = current_now(system, state, crank)
          next = size(times) + 1
          failed = .false.
          flight%crossed = .false.
        end if
        if (failed) run%reason = reason_step_failed
        if (failed) return
        samples(phi_at, first:next - 1) = samples(phi_at, first:next - 1) + turned + two_pi*crank%turns
        call take_flown(system, flight, state, crank)
        call do_events(moving, flight%crossed, state, crank, passed, tally, log)
        idle = merge(0, idle + 1, state%time > before)
        if (idle >= most_idle_events) run%reason = reason_mode_cycle
        if (.not. abs(state%x) <= moving%options%domain) run%reason = reason_left_domain
        if (run%reason /= 0) return
      end do
      run%motion(:speed_row, :) = samples([x_at, phi_at, v_at, w_at], :)
      run%motion(own_row, :) = 0
      if (system%control%has_own) run%motion(own_row, :) = samples(y_at, :)
      if (system%current > 0) run%motion(own_row, :) = samples(system%variables + 1, :)
    end associate
  end subroutine fly_samples

  !> Current of the motor [A].
  pure real(wp) function current_now(system, state, crank)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: value(system%sheet%tape%count)
    value = node_values(system, state, crank)
    current_now = value(system%current)
  end function current_now

  !> Sizes of the variables: angle, speed, position, velocity, current or integral.
  pure function sizes_of(moving) result(sizes)
    type(motor_motion_t), intent(in) :: moving
    real(wp) :: sizes(moving%system%variables)
    associate (system => moving%system)
      sizes = system%own_size
      sizes(phi_at) = 1
      sizes(w_at) = system%no_load_speed
      sizes(x_at) = foot_half_range(system) + system%moment/system%mass
      sizes(v_at) = sizes(x_at)*system%no_load_speed
    end associate
  end function sizes_of

  !> The state after a flight.
  pure subroutine take_flown(system, flight, state, crank)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(in) :: flight
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    integer :: turns
    state%time = flight%time
    state%x = flight%state(x_at)
    state%v = flight%state(v_at)
    turns = floor(flight%state(phi_at)/two_pi)
    crank%phi = flight%state(phi_at) - two_pi*turns
    crank%turns = crank%turns + turns
    crank%w = flight%state(w_at)
    if (system%control%has_own) crank%own(1) = flight%state(y_at)
  end subroutine take_flown

  !> Takes the impacts up to the last sample out of the events.
  pure subroutine read_impacts(log, times, run)
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: times(:)
    type(run_t), intent(inout) :: run
    logical :: is_impact(log%events)
    integer :: i, k
    if (log%events > 0) then
      is_impact = (log%event_kind(:log%events) == event_impact_upper .or. log%event_kind(:log%events) == event_impact_lower) &
                  .and. log%event_data(1, :log%events) <= times(size(times))
    end if
    run%count = count(is_impact)
    allocate (run%impact(4, run%count))
    k = 0
    do i = 1, log%events
      if (.not. is_impact(i)) cycle
      k = k + 1
      run%impact(:, k) = [log%event_data(1, i), abs(log%event_data(3:4, i)), &
                          merge(1.0_wp, -1.0_wp, log%event_kind(i) == event_impact_upper)]
    end do
  end subroutine read_impacts

  !> Derivatives of the samples of one segment by differences between its neighbours and itself.
  pure subroutine differentiate(family, start, times, base, slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(in) :: base
    real(wp), intent(inout) :: slope(:, :, :)
    logical, intent(inout) :: steady
    logical :: open(size(times))
    real(wp) :: moved(size(start)), sizes(crank_rows), step
    integer :: k, row, sense, turn
    slope = merge(0.0_wp, ieee_value(1.0_wp, ieee_quiet_nan), base%reason == 0)
    if (base%reason /= 0) return
    associate (turn_speed => family%driven%system%no_load_speed)
      sizes = [family%start_step(1), family%start_step(3), family%start_step(2), family%start_step(3)*turn_speed, &
               family%start_step(3)*family%driven%system%own_size]
    end associate
    do k = 1, crank_rows
      row = size(family%further) + k
      if (k == own_row .and. .not. family%driven%system%control%has_own) cycle
      open = .true.
      ! A speed is made larger, so that what moves slowly does not turn round.
      sense = merge(-1, 1, (k == v_row .or. k == speed_row) .and. start(k) < 0)
      do turn = 1, 2
        moved = start
        moved(k) = start(k) + sense*sizes(k)
        step = moved(k) - start(k)
        call compare(family%driven, moved, step, times, base, open, slope(row, :, :), steady)
        if (.not. any(open)) exit
        sense = -sense
      end do
    end do
    do k = 1, size(family%further)
      open = .true.
      call step_along(family%further(k), start, times, base, open, slope(k, :, :), steady)
      if (any(open)) call step_along(family%back(k), start, times, base, open, slope(k, :, :), steady)
    end do
  end subroutine differentiate

  !> The difference that a neighbouring machine makes.
  pure subroutine step_along(variant, start, times, base, open, slope, steady)
    type(variant_t), intent(in) :: variant
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(in) :: base
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: slope(:, :)
    if (.not. abs(variant%step) > 0) return
    call compare(variant%driven, start, variant%step, times, base, open, slope, steady)
  end subroutine step_along

  !> Flies a neighbour that is `step` away and fills in its differences at the samples that are still open, but for those
  !> between an impact of the base and the same impact of the neighbour. A neighbour that cannot be flown fills in none. Takes
  !> the steadiness away if the two do not meet the same stops in the same order.
  pure subroutine compare(moving, start, step, times, base, open, slope, steady)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:), step, times(:)
    type(run_t), intent(in) :: base
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: slope(:, :)
    type(run_t) :: other
    logical :: between(size(times))
    integer :: i
    call fly(moving, start, times, other)
    if (other%reason /= 0) return
    if (other%count /= base%count) then
      steady = .false.
    else if (any(abs(other%impact(4, :) - base%impact(4, :)) > 0)) then
      steady = .false.
    end if
    between = between_impacts(base%impact(1, :), other%impact(1, :), 0.0_wp, times)
    do i = 1, size(times)
      if (open(i) .and. .not. between(i)) slope(:, i) = (other%motion(:, i) - base%motion(:, i))/step
    end do
    open = open .and. between
  end subroutine compare

end module crank_segments
