! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body whose equations are on a tape, as a hybrid machine: what is common to bodies by expressions and bodies with a motor.
!> Coordinate 1 is the position of the body; its velocity is the first after the positions. Extensions know the flights, the force
!> that releases the body, the impact law, and where their other coordinates are at an event.
module hybrid_body
  use hybrid_machine, only: event_t, hybrid_t, neighbourhood_t
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_stick, event_turning_point, log_t, mode_lower_barrier, mode_slip_minus, &
    mode_slip_plus, mode_stick, mode_upper_barrier, open_log, reset_tally, tally_t
  use motor_rest, only: slips
  use structure_family, only: vary_section
  implicit none
  private

  public :: event_of_section, guard_of_body, jump_of_body, no_jump, rests_on_barrier

  !> How far a force may be from what releases the body, in sizes, for its instant to follow from it: a force that jumps releases it
  !> at another one.
  real(wp), parameter :: at_release = 1e-6_wp

  type, abstract, extends(hybrid_t), public :: hybrid_body_t
  contains
    procedure :: rests => body_rests
    procedure :: guard => guard_of_body
    procedure :: jump => jump_of_body
    procedure :: begin => begin_body
    procedure :: go_on => go_on_with_body
    procedure :: fly_to_section => fly_body_to_section
    procedure :: fly_sections => fly_body_over_sections
    procedure :: map => map_of_body
    procedure :: at_rest
    procedure :: rests_freely
    procedure :: section_event => event_of_section
    procedure(start_interface), deferred :: start
    procedure(state_interface), deferred :: state_at
    procedure(point_interface), deferred :: point_of
    procedure(margin_interface), deferred :: release_margin
    procedure(impact_interface), deferred :: apply_impact
    procedure(advance_interface), deferred :: advance
    procedure(arrival_interface), deferred :: set_arrival
  end type hybrid_body_t

  abstract interface
    !> The state at a start of the machine. `ok` is false for one beyond a stop.
    pure subroutine start_interface(self, values, section, ok)
      import :: section_state_t, hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      real(wp), intent(in) :: values(:)
      type(section_state_t), intent(out) :: section
      logical, intent(out) :: ok
    end subroutine start_interface

    !> The state at a point of the section.
    pure type(section_state_t) function state_interface(self, point) result(section)
      import :: section_state_t, hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      real(wp), intent(in) :: point(:)
    end function state_interface

    !> The coordinates of a state.
    pure function point_interface(self, section) result(point)
      import :: section_state_t, hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      type(section_state_t), intent(in) :: section
      real(wp) :: point(self%n)
    end function point_interface

    !> By how much the force on a body at rest is less than what moves it to a `side` [N], and its derivatives.
    pure subroutine margin_interface(self, side, t, y, margin, by_state, by_time)
      import :: hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      integer, intent(in) :: side
      real(wp), intent(in) :: t, y(:)
      real(wp), intent(out) :: margin, by_state(:), by_time
    end subroutine margin_interface

    !> The velocities after an impact, or after a chatter that ends; the derivatives are those of the state before.
    pure subroutine impact_interface(self, ends, t, y, after, by_state, by_time)
      import :: hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      logical, intent(in) :: ends
      real(wp), intent(in) :: t, y(:)
      real(wp), intent(inout) :: after(:), by_state(:, :), by_time(:)
    end subroutine impact_interface

    !> Takes a state on to the next section. `reason` (module `status`) is not 0 if it did not come there.
    pure subroutine advance_interface(self, section, tally, reason, log)
      import :: log_t, section_state_t, tally_t, hybrid_body_t
      class(hybrid_body_t), intent(in) :: self
      type(section_state_t), intent(inout) :: section
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
      type(log_t), intent(inout), optional :: log
    end subroutine advance_interface

    !> Where the motion arrives at event number `i` of a log, which was opened at a point `start` after so many sections; `last` is
    !> the event before.
    pure subroutine arrival_interface(self, log, i, sections, start, last, event)
      import :: event_t, log_t, hybrid_body_t, wp
      class(hybrid_body_t), intent(in) :: self
      type(log_t), intent(in) :: log
      integer, intent(in) :: i, sections
      real(wp), intent(in) :: start(:)
      type(event_t), intent(in) :: last
      type(event_t), intent(inout) :: event
    end subroutine arrival_interface
  end interface

