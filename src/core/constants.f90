! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Mathematical constants, and the number that stands for none.
module constants
  use kinds, only: wp
  implicit none
  private

  real(wp), parameter, public :: pi = 3.14159265358979323846264338327950288_wp
  real(wp), parameter, public :: two_pi = 6.28318530717958647692528676655900577_wp
  !> A barrier or a bound beyond this is none; a value that is not finite is stored as this. Its square is representable.
  real(wp), parameter, public :: unreachable = sqrt(huge(1.0_wp))
end module constants
