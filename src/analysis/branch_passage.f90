! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What lies between two points of a branch: margins that pass zero, folds, doublings and the like, located to rounding; and the
!> way on with another sequence of events.
module branch_passage
  use body_family, only: family_t
  use branch_crossing, only: locate_branch_point, no_test, test_circle, test_minus, test_plus, test_turn, test_value
  use branch_point, only: label_bp, label_gr, label_gr_fold, label_not_known, label_ns, label_pd, label_sn, label_stick, &
    label_stiction, no_label, point_t, set_point, step_to, trace_t
  use kinds, only: wp
  use margin_cause, only: cause_of, together
  use motion_state, only: event_separation
  use orbit_margins, only: margin_t, margins_t, of_gap, of_hold, of_impact, of_order, of_release, of_slip, of_stick, &
    of_turning, same_meaning
  use other_sequence, only: change_sequence
  use orbit_motion, only: is_admissible
  use periodic_orbit, only: correct_orbit, orbit_t
  use orbit_directions, only: direct
  use short_slip, only: has_slip_in_stick, stays_stuck, sticks_apart, with_slip
  use secant_bracket, only: bracket_t, narrow, next_trial
  use soft_graze, only: enter_apart, is_touch, touches_apart, touching, vanishing_touch
  use structure, only: structure_t
  use structure_sequence, only: change_structure_sequence
  implicit none
  private

  public :: first_passed, note_bifurcations, label_of_margin, change_all, enter_sequence

  !> A margin within this of 0 is not passed.
  real(wp), parameter, public :: no_passage = 1e-11_wp
  integer, parameter, public :: most_secants = 60
  !> A test of multipliers that is below this on both sides of a step is zero throughout.
  real(wp), parameter :: rounding = 1e-9_wp
  !> First look beyond a point where the sequence changes, as a share of the largest step.
  real(wp), parameter :: first_look = 1e-4_wp
  !> How much longer slips within sticks are taken to be than touches and sticks where they begin.
  real(wp), parameter :: slip_room = 10

  !> What is zero at a point that is looked for: a test, or, without, a margin.
  type :: target_t
    integer :: test = no_test
    type(margin_t) :: margin
  end type target_t

