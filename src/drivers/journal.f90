! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a run reports while it works: lines on stdout (plain or JSON, rank 0 only) and progress with rate and
!> ETA on stderr: one line that is rewritten on a terminal, sparse lines in a log. All of it also goes to a file as JSON
!> lines if one is asked for. A log that cannot be written does not end the work, but makes it end with code 74.
module journal
  use errors, only: error_t
  use files, only: append_line, open_append
  use kinds, only: int64, wp
  use system, only: monotonic_seconds, resident_bytes, stderr_is_terminal, utc_now
  use text, only: replace_all, to_text
  use, intrinsic :: iso_fortran_env, only: error_unit
  implicit none
  private

  public :: json_text, json_number, duration_text, size_text

  real(wp), parameter :: terminal_interval = 0.5_wp, first_interval = 10, longest_interval = 300

  !> Where lines go: a descriptor of the system, -1 = nowhere.
  type :: sink_t
    integer :: descriptor = -1
    character(len=:), allocatable :: name
  end type sink_t

  type, public :: journal_t
    !> Whether this rank speaks at all, in JSON, and only of errors.
    logical :: active = .true., json = .false., quiet = .false.
    real(wp) :: started = 0
    real(wp) :: next_progress = 0, interval = first_interval
    logical :: terminal = .false., line_open = .false., steady = .false.
    !> Stdout, and the file of JSON lines.
    type(sink_t), private :: out, copy
    !> One of them could not be written.
    logical :: lost = .false.
    !> Bytes of results that this rank has written.
    integer(int64) :: written = 0
    !> The task under way.
    character(len=:), allocatable :: things
    integer(int64) :: total = 0, before = 0
    real(wp) :: interval_started = 0
  contains
    procedure :: open => open_journal
    procedure :: open_copy
    procedure :: line
    procedure :: begin
    procedure :: progress
    procedure :: under_way
    procedure :: error => report_error
  end type journal_t

