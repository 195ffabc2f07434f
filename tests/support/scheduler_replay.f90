! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Runs the scheduler over tiles of given costs, asleep instead of computing, so that one machine holds
!> more ranks than it has cores: scheduler_replay COSTS RANKS_PER_NODE POLLS_PER_TILE. COSTS has a
!> number of seconds per line. Prints a table: what each rank did.
program scheduler_replay
  use errors, only: error_t
  use kinds, only: real64
  use parallel, only: make_scheduler, start_team
  use scheduler, only: scheduler_options_t, scheduler_t
  use system, only: exit_program, monotonic_seconds, sleep_microseconds
  use team, only: team_t
  implicit none
  class(team_t), allocatable :: team
  class(scheduler_t), allocatable :: scheduler
  type(error_t), allocatable :: error
  real(real64), allocatable :: costs(:), done(:), all_done(:)
  integer :: position, tiles, polls
  real(real64) :: began, busy, last

  call start_team(team)
  call read_costs(costs)
  polls = integer_argument(3)
  call make_scheduler(team, scheduler_options_t(ranks_per_node=integer_argument(2)), scheduler, error)
  call team%barrier()
  if (.not. allocated(error)) call scheduler%start(size(costs), error)
  if (allocated(error)) call team%abort(error%code)
  tiles = 0
  busy = 0
  last = 0
  do
    call scheduler%next(position)
    if (position == 0) exit
    began = scheduler%elapsed()
    call pretend(costs(position))
    last = scheduler%elapsed()
    busy = busy + last - began
    tiles = tiles + 1
  end do
  done = [real(tiles, real64), busy, last, real(scheduler%log%questions, real64)]
  call scheduler%finish()
  call team%gather(done, all_done)
  if (team%is_root()) call print_table(reshape(all_done, [4, team%size()]))
  call team%close()

contains

  !> Sleeps for the cost of a tile, with looks for messages between.
  subroutine pretend(cost)
    real(real64), intent(in) :: cost
    real(real64) :: start
    integer :: i
    start = monotonic_seconds()
    do i = 1, polls
      call sleep_microseconds(max(0, nint(1e6_real64*(start + i*cost/polls - monotonic_seconds()))))
      call scheduler%poll()
    end do
  end subroutine pretend

  subroutine read_costs(costs)
    real(real64), allocatable, intent(out) :: costs(:)
    character(len=4096) :: path
    integer :: unit, status, lines
    real(real64) :: cost
    call get_command_argument(1, path)
    open (newunit=unit, file=trim(path), status='old', action='read', iostat=status)
    if (status /= 0) call exit_program(66)
    lines = 0
    do
      read (unit, *, iostat=status) cost
      if (status /= 0) exit
      lines = lines + 1
    end do
    rewind (unit)
    allocate (costs(lines))
    read (unit, *) costs
    close (unit)
  end subroutine read_costs

  integer function integer_argument(number)
    integer, intent(in) :: number
    character(len=20) :: text
    integer :: status
    call get_command_argument(number, text)
    read (text, *, iostat=status) integer_argument
    if (status /= 0) call exit_program(64)
  end function integer_argument

  subroutine print_table(values)
    real(real64), intent(in) :: values(:, :)
    integer :: i
    print '(a)', 'rank,tiles,busy,finish,questions'
    do i = 1, size(values, 2)
      print '(i0,",",i0,",",f0.6,",",f0.6,",",i0)', i - 1, nint(values(1, i)), values(2:3, i), nint(values(4, i))
    end do
  end subroutine print_table

end program scheduler_replay
