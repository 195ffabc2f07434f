! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Carries labels from one parameter value to the next, so that a branch keeps its number and its colour.
module match
  use attractors, only: attractor_t
  use kinds, only: wp
  implicit none
  private

  public :: carry_labels

  !> Distance in units of the motion's size beyond which two attractors are not the same branch.
  real(wp), parameter :: farthest = 1.0_wp
  !> Preference for the same regime.
  real(wp), parameter :: regime_penalty = 0.5_wp

contains

  !> Labels `catalogue` after the branches `known` (each as last seen), nearest pairs first; what has no partner
  !> starts a new branch. `known` is brought up to date.
  pure subroutine carry_labels(known, catalogue)
    type(attractor_t), allocatable, intent(inout) :: known(:)
    type(attractor_t), intent(inout) :: catalogue(:)
    real(wp) :: distance(size(known), size(catalogue))
    integer :: i, k, nearest(2)
    do k = 1, size(catalogue)
      catalogue(k)%id = 0
      do i = 1, size(known)
        distance(i, k) = branch_distance(known(i), catalogue(k))
      end do
    end do
    do while (size(known) > 0 .and. size(catalogue) > 0)
      nearest = minloc(distance)
      if (distance(nearest(1), nearest(2)) > farthest) exit
      catalogue(nearest(2))%id = known(nearest(1))%id
      known(nearest(1)) = catalogue(nearest(2))
      distance(nearest(1), :) = huge(1.0_wp)
      distance(:, nearest(2)) = huge(1.0_wp)
    end do
    do k = 1, size(catalogue)
      if (catalogue(k)%id > 0) cycle
      catalogue(k)%id = size(known) + 1
      known = [known, catalogue(k)]
    end do
  end subroutine carry_labels

  !> Nearest distance between points of two cycles of the same period; huge if they cannot be one branch.
  pure real(wp) function branch_distance(a, b) result(distance)
    type(attractor_t), intent(in) :: a, b
    integer :: i
    distance = huge(1.0_wp)
    if (a%period /= b%period .or. (a%rests .neqv. b%rests)) return
    if (a%rests .or. a%period == 0) then
      if (a%features%regime == b%features%regime) distance = 0
      return
    end if
    do i = 1, b%period
      distance = min(distance, norm2((a%points(:, 1) - b%points(:, i))/max(a%scale, b%scale)))
    end do
    if (a%features%regime /= b%features%regime) distance = distance + regime_penalty
  end function branch_distance

end module match
