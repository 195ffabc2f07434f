! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Taylor coefficients in time of every node, along the solution of z' = f(z) whose rates are nodes of the tape. A time that
!> occurs in f is a state with the rate 1.
module tape_series
  use kinds, only: wp
  use operations, only: op_variable
  use series_program, only: compile, instruction_t, put_termwise_last
  use series_terms, only: raise_all
  use tape, only: tape_t
  use tape_parts, only: needed
  use tape_value, only: evaluate_some
  implicit none
  private

  public :: prepare_series, make_room, expand, expand_values, raise_orders

  !> What a series is made of: the nodes in use with the given branches, and where it is stored.
  type, public :: series_t
    integer :: order = 0
    !> The time is counted in this unit, so that coefficients of high orders do not overflow.
    real(wp) :: unit = 1
    !> Coefficients of powers of the time: (0:order, node); there is no room for them before the first expansion.
    real(wp), allocatable :: c(:, :)
    !> Nodes in use; how those of them that vary get their coefficients.
    logical, allocatable :: is_used(:)
    type(instruction_t), allocatable :: program(:)
    !> The first instructions need each other order by order; those after them give all orders at once.
    integer :: together = 0
    !> Nodes whose values are needed, those that are steady apart; values and faults, and the parameters that they are for.
    integer, allocatable :: steady(:), varying(:)
    real(wp), allocatable :: value(:), parameters(:)
    integer, allocatable :: faults(:)
    !> Node of the rate of each variable.
    integer, allocatable :: rates(:)
    integer, allocatable :: branches(:)
  end type series_t

contains

  !> Prepares the series of a system up to `order`: `rates` are the nodes of the rates of its variables, `wanted` other
  !> nodes whose series will be needed, `branches` the sign of every switching function. `only_used`: values of other nodes will
  !> not be needed either.
  pure subroutine prepare_series(tape, order, rates, wanted, branches, series, only_used)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order, rates(:), wanted(:), branches(:)
    type(series_t), intent(inout) :: series
    logical, intent(in), optional :: only_used
    logical :: has_value(tape%count)
    integer :: i
    series%order = order
    series%rates = rates
    series%branches = branches
    series%is_used = needed(tape, [rates, wanted], branches)
    do i = 1, tape%count
      if (tape%nodes(i)%operation == op_variable) series%is_used(i) = .true.
    end do
    call compile(tape, rates, branches, series%is_used, series%program)
    call put_termwise_last(series%program, tape%count, order, series%together)
    has_value = .true.
    if (present(only_used)) then
      ! The other branch serves where a step goes past a switch.
      if (only_used) has_value = series%is_used .or. needed(tape, [rates, wanted])
    end if
    series%steady = pack([(i, i=1, tape%count)], has_value .and. tape%nodes(:tape%count)%is_steady)
    series%varying = pack([(i, i=1, tape%count)], has_value .and. .not. tape%nodes(:tape%count)%is_steady)
    if (allocated(series%parameters)) deallocate (series%parameters)
    series%value = [(0.0_wp, i=1, tape%count)]
    series%faults = [(0, i=1, tape%count)]
    if (.not. allocated(series%c)) return
    if (ubound(series%c, 1) /= order .or. size(series%c, 2) /= tape%count) then
      deallocate (series%c)
    else
      series%c = 0
    end if
  end subroutine prepare_series

  !> Room for the coefficients, only where they are needed: prepared series are often copied.
  pure subroutine make_room(nodes, series)
    integer, intent(in) :: nodes
    type(series_t), intent(inout) :: series
    if (.not. allocated(series%c)) allocate (series%c(0:series%order, nodes), source=0.0_wp)
  end subroutine make_room

  !> Coefficients at a point. `fault` is 0, or the node whose operation, or series, is not defined there; negative where a
  !> coefficient is too large, as the unit of time is.
  pure subroutine expand(tape, variables, parameters, series, fault)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    call expand_values(tape, variables, parameters, series, fault)
    if (fault == 0) call raise_orders(-1.0_wp, series%value, series, fault)
  end subroutine expand

  !> Only the coefficients of order 0. What is steady is evaluated again where parameters have changed.
  pure subroutine expand_values(tape, variables, parameters, series, fault)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    logical :: is_known
    integer :: i
    call make_room(tape%count, series)
    is_known = .false.
    if (allocated(series%parameters)) is_known = all(abs(series%parameters - parameters) <= 0)
    if (.not. is_known) then
      series%parameters = parameters
      call evaluate_some(tape, series%steady, variables, parameters, series%value, series%faults, series%branches)
      series%c(0, series%steady) = series%value(series%steady)
    end if
    call evaluate_some(tape, series%varying, variables, parameters, series%value, series%faults, series%branches)
    do i = 1, size(series%varying)
      series%c(0, series%varying(i)) = series%value(series%varying(i))
    end do
    fault = 0
    if (any(series%faults > 0)) fault = maxval(series%faults, mask=series%is_used)
    fault = max(fault, 0)
  end subroutine expand_values

  !> Coefficients from order 1 on, from those of order 0. `sign` -1: coefficients. 1: bounds on their magnitudes, from bounds in
  !> `c(0, :)` and lower bounds of the magnitudes of divisors in `divisor`.
  pure subroutine raise_orders(sign, divisor, series, fault)
    real(wp), intent(in) :: sign, divisor(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    integer :: at
    fault = 0
    do at = 1, size(series%program)
      if (series%program(at)%divisor == 0) cycle
      if (.not. abs(divisor(series%program(at)%divisor)) > 0) fault = series%program(at)%node
    end do
    if (fault == 0) call raise_all(series%program, series%together, series%order, series%unit, sign, divisor, series%c, fault)
  end subroutine raise_orders

end module tape_series
