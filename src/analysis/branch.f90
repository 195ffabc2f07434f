! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A branch of periodic orbits over a parameter, by pseudo-arclength through folds, and through grazes and the beginnings and
!> ends of sticking by changing the sequence of events. What happens on the way is located to rounding and labelled; an end has
!> a name.
module branch
  use body_family, only: family_t
  use branch_passage, only: first_passed, most_secants, no_passage, note_bifurcations
  use branch_point, only: branch_t, label_chatter, label_closed, label_gr, label_long, label_not_known, label_pd, label_range, &
    label_release, label_run, move_trace, no_label, plan_t, point_t, set_point, step_to, trace_t
  use branch_return, only: close_up
  use branch_vanishing, only: end_at_rest, has_vanished
  use errors, only: error_t
  use graze_passage, only: at_graze, leave_by_graze
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use margin_passage, only: begins_chatter, pass_margin
  use motion_state, only: event_chatter_lower, event_chatter_upper
  use orbit_margins, only: margin_t, of_impact
  use orbit_sections, only: rotate_to_section, section_points
  use orbit_motion, only: is_admissible, orbit_of_motion
  use periodic_orbit, only: closing_time, correct_orbit, move_along, orbit_t, scales_of_orbit
  use orbit_directions, only: direct
  use search_watch, only: search_watch_t
  implicit none
  private

  public :: join_ways, trace_branch, trace_one_way

  !> Turn of the tangent in one step [cosine], and Newton steps from which on a step is thought long.
  real(wp), parameter :: least_cosine = 0.97_wp
  integer, parameter :: many_steps = 6
  !> Smallest step, as a share of the largest.
  real(wp), parameter :: smallest_step = 1e-7_wp
  !> After so many tries a step is accepted to within rounding: ill-conditioned equations do not end a branch.
  integer, parameter :: few_tries = 3
  !> The parameter has not turned back by less than this share of its size.
  real(wp), parameter :: no_turn = 1e-11_wp
  !> Nearness of a multiplier to that of a doubling at the end of a branch.
  real(wp), parameter :: at_doubling = 1e-2_wp
  !> The halves of an orbit may be the same where they differ by less than the first, a share of what they did a step before; they
  !> are where they differ by less than the second, in natural sizes.
  real(wp), parameter :: same_halves = 1e-2_wp, no_difference = 1e-6_wp
  !> What is left of that difference where it is none.
  real(wp), parameter :: rounding_of_halves = 1e-6_wp

