! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The margins of orbits of one body: of its events, the barriers that it misses, its slowest slip, and the reserves of friction
!> while it sticks. See module `orbit_margins`.
module body_margins
  use slip_force, only: pressed_side
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, event_turning_point, &
    mode_stick
  use one_body, only: direction_in, rests_on_barrier, slips_in
  use orbit_margins, only: is_impact, looks, margin_t, margins_t, most_secants, of_gap, of_hold, of_impact, of_order, of_release, &
    of_slip, of_stick, of_turning, orbit_flight_t
  use periodic_orbit, only: orbit_t
  use secant_bracket, only: bracket_t, narrow, next_trial
  implicit none
  private

  public :: add_body_event, look_along_body, least_of_flights

  !> After a rebound slower than this, in natural sizes, so many looks come before the first, each at half the time of the next.
  real(wp), parameter :: slow_rebound = 1e-2_wp
  integer, parameter :: early_looks = 14

  !> The least margins within all flights: gaps to the barriers and reserves of friction below and above, and the slowest slip.
  type, public :: least_margins_t
    type(margin_t) :: gaps(-1:1) = [margin_t(kind=of_gap, side=-1), margin_t(kind=of_gap, side=0), margin_t(kind=of_gap, side=1)]
    type(margin_t) :: holds(-1:1) = [margin_t(kind=of_hold, side=-1), margin_t(kind=of_hold, side=0), &
                                     margin_t(kind=of_hold, side=1)]
    type(margin_t) :: slowest = margin_t(kind=of_slip)
  end type least_margins_t

