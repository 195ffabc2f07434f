! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether to stop before the tiles have begun: while attractors are searched and chains run. The time limit within a trajectory.
module stop_check
  use errors, only: error_t, fail
  use journal, only: journal_t
  use kinds, only: wp
  use signals, only: begin_time_limit, end_time_limit, signal_count
  use status, only: exit_resumable
  use system, only: monotonic_seconds
  implicit none
  private

  public :: check_stop, limit_time

  !> How to go on after a stop before anything was kept, also of a run that resumes another.
  character(len=*), parameter, public :: nothing_kept = &
    'this run has written nothing yet; the same command starts again'

contains

  !> From here to `end_time_limit` the process ends by itself where one trajectory lasts beyond `time_limit` [s] since the start
  !> (0 = none), some seconds later. What is written to its end, whatever the time, is not to lie between.
  subroutine limit_time(journal, time_limit, error)
    type(journal_t), intent(in) :: journal
    real(wp), intent(in) :: time_limit
    type(error_t), allocatable, intent(out) :: error
    if (time_limit > 0) call begin_time_limit(time_limit - (monotonic_seconds() - journal%started), error)
  end subroutine limit_time

  !> Code 75 if a stop signal came or `time_limit` [s] since the start is over (0 = none); `doing` states what is left undone.
  !> `resumable`: a working file is there, with which --resume goes on.
  subroutine check_stop(journal, time_limit, doing, error, resumable)
    type(journal_t), intent(in) :: journal
    real(wp), intent(in) :: time_limit
    character(len=*), intent(in) :: doing
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: resumable
    real(wp) :: elapsed
    logical :: stop_now, has_file
    stop_now = signal_count() > 0
    elapsed = monotonic_seconds() - journal%started
    if (time_limit > 0) stop_now = stop_now .or. elapsed >= time_limit
    if (.not. stop_now) return
    call end_time_limit()
    has_file = .false.
    if (present(resumable)) has_file = resumable
    if (has_file) then
      call fail(error, exit_resumable, 'stopped while '//doing//'; the same command with --resume goes on')
    else
      call fail(error, exit_resumable, 'stopped while '//doing//'; '//nothing_kept)
    end if
  end subroutine check_stop

end module stop_check
