! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Homoclinic contacts of saddles along a branch. The saddle lies on the boundary of the basin of an attractor where all starts
!> beside it on one side lead there. Where those of its other side begin to reach that attractor too, its unstable set has come to
!> touch the boundary, its stable set: a boundary crisis where all of them reach it then (C. Grebogi, E. Ott, J. A. Yorke,
!> Physica D 7 (1983)). Only the forward map is used, so that grazes, sticking and completed chatters do no harm.
module homoclinic
  use beside_saddle, only: all_reach, arrives, beside_t, cycle_points_t, is_chaotic, least_growth, none_reach, not_known, &
    set_beside, settle, some_reach, verdict_of
  use body_family, only: family_t
  use branch_point, only: point_t
  use kinds, only: wp
  implicit none
  private

  public :: find_contacts, put_in_order

  !> Points of a branch that are looked at.
  integer, parameter :: most_looks = 30
  !> Points further on that are taken where the starts at one were too few.
  integer, parameter :: most_further = 2
  !> Starts at a value where the contact is looked for, and so many times more where none is to arrive.
  integer, parameter :: sure_starts = 32, many = 4
  integer, parameter, public :: starts_that_stay = many*sure_starts
  !> Near the contact arrivals are rare: further halving would show where they are too rare to be seen.
  integer, parameter :: halvings = 10
  !> Where a chaotic transient is to end, it may take so many times longer than what settles at once.
  integer, parameter :: long_wait = 20

  type, public :: contact_t
    !> The contact is behind this point of the branch.
    integer :: after = 0
    !> Values of the parameter where some starts of the side reach the attractor of the other, and where none does.
    real(wp) :: reach = 0, stay = 0
    !> Whether all of them reach it beyond, and their motion is chaotic before; period of the attractor that they reach.
    logical :: crisis = .false.
    integer :: period = 0
    !> Section point of the saddle there.
    real(wp), allocatable :: y(:)
  end type contact_t

  !> A contact that is narrowed down: what was seen at the last value.
  type :: hunt_t
    integer :: side = 0, period = 0
    logical :: reaches = .false.
    real(wp), allocatable :: along(:), y(:)
  end type hunt_t

