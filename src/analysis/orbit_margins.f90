! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How far a periodic orbit is from having another sequence of events: margins that are positive as long as the motion really
!> has its events and no others, and pass through zero where it grazes a barrier, begins or ends to stick, or is released no more.
module orbit_margins
  use body_flight, only: pressed_side
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, event_turning_point, &
    mode_stick
  use one_body, only: direction_in, rests_on_barrier, slips_in
  use periodic_orbit, only: closing_time, orbit_t
  use secant_bracket, only: bracket_t, narrow, next_trial
  implicit none
  private

  public :: margins_of, is_impact, is_between, same_meaning

  !> What a margin is of: the speed of an impact or of a touch; the distance to a barrier that is missed; the excess of the
  !> force at a turning point over what would hold the body; the reserve of friction at the beginning of a stick; the rate at
  !> which the force reaches break-away; the speed in a slip; the time between two events; the reserve of friction while a joint
  !> sticks; the force while a contact is closed.
  integer, parameter, public :: of_impact = 1, of_gap = 2, of_turning = 3, of_stick = 4, of_release = 5, of_slip = 6, &
    of_order = 7, of_hold = 8, of_press = 9
  !> Looks along a flight, per period of the section.
  integer, parameter :: looks = 96
  !> After a rebound slower than this, in natural sizes, so many looks come before the first, each at half the time of the next.
  real(wp), parameter :: slow_rebound = 1e-2_wp
  integer, parameter :: early_looks = 14
  integer, parameter :: most_secants = 60

  type, public :: margin_t
    real(wp) :: value = huge(1.0_wp)
    integer :: kind = 0
    !> Which event, or after which one; the side of a gap, or the direction of a slip.
    integer :: event = 0, side = 0
    !> Instant [s].
    real(wp) :: time = 0
    !> Of a structure: the joint, and its guard.
    integer :: joint = 0, guard = 0
  end type margin_t

  !> The margins of an orbit: one per event and kind, then the smallest gaps above and below and the slowest slip. Extremes of x.
  type, public :: margins_t
    type(margin_t), allocatable :: list(:)
    real(wp) :: x_max = -huge(1.0_wp), x_min = huge(1.0_wp)
  end type margins_t

