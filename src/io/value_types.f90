! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The types of variables and their bytes, in the order of little-endian machines, in the file and
!> in memory. Values pass through the rest of the program as real64.
module value_types
  use kinds, only: int16, int32, int64, int8, real32, real64
  implicit none
  private

  public :: type_named, bytes_of, to_bytes, from_bytes, is_float

  integer, parameter, public :: type_int8 = 1, type_int16 = 2, type_int32 = 3, type_int64 = 4, &
    type_uint32 = 5, type_float32 = 6, type_float64 = 7, type_string = 8

  !> Names of the types, index = code.
  character(len=*), parameter, public :: type_names(8) = [character(len=7) :: &
    'int8', 'int16', 'int32', 'int64', 'uint32', 'float32', 'float64', 'string']

  integer, parameter :: sizes(8) = [1, 2, 4, 8, 4, 4, 8, 0]

contains

  !> The type of this name; 0 if there is none.
  pure integer function type_named(name)
    character(len=*), intent(in) :: name
    type_named = findloc(type_names == name, .true., 1)
  end function type_named

  !> Bytes of one value; 0 for strings.
  pure integer function bytes_of(type)
    integer, intent(in) :: type
    bytes_of = sizes(type)
  end function bytes_of

  !> Whether the type has NaN.
  pure logical function is_float(type)
    integer, intent(in) :: type
    is_float = type == type_float32 .or. type == type_float64
  end function is_float

  !> The bytes of the values in a type; integers are rounded to the nearest. The size of `bytes` is
  !> that of `values` times `bytes_of(type)`.
  pure subroutine to_bytes(type, values, bytes)
    integer, intent(in) :: type
    real(real64), intent(in) :: values(:)
    integer(int8), intent(out) :: bytes(:)
    integer :: width
    integer(int64) :: i
    width = bytes_of(type)
    do i = 1, size(values, kind=int64)
      associate (at => bytes((i - 1)*width + 1:i*width))
        select case (type)
        case (type_int8)
          at = nint(values(i), int8)
        case (type_int16)
          at = transfer(nint(values(i), int16), at)
        case (type_int32)
          at = transfer(nint(values(i), int32), at)
        case (type_int64)
          at = transfer(nint(values(i), int64), at)
        case (type_uint32)
          at = transfer(nint(values(i), int64), at, width)
        case (type_float32)
          at = transfer(real(values(i), real32), at)
        case (type_float64)
          at = transfer(values(i), at)
        end select
      end associate
    end do
  end subroutine to_bytes

  !> The values that the bytes of a type stand for; sizes as for `to_bytes`.
  pure subroutine from_bytes(type, bytes, values)
    integer, intent(in) :: type
    integer(int8), intent(in) :: bytes(:)
    real(real64), intent(out) :: values(:)
    integer :: width
    integer(int64) :: i
    width = bytes_of(type)
    do i = 1, size(values, kind=int64)
      associate (at => bytes((i - 1)*width + 1:i*width))
        select case (type)
        case (type_int8)
          values(i) = at(1)
        case (type_int16)
          values(i) = transfer(at, 0_int16)
        case (type_int32)
          values(i) = transfer(at, 0_int32)
        case (type_int64)
          values(i) = real(transfer(at, 0_int64), real64)
        case (type_uint32)
          values(i) = real(iand(int(transfer(at, 0_int32), int64), int(z'FFFFFFFF', int64)), real64)
        case (type_float32)
          values(i) = transfer(at, 0.0_real32)
        case (type_float64)
          values(i) = transfer(at, 0.0_real64)
        end select
      end associate
    end do
  end subroutine from_bytes

end module value_types
