! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The types of `value_types` in HDF5.
module h5_types
  use hdf5, only: h5dget_type_f, H5T_CSET_UTF8_F, H5T_IEEE_F32LE, H5T_IEEE_F64LE, H5T_STD_I16LE, H5T_STD_I32LE, H5T_STD_I64LE, &
    H5T_STD_I8LE, H5T_STD_U32LE, H5T_STRING, h5tclose_f, h5tcopy_f, h5tequal_f, h5tis_variable_str_f, h5tset_cset_f, hid_t
  use value_types, only: type_string
  implicit none
  private

  public :: find_type, h5_string_type, h5_type

contains

  !> The type's identifier in the library.
  integer(hid_t) function h5_type(type)
    integer, intent(in) :: type
    integer(hid_t) :: types(8)
    types = [H5T_STD_I8LE, H5T_STD_I16LE, H5T_STD_I32LE, H5T_STD_I64LE, H5T_STD_U32LE, H5T_IEEE_F32LE, &
             H5T_IEEE_F64LE, H5T_STRING]
    h5_type = types(type)
  end function h5_type

  !> A new identifier of the type of UTF-8 strings of variable length; the caller closes it.
  subroutine h5_string_type(id, status)
    integer(hid_t), intent(out) :: id
    integer, intent(out) :: status
    call h5tcopy_f(H5T_STRING, id, status)
    if (status >= 0) call h5tset_cset_f(id, H5T_CSET_UTF8_F, status)
  end subroutine h5_string_type

  !> The type of the dataset `id`; a negative status if it is none of ours.
  subroutine find_type(id, type, status)
    integer(hid_t), intent(in) :: id
    integer, intent(out) :: type, status
    integer(hid_t) :: found
    logical :: equal
    integer :: one, ignored
    type = 0
    call h5dget_type_f(id, found, status)
    if (status < 0) return
    do one = 1, type_string - 1
      call h5tequal_f(found, h5_type(one), equal, status)
      if (status >= 0 .and. equal) type = one
    end do
    call h5tis_variable_str_f(found, equal, status)
    if (status >= 0 .and. equal) type = type_string
    if (type == 0) status = -1
    call h5tclose_f(found, ignored)
  end subroutine find_type

end module h5_types
