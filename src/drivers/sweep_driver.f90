! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix sweep`: run up, run down, and many starts at every value of the parameter.
module sweep_driver
  use attractors, only: longest_period
  use axis, only: axis_t, linear_values
  use basin_work, only: basin_work_t, prepare_counts, sum_counts
  use build_pair, only: is_pair
  use case_check, only: require_sweep
  use case_setup, only: grid_of, output_path, span_of, sweep_axes
  use case_type, only: case_t
  use catalogue_search, only: search_catalogues
  use command_line, only: command_t
  use crank_catalogue, only: add_crank_catalogue
  use derived_report, only: add_derived_catalogue
  use endings, only: assess_given_up, report_reasons
  use errors, only: error_t
  use file_layout, only: add_catalogue, add_map_variables, axis_dimension
  use grid, only: grid_t
  use journal, only: duration_text, size_text
  use kinds, only: int64, wp
  use map_file, only: map_file_t
  use map_final, only: write_whole
  use map_schema, only: name_length, schema_t, type_float64
  use point_columns, only: at_impacts, at_reason, map_values
  use restoring_law, only: position_is_angle
  use run_plan, only: pilot_seconds, plan_text
  use session, only: describe_file, open_session, session_t
  use signals, only: end_time_limit
  use status, only: exit_done, is_given_up, last_reason, reason_settled, reason_time_over
  use sweep, only: hold_parameter, hold_t
  use sweep_chain, only: chains_t, hold_reason, new_chains, run_chains
  use sweep_report, only: describe_chains, report_given_up, report_limits
  use text, only: to_text
  use tiled_run, only: finish_tiles, open_tiles, run_tiles
  use work_watch, only: watch_t
  use written_check, only: check_written
  implicit none
  private

  public :: run_sweep

  !> A map over the swept parameter, x0 and v0; the file flattens the starts into one dimension.
  type, extends(basin_work_t) :: branch_work_t
    !> Per value: points with impacts and points without.
    integer(int64), allocatable :: impacting(:), free(:)
  contains
    procedure :: compute => compute_branch_points
    procedure :: note => note_branch_point
    procedure :: points_from => branch_points_from
  end type branch_work_t

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_sweep(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(branch_work_t) :: work
    type(chains_t) :: chains
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    character(len=:), allocatable :: path
    call open_session(command, session)
    call require_sweep(session%the_case, error)
    call session%stop_if(error)
    path = output_path(command%output, command%path, command%name)
    call prepare_branches(session, work)
    associate (sweep => session%the_case%sweep)
      if (command%validate) then
        call session%journal%line('valid', command%path//' is a valid case for sweep')
        call session%end_with(exit_done)
      end if
      if (command%dry_run) call report_plan(session, work)
      call session%begin(path, tiled=product(sweep%starts) > 0)
      call session%journal%line('chains', 'running '//trim(sweep%swept%name)//' '//directions_text(session%the_case)//' over '// &
                                to_text(size(sweep%swept%values))//' values')
      call run_chains(session%team, session%journal, command%time_limit, &
                      grid_of(session%the_case, session%the_case%axes(:0)), work%span, &
                      trim(sweep%swept%name), sweep%swept%values, [sweep%directions /= 'down', &
                      sweep%directions /= 'up'], sweep%samples, longest_cycle(session%the_case), &
                      sweep%limit_tolerance, chains, error)
      call session%stop_if(error)
      call report_given_up(session, chains)
      call report_limits(session, chains)
      call describe_file(session, 'sweep', schema)
      call describe_chains(session, chains, schema)
    end associate
    if (product(session%the_case%sweep%starts) > 0) then
      call run_branches(session, work, schema, path)
    else
      call session%provenance%finish(schema)
      call end_time_limit()
      if (session%team%is_root()) call write_whole(path, schema, command%force, error)
      call session%stop_if(error)
      call check_written(session, path)
      call session%journal%line('written', 'wrote '//path)
    end if
    call assess_sweep(session, work, chains)
    call session%end_with(exit_done)
  end subroutine run_sweep

  !> Ends the program with code 78 where every hold of the runs and every one of the many starts was given up.
  subroutine assess_sweep(session, work, chains)
    type(session_t), intent(inout) :: session
    type(branch_work_t), intent(in) :: work
    type(chains_t), intent(in) :: chains
    type(error_t), allocatable :: error
    integer(int64) :: given_up, motions
    integer :: i
    given_up = sum(pack(work%reasons, is_given_up([(i, i=0, last_reason)])))
    motions = sum(work%reasons)
    do i = 1, 2
      if (.not. chains%ran(i)) cycle
      given_up = given_up + count(is_given_up(nint(chains%holds(hold_reason, :, i))))
      motions = motions + size(chains%holds, 2)
    end do
    call assess_given_up(session%journal, given_up, motions, 'holds and starts', session%command%partial, error)
    call session%stop_if(error)
  end subroutine assess_sweep

  !> Reports what would be done: holds of the runs, points of the many starts, bytes, time. Ends the program.
  subroutine report_plan(session, work)
    type(session_t), intent(inout) :: session
    type(branch_work_t), intent(inout) :: work
    type(error_t), allocatable :: error
    type(chains_t) :: chains
    type(schema_t) :: schema, points
    character(len=:), allocatable :: plan
    real(wp) :: seconds
    integer :: holds
    associate (sweep => session%the_case%sweep, values => session%the_case%sweep%swept%values)
      seconds = hold_seconds(session, error)
      call session%stop_if(error)
      chains = new_chains(size(values), sweep%samples, size(session%the_case%derived))
      call describe_chains(session, chains, schema)
      holds = size(values)*merge(2, 1, sweep%directions == 'both')
      plan = to_text(size(values))//' values of '//trim(sweep%swept%name)//', '//directions_text(session%the_case)//': '// &
        to_text(holds)//' holds, '//size_text(schema%bytes())//'; about '// &
        duration_text(size(values)*seconds)//' on one core for each direction'
      if (product(sweep%starts) > 0) then
        ! Without catalogues: every point discovers its own attractor, which takes longer.
        allocate (work%catalogues(0))
        call prepare_counts(work%basin_work_t)
        call pilot_seconds(work, [size(values), product(sweep%starts)], seconds, error)
        call session%stop_if(error)
        call add_map_variables(points, 'branch_', ['value', 'start'], session%the_case%laws)
        plan = plan//'; many starts: '//plan_text([size(values), product(sweep%starts)], [1, product(sweep%starts)], &
                                                  points%bytes_of_point(), seconds, session%command)
      else
        plan = plan//'; no many starts'
      end if
    end associate
    call session%journal%line('plan', plan)
    call session%end_with(exit_done)
  end subroutine report_plan

  !> Time that a hold in the middle of the range takes from the start of the case [s].
  real(wp) function hold_seconds(session, error) result(seconds)
    type(session_t), intent(in) :: session
    type(error_t), allocatable, intent(out) :: error
    type(grid_t) :: grid
    type(hold_t) :: held
    real(wp) :: start
    grid = grid_of(session%the_case, session%the_case%axes(:0))
    call cpu_time(start)
    associate (sweep => session%the_case%sweep)
      call hold_parameter(grid, span_of(session%the_case), trim(sweep%swept%name), &
                          sweep%swept%values(1 + size(sweep%swept%values)/2), sweep%samples, &
                          longest_cycle(session%the_case), held, error)
    end associate
    call cpu_time(seconds)
    seconds = seconds - start
  end function hold_seconds

  !> Which ways the parameter runs.
  pure function directions_text(the_case) result(text)
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: text
    text = trim(the_case%sweep%directions)
    if (text == 'both') text = 'up and down'
  end function directions_text

  !> Drive periods of the longest cycle that the runs look for: that of the attractors, or half of the samples that are kept.
  pure integer function longest_cycle(the_case)
    type(case_t), intent(in) :: the_case
    longest_cycle = max(the_case%attractors%max_period, min(the_case%sweep%samples/2, longest_period))
  end function longest_cycle

  subroutine prepare_branches(session, work)
    type(session_t), intent(in) :: session
    type(branch_work_t), intent(inout) :: work
    associate (sweep => session%the_case%sweep)
      work%variables = map_values(session%the_case%laws)
      work%grid = grid_of(session%the_case, sweep_axes(session%the_case))
      work%span = span_of(session%the_case)
      work%max_period = session%the_case%attractors%max_period
      allocate (work%impacting(size(sweep%swept%values)), work%free(size(sweep%swept%values)), source=0_int64)
    end associate
  end subroutine prepare_branches

  !> Many starts at every value, tile by tile.
  subroutine run_branches(session, work, schema, path)
    type(session_t), intent(inout) :: session
    type(branch_work_t), intent(inout) :: work
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: path
    type(map_file_t) :: file
    type(schema_t) :: extra
    type(error_t), allocatable :: error
    character(len=name_length) :: dimensions(2)
    real(wp), allocatable :: x0(:), v0(:)
    integer :: starts, i
    logical :: complete
    call search_catalogues(session%team, session%journal, work%grid, work%span, session%the_case%attractors, &
                           session%command%time_limit, work%catalogues, error)
    call session%stop_if(error)
    call prepare_counts(work%basin_work_t)
    starts = product(work%grid%shape(2:3))
    associate (axes => work%grid%axes)
      x0 = [(axes(2)%values(1 + (i - 1)/work%grid%shape(3)), i=1, starts)]
      v0 = [(axes(3)%values(1 + modulo(i - 1, work%grid%shape(3))), i=1, starts)]
      dimensions(1) = axis_dimension(axes(1)%name)
    end associate
    dimensions(2) = 'start'
    call schema%add_dimension('start', int(starts, int64))
    call schema%add_variable('start_x0', type_float64, ['start'], units='m', long_name='initial position', data=x0)
    call schema%add_variable('start_v0', type_float64, ['start'], units='m/s', long_name='initial velocity', data=v0)
    call add_map_variables(schema, 'branch_', dimensions, session%the_case%laws)
    call open_tiles(session, path, schema, dimensions, [1, starts], file)
    call run_tiles(session, file, work, complete)
    call session%team%sum(work%impacting)
    call session%team%sum(work%free)
    call sum_counts(session, work%basin_work_t)
    extra%positions_are_angles = position_is_angle(session%the_case%laws)
    call add_catalogue(extra, work%catalogues, work%captured, is_pair(session%the_case%laws))
    call add_crank_catalogue(session%team, work%grid, work%catalogues, extra)
    if (complete) call add_derived_catalogue(session%team, work%grid, work%catalogues, work%span, extra)
    call finish_tiles(session, file, complete, extra)
    call report_multiple(session, work)
    call report_reasons(session%journal, work%reasons)
  end subroutine run_branches

  !> Subscripts of a point of the file along the axes of the map.
  pure function subscripts_of(grid, index) result(subscripts)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    integer :: subscripts(3)
    subscripts = [index(1), 1 + (index(2) - 1)/grid%shape(3), 1 + modulo(index(2) - 1, grid%shape(3))]
  end function subscripts_of

  subroutine compute_branch_points(self, index, values, whole, error, watch)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    integer :: subscripts(3, size(index, 2)), i
    do i = 1, size(index, 2)
      subscripts(:, i) = subscripts_of(self%grid, index(:, i))
    end do
    call self%basin_work_t%compute(subscripts, values, whole, error, watch)
  end subroutine compute_branch_points

  subroutine branch_points_from(self, index, points, error)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    integer, intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    call self%basin_work_t%points_from(subscripts_of(self%grid, index), points, error)
  end subroutine branch_points_from

  subroutine note_branch_point(self, index, values)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    real(wp), intent(in) :: values(:)
    associate (reason => nint(values(at_reason)), at => index(1))
      call self%basin_work_t%note(subscripts_of(self%grid, index), values)
      if (reason /= reason_settled .and. reason /= reason_time_over) return
      if (values(at_impacts) > 0) then
        self%impacting(at) = self%impacting(at) + 1
      else
        self%free(at) = self%free(at) + 1
      end if
    end associate
  end subroutine note_branch_point

  !> Ranges of the parameter where starts lead to motions with impacts, without, and both. The file has the regimes.
  subroutine report_multiple(session, work)
    type(session_t), intent(inout) :: session
    type(branch_work_t), intent(in) :: work
    integer :: i, first
    integer :: kind(size(work%free) + 1)
    character(len=*), parameter :: names(3) = [character(len=24) :: 'without impacts', 'with impacts', &
      'with and without impacts']
    kind = 0
    do i = 1, size(work%free)
      if (work%free(i) > 0) kind(i) = 1
      if (work%impacting(i) > 0) kind(i) = 2
      if (work%free(i) > 0 .and. work%impacting(i) > 0) kind(i) = 3
    end do
    first = 1
    do i = 1, size(work%free)
      if (kind(i + 1) == kind(i)) cycle
      associate (values => work%grid%axes(1)%values)
        if (kind(i) > 0) call session%journal%line('region', '  many starts: '//trim(names(kind(i)))//' from '// &
          to_text(values(first), 6)//' to '//to_text(values(i), 6), '"region": "'//trim(names(kind(i)))// &
          '", "from": '//to_text(values(first))//', "to": '//to_text(values(i)))
      end associate
      first = i + 1
    end do
  end subroutine report_multiple

end module sweep_driver
