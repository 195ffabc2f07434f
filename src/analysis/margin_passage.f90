! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The orbit of a branch where a margin is zero: its label, and the way on with the sequence of events beyond.
module margin_passage
  use body_family, only: family_t
  use branch_passage, only: change_all, enter_sequence, label_of_margin
  use branch_point, only: label_gr, label_gr_fold, label_not_known, label_run, label_stiction, no_label, plan_t, point_t, trace_t
  use graze_passage, only: grazes_twice, is_repeated, leave_by_stick
  use hybrid_machine, only: event_t
  use kinds, only: wp
  use motion_state, only: event_stick, event_turning_point
  use orbit_margins, only: is_impact, margin_t, of_gap, of_hold, of_impact, of_order, of_release, of_stick, of_turning
  use periodic_orbit, only: orbit_t
  use short_slip, only: short_slip_of, slips_on
  use soft_fold, only: begin_touching, beginning_t, duration_of, gap_beside
  use soft_graze, only: is_touch, locate_missed_graze, touches_apart
  implicit none
  private

  public :: pass_margin, begins_chatter

  !> With so many impacts in a row no more are put in: they are the beginning of a chatter.
  integer, parameter :: long_run = 10
  !> And with so many, each slower than the one before, the last of this speed in natural sizes: the next would rise no higher than
  !> rounding resolves.
  integer, parameter :: least_run = 4
  real(wp), parameter :: hardly_an_impact = 1e-5_wp
  !> Touches up to which a fold is looked for that was not seen before a graze, in natural times.
  real(wp), parameter :: longest_touch = 0.1_wp

