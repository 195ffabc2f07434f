! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The function of include/separatrix.h that flies one whole motion.
module c_trajectory
  use attractors, only: attractor_t
  use c_machine, only: prepare_machine, prepared_t, start_problem
  use c_text, only: answer, compute, computed, enter
  use case_setup, only: span_of
  use case_type, only: case_t
  use constants, only: unreachable
  use contact_law, only: barrier_positions, contact_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use machine_columns, only: values_named
  use machine_type, only: machine_t
  use model_type, only: model_t
  use motion_state, only: closing_error, log_t, open_log
  use motor_log, only: foot_row
  use motor_machine, only: motor_machine_t
  use restoring_law, only: position_is_angle
  use settled_cycle, only: describe_cycle
  use status, only: exit_given_up, exit_usage, is_given_up, reason_name, reason_time_over
  use text, only: to_text
  use trajectories, only: run_trajectories
  use single_trajectory, only: fit_window, outcome_t, run_trajectory, span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_positive_inf, ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  implicit none
  private

  public :: separatrix_trajectory

  !> Numbers of a sample, of an event, and of the motion as a whole.
  integer, parameter :: of_sample = 13, of_event = 7, of_summary = 28
  !> Most samples of a trajectory: some hundred bytes each.
  real(wp), parameter :: most_samples = 2e7_wp

