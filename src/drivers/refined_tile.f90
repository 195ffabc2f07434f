! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A tile of a map of which not all points are computed: block after block, each asked for the points it needs.
module refined_tile
  use errors, only: error_t
  use kinds, only: int64, wp
  use point_work, only: compute_list, point_work_t, watch_t
  use refinement, only: block_content, block_t, learn_points, next_points, open_block
  use spread_order, only: spread_subscripts
  implicit none
  private

  public :: refine_tile, pilot_share, layers_of

  !> Blocks from which a dry run estimates the work, and the time after which it is content with those it has [s].
  integer, parameter :: pilot_blocks = 16
  real(wp), parameter :: pilot_time = 10

contains

  !> Values (points of the tile, the last axis fastest; marks and origin) of the tile that begins at `lower` (from 0) and holds
  !> whole blocks. `lengths`: of the map. `whole` is false if the watch requests a stop before the last block is done.
  subroutine refine_tile(work, lengths, lower, extent, values, whole, error, watch)
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: lengths(:), lower(:), extent(:)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(block_t) :: block
    integer :: corner(size(lengths)), step(size(lengths)), i
    logical :: stop_now
    step = 1
    step(work%refined_axes) = work%refine%block
    corner = lower
    whole = .true.
    do
      call refine_block(work, lengths, corner, block, whole, error, watch)
      if (allocated(error) .or. .not. whole) return
      call put_block(work, block, corner, lower, extent, values)
      ! The next block, counting like an odometer.
      do i = size(corner), 1, -1
        corner(i) = corner(i) + step(i)
        if (corner(i) < lower(i) + extent(i)) exit
        corner(i) = lower(i)
      end do
      if (i == 0) return
      if (.not. present(watch)) cycle
      ! What a block asks for may be little enough to be done at one go.
      call watch%look(stop_now)
      whole = .not. stop_now
      if (stop_now) return
    end do
  end subroutine refine_tile

  !> The block that begins at `corner` (from 0), as far as it needs to be computed.
  subroutine refine_block(work, lengths, corner, block, whole, error, watch)
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: lengths(:), corner(:)
    type(block_t), intent(out) :: block
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    integer, allocatable :: points(:, :), index(:, :)
    real(wp), allocatable :: values(:, :), marks(:, :), settling(:)
    integer :: n
    whole = .true.
    associate (axes => work%refined_axes)
      call open_block(work%refine, lengths(axes), corner(axes), layer_of(axes, lengths, corner), block)
      do
        call next_points(block, points)
        n = size(points, 2)
        if (n == 0) return
        index = spread(corner + 1, 2, n)
        index(axes, :) = points + 1
        if (allocated(values)) deallocate (values, marks, settling)
        allocate (values(n, work%variables), marks(n, work%marks), settling(n))
        call compute_list(work, index, values, whole, error, watch)
        if (allocated(error) .or. .not. whole) return
        call work%distinguish(index, values, marks, settling, error)
        if (allocated(error)) return
        call learn_points(block, points, marks, settling)
      end do
    end associate
  end subroutine refine_block

  !> From some blocks spread over the map: seconds on one core, and points computed, per point of the map.
  subroutine pilot_share(work, lengths, seconds, share, error)
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: lengths(:)
    real(wp), intent(out) :: seconds, share
    type(error_t), allocatable, intent(out) :: error
    type(block_t) :: block
    real(wp) :: start, now
    integer :: corner(size(lengths)), i, k
    integer(int64) :: points
    logical :: whole
    call cpu_time(start)
    work%computed = 0
    points = 0
    do i = 1, pilot_blocks
      corner = spread_subscripts(i, lengths) - 1
      do k = 1, size(lengths)
        if (any(work%refined_axes == k)) corner(k) = corner(k)/work%refine%block*work%refine%block
      end do
      call refine_block(work, lengths, corner, block, whole, error)
      if (allocated(error)) return
      points = points + product(block%own(2, :) - block%own(1, :) + 1)
      call cpu_time(now)
      if (now - start > pilot_time) exit
    end do
    call cpu_time(now)
    seconds = (now - start)/points
    share = real(work%computed, wp)/points
  end subroutine pilot_share

  !> Planes of a map of `lengths` above each other.
  pure integer(int64) function layers_of(lengths, axes) result(layers)
    integer, intent(in) :: lengths(:), axes(2)
    layers = product(int(lengths, int64))/product(int(lengths(axes), int64))
  end function layers_of

  !> Number of a block's corner on the axes that are not refined, the last one fastest.
  pure integer(int64) function layer_of(axes, lengths, corner) result(layer)
    integer, intent(in) :: axes(2), lengths(:), corner(:)
    integer :: i
    layer = 0
    do i = 1, size(lengths)
      if (all(axes /= i)) layer = layer*lengths(i) + corner(i)
    end do
  end function layer_of

  !> Puts a block that is done where it belongs in its tile.
  subroutine put_block(work, block, corner, lower, extent, values)
    class(point_work_t), intent(in) :: work
    type(block_t), intent(in) :: block
    integer, intent(in) :: corner(:), lower(:), extent(:)
    real(wp), intent(inout) :: values(:, :)
    real(wp), allocatable :: content(:, :)
    integer, allocatable :: origin(:)
    integer :: here(size(corner)), a, b, i, point, row
    associate (own => block%own, axes => work%refined_axes)
      point = product(own(2, :) - own(1, :) + 1)
      allocate (content(point, work%marks), origin(point))
      call block_content(block, content, origin)
      here = corner - lower
      point = 0
      do a = own(1, 1), own(2, 1)
        here(axes(1)) = a - lower(axes(1))
        do b = own(1, 2), own(2, 2)
          here(axes(2)) = b - lower(axes(2))
          point = point + 1
          row = 0
          do i = 1, size(here)
            row = row*extent(i) + here(i)
          end do
          values(row + 1, :) = [content(point, :), real(origin(point), wp)]
        end do
      end do
    end associate
  end subroutine put_block

end module refined_tile
