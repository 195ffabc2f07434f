! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The table of --tile-times: which rank computed which tile when.
module tile_times
  use errors, only: error_t
  use kinds, only: wp
  use scheduler, only: scheduler_t
  use session, only: session_t
  use text, only: to_text
  use text_table, only: table_t
  implicit none
  private

  public :: write_tile_times

contains

  !> Writes the log of a finished list, `tiles` being the tile of each position; nothing unless asked for.
  !> Collective. Ends the program with code 74 if the table cannot be written.
  subroutine write_tile_times(session, scheduler, tiles)
    type(session_t), intent(inout) :: session
    class(scheduler_t), intent(in) :: scheduler
    integer, intent(in) :: tiles(:)
    type(error_t), allocatable :: error
    real(wp), allocatable :: entries(:, :)
    integer, allocatable :: rank(:)
    if (len(session%command%tile_times) == 0) return
    call scheduler%log%collect(session%team, entries, rank)
    if (session%team%is_root()) call write_rows(session%command%tile_times, tiles, rank, entries, error)
    call session%stop_if(error)
  end subroutine write_tile_times

  subroutine write_rows(path, tiles, rank, entries, error)
    character(len=*), intent(in) :: path
    integer, intent(in) :: tiles(:), rank(:)
    real(wp), intent(in) :: entries(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(table_t) :: table
    integer :: i
    call table%create(path)
    call table%line('tile,rank,begin,end,questions')
    do i = 1, size(rank)
      call table%line(to_text(tiles(nint(entries(1, i))))//','//to_text(rank(i))//','//to_text(entries(2, i), 9)//','// &
                      to_text(entries(3, i), 9)//','//to_text(nint(entries(4, i))))
    end do
    call table%close(error)
  end subroutine write_rows

end module tile_times
