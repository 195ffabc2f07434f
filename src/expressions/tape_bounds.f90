! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bounds over a box of variables: of values, by interval arithmetic, and of Taylor coefficients, by their recurrences on
!> magnitudes. The latter are coarser than interval coefficients for orders of one and two, cost a quarter, and lose little over
!> the box of a whole step, where signs are open anyway.
module tape_bounds
  use intervals, only: hull, interval_t, least_magnitude, magnitude, operate_on_intervals
  use kinds, only: wp
  use operations, only: op_constant, op_parameter, op_select, op_variable, operation_table
  use tape, only: node_t, tape_t
  use tape_series, only: make_room, raise_orders, series_t
  implicit none
  private

  public :: bound_values, bound_coefficients

contains

  !> Intervals that contain the value of every node all over a box. `fault(i)` is the node, on which node i depends, whose
  !> operation is not proven to be defined there, or 0. `branches`: sign of each switching function, otherwise those that
  !> occur in the box.
  pure subroutine bound_values(tape, box, parameters, bound, fault, branches)
    type(tape_t), intent(in) :: tape
    type(interval_t), intent(in) :: box(:)
    real(wp), intent(in) :: parameters(:)
    type(interval_t), intent(out) :: bound(tape%count)
    integer, intent(out) :: fault(tape%count)
    integer, intent(in), optional :: branches(:)
    integer :: i
    do i = 1, tape%count
      call bound_node(tape, i, box, parameters, bound, fault, branches)
    end do
  end subroutine bound_values

  pure subroutine bound_node(tape, i, box, parameters, bound, fault, branches)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i
    type(interval_t), intent(in) :: box(:)
    real(wp), intent(in) :: parameters(:)
    type(interval_t), intent(inout) :: bound(tape%count)
    integer, intent(inout) :: fault(tape%count)
    integer, intent(in), optional :: branches(:)
    type(interval_t) :: chosen
    integer :: a, b, origin
    logical :: is_defined
    fault(i) = 0
    a = tape%nodes(i)%first
    b = a
    select case (tape%nodes(i)%operation)
    case (op_constant)
      bound(i) = interval_t(tape%nodes(i)%value, tape%nodes(i)%value)
    case (op_variable)
      bound(i) = box(a)
    case (op_parameter)
      bound(i) = interval_t(parameters(a), parameters(a))
    case (op_select)
      call bound_branch(tape, tape%nodes(i), bound(:i - 1), fault(:i - 1), chosen, origin, branches)
      bound(i) = chosen
      fault(i) = origin
    case default
      if (operation_table(tape%nodes(i)%operation)%arguments > 1) b = tape%nodes(i)%second
      fault(i) = max(fault(a), fault(b))
      bound(i) = interval_t()
      if (fault(i) > 0) return
      call operate_on_intervals(tape%nodes(i)%operation, bound(a), bound(b), bound(i), is_defined)
      if (.not. is_defined) fault(i) = i
    end select
  end subroutine bound_node

  pure subroutine bound_branch(tape, node, bound, fault, chosen, origin, branches)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    type(interval_t), intent(in) :: bound(:)
    integer, intent(in) :: fault(:)
    type(interval_t), intent(out) :: chosen
    integer, intent(out) :: origin
    integer, intent(in), optional :: branches(:)
    integer :: argument
    logical :: occurs(2), is_given
    argument = tape%switches(node%first)%argument
    origin = 0
    is_given = .false.
    if (present(branches)) is_given = node%first <= size(branches)
    if (is_given) then
      occurs = [branches(node%first) > 0, branches(node%first) <= 0]
    else
      origin = fault(argument)
      if (origin > 0) return
      occurs = [bound(argument)%high >= 0, bound(argument)%low <= 0]
    end if
    chosen = bound(node%second)
    origin = fault(node%second)
    if (.not. occurs(1)) then
      chosen = bound(node%third)
      origin = fault(node%third)
    else if (occurs(2)) then
      chosen = hull(chosen, bound(node%third))
      origin = max(origin, fault(node%third))
    end if
  end subroutine bound_branch

  !> Bounds on the magnitudes of the Taylor coefficients of every node at any point of the box, in `series%c`; `series` is
  !> prepared as for coefficients. `fault` is 0, or a node whose operation or series is not proven to be defined; negative
  !> where a bound is too large.
  pure subroutine bound_coefficients(tape, box, parameters, series, fault)
    type(tape_t), intent(in) :: tape
    type(interval_t), intent(in) :: box(:)
    real(wp), intent(in) :: parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    type(interval_t) :: bound(tape%count)
    integer :: faults(tape%count), i
    bound = interval_t()
    faults = 0
    do i = 1, size(series%steady)
      call bound_node(tape, series%steady(i), box, parameters, bound, faults, series%branches)
    end do
    do i = 1, size(series%varying)
      call bound_node(tape, series%varying(i), box, parameters, bound, faults, series%branches)
    end do
    fault = maxval(faults, mask=series%is_used)
    if (fault > 0) return
    call make_room(tape%count, series)
    series%c(0, :) = magnitude(bound)
    call raise_orders(1.0_wp, least_magnitude(bound), series, fault)
  end subroutine bound_coefficients

end module tape_bounds
