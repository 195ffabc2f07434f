! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A branch of periodic orbits over a parameter, by pseudo-arclength through folds, and through grazes and the beginnings and
!> ends of sticking by changing the sequence of events. What happens on the way is located to rounding and labelled; an end has
!> a name.
module branch
  use body_family, only: family_t
  use branch_parent, only: end_at_parent, swaps_halves
  use branch_passage, only: first_passed, no_passage, note_bifurcations
  use branch_point, only: branch_t, label_chatter, label_closed, label_not_known, label_range, &
    label_release, label_run, move_trace, no_label, plan_t, point_t, set_point, step_to, trace_t
  use branch_return, only: close_up
  use branch_vanishing, only: end_at_rest, has_vanished
  use continuation, only: continuation_t
  use errors, only: error_t
  use graze_passage, only: leave_by_graze
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use margin_passage, only: begins_chatter, pass_margin
  use motion_state, only: event_chatter_lower, event_chatter_upper
  use orbit_margins, only: margin_t
  use orbit_sections, only: rotate_to_section
  use orbit_motion, only: is_admissible, orbit_of_motion
  use periodic_orbit, only: correct_orbit, move_along, orbit_t, scales_of_orbit
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

  !> One way along a branch: where it is, the neighbour that was tried and the Newton steps to it, and where it began.
  type, extends(continuation_t) :: orbits_t
    type(family_t) :: family
    type(plan_t) :: plan
    type(trace_t) :: trace, next, first
    integer :: newton_steps = 0
    type(point_t), allocatable :: points(:)
    class(search_watch_t), pointer :: watch => null()
  contains
    procedure :: points_found, try_step, take_step, give_up
  end type orbits_t

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
    class(search_watch_t), intent(inout), optional, target :: watch
    type(orbits_t) :: orbits
    type(error_t), allocatable :: error
    logical :: ok
    allocate (points(0))
    ending = label_not_known
    orbits%trace%now%orbit = seed
    call machine_neighbourhood(family, seed%parameter, orbits%trace%machines, error)
    if (allocated(error)) return
    call set_point(family, orbits%trace, direct(seed, way), ok)
    points = [orbits%trace%now]
    if (.not. ok) return
    orbits%family = family
    orbits%plan = plan
    orbits%least_cosine = least_cosine
    orbits%first = orbits%trace
    if (present(watch)) orbits%watch => watch
    call move_alloc(points, orbits%points)
    call orbits%follow(0.1_wp*plan%largest_step, smallest_step*plan%largest_step, plan%most_points)
    call move_alloc(orbits%points, points)
    ending = orbits%ending
    associate (last => points(size(points)))
      if (ending == label_not_known .and. last%label == no_label .and. begins_chatter(orbits%trace)) ending = label_run
      if (last%label == no_label) last%label = ending
    end associate
  end subroutine trace_one_way

  pure integer function points_found(self)
    class(orbits_t), intent(in) :: self
    points_found = size(self%points)
  end function points_found

  subroutine try_step(self, cosine, ok)
    class(orbits_t), intent(inout) :: self
    real(wp), intent(out) :: cosine
    logical, intent(out) :: ok
    cosine = -1
    self%trace%step = self%step
    call step_to(self%family, self%trace, self%step, self%next, ok, self%newton_steps, roughly=self%tries > few_tries)
    if (ok) cosine = sum(self%next%now%tangent*self%trace%now%tangent)
  end subroutine try_step

  !> No step leads on: an impact may be about to vanish.
  subroutine give_up(self)
    class(orbits_t), intent(inout) :: self
    type(trace_t) :: before
    integer :: known
    before = self%trace
    known = size(self%points)
    call leave_by_graze(self%family, self%plan, self%trace, self%points, self%ending)
    call look_back(self, before, known)
  end subroutine give_up

  subroutine take_step(self)
    class(orbits_t), intent(inout) :: self
    type(trace_t) :: before
    integer :: known
    before = self%trace
    known = size(self%points)
    call go_on(self%family, self%plan, self%newton_steps, self%trace, self%next, self%points, self%ending)
    call look_back(self, before, known)
  end subroutine take_step

  !> After a step from `before`, when so many points were known: reports it, and looks whether the branch is where it began.
  subroutine look_back(self, before, known)
    class(orbits_t), intent(inout) :: self
    type(trace_t), intent(in) :: before
    integer, intent(in) :: known
    self%step = self%trace%step
    if (self%ending /= no_label) return
    if (associated(self%watch)) call self%watch%report_point(size(self%points), self%trace%now%orbit%parameter)
    if (known > 3) call close_up(self%family, self%first, before, self%trace, known, self%points, self%ending)
  end subroutine look_back

  !> From a point to the next, which has been found by so many Newton steps, and to what is passed on the way.
  subroutine go_on(family, plan, newton_steps, trace, next, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    integer, intent(in) :: newton_steps
    type(trace_t), intent(inout) :: trace, next
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(margin_t) :: passed
    real(wp) :: length
    logical :: ok, turned
    integer :: known
    ending = no_label
    length = trace%step
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
    next%step = min(plan%largest_step, length*merge(0.7_wp, 1.4_wp, newton_steps > many_steps))
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
