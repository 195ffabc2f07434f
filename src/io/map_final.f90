! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The final file: compressed, with a checksum per dataset, independent of tiles and ranks. Under
!> its own name it exists only complete and verified.
module map_final
  use attribute_seal, only: seal_attributes
  use errors, only: error_t, fail
  use files, only: publish_file, remove_file
  use h5, only: h5_close, h5_close_dataset, h5_create, h5_dataset_t, h5_file_t, h5_open, h5_open_dataset, h5_read, h5_write
  use h5_attributes, only: h5_put_numbers
  use kinds, only: int64, int8, real64
  use map_file, only: map_file_t, working_path
  use map_layout, only: create_objects, is_compressed, path_of, write_data
  use map_packing, only: packing_t
  use map_schema, only: schema_t, type_int64
  use map_verify, only: seal, verify_file
  use output_check, only: check_result
  use slabs, only: slab, slab_count
  use status, only: exit_io, exit_resumable
  use system, only: monotonic_seconds
  use team, only: team_t
  use text, only: to_text
  use value_types, only: bytes_of
  implicit none
  private

  public :: finalise, write_whole

  !> Longest path of a variable.
  integer, parameter :: path_length = 128

contains

  !> Turns the working file, all of whose tiles are done, into the final file. Collective; the file is
  !> closed afterwards. `extra`: what is known only now, as summary tables; its attributes replace
  !> those of the same name. Code 75 if tiles are missing, 74 if the disk fails or data is damaged
  !> (then the working file can be resumed). `alone`: seconds in which rank 0 worked and the others waited.
  subroutine finalise(file, team, extra, error, alone)
    type(map_file_t), intent(inout) :: file
    class(team_t), intent(in) :: team
    type(schema_t), intent(in) :: extra
    type(error_t), allocatable, intent(out) :: error
    real(real64), intent(out), optional :: alone
    real(real64) :: waited
    integer :: mismatches, tile, left
    if (present(alone)) alone = 0
    ! Closed and opened again so that each rank sees what the others wrote.
    call file%close(team, error)
    if (.not. allocated(error)) call file%open(team, error)
    if (.not. allocated(error)) call file%recheck(team, mismatches, error)
    if (.not. allocated(error)) call file%close(team, error)
    if (allocated(error)) return
    left = count([(.not. file%tile_done(tile), tile=1, file%tile_count())])
    if (mismatches > 0) then
      call fail(error, exit_io, to_text(mismatches)//' tiles of '''//working_path(file%path)// &
                ''' do not match their checksums; --resume computes them again')
    else if (left > 0) then
      call fail(error, exit_resumable, to_text(left)//' tiles of '''//working_path(file%path)//''' are not done')
    end if
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
    type(h5_file_t) :: part, new
    type(schema_t) :: schema
    type(packing_t) :: packing
    integer, allocatable :: picks(:)
    character(len=:), allocatable :: name
    alone = -monotonic_seconds()
    name = file%path//'.new'
    schema = file%schema
    call schema%append(extra)
    call start_packing(file, packing, picks)
    if (team%is_root()) then
      call h5_open(working_path(file%path), part, error)
      if (.not. allocated(error)) call create(name, schema, new, error)
    end if
    call team%agree(error)
    alone = alone + monotonic_seconds()
    if (.not. allocated(error)) then
      call file%store%open(working_path(file%path), error)
      call team%agree(error)
      if (.not. allocated(error)) call packing%pack(file%store, picks, name, new, team, error)
      call file%store%close()
    end if
    alone = alone + packing%alone - monotonic_seconds()
    if (team%is_root()) then
      if (.not. allocated(error)) call fill(new, schema, error, part, size(file%schema%variables), packing)
      call complete(new, error)
      call h5_close(part, ignored)
    end if
    call team%agree(error)
    alone = alone + monotonic_seconds()
    if (.not. allocated(error)) call packing%check(name, error)
    call team%agree(error)
    alone = alone - monotonic_seconds()
    if (team%is_root()) call publish(name, file%path, error, packing%names)
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

  !> What is to be packed by all ranks, and the numbers of its variables among the tiled ones.
  subroutine start_packing(file, packing, picks)
    type(map_file_t), intent(in) :: file
    type(packing_t), intent(out) :: packing
    integer, allocatable, intent(out) :: picks(:)
    character(len=path_length) :: names(size(file%tiled))
    integer :: types(size(file%tiled)), i
    do i = 1, size(file%tiled)
      associate (variable => file%schema%variables(file%tiled(i)))
        names(i) = path_of(variable%group, variable%name)
        types(i) = variable%type
      end associate
    end do
    allocate (picks(0))
    if (is_compressed(file%tiling%lengths)) picks = [(i, i=1, size(types))]
    call packing%begin(names(picks), types(picks), file%tiling%lengths)
  end subroutine start_packing

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
    if (.not. allocated(error)) call fill(new, whole, error)
    call complete(new, error)
    call publish(path//'.new', path, error)
  end subroutine write_whole

  !> A new file with all objects, without data.
  subroutine create(name, schema, new, error)
    character(len=*), intent(in) :: name
    type(schema_t), intent(in) :: schema
    type(h5_file_t), intent(out) :: new
    type(error_t), allocatable, intent(out) :: error
    call h5_create(name, new, error)
    if (.not. allocated(error)) call create_objects(new, schema, error)
  end subroutine create

  !> Marks the file as complete, unless there is an error, and closes it.
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
  end subroutine complete

  !> Reads a file back, but for the datasets `checked`, and gives it its name; removes it where there is an error.
  subroutine publish(name, path, error, checked)
    character(len=*), intent(in) :: name, path
    type(error_t), allocatable, intent(inout) :: error
    character(len=*), intent(in), optional :: checked(:)
    type(error_t), allocatable :: ignored
    if (.not. allocated(error)) call verify_file(name, error, skipped=checked)
    if (.not. allocated(error)) call publish_file(name, path, error)
    if (allocated(error)) call remove_file(name, ignored)
  end subroutine publish

  !> The data of the variables. The tiled ones among the first `copied` come from the working file: `packing` has packed the
  !> large ones. The others come from the schema.
  subroutine fill(new, schema, error, part, copied, packing)
    type(h5_file_t), intent(in) :: new
    type(schema_t), intent(in) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(h5_file_t), intent(in), optional :: part
    integer, intent(in), optional :: copied
    type(packing_t), intent(in), optional :: packing
    character(len=:), allocatable :: path
    integer :: i, from_part, packed
    from_part = 0
    if (present(copied)) from_part = copied
    do i = 1, size(schema%variables)
      path = path_of(schema%variables(i)%group, schema%variables(i)%name)
      packed = 0
      if (present(packing)) packed = findloc(packing%names == path, .true., dim=1)
      ! What the case alone decides is not taken from a file that may be damaged.
      if (packed > 0) then
        call seal(new, path, error, packing%checksums(packed))
      else if (i <= from_part .and. (schema%variables(i)%tiled .or. schema%variables(i)%group == 'tiles')) then
        call copy(part, new, path, error)
      else
        call write_data(new, schema, schema%variables(i), error)
      end if
      if (packed == 0 .and. .not. allocated(error)) call seal(new, path, error)
      if (allocated(error)) return
    end do
  end subroutine fill

  !> Copies a dataset slab by slab.
  subroutine copy(part, new, name, error)
    type(h5_file_t), intent(in) :: part, new
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: from, to
    call h5_open_dataset(part, name, from, error)
    if (.not. allocated(error)) call h5_open_dataset(new, name, to, error)
    if (.not. allocated(error)) call copy_values(from, to, error)
    if (.not. allocated(error)) call h5_close_dataset(to, error)
    if (.not. allocated(error)) call h5_close_dataset(from, error)
  end subroutine copy

  subroutine copy_values(from, to, error)
    type(h5_dataset_t), intent(in) :: from, to
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: lower(size(from%lengths)), extent(size(from%lengths)), k
    if (size(from%lengths) == 0) then
      allocate (bytes(bytes_of(from%type)))
      call h5_read(from, bytes, error)
      if (.not. allocated(error)) call h5_write(to, bytes, error)
    else
      do k = 1, slab_count(from%lengths)
        call slab(from%lengths, k, lower, extent)
        if (allocated(bytes)) deallocate (bytes)
        allocate (bytes(product(extent)*bytes_of(from%type)))
        call h5_read(from, bytes, error, lower, extent)
        if (.not. allocated(error)) call h5_write(to, bytes, error, lower, extent)
        if (allocated(error)) return
      end do
    end if
  end subroutine copy_values

end module map_final
