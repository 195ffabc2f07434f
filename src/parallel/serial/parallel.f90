! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Starts the program's team and makes schedulers: the build without MPI.
module parallel
  use, intrinsic :: iso_fortran_env, only: error_unit
  use errors, only: error_t
  use launcher, only: launched_ranks
  use scheduler, only: scheduler_options_t, scheduler_t
  use serial_scheduler, only: serial_scheduler_t
  use serial_team, only: serial_team_t
  use status, only: exit_usage
  use system, only: exit_program
  use team, only: team_t
  use text, only: to_text
  implicit none
  private

  public :: start_team, join_team, make_scheduler

  !> What `--version` reports about MPI.
  character(len=*), parameter, public :: mpi_name = 'none'

contains

  !> The team of the whole program. Under mpirun every process would do the whole work and write the same file, so
  !> there the program ends with code 64.
  subroutine start_team(team)
    class(team_t), allocatable, intent(out) :: team
    if (launched_ranks() > 1) then
      write (error_unit, '(a)') 'separatrix: this build has no MPI, found '//to_text(launched_ranks())// &
        ' processes started together, allowed 1'
      call exit_program(exit_usage)
    end if
    allocate (serial_team_t :: team)
  end subroutine start_team

  !> The team of a caller's communicator, which the build without MPI cannot use.
  subroutine join_team(communicator, team)
    integer, intent(in) :: communicator
    class(team_t), allocatable, intent(out) :: team
    associate (unused => communicator)
    end associate
    allocate (serial_team_t :: team)
  end subroutine join_team

  !> The scheduler that belongs to the team.
  subroutine make_scheduler(team, options, scheduler, error)
    class(team_t), intent(in) :: team
    type(scheduler_options_t), intent(in) :: options
    class(scheduler_t), allocatable, intent(out) :: scheduler
    type(error_t), allocatable, intent(out) :: error
    associate (unused => team)
    end associate
    allocate (serial_scheduler_t :: scheduler)
    scheduler%options = options
  end subroutine make_scheduler

end module parallel
