! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where a labelled point of a branch lies over a second parameter: its equations, followed by pseudo-arclength in all unknowns
!> and both parameters. Where a second condition vanishes on the way the point is located: of codimension two.
module bifurcation_curve
  use body_family, only: family_t
  use branch_point, only: label_gr, label_gr_fold, label_not_known, label_pd, label_range, label_sn, label_stick, no_label, point_t
  use continuation, only: continuation_t
  use curve_equations, only: at_zero, beside_like, correct, curve_plan_t, curve_point_t, looked_at, move, curve_position_t, &
    set_position, &
    set_tangent, unknowns
  use inverse_interpolation, only: weights_at_zero
  use kinds, only: wp
  use orbit_margins, only: margin_t, of_gap, of_impact
  use part_of_branch, only: event_speeds
  implicit none
  private

  public :: trace_curve, can_be_followed, curve_label, passes

  integer, parameter :: most_points = 200, most_secants = 50
  !> Steps of the curve in natural sizes.
  real(wp), parameter :: first_step = 1e-3_wp, largest_step = 0.03_wp, smallest_step = 1e-8_wp
  !> Two labelled points are one when the parameter agrees to this share of its range, and the orbits to this in natural sizes.
  real(wp), parameter :: same_point = 1e-8_wp, same_orbit = 1e-5_wp
  !> A point of codimension two is interpolated between so many, with values of about this.
  integer, parameter :: nodes = 6
  real(wp), parameter :: node_value = 1e-3_wp

  !> A curve of the points of one label.
  type, public :: curve_t
    integer :: label = no_label
    type(curve_point_t), allocatable :: points(:)
  end type curve_t

  !> One way along a curve: where it is, what was looked at beside it there, and the neighbour that was tried.
  type, extends(continuation_t) :: curve_way_t
    type(family_t) :: family
    type(curve_plan_t) :: plan
    type(curve_position_t) :: position, next
    type(margin_t) :: beside(2)
    type(curve_point_t), allocatable :: points(:)
  contains
    procedure :: points_found, try_step, take_step, give_up
  end type curve_way_t

