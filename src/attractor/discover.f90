! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Builds the catalogue of attractors of one machine from a sample of starts. Serial and in a fixed order; frozen
!> before any trajectory of a map is labelled.
module discover
  use aperiodic, only: add_aperiodic, meets_chaos, outlast, find_family, watch_long
  use attractors, only: attractor_t, find_box, find_capture, kind_chaotic, kind_not_known, longest_period, regime_non_impact
  use capture, only: attractor_reached, attractor_reached_at
  use exact_return, only: returns_t, watch_returns
  use identification, only: identify, motion_without_impact
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use motion_features, only: features_over
  use motion_state, only: tally_t
  use single_trajectory, only: span_t
  use crank_rests, only: add_crank_rest
  use wide_capture, only: widen
  implicit none
  private

  public :: discover_attractors, sort_attractors, is_given_up, most_not_known

  !> Entries of a catalogue that nobody knows what they are, and nothing else, after which no more starts are followed: where
  !> motions creep or neither gain nor lose energy, every start would add one.
  integer, parameter :: most_not_known = 8

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
  !> not watched over the thousands of periods that distinguish chaos from a long transient. A catalogue of
  !> `most_not_known` entries of which none is known gets no more.
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
      if (is_given_up(catalogue)) return
      call moving%start(starts(:, i), section)
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

  !> Whether a catalogue gets no more: nothing is known of its entries, and they are many.
  pure logical function is_given_up(catalogue)
    type(attractor_t), intent(in) :: catalogue(:)
    is_given_up = size(catalogue) >= most_not_known .and. all(catalogue%kind == kind_not_known)
  end function is_given_up

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
