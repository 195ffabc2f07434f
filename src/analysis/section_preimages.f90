! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Preimages of points on the section under the map over one drive period, by Newton's method with its exact derivative: no
!> inverse of the machine is needed.
module section_preimages
  use body_family, only: map_with_variation
  use circle, only: point_near
  use constants, only: unreachable
  use kinds, only: wp
  use matrices, only: solve
  use motion_state, only: tally_t
  use one_body, only: one_body_t
  use saddle_search, only: section_distance
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: preimage_beside, scan_window

  integer, parameter :: most_newton = 12
  !> Starts along each side of the window whose images are known, and how many of them are tried as guesses.
  integer, parameter :: scans = 40, most_tries = 4
  !> Of natural sizes: how far the image of a guess may be from the target, and after five steps.
  real(wp), parameter :: farthest_guess = 0.5_wp, hopeless = 1e-2_wp
  !> Of natural sizes: distance of a preimage's image.
  real(wp), parameter :: accuracy = 1e-12_wp

  !> Starts all over a window and their images (columns).
  type, public :: scan_t
    real(wp), allocatable :: starts(:, :), images(:, :)
  end type scan_t

contains

  !> The preimage near a guess, or, where the curve runs into a barrier and goes on elsewhere, near the starts whose images are
  !> nearest to the target.
  subroutine preimage_beside(machines, body, scan, target, guess, y, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(scan_t), intent(in) :: scan
    real(wp), intent(in) :: target(2), guess(2)
    real(wp), intent(out) :: y(2)
    logical, intent(out) :: ok
    real(wp) :: distance(size(scan%starts, 2))
    integer :: i, nearest
    y = guess
    call find_preimage(machines, body, target, y, ok)
    if (ok) return
    do i = 1, size(distance)
      distance(i) = section_distance(body, scan%images(:, i), target)
    end do
    do i = 1, most_tries
      nearest = minloc(distance, 1)
      if (distance(nearest) > farthest_guess) exit
      y = scan%starts(:, nearest)
      call find_preimage(machines, body, target, y, ok)
      if (ok) return
      distance(nearest) = huge(distance)
    end do
  end subroutine preimage_beside

  !> Starts all over the window and their images: guesses where the neighbour is none.
  subroutine scan_window(machines, body, lowest, highest, scan)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: lowest(2), highest(2)
    type(scan_t), intent(out) :: scan
    type(tally_t) :: tally
    real(wp) :: slopes(2, 2), low(2), high(2)
    integer :: i, j, k
    logical :: ok
    allocate (scan%starts(2, scans**2), scan%images(2, scans**2))
    associate (contact => body%moving%machine%contact)
      low = [max(lowest(1), contact%lower), lowest(2)]
      high = [min(highest(1), contact%upper), highest(2)]
    end associate
    do j = 1, scans
      do i = 1, scans
        k = i + scans*(j - 1)
        scan%starts(:, k) = low + (high - low)*[i - 0.5_wp, j - 0.5_wp]/scans
        call map_with_variation(machines, scan%starts(:, k), 1, scan%images(:, k), slopes, tally, ok)
        if (.not. ok) scan%images(:, k) = unreachable
      end do
    end do
  end subroutine scan_window

  !> Newton's method for the preimage of `target`, from `y` on.
  subroutine find_preimage(machines, body, target, y, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: target(2)
    real(wp), intent(inout) :: y(2)
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp) :: image(2), slopes(2, 2), step(2), miss, best(2), least
    integer :: i
    least = huge(least)
    best = y
    do i = 1, most_newton
      call map_with_variation(machines, y, 1, image, slopes, tally, ok)
      if (.not. ok) exit
      miss = section_distance(body, image, target)
      image = point_near(image, target, body%moving%machine%turn)
      if (miss < least) best = y
      if (miss >= least .and. least < accuracy) exit
      ! Newton's method is quick, or it leads nowhere.
      if (i > 5 .and. least > hopeless) exit
      least = min(least, miss)
      if (.not. miss > 0) exit
      call solve(slopes, target - image, step, ok)
      if (.not. ok) exit
      if (norm2(step/body%size_of) > 10) exit
      y = y + step
      y(1) = max(min(y(1), body%moving%machine%contact%upper), body%moving%machine%contact%lower)
    end do
    ok = least < accuracy
    y = best
  end subroutine find_preimage

end module section_preimages
