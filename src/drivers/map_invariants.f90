! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold at every point of a file, whatever the case.
module map_invariants
  use attractors, only: last_regime, regime_at_rest, regime_chattering, regime_impact, regime_mixed, regime_names, &
    regime_unresolved
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use map_reader, only: reader_t
  use point_columns, only: at_amplitude, at_attractor, at_impacts, at_reason, at_regime, at_x_max, at_x_min, point_table, &
    point_values
  use slabs, only: slab, slab_count
  use status, only: last_reason, exit_io, reason_names, reason_not_run, reason_settled, reason_time_over
  use text, only: to_text
  implicit none
  private

  public :: check_invariants

contains

  !> Checks every point of a basin or of the many starts of a sweep, and the order of a trajectory's events. `points`
  !> is how many there are. Code 74 names the first violation.
  subroutine check_invariants(reader, kind, points, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: kind
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    points = 0
    select case (kind)
    case ('basin')
      call check_map(reader, '', points, error)
      if (.not. allocated(error)) call check_counts(reader, error)
    case ('sweep')
      if (reader%has('/branch_regime')) call check_map(reader, 'branch_', points, error)
    case ('trajectory')
      call check_events(reader, points, error)
    case ('points')
      call check_points(reader, points, error)
    end select
  end subroutine check_invariants

  subroutine check_map(reader, prefix, points, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: prefix
    integer(int64), intent(inout) :: points
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: needed(7) = [at_regime, at_reason, at_attractor, at_impacts, at_amplitude, at_x_max, at_x_min]
    integer :: known
    integer(int64), allocatable :: lengths(:), lower(:), extent(:)
    real(wp), allocatable :: column(:), block(:, :)
    real(wp), allocatable :: catalogue(:, :)
    integer(int64) :: k
    integer :: i
    call reader%lengths('/'//prefix//'regime', lengths, error)
    if (reader%has('/catalogue/attractor')) then
      if (.not. allocated(error)) call reader%read_columns([character(len=20) :: '/catalogue/attractor', &
                                                                '/catalogue/regime'], catalogue, error)
    else
      allocate (catalogue(0, 2))
    end if
    if (allocated(error)) return
    allocate (lower(size(lengths)), extent(size(lengths)))
    ! A refined map has no more.
    known = merge(3, size(needed), reader%has('/origin'))
    do k = 1, slab_count(lengths)
      call slab(lengths, k, lower, extent)
      if (allocated(block)) deallocate (block)
      allocate (block(product(extent), point_values))
      do i = 1, known
        call reader%read_block('/'//prefix//trim(point_table(needed(i))%name), lower, extent, column, error)
        if (allocated(error)) return
        block(:, needed(i)) = column
      end do
      do i = 1, size(block, 1)
        call check_point(reader%path, points + i - 1, block(i, :), known == size(needed), error)
        if (.not. allocated(error)) call check_label(reader%path, points + i - 1, nint(block(i, at_regime)), &
                                                     nint(block(i, at_attractor)), catalogue, error)
        if (allocated(error)) return
      end do
      points = points + size(block, 1)
    end do
  end subroutine check_map

  !> A labelled point has the regime of its branch in the catalogue.
  subroutine check_label(path, number, regime, label, catalogue, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: number
    integer, intent(in) :: regime, label
    real(wp), intent(in) :: catalogue(:, :)
    type(error_t), allocatable, intent(out) :: error
    if (label == 0 .or. size(catalogue, 1) == 0) return
    if (any(nint(catalogue(:, 1)) == label .and. nint(catalogue(:, 2)) == regime)) return
    call fail(error, exit_io, "'"//path//"', point "//to_text(number)//': regime '//trim(regime_names(regime))// &
              ' with the label of attractor '//to_text(label)//', which has no such regime in the catalogue')
  end subroutine check_label

  !> One point: regime, reason, attractor, and with `described` impacts per period, amplitude, x_max, x_min.
  subroutine check_point(path, number, values, described, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: number
    real(wp), intent(in) :: values(:)
    logical, intent(in) :: described
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    problem = ''
    associate (regime => nint(values(at_regime)), reason => nint(values(at_reason)), attractor => nint(values(at_attractor)))
      if (reason <= reason_not_run .or. reason > last_reason) then
        problem = 'reason code '//to_text(reason)
      else if (regime < 0 .or. regime > last_regime) then
        problem = 'regime code '//to_text(regime)
      else if ((regime == regime_unresolved) .neqv. .not. (reason == reason_settled .or. reason == reason_time_over)) then
        problem = 'regime '//trim(regime_names(regime))//' with reason '//trim(reason_names(reason))
      else if (attractor /= 0 .and. regime == regime_unresolved) then
        problem = 'an attractor without a regime'
      else if (described) then
        problem = problem_of_motion(regime, values(at_impacts), values(at_amplitude), values(at_x_max), values(at_x_min))
      end if
    end associate
    if (len(problem) > 0) call fail(error, exit_io, "'"//path//"', point "//to_text(number)//': '//problem)
  end subroutine check_point

  !> What is wrong with the description of a motion; '' if nothing is.
  pure function problem_of_motion(regime, impacts, amplitude, x_max, x_min) result(problem)
    integer, intent(in) :: regime
    real(wp), intent(in) :: impacts, amplitude, x_max, x_min
    character(len=:), allocatable :: problem
    problem = ''
    if ((impacts > 0) .neqv. any(regime == [regime_impact, regime_mixed, regime_chattering])) then
      problem = to_text(impacts)//' impacts per period with regime '//trim(regime_names(regime))
    else if (regime /= regime_unresolved .and. .not. &
             abs(2*amplitude - (x_max - x_min)) <= 1e-6_wp*(abs(x_max) + abs(x_min))) then
      problem = 'the amplitude is not half the range of the position'
    else if (regime == regime_at_rest .and. amplitude > 0) then
      problem = 'a body at rest with an amplitude'
    end if
  end function problem_of_motion

  !> The counts of the catalogue add up to the points with a label.
  subroutine check_counts(reader, error)
    type(reader_t), intent(in) :: reader
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: lengths(:), lower(:), extent(:)
    real(wp), allocatable :: counts(:), labels(:)
    integer(int64) :: k, labelled
    if (.not. reader%has('/catalogue/count')) return
    call reader%read_values('/catalogue/count', counts, error)
    if (.not. allocated(error)) call reader%lengths('/attractor', lengths, error)
    if (allocated(error)) return
    allocate (lower(size(lengths)), extent(size(lengths)))
    labelled = 0
    do k = 1, slab_count(lengths)
      call slab(lengths, k, lower, extent)
      call reader%read_block('/attractor', lower, extent, labels, error)
      if (allocated(error)) return
      labelled = labelled + count(labels > 0)
    end do
    if (labelled /= nint(sum(counts), int64)) call fail(error, exit_io, "'"//reader%path//"': the catalogue counts "// &
      to_text(nint(sum(counts), int64))//' points, '//to_text(labelled)//' have a label')
  end subroutine check_counts

  !> Events of a trajectory follow each other and impacts reverse the velocity: of a structure that of the joint, which others that
  !> strike with it may make faster. Of two bodies the file does not know it.
  subroutine check_events(reader, points, error)
    type(reader_t), intent(in) :: reader
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: events(:, :)
    logical :: turns_back, of_joint, of_pair
    integer :: i
    points = 0
    of_joint = reader%has('/event_joint_v_before')
    of_pair = reader%has('/event_driver_v')
    if (of_joint) then
      call reader%read_columns([character(len=21) :: '/event_kind', '/event_time', '/event_joint_v_before', &
                                '/event_joint_v_after'], events, error)
    else
      call reader%read_columns([character(len=21) :: '/event_kind', '/event_time', '/event_v_before', '/event_v_after'], &
                               events, error)
    end if
    if (allocated(error)) return
    points = size(events, 1)
    do i = 1, size(events, 1)
      if (i > 1) then
        if (events(i, 2) < events(i - 1, 2)) call fail(error, exit_io, "'"//reader%path//"': event "//to_text(i - 1)// &
                                             ' comes before the one before it')
      end if
      turns_back = .not. events(i, 3)*events(i, 4) > 0 .and. (of_joint .or. .not. abs(events(i, 4)) > abs(events(i, 3)))
      if (nint(events(i, 1)) <= 2 .and. .not. (turns_back .or. of_pair)) then
        call fail(error, exit_io, "'"//reader%path//"': impact "//to_text(i - 1)//' does not reverse the velocity')
      end if
      if (allocated(error)) return
    end do
  end subroutine check_events

  subroutine check_points(reader, points, error)
    type(reader_t), intent(in) :: reader
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :)
    integer :: i
    points = 0
    call reader%read_columns([character(len=18) :: '/reason', '/impacts', '/last_impact_speed'], table, error)
    if (allocated(error)) return
    points = size(table, 1)
    do i = 1, size(table, 1)
      associate (reason => nint(table(i, 1)), impacts => table(i, 2), speed => table(i, 3))
        if (reason <= reason_not_run .or. reason > last_reason) then
          call fail(error, exit_io, "'"//reader%path//"', point "//to_text(i - 1)//': reason code '//to_text(reason))
        else if (speed < 0 .or. (speed > 0 .and. impacts < 1)) then
          call fail(error, exit_io, "'"//reader%path//"', point "//to_text(i - 1)//': '//to_text(nint(impacts))// &
                    ' impacts, last at '//to_text(speed)//' m/s')
        end if
      end associate
      if (allocated(error)) return
    end do
  end subroutine check_points

end module map_invariants
