! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Work for the ranks of an MPI team on two levels. Each node has a pool of items in shared
!> memory. That of rank 0's node is the work list itself, in an order in which every block is a fair
!> sample of it; the others are refilled from it in blocks that shrink with what is left, by messages
!> which rank 0 answers in `poll` and in `finish`.
module mpi_scheduler
  use errors, only: error_t, fail
  use kinds, only: int64, real64
  use mpi_f08, only: MPI_Allreduce, MPI_ANY_SOURCE, MPI_Bcast, MPI_Comm, MPI_Ibarrier, MPI_IN_PLACE, &
    MPI_INTEGER, MPI_Iprobe, MPI_Isend, MPI_LOGICAL, MPI_Recv, MPI_Request, MPI_Send, MPI_Status, &
    MPI_STATUS_IGNORE, MPI_STATUSES_IGNORE, MPI_SUM, MPI_Test, MPI_Waitall
  use mpi_node, only: new_node, node_t
  use mpi_team, only: mpi_team_t
  use scheduler, only: scheduler_options_t, scheduler_t
  use spread_order, only: new_spread_order, spread_order_t
  use status, only: exit_internal
  use system, only: sleep_microseconds
  implicit none
  private

  public :: new_mpi_scheduler

  integer, parameter :: tag_request = 101, tag_reply = 102, tag_stop = 103
  !> Pause between two looks for a message, in microseconds: no core is burnt while waiting.
  integer, parameter :: pause_us = 100
  !> What a rank takes at once from the pool of its node takes it about so many seconds.
  real(real64), parameter :: run_seconds = 0.5_real64
  integer, parameter :: longest_run = 1000

  type, extends(scheduler_t), public :: mpi_scheduler_t
    type(MPI_Comm), private :: comm
    integer, private :: rank = 0, ranks = 1
    type(node_t), private :: node
    !> Pools hold numbers of this order.
    type(spread_order_t), private :: order
    !> Between `start` and `finish`.
    logical, private :: active = .false.
    logical, private :: busy = .false., stopped = .false.
    integer, private :: my_done = 0, all_done = 0
    !> Numbers that this rank has taken and not begun.
    integer, private :: run_next = 1, run_last = 0
    !> Seconds that its items have taken, and when the present one began.
    real(real64), private :: seconds_busy = 0, item_began = 0
    !> On rank 0: items done that each node has reported.
    integer, allocatable, private :: reported(:)
    !> Notices of a stop: sent to rank 0, received by rank 0, sent on by rank 0, received by a leader.
    integer, private :: notices_sent = 0, notices_received = 0
    logical, private :: nodes_informed = .false., was_informed = .false.
    type(MPI_Request), allocatable, private :: sending(:)
  contains
    procedure :: start
    procedure :: next
    procedure :: poll
    procedure :: request_stop
    procedure :: stop_requested
    procedure :: done_count
    procedure :: finish
  end type mpi_scheduler_t

