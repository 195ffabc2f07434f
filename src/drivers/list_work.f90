! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The work of `separatrix points` on a list of starts: its file, its points, and its end.
module list_work
  use attractors, only: attractor_t
  use axis, only: axis_t, name_length
  use case_setup, only: span_of
  use case_type, only: case_t
  use checksum, only: crc32
  use endings, only: assess_reasons, report_reasons
  use device_run, only: run_on_device
  use errors, only: error_t, fail
  use file_layout, only: add_reason, add_regime, axis_dimension
  use grid, only: grid_t, machine_with, make_grid, point_start, sample_axis, slice_motion
  use kinds, only: int64, int8, wp
  use lane_slots, only: prepare_flow
  use map_file, only: map_file_t
  use map_reader, only: open_final, reader_t
  use map_schema, only: schema_t, type_float64, type_int32
  use point_list, only: point_list_t
  use session, only: describe_file, session_t
  use single_trajectory, only: outcome_t
  use status, only: last_reason, exit_done, exit_io, reason_names
  use text, only: to_text
  use text_table, only: table_t
  use tiled_run, only: finish_tiles, point_work_t
  use trajectory_slots, only: describe_regime, ensemble_t
  use work_watch, only: watch_t
  implicit none
  private

  public :: open_list_ensemble, starts_of, shortest_period, read_list, read_further, describe_list, describe_points, end_points

  integer, parameter, public :: points_per_tile = 256
  !> Columns of a point.
  integer, parameter :: at_x = 1, at_v = 2, at_impacts = 3, at_impact_speed = 4, at_regime = 5, at_reason = 6
  integer, parameter, public :: point_variables = 6
  !> Attribute that names the starts of further bodies.
  character(len=*), parameter :: further_starts = 'further_starts'

  type, extends(point_work_t), public :: list_work_t
    !> The machine of the list, and the starts: a grid along the points.
    type(grid_t) :: grid, starts
    type(ensemble_t) :: ensemble
    type(point_list_t) :: list
    real(wp) :: ratio = -1
    integer(int64) :: reasons(0:last_reason) = 0
  contains
    procedure :: compute => compute_list_points
    procedure :: note => note_list_point
  end type list_work_t

