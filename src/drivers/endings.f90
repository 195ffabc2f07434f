! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How trajectories ended, as every command that runs many tells it.
module endings
  use journal, only: journal_t, json_text
  use kinds, only: int64
  use status, only: last_reason, reason_names
  use text, only: to_text
  implicit none
  private

  public :: report_reasons

contains

  !> A line for every reason of module `status` for which any of the points ended; `reasons` are the numbers of points.
  subroutine report_reasons(journal, reasons)
    type(journal_t), intent(inout) :: journal
    integer(int64), intent(in) :: reasons(0:last_reason)
    integer :: i
    do i = 0, last_reason
      if (reasons(i) > 0) call journal%line('reason', '  ended as '//trim(reason_names(i))//': '//to_text(reasons(i))// &
        ' points', '"reason": '//json_text(trim(reason_names(i)))//', "points": '//to_text(reasons(i)))
    end do
  end subroutine report_reasons

end module endings
