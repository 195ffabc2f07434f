! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body by expressions from section to section.
submodule(own_body) own_sections
  use motion_state, only: event_stick, event_turning_point, log_t, mode_slip_plus, mode_stick, open_log, reset_tally
  use structure_family, only: vary_section
  implicit none

  !> How far a force may be from what releases the body, in sizes, for its instant to follow from it: a force that jumps releases it
  !> at another one.
  real(wp), parameter :: at_release = 1e-6_wp

contains

  module procedure begin_own
    ok = point(x_of) <= self%upper .and. point(x_of) >= self%lower
    if (ok) section = self%machine%state_at(point)
  end procedure begin_own

  module procedure go_on_with_own
    type(tally_t) :: tally
    integer :: reason
    call self%machine%advance_to_section(section, tally, reason)
    point = coordinates_of(self, section)
    ok = reason == 0
  end procedure go_on_with_own

  pure function coordinates_of(self, section) result(point)
    class(own_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    real(wp) :: point(self%n)
    point = [section%state%x, section%state%v, section%motor%own(:self%n - v_of)]
  end function coordinates_of

  module procedure fly_own_to_section
    type(section_state_t) :: section
    type(tally_t) :: tally
    integer :: mode
    section = self%machine%start(start)
    ok = self%machine%allows(start)
    if (ok) call fly_periods(self, section, 1, point, events, mode, tally, ok)
  end procedure fly_own_to_section

  module procedure fly_own_over_sections
    type(section_state_t) :: section
    image = point
    mode = 0
    call self%begin(point, section, ok)
    if (ok) call fly_periods(self, section, sections, image, events, mode, tally, ok)
    if (.not. allocated(events)) allocate (events(0))
  end procedure fly_own_over_sections

  !> Flies on over so many sections.
  pure subroutine fly_periods(self, section, periods, image, events, mode, tally, ok)
    class(own_body_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    integer, intent(in) :: periods
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    type(log_t) :: log
    real(wp) :: start(self%n), time
    integer :: i, reason
    allocate (events(0))
    start = coordinates_of(self, section)
    time = section%state%time
    image = start
    mode = section%state%mode
    call reset_tally(tally, section%state, .false.)
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    do i = 1, periods
      call self%machine%advance_to_section(section, tally, reason, log)
      ok = reason == 0
      if (.not. ok) return
    end do
    image = coordinates_of(self, section)
    call add_events(self, log, mode, time, start, events, ok)
  end subroutine fly_periods

  !> The events of a log, which began at `start` in a mode at a time since the section. Not `ok`: the instant of one does not follow
  !> from its guard.
  pure subroutine add_events(self, log, mode, time, start, events, ok)
    class(own_body_t), intent(in) :: self
    type(log_t), intent(in) :: log
    integer, intent(in) :: mode
    real(wp), intent(in) :: time, start(:)
    type(event_t), allocatable, intent(inout) :: events(:)
    logical, intent(inout) :: ok
    type(event_t) :: event
    real(wp) :: y(self%n), t, jump(self%n, self%n), by_time(self%n), flown(self%n)
    integer :: i, now
    y = start
    now = mode
    t = time
    do i = 1, log%events
      if (self%smooth_turns .and. log%event_kind(i) == event_turning_point) cycle
      event = event_t(kind=log%event_kind(i), before=now, time=log%event_data(1, i))
      flown = y
      if (self%n > v_of) call self%fly(now, t, y, event%time, flown)
      event%arrival(:self%n) = [log%event_data(2:3, i), flown(3:)]
      call set_mode(self, event, ok)
      call self%jump(event, event%time, event%arrival(:self%n), y, jump, by_time)
      event%departure(:self%n) = y
      now = event%after
      t = event%time
      events = [events, event]
    end do
  end subroutine add_events

  !> Side of an event and mode after it.
  pure subroutine set_mode(self, event, ok)
    class(own_body_t), intent(in) :: self
    type(event_t), intent(inout) :: event
    logical, intent(inout) :: ok
    real(wp) :: margins(2), by_state(self%n), by_time
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
        call release_margin(self, 1, event%time, y, margins(1), by_state, by_time)
        call release_margin(self, -1, event%time, y, margins(2), by_state, by_time)
        event%side = merge(1, -1, margins(1) < margins(2))
        event%after = merge(mode_slip_plus, mode_slip_minus, event%side > 0)
        if (event%kind /= event_turning_point) ok = ok .and. abs(minval(margins)) <= at_release*self%force_size
      end select
    end associate
  end subroutine set_mode

  module procedure map_of_own
    type(event_t), allocatable :: events(:)
    integer :: mode
    by_start = 0
    if (present(by_parameter)) by_parameter = 0
    call self%fly_sections(point, sections, .false., image, events, mode, tally, ok)
    if (ok) ok = .not. any(events%kind == event_chatter_upper .or. events%kind == event_chatter_lower)
    if (ok) call vary_section(machines, self, mode, point, events, sections, image, by_start, ok, by_parameter)
  end procedure map_of_own

  module procedure starts_of_own
    real(wp) :: share
    integer :: i, k
    points(x_of, :) = watched(1, :)
    points(v_of, :) = watched(2, :)
    share = 2
    do i = 1, 60
      share = (1 + share)**(1/real(self%n - 1, wp))
    end do
    do i = 1, size(watched, 2)
      points(3:, i) = self%machine%starts
      if (modulo(i, 2) == 1) cycle
      do k = 3, self%n
        points(k, i) = 2*self%size_of(k)*(2*modulo(0.5_wp + i*share**(2 - k), 1.0_wp) - 1)
        if (present(spread)) points(k, i) = self%machine%starts(k - v_of) + spread(i)*(points(k, i) - self%machine%starts(k - v_of))
      end do
    end do
  end procedure starts_of_own

end submodule own_sections
