! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A branch of periodic orbits over a parameter, by pseudo-arclength through folds, and through grazes and the beginnings and
!> ends of sticking by changing the sequence of events. What happens on the way is located to rounding and labelled; an end has
!> a name.
module branch
  use body_family, only: body_neighbourhood, body_of_family, family_t
  use errors, only: error_t
  use kinds, only: wp
  use motion_state, only: event_turning_point
  use one_body, only: one_body_t, slips_in
  use orbit_margins, only: is_impact, margin_t, margins_of, margins_t, of_gap, of_impact, of_release, of_slip, of_stick, &
    of_turning
  use other_sequence, only: change_sequence
  use periodic_orbit, only: correct_orbit, direct, is_admissible, move_along, orbit_t, rotate_to_section, scales_of_orbit, &
    section_points, states, tangent_of
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: trace_branch, is_stable, set_sizes

  !> Labels of points. GR: an orbit goes on beyond the graze with an impact more or less; GR-fold: both sides of it are on the
  !> same side of the parameter. BP: multiplier +1 where the parameter does not turn;
  !> release: a body that rests for ever does so no more.
  integer, parameter, public :: no_label = 0, label_sn = 1, label_pd = 2, label_ns = 3, label_bp = 4, label_gr = 5, &
    label_gr_fold = 6, label_stick = 7, label_chatter = 8, label_stiction = 9, label_range = 10, label_closed = 11, &
    label_not_known = 12, label_long = 13, label_release = 14, last_label = 14
  character(len=*), parameter, public :: label_names(0:last_label) = [character(len=13) :: 'none', 'SN', 'PD', 'NS', 'BP', &
    'GR', 'GR-fold', 'stick_onset', 'chatter_onset', 'stiction_end', 'end_of_range', 'closed', 'not_known', 'too_long', &
    'release']

  integer, parameter :: most_secants = 60
  !> Turn of the tangent in one step [cosine], and Newton steps from which on a step is thought long.
  real(wp), parameter :: least_cosine = 0.97_wp
  integer, parameter :: many_steps = 5
  !> With so many impacts in a row no more are put in: they are the beginning of a chatter.
  integer, parameter :: long_run = 10
  !> Smallest step, as a share of the largest; first look beyond a point where the sequence changes.
  real(wp), parameter :: smallest_step = 1e-7_wp, first_look = 1e-4_wp
  !> A margin within this of 0 is not passed; margins within this of 0 are zero together.
  real(wp), parameter :: no_passage = 1e-11_wp, together = 1e-9_wp
  !> Nearness to a graze and to a doubling, in speed and multiplier, at the end of a branch.
  real(wp), parameter :: at_graze = 1e-6_wp, at_doubling = 1e-2_wp

  type, public :: point_t
    type(orbit_t) :: orbit
    integer :: label = no_label
    real(wp) :: x_max = 0, x_min = 0
    !> Direction in which the branch goes on.
    real(wp), allocatable :: tangent(:)
  end type point_t

  !> Points in the order in which they were found; `ending` labels the last.
  type, public :: branch_t
    type(point_t), allocatable :: points(:)
    integer :: ending(2) = no_label
  end type branch_t

  !> What to follow, and how far.
  type, public :: plan_t
    real(wp) :: lowest = 0, highest = 0
    !> Largest step in natural sizes, and most points each way.
    real(wp) :: largest_step = 0.02_wp
    integer :: most_points = 2000
  end type plan_t

  !> Where a trace is.
  type :: trace_t
    type(point_t) :: now
    type(neighbourhood_t) :: machines
    type(margins_t) :: margins
    real(wp) :: step = 0
  end type trace_t

