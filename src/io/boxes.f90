! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Blocks of a grid whose values lie in C order, as bytes.
module boxes
  use kinds, only: int64, int8
  implicit none
  private

  public :: copy_common

contains

  !> Copies what two blocks have in common from one to the other. A block: corner (from 0), extent, values of `width` bytes.
  pure subroutine copy_common(width, from_lower, from_extent, from, to_lower, to_extent, to)
    integer, intent(in) :: width
    integer(int64), intent(in) :: from_lower(:), from_extent(:), to_lower(:), to_extent(:)
    integer(int8), intent(in), contiguous :: from(:)
    integer(int8), intent(inout), contiguous :: to(:)
    integer(int64) :: lower(size(from_lower)), upper(size(from_lower)), subscripts(size(from_lower))
    integer(int64) :: run, rows, row, read_at, write_at
    integer :: last, k
    last = size(from_lower)
    lower = max(from_lower, to_lower)
    upper = min(from_lower + from_extent, to_lower + to_extent)
    if (any(upper <= lower)) return
    run = (upper(last) - lower(last))*width
    rows = 1
    if (last > 1) rows = upper(last - 1) - lower(last - 1)
    subscripts = lower
    do
      read_at = offset(subscripts - from_lower, from_extent)*width
      write_at = offset(subscripts - to_lower, to_extent)*width
      do row = 1, rows
        to(write_at + 1:write_at + run) = from(read_at + 1:read_at + run)
        read_at = read_at + from_extent(last)*width
        write_at = write_at + to_extent(last)*width
      end do
      do k = last - 2, 1, -1
        subscripts(k) = subscripts(k) + 1
        if (subscripts(k) < upper(k)) exit
        subscripts(k) = lower(k)
      end do
      if (k < 1) exit
    end do
  end subroutine copy_common

  !> How many values lie before given subscripts (from 0) in C order.
  pure integer(int64) function offset(subscripts, extent)
    integer(int64), intent(in) :: subscripts(:), extent(:)
    integer :: k
    offset = 0
    do k = 1, size(subscripts)
      offset = offset*extent(k) + subscripts(k)
    end do
  end function offset

end module boxes
