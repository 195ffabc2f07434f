! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> CRC-32 (zlib), incremental.
module checksum
  use, intrinsic :: iso_c_binding, only: c_loc
  use bindings, only: c_crc32, c_crc32_combine
  use kinds, only: int8, int32, int64
  implicit none
  private

  public :: crc32, crc32_combine, crc32_text

contains

  !> The CRC-32 of `bytes`, following data whose CRC-32 is `previous` (0 at the start). The value
  !> is unsigned, 0 to 2**32 - 1.
  integer(int64) function crc32(bytes, previous)
    integer(int8), intent(in), contiguous, target :: bytes(:)
    integer(int64), intent(in) :: previous
    integer(int32) :: word
    crc32 = previous
    if (size(bytes) == 0) return
    word = transfer(previous, word)
    word = c_crc32(word, c_loc(bytes), size(bytes, kind=int64))
    crc32 = iand(int(word, int64), int(z'FFFFFFFF', int64))
  end function crc32

  !> The CRC-32 of two pieces one after the other: `first` and `second` are theirs, the second has `size` bytes.
  integer(int64) function crc32_combine(first, second, size)
    integer(int64), intent(in) :: first, second, size
    integer(int32) :: word
    word = c_crc32_combine(transfer(first, word), transfer(second, word), size)
    crc32_combine = iand(int(word, int64), int(z'FFFFFFFF', int64))
  end function crc32_combine

  !> The CRC-32 of the characters of `string` after data with CRC-32 `previous`.
  integer(int64) function crc32_text(string, previous)
    character(len=*), intent(in) :: string
    integer(int64), intent(in) :: previous
    integer(int8), allocatable :: bytes(:)
    integer :: i
    allocate (bytes(len(string)))
    do i = 1, len(string)
      bytes(i) = transfer(string(i:i), bytes(i))
    end do
    crc32_text = crc32(bytes, previous)
  end function crc32_text

end module checksum
