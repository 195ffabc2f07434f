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
  use invariant_sets, only: grow_set, set_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use one_body, only: one_body_t
  use saddle_search, only: add_saddle, find_saddle, saddle_t, seek_saddles
  use start_label, only: label_not_known
  use team, only: team_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: name_points, cut_lines, grow_sets

  !> Saddles of a plane whose sets are grown, those first that most boundary points lead to.
  integer, parameter :: most_grown = 6

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
    type(error_t), allocatable :: error
    integer :: k
    allocate (names%edge(size(plane%points)), names%saddle(size(plane%points)), source=0)
    allocate (names%tracked(size(plane%points)), source=.false.)
    allocate (names%saddles(0), names%reached(0), names%sets(0), names%saddle_of_set(0))
    family%laws = slice_laws(grid, point_slice(grid, plane%index))
    family%options = grid%options
    call body_neighbourhood(family, 0.0_wp, machines, error)
    names%problem = ''
    if (allocated(error)) names%problem = error%message
    if (allocated(error)) return
    select type (body => machines%centre)
    type is (one_body_t)
      call track_points(team, journal, grid, plane, machines, body, chosen_points(plane), names)
      associate (starts => slice_starts(grid, sought_starts, 0))
        call seek_saddles(machines, body, starts(:2, :), sought_periods, names%saddles)
      end associate
      call try_saddles(team, grid, plane, body, names)
      ! What is left is mostly where one name ends and another begins.
      k = size(names%saddles)
      call track_points(team, journal, grid, plane, machines, body, points_left(plane, names), names)
      if (size(names%saddles) > k) call try_saddles(team, grid, plane, body, names)
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

  !> Points without a name that were not tracked, at most as many as are tracked at first, spread over all.
  pure function points_left(plane, names) result(points)
    type(plane_t), intent(in) :: plane
    type(names_t), intent(in) :: names
    integer, allocatable :: points(:)
    logical :: left(size(plane%points))
    integer :: i, n
    do i = 1, size(left)
      left(i) = names%edge(i) == edge_not_known .and. .not. names%tracked(i)
      if (left(i)) left(i) = is_known(plane, i)
    end do
    points = pack([(i, i=1, size(left))], left)
    n = min(most_tracked, size(points))
    points = [(points(1 + ((2*i - 1)*size(points))/(2*n)), i=1, n)]
  end function points_left

  !> Names points by tracking them.
  subroutine track_points(team, journal, grid, plane, machines, body, points, names)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    integer, intent(in) :: points(:)
    type(names_t), intent(inout) :: names
    real(wp), allocatable :: own(:), found(:)
    type(saddle_t) :: saddle
    real(wp) :: starts(3 + size(grid%others), 2)
    integer :: k, edge, number
    logical :: ok
    names%tracked(points) = .true.
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

  end subroutine track_points

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

  !> Grows the stable and unstable sets of the saddles within `windows` times the window of a plane of x0 and v0, side by side on
  !> the ranks.
  subroutine grow_sets(team, journal, grid, plane, windows, names)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    real(wp), intent(in) :: windows
    type(names_t), intent(inout) :: names
    type(family_t) :: family
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    type(set_t) :: set
    real(wp), allocatable :: own(:), found(:)
    real(wp) :: low(2), high(2)
    integer, allocatable :: chosen(:)
    integer :: k, n, at, length
    integer, parameter :: sides(2) = [1, -1]
    if (len(names%problem) > 0 .or. .not. windows > 0 .or. size(names%saddles) == 0) return
    call window_of(grid, plane, windows, low, high, length)
    if (length == 0) return
    family%laws = slice_laws(grid, point_slice(grid, plane%index))
    family%options = grid%options
    call body_neighbourhood(family, 0.0_wp, machines, error)
    if (allocated(error)) return
    chosen = most_reached(names%reached)
    allocate (own(0))
    call journal%begin('sides of stable and unstable sets', int(4*size(chosen), int64), 0_int64)
    select type (body => machines%centre)
    type is (one_body_t)
      do n = team%rank(), 4*size(chosen) - 1, team%size()
        k = chosen(1 + n/4)
        call grow_set(machines, body, names%saddles(k), modulo(n, 4) < 2, sides(1 + modulo(n, 2)), low, high, set)
        own = [own, real(n, wp), real(set%ending, wp), real(size(set%piece), wp), reshape(set%points, [size(set%points)]), &
               real(set%piece, wp)]
        call journal%progress(int(n + 1, int64))
      end do
    end select
    call team%allgather(own, found)
    do n = 0, 4*size(chosen) - 1
      at = 1
      do while (nint(found(at)) /= n)
        at = at + 3 + 3*nint(found(at + 2))
      end do
      length = nint(found(at + 2))
      set%stable = modulo(n, 4) < 2
      set%side = sides(1 + modulo(n, 2))
      set%ending = nint(found(at + 1))
      set%points = reshape(found(at + 3:at + 2 + 2*length), [2, length])
      set%piece = nint(found(at + 3 + 2*length:at + 2 + 3*length))
      names%sets = [names%sets, set]
      names%saddle_of_set = [names%saddle_of_set, chosen(1 + n/4)]
    end do
  end subroutine grow_sets

  !> The window in x and v; `axes` is 0 if the plane is not that of x0 and v0.
  pure subroutine window_of(grid, plane, windows, low, high, axes)
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: plane
    real(wp), intent(in) :: windows
    real(wp), intent(out) :: low(2), high(2)
    integer, intent(out) :: axes
    integer :: k
    low = 0
    high = 0
    axes = 0
    do k = 1, 2
      associate (axis => grid%start_axis(k))
        if (.not. any(plane%axes == axis)) return
        associate (values => grid%axes(axis)%values)
          low(k) = (values(1) + values(size(values)))/2 - windows*(values(size(values)) - values(1))/2
          high(k) = (values(1) + values(size(values)))/2 + windows*(values(size(values)) - values(1))/2
        end associate
      end associate
    end do
    axes = 2
  end subroutine window_of

  !> The saddles that most points lead to, in their order.
  pure function most_reached(reached) result(chosen)
    integer, intent(in) :: reached(:)
    integer, allocatable :: chosen(:)
    integer :: k, least
    least = 0
    do while (count(reached >= least) > most_grown .and. least <= maxval(reached))
      least = least + 1
    end do
    chosen = pack([(k, k=1, size(reached))], reached >= least)
    if (size(chosen) == 0) chosen = pack([(k, k=1, size(reached))], reached == maxval(reached))
    chosen = chosen(:min(size(chosen), most_grown))
  end function most_reached

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
