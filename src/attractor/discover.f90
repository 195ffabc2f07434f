! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogue of attractors of one machine from a sample of starts. Serial and in a fixed order; frozen
!> before any trajectory of a map is labelled.
module discover
  use attractors, only: attractor_t, features_t, find_box, find_capture, longest_period, most_coordinates
  use cycle, only: refine_cycle
  use kinds, only: int64, wp
  use motion, only: motion_t
  use motion_state, only: reset_tally, tally_t
  use strobe, only: advance_strobe_period, coordinates_of, features_over, has_section, rest_lasts, scales_of, section_point, &
    section_state, start_strobe, strobe_t, without_stops
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
    type(strobe_t) :: strobe
    type(attractor_t) :: found
    real(wp) :: patience
    integer :: i, regime
    logical :: known, ok
    if (.not. allocated(catalogue)) allocate (catalogue(0))
    if (.not. has_section(moving)) return
    do i = 1, size(starts, 2)
      strobe = start_strobe(moving, starts(:, i))
      patience = span%duration
      do
        call settle(moving, catalogue, patience, strobe, regime, known, ok)
        if (known .or. .not. ok) exit
        call recognise(moving, strobe, min(max_period, longest_period), found, ok)
        if (ok) then
          if (.not. holds(catalogue, found)) catalogue = [catalogue, found]
          exit
        end if
        if (find_box(catalogue, section_point(moving, strobe), regime) > 0) exit
        if (2*patience > span%extension*span%duration) then
          call add_aperiodic(moving, strobe, catalogue)
          exit
        end if
        patience = 2*patience
      end do
    end do
  end subroutine discover_attractors

  !> Whether a catalogue has an attractor already, found again from a start that was not captured in time.
  pure logical function holds(catalogue, found)
    type(attractor_t), intent(in) :: catalogue(:), found
    if (found%any_place) then
      holds = find_box(catalogue, [0.0_wp, found%points(:, 1)], found%features%regime) > 0
    else
      holds = find_capture(catalogue, found%points(:, 1), .not. found%rests) > 0
    end if
  end function holds

  !> Runs for `patience` [s] unless captured before; `regime` is that of the run.
  pure subroutine settle(moving, catalogue, patience, strobe, regime, known, ok)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: patience
    type(strobe_t), intent(inout) :: strobe
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
    call reset_tally(tally, strobe%state, allocated(moving%pair))
    do i = 1, max(1, ceiling(patience/moving%machine%period))
      slips = tally%slips
      whole = .not. strobe%state%time > 0 .and. rest_lasts(moving)
      call advance_strobe_period(moving, strobe, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      known = find_capture(catalogue, section_point(moving, strobe), .not. whole .or. tally%slips > slips) > 0
      if (known) return
    end do
    features = features_over(moving, tally, 1.0_wp)
    regime = features%regime
  end subroutine settle

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine recognise(moving, strobe, max_period, found, ok)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: strobe
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    type(strobe_t) :: later
    type(tally_t) :: tally
    real(wp) :: points(most_coordinates, 0:2*longest_period)
    type(motion_t) :: free
    integer :: i, p, reason, n, first
    later = strobe
    call reset_tally(tally, later%state, allocated(moving%pair))
    points(:, 0) = section_point(moving, later)
    do i = 1, 2*max_period
      call advance_strobe_period(moving, later, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      points(:, i) = section_point(moving, later)
    end do
    n = coordinates_of(moving)
    if (tally%slips == 0) then
      found%rests = .true.
      found%period = 1
      found%points(:, 1) = points(:, 0)
      found%coordinates = n
      found%features = features_over(moving, tally, real(2*max_period, wp))
      found%features%v_max = 0
      found%section = section_state(moving, points(:, 0))
      return
    end if
    first = 1
    call without_stops(moving, free, ok)
    ok = ok .and. tally%impacts == 0
    if (ok) first = 2
    associate (sizes => scales_of(moving, (tally%x_max - tally%x_min)/2))
      do p = 1, max_period
        if (.not. returns(points(first:n, :2*max_period), p, sizes(first:n))) cycle
        if (first == 1) then
          call refine_cycle(moving, points(:n, 2*max_period), p, found, ok)
          if (ok) found%section = section_state(moving, found%points(:, 1))
        else
          call refine_cycle(free, points(first:n, 2*max_period), p, found, ok)
          found%any_place = .true.
          if (ok) found%section = section_state(moving, [points(1, 2*max_period), found%points(:, 1)])
        end if
        if (ok) return
      end do
    end associate
    ok = .false.
  end subroutine recognise

  !> Whether every one of a run of section points comes back after `p` periods.
  pure logical function returns(points, p, size_of_motion)
    real(wp), intent(in) :: points(:, 0:), size_of_motion(:)
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
  pure subroutine add_aperiodic(moving, strobe, catalogue)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: strobe
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    type(attractor_t) :: found
    type(strobe_t) :: later
    type(tally_t) :: tally
    integer :: i, k, reason
    later = strobe
    tally%wants_v_max = .true.
    call reset_tally(tally, later%state, allocated(moving%pair))
    found%coordinates = coordinates_of(moving)
    found%points(:, 1) = section_point(moving, later)
    found%points(:, 2) = found%points(:, 1)
    do i = 1, box_periods
      call advance_strobe_period(moving, later, tally, reason)
      if (reason /= 0) return
      found%points(:, 1) = min(found%points(:, 1), section_point(moving, later))
      found%points(:, 2) = max(found%points(:, 2), section_point(moving, later))
    end do
    found%features = features_over(moving, tally, real(box_periods, wp))
    found%features%word = 0
    found%multiplier = 1
    do k = 1, size(catalogue)
      if (catalogue(k)%period /= 0 .or. catalogue(k)%features%regime /= found%features%regime) cycle
      if (all(found%points(:, 1) <= catalogue(k)%points(:, 2) .and. &
              found%points(:, 2) >= catalogue(k)%points(:, 1))) then
        catalogue(k)%points(:, 1) = min(catalogue(k)%points(:, 1), found%points(:, 1))
        catalogue(k)%points(:, 2) = max(catalogue(k)%points(:, 2), found%points(:, 2))
        catalogue(k)%section = section_state(moving, catalogue(k)%points(:, 1))
        return
      end if
    end do
    found%section = section_state(moving, found%points(:, 1))
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
