! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a serial .pf file uses, under the name that pFUnit gives it.
module funit
  use assertions
  use funit_names
  use test_outcome, only: anyExceptions, SourceLocation
  implicit none
  public
end module funit
