! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix verify`: checksums, invariants, and a random sample of the points run again: in double precision,
!> which must give what the file holds, and in quadruple precision, which shows how far it can be trusted.
module verify_driver
  use angle_units, only: unit_of
  use attractors, only: regime_names
  use audit, only: audit_t, note_deviation, sampled
  use axis, only: axis_t
  use basin, only: basin_points, catalogue_t, slice_cache_t
  use boundary_audit, only: audit_boundary, check_boundary
  use case_reader, only: load_case_text
  use case_setup, only: grid_of, span_of, sweep_axes
  use case_type, only: case_t
  use command_line, only: command_t
  use endings, only: assess_file, assess_motion
  use errors, only: error_t, fail
  use grid, only: grid_t, point_laws, point_slice, point_start
  use journal, only: journal_t, json_text
  use kinds, only: int64, real32, wp
  use list_audit, only: audit_points
  use map_invariants, only: check_invariants
  use map_reader, only: open_final, reader_t
  use map_verify, only: probe_file, verify_file
  use point_columns, only: at_attractor, at_reason, at_regime, map_values, marks_of_attractor, point_table
  use reference, only: run_reference
  use refinement, only: origin_contradicted
  use restoring_law, only: position_is_angle
  use serial_team, only: serial_team_t
  use statistics, only: share_upper_limit
  use status, only: exit_io, exit_uncertain, reason_code, reason_settled
  use stored_map, only: restore_catalogues
  use text, only: to_text
  use trajectories, only: run_trajectories
  use trajectory_slots, only: ensemble_t
  use single_trajectory, only: outcome_t
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  private

  public :: run_verify

  !> Deviations [m] above it are explained to the reader.
  real(wp), parameter :: reported_deviation = 1e-6_wp

contains

  !> Verifies the file that `command` names. Code 74 naming what is wrong; 77 where the sample shows that more labels would
  !> change than the command allows, 78 where all the motions were given up.
  subroutine run_verify(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    type(audit_t) :: audit
    type(journal_t) :: journal
    character(len=:), allocatable :: kind, resolved, reason
    type(case_t) :: the_case
    type(error_t), allocatable :: ignored, given_up
    character(len=128) :: no_overrides(0)
    integer :: datasets
    integer(int64) :: points
    call journal%open(.not. command%json, .false., command%quiet)
    call probe_file(command%path, error)
    if (.not. allocated(error)) call open_final(command%path, reader, error)
    if (allocated(error)) return
    call verify_file(command%path, error, datasets)
    if (.not. allocated(error)) call reader%text_attribute('/', 'kind', kind, error)
    if (.not. allocated(error)) call reader%read_text('/provenance/resolved_case', resolved, error)
    if (.not. allocated(error)) call load_case_text(resolved, command%path//' (resolved case)', no_overrides, &
                                                    the_case, error)
    if (.not. allocated(error)) then
      if (kind == 'boundary') call check_boundary(reader, points, error)
      if (kind /= 'boundary') call check_invariants(reader, kind, points, error)
    end if
    if (.not. allocated(error)) then
      audit%is_angle = position_is_angle(the_case%laws)
      select case (kind)
      case ('basin')
        call audit_map(reader, journal, the_case, the_case%axes, '', command%sample, command%seed, audit, error)
      case ('sweep')
        if (reader%has('/branch_regime')) call audit_map(reader, journal, the_case, sweep_axes(the_case), 'branch_', &
                                                         command%sample, command%seed, audit, error)
      case ('boundary')
        call audit_boundary(reader, journal, the_case, command%sample, command%seed, audit, error)
      case ('points')
        call audit_points(reader, the_case, command%sample, command%seed, audit, error)
      case ('trajectory')
        call reader%text_attribute('/', 'reason', reason, error)
      end select
    end if
    if (.not. allocated(error)) call assess_file(journal, reader, command%partial, given_up)
    call reader%close(ignored)
    if (allocated(error)) return
    call report(command, kind, datasets, points, audit)
    if (audit%differing > 0) call fail(error, exit_io, "'"//command%path//"': "//to_text(audit%differing)// &
      ' of '//to_text(audit%points)//' points rerun differ from the file, first '//audit%first_difference)
    if (.not. allocated(error)) call check_changes(command, audit, error)
    if (allocated(error)) return
    if (allocated(given_up)) call move_alloc(given_up, error)
    if (allocated(reason)) call assess_motion(reason_code(reason), reason//'; the file is whole', command%partial, &
                                             error)
  end subroutine run_verify

  !> Code 77 if the share of the sample whose label changes is above what is allowed. The share itself counts, not its
  !> confidence limit: without a change there is nothing against a file, however small the sample.
  subroutine check_changes(command, audit, error)
    type(command_t), intent(in) :: command
    type(audit_t), intent(in) :: audit
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: limits
    if (.not. 100.0_wp*audit%changes > command%max_changes*audit%points) return
    limits = ''
    if (.not. audit%whole) limits = ' (of the whole file, with 95 % confidence, '// &
      per_cent(1 - share_upper_limit(audit%points - audit%changes, audit%points, 0.975_wp))//' to '// &
      per_cent(share_upper_limit(audit%changes, audit%points, 0.975_wp))//')'
    call fail(error, exit_uncertain, "warning: '"//command%path//"': "//to_text(audit%changes)//' of '// &
      to_text(audit%points)//' labels rerun would change, '// &
      per_cent(audit%changes/real(audit%points, wp))//limits//'; allowed are '//to_text(command%max_changes)// &
      ' % (--max-changes). Points like these depend on rounding or were inferred wrongly: their labels mean nothing')
  end subroutine check_changes

  !> A share as '1.49 %'.
  pure function per_cent(share) result(text)
    real(wp), intent(in) :: share
    character(len=:), allocatable :: text
    text = to_text(100*share, 3)//' %'
  end function per_cent

  !> Reruns random points of a map over `axes`, after its catalogue has been searched again.
  subroutine audit_map(reader, journal, the_case, axes, prefix, sample, seed, audit, error)
    type(reader_t), intent(in) :: reader
    type(journal_t), intent(inout) :: journal
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    character(len=*), intent(in) :: prefix
    integer, intent(in) :: sample, seed
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    type(serial_team_t) :: alone
    type(grid_t) :: grid
    type(catalogue_t), allocatable :: catalogues(:)
    type(slice_cache_t) :: cache
    real(wp), allocatable :: values(:, :)
    integer, allocatable :: index(:)
    integer(int64), allocatable :: lengths(:), subscripts(:)
    integer(int64) :: points
    integer :: i, before
    grid = grid_of(the_case, axes)
    allocate (values(1, map_values(grid%laws)))
    call restore_catalogues(reader, alone, journal, grid, the_case, catalogues, error)
    if (.not. allocated(error)) call reader%lengths('/'//prefix//'regime', lengths, error)
    if (.not. allocated(error)) call check_lengths(reader%path, lengths, grid%shape, error)
    if (allocated(error)) return
    allocate (index(size(axes)), subscripts(size(lengths)))
    points = product(int(grid%shape(:size(axes)), int64))
    audit%whole = points <= sample
    points = min(points, int(sample, int64))
    call journal%begin('points run again', points, 0_int64)
    do i = 1, int(points)
      index = sampled(grid%shape(:size(axes)), audit%whole, seed, i)
      if (size(lengths) == size(axes)) then
        subscripts = index - 1
      else
        subscripts = [index(1) - 1, (index(2) - 1)*grid%shape(3) + index(3) - 1]
      end if
      call basin_points(grid, span_of(the_case), the_case%attractors%max_period, catalogues, reshape(index, [size(index), 1]), &
                        cache, values, error)
      if (allocated(error)) return
      before = audit%flips + audit%inferred_differing
      call compare_with_file(reader, prefix, subscripts, values(1, :), audit, error)
      if (allocated(error)) return
      call compare_with_reference(grid, catalogues, index, values(1, :), cache%ensemble, &
                                  audit, error)
      if (allocated(error)) return
      if (audit%flips + audit%inferred_differing > before) audit%changes = audit%changes + 1
      call journal%progress(int(i, int64))
    end do
  end subroutine audit_map

  !> A map has the lengths of the axes of its case; the starts of a sweep are one dimension of the file.
  subroutine check_lengths(path, lengths, shape, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: lengths(:)
    integer, intent(in) :: shape(:)
    type(error_t), allocatable, intent(out) :: error
    logical :: agree
    agree = size(lengths) == size(shape)
    if (agree) then
      agree = all(lengths == shape)
    else if (size(lengths) == 2 .and. size(shape) == 3) then
      agree = all(lengths == [shape(1), shape(2)*shape(3)])
    end if
    if (.not. agree) call fail(error, exit_io, "'"//path//"' has not the points that its case asks for")
  end subroutine check_lengths

  !> Every variable must be what the file holds.
  subroutine compare_with_file(reader, prefix, subscripts, values, audit, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: prefix
    integer(int64), intent(in) :: subscripts(:)
    real(wp), intent(in) :: values(:)
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: stored(:)
    integer :: k
    logical :: same, inferred
    audit%points = audit%points + 1
    inferred = .false.
    if (reader%has('/origin')) then
      call reader%read_block('/origin', subscripts, spread(1_int64, 1, size(subscripts)), stored, error)
      if (allocated(error)) return
      inferred = nint(stored(1)) > origin_contradicted
      if (inferred) audit%inferred = audit%inferred + 1
    end if
    do k = 1, size(values)
      if (.not. reader%has('/'//prefix//trim(point_table(k)%name))) cycle
      call reader%read_block('/'//prefix//trim(point_table(k)%name), subscripts, spread(1_int64, 1, size(subscripts)), stored, &
        error)
      if (allocated(error)) return
      if (k <= marks_of_attractor) same = nint(stored(1), int64) == nint(values(k), int64)
      if (k > marks_of_attractor) same = real(stored(1), real32) == real(values(k), real32) &
                        .or. (stored(1) /= stored(1) .and. values(k) /= values(k))
      if (same) cycle
      if (inferred) then
        audit%inferred_differing = audit%inferred_differing + 1
        return
      end if
      audit%differing = audit%differing + 1
      if (audit%differing == 1) audit%first_difference = trim(point_table(k)%name)//' at '// &
        subscripts_text(subscripts)//': the file has '//to_text(stored(1))//', rerun gives '//to_text(values(k))
      return
    end do
  end subroutine compare_with_file

  pure function subscripts_text(subscripts) result(text)
    integer(int64), intent(in) :: subscripts(:)
    character(len=:), allocatable :: text
    integer :: i
    text = '['
    do i = 1, size(subscripts)
      if (i > 1) text = text//', '
      text = text//to_text(subscripts(i))
    end do
    text = text//']'
  end function subscripts_text

  !> Label from a quadruple-precision run, and how far the double one has drifted at the end of the duration if the
  !> motion settles (on a chaotic one any error grows to its size).
  subroutine compare_with_reference(grid, catalogues, index, values, ensemble, audit, error)
    type(grid_t), intent(in) :: grid
    type(catalogue_t), intent(in) :: catalogues(:)
    integer, intent(in) :: index(:)
    real(wp), intent(in) :: values(:)
    type(ensemble_t), intent(in) :: ensemble
    type(audit_t), intent(inout) :: audit
    type(error_t), allocatable, intent(out) :: error
    type(catalogue_t) :: own
    type(outcome_t) :: outcome(1)
    type(ensemble_t) :: whole
    real(wp) :: start(3 + size(grid%others), 1), results(6, 1)
    start(:, 1) = point_start(grid, index)
    whole = ensemble
    whole%span%stop_when_converged = .false.
    allocate (own%attractors(0))
    if (size(catalogues) > 0) own = catalogues(point_slice(grid, index) + 1)
    call run_trajectories(whole, own%attractors, start, outcome)
    call run_reference(point_laws(grid, index), grid%options, whole%span, own%attractors, start(:3, :), results, error)
    if (allocated(error)) return
    if (size(catalogues) > 0) then
      if (nint(results(2, 1)) /= nint(values(at_attractor))) audit%flips = audit%flips + 1
    else if (nint(results(3, 1)) /= nint(values(at_regime))) then
      audit%flips = audit%flips + 1
    end if
    if (nint(values(at_reason)) == reason_settled) call note_deviation(outcome(1), results(:, 1), audit)
  end subroutine compare_with_reference

  subroutine report(command, kind, datasets, points, audit)
    type(command_t), intent(in) :: command
    character(len=*), intent(in) :: kind
    integer, intent(in) :: datasets
    integer(int64), intent(in) :: points
    type(audit_t), intent(in) :: audit
    character(len=:), allocatable :: all_of, deviations
    all_of = ''
    if (audit%whole) all_of = 'all '
    if (command%json) then
      write (output_unit, '(a)') '{"path": '//json_text(command%path)//', "kind": '//json_text(kind)// &
        ', "datasets": '//to_text(datasets)//', "points": '//to_text(points)//', "rerun": '//to_text(audit%points)// &
        ', "differing": '//to_text(audit%differing)//', "label_flips": '//to_text(audit%flips)// &
        ', "labels_changing": '//to_text(audit%changes)//', "max_changes_percent": '//to_text(command%max_changes)// &
        ', "label_flip_share_upper_95": '//to_text(share_upper_limit(audit%flips, audit%points, 0.95_wp))// &
        ', "compared": '//to_text(audit%compared)//', "impact_counts_differ": '//to_text(audit%impact_count_differs)// &
        ', "x_deviation": '//to_text(audit%x_deviation)//', "v_deviation": '//to_text(audit%v_deviation)//', "inferred": '// &
        to_text(audit%inferred)//', "inferred_differing": '//to_text(audit%inferred_differing)//'}'
      return
    end if
    write (output_unit, '(a)') command%path//': '//kind, &
      '  checksums of '//to_text(datasets)//' datasets agree', &
      '  invariants hold at '//to_text(points)//merge(' events', ' points', kind == 'trajectory')
    if (audit%points == 0) return
    deviations = ', '//to_text(audit%impact_count_differs)//' other impact counts, largest deviation after the duration '// &
                 to_text(audit%x_deviation, 3)//' '//unit_of('m', audit%is_angle)//', '//to_text(audit%v_deviation, 3)//' '// &
                 unit_of('m/s', audit%is_angle)
    if (audit%compared == 0) deviations = '; none had settled: impact counts and states are not compared'
    ! Of a boundary the labels on its two sides are all that is asked.
    if (kind == 'boundary') deviations = ''
    if (audit%wider > 0) deviations = '; '//to_text(audit%wider)//' of the others lie further out than the file states, by no '// &
                                      'more than a hundred times'
    if (audit%inferred > 0) write (output_unit, '(a)') &
      '  '//to_text(audit%inferred)//' inferred points computed: '//to_text(audit%inferred_differing)// &
      ' differ; so, with 95 % confidence, at most '// &
      to_text(100*share_upper_limit(audit%inferred_differing, audit%inferred, 0.95_wp), 3)//' % of the inferred ones are wrong'
    write (output_unit, '(a)') &
      '  '//all_of//to_text(audit%points)//' points run again: '//to_text(audit%differing)//' differ from the file'// &
      trim(merge(' where it was computed', repeat(' ', 22), audit%inferred > 0)), &
      '  against quadruple precision: '//to_text(audit%flips)//' label flips'//deviations
    if (audit%x_deviation > reported_deviation .and. audit%flips == 0) write (output_unit, '(a)') &
      '  a deviation so large with the same label: the phase on the cycle, or chaos, hangs on the last digits of the start'
    if (.not. audit%whole) write (output_unit, '(a)') &
      '  so, with 95 % confidence, at most '//to_text(100*share_upper_limit(audit%flips, audit%points, 0.95_wp), 3)// &
      ' % of the labels would change'
  end subroutine report

end module verify_driver
