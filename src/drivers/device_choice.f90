! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What computes a map: the GPUs of the hosts, one for each rank in turn, or the processor.
module device_choice
  use case_setup, only: automatic_tile, grid_of, options_of, points_of_tile
  use case_type, only: case_t
  use command_line, only: command_t
  use device_run, only: begin_trial, end_report, not_known, on_gpu, on_processor, trial
  use errors, only: error_t, fail
  use lane_slots, only: prepare_flow
  use grid, only: grid_t, slice_motion, two_axes
  use journal, only: journal_t
  use kinds, only: int64, wp
  use lane_gpu, only: count_gpus, gpu_in_use, gpu_is_built, gpu_name, gpu_number, use_gpu
  use lane_types, only: lane_flow_t
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use refined_tile, only: layers_of
  use refinement, only: automatic_block
  use status, only: exit_usage
  use system, only: core_quota, host_name, may_use_core, online_cores
  use team, only: host_length, team_t
  use text, only: join, parse_integer, to_text
  implicit none
  private

  public :: choose_device, device_text, report_trial

  !> Starts that are to fly at once for `auto` to choose a GPU: it has room for a hundred times as many, and one thread of it is
  !> slow. The results are the same. For tests the environment may set another number.
  integer, parameter :: fewest_starts = 1024
  character(len=*), parameter :: fewest_variable = 'SEPARATRIX_GPU_STARTS', threads_variable = 'SEPARATRIX_GPU_THREADS', &
    counted_variable = 'SEPARATRIX_GPU_COUNTED'

