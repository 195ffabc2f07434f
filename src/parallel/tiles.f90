! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Tiles: blocks of a grid of 1 to 6 dimensions. Pure integer arithmetic. Points and tiles are
!> numbered in C order (the last dimension runs fastest), tiles from 1, points from 0.
module tiles
  use errors, only: error_t, fail
  use kinds, only: int64, real64
  use status, only: exit_bad_case, exit_internal
  use text, only: to_text
  implicit none
  private

  public :: new_tiling

  !> Most dimensions of a grid.
  integer, parameter :: max_dimensions = 6

  type, public :: tiling_t
    !> Lengths of the grid and of a tile.
    integer(int64), allocatable :: lengths(:), shape(:)
  contains
    procedure :: count => count_tiles
    procedure :: block_of
    procedure :: points
    procedure :: number_at
  end type tiling_t

contains

  !> The tiling of a grid; the tile shape is cut to the grid. Code 70 if the ranks differ or a
  !> length is not positive; code 65 if the tiles, or the points of one, are more than an integer counts.
  subroutine new_tiling(lengths, shape, tiling, error)
    integer(int64), intent(in) :: lengths(:), shape(:)
    type(tiling_t), intent(out) :: tiling
    type(error_t), allocatable, intent(out) :: error
    tiling%lengths = lengths
    if (size(lengths) /= size(shape)) then
      call fail(error, exit_internal, 'a grid of '//to_text(size(lengths))//' dimensions has a tile of '// &
                to_text(size(shape)))
    else if (size(lengths) < 1 .or. size(lengths) > max_dimensions) then
      call fail(error, exit_internal, 'a grid has 1 to 6 dimensions, not '//to_text(size(lengths)))
    else if (any(lengths < 1) .or. any(shape < 1)) then
      call fail(error, exit_internal, 'lengths of grids and tiles are positive')
    else
      tiling%shape = min(lengths, shape)
      call check_counts(tiling, error)
    end if
  end subroutine new_tiling

  !> Numbers that the integers of a tiling cannot hold.
  subroutine check_counts(tiling, error)
    type(tiling_t), intent(in) :: tiling
    type(error_t), allocatable, intent(out) :: error
    real(real64) :: tiles
    tiles = product(real(tiles_along(tiling), real64))
    if (tiles > huge(1)) then
      call fail(error, exit_bad_case, 'key ''grid.tile'': found '//to_text(tiles)//' tiles, allowed at most '//to_text(huge(1)))
    else if (product(real(tiling%shape, real64)) > huge(1)) then
      call fail(error, exit_bad_case, 'key ''grid.tile'': found tiles of '//to_text(product(real(tiling%shape, real64)))// &
                ' points, allowed at most '//to_text(huge(1)))
    else if (product(real(tiling%lengths, real64)) > 2.0_real64**62) then
      call fail(error, exit_bad_case, 'the grid has '//to_text(product(real(tiling%lengths, real64)))// &
                ' points, allowed at most 2^62')
    end if
  end subroutine check_counts

  !> The number of tiles.
  pure integer function count_tiles(self)
    class(tiling_t), intent(in) :: self
    count_tiles = int(product(tiles_along(self)))
  end function count_tiles

  !> Lower corner (from 0) and extents of a tile (from 1), in grid points.
  pure subroutine block_of(self, tile, lower, extent)
    class(tiling_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int64), intent(out) :: lower(:), extent(:)
    lower = unravel(int(tile - 1, int64), tiles_along(self))*self%shape
    extent = min(self%shape, self%lengths - lower)
  end subroutine block_of

  !> The number of points of a tile.
  pure integer function points(self, tile)
    class(tiling_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int64) :: lower(size(self%lengths)), extent(size(self%lengths))
    call self%block_of(tile, lower, extent)
    points = int(product(extent))
  end function points

  !> The number (from 1) of the tile that is so many tiles from the origin along each axis.
  pure integer(int64) function number_at(self, subscripts)
    class(tiling_t), intent(in) :: self
    integer(int64), intent(in) :: subscripts(:)
    integer(int64) :: counts(size(subscripts))
    integer :: k
    counts = tiles_along(self)
    number_at = 0
    do k = 1, size(subscripts)
      number_at = number_at*counts(k) + subscripts(k)
    end do
    number_at = number_at + 1
  end function number_at

  pure function tiles_along(self) result(counts)
    class(tiling_t), intent(in) :: self
    integer(int64) :: counts(size(self%lengths))
    counts = (self%lengths + self%shape - 1)/self%shape
  end function tiles_along

  pure function unravel(index, lengths) result(subscripts)
    integer(int64), intent(in) :: index, lengths(:)
    integer(int64) :: subscripts(size(lengths)), rest
    integer :: i
    rest = index
    do i = size(lengths), 1, -1
      subscripts(i) = mod(rest, lengths(i))
      rest = rest/lengths(i)
    end do
  end function unravel

end module tiles