contains

  !> The final file and the table, how the points ended, and the end of the program.
  subroutine end_points(session, work, file, complete)
    type(session_t), intent(inout) :: session
    type(list_work_t), intent(inout) :: work
    type(map_file_t), intent(inout) :: file
    logical, intent(in) :: complete
    type(schema_t) :: extra
    type(error_t), allocatable :: error
    call session%team%sum(work%reasons)
    call finish_tiles(session, file, complete, extra)
    associate (csv => session%command%csv)
      if (session%team%is_root() .and. len(csv) > 0) call write_csv(csv, file%path, work%list, error)
      call session%stop_if(error)
      if (len(csv) > 0) call session%journal%line('written', 'wrote '//csv)
    end associate
    call report_reasons(session%journal, work%reasons)
    call assess_reasons(session%journal, work%reasons, session%command%partial, error)
    call session%stop_if(error)
    call session%end_with(exit_done)
  end subroutine end_points

  !> The machine of a list of starts: whole durations, of whose windows only the regime is reported.
  subroutine open_list_ensemble(grid, the_case, ensemble, error)
    type(grid_t), intent(in) :: grid
    type(case_t), intent(in) :: the_case
    type(ensemble_t), intent(out) :: ensemble
    type(error_t), allocatable, intent(out) :: error
    call slice_motion(grid, 0_int64, ensemble%moving, error)
    if (allocated(error)) return
    call prepare_flow(ensemble%moving, ensemble%flow)
    ensemble%span = span_of(the_case)
    ensemble%span%stop_when_converged = .false.
    ensemble%span%extension = 1
    ensemble%describe = describe_regime
  end subroutine open_list_ensemble

  !> The starts of a list as a grid along its points.
  pure function starts_of(grid, list) result(starts)
    type(grid_t), intent(in) :: grid
    type(point_list_t), intent(in) :: list
    type(grid_t) :: starts
    type(axis_t) :: along(1)
    real(wp), allocatable :: drawn(:, :)
    integer :: i
    along(1)%name = sample_axis
    along(1)%unit = '1'
    along(1)%values = [(real(i, wp), i=1, size(list%x0))]
    allocate (drawn(2 + size(list%names), size(list%x0)))
    drawn(1, :) = list%x0
    drawn(2, :) = list%v0
    drawn(3:, :) = list%further
    starts = make_grid(along, grid%laws, grid%start, grid%options, [character(len=name_length) :: 'x0', 'v0', list%names], drawn)
  end function starts_of

  !> The drive period of the fastest point.
  pure real(wp) function shortest_period(work)
    type(list_work_t), intent(in) :: work
    shortest_period = work%ensemble%moving%period
    if (work%ratio > 0) shortest_period = shortest_period*work%ratio/maxval(work%list%ratio)
  end function shortest_period

  !> Checksum of the starts.
  function list_identity(list) result(identity)
    type(point_list_t), intent(in) :: list
    character(len=:), allocatable :: identity
    integer(int8) :: one(1)
    integer(int64) :: sum_so_far
    sum_so_far = crc32(transfer(list%x0, one), 0_int64)
    sum_so_far = crc32(transfer(list%v0, one), sum_so_far)
    sum_so_far = crc32(transfer(list%ratio, one), sum_so_far)
    if (size(list%names) > 0) sum_so_far = crc32(transfer(list%further, one), sum_so_far)
    identity = to_text(sum_so_far)
  end function list_identity

  !> The starts that the file of a run keeps.
  subroutine read_list(path, list, error)
    character(len=*), intent(in) :: path
    type(point_list_t), intent(out) :: list
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    call open_final(path, reader, error)
    if (.not. allocated(error)) call reader%read_values('/x0', list%x0, error)
    if (.not. allocated(error)) call reader%read_values('/v0', list%v0, error)
    if (.not. allocated(error)) call reader%read_values('/ratio', list%ratio, error)
    if (.not. allocated(error)) call read_further(reader, list, error)
    if (.not. allocated(error)) call reader%close(error)
    if (allocated(error)) return
    if (size(list%v0) /= size(list%x0) .or. size(list%ratio) /= size(list%x0)) call fail(error, exit_io, &
      "'"//path//"' is damaged: x0, v0 and ratio have different lengths")
  end subroutine read_list

  !> The starts of further bodies in the file of a run; none are named where there are none.
  subroutine read_further(reader, list, error)
    type(reader_t), intent(in) :: reader
    type(point_list_t), intent(inout) :: list
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: rest
    real(wp), allocatable :: column(:), columns(:)
    integer :: length
    allocate (list%names(0), columns(0))
    rest = ''
    if (reader%has_attribute('/', further_starts)) call reader%text_attribute('/', further_starts, rest, error)
    do while (len_trim(rest) > 0 .and. .not. allocated(error))
      length = index(rest//' ', ' ') - 1
      list%names = [character(len=name_length) :: list%names, rest(:length)]
      rest = rest(min(length + 2, len(rest) + 1):)
      call reader%read_values('/'//axis_dimension(list%names(size(list%names))), column, error)
      if (.not. allocated(error)) columns = [columns, column]
    end do
    if (allocated(error)) return
    if (size(columns) /= size(list%names)*size(list%x0)) then
      call fail(error, exit_io, "'"//reader%path//"' is damaged: starts have different lengths")
      return
    end if
    list%further = transpose(reshape(columns, [size(list%x0), size(list%names)]))
  end subroutine read_further

  !> Attributes, starts and variables of the file.
  subroutine describe_list(session, list, schema)
    type(session_t), intent(in) :: session
    type(point_list_t), intent(in) :: list
    type(schema_t), intent(inout) :: schema
    call describe_file(session, 'points', schema, list_identity(list))
    call describe_points(list, schema)
  end subroutine describe_list

  subroutine describe_points(list, schema)
    type(point_list_t), intent(in) :: list
    type(schema_t), intent(inout) :: schema
    character(len=:), allocatable :: names
    integer :: k
    call schema%add_dimension('point', size(list%x0, kind=int64))
    call add('x0', 'm', 'initial position', list%x0)
    call add('v0', 'm/s', 'initial velocity', list%v0)
    call add('ratio', '1', 'drive angular frequency over natural angular frequency', list%ratio)
    names = ''
    do k = 1, size(list%names)
      names = names//' '//trim(list%names(k))
      call add(axis_dimension(list%names(k)), trim(merge('m  ', 'm/s', index(list%names(k), '.x0') > 0)), &
               trim(list%names(k))//' at the start', list%further(k, :))
    end do
    if (len(names) > 0) call schema%add_attribute('', further_starts, names(2:))
    call schema%add_variable('x', type_float64, ['point'], units='m', long_name='final position', tiled=.true.)
    call schema%add_variable('v', type_float64, ['point'], units='m/s', long_name='final velocity', tiled=.true.)
    call schema%add_variable('impacts', type_int32, ['point'], units='1', long_name='number of impacts', tiled=.true.)
    call schema%add_variable('last_impact_speed', type_float64, ['point'], units='m/s', &
                             long_name='speed just before the last impact, 0 without impacts', tiled=.true.)
    call add_regime(schema, 'regime', ['point'], .true.)
    call add_reason(schema, 'reason', ['point'], .true.)

  contains

    subroutine add(name, units, long_name, data)
      character(len=*), intent(in) :: name, units, long_name
      real(wp), intent(in) :: data(:)
      call schema%add_variable(name, type_float64, ['point'], units=units, long_name=long_name, data=data)
    end subroutine add

  end subroutine describe_points

  subroutine compute_list_points(self, index, values, whole, error, watch)
    class(list_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    integer :: first, last
    whole = .true.
    first = 1
    do while (first <= size(index, 2))
      associate (ratio => self%list%ratio(index(1, first)))
        last = first
        do while (last < size(index, 2))
          if (abs(self%list%ratio(index(1, last + 1)) - ratio) > 0) exit
          last = last + 1
        end do
        if (abs(ratio - self%ratio) > 0) then
          call machine_with(self%grid, 'drive.ratio', ratio, self%ensemble%moving, error)
          if (allocated(error)) return
          call prepare_flow(self%ensemble%moving, self%ensemble%flow)
          self%ratio = ratio
        end if
      end associate
      call run_block(self, index(1, first:last), values(first:last, :), whole, error, watch)
      if (allocated(error) .or. .not. whole) return
      first = last + 1
    end do
  end subroutine compute_list_points

  !> Points of one machine.
  subroutine run_block(work, points, values, whole, error, watch)
    type(list_work_t), intent(in) :: work
    integer, intent(in) :: points(:)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(outcome_t), allocatable :: outcomes(:)
    type(attractor_t) :: no_catalogue(0)
    real(wp), allocatable :: starts(:, :)
    integer :: i
    allocate (outcomes(size(points)), starts(3 + size(work%starts%others), size(points)))
    do i = 1, size(points)
      starts(:, i) = point_start(work%starts, [points(i)])
    end do
    call run_on_device(work%ensemble, no_catalogue, starts, outcomes, whole, error, watch)
    if (allocated(error) .or. .not. whole) return
    do i = 1, size(points)
      associate (outcome => outcomes(i))
        values(i, at_x) = outcome%x
        values(i, at_v) = outcome%v
        values(i, at_impacts) = real(outcome%impacts, wp)
        values(i, at_impact_speed) = outcome%last_impact_speed
        values(i, at_regime) = outcome%features%regime
        values(i, at_reason) = outcome%reason
      end associate
    end do
  end subroutine run_block

  subroutine note_list_point(self, index, values)
    class(list_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    real(wp), intent(in) :: values(:)
    associate (unused => index, reason => nint(values(at_reason)))
      self%reasons(reason) = self%reasons(reason) + 1
    end associate
  end subroutine note_list_point

  !> The table x0,v0,ratio,x,v,impacts,last_impact_speed,reason, starts of further bodies behind ratio; numbers read back to
  !> the same bits.
  subroutine write_csv(csv, path, list, error)
    character(len=*), intent(in) :: csv, path
    type(point_list_t), intent(in) :: list
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    real(wp), allocatable :: x(:), v(:), impacts(:), speed(:), reason(:)
    type(table_t) :: table
    character(len=:), allocatable :: further
    integer :: i, k
    call open_final(path, reader, error)
    if (.not. allocated(error)) call reader%read_values('/x', x, error)
    if (.not. allocated(error)) call reader%read_values('/v', v, error)
    if (.not. allocated(error)) call reader%read_values('/impacts', impacts, error)
    if (.not. allocated(error)) call reader%read_values('/last_impact_speed', speed, error)
    if (.not. allocated(error)) call reader%read_values('/reason', reason, error)
    if (.not. allocated(error)) call reader%close(error)
    if (allocated(error)) return
    call table%create(csv)
    further = ''
    do k = 1, size(list%names)
      further = further//trim(list%names(k))//','
    end do
    call table%line('x0,v0,ratio,'//further//'x,v,impacts,last_impact_speed,reason')
    do i = 1, size(x)
      further = ''
      do k = 1, size(list%names)
        further = further//to_text(list%further(k, i))//','
      end do
      call table%line(to_text(list%x0(i))//','//to_text(list%v0(i))//','//to_text(list%ratio(i))//','//further// &
                      to_text(x(i))//','//to_text(v(i))//','//to_text(nint(impacts(i)))//','//to_text(speed(i))//','// &
                      trim(reason_names(nint(reason(i)))))
    end do
    call table%close(error)
  end subroutine write_csv

end module list_work