contains

  !> The contacts along a branch, in its order.
  subroutine find_contacts(family, line, contacts)
    type(family_t), intent(in) :: family
    type(point_t), intent(in) :: line(:)
    type(contact_t), allocatable, intent(out) :: contacts(:)
    type(beside_t) :: beside
    type(contact_t) :: contact
    integer, allocatable :: looks(:), verdicts(:, :)
    real(wp), allocatable :: along(:, :)
    integer :: i, side, further, low, high
    logical :: ok
    allocate (contacts(0))
    looks = positions_to_search(line)
    allocate (verdicts(2, size(looks)), source=not_known)
    allocate (along(size(line(1)%orbit%y), 0:size(looks)), source=0.0_wp)
    do i = 1, size(looks)
      associate (orbit => line(looks(i))%orbit)
        call set_beside(family, orbit%parameter, orbit%y, orbit%periods, along(:, i - 1), beside, ok)
      end associate
      along(:, i) = along(:, i - 1)
      if (.not. ok) cycle
      along(:, i) = beside%direction
      call look(beside, verdicts(:, i))
    end do
    do i = 1, size(looks) - 1
      do side = 1, 2
        if (minval(verdicts(side, i:i + 1)) /= none_reach .or. maxval(verdicts(side, i:i + 1)) < some_reach) cycle
        ! Where the starts at one point were too few, the contact lies beyond it.
        do further = 0, most_further
          low = merge(i, i - further, verdicts(side, i) >= some_reach)
          high = merge(i + 1 + further, i + 1, verdicts(side, i) >= some_reach)
          ok = low >= 1 .and. high <= size(looks)
          if (ok) ok = any(verdicts(side, [low, high]) == none_reach)
          if (.not. ok) exit
          call narrow_down(family, line(looks(low):looks(high)), side, verdicts(side, [low, high]), along(:, low), contact, ok)
          if (ok) exit
        end do
        if (.not. ok) cycle
        contact%after = contact%after + looks(low) - 1
        contacts = [contacts, contact]
      end do
    end do
    call put_in_order(line, contacts)
  end subroutine find_contacts

  !> Puts contacts in the order of the points of a line, those behind one point by their distance from it.
  pure subroutine put_in_order(line, contacts)
    type(point_t), intent(in) :: line(:)
    type(contact_t), intent(inout) :: contacts(:)
    type(contact_t) :: moved
    integer :: i, k
    do i = 2, size(contacts)
      moved = contacts(i)
      do k = i - 1, 1, -1
        if (.not. comes_before(moved, contacts(k))) exit
        contacts(k + 1) = contacts(k)
      end do
      contacts(k + 1) = moved
    end do

  contains

    pure logical function comes_before(one, other)
      type(contact_t), intent(in) :: one, other
      comes_before = one%after < other%after
      if (one%after /= other%after) return
      associate (value => line(one%after)%orbit%parameter)
        comes_before = abs(one%reach - value) < abs(other%reach - value)
      end associate
    end function comes_before

  end subroutine put_in_order

  !> Points of a branch where it is a saddle whose sides stay apart: the ends of each such piece, and others spread evenly.
  pure function positions_to_search(line) result(looks)
    type(point_t), intent(in) :: line(:)
    integer, allocatable :: looks(:)
    logical :: directed(0:size(line) + 1), chosen(size(line))
    integer :: i, n, every
    directed = .false.
    directed(1:size(line)) = [(is_directed(line(i)), i=1, size(line))]
    every = max(1, count(directed)/most_looks)
    n = 0
    do i = 1, size(line)
      if (directed(i)) n = n + 1
      chosen(i) = directed(i) .and. (modulo(n, every) == 0 .or. .not. (directed(i - 1) .and. directed(i + 1)))
    end do
    looks = pack([(i, i=1, size(line))], chosen)
  end function positions_to_search

  pure logical function is_directed(point)
    type(point_t), intent(in) :: point
    associate (m => point%orbit%multipliers)
      is_directed = abs(aimag(m(1))) <= 0 .and. real(m(1)) > 1 + least_growth .and. real(m(1)) < 1e6_wp .and. all(abs(m(2:)) < 1)
    end associate
  end function is_directed

  !> What the starts of both sides do.
  subroutine look(beside, verdicts)
    type(beside_t), intent(in) :: beside
    integer, intent(out) :: verdicts(2)
    type(cycle_points_t) :: settles
    integer :: side, other
    verdicts = not_known
    do side = 1, 2
      other = 3 - side
      call settle(beside, other, settles)
      if (size(settles%points, 2) == 0) cycle
      if (verdict_of(beside, other, settles, beside%turns) /= all_reach) cycle
      verdicts(side) = verdict_of(beside, side, settles, beside%turns)
    end do
  end subroutine look

  !> The contact of a side on a piece of a branch between two of the points looked at, by halving. `verdicts` are those at its ends,
  !> `along` the direction at the first. `ok` is false if it is not to be had.
  subroutine narrow_down(family, line, side, verdicts, along, contact, ok)
    type(family_t), intent(in) :: family
    type(point_t), intent(in) :: line(:)
    integer, intent(in) :: side, verdicts(2)
    real(wp), intent(in) :: along(:)
    type(contact_t), intent(out) :: contact
    logical, intent(out) :: ok
    type(hunt_t) :: hunt
    real(wp) :: beyond, first, middle
    integer :: tries
    associate (one => line(1)%orbit%parameter, other => line(size(line))%orbit%parameter)
      beyond = merge(one, other, verdicts(1) >= some_reach)
      first = merge(other, one, verdicts(1) >= some_reach)
    end associate
    contact%reach = beyond
    contact%stay = first
    hunt%side = side
    hunt%along = along
    do tries = 1, halvings
      middle = (contact%reach + contact%stay)/2
      call try(family, line, middle, sure_starts, hunt, ok)
      if (.not. ok) return
      if (hunt%reaches) then
        contact%reach = middle
      else
        contact%stay = middle
      end if
    end do
    ! Other parts of the set may touch later; there they are rare.
    do tries = 1, halvings
      ok = abs(contact%stay - first) > 0
      if (ok) call try(family, line, contact%stay, many*sure_starts, hunt, ok)
      if (.not. ok .or. .not. hunt%reaches) exit
      middle = contact%stay
      contact%stay = contact%stay + (contact%stay - contact%reach)
      if ((contact%stay - first)*(beyond - first) <= 0) contact%stay = first
      contact%reach = middle
    end do
    if (.not. ok .or. hunt%reaches) ok = .false.
    if (.not. ok) return
    contact%y = hunt%y
    contact%period = hunt%period
    contact%after = index_before(line, contact%reach)
    contact%crisis = is_crisis(family, line, contact%stay, beyond, hunt)
  end subroutine narrow_down

  !> Looks at a value: does any of `number` starts of the side reach the attractor of the other?
  subroutine try(family, line, value, number, hunt, ok)
    type(family_t), intent(in) :: family
    type(point_t), intent(in) :: line(:)
    real(wp), intent(in) :: value
    integer, intent(in) :: number
    type(hunt_t), intent(inout) :: hunt
    logical, intent(out) :: ok
    type(beside_t) :: beside
    type(cycle_points_t) :: settles
    integer :: i
    call set_beside(family, value, guess_at(line, value), line(1)%orbit%periods, hunt%along, beside, ok)
    if (.not. ok) return
    hunt%along = beside%direction
    hunt%y = beside%saddle%points(:, 1)
    call settle(beside, 3 - hunt%side, settles)
    hunt%period = size(settles%points, 2)
    ok = hunt%period > 0
    if (.not. ok) return
    do i = 1, number
      hunt%reaches = arrives(beside, hunt%side, settles, (i - 0.5_wp)/number, 2*beside%turns)
      if (hunt%reaches) return
    end do
  end subroutine try

  !> Whether the starts of a side are chaotic where they stay, and at the value `beyond` all reach the attractor in the end.
  logical function is_crisis(family, line, stay, beyond, hunt)
    type(family_t), intent(in) :: family
    type(point_t), intent(in) :: line(:)
    real(wp), intent(in) :: stay, beyond
    type(hunt_t), intent(in) :: hunt
    type(beside_t) :: beside
    type(cycle_points_t) :: settles
    call set_beside(family, stay, guess_at(line, stay), line(1)%orbit%periods, hunt%along, beside, is_crisis)
    if (.not. is_crisis) return
    is_crisis = is_chaotic(beside, hunt%side)
    if (.not. is_crisis) return
    call set_beside(family, beyond, guess_at(line, beyond), line(1)%orbit%periods, hunt%along, beside, is_crisis)
    if (.not. is_crisis) return
    call settle(beside, 3 - hunt%side, settles)
    is_crisis = size(settles%points, 2) > 0
    if (is_crisis) is_crisis = verdict_of(beside, hunt%side, settles, long_wait*beside%turns) == all_reach
  end function is_crisis

  !> The point of a line behind which a value lies.
  pure integer function index_before(line, value) result(k)
    type(point_t), intent(in) :: line(:)
    real(wp), intent(in) :: value
    do k = 1, size(line) - 2
      if ((line(k)%orbit%parameter - value)*(line(k + 1)%orbit%parameter - value) <= 0) return
    end do
  end function index_before

  !> The saddle on a branch at a value between its points, by linear interpolation.
  pure function guess_at(line, value) result(y)
    type(point_t), intent(in) :: line(:)
    real(wp), intent(in) :: value
    real(wp) :: y(size(line(1)%orbit%y))
    integer :: k
    k = index_before(line, value)
    associate (one => line(k)%orbit, next => line(k + 1)%orbit)
      y = one%y
      if (abs(next%parameter - one%parameter) > 0) then
        y = one%y + (next%y - one%y)*(value - one%parameter)/(next%parameter - one%parameter)
      end if
    end associate
  end function guess_at

end module homoclinic
