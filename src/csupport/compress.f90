! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bytes in the format of HDF5's filters `shuffle` and `deflate`. With ISA-L the compressed bytes may depend on the processor.
module compress
  use, intrinsic :: iso_c_binding, only: c_int, c_loc
  use bindings, only: c_compress, c_compress_bound, c_shuffle
  use kinds, only: int64, int8
  implicit none
  private

  public :: compress_bytes

contains

  !> The bytes, deflated (zlib); before that, with `width` above 1, the first bytes of all values of that many bytes come
  !> first, then all second ones and so on. No bytes at all where memory is short.
  subroutine compress_bytes(bytes, level, width, out)
    integer(int8), intent(in), contiguous, target :: bytes(:)
    integer, intent(in) :: level, width
    integer(int8), allocatable, intent(out) :: out(:)
    integer(int8), allocatable, target :: room(:), shuffled(:)
    integer(int64) :: length
    allocate (room(c_compress_bound(size(bytes, kind=int64))))
    if (width > 1) then
      allocate (shuffled(size(bytes, kind=int64)))
      call c_shuffle(c_loc(bytes), size(bytes, kind=int64)/width, int(width, c_int), c_loc(shuffled))
      length = c_compress(c_loc(shuffled), size(shuffled, kind=int64), int(level, c_int), c_loc(room), size(room, kind=int64))
    else
      length = c_compress(c_loc(bytes), size(bytes, kind=int64), int(level, c_int), c_loc(room), size(room, kind=int64))
    end if
    out = room(:max(length, 0_int64))
  end subroutine compress_bytes

end module compress
