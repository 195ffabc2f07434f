! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What each part of a basin boundary is: points spread over the lines are tracked to their edge states; then every point is
!> tried on the saddles that were found; what is left is tracked in its turn. Shared among the ranks point by point; parts that are
!> done are kept for an interrupted run.
module boundary_names
  use body_family, only: family_t
  use boundary_search, only: plane_t, side_starts
  use checkpoint, only: checkpoint_t
  use edge_state, only: edge_not_known, edge_saddle, labeller_t, reaches_saddle, track_edge
  use errors, only: error_t
  use grid, only: grid_t, point_slice, slice_laws, slice_starts
  use invariant_sets, only: set_t
  use kinds, only: int64, wp
  use machine_family, only: machine_neighbourhood
  use saddle_search, only: add_saddle, find_saddle, saddle_at, saddle_t
  use session, only: session_t
  use start_label, only: label_not_known
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: name_points, is_known

  !> Points of a plane that are tracked round by round, at most, and of a line in the first.
  integer, parameter :: most_tracked(3) = [32, 256, 256], most_of_line = 8
  !> Starts from which saddles are sought besides, of these periods and of those of the attractors, which are up to the last.
  integer, parameter :: sought_starts = 64, sought_periods(2) = [1, 2], longest_sought = 32
  !> Points to track, starts to seek from, and points to try, that are kept together.
  integer, parameter :: tracked_of_part = 32, sought_of_part = 16, tried_of_part = 1024

  !> Names of the points of a plane, and its saddles; of how many points each saddle is the edge state.
  type, public :: names_t
    integer, allocatable :: edge(:), saddle(:), reached(:)
    logical, allocatable :: tracked(:)
    type(saddle_t), allocatable :: saddles(:)
    !> Sides of the stable and unstable sets, and the saddle of each.
    type(set_t), allocatable :: sets(:)
    integer, allocatable :: saddle_of_set(:)
    !> Why the edge states of the machine cannot be tracked; '' if they can.
    character(len=:), allocatable :: problem
  end type names_t