contains

  !> A scheduler for the ranks of `team`.
  subroutine new_mpi_scheduler(team, options, scheduler, error)
    type(mpi_team_t), intent(in) :: team
    type(scheduler_options_t), intent(in) :: options
    type(mpi_scheduler_t), intent(out) :: scheduler
    type(error_t), allocatable, intent(out) :: error
    if (options%ranks_per_node < 0) then
      call fail(error, exit_internal, 'ranks_per_node is negative')
      return
    end if
    scheduler%options = options
    scheduler%comm = team%comm
    scheduler%rank = team%rank()
    scheduler%ranks = team%size()
  end subroutine new_mpi_scheduler

  !> Begins a list of `n` items. Collective.
  subroutine start(self, n, error)
    class(mpi_scheduler_t), intent(inout) :: self
    integer, intent(in) :: n
    type(error_t), allocatable, intent(out) :: error
    if (n < 0) then
      call fail(error, exit_internal, 'a work list has a negative length')
      return
    end if
    call new_node(self%comm, self%options%ranks_per_node, n, self%node, error)
    if (allocated(error)) return
    self%order = new_spread_order(n)
    self%active = .true.
    self%busy = .false.
    self%stopped = .false.
    self%my_done = 0
    self%all_done = 0
    self%run_next = 1
    self%run_last = 0
    self%seconds_busy = 0
    self%notices_sent = 0
    self%notices_received = 0
    self%nodes_informed = .false.
    self%was_informed = .false.
    if (allocated(self%reported)) deallocate (self%reported)
    if (allocated(self%sending)) deallocate (self%sending)
    allocate (self%reported(size(self%node%leaders)), source=0)
    allocate (self%sending(0))
    call self%begin_log()
  end subroutine start

  !> The next item; 0 = none left, or a stop was requested.
  subroutine next(self, item)
    class(mpi_scheduler_t), intent(inout) :: self
    integer, intent(out) :: item
    if (self%busy) then
      self%my_done = self%my_done + 1
      self%seconds_busy = self%seconds_busy + (self%elapsed() - self%item_began)
      call self%node%count_done()
      call self%log%end(self%elapsed())
      self%busy = .false.
    end if
    do
      item = 0
      call self%poll()
      if (self%node%is_stopped()) return
      if (self%run_next > self%run_last) call self%node%take_run(run_length(self), takers(self), self%run_next, self%run_last)
      if (self%run_last >= self%run_next) exit
      if (self%node%number == 1) return
      if (self%node%is_exhausted()) return
      call refill_pool(self)
    end do
    self%busy = .true.
    item = self%order%item(self%run_next)
    self%run_next = self%run_next + 1
    self%item_began = self%elapsed()
    call self%log%begin(item, self%item_began)
  end subroutine next

  !> Who takes from the pool of this node: that of rank 0 is the work list of all.
  pure integer function takers(self)
    type(mpi_scheduler_t), intent(in) :: self
    takers = merge(self%ranks, self%node%size, self%node%number == 1)
  end function takers

  !> So many items take about `run_seconds`. What is done in a row lies side by side in the file.
  pure integer function run_length(self)
    type(mpi_scheduler_t), intent(in) :: self
    run_length = 1
    if (self%my_done == 0) return
    run_length = max(1, int(min(run_seconds*self%my_done/max(self%seconds_busy, tiny(run_seconds)), real(longest_run, real64))))
  end function run_length

  !> Looks for signals, the time limit and messages.
  subroutine poll(self)
    class(mpi_scheduler_t), intent(inout) :: self
    logical :: found
    if (.not. self%active) return
    if (self%stop_is_due()) call self%request_stop()
    if (self%rank == 0) then
      call serve(self)
    else if (self%node%rank == 0 .and. self%node%number > 1 .and. .not. self%was_informed) then
      call MPI_Iprobe(0, tag_stop, self%comm, found, MPI_STATUS_IGNORE)
      if (found) call hear_stop(self)
    end if
  end subroutine poll

  !> Every rank gets 0 from its next call of `next`.
  subroutine request_stop(self)
    class(mpi_scheduler_t), intent(inout) :: self
    type(MPI_Request) :: request
    integer :: nothing(0)
    if (.not. self%active) return
    if (self%node%is_stopped()) return
    ! Only the first of a node informs rank 0, which sees the flag of its own node.
    if (.not. self%node%set_stop() .or. self%node%number == 1) return
    call MPI_Isend(nothing, 0, MPI_INTEGER, 0, tag_stop, self%comm, request)
    self%sending = [self%sending, request]
    self%notices_sent = self%notices_sent + 1
  end subroutine request_stop

  !> Whether to leave the work now.
  logical function stop_requested(self)
    class(mpi_scheduler_t), intent(in) :: self
    stop_requested = self%stopped
    if (self%active) stop_requested = self%node%is_stopped()
  end function stop_requested

  !> Items done; on rank 0 while the work runs, exact on every rank after `finish`.
  integer function done_count(self)
    class(mpi_scheduler_t), intent(in) :: self
    done_count = self%all_done
    if (self%active) done_count = self%node%done() + sum(self%reported)
  end function done_count

  !> Waits for all ranks; rank 0 answers the other nodes meanwhile. Collective.
  subroutine finish(self)
    class(mpi_scheduler_t), intent(inout) :: self
    type(MPI_Request) :: everyone
    logical :: arrived
    if (.not. self%active) return
    self%busy = .false.
    call MPI_Ibarrier(self%comm, everyone)
    do
      call MPI_Test(everyone, arrived, MPI_STATUS_IGNORE)
      if (arrived) exit
      call self%poll()
      call sleep_microseconds(pause_us)
    end do
    call settle_notices(self)
    call self%node%free()
    self%active = .false.
  end subroutine finish

  !> After the barrier nobody sends any more. What was sent is received, and the totals are shared.
  subroutine settle_notices(self)
    class(mpi_scheduler_t), intent(inout) :: self
    integer :: totals(3)
    totals = [self%my_done, self%notices_sent, merge(1, 0, self%node%is_stopped())]
    call MPI_Allreduce(MPI_IN_PLACE, totals, size(totals), MPI_INTEGER, MPI_SUM, self%comm)
    self%all_done = totals(1)
    self%stopped = totals(3) > 0
    if (self%rank == 0) then
      do while (self%notices_received < totals(2))
        call hear_notice(self)
      end do
    end if
    call MPI_Bcast(self%nodes_informed, 1, MPI_LOGICAL, 0, self%comm)
    if (self%nodes_informed .and. self%node%rank == 0 .and. self%node%number > 1 .and. .not. self%was_informed) then
      call hear_stop(self)
    end if
    call MPI_Waitall(size(self%sending), self%sending, MPI_STATUSES_IGNORE)
  end subroutine settle_notices

  !> One rank of a node asks rank 0 for a block; the others wait for it.
  subroutine refill_pool(self)
    class(mpi_scheduler_t), intent(inout) :: self
    integer :: question(3), block(2)
    logical :: answered, needed
    if (.not. self%node%begin_refill()) then
      call sleep_microseconds(pause_us)
      return
    end if
    ! Another rank may have refilled the pool since it was seen empty.
    needed = .not. self%node%has_work()
    if (needed) needed = .not. self%node%is_exhausted()
    if (needed) then
      self%log%questions = self%log%questions + 1
      question = [self%node%number, self%node%size, self%node%done()]
      call MPI_Send(question, size(question), MPI_INTEGER, 0, tag_request, self%comm)
      do
        call MPI_Iprobe(0, tag_reply, self%comm, answered, MPI_STATUS_IGNORE)
        if (answered) exit
        call self%poll()
        call sleep_microseconds(pause_us)
      end do
      call MPI_Recv(block, size(block), MPI_INTEGER, 0, tag_reply, self%comm, MPI_STATUS_IGNORE)
      call self%node%refill(block(1), block(2))
    end if
    call self%node%end_refill()
  end subroutine refill_pool

  !> Rank 0 answers what has arrived, and sends a stop on to the other nodes once.
  subroutine serve(self)
    class(mpi_scheduler_t), intent(inout) :: self
    logical :: found
    type(MPI_Status) :: from
    integer :: question(3), block(2), nothing(0), i
    type(MPI_Request) :: request
    if (size(self%node%leaders) == 1) return
    call MPI_Iprobe(MPI_ANY_SOURCE, tag_stop, self%comm, found, MPI_STATUS_IGNORE)
    if (found) call hear_notice(self)
    if (self%node%is_stopped() .and. .not. self%nodes_informed) then
      do i = 2, size(self%node%leaders)
        call MPI_Isend(nothing, 0, MPI_INTEGER, self%node%leaders(i), tag_stop, self%comm, request)
        self%sending = [self%sending, request]
      end do
      self%nodes_informed = .true.
    end if
    do
      call MPI_Iprobe(MPI_ANY_SOURCE, tag_request, self%comm, found, from)
      if (.not. found) exit
      call MPI_Recv(question, size(question), MPI_INTEGER, from%MPI_SOURCE, tag_request, self%comm, MPI_STATUS_IGNORE)
      self%reported(question(1)) = question(3)
      block = [1, 0]
      ! Half of the node's fair share of what is left.
      if (.not. self%node%is_stopped()) call self%node%take(1, block(1), block(2), question(2), 2*self%ranks)
      call MPI_Send(block, size(block), MPI_INTEGER, from%MPI_SOURCE, tag_reply, self%comm)
    end do
  end subroutine serve

  !> Rank 0 receives a node's notice.
  subroutine hear_notice(self)
    class(mpi_scheduler_t), intent(inout) :: self
    integer :: nothing(0)
    logical :: first
    call MPI_Recv(nothing, 0, MPI_INTEGER, MPI_ANY_SOURCE, tag_stop, self%comm, MPI_STATUS_IGNORE)
    self%notices_received = self%notices_received + 1
    first = self%node%set_stop()
  end subroutine hear_notice

  !> A leader receives the stop from rank 0.
  subroutine hear_stop(self)
    class(mpi_scheduler_t), intent(inout) :: self
    integer :: nothing(0)
    logical :: first
    call MPI_Recv(nothing, 0, MPI_INTEGER, 0, tag_stop, self%comm, MPI_STATUS_IGNORE)
    self%was_informed = .true.
    first = self%node%set_stop()
  end subroutine hear_stop

end module mpi_scheduler
