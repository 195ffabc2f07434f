! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Around a call into a library that can loop for ever, or crash, on a damaged file.
module guard
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  implicit none
  private

  public :: begin_guard, end_guard, hold_guard, release_guard

  interface
    subroutine c_guard_begin(text, seconds, code) bind(c, name='separatrix_guard_begin')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int), value :: seconds, code
    end subroutine c_guard_begin

    !> Ends what `begin_guard` began.
    subroutine end_guard() bind(c, name='separatrix_guard_end')
    end subroutine end_guard

    !> Until `release_guard` many guards cost little. Standard error is silent meanwhile.
    subroutine hold_guard() bind(c, name='separatrix_guard_hold')
    end subroutine hold_guard

    subroutine release_guard() bind(c, name='separatrix_guard_release')
    end subroutine release_guard
  end interface

contains

  !> Until `end_guard` this process ends with `code`, and prints `message`, if it crashes or uses more than `seconds` of the
  !> processor.
  subroutine begin_guard(message, seconds, code)
    character(len=*), intent(in) :: message
    integer, intent(in) :: seconds, code
    call c_guard_begin(message//c_null_char, int(seconds, c_int), int(code, c_int))
  end subroutine begin_guard

end module guard
