! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a basin boundary leads to: two motions that start on its two sides are followed from section to section while they are
!> together. They come near to a saddle orbit, or part at once at an event that only one of them has, or wander on. Edge
!> tracking by bisection: J. D. Skufca, J. A. Yorke, B. Eckhardt, Phys. Rev. Lett. 96 (2006).
module edge_state
  use attractors, only: attractor_t
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, event_stick, &
    event_touch_lower, event_touch_upper, tally_t, take_turns
  use saddle_search, only: distance_to_saddle, find_saddle, saddle_t, section_distance, sides_of_saddle
  use start_label, only: label_from, label_not_known, label_of
  use single_trajectory, only: outcome_t, run_trajectory, span_t
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

  !> Drive periods that a pair is followed, and more where it is on its way to a saddle; and the longest saddle that is looked for.
  integer, parameter :: most_periods = 300, most_arriving = 900, longest = 32
  !> Distances in natural sizes: at which a pair is brought together again and to which, at which it has parted.
  real(wp), parameter :: apart = 1e-6_wp, together = 1e-10_wp, closest = 1e-13_wp, parted = 1e-2_wp
  !> Growth of the distance within one period that is looked at more closely where one has an event that the other has not.
  real(wp), parameter :: sudden = 1e3_wp
  !> A return so near is tried with Newton's method. A motion settles on no cycle where its returns, after the number of periods
  !> after which they are the nearest, are `far` still in its last quarter, and not less than this share of what they were.
  real(wp), parameter :: near_return = 1e-3_wp, far = 0.1_wp, settling = 0.8_wp
  !> It has come to a saddle at this distance; it has not where the distance grows so many times, or after so many periods.
  real(wp), parameter :: arrived = 1e-5_wp, moved_off = 20
  integer, parameter :: waiting_least = 60
  !> Halvings of the way between two starts.
  integer, parameter :: start_halvings = 10
  !> A pair leaves a saddle that it has come as near to as `near_saddle` on two sides: before it is as far as `left_saddle` both are
  !> so many times as far from the stable set as at first, or as what the saddle is known to.
  real(wp), parameter :: near_saddle = 3e-3_wp, left_saddle = 2e-2_wp, leaves = 10, known_to = 1e-9_wp

  !> What labels a motion: the machine, its trajectories, and the attractors that they may come to.
  type, public :: labeller_t
    class(machine_t), allocatable :: moving
    type(attractor_t), allocatable :: catalogue(:)
    type(span_t) :: span
  end type labeller_t

  !> Two motions, one on either side of a boundary: section points (columns), or, before the first section, starts as
  !> `machine_t` has them.
  type :: pair_t
    real(wp), allocatable :: points(:, :)
    logical :: on_section = .false.
    integer :: labels(2) = 0
    !> A third label was met between the two, and the second is that one now.
    logical :: mixed = .false.
  end type pair_t

