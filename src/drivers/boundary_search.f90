! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The boundary lines of one plane of a map, with the work shared among the ranks: edge by edge in turn, so that the result does not
!> depend on their number. Parts that are done are kept for an interrupted run.
module boundary_search
  use attractors, only: attractor_t
  use bisection, only: halve_intervals, interval_t, join_slivers, label_starts
  use boundary_lines, only: crossed_edges, crowded_cells, edge_t, line_point_t, line_t, link_lines
  use checkpoint, only: checkpoint_t
  use grid, only: grid_t, point_start
  use kinds, only: int64, wp
  use session, only: session_t
  use trajectory_slots, only: ensemble_t
  implicit none
  private

  public :: search_lines, plane_starts, side_starts

  !> Boundary points are known to this share of the range of their axis.
  real(wp), parameter :: accuracy = 1e-10_wp
  !> Numbers of an interval on its way between ranks.
  integer, parameter :: packed = 5
  !> Edges, and starts to label, that are kept together.
  integer, parameter :: edges_of_part = 512, starts_of_part = 65536

  !> A plane of the grid over two axes through the point `index`, and what labels its starts.
  type, public :: plane_t
    integer :: axes(2) = 0
    integer, allocatable :: index(:)
    real(wp), allocatable :: first(:), second(:)
    type(ensemble_t) :: ensemble
    type(attractor_t), allocatable :: attractors(:)
    integer, allocatable :: labels(:, :)
    logical, allocatable :: inferred(:, :)
    !> Points of a refined map whose labels were inferred wrongly beside the boundary.
    integer :: corrected = 0
    !> Edges that are crossed, intervals that they fell into, and lines.
    type(edge_t), allocatable :: edges(:)
    type(interval_t), allocatable :: intervals(:)
    type(line_point_t), allocatable :: points(:)
    type(line_t), allocatable :: lines(:)
  end type plane_t

