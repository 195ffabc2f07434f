! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Points of a map that end without an attractor go back to discovery: an attractor with a basin so small that the sample of
!> starts missed it is found from the points of the map that lead to it, and those points get their label. From which points it was
!> searched is written down in the file before any label changes. Then the catalogue follows from the file, and an interrupted
!> run goes on the same way; the choice depends neither on tiles nor on ranks.
module second_look
  use basin, only: catalogue_t, open_slice
  use basin_work, only: basin_work_t, needs_label, prepare_counts
  use catalogue_report, only: list_attractors
  use catalogue_search, only: pack_catalogues, unpack_catalogues
  use discover, only: discover_attractors, is_given_up
  use errors, only: error_t
  use grid, only: grid_t, point_slice, point_start, slice_neighbours
  use journal, only: journal_t
  use kinds, only: int64, wp
  use machine_type, only: machine_t
  use map_file, only: map_file_t
  use map_record, only: add_record, read_record, rows_of, write_row
  use map_schema, only: schema_t
  use match, only: carry_labels, number_new
  use point_columns, only: at_reason
  use random, only: uniform
  use session, only: session_t
  use status, only: reason_time_over
  use stop_check, only: check_stop, limit_time
  use team, only: team_t
  use text, only: to_text
  use tiled_run, only: index_in_block, run_tiles
  use single_trajectory, only: span_t
  implicit none
  private

  public :: offer_second_look, resume_second_look, look_again, recall_second_look

  character(len=*), parameter :: group = 'second_look', record = 'start'
  !> Rounds into which the budget of starts is divided: what one finds need not be searched by the next.
  integer, parameter :: most_looks = 4

