! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a branch is a part of another one that was followed further.
module part_of_branch
  use body_family, only: family_t
  use branch_point, only: branch_t, point_t
  use kinds, only: wp
  use periodic_orbit, only: orbit_t
  implicit none
  private

  public :: lies_on, event_speeds

  !> How far a branch is from the chord of a step, as a share of it: more than the turn of a step allows; and at least.
  real(wp), parameter :: off_chord = 0.05_wp, rounding = 1e-7_wp
  !> Number of features that distinguish the orbits at one value of the parameter.
  integer, parameter :: features = 5

contains

  !> Whether all points of a branch, or with `mirror` [m] their mirror images about that position, lie between points of another.
  pure logical function lies_on(part, whole, family, mirror)
    type(branch_t), intent(in) :: part, whole
    type(family_t), intent(in) :: family
    real(wp), intent(in), optional :: mirror
    real(wp) :: ends(features, size(whole%points))
    integer :: i, k, last
    lies_on = part%points(1)%orbit%periods == whole%points(1)%orbit%periods
    if (.not. lies_on) return
    do k = 1, size(whole%points)
      ends(:, k) = features_of(whole%points(k), family)
    end do
    last = 1
    do i = 1, size(part%points)
      call find_chord(features_of(part%points(i), family, mirror), ends, last, lies_on)
      if (.not. lies_on) return
    end do
  end function lies_on

  !> The chord on which a position lies, from the one found last.
  pure subroutine find_chord(position, ends, last, found)
    real(wp), intent(in) :: position(:), ends(:, :)
    integer, intent(inout) :: last
    logical, intent(out) :: found
    real(wp) :: step(features), away(features), share
    integer :: k, at, chords
    found = .false.
    chords = size(ends, 2) - 1
    do k = 0, chords - 1
      at = 1 + modulo(last - 1 + k, chords)
      step = ends(:, at + 1) - ends(:, at)
      away = position - ends(:, at)
      share = 0
      if (norm2(step) > 0) share = min(max(sum(away*step)/sum(step**2), 0.0_wp), 1.0_wp)
      found = norm2(away - share*step) <= off_chord*norm2(step) + rounding
      if (found) last = at
      if (found) return
    end do
  end subroutine find_chord

  !> The parameter, the extremes, and sums of the states before the events: none depends on where the orbit begins, and in a graze
  !> only that of the positions jumps. In natural sizes.
  pure function features_of(point, family, mirror) result(position)
    type(point_t), intent(in) :: point
    type(family_t), intent(in) :: family
    real(wp), intent(in), optional :: mirror
    real(wp) :: position(features)
    integer :: k
    associate (orbit => point%orbit, sizes => family%sizes)
      position(:3) = [orbit%parameter/family%parameter_size, [point%x_min, point%x_max]/sizes(1)]
      position(4) = 0
      do k = 1, size(orbit%events)
        position(4) = position(4) + orbit%events(k)%arrival(1)/sizes(1)
      end do
      position(5) = event_speeds(orbit, sizes)
      if (.not. present(mirror)) return
      position(2:3) = 2*mirror/sizes(1) - position([3, 2])
      position(4) = 2*size(orbit%events)*mirror/sizes(1) - position(4)
      position(5) = -position(5)
    end associate
  end function features_of

  !> Sum of the states but the first before the events, in natural sizes: a number that distinguishes orbits, does not depend on
  !> where they begin, and changes its sign for the mirror image of a body's orbit.
  pure real(wp) function event_speeds(orbit, sizes) result(total)
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: sizes(2)
    integer :: k
    total = 0
    do k = 1, size(orbit%events)
      total = total + sum(orbit%events(k)%arrival(2:size(orbit%y)))/sizes(2)
    end do
  end function event_speeds

end module part_of_branch
