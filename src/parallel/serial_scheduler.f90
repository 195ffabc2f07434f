! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The scheduler of one process: the items in the order that ranks would get them.
module serial_scheduler
  use errors, only: error_t, fail
  use scheduler, only: scheduler_t
  use spread_order, only: new_spread_order, spread_order_t
  use status, only: exit_internal
  implicit none
  private

  type, extends(scheduler_t), public :: serial_scheduler_t
    integer, private :: total = 0, handed_out = 0, done = 0
    type(spread_order_t), private :: order
    logical, private :: busy = .false., stop = .false.
  contains
    procedure :: start
    procedure :: next
    procedure :: poll
    procedure :: request_stop
    procedure :: stop_requested
    procedure :: done_count
    procedure :: finish
  end type serial_scheduler_t

contains

  !> Begins a list of `n` items.
  subroutine start(self, n, error)
    class(serial_scheduler_t), intent(inout) :: self
    integer, intent(in) :: n
    type(error_t), allocatable, intent(out) :: error
    if (n < 0) then
      call fail(error, exit_internal, 'a work list has a negative length')
      return
    end if
    self%total = n
    self%order = new_spread_order(n)
    self%handed_out = 0
    self%done = 0
    self%busy = .false.
    self%stop = .false.
    call self%begin_log()
  end subroutine start

  !> The next item; 0 = none left, or a stop was requested.
  subroutine next(self, item)
    class(serial_scheduler_t), intent(inout) :: self
    integer, intent(out) :: item
    if (self%busy) self%done = self%done + 1
    call self%log%end(self%elapsed())
    self%busy = .false.
    item = 0
    call self%poll()
    if (self%stop .or. self%handed_out == self%total) return
    self%handed_out = self%handed_out + 1
    self%busy = .true.
    item = self%order%item(self%handed_out)
    call self%log%begin(item, self%elapsed())
  end subroutine next

  !> Looks for signals and the time limit.
  subroutine poll(self)
    class(serial_scheduler_t), intent(inout) :: self
    if (self%stop_is_due()) self%stop = .true.
  end subroutine poll

  !> No item is handed out any more.
  subroutine request_stop(self)
    class(serial_scheduler_t), intent(inout) :: self
    self%stop = .true.
  end subroutine request_stop

  !> Whether to leave the work now.
  logical function stop_requested(self)
    class(serial_scheduler_t), intent(in) :: self
    stop_requested = self%stop
  end function stop_requested

  !> Items done.
  integer function done_count(self)
    class(serial_scheduler_t), intent(in) :: self
    done_count = self%done
  end function done_count

  !> The item in hand is given up.
  subroutine finish(self)
    class(serial_scheduler_t), intent(inout) :: self
    self%busy = .false.
  end subroutine finish

end module serial_scheduler
