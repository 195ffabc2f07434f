! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Taylor coefficients in time of every node, along the solution of z' = f(z) whose rates are nodes of the tape. A time that
!> occurs in f is a state with the rate 1.
module tape_series
  use kinds, only: wp
  use operations, only: op_variable
  use series_terms, only: compile, instruction_t, raise_all
  use tape, only: tape_t
  use tape_parts, only: needed
  use tape_value, only: evaluate
  implicit none
  private

  public :: prepare_series, expand, raise_orders

  !> What a series is made of: the nodes in use with the given branches, and where it is stored.
  type, public :: series_t
    integer :: order = 0
    !> The time is counted in this unit, so that coefficients of high orders do not overflow.
    real(wp) :: unit = 1
    !> Coefficients of powers of the time: (0:order, node).
    real(wp), allocatable :: c(:, :)
    !> Nodes in use; how those of them that vary get their coefficients.
    logical, allocatable :: is_used(:)
    type(instruction_t), allocatable :: program(:)
    !> Node of the rate of each variable.
    integer, allocatable :: rates(:)
    integer, allocatable :: branches(:)
  end type series_t

contains

  !> Makes room for the series of a system up to `order`: `rates` are the nodes of the rates of its variables, `wanted` other
  !> nodes whose series will be needed, `branches` the sign of every switching function.
  pure subroutine prepare_series(tape, order, rates, wanted, branches, series)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: order, rates(:), wanted(:), branches(:)
    type(series_t), intent(inout) :: series
    integer :: i
    series%order = order
    series%rates = rates
    series%branches = branches
    series%is_used = needed(tape, [rates, wanted], branches)
    do i = 1, tape%count
      if (tape%nodes(i)%operation == op_variable) series%is_used(i) = .true.
    end do
    call compile(tape, rates, branches, series%is_used, series%program)
    if (allocated(series%c)) then
      if (ubound(series%c, 1) /= order .or. size(series%c, 2) /= tape%count) deallocate (series%c)
    end if
    if (.not. allocated(series%c)) allocate (series%c(0:order, tape%count))
    series%c = 0
  end subroutine prepare_series

  !> Coefficients at a point. `fault` is 0, or the node whose operation, or series, is not defined there; negative where a
  !> coefficient is too large, as the unit of time is.
  pure subroutine expand(tape, variables, parameters, series, fault)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: variables(:), parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    real(wp) :: value(tape%count)
    integer :: faults(tape%count)
    call evaluate(tape, variables, parameters, value, faults, series%branches)
    fault = maxval(faults, mask=series%is_used)
    if (fault > 0) return
    series%c(0, :) = value
    call raise_orders(-1.0_wp, value, series, fault)
  end subroutine expand

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
    if (fault == 0) call raise_all(series%program, series%order, series%unit, sign, divisor, series%c, fault)
  end subroutine raise_orders

end module tape_series
