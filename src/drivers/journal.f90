! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a run says while it works: lines on stdout (plain or JSON, rank 0 only) and progress with rate and
!> ETA on stderr: one line that is rewritten on a terminal, sparse lines in a log.
module journal
  use kinds, only: int64, wp
  use system, only: monotonic_seconds, resident_bytes, stderr_is_terminal
  use text, only: replace_all, to_text
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  implicit none
  private

  public :: json_text, duration_text

  real(wp), parameter :: terminal_interval = 0.5_wp, first_interval = 10, longest_interval = 300

  type, public :: journal_t
    !> Whether this rank speaks at all, in JSON, and only of errors.
    logical :: active = .true., json = .false., quiet = .false.
    real(wp) :: started = 0
    real(wp) :: next_progress = 0, interval = first_interval
    logical :: terminal = .false., line_open = .false.
    !> The stretch of work under way.
    character(len=:), allocatable :: things
    integer(int64) :: total = 0, before = 0
    real(wp) :: stretch_started = 0
  contains
    procedure :: open => open_journal
    procedure :: line
    procedure :: begin
    procedure :: progress
    procedure :: error => report_error
  end type journal_t

contains

  !> Starts the clock.
  subroutine open_journal(self, active, json, quiet)
    class(journal_t), intent(inout) :: self
    logical, intent(in) :: active, json, quiet
    self%active = active
    self%json = json
    self%quiet = quiet
    self%started = monotonic_seconds()
    self%terminal = stderr_is_terminal() .and. .not. json
    self%interval = merge(terminal_interval, first_interval, self%terminal)
    self%next_progress = self%started + self%interval
  end subroutine open_journal

  !> One line of the log. `fields`: further members of the JSON object, '"name": value, ...'.
  subroutine line(self, event, message, fields)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: event, message
    character(len=*), intent(in), optional :: fields
    character(len=:), allocatable :: more
    if (.not. self%active .or. self%quiet) return
    call close_line(self)
    if (self%json) then
      more = ''
      if (present(fields)) more = ', '//fields
      write (output_unit, '(a)') '{"event": '//json_text(event)//', "seconds": '// &
        to_text(monotonic_seconds() - self%started, 6)//', "message": '//json_text(message)//more//'}'
    else
      write (output_unit, '(a)') message
    end if
    flush (output_unit)
  end subroutine line

  !> Begins a stretch of work: `total` things named `things`, of which `before` were done earlier.
  subroutine begin(self, things, total, before)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: things
    integer(int64), intent(in) :: total, before
    self%things = things
    self%total = total
    self%before = before
    self%stretch_started = monotonic_seconds()
  end subroutine begin

  !> Progress of the stretch when it is due.
  subroutine progress(self, done)
    class(journal_t), intent(inout) :: self
    integer(int64), intent(in) :: done
    real(wp) :: now, rate
    character(len=:), allocatable :: message
    if (.not. self%active .or. self%quiet) return
    now = monotonic_seconds()
    if (now < self%next_progress .or. done <= self%before) return
    if (.not. self%terminal) self%interval = min(2*self%interval, longest_interval)
    self%next_progress = now + self%interval
    rate = real(done - self%before, wp)/max(now - self%stretch_started, 1e-3_wp)
    message = to_text(done)//' of '//to_text(self%total)//' '//self%things//', '//to_text(nint(100*real(done, wp) &
      /real(max(self%total, 1_int64), wp)))//' %, '//to_text(rate, 3)//' '//self%things//'/s, ETA '// &
      duration_text(real(self%total - done, wp)/rate)
    if (self%json) then
      call self%line('progress', message, '"done": '//to_text(done)//', "total": '//to_text(self%total)// &
        ', "of": '//json_text(self%things)//', "per_second": '//to_text(rate, 6)//', "resident_bytes": '//to_text(resident_bytes()))
    else if (self%terminal) then
      write (error_unit, '(a)', advance='no') achar(13)//'  '//message//'    '
      flush (error_unit)
      self%line_open = .true.
    else
      write (error_unit, '(a)') message
    end if
  end subroutine progress

  subroutine close_line(self)
    class(journal_t), intent(inout) :: self
    if (self%line_open) write (error_unit, '(a)') ''
    self%line_open = .false.
  end subroutine close_line

  !> An error, on stderr in plain text whatever the log's form.
  subroutine report_error(self, message)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: message
    if (.not. self%active) return
    call close_line(self)
    write (error_unit, '(a)') 'separatrix: '//message
    flush (error_unit)
  end subroutine report_error

  !> A JSON string.
  pure function json_text(string) result(quoted)
    character(len=*), intent(in) :: string
    character(len=:), allocatable :: quoted
    character(len=4) :: code
    integer :: i
    quoted = ''
    do i = 1, len(string)
      select case (iachar(string(i:i)))
      case (34, 92)
        quoted = quoted//'\'//string(i:i)
      case (0:31)
        write (code, '(z4.4)') iachar(string(i:i))
        quoted = quoted//'\u'//code
      case default
        quoted = quoted//string(i:i)
      end select
    end do
    quoted = '"'//quoted//'"'
  end function json_text

  !> Seconds as '12 s', '3 min 20 s', '5 h 12 min'.
  pure function duration_text(seconds) result(words)
    real(wp), intent(in) :: seconds
    character(len=:), allocatable :: words
    integer(int64) :: whole
    whole = nint(min(max(seconds, 0.0_wp), 1e15_wp), int64)
    if (seconds < 10) then
      words = to_text(max(seconds, 0.0_wp), 2)//' s'
    else if (whole < 60) then
      words = to_text(whole)//' s'
    else if (whole < 3600) then
      words = to_text(whole/60)//' min '//to_text(modulo(whole, 60_int64))//' s'
    else
      words = to_text(whole/3600)//' h '//to_text(modulo(whole, 3600_int64)/60)//' min'
    end if
  end function duration_text

end module journal
