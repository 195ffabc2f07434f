! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The equations of a labelled point of a branch over two parameters: the orbit closes, and what the label is of is zero. Their
!> derivatives are differences; Newton's method in all unknowns and both parameters.
module curve_equations
  use body_family, only: body_of_family, family_t
  use branch_point, only: label_gr, label_pd, label_sn, no_label
  use errors, only: error_t
  use kinds, only: wp
  use law_table, only: change_parameter
  use matrices, only: eigenvalues, solve
  use one_body, only: one_body_t
  use orbit_margins, only: margin_t, margins_of, margins_t, of_gap, of_impact, of_order, of_release, of_slip
  use periodic_orbit, only: move_along, orbit_t, shoot
  use variations, only: neighbourhood_t, vary
  implicit none
  private

  public :: choose_monitor, unknowns, correct, set_tangent, move, looked_at, beside_like

  integer, parameter :: most_newton = 15
  !> Coordinates of one body.
  integer, parameter :: states = 2
  !> Steps of the differences and of Newton's method at the end, in natural sizes.
  real(wp), parameter :: difference = 1e-5_wp, converged_step = 1e-10_wp
  !> A margin within this of zero at a labelled point is what is zero there.
  real(wp), parameter, public :: at_zero = 1e-7_wp
  !> An impact and a turning point nearer to each other than this share of the period are the same graze.
  real(wp), parameter :: one_touch = 1e-4_wp

  !> A point of a curve: the orbit, the second parameter, and what else is zero there.
  type, public :: curve_point_t
    type(orbit_t) :: orbit
    real(wp) :: free = 0
    !> Label of the second condition at a point of codimension two.
    integer :: second = no_label
  end type curve_point_t

  !> The second parameter, and the ranges of both.
  type, public :: curve_plan_t
    character(len=:), allocatable :: free
    real(wp) :: lowest(2) = 0, highest(2) = 0
  end type curve_plan_t

  !> Where a trace of a curve is; `monitor` is the margin that is zero on it, without one the test of its label.
  type, public :: place_t
    type(curve_point_t) :: now
    integer :: label = no_label
    type(margin_t) :: monitor
    real(wp), allocatable :: tangent(:)
  end type place_t