contains

  !> Chooses what this rank computes with, --device being auto, cpu or gpu; before anything is made ready to fly. Code 64 where
  !> a GPU is asked for that is not there, or that cannot help. Collective.
  subroutine choose_device(team, command, the_case, error)
    class(team_t), intent(in) :: team
    type(command_t), intent(in) :: command
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: why, asked
    integer :: local_rank, neighbours, count
    integer(int64) :: starts
    call use_gpu(-1)
    call begin_trial(.false.)
    asked = trim(command%device)
    ! Before any return, as ranks may be asked for different things.
    call find_local_rank(team, local_rank, neighbours)
    if (asked == 'cpu') return
    starts = starts_at_once(command, the_case, team%size())
    if (asked == 'auto') then
      if (starts < fewest()) return
    end if
    count = 0
    if (starts == 0) then
      call fail(error, exit_usage, '--device gpu: found a '//trim(command%name)//' that has no starts to fly together; '// &
                'allowed are auto and cpu')
    else if (has_lanes(the_case, on_gpu=.true.)) then
      call count_gpus(count, why)
      if (.not. gpu_is_built() .and. len(why) == 0) then
        why = ' (and no code for one: this build has SEPARATRIX_GPU=OFF)'
      else if (len(why) > 0) then
        why = ' ('//why//')'
      end if
      if (asked == 'gpu' .and. count <= 0) call fail(error, exit_usage, '--device gpu: found no GPU on '//host_name()//why// &
                                                     '; allowed are auto and cpu')
    else if (asked == 'gpu') then
      call fail(error, exit_usage, '--device gpu: found a machine that only a processor flies (one by one, or of several '// &
                'bodies); allowed are auto and cpu')
    end if
    if (count <= 0) return
    call use_gpu(gpu_number(modulo(local_rank, count)), threads_of(neighbours))
    if (asked == 'auto') call begin_trial(.true., asked_number(counted_variable, 0)/100.0_wp)
  end subroutine choose_device

  !> What `auto` asks for.
  integer function fewest()
    fewest = asked_number(fewest_variable, fewest_starts)
  end function fewest

  !> The number, at least 1, that a variable of the environment has, else `usual`.
  integer function asked_number(variable, usual) result(number)
    character(len=*), intent(in) :: variable
    integer, intent(in) :: usual
    character(len=16) :: text
    integer :: asked, status
    number = usual
    call get_environment_variable(variable, text, status=status)
    if (status /= 0) return
    call parse_integer(trim(text), asked, status)
    if (status == 0) number = max(1, asked)
  end function asked_number

  !> About so many starts of one machine fly together, if every rank has a GPU: those of a tile. 0 where all are flown one by one;
  !> many where the case lacks what the command needs, which is reported later.
  integer(int64) function starts_at_once(command, the_case, ranks) result(starts)
    type(command_t), intent(in) :: command
    type(case_t), intent(in) :: the_case
    integer, intent(in) :: ranks
    type(grid_t) :: grid
    integer, allocatable :: tile(:)
    integer :: axes(2), gpus, side, i
    starts = huge(starts)
    gpus = merge(0, ranks, command%shard > 0)
    select case (trim(command%name))
    case ('sweep')
      if (the_case%sweep%present) starts = product(int(the_case%sweep%starts, int64))
    case ('points')
      starts = lines_of(command%list, int(fewest(), int64)*4*ranks)
      starts = min(starts, int(points_of_tile(starts, ranks, gpus), int64))
    case ('basin')
      if (size(the_case%axes) == 0) return
      grid = grid_of(the_case, the_case%axes)
      tile = automatic_tile(grid, the_case%tile, points_of_tile(product(int(grid%shape, int64)), ranks, gpus))
      if (all(grid%start_axis == 0)) then
        starts = 0
      else if (the_case%refine%active) then
        ! The coarse lattice of a block.
        axes = two_axes(grid)
        side = automatic_block(the_case%refine, grid%shape(axes), layers_of(grid%shape, axes))
        starts = (int(side, int64)/the_case%refine%step + 1)**2
      else
        starts = product(int(pack(tile, [(any(grid%start_axis == i), i=1, size(tile))]), int64))
      end if
    end select
  end function starts_at_once

  !> Lines of a file, counted up to `most`, which is also returned where it cannot be read.
  integer(int64) function lines_of(path, most) result(lines)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: most
    integer :: unit, status
    lines = most
    open (newunit=unit, file=path, status='old', action='read', iostat=status)
    if (status /= 0) return
    do lines = 0, most - 1
      read (unit, '()', iostat=status)
      if (status /= 0) exit
    end do
    close (unit)
  end function lines_of

  !> Threads that serve the bodies of a rank that has so many `neighbours` on its host, itself included: one for each of its cores.
  integer function threads_of(neighbours) result(threads)
    integer, intent(in) :: neighbours
    integer :: cores, i
    cores = ceiling(min(real(online_cores(), wp), core_quota()))
    threads = asked_number(threads_variable, max(1, min(cores/neighbours, count([(may_use_core(i), i=0, cores - 1)]))))
  end function threads_of

  !> Number of this rank among the `neighbours` on its host, from 0. Collective.
  subroutine find_local_rank(team, local_rank, neighbours)
    class(team_t), intent(in) :: team
    integer, intent(out) :: local_rank, neighbours
    character(len=host_length), allocatable :: names(:)
    real(wp), allocatable :: hosts(:)
    character(len=host_length) :: mine
    mine = host_name()
    call team%hosts(mine, names)
    call team%allgather([real(findloc(names == mine, .true., dim=1), wp)], hosts)
    local_rank = count(nint(hosts(:team%rank())) == nint(hosts(team%rank() + 1)))
    neighbours = count(nint(hosts) == nint(hosts(team%rank() + 1)))
  end subroutine find_local_rank

  !> Whether bodies of the case fly in lanes; `on_gpu`: in those that a GPU has, which know one body. Asks the case itself, not
  !> along its axes.
  logical function has_lanes(the_case, on_gpu)
    type(case_t), intent(in) :: the_case
    logical, intent(in) :: on_gpu
    class(machine_t), allocatable :: moving
    type(lane_flow_t) :: flow
    type(error_t), allocatable :: error
    has_lanes = .false.
    call slice_motion(grid_of(the_case, the_case%axes(:0)), 0_int64, moving, error)
    if (allocated(error)) return
    call prepare_flow(moving, flow)
    has_lanes = flow%available .and. .not. (on_gpu .and. (allocated(flow%structure) .or. allocated(flow%tape)))
  end function has_lanes

  pure function device_of(number) result(words)
    integer, intent(in) :: number
    character(len=:), allocatable :: words
    words = 'processor'
    if (number >= 0) words = 'GPU '//to_text(number)
  end function device_of

  !> What processors and GPUs were measured to do in the ranks, and how many took which; nothing where nothing new was. Collective.
  subroutine report_trial(team, journal)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    real(wp), allocatable :: facts(:)
    real(wp) :: rates(2)
    integer :: takers(0:2), device
    logical :: any_new
    call team%allgather([merge(1.0_wp, 0.0_wp, trial%unreported), real(trial%taken, wp), trial%rate(on_processor), &
                         trial%rate(on_gpu)], facts)
    any_new = any(facts(1::4) > 0.5_wp)
    call end_report()
    if (.not. any_new) return
    associate (measured => facts(3::4) > 0, taken => nint(facts(2::4)))
      takers = [(count(measured .and. taken == device), device=not_known, on_gpu)]
      do device = on_processor, on_gpu
        rates(device) = mean_of(facts(2 + device::4))
      end do
      call journal%line('trial', trial_text(rates, takers, count(measured)), '"processor_starts_per_second": '// &
                        to_text(rates(on_processor), 6)//', "gpu_starts_per_second": '//to_text(rates(on_gpu), 6)// &
                        ', "processor_ranks": '//to_text(takers(on_processor))//', "gpu_ranks": '//to_text(takers(on_gpu)))
    end associate
  end subroutine report_trial

  !> The mean of the values above 0, 0 where there is none.
  pure real(wp) function mean_of(values)
    real(wp), intent(in) :: values(:)
    mean_of = sum(values, values > 0)/max(1, count(values > 0))
  end function mean_of

  !> `rates` [1/s] of the devices of a rank, and how many of `ranks` took which.
  pure function trial_text(rates, takers, ranks) result(words)
    real(wp), intent(in) :: rates(2)
    integer, intent(in) :: takers(0:2), ranks
    character(len=:), allocatable :: words
    words = 'measured'
    if (ranks > 1) words = words//' (means of '//to_text(ranks)//' ranks)'
    words = words//': processor '//to_text(nint(rates(on_processor), int64))//' starts/s, '
    if (rates(on_gpu) > 0) then
      words = words//'GPU '//to_text(nint(rates(on_gpu), int64))//' starts/s; '
    else
      words = words//'GPU not tried; '
    end if
    if (ranks == 1) then
      if (takers(not_known) == 1) words = words//'too few starts to choose'
      if (takers(on_processor) == 1) words = words//'the processor was taken'
      if (takers(on_gpu) == 1) words = words//'the GPU was taken'
    else
      words = words//'the GPU was taken by '//to_text(takers(on_gpu))//', the processor by '//to_text(takers(on_processor))
      if (takers(not_known) > 0) words = words//', too few starts to choose in '//to_text(takers(not_known))
    end if
  end function trial_text

  !> What was chosen, in words, and by how many ranks a GPU; on rank 0 of all ranks. Collective.
  subroutine device_text(team, the_case, words, gpus)
    class(team_t), intent(in) :: team
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable, intent(out) :: words
    integer, intent(out) :: gpus
    real(wp), allocatable :: chosen(:), facts(:)
    character(len=40), allocatable :: of_ranks(:)
    type(options_t) :: options
    integer :: first, last, group
    call team%allgather([real(gpu_in_use, wp), merge(1.0_wp, 0.0_wp, trial%taken == not_known)], facts)
    chosen = facts(1::2)
    gpus = count(chosen > -0.5_wp)
    if (gpus == 0) then
      options = options_of(the_case)
      words = 'processor, one by one'
      if (has_lanes(the_case, on_gpu=.false.)) words = 'processor, vectors of '//to_text(options%lane_width)//' doubles'
    else if (team%size() == 1) then
      words = 'GPU '//to_text(gpu_in_use)//' ('//gpu_name(gpu_in_use)//')'
    else
      allocate (of_ranks(size(chosen)))
      group = 0
      last = 0
      do while (last < size(chosen))
        first = last + 1
        last = first
        do while (last < size(chosen))
          if (nint(chosen(last + 1)) /= nint(chosen(first))) exit
          last = last + 1
        end do
        group = group + 1
        of_ranks(group) = to_text(first - 1)
        if (last > first) of_ranks(group) = trim(of_ranks(group))//'-'//to_text(last - 1)
        of_ranks(group) = trim(of_ranks(group))//': '//device_of(nint(chosen(first)))
      end do
      words = 'rank '//join(of_ranks(:group), ', ')
    end if
    if (any(facts(2::2) > 0.5_wp)) words = words//', or the processor where that is faster'
  end subroutine device_text

end module device_choice
