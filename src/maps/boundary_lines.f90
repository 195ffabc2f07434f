! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The boundaries between the labels of a plane of points as lines: positions where the label changes along the edges of the
!> cells are linked through the cells. Any number of labels; where three or more meet in a cell, the lines end in a junction.
module boundary_lines
  use bisection, only: interval_t
  use kinds, only: wp
  implicit none
  private

  public :: crossed_edges, crowded_cells, link_lines

  !> An edge between the points (i, j) and the next along axis `along`.
  type, public :: edge_t
    integer :: i = 0, j = 0, along = 1
  end type edge_t

  !> A point of a line: in units of the axes, with the axis of its edge (0: a junction), the labels below and above it along that,
  !> half the width of the interval that holds it, and the number of the interval (0: a junction).
  type, public :: line_point_t
    real(wp) :: position(2) = 0, error = 0
    integer :: along = 0, below = 0, above = 0, interval = 0
  end type line_point_t

  !> A line between two labels, from end to end; a closed one does not repeat its first point.
  type, public :: line_t
    integer, allocatable :: points(:)
    integer :: labels(2) = 0
    logical :: closed = .false.
  end type line_t

  !> Where the intervals of each edge are: those of `edge(i, j, along)` from `first` on, `count` of them, sorted.
  type :: crossings_t
    integer, allocatable :: edge(:, :, :), first(:), count(:)
  end type crossings_t

  !> Links of points: pairs, and up to two neighbours of each point on an edge.
  type :: links_t
    integer, allocatable :: ends(:, :)
    integer :: count = 0
  end type links_t

