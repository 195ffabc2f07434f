! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogue of attractors of one machine from a sample of starts. Serial and in a fixed order; frozen
!> before any trajectory of a map is labelled.
module discover
  use attractors, only: attractor_t, features_t, find_box, find_capture, longest_period, regime_of
  use cycle, only: refine_cycle
  use kinds, only: int64, wp
  use motion, only: advance_period, motion_t, start_state
  use motion_state, only: reset_tally, state_t, tally_t
  use trajectory, only: span_t
  implicit none
  private

  public :: discover_attractors, sort_attractors

  !> Relative distance at which a section point counts as a return to an earlier one.
  real(wp), parameter :: return_tolerance = 0.05_wp
  !> Drive periods over which the box of a motion that is not periodic is taken.
  integer, parameter :: box_periods = 512

contains

  !> Adds to `catalogue` what `starts` (rows x [m], v [m/s], crank angle [rad]) lead to and it does not yet hold.
  !> Cycles up to `max_period` drive periods are looked for after one, two, four ... durations.
  pure subroutine discover_attractors(moving, span, starts, max_period, catalogue)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: max_period
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    type(state_t) :: state
    type(attractor_t) :: found
    real(wp) :: patience
    integer :: i, regime
    logical :: known, ok
    if (.not. allocated(catalogue)) allocate (catalogue(0))
    if (allocated(moving%pair)) return
    do i = 1, size(starts, 2)
      state = start_state(moving, starts(1, i), starts(2, i), starts(3, i))
      patience = span%duration
      do
        call settle(moving, catalogue, patience, state, regime, known, ok)
        if (known .or. .not. ok) exit
        call recognise(moving, state, min(max_period, longest_period), found, ok)
        if (ok) then
          if (.not. holds(catalogue, found)) catalogue = [catalogue, found]
          exit
        end if
        if (find_box(catalogue, state, regime) > 0) exit
        if (2*patience > span%extension*span%duration) then
          call add_aperiodic(moving, state, catalogue)
          exit
        end if
        patience = 2*patience
      end do
    end do
  end subroutine discover_attractors

  !> Whether a catalogue has an attractor already, found again from a start that was not captured in time.
  pure logical function holds(catalogue, found)
    type(attractor_t), intent(in) :: catalogue(:), found
    type(state_t) :: state
    state%x = found%points(1, 1)
    state%v = found%points(2, 1)
    holds = find_capture(catalogue, state, .not. found%rests) > 0
  end function holds

  !> Runs for `patience` [s] unless captured before; `regime` is that of the run.
  pure subroutine settle(moving, catalogue, patience, state, regime, known, ok)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: patience
    type(state_t), intent(inout) :: state
    integer, intent(out) :: regime
    logical, intent(out) :: known, ok
    type(tally_t) :: tally
    type(features_t) :: features
    integer(int64) :: slips
    integer :: i, reason
    logical :: whole
    known = .false.
    ok = .true.
    regime = 0
    call reset_tally(tally, state)
    do i = 1, max(1, ceiling(patience/moving%machine%period))
      slips = tally%slips
      whole = .not. state%time > 0
      call advance_period(moving, state, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      known = find_capture(catalogue, state, .not. whole .or. tally%slips > slips) > 0
      if (known) return
    end do
    features = regime_of(tally, 1.0_wp)
    regime = features%regime
  end subroutine settle

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine recognise(moving, state, max_period, found, ok)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    type(state_t) :: later
    type(tally_t) :: tally
    real(wp) :: points(2, 0:2*longest_period), size_of_motion(2)
    integer :: i, p, reason
    later = state
    call reset_tally(tally, later)
    points(:, 0) = [later%x, later%v]
    do i = 1, 2*max_period
      call advance_period(moving, later, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      points(:, i) = [later%x, later%v]
    end do
    if (tally%slips == 0) then
      found%rests = .true.
      found%period = 1
      found%points(:, 1) = points(:, 0)
      found%features = regime_of(tally, real(2*max_period, wp))
      found%features%v_max = 0
      return
    end if
    size_of_motion = (tally%x_max - tally%x_min)/2*[1.0_wp, moving%machine%drive_frequency]
    do p = 1, max_period
      if (.not. returns(points(:, :2*max_period), p, size_of_motion)) cycle
      call refine_cycle(moving, points(:, 2*max_period), p, found, ok)
      if (ok) return
    end do
    ok = .false.
  end subroutine recognise

  !> Whether every one of a run of section points comes back after `p` periods.
  pure logical function returns(points, p, size_of_motion)
    real(wp), intent(in) :: points(:, 0:), size_of_motion(2)
    integer, intent(in) :: p
    integer :: i
    returns = .false.
    do i = 0, ubound(points, 2) - p
      if (norm2((points(:, i + p) - points(:, i))/size_of_motion) > return_tolerance) return
    end do
    returns = .true.
  end function returns

  !> A motion that is not periodic: the box of its section points and its features over many periods. One of the
  !> same regime whose box meets it is widened instead.
  pure subroutine add_aperiodic(moving, state, catalogue)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    type(attractor_t) :: found
    type(state_t) :: later
    type(tally_t) :: tally
    integer :: i, k, reason
    later = state
    tally%wants_v_max = .true.
    call reset_tally(tally, later)
    found%points(:, 1) = [later%x, later%v]
    found%points(:, 2) = found%points(:, 1)
    do i = 1, box_periods
      call advance_period(moving, later, tally, reason)
      if (reason /= 0) return
      found%points(:, 1) = min(found%points(:, 1), [later%x, later%v])
      found%points(:, 2) = max(found%points(:, 2), [later%x, later%v])
    end do
    found%features = regime_of(tally, real(box_periods, wp))
    found%features%word = 0
    found%multiplier = 1
    do k = 1, size(catalogue)
      if (catalogue(k)%period /= 0 .or. catalogue(k)%features%regime /= found%features%regime) cycle
      if (all(found%points(:, 1) <= catalogue(k)%points(:, 2) .and. &
              found%points(:, 2) >= catalogue(k)%points(:, 1))) then
        catalogue(k)%points(:, 1) = min(catalogue(k)%points(:, 1), found%points(:, 1))
        catalogue(k)%points(:, 2) = max(catalogue(k)%points(:, 2), found%points(:, 2))
        return
      end if
    end do
    catalogue = [catalogue, found]
  end subroutine add_aperiodic

  !> Orders a catalogue by regime, period and position and numbers it from 1.
  pure subroutine sort_attractors(catalogue)
    type(attractor_t), intent(inout) :: catalogue(:)
    type(attractor_t) :: moved
    integer :: i, k
    do i = 2, size(catalogue)
      moved = catalogue(i)
      k = i - 1
      do while (k >= 1)
        if (.not. before(moved, catalogue(k))) exit
        catalogue(k + 1) = catalogue(k)
        k = k - 1
      end do
      catalogue(k + 1) = moved
    end do
    do i = 1, size(catalogue)
      catalogue(i)%id = i
    end do
  end subroutine sort_attractors

  pure logical function before(a, b)
    type(attractor_t), intent(in) :: a, b
    if (a%features%regime /= b%features%regime) then
      before = a%features%regime < b%features%regime
    else if (a%period /= b%period) then
      before = a%period < b%period
    else
      before = a%points(1, 1) < b%points(1, 1)
    end if
  end function before

end module discover
