! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What debug builds do with every file that they have written: `verify` without its sample, at once.
module written_check
  use build_info, only: debug_build
  use errors, only: error_t
  use kinds, only: int64
  use map_invariants, only: check_invariants
  use map_reader, only: open_final, reader_t
  use session, only: session_t
  use text, only: to_text
  implicit none
  private

  public :: check_written

contains

  !> In a debug build ends the program with code 74 unless the invariants hold in the file `path`. Collective.
  subroutine check_written(session, path)
    type(session_t), intent(inout) :: session
    character(len=*), intent(in) :: path
    type(error_t), allocatable :: error, ignored
    type(reader_t) :: reader
    character(len=:), allocatable :: kind
    integer(int64) :: points
    if (.not. debug_build) return
    points = 0
    if (session%team%is_root()) then
      call open_final(path, reader, error)
      if (.not. allocated(error)) call reader%text_attribute('/', 'kind', kind, error)
      if (.not. allocated(error)) call check_invariants(reader, kind, points, error)
      call reader%close(ignored)
    end if
    call session%stop_if(error)
    call session%journal%line('checked', 'invariants hold at '//to_text(points)//' points', plain=.false.)
  end subroutine check_written

end module written_check
