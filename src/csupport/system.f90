! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Clock, host, memory and environment of this process.
module system
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use bindings, only: c_core_list, c_core_quota, c_cpu_name, c_crashed, c_default_environment, c_environment, c_exit, c_exit_now, &
    c_fork, c_host_name, c_keep_memory, c_may_use_core, c_monotonic_seconds, c_online_cores, c_resident_bytes, &
    c_set_environment, c_sleep_microseconds, c_stderr_is_terminal, c_utc_now
  use kinds, only: int64, real64
  implicit none
  private

  public :: monotonic_seconds, utc_now, resident_bytes, host_name, stderr_is_terminal, &
    default_environment, set_environment, sleep_microseconds, exit_program, exit_at_once, fork_process, has_crashed, &
    from_c, core_list, keep_memory, may_use_core, online_cores, core_quota, cpu_name, environment_text

contains

  !> Seconds since an arbitrary moment; never goes back.
  real(real64) function monotonic_seconds()
    monotonic_seconds = c_monotonic_seconds()
  end function monotonic_seconds

  !> From now on memory that is given back stays with the process, up to `bytes` of it, so that large arrays that come and go find
  !> pages ready; without effect where the C library does not know this.
  subroutine keep_memory(bytes)
    integer, intent(in) :: bytes
    call c_keep_memory(int(bytes, c_int))
  end subroutine keep_memory

  !> The time now as 2026-01-31T12:34:56Z; 'unknown' if the system has no clock.
  function utc_now() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(32)
    if (c_utc_now(buffer, int(size(buffer), c_int)) == 0) then
      text = from_c(buffer)
    else
      text = 'unknown'
    end if
  end function utc_now

  !> Resident memory of this process in bytes; -1 if the system does not report it.
  integer(int64) function resident_bytes()
    resident_bytes = c_resident_bytes()
  end function resident_bytes

  !> The name of this host; 'unknown' if the system does not report it.
  function host_name() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(256)
    if (c_host_name(buffer, int(size(buffer), c_int)) == 0) then
      text = from_c(buffer)
    else
      text = 'unknown'
    end if
  end function host_name

  !> The cores that this process may run on, as '0-3,8'; 'unknown' if the system does not report them.
  function core_list() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(128)
    text = 'unknown'
    if (c_core_list(buffer, int(size(buffer), c_int)) > 0) text = from_c(buffer)
  end function core_list

  !> Whether this process may run on a core (from 0).
  logical function may_use_core(core)
    integer, intent(in) :: core
    may_use_core = c_may_use_core(int(core, c_int)) == 1
  end function may_use_core

  !> Cores of this host.
  integer function online_cores()
    online_cores = int(c_online_cores())
  end function online_cores

  !> Cores whose time the control groups of this process allow; huge without a limit. `root`: where /proc and /sys are ('').
  real(real64) function core_quota(root)
    character(len=*), intent(in), optional :: root
    character(len=:), allocatable :: folder
    folder = ''
    if (present(root)) folder = root
    core_quota = real(c_core_quota(folder//c_null_char), real64)
    if (core_quota <= 0) core_quota = huge(core_quota)
  end function core_quota

  !> The name of the processor; 'unknown' if the system does not report it.
  function cpu_name() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(256)
    text = 'unknown'
    if (c_cpu_name(buffer, int(size(buffer), c_int)) == 0) text = from_c(buffer)
  end function cpu_name

  !> The variables that decide how MPI, HDF5 and the batch system work, as 'NAME=VALUE NAME=VALUE'.
  function environment_text() result(text)
    character(len=:), allocatable :: text
    character(kind=c_char) :: buffer(8192)
    call c_environment(buffer, int(size(buffer), c_int))
    text = from_c(buffer)
  end function environment_text

  !> Whether stderr is a terminal.
  logical function stderr_is_terminal()
    stderr_is_terminal = c_stderr_is_terminal() == 1
  end function stderr_is_terminal

  !> Sets an environment variable unless it is set already.
  subroutine default_environment(name, value)
    character(len=*), intent(in) :: name, value
    integer(c_int) :: ignored
    ignored = c_default_environment(name//c_null_char, value//c_null_char)
  end subroutine default_environment

  !> Sets an environment variable.
  subroutine set_environment(name, value)
    character(len=*), intent(in) :: name, value
    integer(c_int) :: ignored
    ignored = c_set_environment(name//c_null_char, value//c_null_char)
  end subroutine set_environment

  !> Gives the core away for at least this long.
  subroutine sleep_microseconds(microseconds)
    integer, intent(in) :: microseconds
    call c_sleep_microseconds(int(microseconds, c_int))
  end subroutine sleep_microseconds

  !> Ends the program with this exit code.
  subroutine exit_program(code)
    integer, intent(in) :: code
    call c_exit(int(code, c_int))
  end subroutine exit_program

  !> Ends the program with this exit code, without the clean-up of the libraries in use.
  subroutine exit_at_once(code)
    integer, intent(in) :: code
    call c_exit_now(int(code, c_int))
  end subroutine exit_at_once

  !> A copy of this process that prints nothing, for a trial that may crash: 0 in the copy, its number in this one, -1 if
  !> there can be none.
  integer function fork_process()
    fork_process = c_fork()
  end function fork_process

  !> Waits for the copy; whether it crashed, or ended with another code than 0.
  logical function has_crashed(process)
    integer, intent(in) :: process
    has_crashed = c_crashed(int(process, c_int)) == 1
  end function has_crashed

  !> The characters before the first null.
  pure function from_c(buffer) result(text)
    character(kind=c_char), intent(in) :: buffer(:)
    character(len=:), allocatable :: text
    integer :: length, i
    length = size(buffer)
    do i = 1, size(buffer)
      if (buffer(i) == c_null_char) then
        length = i - 1
        exit
      end if
    end do
    allocate (character(len=length) :: text)
    do i = 1, length
      text(i:i) = buffer(i)
    end do
  end function from_c

end module system
