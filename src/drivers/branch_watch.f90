! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Reports the progress of a search for branches to the log.
module branch_watch
  use search_state, only: search_t
  use journal, only: journal_t, json_number
  use kinds, only: int64, wp
  use search_watch, only: search_watch_t
  use text, only: to_text
  implicit none
  private

  type, extends(search_watch_t), public :: branch_watch_t
    private
    type(journal_t), pointer :: journal => null()
    type(search_t), pointer :: search => null()
    integer(int64) :: tried = 0
  contains
    procedure :: begin
    procedure :: report_start
    procedure :: report_point
  end type branch_watch_t

contains

  !> Watches a search; both it and the log outlive this.
  subroutine begin(self, journal, search)
    class(branch_watch_t), intent(inout), target :: self
    type(journal_t), intent(inout), target :: journal
    type(search_t), intent(inout), target :: search
    self%journal => journal
    self%search => search
    search%watcher => self
    ! Every start is tried twice: where its motion settles, and as it is.
    call journal%begin('starts', 2_int64*size(search%values)*size(search%starts, 2), 0_int64)
  end subroutine begin

  subroutine report_start(self)
    class(branch_watch_t), intent(inout) :: self
    integer(int64) :: total
    ! The other ranks are at work on as many.
    total = 2_int64*size(self%search%values)*size(self%search%starts, 2)
    self%tried = min(total, self%tried + self%search%workers%count())
    call self%journal%progress(self%tried)
  end subroutine report_start

  subroutine report_point(self, points, parameter)
    class(branch_watch_t), intent(inout) :: self
    integer, intent(in) :: points
    real(wp), intent(in) :: parameter
    associate (branch => size(self%search%branches) + 1)
      call self%journal%under_way('following branch '//to_text(branch)//': '//to_text(points)//' points this way, '// &
        self%search%family%path//' = '//to_text(parameter, 6), '"following": '//to_text(branch)//', "points": '// &
        to_text(points)//', "parameter": '//json_number(parameter))
    end associate
  end subroutine report_point

end module branch_watch