contains

  !> A number in JSON, null where there is none.
  pure function json_number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = 'null'
    if (abs(value) <= huge(value)) text = to_text(value)
  end function json_number

  !> Starts the clock. `progress_interval` [s]: 0 = every half second on a terminal, in a log ever less often.
  subroutine open_journal(self, active, json, quiet, progress_interval)
    class(journal_t), intent(inout) :: self
    logical, intent(in) :: active, json, quiet
    real(wp), intent(in), optional :: progress_interval
    self%active = active
    self%json = json
    self%quiet = quiet
    self%out = sink_t(1, 'stdout')
    self%started = monotonic_seconds()
    self%terminal = stderr_is_terminal() .and. .not. json
    self%interval = merge(terminal_interval, first_interval, self%terminal)
    if (present(progress_interval)) self%steady = progress_interval > 0
    if (self%steady) self%interval = progress_interval
    self%next_progress = self%started + self%interval
  end subroutine open_journal

  !> Also writes every line, and errors, to the file `path` as JSON, behind what is in it. Code 73.
  subroutine open_copy(self, path, error)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    if (.not. self%active .or. len(path) == 0) return
    self%copy%name = path
    call open_append(path, self%copy%descriptor, error)
  end subroutine open_copy

  !> One line of the log. `fields`: further members of the JSON object, '"name": value, ...'. `plain` = .false.: left out
  !> of a log in plain text.
  subroutine line(self, event, message, fields, plain)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: event, message
    character(len=*), intent(in), optional :: fields
    logical, intent(in), optional :: plain
    character(len=:), allocatable :: more
    logical :: shown
    if (.not. self%active) return
    shown = .true.
    if (present(plain)) shown = plain .or. self%json
    more = ''
    if (present(fields)) more = ', '//fields
    call write_copy(self, event, message, more)
    if (self%quiet .or. .not. shown) return
    call close_line(self)
    if (self%json) then
      call put(self, self%out, json_line(self, event, message, more))
    else
      call put(self, self%out, message)
    end if
  end subroutine line

  subroutine write_copy(self, event, message, more)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: event, message, more
    call put(self, self%copy, json_line(self, event, message, more))
  end subroutine write_copy

  !> One line. After the first that cannot be written, which is reported on stderr, the sink is given up.
  subroutine put(self, sink, text)
    class(journal_t), intent(inout) :: self
    type(sink_t), intent(inout) :: sink
    character(len=*), intent(in) :: text
    type(error_t), allocatable :: error
    if (sink%descriptor < 0) return
    call append_line(sink%descriptor, sink%name, text, error)
    if (.not. allocated(error)) return
    sink%descriptor = -1
    self%lost = .true.
    call close_line(self)
    write (error_unit, '(a)') 'separatrix: '//error%message//'; the work goes on without this log'
    flush (error_unit)
  end subroutine put

  function json_line(self, event, message, more) result(line)
    class(journal_t), intent(in) :: self
    character(len=*), intent(in) :: event, message, more
    character(len=:), allocatable :: line
    line = '{"event": '//json_text(event)//', "time": '//json_text(utc_now())//', "seconds": '// &
           to_text(monotonic_seconds() - self%started, 6)//', "message": '//json_text(message)//more//'}'
  end function json_line

  !> Begins a task: `total` things named `things`, of which `before` were done earlier.
  subroutine begin(self, things, total, before)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: things
    integer(int64), intent(in) :: total, before
    self%things = things
    self%total = total
    self%before = before
    self%interval_started = monotonic_seconds()
  end subroutine begin

  !> Progress of the task when it is due.
  subroutine progress(self, done)
    class(journal_t), intent(inout) :: self
    integer(int64), intent(in) :: done
    real(wp) :: now, rate
    character(len=:), allocatable :: message, fields
    if (.not. self%active .or. (self%quiet .and. self%copy%descriptor < 0)) return
    if (done <= self%before) return
    if (.not. is_due(self)) return
    now = monotonic_seconds()
    rate = real(done - self%before, wp)/max(now - self%interval_started, 1e-3_wp)
    message = to_text(done)//' of '//to_text(self%total)//' '//self%things//', '//to_text(nint(100*real(done, wp) &
      /real(max(self%total, 1_int64), wp)))//' %, '//to_text(rate, 3)//' '//self%things//'/s, ETA '// &
      duration_text(real(self%total - done, wp)/rate)
    fields = ', "done": '//to_text(done)//', "total": '//to_text(self%total)//', "of": '//json_text(self%things)// &
             ', "per_second": '//to_text(rate, 6)//', "resident_bytes": '//to_text(resident_bytes())// &
             ', "written_bytes": '//to_text(self%written)
    call put_progress(self, message, fields)
  end subroutine progress

  !> The same of work whose end is not known: how far it is in words, and as members of the JSON object.
  subroutine under_way(self, message, fields)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: message, fields
    if (.not. self%active .or. (self%quiet .and. self%copy%descriptor < 0)) return
    if (is_due(self)) call put_progress(self, message, ', '//fields)
  end subroutine under_way

  !> Whether progress is due; if so the next time is set.
  logical function is_due(self)
    class(journal_t), intent(inout) :: self
    real(wp) :: now
    now = monotonic_seconds()
    is_due = now >= self%next_progress
    if (.not. is_due) return
    if (.not. (self%terminal .or. self%steady)) self%interval = min(2*self%interval, longest_interval)
    self%next_progress = now + self%interval
  end function is_due

  subroutine put_progress(self, message, fields)
    class(journal_t), intent(inout) :: self
    character(len=*), intent(in) :: message, fields
    if (self%json) then
      call self%line('progress', message, fields(3:))
      return
    end if
    call write_copy(self, 'progress', message, fields)
    if (self%quiet) return
    if (self%terminal) then
      write (error_unit, '(a)', advance='no') achar(13)//'  '//message//'    '
      flush (error_unit)
      self%line_open = .true.
    else
      write (error_unit, '(a)') message
      ! Who follows a log waits for it now.
      flush (error_unit)
    end if
  end subroutine put_progress

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
    call write_copy(self, 'error', message, '')
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
    integer(int64), parameter :: day = 86400, year = 365*day
    whole = nint(min(max(seconds, 0.0_wp), 1e15_wp), int64)
    if (seconds < 10) then
      words = to_text(max(seconds, 0.0_wp), 2)//' s'
    else if (whole < 60) then
      words = to_text(whole)//' s'
    else if (whole < 3600) then
      words = to_text(whole/60)//' min '//to_text(modulo(whole, 60_int64))//' s'
    else if (whole < 2*day) then
      words = to_text(whole/3600)//' h '//to_text(modulo(whole, 3600_int64)/60)//' min'
    else if (whole < 2*year) then
      words = to_text(whole/day)//' days '//to_text(modulo(whole, day)/3600)//' h'
    else
      words = to_text(whole/year)//' years'
    end if
  end function duration_text

  !> A size in the unit that fits it: "512 bytes", "1.92 TB".
  pure function size_text(bytes) result(words)
    integer(int64), intent(in) :: bytes
    character(len=:), allocatable :: words
    character(len=2), parameter :: units(5) = ['kB', 'MB', 'GB', 'TB', 'PB']
    real(wp) :: amount
    integer :: i
    words = to_text(bytes)//' bytes'
    amount = bytes
    do i = 1, size(units)
      if (amount < 1000) return
      amount = amount/1000
      words = to_text(amount, 3)//' '//units(i)
    end do
  end function size_text

end module journal
