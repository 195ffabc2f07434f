! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogue of attractors of one machine from a sample of starts. Serial and in a fixed order; frozen
!> before any trajectory of a map is labelled.
module discover
  use aperiodic, only: add_aperiodic, meets_chaos, outlast, find_family, watch_long
  use attractors, only: attractor_t, find_box, find_capture, kind_chaotic, kind_not_known, kind_rest, longest_period, &
    make_points, most_coordinates, regime_at_rest, regime_non_impact
  use capture, only: attractor_reached, attractor_reached_at
  use circle, only: point_near
  use cycle, only: refine_cycle
  use section_map, only: map_point
  use exact_return, only: exact_cycle, returns_t, watch_returns
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: solve
  use motion_features, only: cycle_word, features_over
  use motion_state, only: tally_t
  use single_trajectory, only: span_t
  use crank_rests, only: add_crank_rest
  use wide_capture, only: widen
  implicit none
  private

  public :: discover_attractors, sort_attractors

  !> Relative distance at which a section point counts as a return to an earlier one.
  real(wp), parameter :: return_tolerance = 0.05_wp

  !> What a segment of a motion showed: its regime and amplitude [m], whether it converged, was given up, or came back exactly.
  type :: segment_t
    integer :: regime = 0
    real(wp) :: amplitude = 0
    logical :: known = .false., ok = .true.
    type(returns_t) :: returns
  end type segment_t

