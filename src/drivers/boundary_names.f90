! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What each part of a basin boundary is: points spread over the lines are tracked to their edge states; then every point is
!> tried on the saddles that were found; lines are cut where the name changes. Shared among the ranks point by point.
module boundary_names
  use body_family, only: body_neighbourhood, family_t
  use boundary_lines, only: line_t
  use boundary_search, only: plane_t, side_starts
  use edge_state, only: edge_not_known, edge_saddle, reaches_saddle, track_edge
  use errors, only: error_t
  use grid, only: grid_t, point_slice, slice_laws, slice_starts
  use journal, only: journal_t
  use kinds, only: int64, wp
  use one_body, only: one_body_t
  use saddle_search, only: add_saddle, find_saddle, saddle_t, seek_saddles
  use start_label, only: label_not_known
  use team, only: team_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: name_points, cut_lines

  !> Points tracked: of a plane, and of a line, at most.
  integer, parameter :: most_tracked = 256, most_of_line = 24
  !> Starts from which saddles are sought besides, and their longest period.
  integer, parameter :: sought_starts = 64, sought_periods = 2
  !> Points without a name between two of one name get it where they are at most this share of their line, or so few.
  real(wp), parameter :: bridged = 0.1_wp
  integer, parameter :: few = 5

  !> Names of the points of a plane, and its saddles; of how many points each saddle is the edge state.
  type, public :: names_t
    integer, allocatable :: edge(:), saddle(:), reached(:)
    type(saddle_t), allocatable :: saddles(:)
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
    type(error_t), allocatable :: error
    integer :: k
    allocate (names%edge(size(plane%points)), names%saddle(size(plane%points)), source=0)
    allocate (names%saddles(0), names%reached(0))
    family%laws = slice_laws(grid, point_slice(grid, plane%index))
    family%options = grid%options
    call body_neighbourhood(family, 0.0_wp, machines, error)
    names%problem = ''
    if (allocated(error)) names%problem = error%message
    if (allocated(error)) return
    select type (body => machines%centre)
    type is (one_body_t)
      call track_samples(team, journal, grid, plane, machines, body, names)
      associate (starts => slice_starts(grid, sought_starts, 0))
        call seek_saddles(machines, body, starts(:2, :), sought_periods, names%saddles)
      end associate
      call try_saddles(team, grid, plane, body, names)
    end select
    do k = 1, size(plane%lines)
      call bridge(plane, plane%lines(k), names)
    end do
    names%reached = [(count(names%saddle == k .and. plane%points%along > 0), k=1, size(names%saddles))]
  end subroutine name_points

  !> Whether the labels on both sides of a point are known.
  pure elemental logical function is_known(plane, point) result(known)
    type(plane_t), intent(in) :: plane
    integer, intent(in) :: point
    associate (one => plane%points(point))
      known = one%interval > 0 .and. one%below /= label_not_known .and. one%above /= label_not_known
    end associate
  end function is_known

  !> Points to track: spread over the longest lines.
  pure function chosen_points(plane) result(points)
    type(plane_t), intent(in) :: plane
    integer, allocatable :: points(:), lengths(:)
    integer :: l, i, share, n, shortest
    lengths = [(size(plane%lines(l)%points), l=1, size(plane%lines))]
    shortest = 1
    do while (count(lengths >= shortest) > most_tracked)
      shortest = shortest + 1
    end do
    share = max(1, min(most_of_line, most_tracked/max(1, count(lengths >= shortest))))
    allocate (points(0))
    do l = 1, size(plane%lines)
      if (lengths(l) < shortest) cycle
      associate (own => pack(plane%lines(l)%points, [(is_known(plane, plane%lines(l)%points(i)), i=1, lengths(l))]))
        n = min(share, size(own))
        points = [points, [(own(1 + ((2*i - 1)*size(own))/(2*n)), i=1, n)]]
      end associate
    end do
  end function chosen_points

  subroutine track_samples(team, journal, grid, plane, machines, body, names)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(names_t), intent(inout) :: names
    integer, allocatable :: points(:)
    real(wp), allocatable :: own(:), found(:)
    type(saddle_t) :: saddle
    real(wp) :: starts(3 + size(grid%others), 2)
    integer :: k, edge, number
    logical :: ok
    points = chosen_points(plane)
    allocate (own(0))
    call journal%begin('edge states', int(size(points)/team%size(), int64), 0_int64)
    do k = 1 + team%rank(), size(points), team%size()
      associate (point => plane%points(points(k)))
        starts = side_starts(grid, plane, plane%intervals(point%interval))
        call track_edge(machines, body, plane%attractors, plane%journey%span, starts(:3, :), [point%below, point%above], edge, &
                        saddle)
      end associate
      if (edge /= edge_saddle) own = [own, real(k, wp), real(edge, wp), 0.0_wp, 0.0_wp, 0.0_wp]
      if (edge == edge_saddle) own = [own, real(k, wp), real(edge, wp), real(saddle%periods, wp), saddle%points(:, 1)]
      call journal%progress(int(k/team%size(), int64))
    end do
    call team%allgather(own, found)
    do k = 1, size(points)
      associate (row => found(5*locate(k) - 4:5*locate(k)), point => points(k))
        names%edge(point) = nint(row(2))
        if (names%edge(point) /= edge_saddle) cycle
        call find_saddle(machines, body, row(4:5), nint(row(3)), saddle, ok)
        if (.not. ok) then
          names%edge(point) = edge_not_known
          cycle
        end if
        call add_saddle(body, saddle, names%saddles, number)
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

  end subroutine track_samples

  !> Tries every point that was not tracked on the saddles.
  subroutine try_saddles(team, grid, plane, body, names)
    class(team_t), intent(in) :: team
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(one_body_t), intent(in) :: body
    type(names_t), intent(inout) :: names
    integer(int64) :: numbers(size(plane%points))
    real(wp) :: starts(3 + size(grid%others), 2)
    integer :: k, number
    if (size(names%saddles) == 0 .or. size(numbers) == 0) return
    numbers = 0
    do k = 1 + team%rank(), size(numbers), team%size()
      if (names%edge(k) /= edge_not_known .or. .not. is_known(plane, k)) cycle
      starts = side_starts(grid, plane, plane%intervals(plane%points(k)%interval))
      call reaches_saddle(body, names%saddles, starts(:3, :), number)
      numbers(k) = number
    end do
    call team%sum(numbers)
    where (numbers > 0)
      names%edge = edge_saddle
      names%saddle = int(numbers)
    end where
  end subroutine try_saddles

  !> Gives points without a name that of their neighbours on both sides, and junctions that of the one neighbour.
  pure subroutine bridge(plane, line, names)
    type(plane_t), intent(in) :: plane
    type(line_t), intent(in) :: line
    type(names_t), intent(inout) :: names
    integer :: n, i, first, last, before, after
    n = size(line%points)
    if (all(names%edge(line%points) == edge_not_known)) return
    i = 1
    do while (i <= n)
      if (names%edge(line%points(i)) /= edge_not_known) then
        i = i + 1
        cycle
      end if
      first = i
      do last = i, n
        if (last == n) exit
        if (names%edge(line%points(last + 1)) /= edge_not_known) exit
      end do
      i = last + 1
      before = place_of(first - 1)
      after = place_of(last + 1)
      if (first == last .and. plane%points(line%points(first))%along == 0) then
        if (before == 0) before = after
        if (after == 0) after = before
      end if
      if (before == 0 .or. after == 0 .or. last - first + 1 > max(few, int(bridged*n))) cycle
      if (names%edge(before) /= names%edge(after) .or. names%saddle(before) /= names%saddle(after)) cycle
      if (.not. all(is_known(plane, line%points(first:last)) .or. plane%points(line%points(first:last))%along == 0)) cycle
      names%edge(line%points(first:last)) = names%edge(after)
      names%saddle(line%points(first:last)) = names%saddle(after)
    end do

  contains

    !> Point at a position of the line; 0 beyond an end.
    pure integer function place_of(position)
      integer, intent(in) :: position
      place_of = 0
      if (line%closed) place_of = line%points(1 + modulo(position - 1, n))
      if (position >= 1 .and. position <= n) place_of = line%points(position)
      if (place_of == 0) return
      if (names%edge(place_of) == edge_not_known) place_of = 0
    end function place_of

  end subroutine bridge

  !> Lines cut where the name changes; neighbouring parts share the point between them, which has the name of the first.
  pure subroutine cut_lines(names, lines, pieces, of_line)
    type(names_t), intent(in) :: names
    type(line_t), intent(in) :: lines(:)
    type(line_t), allocatable, intent(out) :: pieces(:)
    integer, allocatable, intent(out) :: of_line(:)
    type(line_t) :: line
    integer :: l, i, n, first, count
    integer, allocatable :: lead(:)
    n = sum([(size(lines(l)%points), l=1, size(lines))])
    allocate (pieces(n), of_line(n))
    count = 0
    do l = 1, size(lines)
      line = lines(l)
      n = size(line%points)
      allocate (lead(0))
      if (line%closed) then
        do i = 1, n
          if (.not. differs(line%points(i), line%points(1 + modulo(i, n)))) cycle
          ! It is opened where the name changes.
          lead = line%points(i:i)
          line%points = cshift(line%points, i)
          line%closed = .false.
          exit
        end do
      end if
      first = 1
      do i = 1, n
        if (i < n) then
          if (.not. differs(line%points(i), line%points(i + 1))) cycle
        end if
        count = count + 1
        pieces(count) = line
        pieces(count)%points = [lead, line%points(first:i)]
        of_line(count) = line%points(i)
        lead = line%points(i:i)
        first = i + 1
      end do
      deallocate (lead)
    end do
    pieces = pieces(:count)
    of_line = of_line(:count)

  contains

    pure logical function differs(one, other)
      integer, intent(in) :: one, other
      differs = names%edge(one) /= names%edge(other) .or. names%saddle(one) /= names%saddle(other)
    end function differs

  end subroutine cut_lines

end module boundary_names
