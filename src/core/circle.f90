! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A coordinate on a circle: it means the same after every `turn`; a turn of 0 is none, and the coordinate lies on a line. The
!> coordinate of a point that may lie on a circle is its first.
module circle
  use kinds, only: wp
  implicit none
  private

  public :: nearest_turn, point_near

contains

  !> The representative of `x` within half a turn of `centre`.
  pure elemental real(wp) function nearest_turn(x, centre, turn) result(nearest)
    real(wp), intent(in) :: x, centre, turn
    nearest = x
    if (turn > 0) nearest = x - turn*floor_of((x - centre)/turn + 0.5_wp)
  end function nearest_turn

  !> The representative of a point nearest to another: differences of points are taken with it.
  pure function point_near(point, other, turn) result(nearest)
    real(wp), intent(in) :: point(:), other(:), turn
    real(wp) :: nearest(size(point))
    nearest = point
    if (turn > 0) nearest(1) = nearest_turn(point(1), other(1), turn)
  end function point_near

  !> The largest whole number that is not above `x`, of any size.
  pure elemental real(wp) function floor_of(x)
    real(wp), intent(in) :: x
    floor_of = aint(x)
    if (floor_of > x) floor_of = floor_of - 1
  end function floor_of

end module circle
