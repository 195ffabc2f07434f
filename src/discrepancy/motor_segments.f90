! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Segments of a body with a motor. The numbers of a start and of a sample are position [m], crank angle [rad], velocity [m/s],
!> crank speed [rad/s], and current [A] or integral of a speed control [rad]. Flights are by `motor_march`.
module motor_segments
  use constants, only: two_pi
  use contact_law, only: beyond_barrier
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: event_impact_lower, event_impact_upper, log_t, state_t, tally_t
  use motor_choices, only: has_ramp
  use motor_equations, only: foot_half_range
  use motor_machine, only: motor_machine_t
  use motor_march, only: march_mode
  use motor_modes, only: begin_mode
  use motor_motion, only: do_events, most_idle_events, motor_motion_t, start_motor
  use motor_now, only: node_values
  use motor_rest, only: equation_mode, slips
  use motor_state, only: motor_state_t
  use motor_system, only: motor_system_t, phi_at, v_at, w_at, x_at, y_at
  use segment_machine, only: add_impact, begin_flight, end_flight, flown_segment_t, segment_machine_t
  use series_flight, only: flight_t
  use status, only: reason_event_budget, reason_left_domain, reason_mode_cycle, reason_step_failed
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: segments_of_motor

  integer, parameter :: numbers = 5
  integer, parameter :: x_row = 1, angle_row = 2, v_row = 3, speed_row = 4, own_row = 5

  type, extends(segment_machine_t), public :: motor_segments_t
    type(motor_motion_t) :: driven
    !> The voltage or the speed without load rises.
    logical :: ramps = .false.
  contains
    procedure :: obstacle
    procedure :: set_steps
    procedure :: allows
    procedure :: fly
  end type motor_segments_t

contains

  pure function segments_of_motor(machine) result(segments)
    type(motor_machine_t), intent(in) :: machine
    type(motor_segments_t) :: segments
    segments%start_numbers = numbers
    segments%sample_numbers = numbers
    segments%driven = machine%motor
    segments%ramps = has_ramp(machine%laws)
  end function segments_of_motor

  pure function obstacle(self) result(text)
    class(motor_segments_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (self%ramps) text = 'motor.ramp_time: found a ramp, whose instant no start of a segment states'
  end function obstacle

  pure subroutine set_steps(self, unit, steps, speeds)
    class(motor_segments_t), intent(in) :: self
    real(wp), intent(in) :: unit(3)
    real(wp), intent(out) :: steps(:)
    logical, intent(out) :: speeds(:)
    associate (system => self%driven%system)
      steps = [unit(1), unit(3), unit(2), unit(3)*system%no_load_speed, unit(3)*system%own_size]
      if (.not. system%control%has_own) steps(own_row) = 0
    end associate
    speeds = .false.
    speeds([v_row, speed_row]) = .true.
  end subroutine set_steps

  !> The motor's own state need not be given where it may follow the speed: a current.
  pure logical function allows(self, start) result(allowed)
    class(motor_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    associate (system => self%driven%system)
      allowed = all(ieee_is_finite(start(:own_row - 1))) .and. &
                (ieee_is_finite(start(own_row)) .or. system%current > 0 .or. .not. system%control%has_own)
      if (allowed) allowed = .not. beyond_barrier(system%contact, start(x_row))
    end associate
  end function allows

  pure subroutine fly(self, start, times, log, flight)
    class(motor_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:), times(:)
    type(log_t), intent(inout) :: log
    type(flown_segment_t), intent(out) :: flight
    type(state_t) :: state
    type(motor_state_t) :: crank
    real(wp) :: own
    call begin_flight(self, size(times), log, flight)
    if (self%allows(start)) then
      flight%reason = 0
      own = start(own_row)
      if (.not. ieee_is_finite(own)) own = current_that_follows(self%driven, start)
      call start_motor(self%driven, [start([x_row, v_row, angle_row, speed_row]), own], state, crank)
      call fly_samples(self%driven, start(angle_row) - crank%phi, times, state, crank, log, flight)
    end if
    call read_impacts(log, times, flight)
    call end_flight(flight)
  end subroutine fly

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
  pure subroutine fly_samples(moving, turned, times, state, crank, log, flown)
    type(motor_motion_t), intent(in) :: moving
    real(wp), intent(in) :: turned, times(:)
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    type(log_t), intent(inout) :: log
    type(flown_segment_t), intent(inout) :: flown
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
        flown%reason = merge(reason_event_budget, 0, tally%events > moving%options%event_budget)
        if (flown%reason /= 0) return
        before = state%time
        first = next
        call begin_mode(system, state, crank, .false., 0, flight, fault)
        flown%reason = merge(reason_step_failed, 0, fault /= 0)
        if (flown%reason /= 0) return
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
        if (failed) flown%reason = reason_step_failed
        if (failed) return
        samples(phi_at, first:next - 1) = samples(phi_at, first:next - 1) + turned + two_pi*crank%turns
        call take_flown(system, flight, state, crank)
        call do_events(moving, flight%crossed, state, crank, passed, tally, log)
        idle = merge(0, idle + 1, state%time > before)
        if (idle >= most_idle_events) flown%reason = reason_mode_cycle
        if (.not. abs(state%x) <= moving%options%domain) flown%reason = reason_left_domain
        if (flown%reason /= 0) return
      end do
      flown%motion(:speed_row, :) = samples([x_at, phi_at, v_at, w_at], :)
      flown%motion(own_row, :) = 0
      if (system%control%has_own) flown%motion(own_row, :) = samples(y_at, :)
      if (system%current > 0) flown%motion(own_row, :) = samples(system%variables + 1, :)
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
  pure subroutine read_impacts(log, times, flight)
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: times(:)
    type(flown_segment_t), intent(inout) :: flight
    integer :: i
    do i = 1, log%events
      if (log%event_kind(i) /= event_impact_upper .and. log%event_kind(i) /= event_impact_lower) cycle
      associate (event => log%event_data(:, i))
        if (event(1) > times(size(times))) return
        call add_impact(flight, [event(1), 1.0_wp, abs(event(3:4)), &
                                 merge(1.0_wp, -1.0_wp, log%event_kind(i) == event_impact_upper)])
      end associate
    end do
  end subroutine read_impacts

end module motor_segments
