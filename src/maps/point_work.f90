! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is computed at the points of a grid, and lists of points computed piece by piece.
module point_work
  use errors, only: error_t
  use kinds, only: int64, wp
  use refinement, only: refine_t
  use work_watch, only: watch_t
  implicit none
  private

  public :: compute_list, watch_t

  type, abstract, public :: point_work_t
    integer :: variables = 0
    !> Points computed at a time: as many as a stop signal may wait for.
    integer :: block = 1
    !> Where not all points are computed: how they are chosen, and along which two axes.
    type(refine_t) :: refine
    integer :: refined_axes(2) = 0
    !> Number of values that distinguish its points; those are kept.
    integer :: marks = 0
    !> Points computed by this process, with those that several blocks have asked for.
    integer(int64) :: computed = 0
    !> Tiles are there already: only points that do not stand are computed again.
    logical :: again = .false.
  contains
    procedure(compute_points), deferred :: compute
    procedure(note_point), deferred :: note
    procedure :: distinguish => by_all_values
    procedure :: points_from => block_of_points
    procedure :: stands => never_again
  end type point_work_t

  abstract interface
    !> Values (points, variables) of the points at `index` (axes, points), from 1 along each axis. Where this takes long the watch
    !> is looked at on the way; `whole` is false if it requests a stop, and the values are void.
    subroutine compute_points(self, index, values, whole, error, watch)
      import :: error_t, point_work_t, watch_t, wp
      class(point_work_t), intent(inout) :: self
      integer, intent(in) :: index(:, :)
      real(wp), intent(out) :: values(:, :)
      logical, intent(out) :: whole
      type(error_t), allocatable, intent(out) :: error
      class(watch_t), intent(inout), optional :: watch
    end subroutine compute_points

    !> Counts a point that is done, computed now or read back after an interruption.
    subroutine note_point(self, index, values)
      import :: point_work_t, wp
      class(point_work_t), intent(inout) :: self
      integer, intent(in) :: index(:)
      real(wp), intent(in) :: values(:)
    end subroutine note_point
  end interface

contains

  !> What distinguishes the points at `index` (axes, points), of their values (points, variables): `marks` (points, marks) and how
  !> long they take to settle, in drive periods.
  subroutine by_all_values(self, index, values, marks, settling, error)
    class(point_work_t), intent(inout) :: self
    integer, intent(in) :: index(:, :)
    real(wp), intent(in) :: values(:, :)
    real(wp), intent(out) :: marks(:, :), settling(:)
    type(error_t), allocatable, intent(out) :: error
    marks = values(:, :self%marks)
    settling(:size(index, 2)) = 0
  end subroutine by_all_values

  !> Points to compute at a time from that at `index` on.
  subroutine block_of_points(self, index, points, error)
    class(point_work_t), intent(inout) :: self
    integer, intent(in) :: index(:)
    integer, intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    associate (unused => index)
      points = self%block
    end associate
  end subroutine block_of_points

  !> Whether a point of these values need not be computed again.
  logical function never_again(self, values)
    class(point_work_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    associate (unused => self, unused_too => values)
    end associate
    never_again = .true.
  end function never_again

  !> Values (points, variables) of the points at `index` (axes, points); `whole` is false if the watch requests a stop before the
  !> last of them.
  subroutine compute_list(work, index, values, whole, error, watch)
    class(point_work_t), intent(inout) :: work
    integer, intent(in) :: index(:, :)
    real(wp), intent(out) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    logical :: stop_now
    integer :: first, last, points
    whole = .true.
    last = 0
    do while (last < size(index, 2))
      first = last + 1
      call work%points_from(index(:, first), points, error)
      if (allocated(error)) return
      last = min(last + points, size(index, 2))
      call work%compute(index(:, first:last), values(first:last, :), whole, error, watch)
      if (allocated(error) .or. .not. whole) return
      work%computed = work%computed + last - first + 1
      if (.not. present(watch)) cycle
      call watch%look(stop_now)
      whole = .not. stop_now .or. last == size(index, 2)
      if (.not. whole) return
    end do
  end subroutine compute_list

end module point_work
