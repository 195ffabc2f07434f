! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Attributes, strings and dimension scales of HDF5 objects. A text is an attribute, UTF-8 of variable length: of that every
!> reader shows all, however long it is, and those that cannot read it pass it by. Files of version 1 also have datasets of strings.
module h5_attributes
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_pointer, c_loc, c_null_char, c_null_ptr, c_ptr
  use bindings, only: c_string_length
  use errors, only: error_t
  use guard, only: end_guard
  use h5, only: h5_dataset_t, h5_failed, h5_file_t
  use h5_types, only: h5_string_type, h5_type
  use h5_stored, only: h5_check_stored
  use h5_trap, only: trap
  use h5ds, only: h5dsattach_scale_f, h5dsset_scale_f
  use hdf5, only: &
    h5aclose_f, h5acreate_by_name_f, h5adelete_by_name_f, h5aexists_by_name_f, h5aget_space_f, &
    h5aopen_by_name_f, h5aread_f, h5awrite_f, h5dget_space_f, h5dread_f, h5dvlen_reclaim_f, &
    H5P_DEFAULT_F, H5S_SCALAR_F, h5sclose_f, h5screate_f, h5screate_simple_f, &
    h5sget_simple_extent_npoints_f, h5tclose_f, hid_t, hsize_t
  use kinds, only: int64, int8, real64
  use value_types, only: bytes_of, from_bytes, to_bytes, type_float64
  implicit none
  private

  public :: h5_put_text, h5_put_numbers, h5_get_text, h5_get_numbers, h5_has_attribute, &
    h5_read_strings, h5_make_scale, h5_attach_scale

