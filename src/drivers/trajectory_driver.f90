! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix trajectory`: one motion, its time history and every event.
module trajectory_driver
  use attractors, only: attractor_t, features_t, regime_at_rest, regime_names, regime_non_impact
  use case_check, only: require_start
  use case_setup, only: grid_of, output_path, span_of
  use case_type, only: case_t
  use command_line, only: command_t
  use constants, only: unreachable
  use contact_law, only: barrier_positions, contact_t
  use crank_report, only: describe_crank
  use derived_report, only: describe_derived, report_derived
  use derived_quantities, only: derived_t
  use endings, only: assess_motion
  use errors, only: error_t, fail
  use file_layout, only: add_events
  use grid, only: grid_t, slice_motion
  use machine_columns, only: machine_column_t
  use machine_type, only: machine_t
  use kinds, only: int64, wp
  use map_final, only: write_whole
  use map_schema, only: schema_t, type_float64, type_int8
  use motion_state, only: energy_balance_t, closing_error, event_names, log_t, open_log
  use record_writer, only: write_record
  use session, only: describe_file, open_session, session_t
  use settled_cycle, only: describe_cycle
  use span_check, only: check_periods
  use status, only: exit_bad_case, exit_done, reason_name, reason_time_over
  use system, only: monotonic_seconds
  use text, only: to_text
  use text_table, only: table_t
  use written_check, only: check_written
  use trajectory_report, only: counted_over, ended_after, explained, report
  use single_trajectory, only: begin_trajectory, begin_record, conclude, trajectory_state_t, end_record, fit_window, go_on, &
    is_recorded, outcome_t, span_t
  implicit none
  private

  public :: run_trajectory_command

  !> Most samples of a trajectory: some hundred bytes each.
  real(wp), parameter :: most_samples = 2e7_wp
  !> A search that may take so many seconds is reported.
  real(wp), parameter :: worth_a_word = 5

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_trajectory_command(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(grid_t) :: grid
    type(span_t) :: span
    class(machine_t), allocatable :: moving
    type(log_t) :: log
    type(outcome_t) :: outcome
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    type(attractor_t) :: cycle
    real(wp), allocatable :: derived(:)
    character(len=:), allocatable :: path
    call open_session(command, session)
    call require_start(session%the_case, error)
    call session%stop_if(error)
    call prepare_motion(session%the_case, grid, span, moving, error)
    if (.not. allocated(error) .and. len(command%record) > 0) call check_record(session%the_case, error)
    call session%stop_if(error)
    path = output_path(command%output, command%path, command%name)
    if (command%validate .or. command%dry_run) then
      call session%journal%line('valid', command%path//' is a valid case for trajectory: about '// &
        to_text(nint(span%duration/moving%period*session%the_case%trajectory%samples_per_period))// &
        ' samples, well under a second, into '//path)
      call session%end_with(exit_done)
    end if
    call session%begin(path, tiled=.false.)
    call open_log(log, moving%period/session%the_case%trajectory%samples_per_period)
    call fly(session, moving, span, grid%start, outcome, log)
    call describe_cycle(moving, span_of(session%the_case), span, session%the_case%attractors%max_period, grid%start, outcome, &
                        cycle)
    call describe_file(session, 'trajectory', schema)
    call describe_motion(moving, span, outcome, cycle, log, schema)
    call describe_derived(moving, grid, span, cycle, outcome%reason, derived, schema)
    call describe_crank(session%the_case%laws, span%window, log, schema)
    call add_history(moving, grid%start(3), log, schema)
    call add_events(schema, log%event_kind(:log%events), log%event_data(:, :log%events))
    call add_columns(moving%event_columns(log), 'event', 'event_', schema)
    call add_energy(moving, log, schema)
    call add_balance(log%balance, outcome%reason == reason_time_over, schema)
    call session%provenance%finish(schema)
    if (session%team%is_root()) then
      call write_whole(path, schema, command%force, error)
      if (.not. allocated(error) .and. len(command%csv) > 0) then
        call write_events(command%csv, log, moving%event_columns(log), error)
      end if
      if (.not. allocated(error) .and. len(command%record) > 0) then
        call write_record(command%record, session%the_case, moving, grid%start, error)
      end if
    end if
    call session%stop_if(error)
    call check_written(session, path)
    call report(session, moving, span, outcome, cycle, log)
    call report_files(session, command, path, grid%derived, derived)
    call assess_motion(outcome%reason, explained(outcome%reason)//' after '// &
                      to_text(ended_after(moving, outcome%reason, log), 6)//' s of '//to_text(span%duration, 6)//' s; '// &
                      path//' has what comes before', command%partial, error)
    call session%stop_if(error)
    call session%end_with(exit_done)
  end subroutine run_trajectory_command

  !> The machine of a case, its start, and the span of one motion, which ends with its duration.
  subroutine prepare_motion(the_case, grid, span, moving, error)
    type(case_t), intent(in) :: the_case
    type(grid_t), intent(out) :: grid
    type(span_t), intent(out) :: span
    class(machine_t), allocatable, intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    grid = grid_of(the_case, the_case%axes(:0))
    span = span_of(the_case)
    span%extension = 1
    span%stop_when_converged = .false.
    call slice_motion(grid, 0_int64, moving, error)
    if (.not. allocated(error)) call fit_window(moving%period, span)
    if (.not. allocated(error)) call check_periods(span, moving%period, error)
    if (.not. allocated(error)) call check_samples(the_case, span%duration/moving%period, error)
  end subroutine prepare_motion

  !> The motion, with a word on how far it is where it takes its time.
  subroutine fly(session, moving, span, start, outcome, log)
    type(session_t), intent(inout) :: session
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: start(3)
    type(outcome_t), intent(out) :: outcome
    type(log_t), intent(inout) :: log
    type(attractor_t) :: no_catalogue(0)
    type(trajectory_state_t) :: trajectory
    real(wp) :: began, periods, searched
    began = monotonic_seconds()
    call begin_trajectory(moving, span, start, trajectory)
    call session%journal%begin('periods', ceiling(span%duration/moving%period, int64), 0_int64)
    call begin_record(moving, span, trajectory, log)
    do while (is_recorded(trajectory))
      call go_on(moving, no_catalogue, span, trajectory, outcome, log)
      call session%journal%progress(int(trajectory%elapsed/moving%period, int64))
    end do
    call end_record(moving, span, trajectory, log)
    call conclude(moving, no_catalogue, trajectory, outcome)
    call note_rest(moving, span, log, outcome%window)
    if (.not. span%whole_periods .or. outcome%reason /= reason_time_over) return
    ! Newton's method at each period, four steps in the mean, with differences along every coordinate.
    periods = span%duration/moving%period
    searched = session%the_case%run%extension*periods &
               + 2*(2*moving%coordinates() + 1)*min(periods, real(session%the_case%attractors%max_period, wp))**2
    if ((monotonic_seconds() - began)/periods*searched < worth_a_word) return
    call session%journal%line('search', 'searching for the cycle on which the motion settled; run.average = "window" '// &
      'skips this search')
  end subroutine fly

  !> A structure without a drive is at rest where all its velocities in the window are rounding.
  pure subroutine note_rest(moving, span, log, features)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(log_t), intent(in) :: log
    type(features_t), intent(inout) :: features
    if (features%regime /= regime_non_impact) return
    if (.not. moving%rests_at_end(features%amplitude, span%duration - span%window, log)) return
    features%regime = regime_at_rest
    features%amplitude = 0
    features%v_max = 0
  end subroutine note_rest

  !> Code 65 if the samples of so many periods are more than fit into memory.
  subroutine check_samples(the_case, periods, error)
    type(case_t), intent(in) :: the_case
    real(wp), intent(in) :: periods
    type(error_t), allocatable, intent(out) :: error
    if (periods*the_case%trajectory%samples_per_period <= most_samples) return
    call fail(error, exit_bad_case, "key 'trajectory.samples_per_period': found "// &
              to_text(the_case%trajectory%samples_per_period)//' over '//to_text(periods, 6)//' periods, allowed '// &
              'at most '//to_text(nint(most_samples))//' samples in all')
  end subroutine check_samples

  !> Code 65 if the samples of a record are more than fit into memory.
  subroutine check_record(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    if (the_case%run%duration*the_case%record%rate < most_samples) return
    call fail(error, exit_bad_case, "key 'record.rate': found "//to_text(the_case%record%rate)//' Hz, allowed at most '// &
              to_text(most_samples/the_case%run%duration, 6)//' Hz over '//to_text(the_case%run%duration, 6)//' s ('// &
              to_text(nint(most_samples))//' samples in all)')
  end subroutine check_record

  !> Attributes: the drive, the barriers, and the steady values over the cycle or the window.
  subroutine describe_motion(moving, span, outcome, cycle, log, schema)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(outcome_t), intent(in) :: outcome
    type(attractor_t), intent(in) :: cycle
    type(log_t), intent(in) :: log
    type(schema_t), intent(inout) :: schema
    real(wp) :: barriers(2)
    type(contact_t) :: stops
    stops = moving%stops
    barriers = barrier_positions(stops)
    call schema%add_attribute('', 'drive_period', moving%period)
    call schema%add_attribute('', 'driven', merge(1, 0, moving%has_drive_period))
    call schema%add_attribute('', 'drive_ratio', moving%drive_ratio)
    if (barriers(1) < unreachable) call schema%add_attribute('', 'barrier_upper', barriers(1))
    if (barriers(2) > -unreachable) call schema%add_attribute('', 'barrier_lower', barriers(2))
    if (stops%soft) then
      call schema%add_attribute('', 'peak_force', log%peak_force)
      call schema%add_attribute('', 'peak_penetration', log%peak_penetration)
      call schema%add_attribute('', 'contact_work', log%contact_work)
    end if
    call schema%add_attribute('', 'window', span%window)
    call schema%add_attribute('', 'period', cycle%period)
    if (cycle%duration > 0) call schema%add_attribute('', 'cycle_time', cycle%duration)
    associate (f => outcome%window)
      call schema%add_attribute('', 'amplitude', f%amplitude)
      call schema%add_attribute('', 'x_max', f%x_max)
      call schema%add_attribute('', 'x_min', f%x_min)
      call schema%add_attribute('', 'v_max', f%v_max)
      call schema%add_attribute('', 'impacts', nint(f%impacts_per_period*span%window/counted_over(moving, cycle)))
      call schema%add_attribute('', 'impacts_per_period', f%impacts_per_period)
      call schema%add_attribute('', 'mean_impact_speed', f%mean_impact_speed)
      if (moving%turn > 0) then
        call schema%add_attribute('', 'turn', moving%turn)
        call schema%add_attribute('', 'rotation_number', f%rotation)
      end if
      call schema%add_attribute('', 'regime', trim(regime_names(f%regime)))
      call schema%add_attribute('', 'reason', reason_name(outcome%reason))
    end associate
  end subroutine describe_motion

  subroutine add_history(moving, crank_angle, log, schema)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(schema_t), intent(inout) :: schema
    type(contact_t) :: stops
    call schema%add_dimension('time', int(log%samples, int64))
    call schema%add_variable('time', type_float64, ['time'], units='s', long_name='time since the start', &
                             data=log%sample_data(1, :log%samples))
    call schema%add_variable('x', type_float64, ['time'], units='m', long_name='position', &
                             data=log%sample_data(2, :log%samples))
    call schema%add_variable('v', type_float64, ['time'], units='m/s', long_name='velocity', &
                             data=log%sample_data(3, :log%samples))
    call add_columns(moving%sample_columns(crank_angle, log), 'time', '', schema)
    stops = moving%stops
    if (stops%soft) then
      call schema%add_variable('contact_force', type_float64, ['time'], units='N', &
        long_name='force of the barriers on the body', data=moving%contact_forces(log))
    end if
    call schema%add_variable('mode', type_int8, ['time'], units='1', long_name='mode', flag_values=[1, 2, 3, 4, 5, 6], &
      flag_meanings='slip_plus slip_minus stick upper_barrier lower_barrier held', &
      data=real(log%sample_mode(:log%samples), wp))
  end subroutine add_history

  !> Where the energy went by the end, or until the motion was given up.
  subroutine add_balance(balance, complete, schema)
    type(energy_balance_t), intent(in) :: balance
    logical, intent(in) :: complete
    type(schema_t), intent(inout) :: schema
    call schema%add_attribute('', 'energy_start', balance%at_start)
    call schema%add_attribute('', 'energy_lost_to_friction', balance%friction)
    call schema%add_attribute('', 'energy_lost_to_damping', balance%damping)
    call schema%add_attribute('', 'energy_lost_to_contacts', balance%contact)
    call schema%add_attribute('', 'energy_put_in', balance%work)
    if (.not. complete) return
    call schema%add_attribute('', 'energy_end', balance%at_end)
    call schema%add_attribute('', 'energy_closing_error', closing_error(balance))
  end subroutine add_balance

  !> The columns of the machine along a dimension; `prefix` comes before their names.
  subroutine add_columns(columns, dimension, prefix, schema)
    type(machine_column_t), intent(in) :: columns(:)
    character(len=*), intent(in) :: dimension, prefix
    type(schema_t), intent(inout) :: schema
    integer :: i, k
    do i = 1, size(columns)
      associate (column => columns(i))
        if (len(column%meanings) > 0) then
          call schema%add_variable(prefix//column%name, type_int8, [dimension], units=column%units, long_name=column%text, &
            own_units=.true., flag_values=[(k, k=1, words_in(column%meanings))], flag_meanings=column%meanings, data=column%values)
        else
          call schema%add_variable(prefix//column%name, type_float64, [dimension], units=column%units, long_name=column%text, &
                                   own_units=.true., data=column%values)
        end if
      end associate
    end do
  end subroutine add_columns

  !> Number of words parted by single spaces.
  pure integer function words_in(text)
    character(len=*), intent(in) :: text
    integer :: i
    words_in = 1 + count([(text(i:i) == ' ', i=1, len(text))])
  end function words_in

  !> Where the energy went over time.
  subroutine add_energy(moving, log, schema)
    class(machine_t), intent(in) :: moving
    type(log_t), intent(in) :: log
    type(schema_t), intent(inout) :: schema
    real(wp) :: kinetic(log%samples)
    kinetic = moving%kinetic_energies(log)
    associate (balance => log%sample_balance(:, :log%samples))
      call add('energy', balance(5, :), 'energy of spring and bodies')
      call add('kinetic_energy', kinetic, 'kinetic energy')
      call add('potential_energy', balance(5, :) - kinetic, 'energy of the spring')
      call add('friction_loss', balance(1, :), 'energy lost to dry friction since the start')
      call add('damping_loss', balance(2, :), 'energy lost to viscous damping since the start')
      call add('contact_loss', balance(3, :), 'energy put into barriers since the start; of a pressed soft one, part comes back')
      call add('drive_work', balance(4, :), 'work of drive and impulses since the start')
    end associate

  contains

    subroutine add(name, values, long_name)
      character(len=*), intent(in) :: name, long_name
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type_float64, ['time'], units='J', long_name=long_name, data=values)
    end subroutine add

  end subroutine add_energy

  !> The events as a table at full precision, with what the machine adds to them.
  subroutine write_events(path, log, columns, error)
    character(len=*), intent(in) :: path
    type(log_t), intent(in) :: log
    type(machine_column_t), intent(in) :: columns(:)
    type(error_t), allocatable, intent(out) :: error
    type(table_t) :: table
    character(len=:), allocatable :: more
    integer :: i, k
    call table%create(path)
    more = ''
    do k = 1, size(columns)
      more = more//','//columns(k)%name
    end do
    call table%line('kind,time,x,v_before,v_after'//more)
    do i = 1, log%events
      more = ''
      do k = 1, size(columns)
        more = more//','//to_text(columns(k)%values(i))
      end do
      call table%line(trim(event_names(log%event_kind(i)))//','//to_text(log%event_data(1, i))//','// &
                      to_text(log%event_data(2, i))//','//to_text(log%event_data(3, i))//','// &
                      to_text(log%event_data(4, i))//more)
    end do
    call table%close(error)
  end subroutine write_events

  !> A line for each file that was written.
  subroutine report_files(session, command, path, wanted, derived)
    type(session_t), intent(inout) :: session
    type(command_t), intent(in) :: command
    character(len=*), intent(in) :: path
    type(derived_t), intent(in) :: wanted(:)
    real(wp), intent(in) :: derived(:)
    call report_derived(session%journal, wanted, derived)
    call session%journal%line('written', 'wrote '//path)
    if (len(command%csv) > 0) call session%journal%line('written', 'wrote '//command%csv)
    if (len(command%record) > 0) call session%journal%line('written', 'wrote '//command%record)
  end subroutine report_files

end module trajectory_driver
