! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A dataset in blocks that are contiguous in C order and made of whole chunks of the final file,
!> so that it is copied and checked with bounded memory. Nothing here depends on tiles.
module slabs
  use kinds, only: int64
  implicit none
  private

  public :: final_chunk, slab_count, slab, chunk_count, chunk_corner

  !> Values of a chunk in the final file, the side of a square one, and most values of a slab.
  integer(int64), parameter :: chunk_values = 65536, chunk_side = 256, slab_values = 2_int64**18

contains

  !> The chunk of a dataset in the final file: 65536 values or somewhat fewer, flat where rows are so long that a slab of
  !> square ones would be too large.
  pure function final_chunk(lengths) result(chunk)
    integer(int64), intent(in) :: lengths(:)
    integer(int64) :: chunk(size(lengths))
    integer(int64) :: values
    integer :: k
    values = 1
    do k = size(lengths), 1, -1
      chunk(k) = min(lengths(k), max(1_int64, chunk_values/values))
      if (k == size(lengths) .and. k > 1) chunk(k) = min(chunk(k), max(chunk_side, lengths(k)*chunk_values/slab_values))
      values = values*chunk(k)
    end do
  end function final_chunk

  !> The number of slabs of a dataset.
  pure integer(int64) function slab_count(lengths)
    integer(int64), intent(in) :: lengths(:)
    integer(int64) :: step
    integer :: k
    slab_count = 1
    if (size(lengths) == 0) return
    call cut(lengths, k, step)
    slab_count = product(lengths(:k - 1))*((lengths(k) + step - 1)/step)
    if (any(lengths == 0)) slab_count = 0
  end function slab_count

  !> Corner (from 0) and extent of slab `index` (from 1).
  pure subroutine slab(lengths, index, lower, extent)
    integer(int64), intent(in) :: lengths(:), index
    integer(int64), intent(out) :: lower(:), extent(:)
    integer(int64) :: step, rest, steps
    integer :: k, i
    if (size(lengths) == 0) return
    call cut(lengths, k, step)
    lower = 0
    extent = lengths
    steps = (lengths(k) + step - 1)/step
    lower(k) = mod(index - 1, steps)*step
    extent(k) = min(step, lengths(k) - lower(k))
    rest = (index - 1)/steps
    do i = k - 1, 1, -1
      lower(i) = mod(rest, lengths(i))
      extent(i) = 1
      rest = rest/lengths(i)
    end do
  end subroutine slab

  !> The number of chunks of a block made of whole ones.
  pure integer(int64) function chunk_count(chunk, extent)
    integer(int64), intent(in) :: chunk(:), extent(:)
    chunk_count = product((extent + chunk - 1)/chunk)
  end function chunk_count

  !> Corner (from 0) of chunk `index` (from 1, in C order) of such a block.
  pure function chunk_corner(chunk, lower, extent, index) result(corner)
    integer(int64), intent(in) :: chunk(:), lower(:), extent(:)
    integer, intent(in) :: index
    integer(int64) :: corner(size(chunk)), rest, along
    integer :: k
    rest = index - 1
    do k = size(chunk), 1, -1
      along = (extent(k) + chunk(k) - 1)/chunk(k)
      corner(k) = lower(k) + mod(rest, along)*chunk(k)
      rest = rest/along
    end do
  end function chunk_corner

  !> The first dimension in which a chunk is longer than 1 is the one that is cut.
  pure subroutine cut(lengths, k, step)
    integer(int64), intent(in) :: lengths(:)
    integer, intent(out) :: k
    integer(int64), intent(out) :: step
    integer(int64) :: chunk(size(lengths))
    chunk = final_chunk(lengths)
    do k = 1, size(lengths) - 1
      if (chunk(k) > 1) exit
    end do
    step = max(1_int64, chunk(k))
  end subroutine cut

end module slabs
