! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix basin`: where every point of a grid ends up.
module basin_driver
  use basin_map, only: describe_basin, end_basin, prepare_basin
  use basin_work, only: basin_work_t, prepare_counts
  use case_check, only: require_axes
  use case_setup, only: output_path
  use catalogue_report, only: list_attractors, missed_text, not_known_text, report_found
  use catalogue_search, only: check_slices, pack_catalogues, search_catalogues, unpack_catalogues
  use command_line, only: command_t
  use errors, only: error_t
  use kinds, only: int64, wp
  use map_file, only: map_file_t
  use map_schema, only: name_length, schema_t
  use refined_tile, only: pilot_share
  use run_plan, only: pilot_seconds, plan_text
  use second_look, only: look_again, resume_second_look
  use session, only: identity_of, open_session, session_t
  use shard, only: describe_shard, finish_search, finish_shard, shard_path
  use share_files, only: read_catalogue
  use status, only: exit_done
  use text, only: to_text
  use tiled_run, only: open_tiles, run_tiles
  implicit none
  private

  public :: run_basin

  !> Slices up to which a dry run builds the catalogues.
  integer, parameter :: most_dry_slices = 16

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_basin(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(basin_work_t) :: work
    type(map_file_t) :: file
    type(schema_t) :: schema
    type(error_t), allocatable :: error
    character(len=name_length), allocatable :: dimensions(:)
    character(len=:), allocatable :: path
    integer, allocatable :: tile(:)
    logical :: complete
    call open_session(command, session)
    call require_axes(session%the_case, error)
    call session%stop_if(error)
    call prepare_basin(session%the_case, work, tile, session%team%size(), merge(0, session%gpus, command%shard > 0))
    call check_slices(work%grid, work%span, error)
    call session%stop_if(error)
    if (command%validate) then
      call session%journal%line('valid', command%path//' is a valid case for basin')
      call session%end_with(exit_done)
    end if
    path = output_path(command%output, command%path, command%name)
    if (command%shard > 0) path = shard_path(path, command%shard, command%shard_count)
    if (.not. command%dry_run) call session%begin(path, tiled=.true.)
    if (command%dry_run .and. work%grid%slices > most_dry_slices) then
      ! Too many catalogues for a dry run: every point discovers its own attractor instead, which takes longer.
      allocate (work%catalogues(0))
      call prepare_counts(work)
      call report_plan(session, work, tile)
    end if
    if (len(command%catalogue) > 0) then
      call take_catalogues(session, work, error)
    else
      call search_catalogues(session%team, session%journal, work%grid, work%span, session%the_case%attractors, &
                             command%time_limit, work%catalogues, error)
    end if
    call session%stop_if(error)
    call prepare_counts(work)
    if (command%dry_run) call report_plan(session, work, tile)
    call report_catalogue(session, work)
    call describe_basin(session, work, schema, dimensions)
    if (command%shard > 0) call describe_shard(command%shard, command%shard_count, schema, &
                                               pack_catalogues(work%catalogues, spread(.true., 1, size(work%catalogues))))
    call open_tiles(session, path, schema, dimensions, tile, file, open_shape=.not. any(session%the_case%tile > 0))
    if (command%search_only) call finish_search(session, file)
    call resume_second_look(session, file, work)
    call run_tiles(session, file, work, complete)
    if (command%shard > 0 .and. complete) call finish_shard(session, file)
    if (complete) call look_again(session, file, work, complete)
    call end_basin(session, work, file, complete)
  end subroutine run_basin

  !> The attractors that a share of the same map has found, on all ranks.
  subroutine take_catalogues(session, work, error)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(inout) :: work
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: packed(:), all_values(:)
    allocate (packed(0))
    if (session%team%is_root()) call read_catalogue(session%command%catalogue, identity_of(session%the_case, 'basin'), packed, &
                                                    error)
    call session%team%agree(error)
    if (allocated(error)) return
    call session%team%allgather(packed, all_values)
    allocate (work%catalogues(merge(work%grid%slices, 0_int64, any(work%grid%start_axis > 0))))
    call unpack_catalogues(all_values, work%catalogues, error)
  end subroutine take_catalogues

  !> Reports what a dry run would do, with a rate from a few points, and ends the program.
  subroutine report_plan(session, work, tile)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(inout) :: work
    integer, intent(in) :: tile(:)
    type(error_t), allocatable :: error
    real(wp) :: seconds, share
    type(schema_t) :: schema
    character(len=name_length), allocatable :: dimensions(:)
    call describe_basin(session, work, schema, dimensions)
    if (work%refine%active) then
      call pilot_share(work, work%grid%shape, seconds, share, error)
      call session%stop_if(error)
      call session%journal%line('plan', plan_text(work%grid%shape, tile, schema%bytes_of_point(), seconds, session%command))
      call session%journal%line('plan', 'about '//to_text(100*share, 2)//' % of the points computed (from a few blocks)')
    else
      call pilot_seconds(work, work%grid%shape, seconds, error)
      call session%stop_if(error)
      call session%journal%line('plan', plan_text(work%grid%shape, tile, schema%bytes_of_point(), seconds, session%command))
    end if
    call session%end_with(exit_done)
  end subroutine report_plan

  subroutine report_catalogue(session, work)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(in) :: work
    character(len=:), allocatable :: source, not_known, missed
    if (size(work%catalogues) == 0) then
      call session%journal%line('catalogue', 'no start is an axis: every point has its own attractor, unlabelled')
      return
    end if
    source = 'discovered'
    if (len(session%command%catalogue) > 0) source = 'taken from '//session%command%catalogue
    call report_found(session%journal, work%catalogues, source)
    not_known = not_known_text(work%catalogues, work%span%extension)
    if (len(not_known) > 0) call session%journal%line('warning', not_known)
    missed = missed_text(work%catalogues, session%the_case%attractors%sample)
    if (len(missed) > 0) call session%journal%line('missed', missed)
    if (size(work%catalogues) > 1) return
    call list_attractors(session%journal, work%catalogues(1)%attractors, session%the_case%laws)
  end subroutine report_catalogue

end module basin_driver
