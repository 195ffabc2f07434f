! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How evenly a run used its ranks, and what it took.
module balance
  use journal, only: journal_t
  use kinds, only: int64, wp
  use system, only: resident_bytes
  use team, only: team_t
  use text, only: to_text
  implicit none
  private

  public :: report_balance

contains

  !> Reports which share of the `elapsed` seconds the ranks computed (least, mean, most), which of it those of `gpus` waited for
  !> them, the largest memory of a rank and the bytes of results written. In plain text only for several ranks, or where a
  !> GPU computes. Collective.
  subroutine report_balance(team, journal, busy, waited, elapsed, gpus)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    real(wp), intent(in) :: busy, waited, elapsed
    integer, intent(in) :: gpus
    character(len=:), allocatable :: of_gpus
    real(wp), allocatable :: facts(:)
    real(wp) :: shares(team%size()), waiting
    integer(int64) :: resident, written
    call team%gather([100*busy/max(elapsed, tiny(elapsed)), real(resident_bytes(), wp), &
                      100*waited/max(elapsed, tiny(elapsed))], facts)
    written = total(team, journal%written)
    if (.not. team%is_root()) return
    shares = min(100.0_wp, facts(1::3))
    resident = nint(maxval(facts(2::3)), int64)
    waiting = sum(facts(3::3))/max(1, gpus)
    of_gpus = ''
    if (gpus > 0) of_gpus = ', waiting for a GPU '//to_text(waiting, 3)//' %'
    call journal%line('balance', 'ranks busy '//to_text(sum(shares)/size(shares), 3)//' % of the time ('// &
      to_text(minval(shares), 3)//' to '//to_text(maxval(shares), 3)//' %)'//of_gpus//', at most '//to_text(resident/2**20)// &
      ' MiB each, '//to_text(written)//' bytes written', &
      '"busy_percent_min": '//to_text(minval(shares), 6)//', "busy_percent_mean": '//to_text(sum(shares)/size(shares), 6)// &
      ', "busy_percent_max": '//to_text(maxval(shares), 6)//', "busy_percent": ['//to_text(shares(1), 4)//listed(shares(2:))// &
      '], "resident_bytes_max": '//to_text(resident)//', "written_bytes": '//to_text(written)// &
      ', "gpu_wait_percent_mean": '//to_text(waiting, 6), plain=team%size() > 1 .or. gpus > 0)
  end subroutine report_balance

  integer(int64) function total(team, mine)
    class(team_t), intent(in) :: team
    integer(int64), intent(in) :: mine
    integer(int64) :: values(1)
    values = mine
    call team%sum(values)
    total = values(1)
  end function total

  pure function listed(values) result(text)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, size(values)
      text = text//', '//to_text(values(i), 4)
    end do
  end function listed

end module balance
