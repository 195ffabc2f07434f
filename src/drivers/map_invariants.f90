! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold at every point of a file, whatever the case.
module map_invariants
  use attractors, only: last_regime, regime_at_rest, regime_chattering, regime_impact, regime_mixed, regime_names, &
    regime_unresolved
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use map_reader, only: reader_t
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
    character(len=*), parameter :: names(7) = [character(len=18) :: 'regime', 'reason', 'attractor', &
      'impacts_per_period', 'amplitude', 'x_max', 'x_min']
    integer :: known
    integer(int64), allocatable :: lengths(:), lower(:), extent(:)
    real(wp), allocatable :: column(:), block(:, :)
    real(wp), allocatable :: labels(:), regimes(:)
    integer(int64) :: k
    integer :: i
    call reader%lengths('/'//prefix//'regime', lengths, error)
    if (reader%has('/catalogue/attractor')) then
      if (.not. allocated(error)) call reader%read_values('/catalogue/attractor', labels, error)
      if (.not. allocated(error)) call reader%read_values('/catalogue/regime', regimes, error)
    else
      allocate (labels(0), regimes(0))
    end if
    if (allocated(error)) return
    allocate (lower(size(lengths)), extent(size(lengths)))
    ! A refined map has no more.
    known = merge(3, size(names), reader%has('/origin'))
    do k = 1, slab_count(lengths)
      call slab(lengths, k, lower, extent)
      if (allocated(block)) deallocate (block)
      allocate (block(product(extent), known))
      do i = 1, known
        call reader%read_block('/'//prefix//trim(names(i)), lower, extent, column, error)
        if (allocated(error)) return
        block(:, i) = column
      end do
      do i = 1, size(block, 1)
        call check_point(reader%path, points + i - 1, block(i, :), error)
        if (.not. allocated(error)) call check_label(reader%path, points + i - 1, nint(block(i, 1)), nint(block(i, 3)), &
                                                     labels, regimes, error)
        if (allocated(error)) return
      end do
      points = points + size(block, 1)
    end do
  end subroutine check_map

  !> A labelled point has the regime of its branch in the catalogue.
  subroutine check_label(path, number, regime, label, labels, regimes, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: number
    integer, intent(in) :: regime, label
    real(wp), intent(in) :: labels(:), regimes(:)
    type(error_t), allocatable, intent(out) :: error
    if (label == 0 .or. size(labels) == 0) return
    if (any(nint(labels) == label .and. nint(regimes) == regime)) return
    call fail(error, exit_io, "'"//path//"', point "//to_text(number)//': regime '//trim(regime_names(regime))// &
              ' with the label of attractor '//to_text(label)//', which has no such regime in the catalogue')
  end subroutine check_label

  !> One point: regime, reason, attractor, and unless the map is refined impacts per period, amplitude, x_max, x_min.
  subroutine check_point(path, number, values, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: number
    real(wp), intent(in) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    problem = ''
    associate (regime => nint(values(1)), reason => nint(values(2)), attractor => nint(values(3)))
      if (reason <= reason_not_run .or. reason > last_reason) then
        problem = 'reason code '//to_text(reason)
      else if (regime < 0 .or. regime > last_regime) then
        problem = 'regime code '//to_text(regime)
      else if ((regime == regime_unresolved) .neqv. .not. (reason == reason_settled .or. reason == reason_time_over)) then
        problem = 'regime '//trim(regime_names(regime))//' with reason '//trim(reason_names(reason))
      else if (attractor /= 0 .and. regime == regime_unresolved) then
        problem = 'an attractor without a regime'
      else if (size(values) == 7) then
        problem = problem_of_motion(regime, values(4), values(5), values(6), values(7))
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

  !> Events of a trajectory follow each other and impacts reverse the velocity.
  subroutine check_events(reader, points, error)
    type(reader_t), intent(in) :: reader
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: kinds_of_event(:), time(:), before(:), after(:)
    integer :: i
    points = 0
    call reader%read_values('/event_kind', kinds_of_event, error)
    if (.not. allocated(error)) call reader%read_values('/event_time', time, error)
    if (.not. allocated(error)) call reader%read_values('/event_v_before', before, error)
    if (.not. allocated(error)) call reader%read_values('/event_v_after', after, error)
    if (allocated(error)) return
    points = size(time)
    do i = 1, size(time)
      if (i > 1) then
        if (time(i) < time(i - 1)) call fail(error, exit_io, "'"//reader%path//"': event "//to_text(i - 1)// &
                                             ' comes before the one before it')
      end if
      if (nint(kinds_of_event(i)) <= 2 .and. (before(i)*after(i) > 0 .or. abs(after(i)) > abs(before(i)))) then
        call fail(error, exit_io, "'"//reader%path//"': impact "//to_text(i - 1)//' does not reverse the velocity')
      end if
      if (allocated(error)) return
    end do
  end subroutine check_events

  subroutine check_points(reader, points, error)
    type(reader_t), intent(in) :: reader
    integer(int64), intent(out) :: points
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: reason(:), impacts(:), speed(:)
    integer :: i
    points = 0
    call reader%read_values('/reason', reason, error)
    if (.not. allocated(error)) call reader%read_values('/impacts', impacts, error)
    if (.not. allocated(error)) call reader%read_values('/last_impact_speed', speed, error)
    if (allocated(error)) return
    points = size(reason)
    do i = 1, size(reason)
      if (nint(reason(i)) <= reason_not_run .or. nint(reason(i)) > last_reason) then
        call fail(error, exit_io, "'"//reader%path//"', point "//to_text(i - 1)//': reason code '//to_text(nint(reason(i))))
      end if
      if (.not. allocated(error) .and. (speed(i) < 0 .or. (speed(i) > 0 .and. impacts(i) < 1))) call fail(error, exit_io, &
        "'"//reader%path//"', point "//to_text(i - 1)//': '//to_text(nint(impacts(i)))//' impacts, last at '// &
        to_text(speed(i))//' m/s')
      if (allocated(error)) return
    end do
  end subroutine check_points

end module map_invariants
