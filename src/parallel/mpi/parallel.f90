! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Starts the program's team and makes schedulers: the build with MPI.
module parallel
  use errors, only: error_t
  use launcher, only: with_component
  use mpi_f08, only: MPI_Comm, MPI_COMM_WORLD, MPI_Init_thread, MPI_Initialized, MPI_THREAD_FUNNELED
  use mpi_scheduler, only: mpi_scheduler_t, new_mpi_scheduler
  use mpi_team, only: mpi_team_t, new_mpi_team
  use scheduler, only: scheduler_options_t, scheduler_t
  use serial_scheduler, only: serial_scheduler_t
  use system, only: set_environment
  use team, only: team_t
  implicit none
  private

  public :: start_team, join_team, make_scheduler

  !> What `--version` reports about MPI.
  character(len=*), parameter, public :: mpi_name = 'MPI'

contains

  !> The team of the whole program; starts MPI if nobody has. Also without mpirun.
  subroutine start_team(team)
    class(team_t), allocatable, intent(out) :: team
    type(mpi_team_t) :: ours
    logical :: running
    integer :: provided
    call MPI_Initialized(running)
    if (.not. running) then
      call allow_shared_memory()
      ! Threads serve the bodies of a GPU; the first of them alone calls MPI.
      call MPI_Init_thread(MPI_THREAD_FUNNELED, provided)
    end if
    call new_mpi_team(MPI_COMM_WORLD, ours, owns_mpi=.not. running)
    team = ours
  end subroutine start_team

  !> Where the user has chosen OpenMPI's one-sided transports, adds the one that can share the memory of a node.
  subroutine allow_shared_memory()
    character(len=*), parameter :: name = 'OMPI_MCA_osc'
    character(len=:), allocatable :: chosen
    integer :: length, status
    call get_environment_variable(name, length=length, status=status)
    if (status /= 0 .or. length == 0) return
    allocate (character(len=length) :: chosen)
    call get_environment_variable(name, chosen)
    call set_environment(name, with_component(chosen, 'sm'))
  end subroutine allow_shared_memory

  !> The team of a caller's communicator, given by its Fortran handle. MPI is running.
  subroutine join_team(communicator, team)
    integer, intent(in) :: communicator
    class(team_t), allocatable, intent(out) :: team
    type(mpi_team_t) :: ours
    type(MPI_Comm) :: handle
    handle%MPI_VAL = communicator
    call new_mpi_team(handle, ours, owns_mpi=.false.)
    team = ours
  end subroutine join_team

  !> The scheduler that belongs to the team. Collective.
  subroutine make_scheduler(team, options, scheduler, error)
    class(team_t), intent(in) :: team
    type(scheduler_options_t), intent(in) :: options
    class(scheduler_t), allocatable, intent(out) :: scheduler
    type(error_t), allocatable, intent(out) :: error
    type(mpi_scheduler_t) :: ours
    select type (team)
    type is (mpi_team_t)
      call new_mpi_scheduler(team, options, ours, error)
      scheduler = ours
    class default
      allocate (serial_scheduler_t :: scheduler)
      scheduler%options = options
    end select
  end subroutine make_scheduler

end module parallel
