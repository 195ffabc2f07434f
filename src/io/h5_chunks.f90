! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Chunks as they lie in the file, past HDF5's filters. A chunk is named by its corner, from 0, in C order. Errors have code
!> 74.
module h5_chunks
  use, intrinsic :: iso_c_binding, only: c_int, c_int32_t, c_int64_t, c_loc, c_ptr, c_size_t
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5, only: h5_dataset_t, h5_failed, h5_file_t
  use h5_trap, only: trap
  use hdf5, only: h5fget_filesize_f, H5P_DEFAULT_F, hsize_t
  use kinds, only: int64, int8
  use status, only: exit_io
  implicit none
  private

  public :: h5_reserve_chunk, h5_read_chunk

  interface
    ! HDF5's Fortran interface lacks these.
    integer(c_int) function write_chunk(dataset, access, filters, corner, size, bytes) bind(c, name='H5Dwrite_chunk')
      import :: c_int, c_int32_t, c_int64_t, c_ptr, c_size_t
      integer(c_int64_t), value :: dataset, access
      integer(c_int32_t), value :: filters
      integer(c_size_t), value :: size
      type(c_ptr), value :: corner, bytes
    end function write_chunk

    integer(c_int) function read_chunk(dataset, access, corner, filters, bytes) bind(c, name='H5Dread_chunk')
      import :: c_int, c_int32_t, c_int64_t, c_ptr
      integer(c_int64_t), value :: dataset, access
      integer(c_int32_t), intent(out) :: filters
      type(c_ptr), value :: corner, bytes
    end function read_chunk

    integer(c_int) function chunk_size(dataset, corner, size) bind(c, name='H5Dget_chunk_storage_size')
      import :: c_int, c_int64_t, c_ptr
      integer(c_int64_t), value :: dataset
      type(c_ptr), value :: corner
      integer(c_int64_t), intent(out) :: size
    end function chunk_size

    integer(c_int) function chunk_info(dataset, corner, filters, offset, size) bind(c, name='H5Dget_chunk_info_by_coord')
      import :: c_int, c_int32_t, c_int64_t, c_ptr
      integer(c_int64_t), value :: dataset
      type(c_ptr), value :: corner
      integer(c_int32_t), intent(out) :: filters
      integer(c_int64_t), intent(out) :: offset, size
    end function chunk_info
  end interface

contains

  !> Where in the file a chunk begins. HDF5 1.10 looks at all chunks before it.
  subroutine h5_chunk_offset(dataset, corner, offset, error)
    type(h5_dataset_t), intent(in) :: dataset
    integer(int64), intent(in), contiguous, target :: corner(:)
    integer(int64), intent(out) :: offset
    type(error_t), allocatable, intent(out) :: error
    integer(c_int32_t) :: filters
    integer(c_int64_t) :: bytes
    integer :: status
    call trap(dataset%name, dataset%path, endless=.true.)
    status = chunk_info(dataset%id, c_loc(corner), filters, offset, bytes)
    call end_guard()
    if (status >= 0 .and. bytes == 0) status = -1
    if (h5_failed(status, 'find a chunk of', dataset%name, dataset%path, error)) return
  end subroutine h5_chunk_offset

  !> Takes the space of a chunk that no one has written yet, by writing these bytes into it, as they are, and returns its offset.
  subroutine h5_reserve_chunk(file, dataset, corner, bytes, offset, error)
    type(h5_file_t), intent(in) :: file
    type(h5_dataset_t), intent(in) :: dataset
    integer(int64), intent(in), contiguous, target :: corner(:)
    integer(int8), intent(in), contiguous, target :: bytes(:)
    integer(int64), intent(out) :: offset
    type(error_t), allocatable, intent(out) :: error
    integer(hsize_t) :: before, after
    integer(int64) :: gap
    integer :: status
    offset = 0
    call h5fget_filesize_f(file%id, before, status)
    if (status >= 0) status = write_chunk(dataset%id, H5P_DEFAULT_F, 0_c_int32_t, c_loc(corner), size(bytes, kind=c_size_t), &
                                              c_loc(bytes))
    if (status >= 0) call h5fget_filesize_f(file%id, after, status)
    if (h5_failed(status, 'write', dataset%name, dataset%path, error)) return
    gap = 0
    if (size(bytes) >= file%alignment) gap = modulo(-before, file%alignment)
    if (after - before == gap + size(bytes)) then
      ! The file has grown by just that. Asking would take longer with every chunk.
      offset = before + gap
    else
      call h5_chunk_offset(dataset, corner, offset, error)
    end if
  end subroutine h5_reserve_chunk

  !> Reads a chunk that has just as many bytes, all filters applied.
  subroutine h5_read_chunk(dataset, corner, bytes, error)
    type(h5_dataset_t), intent(in) :: dataset
    integer(int64), intent(in), contiguous, target :: corner(:)
    integer(int8), intent(out), contiguous, target :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(c_int32_t) :: filters
    integer(c_int64_t) :: stored
    integer :: status
    type(c_ptr) :: address
    address = c_loc(bytes)
    filters = 0
    call trap(dataset%name, dataset%path, endless=.true.)
    status = chunk_size(dataset%id, c_loc(corner), stored)
    if (status >= 0 .and. stored == size(bytes)) status = read_chunk(dataset%id, H5P_DEFAULT_F, c_loc(corner), filters, address)
    call end_guard()
    if (h5_failed(status, 'read', dataset%name, dataset%path, error)) return
    if (stored /= size(bytes) .or. filters /= 0) then
      call fail(error, exit_io, 'a chunk of '''//dataset%name//''' of '''//dataset%path//''' is not as it was written')
    end if
  end subroutine h5_read_chunk

end module h5_chunks
