! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The points of a basin map as work for a team, and what is counted on the way.
module basin_work
  use attractors, only: last_regime
  use basin, only: basin_points, catalogue_t, points_at_a_time, slice_cache_t
  use errors, only: error_t
  use grid, only: grid_t, point_slice, slice_period
  use kinds, only: int64, wp
  use point_columns, only: at_attractor, at_origin, at_reason, at_regime, at_settle_time, marks_of_attractor
  use point_work, only: point_work_t, watch_t
  use refinement, only: last_origin
  use session, only: session_t
  use status, only: last_reason, reason_settled, reason_time_over
  use single_trajectory, only: span_t
  implicit none
  private

  public :: prepare_counts, sum_counts, needs_label

  type, extends(point_work_t), public :: basin_work_t
    type(grid_t) :: grid
    type(span_t) :: span
    integer :: max_period = 16
    type(catalogue_t), allocatable :: catalogues(:)
    type(slice_cache_t) :: cache
    !> Points per regime, per reason, and per entry of the catalogue.
    integer(int64) :: regimes(0:last_regime) = 0, reasons(0:last_reason) = 0
    integer(int64), allocatable :: captured(:)
    !> Points that ended without a label.
    integer(int64) :: unlabelled = 0
    !> Points of a refined map per origin.
    integer(int64) :: origins(0:last_origin) = 0
    !> The slice whose drive period [s] was last asked for.
    integer(int64) :: period_slice = -1
    real(wp) :: period = 1
    !> Entries of the catalogue before each slice.
    integer, allocatable :: offset(:)
  contains
    procedure :: compute => compute_basin_points
    procedure :: note => note_basin_point
    procedure :: distinguish => distinguish_basin_points
    procedure :: points_from => basin_points_from
    procedure :: stands => basin_point_stands
  end type basin_work_t

contains

  !> Counts per entry of the catalogue, all 0.
  subroutine prepare_counts(work)
    type(basin_work_t), intent(inout) :: work
    integer :: i
    work%regimes = 0
    work%reasons = 0
    work%origins = 0
    work%unlabelled = 0
    if (allocated(work%offset)) deallocate (work%offset, work%captured)
    allocate (work%offset(size(work%catalogues) + 1))
    work%offset(1) = 0
    do i = 1, size(work%catalogues)
      work%offset(i + 1) = work%offset(i) + size(work%catalogues(i)%attractors)
    end do
    allocate (work%captured(work%offset(size(work%offset))), source=0_int64)
  end subroutine prepare_counts

  subroutine compute_basin_points(self, index, values, whole, error, watch)
    class(basin_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    call basin_points(self%grid, self%span, self%max_period, self%catalogues, index, self%cache, values, error, whole, watch)
  end subroutine compute_basin_points

  subroutine basin_points_from(self, index, points, error)
    class(basin_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    integer, intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    points = 1
    if (size(self%catalogues) > 0) call points_at_a_time(self%grid, self%span, index, self%cache, points, error)
  end subroutine basin_points_from

  !> Points of one cell are to have the same attractor, and to settle about equally fast.
  subroutine distinguish_basin_points(self, index, values, marks, settling, error)
    class(basin_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(in) :: values(:, :)
    real(wp), intent(out) :: marks(:, :), settling(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: slice
    integer :: i
    marks = values(:, :marks_of_attractor)
    settling = 0
    do i = 1, size(settling)
      if (nint(values(i, at_reason)) /= reason_settled) cycle
      slice = point_slice(self%grid, index(:, i))
      if (slice /= self%period_slice) call slice_period(self%grid, slice, self%period, error)
      if (allocated(error)) return
      self%period_slice = slice
      settling(i) = values(i, at_settle_time)/self%period
    end do
  end subroutine distinguish_basin_points

  subroutine note_basin_point(self, index, values)
    class(basin_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    real(wp), intent(in) :: values(:)
    integer(int64) :: slice
    integer :: k
    associate (regime => nint(values(at_regime)), label => nint(values(at_attractor)), reason => nint(values(at_reason)))
      self%regimes(regime) = self%regimes(regime) + 1
      self%reasons(reason) = self%reasons(reason) + 1
      if (needs_label(values)) self%unlabelled = self%unlabelled + 1
      if (self%refine%active) then
        associate (origin => nint(values(at_origin)))
          self%origins(origin) = self%origins(origin) + 1
        end associate
      end if
      if (label == 0 .or. size(self%catalogues) == 0) return
      slice = point_slice(self%grid, index) + 1
      do k = 1, size(self%catalogues(slice)%attractors)
        if (self%catalogues(slice)%attractors(k)%id == label) then
          self%captured(self%offset(slice) + k) = self%captured(self%offset(slice) + k) + 1
        end if
      end do
    end associate
  end subroutine note_basin_point

  !> A point that converged stays as it is when attractors are added, and so does one that was given up.
  logical function basin_point_stands(self, values)
    class(basin_work_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    associate (unused => self)
    end associate
    basin_point_stands = nint(values(at_reason)) /= reason_time_over
  end function basin_point_stands

  !> Whether a point of these values ran to its end and no attractor is known for it.
  pure logical function needs_label(values)
    real(wp), intent(in) :: values(:)
    needs_label = nint(values(at_attractor)) == 0 .and. nint(values(at_reason)) == reason_time_over
  end function needs_label

  subroutine sum_counts(session, work)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(inout) :: work
    call session%team%sum(work%regimes)
    call session%team%sum(work%reasons)
    call session%team%sum(work%origins)
    if (size(work%captured) > 0) call session%team%sum(work%captured)
  end subroutine sum_counts

end module basin_work
