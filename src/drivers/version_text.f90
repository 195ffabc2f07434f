! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix --version`.
module version_text
  use build_info, only: commit, compiler, flags, hdf5, mpi, version
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  private

  public :: print_version

contains

  !> Version, commit, compiler, MPI, HDF5 and flags, one a line.
  subroutine print_version()
    write (output_unit, '(a)') 'separatrix '//version, 'commit '//commit, 'compiler '//compiler, 'mpi '//mpi, &
      'hdf5 '//hdf5, 'flags '//flags
  end subroutine print_version

end module version_text
