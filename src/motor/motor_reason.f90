! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Why a flight by Taylor series gave a motion up.
module motor_reason
  use kinds, only: wp
  use series_flight, only: flight_left_domain, flight_no_progress, flight_step_budget, flight_t, flight_wrong_branch
  use status, only: reason_left_domain, reason_mode_cycle, reason_step_budget, reason_step_failed
  use tape_value, only: evaluate
  implicit none
  private

  public :: reason_of_flight

  !> A quantity that has grown by this factor, and would again within the time over this factor, grows into a pole.
  real(wp), parameter :: growth = 1e6_wp

contains

  !> The reason for the `status` of a flight from the state `began`; 0 where the motion goes on. Steps shrink to nothing where an
  !> operation is not defined, or before a motion that grows without bound.
  pure integer function reason_of_flight(status, flight, began) result(reason)
    integer, intent(in) :: status
    type(flight_t), intent(in) :: flight
    real(wp), intent(in) :: began(:)
    reason = 0
    if (status == flight_step_budget) reason = reason_step_budget
    if (status == flight_left_domain .or. status == flight_no_progress) then
      reason = merge(reason_left_domain, reason_step_failed, grew_without_bound(flight, began))
    end if
    if (status == flight_wrong_branch) reason = reason_mode_cycle
  end function reason_of_flight

  !> Whether one of the first variables is at a pole in time. A speed whose rate alone has a pole, as beside a division by zero, is
  !> not: it has grown by its logarithm.
  pure logical function grew_without_bound(flight, began)
    type(flight_t), intent(in) :: flight
    real(wp), intent(in) :: began(:)
    real(wp) :: value(flight%tape%count), rate(size(began)), now(size(began))
    integer :: fault(flight%tape%count)
    call evaluate(flight%tape, flight%state, flight%parameters, value, fault)
    now = abs(flight%state(:size(began)))
    rate = abs(value(flight%rates(:size(began))))
    grew_without_bound = any(now > growth*max(abs(began), 1.0_wp) .and. &
                             (rate*flight%time > growth*now .or. fault(flight%rates(:size(began))) > 0))
  end function grew_without_bound

end module motor_reason
