! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Carries labels from one parameter value to the next, so that a branch keeps its number and its colour.
module match
  use attractors, only: attractor_t, kind_family
  use circle, only: point_near
  use kinds, only: wp
  implicit none
  private

  public :: carry_labels, number_new, remember

  !> Distance in units of the motion's size beyond which two attractors are not the same branch.
  real(wp), parameter :: farthest = 1.0_wp

contains

  !> Gives the attractors of `catalogue` that have no label yet (id 0) those of the nearest branches in `known`, nearest
  !> pairs first; no label twice.
  pure subroutine carry_labels(known, catalogue)
    type(attractor_t), intent(in) :: known(:)
    type(attractor_t), intent(inout) :: catalogue(:)
    real(wp) :: distance(size(known), size(catalogue))
    integer :: i, k, nearest(2)
    if (size(known) == 0 .or. size(catalogue) == 0) return
    do k = 1, size(catalogue)
      do i = 1, size(known)
        distance(i, k) = huge(1.0_wp)
        if (catalogue(k)%id == 0 .and. .not. any(catalogue%id == known(i)%id)) then
          distance(i, k) = branch_distance(known(i), catalogue(k))
        end if
      end do
    end do
    do
      nearest = minloc(distance)
      if (distance(nearest(1), nearest(2)) > farthest) exit
      catalogue(nearest(2))%id = known(nearest(1))%id
      distance(nearest(1), :) = huge(1.0_wp)
      distance(:, nearest(2)) = huge(1.0_wp)
    end do
  end subroutine carry_labels

  !> What has no label yet starts new branches: `highest` + 1, + 2, ...
  pure subroutine number_new(catalogue, highest)
    type(attractor_t), intent(inout) :: catalogue(:)
    integer, intent(inout) :: highest
    integer :: k
    do k = 1, size(catalogue)
      if (catalogue(k)%id > 0) cycle
      highest = highest + 1
      catalogue(k)%id = highest
    end do
  end subroutine number_new

  !> Brings `known`, branches as last seen, up to date with a labelled catalogue.
  pure subroutine remember(known, catalogue)
    type(attractor_t), allocatable, intent(inout) :: known(:)
    type(attractor_t), intent(in) :: catalogue(:)
    integer :: i, k
    do k = 1, size(catalogue)
      i = findloc(known%id, catalogue(k)%id, dim=1)
      if (i > 0) then
        known(i) = catalogue(k)
      else
        known = [known, catalogue(k)]
      end if
    end do
  end subroutine remember

  !> Nearest distance between points of two cycles of the same regime and period; huge if they cannot be one branch.
  pure real(wp) function branch_distance(a, b) result(distance)
    type(attractor_t), intent(in) :: a, b
    integer :: i, n
    distance = huge(1.0_wp)
    n = a%coordinates
    if (a%period /= b%period .or. a%features%regime /= b%features%regime .or. n /= b%coordinates .or. &
        (a%by_event .neqv. b%by_event)) return
    if ((a%kind == kind_family) .neqv. (b%kind == kind_family)) return
    if (abs(a%features%rotation - b%features%rotation) > 0 .and. a%period > 0) return
    if (a%period == 0) then
      distance = 0
      return
    end if
    if (a%rests) then
      ! The nearest positions of rest, however far: they have no size of their own.
      associate (away => norm2(point_near(b%points(:n, 1), a%points(:n, 1), a%turn) - a%points(:n, 1)))
        distance = farthest*away/(1 + away)
      end associate
      return
    end if
    do i = 1, b%period
      associate (near => point_near(b%points(:n, i), a%points(:n, 1), a%turn))
        distance = min(distance, norm2((a%points(:n, 1) - near)/max(a%scale(:n), b%scale(:n))))
      end associate
    end do
  end function branch_distance

end module match
