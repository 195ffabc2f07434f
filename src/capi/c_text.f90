! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Texts across the C interface.
!>
!> gfortran keeps the length of a result `character(len=:), allocatable` in static memory of the caller, also with -frecursive. So
!> texts are made by one thread at a time: a call holds the lock from `enter` to `answer`, but while it computes.
module c_text
  use bindings, only: c_lock_calls, c_unlock_calls
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char, c_size_t
  use errors, only: error_t
  use status, only: exit_done
  implicit none
  private

  public :: from_c, to_c, enter, compute, computed, answer

contains

  !> Begins a call: texts may be made.
  subroutine enter()
    call c_lock_calls()
  end subroutine enter

  !> From here on no text is made, and other threads may call.
  subroutine compute()
    call c_unlock_calls()
  end subroutine compute

  !> Texts may be made again.
  subroutine computed()
    call c_lock_calls()
  end subroutine computed

  !> A text that ends with the null character.
  pure function from_c(string) result(text)
    character(kind=c_char), intent(in) :: string(*)
    character(len=:), allocatable :: text
    integer :: length, i
    length = 0
    do while (string(length + 1) /= c_null_char)
      length = length + 1
    end do
    allocate (character(len=length) :: text)
    do i = 1, length
      text(i:i) = string(i)
    end do
  end function from_c

  !> Copies a text into a buffer of `size` characters, cut to fit, with a null character at the end.
  pure subroutine to_c(text, buffer, size)
    character(len=*), intent(in) :: text
    integer(c_size_t), intent(in) :: size
    character(kind=c_char), intent(inout) :: buffer(*)
    integer :: i, length
    if (size < 1) return
    length = int(min(int(len(text), c_size_t), size - 1))
    do i = 1, length
      buffer(i) = text(i:i)
    end do
    buffer(length + 1) = c_null_char
  end subroutine to_c

  !> Ends a call: the code of an error, its message in the buffer of the caller.
  integer(c_int) function answer(error, message, message_size) result(code)
    type(error_t), allocatable, intent(in) :: error
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), intent(in) :: message_size
    code = exit_done
    if (allocated(error)) then
      code = error%code
      call to_c(error%message, message, message_size)
    else
      call to_c('', message, message_size)
    end if
    call c_unlock_calls()
  end function answer

end module c_text
