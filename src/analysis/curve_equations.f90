! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The equations of a labelled point of a branch over two parameters: the orbit closes, and what the label is of is zero. Their
!> derivatives are differences; Newton's method in all unknowns and both parameters.
module curve_equations
  use body_family, only: family_t
  use branch_point, only: label_gr, label_pd, label_sn, no_label
  use constants, only: unreachable
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use law_table, only: change_parameter
  use margins_along, only: margins_of_machine
  use machine_family, only: machine_of_family
  use matrices, only: solve
  use multipliers, only: shifted_determinant
  use orbit_margins, only: is_between, margin_t, margins_t, of_gap, of_impact, of_order, of_release, same_meaning
  use periodic_orbit, only: move_along, orbit_t, set_multipliers, shoot
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: set_position, unknowns, correct, set_tangent, move, looked_at, beside_like

  integer, parameter :: most_newton = 15
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
  type, public :: curve_position_t
    type(curve_point_t) :: now
    integer :: label = no_label
    type(margin_t) :: monitor
    real(wp), allocatable :: tangent(:)
    !> Natural sizes of the unknowns: state, instants, both parameters.
    real(wp), allocatable :: sizes(:)
  end type curve_position_t

contains

  pure integer function unknowns(now)
    type(curve_point_t), intent(in) :: now
    unknowns = size(now%orbit%y) + size(now%orbit%events) + 2
  end function unknowns

  !> The machine of a point.
  subroutine machine_at(family, plan, now, machine, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_point_t), intent(in) :: now
    class(hybrid_t), allocatable, intent(out) :: machine
    logical, intent(out) :: ok
    type(family_t) :: here
    type(error_t), allocatable :: error
    here = family
    call change_parameter(here%laws, plan%free, now%free, ok)
    if (ok) call machine_of_family(here, now%orbit%parameter, machine, error)
    ok = ok .and. .not. allocated(error)
  end subroutine machine_at

  !> Sizes of the unknowns of a point, and the margin that is zero there; a fold and a doubling have none. One of an event is taken
  !> before one between events.
  subroutine set_position(family, plan, position, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(inout) :: position
    logical, intent(out) :: ok
    class(hybrid_t), allocatable :: machine
    type(margins_t) :: margins
    real(wp), allocatable :: miss(:), slopes(:, :)
    integer :: i, n
    call machine_at(family, plan, position%now, machine, ok)
    if (.not. ok) return
    n = unknowns(position%now) - 2
    position%sizes = [machine%size_of, [(machine%size_of_time(), i=1, size(position%now%orbit%events))], plan%highest - plan%lowest]
    if (position%label == label_sn .or. position%label == label_pd) return
    allocate (miss(n), slopes(n, n))
    call shoot(machine, position%now%orbit, miss, slopes)
    margins = margins_of_machine(machine, position%now%orbit)
    ok = .false.
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (.not. abs(one%value) < at_zero .or. one%kind == of_order .or. one%kind == of_release) cycle
        if ((position%label == label_gr) .neqv. (one%kind == of_impact .or. one%kind == of_gap)) cycle
        if (ok .and. (is_between(one) .or. .not. is_between(position%monitor))) cycle
        ok = .true.
        position%monitor = one
      end associate
    end do
  end subroutine set_position

  !> What must be zero on the curve: the orbit does not close, and the monitor; then, beside, what is looked at: the least of the
  !> other margins, and the other test of multipliers.
  subroutine residual(machine, position, left, beside, ok)
    class(hybrid_t), intent(in) :: machine
    type(curve_position_t), intent(inout) :: position
    real(wp), intent(out) :: left(:)
    type(margin_t), intent(out), optional :: beside(2)
    logical, intent(out) :: ok
    type(margins_t) :: margins
    real(wp) :: slopes(size(left) - 1, size(left) - 1), test(2), touch
    integer :: i, n
    n = size(left) - 1
    call shoot(machine, position%now%orbit, left(:n), slopes)
    margins = margins_of_machine(machine, position%now%orbit, &
                                 events_only=.not. (present(beside) .or. is_between(position%monitor)))
    test = huge(1.0_wp)
    if (position%monitor%kind == 0) test = tests(machine, position%now%orbit, margins)
    if (position%monitor%kind == 0) left(n + 1) = merge(test(1), test(2), position%label == label_sn)
    if (position%monitor%kind /= 0) left(n + 1) = huge(1.0_wp)
    touch = -huge(touch)
    if (position%monitor%kind /= 0) then
      do i = 1, size(margins%list)
        if (.not. same_meaning(margins%list(i), position%monitor)) cycle
        left(n + 1) = margins%list(i)%value
        touch = margins%list(i)%time
      end do
    end if
    ok = all(abs(left) < 1e100_wp)
    if (.not. present(beside)) return
    beside = margin_t()
    do i = 1, size(margins%list)
      associate (one => margins%list(i))
        if (one%kind == of_order .or. same_meaning(one, position%monitor)) cycle
        ! A graze is an impact without speed and a turning point without a gap.
        if (any(one%kind == [of_impact, of_gap]) .and. one%joint == position%monitor%joint .and. &
            abs(one%time - touch) < one_touch*machine%period) cycle
        if (one%value < beside(1)%value) beside(1) = one
      end associate
    end do
    if (position%monitor%kind == 0) beside(2)%value = merge(test(2), test(1), position%label == label_sn)
  end subroutine residual

  !> The products of 1 - m and of 1 + m over the multipliers m, times the speeds of the impacts: smooth also where one has none.
  function tests(machine, orbit, margins) result(test)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(inout) :: orbit
    type(margins_t), intent(in) :: margins
    real(wp) :: test(2)
    type(neighbourhood_t) :: machines
    test = huge(1.0_wp)
    allocate (machines%centre, source=machine)
    call set_multipliers(machines, orbit)
    if (.not. all(abs(orbit%matrix) < unreachable)) return
    if (size(orbit%y) == 2) then
      ! From the determinant by factors, which keeps its digits beside a graze.
      test = real([product(1 - orbit%multipliers), product(1 + orbit%multipliers)], wp)
    else
      test = [(-1)**size(orbit%y)*shifted_determinant(orbit%matrix, -1.0_wp), shifted_determinant(orbit%matrix, 1.0_wp)]
    end if
    test = test*product(margins%list%value, mask=margins%list%kind == of_impact)
  end function tests

  !> Moves all unknowns by a change in natural sizes.
  subroutine move(position, change)
    type(curve_position_t), intent(inout) :: position
    real(wp), intent(in) :: change(:)
    real(wp) :: by(size(change))
    integer :: n
    n = size(change)
    by = change*position%sizes
    call move_along(position%now%orbit, by(:n - 1))
    position%now%free = position%now%free + by(n)
  end subroutine move

  !> The equations and their derivatives by all unknowns, by differences of fourth order, each over its largest; `rows` are the
  !> factors.
  subroutine linearise(family, plan, position, left, slopes, ok, rows)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(inout) :: position
    real(wp), intent(out) :: left(:), slopes(:, :)
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: rows(:)
    type(curve_position_t) :: near
    class(hybrid_t), allocatable :: machine, there
    real(wp) :: values(size(left), -2:2), change(size(left) + 1)
    integer :: i, k
    call machine_at(family, plan, position%now, machine, ok)
    if (ok) call residual(machine, position, left, ok=ok)
    if (.not. ok) return
    do k = 1, size(change)
      do i = -2, 2
        if (i == 0) cycle
        near = position
        change = 0
        change(k) = i*difference
        call move(near, change)
        ! The last two are the parameters.
        if (k < size(change) - 1) then
          call residual(machine, near, values(:, i), ok=ok)
        else
          call machine_at(family, plan, near%now, there, ok)
          if (ok) call residual(there, near, values(:, i), ok=ok)
        end if
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
  subroutine correct(family, plan, position, along, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(inout) :: position
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    class(hybrid_t), allocatable :: machine
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
        call linearise(family, plan, position, right(:n - 1), slopes(:n - 1, :), ok, rows(:n - 1))
      else
        call machine_at(family, plan, position%now, machine, ok)
        if (ok) call residual(machine, position, right(:n - 1), ok=ok)
        right = right*rows
      end if
      if (.not. ok) return
      slopes(n, :) = along
      right(n) = 0
      call solve(slopes, -right, change, ok)
      if (ok) ok = all(abs(change) < 0.5_wp)
      if (.not. ok) return
      call move(position, change)
      before = length
      length = norm2(change)
      fresh = i == 1 .or. length < 0.2_wp*before
      if (length < 1e-14_wp .or. (length < converged_step .and. length > 0.1_wp*before)) exit
    end do
    ok = length < converged_step
  end subroutine correct

  subroutine set_tangent(family, plan, position, along, ok)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(inout) :: position
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    real(wp), dimension(size(along)) :: left, right
    real(wp) :: slopes(size(along), size(along))
    integer :: n
    n = size(along)
    position%tangent = along
    call linearise(family, plan, position, left(:n - 1), slopes(:n - 1, :), ok)
    if (.not. ok) return
    slopes(n, :) = along
    right = 0
    right(n) = 1
    call solve(slopes, right, position%tangent, ok)
    position%tangent = position%tangent/norm2(position%tangent)
  end subroutine set_tangent

  !> What lies beside a curve at a position: the least of the other margins, and the other test of multipliers.
  function looked_at(family, plan, position) result(beside)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: position
    type(margin_t) :: beside(2)
    class(hybrid_t), allocatable :: machine
    type(curve_position_t) :: copy
    real(wp) :: left(unknowns(position%now) - 1)
    logical :: ok
    copy = position
    call machine_at(family, plan, copy%now, machine, ok)
    if (ok) call residual(machine, copy, left, beside, ok)
  end function looked_at

  !> Value of what is beside a curve: a margin like one, or the other test.
  real(wp) function beside_like(family, plan, position, which, margin) result(value)
    type(family_t), intent(in) :: family
    type(curve_plan_t), intent(in) :: plan
    type(curve_position_t), intent(in) :: position
    integer, intent(in) :: which
    type(margin_t), intent(in) :: margin
    class(hybrid_t), allocatable :: machine
    type(curve_position_t) :: copy
    type(margin_t) :: beside(2)
    type(margins_t) :: margins
    real(wp) :: left(unknowns(position%now) - 1)
    logical :: ok
    integer :: i
    copy = position
    value = huge(value)
    call machine_at(family, plan, copy%now, machine, ok)
    if (.not. ok) return
    call residual(machine, copy, left, beside, ok)
    value = beside(which)%value
    if (which == 2) return
    margins = margins_of_machine(machine, copy%now%orbit)
    do i = 1, size(margins%list)
      if (same_meaning(margins%list(i), margin)) value = margins%list(i)%value
    end do
  end function beside_like

end module curve_equations
