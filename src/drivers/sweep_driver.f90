! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix sweep`: run up, run down, and many starts at every value of the parameter.
module sweep_driver
  use attractors, only: regime_impact, regime_names
  use axis, only: axis_t, linear_values
  use basin_driver, only: bytes_per_point
  use basin, only: basin_points, basin_variables, catalogue_t, points_at_a_time, slice_cache_t
  use case_check, only: require_sweep
  use case_setup, only: grid_of, output_path, span_of
  use case_type, only: case_t, contact_position => contact_law
  use catalogue_search, only: search_catalogues
  use command_line, only: command_t
  use contact_law, only: add_to_contact, barrier_positions, contact_of, contact_t
  use endings, only: report_reasons
  use errors, only: error_t
  use file_layout, only: add_axes, add_map_variables, add_reason, add_regime, axis_dimension
  use grid, only: grid_t
  use kinds, only: int64, wp
  use law_table, only: effect_family
  use map_file, only: map_file_t
  use map_final, only: write_whole
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int64, type_string
  use pair, only: is_pair
  use restoring_law, only: position_is_angle
  use session, only: describe_file, open_session, session_t
  use status, only: exit_done, last_reason, reason_names, reason_settled, reason_time_over
  use sweep_chain, only: chains_t, hold_reason, limit_t, run_chains
  use text, only: replace_all, to_text
  use tiled_run, only: finish_tiles, open_tiles, pilot_seconds, plan_text, point_work_t, run_tiles
  use trajectory, only: span_t
  use written_check, only: check_written
  implicit none
  private

  public :: run_sweep, sweep_axes

  type, extends(point_work_t) :: branch_work_t
    !> Grid over the swept parameter, x0 and v0; the file flattens the starts into one dimension.
    type(grid_t) :: grid
    type(span_t) :: span
    integer :: max_period = 16
    type(catalogue_t), allocatable :: catalogues(:)
    type(slice_cache_t) :: cache
    !> Per value: points with impacts and points without.
    integer(int64), allocatable :: impacting(:), free(:)
    !> Points per reason.
    integer(int64) :: reasons(0:last_reason) = 0
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
    real(wp) :: seconds
    call open_session(command, session)
    call require_sweep(session%the_case, error)
    call session%stop_if(error)
    path = output_path(command%output, command%path)
    call prepare_branches(session, work)
    associate (sweep => session%the_case%sweep)
      if (command%validate) then
        call session%journal%line('valid', command%path//' is a valid case for sweep')
        call session%end_with(exit_done)
      end if
      if (command%dry_run) then
        ! Without catalogues: every point discovers its own attractor, which takes longer.
        allocate (work%catalogues(0))
        seconds = 0
        if (product(sweep%starts) > 0) call pilot_seconds(work, [size(sweep%swept%values), product(sweep%starts)], &
                                                          seconds, error)
        call session%stop_if(error)
        call session%journal%line('plan', to_text(size(sweep%swept%values))//' values of '//trim(sweep%swept%name)// &
          ', up and down; many starts: '//plan_text([size(sweep%swept%values), max(1, product(sweep%starts))], &
          [1, max(1, product(sweep%starts))], bytes_per_point, seconds))
        call session%end_with(exit_done)
      end if
      call session%begin(path, tiled=product(sweep%starts) > 0)
      call session%journal%line('chains', 'running '//trim(sweep%swept%name)//' up and down over '// &
                                to_text(size(sweep%swept%values))//' values')
      call run_chains(session%team, session%journal, command%time_limit, &
                      grid_of(session%the_case, session%the_case%axes(:0)), work%span, &
                      trim(sweep%swept%name), sweep%swept%values, [sweep%directions /= 'down', &
                      sweep%directions /= 'up'], sweep%samples, sweep%limit_tolerance, chains, error)
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
      if (session%team%is_root()) call write_whole(path, schema, command%force, error)
      call session%stop_if(error)
      call check_written(session, path)
      call session%journal%line('written', 'wrote '//path)
    end if
    call session%end_with(exit_done)
  end subroutine run_sweep

  subroutine prepare_branches(session, work)
    type(session_t), intent(in) :: session
    type(branch_work_t), intent(inout) :: work
    associate (sweep => session%the_case%sweep)
      work%variables = basin_variables
      work%grid = grid_of(session%the_case, sweep_axes(session%the_case))
      work%span = span_of(session%the_case)
      work%max_period = session%the_case%attractors%max_period
      allocate (work%impacting(size(sweep%swept%values)), work%free(size(sweep%swept%values)), source=0_int64)
    end associate
  end subroutine prepare_branches

  !> The axes of the many starts: the swept parameter, x0, v0.
  function sweep_axes(the_case) result(axes)
    type(case_t), intent(in) :: the_case
    type(axis_t) :: axes(3)
    associate (sweep => the_case%sweep)
      axes(1) = sweep%swept
      axes(2) = axis_t('x0', 'm', linear_values(sweep%x0(1), sweep%x0(2), sweep%starts(1)))
      axes(3) = axis_t('v0', 'm/s', linear_values(sweep%v0(1), sweep%v0(2), sweep%starts(2)))
    end associate
  end function sweep_axes

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
    call add_map_variables(schema, 'branch_', dimensions)
    call open_tiles(session, path, schema, dimensions, [1, starts], file)
    call run_tiles(session, file, work, complete)
    call session%team%sum(work%impacting)
    call session%team%sum(work%free)
    call session%team%sum(work%reasons)
    call finish_tiles(session, file, complete, extra)
    call report_multiple(session, work)
    call report_reasons(session%journal, work%reasons)
  end subroutine run_branches

  subroutine compute_branch_points(self, index, values, error)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer :: place(3, size(index, 2))
    place(1, :) = index(1, :)
    place(2, :) = 1 + (index(2, :) - 1)/self%grid%shape(3)
    place(3, :) = 1 + modulo(index(2, :) - 1, self%grid%shape(3))
    call basin_points(self%grid, self%span, self%max_period, self%catalogues, place, self%cache, values, error)
  end subroutine compute_branch_points

  subroutine branch_points_from(self, index, points, error)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    integer, intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    points = 1
    ! The slice depends on the first axis only.
    if (size(self%catalogues) > 0) call points_at_a_time(self%grid, self%span, [index(1), 1, 1], self%cache, points, error)
  end subroutine branch_points_from

  subroutine note_branch_point(self, index, values)
    class(branch_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    real(wp), intent(in) :: values(:)
    associate (reason => nint(values(3)), place => index(1))
      self%reasons(reason) = self%reasons(reason) + 1
      if (reason /= reason_settled .and. reason /= reason_time_over) return
      if (values(6) > 0) then
        self%impacting(place) = self%impacting(place) + 1
      else
        self%free(place) = self%free(place) + 1
      end if
    end associate
  end subroutine note_branch_point

  !> Run up and run down as variables, and the limits as a table.
  subroutine describe_chains(session, chains, schema)
    type(session_t), intent(in) :: session
    type(chains_t), intent(in) :: chains
    type(schema_t), intent(inout) :: schema
    character(len=name_length), allocatable :: swept(:)
    character(len=name_length) :: dimensions(2)
    real(wp), allocatable :: barriers(:)
    call add_axes(schema, [session%the_case%sweep%swept], swept)
    call schema%add_dimension('direction', 2_int64)
    call schema%add_dimension('sample', int(session%the_case%sweep%samples, int64))
    dimensions = [character(len=name_length) :: 'direction', swept(1)]
    call add_regime(schema, 'regime', dimensions, .false.)
    call fill(1)
    call add_reason(schema, 'reason', dimensions, .false.)
    call fill(2)
    call add('period', type_int16, '1', 'period in drive periods, 0 = not periodic', 3)
    call add('event_word', type_int64, '1', 'events of one period of the motion, three bits each', 4)
    call add('impacts_per_period', type_float64, '1', 'impacts per drive period', 5)
    call add('mean_impact_speed', type_float64, 'm/s', 'mean speed just before impact', 6)
    call add('amplitude', type_float64, 'm', 'half the range of the position', 7)
    call add('x_max', type_float64, 'm', 'largest position', 8)
    call add('x_min', type_float64, 'm', 'smallest position', 9)
    call add('v_max', type_float64, 'm/s', 'largest velocity towards the upper barrier', 10)
    if (position_is_angle(session%the_case%laws)) then
      call add('rotation_number', type_float64, '1', 'turns of the angle per drive period, upwards', 11)
    end if
    call schema%add_variable('strobe_x', type_float64, [dimensions, [character(len=name_length) :: 'sample']], &
      units='m', long_name='position at crank angle 0', data=reshape(chains%samples(1, :, :, :), &
      [size(chains%samples)/2]))
    call schema%add_variable('strobe_v', type_float64, [dimensions, [character(len=name_length) :: 'sample']], &
      units='m/s', long_name='velocity at crank angle 0', data=reshape(chains%samples(2, :, :, :), &
      [size(chains%samples)/2]))
    if (size(chains%limits) > 0) call add_limits(session, schema, chains%limits)
    barriers = barriers_of(session)
    ! A barrier that is swept has no one position.
    if (session%the_case%sweep%swept%name == 'contact.upper') barriers(1) = huge(1.0_wp)
    if (session%the_case%sweep%swept%name == 'contact.lower') barriers(2) = -huge(1.0_wp)
    if (barriers(1) < sqrt(huge(1.0_wp))) call schema%add_attribute('', 'barrier_upper', barriers(1))
    if (barriers(2) > -sqrt(huge(1.0_wp))) call schema%add_attribute('', 'barrier_lower', barriers(2))

  contains

    subroutine add(name, type, units, long_name, row)
      character(len=*), intent(in) :: name, units, long_name
      integer, intent(in) :: type, row
      call schema%add_variable(name, type, dimensions, units=units, long_name=long_name)
      call fill(row)
    end subroutine add

    subroutine fill(row)
      integer, intent(in) :: row
      schema%variables(size(schema%variables))%data = reshape(chains%holds(row, :, :), [2*size(chains%holds, 2)])
    end subroutine fill

  end subroutine describe_chains

  function barriers_of(session) result(barriers)
    type(session_t), intent(in) :: session
    real(wp) :: barriers(2)
    type(contact_t) :: contact
    integer :: i
    associate (laws => session%the_case%laws)
      contact = contact_of(laws(contact_position), mass=1.0_wp)
      do i = 1, size(laws)
        if (laws(i)%family == effect_family) call add_to_contact(contact, laws(i))
      end do
    end associate
    barriers = barrier_positions(contact)
  end function barriers_of

  subroutine add_limits(session, schema, limits)
    type(session_t), intent(in) :: session
    type(schema_t), intent(inout) :: schema
    type(limit_t), intent(in) :: limits(:)
    character(len=40) :: names(size(limits))
    character(len=:), allocatable :: unit
    integer :: i
    unit = trim(session%the_case%sweep%swept%unit)
    do i = 1, size(limits)
      names(i) = limit_name(session, limits(i))
    end do
    call schema%add_dimension('limit', size(limits, kind=int64))
    call schema%add_variable('name', type_string, ['limit'], strings=names, group='limits', &
                             long_name='where impacts start or stop, or a regime of two bodies gives way')
    call schema%add_variable('lower', type_float64, ['limit'], units=unit, long_name='lower end of the bracket', &
                             data=limits%bracket(1), group='limits')
    call schema%add_variable('upper', type_float64, ['limit'], units=unit, long_name='upper end of the bracket', &
                             data=limits%bracket(2), group='limits')
  end subroutine add_limits

  !> What happens at a limit: impacts start or stop, or one regime of two bodies gives way to another.
  pure function limit_name(session, limit) result(name)
    type(session_t), intent(in) :: session
    type(limit_t), intent(in) :: limit
    character(len=:), allocatable :: name
    if (is_pair(session%the_case%laws)) then
      name = trim(regime_names(limit%from))//'_to_'//trim(regime_names(limit%to))
    else
      name = 'impacts_'//trim(merge('start', 'stop ', limit%to == regime_impact))
    end if
    name = name//'_'//trim(merge('up  ', 'down', limit%up))
  end function limit_name

  !> Where holds had to be given up, and why: ranges of the parameter.
  subroutine report_given_up(session, chains)
    type(session_t), intent(inout) :: session
    type(chains_t), intent(in) :: chains
    integer :: direction, i, first, reason
    associate (reasons => nint(chains%holds(hold_reason, :, :)), values => session%the_case%sweep%swept%values)
      do direction = 1, 2
        first = 1
        do i = 1, size(values)
          reason = reasons(i, direction)
          if (i < size(values)) then
            if (reasons(i + 1, direction) == reason) cycle
          end if
          if (chains%ran(direction) .and. reason /= reason_time_over) then
            call session%journal%line('given_up', '  run '//trim(merge('up  ', 'down', direction == 1))//': given up from '// &
              to_text(values(first), 6)//' to '//to_text(values(i), 6)//' as '//trim(reason_names(reason)), &
              '"reason": "'//trim(reason_names(reason))//'", "from": '//to_text(values(first))//', "to": '//to_text(values(i)))
          end if
          first = i + 1
        end do
      end do
    end associate
  end subroutine report_given_up

  subroutine report_limits(session, chains)
    type(session_t), intent(inout) :: session
    type(chains_t), intent(in) :: chains
    character(len=:), allocatable :: name
    integer :: i
    associate (limits => chains%limits)
      do i = 1, size(limits)
        name = limit_name(session, limits(i))
        associate (bracket => limits(i)%bracket)
          call session%journal%line('limit', '  run '//trim(merge('up  ', 'down', limits(i)%up))//': '// &
            replace_all(name(:index(name, '_', back=.true.) - 1), '_', ' ')//' between '//to_text(bracket(1), 6)//' and '// &
            to_text(bracket(2), 6), '"name": "'//name//'", "lower": '//to_text(bracket(1))//', "upper": '//to_text(bracket(2)))
        end associate
      end do
    end associate
    if (size(chains%limits) > 0) return
    if (any(count(nint(chains%holds(hold_reason, :, :)) == reason_time_over, dim=1) < size(chains%holds, 2) .and. &
            chains%ran)) then
      call session%journal%line('limit', '  no limit seen between the values that were not given up')
    else if (is_pair(session%the_case%laws)) then
      call session%journal%line('limit', '  one regime throughout')
    else
      call session%journal%line('limit', '  impacts neither start nor stop')
    end if
  end subroutine report_limits

  !> Ranges of the parameter where starts lead to motions with impacts, without, and both.
  subroutine report_multiple(session, work)
    type(session_t), intent(inout) :: session
    type(branch_work_t), intent(in) :: work
    integer :: i, first
    integer :: kind(size(work%free) + 1)
    character(len=*), parameter :: names(3) = [character(len=19) :: 'non-impact', 'impact', 'multiple solutions']
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
