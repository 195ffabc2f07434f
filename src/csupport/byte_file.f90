! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bytes at offsets of a file that exists. Errors have code 74.
module byte_file
  use, intrinsic :: iso_c_binding, only: c_int, c_loc, c_null_char
  use bindings, only: c_close_bytes, c_has_name, c_length_of, c_open_bytes, c_read_bytes, c_set_length, c_write_bytes
  use errors, only: error_t
  use files, only: test_status
  use kinds, only: int64, int8
  use status, only: exit_io
  implicit none
  private

  !> An open file.
  type, public :: byte_file_t
    character(len=:), allocatable :: path
    integer(c_int), private :: descriptor = -1
  contains
    procedure :: open => open_bytes
    procedure :: read => read_bytes
    procedure :: write => write_bytes
    procedure :: close => close_bytes
    procedure :: has_name
    procedure :: length
    procedure :: set_length
  end type byte_file_t

contains

  !> Opens a file.
  subroutine open_bytes(self, path, writable, error)
    class(byte_file_t), intent(out) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: number
    self%path = path
    number = c_open_bytes(path//c_null_char, merge(1_c_int, 0_c_int, writable), self%descriptor)
    call test_status(number, exit_io, 'cannot open', path, error)
  end subroutine open_bytes

  !> Whether the file is still there under its name: it has been neither removed nor moved. A file system that does not answer
  !> counts as one that has it.
  logical function has_name(self)
    class(byte_file_t), intent(in) :: self
    has_name = .true.
    if (self%descriptor >= 0) has_name = c_has_name(self%descriptor, self%path//c_null_char) /= 0
  end function has_name

  !> Bytes of the file, -1 if it is not open or the file system does not answer.
  integer(int64) function length(self)
    class(byte_file_t), intent(in) :: self
    length = -1
    if (self%descriptor >= 0) length = c_length_of(self%descriptor)
  end function length

  !> Makes the file `bytes` long, without a write into what is there.
  subroutine set_length(self, bytes, error)
    class(byte_file_t), intent(in) :: self
    integer(int64), intent(in) :: bytes
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: number
    number = c_set_length(self%descriptor, bytes)
    call test_status(number, exit_io, 'cannot extend', self%path, error)
  end subroutine set_length

  !> Reads what lies at an offset (from 0).
  subroutine read_bytes(self, bytes, offset, error)
    class(byte_file_t), intent(in) :: self
    integer(int8), intent(out), contiguous, target :: bytes(:)
    integer(int64), intent(in) :: offset
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: number
    number = c_read_bytes(self%descriptor, c_loc(bytes), size(bytes, kind=int64), offset)
    call test_status(number, exit_io, 'cannot read', self%path, error)
  end subroutine read_bytes

  !> Writes at an offset (from 0).
  subroutine write_bytes(self, bytes, offset, error)
    class(byte_file_t), intent(in) :: self
    integer(int8), intent(in), contiguous, target :: bytes(:)
    integer(int64), intent(in) :: offset
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: number
    number = c_write_bytes(self%descriptor, c_loc(bytes), size(bytes, kind=int64), offset)
    call test_status(number, exit_io, 'cannot write', self%path, error)
  end subroutine write_bytes

  !> Closes the file; one that is not open stays so. `durable`: what was written is on the disk afterwards.
  subroutine close_bytes(self, error, durable)
    class(byte_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: durable
    integer(c_int) :: number, sync
    if (self%descriptor < 0) return
    sync = 0
    if (present(durable)) sync = merge(1_c_int, 0_c_int, durable)
    number = c_close_bytes(self%descriptor, sync)
    self%descriptor = -1
    call test_status(number, exit_io, 'cannot close', self%path, error)
  end subroutine close_bytes

end module byte_file
