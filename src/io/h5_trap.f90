! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What happens where HDF5 does not come back from a damaged file.
module h5_trap
  use guard, only: begin_guard
  use status, only: exit_io
  implicit none
  private

  public :: trap

  !> Seconds of the processor that no reading of names, types and strings takes.
  integer, parameter :: most_seconds = 5

contains

  !> Until `end_guard`: where HDF5 crashes in a damaged file, or reads names, types or strings for ever (`endless`), the
  !> program ends with code 74. HDF5 1.10 does both: its heap of strings, for one, has no checksum.
  subroutine trap(what, path, endless)
    character(len=*), intent(in) :: what, path
    logical, intent(in) :: endless
    call begin_guard('HDF5 fails in '''//path//''' at '//what//': the file is damaged', merge(most_seconds, 0, endless), exit_io)
  end subroutine trap

end module h5_trap
