! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of a multibody structure, by the flow that its mode has: in closed form, or marched where the force of a joint
!> is not linear.
module multibody_flight
  use flight_path, only: path_t
  use guards, only: joint_guard_t
  use multibody, only: multibody_t
  use multibody_log, only: log_flight
  use multibody_state, only: is_marched, multibody_state_t
  use kinds, only: int64, wp
  use linear_flight, only: fly_linear, watch_t
  use marched_flight, only: begin_flight, marched_flight_t, step_flight
  use march_pace, only: pace_t, watch_pace
  use mode_flow, only: mode_flow_t
  use motion_state, only: flight_adaptive, log_t, options_t
  use status, only: reason_left_domain, reason_step_budget, reason_step_failed
  implicit none
  private

  public :: fly

contains

  !> Flies from `state` to `until` [s after the section] at most. `list` are the guards, `triggered` those triggered together at
  !> the end, none if the time is over. `steps` counts, and bounds, the work; `reason`: why a flight was given up, else 0.
  pure subroutine fly(machine, flow, options, state, until, list, count_guards, triggered, watch, steps, reason, log)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(options_t), intent(in) :: options
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: until
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(out) :: count_guards, reason
    logical, intent(out) :: triggered(:)
    type(watch_t), intent(inout) :: watch
    integer(int64), intent(inout) :: steps
    type(log_t), intent(inout), optional :: log
    type(multibody_state_t) :: start
    type(path_t) :: path
    type(pace_t) :: pace
    logical :: ended, failed, hopeless
    reason = 0
    if (.not. (options%flight == flight_adaptive .or. is_marched(machine, state%phase))) then
      if (present(log)) start = state
      ! Intervals of a series, of which a stiff structure has many.
      if (.not. flow%modal .and. flow%rate*(until - state%time) > options%step_budget) then
        triggered = .false.
        count_guards = 0
        reason = reason_step_budget
        return
      end if
      call fly_linear(machine, flow, state, until, list, count_guards, triggered, path, watch)
      if (present(log)) call log_flight(machine, flow, path, start, state%time - start%time, log)
      steps = steps + watch%evaluations
      watch%evaluations = 0
      return
    end if
    ! Large: made where it is needed.
    block
      type(marched_flight_t) :: flight
      call begin_flight(machine, flow, state, options%tolerance, flight)
      list = flight%list
      count_guards = flight%count_guards
      do
        if (present(log)) start = state
        call step_flight(machine, flight, state, until, path, triggered, ended, failed, watch)
        if (present(log) .and. path%length > 0) call log_flight(machine, flow, path, start, state%time - start%time, log)
        steps = steps + 1
        if (failed) reason = reason_step_failed
        ! Before a pole in time; positions may grow by its logarithm alone.
        if (failed .and. any(abs(state%v(:machine%n))*(until - state%time) > options%domain)) reason = reason_left_domain
        call watch_pace(state%time, until, options%step_budget, pace, hopeless)
        if (hopeless .or. steps > options%step_budget) reason = reason_step_budget
        if (.not. all(abs(state%q(:machine%n)) <= options%domain)) reason = reason_left_domain
        if (ended .or. reason /= 0) exit
      end do
    end block
    watch%evaluations = 0
  end subroutine fly

end module multibody_flight
