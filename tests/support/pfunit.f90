! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an MPI .pf file uses, under the name that pFUnit gives it.
module pfunit
  use funit
  use mpi_test_method, only: MpiTestMethod
  implicit none
  public
end module pfunit
