! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a basin boundary leads to: two motions that start on its two sides are followed from section to section while they are
!> together. They come near to a saddle orbit, or part at once at an event that only one of them has, or wander on. Edge
!> tracking by bisection: J. D. Skufca, J. A. Yorke, B. Eckhardt, Phys. Rev. Lett. 96 (2006).
module edge_state
  use attractors, only: attractor_t
  use body_events, only: events_of_body
  use hybrid_machine, only: event_t
  use kinds, only: wp
  use motion, only: advance_period, start_state
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, event_stick, log_t, &
    open_log, state_t, tally_t
  use one_body, only: one_body_t
  use saddle_search, only: distance_to_saddle, find_saddle, saddle_t, section_distance
  use start_label, only: label_start
  use trajectory, only: span_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: track_edge, reaches_saddle

  !> What a boundary is.
  integer, parameter, public :: edge_not_known = 0, edge_saddle = 1, edge_recurrent = 2, edge_graze = 3, edge_stick = 4, &
    edge_chatter = 5, edge_other_event = 6
  character(len=*), parameter, public :: edge_names(0:6) = [character(len=14) :: 'not_known', 'stable_set', 'recurrent', &
    'graze', 'stick', 'chatter', 'other_event']

  character(len=*), parameter, public :: edge_texts(0:6) = [character(len=38) :: 'not known', 'stable set of a saddle', &
    'recurrent edge state, not periodic', 'edge of a graze', 'rim of a stick set', 'edge of a completed chatter', &
    'edge at another event']

  !> Drive periods that a pair is followed, and the longest saddle that is looked for.
  integer, parameter :: most_periods = 300, longest = 12
  !> Distances in natural sizes: at which a pair is brought together again and to which, at which it has parted.
  real(wp), parameter :: apart = 1e-6_wp, together = 1e-10_wp, closest = 1e-13_wp, parted = 1e-2_wp
  !> A return so near is tried with Newton's method; a motion that never returns nearer than `far` is not periodic.
  real(wp), parameter :: near_return = 1e-3_wp, far = 2e-2_wp
  !> It has come to a saddle at this distance; it has not where the distance grows so many times, or after so many periods.
  real(wp), parameter :: arrived = 1e-5_wp, moved_off = 20
  integer, parameter :: most_waiting = 60
  !> A pair leaves a saddle that it has come as near to as `near_saddle`, up to the distance `left_saddle`, on two sides.
  real(wp), parameter :: near_saddle = 3e-3_wp, left_saddle = 2e-2_wp

  !> Two motions, one on either side of a boundary, on the section or at their starts.
  type :: pair_t
    type(state_t) :: states(2)
    integer :: labels(2) = 0
  end type pair_t

