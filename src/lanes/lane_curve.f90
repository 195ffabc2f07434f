! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A restitution by a table, as lanes of one body and of several have it.
module lane_curve
  use curve_law, only: curve_t, most_knots
  use kinds, only: wp
  use, intrinsic :: iso_c_binding, only: c_double
  implicit none
  private

  public :: restitution_curve_of

  !> Mirrors `lane_curve` of lane_types.hpp.
  type, bind(c), public :: restitution_curve_t
    real(c_double) :: count = 0, at(most_knots) = 0, value(most_knots) = 0, slope(most_knots) = 0
  end type restitution_curve_t

contains

  !> The table for lanes.
  pure type(restitution_curve_t) function restitution_curve_of(curve) result(table)
    type(curve_t), intent(in) :: curve
    table = restitution_curve_t(real(curve%count, wp), curve%at, curve%value, curve%slope)
  end function restitution_curve_of

end module lane_curve
