! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A dataset of records (a compound type) whose bytes are read and written past HDF5. Errors have code 74.
module h5_records
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5, only: h5_failed, h5_file_t
  use h5_trap, only: trap
  use h5_types, only: h5_type
  use hdf5, only: H5D_ALLOC_TIME_EARLY_F, H5D_FILL_TIME_NEVER_F, h5dclose_f, h5dcreate_f, h5dget_offset_f, h5dget_space_f, &
    h5dget_type_f, h5dopen_f, H5P_DATASET_CREATE_F, h5pclose_f, h5pcreate_f, h5pset_alloc_time_f, h5pset_fill_time_f, h5sclose_f, &
    h5screate_simple_f, h5sget_simple_extent_npoints_f, H5T_COMPOUND_F, h5tarray_create_f, h5tclose_f, h5tcreate_f, h5tequal_f, &
    h5tget_size_f, h5tinsert_f, hid_t, hsize_t, size_t
  use kinds, only: int64
  use status, only: exit_io, exit_other_case
  implicit none
  private

  public :: h5_create_records, h5_records_extent, h5_records_offset

  !> One record: names, types and first bytes of its members, the first `scalars` of them numbers, the others arrays of a shape (C
  !> order).
  type, public :: h5_record_t
    character(len=:), allocatable :: names(:)
    integer, allocatable :: types(:)
    integer(int64), allocatable :: begins(:), shape(:)
    integer :: scalars = 0
    integer(int64) :: bytes = 0
  end type h5_record_t

contains

  !> Creates a dataset of `count` records, all space allocated and nothing written.
  subroutine h5_create_records(file, name, record, count, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(h5_record_t), intent(in) :: record
    integer(int64), intent(in) :: count
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: type, space, creation, dataset
    integer :: status, ignored
    call record_type(record, type, status)
    if (status >= 0) call h5screate_simple_f(1, [int(count, hsize_t)], space, status)
    if (status >= 0) call h5pcreate_f(H5P_DATASET_CREATE_F, creation, status)
    if (status >= 0) call h5pset_fill_time_f(creation, H5D_FILL_TIME_NEVER_F, status)
    if (status >= 0) call h5pset_alloc_time_f(creation, H5D_ALLOC_TIME_EARLY_F, status)
    if (status >= 0) call h5dcreate_f(file%id, name, type, space, dataset, status, creation)
    if (h5_failed(status, 'create', name, file%path, error)) return
    call h5dclose_f(dataset, status)
    call h5pclose_f(creation, ignored)
    call h5sclose_f(space, ignored)
    call h5tclose_f(type, ignored)
    if (h5_failed(status, 'close', name, file%path, error)) return
  end subroutine h5_create_records

  subroutine record_type(record, type, status)
    type(h5_record_t), intent(in) :: record
    integer(hid_t), intent(out) :: type
    integer, intent(out) :: status
    integer(hid_t) :: member
    integer :: i, ignored
    call h5tcreate_f(H5T_COMPOUND_F, int(record%bytes, size_t), type, status)
    do i = 1, size(record%types)
      if (status < 0) return
      if (i <= record%scalars) then
        call h5tinsert_f(type, trim(record%names(i)), int(record%begins(i), size_t), h5_type(record%types(i)), status)
      else
        associate (shape => record%shape)
          call h5tarray_create_f(h5_type(record%types(i)), size(shape), int(shape(size(shape):1:-1), hsize_t), member, status)
        end associate
        if (status >= 0) call h5tinsert_f(type, trim(record%names(i)), int(record%begins(i), size_t), member, status)
        if (status >= 0) call h5tclose_f(member, ignored)
      end if
    end do
  end subroutine record_type

  !> Where in the file the first record begins. Code 76 if the dataset has other records, or another number of them.
  subroutine h5_records_offset(file, name, record, count, offset, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(h5_record_t), intent(in) :: record
    integer(int64), intent(in) :: count
    integer(int64), intent(out) :: offset
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, space, type, expected
    integer(hsize_t) :: points
    integer :: status, ignored
    logical :: equal
    offset = -1
    equal = .false.
    points = -1
    call trap(name, file%path, endless=.true.)
    call h5dopen_f(file%id, name, dataset, status)
    if (status >= 0) call h5dget_space_f(dataset, space, status)
    if (status >= 0) call h5sget_simple_extent_npoints_f(space, points, status)
    if (status >= 0) call h5dget_type_f(dataset, type, status)
    if (status >= 0) call h5dget_offset_f(dataset, offset, status)
    if (status >= 0) call record_type(record, expected, status)
    if (status >= 0) call h5tequal_f(type, expected, equal, status)
    call end_guard()
    if (h5_failed(status, 'open', name, file%path, error)) return
    call h5tclose_f(expected, ignored)
    call h5tclose_f(type, ignored)
    call h5sclose_f(space, ignored)
    call h5dclose_f(dataset, ignored)
    if (.not. equal .or. points /= count) then
      call fail(error, exit_other_case, ''''//file%path//''' has another layout ('//name//')')
    else if (offset <= 0) then
      call fail(error, exit_io, ''''//file%path//''' has no space for '''//name//'''')
    end if
  end subroutine h5_records_offset

  !> Where in a file the first record of a dataset begins, the bytes of one, and their number.
  subroutine h5_records_extent(file, name, offset, bytes, count, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer(int64), intent(out) :: offset, bytes, count
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: dataset, space, type
    integer(hsize_t) :: points
    integer(size_t) :: size_of_type
    integer :: status, ignored
    call trap(name, file%path, endless=.true.)
    call h5dopen_f(file%id, name, dataset, status)
    if (status >= 0) call h5dget_space_f(dataset, space, status)
    if (status >= 0) call h5sget_simple_extent_npoints_f(space, points, status)
    if (status >= 0) call h5dget_type_f(dataset, type, status)
    if (status >= 0) call h5tget_size_f(type, size_of_type, status)
    if (status >= 0) call h5dget_offset_f(dataset, offset, status)
    call end_guard()
    if (h5_failed(status, 'open', name, file%path, error)) return
    call h5tclose_f(type, ignored)
    call h5sclose_f(space, ignored)
    call h5dclose_f(dataset, ignored)
    bytes = size_of_type
    count = points
    if (offset <= 0) call fail(error, exit_io, ''''//file%path//''' has no space for '''//name//'''')
  end subroutine h5_records_extent

end module h5_records
