! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The final file: compressed, with a checksum per dataset, independent of tiles and ranks. Under
!> its own name it exists only complete and verified.
module map_final
  use attribute_seal, only: seal_attributes
  use byte_file, only: byte_file_t
  use checksum, only: crc32
  use errors, only: error_t, fail
  use files, only: publish_file, remove_file
  use guard, only: hold_guard, release_guard
  use h5, only: h5_close, h5_close_dataset, h5_create, h5_dataset_t, h5_file_t, h5_open_dataset, h5_write
  use h5_attributes, only: h5_put_numbers
  use kinds, only: int64, real64
  use map_file, only: map_file_t, working_path
  use map_layout, only: create_objects, is_compressed, path_of, write_data
  use map_packing, only: packing_t
  use map_schema, only: schema_t, type_int64, type_int8
  use map_verify, only: seal, verify_file
  use output_check, only: check_result
  use status, only: exit_io, exit_resumable
  use system, only: monotonic_seconds
  use team, only: team_t
  use text, only: to_text
  use tile_record, only: values_t
  use tile_store, only: tile_damaged, tile_whole
  use value_types, only: bytes_of, type_uint32
  implicit none
  private

  public :: finalise, write_whole

contains

  !> Turns the working file, all of whose tiles are done, into the final file. Collective; the file is closed afterwards. `extra`:
  !> what is known only now, as summary tables; its attributes replace those of the same name. Code 75 if tiles are missing, 74 if
  !> the disk fails or data is damaged (then the working file can be resumed). `alone`: seconds in which rank 0 worked and the
  !> others waited.
  subroutine finalise(file, team, extra, error, alone)
    type(map_file_t), intent(inout) :: file
    class(team_t), intent(in) :: team
    type(schema_t), intent(in) :: extra
    type(error_t), allocatable, intent(out) :: error
    real(real64), intent(out), optional :: alone
    real(real64) :: waited
    integer :: left
    if (present(alone)) alone = 0
    if (team%is_root()) call file%check(error)
    call team%agree(error)
    if (allocated(error)) return
    left = file%count_left(team)
    call file%close(team, error)
    if (.not. allocated(error) .and. left > 0) call fail(error, exit_resumable, to_text(left)//' tiles of '''// &
                                                           working_path(file%path)//''' are not done')
    if (allocated(error)) return
    call repack(file, team, extra, waited, error)
    if (present(alone)) alone = waited
  end subroutine finalise

  !> Rank 0 makes the file and all that is small in it; the data of the tiles is packed, and checked, by all.
  subroutine repack(file, team, extra, alone, error)
    type(map_file_t), intent(inout) :: file
    class(team_t), intent(in) :: team
    type(schema_t), intent(in) :: extra
    real(real64), intent(out) :: alone
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: new
    type(schema_t) :: schema
    type(packing_t) :: packing
    character(len=:), allocatable :: name
    alone = -monotonic_seconds()
    name = file%path//'.new'
    schema = whole_schema(file, extra)
    call packing%begin(file%names(), file%types(), file%tiling%lengths, file%tile_count())
    if (team%is_root()) call create(name, schema, new, error)
    ! A rank without a slab opens, and syncs, nothing.
    if (packing%has_slab(team%rank()) .and. .not. allocated(error)) call file%store%open(working_path(file%path), .true., error)
    call team%agree(error)
    alone = alone + monotonic_seconds()
    if (.not. allocated(error)) then
      if (is_compressed(file%tiling%lengths)) then
        call packing%pack(file%store, name, new, team, error)
      else if (team%is_root()) then
        call copy_values(file, packing, new, error)
      end if
      call check_tiles(file, packing, team, error)
    end if
    call file%store%close(ignored)
    alone = alone + packing%alone - monotonic_seconds()
    ! The others sync what they have written meanwhile.
    call packing%finish(.not. team%is_root(), error)
    if (team%is_root()) then
      call hold_guard()
      if (.not. allocated(error)) call fill(new, schema, error, packing)
      call complete(new, error)
    end if
    alone = alone + monotonic_seconds()
    call team%agree(error)
    if (.not. allocated(error)) call read_back(name, packing, team, error)
    alone = alone - monotonic_seconds()
    if (team%is_root()) call publish(name, file%path, error)
    call team%agree(error)
    alone = alone + monotonic_seconds()
    if (allocated(error)) then
      error%code = exit_io
      error%message = error%message//'; '''//working_path(file%path)//''' is complete, --resume tries again'
      return
    end if
    if (team%is_root()) call remove_file(working_path(file%path), error)
    call team%agree(error)
  end subroutine repack

  !> Reads the file back: all ranks what was packed, the last one the rest, while the first one syncs it. Collective.
  subroutine read_back(name, packing, team, error)
    character(len=*), intent(in) :: name
    type(packing_t), intent(in) :: packing
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(byte_file_t) :: bytes
    call packing%check(name, error)
    if (allocated(error)) then
      continue
    else if (team%rank() == team%size() - 1) then
      call verify_held(name, error, packing%checked_names())
    else if (team%is_root()) then
      call bytes%open(name, .true., error)
      if (.not. allocated(error)) call bytes%close(error, durable=.true.)
    end if
    call team%agree(error)
  end subroutine read_back

  subroutine verify_held(name, error, skipped)
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    character(len=*), intent(in), optional :: skipped(:)
    call hold_guard()
    call verify_file(name, error, skipped=skipped)
    call release_guard()
  end subroutine verify_held

  !> The schema of the final file.
  function whole_schema(file, extra) result(schema)
    type(map_file_t), intent(in) :: file
    type(schema_t), intent(in) :: extra
    type(schema_t) :: schema
    schema = file%schema
    call schema%add_dimension('tile', int(file%tile_count(), int64))
    call schema%add_variable('state', type_int8, ['tile'], group='tiles', long_name='1 = the tile is done', flag_values=[0, 1], &
                             flag_meanings='not_done done')
    call schema%add_variable('checksum', type_uint32, ['tile'], group='tiles', &
                             long_name='CRC-32 of the data of the tile, variables in file order')
    call schema%append(extra)
  end function whole_schema

  !> Code 74 if the data of a tile does not match its checksum; the tile is marked as not done. Collective.
  subroutine check_tiles(file, packing, team, error)
    type(map_file_t), intent(in) :: file
    type(packing_t), intent(inout) :: packing
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(inout) :: error
    integer :: tile, damaged
    call team%agree(error)
    if (allocated(error)) return
    call team%sum(packing%states)
    call team%sum(packing%tile_checksums)
    damaged = count(packing%states /= tile_whole)
    if (damaged == 0) return
    do tile = 1, file%tile_count()
      if (packing%states(tile) == tile_damaged .and. team%is_root() .and. .not. allocated(error)) call file%store%drop(tile, error)
    end do
    call team%agree(error)
    if (allocated(error)) return
    call fail(error, exit_io, to_text(damaged)//' tiles of '''//working_path(file%path)// &
              ''' do not match their checksums; --resume computes them again')
  end subroutine check_tiles

  !> Writes a file that needs no working file, by one process. Code 73 if it exists and `force` is
  !> false.
  subroutine write_whole(path, schema, force, error)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    logical, intent(in) :: force
    type(error_t), allocatable, intent(out) :: error
    type(h5_file_t) :: new
    type(schema_t) :: whole, nothing
    call check_result(path, force, error)
    if (allocated(error)) return
    whole = schema
    call whole%append(nothing)
    call create(path//'.new', whole, new, error)
    call hold_guard()
    if (.not. allocated(error)) call fill(new, whole, error)
    call complete(new, error)
    if (.not. allocated(error)) call verify_held(path//'.new', error)
    call publish(path//'.new', path, error)
  end subroutine write_whole

  !> A new file with all objects, without data.
  subroutine create(name, schema, new, error)
    character(len=*), intent(in) :: name
    type(schema_t), intent(in) :: schema
    type(h5_file_t), intent(out) :: new
    type(error_t), allocatable, intent(out) :: error
    call hold_guard()
    call h5_create(name, new, error)
    if (.not. allocated(error)) call create_objects(new, schema, .false., error)
    call release_guard()
  end subroutine create

  !> Marks the file as complete, unless there is an error, and closes it. Ends the hold of the guard.
  subroutine complete(new, error)
    type(h5_file_t), intent(inout) :: new
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: ignored
    if (.not. allocated(error)) call h5_put_numbers(new, '/', 'complete', type_int64, [1.0_real64], error)
    if (.not. allocated(error)) call seal_attributes(new, error)
    if (allocated(error)) then
      call h5_close(new, ignored)
    else
      call h5_close(new, error)
    end if
    call release_guard()
  end subroutine complete

  !> Gives a file its name; removes it where there is an error.
  subroutine publish(name, path, error)
    character(len=*), intent(in) :: name, path
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: ignored
    if (.not. allocated(error)) call publish_file(name, path, error)
    if (allocated(error)) call remove_file(name, ignored)
  end subroutine publish

  !> The data of the variables: the tiled ones are there already, the others come from the schema.
  subroutine fill(new, schema, error, packing)
    type(h5_file_t), intent(in) :: new
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(packing_t), intent(in), optional :: packing
    character(len=:), allocatable :: path
    integer :: i, packed
    do i = 1, size(schema%variables)
      path = path_of(schema%variables(i)%group, schema%variables(i)%name)
      packed = 0
      if (present(packing)) then
        packed = findloc(packing%names == path, .true., dim=1)
        if (path == '/tiles/state') schema%variables(i)%data = real(packing%states, real64)
        if (path == '/tiles/checksum') schema%variables(i)%data = real(packing%tile_checksums, real64)
      end if
      if (packed > 0) then
        call seal(new, path, error, packing%checksums(packed))
      else
        call write_data(new, schema, schema%variables(i), error)
        if (.not. allocated(error)) call seal(new, path, error)
      end if
      if (allocated(error)) return
    end do
  end subroutine fill

  !> The tiled variables of a map that is too small to be packed.
  subroutine copy_values(file, packing, new, error)
    type(map_file_t), intent(in) :: file
    type(packing_t), intent(inout) :: packing
    type(h5_file_t), intent(in) :: new
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    type(values_t) :: values(size(packing%names))
    integer :: types(size(packing%names)), v
    types = file%types()
    associate (lengths => file%tiling%lengths)
      do v = 1, size(values)
        allocate (values(v)%bytes(product(lengths)*bytes_of(types(v))))
      end do
      call file%store%read_block(0*lengths, lengths, values, packing%states, packing%tile_checksums, error)
    end associate
    do v = 1, size(values)
      if (.not. allocated(error)) call h5_open_dataset(new, trim(packing%names(v)), dataset, error)
      if (.not. allocated(error)) call h5_write(dataset, values(v)%bytes, error)
      if (.not. allocated(error)) call h5_close_dataset(dataset, error)
      packing%checksums(v) = crc32(values(v)%bytes, 0_int64)
    end do
  end subroutine copy_values

end module map_final
