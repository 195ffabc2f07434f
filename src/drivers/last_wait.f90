! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The wait for the other ranks after the last tile. A rank that cannot be reached any more would keep the others, and the hosts
!> that are paid for, until MPI notices. So rank 0 bounds the wait once nobody has work left.
module last_wait
  use errors, only: error_t, fail
  use kinds, only: wp
  use map_reader, only: open_final, reader_t
  use scheduler, only: scheduler_t
  use status, only: exit_resumable
  use system, only: monotonic_seconds, sleep_microseconds
  use team, only: team_t
  use text, only: parse_integer, to_text
  implicit none
  private

  public :: last_wait_t

  character(len=*), parameter :: variable = 'SEPARATRIX_LAST_WAIT'
  !> Seconds to wait for ranks that have nothing left to do, and between two looks into the working file.
  integer, parameter :: usual_bound = 120
  real(wp), parameter :: look_interval = 5
  !> Pause between two questions, in microseconds: no core is burnt while waiting.
  integer, parameter :: pause_us = 100

  type :: last_wait_t
    private
    character(len=:), allocatable :: part
    integer :: bound = usual_bound
    !> Tiles of this run in the working file when it is complete; -1 where the file counts others.
    integer :: tiles = -1
    !> When rank 0 saw first that no work is left, and when it looked last [s].
    real(wp) :: idle_since = -1, last_look = 0
  contains
    procedure :: begin
    procedure :: wait
  end type last_wait_t

contains

  !> Before any rank begins a tile: `tiles` of the working file `part` are of this run, `done` of them finished. Where the file
  !> counts others, as those that are computed again, only a stop bounds the wait.
  subroutine begin(self, part, tiles, done, team)
    class(last_wait_t), intent(out) :: self
    character(len=*), intent(in) :: part
    integer, intent(in) :: tiles, done
    class(team_t), intent(in) :: team
    character(len=16) :: text
    integer :: asked, status
    self%part = part
    if (.not. team%is_root() .or. team%size() == 1) return
    call get_environment_variable(variable, text, status=status)
    if (status == 0) call parse_integer(trim(text), asked, status)
    if (status == 0) self%bound = max(1, asked)
    if (tiles_done(part) == done) self%tiles = tiles
  end subroutine begin

  !> Waits until all ranks are here. Code 75 on rank 0 if one is not, long after the last tile is done or a stop was requested.
  subroutine wait(self, team, scheduler, error)
    class(last_wait_t), intent(inout) :: self
    class(team_t), intent(inout) :: team
    class(scheduler_t), intent(inout) :: scheduler
    type(error_t), allocatable, intent(out) :: error
    self%last_look = monotonic_seconds()
    call team%arrive()
    do while (.not. team%all_arrived())
      call scheduler%poll()
      if (team%is_root()) call look(self, scheduler%stop_requested(), error)
      if (allocated(error)) return
      call sleep_microseconds(pause_us)
    end do
  end subroutine wait

  subroutine look(self, stopped, error)
    class(last_wait_t), intent(inout) :: self
    logical, intent(in) :: stopped
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: now
    logical :: idle
    now = monotonic_seconds()
    if (self%idle_since < 0 .and. now - self%last_look > min(look_interval, real(self%bound, wp))) then
      self%last_look = now
      idle = stopped
      if (.not. idle) idle = tiles_done(self%part) == self%tiles
      if (idle) self%idle_since = now
    end if
    if (self%idle_since >= 0 .and. now - self%idle_since > self%bound) call fail(error, exit_resumable, &
      'a rank has not answered for '//to_text(self%bound)//' s after the end of its work (a lost link, or a host that fails); '// &
      'the tiles done are kept in '//self%part//'; the same command with --resume (without --force) goes on')
  end subroutine look

  !> Tiles done in a working file; -2 if it cannot be read.
  integer function tiles_done(part)
    character(len=*), intent(in) :: part
    type(reader_t) :: reader
    type(error_t), allocatable :: error
    type(error_t), allocatable :: ignored
    integer :: done, tiles
    tiles_done = -2
    call open_final(part, reader, error)
    if (.not. allocated(error)) call reader%count_tiles(done, tiles, error)
    if (.not. allocated(error)) tiles_done = done
    call reader%close(ignored)
  end function tiles_done

end module last_wait
