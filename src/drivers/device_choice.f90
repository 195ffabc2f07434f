! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What computes a map: the GPUs of the hosts, one for each rank in turn, or the processor.
module device_choice
  use case_setup, only: grid_of, options_of
  use case_type, only: case_t
  use errors, only: error_t, fail
  use grid, only: slice_motion
  use kinds, only: int64, wp
  use lane_gpu, only: count_gpus, gpu_in_use, gpu_is_built, gpu_name, use_gpu
  use lane_preparation, only: prepare_lanes
  use lane_types, only: lane_flow_t
  use motion, only: motion_t
  use motion_state, only: options_t
  use status, only: exit_usage
  use system, only: host_name
  use team, only: host_length, team_t
  use text, only: join, to_text
  implicit none
  private

  public :: choose_device, device_text

contains

  !> Chooses what this rank computes with, `asked` being auto, cpu or gpu; before anything is made ready to fly. Code 64 where
  !> a GPU is asked for that is not there, or that cannot help. Collective.
  subroutine choose_device(team, asked, the_case, error)
    class(team_t), intent(in) :: team
    character(len=*), intent(in) :: asked
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: why
    integer :: place, count
    call use_gpu(-1)
    if (asked == 'cpu') return
    place = place_on_host(team)
    count = 0
    if (has_lanes(the_case, on_gpu=.true.)) then
      call count_gpus(count, why)
      if (len(why) > 0) why = ' ('//why//')'
      if (.not. gpu_is_built()) why = ' (and no code for one: this build has SEPARATRIX_GPU=OFF)'
      if (asked == 'gpu' .and. count == 0) call fail(error, exit_usage, '--device gpu: found no GPU on '//host_name()//why// &
                                                     '; allowed are auto and cpu')
    else if (asked == 'gpu') then
      call fail(error, exit_usage, '--device gpu: found a machine that only a processor flies (one by one, or of several '// &
                'bodies); allowed are auto and cpu')
    end if
    if (count > 0) call use_gpu(modulo(place, count))
  end subroutine choose_device

  !> Number of this rank among those of its host, from 0. Collective.
  integer function place_on_host(team) result(place)
    class(team_t), intent(in) :: team
    character(len=host_length), allocatable :: names(:)
    real(wp), allocatable :: hosts(:)
    character(len=host_length) :: mine
    mine = host_name()
    call team%hosts(mine, names)
    call team%allgather([real(findloc(names == mine, .true., dim=1), wp)], hosts)
    place = count(nint(hosts(:team%rank())) == nint(hosts(team%rank() + 1)))
  end function place_on_host

  !> Whether bodies of the case fly in lanes; `on_gpu`: in those that a GPU has, which know one body. Asks the case itself, not
  !> along its axes.
  logical function has_lanes(the_case, on_gpu)
    type(case_t), intent(in) :: the_case
    logical, intent(in) :: on_gpu
    type(motion_t) :: moving
    type(lane_flow_t) :: flow
    type(error_t), allocatable :: error
    has_lanes = .false.
    call slice_motion(grid_of(the_case, the_case%axes(:0)), 0_int64, moving, error)
    if (allocated(error)) return
    call prepare_lanes(moving, flow)
    has_lanes = flow%available .and. .not. (on_gpu .and. allocated(flow%structure))
  end function has_lanes

  !> What was chosen, in words, and by how many ranks a GPU; on rank 0 of all ranks. Collective.
  subroutine device_text(team, the_case, words, gpus)
    class(team_t), intent(in) :: team
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable, intent(out) :: words
    integer, intent(out) :: gpus
    real(wp), allocatable :: chosen(:)
    character(len=24), allocatable :: of_rank(:)
    type(options_t) :: options
    integer :: rank
    call team%allgather([real(gpu_in_use, wp)], chosen)
    gpus = count(chosen > -0.5_wp)
    if (gpus == 0) then
      options = options_of(the_case)
      words = 'processor, one by one'
      if (has_lanes(the_case, on_gpu=.false.)) words = 'processor, vectors of '//to_text(options%lane_width)//' doubles'
    else if (team%size() == 1) then
      words = 'GPU '//to_text(gpu_in_use)//' ('//gpu_name(gpu_in_use)//')'
    else
      allocate (of_rank(size(chosen)))
      do rank = 1, size(chosen)
        of_rank(rank) = to_text(rank - 1)//': processor'
        if (chosen(rank) > -0.5_wp) of_rank(rank) = to_text(rank - 1)//': GPU '//to_text(nint(chosen(rank)))
      end do
      words = 'rank '//join(of_rank, ', ')
    end if
  end subroutine device_text

end module device_choice
