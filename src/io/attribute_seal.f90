! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One checksum over all attributes of a file: HDF5 keeps texts in a group that it does not check.
module attribute_seal
  use checksum, only: crc32, crc32_text
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5, only: h5_exists, h5_failed, h5_file_t
  use h5_attributes, only: h5_get_numbers, h5_get_text, h5_has_attribute, h5_put_numbers
  use h5_list, only: h5_children
  use h5_trap, only: trap
  use hdf5, only: H5_INDEX_NAME_F, H5_ITER_INC_F, h5aclose_f, h5aget_name_f, h5aget_num_attrs_f, h5aget_type_f, &
    h5aopen_by_idx_f, h5oclose_f, h5oopen_f, h5tclose_f, h5tis_variable_str_f, hid_t, hsize_t, size_t
  use kinds, only: int64, int8, real64
  use map_layout, only: path_of
  use status, only: exit_io
  use value_types, only: bytes_of, to_bytes, type_float64, type_uint32
  implicit none
  private

  public :: seal_attributes, verify_attributes, is_sealed

  character(len=*), parameter :: group = '/provenance', seal_name = 'attributes_checksum'
  !> The seals, and what the dimension scales consist of.
  character(len=*), parameter :: left_out(6) = [character(len=19) :: seal_name, 'checksum', 'CLASS', 'NAME', 'DIMENSION_LIST', &
    'REFERENCE_LIST']
  integer, parameter :: longest_name = 128

contains

  !> Gives the group `provenance` the attribute `attributes_checksum`; a file without that group stays as it is.
  subroutine seal_attributes(file, error)
    type(h5_file_t), intent(in) :: file
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: value
    if (.not. h5_exists(file, group)) return
    value = 0
    call add_object(file, '/', value, error)
    if (allocated(error)) return
    call h5_put_numbers(file, group, seal_name, type_uint32, [real(value, real64)], error)
  end subroutine seal_attributes

  !> Code 74 if the attributes do not match it; a file without it passes.
  subroutine verify_attributes(file, error)
    type(h5_file_t), intent(in) :: file
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: expected(:)
    integer(int64) :: found
    if (.not. is_sealed(file)) return
    call h5_get_numbers(file, group, seal_name, expected, error)
    found = 0
    if (.not. allocated(error)) call add_object(file, '/', found, error)
    if (allocated(error)) return
    if (size(expected) /= 1) then
      call fail(error, exit_io, 'attribute '''//seal_name//''' of '''//file%path//''' is not one number')
    else if (.not. abs(expected(1) - real(found, real64)) <= 0) then
      call fail(error, exit_io, 'the attributes of '''//file%path//''' do not match their checksum')
    end if
  end subroutine verify_attributes

  !> Whether a file has a checksum of its attributes.
  logical function is_sealed(file)
    type(h5_file_t), intent(in) :: file
    is_sealed = h5_exists(file, group)
    if (is_sealed) is_sealed = h5_has_attribute(file, group, seal_name)
  end function is_sealed

  !> Adds the attributes of an object, by name, and of what is below it, in the order of the file.
  recursive subroutine add_object(file, object, value, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object
    integer(int64), intent(inout) :: value
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names(:)
    logical, allocatable :: are_groups(:)
    integer :: i
    call add_attributes(file, object, value, error)
    if (allocated(error)) return
    call h5_children(file, object, names, are_groups, error)
    if (allocated(error)) return
    do i = 1, size(names)
      if (are_groups(i)) then
        call add_object(file, path_of(object(2:), trim(names(i))), value, error)
      else
        call add_attributes(file, path_of(object(2:), trim(names(i))), value, error)
      end if
      if (allocated(error)) return
    end do
  end subroutine add_object

  subroutine add_attributes(file, object, value, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object
    integer(int64), intent(inout) :: value
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: id, attribute, type_id
    integer :: status, count, i, ignored
    logical :: is_text
    character(len=longest_name) :: name
    call trap('attributes of '//object, file%path, endless=.true.)
    call h5oopen_f(file%id, object, id, status)
    if (status >= 0) call h5aget_num_attrs_f(id, count, status)
    call end_guard()
    if (h5_failed(status, 'list the attributes of', object, file%path, error)) return
    do i = 1, count
      name = ''
      call trap('attributes of '//object, file%path, endless=.true.)
      call h5aopen_by_idx_f(id, '.', H5_INDEX_NAME_F, H5_ITER_INC_F, int(i - 1, hsize_t), attribute, status)
      if (status >= 0) call h5aget_name_f(attribute, int(longest_name, size_t), name, ignored)
      if (status >= 0) call h5aget_type_f(attribute, type_id, status)
      if (status >= 0) call h5tis_variable_str_f(type_id, is_text, status)
      call end_guard()
      if (h5_failed(status, 'read an attribute of', object, file%path, error)) return
      call h5tclose_f(type_id, ignored)
      call h5aclose_f(attribute, ignored)
      if (any(left_out == name)) cycle
      call add_value(file, object, trim(name), is_text, value, error)
      if (allocated(error)) return
    end do
    call h5oclose_f(id, ignored)
  end subroutine add_attributes

  subroutine add_value(file, object, name, is_text, value, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    logical, intent(in) :: is_text
    integer(int64), intent(inout) :: value
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text
    real(real64), allocatable :: numbers(:)
    integer(int8), allocatable :: bytes(:)
    value = crc32_text(object//' '//name//achar(0), value)
    if (is_text) then
      call h5_get_text(file, object, name, text, error)
      if (.not. allocated(error)) value = crc32_text(text//achar(0), value)
    else
      call h5_get_numbers(file, object, name, numbers, error)
      if (allocated(error)) return
      allocate (bytes(size(numbers)*bytes_of(type_float64)))
      call to_bytes(type_float64, numbers, bytes)
      value = crc32(bytes, value)
    end if
  end subroutine add_value

end module attribute_seal
