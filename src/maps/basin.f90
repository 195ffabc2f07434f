! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Points of a basin map: start to values, with the machine of the current slice at hand.
module basin
  use attractors, only: attractor_t
  use discover, only: discover_attractors, sort_attractors
  use errors, only: error_t
  use grid, only: grid_t, point_slice, point_start, slice_motion, slice_starts
  use kinds, only: int64, wp
  use match, only: carry_labels
  use motion, only: motion_t
  use trajectory, only: outcome_t, run_trajectory, span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: discover_slice, label_slices, basin_point, outcome_values

  !> Values of a point, in the order of the file.
  integer, parameter, public :: basin_variables = 13

  !> The attractors of one slice.
  type, public :: catalogue_t
    type(attractor_t), allocatable :: attractors(:)
  end type catalogue_t

  !> The machine of the slice that was last looked at.
  type, public :: slice_cache_t
    integer(int64) :: slice = -1
    type(motion_t) :: moving
  end type slice_cache_t

contains

  !> Attractors of a slice from its own sample of starts and, as further starts, the section points of
  !> `neighbours` (attractors of other slices).
  subroutine discover_slice(grid, span, slice, sample, seed, max_period, neighbours, catalogue, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer(int64), intent(in) :: slice
    integer, intent(in) :: sample, seed, max_period
    type(attractor_t), intent(in) :: neighbours(:)
    type(catalogue_t), intent(inout) :: catalogue
    type(error_t), allocatable, intent(out) :: error
    type(motion_t) :: moving
    real(wp), allocatable :: starts(:, :)
    integer :: i
    call slice_motion(grid, slice, moving, error)
    if (allocated(error)) return
    starts = slice_starts(grid, sample, seed)
    if (allocated(catalogue%attractors)) starts = starts(:, :0)
    do i = 1, size(neighbours)
      if (neighbours(i)%rests) cycle
      starts = reshape([starts, neighbours(i)%points(:, 1), 0.0_wp], [3, size(starts, 2) + 1])
    end do
    call discover_attractors(moving, span, starts, max_period, catalogue%attractors)
    call sort_attractors(catalogue%attractors)
  end subroutine discover_slice

  !> Labels along the slices in order, so that a branch keeps its number.
  pure subroutine label_slices(catalogues)
    type(catalogue_t), intent(inout) :: catalogues(:)
    type(attractor_t), allocatable :: known(:)
    integer :: i
    allocate (known(0))
    do i = 1, size(catalogues)
      call carry_labels(known, catalogues(i)%attractors)
    end do
  end subroutine label_slices

  !> Values of the point at `index` (from 1 along each axis). Without a start among the axes every point is its own
  !> slice: then `catalogues` is empty and the point's attractor is discovered on the spot, unlabelled.
  subroutine basin_point(grid, span, max_period, catalogues, index, cache, values, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer, intent(in) :: max_period
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(in) :: index(:)
    type(slice_cache_t), intent(inout) :: cache
    real(wp), intent(out) :: values(basin_variables)
    type(error_t), allocatable, intent(out) :: error
    type(attractor_t), allocatable :: own(:)
    type(outcome_t) :: outcome
    integer(int64) :: slice
    real(wp) :: start(3)
    slice = point_slice(grid, index)
    if (slice /= cache%slice) then
      call slice_motion(grid, slice, cache%moving, error)
      if (allocated(error)) return
      cache%slice = slice
    end if
    start = point_start(grid, index)
    if (size(catalogues) > 0) then
      call run_trajectory(cache%moving, catalogues(slice + 1)%attractors, span, start(1), start(2), start(3), &
                          outcome)
    else
      call discover_attractors(cache%moving, span, reshape(start, [3, 1]), max_period, own)
      call run_trajectory(cache%moving, own, span, start(1), start(2), start(3), outcome)
    end if
    values = outcome_values(outcome)
  end subroutine basin_point

  !> An outcome in the order of the file: regime, attractor, reason, period, event word, impacts per period, mean
  !> impact speed, amplitude, x_max, x_min, v_max, settle time (not a number: not captured), grazing margin (infinite:
  !> no barrier was missed).
  pure function outcome_values(outcome) result(values)
    type(outcome_t), intent(in) :: outcome
    real(wp) :: values(basin_variables)
    associate (f => outcome%features)
      values = [real(f%regime, wp), real(outcome%attractor, wp), real(outcome%reason, wp), &
                real(outcome%period, wp), real(f%word, wp), f%impacts_per_period, f%mean_impact_speed, &
                f%amplitude, f%x_max, f%x_min, f%v_max, outcome%settle_time, f%grazing_margin]
      if (outcome%settle_time < 0) values(12) = ieee_value(1.0_wp, ieee_quiet_nan)
      if (.not. f%grazing_margin < huge(1.0_wp)) values(13) = ieee_value(1.0_wp, ieee_positive_inf)
    end associate
  end function outcome_values

end module basin