contains

  !> Whether the object has this attribute.
  logical function h5_has_attribute(file, object, name)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    integer :: status
    call trap('attribute '//name//' of '//object, file%path, endless=.true.)
    call h5aexists_by_name_f(file%id, object, name, h5_has_attribute, status)
    call end_guard()
    if (status < 0) h5_has_attribute = .false.
  end function h5_has_attribute

  !> Sets a text attribute, replacing one of the same name.
  subroutine h5_put_text(file, object, name, text, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name, text
    type(error_t), allocatable, intent(out) :: error
    character(kind=c_char, len=:), allocatable, target :: string
    type(c_ptr), target :: pointers(1)
    integer(hid_t) :: attribute, type_id
    integer :: status, ignored
    string = text//c_null_char
    pointers(1) = c_loc(string)
    call h5_string_type(type_id, status)
    if (status >= 0) call new_attribute(file, object, name, type_id, 0, attribute, status)
    if (status >= 0) call h5awrite_f(attribute, type_id, c_loc(pointers), status)
    if (h5_failed(status, 'write attribute '''//name//''' of', object, file%path, error)) return
    call h5aclose_f(attribute, ignored)
    call h5tclose_f(type_id, ignored)
  end subroutine h5_put_text

  !> Sets a numeric attribute, replacing one of the same name; a scalar unless `list`.
  subroutine h5_put_numbers(file, object, name, type, values, error, list)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    integer, intent(in) :: type
    real(real64), intent(in) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: list
    integer(int8), allocatable, target :: bytes(:)
    integer(hid_t) :: attribute
    integer :: status, ignored, length
    allocate (bytes(size(values)*bytes_of(type)))
    call to_bytes(type, values, bytes)
    length = 0
    if (present(list)) length = merge(size(values), 0, list)
    call new_attribute(file, object, name, h5_type(type), length, attribute, status)
    if (status >= 0) call h5awrite_f(attribute, h5_type(type), c_loc(bytes), status)
    if (h5_failed(status, 'write attribute '''//name//''' of', object, file%path, error)) return
    call h5aclose_f(attribute, ignored)
  end subroutine h5_put_numbers

  !> Creates an attribute of this length (0 = scalar).
  subroutine new_attribute(file, object, name, type_id, length, attribute, status)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    integer(hid_t), intent(in) :: type_id
    integer, intent(in) :: length
    integer(hid_t), intent(out) :: attribute
    integer, intent(out) :: status
    integer(hid_t) :: space
    integer :: ignored
    status = 0
    if (h5_has_attribute(file, object, name)) call h5adelete_by_name_f(file%id, object, name, status)
    if (status < 0) return
    if (length == 0) then
      call h5screate_f(H5S_SCALAR_F, space, status)
    else
      call h5screate_simple_f(1, [int(length, hsize_t)], space, status)
    end if
    if (status < 0) return
    call h5acreate_by_name_f(file%id, object, name, type_id, space, attribute, status)
    call h5sclose_f(space, ignored)
  end subroutine new_attribute

  !> The value of a text attribute; code 74 if there is none.
  subroutine h5_get_text(file, object, name, text, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    type(c_ptr), target :: pointers(1)
    type(c_ptr) :: address
    integer(hid_t) :: attribute, type_id, space
    integer(hsize_t) :: count
    integer :: status, ignored
    pointers = c_null_ptr
    address = c_loc(pointers)
    call trap('attribute '//name//' of '//object, file%path, endless=.true.)
    call h5aopen_by_name_f(file%id, object, name, attribute, status)
    if (status >= 0) call h5aget_space_f(attribute, space, status)
    if (status >= 0) call h5sget_simple_extent_npoints_f(space, count, status)
    if (status >= 0 .and. count > 1) status = -1
    if (status >= 0) call h5_string_type(type_id, status)
    if (status >= 0) call h5aread_f(attribute, type_id, address, status)
    call end_guard()
    if (h5_failed(status, 'read attribute '''//name//''' of', object, file%path, error)) return
    call copy_string(pointers(1), text)
    call h5dvlen_reclaim_f(type_id, space, H5P_DEFAULT_F, address, ignored)
    call h5sclose_f(space, ignored)
    call h5tclose_f(type_id, ignored)
    call h5aclose_f(attribute, ignored)
  end subroutine h5_get_text

  !> The values of a numeric attribute of any type; code 74 if there is none.
  subroutine h5_get_numbers(file, object, name, values, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: object, name
    real(real64), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable, target :: bytes(:)
    type(c_ptr) :: address
    integer(hid_t) :: attribute, space
    integer(hsize_t) :: count
    integer :: status, ignored
    call trap('attribute '//name//' of '//object, file%path, endless=.true.)
    call h5aopen_by_name_f(file%id, object, name, attribute, status)
    if (status >= 0) call h5aget_space_f(attribute, space, status)
    if (status >= 0) call h5sget_simple_extent_npoints_f(space, count, status)
    call end_guard()
    if (h5_failed(status, 'read attribute '''//name//''' of', object, file%path, error)) return
    allocate (bytes(count*bytes_of(type_float64)), values(count))
    address = c_loc(bytes)
    call h5aread_f(attribute, h5_type(type_float64), address, status)
    if (h5_failed(status, 'read attribute '''//name//''' of', object, file%path, error)) return
    call from_bytes(type_float64, bytes, values)
    call h5sclose_f(space, ignored)
    call h5aclose_f(attribute, ignored)
  end subroutine h5_get_numbers

  !> Reads all strings of a dataset.
  subroutine h5_read_strings(dataset, strings, error)
    type(h5_dataset_t), intent(in) :: dataset
    character(len=:), allocatable, intent(out) :: strings(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text
    type(c_ptr), allocatable, target :: pointers(:)
    type(c_ptr) :: address
    integer(hid_t) :: type_id, space
    integer :: status, i, ignored, longest
    call h5_check_stored(dataset, error)
    if (allocated(error)) return
    allocate (pointers(product(dataset%lengths)))
    pointers = c_null_ptr
    longest = 0
    if (size(pointers) > 0) then
      address = c_loc(pointers)
      call h5_string_type(type_id, status)
      call trap(dataset%name, dataset%path, endless=.true.)
      if (status >= 0) call h5dread_f(dataset%id, type_id, address, status)
      call end_guard()
      if (h5_failed(status, 'read', dataset%name, dataset%path, error)) return
      do i = 1, size(pointers)
        if (c_associated(pointers(i))) longest = max(longest, int(c_string_length(pointers(i))))
      end do
    end if
    allocate (character(len=longest) :: strings(size(pointers)))
    if (size(pointers) == 0) return
    do i = 1, size(pointers)
      call copy_string(pointers(i), text)
      strings(i) = text
    end do
    call h5dget_space_f(dataset%id, space, ignored)
    call h5dvlen_reclaim_f(type_id, space, H5P_DEFAULT_F, address, ignored)
    call h5sclose_f(space, ignored)
    call h5tclose_f(type_id, ignored)
  end subroutine h5_read_strings

  subroutine copy_string(pointer, text)
    type(c_ptr), intent(in) :: pointer
    character(len=:), allocatable, intent(out) :: text
    character(kind=c_char), pointer :: characters(:)
    integer :: i, length
    length = 0
    if (c_associated(pointer)) length = int(c_string_length(pointer))
    allocate (character(len=length) :: text)
    if (length == 0) return
    call c_f_pointer(pointer, characters, [length])
    do i = 1, length
      text(i:i) = characters(i)
    end do
  end subroutine copy_string

  !> Makes a dataset of one dimension the scale of the dimension `name`.
  subroutine h5_make_scale(dataset, name, error)
    type(h5_dataset_t), intent(in) :: dataset
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    call h5dsset_scale_f(dataset%id, status, name)
    if (h5_failed(status, 'make a dimension scale of', dataset%name, dataset%path, error)) return
  end subroutine h5_make_scale

  !> Attaches a scale to dimension `k` of a dataset, counted from 1 in C order. The Fortran interface
  !> of the scales does not reverse dimensions as the rest of the library does.
  subroutine h5_attach_scale(dataset, scale, k, error)
    type(h5_dataset_t), intent(in) :: dataset, scale
    integer, intent(in) :: k
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    call h5dsattach_scale_f(dataset%id, scale%id, k, status)
    if (h5_failed(status, 'attach '''//scale%name//''' to', dataset%name, dataset%path, error)) return
  end subroutine h5_attach_scale

end module h5_attributes