contains

  !> Names the points of a plane whose lines are there.
  subroutine name_points(session, kept, grid, plane, names)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(names_t), intent(out) :: names
    type(family_t) :: family
    type(neighbourhood_t) :: machines
    type(labeller_t) :: labeller
    type(error_t), allocatable :: error
    integer, allocatable :: points(:)
    integer :: round, tried
    allocate (names%edge(size(plane%points)), names%saddle(size(plane%points)), source=0)
    allocate (names%tracked(size(plane%points)), source=.false.)
    allocate (names%saddles(0), names%reached(0), names%sets(0), names%saddle_of_set(0))
    family%laws = slice_laws(grid, point_slice(grid, plane%index))
    family%options = grid%options
    call machine_neighbourhood(family, 0.0_wp, machines, error)
    names%problem = ''
    if (allocated(error)) names%problem = error%message
    if (allocated(error)) return
    labeller = labeller_t(plane%ensemble%moving, plane%attractors, plane%ensemble%span)
    do round = 1, size(most_tracked)
      if (round == 1) points = chosen_points(plane, most_tracked(round))
      ! What is left is mostly where one name ends and another begins.
      if (round > 1) points = points_left(plane, names, most_tracked(round))
      if (round > 1 .and. size(points) == 0) exit
      tried = size(names%saddles)
      call track_points(session, kept, grid, plane, machines, labeller, points, names)
      if (round == 1) call seek_saddles(session, kept, grid, machines, periods_of(plane), names%saddles)
      if (size(names%saddles) > tried) call try_saddles(session, kept, grid, plane, machines, names)
    end do
  end subroutine name_points

  !> Whether the labels on both sides of a point are known.
  pure elemental logical function is_known(plane, point) result(known)
    type(plane_t), intent(in) :: plane
    integer, intent(in) :: point
    associate (one => plane%points(point))
      known = one%interval > 0 .and. one%below /= label_not_known .and. one%above /= label_not_known
    end associate
  end function is_known

  !> At most so many points to track, spread over the longest lines.
  pure function chosen_points(plane, most) result(points)
    type(plane_t), intent(in) :: plane
    integer, intent(in) :: most
    integer, allocatable :: points(:), lengths(:)
    integer :: l, i, share, n, shortest
    lengths = [(size(plane%lines(l)%points), l=1, size(plane%lines))]
    shortest = 1
    do while (count(lengths >= shortest) > most)
      shortest = shortest + 1
    end do
    share = max(1, min(most_of_line, most/max(1, count(lengths >= shortest))))
    allocate (points(0))
    do l = 1, size(plane%lines)
      if (lengths(l) < shortest) cycle
      associate (own => pack(plane%lines(l)%points, [(is_known(plane, plane%lines(l)%points(i)), i=1, lengths(l))]))
        n = min(share, size(own))
        points = [points, [(own(1 + ((2*i - 1)*size(own))/(2*n)), i=1, n)]]
      end associate
    end do
  end function chosen_points

  !> Points without a name that were not tracked, at most so many, spread over all.
  pure function points_left(plane, names, most) result(points)
    type(plane_t), intent(in) :: plane
    type(names_t), intent(in) :: names
    integer, intent(in) :: most
    integer, allocatable :: points(:)
    logical :: left(size(plane%points))
    integer :: i, n
    do i = 1, size(left)
      left(i) = names%edge(i) == edge_not_known .and. .not. names%tracked(i)
      if (left(i)) left(i) = is_known(plane, i)
    end do
    points = pack([(i, i=1, size(left))], left)
    n = min(most, size(points))
    points = [(points(1 + ((2*i - 1)*size(points))/(2*n)), i=1, n)]
  end function points_left

  !> Names points by tracking them.
  subroutine track_points(session, kept, grid, plane, machines, labeller, points, names)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(labeller_t), intent(in) :: labeller
    integer, intent(in) :: points(:)
    type(names_t), intent(inout) :: names
    real(wp), allocatable :: rows(:)
    type(saddle_t) :: saddle
    integer :: first, last, i, number, width
    logical :: ok, found
    names%tracked(points) = .true.
    width = 3 + machines%centre%n
    call session%journal%begin('edge states', int(size(points), int64), 0_int64)
    do first = 1, size(points), tracked_of_part
      last = min(size(points), first + tracked_of_part - 1)
      call kept%recall(session, rows, found)
      if (.not. found) then
        call track_part(session, grid, plane, machines, labeller, points(:last), first, rows)
        call kept%keep(session, rows)
      end if
      ! A saddle has its number by the order of the points, whatever the ranks.
      do i = first, last
        associate (row => row_of(i), point => points(i))
          names%edge(point) = nint(row(2))
          if (nint(row(3)) == 0) cycle
          call find_saddle(machines, row(4:), nint(row(3)), saddle, ok)
          if (ok) call add_saddle(machines%centre, saddle, names%saddles, number)
          if (names%edge(point) /= edge_saddle) cycle
          if (ok) names%saddle(point) = number
          if (.not. ok) names%edge(point) = edge_not_known
        end associate
      end do
    end do

  contains

    !> The row of the point number `i`: they come rank by rank.
    pure function row_of(i) result(row)
      integer, intent(in) :: i
      real(wp) :: row(width)
      integer :: k
      do k = 1, size(rows), width
        if (nint(rows(k)) == i) row = rows(k:k + width - 1)
      end do
    end function row_of

  end subroutine track_points

  !> Tracks the points from number `first` on, each on one rank: number, edge state, periods (0: none) and a section point of the
  !> saddle met.
  subroutine track_part(session, grid, plane, machines, labeller, points, first, rows)
    type(session_t), intent(inout) :: session
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(labeller_t), intent(in) :: labeller
    integer, intent(in) :: points(:), first
    real(wp), allocatable, intent(out) :: rows(:)
    real(wp), allocatable :: own(:)
    real(wp) :: starts(3 + size(grid%others), 2), position(machines%centre%n)
    type(saddle_t) :: saddle
    integer :: k, edge
    allocate (own(0))
    associate (team => session%team)
      do k = first + team%rank(), size(points), team%size()
        associate (point => plane%points(points(k)))
          starts = side_starts(grid, plane, plane%intervals(point%interval))
          call track_edge(machines, labeller, starts, [point%below, point%above], edge, saddle)
        end associate
        position = 0
        if (saddle%periods > 0) position = saddle%points(:, 1)
        own = [own, real(k, wp), real(edge, wp), real(saddle%periods, wp), position]
        call session%journal%progress(int(k, int64))
      end do
      call team%allgather(own, rows)
    end associate
  end subroutine track_part

  !> Periods of the saddles that are sought, each once.
  pure function periods_of(plane) result(periods)
    type(plane_t), intent(in) :: plane
    integer, allocatable :: periods(:)
    integer :: k
    periods = sought_periods
    do k = 1, size(plane%attractors)
      associate (period => plane%attractors(k)%period)
        if (period > 0 .and. period <= longest_sought .and. .not. any(periods == period)) periods = [periods, period]
      end associate
    end do
  end function periods_of

  !> Adds the saddles that Newton's method comes to from starts spread over the map, each on one rank, in the order of the starts.
  subroutine seek_saddles(session, kept, grid, machines, periods, saddles)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: periods(:)
    type(saddle_t), allocatable, intent(inout) :: saddles(:)
    real(wp) :: starts(machines%centre%n, sought_starts)
    real(wp), allocatable :: rows(:)
    type(saddle_t) :: saddle
    integer :: first, i, k, number, width
    logical :: ok, found
    associate (plane_starts => slice_starts(grid, sought_starts, 0))
      starts = machines%centre%starts_of_section(plane_starts(:2, :))
    end associate
    width = 2 + machines%centre%n
    call session%journal%begin('starts to seek saddles from', int(sought_starts, int64), 0_int64)
    do first = 1, sought_starts, sought_of_part
      call kept%recall(session, rows, found)
      if (.not. found) then
        call seek_part(session, machines, starts(:, :first + sought_of_part - 1), first, periods, rows)
        call kept%keep(session, rows)
      end if
      do i = first, first + sought_of_part - 1
        do k = 1, size(rows), width
          if (nint(rows(k)) /= i) cycle
          call saddle_at(machines, rows(k + 2:k + width - 1), nint(rows(k + 1)), saddle, ok)
          if (ok) call add_saddle(machines%centre, saddle, saddles, number)
        end do
      end do
    end do
  end subroutine seek_saddles

  !> The saddles that are found from the starts from number `first` on: number, periods, first section point.
  subroutine seek_part(session, machines, starts, first, periods, rows)
    type(session_t), intent(inout) :: session
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: first, periods(:)
    real(wp), allocatable, intent(out) :: rows(:)
    real(wp), allocatable :: own(:)
    type(saddle_t) :: saddle
    integer :: i, n
    logical :: ok
    allocate (own(0))
    associate (team => session%team)
      do i = first + team%rank(), size(starts, 2), team%size()
        do n = 1, size(periods)
          call find_saddle(machines, starts(:, i), periods(n), saddle, ok)
          if (ok) own = [own, real(i, wp), real(periods(n), wp), saddle%points(:, 1)]
        end do
        call session%journal%progress(int(i, int64))
      end do
      call team%allgather(own, rows)
    end associate
  end subroutine seek_part

  !> Tries every point without a name on the saddles.
  subroutine try_saddles(session, kept, grid, plane, machines, names)
    type(session_t), intent(inout) :: session
    type(checkpoint_t), intent(inout) :: kept
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(names_t), intent(inout) :: names
    real(wp), allocatable :: numbers(:)
    integer :: first, last, i
    logical :: found
    call session%journal%begin('boundary points', int(size(plane%points), int64), 0_int64)
    do first = 1, size(plane%points), tried_of_part
      last = min(size(plane%points), first + tried_of_part - 1)
      call kept%recall(session, numbers, found)
      if (.not. found) then
        call try_part(session, grid, plane, machines, names, first, last, numbers)
        call kept%keep(session, numbers)
      end if
      do i = first, last
        if (nint(numbers(i - first + 1)) == 0) cycle
        names%edge(i) = edge_saddle
        names%saddle(i) = nint(numbers(i - first + 1))
      end do
    end do
  end subroutine try_saddles

  !> The saddles that the points `first` to `last` without a name lead to, 0 for none.
  subroutine try_part(session, grid, plane, machines, names, first, last, found)
    type(session_t), intent(inout) :: session
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(names_t), intent(in) :: names
    integer, intent(in) :: first, last
    real(wp), allocatable, intent(out) :: found(:)
    integer(int64) :: numbers(first:last)
    real(wp) :: starts(3 + size(grid%others), 2)
    integer :: k, number
    numbers = 0
    do k = first + session%team%rank(), last, session%team%size()
      call session%journal%progress(int(k, int64))
      if (names%edge(k) /= edge_not_known .or. .not. is_known(plane, k)) cycle
      starts = side_starts(grid, plane, plane%intervals(plane%points(k)%interval))
      call reaches_saddle(machines%centre, names%saddles, starts, number)
      numbers(k) = number
    end do
    call session%team%sum(numbers)
    found = real(numbers, wp)
  end subroutine try_part

end module boundary_names