contains

  integer(c_int) function separatrix_trajectory(model, chosen_count, chosen, values, start, duration, samples_per_period, &
      sample_capacity, sample_count, sample, event_capacity, event_count, event, summary, message, message_size) bind(c) &
      result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count, samples_per_period, sample_capacity, event_capacity
    integer(c_int), intent(in) :: chosen(chosen_count)
    real(c_double), value :: duration
    real(c_double), intent(in) :: values(chosen_count), start(3)
    integer(c_int), intent(out) :: sample_count, event_count
    real(c_double), intent(inout) :: sample(of_sample, sample_capacity), event(of_event, event_capacity)
    real(c_double), intent(out) :: summary(of_summary)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(prepared_t) :: prepared
    type(outcome_t) :: outcome
    type(log_t) :: log
    integer :: kept
    call enter()
    call c_f_pointer(model, self)
    sample_count = 0
    event_count = 0
    summary = ieee_value(1.0_wp, ieee_quiet_nan)
    call prepare(self, chosen + 1, values, start, duration, samples_per_period, prepared, log, error)
    if (.not. allocated(error)) then
      call compute()
      call fly(self%the_case, prepared, start, duration > 0, log, outcome, summary)
      call computed()
      sample_count = log%samples
      event_count = log%events
      kept = min(sample_count, sample_capacity)
      if (kept > 0) call put_samples(prepared%ensemble%moving, start(3), log, kept, sample)
      kept = min(event_count, event_capacity)
      if (kept > 0) call put_events(prepared%ensemble%moving, log, kept, event)
      call summarise(prepared%ensemble%moving, log, outcome, summary)
      summary(28) = merge(1.0_wp, 0.0_wp, position_is_angle(self%the_case%laws))
      if (is_given_up(outcome%reason)) call fail(error, exit_given_up, 'the motion was given up: '//reason_name(outcome%reason))
    end if
    code = answer(error, message, message_size)
  end function separatrix_trajectory

  !> The machine, flown for `duration` [s] (0: that of the case) with as many samples as asked for (0: those of the case, negative:
  !> none), and an empty log.
  subroutine prepare(self, chosen, values, start, duration, samples_per_period, prepared, log, error)
    type(model_t), intent(in) :: self
    integer, intent(in) :: chosen(:), samples_per_period
    real(wp), intent(in) :: values(:), start(3), duration
    type(prepared_t), intent(out) :: prepared
    type(log_t), intent(out) :: log
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    type(span_t) :: span
    integer :: samples
    span = span_of(self%the_case)
    if (.not. (duration >= 0 .and. ieee_is_finite(duration))) then
      call fail(error, exit_usage, 'duration: found '//to_text(duration)//' s, allowed at least 0 s, finite')
      return
    end if
    if (duration > 0) span%duration = duration
    span%window = min(span%window, span%duration)
    span%extension = 1
    span%stop_when_converged = .false.
    call prepare_machine(self, chosen, values, span, .false., prepared, error)
    if (allocated(error)) return
    problem = start_problem(prepared, start)
    samples = samples_per_period
    if (samples == 0) samples = self%the_case%trajectory%samples_per_period
    associate (period => prepared%ensemble%moving%period)
      if (len(problem) > 0) then
        call fail(error, exit_usage, 'start: '//problem)
      else if (samples*(span%duration/period) > most_samples) then
        call fail(error, exit_usage, 'samples_per_period: found '//to_text(samples)//' over '// &
                  to_text(span%duration/period, 6)//' drive periods, allowed at most '//to_text(nint(most_samples))// &
                  ' samples in all')
      else
        call open_log(log, merge(period/max(1, samples), 0.0_wp, samples > 0))
      end if
    end associate
  end subroutine prepare

  !> Flies with a log as the command `trajectory` does, and to the end as the command `points` does, in lanes where the
  !> machine allows. The cycle that it comes to is not looked for in a motion of `another_duration`.
  subroutine fly(the_case, prepared, start, another_duration, log, outcome, summary)
    type(case_t), intent(in) :: the_case
    type(prepared_t), intent(in) :: prepared
    real(wp), intent(in) :: start(3)
    logical, intent(in) :: another_duration
    type(log_t), intent(inout) :: log
    type(outcome_t), intent(out) :: outcome
    real(wp), intent(inout) :: summary(:)
    type(attractor_t) :: no_catalogue(0)
    type(attractor_t) :: cycle
    type(outcome_t) :: ends(1)
    type(span_t) :: span
    span = prepared%ensemble%span
    associate (moving => prepared%ensemble%moving)
      call fit_window(moving%period, span)
      call run_trajectory(moving, no_catalogue, span, start, outcome, log)
      if (.not. another_duration) then
        call describe_cycle(moving, span_of(the_case), span, the_case%attractors%max_period, start, outcome, cycle)
        summary(26) = cycle%period
      end if
    end associate
    call run_trajectories(prepared%ensemble, no_catalogue, reshape(start, [3, 1]), ends)
    associate (last => ends(1))
      summary(:6) = [last%x, last%v, real(last%impacts, wp), last%last_impact_speed, real(last%features%regime, wp), &
                     real(last%reason, wp)]
    end associate
  end subroutine fly

  !> Rows: time, x, v, mode, foot (and crank angle of a motor) or driving body: x and v, contact force, energy, kinetic energy,
  !> lost to friction, damping and contacts, put in by the drive.
  subroutine put_samples(moving, crank_angle, log, kept, sample)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    integer, intent(in) :: kept
    real(wp), intent(inout) :: sample(:, :)
    type(contact_t) :: stops
    real(wp), allocatable :: column(:)
    sample(:3, :kept) = log%sample_data(:, :kept)
    sample(4, :kept) = log%sample_mode(:kept)
    if (moving%has_driver) then
      sample(5:6, :kept) = log%sample_driver(:, :kept)
    else
      sample(5, :kept) = values_named(moving%sample_columns(crank_angle, log), 'drive', kept)
      sample(6, :kept) = ieee_value(1.0_wp, ieee_quiet_nan)
    end if
    select type (moving)
    type is (motor_machine_t)
      sample(5, :kept) = log%sample_coordinates(foot_row, :kept)
      sample(6, :kept) = log%sample_driver(1, :kept)
    end select
    sample(7, :kept) = 0
    stops = moving%stops
    if (stops%soft) then
      column = moving%contact_forces(log)
      sample(7, :kept) = column(:kept)
    end if
    sample(8, :kept) = log%sample_balance(5, :kept)
    column = moving%kinetic_energies(log)
    sample(9, :kept) = column(:kept)
    sample(10:13, :kept) = log%sample_balance(:4, :kept)
  end subroutine put_samples

  !> Rows: kind, time, x, v before and after, driving body: x and v.
  subroutine put_events(moving, log, kept, event)
    class(machine_t), intent(in) :: moving
    type(log_t), intent(in) :: log
    integer, intent(in) :: kept
    real(wp), intent(inout) :: event(:, :)
    event(1, :kept) = log%event_kind(:kept)
    event(2:5, :kept) = log%event_data(:, :kept)
    event(6:7, :kept) = ieee_value(1.0_wp, ieee_quiet_nan)
    if (moving%has_driver) event(6:7, :kept) = log%event_driver(:, :kept)
  end subroutine put_events

  !> The steady values, the machine and the energy balance.
  subroutine summarise(moving, log, outcome, summary)
    class(machine_t), intent(in) :: moving
    type(log_t), intent(in) :: log
    type(outcome_t), intent(in) :: outcome
    real(wp), intent(inout) :: summary(:)
    real(wp) :: barriers(2)
    type(contact_t) :: stops
    stops = moving%stops
    barriers = barrier_positions(stops)
    where (abs(barriers) > unreachable) barriers = sign(ieee_value(1.0_wp, ieee_positive_inf), barriers)
    associate (f => outcome%window, balance => log%balance)
      summary(7:12) = [f%amplitude, f%x_max, f%x_min, f%v_max, f%impacts_per_period, f%mean_impact_speed]
      summary(13:18) = [moving%period, barriers, merge(1.0_wp, 0.0_wp, stops%soft), &
                        merge(1.0_wp, 0.0_wp, moving%has_driver), real(outcome%reason, wp)]
      summary(19:23) = [balance%at_start, balance%friction, balance%damping, balance%contact, balance%work]
      summary(27) = merge(1.0_wp, 0.0_wp, moving%has_drive_period)
      if (outcome%reason == reason_time_over) summary(24:25) = [balance%at_end, closing_error(balance)]
    end associate
  end subroutine summarise

end module c_trajectory
