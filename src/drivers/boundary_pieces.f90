! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The lines of a plane whose points have names: gaps between points of one name are bridged, and lines are cut where it changes.
module boundary_pieces
  use boundary_lines, only: line_t
  use boundary_search, only: plane_t
  use boundary_names, only: is_known, names_t
  use edge_state, only: edge_not_known
  use kinds, only: wp
  implicit none
  private

  public :: bridge_gaps, cut_lines

  !> Points without a name between two of one name get it where they are at most this share of their line, or so few.
  real(wp), parameter :: bridged = 0.1_wp
  integer, parameter :: few = 5

contains

  !> Gives points without a name that of their neighbours, line by line, and counts anew how many lead to each saddle.
  pure subroutine bridge_gaps(plane, names)
    type(plane_t), intent(in) :: plane
    type(names_t), intent(inout) :: names
    integer :: k
    do k = 1, size(plane%lines)
      call bridge(plane, plane%lines(k), names)
    end do
    names%reached = [(count(names%saddle == k .and. plane%points%along > 0), k=1, size(names%saddles))]
  end subroutine bridge_gaps

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
      before = position_of(first - 1)
      after = position_of(last + 1)
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

    !> Point at an index of the line; 0 beyond an end.
    pure integer function position_of(position)
      integer, intent(in) :: position
      position_of = 0
      if (line%closed) position_of = line%points(1 + modulo(position - 1, n))
      if (position >= 1 .and. position <= n) position_of = line%points(position)
      if (position_of == 0) return
      if (names%edge(position_of) == edge_not_known) position_of = 0
    end function position_of

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

end module boundary_pieces
