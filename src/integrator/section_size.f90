! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How many coordinates a section may have.
module section_size
  implicit none
  private

  integer, parameter, public :: most_coordinates = 128

end module section_size
