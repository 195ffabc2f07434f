! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One executable with subcommands: reads the arguments, calls the command, returns the exit code.
program separatrix
  use basin_driver, only: run_basin
  use boundary_driver, only: run_boundary
  use branches_driver, only: run_branches
  use command_line, only: command_t, read_command_line
  use command_table, only: help_text
  use errors, only: error_t
  use info_driver, only: run_info
  use launcher, only: launched_rank
  use laws_driver, only: run_laws
  use merge_driver, only: run_merge
  use points_driver, only: run_points
  use stability_driver, only: run_stability
  use sweep_driver, only: run_sweep
  use status, only: exit_io
  use system, only: default_environment, exit_at_once, exit_program, sleep_microseconds
  use trajectory_driver, only: run_trajectory_command
  use verify_driver, only: run_verify
  use version_text, only: print_version
  use, intrinsic :: iso_fortran_env, only: error_unit, output_unit
  implicit none

  type(command_t) :: command
  type(error_t), allocatable :: error
  logical :: first

  ! Work that is not shared among the processes of mpirun is done and reported by the first of them.
  first = launched_rank() == 0
  ! Runs have a lock of their own; those of HDF5 fail where the file system has none.
  call default_environment('HDF5_USE_FILE_LOCKING', 'FALSE')
  call read_command_line(command, error)
  if (.not. allocated(error)) then
    if (command%help) then
      if (first) write (output_unit, '(a)', advance='no') help_text(command%name)
    else if (command%version) then
      if (first) call print_version()
    else
      select case (command%name)
      case ('basin')
        call run_basin(command)
      case ('sweep')
        call run_sweep(command)
      case ('branches')
        call run_branches(command)
      case ('boundary')
        call run_boundary(command)
      case ('stability')
        call run_stability(command, error)
      case ('trajectory')
        call run_trajectory_command(command)
      case ('points')
        call run_points(command)
      case ('merge')
        if (first) call run_merge(command)
      case ('laws')
        if (first) call run_laws(command%json)
      case ('info')
        if (first) call run_info(command%path, command%json, error)
      case ('verify')
        if (first) call run_verify(command, error)
      end select
    end if
  end if
  if (allocated(error)) then
    if (first) then
      write (error_unit, '(a)') 'separatrix: '//error%message
      ! A file is buffered, and what ends at once leaves buffers as they are.
      flush (error_unit)
    else
      ! mpirun ends the others with the first that fails: let it be the one that speaks.
      call sleep_microseconds(500000)
    end if
    ! HDF5 cannot be shut down after it has failed on a damaged file.
    if (error%code == exit_io) call exit_at_once(error%code)
    call exit_program(error%code)
  end if
end program separatrix
