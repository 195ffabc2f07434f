! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Segments of one body: x [m], v [m/s] and crank angle [rad] are its start, x as the sensor shows it and v a sample. If the sensor
!> is late, the body was at the start `delay` before, when the crank was that much behind the angle given.
module body_segments
  use body_machine, only: body_machine_t
  use contact_law, only: barrier_positions, beyond_barrier
  use effect_law, only: observed
  use kinds, only: wp
  use lane_preparation, only: prepare_lanes
  use lane_sampling, only: can_sample, sample_in_lanes, sampled_t
  use lane_types, only: lane_flow_t
  use logged_segments, only: logged_segments_t
  use machine_type, only: section_state_t
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: event_impact_lower, event_impact_upper, event_separation, event_touch_lower, event_touch_upper, log_t, &
    state_t, tally_t
  use segment_machine, only: add_impact, flown_segment_t, impact_numbers, impact_time, not_a_number, segment_machine_t, speed_after
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: segments_of_body

  !> Parameters of the sensor: derivatives by them follow from the samples and from those by the crank angle, and need no
  !> machine.
  integer, parameter :: sensor_bias = 1, sensor_gain = 2, sensor_delay = 3
  character(len=*), parameter, public :: sensor_paths(3) = [character(len=25) :: &
    'effect.sensor_bias.bias', 'effect.sensor_gain.gain', 'effect.sensor_delay.delay']

  !> Number of the crank angle in a start.
  integer, parameter :: crank = 3

  type, extends(logged_segments_t), public :: body_segments_t
    type(motion_t) :: moving
  contains
    procedure :: obstacle
    procedure :: set_steps
    procedure :: allows
    procedure :: begin
    procedure :: move
    procedure :: take
    procedure :: fly_in_lanes
    procedure :: never_meets
    procedure :: show
  end type body_segments_t