contains

  !> Follows the pair that starts at the columns of `starts` with `labels`, halving its distance by the labels whenever it grows.
  !> `edge` is one of the codes above; `saddle` is the orbit where it is `edge_saddle`. Where a third label was met on the way it is
  !> that of another pair of labels: `edge` is not known then, but the periods of `saddle` are not 0.
  pure subroutine track_edge(machines, labeller, starts, labels, edge, saddle)
    type(neighbourhood_t), intent(in) :: machines
    type(labeller_t), intent(in) :: labeller
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: labels(2)
    integer, intent(out) :: edge
    type(saddle_t), intent(out) :: saddle
    type(pair_t) :: pair, before
    type(saddle_t) :: candidate
    real(wp) :: past(machines%centre%n, most_arriving), distance, first_distance, gap
    integer :: n, event, waiting, most
    logical :: ok
    edge = edge_not_known
    waiting = 0
    pair = pair_t(starts, .false., labels)
    do n = 1, most_arriving
      if (n > most_periods .and. waiting == 0) exit
      if (n > 1) then
        if (gap_of(machines%centre, pair) > apart) call bring_together(machines%centre, labeller, together, pair, ok)
        if (.not. ok) return
      end if
      before = pair
      call advance_pair(machines%centre, pair, event, ok)
      if (.not. ok) return
      gap = gap_of(machines%centre, pair)
      if (gap > parted .or. (event /= 0 .and. gap > sudden*gap_before(machines%centre, before))) then
        call look_closer(machines%centre, labeller, before, pair, event, ok)
        if (ok .and. .not. pair%mixed) edge = edge_of_event(event)
        if (ok .or. gap_of(machines%centre, pair) > parted) return
        ok = .true.
      end if
      past(:, n) = pair%points(:, 1) + (machines%centre%nearest_copy(pair%points(:, 2), pair%points(:, 1)) - pair%points(:, 1))/2
      if (waiting == 0) then
        call try_returns(machines, past(:, :n), candidate, ok)
        if (ok) then
          first_distance = distance_to_saddle(machines%centre, candidate, past(:, n))
          waiting = n
          most = waiting_of(candidate, first_distance)
        end if
        ok = .true.
      end if
      if (waiting == 0) cycle
      ! Near to a saddle once is not enough: the pair has to come to it.
      distance = distance_to_saddle(machines%centre, candidate, past(:, n))
      if (distance < arrived) then
        saddle = candidate
        if (.not. pair%mixed) edge = edge_saddle
        return
      end if
      if (distance > moved_off*first_distance .or. n > waiting + most) waiting = 0
    end do
    if (.not. pair%mixed .and. wanders(machines%centre, past(:, :most_periods))) edge = edge_recurrent
  end subroutine track_edge

  !> Periods that a pair may take from a distance to where it has arrived, as the saddle attracts.
  pure integer function waiting_of(saddle, distance) result(most)
    type(saddle_t), intent(in) :: saddle
    real(wp), intent(in) :: distance
    real(wp) :: rate
    rate = -log(max(tiny(rate), maxval(abs(saddle%multipliers(2:)))))/saddle%periods
    most = max(waiting_least, ceiling(min(real(most_arriving, wp), 2*log(max(1.0_wp, distance/arrived))/rate)))
  end function waiting_of

  !> Whether a motion settles on no cycle of up to `longest` periods: to its end it comes back far from where it was.
  pure logical function wanders(machine, past)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: past(:, :)
    real(wp) :: largest(2), best(2)
    integer :: p, n, quarter
    quarter = size(past, 2)/4
    best = huge(best)
    do p = 1, longest
      largest = 0
      do n = quarter + 1, 2*quarter
        largest(1) = max(largest(1), section_distance(machine, past(:, n - p), past(:, n)))
        largest(2) = max(largest(2), section_distance(machine, past(:, n + 2*quarter - p), past(:, n + 2*quarter)))
      end do
      if (largest(2) < best(2)) best = largest
    end do
    wanders = best(2) > far .and. best(2) >= settling*best(1)
  end function wanders

  !> Distance from which a pair has grown; of starts the least that is looked at.
  pure real(wp) function gap_before(machine, pair) result(gap)
    class(hybrid_t), intent(in) :: machine
    type(pair_t), intent(in) :: pair
    gap = together
    if (pair%on_section) gap = max(gap, gap_of(machine, pair))
  end function gap_before

  !> A pair has parted within one period: with its distance before made a thousandth, or less, does it part as much? Then the map is
  !> discontinuous there, and `event` is what only one of the two has.
  pure subroutine look_closer(machine, labeller, before, pair, event, discontinuous)
    class(hybrid_t), intent(in) :: machine
    type(labeller_t), intent(in) :: labeller
    type(pair_t), intent(in) :: before
    type(pair_t), intent(inout) :: pair
    integer, intent(inout) :: event
    logical, intent(out) :: discontinuous
    type(pair_t) :: closer
    real(wp) :: gap
    closer = before
    call bring_together(machine, labeller, closest, closer, discontinuous)
    if (.not. discontinuous) return
    gap = gap_of(machine, pair)
    call advance_pair(machine, closer, event, discontinuous)
    if (.not. discontinuous) return
    discontinuous = event /= 0 .and. gap_of(machine, closer) > gap/3
    pair = closer
  end subroutine look_closer

  !> Looks for the nearest return among the last points; from a near one Newton's method, whose orbit is to be near.
  pure subroutine try_returns(machines, past, saddle, found)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: past(:, :)
    type(saddle_t), intent(out) :: saddle
    logical, intent(out) :: found
    real(wp) :: distance
    integer :: p, n
    found = .false.
    n = size(past, 2)
    do p = 1, min(longest, n - 1)
      distance = section_distance(machines%centre, past(:, n - p), past(:, n))
      if (distance > near_return) cycle
      call find_saddle(machines, past(:, n), p, saddle, found)
      ! What comes to it slowly is far from it still.
      if (found) found = distance_to_saddle(machines%centre, saddle, past(:, n)) <= &
        10*distance/(1 - maxval(abs(saddle%multipliers(2:)))) + together
      if (found) return
    end do
  end subroutine try_returns

  !> Distance of a pair on the section.
  pure real(wp) function gap_of(machine, pair) result(gap)
    class(hybrid_t), intent(in) :: machine
    type(pair_t), intent(in) :: pair
    gap = section_distance(machine, pair%points(:, 1), pair%points(:, 2))
  end function gap_of

  !> Label of a section point, or of a start.
  pure integer function label_at(machine, labeller, on_section, point) result(label)
    class(hybrid_t), intent(in) :: machine
    type(labeller_t), intent(in) :: labeller
    logical, intent(in) :: on_section
    real(wp), intent(in) :: point(:)
    type(outcome_t) :: outcome
    type(section_state_t) :: section
    logical :: ok
    if (on_section) then
      call machine%begin(point, section, ok)
      call take_turns(machine%turn, section%state)
      label = label_not_known
      if (ok) label = label_from(labeller%moving, labeller%catalogue, labeller%span, section)
    else
      call run_trajectory(labeller%moving, labeller%catalogue, labeller%span, point, outcome)
      label = label_of(outcome)
    end if
  end function label_at

  !> Halves the way between the two, by the labels: on the section down to the distance `goal`, of starts to a thousandth. Where a
  !> third label is met the pair is `mixed`, and stays on the boundary of the first. `ok` is false where the labels are not those of
  !> the pair, or one is not known.
  pure subroutine bring_together(machine, labeller, goal, pair, ok)
    class(hybrid_t), intent(in) :: machine
    type(labeller_t), intent(in) :: labeller
    real(wp), intent(in) :: goal
    type(pair_t), intent(inout) :: pair
    logical, intent(out) :: ok
    real(wp) :: points(size(pair%points, 1), 2), middle(size(pair%points, 1))
    integer :: side, label, halvings, i
    points = pair%points
    do side = 1, 2
      ok = label_at(machine, labeller, pair%on_section, points(:, side)) == pair%labels(side)
      if (.not. ok) return
    end do
    halvings = start_halvings
    if (pair%on_section) halvings = ceiling(log(max(1.0_wp, gap_of(machine, pair)/goal))/log(2.0_wp))
    do i = 1, halvings
      middle = points(:, 1) + (points(:, 2) - points(:, 1))/2
      if (all(abs(middle - points(:, 1)) <= 0) .or. all(abs(middle - points(:, 2)) <= 0)) exit
      label = label_at(machine, labeller, pair%on_section, middle)
      ok = label /= label_not_known
      if (.not. ok) return
      if (.not. any(pair%labels == label)) then
        pair%labels(2) = label
        pair%mixed = .true.
      end if
      points(:, findloc(pair%labels, label, 1)) = middle
    end do
    pair%points = points
  end subroutine bring_together

  !> Moves both to the next section. `event` is the first that only one of them has, 0 if they have the same.
  pure subroutine advance_pair(machine, pair, event, ok)
    class(hybrid_t), intent(in) :: machine
    type(pair_t), intent(inout) :: pair
    integer, intent(out) :: event
    logical, intent(out) :: ok
    type(event_t), allocatable :: events(:), others(:)
    real(wp) :: images(machine%n, 2)
    integer :: k
    event = 0
    call advance_one(machine, pair, 1, images(:, 1), events, ok)
    if (ok) call advance_one(machine, pair, 2, images(:, 2), others, ok)
    if (.not. ok) return
    pair = pair_t(images, .true., pair%labels, pair%mixed)
    do k = 1, max(size(events), size(others))
      if (k > size(events)) then
        event = others(k)%kind
      else if (k > size(others)) then
        event = events(k)%kind
      else if (events(k)%kind /= others(k)%kind .or. events(k)%side /= others(k)%side .or. &
               events(k)%joint /= others(k)%joint) then
        event = rarer(events(k)%kind, others(k)%kind)
      end if
      if (event /= 0) return
    end do
  end subroutine advance_pair

  pure subroutine advance_one(machine, pair, side, image, events, ok)
    class(hybrid_t), intent(in) :: machine
    type(pair_t), intent(in) :: pair
    integer, intent(in) :: side
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    logical, intent(out) :: ok
    type(tally_t) :: tally
    integer :: mode
    if (pair%on_section) then
      call machine%fly_sections(pair%points(:, side), 1, .true., image, events, mode, tally, ok)
    else
      call machine%fly_to_section(pair%points(:, side), image, events, ok)
    end if
  end subroutine advance_one

  !> Of two events at the same index of two sequences the one that distinguishes them: chatter, then sticking, then an impact.
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
    case (event_impact_lower, event_impact_upper, event_touch_lower, event_touch_upper)
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

  !> Whether a pair, followed without halving, comes near to a saddle and leaves it on the two sides of its stable set: then it
  !> started on either side of that. `number` is that of the saddle, 0 for none.
  pure subroutine reaches_saddle(machine, saddles, starts, number)
    class(hybrid_t), intent(in) :: machine
    type(saddle_t), intent(in) :: saddles(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(out) :: number
    type(pair_t) :: pair
    type(event_t), allocatable :: events(:)
    real(wp) :: entered(2, size(saddles)), distance, sides(2), images(machine%n, 2)
    integer :: n, k, side
    logical :: ok
    number = 0
    pair = pair_t(starts, .false.)
    entered = 0
    do n = 1, most_periods
      do side = 1, 2
        call advance_one(machine, pair, side, images(:, side), events, ok)
        if (.not. ok) return
      end do
      pair = pair_t(images, .true.)
      do k = 1, size(saddles)
        call sides_of_saddle(machine, saddles(k), images, distance, sides)
        if (distance > left_saddle) then
          entered(:, k) = 0
        else if (entered(1, k) > 0) then
          if (product(sides) < 0 .and. all(abs(sides) > leaves*entered(:, k))) number = k
          if (number > 0) return
        else if (distance < near_saddle) then
          entered(:, k) = max(known_to, abs(sides))
        end if
      end do
      if (gap_of(machine, pair) > 1) return
    end do
  end subroutine reaches_saddle

end module edge_state
