! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The ranks of one node and the pool of items that they share in memory.
module mpi_node
  use, intrinsic :: iso_c_binding, only: c_ptr
  use atomics, only: atomic_bytes, atomic_fetch_add, atomic_load, atomic_store, atomic_try_lock, yield
  use errors, only: error_t, fail
  use kinds, only: int64
  use mpi_f08, only: MPI_ADDRESS_KIND, MPI_Allgather, MPI_Barrier, MPI_Bcast, MPI_Comm, MPI_Comm_free, &
    MPI_Comm_rank, MPI_Comm_set_errhandler, MPI_Comm_size, MPI_Comm_split, MPI_Comm_split_type, MPI_COMM_TYPE_SHARED, &
    MPI_ERRORS_ARE_FATAL, MPI_ERRORS_RETURN, MPI_INFO_NULL, MPI_INTEGER, MPI_SUCCESS, MPI_Win, MPI_Win_allocate_shared, &
    MPI_Win_free, MPI_Win_shared_query
  use status, only: exit_internal
  implicit none
  private

  public :: new_node

  !> The shared words. `next` to `last` are the items left; `lock` guards the two.
  integer, parameter :: word_lock = 0, word_next = 1, word_last = 2, word_refilling = 3, &
    word_exhausted = 4, word_stop = 5, word_done = 6, word_count = 7

  !> A rank takes at most this part of its share of the pool in a row.
  integer, parameter :: run_share = 8

  type, public :: node_t
    !> Rank in the node and size of the node.
    integer :: rank = 0, size = 1
    !> Number of this node from 1 (rank 0 of the team is in node 1), and of all nodes their rank 0.
    integer :: number = 1
    integer, allocatable :: leaders(:)
    type(MPI_Comm), private :: comm
    type(MPI_Win), private :: window
    type(c_ptr), private :: words
  contains
    procedure :: take
    procedure :: take_run
    procedure :: has_work
    procedure :: refill
    procedure :: begin_refill
    procedure :: end_refill
    procedure :: is_exhausted
    procedure :: set_stop
    procedure :: is_stopped
    procedure :: count_done
    procedure :: done
    procedure :: free
  end type node_t

