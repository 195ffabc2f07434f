! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a dry run reports of a grid that is computed tile by tile.
module run_plan
  use command_line, only: command_t
  use errors, only: error_t
  use journal, only: duration_text, size_text
  use kinds, only: int64, wp
  use point_work, only: compute_list, point_work_t
  use shard, only: in_shard
  use spread_order, only: spread_subscripts
  use text, only: to_text
  use tiles, only: new_tiling, tiling_t
  implicit none
  private

  public :: plan_text, pilot_seconds

  !> Points of the small sample from which the time is estimated.
  integer, parameter :: pilot_points = 64

contains

  !> Seconds per point on one core, from a small sample spread over the grid.
  subroutine pilot_seconds(work, lengths, seconds, error)
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: lengths(:)
    real(wp), intent(out) :: seconds
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: values(pilot_points, work%variables), start
    integer :: index(size(lengths), pilot_points), i
    logical :: whole
    do i = 1, pilot_points
      index(:, i) = spread_subscripts(i, lengths)
    end do
    ! Of the processor, which others may be using too.
    call cpu_time(start)
    call compute_list(work, index, values, whole, error)
    if (allocated(error)) return
    call cpu_time(seconds)
    seconds = (seconds - start)/pilot_points
  end subroutine pilot_seconds

  !> Points, tiles and bytes of a grid, or of the share that the command computes, and the time that `seconds_per_point` on one
  !> core mean.
  function plan_text(lengths, tile_shape, bytes_per_point, seconds_per_point, command) result(lines)
    integer, intent(in) :: lengths(:), tile_shape(:)
    integer(int64), intent(in) :: bytes_per_point
    real(wp), intent(in) :: seconds_per_point
    type(command_t), intent(in) :: command
    character(len=:), allocatable :: lines
    type(tiling_t) :: tiling
    type(error_t), allocatable :: error
    integer(int64) :: points
    integer :: i, tile
    call new_tiling(int(lengths, int64), int(tile_shape, int64), tiling, error)
    if (allocated(error)) then
      lines = error%message
      return
    end if
    points = product(int(lengths, int64))
    lines = to_text(lengths(1))
    do i = 2, size(lengths)
      lines = lines//' x '//to_text(lengths(i))
    end do
    lines = lines//' = '//to_text(points)//' points in '//to_text(tiling%count())//' tiles; '
    if (command%shard > 0) then
      associate (mine => pack([(tile, tile=1, tiling%count())], &
                              [(in_shard(tile, command%shard, command%shard_count), tile=1, tiling%count())]))
        points = sum([(tiling%points(mine(tile)), tile=1, size(mine))])
        lines = lines//'share '//to_text(command%shard)//' of '//to_text(command%shard_count)//': '//to_text(points)// &
          ' points in '//to_text(size(mine))//' tiles; '
      end associate
    end if
    lines = lines//size_text(points*bytes_per_point)//' while it runs, less when compressed; about '// &
      duration_text(points*seconds_per_point)//' on one core (from a small sample), divided by the number of ranks'
  end function plan_text

end module run_plan