contains

  !> The orbit `at` where a margin is zero, from `trace` on: its label, and on with the sequence of events beyond, if there is one.
  subroutine pass_margin(family, plan, trace, at, passed, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(inout) :: trace
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: beyond
    type(point_t), allocatable :: here(:)
    type(orbit_t) :: changed
    logical :: goes_on
    integer :: k
    k = short_pair(at, passed)
    if (k > 0) then
      ! A stick has been left where its margin is zero, if its equations lead there.
      if (at%now%orbit%events(k)%kind /= event_stick) then
        call pass_without(family, plan, at, k, trace, points, ending)
        ! A release by a force that only just reaches friction would be taken for the end of sticking.
        if (ending == no_label .or. passed%kind == of_release) return
      end if
    end if
    ending = no_label
    here = [at%now]
    here%label = label_of_margin(passed)
    if (passed%kind == of_hold) then
      if (slips_on(at%machines%centre, at%now%orbit, passed)) here%label = label_stiction
    end if
    if (here(1)%label == label_gr .and. (is_repeated(at) .or. grazes_twice(at))) then
      ending = label_gr
      points = [points, here]
      return
    end if
    goes_on = here(1)%label /= label_stiction
    if (goes_on) call go_beyond(family, at, passed, trace%step, changed, beyond, goes_on)
    if (k > 0 .and. .not. goes_on) then
      call pass_without(family, plan, at, k, trace, points, ending)
      if (ending == no_label) return
    end if
    if (.not. goes_on) then
      ! Two events that change their order are no bifurcation, if the motion goes on.
      if (here(1)%label == no_label) here%label = label_not_known
      ending = here(1)%label
    else if (is_touch(at%now%orbit, passed)) then
      call leave_contact(family, beyond, passed, points(size(points))%orbit%parameter, here)
    else if (here(1)%label == label_gr .and. any(abs(touches_apart(changed)) > 0)) then
      call enter_contact(family, at, passed, changed, beyond, here)
    else if (here(1)%label == label_gr) then
      if (rise_of(at%now)*rise_of(beyond%now) < 0) here%label = label_gr_fold
    end if
    points = [points, here]
    ! Impact after impact is put in as a chatter is approached.
    if (passed%kind == of_gap .and. longest_run(at%now%orbit) >= long_run) ending = label_run
    if (ending /= no_label) return
    points = [points, beyond%now]
    beyond%came = beyond%step
    trace = beyond
  end subroutine pass_margin

  !> The orbit `changed` at a margin, with the events beyond it, and the point `beyond` that is `step` further, if there is one.
  subroutine go_beyond(family, at, passed, step, changed, beyond, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    real(wp), intent(in) :: step
    type(orbit_t), intent(out) :: changed
    type(trace_t), intent(inout) :: beyond
    logical, intent(out) :: ok
    call change_all(at, passed, changed, ok)
    if (ok) beyond%now%orbit = changed
    if (ok) call enter_sequence(family, at, step, beyond, ok)
    ! An orbit of a shorter period near by is not what goes on there.
    if (ok) ok = .not. is_repeated(beyond)
  end subroutine go_beyond

  !> The event with which a slip, or stick, begins that lasts for next to no time, if what is zero belongs to it: all of its margins
  !> are zero together, and the orbit goes on without it. 0 without.
  pure integer function short_pair(at, passed) result(k)
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    k = 0
    if (all(passed%kind /= [of_turning, of_release, of_order, of_stick])) return
    k = short_slip_of(at%machines%centre, at%now%orbit, max(1, passed%event - 1))
    if (k > passed%event) k = 0
  end function short_pair

  !> From `at` on without the slip, or stick, after the event `k`; `ending` is no label where the branch goes on so, from `trace`.
  subroutine pass_without(family, plan, at, k, trace, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(in) :: at
    integer, intent(in) :: k
    type(trace_t), intent(inout) :: trace
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there
    there = at
    call leave_by_stick(family, plan, there, k, points, ending)
    if (ending == no_label) trace = there
  end subroutine pass_without

  !> Rise of the parameter along the branch.
  pure real(wp) function rise_of(point)
    type(point_t), intent(in) :: point
    rise_of = point%tangent(size(point%tangent))
  end function rise_of

  !> The label of the graze `here` of a soft contact from the side that misses it, and the folds behind it that come before
  !> `beyond`; `touching` is the orbit at the graze with a touch of no duration.
  subroutine enter_contact(family, at, gap, touching, beyond, here)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at, beyond
    type(margin_t), intent(in) :: gap
    type(orbit_t), intent(in) :: touching
    type(point_t), allocatable, intent(inout) :: here(:)
    type(beginning_t) :: beginning
    integer :: before, after
    before = nint(sign(1.0_wp, rise_of(at%now)))
    after = nint(sign(1.0_wp, rise_of(beyond%now)))
    call begin_touching(family, at, gap, duration_of(family, at, touching, beyond%now%orbit), beginning)
    here%label = label_between(before, beginning%at_graze, before == after)
    if (.not. beginning%all_found) here%label = label_not_known
    here = [here, beginning%folds]
  end subroutine enter_contact

  !> The graze `here` of a soft contact by the orbit that misses it, `beyond`, for the equations of that which touches are singular
  !> there; its label, and the fold before it, if the parameter came from its value `last` in another direction than it has there.
  subroutine leave_contact(family, beyond, touch, last, here)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: beyond
    type(margin_t), intent(in) :: touch
    real(wp), intent(in) :: last
    type(point_t), allocatable, intent(inout) :: here(:)
    type(beginning_t) :: beginning
    type(trace_t) :: graze
    integer :: before, after
    logical :: ok
    call locate_missed_graze(family, beyond, touch, here(1)%orbit%parameter, graze, ok)
    after = nint(sign(1.0_wp, rise_of(beyond%now)))
    if (ok) then
      graze%now%label = here(1)%label
      here = [graze%now]
      call begin_touching(family, graze, gap_beside(graze, touch), longest_touch, beginning)
    end if
    ! The tangents of the last points are less reliable: they may be beyond the graze by rounding, where touches end before they
    ! begin.
    before = nint(sign(1.0_wp, here(1)%orbit%parameter - last))
    here%label = label_between(-beginning%at_graze, after, before == after)
    if (beginning%at_graze == 0 .or. -beginning%at_graze == before) return
    ! The fold that distinguishes one direction from the other.
    if (size(beginning%folds) > 0 .and. beginning%all_found) then
      here = [beginning%folds(1), here]
    else
      here%label = label_not_known
    end if
  end subroutine leave_contact

  !> The label of a graze with the directions of the parameter on its two sides, 0 where one is not known. `alike`: those some way
  !> off are the same.
  pure integer function label_between(before, after, alike) result(label)
    integer, intent(in) :: before, after
    logical, intent(in) :: alike
    label = merge(label_gr, label_gr_fold, before == after)
    if (before*after == 0) label = merge(label_gr, label_not_known, alike)
  end function label_between

  !> Whether an orbit has impacts in a row that fade until they are hardly any: those of a chatter.
  pure logical function begins_chatter(trace) result(begins)
    type(trace_t), intent(in) :: trace
    type(event_t) :: last
    real(wp) :: speed
    integer :: i, run
    begins = .false.
    run = 0
    speed = 0
    do i = 1, size(trace%margins%list)
      associate (one => trace%margins%list(i))
        if (one%kind /= of_impact) cycle
        associate (event => trace%now%orbit%events(one%event))
          if (event%kind /= last%kind .or. event%joint /= last%joint .or. one%value > speed) run = 0
          run = merge(run + 1, 0, is_impact(event%kind))
          last = event
        end associate
        speed = one%value
        begins = begins .or. (run >= least_run .and. speed < hardly_an_impact)
      end associate
    end do
  end function begins_chatter

  !> Impacts in a row on one side of a joint, turning points aside.
  pure integer function longest_run(orbit) result(longest)
    type(orbit_t), intent(in) :: orbit
    type(event_t) :: last
    integer :: k, run
    run = 0
    longest = 0
    do k = 1, size(orbit%events)
      associate (event => orbit%events(k))
        if (event%kind == event_turning_point) cycle
        if (event%kind /= last%kind .or. event%joint /= last%joint) run = 0
        run = merge(run + 1, 0, is_impact(event%kind))
        longest = max(longest, run)
        last = event
      end associate
    end do
  end function longest_run

end module margin_passage
