! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix merge`: the shares of a map become the file that one run would have written.
module merge_driver
  use basin_driver, only: basin_work_t, describe_basin, end_basin, prepare_basin, prepare_counts
  use case_reader, only: load_case_text
  use catalogue_search, only: unpack_catalogues
  use command_line, only: command_t
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use map_file, only: create_working, map_file_t, open_working
  use map_reader, only: open_final, reader_t
  use map_schema, only: name_length, schema_t
  use serial_team, only: serial_team_t
  use session, only: session_t
  use shard, only: catalogue_dataset, describe_shard, in_shard
  use signals, only: install_signals
  use status, only: exit_bad_case, exit_io, exit_no_input, exit_other_case, exit_resumable
  use text, only: to_text
  use tiled_run, only: index_in_block
  implicit none
  private

  public :: run_merge

  !> What is known of the shares before their tiles are read.
  type :: shares_t
    integer :: count = 0
    !> The file of each share.
    character(len=:), allocatable :: files(:)
    character(len=:), allocatable :: case_text, resolved_case
    real(wp), allocatable :: catalogue(:)
  end type shares_t

contains

  !> Runs the command; ends the program with the exit code on errors. Code 65 for a file that is no share or is given
  !> twice, 66 for a share that is missing, 74 for a damaged one, 75 for one that is not done, 76 for one of another case.
  subroutine run_merge(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(basin_work_t) :: work
    type(shares_t) :: shares
    type(map_file_t) :: file
    type(map_file_t), allocatable :: parts(:)
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    character(len=name_length), allocatable :: dimensions(:)
    character(len=128) :: no_overrides(0)
    integer, allocatable :: tile(:)
    session%command = command
    allocate (serial_team_t :: session%team)
    call session%journal%open(.true., command%json, command%quiet)
    call session%journal%open_copy(command%log, error)
    if (.not. allocated(error)) call install_signals(error)
    if (.not. allocated(error)) call read_shares(command%shards, shares, error)
    if (.not. allocated(error)) call load_case_text(shares%resolved_case, trim(command%shards(1))//' (resolved case)', &
                                                    no_overrides, session%the_case, error)
    call session%stop_if(error)
    session%the_case%raw_text = shares%case_text
    call prepare_basin(session%the_case, work, tile)
    call take_catalogues(shares, work, error)
    call session%stop_if(error)
    call session%begin(command%path, tiled=.true.)
    call describe_basin(session, work, schema, dimensions)
    call open_parts(shares, session, work, tile, parts, error)
    call session%stop_if(error)
    call create_working(command%path, schema, dimensions, int(tile, int64), command%force, session%team, file, error)
    call session%stop_if(error)
    call session%journal%begin('tiles', int(file%tile_count(), int64), 0_int64)
    call copy_tiles(session, shares%count, parts, file, work, error)
    call session%stop_if(error)
    call end_basin(session, work, file, complete=.true.)
  end subroutine run_merge

  !> Reads what the files are, and that they are the shares of one map, each once.
  subroutine read_shares(paths, shares, error)
    character(len=*), intent(in) :: paths(:)
    type(shares_t), intent(out) :: shares
    type(error_t), allocatable, intent(out) :: error
    integer :: i, number, count
    do i = 1, size(paths)
      call read_share(trim(paths(i)), i == 1, shares, number, count, error)
      if (allocated(error)) return
      if (i == 1) then
        shares%count = count
        allocate (character(len=len(paths)) :: shares%files(count))
        shares%files = ''
      end if
      if (count /= shares%count) then
        call fail(error, exit_bad_case, "'"//trim(paths(i))//"' is a share of "//to_text(count)//", '"//trim(paths(1))// &
                  "' is one of "//to_text(shares%count))
      else if (len_trim(shares%files(number)) > 0) then
        call fail(error, exit_bad_case, 'share '//to_text(number)//' of '//to_text(count)//" is given twice: '"// &
                  trim(shares%files(number))//"' and '"//trim(paths(i))//"'")
      end if
      if (allocated(error)) return
      shares%files(number) = paths(i)
    end do
    do i = 1, shares%count
      if (len_trim(shares%files(i)) == 0) then
        call fail(error, exit_no_input, 'share '//to_text(i)//' of '//to_text(shares%count)//' is missing; found '// &
                  to_text(size(paths)))
        return
      end if
    end do
  end subroutine read_shares

  subroutine read_share(path, is_first, shares, number, count, error)
    character(len=*), intent(in) :: path
    logical, intent(in) :: is_first
    type(shares_t), intent(inout) :: shares
    integer, intent(out) :: number, count
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(reader_t) :: reader
    real(wp), allocatable :: catalogue(:)
    real(wp) :: values(2)
    number = 0
    count = 0
    call open_final(path, reader, error)
    if (allocated(error)) return
    values = 0
    if (reader%has('/shard')) then
      call reader%number_attribute('/shard', 'number', values(1), error)
      if (.not. allocated(error)) call reader%number_attribute('/shard', 'shares', values(2), error)
    else
      call fail(error, exit_bad_case, "'"//path//"' is no share of a map: basin --shard I/N writes them")
    end if
    if (.not. allocated(error)) call reader%read_values(catalogue_dataset, catalogue, error)
    if (.not. allocated(error) .and. is_first) then
      call reader%read_text('/provenance/case_text', shares%case_text, error)
      if (.not. allocated(error)) call reader%read_text('/provenance/resolved_case', shares%resolved_case, error)
      if (.not. allocated(error)) shares%catalogue = catalogue
    end if
    call reader%close(ignored)
    if (allocated(error)) return
    if (.not. (values(1) >= 1 .and. values(1) <= values(2) .and. values(2) < huge(1))) then
      call fail(error, exit_io, "'"//path//"' is damaged: share "//to_text(values(1))//' of '//to_text(values(2)))
      return
    end if
    number = nint(values(1))
    count = nint(values(2))
    if (.not. same(catalogue, shares%catalogue)) call fail(error, exit_other_case, "'"//path// &
      "' belongs to another case, or was made by another version: its catalogue differs from the first share's")
  end subroutine read_share

  pure logical function same(one, other)
    real(wp), intent(in) :: one(:), other(:)
    same = size(one) == size(other)
    if (same) same = all(transfer(one, [0_int64]) == transfer(other, [0_int64]))
  end function same

  subroutine take_catalogues(shares, work, error)
    type(shares_t), intent(in) :: shares
    type(basin_work_t), intent(inout) :: work
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    allocate (work%catalogues(merge(work%grid%slices, 0_int64, any(work%grid%start_axis > 0))))
    call unpack_catalogues(shares%catalogue, work%catalogues)
    do i = 1, size(work%catalogues)
      if (allocated(work%catalogues(i)%attractors)) cycle
      call fail(error, exit_io, 'the shares lack the catalogue of slice '//to_text(i - 1))
      return
    end do
    call prepare_counts(work)
  end subroutine take_catalogues

  !> Opens the shares as if to resume them, which checks case, layout and every tile.
  subroutine open_parts(shares, session, work, tile, parts, error)
    type(shares_t), intent(in) :: shares
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(in) :: work
    integer, intent(in) :: tile(:)
    type(map_file_t), allocatable, intent(out) :: parts(:)
    type(error_t), allocatable, intent(out) :: error
    type(schema_t) :: schema
    character(len=name_length), allocatable :: dimensions(:)
    character(len=:), allocatable :: path
    integer :: i, k, left
    allocate (parts(shares%count))
    do i = 1, shares%count
      path = trim(shares%files(i))
      if (len(path) <= len('.part') .or. index(path, '.part', back=.true.) /= len(path) - len('.part') + 1) then
        call fail(error, exit_bad_case, "'"//path//"': the name of a share ends in .part")
        return
      end if
      schema = schema_t()
      call describe_basin(session, work, schema, dimensions)
      call describe_shard(work%catalogues, i, shares%count, schema)
      call open_working(path(:len(path) - len('.part')), schema, dimensions, int(tile, int64), session%team, parts(i), error)
      if (allocated(error)) return
      left = count([(in_shard(k, i, shares%count) .and. .not. parts(i)%tile_done(k), k=1, parts(i)%tile_count())])
      if (left == 0) cycle
      call fail(error, exit_resumable, 'share '//to_text(i)//' of '//to_text(shares%count)//" in '"//path//"' has "// &
        to_text(left)//' tiles that are not done or damaged; basin with --shard '//to_text(i)//'/'//to_text(shares%count)// &
        ' --resume computes them')
      return
    end do
  end subroutine open_parts

  subroutine copy_tiles(session, count, parts, file, work, error)
    type(session_t), intent(inout) :: session
    integer, intent(in) :: count
    type(map_file_t), intent(inout) :: parts(:), file
    type(basin_work_t), intent(inout) :: work
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:, :)
    integer(int64) :: lower(size(file%tiling%lengths)), extent(size(file%tiling%lengths))
    integer :: tile, i, point
    do tile = 1, file%tile_count()
      i = 1 + modulo(tile - 1, count)
      call parts(i)%read_tile(tile, values, error)
      if (.not. allocated(error)) call file%write_tile(tile, values, error)
      if (allocated(error)) return
      call file%tiling%block_of(tile, lower, extent)
      do point = 1, size(values, 1)
        call work%note(index_in_block(lower, extent, point), values(point, :))
      end do
      call session%journal%progress(int(tile, int64))
    end do
    do i = 1, count
      call parts(i)%close(session%team, error)
      if (allocated(error)) return
    end do
  end subroutine copy_tiles

end module merge_driver