contains

  !> Finds edges, points and lines of a plane whose labels are there.
  subroutine search_lines(session, kept, grid, plane)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(inout) :: plane
    integer, allocatable :: cells(:, :), centres(:)
    real(wp), allocatable :: corners(:, :, :)
    integer :: k
    call correct_labels(session, kept, grid, plane)
    call halve_edges(session, kept, grid, plane)
    call join_slivers(plane%intervals)
    call crowded_cells(shape(plane%labels), plane%edges, plane%intervals, .true., cells)
    allocate (centres(size(cells, 2)))
    allocate (corners(3 + size(grid%others), size(cells, 2), 2))
    do k = 1, size(cells, 2)
      corners(:, k, 1) = plane_starts(grid, plane, cells(1, k), cells(2, k))
      corners(:, k, 2) = plane_starts(grid, plane, cells(1, k) + 1, cells(2, k) + 1)
    end do
    call share_labels(session, kept, plane, (corners(:, :, 1) + corners(:, :, 2))/2, centres)
    call link_lines(plane%first, plane%second, plane%edges, plane%intervals, centres, plane%points, plane%lines)
  end subroutine search_lines

  !> The start at the point (i, j) of the plane.
  pure function plane_starts(grid, plane, i, j) result(start)
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    integer, intent(in) :: i, j
    real(wp) :: start(3 + size(grid%others))
    integer :: index(size(plane%index))
    index = plane%index
    index(plane%axes) = [i, j]
    start = point_start(grid, index)
  end function plane_starts

  !> The starts on both sides of a boundary point: the ends of its interval.
  pure function side_starts(grid, plane, interval) result(starts)
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(interval_t), intent(in) :: interval
    real(wp) :: starts(3 + size(grid%others), 2), from(3 + size(grid%others)), to(3 + size(grid%others))
    associate (edge => plane%edges(interval%edge))
      from = plane_starts(grid, plane, edge%i, edge%j)
      to = plane_starts(grid, plane, edge%i + merge(1, 0, edge%along == 1), edge%j + merge(1, 0, edge%along == 2))
      starts(:, 1) = from + interval%low*(to - from)
      starts(:, 2) = from + interval%high*(to - from)
    end associate
  end function side_starts

  !> Labels of starts on all ranks, each start by one of them.
  subroutine share_labels(session, kept, plane, starts, labels)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(plane_t), intent(in) :: plane
    real(wp), intent(in) :: starts(:, :)
    integer, intent(out) :: labels(:)
    integer, allocatable :: mine(:), own(:)
    integer(int64), allocatable :: sums(:)
    real(wp), allocatable :: values(:)
    integer :: k, first, last
    logical :: found
    do first = 1, size(labels), starts_of_part
      last = min(size(labels), first + starts_of_part - 1)
      call kept%recall(session, values, found)
      if (.not. found) then
        associate (team => session%team)
          mine = [(k, k=first + team%rank(), last, team%size())]
          allocate (own(size(mine)), sums(first:last))
          call label_starts(plane%ensemble, plane%attractors, starts(:, mine), own)
          sums = 0
          sums(mine) = own
          call team%sum(sums)
        end associate
        values = real(sums, wp)
        deallocate (own, sums)
        call kept%keep(session, values)
      end if
      labels(first:last) = nint(values)
    end do
  end subroutine share_labels

  !> Computes the inferred labels at the ends of crossed edges, until all of these are computed.
  subroutine correct_labels(session, kept, grid, plane)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(inout) :: plane
    logical, allocatable :: wanted(:, :)
    integer, allocatable :: labels(:), chosen_cells(:, :)
    real(wp), allocatable :: starts(:, :)
    integer :: i, j, k
    do
      call crossed_edges(plane%labels, plane%edges)
      if (.not. any(plane%inferred)) return
      allocate (wanted(size(plane%first), size(plane%second)), source=.false.)
      do k = 1, size(plane%edges)
        associate (edge => plane%edges(k))
          wanted(edge%i, edge%j) = .true.
          wanted(edge%i + merge(1, 0, edge%along == 1), edge%j + merge(1, 0, edge%along == 2)) = .true.
        end associate
      end do
      wanted = wanted .and. plane%inferred
      if (.not. any(wanted)) return
      allocate (chosen_cells(2, count(wanted)))
      k = 0
      do j = 1, size(wanted, 2)
        do i = 1, size(wanted, 1)
          if (.not. wanted(i, j)) cycle
          k = k + 1
          chosen_cells(:, k) = [i, j]
        end do
      end do
      allocate (starts(3 + size(grid%others), k), labels(k))
      do k = 1, size(labels)
        starts(:, k) = plane_starts(grid, plane, chosen_cells(1, k), chosen_cells(2, k))
      end do
      call share_labels(session, kept, plane, starts, labels)
      do k = 1, size(labels)
        associate (label => plane%labels(chosen_cells(1, k), chosen_cells(2, k)))
          if (label /= labels(k)) plane%corrected = plane%corrected + 1
          label = labels(k)
          plane%inferred(chosen_cells(1, k), chosen_cells(2, k)) = .false.
        end associate
      end do
      deallocate (wanted, chosen_cells, starts, labels)
    end do
  end subroutine correct_labels

  !> The intervals of all crossed edges, on all ranks.
  subroutine halve_edges(session, kept, grid, plane)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(inout) :: plane
    real(wp), allocatable :: part(:), all_values(:)
    integer :: k, first
    logical :: found
    allocate (all_values(0))
    call session%journal%begin('edges', int(size(plane%edges), int64), 0_int64)
    do first = 1, size(plane%edges), edges_of_part
      call kept%recall(session, part, found)
      if (.not. found) then
        call halve_part(session, grid, plane, first, min(size(plane%edges), first + edges_of_part - 1), part)
        call kept%keep(session, part)
      end if
      all_values = [all_values, part]
    end do
    allocate (plane%intervals(size(all_values)/packed))
    do k = 1, size(plane%intervals)
      associate (values => all_values(packed*(k - 1) + 1:packed*k))
        plane%intervals(k) = interval_t(nint(values(1)), values(2), values(3), nint(values(4)), nint(values(5)), .true.)
      end associate
    end do
  end subroutine halve_edges

  !> The intervals, as numbers one after the other, of the crossed edges `first` to `last`.
  subroutine halve_part(session, grid, plane, first, last, part)
    type(session_t), intent(inout) :: session
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    integer, intent(in) :: first, last
    real(wp), allocatable, intent(out) :: part(:)
    integer, allocatable :: mine(:)
    real(wp), allocatable :: from(:, :), to(:, :), tolerance(:)
    type(interval_t), allocatable :: own(:)
    type(interval_t) :: one
    integer :: k, left
    mine = [(k, k=first + session%team%rank(), last, session%team%size())]
    allocate (from(3 + size(grid%others), size(mine)), to(3 + size(grid%others), size(mine)), tolerance(size(mine)), &
              own(size(mine)))
    do k = 1, size(mine)
      associate (edge => plane%edges(mine(k)))
        one = interval_t(edge=mine(k))
        from(:, k) = plane_starts(grid, plane, edge%i, edge%j)
        to(:, k) = plane_starts(grid, plane, edge%i + merge(1, 0, edge%along == 1), edge%j + merge(1, 0, edge%along == 2))
        one%below = plane%labels(edge%i, edge%j)
        one%above = plane%labels(edge%i + merge(1, 0, edge%along == 1), edge%j + merge(1, 0, edge%along == 2))
        one%edge = k
        own(k) = one
        tolerance(k) = tolerance_of(plane, edge)
      end associate
    end do
    do
      call halve_intervals(plane%ensemble, plane%attractors, from, to, tolerance, own, left)
      call session%journal%progress(min(int(last, int64), int(first - 1, int64) + max(size(mine) - left, 0)*session%team%size()))
      if (left == 0) exit
    end do
    own%edge = mine(own%edge)
    call session%team%allgather([(real(own(k)%edge, wp), own(k)%low, own(k)%high, real(own(k)%below, wp), real(own(k)%above, wp), &
                                  k=1, size(own))], part)
  end subroutine halve_part

  !> The accuracy as a share of an edge.
  pure real(wp) function tolerance_of(plane, edge) result(tolerance)
    type(plane_t), intent(in) :: plane
    type(edge_t), intent(in) :: edge
    if (edge%along == 1) then
      tolerance = accuracy*(plane%first(size(plane%first)) - plane%first(1))/(plane%first(edge%i + 1) - plane%first(edge%i))
    else
      tolerance = accuracy*(plane%second(size(plane%second)) - plane%second(1))/(plane%second(edge%j + 1) - plane%second(edge%j))
    end if
  end function tolerance_of

end module boundary_search
