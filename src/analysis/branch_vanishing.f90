! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The end of a branch of limit cycles that shrink to a point: beyond it the equations have the same cycles once more, with the
!> section on their other side.
module branch_vanishing
  use body_family, only: family_t
  use branch_point, only: label_hb, point_t, step_to, trace_t
  use kinds, only: wp
  implicit none
  private

  public :: has_vanished, end_at_rest

  !> A cycle of this extent, in natural sizes, is as near as its equations lead without losing their digits.
  real(wp), parameter :: nearest = 1e-4_wp
  integer, parameter :: most_halvings = 60

contains

  !> How far the section is from the middle of the cycle, in natural sizes.
  pure real(wp) function amplitude_of(trace) result(amplitude)
    type(trace_t), intent(in) :: trace
    real(wp) :: rows(2, size(trace%now%orbit%y))
    rows = trace%machines%centre%watched
    amplitude = (sum(rows(1, :)*trace%now%orbit%y) - (trace%now%x_max + trace%now%x_min)/2)/trace%machines%centre%size_of(1)
  end function amplitude_of

  !> Whether the cycle of a machine without a clock has shrunk to nothing between a point and the next.
  pure logical function has_vanished(trace, next)
    type(trace_t), intent(in) :: trace, next
    has_vanished = .not. (trace%machines%centre%has_clock .or. trace%machines%centre%crank_section)
    if (has_vanished) has_vanished = amplitude_of(trace)*amplitude_of(next) < 0
  end function has_vanished

  !> Ends a branch with the smallest cycle that is found within `length`.
  subroutine end_at_rest(family, trace, length, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there, tried
    real(wp) :: low, high, middle
    logical :: ok
    integer :: i, steps
    ending = label_hb
    there = trace
    low = 0
    high = length
    do i = 1, most_halvings
      if (abs(amplitude_of(there)) < nearest) exit
      middle = (low + high)/2
      call step_to(family, trace, middle, tried, ok, steps)
      if (ok) ok = .not. has_vanished(trace, tried)
      if (ok) then
        low = middle
        there = tried
      else
        high = middle
      end if
    end do
    there%now%label = label_hb
    points = [points, there%now]
  end subroutine end_at_rest

end module branch_vanishing