contains

  !> Adds to `catalogue` what `starts` (rows x [m], v [m/s], crank angle [rad]) lead to and it does not yet hold.
  !> Cycles up to `max_period` drive periods are looked for after one, two, four ... durations, those that come back to the bit
  !> whatever their period. `within_span`: a motion that has converged to nothing by the end of the extension is left out; it is
  !> not watched over the thousands of periods that distinguish chaos from a long transient.
  pure subroutine discover_attractors(moving, span, starts, max_period, catalogue, within_span)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: max_period
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    logical, intent(in), optional :: within_span
    type(section_state_t) :: section
    type(attractor_t) :: found
    type(segment_t) :: segment
    real(wp) :: patience
    integer :: i
    logical :: ok, longer
    longer = .true.
    if (present(within_span)) longer = .not. within_span
    if (.not. allocated(catalogue)) allocate (catalogue(0))
    if (.not. moving%has_section) return
    do i = 1, size(starts, 2)
      section = moving%start(starts(:, i))
      patience = span%duration
      do
        call settle(moving, catalogue, patience, section, segment)
        if (.not. segment%ok) call add_crank_rest(moving, section, catalogue)
        if (segment%known .or. .not. segment%ok) exit
        call identify(moving, section, segment%returns, max_period, found, ok)
        if (ok) then
          call add(moving, found, catalogue)
          exit
        end if
        if (find_box(catalogue, moving%point_of(section), segment%regime) > 0) exit
        if (2*patience > span%extension*span%duration) then
          call look_longer(moving, max_period, longer, segment, section, catalogue)
          exit
        end if
        patience = 2*patience
      end do
    end do
  end subroutine discover_attractors

  !> Adds an attractor that a catalogue does not hold yet.
  pure subroutine add(moving, found, catalogue)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: found
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    if (holds(moving, catalogue, found)) return
    call widen(moving, found)
    catalogue = [catalogue, found]
  end subroutine add

  !> The end of patience: the motion without impact of a linear oscillator is known without it; any other is watched for a fixed
  !> number of periods more if it may take `longer`, and if it has come to no cycle then, it is not periodic, or not known.
  pure subroutine look_longer(moving, max_period, longer, segment, section, catalogue)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: max_period
    logical, intent(in) :: longer
    type(segment_t), intent(in) :: segment
    type(section_state_t), intent(inout) :: section
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    type(attractor_t) :: found, cycle_found
    type(returns_t) :: returns
    logical :: known, ok, lasts, forgets
    if (moving%linear .and. segment%regime == regime_non_impact) then
      call motion_without_impact(moving, found, ok)
      if (ok) then
        call add(moving, found, catalogue)
        return
      end if
    end if
    if (.not. longer) return
    lasts = .false.
    forgets = .false.
    do
      call watch_long(moving, catalogue, segment%amplitude, section, found, returns, known, ok)
      if (known .or. .not. ok) return
      call identify(moving, section, returns, max_period, cycle_found, ok)
      if (ok) then
        call add(moving, cycle_found, catalogue)
        return
      end if
      if (moving%has_clock) call find_family(moving, section, segment%amplitude, min(max_period, longest_period), found)
      if (lasts .or. found%kind /= kind_chaotic .or. meets_chaos(catalogue, found)) exit
      call outlast(moving, catalogue, section, returns, known, forgets, ok)
      if (known .or. .not. ok) return
      lasts = .true.
    end do
    if (forgets .and. found%kind == kind_chaotic) found%kind = kind_not_known
    call add_aperiodic(moving, found, catalogue)
  end subroutine look_longer

  !> The one motion without impact of a linear damped oscillator, if it stays clear of the barriers: its map is linear, so that
  !> the images of three points give it.
  pure subroutine motion_without_impact(moving, found, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    class(machine_t), allocatable :: free
    type(tally_t) :: tally
    real(wp) :: origin(2), image(2), columns(2, 2), point(2), unit(2), scale(2)
    integer :: k
    call moving%without_stops(free, k)
    scale = [1.0_wp, moving%drive_frequency]
    call map_point(free, [0.0_wp, 0.0_wp], 1, origin, tally, ok)
    do k = 1, 2
      unit = 0
      unit(k) = scale(k)
      if (ok) call map_point(free, unit, 1, image, tally, ok)
      columns(:, k) = -(image - origin)/scale(k)
      columns(k, k) = columns(k, k) + 1
    end do
    if (ok) call solve(columns, origin, point, ok)
    if (ok) call map_point(free, point, 1, image, tally, ok)
    if (ok) ok = tally%x_max < moving%upper .and. tally%x_min > moving%lower
    if (ok) call refine_cycle(moving, point, 1, found, ok)
    if (ok) found%section = moving%watched_at(found%points(:, 1))
  end subroutine motion_without_impact

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine identify(moving, section, returns, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    type(returns_t), intent(in) :: returns
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    ok = .false.
    if (returns%period > 0 .and. returns%chattered) call exact_cycle(moving, section, returns%period, found, ok)
    if (.not. ok) call recognise(moving, section, min(max_period, longest_period), found, ok)
    if (.not. ok .and. returns%period > 0) call exact_cycle(moving, section, returns%period, found, ok)
    if (.not. moving%undriven) return
    if (ok) then
      call take_as_one_point(moving, found)
      call find_equilibrium(found)
    else
      call recognise_equilibrium(moving, section, found, ok)
      if (.not. ok .and. .not. moving%has_clock) then
        call recognise_by_event(moving, section, min(max_period, longest_period), found, ok)
      end if
    end if
  end subroutine identify

  !> The equilibrium that a state approaches: what is left of its motion shrinks with the motion, and never looks like a return.
  pure subroutine recognise_equilibrium(moving, section, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    real(wp) :: point(most_coordinates)
    point = moving%point_of(section)
    call refine_cycle(moving, point(:moving%coordinates()), 1, found, ok)
    if (.not. ok) return
    found%section = moving%watched_at(found%points(:, 1))
    call find_equilibrium(found)
    ok = found%kind == kind_rest .and. find_capture([found], point, .true.) > 0
  end subroutine recognise_equilibrium

  !> Rest that nothing but the springs decides is one point, which attracts from all around, not a set held by friction.
  pure subroutine take_as_one_point(moving, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: found
    type(attractor_t) :: point
    logical :: ok
    if (.not. found%rests) return
    call refine_cycle(moving, found%points(:found%coordinates, 1), 1, point, ok)
    if (.not. ok) return
    point%section = found%section
    found = point
  end subroutine take_as_one_point

  !> A motion that does not change from one time to any later one: an equilibrium.
  pure subroutine find_equilibrium(found)
    type(attractor_t), intent(inout) :: found
    if (found%rests .or. found%features%amplitude > 1e-9_wp*found%scale(1)) return
    found%kind = kind_rest
    found%duration = 0
    associate (f => found%features)
      f%regime = regime_at_rest
      f%x_max = found%section(1)
      f%x_min = f%x_max
      f%amplitude = 0
      f%v_max = 0
    end associate
  end subroutine find_equilibrium

  !> The limit cycle of a machine without a clock at which a settled state is, by its returns to where it turns round.
  pure subroutine recognise_by_event(moving, section, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    class(machine_t), allocatable :: turning
    type(section_state_t) :: later
    type(tally_t) :: unused
    integer :: reason
    allocate (turning, source=moving)
    turning%by_event = .true.
    later = section
    call turning%advance_to_section(later, unused, reason)
    ok = reason == 0
    if (ok) call recognise(turning, later, max_period, found, ok)
    ! What turns round by rounding alone is on no cycle, nor is what creeps into rest where forces jump.
    if (ok) ok = found%features%amplitude > max(1e-9_wp*max(abs(found%features%x_max), abs(found%features%x_min)), &
                                                1e-4_wp*moving%smallest_motion)
  end subroutine recognise_by_event

  !> Whether a catalogue has an attractor already, found again from a start that did not converge in time.
  pure logical function holds(moving, catalogue, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:), found
    if (found%any_position) then
      holds = find_box(catalogue, [spread(0.0_wp, 1, found%positions), found%points(:, 1)], found%features%regime) > 0
    else if (found%by_event) then
      holds = find_capture(catalogue, found%points(:, 1), .true., by_event=.true.) > 0
    else
      holds = attractor_reached_at(moving, catalogue, found%points(:, 1), .not. found%rests) > 0
    end if
  end function holds

  !> Runs for `patience` [s] unless it converges before, or is back at a state from which a completed chatter has led to it again.
  pure subroutine settle(moving, catalogue, patience, section, segment)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: patience
    type(section_state_t), intent(inout) :: section
    type(segment_t), intent(out) :: segment
    type(tally_t) :: tally
    integer(int64) :: slips
    integer :: i, reason
    logical :: whole
    call moving%begin_tally(section, tally)
    do i = 1, max(1, ceiling(patience/moving%period))
      slips = tally%slips
      whole = .not. section%state%time > 0 .and. moving%rest_lasts
      call moving%advance_to_section(section, tally, reason)
      segment%ok = reason == 0
      if (.not. segment%ok) return
      segment%known = attractor_reached(moving, catalogue, section, .not. whole .or. tally%slips > slips) > 0
      if (segment%known) return
      call watch_returns(moving, section, tally%chatters, segment%returns)
      if (segment%returns%period > 0 .and. segment%returns%chattered) exit
    end do
    associate (features => features_over(moving, tally, 1.0_wp))
      segment%regime = features%regime
      segment%amplitude = features%amplitude
    end associate
  end subroutine settle

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine recognise(moving, section, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    type(section_state_t) :: later
    type(tally_t) :: tally
    real(wp) :: points(most_coordinates, 0:2*longest_period)
    class(machine_t), allocatable :: free
    integer :: i, p, reason, n, first, positions
    later = section
    call moving%begin_tally(later, tally)
    points(:, 0) = moving%point_of(later)
    do i = 1, 2*max_period
      call moving%advance_to_section(later, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      points(:, i) = moving%point_of(later)
    end do
    n = moving%coordinates()
    if (tally%slips == 0) then
      found%rests = .true.
      found%kind = kind_rest
      found%period = 1
      found%coordinates = n
      call make_points(found, 1)
      found%points(:, 1) = points(:, 0)
      found%turn = moving%turn
      found%features = features_over(moving, tally, real(2*max_period, wp))
      found%features%v_max = 0
      found%features%word = cycle_word(moving, section, 1)
      found%section = moving%watched_at(points(:, 0))
      return
    end if
    positions = 0
    if (tally%impacts == 0) call moving%without_stops(free, positions)
    first = positions + 1
    associate (sizes => moving%scales((tally%x_max - tally%x_min)/2))
      do p = 1, max_period
        if (.not. returns(points(first:n, :2*max_period), p, sizes(first:n), moving%turn_on_section())) cycle
        if (positions == 0) then
          call refine_cycle(moving, points(:n, 2*max_period), p, found, ok)
          if (ok) found%section = moving%watched_at(found%points(:, 1))
        else
          call refine_cycle(free, points(first:n, 2*max_period), p, found, ok)
          found%any_position = .true.
          found%positions = positions
          if (ok) ok = comes_back(moving, free, found)
          if (ok) found%section = moving%watched_at([points(:positions, 2*max_period), found%points(:, 1)])
        end if
        if (ok) return
      end do
    end associate
    ok = .false.
  end subroutine recognise

  !> Whether a cycle of the machine without stops ends at the position where it began: else it drifts towards a stop.
  pure logical function comes_back(moving, free, cycle)
    class(machine_t), intent(in) :: moving, free
    type(attractor_t), intent(in) :: cycle
    type(section_state_t) :: section
    type(tally_t) :: unused
    real(wp) :: before(most_coordinates), after(most_coordinates)
    integer :: i, reason
    section = free%state_at(cycle%points(:cycle%coordinates, 1))
    before = moving%point_of(section)
    do i = 1, cycle%period
      call free%advance_to_section(section, unused, reason)
    end do
    after = moving%point_of(section)
    comes_back = all(abs(after(:cycle%positions) - before(:cycle%positions)) <= 1e-9_wp*maxval(cycle%scale(:cycle%coordinates)))
  end function comes_back

  !> Whether every one of a run of section points comes back after `p` periods.
  pure logical function returns(points, p, size_of_motion, turn)
    real(wp), intent(in) :: points(:, 0:), size_of_motion(:), turn
    integer, intent(in) :: p
    integer :: i
    returns = .false.
    do i = 0, ubound(points, 2) - p
      if (norm2((point_near(points(:, i + p), points(:, i), turn) - points(:, i))/size_of_motion) > return_tolerance) return
    end do
    returns = .true.
  end function returns

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
