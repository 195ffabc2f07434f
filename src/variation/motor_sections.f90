! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body with a motor from section to section.
submodule(motor_body) motor_sections
  use motion_state, only: event_stick, event_turning_point, log_t, mode_slip_minus, mode_slip_plus, open_log, reset_tally
  use motor_motion, only: advance_motor, start_motor
  use structure_family, only: vary_section
  implicit none

  !> Longest return, in turns without load. Speeds of starts, as shares of that without load.
  integer, parameter :: longest = 256
  real(wp), parameter :: golden = 0.6180339887498949_wp, lowest_speed = 0.3_wp, highest_speed = 1.1_wp

contains

  module procedure begin_motor
    ok = point(x_of) <= self%upper .and. point(x_of) >= self%lower
    if (ok) call start_at(self, point, section%state, section%motor)
  end procedure begin_motor

  !> A body and its crank at a section point.
  pure subroutine start_at(self, point, state, crank)
    class(motor_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(state_t), intent(out) :: state
    type(motor_state_t), intent(out) :: crank
    real(wp) :: own
    own = 0
    if (self%n == own_of) own = point(own_of)
    call start_motor(self%machine%motor, [point(x_of), point(v_of), 0.0_wp, point(speed_of), own], state, crank)
  end subroutine start_at

  module procedure go_on_with_motor
    type(tally_t) :: tally
    integer :: reason
    call self%machine%advance_to_section(section, tally, reason)
    point = point_of_crank(self, section%state, section%motor)
    ok = reason == 0
  end procedure go_on_with_motor

  module procedure fly_motor_to_section
    type(section_state_t) :: section
    type(tally_t) :: tally
    integer :: mode
    section = self%machine%start(start)
    ok = self%machine%allows(start)
    if (ok) call fly_turns(self, section%state, section%motor, 1, point, events, mode, tally, ok)
  end procedure fly_motor_to_section

  module procedure fly_motor_over_sections
    type(section_state_t) :: section
    image = point
    mode = 0
    call self%begin(point, section, ok)
    if (ok) ok = section%motor%turning /= 0
    if (ok) call fly_turns(self, section%state, section%motor, sections, image, events, mode, tally, ok)
    if (.not. allocated(events)) allocate (events(0))
  end procedure fly_motor_over_sections

  !> Flies on over so many sections.
  pure subroutine fly_turns(self, state, crank, turns, image, events, mode, tally, ok)
    class(motor_body_t), intent(in) :: self
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    integer, intent(in) :: turns
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    type(log_t) :: log
    integer :: i, reason
    logical :: passed
    allocate (events(0))
    image = point_of_crank(self, state, crank)
    mode = state%mode
    call reset_tally(tally, state, .false.)
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    do i = 1, turns
      passed = .true.
      log%events = 0
      call advance_motor(self%machine%motor, state, crank, state%time + longest*self%period, passed, tally, reason, log)
      ok = reason == 0 .and. passed .and. crank%turning == crank%passed_last
      if (.not. ok) return
      call add_events(self, log, i - 1, mode, image, events)
      call add_section(self, state, crank, events)
      image = point_of_crank(self, state, crank)
      image(angle_of) = 0
    end do
  end subroutine fly_turns

  !> The passage of the section at a state that is there.
  pure subroutine add_section(self, state, crank, events)
    class(motor_body_t), intent(in) :: self
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(event_t), allocatable, intent(inout) :: events(:)
    type(event_t) :: event
    event%guard = turns_round
    event%before = state%mode
    event%after = state%mode
    event%time = state%time
    event%departure(:self%n) = point_of_crank(self, state, crank)
    event%departure(angle_of) = 0
    event%arrival = event%departure
    event%arrival(angle_of) = sign(two_pi, crank%w)
    events = [events, event]
  end subroutine add_section

  !> The events of a log over one turn, which began at `start` in a mode after so many turns.
  pure subroutine add_events(self, log, turns, mode, start, events)
    class(motor_body_t), intent(in) :: self
    type(log_t), intent(in) :: log
    integer, intent(in) :: turns, mode
    real(wp), intent(in) :: start(:)
    type(event_t), allocatable, intent(inout) :: events(:)
    type(event_t) :: event
    real(wp) :: y(self%n), t, jump(self%n, self%n), by_time(self%n), flown(self%n)
    integer :: i, now
    y = start
    now = mode
    t = 0
    if (size(events) > 0) then
      now = events(size(events))%after
      t = events(size(events))%time
    end if
    do i = 1, log%events
      if (self%smooth_turns .and. log%event_kind(i) == event_turning_point) cycle
      event = event_t(kind=log%event_kind(i), before=now, time=log%event_data(1, i))
      event%arrival([x_of, v_of]) = log%event_data(2:3, i)
      event%arrival([angle_of, speed_of]) = log%event_driver(:, i) - [sign(two_pi, start(speed_of))*turns, 0.0_wp]
      if (self%n == own_of) then
        call self%fly(now, t, y, event%time, flown)
        event%arrival(own_of) = flown(own_of)
      end if
      call set_mode(self, event)
      call self%jump(event, event%time, event%arrival(:self%n), y, jump, by_time)
      event%departure(:self%n) = y
      now = event%after
      t = event%time
      events = [events, event]
    end do
  end subroutine add_events

  !> Side of an event and mode after it.
  pure subroutine set_mode(self, event)
    class(motor_body_t), intent(in) :: self
    type(event_t), intent(inout) :: event
    real(wp) :: margin, by_state(self%n)
    associate (y => event%arrival(:self%n))
      select case (event%kind)
      case (event_impact_upper, event_impact_lower)
        event%side = merge(1, -1, event%kind == event_impact_upper)
        event%after = merge(mode_slip_minus, mode_slip_plus, event%side > 0)
      case (event_chatter_upper, event_chatter_lower)
        event%side = merge(1, -1, event%kind == event_chatter_upper)
        event%after = merge(mode_upper_barrier, mode_lower_barrier, event%side > 0)
      case (event_stick)
        event%side = merge(-1, 1, event%before == mode_slip_minus)
        event%after = mode_stick
        if (y(x_of) >= self%upper) event%after = mode_upper_barrier
        if (y(x_of) <= self%lower) event%after = mode_lower_barrier
      case default
        ! The force decides which way it goes on.
        call release_margin(self, 1, y, margin, by_state)
        event%side = merge(1, -1, margin < self%machine%motor%system%body_level)
        event%after = merge(mode_slip_plus, mode_slip_minus, event%side > 0)
      end select
    end associate
  end subroutine set_mode

  module procedure map_of_motor
    type(event_t), allocatable :: events(:)
    integer :: mode
    by_start = 0
    if (present(by_parameter)) by_parameter = 0
    call self%fly_sections(point, sections, .false., image, events, mode, tally, ok)
    if (ok) ok = .not. any(events%kind == event_chatter_upper .or. events%kind == event_chatter_lower)
    if (ok) call vary_section(machines, self, mode, point, events, sections, image, by_start, ok, by_parameter)
  end procedure map_of_motor

  module procedure starts_of_motor
    real(wp) :: share
    integer :: i
    points = 0
    points(x_of, :) = watched(1, :)
    points(v_of, :) = watched(2, :)
    do i = 1, size(watched, 2)
      share = modulo(0.5_wp + i*golden, 1.0_wp)
      points(speed_of, i) = self%size_of(speed_of)*(lowest_speed + (highest_speed - lowest_speed)*share)
      if (modulo(i, 2) == 1 .and. abs(self%machine%own_start(1)) > 0) points(speed_of, i) = self%machine%own_start(1)
      if (self%n == own_of) points(own_of, i) = self%machine%own_start(2)
    end do
  end procedure starts_of_motor

end submodule motor_sections
