! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A number that two builds share if their laws have the same rows and parameters, in the same order.
module law_fingerprint
  use kinds, only: int64
  use law_table, only: laws, parameters
  implicit none
  private

  public :: fingerprint

contains

  !> The number, below 2**31.
  pure integer(int64) function fingerprint()
    integer :: i
    fingerprint = size(laws)
    do i = 1, size(laws)
      call add(laws(i)%family//laws(i)%name, fingerprint)
    end do
    do i = 1, size(parameters)
      call add(parameters(i)%family//parameters(i)%law//parameters(i)%name, fingerprint)
    end do
  end function fingerprint

  pure subroutine add(text, sum)
    character(len=*), intent(in) :: text
    integer(int64), intent(inout) :: sum
    integer :: i
    do i = 1, len(text)
      sum = mod(131*sum + ichar(text(i:i)), 2_int64**31 - 1)
    end do
  end subroutine add

end module law_fingerprint