contains

  pure function segments_of_body(machine) result(segments)
    type(body_machine_t), intent(in) :: machine
    type(body_segments_t) :: segments
    segments%start_numbers = 3
    segments%sample_numbers = 2
    segments%moving = machine%body
    ! Samples within the Stribeck layer need the adaptive flight anyhow.
    segments%moving%transit%available = .false.
  end function segments_of_body

  pure function obstacle(self) result(text)
    class(body_segments_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
  end function obstacle

  pure subroutine set_steps(self, unit, steps, speeds)
    class(body_segments_t), intent(in) :: self
    real(wp), intent(in) :: unit(3)
    real(wp), intent(out) :: steps(:)
    logical, intent(out) :: speeds(:)
    steps = unit
    speeds = [.false., .true., .false.]
  end subroutine set_steps

  pure logical function allows(self, start) result(allowed)
    class(body_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    allowed = all(ieee_is_finite(start))
    if (allowed) allowed = .not. beyond_barrier(self%moving%machine%contact, start(1))
  end function allows

  pure function state_at(moving, start) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    type(state_t) :: state
    associate (machine => moving%machine)
      state = start_state(moving, start(1), start(2), start(crank) - machine%drive_frequency*machine%sensor%delay)
    end associate
  end function state_at

  pure subroutine begin(self, start, section, origin, tally, reason)
    class(body_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    type(section_state_t), intent(inout) :: section
    real(wp), intent(out) :: origin
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    section%state = state_at(self%moving, start)
    origin = section%state%time
    tally%x_max = start(1)
    tally%x_min = start(1)
    reason = 0
  end subroutine begin

  pure subroutine move(self, section, tally, reason, log, until)
    class(body_segments_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout) :: log
    real(wp), intent(in), optional :: until
    if (present(until)) then
      call advance(self%moving, section%state, until, tally, reason, log)
    else
      call advance_period(self%moving, section%state, tally, reason, log)
    end if
  end subroutine move

  pure subroutine take(self, section, tally, log, flight)
    class(body_segments_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    type(log_t), intent(in) :: log
    type(flown_segment_t), intent(inout) :: flight
    real(wp) :: side
    integer :: i, done
    flight%grazing_margin = tally%grazing_margin
    flight%x_max = tally%x_max
    flight%x_min = tally%x_min
    done = log%samples
    if (done > 0) flight%motion(:, :done) = log%sample_data(2:3, :done)
    flight%motion(1, done + 1:) = section%state%x
    flight%motion(2, done + 1:) = section%state%v
    do i = 1, log%events
      select case (log%event_kind(i))
      case (event_impact_upper, event_touch_upper)
        side = 1
      case (event_impact_lower, event_touch_lower)
        side = -1
      case (event_separation)
        if (flight%count > 0) flight%impact(speed_after, flight%count) = abs(log%event_data(3, i))
        cycle
      case default
        cycle
      end select
      associate (event => log%event_data(:, i))
        call add_impact(flight, [event(1) - flight%origin, 1.0_wp, abs(event(3)), abs(event(4)), side])
        if (any(log%event_kind(i) == [event_touch_upper, event_touch_lower])) then
          flight%impact(speed_after, flight%count) = not_a_number()
        end if
      end associate
    end do
  end subroutine take

  pure subroutine fly_in_lanes(self, start, first, times, asked, flights)
    class(body_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(inout) :: asked(:)
    type(flown_segment_t), intent(inout) :: flights(:)
    type(lane_flow_t) :: flow
    type(sampled_t), allocatable :: sampled(:)
    type(state_t), allocatable :: states(:)
    integer, allocatable :: which(:), offset(:)
    real(wp), allocatable :: instants(:)
    integer :: i, k
    if (.not. any(asked)) return
    flow%width = self%moving%options%lane_width
    flow%gpu = self%moving%options%gpu
    if (flow%width > 0) call prepare_lanes(self%moving, flow)
    asked = asked .and. can_sample(flow)
    do i = 1, size(asked)
      if (asked(i)) asked(i) = self%allows(start(:, i))
    end do
    which = pack([(i, i=1, size(asked))], asked)
    if (size(which) == 0) return
    allocate (states(size(which)), sampled(size(which)), offset(size(which) + 1))
    offset(1) = 0
    do k = 1, size(which)
      states(k) = state_at(self%moving, start(:, which(k)))
      offset(k + 1) = offset(k) + first(which(k) + 1) - first(which(k))
    end do
    allocate (instants(offset(size(which) + 1)))
    do k = 1, size(which)
      instants(offset(k) + 1:offset(k + 1)) = times(first(which(k)) + 1:first(which(k) + 1))
    end do
    call sample_in_lanes(flow, states, offset, instants, sampled)
    do k = 1, size(which)
      asked(which(k)) = sampled(k)%flown
      if (sampled(k)%flown) flights(which(k)) = flight_from(self%moving, states(k), sampled(k))
    end do
  end subroutine fly_in_lanes

  !> A flight in a lane as segments have it.
  pure function flight_from(moving, state, sampled) result(flight)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    type(sampled_t), intent(in) :: sampled
    type(flown_segment_t) :: flight
    real(wp) :: barriers(2)
    flight%origin = state%time
    flight%count = sampled%impacts
    allocate (flight%impact(impact_numbers, flight%count), source=1.0_wp)
    flight%impact([impact_time, speed_after - 1, speed_after, impact_numbers], :) = sampled%impact(:, :flight%count)
    flight%impact(impact_time, :) = flight%impact(impact_time, :) - state%time
    flight%motion = reshape([sampled%x, sampled%v], [2, size(sampled%x)], order=[2, 1])
    flight%grazing_margin = sampled%grazing_margin
    flight%x_max = maxval([state%x, sampled%x])
    flight%x_min = minval([state%x, sampled%x])
    ! Between samples a body turns round no nearer to a barrier than that.
    barriers = barrier_positions(moving%machine%contact)
    associate (margin => sampled%grazing_margin)
      if (barriers(1) < huge(margin)) flight%x_max = max(flight%x_max, barriers(1) - margin)
      if (barriers(2) > -huge(margin)) flight%x_min = min(flight%x_min, barriers(2) + margin)
    end associate
  end function flight_from

  pure logical function never_meets(self, other, flight)
    class(body_segments_t), intent(in) :: self
    class(segment_machine_t), intent(in) :: other
    type(flown_segment_t), intent(in) :: flight
    real(wp) :: here(2), there(2)
    never_meets = .false.
    select type (other)
    type is (body_segments_t)
      here = barrier_positions(self%moving%machine%contact)
      there = barrier_positions(other%moving%machine%contact)
      never_meets = flight%x_max < min(here(1), there(1)) .and. flight%x_min > max(here(2), there(2))
    end select
  end function never_meets

  !> A delay is an angle by which the crank was behind.
  pure subroutine show(self, flight, motion, of_sensor, slope)
    class(body_segments_t), intent(in) :: self
    type(flown_segment_t), intent(in) :: flight
    real(wp), intent(out) :: motion(:, :)
    real(wp), intent(in), optional :: of_sensor(:, :)
    real(wp), intent(inout), optional :: slope(:, :, :)
    real(wp) :: behind
    integer :: row, angle
    associate (sensor => self%moving%machine%sensor)
      motion(1, :) = observed(sensor, flight%motion(1, :))
      motion(2, :) = flight%motion(2, :)
      if (.not. present(slope) .or. .not. present(of_sensor)) return
      if (abs(sensor%gain) > 0) slope(:, 1, :) = (1 + sensor%gain)*slope(:, 1, :)
    end associate
    angle = size(of_sensor, 2) + crank
    do row = 1, size(of_sensor, 2)
      associate (along => of_sensor(:, row))
        if (.not. any(abs(along) > 0)) cycle
        behind = along(sensor_delay)*self%moving%machine%drive_frequency
        slope(row, 1, :) = slope(row, 1, :) + along(sensor_bias) + along(sensor_gain)*flight%motion(1, :) &
                           - behind*slope(angle, 1, :)
        slope(row, 2, :) = slope(row, 2, :) - behind*slope(angle, 2, :)
      end associate
    end do
  end subroutine show

end module body_segments
