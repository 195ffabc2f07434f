! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Why a flight by Taylor series gave a motion up.
module motor_reason
  use kinds, only: wp
  use series_flight, only: flight_left_domain, flight_no_progress, flight_step_budget, flight_t, flight_wrong_branch
  use status, only: reason_left_domain, reason_mode_cycle, reason_step_budget, reason_step_failed
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: starting_branches
  implicit none
  private

  public :: reason_of_flight

  !> A pole is nearer than the time over this factor.
  real(wp), parameter :: growth = 1e6_wp
  !> Of a quantity y at a pole of order p, y y''/y'^2 is 1 + 1/p; of one that grows by the logarithm of the time left, it is that
  !> logarithm.
  real(wp), parameter :: largest_ratio = 8

contains

  !> The reason for the `status` of a flight, wherever it began; 0 where the motion goes on. Steps shrink to nothing where an
  !> operation is not defined, or before a motion that grows without bound.
  pure integer function reason_of_flight(status, flight) result(reason)
    integer, intent(in) :: status
    type(flight_t), intent(in) :: flight
    reason = 0
    if (status == flight_step_budget) reason = reason_step_budget
    if (status == flight_left_domain .or. status == flight_no_progress) then
      reason = merge(reason_left_domain, reason_step_failed, grew_without_bound(flight))
    end if
    if (status == flight_wrong_branch) reason = reason_mode_cycle
  end function reason_of_flight

  !> Whether one of the variables is at a pole in time. A speed whose rate alone has a pole, as beside a division by zero, is not.
  pure logical function grew_without_bound(flight)
    type(flight_t), intent(in) :: flight
    type(series_t) :: series
    real(wp), dimension(size(flight%rates)) :: now, rate, ratio
    integer :: branches(size(flight%tape%switches)), fault
    now = flight%state
    call starting_branches(flight%tape, flight%state, flight%parameters, branches)
    where (branches == 0) branches = 1
    call prepare_series(flight%tape, 1, flight%rates, [integer ::], branches, series)
    series%unit = tiny(1.0_wp)**0.25_wp
    call expand(flight%tape, flight%state, flight%parameters, series, fault)
    grew_without_bound = fault /= 0 .and. any(abs(now) > growth)
    if (fault /= 0) return
    rate = series%c(0, flight%rates)
    ratio = 0
    where (abs(rate) > 0) ratio = (now/rate)*(series%c(1, flight%rates)/series%unit/rate)
    grew_without_bound = any(abs(rate)*flight%time > growth*abs(now) .and. ratio > 1 .and. ratio < largest_ratio)
  end function grew_without_bound

end module motor_reason
