! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How trajectories ended, as reported by every command that runs many, and whether that is an error.
module endings
  use errors, only: error_t, fail
  use journal, only: journal_t, json_text
  use kinds, only: int64
  use map_reader, only: reader_t
  use status, only: exit_given_up, is_given_up, last_reason, reason_names, reason_not_run
  use text, only: to_text
  implicit none
  private

  public :: report_reasons, assess_reasons, assess_given_up, assess_file, assess_motion

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

  !> As `assess_given_up`, of points that ended for these reasons.
  subroutine assess_reasons(journal, reasons, partial, error)
    type(journal_t), intent(inout) :: journal
    integer(int64), intent(in) :: reasons(0:last_reason)
    logical, intent(in) :: partial
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    call assess_given_up(journal, sum(pack(reasons, is_given_up([(i, i=0, last_reason)]))), sum(reasons), 'points', partial, error)
  end subroutine assess_reasons

  !> A line where some of the motions were given up; code 78 where all of them were, unless `partial` results are asked for.
  subroutine assess_given_up(journal, given_up, motions, things, partial, error)
    type(journal_t), intent(inout) :: journal
    integer(int64), intent(in) :: given_up, motions
    character(len=*), intent(in) :: things
    logical, intent(in) :: partial
    type(error_t), allocatable, intent(out) :: error
    if (given_up == 0) return
    if (given_up == motions .and. .not. partial) then
      call fail(error, exit_given_up, 'the motions of all '//to_text(motions)//' '//things//' were given up: nothing is known '// &
                'of their ends (--partial: no error)')
    else
      call journal%line('given_up', '  given up: '//to_text(given_up)//' of '//to_text(motions)//' '//things, &
                        '"given_up": '//to_text(given_up)//', "of": '//to_text(motions))
    end if
  end subroutine assess_given_up

  !> As `assess_reasons`, of the points of a file.
  subroutine assess_file(journal, reader, partial, error)
    type(journal_t), intent(inout) :: journal
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: partial
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: names(2) = [character(len=14) :: '/reason', '/branch_reason']
    integer(int64), dimension(0:last_reason) :: counts, reasons
    integer :: i
    reasons = 0
    do i = 1, size(names)
      if (.not. reader%has(trim(names(i)))) cycle
      call reader%count_codes(trim(names(i)), counts, error)
      if (allocated(error)) return
      reasons = reasons + counts
    end do
    ! A sweep that runs one way has no holds of the other.
    reasons(reason_not_run) = 0
    call assess_reasons(journal, reasons, partial, error)
  end subroutine assess_file

  !> Code 78 where the one motion that was asked for was given up, as `words` state, unless `partial` results are asked for.
  pure subroutine assess_motion(reason, words, partial, error)
    integer, intent(in) :: reason
    character(len=*), intent(in) :: words
    logical, intent(in) :: partial
    type(error_t), allocatable, intent(out) :: error
    if (is_given_up(reason) .and. .not. partial) call fail(error, exit_given_up, 'the motion was given up: '//words// &
                                                           ' (--partial: no error)')
  end subroutine assess_motion

end module endings
