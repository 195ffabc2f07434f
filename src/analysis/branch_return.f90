! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a branch has come back to the orbit in which it began, and its last point there.
module branch_return
  use body_family, only: family_t
  use branch_point, only: label_closed, label_not_known, no_label, point_t, step_to, trace_t
  use kinds, only: wp
  use orbit_motion, only: same_sequence
  use orbit_sections, only: begun_at
  use periodic_orbit, only: orbit_t, scales_of_orbit
  implicit none
  private

  public :: close_up

  !> The branch is where it began if it is there to this, in natural sizes.
  real(wp), parameter :: nearly = 1e-8_wp
  integer, parameter :: most_looks = 6
  !> A point that is further than this share of a step from its tangent is not looked at: more than the turn of a step allows.
  real(wp), parameter :: off_tangent = 0.5_wp

contains

  !> Ends a branch that has passed the orbit `first` on its step from `before` to `trace`, maybe at another of its section points,
  !> in that orbit: `ending` is "closed" then. Only an orbit that Newton's method finds there is taken for it.
  !> `known` of the points come before the step; what was located beyond has been there from the beginning. Where the branch comes
  !> back in the other direction it has turned round unseen, and the ending is not known.
  subroutine close_up(family, first, before, trace, known, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: first, before, trace
    integer, intent(in) :: known
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there
    type(orbit_t) :: seed
    integer :: k
    logical :: found
    ending = no_label
    do k = 1, first%now%orbit%periods
      seed = begun_at(first%machines, first%now%orbit, k)
      call find_on_step(family, before, seed, 0.0_wp, length_of_step(family, before, points(known + 1:)), there, found)
      if (found) then
        points = [points(:known), pack(points(known + 1:), is_before(points(known + 1:)))]
      else
        ! The events have changed on the way, or their numbers: it may lie behind the end of the step.
        call find_on_step(family, trace, seed, -trace%came, 0.0_wp, there, found)
        if (found) points = points(:size(points) - 1)
      end if
      if (.not. found) cycle
      associate (last => size(there%now%tangent), first_last => size(first%now%tangent))
        ending = merge(label_closed, label_not_known, there%now%tangent(last)*first%now%tangent(first_last) > 0)
      end associate
      points = [points, there%now]
      return
    end do

  contains

    !> Whether points of the step come before the position that was found.
    pure elemental logical function is_before(point)
      type(point_t), intent(in) :: point
      is_before = same_sequence(point%orbit, there%now%orbit)
      if (is_before) is_before = sum(difference(family, there, point%orbit, there%now%orbit)*there%now%tangent) > 0
    end function is_before

  end subroutine close_up

  !> How far a step goes with the events with which it begins, whose points are given.
  pure real(wp) function length_of_step(family, before, points) result(length)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: before
    type(point_t), intent(in) :: points(:)
    integer :: i
    length = 0
    do i = 1, size(points)
      if (.not. same_sequence(before%now%orbit, points(i)%orbit)) return
      length = max(length, sum(difference(family, before, before%now%orbit, points(i)%orbit)*before%now%tangent))
    end do
  end function length_of_step

  !> From one orbit to another with the same events, in natural sizes.
  pure function difference(family, trace, from, to) result(way)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    type(orbit_t), intent(in) :: from, to
    real(wp) :: way(size(from%y) + size(from%events) + 1)
    way = [trace%machines%centre%nearest_copy(to%y, from%y) - from%y, to%events%time - from%events%time, &
           to%parameter - from%parameter]
    way = way/scales_of_orbit(trace%machines, from, family%parameter_size)
  end function difference

  !> The point of a branch at the height of the orbit `seed`, if that is within `low` to `high` of a point, and the same orbit.
  subroutine find_on_step(family, from, seed, low, high, there, found)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: from
    type(orbit_t), intent(in) :: seed
    real(wp), intent(in) :: low, high
    type(trace_t), intent(out) :: there
    logical, intent(out) :: found
    real(wp) :: way(size(from%now%tangent)), along
    logical :: near
    integer :: i, steps
    found = same_sequence(from%now%orbit, seed)
    if (.not. found) return
    way = difference(family, from, from%now%orbit, seed)
    along = sum(way*from%now%tangent)
    found = along >= low .and. along <= high .and. norm2(way - along*from%now%tangent) <= off_tangent*(high - low)
    ! Natural sizes may change on the way, so that it is not there at once; the last look is for the digits.
    near = .false.
    do i = 1, merge(most_looks, 0, found)
      call step_to(family, from, along, there, found, steps)
      if (.not. found .or. near) return
      way = difference(family, from, there%now%orbit, seed)
      near = norm2(way) < nearly
      along = along + sum(way*from%now%tangent)
    end do
    found = .false.
  end subroutine find_on_step

end module branch_return