contains

  !> Follows the orbits through `seed`, which is corrected, both ways. Points come in order from one end to the other. Every point
  !> is reported to `watch`.
  subroutine trace_branch(family, plan, seed, found, watch)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(orbit_t), intent(in) :: seed
    type(branch_t), intent(out) :: found
    class(search_watch_t), intent(inout), optional :: watch
    type(point_t), allocatable :: back(:), further(:)
    integer :: ending(2)
    call trace_one_way(family, plan, seed, -1, back, ending(1), watch)
    allocate (further(0))
    if (ending(1) /= label_closed) call trace_one_way(family, plan, seed, 1, further, ending(2), watch)
    call join_ways(family, back, further, ending, found)
  end subroutine trace_branch

  !> The branch whose points and endings `back` and `further` are, each from the seed on; one way is all of a closed one.
  subroutine join_ways(family, back, further, ending, found)
    type(family_t), intent(in) :: family
    type(point_t), intent(in) :: back(:), further(:)
    integer, intent(in) :: ending(2)
    type(branch_t), intent(out) :: found
    integer :: i
    found%ending = ending
    found%points = [(back(i), i=size(back), 1, -1)]
    if (ending(1) == label_closed) then
      found%ending(2) = label_closed
    else
      found%points = [found%points, further(min(2, size(further) + 1):)]
    end if
    call mark_turns(family%parameter_size, found%points)
  end subroutine join_ways

  !> Where the parameter turns there is a bifurcation, even if it could not be located; such a point is labelled accordingly. Two
  !> steps each way distinguish a turn from rounding.
  pure subroutine mark_turns(parameter_size, points)
    real(wp), intent(in) :: parameter_size
    type(point_t), intent(inout) :: points(:)
    real(wp) :: rises(4)
    integer :: i, k
    do i = 3, size(points) - 2
      if (any(points(i - 1:i + 1)%label /= no_label)) cycle
      rises = [(points(i + k)%orbit%parameter - points(i + k - 1)%orbit%parameter, k=-1, 2)]
      if (minval(abs(rises)) <= no_turn*parameter_size) cycle
      if (all(rises(:2)*rises(2) > 0) .and. all(rises(3:)*rises(2) < 0)) points(i)%label = label_not_known
    end do
  end subroutine mark_turns

  !> From the seed in the direction in which the parameter rises (`way` = 1) or falls, up to an end.
  subroutine trace_one_way(family, plan, seed, way, points, ending, watch)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(orbit_t), intent(in) :: seed
    integer, intent(in) :: way
    type(point_t), allocatable, intent(out) :: points(:)
    integer, intent(out) :: ending
    class(search_watch_t), intent(inout), optional :: watch
    type(trace_t) :: first, trace, before
    type(error_t), allocatable :: error
    logical :: ok
    integer :: labels, known
    allocate (points(0))
    ending = label_not_known
    trace%now%orbit = seed
    call machine_neighbourhood(family, seed%parameter, trace%machines, error)
    if (allocated(error)) return
    call set_point(family, trace, direct(seed, way), ok)
    points = [trace%now]
    if (.not. ok) return
    trace%step = 0.1_wp*plan%largest_step
    first = trace
    ending = no_label
    do while (ending == no_label .and. size(points) < plan%most_points)
      before = trace
      known = size(points)
      call go_on(family, plan, trace, points, ending)
      if (ending /= no_label) exit
      if (present(watch)) call watch%report_point(size(points), trace%now%orbit%parameter)
      if (known > 3) call close_up(family, first, before, trace, known, points, ending)
    end do
    if (ending == no_label) ending = label_long
    if (ending == label_not_known .and. points(size(points))%label == no_label .and. begins_chatter(trace)) ending = label_run
    labels = size(points)
    if (points(labels)%label == no_label) points(labels)%label = ending
  end subroutine trace_one_way

  !> One step of the branch: to the next point, and to what is passed on the way.
  subroutine go_on(family, plan, trace, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(inout) :: trace
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: next
    type(margin_t) :: passed
    real(wp) :: length
    logical :: ok, turned
    integer :: tries, steps, known
    ending = no_label
    do tries = 1, 60
      length = trace%step
      call step_to(family, trace, length, next, ok, steps, roughly=tries > few_tries)
      if (ok) ok = sum(next%now%tangent*trace%now%tangent) > least_cosine
      if (ok) exit
      trace%step = trace%step/2
      if (trace%step < smallest_step*plan%largest_step) then
        call leave_by_graze(family, plan, trace, points, ending)
        return
      end if
    end do
    if (swaps_halves(trace, next)) then
      call end_at_parent(family, trace, length, points, ending)
      if (ending /= no_label) return
    end if
    if (has_vanished(trace, next)) then
      call end_at_rest(family, trace, length, points, ending)
      return
    end if
    if (leaves_range(plan, next%now%orbit%parameter)) then
      call end_at_range(family, plan, trace, length, points, ending)
      return
    end if
    call first_passed(family, trace, next, length, passed)
    known = size(points)
    call note_bifurcations(family, trace, next, length, passed%kind /= 0, points)
    if (passed%kind /= 0) then
      call pass_margin(family, plan, trace, next, passed, points, ending)
      return
    end if
    call rotate_to_section(next%machines, next%now%orbit, turned)
    if (.not. is_admissible(next%machines, next%now%orbit)) then
      ! A change of the events that no margin predicts, or one that is nearer than the samples along the flights.
      trace%step = length/4
      ! What was located on a step that is taken anew is found once more.
      points = points(:known)
      if (trace%step < smallest_step*plan%largest_step) call leave_unforeseen(family, plan, next, trace, points, ending)
      return
    end if
    next%step = min(plan%largest_step, length*merge(0.7_wp, 1.4_wp, steps > many_steps))
    next%came = length
    if (turned) call set_point(family, next, direct(next%now%orbit, &
                                                    nint(sign(1.0_wp, next%now%tangent(size(next%now%tangent))))), ok)
    points = [points, next%now]
    if (allocated(next%bend)) deallocate (next%bend)
    if (.not. turned) next%bend = (next%now%tangent - trace%now%tangent)/length
    call move_trace(next, trace)
  end subroutine go_on

  !> Beyond a step than which none is shorter the motion `next` has other events.
  subroutine leave_unforeseen(family, plan, next, trace, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(in) :: next
    type(trace_t), intent(inout) :: trace
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(inout) :: ending
    call leave_by_graze(family, plan, trace, points, ending)
    if (ending == label_not_known) ending = unforeseen(trace, next)
  end subroutine leave_unforeseen

  !> What the second half of an orbit of even period differs by from the first, in natural sizes: in the instants and states of the
  !> events, and without any in the section points, which jump where an impact passes the section. Nothing where the halves have
  !> other events.
  pure function halves_differ(trace) result(difference)
    type(trace_t), intent(in) :: trace
    real(wp), allocatable :: difference(:)
    real(wp) :: points(size(trace%now%orbit%y), trace%now%orbit%periods)
    integer :: k
    associate (orbit => trace%now%orbit, machine => trace%machines%centre, m => size(trace%now%orbit%events), &
               half => size(trace%now%orbit%events)/2, n => size(trace%now%orbit%y))
      allocate (difference(0))
      if (m == 0) then
        points = section_points(trace%machines, orbit)
        difference = (points(:, 1 + orbit%periods/2) - points(:, 1))/machine%size_of
        return
      end if
      if (modulo(m, 2) > 0) return
      do k = 1, half
        associate (one => orbit%events(k), other => orbit%events(half + k))
          if (one%kind /= other%kind .or. one%side /= other%side .or. one%joint /= other%joint) then
            difference = [real(wp) ::]
            return
          end if
          difference = [difference, (other%time - one%time - closing_time(machine, orbit)/2)/machine%size_of_time(), &
                        (machine%nearest_copy(other%arrival(:n), one%arrival(:n)) - one%arrival(:n))/machine%size_of]
        end associate
      end do
    end associate
  end function halves_differ

  !> Whether the halves of an orbit may have been exchanged: in between it was one of half the period.
  pure logical function swaps_halves(trace, next)
    type(trace_t), intent(in) :: trace, next
    swaps_halves = modulo(trace%now%orbit%periods, 2) == 0
    if (swaps_halves) swaps_halves = .not. still_differ(trace, next)
  end function swaps_halves

  !> Whether the halves of the orbit `next` differ as those of `trace` do: not the other way round, and not by rounding alone, as
  !> where a step has ended on the branch of half the period.
  pure logical function still_differ(trace, next)
    type(trace_t), intent(in) :: trace, next
    real(wp), allocatable :: before(:)
    before = halves_differ(trace)
    still_differ = sum(before*halves_differ(next)) >= rounding_of_halves*sum(before**2)
  end function still_differ

  !> The end of a branch in the orbit of half its period, from which it came by a doubling or in a graze; none if the halves are not
  !> the same anywhere on the step.
  subroutine end_at_parent(family, trace, length, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there, tried
    real(wp) :: low, high, middle, left
    logical :: ok, all_ok
    integer :: i, steps
    there = trace
    all_ok = .true.
    low = 0
    high = length
    do i = 1, most_secants
      middle = (low + high)/2
      call step_to(family, trace, middle, tried, ok, steps)
      ! At the end itself the equations are singular: it is approached from this side.
      if (ok) there = tried
      all_ok = all_ok .and. ok
      if (.not. ok .or. .not. still_differ(trace, there)) then
        high = middle
      else
        low = middle
      end if
      if (high - low <= 4*spacing(high)) exit
    end do
    left = norm2(halves_differ(there))
    ending = no_label
    if (all_ok .and. left > same_halves*norm2(halves_differ(trace))) return
    ending = label_not_known
    ! It began in a graze, or in a doubling, where the orbit of twice the period has a multiplier +1.
    if (any(there%margins%list%kind == of_impact .and. abs(there%margins%list%value) < at_graze)) then
      ending = label_gr
    else if (left < no_difference .or. minval(abs(there%now%orbit%multipliers - 1)) < at_doubling) then
      ending = label_pd
    end if
    there%now%label = ending
    points = [points, there%now]
  end subroutine end_at_parent

  pure logical function leaves_range(plan, parameter)
    type(plan_t), intent(in) :: plan
    real(wp), intent(in) :: parameter
    leaves_range = parameter < plan%lowest .or. parameter > plan%highest
  end function leaves_range

  !> What ends where the motion from the point `next` of a branch suddenly has other events: a chatter that is completed there
  !> and not on the branch, or the other way round; a rest that is over.
  integer function unforeseen(trace, next) result(label)
    type(trace_t), intent(in) :: trace, next
    type(orbit_t) :: motion
    logical :: ok
    label = label_not_known
    associate (orbit => trace%now%orbit)
      if (size(orbit%events) == 0 .and. trace%machines%centre%rests(orbit%mode)) label = label_release
      call orbit_of_motion(next%machines, next%now%orbit%parameter, next%now%orbit%y, orbit%periods, motion, ok)
      if (.not. ok) return
      if (any(is_chatter(motion%events%kind)) .neqv. any(is_chatter(orbit%events%kind))) label = label_chatter
    end associate
  end function unforeseen

  pure elemental logical function is_chatter(kind)
    integer, intent(in) :: kind
    is_chatter = kind == event_chatter_upper .or. kind == event_chatter_lower
  end function is_chatter

  !> The last point within the range of the parameter.
  subroutine end_at_range(family, plan, trace, length, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: next
    type(error_t), allocatable :: error
    real(wp) :: share, bound
    logical :: ok
    ending = label_range
    associate (rise => trace%now%tangent(size(trace%now%tangent))*family%parameter_size)
      bound = merge(plan%highest, plan%lowest, rise > 0)
      share = (bound - trace%now%orbit%parameter)/rise
    end associate
    if (.not. (share > 0 .and. share <= 2*length)) return
    next = trace
    call move_along(next%now%orbit, share*trace%now%tangent* &
                    scales_of_orbit(trace%machines, trace%now%orbit, family%parameter_size))
    next%now%orbit%parameter = bound
    call machine_neighbourhood(family, bound, next%machines, error)
    if (allocated(error)) return
    call correct_orbit(family, next%machines, next%now%orbit, direct(next%now%orbit, 1), ok)
    if (.not. ok) return
    call set_point(family, next, trace%now%tangent, ok)
    if (.not. ok .or. any(next%margins%list%value < -no_passage)) return
    points = [points, next%now]
  end subroutine end_at_range

end module branch
