! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Atomic 64-bit words in memory that processes of a node share, numbered from 0, each on a cache
!> line of its own.
module atomics
  use, intrinsic :: iso_c_binding, only: c_int, c_ptr
  use bindings, only: c_atomic_bytes, c_atomic_fetch_add, c_atomic_load, c_atomic_store, &
    c_atomic_try_lock, c_yield
  use kinds, only: int64
  implicit none
  private

  public :: atomic_bytes, atomic_load, atomic_store, atomic_fetch_add, atomic_try_lock, yield

contains

  !> Bytes of memory that `count` words take.
  integer(int64) function atomic_bytes(count)
    integer, intent(in) :: count
    atomic_bytes = c_atomic_bytes(int(count, c_int))
  end function atomic_bytes

  !> The word's value.
  integer(int64) function atomic_load(words, index)
    type(c_ptr), intent(in) :: words
    integer, intent(in) :: index
    atomic_load = c_atomic_load(words, int(index, c_int))
  end function atomic_load

  !> Sets the word.
  subroutine atomic_store(words, index, value)
    type(c_ptr), intent(in) :: words
    integer, intent(in) :: index
    integer(int64), intent(in) :: value
    call c_atomic_store(words, int(index, c_int), value)
  end subroutine atomic_store

  !> Adds to the word and returns its value before.
  integer(int64) function atomic_fetch_add(words, index, value)
    type(c_ptr), intent(in) :: words
    integer, intent(in) :: index
    integer(int64), intent(in) :: value
    atomic_fetch_add = c_atomic_fetch_add(words, int(index, c_int), value)
  end function atomic_fetch_add

  !> Whether the word was 0 and is 1 now. Storing 0 unlocks.
  logical function atomic_try_lock(words, index)
    type(c_ptr), intent(in) :: words
    integer, intent(in) :: index
    atomic_try_lock = c_atomic_try_lock(words, int(index, c_int)) == 1
  end function atomic_try_lock

  !> Lets another process of this core run.
  subroutine yield()
    call c_yield()
  end subroutine yield

end module atomics
