! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Hands out the items 1..n of a work list to the ranks of a team, one at a time. Children:
!> serial_scheduler, mpi_scheduler. The loop of every rank:
!>
!>     call scheduler%start(n, error)
!>     do
!>       call scheduler%next(item)
!>       if (item == 0) exit
!>       (trajectories, with `call scheduler%poll()` between them; if `stop_requested()` then leave
!>        the loop without calling `next`, which counts the item before as done)
!>     end do
!>     call scheduler%finish()
module scheduler
  use errors, only: error_t
  use kinds, only: real64
  use signals, only: end_time_limit, signal_count
  use system, only: monotonic_seconds
  use work_log, only: work_log_t
  implicit none
  private

  type, public :: scheduler_options_t
    !> Seconds after `start` at which the run stops; 0 = none.
    real(real64) :: time_limit = 0
    !> Splits the ranks of a host into nodes of at most this many ranks; 0 = as the hosts are.
    integer :: ranks_per_node = 0
    !> Keeps a log of the items: 32 bytes for each that this rank does.
    logical :: logged = .false.
  end type scheduler_options_t

  type, abstract, public :: scheduler_t
    type(scheduler_options_t) :: options
    real(real64) :: started = 0
    !> What this rank did and when, if `options%logged`.
    type(work_log_t) :: log
  contains
    procedure(start_with), deferred :: start
    procedure(next_of), deferred :: next
    procedure(act), deferred :: poll
    procedure(act), deferred :: request_stop
    procedure(is_true), deferred :: stop_requested
    procedure(count_of), deferred :: done_count
    procedure(act), deferred :: finish
    procedure :: stop_is_due
    procedure :: begin_log
    procedure :: elapsed
  end type scheduler_t

  abstract interface
    !> Collective: begins a list of `n` items, the same on every rank.
    subroutine start_with(self, n, error)
      import :: error_t, scheduler_t
      class(scheduler_t), intent(inout) :: self
      integer, intent(in) :: n
      type(error_t), allocatable, intent(out) :: error
    end subroutine start_with

    !> The next item; 0 = none left, or a stop was requested. The item that this rank got
    !> before counts as done.
    subroutine next_of(self, item)
      import :: scheduler_t
      class(scheduler_t), intent(inout) :: self
      integer, intent(out) :: item
    end subroutine next_of

    !> `poll`: cheap; looks for signals, the time limit and messages. `request_stop`: all ranks stop
    !> soon. `finish`: collective; every rank calls it once after its last item.
    subroutine act(self)
      import :: scheduler_t
      class(scheduler_t), intent(inout) :: self
    end subroutine act

    !> Whether this rank should leave its work now.
    logical function is_true(self)
      import :: scheduler_t
      class(scheduler_t), intent(in) :: self
    end function is_true

    !> Items done. While the work runs only rank 0 knows it, apart from blocks that other nodes
    !> have not reported; after `finish` it is exact on every rank.
    integer function count_of(self)
      import :: scheduler_t
      class(scheduler_t), intent(in) :: self
    end function count_of
  end interface

contains

  !> Whether a signal came or the time is over; that is noticed here, so that no timer has to end the process.
  logical function stop_is_due(self)
    class(scheduler_t), intent(in) :: self
    stop_is_due = signal_count() > 0
    if (stop_is_due .or. self%options%time_limit <= 0) return
    stop_is_due = monotonic_seconds() - self%started >= self%options%time_limit
    if (stop_is_due) call end_time_limit()
  end function stop_is_due

  !> Starts the clock and an empty log.
  subroutine begin_log(self)
    class(scheduler_t), intent(inout) :: self
    type(work_log_t) :: empty
    self%log = empty
    self%log%on = self%options%logged
    self%started = monotonic_seconds()
  end subroutine begin_log

  !> Seconds since `start`.
  real(real64) function elapsed(self)
    class(scheduler_t), intent(in) :: self
    elapsed = monotonic_seconds() - self%started
  end function elapsed

end module scheduler
