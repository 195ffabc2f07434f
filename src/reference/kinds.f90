! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The working precision of the reference library: quadruple. Stands in for src/core/kinds.f90.
module kinds
  use, intrinsic :: iso_fortran_env, only: int8, int16, int32, int64, real32, real64, real128
  implicit none
  private

  public :: int8, int16, int32, int64, real32, real64

  integer, parameter, public :: wp = real128
end module kinds
