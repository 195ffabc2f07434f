! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The argument of an MPI test. Names follow pFUnit.
module mpi_test_method
  use mpi_f08, only: MPI_Comm, MPI_Comm_rank, MPI_Comm_size, MPI_COMM_NULL
  implicit none
  private

  public :: new_method

  type, public :: MpiTestMethod
    private
    type(MPI_Comm) :: comm = MPI_COMM_NULL
  contains
    procedure :: getMpiCommunicator
    procedure :: getProcessRank
    procedure :: getNumProcesses
  end type MpiTestMethod

contains

  !> The argument of a test on the ranks of a communicator.
  type(MpiTestMethod) function new_method(comm)
    type(MPI_Comm), intent(in) :: comm
    new_method%comm = comm
  end function new_method

  !> Handle for the value of a `type(MPI_Comm)`.
  integer function getMpiCommunicator(self)
    class(MpiTestMethod), intent(in) :: self
    getMpiCommunicator = self%comm%mpi_val
  end function getMpiCommunicator

  !> From 0.
  integer function getProcessRank(self)
    class(MpiTestMethod), intent(in) :: self
    call MPI_Comm_rank(self%comm, getProcessRank)
  end function getProcessRank

  integer function getNumProcesses(self)
    class(MpiTestMethod), intent(in) :: self
    call MPI_Comm_size(self%comm, getNumProcesses)
  end function getNumProcesses

end module mpi_test_method
