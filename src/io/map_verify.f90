! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Checksums of datasets: computed, written, verified.
module map_verify
  use attribute_seal, only: is_sealed, verify_attributes
  use checksum, only: crc32, crc32_text
  use errors, only: error_t, fail
  use files, only: is_special
  use guard, only: end_guard
  use h5, only: h5_close, h5_close_dataset, h5_dataset_t, h5_file_t, h5_open, h5_open_dataset, h5_read
  use h5_attributes, only: h5_get_numbers, h5_has_attribute, h5_put_numbers, h5_read_strings
  use h5_stored, only: h5_check_stored, h5_count_filters
  use h5_list, only: h5_children
  use h5_trap, only: trap
  use kinds, only: int64, int8, real64
  use map_layout, only: path_of
  use slabs, only: slab, slab_count
  use status, only: exit_io
  use system, only: exit_at_once, fork_process, has_crashed
  use tile_damage, only: damaged_tiles
  use value_types, only: bytes_of, type_string, type_uint32
  implicit none
  private

  public :: seal, verify_file, verify_plain, probe_file

contains

  !> The CRC-32 of a dataset: of the bytes of its values in C order; of strings, each followed by a
  !> zero byte.
  subroutine dataset_checksum(file, name, value, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer(int64), intent(out) :: value
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    character(len=:), allocatable :: strings(:)
    integer :: i
    value = 0
    call h5_open_dataset(file, name, dataset, error)
    if (allocated(error)) return
    if (dataset%type == type_string) then
      call h5_read_strings(dataset, strings, error)
      if (allocated(error)) return
      do i = 1, size(strings)
        value = crc32_text(trim(strings(i))//achar(0), value)
      end do
    else
      call h5_check_stored(dataset, error)
      if (.not. allocated(error)) call checksum_of_slabs(dataset, value, error)
      if (allocated(error)) return
    end if
    call h5_close_dataset(dataset, error)
  end subroutine dataset_checksum

  subroutine checksum_of_slabs(dataset, value, error)
    type(h5_dataset_t), intent(in) :: dataset
    integer(int64), intent(inout) :: value
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: lower(size(dataset%lengths)), extent(size(dataset%lengths)), k
    if (size(dataset%lengths) == 0) then
      allocate (bytes(bytes_of(dataset%type)))
      call h5_read(dataset, bytes, error)
      if (.not. allocated(error)) value = crc32(bytes, value)
      return
    end if
    do k = 1, slab_count(dataset%lengths)
      call slab(dataset%lengths, k, lower, extent)
      if (allocated(bytes)) deallocate (bytes)
      allocate (bytes(product(extent)*bytes_of(dataset%type)))
      call h5_read(dataset, bytes, error, lower, extent)
      if (allocated(error)) return
      value = crc32(bytes, value)
    end do
  end subroutine checksum_of_slabs

  !> Gives a dataset the attribute `checksum`. `known`: the checksum of what was to be written; else what is there is read.
  subroutine seal(file, name, error, known)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    integer(int64), intent(in), optional :: known
    integer(int64) :: value
    if (present(known)) then
      value = known
    else
      call dataset_checksum(file, name, value, error)
      if (allocated(error)) return
    end if
    call h5_put_numbers(file, name, 'checksum', type_uint32, [real(value, real64)], error)
  end subroutine seal

  !> Reads a final file whole. Code 74, naming the dataset and the tiles, if it is not complete or a checksum is
  !> wrong. `count`: datasets verified. `skipped`: paths of datasets that are not read.
  subroutine verify_file(path, error, count, skipped)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    integer, intent(out), optional :: count
    character(len=*), intent(in), optional :: skipped(:)
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: file
    real(real64), allocatable :: complete(:)
    integer :: verified
    verified = 0
    call h5_open(path, file, error)
    if (allocated(error)) return
    call h5_get_numbers(file, '/', 'complete', complete, error)
    if (.not. allocated(error)) then
      if (size(complete) /= 1) then
        call fail(error, exit_io, 'attribute ''complete'' of '''//path//''' is not one number')
      else if (.not. abs(complete(1) - 1) <= 0) then
        call fail(error, exit_io, ''''//path//''' is not complete')
      end if
    end if
    if (.not. allocated(error)) then
      call verify_group(file, '', verified, error, skipped)
      if (allocated(error)) error%message = error%message//damaged_tiles(file)
    end if
    if (.not. allocated(error)) call verify_attributes(file, error)
    call trap('its end', path, endless=.true.)
    call h5_close(file, ignored)
    call end_guard()
    if (present(count)) count = verified
  end subroutine verify_file

  !> Code 74 if an attribute, or a dataset that is stored without compression, is damaged. HDF5 notices damage of compressed values
  !> itself, when they are read. An incomplete file has no checksums yet and passes.
  subroutine verify_plain(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: file
    integer :: verified
    verified = 0
    call h5_open(path, file, error)
    if (allocated(error)) return
    call verify_attributes(file, error)
    if (.not. allocated(error)) call verify_group(file, '', verified, error, plain=.true.)
    if (.not. allocated(error) .and. verified > 0) call check_sealed(file, error)
    call trap('its end', path, endless=.true.)
    call h5_close(file, ignored)
    call end_guard()
  end subroutine verify_plain

  !> Code 74 if a file with checksums of its datasets lacks that of its attributes, which files of version 1 need not have.
  subroutine check_sealed(file, error)
    type(h5_file_t), intent(in) :: file
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: version(:)
    if (is_sealed(file)) return
    call h5_get_numbers(file, '/', 'format_version', version, error)
    if (allocated(error)) return
    if (any(version >= 2)) call fail(error, exit_io, "'"//file%path//"' is damaged: the checksum of its attributes is missing")
  end subroutine check_sealed

  !> Reads all texts of a file in a process of its own: HDF5 1.10 itself breaks on some damaged ones, and may spoil the
  !> memory before it does. Code 74 then. Not for a process that uses MPI.
  subroutine probe_file(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: found
    type(h5_file_t) :: file
    integer :: process, verified
    logical :: crashed
    ! A pipe would wait for its writer; open_reader reports what it is.
    if (is_special(path)) return
    process = fork_process()
    if (process == 0) then
      verified = 0
      call h5_open(path, file, found)
      if (.not. allocated(found)) call verify_attributes(file, found)
      if (.not. allocated(found)) call verify_group(file, 'provenance', verified, found)
      call exit_at_once(0)
    end if
    if (process < 0) return
    crashed = has_crashed(process)
    if (crashed) call fail(error, exit_io, "'"//path//"' is damaged: reading its texts breaks the HDF5 library")
  end subroutine probe_file

  !> `plain`: only datasets without compression.
  recursive subroutine verify_group(file, group, verified, error, skipped, plain)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: group
    integer, intent(inout) :: verified
    type(error_t), allocatable, intent(out) :: error
    character(len=*), intent(in), optional :: skipped(:)
    logical, intent(in), optional :: plain
    character(len=:), allocatable :: names(:), path
    logical :: compressed
    logical, allocatable :: are_groups(:)
    integer :: i
    call h5_children(file, '/'//group, names, are_groups, error)
    if (allocated(error)) return
    do i = 1, size(names)
      path = path_of(group, trim(names(i)))
      if (present(skipped)) then
        if (any(skipped == path)) cycle
      end if
      if (are_groups(i)) then
        call verify_group(file, path(2:), verified, error, skipped, plain)
      else if (h5_has_attribute(file, path, 'checksum')) then
        compressed = .false.
        if (present(plain)) call find_compression(file, path, compressed, error)
        if (.not. (compressed .or. allocated(error))) call verify_dataset(file, path, error)
        verified = verified + 1
      end if
      if (allocated(error)) return
    end do
  end subroutine verify_group

  subroutine find_compression(file, name, compressed, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    logical, intent(out) :: compressed
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_dataset_t) :: dataset
    integer :: filters
    filters = 0
    call h5_open_dataset(file, name, dataset, error)
    if (.not. allocated(error)) call h5_count_filters(dataset, filters, error)
    call h5_close_dataset(dataset, ignored)
    compressed = filters > 0
  end subroutine find_compression

  subroutine verify_dataset(file, name, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: expected(:)
    integer(int64) :: found
    call h5_get_numbers(file, name, 'checksum', expected, error)
    if (allocated(error)) return
    call dataset_checksum(file, name, found, error)
    if (allocated(error)) return
    if (size(expected) /= 1) then
      call fail(error, exit_io, 'attribute ''checksum'' of '''//name//''' in '''//file%path//''' is not one number')
    else if (.not. abs(expected(1) - real(found, real64)) <= 0) then
      call fail(error, exit_io, 'dataset '''//name//''' of '''//file%path//''' does not match its checksum')
    end if
  end subroutine verify_dataset

end module map_verify
