! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How a file is opened: the only choice between serial and parallel HDF5 in this layer.
module h5_access
  use hdf5, only: hid_t
#ifdef SEPARATRIX_MPI
  use hdf5, only: h5pset_fapl_mpio_f
  use mpi_f08, only: MPI_Info, MPI_Info_create, MPI_Info_free, MPI_Info_set
#endif
  implicit none
  private

  public :: set_parallel_access

contains

  !> Makes the ranks of a communicator (Fortran handle) open a file together, with transfers that
  !> are independent of each other. `status` as HDF5.
  subroutine set_parallel_access(access, communicator, status)
    integer(hid_t), intent(in) :: access
    integer, intent(in) :: communicator
    integer, intent(out) :: status
#ifdef SEPARATRIX_MPI
    type(MPI_Info) :: hints
    call MPI_Info_create(hints)
    ! Data sieving rewrites what lies between the rows of a tile, and locks it.
    call MPI_Info_set(hints, 'romio_ds_write', 'disable')
    call h5pset_fapl_mpio_f(access, communicator, hints%MPI_VAL, status)
    call MPI_Info_free(hints)
#else
    associate (unused => access, also => communicator)
    end associate
    status = -1
#endif
  end subroutine set_parallel_access

end module h5_access
