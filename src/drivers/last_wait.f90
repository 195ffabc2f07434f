! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The wait for the other ranks after the last tile. A rank that cannot be reached any more would keep the others, and the hosts
!> that are paid for, until MPI notices. So rank 0 bounds the wait once nobody has work left.
module last_wait
  use errors, only: error_t, fail
  use kinds, only: wp
  use scheduler, only: scheduler_t
  use status, only: exit_resumable
  use system, only: monotonic_seconds, sleep_microseconds
  use team, only: team_t
  use text, only: parse_integer, to_text
  use tile_store, only: tile_store_t
  implicit none
  private

  public :: last_wait_t

  character(len=*), parameter :: variable = 'SEPARATRIX_LAST_WAIT'
  !> Seconds to wait for ranks that have nothing left to do, before the first look into the working file, and between two of them.
  integer, parameter :: usual_bound = 120
  real(wp), parameter :: first_look = 5, look_interval = 1
  !> Longest look [s]: the others may ask rank 0, and a slow file system takes milliseconds for each tile.
  real(wp), parameter :: longest_look = 0.05_wp
  !> Pause between two questions, in microseconds: no core is burnt while waiting.
  integer, parameter :: pause_us = 100

  type :: last_wait_t
    private
    character(len=:), allocatable :: part
    integer :: bound = usual_bound
    !> The working file marks the tiles of this run that are done; false where they are computed again.
    logical :: in_file = .true.
    !> Tiles of this run, from the first one on, that are known to be done.
    integer :: done = 0
    !> When rank 0 saw first that no work is left, and when the next look is due [s].
    real(wp) :: idle_since = -1, next_look = 0
  contains
    procedure :: begin
    procedure :: wait
  end type last_wait_t

contains

  !> Before any rank begins a tile. `part`: the working file; `again`: its tiles are done, and computed again, so that only a stop
  !> bounds the wait.
  subroutine begin(self, part, again, team)
    class(last_wait_t), intent(out) :: self
    character(len=*), intent(in) :: part
    logical, intent(in) :: again
    class(team_t), intent(in) :: team
    character(len=16) :: text
    integer :: asked, status
    self%part = part
    self%in_file = .not. again
    if (.not. team%is_root() .or. team%size() == 1) return
    call get_environment_variable(variable, text, status=status)
    if (status == 0) call parse_integer(trim(text), asked, status)
    if (status == 0) self%bound = max(1, asked)
  end subroutine begin

  !> Waits until all ranks are here. `tiles`: those of this run, which `store` holds. Code 75 on rank 0 if a rank is not here, long
  !> after the last tile is done or a stop was requested.
  subroutine wait(self, team, scheduler, store, tiles, error)
    class(last_wait_t), intent(inout) :: self
    class(team_t), intent(inout) :: team
    class(scheduler_t), intent(inout) :: scheduler
    type(tile_store_t), intent(in) :: store
    integer, intent(in) :: tiles(:)
    type(error_t), allocatable, intent(out) :: error
    self%next_look = monotonic_seconds() + min(first_look, real(self%bound, wp))
    call team%arrive()
    do while (.not. team%all_arrived())
      call scheduler%poll()
      if (team%is_root()) call look(self, scheduler%stop_requested(), store, tiles, error)
      if (allocated(error)) return
      call sleep_microseconds(pause_us)
    end do
  end subroutine wait

  subroutine look(self, stopped, store, tiles, error)
    class(last_wait_t), intent(inout) :: self
    logical, intent(in) :: stopped
    type(tile_store_t), intent(in) :: store
    integer, intent(in) :: tiles(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: now
    now = monotonic_seconds()
    if (self%idle_since < 0 .and. now > self%next_look) then
      do while (self%in_file .and. self%done < size(tiles))
        if (monotonic_seconds() - now > longest_look) exit
        if (.not. store%has_done(tiles(self%done + 1))) then
          ! It is looked at again later; the others are gone through without a pause.
          self%next_look = now + look_interval
          exit
        end if
        self%done = self%done + 1
      end do
      if (stopped .or. self%in_file .and. self%done == size(tiles)) self%idle_since = now
    end if
    if (self%idle_since >= 0 .and. now - self%idle_since > self%bound) call fail(error, exit_resumable, &
      'a rank has not answered for '//to_text(self%bound)//' s after the end of its work (a lost link, or a host that fails); '// &
      'the tiles done are kept in '//self%part//'; the same command with --resume (without --force) goes on')
  end subroutine look

end module last_wait