contains

  pure integer function unknowns(now)
    type(curve_point_t), intent(in) :: now
    unknowns = states + size(now%orbit%events) + 2
  end function unknowns

  !> The machine of a point.
  subroutine machine_at(family, plan, now, body, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_point_t), intent(in) :: now
    type(one_body_t), intent(out) :: body
    logical, intent(out) :: ok
    type(family_t) :: here
    type(error_t), allocatable :: error
    here = family
    call change_parameter(here%laws, plan%free, now%free, ok)
    call body_of_family(here, now%orbit%parameter, body, error)
    ok = ok .and. .not. allocated(error)
  end subroutine machine_at

  !> The margin that is zero at a point; a fold and a doubling have none.
  subroutine choose_monitor(family, plan, place, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(inout) :: place
    logical, intent(out) :: ok
    type(one_body_t) :: body
    type(margins_t) :: margins
    real(wp), allocatable :: miss(:), slopes(:, :)
    integer :: i
    ok = place%label == label_sn .or. place%label == label_pd
    if (ok) return
    call machine_at(family, plan, place%now, body, ok)
    if (.not. ok) return
    i = unknowns(place%now) - 2
    allocate (miss(i), slopes(i, i))
    call shoot(body, place%now%orbit, miss, slopes)
    margins = margins_of(body, place%now%orbit)
    ok = .false.
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (ok .or. .not. abs(one%value) < at_zero .or. one%kind == of_order .or. one%kind == of_release) cycle
        ok = (place%label == label_gr) .eqv. (one%kind == of_impact .or. one%kind == of_gap)
        if (ok) place%monitor = one
      end associate
    end do
  end subroutine choose_monitor

  !> What must be zero on the curve: the orbit does not close, and the monitor; then, beside, what is looked at: the least of the
  !> other margins, and the other test of multipliers.
  subroutine residual(family, plan, place, left, beside, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(inout) :: place
    real(wp), intent(out) :: left(:)
    type(margin_t), intent(out), optional :: beside(2)
    logical, intent(out) :: ok
    type(one_body_t) :: body
    type(margins_t) :: margins
    real(wp) :: slopes(size(left) - 1, size(left) - 1), test(2), touch
    integer :: i, n
    n = size(left) - 1
    left = 0
    call machine_at(family, plan, place%now, body, ok)
    if (.not. ok) return
    call shoot(body, place%now%orbit, left(:n), slopes)
    if (present(beside) .or. place%monitor%kind /= 0) margins = margins_of(body, place%now%orbit)
    test = huge(1.0_wp)
    if (place%monitor%kind == 0) test = tests(body, place%now%orbit)
    if (place%monitor%kind == 0) left(n + 1) = merge(test(1), test(2), place%label == label_sn)
    if (place%monitor%kind /= 0) left(n + 1) = huge(1.0_wp)
    touch = -huge(touch)
    if (place%monitor%kind /= 0) then
      do i = 1, size(margins%list)
        if (.not. is_same(margins%list(i), place%monitor)) cycle
        left(n + 1) = margins%list(i)%value
        touch = margins%list(i)%time
      end do
    end if
    ok = all(abs(left) < 1e100_wp)
    if (.not. present(beside)) return
    beside = margin_t()
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (one%kind == of_order .or. is_same(one, place%monitor)) cycle
        ! A graze is an impact without speed and a turning point without a gap.
        if (any(one%kind == [of_impact, of_gap]) .and. abs(one%time - touch) < one_touch*body%period) cycle
        if (one%value < beside(1)%value) beside(1) = one
      end associate
    end do
    if (place%monitor%kind == 0) beside(2)%value = merge(test(2), test(1), place%label == label_sn)
  end subroutine residual

  pure logical function is_same(one, other)
    type(margin_t), intent(in) :: one, other
    is_same = one%kind == other%kind
    if (one%kind == of_gap) is_same = is_same .and. one%side == other%side
    if (one%kind /= of_gap .and. one%kind /= of_slip) is_same = is_same .and. one%event == other%event
  end function is_same

  !> det(M - 1) and det(M + 1), times the speeds of the impacts: smooth also where one has none.
  function tests(body, orbit) result(test)
    type(one_body_t), intent(in) :: body
    type(orbit_t), intent(inout) :: orbit
    real(wp) :: test(2), m(states, states), speeds, determinant
    type(neighbourhood_t) :: machines
    type(margins_t) :: margins
    logical :: ok
    test = huge(1.0_wp)
    allocate (machines%centre, source=body)
    call vary(machines, orbit%mode, orbit%y, orbit%events, orbit%periods*body%period, [huge(1.0_wp), huge(1.0_wp)], m, ok, &
              determinant=determinant)
    if (.not. ok) return
    orbit%matrix = m
    orbit%multipliers = eigenvalues(m, determinant)
    margins = margins_of(body, orbit)
    speeds = product(margins%list%value, mask=margins%list%kind == of_impact)
    test = speeds*(1 + [-1, 1]*(m(1, 1) + m(2, 2)) + determinant)
  end function tests

  !> Natural sizes of the unknowns: state, instants, both parameters.
  function sizes_of(family, plan, now) result(sizes)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_point_t), intent(in) :: now
    real(wp) :: sizes(unknowns(now))
    integer :: n
    n = size(sizes)
    sizes = family%sizes(1)/family%sizes(2)
    sizes(:states) = family%sizes
    sizes(n - 1:) = plan%highest - plan%lowest
  end function sizes_of

  !> Moves all unknowns by a change in natural sizes.
  subroutine move(family, plan, now, change)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_point_t), intent(inout) :: now
    real(wp), intent(in) :: change(:)
    real(wp) :: by(size(change))
    integer :: n
    n = size(change)
    by = change*sizes_of(family, plan, now)
    call move_along(now%orbit, by(:n - 1))
    now%free = now%free + by(n)
  end subroutine move

  !> The equations and their derivatives by all unknowns, by differences of fourth order, each over its largest; `rows` are the
  !> factors.
  subroutine linearise(family, plan, place, left, slopes, ok, rows)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(inout) :: place
    real(wp), intent(out) :: left(:), slopes(:, :)
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: rows(:)
    type(place_t) :: near
    real(wp) :: values(size(left), -2:2), change(size(left) + 1)
    integer :: i, k
    call residual(family, plan, place, left, ok=ok)
    if (.not. ok) return
    do k = 1, size(left) + 1
      do i = -2, 2
        if (i == 0) cycle
        near = place
        change = 0
        change(k) = i*difference
        call move(family, plan, near%now, change)
        call residual(family, plan, near, values(:, i), ok=ok)
        if (.not. ok) return
      end do
      slopes(:size(left), k) = (8*(values(:, 1) - values(:, -1)) - (values(:, 2) - values(:, -2)))/(12*difference)
    end do
    do i = 1, size(left)
      associate (largest => maxval(abs(slopes(i, :))))
        if (present(rows)) rows(i) = 1
        if (.not. largest > 0) cycle
        if (present(rows)) rows(i) = 1/largest
        left(i) = left(i)/largest
        slopes(i, :) = slopes(i, :)/largest
      end associate
    end do
  end subroutine linearise

  !> Newton's method across `along`.
  subroutine correct(family, plan, place, along, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(inout) :: place
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    real(wp), dimension(size(along)) :: right, change, rows
    real(wp) :: slopes(size(along), size(along)), before, length
    logical :: fresh
    integer :: i, n
    n = size(along)
    length = huge(length)
    fresh = .false.
    rows = 1
    do i = 1, most_newton
      ! The derivatives are taken anew only where the steps do not shrink fast.
      if (.not. fresh) then
        call linearise(family, plan, place, right(:n - 1), slopes(:n - 1, :), ok, rows(:n - 1))
      else
        call residual(family, plan, place, right(:n - 1), ok=ok)
        right = right*rows
      end if
      if (.not. ok) return
      slopes(n, :) = along
      right(n) = 0
      call solve(slopes, -right, change, ok)
      if (ok) ok = all(abs(change) < 0.5_wp)
      if (.not. ok) return
      call move(family, plan, place%now, change)
      before = length
      length = norm2(change)
      fresh = i == 1 .or. length < 0.2_wp*before
      if (length < 1e-14_wp .or. (length < converged_step .and. length > 0.1_wp*before)) exit
    end do
    ok = length < converged_step
  end subroutine correct

  subroutine set_tangent(family, plan, place, along, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(inout) :: place
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    real(wp), dimension(size(along)) :: left, right
    real(wp) :: slopes(size(along), size(along))
    integer :: n
    n = size(along)
    place%tangent = along
    call linearise(family, plan, place, left(:n - 1), slopes(:n - 1, :), ok)
    if (.not. ok) return
    slopes(n, :) = along
    right = 0
    right(n) = 1
    call solve(slopes, right, place%tangent, ok)
    place%tangent = place%tangent/norm2(place%tangent)
  end subroutine set_tangent

  function looked_at(family, plan, place) result(beside)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(in) :: place
    type(margin_t) :: beside(2)
    type(place_t) :: copy
    real(wp) :: left(unknowns(place%now) - 1)
    logical :: ok
    copy = place
    call residual(family, plan, copy, left, beside, ok)
  end function looked_at

  !> Value of what is beside a curve: a margin like one, or the other test.
  real(wp) function beside_like(family, plan, place, which, margin) result(value)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(place_t), intent(in) :: place
    integer, intent(in) :: which
    type(margin_t), intent(in) :: margin
    type(place_t) :: copy
    type(margin_t) :: beside(2)
    type(margins_t) :: margins
    type(one_body_t) :: body
    real(wp) :: left(unknowns(place%now) - 1)
    logical :: ok
    integer :: i
    copy = place
    call residual(family, plan, copy, left, beside, ok)
    value = beside(which)%value
    if (which == 2) return
    call machine_at(family, plan, copy%now, body, ok)
    margins = margins_of(body, copy%now%orbit)
    do i = 1, size(margins%list)
      if (is_same(margins%list(i), margin)) value = margins%list(i)%value
    end do
  end function beside_like

end module curve_equations
