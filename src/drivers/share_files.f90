! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The working files of the shares of one run, read and joined.
module share_files
  use build_info, only: version
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use map_file, only: create_working, map_file_t, open_working
  use map_reader, only: open_final, reader_t
  use map_schema, only: format_version, schema_t
  use point_work, only: point_work_t
  use resumption, only: builder_of, read_builder
  use session, only: session_t
  use shard, only: catalogue_dataset, describe_shard, in_shard
  use status, only: exit_bad_case, exit_io, exit_no_input, exit_other_case, exit_resumable
  use text, only: to_text
  use tile_order, only: share_of
  use tiled_run, only: index_in_block
  implicit none
  private

  public :: read_shares, note_builds, join_shares, read_catalogue

  !> What is known of the shares before their tiles are read.
  type, public :: shares_t
    integer :: count = 0
    !> The command that made them: basin or points.
    character(len=:), allocatable :: kind
    !> The file of each share.
    character(len=:), allocatable :: files(:)
    character(len=:), allocatable :: case_text, resolved_case
    !> The catalogues of a map.
    real(wp), allocatable :: catalogue(:)
  end type shares_t

contains

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
    character(len=:), allocatable :: kind, made_by
    real(wp) :: values(2), format
    number = 0
    count = 0
    call open_final(path, reader, error)
    if (allocated(error)) return
    values = 0
    if (reader%has('/shard')) then
      call reader%number_attribute('/shard', 'number', values(1), error)
      if (.not. allocated(error)) call reader%number_attribute('/shard', 'shares', values(2), error)
    else
      call fail(error, exit_bad_case, "'"//path// &
                "' is no share of a map or of a list of starts: basin and points with --shard I/N write them")
    end if
    if (.not. allocated(error)) call reader%text_attribute('/', 'kind', kind, error)
    if (.not. allocated(error)) call reader%text_attribute('/provenance', 'version', made_by, error)
    if (.not. allocated(error)) call reader%number_attribute('/', 'format_version', format, error)
    allocate (catalogue(0))
    if (.not. allocated(error)) then
      if (kind == 'basin') call reader%read_values(catalogue_dataset, catalogue, error)
    end if
    if (.not. allocated(error) .and. is_first) then
      call reader%read_text('/provenance/case_text', shares%case_text, error)
      if (.not. allocated(error)) call reader%read_text('/provenance/resolved_case', shares%resolved_case, error)
      if (.not. allocated(error)) shares%kind = kind
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
    if (made_by /= version) then
      call fail(error, exit_other_case, "'"//path//"' was made by version "//made_by//', this is '//version)
    else if (nint(format) /= format_version) then
      call fail(error, exit_other_case, "'"//path//"' was begun in format version "//to_text(nint(format))// &
                ', this program writes '//to_text(format_version)//': the program that began it finishes it')
    else if (kind /= shares%kind) then
      call fail(error, exit_other_case, "'"//path//"' belongs to another case: it was made by "//kind//', the first share by '// &
                shares%kind)
    else if (.not. same(catalogue, shares%catalogue)) then
      call fail(error, exit_other_case, "'"//path// &
                "' belongs to another case, or was made by another version: its catalogue differs from the first share's")
    end if
  end subroutine read_share

  pure logical function same(one, other)
    real(wp), intent(in) :: one(:), other(:)
    same = size(one) == size(other)
    if (same) same = all(transfer(one, [0_int64]) == transfer(other, [0_int64]))
  end function same

  !> The catalogues of all slices that a share of the same map has found, as `pack_catalogues` makes them. Code 65 if the
  !> file is no share of a map, 76 if it is of another case or version than `identity` and this program.
  subroutine read_catalogue(path, identity, packed, error)
    character(len=*), intent(in) :: path, identity
    real(wp), allocatable, intent(out) :: packed(:)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(reader_t) :: reader
    character(len=:), allocatable :: found, made_by
    allocate (packed(0))
    call open_final(path, reader, error)
    if (allocated(error)) return
    if (.not. reader%has(catalogue_dataset)) then
      call fail(error, exit_bad_case, "'"//path//"' is no share of a map: basin --shard I/N writes them")
    else
      call reader%text_attribute('/provenance', 'case_identity', found, error)
      if (.not. allocated(error)) call reader%text_attribute('/provenance', 'version', made_by, error)
    end if
    if (.not. allocated(error)) then
      if (found /= identity .or. made_by /= version) call fail(error, exit_other_case, "'"//path// &
        "' belongs to another case, or was made by another version; its catalogue is not that of this map")
    end if
    if (.not. allocated(error)) call reader%read_values(catalogue_dataset, packed, error)
    call reader%close(ignored)
  end subroutine read_catalogue

  !> Names the builds other than this one that made shares, in the log and in the file.
  subroutine note_builds(session, shares, schema, error)
    type(session_t), intent(inout) :: session
    type(shares_t), intent(in) :: shares
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(reader_t) :: reader
    character(len=:), allocatable :: builder, builders
    integer :: i
    builders = ''
    do i = 1, shares%count
      call open_final(trim(shares%files(i)), reader, error)
      if (allocated(error)) return
      call read_builder(reader, builder, error)
      call reader%close(ignored)
      if (allocated(error)) return
      if (builder == builder_of(session) .or. index(builders, builder) > 0) cycle
      builders = builders//builder//new_line('a')
      call session%journal%line('build', "'"//trim(shares%files(i))//"' was made by another build: "//builder)
    end do
    if (len(builders) > 0) call schema%add_attribute('provenance', 'other_builds', builders(:len(builders) - 1))
  end subroutine note_builds

  !> Copies the tiles of the shares into the new working file of `path`, counted by `work`. Ends the program on errors.
  subroutine join_shares(session, shares, path, schema, grid, tile, work, file)
    type(session_t), intent(inout) :: session
    type(shares_t), intent(in) :: shares
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer, intent(in) :: tile(:)
    class(point_work_t), intent(inout) :: work
    type(map_file_t), intent(out) :: file
    type(map_file_t), allocatable :: parts(:)
    type(error_t), allocatable :: error
    call open_parts(shares, session, schema, grid, tile, parts, error)
    call session%stop_if(error)
    call create_working(path, schema, grid, int(tile, int64), session%command%force, session%team, file, error)
    call session%stop_if(error)
    call session%journal%begin('tiles', int(file%tile_count(), int64), 0_int64)
    call copy_tiles(session, shares%count, parts, file, work, error)
    call session%stop_if(error)
  end subroutine join_shares

  !> Opens the shares, only to be read, which checks case, layout and every tile.
  subroutine open_parts(shares, session, schema, grid, tile, parts, error)
    type(shares_t), intent(in) :: shares
    type(session_t), intent(in) :: session
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer, intent(in) :: tile(:)
    type(map_file_t), allocatable, intent(out) :: parts(:)
    type(error_t), allocatable, intent(out) :: error
    type(schema_t) :: of_share
    character(len=:), allocatable :: path
    integer :: i, k, left
    allocate (parts(shares%count))
    do i = 1, shares%count
      path = trim(shares%files(i))
      if (len(path) <= len('.part') .or. index(path, '.part', back=.true.) /= len(path) - len('.part') + 1) then
        call fail(error, exit_bad_case, "'"//path//"': the name of a share ends in .part")
        return
      end if
      of_share = schema
      if (shares%kind == 'basin') then
        call describe_shard(i, shares%count, of_share, shares%catalogue)
      else
        call describe_shard(i, shares%count, of_share)
      end if
      call open_working(path(:len(path) - len('.part')), of_share, grid, int(tile, int64), session%team, parts(i), error, &
                        only_read=.true.)
      if (allocated(error)) return
      left = count([(in_shard(k, i, shares%count) .and. .not. parts(i)%tile_done(k), k=1, parts(i)%tile_count())])
      if (left == 0) cycle
      call fail(error, exit_resumable, 'share '//to_text(i)//' of '//to_text(shares%count)//" in '"//path//"' has "// &
        to_text(left)//' tiles that are not done or damaged; '//shares%kind//' with --shard '//to_text(i)//'/'// &
        to_text(shares%count)//' --resume computes them')
      return
    end do
  end subroutine open_parts

  subroutine copy_tiles(session, count, parts, file, work, error)
    type(session_t), intent(inout) :: session
    integer, intent(in) :: count
    type(map_file_t), intent(inout) :: parts(:), file
    class(point_work_t), intent(inout) :: work
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:, :)
    integer(int64) :: lower(size(file%tiling%lengths)), extent(size(file%tiling%lengths))
    integer :: tile, i, point
    do tile = 1, file%tile_count()
      i = share_of(tile, count)
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

end module share_files
