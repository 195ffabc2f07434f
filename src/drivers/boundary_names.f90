! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What each part of a basin boundary is: points spread over the lines are tracked to their edge states; then every point is
!> tried on the saddles that were found; what is left is tracked in its turn. Shared among the ranks point by point.
module boundary_names
  use body_family, only: family_t
  use boundary_search, only: plane_t, side_starts
  use edge_state, only: edge_not_known, edge_saddle, labeller_t, reaches_saddle, track_edge
  use errors, only: error_t
  use grid, only: grid_t, point_slice, slice_laws, slice_starts
  use invariant_sets, only: set_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use machine_family, only: machine_neighbourhood, starts_of_section
  use saddle_search, only: add_saddle, find_saddle, saddle_t, seek_saddles
  use start_label, only: label_not_known
  use team, only: team_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: name_points, is_known

  !> Points of a plane that are tracked round by round, at most, and of a line in the first.
  integer, parameter :: most_tracked(3) = [32, 256, 256], most_of_line = 8
  !> Starts from which saddles are sought besides, and their longest period.
  integer, parameter :: sought_starts = 64, sought_periods = 2

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
  subroutine name_points(team, journal, grid, plane, names)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
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
    labeller = labeller_t(plane%journey%moving, plane%attractors, plane%journey%span)
    do round = 1, size(most_tracked)
      if (round == 1) points = chosen_points(plane, most_tracked(round))
      ! What is left is mostly where one name ends and another begins.
      if (round > 1) points = points_left(plane, names, most_tracked(round))
      if (round > 1 .and. size(points) == 0) exit
      tried = size(names%saddles)
      call track_points(team, journal, grid, plane, machines, labeller, points, names)
      if (round == 1) then
        associate (starts => slice_starts(grid, sought_starts, 0))
          call seek_saddles(machines, starts_of_section(machines%centre, starts(:2, :)), sought_periods, names%saddles)
        end associate
      end if
      if (size(names%saddles) > tried) call try_saddles(team, grid, plane, machines, names)
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
  subroutine track_points(team, journal, grid, plane, machines, labeller, points, names)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(labeller_t), intent(in) :: labeller
    integer, intent(in) :: points(:)
    type(names_t), intent(inout) :: names
    real(wp), allocatable :: own(:), found(:)
    type(saddle_t) :: saddle
    real(wp) :: starts(3 + size(grid%others), 2), place(machines%centre%n)
    integer :: k, edge, number, width
    logical :: ok
    names%tracked(points) = .true.
    width = 3 + size(place)
    allocate (own(0))
    call journal%begin('edge states', int(size(points)/team%size(), int64), 0_int64)
    do k = 1 + team%rank(), size(points), team%size()
      associate (point => plane%points(points(k)))
        starts = side_starts(grid, plane, plane%intervals(point%interval))
        call track_edge(machines, labeller, starts, [point%below, point%above], edge, saddle)
      end associate
      place = 0
      if (edge == edge_saddle) place = saddle%points(:, 1)
      own = [own, real(k, wp), real(edge, wp), real(saddle%periods, wp), place]
      call journal%progress(int(k/team%size(), int64))
    end do
    call team%allgather(own, found)
    do k = 1, size(points)
      associate (row => found(width*(locate(k) - 1) + 1:width*locate(k)), point => points(k))
        names%edge(point) = nint(row(2))
        if (names%edge(point) /= edge_saddle) cycle
        call find_saddle(machines, row(4:), nint(row(3)), saddle, ok)
        if (.not. ok) then
          names%edge(point) = edge_not_known
          cycle
        end if
        call add_saddle(machines%centre, saddle, names%saddles, number)
        names%saddle(point) = number
      end associate
    end do

  contains

    !> Row of a point among those of the ranks, each of which has every size-th.
    pure integer function locate(k)
      integer, intent(in) :: k
      integer :: rank, r
      rank = modulo(k - 1, team%size())
      locate = 1 + (k - 1)/team%size()
      do r = 0, rank - 1
        locate = locate + (size(points) - r + team%size() - 1)/team%size()
      end do
    end function locate

  end subroutine track_points

  !> Tries every point without a name on the saddles.
  subroutine try_saddles(team, grid, plane, machines, names)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(names_t), intent(inout) :: names
    integer(int64) :: numbers(size(plane%points))
    real(wp) :: starts(3 + size(grid%others), 2)
    integer :: k, number
    if (size(numbers) == 0) return
    numbers = 0
    do k = 1 + team%rank(), size(numbers), team%size()
      if (names%edge(k) /= edge_not_known .or. .not. is_known(plane, k)) cycle
      starts = side_starts(grid, plane, plane%intervals(plane%points(k)%interval))
      call reaches_saddle(machines%centre, names%saddles, starts, number)
      numbers(k) = number
    end do
    call team%sum(numbers)
    where (numbers > 0)
      names%edge = edge_saddle
      names%saddle = int(numbers)
    end where
  end subroutine try_saddles

end module boundary_names