contains

  !> Follows the pair that starts at the columns of `starts` (x, v, crank angle) with `labels`, halving its distance by the labels
  !> whenever it grows. `edge` is one of the codes above; `saddle` is the orbit where it is `edge_saddle`.
  pure subroutine track_edge(machines, body, catalogue, span, starts, labels, edge, saddle)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: starts(3, 2)
    integer, intent(in) :: labels(2)
    integer, intent(out) :: edge
    type(saddle_t), intent(out) :: saddle
    type(pair_t) :: pair, before
    real(wp) :: past(2, most_periods), least, distance, first_distance
    integer :: n, event, waiting
    logical :: ok
    edge = edge_not_known
    waiting = 0
    pair%labels = labels
    pair%states(1) = start_state(body%moving, starts(1, 1), starts(2, 1), starts(3, 1))
    pair%states(2) = start_state(body%moving, starts(1, 2), starts(2, 2), starts(3, 2))
    least = huge(least)
    do n = 1, most_periods
      if (n > 1 .and. gap_of(body, pair) > apart) then
        call bring_together(body, catalogue, span, together, pair, ok)
        if (.not. ok) return
      end if
      before = pair
      call advance_pair(body, pair, event, ok)
      if (.not. ok) return
      if (gap_of(body, pair) > parted) then
        call look_closer(body, catalogue, span, before, pair, event, ok)
        if (ok) edge = edge_of_event(event)
        if (ok .or. gap_of(body, pair) > parted) return
      end if
      past(:, n) = (point_of(pair, 1) + point_of(pair, 2))/2
      if (waiting == 0) then
        call try_returns(machines, body, past(:, :n), least, saddle, ok)
        if (.not. ok) cycle
        waiting = n
        first_distance = distance_to_saddle(body, saddle, past(:, n))
      end if
      ! Near to a saddle once is not enough: the pair has to come to it.
      distance = distance_to_saddle(body, saddle, past(:, n))
      if (distance < arrived) edge = edge_saddle
      if (edge == edge_saddle) return
      if (distance > moved_off*first_distance .or. n > waiting + most_waiting) waiting = 0
    end do
    if (least > far) edge = edge_recurrent
  end subroutine track_edge

  !> A pair has parted within one period: with its distance before made a thousandth, does it part as much? Then the map is
  !> discontinuous there, and `event` is what only one of the two has.
  pure subroutine look_closer(body, catalogue, span, before, pair, event, discontinuous)
    type(one_body_t), intent(in) :: body
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(pair_t), intent(in) :: before
    type(pair_t), intent(inout) :: pair
    integer, intent(inout) :: event
    logical, intent(out) :: discontinuous
    type(pair_t) :: closer
    real(wp) :: gap
    discontinuous = .false.
    ! Only pairs on the section can be halved.
    if (before%states(1)%time > 0) return
    closer = before
    call bring_together(body, catalogue, span, closest, closer, discontinuous)
    if (.not. discontinuous) return
    gap = gap_of(body, pair)
    call advance_pair(body, closer, event, discontinuous)
    if (.not. discontinuous) return
    discontinuous = event /= 0 .and. gap_of(body, closer) > gap/3
    pair = closer
  end subroutine look_closer

  !> Looks for the nearest return among the last points; from a near one Newton's method, whose orbit is to be near.
  pure subroutine try_returns(machines, body, past, least, saddle, found)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: past(:, :)
    real(wp), intent(inout) :: least
    type(saddle_t), intent(out) :: saddle
    logical, intent(out) :: found
    real(wp) :: distance
    integer :: p, n
    found = .false.
    n = size(past, 2)
    do p = 1, min(longest, n - 1)
      distance = section_distance(body, past(:, n - p), past(:, n))
      if (n > most_periods/2) least = min(least, distance)
      if (distance > near_return) cycle
      call find_saddle(machines, body, past(:, n), p, saddle, found)
      if (found) found = distance_to_saddle(body, saddle, past(:, n)) <= 10*distance + together
      if (found) return
    end do
  end subroutine try_returns

  pure function point_of(pair, side) result(point)
    type(pair_t), intent(in) :: pair
    integer, intent(in) :: side
    real(wp) :: point(2)
    point = [pair%states(side)%x, pair%states(side)%v]
  end function point_of

  pure real(wp) function gap_of(body, pair) result(gap)
    type(one_body_t), intent(in) :: body
    type(pair_t), intent(in) :: pair
    gap = section_distance(body, point_of(pair, 1), point_of(pair, 2))
  end function gap_of

  !> Halves the way between the two on the section, by the labels, down to a distance. `ok` is false where the labels are not
  !> those of the pair, or a third is met.
  pure subroutine bring_together(body, catalogue, span, goal, pair, ok)
    type(one_body_t), intent(in) :: body
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: goal
    type(pair_t), intent(inout) :: pair
    logical, intent(out) :: ok
    real(wp) :: points(2, 2), middle(2)
    integer :: side, label
    do side = 1, 2
      points(:, side) = point_of(pair, side)
      ok = label_start(body%moving, catalogue, span, [points(:, side), 0.0_wp]) == pair%labels(side)
      if (.not. ok) return
    end do
    do while (section_distance(body, points(:, 1), points(:, 2)) > goal)
      middle = points(:, 1) + (points(:, 2) - points(:, 1))/2
      if (all(abs(middle - points(:, 1)) <= 0) .or. all(abs(middle - points(:, 2)) <= 0)) exit
      label = label_start(body%moving, catalogue, span, [middle, 0.0_wp])
      ok = any(pair%labels == label)
      if (.not. ok) return
      points(:, findloc(pair%labels, label, 1)) = middle
    end do
    do side = 1, 2
      pair%states(side) = start_state(body%moving, points(1, side), points(2, side), 0.0_wp)
    end do
  end subroutine bring_together

  !> Moves both to the next section. `event` is the first that only one of them has, 0 if they have the same.
  pure subroutine advance_pair(body, pair, event, ok)
    type(one_body_t), intent(in) :: body
    type(pair_t), intent(inout) :: pair
    integer, intent(out) :: event
    logical, intent(out) :: ok
    type(event_t), allocatable :: events(:), others(:)
    integer :: k
    event = 0
    call advance_one(body, pair%states(1), events, ok)
    if (ok) call advance_one(body, pair%states(2), others, ok)
    if (.not. ok) return
    do k = 1, max(size(events), size(others))
      if (k > size(events)) then
        event = others(k)%kind
      else if (k > size(others)) then
        event = events(k)%kind
      else if (events(k)%kind /= others(k)%kind .or. events(k)%side /= others(k)%side) then
        event = rarer(events(k)%kind, others(k)%kind)
      end if
      if (event /= 0) return
    end do
  end subroutine advance_pair

  !> Of two events at the same place of two sequences the one that tells them apart: chatter, then sticking, then an impact.
  pure integer function rarer(one, other) result(event)
    integer, intent(in) :: one, other
    event = merge(one, other, rank_of(one) >= rank_of(other))
  end function rarer

  pure integer function rank_of(event) result(rank)
    integer, intent(in) :: event
    select case (event)
    case (event_chatter_lower, event_chatter_upper)
      rank = 3
    case (event_stick)
      rank = 2
    case (event_impact_lower, event_impact_upper)
      rank = 1
    case default
      rank = 0
    end select
  end function rank_of

  pure integer function edge_of_event(event) result(edge)
    integer, intent(in) :: event
    integer, parameter :: edges(0:3) = [edge_other_event, edge_graze, edge_stick, edge_chatter]
    edge = edges(rank_of(event))
  end function edge_of_event

  pure subroutine advance_one(body, state, events, ok)
    type(one_body_t), intent(in) :: body
    type(state_t), intent(inout) :: state
    type(event_t), allocatable, intent(out) :: events(:)
    logical, intent(out) :: ok
    type(state_t) :: start
    type(tally_t) :: tally
    type(log_t) :: log
    integer :: reason, mode
    call open_log(log, 0.0_wp)
    log%book%kept = .false.
    start = state
    call advance_period(body%moving, state, tally, reason, log)
    ok = reason == 0
    if (ok) call events_of_body(body, start, log, state, .true., events, mode)
  end subroutine advance_one

  !> Whether a pair, followed without halving, comes near to a saddle and leaves it on two sides: then it started on its stable set.
  !> `number` is that of the saddle, 0 for none.
  pure subroutine reaches_saddle(body, saddles, starts, number)
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddles(:)
    real(wp), intent(in) :: starts(3, 2)
    integer, intent(out) :: number
    type(pair_t) :: pair
    real(wp) :: nearest(size(saddles)), distance
    integer :: n, k, side, reason
    type(tally_t) :: tally
    number = 0
    do side = 1, 2
      pair%states(side) = start_state(body%moving, starts(1, side), starts(2, side), starts(3, side))
    end do
    nearest = huge(nearest)
    do n = 1, most_periods
      do side = 1, 2
        tally = tally_t()
        call advance_period(body%moving, pair%states(side), tally, reason)
        if (reason /= 0) return
      end do
      do k = 1, size(saddles)
        distance = maxval([(distance_to_saddle(body, saddles(k), point_of(pair, side)), side=1, 2)])
        if (distance < nearest(k)) then
          nearest(k) = distance
        else if (nearest(k) < near_saddle .and. distance > left_saddle) then
          ! It leaves: the two together, or each to its side.
          if (gap_of(body, pair) > distance/2) number = k
          if (number > 0) return
          nearest(k) = huge(nearest)
        end if
      end do
      if (gap_of(body, pair) > 1) return
    end do
  end subroutine reaches_saddle

end module edge_state
