! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Stop signals: SIGUSR1, SIGUSR2, SIGTERM and the first SIGINT are counted, SIGXFSZ can be ignored. A process that has not asked
!> for the count some seconds after the first ends by itself with code 75, and so does one that has not noticed the end of its time.
module signals
  use, intrinsic :: iso_c_binding, only: c_null_char
  use bindings, only: c_signals_clear, c_signals_farewell, c_signals_ignore_file_limit, c_signals_install, c_signals_limit, &
    c_signals_no_limit, c_signals_notice, c_signals_raise, c_signals_received, c_signals_terminated
  use errors, only: error_t, fail
  use kinds, only: real64
  use status, only: exit_internal
  implicit none
  private

  public :: install_signals, ignore_file_limit, set_farewell, begin_time_limit, end_time_limit, notice_stop
  public :: signal_count, termination_asked, clear_signals, raise_signal

  !> Linux signal numbers.
  integer, parameter, public :: sig_usr1 = 10, sig_usr2 = 12, sig_term = 15, sig_xfsz = 25

contains

  !> Installs the handlers; code 70 if the system refuses.
  subroutine install_signals(error)
    type(error_t), allocatable, intent(out) :: error
    if (c_signals_install() /= 0) call fail(error, exit_internal, 'cannot install the signal handlers')
  end subroutine install_signals

  !> What a process prints that ends by itself after a signal.
  subroutine set_farewell(text)
    character(len=*), intent(in) :: text
    call c_signals_farewell(text//c_null_char)
  end subroutine set_farewell

  !> The process ends by itself some seconds after the next `seconds`, unless `end_time_limit` is called before; code 70 if the
  !> system refuses.
  subroutine begin_time_limit(seconds, error)
    real(real64), intent(in) :: seconds
    type(error_t), allocatable, intent(out) :: error
    if (c_signals_limit(seconds) /= 0) call fail(error, exit_internal, 'cannot set the timer of the time limit')
  end subroutine begin_time_limit

  !> The end of the time was noticed, or the work that it limits is done.
  subroutine end_time_limit()
    call c_signals_no_limit()
  end subroutine end_time_limit

  !> The process ends, for whatever reason: neither a signal that came nor the time limit has to end it.
  subroutine notice_stop()
    call c_signals_notice()
  end subroutine notice_stop

  !> Makes a write beyond the file size limit an error instead of the end of the process; code 70 if the system refuses.
  subroutine ignore_file_limit(error)
    type(error_t), allocatable, intent(out) :: error
    if (c_signals_ignore_file_limit() /= 0) call fail(error, exit_internal, 'cannot ignore the file size signal')
  end subroutine ignore_file_limit

  !> Whether SIGTERM came since the start or the last `clear_signals`.
  logical function termination_asked()
    termination_asked = c_signals_terminated() == 1
  end function termination_asked

  !> Stop signals received since the start or the last `clear_signals`.
  integer function signal_count()
    signal_count = c_signals_received()
  end function signal_count

  !> Forgets the signals received so far.
  subroutine clear_signals()
    call c_signals_clear()
  end subroutine clear_signals

  !> Sends a signal to this process; code 70 if the number is unknown.
  subroutine raise_signal(number, error)
    integer, intent(in) :: number
    type(error_t), allocatable, intent(out) :: error
    if (c_signals_raise(number) /= 0) call fail(error, exit_internal, 'unknown signal')
  end subroutine raise_signal

end module signals