contains

  pure elemental logical function is_impact(kind)
    integer, intent(in) :: kind
    is_impact = kind == event_impact_upper .or. kind == event_impact_lower
  end function is_impact

  !> Whether a margin is of what does not happen, within a flight.
  pure elemental logical function is_between(margin)
    type(margin_t), intent(in) :: margin
    is_between = any(margin%kind == [of_gap, of_slip, of_hold, of_press])
  end function is_between

  !> Whether a margin of one orbit means what that of another means.
  pure logical function same_meaning(one, other) result(same)
    type(margin_t), intent(in) :: one, other
    same = one%kind == other%kind .and. one%joint == other%joint .and. one%guard == other%guard
    if (any(one%kind == [of_gap, of_hold])) same = same .and. one%side == other%side
    if (.not. is_between(one)) same = same .and. one%event == other%event
  end function same_meaning

  !> The margins of an orbit whose events have their machine%n; all in natural units.
  pure function margins_of(machine, orbit) result(margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(margins_t) :: margins
    type(margin_t) :: gaps(-1:1), holds(-1:1), slowest
    real(wp) :: y(machine%n), t, until
    integer :: k, m, mode
    m = size(orbit%events)
    allocate (margins%list(0))
    gaps = margin_t(kind=of_gap)
    gaps%side = [-1, 0, 1]
    holds = margin_t(kind=of_hold)
    holds%side = gaps%side
    slowest = margin_t(kind=of_slip)
    y = orbit%y
    t = 0
    mode = orbit%mode
    do k = 0, m
      if (k > 0) then
        associate (event => orbit%events(k))
          call add_event(machine, orbit, k, margins%list)
          if (event%kind == event_turning_point .and. pressed_side(event%before) /= -event%side) then
            call note_gap(machine, event%arrival(1), k, -event%side, event%time, .true., gaps)
          end if
          y = event%departure(:machine%n)
          t = event%time
          mode = event%after
        end associate
      end if
      margins%x_max = max(margins%x_max, y(1))
      margins%x_min = min(margins%x_min, y(1))
      until = closing_time(machine, orbit)
      if (k < m) until = orbit%events(k + 1)%time
      if (.not. until > t) cycle
      if (slips_in(mode)) call look_along(machine, orbit, mode, t, y, until, k, gaps, slowest, margins)
      ! A body that rests for ever has no other motion near by.
      if (mode == mode_stick .and. m > 0) call look_while_stuck(machine, t, y, until, k, holds)
    end do
    margins%list = [margins%list, gaps(-1), gaps(1), slowest, holds(-1), holds(1)]
  end function margins_of

  !> The margins of the event `k`.
  pure subroutine add_event(machine, orbit, k, list)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(margin_t), allocatable, intent(inout) :: list(:)
    type(margin_t) :: margin
    type(event_t) :: probe
    real(wp) :: value, other, rate, by_state(machine%n)
    associate (event => orbit%events(k), size_of => machine%size_of, force => machine%force_size, speed => machine%positions + 1)
      margin = margin_t(event=k, side=event%side, time=event%time)
      probe = event
      probe%kind = event_release
      select case (event%kind)
      case (event_impact_upper, event_impact_lower, event_touch_upper, event_touch_lower, event_chatter_upper, event_chatter_lower)
        margin%kind = of_impact
        margin%value = event%side*event%arrival(speed)/size_of(speed)
      case (event_separation)
        margin%kind = of_impact
        margin%value = -event%side*event%arrival(speed)/size_of(speed)
      case (event_turning_point)
        margin%kind = of_turning
        call machine%guard(probe, event%time, event%arrival(:machine%n), value, by_state, rate)
        margin%value = -value/force
      case (event_stick)
        margin%kind = of_stick
        if (.not. rests_on_barrier(event%after)) then
          call machine%guard(probe, event%time, event%arrival(:machine%n), value, by_state, rate)
          probe%side = -probe%side
          call machine%guard(probe, event%time, event%arrival(:machine%n), other, by_state, rate)
          margin%value = min(value, other)/force
        end if
      case (event_release, event_barrier_release)
        margin%kind = of_release
        call machine%guard(probe, event%time, event%arrival(:machine%n), value, by_state, rate)
        rate = rate + sum(by_state*machine%slope(event%before, event%time, event%arrival(:machine%n)))
        margin%value = -rate*size_of(1)/size_of(speed)/force
      end select
      if (margin%kind > 0) list = [list, margin]
      if (is_dead_impact(machine, event)) list = [list, rest_or_return(machine, event, k)]
      ! The section closes the orbit of a machine without a clock: it is not part of the order.
      if (k == 1 .or. (.not. machine%has_clock .and. k == size(orbit%events))) return
      margin = margin_t(event=k, side=event%side, time=event%time, kind=of_order, &
                        value=(event%time - orbit%events(k - 1)%time)/machine%period)
      list = [list, margin]
    end associate
  end subroutine add_event

  !> Whether an event is an impact without rebound.
  pure logical function is_dead_impact(machine, event) result(dead)
    class(hybrid_t), intent(in) :: machine
    type(event_t), intent(in) :: event
    real(wp) :: after(machine%n), by_state(machine%n, machine%n), by_time(machine%n)
    dead = is_impact(event%kind)
    if (.not. dead) return
    call machine%jump(event, event%time, event%arrival(:machine%n), after, by_state, by_time)
    associate (own => [1, machine%positions + 1])
      dead = .not. any(abs(by_state(own, own)) > 0)
    end associate
  end function is_dead_impact

  !> After the impact `k` without rebound: by how much the force is more than what keeps the body at the barrier where it goes
  !> back, or less where it stays.
  pure type(margin_t) function rest_or_return(machine, event, k) result(margin)
    class(hybrid_t), intent(in) :: machine
    type(event_t), intent(in) :: event
    integer, intent(in) :: k
    type(event_t) :: probe
    real(wp) :: value, by_state(machine%n), rate
    probe = event
    probe%kind = event_barrier_release
    probe%side = -event%side
    call machine%guard(probe, event%time, event%departure(:machine%n), value, by_state, rate)
    margin = margin_t(event=k, side=event%side, time=event%time, kind=merge(of_stick, of_turning, rests_on_barrier(event%after)))
    margin%value = value/machine%force_size
    if (margin%kind == of_turning) margin%value = -margin%value
  end function rest_or_return

  !> Where the velocity passes zero within a flight the body turns short of a barrier; where its size has a least value, a slip
  !> in which friction acts may stop.
  pure subroutine look_along(machine, orbit, mode, from, start, until, k, gaps, slowest, margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: mode, k
    real(wp), intent(in) :: from, start(machine%n), until
    type(margin_t), intent(inout) :: gaps(-1:1), slowest
    type(margins_t), intent(inout) :: margins
    real(wp) :: y(machine%n), a, last(machine%n), last_a, t, last_t, slope(machine%n)
    integer :: i, count, early, direction, speed
    logical :: smooth
    speed = machine%positions + 1
    smooth = machine%smooth_turns
    direction = direction_in(mode)
    count = max(6, ceiling(looks*(until - from)/machine%period))
    last = start
    last_t = from
    slope = machine%slope(mode, from, start)
    last_a = slope(speed)
    early = 0
    if (k > 0) then
      ! A released body gathers speed from zero, whatever the rounding of its acceleration.
      if (orbit%events(k)%kind == event_release) last_a = 0
      ! One that hardly rebounds may be back before the first look.
      if (is_impact(orbit%events(k)%kind) .and. abs(start(speed)) < slow_rebound*machine%size_of(speed)) early = early_looks
    end if
    do i = 1 - early, count
      t = from + (until - from)*merge(2.0_wp**(i - 1), real(i, wp), i < 1)/count
      call machine%fly(mode, last_t, last, t, y)
      slope = machine%slope(mode, t, y)
      a = slope(speed)
      margins%x_max = max(margins%x_max, y(1))
      margins%x_min = min(margins%x_min, y(1))
      if (smooth .and. last(speed)*y(speed) < 0) then
        call note_turning(machine, mode, last, last_t, t, merge(1, -1, last(speed) > 0), k, gaps, margins)
      else if (.not. smooth .and. direction*last_a < 0 .and. direction*a > 0) then
        call note_slowest(machine, mode, last, last_t, t, direction, k, slowest)
      end if
      last = y
      last_a = a
      last_t = t
    end do
  end subroutine look_along

  !> The least reserves of friction, in both directions, in a stick after the event `k` that lasts from `from` to `until` [s] at the
  !> state `y`; those at its ends are others' margins.
  pure subroutine look_while_stuck(machine, from, y, until, k, holds)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: from, y(machine%n), until
    integer, intent(in) :: k
    type(margin_t), intent(inout) :: holds(-1:1)
    real(wp) :: t, last_t, value, rate, last_rate
    integer :: i, side, count
    count = max(6, ceiling(looks*(until - from)/machine%period))
    do side = -1, 1, 2
      last_rate = 0
      last_t = from
      do i = 0, count
        t = from + (until - from)*i/count
        call reserve_at(machine, side, from, y, t, value, rate)
        if (last_rate < 0 .and. rate > 0) then
          call least_reserve(machine, side, from, y, bracket_t(last_t, t, last_rate, rate), last_t, value)
          value = value/machine%force_size
          if (value < holds(side)%value) holds(side) = margin_t(value, of_hold, -k - 1, side, last_t)
        end if
        last_rate = rate
        last_t = t
      end do
    end do
  end subroutine look_while_stuck

  !> The least reserve of friction [N] and its instant [s] in a stick that begins at `from` with `y`, by the Illinois form of the
  !> secant rule.
  pure subroutine least_reserve(machine, side, from, y, within, t, value)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: side
    real(wp), intent(in) :: from, y(machine%n)
    type(bracket_t), intent(in) :: within
    real(wp), intent(out) :: t, value
    type(bracket_t) :: bracket
    real(wp) :: rate
    integer :: i
    bracket = within
    do i = 1, most_secants
      t = next_trial(bracket)
      call reserve_at(machine, side, from, y, t, value, rate)
      call narrow(bracket, t, rate)
      if (.not. abs(rate) > 0 .or. bracket%high - bracket%low <= 4*spacing(bracket%high)) exit
    end do
  end subroutine least_reserve

  !> By how much the force on a body that rests at `start` from the time `from` on is less at `t` than what moves it to a side [N],
  !> and the rate of that [N/s].
  pure subroutine reserve_at(machine, side, from, start, t, value, rate)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: side
    real(wp), intent(in) :: from, start(machine%n), t
    real(wp), intent(out) :: value, rate
    real(wp) :: y(machine%n), by_state(machine%n)
    call machine%fly(mode_stick, from, start, t, y)
    call machine%guard(event_t(kind=event_release, side=side), t, y, value, by_state, rate)
    rate = rate + sum(by_state*machine%slope(mode_stick, t, y))
  end subroutine reserve_at

  !> The extreme of x between two looks, the body being at `start` at the first.
  pure subroutine note_turning(machine, mode, start, low, high, side, k, gaps, margins)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode, side, k
    real(wp), intent(in) :: start(machine%n), low, high
    type(margin_t), intent(inout) :: gaps(-1:1)
    type(margins_t), intent(inout) :: margins
    real(wp) :: t, y(machine%n)
    call find_zero(machine, mode, start, low, high, 1, t, y)
    margins%x_max = max(margins%x_max, y(1))
    margins%x_min = min(margins%x_min, y(1))
    ! A soft barrier that is pressed is not missed.
    if (pressed_side(mode) /= side) call note_gap(machine, y(1), k, side, t, .false., gaps)
  end subroutine note_turning

  pure subroutine note_slowest(machine, mode, start, low, high, direction, k, slowest)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode, direction, k
    real(wp), intent(in) :: start(machine%n), low, high
    type(margin_t), intent(inout) :: slowest
    real(wp) :: t, y(machine%n)
    call find_zero(machine, mode, start, low, high, machine%positions + 1, t, y)
    associate (pace => direction*y(machine%positions + 1)/machine%size_of(machine%positions + 1))
      if (pace < slowest%value) slowest = margin_t(pace, of_slip, k, direction, t)
    end associate
  end subroutine note_slowest

  !> Where the rate of a coordinate, `row`, changes its sign between `low` and `high` [s], by the Illinois form of the secant rule
  !> from the state `start` at `low`; the state there.
  pure subroutine find_zero(machine, mode, start, low, high, row, t, y)
    class(hybrid_t), intent(in) :: machine
    integer, intent(in) :: mode, row
    real(wp), intent(in) :: start(machine%n), low, high
    real(wp), intent(out) :: t, y(machine%n)
    type(bracket_t) :: bracket
    real(wp) :: first(machine%n), last(machine%n), slope(machine%n)
    integer :: i
    first = machine%slope(mode, low, start)
    call machine%fly(mode, low, start, high, y)
    last = machine%slope(mode, high, y)
    bracket = bracket_t(low, high, first(row), last(row))
    do i = 1, most_secants
      t = next_trial(bracket)
      call machine%fly(mode, low, start, t, y)
      slope = machine%slope(mode, t, y)
      call narrow(bracket, t, slope(row))
      if (.not. abs(slope(row)) > 0 .or. bracket%high - bracket%low <= 2*spacing(bracket%high)) exit
    end do
  end subroutine find_zero

  !> Notes the distance of a turning point at `x` [m] to the barrier on its side; `at_event`: it is the event `k`, else it comes
  !> after that.
  pure subroutine note_gap(machine, x, k, side, t, at_event, gaps)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: x, t
    integer, intent(in) :: k, side
    logical, intent(in) :: at_event
    type(margin_t), intent(inout) :: gaps(-1:1)
    real(wp) :: barrier, value
    barrier = machine%barriers(merge(2, 1, side > 0))
    if (.not. abs(barrier) < huge(barrier)) return
    value = side*(barrier - x)/machine%size_of(1)
    if (value < gaps(side)%value) gaps(side) = margin_t(value, of_gap, merge(k, -k - 1, at_event), side, t)
  end subroutine note_gap

end module orbit_margins
