! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The sequence of events on the other side of a point where a margin of a periodic orbit is zero: an impact put in or taken out,
!> a turning point that becomes a stick, and back.
module other_sequence
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_impact_lower, event_impact_upper, event_release, event_separation, &
    event_stick, event_touch_lower, event_touch_upper, event_turning_point, mode_lower_barrier, mode_slip_minus, mode_slip_plus, &
    mode_stick, mode_upper_barrier
  use orbit_margins, only: is_impact, margin_t, of_gap, of_hold, of_impact, of_slip, of_stick, of_turning
  use periodic_orbit, only: orbit_t
  implicit none
  private

  public :: change_sequence

contains

  !> The orbit at which `margin` is zero, with the sequence of events beyond; `known` is false where there is no rule.
  pure subroutine change_sequence(machine, orbit, margin, other, known)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(margin_t), intent(in) :: margin
    type(orbit_t), intent(out) :: other
    logical, intent(out) :: known
    logical :: smooth
    integer :: k
    other = orbit
    known = .true.
    smooth = machine%smooth_turns
    k = margin%event
    select case (margin%kind)
    case (of_impact)
      call take_impact_out(smooth, k, other, known)
    case (of_gap)
      call put_impact_in(machine, margin, other, known)
    case (of_turning)
      if (is_impact(orbit%events(k)%kind)) then
        call rest_at_barrier(k, other)
        return
      end if
      other%events(k)%kind = event_stick
      other%events(k)%side = -orbit%events(k)%side
      other%events(k)%after = mode_stick
      other%events = [other%events(:k), release_at(orbit%events(k)%time, orbit%events(k)%side, orbit%events(k)%after), &
                      orbit%events(k + 1:)]
    case (of_stick)
      known = k < size(orbit%events)
      if (is_impact(orbit%events(k)%kind)) then
        if (known) known = orbit%events(k + 1)%kind == event_barrier_release
        if (known) other%events(k)%after = orbit%events(k + 1)%after
        if (known) other%events = [other%events(:k), orbit%events(k + 2:)]
        return
      end if
      if (known) known = orbit%events(k + 1)%kind == event_release
      if (.not. known) return
      other%events(k)%kind = event_turning_point
      other%events(k)%side = orbit%events(k + 1)%side
      other%events(k)%after = orbit%events(k + 1)%after
      if (orbit%events(k)%side == orbit%events(k + 1)%side) then
        other%events = [orbit%events(:k - 1), orbit%events(k + 2:)]
      else
        other%events = [other%events(:k), orbit%events(k + 2:)]
      end if
    case (of_slip)
      ! Where a slip comes to a stop the force is that of sliding friction, which holds the body.
      other%events = [orbit%events(:k), event_t(kind=event_stick, side=margin%side, after=mode_stick, time=margin%time), &
                      release_at(margin%time, margin%side, slip_in(margin%side)), orbit%events(k + 1:)]
    case (of_hold)
      other%events = [orbit%events(:-k - 1), release_at(margin%time, margin%side, slip_in(margin%side)), &
                      event_t(kind=event_stick, side=margin%side, after=mode_stick, time=margin%time), orbit%events(-k:)]
    case default
      known = .false.
    end select
  end subroutine change_sequence

  !> The body stays where the impact `k` without rebound leaves it, until the force takes it back.
  pure subroutine rest_at_barrier(k, other)
    integer, intent(in) :: k
    type(orbit_t), intent(inout) :: other
    type(event_t) :: leave
    leave = release_at(other%events(k)%time, -other%events(k)%side, other%events(k)%after)
    leave%kind = event_barrier_release
    other%events(k)%after = merge(mode_upper_barrier, mode_lower_barrier, other%events(k)%side > 0)
    other%events = [other%events(:k), leave, other%events(k + 1:)]
  end subroutine rest_at_barrier

  pure integer function slip_in(direction)
    integer, intent(in) :: direction
    slip_in = merge(mode_slip_plus, mode_slip_minus, direction > 0)
  end function slip_in

  pure type(event_t) function release_at(time, side, mode) result(event)
    real(wp), intent(in) :: time
    integer, intent(in) :: side, mode
    event = event_t(kind=event_release, side=side, after=mode, time=time)
  end function release_at

  !> Without the impact or the touch `k`: where friction acts, a turning point stays.
  pure subroutine take_impact_out(smooth, k, other, known)
    logical, intent(in) :: smooth
    integer, intent(in) :: k
    type(orbit_t), intent(inout) :: other
    logical, intent(out) :: known
    integer :: last
    associate (events => other%events)
      ! It goes with its touch, which has no speed either.
      known = events(k)%kind == event_separation
      if (known) return
      known = is_impact(events(k)%kind) .or. events(k)%kind == event_touch_upper .or. events(k)%kind == event_touch_lower
      if (.not. known) return
      if (is_impact(events(k)%kind)) then
        if (smooth) then
          other%events = [events(:k - 1), events(k + 1:)]
        else
          events(k)%kind = event_turning_point
          events(k)%side = -events(k)%side
        end if
        return
      end if
      ! The touch, what happens in the contact, and its end.
      do last = k + 1, size(events)
        if (events(last)%kind == event_separation) exit
      end do
      known = last <= size(events)
      if (.not. known) return
      if (smooth) then
        other%events = [events(:k - 1), events(last + 1:)]
      else
        events(k)%kind = event_turning_point
        events(k)%side = -events(k)%side
        events(k)%after = slip_in(events(k)%side)
        other%events = [events(:k), events(last + 1:)]
      end if
    end associate
  end subroutine take_impact_out

  !> With an impact, or a touch and a separation, at the turning point that meets the barrier.
  pure subroutine put_impact_in(machine, margin, other, known)
    class(hybrid_t), intent(in) :: machine
    type(margin_t), intent(in) :: margin
    type(orbit_t), intent(inout) :: other
    logical, intent(out) :: known
    type(event_t) :: hit, leave, turn
    integer :: k
    k = margin%event
    hit%time = margin%time
    hit%side = margin%side
    known = .true.
    if (machine%soft) then
      hit%kind = merge(event_touch_upper, event_touch_lower, margin%side > 0)
      hit%after = slip_in(margin%side) + merge(10, 20, margin%side > 0)
      turn = event_t(kind=event_turning_point, side=-margin%side, time=margin%time, &
                     after=slip_in(-margin%side) + merge(10, 20, margin%side > 0))
      leave = event_t(kind=event_separation, side=margin%side, after=slip_in(-margin%side), time=margin%time)
      if (k >= 0) then
        other%events = [other%events(:k - 1), hit, turn, leave, other%events(k + 1:)]
      else
        other%events = [other%events(:-k - 1), hit, leave, other%events(-k:)]
      end if
      return
    end if
    hit%kind = merge(event_impact_upper, event_impact_lower, margin%side > 0)
    hit%after = slip_in(-margin%side)
    if (k >= 0) then
      other%events = [other%events(:k - 1), hit, other%events(k + 1:)]
    else
      other%events = [other%events(:-k - 1), hit, other%events(-k:)]
    end if
  end subroutine put_impact_in

end module other_sequence