contains

  !> Whether both multipliers are within the unit circle.
  pure logical function is_stable(orbit)
    type(orbit_t), intent(in) :: orbit
    is_stable = maxval(abs(orbit%multipliers)) < 1
  end function is_stable

  !> Sets the sizes of a family: of the parameter by its range, of the state by the largest motion that the drive alone brings
  !> about at the ends of the range.
  subroutine set_sizes(plan, family, error)
    type(plan_t), intent(in) :: plan
    type(family_t), intent(inout) :: family
    type(error_t), allocatable, intent(out) :: error
    type(one_body_t) :: body
    real(wp) :: sizes(2)
    family%parameter_size = plan%highest - plan%lowest
    family%sizes = 0
    sizes = 0
    call body_of_family(family, plan%lowest, body, error)
    if (allocated(error)) return
    sizes = body%size_of
    call body_of_family(family, plan%highest, body, error)
    if (allocated(error)) return
    family%sizes = max(sizes, body%size_of)
  end subroutine set_sizes

  !> Follows the orbits through `seed`, which is corrected, both ways. Points come in order from one end to the other.
  subroutine trace_branch(family, plan, seed, found)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(orbit_t), intent(in) :: seed
    type(branch_t), intent(out) :: found
    type(point_t), allocatable :: back(:), further(:)
    integer :: i
    call trace_one_way(family, plan, seed, -1, back, found%ending(1))
    if (found%ending(1) == label_closed) then
      found%ending(2) = label_closed
      allocate (further(0))
    else
      call trace_one_way(family, plan, seed, 1, further, found%ending(2))
    end if
    found%points = [[(back(i), i=size(back), 1, -1)], further(min(2, size(further) + 1):)]
  end subroutine trace_branch

  !> From the seed in the direction in which the parameter rises (`way` = 1) or falls, up to an end.
  subroutine trace_one_way(family, plan, seed, way, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(orbit_t), intent(in) :: seed
    integer, intent(in) :: way
    type(point_t), allocatable, intent(out) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: trace
    type(point_t) :: first
    type(error_t), allocatable :: error
    logical :: ok
    integer :: labels
    allocate (points(0))
    ending = label_not_known
    trace%now%orbit = seed
    call body_neighbourhood(family, seed%parameter, trace%machines, error)
    if (allocated(error)) return
    call set_point(family, trace, direct(seed, way), ok)
    points = [trace%now]
    if (.not. ok) return
    first = trace%now
    trace%step = 0.1_wp*plan%largest_step
    ending = no_label
    do while (ending == no_label .and. size(points) < plan%most_points)
      call go_on(family, plan, trace, points, ending)
      if (ending /= no_label) exit
      if (size(points) > 4 .and. has_returned(first, trace)) ending = label_closed
    end do
    if (ending == no_label) ending = label_long
    labels = size(points)
    if (points(labels)%label == no_label) points(labels)%label = ending
  end subroutine trace_one_way

  !> Whether a trace is back where it began.
  pure logical function has_returned(first, trace) result(back)
    type(point_t), intent(in) :: first
    type(trace_t), intent(in) :: trace
    back = size(first%orbit%events) == size(trace%now%orbit%events)
    if (.not. back) return
    select type (machine => trace%machines%centre)
    type is (one_body_t)
      back = norm2((first%orbit%y - trace%now%orbit%y)/machine%size_of) < 0.5_wp*trace%step .and. &
             sum(first%tangent*trace%now%tangent) > 0.9_wp
    end select
    if (back) back = abs(first%orbit%parameter - trace%now%orbit%parameter) < &
                     trace%step*abs(first%tangent(size(first%tangent))) + tiny(trace%step)
  end function has_returned

  !> Tangent, margins and extremes of the orbit where the trace is.
  subroutine set_point(family, trace, along, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(inout) :: trace
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    if (allocated(trace%now%tangent)) deallocate (trace%now%tangent)
    allocate (trace%now%tangent(size(along)), source=0.0_wp)
    call tangent_of(trace%machines, trace%now%orbit, family%parameter_size, along, trace%now%tangent, ok)
    trace%margins = margins_of(trace%machines%centre, trace%now%orbit)
    trace%now%x_max = trace%margins%x_max
    trace%now%x_min = trace%margins%x_min
  end subroutine set_point

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
    integer :: tries, steps
    ending = no_label
    do tries = 1, 60
      length = trace%step
      call step_to(family, trace, length, next, ok, steps)
      if (ok) ok = sum(next%now%tangent*trace%now%tangent) > least_cosine
      if (ok) exit
      trace%step = trace%step/2
      if (trace%step < smallest_step*plan%largest_step) then
        ending = label_not_known
        return
      end if
    end do
    if (swaps_halves(trace, next)) then
      call end_at_parent(family, trace, length, points, ending)
      return
    end if
    if (leaves_range(plan, next%now%orbit%parameter)) then
      call end_at_range(family, plan, trace, length, points, ending)
      return
    end if
    call first_passed(family, trace, next, length, passed)
    call note_bifurcations(family, trace, next, length*(1 - 1e-6_wp), points)
    if (passed%kind /= 0) then
      call pass_margin(family, trace, next, passed, points, ending)
      return
    end if
    call rotate_to_section(next%machines, next%now%orbit, turned)
    if (.not. is_admissible(next%machines, next%now%orbit)) then
      ! A turn of events that no margin foretells, or one that is nearer than the look along the flights.
      trace%step = length/4
      if (trace%step < smallest_step*plan%largest_step) ending = unforeseen(next%now%orbit)
      return
    end if
    next%step = min(plan%largest_step, length*merge(0.7_wp, 1.4_wp, steps > many_steps))
    if (turned) call set_point(family, next, direct(next%now%orbit, &
                                                    nint(sign(1.0_wp, next%now%tangent(size(next%now%tangent))))), ok)
    points = [points, next%now]
    trace = next
  end subroutine go_on

  !> What the second half of an orbit of even period differs by from the first, in natural sizes.
  pure function halves_differ(trace) result(difference)
    type(trace_t), intent(in) :: trace
    real(wp) :: difference(states)
    real(wp) :: points(states, trace%now%orbit%periods)
    points = section_points(trace%machines, trace%now%orbit)
    difference = points(:, 1 + trace%now%orbit%periods/2) - points(:, 1)
    select type (machine => trace%machines%centre)
    type is (one_body_t)
      difference = difference/machine%size_of
    end select
  end function halves_differ

  !> Whether the halves of an orbit have changed places: in between it was one of half the period.
  pure logical function swaps_halves(trace, next)
    type(trace_t), intent(in) :: trace, next
    swaps_halves = modulo(trace%now%orbit%periods, 2) == 0
    if (swaps_halves) swaps_halves = sum(halves_differ(trace)*halves_differ(next)) < 0
  end function swaps_halves

  !> The end of a branch in the orbit of half its period, from which it came by a doubling or in a graze.
  subroutine end_at_parent(family, trace, length, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there, tried
    real(wp) :: low, high, middle
    logical :: ok
    integer :: i, steps
    ending = label_not_known
    there = trace
    low = 0
    high = length
    do i = 1, most_secants
      middle = (low + high)/2
      call step_to(family, trace, middle, tried, ok, steps)
      ! At the end itself the equations are singular.
      if (.not. ok) exit
      there = tried
      if (sum(halves_differ(trace)*halves_differ(there)) < 0) then
        high = middle
      else
        low = middle
      end if
      if (high - low <= 4*spacing(high)) exit
    end do
    ending = label_pd
    ! It began in a graze, or in a doubling, where the orbit of twice the period has a multiplier +1.
    if (any(there%margins%list%kind == of_impact .and. abs(there%margins%list%value) < at_graze)) then
      ending = label_gr
    else if (minval(abs(there%now%orbit%multipliers - 1)) > at_doubling) then
      ending = label_not_known
    end if
    there%now%label = ending
    points = [points, there%now]
  end subroutine end_at_parent

  pure logical function leaves_range(plan, parameter)
    type(plan_t), intent(in) :: plan
    real(wp), intent(in) :: parameter
    leaves_range = parameter < plan%lowest .or. parameter > plan%highest
  end function leaves_range

  !> What ends where the motion suddenly has other events: a long run of ever weaker impacts is a chatter.
  pure integer function unforeseen(orbit) result(label)
    type(orbit_t), intent(in) :: orbit
    label = label_not_known
    if (size(orbit%events) == 0 .and. .not. slips_in(orbit%mode)) label = label_release
    if (longest_run(orbit) >= long_run) label = label_chatter
  end function unforeseen

  !> Impacts in a row, turning points aside.
  pure integer function longest_run(orbit) result(longest)
    type(orbit_t), intent(in) :: orbit
    integer :: k, run
    run = 0
    longest = 0
    do k = 1, size(orbit%events)
      if (orbit%events(k)%kind == event_turning_point) cycle
      run = merge(run + 1, 0, is_impact(orbit%events(k)%kind))
      longest = max(longest, run)
    end do
  end function longest_run

  !> The point `length` further along the branch, with everything that belongs to it.
  subroutine step_to(family, trace, length, next, ok, steps)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(trace_t), intent(out) :: next
    logical, intent(out) :: ok
    integer, intent(out) :: steps
    type(error_t), allocatable :: error
    steps = 0
    next = trace
    call move_along(next%now%orbit, length*trace%now%tangent* &
                    scales_of_orbit(trace%machines, trace%now%orbit, family%parameter_size))
    call body_neighbourhood(family, next%now%orbit%parameter, next%machines, error)
    ok = .not. allocated(error)
    if (ok) call correct_orbit(family, next%machines, next%now%orbit, trace%now%tangent, ok, steps)
    if (ok) call set_point(family, next, trace%now%tangent, ok)
  end subroutine step_to

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
    call body_neighbourhood(family, bound, next%machines, error)
    if (allocated(error)) return
    call correct_orbit(family, next%machines, next%now%orbit, direct(next%now%orbit, 1), ok)
    if (.not. ok) return
    call set_point(family, next, trace%now%tangent, ok)
    if (.not. ok .or. any(next%margins%list%value < -no_passage)) return
    points = [points, next%now]
  end subroutine end_at_range

  !> The first margin that is passed between two points; `length` becomes the distance to it and `next` the point there.
  subroutine first_passed(family, trace, next, length, passed)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    type(trace_t), intent(inout) :: next
    real(wp), intent(inout) :: length
    type(margin_t), intent(out) :: passed
    type(trace_t) :: there
    type(margin_t) :: candidate
    integer :: tries
    logical :: ok
    do tries = 1, 8
      call most_negative(trace%margins, next%margins, candidate)
      if (candidate%kind == 0) return
      call locate_margin(family, trace, next, length, candidate, there, ok)
      if (.not. ok) return
      next = there
      passed = candidate
    end do
  end subroutine first_passed

  !> The margin that falls below zero first, as far as a straight line tells.
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
        if (one%kind /= margin%kind) cycle
        if (margin%kind == of_gap .and. one%side /= margin%side) cycle
        if (margin%kind /= of_gap .and. margin%kind /= of_slip .and. one%event /= margin%event) cycle
        value = one%value
      end associate
    end do
  end function value_like

  !> The point at which a margin is zero, by the Illinois form of the secant rule over the length of the step. `candidate` is the
  !> margin there, `length` its distance.
  subroutine locate_margin(family, trace, next, length, candidate, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    real(wp), intent(inout) :: length
    type(margin_t), intent(inout) :: candidate
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    real(wp) :: low, high, f_low, f_high, s, f
    integer :: i, steps, side
    low = 0
    high = length
    f_low = max(value_like(trace%margins, candidate), 0.0_wp)
    f_high = candidate%value
    there = next
    ok = .true.
    side = 0
    do i = 1, most_secants
      s = (low + high)/2
      if (f_low < 1e3_wp) s = (f_low*high - f_high*low)/(f_low - f_high)
      if (.not. (s > low .and. s < high)) s = (low + high)/2
      call step_to(family, trace, s, there, ok, steps)
      if (.not. ok) return
      f = value_like(there%margins, candidate)
      if (f < 0) then
        high = s
        f_high = f
        if (side < 0) f_low = f_low/2
        side = -1
      else
        low = s
        f_low = f
        if (side > 0) f_high = f_high/2
        side = 1
      end if
      if (abs(f) <= 4*epsilon(f) .or. high - low <= 4*spacing(high)) exit
    end do
    length = s
    candidate%time = time_like(there%margins, candidate)
  end subroutine locate_margin

  pure real(wp) function time_like(margins, margin) result(time)
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: margin
    integer :: i
    time = margin%time
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (one%kind == margin%kind .and. one%side == margin%side .and. one%event == margin%event) time = one%time
      end associate
    end do
  end function time_like

  !> Folds, doublings and the like between two points of one sequence of events: located, and added to the points.
  subroutine note_bifurcations(family, trace, next, length, points)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    type(trace_t) :: end_point, there
    integer :: label, steps
    logical :: ok, turns
    call step_to(family, trace, length, end_point, ok, steps)
    if (.not. ok) end_point = next
    turns = test_value(label_sn, trace)*test_value(label_sn, end_point) < 0
    do label = label_sn, label_bp
      if (label == label_bp .and. turns) cycle
      if (.not. test_value(label, trace)*test_value(label, end_point) < 0) cycle
      call locate_test(family, trace, end_point, length, label, there, ok)
      if (.not. ok) cycle
      if (.not. is_genuine(label, there%now%orbit)) cycle
      there%now%label = label
      points = [points, there%now]
    end do
  end subroutine note_bifurcations

  !> Whether a multiplier is where the label says; near a graze its rounding is large.
  pure logical function is_genuine(label, orbit) result(genuine)
    integer, intent(in) :: label
    type(orbit_t), intent(in) :: orbit
    select case (label)
    case (label_pd)
      genuine = minval(abs(orbit%multipliers + 1)) < 1e-5_wp
    case (label_bp)
      genuine = minval(abs(orbit%multipliers - 1)) < 1e-5_wp
    case (label_ns)
      genuine = abs(aimag(orbit%multipliers(1))) > 0 .and. abs(abs(orbit%multipliers(1)) - 1) < 1e-5_wp
    case default
      genuine = .true.
    end select
  end function is_genuine

  !> What changes its sign where a label belongs.
  pure real(wp) function test_value(label, trace) result(value)
    integer, intent(in) :: label
    type(trace_t), intent(in) :: trace
    associate (m => trace%now%orbit%matrix)
      associate (trace_of => m(1, 1) + m(2, 2), determinant => m(1, 1)*m(2, 2) - m(1, 2)*m(2, 1))
        select case (label)
        case (label_sn)
          value = trace%now%tangent(size(trace%now%tangent))
        case (label_pd)
          value = 1 + trace_of + determinant
        case (label_ns)
          value = determinant - 1
        case default
          value = 1 - trace_of + determinant
        end select
      end associate
    end associate
  end function test_value

  !> The point where a test passes zero.
  subroutine locate_test(family, trace, next, length, label, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    real(wp), intent(in) :: length
    integer, intent(in) :: label
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    real(wp) :: low, high, f_low, f_high, s, f
    integer :: i, steps, side
    low = 0
    high = length
    f_low = test_value(label, trace)
    f_high = test_value(label, next)
    side = 0
    do i = 1, most_secants
      s = (f_low*high - f_high*low)/(f_low - f_high)
      if (.not. (s > low .and. s < high)) s = (low + high)/2
      call step_to(family, trace, s, there, ok, steps)
      if (.not. ok) return
      f = test_value(label, there)
      if (f*f_high > 0) then
        high = s
        f_high = f
        if (side < 0) f_low = f_low/2
        side = -1
      else
        low = s
        f_low = f
        if (side > 0) f_high = f_high/2
        side = 1
      end if
      if (abs(f) <= 4*epsilon(f) .or. high - low <= 4*spacing(high)) exit
    end do
  end subroutine locate_test

  !> Label of the place where a margin is zero.
  pure integer function label_of_margin(margin) result(label)
    type(margin_t), intent(in) :: margin
    select case (margin%kind)
    case (of_impact, of_gap)
      label = label_gr
    case (of_turning, of_stick, of_slip)
      label = label_stick
    case (of_release)
      label = label_stiction
    case default
      label = label_not_known
    end select
  end function label_of_margin

  !> The orbit where a margin is zero: its label, and on with the sequence of events beyond, if there is one.
  subroutine pass_margin(family, trace, at, passed, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(inout) :: trace
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: beyond
    type(point_t) :: point
    real(wp) :: rise_before, rise_after
    logical :: known
    ending = no_label
    point = at%now
    point%label = label_of_margin(passed)
    call change_all(at, passed, beyond%now%orbit, known)
    if (known) call enter_sequence(family, at, trace%step, beyond, known)
    if (known) then
      rise_before = at%now%tangent(size(at%now%tangent))
      rise_after = beyond%now%orbit%parameter - at%now%orbit%parameter
      if (point%label == label_gr .and. rise_before*rise_after < 0) point%label = label_gr_fold
    end if
    points = [points, point]
    if (.not. known) ending = point%label
    ! Impact after impact is put in as a chatter is approached.
    if (passed%kind == of_gap .and. longest_run(at%now%orbit) >= long_run) ending = label_long
    if (ending /= no_label) return
    points = [points, beyond%now]
    trace = beyond
  end subroutine pass_margin

  !> Changes the sequence where `passed` and every other margin of its kind is zero: a symmetric orbit has two.
  subroutine change_all(at, passed, changed, known)
    type(trace_t), intent(in) :: at
    type(margin_t), intent(in) :: passed
    type(orbit_t), intent(out) :: changed
    logical, intent(out) :: known
    type(orbit_t) :: before
    real(wp) :: place(size(at%margins%list))
    integer :: i
    changed = at%now%orbit
    known = .true.
    place = -1
    do i = 1, size(place)
      associate (one => at%margins%list(i))
        if (one%kind /= passed%kind .or. .not. abs(one%value) <= together) cycle
        place(i) = one%event
        ! After an event that comes with its number turned round.
        if (one%event < 0) place(i) = -one%event - 0.5_wp
        if (one%kind == of_slip) place(i) = one%event + 0.5_wp
      end associate
    end do
    if (all(place < 0)) known = .false.
    ! From the last on, so that the numbers of the others stay.
    do while (any(place >= 0) .and. known)
      i = maxloc(place, 1)
      place(i) = -1
      before = changed
      select type (machine => at%machines%centre)
      type is (one_body_t)
        call change_sequence(machine, before, at%margins%list(i), changed, known)
      end select
    end do
  end subroutine change_all

  !> A first point with the new sequence, on the side on which its motion really has those events.
  subroutine enter_sequence(family, at, step, beyond, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    real(wp), intent(in) :: step
    type(trace_t), intent(inout) :: beyond
    logical, intent(out) :: ok
    type(trace_t) :: start, there
    real(wp) :: look, along(states + size(beyond%now%orbit%events) + 1)
    integer :: way, tries, steps
    start%machines = at%machines
    start%now%orbit = beyond%now%orbit
    call correct_orbit(family, start%machines, start%now%orbit, direct(start%now%orbit, 1), ok)
    if (.not. ok) return
    along = direct(start%now%orbit, nint(sign(1.0_wp, at%now%tangent(size(at%now%tangent)))))
    call set_point(family, start, along, ok)
    if (.not. ok) return
    along = start%now%tangent
    look = first_look*step
    do tries = 1, 4
      do way = 1, -1, -2
        start%now%tangent = way*along
        call step_to(family, start, look, there, ok, steps)
        if (ok) ok = all(there%margins%list%value > -no_passage)
        if (ok) ok = is_admissible(there%machines, there%now%orbit)
        if (ok) exit
      end do
      if (ok) exit
      look = 10*look
    end do
    if (.not. ok) return
    beyond = there
    beyond%step = max(look, 0.1_wp*step)
  end subroutine enter_sequence

end module branch