contains

  !> The first margin that is passed between two points; `length` becomes the distance to it and `next` the point there.
  subroutine first_passed(family, trace, next, length, passed)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    type(trace_t), intent(inout) :: next
    real(wp), intent(inout) :: length
    type(margin_t), intent(out) :: passed
    type(trace_t) :: there
    type(margin_t) :: candidate
    integer :: tries, i
    logical :: ok
    do tries = 1, 8
      call most_negative(trace%margins, next%margins, candidate)
      if (candidate%kind == 0) return
      call locate(family, trace, next, target_t(margin=candidate), length, there, ok)
      if (.not. ok) return
      candidate%time = time_like(there%margins, candidate)
      next = there
      passed = candidate
      i = vanishing_touch(there%now%orbit, there%margins, candidate%joint)
      if (i == 0) i = cause_of(there%now%orbit, there%margins, candidate)
      if (i == 0) cycle
      ! The order of its events and the gap pass zero with it.
      passed = there%margins%list(i)
      return
    end do
  end subroutine first_passed

  !> The margin that falls below zero first, by linear interpolation.
  pure subroutine most_negative(before, after, candidate)
    type(margins_t), intent(in) :: before, after
    type(margin_t), intent(out) :: candidate
    real(wp) :: share, first, old
    integer :: i
    first = 2
    do i = 1, size(after%list)
      if (.not. after%list(i)%value < -no_passage) cycle
      old = value_like(before, after%list(i))
      share = 1
      if (old < huge(old)) share = max(old, 0.0_wp)/(max(old, 0.0_wp) - after%list(i)%value)
      if (share >= first) cycle
      first = share
      candidate = after%list(i)
    end do
  end subroutine most_negative

  !> Value of the margin of the same meaning.
  pure real(wp) function value_like(margins, margin) result(value)
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: margin
    integer :: i
    value = huge(value)
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (same_meaning(one, margin)) value = one%value
      end associate
    end do
  end function value_like

  !> The point between two of a branch where a test or a margin passes zero, by the Illinois form of the secant rule over the
  !> length of the step, by halving where the first has no such margin; `length` becomes its distance.
  subroutine locate(family, trace, next, target, length, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    type(target_t), intent(in) :: target
    real(wp), intent(inout) :: length
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    type(bracket_t) :: bracket
    real(wp) :: s, f
    integer :: i, steps
    bracket = bracket_t(0.0_wp, length, value_of(target, trace), value_of(target, next))
    ! A margin that is not passed within rounding.
    if (target%test == no_test) bracket%at_low = max(bracket%at_low, 0.0_wp)
    there = next
    ok = .true.
    s = length
    do i = 1, most_secants
      s = next_trial(bracket)
      call step_to(family, trace, s, there, ok, steps, roughly=target%test == no_test)
      if (.not. ok) return
      f = value_of(target, there)
      call narrow(bracket, s, f)
      if (abs(f) <= 4*epsilon(f) .or. bracket%high - bracket%low <= 4*spacing(bracket%high)) exit
    end do
    length = s
  end subroutine locate

  !> What is zero at a target; `huge` where the orbit has no such margin.
  pure real(wp) function value_of(target, trace) result(value)
    type(target_t), intent(in) :: target
    type(trace_t), intent(in) :: trace
    if (target%test == no_test) then
      value = value_like(trace%margins, target%margin)
    else
      value = test_value(target%test, trace)
    end if
  end function value_of

  pure real(wp) function time_like(margins, margin) result(time)
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: margin
    integer :: i
    time = margin%time
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (one%kind == margin%kind .and. one%side == margin%side .and. one%event == margin%event .and. &
            one%joint == margin%joint .and. one%guard == margin%guard) time = one%time
      end associate
    end do
  end function time_like

  !> Folds, doublings and the like between two points of one sequence of events: located, and added to the points. In a fold the
  !> parameter turns and a multiplier passes +1; where only one of these happens another branch crosses. Where a margin is zero at
  !> `next` (`at_margin`) multipliers may have no value: what is looked at ends just before.
  subroutine note_bifurcations(family, trace, next, length, at_margin, points)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    real(wp), intent(in) :: length
    logical, intent(in) :: at_margin
    type(point_t), allocatable, intent(inout) :: points(:)
    type(trace_t) :: end_point
    real(wp) :: span
    integer :: steps
    logical :: ok
    ok = at_margin
    span = length
    if (ok) span = length*(1 - 1e-6_wp)
    if (ok) call step_to(family, trace, span, end_point, ok, steps)
    if (ok) then
      call note_between(family, trace, end_point, span, points)
    else
      call note_between(family, trace, next, span, points)
    end if
  end subroutine note_bifurcations

  !> The same on the whole of a step, of the length `span`, to `end_point`.
  subroutine note_between(family, trace, end_point, span, points)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, end_point
    real(wp), intent(in) :: span
    type(point_t), allocatable, intent(inout) :: points(:)
    logical :: ok, turns, passes
    turns = changes(test_turn)
    passes = changes(test_plus)
    if (turns) then
      call add(merge(label_sn, label_bp, passes), test_turn)
    else if (passes) then
      call add(label_bp, test_plus)
    end if
    if (changes(test_minus)) call add(label_pd, test_minus)
    if (changes(test_circle)) call add(label_ns, test_circle)

  contains

    logical function changes(test)
      integer, intent(in) :: test
      real(wp) :: before, after
      before = test_value(test, trace)
      after = test_value(test, end_point)
      changes = before*after < 0
      ! What stays zero, as without losses, changes its sign by rounding.
      if (test /= test_turn) changes = changes .and. max(abs(before), abs(after)) > rounding
    end function changes

    subroutine add(label, test)
      integer, intent(in) :: label, test
      type(trace_t) :: there
      real(wp) :: distance
      distance = span
      if (label == label_bp) then
        call locate_branch_point(family, trace, end_point, test, span, there, ok)
      else
        call locate(family, trace, end_point, target_t(test), distance, there, ok)
      end if
      if (ok) ok = is_genuine(label, there%now%orbit)
      if (.not. ok) return
      there%now%label = label
      points = [points, there%now]
    end subroutine add

  end subroutine note_between

  !> Whether a multiplier is where the label requires it; near a graze its rounding is large.
  pure logical function is_genuine(label, orbit) result(genuine)
    integer, intent(in) :: label
    type(orbit_t), intent(in) :: orbit
    select case (label)
    case (label_pd)
      genuine = minval(abs(orbit%multipliers + 1)) < 1e-5_wp
    case (label_sn, label_bp)
      genuine = minval(abs(orbit%multipliers - 1)) < 1e-5_wp
    case (label_ns)
      genuine = any(abs(aimag(orbit%multipliers)) > 0 .and. abs(abs(orbit%multipliers) - 1) < 1e-5_wp)
    case default
      genuine = .true.
    end select
  end function is_genuine

  !> Label of the event at which a margin is zero.
  pure integer function label_of_margin(margin) result(label)
    type(margin_t), intent(in) :: margin
    select case (margin%kind)
    case (of_impact, of_gap)
      label = label_gr
    case (of_turning, of_stick, of_slip, of_hold)
      label = label_stick
    case (of_release)
      label = label_stiction
    case (of_order)
      label = no_label
    case default
      label = label_not_known
    end select
  end function label_of_margin

  !> Changes the sequence where `passed` and every other margin of its kind is zero: a symmetric orbit has two.
  subroutine change_all(at, passed, changed, known)
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    type(orbit_t), intent(out) :: changed
    logical, intent(out) :: known
    type(orbit_t) :: before
    real(wp) :: crossed_event(size(at%margins%list)), nil
    integer :: i
    changed = at%now%orbit
    known = .true.
    crossed_event = -1
    do i = 1, size(crossed_event)
      associate (one => at%margins%list(i))
        if (one%kind /= passed%kind) cycle
        nil = merge(touching, together, is_touch(at%now%orbit, one))
        if (.not. abs(one%value) <= nil) cycle
        ! The end of a touch goes with its beginning.
        if (one%kind == of_impact) then
          if (at%now%orbit%events(one%event)%kind == event_separation) cycle
        end if
        crossed_event(i) = one%event
        ! After an event that comes with its number turned round.
        if (one%event < 0) crossed_event(i) = -one%event - 0.5_wp
        if (one%kind == of_slip .and. one%event >= 0) crossed_event(i) = one%event + 0.5_wp
      end associate
    end do
    if (all(crossed_event < 0)) known = .false.
    ! From the last on, so that the numbers of the others stay.
    do while (any(crossed_event >= 0) .and. known)
      i = maxloc(crossed_event, 1)
      crossed_event(i) = -1
      before = changed
      if (stops_later(at, at%margins%list(i))) then
        changed = with_slip(at%machines%centre, before, at%margins%list(i)%event)
        cycle
      end if
      select type (machine => at%machines%centre)
      type is (structure_t)
        call change_structure_sequence(machine, before, at%margins%list(i), changed, known)
      class default
        call change_sequence(machine, before, at%margins%list(i), changed, known)
      end select
    end do
  end subroutine change_all

  !> Whether the joint turns round and slips back for a while before it sticks, where the margin of its stick is zero.
  pure logical function stops_later(at, margin)
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: margin
    stops_later = margin%kind == of_stick .and. margin%event > 0
    if (stops_later) stops_later = stays_stuck(at%machines%centre, at%now%orbit, margin%event)
  end function stops_later

  !> A first point with the new sequence, on the side on which its motion really has those events: with the events that are one
  !> there a little apart where the equations are singular else.
  subroutine enter_sequence(family, at, step, beyond, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    real(wp), intent(in) :: step
    type(trace_t), intent(inout) :: beyond
    logical, intent(out) :: ok
    real(wp) :: along(size(beyond%now%orbit%y) + size(beyond%now%orbit%events) + 1)
    along = touches_apart(beyond%now%orbit)
    if (.not. any(abs(along) > 0)) then
      ok = .false.
      if (.not. has_slip_in_stick(beyond%now%orbit)) call enter_beside(family, at, step, beyond, ok)
      if (ok) return
      along = sticks_apart(beyond%now%orbit)
    end if
    ok = any(abs(along) > 0)
    if (.not. ok) return
    ! What grows with the cube of the length of a slip is resolved by its equations if the slip is not too short.
    if (has_slip_in_stick(beyond%now%orbit)) along = slip_room*along
    call enter_apart(family, at, along, no_passage, beyond, ok)
    if (ok) beyond%step = 0.1_wp*step
  end subroutine enter_sequence

  !> The same by looks along the branch of the new sequence, both ways.
  subroutine enter_beside(family, at, step, beyond, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    real(wp), intent(in) :: step
    type(trace_t), intent(inout) :: beyond
    logical, intent(out) :: ok
    type(trace_t) :: start, there, tried(2)
    real(wp) :: look, beyond_step, along(size(beyond%now%orbit%y) + size(beyond%now%orbit%events) + 1)
    logical :: fits(2), found, resolved
    integer :: way, tries, steps
    start%machines = at%machines
    start%now%orbit = beyond%now%orbit
    call correct_orbit(family, start%machines, start%now%orbit, direct(start%now%orbit, 1), ok, roughly=.true.)
    if (.not. ok) return
    along = direct(start%now%orbit, nint(sign(1.0_wp, at%now%tangent(size(at%now%tangent)))))
    call set_point(family, start, along, ok)
    if (.not. ok) return
    along = start%now%tangent
    look = first_look*step
    found = .false.
    resolved = .false.
    do tries = 1, 4
      do way = 1, 2
        start%now%tangent = merge(1, -1, way == 1)*along
        call step_to(family, start, look, tried(way), fits(way), steps, roughly=.true.)
        if (fits(way)) fits(way) = all(tried(way)%margins%list%value > -no_passage)
        if (fits(way)) fits(way) = is_admissible(tried(way)%machines, tried(way)%now%orbit)
      end do
      if (any(fits) .and. .not. (found .and. all(fits))) then
        there = tried(findloc(fits, .true., 1))
        beyond_step = max(look, 0.1_wp*step)
        found = .true.
        resolved = .not. all(fits)
        ! So near the point both sides may be on it within rounding: a longer step distinguishes them.
        if (.not. all(fits) .and. all(there%margins%list%value > no_passage)) exit
      end if
      look = 10*look
    end do
    ! Where both sides seem to be on it at every step, nothing determines to which of them the branch goes on.
    ok = resolved
    if (.not. ok) return
    beyond = there
    beyond%step = beyond_step
  end subroutine enter_beside

end module branch_passage
