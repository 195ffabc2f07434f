! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The only file that names a kind. The reference library is the same code built with `wp` in
!> quadruple precision (src/reference).
module kinds
  use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64
  implicit none
  private

  public :: int8, int16, int32, int64, real32, real64

  !> Working precision of the numerics.
  integer, parameter, public :: wp = real64
end module kinds
