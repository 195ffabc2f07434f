! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The events of a motion of one body, from its log.
module body_events
  use contact_law, only: contact_t
  use hybrid_machine, only: event_t
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, &
    event_turning_point, log_t, mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, mode_upper_barrier, state_t
  use one_body, only: direction_in, mode_of_body, one_body_t, rests_on_barrier, slips_in, turns_smoothly
  implicit none
  private

  public :: events_of_body

contains

  !> The events that `log` holds of a motion from `start` to `finish`, in order; `mode` is that after the last. Turning points
  !> at which no force changes are left out. With `collapsed` a completed chatter is one event, in place of its impacts.
  pure subroutine events_of_body(body, start, log, finish, collapsed, events, mode)
    type(one_body_t), intent(in) :: body
    type(state_t), intent(in) :: start, finish
    type(log_t), intent(in) :: log
    logical, intent(in) :: collapsed
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(event_t) :: event
    logical :: smooth
    real(wp) :: next_x
    integer :: i, count
    allocate (events(log%events))
    smooth = turns_smoothly(body)
    mode = mode_of_body(body, start)
    count = 0
    do i = 1, log%events
      event = event_t(kind=log%event_kind(i), before=mode)
      event%time = log%event_data(1, i)
      event%arrival(:2) = log%event_data(2:3, i)
      event%departure(:2) = log%event_data([2, 4], i)
      next_x = finish%x
      if (i < log%events) next_x = log%event_data(2, i + 1)
      call set_mode(body, next_x - event%arrival(1), event)
      if (follows_dead_impact(events, count, event)) then
        ! The body stays there, or goes back from there: of the impact.
        mode = event%after
        events(count)%after = mode
        cycle
      end if
      if (smooth .and. event%kind == event_turning_point .and. slips_in(mode) .and. .not. rests_on_barrier(event%after)) cycle
      mode = event%after
      if (collapsed .and. is_chatter(event%kind)) count = before_chatter(events, count, event%side)
      if (collapsed .and. is_chatter(event%kind) .and. count < size(events)) then
        if (events(count + 1)%side == event%side .and. is_impact(events(count + 1)%kind)) then
          event%time = events(count + 1)%time
          event%arrival = events(count + 1)%arrival
          event%before = events(count + 1)%before
        end if
      end if
      count = count + 1
      events(count) = event
    end do
    if (count < size(events)) events = events(:count)
  end subroutine events_of_body

  !> Mode after an event and its side; `ahead` is how far x goes until the next.
  pure subroutine set_mode(body, ahead, event)
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: ahead
    type(event_t), intent(inout) :: event
    integer :: direction
    associate (contact => body%moving%machine%contact, x => event%arrival(1))
      direction = direction_in(event%before)
      select case (event%kind)
      case (event_impact_upper)
        event%side = 1
        event%after = mode_slip_minus
      case (event_impact_lower)
        event%side = -1
        event%after = mode_slip_plus
      case (event_chatter_upper)
        event%side = 1
        event%after = mode_upper_barrier
      case (event_chatter_lower)
        event%side = -1
        event%after = mode_lower_barrier
      case (event_stick)
        event%side = direction
        event%after = mode_stick
        if (x >= contact%upper) event%after = mode_upper_barrier
        if (x <= contact%lower) event%after = mode_lower_barrier
      case (event_turning_point, event_release, event_barrier_release)
        if (abs(ahead) > 0) direction = nint(sign(1.0_wp, ahead))
        if (.not. abs(ahead) > 0) direction = -direction
        event%side = direction
        event%after = mode_of_body(body, state_t(x=x, mode=merge(mode_slip_plus, mode_slip_minus, direction > 0)))
      case default
        event%side = merge(1, -1, abs(x - contact%soft_upper) < abs(x - contact%soft_lower))
        event%after = merge(mode_slip_plus, mode_slip_minus, direction > 0)
        if (event%kind /= event_separation) event%after = event%after + merge(10, 20, event%side > 0)
      end select
    end associate
  end subroutine set_mode

  !> Whether a turning point or a stick is the end of an impact without rebound, the last of `count` events.
  pure logical function follows_dead_impact(events, count, event) result(follows)
    type(event_t), intent(in) :: events(:), event
    integer, intent(in) :: count
    follows = count > 0 .and. (event%kind == event_turning_point .or. event%kind == event_stick)
    if (.not. follows) return
    associate (last => events(count))
      follows = is_impact(last%kind) .and. .not. abs(last%departure(2)) > 0 .and. .not. event%time > last%time
    end associate
  end function follows_dead_impact

  pure elemental logical function is_impact(kind)
    integer, intent(in) :: kind
    is_impact = kind == event_impact_upper .or. kind == event_impact_lower
  end function is_impact

  pure elemental logical function is_chatter(kind)
    integer, intent(in) :: kind
    is_chatter = kind == event_chatter_upper .or. kind == event_chatter_lower
  end function is_chatter

  !> Number of events before the impacts that end the list, on one barrier, ever weaker, with nothing but turning points
  !> between them: a chatter.
  pure integer function before_chatter(events, count, side) result(kept)
    type(event_t), intent(in) :: events(:)
    integer, intent(in) :: count, side
    real(wp) :: speed
    integer :: i
    kept = count
    speed = 0
    do i = count, 1, -1
      if (events(i)%kind == event_turning_point) cycle
      if (.not. is_impact(events(i)%kind) .or. events(i)%side /= side) exit
      if (abs(events(i)%arrival(2)) < speed) exit
      speed = abs(events(i)%arrival(2))
      kept = i - 1
    end do
  end function before_chatter

end module body_events