contains

  !> Edges whose ends have different labels.
  pure subroutine crossed_edges(labels, edges)
    integer, intent(in) :: labels(:, :)
    type(edge_t), allocatable, intent(out) :: edges(:)
    integer :: i, j, along, count, n(2)
    n = shape(labels)
    allocate (edges(sum(merge(1, 0, labels(2:, :) /= labels(:n(1) - 1, :))) + &
                    sum(merge(1, 0, labels(:, 2:) /= labels(:, :n(2) - 1)))))
    count = 0
    do along = 1, 2
      do j = 1, n(2) - merge(1, 0, along == 2)
        do i = 1, n(1) - merge(1, 0, along == 1)
          if (labels(i, j) == labels(i + merge(1, 0, along == 1), j + merge(1, 0, along == 2))) cycle
          count = count + 1
          edges(count) = edge_t(i, j, along)
        end do
      end do
    end do
  end subroutine crossed_edges

  pure function crossings_of(n, edges, intervals) result(crossings)
    integer, intent(in) :: n(2)
    type(edge_t), intent(in) :: edges(:)
    type(interval_t), intent(in) :: intervals(:)
    type(crossings_t) :: crossings
    integer :: e, k
    allocate (crossings%edge(n(1), n(2), 2), crossings%first(0:size(edges)), crossings%count(0:size(edges)), source=0)
    do e = 1, size(edges)
      crossings%edge(edges(e)%i, edges(e)%j, edges(e)%along) = e
    end do
    do k = size(intervals), 1, -1
      crossings%first(intervals(k)%edge) = k
      crossings%count(intervals(k)%edge) = crossings%count(intervals(k)%edge) + 1
    end do
  end function crossings_of

  !> The intervals round the cell whose lowest corner is (i, j), in the sense from the first axis to the second; `after` has the
  !> label behind each. It is not `whole` where one does not begin with the label that the one before ends with: between the two the
  !> label changes where it was not followed.
  pure subroutine walk_round(crossings, intervals, i, j, round, after, whole)
    type(crossings_t), intent(in) :: crossings
    type(interval_t), intent(in) :: intervals(:)
    integer, intent(in) :: i, j
    integer, allocatable, intent(out) :: round(:), after(:)
    logical, intent(out) :: whole
    integer, allocatable :: before(:)
    integer :: sides(4), side, k, e, m, n
    sides = [crossings%edge(i, j, 1), crossings%edge(i + 1, j, 2), crossings%edge(i, j + 1, 1), crossings%edge(i, j, 2)]
    n = sum(crossings%count(sides))
    allocate (round(n), after(n), before(n))
    n = 0
    do side = 1, 4
      e = sides(side)
      do k = 0, crossings%count(e) - 1
        n = n + 1
        if (side <= 2) then
          m = crossings%first(e) + k
          before(n) = intervals(m)%below
          after(n) = intervals(m)%above
        else
          m = crossings%first(e) + crossings%count(e) - 1 - k
          before(n) = intervals(m)%above
          after(n) = intervals(m)%below
        end if
        round(n) = m
      end do
    end do
    whole = all(before == cshift(after, -1))
  end subroutine walk_round

  !> Cells next to crossed edges, each once, lowest corners in columns. With `crowded` only those round which the label changes
  !> more than twice: how the lines go through them depends on the label in their middle.
  pure subroutine crowded_cells(n, edges, intervals, crowded, cells)
    integer, intent(in) :: n(2)
    type(edge_t), intent(in) :: edges(:)
    type(interval_t), intent(in) :: intervals(:)
    logical, intent(in) :: crowded
    integer, allocatable, intent(out) :: cells(:, :)
    type(crossings_t) :: crossings
    logical, allocatable :: wanted(:, :)
    integer :: e, i, j, side, count, sides(4)
    crossings = crossings_of(n, edges, intervals)
    allocate (wanted(n(1), n(2)), source=.false.)
    do e = 1, size(edges)
      do side = 0, 1
        i = edges(e)%i - merge(side, 0, edges(e)%along == 2)
        j = edges(e)%j - merge(side, 0, edges(e)%along == 1)
        if (i < 1 .or. j < 1 .or. i >= n(1) .or. j >= n(2)) cycle
        sides = [crossings%edge(i, j, 1), crossings%edge(i + 1, j, 2), crossings%edge(i, j + 1, 1), crossings%edge(i, j, 2)]
        wanted(i, j) = .not. crowded .or. sum(crossings%count(sides)) > 2
      end do
    end do
    allocate (cells(2, count_of(wanted)))
    count = 0
    do j = 1, n(2)
      do i = 1, n(1)
        if (.not. wanted(i, j)) cycle
        count = count + 1
        cells(:, count) = [i, j]
      end do
    end do
  end subroutine crowded_cells

  pure integer function count_of(mask) result(number)
    logical, intent(in) :: mask(:, :)
    number = count(mask)
  end function count_of

  !> The lines of a plane with values `a`, `b` along its axes. `intervals` are sorted by edge and position; `centres` are the
  !> labels in the middle of the crowded cells, in their order.
  subroutine link_lines(a, b, edges, intervals, centres, points, lines)
    real(wp), intent(in) :: a(:), b(:)
    type(edge_t), intent(in) :: edges(:)
    type(interval_t), intent(in) :: intervals(:)
    integer, intent(in) :: centres(:)
    type(line_point_t), allocatable, intent(out) :: points(:)
    type(line_t), allocatable, intent(out) :: lines(:)
    type(crossings_t) :: crossings
    type(links_t) :: links
    integer, allocatable :: cells(:, :), round(:), after(:)
    integer :: c, crowd, k
    logical :: whole
    crossings = crossings_of([size(a), size(b)], edges, intervals)
    allocate (points(size(intervals)), links%ends(2, 2*size(intervals) + 16))
    do k = 1, size(intervals)
      points(k) = point_on(a, b, edges(intervals(k)%edge), intervals(k), k)
    end do
    call crowded_cells([size(a), size(b)], edges, intervals, .false., cells)
    crowd = 0
    do c = 1, size(cells, 2)
      call walk_round(crossings, intervals, cells(1, c), cells(2, c), round, after, whole)
      if (size(round) > 2) crowd = crowd + 1
      if (size(round) >= 2 .and. .not. whole) then
        call meet(a, b, cells(:, c), round, points, links)
      else if (size(round) == 2) then
        call add_link(links, round(1), round(2))
      else if (size(round) > 2) then
        call link_crowd(a, b, cells(:, c), round, after, centres(crowd), points, links)
      end if
    end do
    call trace(points, links, lines)
  end subroutine link_lines

  pure function point_on(a, b, edge, interval, number) result(point)
    real(wp), intent(in) :: a(:), b(:)
    type(edge_t), intent(in) :: edge
    type(interval_t), intent(in) :: interval
    integer, intent(in) :: number
    type(line_point_t) :: point
    real(wp) :: length, share
    share = interval%low + (interval%high - interval%low)/2
    point%position = [a(edge%i), b(edge%j)]
    if (edge%along == 1) length = a(edge%i + 1) - a(edge%i)
    if (edge%along == 2) length = b(edge%j + 1) - b(edge%j)
    point%position(edge%along) = point%position(edge%along) + share*length
    point%error = (interval%high - interval%low)/2*length
    point%along = edge%along
    point%below = interval%below
    point%above = interval%above
    point%interval = number
  end function point_on

  pure subroutine add_link(links, one, other)
    type(links_t), intent(inout) :: links
    integer, intent(in) :: one, other
    integer, allocatable :: longer(:, :)
    if (links%count == size(links%ends, 2)) then
      allocate (longer(2, 2*links%count))
      longer(:, :links%count) = links%ends
      call move_alloc(longer, links%ends)
    end if
    links%count = links%count + 1
    links%ends(:, links%count) = [one, other]
  end subroutine add_link

  !> Lines through a cell round which the label changes more than twice: the basin in its middle holds together, and cuts off the
  !> others; where two or more are cut off together their lines meet in a junction.
  pure subroutine link_crowd(a, b, cell, round, after, centre, points, links)
    real(wp), intent(in) :: a(:), b(:)
    integer, intent(in) :: cell(2), round(:), after(:), centre
    type(line_point_t), allocatable, intent(inout) :: points(:)
    type(links_t), intent(inout) :: links
    integer :: n, middle, first, last, i, k
    n = size(round)
    middle = centre
    if (.not. any(after == centre)) middle = after(maxloc([(count(after == after(i)), i=1, n)], 1))
    do first = 1, n
      if (after(first) /= middle) cycle
      ! Up to the next arc of the basin in the middle.
      do k = 1, n
        last = 1 + modulo(first + k - 1, n)
        if (after(last) == middle) exit
      end do
      associate (group => [(round(1 + modulo(first + i - 1, n)), i=1, k)])
        if (k == 2) then
          call add_link(links, group(1), group(2))
        else
          call meet(a, b, cell, group, points, links)
        end if
      end associate
    end do
  end subroutine link_crowd

  !> The lines of the points of a `group` in a cell meet in a junction.
  pure subroutine meet(a, b, cell, group, points, links)
    real(wp), intent(in) :: a(:), b(:)
    integer, intent(in) :: cell(2), group(:)
    type(line_point_t), allocatable, intent(inout) :: points(:)
    type(links_t), intent(inout) :: links
    type(line_point_t) :: junction
    integer :: i
    junction%position = [(sum(points(group)%position(i))/size(group), i=1, 2)]
    junction%error = maxval([a(cell(1) + 1) - a(cell(1)), b(cell(2) + 1) - b(cell(2))])/2
    points = [points, junction]
    do i = 1, size(group)
      call add_link(links, group(i), size(points))
    end do
  end subroutine meet

  !> Walks along the links: first from ends and junctions, then round what is closed.
  subroutine trace(points, links, lines)
    type(line_point_t), intent(in) :: points(:)
    type(links_t), intent(in) :: links
    type(line_t), allocatable, intent(out) :: lines(:)
    integer, allocatable :: first(:), incident(:), walked(:)
    logical, allocatable :: used(:)
    integer :: p, k, count, length, round
    call incidence(size(points), links, first, incident)
    allocate (used(links%count), source=.false.)
    allocate (walked(links%count + 1), lines(16))
    count = 0
    do round = 1, 2
      do p = 1, size(points)
        if (round == 1 .and. .not. ends_line(p)) cycle
        do k = first(p), first(p + 1) - 1
          if (used(incident(k))) cycle
          call walk(p, incident(k), length)
          if (count == size(lines)) call make_room(lines)
          count = count + 1
          lines(count)%closed = length > 1 .and. walked(1) == walked(length) .and. round == 2
          if (lines(count)%closed) length = length - 1
          lines(count)%points = walked(:length)
          associate (inner => points(merge(walked(1), walked(2), points(walked(1))%interval > 0)))
            lines(count)%labels = [min(inner%below, inner%above), max(inner%below, inner%above)]
          end associate
        end do
      end do
    end do
    lines = lines(:count)

  contains

    !> A junction does, also one of two lines of different labels.
    pure logical function ends_line(point)
      integer, intent(in) :: point
      ends_line = first(point + 1) - first(point) /= 2 .or. points(point)%interval == 0
    end function ends_line

    !> From a point along a link, until an end, a junction, or where it began.
    subroutine walk(start, link, length)
      integer, intent(in) :: start, link
      integer, intent(out) :: length
      integer :: at, next
      at = start
      next = link
      length = 1
      walked(1) = start
      do
        used(next) = .true.
        at = sum(links%ends(:, next)) - at
        length = length + 1
        walked(length) = at
        if (ends_line(at) .or. at == start) return
        next = sum(incident(first(at):first(at) + 1)) - next
      end do
    end subroutine walk

  end subroutine trace

  !> Room for twice as many lines.
  subroutine make_room(lines)
    type(line_t), allocatable, intent(inout) :: lines(:)
    type(line_t), allocatable :: longer(:)
    allocate (longer(2*size(lines)))
    longer(:size(lines)) = lines
    call move_alloc(longer, lines)
  end subroutine make_room

  !> The links of each point: those of point p from `first(p)` to `first(p + 1) - 1`.
  pure subroutine incidence(n, links, first, incident)
    integer, intent(in) :: n
    type(links_t), intent(in) :: links
    integer, allocatable, intent(out) :: first(:), incident(:)
    integer, allocatable :: next(:)
    integer :: l, k
    allocate (first(n + 1), source=0)
    allocate (incident(2*links%count))
    do l = 1, links%count
      do k = 1, 2
        associate (p => links%ends(k, l))
          first(p + 1) = first(p + 1) + 1
        end associate
      end do
    end do
    first(1) = 1
    do k = 1, n
      first(k + 1) = first(k + 1) + first(k)
    end do
    next = first
    do l = 1, links%count
      do k = 1, 2
        associate (p => links%ends(k, l))
          incident(next(p)) = l
          next(p) = next(p) + 1
        end associate
      end do
    end do
  end subroutine incidence

end module boundary_lines