contains

  !> Whether a label has a curve.
  pure elemental logical function can_be_followed(label)
    integer, intent(in) :: label
    can_be_followed = any(label == [label_sn, label_pd, label_gr, label_gr_fold, label_stick])
  end function can_be_followed

  !> The label of the curve through points of a label: both kinds of grazes lie on one.
  pure integer function curve_label(label)
    integer, intent(in) :: label
    curve_label = merge(label_gr, label, label == label_gr_fold)
  end function curve_label

  !> The curve through a labelled point, both ways; no points where it cannot be followed. `value` is the second parameter of
  !> the case.
  subroutine trace_curve(family, plan, point, value, curve)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(point_t), intent(in) :: point
    real(wp), intent(in) :: value
    type(curve_t), intent(out) :: curve
    type(curve_position_t) :: start
    type(curve_point_t), allocatable :: back(:), further(:)
    real(wp), allocatable :: along(:)
    logical :: ok
    integer :: i
    curve%label = curve_label(point%label)
    allocate (curve%points(0))
    start%now%orbit = point%orbit
    start%now%free = value
    start%label = curve%label
    call set_position(family, plan, start, ok)
    if (.not. ok) return
    allocate (along(unknowns(start%now)), source=0.0_wp)
    along(size(along)) = 1
    call correct(family, plan, start, along, ok)
    if (.not. ok) return
    call set_tangent(family, plan, start, along, ok)
    if (.not. ok) return
    call trace_one_way(family, plan, start, back)
    start%tangent = -start%tangent
    call trace_one_way(family, plan, start, further)
    curve%points = [[(back(i), i=size(back), 1, -1)], further(2:)]
  end subroutine trace_curve

  !> Whether a curve passes a labelled point, `value` being the second parameter there: its points are some distance apart, so that
  !> it is brought to that value where it crosses it.
  logical function passes(family, plan, curve, point, value)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_t), intent(in) :: curve
    type(point_t), intent(in) :: point
    real(wp), intent(in) :: value
    type(curve_position_t) :: there
    real(wp), allocatable :: along(:)
    logical :: ok
    integer :: i, k
    passes = .false.
    if (curve%label /= curve_label(point%label)) return
    do i = 1, size(curve%points) - 1
      associate (one => curve%points(i), next => curve%points(i + 1))
        if (one%orbit%periods /= point%orbit%periods .or. (one%free - value)*(next%free - value) > 0) cycle
        there%now = one
        if (abs(next%free - value) < abs(one%free - value)) there%now = next
      end associate
      there%label = curve%label
      there%monitor = margin_t()
      call set_position(family, plan, there, ok)
      if (.not. ok) cycle
      there%now%free = value
      along = [(0.0_wp, k=1, unknowns(there%now) - 1), 1.0_wp]
      call correct(family, plan, there, along, ok)
      if (.not. ok) cycle
      passes = abs(there%now%orbit%parameter - point%orbit%parameter) < same_point*(plan%highest(1) - plan%lowest(1)) .and. &
        abs(event_speeds(there%now%orbit, family%sizes) - event_speeds(point%orbit, family%sizes)) < same_orbit
      if (passes) return
    end do
  end function passes

  !> The point `length` further.
  subroutine step_on(family, plan, position, length, next, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: position
    real(wp), intent(in) :: length
    type(curve_position_t), intent(out) :: next
    logical, intent(out) :: ok
    next = position
    next%now%second = no_label
    call move(next, length*position%tangent)
    call correct(family, plan, next, position%tangent, ok)
    if (ok) call set_tangent(family, plan, next, position%tangent, ok)
  end subroutine step_on

  !> From a point to the end of a range, or to where another condition vanishes and the events are others beyond.
  subroutine trace_one_way(family, plan, start, points)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: start
    type(curve_point_t), allocatable, intent(out) :: points(:)
    type(curve_way_t) :: way
    way%family = family
    way%plan = plan
    way%position = start
    way%points = [start%now]
    way%beside = looked_at(family, plan, start)
    call way%follow(first_step, smallest_step, most_points)
    call move_alloc(way%points, points)
  end subroutine trace_one_way

  pure integer function points_found(self)
    class(curve_way_t), intent(in) :: self
    points_found = size(self%points)
  end function points_found

  subroutine try_step(self, cosine, ok)
    class(curve_way_t), intent(inout) :: self
    real(wp), intent(out) :: cosine
    logical, intent(out) :: ok
    cosine = -1
    call step_on(self%family, self%plan, self%position, self%step, self%next, ok)
    if (ok) cosine = sum(self%next%tangent*self%position%tangent)
  end subroutine try_step

  subroutine give_up(self)
    class(curve_way_t), intent(inout) :: self
    self%ending = label_not_known
  end subroutine give_up

  subroutine take_step(self)
    class(curve_way_t), intent(inout) :: self
    type(margin_t) :: after(2)
    logical :: ok
    associate (family => self%family, plan => self%plan, position => self%position, next => self%next, before => self%beside)
      if (.not. is_within(plan, next%now)) then
        call end_at_range(family, plan, position, self%step, self%points)
        self%ending = label_range
        return
      end if
      after = looked_at(family, plan, next)
      ! Beyond a margin that was at zero before, or was not there: no motion of the machine.
      if (after(1)%value < -at_zero) self%ending = label_not_known
      if (after(1)%value < 0 .and. before(1)%value > at_zero) then
        call locate(family, plan, position, self%step, 1, after(1), next, ok)
        if (ok) self%points = [self%points, next%now]
        self%ending = label_not_known
      end if
      if (self%ending /= no_label) return
      if (max(abs(before(2)%value), abs(after(2)%value)) < huge(1.0_wp) .and. before(2)%value*after(2)%value < 0) then
        call locate(family, plan, position, self%step, 2, after(2), next, ok)
        if (ok) self%points = [self%points, next%now]
        call step_on(family, plan, position, self%step, next, ok)
      end if
      self%points = [self%points, next%now]
      position = next
      before = after
      self%step = min(largest_step, 1.4_wp*self%step)
    end associate
  end subroutine take_step

  pure logical function is_within(plan, now)
    type(curve_plan_t), intent(in) :: plan
    type(curve_point_t), intent(in) :: now
    associate (both => [now%orbit%parameter, now%free])
      is_within = all(both >= plan%lowest) .and. all(both <= plan%highest)
    end associate
  end function is_within

  !> The last point within the ranges, by halving.
  subroutine end_at_range(family, plan, position, step, points)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: position
    real(wp), intent(in) :: step
    type(curve_point_t), allocatable, intent(inout) :: points(:)
    type(curve_position_t) :: tried, last
    real(wp) :: low, high
    logical :: ok
    integer :: i
    low = 0
    high = step
    do i = 1, most_secants
      call step_on(family, plan, position, (low + high)/2, tried, ok)
      if (ok) ok = is_within(plan, tried%now)
      if (ok) then
        low = (low + high)/2
        last = tried
      else
        high = (low + high)/2
      end if
      if (high - low < 1e-12_wp) exit
    end do
    if (low > 0) points = [points, last%now]
  end subroutine end_at_range

  !> The point of codimension two within a step, where the margin or the test beside the curve that is like `passed` is zero.
  !> Multipliers are large where an impact has no speed, so that the position is interpolated between points on both sides of it.
  subroutine locate(family, plan, position, step, which, passed, there, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: position
    real(wp), intent(in) :: step
    integer, intent(in) :: which
    type(margin_t), intent(in) :: passed
    type(curve_position_t), intent(out) :: there
    logical, intent(out) :: ok
    type(curve_position_t) :: node
    real(wp) :: low, high, f_low, f_high, s, f, distance, value(nodes), all(unknowns(position%now), nodes), weight(nodes)
    integer :: i, k, n, states
    low = 0
    high = step
    f_low = beside_like(family, plan, position, which, passed)
    f_high = passed%value
    do i = 1, most_secants
      s = low + (high - low)*min(max(f_low/(f_low - f_high), 0.1_wp), 0.9_wp)
      call step_on(family, plan, position, s, node, ok)
      ! By chance too near to a graze.
      if (.not. ok) s = s + 0.02_wp*(high - low)
      if (.not. ok) call step_on(family, plan, position, s, node, ok)
      if (.not. ok) return
      f = beside_like(family, plan, node, which, passed)
      if (abs(f) < node_value) exit
      if (f < 0 .eqv. f_high < 0) then
        high = s
        f_high = f
      else
        low = s
        f_low = f
      end if
    end do
    ok = abs(f_high - f_low) > 0
    if (.not. ok) return
    s = s - f*(high - low)/(f_high - f_low)
    distance = min(node_value*(high - low)/abs(f_high - f_low), 0.3_wp*largest_step)
    n = size(all, 1)
    do k = 1, nodes
      call step_on(family, plan, position, s + (2*k - nodes - 1)*distance, node, ok)
      if (.not. ok) return
      value(k) = beside_like(family, plan, node, which, passed)
      all(:, k) = [node%now%orbit%y, node%now%orbit%events%time, node%now%orbit%parameter, node%now%free]
    end do
    call weights_at_zero(value, weight, ok)
    if (.not. ok) return
    there = node
    states = size(there%now%orbit%y)
    there%now%orbit%y = matmul(all(:states, :), weight)
    there%now%orbit%events%time = matmul(all(states + 1:n - 2, :), weight)
    there%now%orbit%parameter = sum(all(n - 1, :)*weight)
    there%now%free = sum(all(n, :)*weight)
    there%now%second = label_of(position%label, which, passed)
  end subroutine locate

  !> Label of the second condition.
  pure integer function label_of(label, which, passed) result(second)
    integer, intent(in) :: label, which
    type(margin_t), intent(in) :: passed
    if (which == 2) then
      second = merge(label_pd, label_sn, label == label_sn)
    else
      second = label_stick
      if (passed%kind == of_impact .or. passed%kind == of_gap) second = label_gr
    end if
  end function label_of

end module bifurcation_curve
