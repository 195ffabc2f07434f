! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogues of all slices of a grid on a team: slices are handed out to the ranks, for their costs differ,
!> then all are known to all. The result does not depend on the number of ranks.
module catalogue_search
  use attractors, only: attractor_t, is_packed, kind_not_known, least_packed, pack_attractor, packed_length, unpack_attractor
  use basin, only: catalogue_t, label_slices, open_ensemble, open_slice, search_starts
  use case_type, only: attractors_t
  use discover, only: discover_attractors, is_given_up, sort_attractors
  use errors, only: error_t, fail
  use grid, only: grid_t, slice_neighbours
  use journal, only: journal_t
  use kinds, only: int64, wp
  use known_starts, only: note_known_starts
  use machine_type, only: machine_t
  use parallel, only: make_scheduler
  use scheduler, only: scheduler_options_t, scheduler_t
  use status, only: exit_bad_case, exit_io, exit_resumable
  use stop_check, only: check_stop, nothing_kept
  use team, only: team_t
  use text, only: to_text
  use trajectory_slots, only: describe_regime, ensemble_t
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: check_slices, search_catalogues, pack_catalogues, unpack_catalogues

  !> Most slices: the numbers of their attractors are counted by default integers, as MPI does.
  integer, parameter :: most_slices = (huge(1) - modulo(huge(1), least_packed + 2))/(least_packed + 2)

