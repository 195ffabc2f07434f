! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix basin`: where every point of a grid ends up.
module basin_driver
  use attractors, only: last_regime, regime_names
  use basin_work, only: basin_work_t, prepare_counts, sum_counts
  use case_check, only: require_axes
  use case_setup, only: automatic_tile, grid_of, output_path, points_of_tile, span_of, tile_of_blocks
  use case_type, only: case_t
  use catalogue_report, only: list_attractors, missed_text, not_known_text, report_found
  use catalogue_search, only: check_slices, pack_catalogues, search_catalogues, unpack_catalogues
  use command_line, only: command_t
  use endings, only: assess_reasons, report_reasons
  use errors, only: error_t
  use file_layout, only: add_axes, add_catalogue, add_map_variables, add_refined_variables
  use point_columns, only: bytes_of_point, marks_of_attractor, point_values
  use sample_shares, only: add_sample_shares, add_samples, share_with_interval
  use grid, only: grid_t, two_axes
  use journal, only: json_text
  use kinds, only: int64, wp
  use map_file, only: map_file_t
  use map_schema, only: name_length, schema_t
  use refinement, only: automatic_block
  use refinement_report, only: add_refinement, report_refinement
  use refined_tile, only: layers_of, pilot_share
  use pair, only: is_pair
  use restoring_law, only: position_is_angle
  use session, only: describe_file, identity_of, open_session, session_t
  use shard, only: describe_shard, finish_search, finish_shard, shard_path
  use share_files, only: read_catalogue
  use second_look, only: look_again, offer_second_look, resume_second_look
  use status, only: exit_done
  use text, only: to_text
  use tiled_run, only: finish_tiles, open_tiles, pilot_seconds, plan_text, run_tiles
  implicit none
  private

  public :: run_basin, prepare_basin, describe_basin, end_basin

  !> Bytes of the origin of a point of a refined map.
  integer, parameter :: bytes_of_origin = 1
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

  !> Grid, span and tiles of a case, for so many ranks of which so many have a GPU. Shares of a map are to have the same tiles,
  !> whoever computes them: for these `gpus` is 0.
  subroutine prepare_basin(the_case, work, tile, ranks, gpus)
    type(case_t), intent(in) :: the_case
    type(basin_work_t), intent(inout) :: work
    integer, allocatable, intent(out) :: tile(:)
    integer, intent(in) :: ranks, gpus
    work%variables = point_values
    work%grid = grid_of(the_case, the_case%axes)
    work%span = span_of(the_case)
    work%max_period = the_case%attractors%max_period
    call prepare_refinement(the_case, work)
    tile = automatic_tile(work%grid, the_case%tile, points_of_tile(product(int(work%grid%shape, int64)), ranks, gpus))
    if (work%refine%active) tile = tile_of_blocks(work%grid, work%refine, the_case%tile)
  end subroutine prepare_basin

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

  !> Attributes, axes and variables of the file; returns the names of its dimensions.
  subroutine describe_basin(session, work, schema, dimensions)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(in) :: work
    type(schema_t), intent(inout) :: schema
    character(len=name_length), allocatable, intent(out) :: dimensions(:)
    call describe_file(session, 'basin', schema)
    call add_axes(schema, work%grid%axes, dimensions)
    call add_samples(schema, session%the_case%sample)
    if (work%refine%active) then
      call add_refined_variables(schema, dimensions)
    else
      call add_map_variables(schema, '', dimensions)
    end if
    if (size(work%catalogues) > 0) call offer_second_look(session%the_case%attractors%second_look, schema)
  end subroutine describe_basin

  !> The final file with its catalogue, the shares of the regimes, and the end of the program.
  subroutine end_basin(session, work, file, complete)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(inout) :: work
    type(map_file_t), intent(inout) :: file
    logical, intent(in) :: complete
    type(schema_t) :: extra
    type(error_t), allocatable :: error
    call sum_counts(session, work)
    extra%positions_are_angles = position_is_angle(session%the_case%laws)
    call add_catalogue(extra, work%catalogues, work%captured, is_pair(session%the_case%laws))
    if (allocated(work%grid%drawn)) call add_sample_shares(extra, work%captured, points_of_slice(work%grid))
    if (work%refine%active) call add_refinement(extra, work, work%grid%shape, work%origins)
    call finish_tiles(session, file, complete, extra)
    call report_shares(session, work)
    if (work%refine%active) call report_refinement(session, work, work%grid%shape, work%origins)
    call assess_reasons(session%journal, work%reasons, session%command%partial, error)
    call session%stop_if(error)
    call session%end_with(exit_done)
  end subroutine end_basin

  subroutine prepare_refinement(the_case, work)
    type(case_t), intent(in) :: the_case
    type(basin_work_t), intent(inout) :: work
    work%refine = the_case%refine
    work%marks = marks_of_attractor
    if (.not. work%refine%active) return
    work%refined_axes = two_axes(work%grid)
    work%refine%block = automatic_block(work%refine, work%grid%shape(work%refined_axes), layers_of(work%grid%shape, &
                                                                                                   work%refined_axes))
  end subroutine prepare_refinement

  !> Reports what a dry run would do, with a rate from a few points, and ends the program.
  subroutine report_plan(session, work, tile)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(inout) :: work
    integer, intent(in) :: tile(:)
    type(error_t), allocatable :: error
    real(wp) :: seconds, share
    integer :: bytes
    if (work%refine%active) then
      call pilot_share(work, work%grid%shape, seconds, share, error)
      call session%stop_if(error)
      bytes = bytes_of_point(marks_of_attractor) + bytes_of_origin
      call session%journal%line('plan', plan_text(work%grid%shape, tile, bytes, seconds))
      call session%journal%line('plan', 'about '//to_text(100*share, 2)//' % of the points computed (from a few blocks)')
    else
      call pilot_seconds(work, work%grid%shape, seconds, error)
      call session%stop_if(error)
      call session%journal%line('plan', plan_text(work%grid%shape, tile, bytes_of_point(point_values), seconds))
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
    call list_attractors(session%journal, work%catalogues(1)%attractors, position_is_angle(session%the_case%laws))
  end subroutine report_catalogue

  subroutine report_shares(session, work)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(in) :: work
    integer :: i
    real(wp) :: share
    do i = 0, last_regime
      if (work%regimes(i) == 0) cycle
      share = 100*real(work%regimes(i), wp)/sum(work%regimes)
      call session%journal%line('share', '  '//trim(regime_names(i))//': '//to_text(share, 6)//' % ('// &
        to_text(work%regimes(i))//' points)', '"regime": '//json_text(trim(regime_names(i)))//', "percent": '// &
        to_text(share)//', "points": '//to_text(work%regimes(i)))
    end do
    call report_reasons(session%journal, work%reasons)
    if (allocated(work%grid%drawn) .and. size(work%catalogues) == 1) call report_sample_shares(session, work)
  end subroutine report_shares

  !> Points of one slice.
  pure integer(int64) function points_of_slice(grid)
    type(grid_t), intent(in) :: grid
    points_of_slice = product(int(grid%shape, int64))/grid%slices
  end function points_of_slice

  !> Shares of the attractors of starts drawn at random.
  subroutine report_sample_shares(session, work)
    type(session_t), intent(inout) :: session
    type(basin_work_t), intent(in) :: work
    real(wp) :: share(3)
    integer :: k
    do k = 1, size(work%catalogues(1)%attractors)
      share = share_with_interval(work%captured(k), points_of_slice(work%grid))
      call session%journal%line('basin_share', '  attractor '//to_text(work%catalogues(1)%attractors(k)%id)//': '// &
        to_text(100*share(1), 4)//' % of the starts, between '//to_text(100*share(2), 4)//' % and '// &
        to_text(100*share(3), 4)//' % with 95 % confidence', '"attractor": '// &
        to_text(work%catalogues(1)%attractors(k)%id)//', "share": '//to_text(share(1))//', "lower": '// &
        to_text(share(2))//', "upper": '//to_text(share(3)))
    end do
  end subroutine report_sample_shares

end module basin_driver
