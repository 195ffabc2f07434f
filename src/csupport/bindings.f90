! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The interfaces of the C files of this folder; flat arrays and integer status only. The modules
!> signals, checksum, random, system, files, atomics and statistics give them Fortran types.
module bindings
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int32_t, c_int64_t, c_ptr
  implicit none
  private

  public :: c_crashed, c_fork, c_signals_farewell, c_signals_install, c_signals_ignore_file_limit, c_signals_limit, &
    c_signals_no_limit, c_signals_notice, c_signals_terminated, &
    c_signals_received, c_signals_clear, c_signals_raise, c_crc32, &
    c_philox, c_uniform, c_monotonic_seconds, c_utc_now, c_resident_bytes, c_host_name, c_keep_memory, &
    c_stderr_is_terminal, c_default_environment, c_set_environment, c_sleep_microseconds, c_exit, c_exit_now, c_file_exists, &
    c_folder_status, c_free_bytes, c_reserve_file, c_publish_file, c_remove_file, c_take_lock, c_give_lock, &
    c_open_append, c_append, c_error_text, c_atomic_bytes, c_atomic_load, c_atomic_store, c_atomic_fetch_add, &
    c_atomic_try_lock, c_yield, c_lock_calls, c_unlock_calls, c_string_length, c_share_upper_limit, c_is_special, &
    c_is_same_file, c_core_list, c_may_use_core, c_online_cores, c_core_quota, c_cpu_name, c_environment, &
    c_crc32_combine, c_compress_bound, c_compress, c_shuffle, c_open_bytes, c_read_bytes, c_write_bytes, c_has_name, &
    c_length_of, c_set_length, c_close_bytes

  interface
    integer(c_int32_t) function c_crc32_combine(first, second, size) bind(c, name='separatrix_crc32_combine')
      import :: c_int32_t, c_int64_t
      integer(c_int32_t), value :: first, second
      integer(c_int64_t), value :: size
    end function c_crc32_combine

    integer(c_int64_t) function c_compress_bound(size) bind(c, name='separatrix_compress_bound')
      import :: c_int64_t
      integer(c_int64_t), value :: size
    end function c_compress_bound

    integer(c_int64_t) function c_compress(bytes, size, level, out, room) bind(c, name='separatrix_compress')
      import :: c_int, c_int64_t, c_ptr
      type(c_ptr), value :: bytes, out
      integer(c_int64_t), value :: size, room
      integer(c_int), value :: level
    end function c_compress

    subroutine c_shuffle(bytes, values, width, out) bind(c, name='separatrix_shuffle')
      import :: c_int, c_int64_t, c_ptr
      type(c_ptr), value :: bytes, out
      integer(c_int64_t), value :: values
      integer(c_int), value :: width
    end subroutine c_shuffle

    integer(c_int) function c_open_bytes(path, writable, descriptor) bind(c, name='separatrix_open_bytes')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: writable
      integer(c_int), intent(out) :: descriptor
    end function c_open_bytes

    integer(c_int) function c_read_bytes(descriptor, bytes, size, offset) bind(c, name='separatrix_read_bytes')
      import :: c_int, c_int64_t, c_ptr
      integer(c_int), value :: descriptor
      type(c_ptr), value :: bytes
      integer(c_int64_t), value :: size, offset
    end function c_read_bytes

    integer(c_int) function c_write_bytes(descriptor, bytes, size, offset) bind(c, name='separatrix_write_bytes')
      import :: c_int, c_int64_t, c_ptr
      integer(c_int), value :: descriptor
      type(c_ptr), value :: bytes
      integer(c_int64_t), value :: size, offset
    end function c_write_bytes

    integer(c_int) function c_has_name(descriptor, path) bind(c, name='separatrix_has_name')
      import :: c_char, c_int
      integer(c_int), value :: descriptor
      character(kind=c_char), intent(in) :: path(*)
    end function c_has_name

    integer(c_int64_t) function c_length_of(descriptor) bind(c, name='separatrix_length_of')
      import :: c_int, c_int64_t
      integer(c_int), value :: descriptor
    end function c_length_of

    integer(c_int) function c_set_length(descriptor, length) bind(c, name='separatrix_set_length')
      import :: c_int, c_int64_t
      integer(c_int), value :: descriptor
      integer(c_int64_t), value :: length
    end function c_set_length

    integer(c_int) function c_close_bytes(descriptor, sync) bind(c, name='separatrix_close_bytes')
      import :: c_int
      integer(c_int), value :: descriptor, sync
    end function c_close_bytes

    integer(c_int) function c_is_special(path) bind(c, name='separatrix_is_special')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_is_special

    integer(c_int) function c_is_same_file(path, other) bind(c, name='separatrix_is_same_file')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*), other(*)
    end function c_is_same_file

    real(c_double) function c_share_upper_limit(found, sample, confidence) &
        bind(c, name='separatrix_share_upper_limit')
      import :: c_double, c_int64_t
      integer(c_int64_t), value :: found, sample
      real(c_double), value :: confidence
    end function c_share_upper_limit

    integer(c_int) function c_signals_install() bind(c, name='separatrix_signals_install')
      import :: c_int
    end function c_signals_install

    integer(c_int) function c_fork() bind(c, name='separatrix_fork')
      import :: c_int
    end function c_fork

    integer(c_int) function c_crashed(process) bind(c, name='separatrix_crashed')
      import :: c_int
      integer(c_int), value :: process
    end function c_crashed

    integer(c_int) function c_signals_ignore_file_limit() bind(c, name='separatrix_signals_ignore_file_limit')
      import :: c_int
    end function c_signals_ignore_file_limit

    integer(c_int) function c_signals_terminated() bind(c, name='separatrix_signals_terminated')
      import :: c_int
    end function c_signals_terminated

    integer(c_int) function c_signals_received() bind(c, name='separatrix_signals_received')
      import :: c_int
    end function c_signals_received

    subroutine c_signals_farewell(text) bind(c, name='separatrix_signals_farewell')
      import :: c_char
      character(kind=c_char), intent(in) :: text(*)
    end subroutine c_signals_farewell

    integer(c_int) function c_signals_limit(seconds) bind(c, name='separatrix_signals_limit')
      import :: c_double, c_int
      real(c_double), value :: seconds
    end function c_signals_limit

    subroutine c_signals_no_limit() bind(c, name='separatrix_signals_no_limit')
    end subroutine c_signals_no_limit

    subroutine c_signals_notice() bind(c, name='separatrix_signals_notice')
    end subroutine c_signals_notice

    subroutine c_signals_clear() bind(c, name='separatrix_signals_clear')
    end subroutine c_signals_clear

    integer(c_int) function c_signals_raise(number) bind(c, name='separatrix_signals_raise')
      import :: c_int
      integer(c_int), value :: number
    end function c_signals_raise

    pure integer(c_int32_t) function c_crc32(previous, bytes, size) bind(c, name='separatrix_crc32')
      import :: c_int32_t, c_int64_t, c_ptr
      integer(c_int32_t), value :: previous
      type(c_ptr), value :: bytes
      integer(c_int64_t), value :: size
    end function c_crc32

    pure subroutine c_philox(counter, key, out) bind(c, name='separatrix_philox')
      import :: c_int32_t
      integer(c_int32_t), intent(in) :: counter(4), key(2)
      integer(c_int32_t), intent(out) :: out(4)
    end subroutine c_philox

    pure subroutine c_uniform(seed, counter, count, values) bind(c, name='separatrix_uniform')
      import :: c_double, c_int64_t
      integer(c_int64_t), value :: seed, counter, count
      real(c_double), intent(out) :: values(*)
    end subroutine c_uniform

    real(c_double) function c_monotonic_seconds() bind(c, name='separatrix_monotonic_seconds')
      import :: c_double
    end function c_monotonic_seconds

    subroutine c_keep_memory(bytes) bind(c, name='separatrix_keep_memory')
      import :: c_int
      integer(c_int), value :: bytes
    end subroutine c_keep_memory

    integer(c_int) function c_utc_now(text, size) bind(c, name='separatrix_utc_now')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: size
    end function c_utc_now

    integer(c_int64_t) function c_resident_bytes() bind(c, name='separatrix_resident_bytes')
      import :: c_int64_t
    end function c_resident_bytes

    integer(c_int) function c_host_name(text, size) bind(c, name='separatrix_host_name')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: size
    end function c_host_name

    integer(c_int) function c_core_list(text, size) bind(c, name='separatrix_core_list')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: size
    end function c_core_list

    integer(c_int) function c_may_use_core(core) bind(c, name='separatrix_may_use_core')
      import :: c_int
      integer(c_int), value :: core
    end function c_may_use_core

    integer(c_int) function c_online_cores() bind(c, name='separatrix_online_cores')
      import :: c_int
    end function c_online_cores

    real(c_double) function c_core_quota(root) bind(c, name='separatrix_core_quota')
      import :: c_char, c_double
      character(kind=c_char), intent(in) :: root(*)
    end function c_core_quota

    integer(c_int) function c_cpu_name(text, size) bind(c, name='separatrix_cpu_name')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: size
    end function c_cpu_name

    subroutine c_environment(text, size) bind(c, name='separatrix_environment')
      import :: c_char, c_int
      character(kind=c_char), intent(out) :: text(*)
      integer(c_int), value :: size
    end subroutine c_environment

    integer(c_int) function c_stderr_is_terminal() bind(c, name='separatrix_stderr_is_terminal')
      import :: c_int
    end function c_stderr_is_terminal

    integer(c_int) function c_default_environment(name, value) bind(c, name='separatrix_default_environment')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*), value(*)
    end function c_default_environment

    integer(c_int) function c_set_environment(name, value) bind(c, name='separatrix_set_environment')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: name(*), value(*)
    end function c_set_environment

    subroutine c_sleep_microseconds(microseconds) bind(c, name='separatrix_sleep_microseconds')
      import :: c_int
      integer(c_int), value :: microseconds
    end subroutine c_sleep_microseconds

    subroutine c_exit(code) bind(c, name='separatrix_exit')
      import :: c_int
      integer(c_int), value :: code
    end subroutine c_exit

    subroutine c_exit_now(code) bind(c, name='separatrix_exit_now')
      import :: c_int
      integer(c_int), value :: code
    end subroutine c_exit_now

    integer(c_int) function c_file_exists(path) bind(c, name='separatrix_file_exists')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_file_exists

    integer(c_int) function c_folder_status(path) bind(c, name='separatrix_folder_status')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_folder_status

    integer(c_int64_t) function c_free_bytes(path) bind(c, name='separatrix_free_bytes')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: path(*)
    end function c_free_bytes

    integer(c_int) function c_reserve_file(path) bind(c, name='separatrix_reserve_file')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_reserve_file

    integer(c_int) function c_publish_file(from, to) bind(c, name='separatrix_publish_file')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_publish_file

    integer(c_int) function c_remove_file(path) bind(c, name='separatrix_remove_file')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
    end function c_remove_file

    integer(c_int) function c_take_lock(path, descriptor, refusal) bind(c, name='separatrix_take_lock')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), intent(out) :: descriptor, refusal
    end function c_take_lock

    subroutine c_give_lock(path, descriptor) bind(c, name='separatrix_give_lock')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), value :: descriptor
    end subroutine c_give_lock

    integer(c_int) function c_open_append(path, descriptor) bind(c, name='separatrix_open_append')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int), intent(out) :: descriptor
    end function c_open_append

    integer(c_int) function c_append(descriptor, text, length) bind(c, name='separatrix_append')
      import :: c_char, c_int, c_int64_t
      integer(c_int), value :: descriptor
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int64_t), value :: length
    end function c_append

    subroutine c_error_text(number, text, size) bind(c, name='separatrix_error_text')
      import :: c_char, c_int
      integer(c_int), value :: number, size
      character(kind=c_char), intent(out) :: text(*)
    end subroutine c_error_text

    integer(c_int64_t) function c_atomic_bytes(count) bind(c, name='separatrix_atomic_bytes')
      import :: c_int, c_int64_t
      integer(c_int), value :: count
    end function c_atomic_bytes

    integer(c_int64_t) function c_atomic_load(words, index) bind(c, name='separatrix_atomic_load')
      import :: c_int, c_int64_t, c_ptr
      type(c_ptr), value :: words
      integer(c_int), value :: index
    end function c_atomic_load

    subroutine c_atomic_store(words, index, value) bind(c, name='separatrix_atomic_store')
      import :: c_int, c_int64_t, c_ptr
      type(c_ptr), value :: words
      integer(c_int), value :: index
      integer(c_int64_t), value :: value
    end subroutine c_atomic_store

    integer(c_int64_t) function c_atomic_fetch_add(words, index, value) bind(c, name='separatrix_atomic_fetch_add')
      import :: c_int, c_int64_t, c_ptr
      type(c_ptr), value :: words
      integer(c_int), value :: index
      integer(c_int64_t), value :: value
    end function c_atomic_fetch_add

    integer(c_int) function c_atomic_try_lock(words, index) bind(c, name='separatrix_atomic_try_lock')
      import :: c_int, c_ptr
      type(c_ptr), value :: words
      integer(c_int), value :: index
    end function c_atomic_try_lock

    subroutine c_yield() bind(c, name='separatrix_yield')
    end subroutine c_yield

    subroutine c_lock_calls() bind(c, name='separatrix_lock_calls')
    end subroutine c_lock_calls

    subroutine c_unlock_calls() bind(c, name='separatrix_unlock_calls')
    end subroutine c_unlock_calls

    !> strlen, for strings that the HDF5 library returns.
    integer(c_int64_t) function c_string_length(string) bind(c, name='strlen')
      import :: c_int64_t, c_ptr
      type(c_ptr), value :: string
    end function c_string_length
  end interface

end module bindings