contains

  !> Refuses a grid (code 65) whose slices, with one attractor each, would have more than fit, and a duration that does not suit
  !> the drive of the first slice or the last.
  subroutine check_slices(grid, span, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(error_t), allocatable, intent(out) :: error
    class(machine_t), allocatable :: moving
    if (any(grid%start_axis > 0) .and. grid%slices > most_slices) call fail(error, exit_bad_case, &
      "key 'axis.count': found "//to_text(grid%slices)//' slices of starts over the parameters of the machine, allowed at most '// &
      to_text(most_slices)//'; divide the map')
    if (.not. allocated(error)) call open_slice(grid, span, 0_int64, moving, error)
    if (.not. allocated(error)) call open_slice(grid, span, grid%slices - 1, moving, error)
  end subroutine check_slices

  !> Catalogues of every slice, labelled along the slices; none if no start is an axis (then every point is its own
  !> slice). A second round offers each slice the attractors of its neighbours, so that none is missed
  !> because the sample happened to miss its basin. Code 75 on a stop signal or after `time_limit` [s].
  subroutine search_catalogues(team, journal, grid, span, settings, time_limit, catalogues, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(attractors_t), intent(in) :: settings
    real(wp), intent(in) :: time_limit
    type(catalogue_t), allocatable, intent(out) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    type(catalogue_t), allocatable :: first_round(:)
    logical, allocatable :: mine(:)
    integer :: round, rounds
    allocate (catalogues(merge(grid%slices, 0_int64, any(grid%start_axis > 0))))
    if (size(catalogues) == 0) return
    rounds = merge(2, 1, grid%slices > 1)
    call journal%begin('slices', rounds*grid%slices, 0_int64)
    allocate (first_round(0))
    do round = 1, rounds
      if (round == 2) first_round = catalogues
      call search_round(team, journal, grid, span, settings, time_limit, first_round, catalogues, mine, error)
      if (allocated(error)) return
      ! Large where the slices are many.
      if (round == rounds) deallocate (first_round)
      call exchange(team, mine, catalogues, error)
      if (allocated(error)) return
    end do
    call label_slices(grid, catalogues)
  end subroutine search_catalogues

  !> Every slice once: from the sample, or from the attractors of its neighbours in the `first_round` if that has any.
  !> `mine`: the slices that this rank searched.
  subroutine search_round(team, journal, grid, span, settings, time_limit, first_round, catalogues, mine, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    type(attractors_t), intent(in) :: settings
    real(wp), intent(in) :: time_limit
    type(catalogue_t), intent(in) :: first_round(:)
    type(catalogue_t), intent(inout) :: catalogues(:)
    logical, allocatable, intent(out) :: mine(:)
    type(error_t), allocatable, intent(out) :: error
    class(scheduler_t), allocatable :: slices
    real(wp), allocatable :: starts(:, :)
    type(catalogue_t) :: unknown
    integer(int64) :: slice
    integer :: position
    allocate (mine(size(catalogues)), source=.false.)
    call make_scheduler(team, scheduler_options_t(), slices, error)
    if (.not. allocated(error)) call slices%start(size(catalogues), error)
    call team%agree(error)
    if (allocated(error)) return
    do
      call slices%next(position)
      if (position == 0) exit
      slice = position - 1
      if (size(first_round) == 0) then
        starts = search_starts(grid, settings%sample, settings%seed)
      else
        starts = search_starts(grid, settings%sample, settings%seed, &
                               attractors_of(first_round, slice_neighbours(grid, slice, .true.)))
      end if
      call set_aside(catalogues(position), size(first_round) > 0, unknown)
      call search_slice(journal, slices, grid, span, slice, starts, settings%max_period, time_limit, &
                        catalogues(position), error)
      call take_back(unknown, catalogues(position))
      if (allocated(error)) call slices%request_stop()
      if (slices%stop_requested()) exit
      mine(position) = .true.
      call journal%progress(merge(0_int64, grid%slices, size(first_round) == 0) + slices%done_count() + 1)
    end do
    call slices%finish()
    call team%agree(error)
    if (allocated(error)) return
    if (slices%stop_requested()) call fail(error, exit_resumable, 'stopped while searching for attractors; '// &
      nothing_kept)
  end subroutine search_round

  !> The attractors of neighbours are followed also in a slice whose search was given up: its entries are put aside.
  subroutine set_aside(catalogue, again, unknown)
    type(catalogue_t), intent(inout) :: catalogue
    logical, intent(in) :: again
    type(catalogue_t), intent(out) :: unknown
    allocate (unknown%attractors(0))
    if (.not. again .or. .not. allocated(catalogue%attractors)) return
    if (.not. is_given_up(catalogue%attractors)) return
    call move_alloc(catalogue%attractors, unknown%attractors)
    allocate (catalogue%attractors(0))
  end subroutine set_aside

  !> Of what was found then, what is known joins the entries put aside.
  subroutine take_back(unknown, catalogue)
    type(catalogue_t), intent(in) :: unknown
    type(catalogue_t), intent(inout) :: catalogue
    if (size(unknown%attractors) == 0) return
    catalogue%attractors = [unknown%attractors, pack(catalogue%attractors, catalogue%attractors%kind /= kind_not_known)]
    call sort_attractors(catalogue%attractors)
  end subroutine take_back

  !> Adds to the catalogue of a slice what `starts` lead to, one by one, so that a stop is noticed between them. Those that lead to
  !> what is known are found many at once, where lanes can fly them.
  subroutine search_slice(journal, slices, grid, span, slice, starts, max_period, time_limit, catalogue, error)
    type(journal_t), intent(in) :: journal
    class(scheduler_t), intent(inout) :: slices
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    integer(int64), intent(in) :: slice
    real(wp), intent(in) :: starts(:, :), time_limit
    integer, intent(in) :: max_period
    type(catalogue_t), intent(inout) :: catalogue
    type(error_t), allocatable, intent(out) :: error
    type(ensemble_t) :: ensemble
    logical :: known(size(starts, 2)), useful
    integer :: i, decided, attractors
    call open_ensemble(grid, span, slice, describe_regime, ensemble, error)
    if (allocated(error)) return
    ! Lanes end at convergence, whatever a map does.
    ensemble%span%stop_when_converged = .true.
    if (.not. allocated(catalogue%attractors)) allocate (catalogue%attractors(0))
    known = .false.
    useful = .true.
    decided = 0
    attractors = 0
    do i = 1, size(starts, 2)
      associate (found => size(catalogue%attractors))
        if (found > 0 .and. (i > decided .or. found > attractors)) then
          call note_known_starts(ensemble, catalogue%attractors, starts, i - 1, known, decided, useful)
          attractors = found
        end if
      end associate
      if (.not. known(i)) call discover_attractors(ensemble%moving, span, starts(:, i:i), max_period, catalogue%attractors)
      call check_stop(journal, time_limit, 'searching for attractors', error)
      call slices%poll()
      if (allocated(error)) return
      if (slices%stop_requested()) return
    end do
    call sort_attractors(catalogue%attractors)
  end subroutine search_slice

  !> The attractors of several slices.
  pure function attractors_of(catalogues, slices) result(attractors)
    type(catalogue_t), intent(in) :: catalogues(:)
    integer(int64), intent(in) :: slices(:)
    type(attractor_t), allocatable :: attractors(:)
    integer :: i
    allocate (attractors(0))
    do i = 1, size(slices)
      attractors = [attractors, catalogues(slices(i) + 1)%attractors]
    end do
  end function attractors_of

  !> Every rank gets the catalogues of the slices that the others searched.
  subroutine exchange(team, searched, catalogues, error)
    class(team_t), intent(in) :: team
    logical, intent(in) :: searched(:)
    type(catalogue_t), intent(inout) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: all_values(:)
    integer(int64) :: found(1)
    integer :: slice
    found = 0
    do slice = 1, size(catalogues)
      if (searched(slice)) found = found + packed_numbers(catalogues(slice)%attractors)
    end do
    call team%sum(found)
    if (found(1) > huge(1)) then
      call fail(error, exit_bad_case, "key 'axis.count': the attractors of all slices together take "//to_text(found(1))// &
        ' numbers, allowed at most '//to_text(huge(1))//'; divide the map')
      return
    end if
    call team%allgather(pack_catalogues(catalogues, searched), all_values)
    call unpack_catalogues(all_values, catalogues, error)
  end subroutine exchange

  !> Numbers that `pack_catalogues` makes of a slice.
  pure integer(int64) function packed_numbers(attractors)
    type(attractor_t), intent(in) :: attractors(:)
    integer :: i
    packed_numbers = 2 + sum([(packed_length(attractors(i)), i=1, size(attractors))])
  end function packed_numbers

  !> The catalogues of the slices that were `searched`, as numbers: slice, number of attractors, and these.
  pure function pack_catalogues(catalogues, searched) result(packed)
    type(catalogue_t), intent(in) :: catalogues(:)
    logical, intent(in) :: searched(:)
    real(wp), allocatable :: packed(:)
    integer :: slice, i, position, length
    position = 0
    do slice = 1, size(catalogues)
      if (searched(slice)) position = position + int(packed_numbers(catalogues(slice)%attractors))
    end do
    allocate (packed(position))
    position = 0
    do slice = 1, size(catalogues)
      if (.not. searched(slice)) cycle
      packed(position + 1:position + 2) = [real(slice, wp), real(size(catalogues(slice)%attractors), wp)]
      position = position + 2
      do i = 1, size(catalogues(slice)%attractors)
        length = packed_length(catalogues(slice)%attractors(i))
        packed(position + 1:position + length) = pack_attractor(catalogues(slice)%attractors(i))
        position = position + length
      end do
    end do
  end function pack_catalogues

  !> What `pack_catalogues` packed, into the slices that it names. Code 74 if it is not that, as from a damaged file, or a
  !> slice has no catalogue then.
  pure subroutine unpack_catalogues(packed, catalogues, error)
    real(wp), intent(in) :: packed(:)
    type(catalogue_t), intent(inout) :: catalogues(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: slice, i, position, count, length
    logical :: whole
    position = 0
    whole = .true.
    do while (position < size(packed))
      whole = position + 2 <= size(packed)
      if (whole) whole = all(ieee_is_finite(packed(position + 1:position + 2)))
      if (whole) whole = packed(position + 1) >= 1 .and. packed(position + 1) <= size(catalogues) .and. &
        packed(position + 2) >= 0 .and. packed(position + 2) <= (size(packed) - position - 2)/least_packed
      if (.not. whole) exit
      slice = nint(packed(position + 1))
      count = nint(packed(position + 2))
      position = position + 2
      if (allocated(catalogues(slice)%attractors)) deallocate (catalogues(slice)%attractors)
      allocate (catalogues(slice)%attractors(count))
      do i = 1, count
        whole = position < size(packed)
        if (whole) whole = packed(position + 1) >= least_packed .and. packed(position + 1) <= size(packed) - position
        if (.not. whole) exit
        length = nint(packed(position + 1))
        whole = is_packed(packed(position + 1:position + length))
        if (.not. whole) exit
        catalogues(slice)%attractors(i) = unpack_attractor(packed(position + 1:position + length))
        position = position + length
      end do
      if (.not. whole) exit
    end do
    if (.not. whole) then
      call fail(error, exit_io, 'the catalogue of the attractors is damaged')
      return
    end if
    do slice = 1, size(catalogues)
      if (allocated(catalogues(slice)%attractors)) cycle
      call fail(error, exit_io, 'the catalogue of slice '//to_text(slice - 1)//' is missing')
      return
    end do
  end subroutine unpack_catalogues

end module catalogue_search
