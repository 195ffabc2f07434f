! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Mathematical constants.
module constants
  use kinds, only: wp
  implicit none
  private

  real(wp), parameter, public :: pi = 3.14159265358979323846264338327950288_wp
  real(wp), parameter, public :: two_pi = 6.28318530717958647692528676655900577_wp
end module constants
