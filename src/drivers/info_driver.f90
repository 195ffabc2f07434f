! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix info`: what is in a file.
module info_driver
  use attractors, only: regime_names
  use errors, only: error_t, fail
  use info_catalogue, only: add_catalogue
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use map_reader, only: open_final, reader_t, variable_info_t
  use map_verify, only: probe_file, verify_plain
  use status, only: exit_io, reason_names
  use tile_record, only: tile_records
  use text, only: interval_text, join, to_text
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  private

  public :: run_info

  character(len=*), parameter :: root_texts(6) = [character(len=14) :: 'kind', 'title', 'source', 'date_created', &
    'format_version', 'complete']
  character(len=*), parameter :: provenance_texts(17) = [character(len=13) :: 'version', 'commit', 'compiler', 'flags', &
    'c_flags', 'mpi', 'hdf5', 'ranks', 'host_count', 'hosts', 'processor', 'environment', 'started', 'finished', &
    'wall_seconds', 'case_identity', 'command_line']
  character(len=*), parameter :: numeric(5) = [character(len=14) :: 'format_version', 'complete', 'ranks', 'host_count', &
    'wall_seconds']
contains

  !> Prints the content of a file; a working file can be looked at as well.
  subroutine run_info(path, json, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: json
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    type(variable_info_t), allocatable :: variables(:)
    character(len=:), allocatable :: body
    call probe_file(path, error)
    if (.not. allocated(error)) call open_final(path, reader, error)
    if (.not. allocated(error)) call verify_plain(path, error)
    if (allocated(error)) return
    call reader%variables(variables, error)
    if (allocated(error)) return
    body = ''
    call add_attributes(reader, json, body, error)
    if (.not. allocated(error)) call add_tiles(reader, json, body, error)
    if (.not. allocated(error)) call add_variables(variables, json, body)
    if (.not. allocated(error)) call add_codes(reader, json, 'regime', regime_names, body, error)
    if (.not. allocated(error)) call add_codes(reader, json, 'reason', reason_names, body, error)
    if (.not. allocated(error)) call add_refinement(reader, json, body, error)
    if (.not. allocated(error)) call add_catalogue(reader, json, body, error)
    if (.not. allocated(error)) call add_limits(reader, json, body, error)
    if (allocated(error)) return
    call reader%close(error)
    if (allocated(error)) return
    if (json) then
      write (output_unit, '(a)') '{"path": '//json_text(path)//body//'}'
    else
      write (output_unit, '(a)') path//body
    end if
  end subroutine run_info

  subroutine add_attributes(reader, json, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(root_texts)
      call add_one('/', trim(root_texts(i)))
      if (allocated(error)) return
    end do
    do i = 1, size(provenance_texts)
      call add_one('/provenance', trim(provenance_texts(i)))
      if (allocated(error)) return
    end do

  contains

    subroutine add_one(object, name)
      character(len=*), intent(in) :: object, name
      character(len=:), allocatable :: text
      real(wp) :: number
      if (.not. reader%has_attribute(object, name)) return
      if (any(numeric == name)) then
        call reader%number_attribute(object, name, number, error)
        if (allocated(error)) return
        text = to_text(number)
        if (abs(number) < 1e15_wp .and. abs(number - anint(number)) <= 0) text = to_text(nint(number, int64))
      else
        call reader%text_attribute(object, name, text, error)
        if (.not. allocated(error) .and. json) text = json_text(text)
      end if
      if (allocated(error)) return
      if (json) then
        body = body//', "'//name//'": '//text
      else
        body = body//new_line('a')//'  '//name//': '//text
      end if
    end subroutine add_one

  end subroutine add_attributes

  !> How many tiles of a file are done.
  subroutine add_tiles(reader, json, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: states(:)
    integer :: done, tiles
    if (reader%has(tile_records)) then
      call reader%count_tiles(done, tiles, error)
    else if (reader%has('/tiles/state')) then
      call reader%read_values('/tiles/state', states, error)
      if (allocated(error)) return
      done = count(abs(states - 1) <= 0)
      tiles = size(states)
    else
      return
    end if
    if (allocated(error)) return
    if (json) then
      body = body//', "tiles_done": '//to_text(done)//', "tiles": '//to_text(tiles)
    else
      body = body//new_line('a')//'  tiles: '//to_text(done)//' of '//to_text(tiles)//' done'
    end if
  end subroutine add_tiles

  subroutine add_variables(variables, json, body)
    type(variable_info_t), intent(in) :: variables(:)
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    character(len=:), allocatable :: name, shape_text
    integer :: i, k
    if (json) body = body//', "variables": ['
    if (.not. json) body = body//new_line('a')//'  variables:'
    do i = 1, size(variables)
      name = variables(i)%name
      if (len(variables(i)%group) > 0) name = variables(i)%group//'/'//name
      shape_text = ''
      do k = 1, size(variables(i)%lengths)
        if (k > 1) shape_text = shape_text//', '
        shape_text = shape_text//to_text(variables(i)%lengths(k))
      end do
      if (json) then
        if (i > 1) body = body//', '
        body = body//'{"name": '//json_text(name)//', "type": '//json_text(variables(i)%type)//', "shape": ['// &
          shape_text//']}'
      else
        body = body//new_line('a')//'    '//name//' ('//shape_text//') '//variables(i)%type
      end if
    end do
    if (json) body = body//']'
  end subroutine add_variables

  !> Shares of the codes of a variable, or of its `branch_` twin in a sweep.
  subroutine add_codes(reader, json, variable, names, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=*), intent(in) :: variable, names(0:)
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: path
    integer(int64) :: counts(0:ubound(names, 1))
    integer :: i
    logical :: first
    path = '/'//variable
    if (reader%has('/branch_'//variable)) path = '/branch_'//variable
    if (.not. reader%has(path)) return
    call reader%count_codes(path, counts, error)
    if (allocated(error)) return
    if (json) body = body//', "'//path(2:)//'": {'
    if (.not. json) body = body//new_line('a')//'  '//path(2:)//':'
    first = .true.
    do i = 0, ubound(names, 1)
      if (counts(i) == 0) cycle
      if (json) then
        if (.not. first) body = body//', '
        body = body//json_text(trim(names(i)))//': {"points": '//to_text(counts(i))//', "percent": '// &
          to_text(100*real(counts(i), wp)/sum(counts))//'}'
      else
        body = body//new_line('a')//'    '//trim(names(i))//': '//to_text(counts(i))//' points, '// &
          to_text(100*real(counts(i), wp)/sum(counts), 6)//' %'
      end if
      first = .false.
    end do
    if (json) body = body//'}'
  end subroutine add_codes

  !> How much of a refined map was computed, and how much of it can be wrong.
  subroutine add_refinement(reader, json, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: names(6) = [character(len=23) :: 'points_computed', 'points_inferred', &
      'probes_drawn', 'probes_contradicted', 'wrong_share_upper_limit', 'confidence']
    real(wp) :: values(size(names))
    integer :: i
    do i = 1, size(names)
      if (.not. reader%has_attribute('/refinement', trim(names(i)))) return
      call reader%number_attribute('/refinement', trim(names(i)), values(i), error)
      if (allocated(error)) return
    end do
    if (json) then
      body = body//', "refinement": {'
      do i = 1, size(names)
        body = body//json_text(trim(names(i)))//': '//number_text(i)//', '
      end do
      body = body//'"percent_computed": '//to_text(100*values(1)/(values(1) + values(2)))//'}'
    else
      body = body//new_line('a')//'  refined:'// &
        new_line('a')//'    computed: '//number_text(1)//' points, '//to_text(100*values(1)/(values(1) + values(2)), 4)//' %'// &
        new_line('a')//'    inferred: '//number_text(2)//' points'// &
        new_line('a')//'    probes: '//number_text(3)//' drawn, '//number_text(4)//' found something else (mended)'// &
        new_line('a')//'    wrong: at most '//to_text(100*values(5), 3)//' % of the points, with '// &
        to_text(100*values(6), 2)//' % confidence'
    end if

  contains

    function number_text(i) result(text)
      integer, intent(in) :: i
      character(len=:), allocatable :: text
      if (i <= 4) then
        text = to_text(nint(values(i), int64))
      else
        text = to_text(values(i))
      end if
    end function number_text

  end subroutine add_refinement

  subroutine add_limits(reader, json, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: group = '/limits/', columns(4) = [character(len=14) :: 'lower', 'upper', 'observed_lower', &
      'observed_upper']
    character(len=:), allocatable :: names(:), line
    real(wp), allocatable :: ends(:, :)
    integer :: i, k, last
    if (.not. reader%has('/limits/name')) return
    last = merge(4, 2, reader%has('/limits/observed_upper'))
    call reader%read_strings('/limits/name', names, error)
    if (.not. allocated(error)) call reader%read_columns(group//columns(:last), ends, error)
    if (allocated(error)) return
    if (size(ends, 1) /= size(names)) then
      call fail(error, exit_io, "the columns of '/limits' in '"//reader%path//"' differ in length")
      return
    end if
    if (json) body = body//', "limits": ['
    if (.not. json) body = body//new_line('a')//'  limits:'
    do i = 1, size(names)
      if (json) then
        line = trim(merge(', ', '  ', i > 1))//'{"name": '//json_text(trim(names(i)))
        do k = 1, last
          line = line//', "'//trim(columns(k))//'": '//json_number(ends(i, k))
        end do
        body = body//line//'}'
      else
        line = 'not known'
        if (abs(ends(i, 1)) <= huge(1.0_wp)) line = interval_text(ends(i, :2), ' .. ')
        if (last == 4) line = line//'; in steps '//interval_text(ends(i, 3:), ' .. ')
        body = body//new_line('a')//'    '//trim(names(i))//': '//line
      end if
    end do
    if (json) body = body//']'
  end subroutine add_limits

end module info_driver