contains

  !> As a list.
  pure function least_of_flights(least) result(list)
    type(least_margins_t), intent(in) :: least
    type(margin_t) :: list(5)
    list = [least%gaps(-1), least%gaps(1), least%slowest, least%holds(-1), least%holds(1)]
  end function least_of_flights

  !> Margins within a flight, and the extremes of x.
  pure subroutine look_along_body(machine, orbit, flight, least, margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(orbit_flight_t), intent(in) :: flight
    type(least_margins_t), intent(inout) :: least
    type(margins_t), intent(inout) :: margins
    margins%x_max = max(margins%x_max, flight%start(1))
    margins%x_min = min(margins%x_min, flight%start(1))
    if (.not. flight%until > flight%from) return
    if (slips_in(flight%mode)) call look_along_slip(machine, orbit, flight, least, margins)
    ! A body that rests for ever has no other motion near by.
    if (flight%mode == mode_stick .and. size(orbit%events) > 0) call look_while_stuck(machine, flight, least%holds)
  end subroutine look_along_body

  !> Adds the margins of the event `k` to `list`, and what it misses to `least`.
  pure subroutine add_body_event(machine, orbit, k, list, least)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(margin_t), allocatable, intent(inout) :: list(:)
    type(least_margins_t), intent(inout) :: least
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
      if (event%kind == event_turning_point .and. pressed_side(event%before) /= -event%side) then
        call note_gap(machine, event%arrival(1), k, -event%side, event%time, .true., least%gaps)
      end if
      if (is_dead_impact(machine, event)) list = [list, rest_or_return(machine, event, k)]
      ! The section closes the orbit of a machine without a clock: it is not part of the order.
      if (k == 1 .or. (.not. machine%has_clock .and. k == size(orbit%events))) return
      margin = margin_t(event=k, side=event%side, time=event%time, kind=of_order, &
                        value=(event%time - orbit%events(k - 1)%time)/machine%period)
      list = [list, margin]
    end associate
  end subroutine add_body_event

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
  pure subroutine look_along_slip(machine, orbit, flight, least, margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(orbit_flight_t), intent(in) :: flight
    type(least_margins_t), intent(inout) :: least
    type(margins_t), intent(inout) :: margins
    real(wp) :: start(machine%n), y(machine%n), a, last(machine%n), last_a, t, last_t, slope(machine%n)
    integer :: i, count, early, direction, speed
    logical :: smooth
    start = flight%start(:machine%n)
    speed = machine%positions + 1
    smooth = machine%smooth_turns
    direction = direction_in(flight%mode)
    count = max(6, ceiling(looks*(flight%until - flight%from)/machine%period))
    last = start
    last_t = flight%from
    slope = machine%slope(flight%mode, flight%from, start)
    last_a = slope(speed)
    early = 0
    if (flight%event > 0) then
      ! A released body gathers speed from zero, whatever the rounding of its acceleration.
      if (orbit%events(flight%event)%kind == event_release) last_a = 0
      ! One that hardly rebounds may be back before the first look.
      if (is_impact(orbit%events(flight%event)%kind) .and. abs(start(speed)) < slow_rebound*machine%size_of(speed)) then
        early = early_looks
      end if
    end if
    do i = 1 - early, count
      t = flight%from + (flight%until - flight%from)*merge(2.0_wp**(i - 1), real(i, wp), i < 1)/count
      call machine%fly(flight%mode, last_t, last, t, y)
      slope = machine%slope(flight%mode, t, y)
      a = slope(speed)
      margins%x_max = max(margins%x_max, y(1))
      margins%x_min = min(margins%x_min, y(1))
      if (smooth .and. last(speed)*y(speed) < 0) then
        call note_turning(machine, flight, last, last_t, t, least%gaps, margins)
      else if (.not. smooth .and. direction*last_a < 0 .and. direction*a > 0) then
        call note_slowest(machine, flight, last, last_t, t, least%slowest)
      end if
      last = y
      last_a = a
      last_t = t
    end do
  end subroutine look_along_slip

  !> The least reserves of friction, in both directions, in a stick; those at its ends are others' margins.
  pure subroutine look_while_stuck(machine, flight, holds)
    class(hybrid_t), intent(in) :: machine
    type(orbit_flight_t), intent(in) :: flight
    type(margin_t), intent(inout) :: holds(-1:1)
    real(wp) :: y(machine%n), t, last_t, value, rate, last_rate
    integer :: i, side, count
    y = flight%start(:machine%n)
    count = max(6, ceiling(looks*(flight%until - flight%from)/machine%period))
    do side = -1, 1, 2
      last_rate = 0
      last_t = flight%from
      do i = 0, count
        t = flight%from + (flight%until - flight%from)*i/count
        call reserve_at(machine, side, flight%from, y, t, value, rate)
        if (last_rate < 0 .and. rate > 0) then
          call least_reserve(machine, side, flight%from, y, bracket_t(last_t, t, last_rate, rate), last_t, value)
          value = value/machine%force_size
          if (value < holds(side)%value) holds(side) = margin_t(value, of_hold, -flight%event - 1, side, last_t)
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
  pure subroutine note_turning(machine, flight, start, low, high, gaps, margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_flight_t), intent(in) :: flight
    real(wp), intent(in) :: start(machine%n), low, high
    type(margin_t), intent(inout) :: gaps(-1:1)
    type(margins_t), intent(inout) :: margins
    real(wp) :: t, y(machine%n)
    integer :: side
    side = merge(1, -1, start(machine%positions + 1) > 0)
    call find_zero(machine, flight%mode, start, low, high, 1, t, y)
    margins%x_max = max(margins%x_max, y(1))
    margins%x_min = min(margins%x_min, y(1))
    ! A soft barrier that is pressed is not missed.
    if (pressed_side(flight%mode) /= side) call note_gap(machine, y(1), flight%event, side, t, .false., gaps)
  end subroutine note_turning

  pure subroutine note_slowest(machine, flight, start, low, high, slowest)
    class(hybrid_t), intent(in) :: machine
    type(orbit_flight_t), intent(in) :: flight
    real(wp), intent(in) :: start(machine%n), low, high
    type(margin_t), intent(inout) :: slowest
    real(wp) :: t, y(machine%n)
    integer :: direction
    direction = direction_in(flight%mode)
    call find_zero(machine, flight%mode, start, low, high, machine%positions + 1, t, y)
    associate (pace => direction*y(machine%positions + 1)/machine%size_of(machine%positions + 1))
      if (pace < slowest%value) slowest = margin_t(pace, of_slip, flight%event, direction, t)
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

end module body_margins