contains

  !> Groups the ranks of `comm` that share memory, at most `ranks_per_node` of them if that is
  !> positive. The pool of the first node begins with 1 to `length`. Code 70 if they
  !> cannot share memory. Collective.
  subroutine new_node(comm, ranks_per_node, length, node, error)
    type(MPI_Comm), intent(in) :: comm
    integer, intent(in) :: ranks_per_node, length
    type(node_t), intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    type(MPI_Comm) :: host
    integer :: team_rank, host_rank
    call MPI_Comm_rank(comm, team_rank)
    call MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, team_rank, MPI_INFO_NULL, node%comm)
    if (ranks_per_node > 0) then
      host = node%comm
      call MPI_Comm_rank(host, host_rank)
      call MPI_Comm_split(host, host_rank/ranks_per_node, team_rank, node%comm)
      call MPI_Comm_free(host)
    end if
    call MPI_Comm_rank(node%comm, node%rank)
    call MPI_Comm_size(node%comm, node%size)
    call find_leaders(comm, team_rank, node)
    call share_words(node, length, error)
  end subroutine new_node

  subroutine find_leaders(comm, team_rank, node)
    type(MPI_Comm), intent(in) :: comm
    integer, intent(in) :: team_rank
    type(node_t), intent(inout) :: node
    integer, allocatable :: leader_of(:)
    integer :: leader, ranks, i
    leader = team_rank
    call MPI_Bcast(leader, 1, MPI_INTEGER, 0, node%comm)
    call MPI_Comm_size(comm, ranks)
    allocate (leader_of(0:ranks - 1))
    call MPI_Allgather(leader, 1, MPI_INTEGER, leader_of, 1, MPI_INTEGER, comm)
    node%leaders = pack([(i, i=0, ranks - 1)], [(leader_of(i) == i, i=0, ranks - 1)])
    node%number = findloc(node%leaders, leader, dim=1)
  end subroutine find_leaders

  subroutine share_words(node, length, error)
    type(node_t), intent(inout) :: node
    integer, intent(in) :: length
    type(error_t), allocatable, intent(out) :: error
    integer(MPI_ADDRESS_KIND) :: bytes
    integer :: unit, status, i
    type(c_ptr) :: mine
    bytes = 0
    if (node%rank == 0) bytes = atomic_bytes(word_count)
    call MPI_Comm_set_errhandler(node%comm, MPI_ERRORS_RETURN)
    call MPI_Win_allocate_shared(bytes, 8, MPI_INFO_NULL, node%comm, mine, node%window, status)
    call MPI_Comm_set_errhandler(node%comm, MPI_ERRORS_ARE_FATAL)
    if (status /= MPI_SUCCESS) then
      call fail(error, exit_internal, 'MPI cannot share memory among the ranks of a node; with OpenMPI the transport "sm" '// &
                'has to be allowed (mpirun --mca osc sm)')
      return
    end if
    call MPI_Win_shared_query(node%window, 0, bytes, unit, node%words)
    if (node%rank == 0) then
      do i = 0, word_count - 1
        call atomic_store(node%words, i, 0_int64)
      end do
      call atomic_store(node%words, word_next, 1_int64)
      if (node%number == 1) call atomic_store(node%words, word_last, int(length, int64))
    end if
    ! Nobody looks at the pool before it is filled: an empty first pool means that all is done.
    call MPI_Barrier(node%comm)
  end subroutine share_words

  !> Takes up to `wanted` items, or the share `numerator`/`denominator` of what is left if that is
  !> more: `first` to `last`; last < first = the pool is empty.
  subroutine take(self, wanted, first, last, numerator, denominator)
    class(node_t), intent(in) :: self
    integer, intent(in) :: wanted
    integer, intent(out) :: first, last
    integer, intent(in), optional :: numerator, denominator
    integer(int64) :: next, end, count
    call lock(self)
    next = atomic_load(self%words, word_next)
    end = atomic_load(self%words, word_last)
    count = wanted
    if (present(numerator)) count = max(count, (end - next + 1)*numerator/denominator)
    count = min(count, end - next + 1)
    call atomic_store(self%words, word_next, next + count)
    call atomic_store(self%words, word_lock, 0_int64)
    first = int(next)
    last = int(next + count - 1)
  end subroutine take

  !> Takes up to `wanted` items in a row, the fewer the less is left for the `takers` ranks, so that they end together: `first` to
  !> `last`.
  subroutine take_run(self, wanted, takers, first, last)
    class(node_t), intent(in) :: self
    integer, intent(in) :: wanted, takers
    integer, intent(out) :: first, last
    integer(int64) :: next, end, count
    call lock(self)
    next = atomic_load(self%words, word_next)
    end = atomic_load(self%words, word_last)
    count = min(int(wanted, int64), max(1_int64, (end - next + 1)/(run_share*takers)), end - next + 1)
    call atomic_store(self%words, word_next, next + count)
    call atomic_store(self%words, word_lock, 0_int64)
    first = int(next)
    last = int(next + count - 1)
  end subroutine take_run

  !> Whether items are left in the pool.
  logical function has_work(self)
    class(node_t), intent(in) :: self
    call lock(self)
    has_work = atomic_load(self%words, word_next) <= atomic_load(self%words, word_last)
    call atomic_store(self%words, word_lock, 0_int64)
  end function has_work

  !> Fills the empty pool with `first` to `last`; nothing to fill = the work list is exhausted.
  subroutine refill(self, first, last)
    class(node_t), intent(in) :: self
    integer, intent(in) :: first, last
    if (last < first) then
      call atomic_store(self%words, word_exhausted, 1_int64)
      return
    end if
    call lock(self)
    call atomic_store(self%words, word_next, int(first, int64))
    call atomic_store(self%words, word_last, int(last, int64))
    call atomic_store(self%words, word_lock, 0_int64)
  end subroutine refill

  !> Whether this rank is the one that refills the pool now.
  logical function begin_refill(self)
    class(node_t), intent(in) :: self
    begin_refill = atomic_try_lock(self%words, word_refilling)
  end function begin_refill

  !> Ends `begin_refill`.
  subroutine end_refill(self)
    class(node_t), intent(in) :: self
    call atomic_store(self%words, word_refilling, 0_int64)
  end subroutine end_refill

  !> Whether the node was informed that nothing is left. The pool is empty then.
  logical function is_exhausted(self)
    class(node_t), intent(in) :: self
    is_exhausted = atomic_load(self%words, word_exhausted) /= 0
  end function is_exhausted

  !> Sets the stop word; whether this call was the first.
  logical function set_stop(self)
    class(node_t), intent(in) :: self
    set_stop = atomic_fetch_add(self%words, word_stop, 1_int64) == 0
  end function set_stop

  !> Whether the stop word is set.
  logical function is_stopped(self)
    class(node_t), intent(in) :: self
    is_stopped = atomic_load(self%words, word_stop) /= 0
  end function is_stopped

  !> Counts one item done.
  subroutine count_done(self)
    class(node_t), intent(in) :: self
    integer(int64) :: before
    before = atomic_fetch_add(self%words, word_done, 1_int64)
  end subroutine count_done

  !> Items done in this node.
  integer function done(self)
    class(node_t), intent(in) :: self
    done = int(atomic_load(self%words, word_done))
  end function done

  !> Gives the shared memory back. Collective.
  subroutine free(self)
    class(node_t), intent(inout) :: self
    call MPI_Win_free(self%window)
    call MPI_Comm_free(self%comm)
  end subroutine free

  subroutine lock(self)
    class(node_t), intent(in) :: self
    do while (.not. atomic_try_lock(self%words, word_lock))
      call yield()
    end do
  end subroutine lock

end module mpi_node
