! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The library's error object: procedures return `type(error_t), allocatable, intent(out)`, the
!> caller tests `allocated(error)`. Only the program decides to stop.
module errors
  use status, only: exit_internal
  implicit none
  private

  public :: fail

  type, public :: error_t
    !> Exit code of module `status` that the program ends with.
    integer :: code = exit_internal
    !> What was found, where, and what is allowed.
    character(len=:), allocatable :: message
  end type error_t

contains

  !> Sets an error.
  pure subroutine fail(error, code, message)
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in) :: code
    character(len=*), intent(in) :: message
    allocate (error)
    error%code = code
    error%message = message
  end subroutine fail

end module errors