contains

  pure logical function body_rests(self, mode)
    class(hybrid_body_t), intent(in) :: self
    integer, intent(in) :: mode
    body_rests = self%n > 0 .and. .not. slips(mode)
  end function body_rests

  !> Whether an event at a position is that of a body that nothing holds, which rests as long as the forces on it are zero: its
  !> flight goes on through the rest.
  pure logical function rests_freely(self, kind, x)
    class(hybrid_body_t), intent(in) :: self
    integer, intent(in) :: kind
    real(wp), intent(in) :: x
    rests_freely = kind == event_release .or. (kind == event_stick .and. x < self%upper .and. x > self%lower)
    rests_freely = rests_freely .and. .not. self%rests(mode_stick)
  end function rests_freely

  pure logical function rests_on_barrier(mode)
    integer, intent(in) :: mode
    rests_on_barrier = mode == mode_upper_barrier .or. mode == mode_lower_barrier
  end function rests_on_barrier

  !> A state, at rest where the mode is one of rest.
  pure function at_rest(self, mode, y) result(resting)
    class(hybrid_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp) :: resting(size(y))
    resting = y
    if (.not. slips(mode)) resting(self%positions + 1) = 0
    if (mode == mode_upper_barrier) resting(1) = self%upper
    if (mode == mode_lower_barrier) resting(1) = self%lower
  end function at_rest

  pure subroutine guard_of_body(self, event, t, y, value, by_state, by_time)
    class(hybrid_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: value, by_state(:), by_time
    by_state = 0
    by_time = 0
    select case (event%kind)
    case (event_impact_upper, event_chatter_upper)
      value = y(1) - self%upper
      by_state(1) = 1
    case (event_impact_lower, event_chatter_lower)
      value = y(1) - self%lower
      by_state(1) = 1
    case (event_release, event_barrier_release)
      call self%release_margin(event%side, t, y, value, by_state, by_time)
    case default
      value = y(self%positions + 1)
      by_state(self%positions + 1) = 1
    end select
  end subroutine guard_of_body

  pure subroutine jump_of_body(self, event, t, y, after, by_state, by_time)
    class(hybrid_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    call no_jump(y, after, by_state, by_time)
    associate (v_of => self%positions + 1)
      select case (event%kind)
      case (event_impact_upper, event_impact_lower)
        call self%apply_impact(.false., t, y, after, by_state, by_time)
        ! Without rebound nothing is left of the position but the instant.
        if (.not. abs(after(v_of)) > 0) by_state(:, 1) = 0
        if (.not. abs(after(v_of)) > 0) after(1) = merge(self%upper, self%lower, event%kind == event_impact_upper)
      case (event_chatter_upper, event_chatter_lower)
        call self%apply_impact(.true., t, y, after, by_state, by_time)
      case default
        after(v_of) = 0
        by_state(v_of, v_of) = 0
      end select
    end associate
    if (rests_on_barrier(event%after)) then
      by_state(1, :) = 0
      by_state(:, 1) = 0
      after(1) = merge(self%upper, self%lower, event%after == mode_upper_barrier)
    end if
  end subroutine jump_of_body

  !> A state that goes on as it is, and its derivatives.
  pure subroutine no_jump(y, after, by_state, by_time)
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    integer :: k
    after = y
    by_time = 0
    by_state = 0
    do k = 1, size(y)
      by_state(k, k) = 1
    end do
  end subroutine no_jump

  pure subroutine begin_body(self, point, section, ok)
    class(hybrid_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
    ok = point(1) <= self%upper .and. point(1) >= self%lower
    if (ok) section = self%state_at(point)
  end subroutine begin_body

  pure subroutine go_on_with_body(self, section, point, ok)
    class(hybrid_body_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    real(wp), intent(out) :: point(:)
    logical, intent(out) :: ok
    type(tally_t) :: tally
    integer :: reason
    call self%advance(section, tally, reason)
    ok = reason == 0
    point = self%point_of(section)
  end subroutine go_on_with_body

  pure subroutine fly_body_to_section(self, start, point, events, ok)
    class(hybrid_body_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    real(wp), intent(out) :: point(:)
    type(event_t), allocatable, intent(out) :: events(:)
    logical, intent(out) :: ok
    type(section_state_t) :: section
    type(tally_t) :: tally
    call self%start(start, section, ok)
    if (ok) call fly_on(self, section, 1, point, events, tally, ok)
  end subroutine fly_body_to_section

  pure subroutine fly_body_over_sections(self, point, sections, collapsed, image, events, mode, tally, ok)
    class(hybrid_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    logical, intent(in) :: collapsed
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    type(section_state_t) :: section
    image = point
    mode = 0
    call self%begin(point, section, ok)
    if (ok .and. self%crank_section) ok = section%motor%turning /= 0
    if (ok) mode = section%state%mode
    if (ok) call fly_on(self, section, sections, image, events, tally, ok)
    if (.not. allocated(events)) allocate (events(0))
  end subroutine fly_body_over_sections

  !> Flies on over so many sections.
  pure subroutine fly_on(self, section, sections, image, events, tally, ok)
    class(hybrid_body_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    type(log_t) :: log
    type(event_t) :: last
    integer :: i, reason
    logical :: certain
    allocate (events(0))
    certain = .true.
    image = self%point_of(section)
    last%after = section%state%mode
    last%time = section%state%time
    last%departure(:self%n) = image
    call reset_tally(tally, section%state, .false.)
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    do i = 1, sections
      log%events = 0
      call self%advance(section, tally, reason, log)
      ok = reason == 0
      if (.not. ok) return
      call add_events(self, log, i - 1, image, last, events, certain)
      image = self%point_of(section)
      if (self%has_clock) cycle
      last = self%section_event(section)
      events = [events, last]
      image = last%departure(:self%n)
    end do
    ok = certain
  end subroutine fly_on

  !> The events of a log, which was opened at a point `start` after so many sections; `last` is the event before them. Not
  !> `certain`: the instant of one does not follow from its guard.
  pure subroutine add_events(self, log, sections, start, last, events, certain)
    class(hybrid_body_t), intent(in) :: self
    type(log_t), intent(in) :: log
    integer, intent(in) :: sections
    real(wp), intent(in) :: start(:)
    type(event_t), intent(inout) :: last
    type(event_t), allocatable, intent(inout) :: events(:)
    logical, intent(inout) :: certain
    type(event_t) :: event
    real(wp) :: y(self%n), jump(self%n, self%n), by_time(self%n)
    integer :: i
    do i = 1, log%events
      if (self%smooth_turns .and. log%event_kind(i) == event_turning_point) cycle
      if (self%rests_freely(log%event_kind(i), log%event_data(2, i))) cycle
      event = event_t(kind=log%event_kind(i), before=last%after, time=log%event_data(1, i))
      call self%set_arrival(log, i, sections, start, last, event)
      call set_mode(self, event, certain)
      call self%jump(event, event%time, event%arrival(:self%n), y, jump, by_time)
      event%departure(:self%n) = y
      events = [events, event]
      last = event
    end do
  end subroutine add_events

  !> Side of an event and mode after it.
  pure subroutine set_mode(self, event, certain)
    class(hybrid_body_t), intent(in) :: self
    type(event_t), intent(inout) :: event
    logical, intent(inout) :: certain
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
        if (y(1) >= self%upper) event%after = mode_upper_barrier
        if (y(1) <= self%lower) event%after = mode_lower_barrier
      case default
        ! The force decides which way it goes on.
        call self%release_margin(1, event%time, y, margins(1), by_state, by_time)
        call self%release_margin(-1, event%time, y, margins(2), by_state, by_time)
        event%side = merge(1, -1, margins(1) < margins(2))
        event%after = merge(mode_slip_plus, mode_slip_minus, event%side > 0)
        if (event%kind /= event_turning_point) certain = certain .and. abs(minval(margins)) <= at_release*self%force_size
      end select
    end associate
  end subroutine set_mode

  !> The passage of the section, where that is an event, at a state that is there.
  pure type(event_t) function event_of_section(self, section) result(event)
    class(hybrid_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    event%before = section%state%mode
    event%after = section%state%mode
    event%time = section%state%time
    event%departure(:self%n) = self%point_of(section)
    event%arrival = event%departure
  end function event_of_section

  pure subroutine map_of_body(self, machines, point, sections, image, by_start, tally, ok, by_parameter)
    class(hybrid_body_t), intent(in) :: self
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:), by_start(:, :)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(:)
    type(event_t), allocatable :: events(:)
    integer :: mode
    by_start = 0
    if (present(by_parameter)) by_parameter = 0
    call self%fly_sections(point, sections, .false., image, events, mode, tally, ok)
    if (ok) ok = .not. any(events%kind == event_chatter_upper .or. events%kind == event_chatter_lower)
    if (ok) call vary_section(machines, self, mode, point, events, sections, image, by_start, ok, by_parameter)
  end subroutine map_of_body

end module hybrid_body
