! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A team of MPI processes on a communicator of its own, a copy of the one it is made from.
module mpi_team
  use kinds, only: int64, real64
  use mpi_f08, only: MPI_Abort, MPI_Allgather, MPI_Allgatherv, MPI_Allreduce, MPI_Barrier, MPI_Bcast, &
    MPI_CHARACTER, MPI_Comm, MPI_Comm_dup, MPI_Comm_free, MPI_Comm_rank, MPI_Comm_size, &
    MPI_Finalize, MPI_Gatherv, MPI_Ibarrier, MPI_IN_PLACE, MPI_INTEGER, MPI_INTEGER8, MPI_REAL8, MPI_Request, &
    MPI_STATUS_IGNORE, MPI_SUM, MPI_Test
  use team, only: team_t
  implicit none
  private

  public :: new_mpi_team

  type, extends(team_t), public :: mpi_team_t
    type(MPI_Comm) :: comm
    integer, private :: my_rank = 0, my_size = 1
    logical, private :: owns_mpi = .false.
    !> The barrier that `arrive` has begun.
    type(MPI_Request), private :: everyone
  contains
    procedure :: rank => rank_of
    procedure :: size => size_of
    procedure :: communicator
    procedure :: barrier
    procedure :: arrive
    procedure :: all_arrived
    procedure :: abort => abort_with
    procedure :: broadcast_text
    procedure :: broadcast_integers
    procedure :: sum => sum_integers
    procedure :: gather
    procedure :: allgather
    procedure :: close => close_team
  end type mpi_team_t

contains

  !> Makes the team of the ranks of `comm`. `owns_mpi`: `close` ends MPI.
  subroutine new_mpi_team(comm, team, owns_mpi)
    type(MPI_Comm), intent(in) :: comm
    type(mpi_team_t), intent(out) :: team
    logical, intent(in) :: owns_mpi
    call MPI_Comm_dup(comm, team%comm)
    call MPI_Comm_rank(team%comm, team%my_rank)
    call MPI_Comm_size(team%comm, team%my_size)
    team%owns_mpi = owns_mpi
  end subroutine new_mpi_team

  !> This rank, from 0.
  pure integer function rank_of(self)
    class(mpi_team_t), intent(in) :: self
    rank_of = self%my_rank
  end function rank_of

  !> The number of ranks.
  pure integer function size_of(self)
    class(mpi_team_t), intent(in) :: self
    size_of = self%my_size
  end function size_of

  !> The Fortran handle of the team's communicator.
  pure integer function communicator(self)
    class(mpi_team_t), intent(in) :: self
    communicator = self%comm%MPI_VAL
  end function communicator

  !> Waits for all ranks.
  subroutine barrier(self)
    class(mpi_team_t), intent(in) :: self
    call MPI_Barrier(self%comm)
  end subroutine barrier

  !> Begins a barrier without waiting.
  subroutine arrive(self)
    class(mpi_team_t), intent(inout) :: self
    call MPI_Ibarrier(self%comm, self%everyone)
  end subroutine arrive

  !> Whether all ranks have called `arrive`.
  logical function all_arrived(self)
    class(mpi_team_t), intent(inout) :: self
    call MPI_Test(self%everyone, all_arrived, MPI_STATUS_IGNORE)
  end function all_arrived

  !> Ends all ranks with this exit code.
  subroutine abort_with(self, code)
    class(mpi_team_t), intent(in) :: self
    integer, intent(in) :: code
    call MPI_Abort(self%comm, code)
  end subroutine abort_with

  !> Every rank gets the text of rank `root` (0 unless given).
  subroutine broadcast_text(self, text, root)
    class(mpi_team_t), intent(in) :: self
    character(len=:), allocatable, intent(inout) :: text
    integer, intent(in), optional :: root
    character(len=:), allocatable :: buffer
    integer :: length
    length = 0
    if (self%my_rank == from_rank(root)) length = len(text)
    call MPI_Bcast(length, 1, MPI_INTEGER, from_rank(root), self%comm)
    allocate (character(len=length) :: buffer)
    if (self%my_rank == from_rank(root)) buffer = text
    call MPI_Bcast(buffer, length, MPI_CHARACTER, from_rank(root), self%comm)
    call move_alloc(buffer, text)
  end subroutine broadcast_text

  !> Every rank gets the values of rank `root` (0 unless given).
  subroutine broadcast_integers(self, values, root)
    class(mpi_team_t), intent(in) :: self
    integer(int64), intent(inout), contiguous :: values(:)
    integer, intent(in), optional :: root
    call MPI_Bcast(values, size(values), MPI_INTEGER8, from_rank(root), self%comm)
  end subroutine broadcast_integers

  !> Every rank gets the sums over the ranks.
  subroutine sum_integers(self, values)
    class(mpi_team_t), intent(in) :: self
    integer(int64), intent(inout), contiguous :: values(:)
    call MPI_Allreduce(MPI_IN_PLACE, values, size(values), MPI_INTEGER8, MPI_SUM, self%comm)
  end subroutine sum_integers

  !> The values of all ranks in the order of the ranks, on rank 0.
  subroutine gather(self, values, all_values)
    class(mpi_team_t), intent(in) :: self
    real(real64), intent(in), contiguous :: values(:)
    real(real64), allocatable, intent(out) :: all_values(:)
    integer, allocatable :: counts(:), offsets(:)
    call sizes_of_all(self, size(values), counts, offsets)
    allocate (all_values(merge(sum(counts), 0, self%my_rank == 0)))
    call MPI_Gatherv(values, size(values), MPI_REAL8, all_values, counts, offsets, MPI_REAL8, 0, self%comm)
  end subroutine gather

  !> The values of all ranks in the order of the ranks, on every rank.
  subroutine allgather(self, values, all_values)
    class(mpi_team_t), intent(in) :: self
    real(real64), intent(in), contiguous :: values(:)
    real(real64), allocatable, intent(out) :: all_values(:)
    integer, allocatable :: counts(:), offsets(:)
    call sizes_of_all(self, size(values), counts, offsets)
    allocate (all_values(sum(counts)))
    call MPI_Allgatherv(values, size(values), MPI_REAL8, all_values, counts, offsets, MPI_REAL8, self%comm)
  end subroutine allgather

  !> Gives the communicator back, and ends MPI if this team started it.
  subroutine close_team(self)
    class(mpi_team_t), intent(inout) :: self
    call MPI_Comm_free(self%comm)
    if (self%owns_mpi) call MPI_Finalize()
  end subroutine close_team

  subroutine sizes_of_all(self, mine, counts, offsets)
    class(mpi_team_t), intent(in) :: self
    integer, intent(in) :: mine
    integer, allocatable, intent(out) :: counts(:), offsets(:)
    integer :: i
    allocate (counts(self%my_size), offsets(self%my_size))
    call MPI_Allgather(mine, 1, MPI_INTEGER, counts, 1, MPI_INTEGER, self%comm)
    offsets(1) = 0
    do i = 2, self%my_size
      offsets(i) = offsets(i - 1) + counts(i - 1)
    end do
  end subroutine sizes_of_all

  pure integer function from_rank(root)
    integer, intent(in), optional :: root
    from_rank = 0
    if (present(root)) from_rank = root
  end function from_rank

end module mpi_team
