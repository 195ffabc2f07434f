! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Points of a basin map: start to values, with the machine of the current slice at hand.
module basin
  use attractors, only: attractor_t
  use crank_summary, only: crank_summary_t, no_summary
  use crank_turns, only: summarize_attractor, summarize_while
  use discover, only: discover_attractors
  use device_run, only: run_on_device
  use errors, only: error_t, fail
  use lane_slots, only: prepare_flow
  use grid, only: grid_t, point_slice, point_start, slice_motion, slice_neighbours, slice_starts
  use kinds, only: int64, wp
  use machine_type, only: machine_t
  use match, only: carry_labels, number_new, remember
  use build_pair, only: is_pair
  use point_columns, only: at_attractor, crank_values_of, outcome_values, point_values
  use span_check, only: check_periods
  use status, only: exit_bad_case, reason_settled, reason_time_over
  use text, only: to_text
  use trajectories, only: block_size
  use trajectory_slots, only: describe_all, ensemble_t
  use work_watch, only: watch_t
  use single_trajectory, only: fit_window, outcome_t, run_trajectory, span_t
  implicit none
  private

  public :: open_slice, open_ensemble, points_at_a_time, search_starts, label_slices, basin_points

  !> The attractors of one slice.
  type, public :: catalogue_t
    type(attractor_t), allocatable :: attractors(:)
  end type catalogue_t

  !> The slice that was last looked at.
  type, public :: slice_cache_t
    integer(int64) :: slice = -1
    type(ensemble_t) :: ensemble
    !> What the crank of a motor does on each attractor, once a point asked for it.
    type(crank_summary_t), allocatable :: cranks(:)
  end type slice_cache_t