contains

  !> Room in the file for the starts of a second look.
  subroutine offer_second_look(budget, schema)
    integer, intent(in) :: budget
    type(schema_t), intent(inout) :: schema
    integer :: looks
    if (budget == 0) return
    looks = min(most_looks, budget)
    call schema%add_dimension('look', int(looks, int64))
    call schema%add_dimension('look_column', int(budget/looks + 1, int64))
    call add_record(schema, group, record, 'look', 'look_column', 'points (C order, from 0) from which attractors were '// &
                    'searched again, -1 = none; last column: check number of the row, 0 = no such look')
  end subroutine offer_second_look

  !> Brings the catalogues to where an interrupted second look had them.
  subroutine resume_second_look(session, file, work)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(basin_work_t), intent(inout) :: work
    type(error_t), allocatable :: error
    integer(int64), allocatable :: rows(:, :)
    logical :: changed
    integer :: i
    if (.not. is_offered(session, work)) return
    call read_record(file, session%team, group, record, rows, error)
    call session%stop_if(error)
    do i = 1, size(rows, 2)
      call extend_catalogues(session%team, session%journal, work%grid, work%span, work%max_period, &
                             session%command%time_limit, rows(:, i), work%catalogues, changed, error)
      call session%stop_if(error)
    end do
    if (size(rows, 2) > 0) call prepare_counts(work)
  end subroutine resume_second_look

  !> The same for the catalogues of a final file, from the values of its record (`columns` in a row).
  subroutine recall_second_look(team, journal, grid, span, max_period, values, columns, catalogues, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(in) :: journal
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer, intent(in) :: max_period, columns
    real(wp), intent(in) :: values(:)
    type(catalogue_t), intent(inout) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    logical :: changed
    integer :: i
    associate (rows => rows_of(values, columns))
      do i = 1, size(rows, 2)
        call extend_catalogues(team, journal, grid, span, max_period, 0.0_wp, rows(:, i), catalogues, changed, error)
        if (allocated(error)) return
      end do
    end associate
  end subroutine recall_second_look

  !> Where the search has found nothing there is no section, or no start that ends anywhere; nor is there more to find where it was
  !> given up.
  logical function is_offered(session, work)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(in) :: work
    integer :: i
    is_offered = session%the_case%attractors%second_look > 0 .and. entries(work%catalogues) > 0
    if (is_offered) is_offered = .not. all([(is_given_up(work%catalogues(i)%attractors), i=1, size(work%catalogues))])
  end function is_offered

  !> Looks again as long as points are without an attractor and the budget lasts. `complete` is false after a stop.
  subroutine look_again(session, file, work, complete)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(basin_work_t), intent(inout) :: work
    logical, intent(out) :: complete
    type(error_t), allocatable :: error
    integer(int64), allocatable :: rows(:, :), row(:)
    integer :: looks, budget, before, found, highest
    integer(int64) :: first, left
    character(len=:), allocatable :: suggestion
    logical :: changed
    complete = .true.
    if (.not. is_offered(session, work)) return
    call read_record(file, session%team, group, record, rows, error)
    call session%stop_if(error)
    budget = session%the_case%attractors%second_look
    looks = min(most_looks, budget)
    before = entries(work%catalogues)
    highest = maxval([0, work%catalogues(1)%attractors%id])
    ! Whether the labels were already mended before an interruption is not known.
    if (size(rows, 2) > 0) call mend_labels(session, file, work, complete)
    left = left_over(session, work)
    first = left
    do while (complete .and. size(rows, 2) < looks .and. left > 0)
      call choose(session, file, work, size(rows, 1), rows, row)
      if (all(row < 0)) exit
      call write_row(file, session%team, group, record, size(rows, 2) + 1, row, error)
      call session%stop_if(error)
      rows = reshape([rows, row], [size(row), size(rows, 2) + 1])
      call extend_catalogues(session%team, session%journal, work%grid, work%span, work%max_period, &
                             session%command%time_limit, row, work%catalogues, changed, error)
      call session%stop_if(error)
      if (.not. changed) cycle
      call mend_labels(session, file, work, complete)
      left = left_over(session, work)
    end do
    if (size(rows, 2) == 0 .or. .not. complete) return
    found = entries(work%catalogues) - before
    suggestion = ''
    if (left > 0) suggestion = ', a longer run.extension may decide'
    call session%journal%line('second_look', 'second look from '//to_text(count(rows >= 0))//' of '//to_text(first)// &
      ' points that had ended without an attractor: '//to_text(found)//' more found, '//to_text(left)//' points left without'// &
      suggestion, '"starts": '//to_text(count(rows >= 0))//', "found": '//to_text(found)//', "left": '//to_text(left))
    if (size(work%catalogues) > 1) return
    associate (attractors => work%catalogues(1)%attractors)
      call list_attractors(session%journal, pack(attractors, attractors%id > highest), session%the_case%laws)
    end associate
  end subroutine look_again

  pure integer function entries(catalogues)
    type(catalogue_t), intent(in) :: catalogues(:)
    integer :: i
    entries = sum([(size(catalogues(i)%attractors), i=1, size(catalogues))])
  end function entries

  !> Points without an attractor, on all ranks.
  integer(int64) function left_over(session, work)
    type(session_t), intent(in) :: session
    type(basin_work_t), intent(in) :: work
    integer(int64) :: total(1)
    total = work%unlabelled
    call session%team%sum(total)
    left_over = total(1)
  end function left_over

  !> The points without an attractor that come first in a random order that only the seed decides, `rows` left out; -1 behind them.
  subroutine choose(session, file, work, wanted, rows, row)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(basin_work_t), intent(in) :: work
    integer, intent(in) :: wanted
    integer(int64), intent(in) :: rows(:, :)
    integer(int64), allocatable, intent(out) :: row(:)
    type(error_t), allocatable :: error
    real(wp), allocatable :: values(:, :), everywhere(:)
    real(wp) :: best(2, wanted), drawn(1)
    integer(int64) :: lower(size(work%grid%shape)), extent(size(work%grid%shape)), flat
    integer :: tile, point, i
    best = huge(1.0_wp)
    do tile = 1 + session%team%rank(), file%tile_count(), session%team%size()
      call file%read_tile(tile, values, error)
      call session%abort_if(error)
      call file%tiling%block_of(tile, lower, extent)
      do point = 1, size(values, 1)
        if (.not. needs_label(values(point, :))) cycle
        flat = flat_index(work%grid, index_in_block(lower, extent, point))
        if (any(rows == flat)) cycle
        call uniform(int(session%the_case%attractors%seed, int64), flat, drawn)
        call put_in_order(best, drawn(1), real(flat, wp))
      end do
    end do
    call session%team%allgather(reshape(best, [size(best)]), everywhere)
    best = huge(1.0_wp)
    do i = 1, size(everywhere), 2
      call put_in_order(best, everywhere(i), everywhere(i + 1))
    end do
    allocate (row(wanted), source=-1_int64)
    where (best(1, :) < 2) row = nint(best(2, :), int64)
  end subroutine choose

  !> Keeps the smallest numbers drawn, in order, each with its point.
  pure subroutine put_in_order(best, drawn, flat)
    real(wp), intent(inout) :: best(:, :)
    real(wp), intent(in) :: drawn, flat
    integer :: i
    if (drawn >= best(1, size(best, 2))) return
    i = size(best, 2) - 1
    do while (i >= 1)
      if (best(1, i) <= drawn) exit
      best(:, i + 1) = best(:, i)
      i = i - 1
    end do
    best(:, i + 1) = [drawn, flat]
  end subroutine put_in_order

  !> Number of a point in C order, from 0.
  pure integer(int64) function flat_index(grid, index) result(flat)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    integer :: i
    flat = 0
    do i = 1, size(index)
      flat = flat*grid%shape(i) + index(i) - 1
    end do
  end function flat_index

  pure function index_of(grid, flat) result(index)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: flat
    integer :: index(size(grid%axes)), i
    integer(int64) :: rest
    rest = flat
    do i = size(index), 1, -1
      index(i) = 1 + int(modulo(rest, int(grid%shape(i), int64)))
      rest = rest/grid%shape(i)
    end do
  end function index_of

  !> Adds what the points of a row lead to, in the order of the row, slices shared among the ranks; `changed`: whether the
  !> catalogues have changed. New attractors carry the labels of their branches in the neighbouring slices, or new ones.
  subroutine extend_catalogues(team, journal, grid, span, max_period, time_limit, row, catalogues, changed, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(in) :: journal
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer, intent(in) :: max_period
    real(wp), intent(in) :: time_limit
    integer(int64), intent(in) :: row(:)
    type(catalogue_t), intent(inout) :: catalogues(:)
    logical, intent(out) :: changed
    type(error_t), allocatable, intent(out) :: error
    class(machine_t), allocatable :: moving
    real(wp), allocatable :: before(:), everything(:)
    integer(int64) :: slice(size(row))
    logical :: touched(size(catalogues)), mine(size(catalogues))
    real(wp) :: start(3 + size(grid%others), 1)
    integer :: i, k, highest
    slice = -1
    do i = 1, size(row)
      if (row(i) >= 0) slice(i) = point_slice(grid, index_of(grid, row(i)))
    end do
    touched = [(any(slice == i - 1), i=1, size(catalogues))]
    mine = [(touched(i) .and. modulo(count(touched(:i)), team%size()) == team%rank(), i=1, size(catalogues))]
    before = pack_catalogues(catalogues, touched)
    call limit_time(journal, time_limit, error)
    do i = 1, size(catalogues)
      if (.not. mine(i) .or. allocated(error)) cycle
      call open_slice(grid, span, int(i - 1, int64), moving, error)
      do k = 1, size(row)
        if (slice(k) /= i - 1 .or. allocated(error)) cycle
        start(:, 1) = point_start(grid, index_of(grid, row(k)))
        call discover_attractors(moving, span, start, max_period, catalogues(i)%attractors)
        call check_stop(journal, time_limit, 'looking again for attractors', error, resumable=.true.)
      end do
    end do
    call team%agree(error)
    if (allocated(error)) return
    call team%allgather(pack_catalogues(catalogues, mine), everything)
    call unpack_catalogues(everything, catalogues, error)
    if (allocated(error)) return
    everything = pack_catalogues(catalogues, touched)
    changed = size(everything) /= size(before)
    if (.not. changed) changed = any(abs(everything - before) > 0)
    if (.not. changed) return
    highest = maxval([(maxval([0, catalogues(i)%attractors%id]), i=1, size(catalogues))])
    do i = 1, size(catalogues)
      if (.not. touched(i)) cycle
      associate (neighbours => slice_neighbours(grid, int(i - 1, int64), .true.))
        do k = 1, size(neighbours)
          call carry_labels(catalogues(neighbours(k) + 1)%attractors, catalogues(i)%attractors)
        end do
      end associate
      call number_new(catalogues(i)%attractors, highest)
    end do
  end subroutine extend_catalogues

  !> Computes again the points that did not converge. `complete` is false after a stop.
  subroutine mend_labels(session, file, work, complete)
    type(session_t), intent(inout) :: session
    type(map_file_t), intent(inout) :: file
    type(basin_work_t), intent(inout) :: work
    logical, intent(out) :: complete
    type(error_t), allocatable :: error
    real(wp), allocatable :: values(:, :)
    integer(int64) :: open_points(file%tile_count())
    integer :: tile
    open_points = 0
    do tile = 1 + session%team%rank(), file%tile_count(), session%team%size()
      call file%read_tile(tile, values, error)
      call session%abort_if(error)
      open_points(tile) = count(nint(values(:, at_reason)) == reason_time_over)
    end do
    call session%team%sum(open_points)
    file%done = open_points == 0
    call prepare_counts(work)
    work%again = .true.
    call limit_time(session%journal, session%command%time_limit, error)
    call session%stop_if(error)
    call run_tiles(session, file, work, complete)
    ! Each rank knows only the tiles that it computed.
    if (complete) file%done = .true.
  end subroutine mend_labels

end module second_look
