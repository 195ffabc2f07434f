! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The margins of orbits of a structure: the guards of its flights that are not met, the speeds of its impacts, the reserve of what
!> holds, the order of its events. See module `orbit_margins`.
module structure_margins
  use guards, only: force_ends, force_returns, guards_of, joint_guard_t, leaves, lets_go, meets_lower, meets_upper, &
    room_for_guards, &
    slide_ends, slides_down, slides_up, turns_round
  use hybrid_machine, only: event_t
  use multibody, only: most_joints
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use motion_state, only: event_release
  use orbit_margins, only: looks, margin_t, margins_t, most_secants, of_gap, of_hold, of_impact, of_order, of_press, of_release, &
    of_slip, of_stick, of_turning, orbit_flight_t
  use periodic_orbit, only: orbit_t
  use secant_bracket, only: bracket_t, narrow, next_trial
  use structure, only: state_in, structure_t
  use structure_modes, only: mode_number, phases_in
  use structure_flight, only: flow_of
  implicit none
  private

  public :: add_structure_event, look_along_structure

contains

  !> Size of forces [N].
  pure real(wp) function force_size(machine)
    type(structure_t), intent(in) :: machine
    force_size = max(machine%frame%moving%machine%force_scale, tiny(1.0_wp))
  end function force_size

  !> Value and rate of the guard of an event in the mode before it.
  pure subroutine value_and_rate(machine, event, t, y, value, rate)
    type(structure_t), intent(in) :: machine
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: value, rate
    real(wp) :: by_state(machine%n), by_time
    call machine%guard(event, t, y, value, by_state, by_time)
    rate = sum(by_state*machine%slope(event%before, t, y)) + by_time
  end subroutine value_and_rate

  !> The margins of the event `k`.
  pure subroutine add_structure_event(machine, orbit, k, list)
    type(structure_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(margin_t), allocatable, intent(inout) :: list(:)
    type(margin_t) :: margin
    real(wp) :: value, rate
    associate (event => orbit%events(k), y => orbit%events(k)%arrival(:machine%n), size_of => machine%size_of)
      margin = margin_t(event=k, side=event%side, time=event%time, joint=event%joint, guard=event%guard)
      call value_and_rate(machine, event, event%time, y, value, rate)
      select case (event%guard)
      case (meets_upper, meets_lower, leaves)
        margin%kind = of_impact
        margin%value = -rate/size_of(machine%positions + 1)
      case (slide_ends)
        call note_stop(machine, event, margin)
      case (slides_up, slides_down, lets_go)
        margin%kind = of_release
        margin%value = -rate*machine%size_of_time()/force_size(machine)
      case default
        margin%kind = 0
      end select
      if (margin%kind /= 0) list = [list, margin]
      ! An event that comes to be after the section is one of the next turn.
      if (k == 1 .or. (.not. machine%has_clock .and. k == size(orbit%events))) return
      list = [list, margin_t(event=k, side=event%side, time=event%time, kind=of_order, joint=event%joint, &
                             value=(event%time - orbit%events(k - 1)%time)/machine%period)]
    end associate
  end subroutine add_structure_event

  !> Where a slide ends: what is left of the friction that holds, or what the forces are beyond it where the joint slides back.
  pure subroutine note_stop(machine, event, margin)
    type(structure_t), intent(in) :: machine
    type(event_t), intent(in) :: event
    type(margin_t), intent(inout) :: margin
    type(event_t) :: probe
    real(wp) :: up, down, rate
    integer :: phase(most_joints), after
    phase = phases_in(machine%frame%moving%machine, event%after)
    after = phase(event%joint)
    phase(event%joint) = 0
    probe = event
    probe%before = mode_number(machine%frame%moving%machine, phase)
    probe%guard = slides_up
    associate (y => event%departure(:machine%n))
      call value_and_rate(machine, probe, event%time, y, up, rate)
      probe%guard = slides_down
      call value_and_rate(machine, probe, event%time, y, down, rate)
    end associate
    ! Elastic friction stops with its spring at its limit on one side.
    if (any(machine%frame%elastic == event%joint)) then
      margin%kind = 0
    else if (after == 0) then
      margin%kind = of_stick
      margin%value = min(up, down)/force_size(machine)
    else
      margin%kind = of_turning
      margin%value = -merge(up, down, after > 0)/force_size(machine)
    end if
  end subroutine note_stop

  !> The least values of the guards within a flight, those at its end that is an event excepted.
  pure subroutine look_along_structure(machine, orbit, flight, margins)
    type(structure_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(orbit_flight_t), intent(in) :: flight
    type(margins_t), intent(inout) :: margins
    type(mode_flow_t) :: spare
    type(joint_guard_t) :: list(room_for_guards(machine%frame%moving%machine))
    type(event_t) :: probe
    real(wp) :: start(machine%n), y(machine%n), last(machine%n), t, last_t, value, rate, last_rate(size(list))
    real(wp) :: least_t, least
    type(multibody_state_t) :: state
    integer :: i, g, at, count_guards, count_looks
    start = flight%start(:machine%n)
    state = state_in(machine, flight%mode, flight%from, start)
    call flow_of(machine%frame%moving, state%phase, at, spare)
    if (at > 0) then
      call guards_of(machine%frame%moving%machine, machine%frame%moving%flows(at), state, list, count_guards)
    else
      call guards_of(machine%frame%moving%machine, spare, state, list, count_guards)
    end if
    count_looks = max(6, ceiling(looks*(flight%until - flight%from)/machine%period))
    last_t = flight%from
    last = start
    probe%before = flight%mode
    do i = 0, count_looks
      t = flight%from + (flight%until - flight%from)*i/count_looks
      y = start
      if (i > 0) call machine%fly(flight%mode, last_t, last, t, y)
      call note_position(machine, y, margins)
      do g = 1, count_guards
        if (list(g)%meaning == turns_round) cycle
        probe%joint = list(g)%joint
        probe%guard = list(g)%meaning
        call value_and_rate(machine, probe, t, y, value, rate)
        if (i == 0) then
          ! A jump elsewhere may have turned it round.
          if (flight%event > 0 .and. rate >= 0) then
            if (orbit%events(flight%event)%joint /= probe%joint) call note(machine, probe, flight%event, t, value, margins)
          end if
          ! A released joint gathers speed from zero, whatever the rounding of its acceleration.
          if (flight%event > 0 .and. probe%guard == slide_ends) then
            if (orbit%events(flight%event)%joint == probe%joint .and. orbit%events(flight%event)%kind == event_release) rate = 0
          end if
        else if (last_rate(g) < 0 .and. rate > 0) then
          call find_least(machine, probe, last, last_t, t, last_rate(g), rate, least_t, least)
          call note(machine, probe, flight%event, least_t, least, margins)
        end if
        last_rate(g) = rate
      end do
      last_t = t
      last = y
    end do
  end subroutine look_along_structure

  pure subroutine note_position(machine, y, margins)
    type(structure_t), intent(in) :: machine
    real(wp), intent(in) :: y(:)
    type(margins_t), intent(inout) :: margins
    real(wp) :: x
    x = sum(machine%watched(1, :)*y)
    margins%x_max = max(margins%x_max, x)
    margins%x_min = min(margins%x_min, x)
  end subroutine note_position

  !> Where the rate of a guard changes its sign after the state `start` at `low`, by the Illinois form of the secant rule, and its
  !> value there.
  pure subroutine find_least(machine, probe, start, low, high, rate_low, rate_high, t, value)
    type(structure_t), intent(in) :: machine
    type(event_t), intent(in) :: probe
    real(wp), intent(in) :: start(:), low, high, rate_low, rate_high
    real(wp), intent(out) :: t, value
    type(bracket_t) :: bracket
    real(wp) :: rate, y(machine%n)
    integer :: i
    bracket = bracket_t(low, high, rate_low, rate_high)
    do i = 1, most_secants
      t = next_trial(bracket)
      call machine%fly(probe%before, low, start, t, y)
      call value_and_rate(machine, probe, t, y, value, rate)
      call narrow(bracket, t, rate)
      if (.not. abs(rate) > 0 .or. bracket%high - bracket%low <= 4*spacing(bracket%high)) exit
    end do
  end subroutine find_least

  !> Notes a value of the guard of `probe` after the event `k`, if it is the least of its joint and meaning.
  pure subroutine note(machine, probe, k, t, value, margins)
    type(structure_t), intent(in) :: machine
    type(event_t), intent(in) :: probe
    integer, intent(in) :: k
    real(wp), intent(in) :: t, value
    type(margins_t), intent(inout) :: margins
    type(margin_t) :: margin
    integer :: i
    margin = margin_t(joint=probe%joint, guard=probe%guard, event=-k - 1, time=t)
    select case (probe%guard)
    case (meets_upper, meets_lower)
      margin%kind = of_gap
      margin%side = merge(1, -1, probe%guard == meets_upper)
      margin%value = value/machine%size_of(1)
    case (slide_ends)
      margin%kind = of_slip
      margin%value = value/machine%size_of(machine%positions + 1)
    case (slides_up, slides_down)
      margin%kind = of_hold
      margin%side = merge(1, -1, probe%guard == slides_up)
      margin%value = value/force_size(machine)
    case (lets_go, force_ends, force_returns)
      margin%kind = of_press
      margin%value = value/force_size(machine)
    case default
      return
    end select
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (one%kind /= margin%kind .or. one%joint /= margin%joint .or. one%guard /= margin%guard .or. one%event >= 0) cycle
        if (margin%value < one%value) one = margin
        return
      end associate
    end do
    margins%list = [margins%list, margin]
  end subroutine note

end module structure_margins