contains

  !> The machine of a slice. Code 65 if a trajectory would not last one drive period (what it shows would
  !> be a piece of its beginning), or more of them than can be run.
  subroutine open_slice(grid, span, slice, moving, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer(int64), intent(in) :: slice
    class(machine_t), allocatable, intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    call slice_motion(grid, slice, moving, error)
    if (allocated(error)) return
    if (span%duration < moving%period) call fail(error, exit_bad_case, "key 'run.duration': found "// &
      to_text(span%duration)//' s, allowed at least one drive period, '//to_text(moving%period, 6)//' s')
    if (.not. allocated(error)) call check_periods(span, moving%period, error)
  end subroutine open_slice

  !> The machine of a slice, ready for whole trajectories.
  subroutine open_ensemble(grid, span, slice, describe, ensemble, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer(int64), intent(in) :: slice
    integer, intent(in) :: describe
    type(ensemble_t), intent(out) :: ensemble
    type(error_t), allocatable, intent(out) :: error
    call open_slice(grid, span, slice, ensemble%moving, error)
    if (allocated(error)) return
    ensemble%span = span
    call fit_window(ensemble%moving%period, ensemble%span)
    ensemble%describe = describe
    call prepare_flow(ensemble%moving, ensemble%flow)
  end subroutine open_ensemble

  !> Points worth asking `basin_points` for at a time, from that at `index` on: its slice speaks for those that follow.
  subroutine points_at_a_time(grid, span, index, cache, points, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer, intent(in) :: index(:)
    type(slice_cache_t), intent(inout) :: cache
    integer, intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    points = 1
    call turn_to(grid, span, point_slice(grid, index), cache, error)
    if (.not. allocated(error)) points = block_size(cache%ensemble)
  end subroutine points_at_a_time

  !> Makes the cache hold the machine of a slice.
  subroutine turn_to(grid, span, slice, cache, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer(int64), intent(in) :: slice
    type(slice_cache_t), intent(inout) :: cache
    type(error_t), allocatable, intent(out) :: error
    if (slice == cache%slice) return
    cache%slice = -1
    if (allocated(cache%cranks)) deallocate (cache%cranks)
    call open_ensemble(grid, span, slice, describe_all, cache%ensemble, error)
    if (.not. allocated(error)) cache%slice = slice
  end subroutine turn_to

  !> Starts from which the attractors of a slice are searched: its own sample, or, where `neighbours` (attractors of other
  !> slices) are given, their section points.
  pure function search_starts(grid, sample, seed, neighbours) result(starts)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: sample, seed
    type(attractor_t), intent(in), optional :: neighbours(:)
    real(wp), allocatable :: starts(:, :)
    integer :: i
    if (.not. present(neighbours)) then
      starts = slice_starts(grid, sample, seed)
      return
    end if
    allocate (starts(3 + size(grid%others), 0))
    ! A start has no coordinates of the driving body of two.
    if (is_pair(grid%laws)) return
    do i = 1, size(neighbours)
      if (neighbours(i)%rests) cycle
      starts = reshape([starts, merge(neighbours(i)%section(:2), neighbours(i)%points(:2, 1), neighbours(i)%by_event), 0.0_wp, &
                        grid%others], [size(starts, 1), size(starts, 2) + 1])
    end do
  end function search_starts

  !> Labels of all slices, so that a branch keeps its number along every parameter axis: after the branches of the row so
  !> far (the last axis runs along a row), then after the neighbours on the other axes; what is left starts a new branch.
  pure subroutine label_slices(grid, catalogues)
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(inout) :: catalogues(:)
    type(attractor_t), allocatable :: row(:)
    integer(int64), allocatable :: neighbours(:)
    integer(int64) :: slice
    integer :: i, highest
    allocate (row(0))
    highest = 0
    do slice = 0, size(catalogues, kind=int64) - 1
      associate (attractors => catalogues(slice + 1)%attractors)
        attractors%id = 0
        neighbours = slice_neighbours(grid, slice, .false.)
        if (.not. any(neighbours == slice - 1)) row = row(:0)
        call carry_labels(row, attractors)
        do i = 1, size(neighbours)
          call carry_labels(catalogues(neighbours(i) + 1)%attractors, attractors)
        end do
        call number_new(attractors, highest)
        call remember(row, attractors)
      end associate
    end do
  end subroutine label_slices

  !> Values (points, variables) of the points at `index` (axes, points), from 1 along each axis. Without a start among the
  !> axes every point is its own slice: then `catalogues` is empty and the point's attractor is discovered on the spot,
  !> unlabelled. `whole` is false if the watch requests a stop on the way.
  subroutine basin_points(grid, span, max_period, catalogues, index, cache, values, error, whole, watch)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer, intent(in) :: max_period
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(in) :: index(:, :)
    type(slice_cache_t), intent(inout) :: cache
    real(wp), intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    logical, intent(out), optional :: whole
    class(watch_t), intent(inout), optional :: watch
    integer(int64) :: slices(size(index, 2))
    logical :: left(size(index, 2)), done
    integer :: i, first
    do i = 1, size(index, 2)
      slices(i) = point_slice(grid, index(:, i))
    end do
    left = .true.
    if (present(whole)) whole = .true.
    do first = 1, size(slices)
      if (.not. left(first)) cycle
      call turn_to(grid, span, slices(first), cache, error)
      if (allocated(error)) return
      associate (members => pack([(i, i=1, size(slices))], left .and. slices == slices(first)))
        left(members) = .false.
        if (size(catalogues) > 0) then
          call slice_points(grid, cache, catalogues(slices(first) + 1)%attractors, index, members, values, done, error, watch)
          if (present(whole)) whole = done
          if (allocated(error) .or. .not. done) return
        else
          call isolated_points(grid, max_period, cache%ensemble, index, members, values)
        end if
      end associate
    end do
  end subroutine basin_points

  !> Points of one slice with a catalogue.
  subroutine slice_points(grid, cache, catalogue, index, members, values, whole, error, watch)
    type(grid_t), intent(in) :: grid
    type(slice_cache_t), intent(inout) :: cache
    type(attractor_t), intent(in) :: catalogue(:)
    integer, intent(in) :: index(:, :), members(:)
    real(wp), intent(inout) :: values(:, :)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(outcome_t), allocatable :: outcomes(:)
    real(wp), allocatable :: starts(:, :)
    integer :: i
    allocate (outcomes(size(members)), starts(3 + size(grid%others), size(members)))
    do i = 1, size(members)
      starts(:, i) = point_start(grid, index(:, members(i)))
    end do
    call run_on_device(cache%ensemble, catalogue, starts, outcomes, whole, error, watch)
    if (allocated(error) .or. .not. whole) return
    if (size(values, 2) > point_values .and. .not. allocated(cache%cranks)) then
      call summarize_all(cache%ensemble%moving, catalogue, cache%cranks)
    end if
    do i = 1, size(members)
      call put_values(cache%ensemble, outcomes(i), catalogue, cache%cranks, values(members(i), :))
    end do
  end subroutine slice_points

  !> Points that are their own slices: each discovers its attractor.
  subroutine isolated_points(grid, max_period, ensemble, index, members, values)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: max_period
    type(ensemble_t), intent(in) :: ensemble
    integer, intent(in) :: index(:, :), members(:)
    real(wp), intent(inout) :: values(:, :)
    type(attractor_t), allocatable :: own(:)
    type(crank_summary_t), allocatable :: cranks(:)
    type(outcome_t) :: outcome
    real(wp) :: start(3 + size(grid%others))
    integer :: i, k
    do i = 1, size(members)
      start = point_start(grid, index(:, members(i)))
      if (allocated(own)) deallocate (own)
      call discover_attractors(ensemble%moving, ensemble%span, reshape(start, [size(start), 1]), max_period, own)
      own%id = [(k, k=1, size(own))]
      call run_trajectory(ensemble%moving, own, ensemble%span, start, outcome)
      if (size(values, 2) > point_values) call summarize_all(ensemble%moving, own, cranks)
      call put_values(ensemble, outcome, own, cranks, values(members(i), :))
      values(members(i), at_attractor) = 0
    end do
  end subroutine isolated_points

  !> What the crank of a motor does on each attractor.
  pure subroutine summarize_all(moving, catalogue, cranks)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(crank_summary_t), allocatable, intent(out) :: cranks(:)
    integer :: i
    allocate (cranks(size(catalogue)))
    do i = 1, size(catalogue)
      call summarize_attractor(moving, catalogue(i), cranks(i))
    end do
  end subroutine summarize_all

  !> The values of a point; with `cranks` those of a motor too: of the attractor if it converged, else over as long as the window
  !> after its end.
  pure subroutine put_values(ensemble, outcome, catalogue, cranks, values)
    type(ensemble_t), intent(in) :: ensemble
    type(outcome_t), intent(in) :: outcome
    type(attractor_t), intent(in) :: catalogue(:)
    type(crank_summary_t), intent(in), optional :: cranks(:)
    real(wp), intent(out) :: values(:)
    type(crank_summary_t) :: crank
    integer :: i
    values(:point_values) = outcome_values(outcome)
    if (.not. present(cranks)) return
    crank = no_summary()
    select case (outcome%reason)
    case (reason_time_over)
      call summarize_while(ensemble%moving, [outcome%x, outcome%v, outcome%crank], ensemble%span%window, crank)
    case (reason_settled)
      do i = 1, size(catalogue)
        if (catalogue(i)%id == outcome%attractor) crank = cranks(i)
      end do
    end select
    values(point_values + 1:) = crank_values_of(crank)
  end subroutine put_values

end module basin
