! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix points`: a list of starts, each run for the whole duration.
module points_driver
  use case_setup, only: grid_of, output_path, points_of_tile
  use command_line, only: command_t
  use errors, only: error_t
  use kinds, only: int64, wp
  use list_work, only: describe_list, describe_points, end_points, list_work_t, open_list_ensemble, point_variables, &
    points_per_tile, shortest_period, starts_of
  use map_file, only: map_file_t
  use map_schema, only: schema_t
  use point_list, only: read_point_list
  use run_plan, only: pilot_seconds, plan_text
  use session, only: open_session, session_t
  use shard, only: describe_shard, finish_shard, shard_path
  use span_check, only: check_periods
  use status, only: exit_done
  use tiled_run, only: open_tiles, run_tiles
  use trajectories, only: block_size
  implicit none
  private

  public :: run_points

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_points(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(list_work_t) :: work
    type(map_file_t) :: file
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    character(len=:), allocatable :: path
    real(wp) :: seconds
    integer :: points
    logical :: complete
    call open_session(command, session)
    work%variables = point_variables
    work%grid = grid_of(session%the_case, session%the_case%axes(:0))
    call open_list_ensemble(work%grid, session%the_case, work%ensemble, error)
    work%block = block_size(work%ensemble)
    if (.not. allocated(error)) work%ratio = work%ensemble%moving%drive_ratio
    if (.not. allocated(error)) call read_point_list(command%list, work%ratio, work%ensemble%moving%stops, &
                                                     session%the_case%laws, work%list, error)
    if (.not. allocated(error)) work%starts = starts_of(work%grid, work%list)
    if (.not. allocated(error)) call check_periods(work%ensemble%span, shortest_period(work), error)
    call session%stop_if(error)
    path = output_path(command%output, command%path, command%name)
    if (command%shard > 0) path = shard_path(path, command%shard, command%shard_count)
    if (command%validate) then
      call session%journal%line('valid', command%path//' and '//command%list//' are valid for points')
      call session%end_with(exit_done)
    end if
    if (command%dry_run) then
      call pilot_seconds(work, [size(work%list%x0)], seconds, error)
      call session%stop_if(error)
      call describe_points(work%list, schema)
      call session%journal%line('plan', plan_text([size(work%list%x0)], [points_per_tile], &
                                                  schema%bytes()/size(work%list%x0) + schema%bytes_of_point(), seconds, command))
      call session%end_with(exit_done)
    end if
    call session%begin(path, tiled=.true.)
    call describe_list(session, work%list, schema)
    if (command%shard > 0) call describe_shard(command%shard, command%shard_count, schema)
    points = points_per_tile
    if (session%gpus == session%team%size() .and. command%shard == 0) then
      points = points_of_tile(size(work%list%x0, kind=int64), session%team%size(), session%gpus)
    end if
    call open_tiles(session, path, schema, ['point'], [points], file, open_shape=.true.)
    call run_tiles(session, file, work, complete)
    if (command%shard > 0 .and. complete) call finish_shard(session, file)
    call end_points(session, work, file, complete)
  end subroutine run_points

end module points_driver
