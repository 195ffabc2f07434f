! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an MPI .pf file uses, under the name that pFUnit gives it. pFUnit hands on module mpi, so that a suite with mpi_f08
!> takes `MpiTestMethod` alone from here and the assertions from funit.
module pfunit
  use funit
  use mpi
  use mpi_test_method, only: MpiTestMethod
  use pfunit_names
  implicit none
  public
end module pfunit
