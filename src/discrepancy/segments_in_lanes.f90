! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Segments of one body, and those of its neighbours, many at once: machine by machine the segments are in lanes. What a lane
!> leaves to the event loop flies there with all its neighbours.
module segments_in_lanes
  use contact_law, only: barrier_positions
  use kinds, only: wp
  use lane_preparation, only: prepare_lanes
  use lane_sampling, only: can_sample, sample_in_lanes, sampled_t
  use lane_types, only: lane_flow_t
  use motion, only: motion_t, start_state
  use motion_state, only: state_t
  use segment_flight, only: add_differences, differentiate_sensor, flight_t, grazes, moved_start, start_allowed, untouched
  use variants, only: family_t, variant_t
  implicit none
  private

  public :: fly_base_in_lanes, differentiate_in_lanes

  !> Drive periods of a segment for lanes: their clock starts anew at no section.
  real(wp), parameter :: most_periods = 8

  !> Segments in lanes: which flew there, their flights, and whether they are steady.
  type, public :: lane_segments_t
    logical, allocatable :: flown(:), steady(:)
    type(flight_t), allocatable :: base(:)
  end type lane_segments_t

  !> The work on one direction: which segments ask for a neighbour, the starts of those, which samples are open.
  type :: direction_t
    logical, allocatable :: asked(:), open(:)
    real(wp), allocatable :: start(:, :), step(:)
    type(flight_t), allocatable :: other(:)
  end type direction_t

contains

  !> Flies what lanes can take of the segments of a family, see `propagate`.
  pure subroutine fly_base_in_lanes(family, start, first, times, lanes)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    type(lane_segments_t), intent(out) :: lanes
    integer :: i
    allocate (lanes%flown(size(start, 2)), lanes%steady(size(start, 2)))
    allocate (lanes%base(size(start, 2)))
    do i = 1, size(start, 2)
      lanes%flown(i) = start_allowed(family%moving, start(:, i))
      if (first(i + 1) > first(i)) lanes%flown(i) = lanes%flown(i) .and. &
        times(first(i + 1)) <= most_periods*family%moving%machine%period
    end do
    call fly(family%moving, start, first, times, lanes%flown, lanes%base)
    lanes%steady = lanes%flown
  end subroutine fly_base_in_lanes

  !> Flies the segments that are `asked` for; those that lanes leave are not any more.
  pure subroutine fly(moving, start, first, times, asked, flights)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(inout) :: asked(:)
    type(flight_t), intent(inout) :: flights(:)
    type(lane_flow_t) :: flow
    type(sampled_t), allocatable :: sampled(:)
    type(state_t), allocatable :: states(:)
    integer, allocatable :: which(:), offset(:)
    real(wp), allocatable :: instants(:)
    integer :: i, k
    if (.not. any(asked)) return
    flow%width = moving%options%lane_width
    flow%gpu = moving%options%gpu
    if (flow%width > 0) call prepare_lanes(moving, flow)
    asked = asked .and. can_sample(flow)
    which = pack([(i, i=1, size(asked))], asked)
    if (size(which) == 0) return
    allocate (states(size(which)), sampled(size(which)), offset(size(which) + 1))
    offset(1) = 0
    do k = 1, size(which)
      associate (from => start(:, which(k)), machine => moving%machine)
        states(k) = start_state(moving, from(1), from(2), from(3) - machine%drive_frequency*machine%sensor%delay)
      end associate
      offset(k + 1) = offset(k) + first(which(k) + 1) - first(which(k))
    end do
    allocate (instants(offset(size(which) + 1)))
    do k = 1, size(which)
      instants(offset(k) + 1:offset(k + 1)) = times(first(which(k)) + 1:first(which(k) + 1))
    end do
    call sample_in_lanes(flow, states, offset, instants, sampled)
    do k = 1, size(which)
      asked(which(k)) = sampled(k)%flown
      if (sampled(k)%flown) call describe(moving, states(k), sampled(k), flights(which(k)))
    end do
  end subroutine fly

  !> A flight as segments have it.
  pure subroutine describe(moving, state, sampled, flight)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    type(sampled_t), intent(in) :: sampled
    type(flight_t), intent(inout) :: flight
    real(wp) :: barriers(2)
    flight%reason = 0
    flight%origin = state%time
    flight%count = sampled%impacts
    flight%impact = sampled%impact(:, :sampled%impacts)
    flight%impact(1, :) = flight%impact(1, :) - state%time
    flight%x = sampled%x
    flight%v = sampled%v
    flight%grazing_margin = sampled%grazing_margin
    flight%x_max = maxval([state%x, sampled%x])
    flight%x_min = minval([state%x, sampled%x])
    ! Between samples a body turns round no nearer to a barrier than that.
    barriers = barrier_positions(moving%machine%contact)
    associate (margin => sampled%grazing_margin)
      if (barriers(1) < huge(margin)) flight%x_max = max(flight%x_max, barriers(1) - margin)
      if (barriers(2) > -huge(margin)) flight%x_min = min(flight%x_min, barriers(2) + margin)
    end associate
  end subroutine describe

  !> Derivatives of the samples of all segments in lanes by differences, as `differentiate` of module `segments`. A segment with a
  !> neighbour that lanes leave is in them no more.
  pure subroutine differentiate_in_lanes(family, start, first, times, lanes, x_slope, v_slope)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    type(lane_segments_t), intent(inout) :: lanes
    real(wp), intent(inout) :: x_slope(:, :), v_slope(:, :)
    type(direction_t) :: along
    integer :: i, row
    allocate (along%other(size(start, 2)), along%step(size(start, 2)))
    do i = 1, size(start, 2)
      lanes%steady(i) = lanes%flown(i)
      if (lanes%flown(i)) lanes%steady(i) = .not. grazes(family, lanes%base(i))
    end do
    x_slope = 0
    v_slope = 0
    do row = 1, size(family%further) + 3
      if (.not. any(lanes%flown)) return
      call differentiate_along(family, row, start, first, times, lanes, along, x_slope(row, :), v_slope(row, :))
    end do
    do i = 1, size(start, 2)
      associate (from => first(i) + 1, to => first(i + 1))
        if (lanes%flown(i)) call differentiate_sensor(family, lanes%base(i), x_slope(:, from:to), v_slope(:, from:to))
      end associate
    end do
  end subroutine differentiate_in_lanes

  !> Derivatives along one direction, or by one coordinate of the start.
  pure subroutine differentiate_along(family, row, start, first, times, lanes, along, x_slope, v_slope)
    type(family_t), intent(in) :: family
    integer, intent(in) :: row, first(:)
    real(wp), intent(in) :: start(:, :), times(:)
    type(lane_segments_t), intent(inout) :: lanes
    type(direction_t), intent(inout) :: along
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    logical :: wanted(size(start, 2)), skipped(size(start, 2))
    integer :: i, turn
    along%open = spread(.true., 1, size(times))
    skipped = .false.
    if (row <= size(family%further)) then
      if (.not. abs(family%further(row)%step) > 0) return
      skipped = [(untouched(family%moving, family%further(row), lanes%base(i)), i=1, size(start, 2))]
    end if
    do turn = 1, 2
      wanted = [(lanes%flown(i) .and. .not. skipped(i) .and. any(along%open(first(i) + 1:first(i + 1))), i=1, size(start, 2))]
      call fly_neighbours(family, row, turn, start, first, times, wanted, along)
      lanes%flown = lanes%flown .and. (.not. wanted .or. along%asked)
      do i = 1, size(start, 2)
        associate (from => first(i) + 1, to => first(i + 1))
          if (wanted(i) .and. along%asked(i)) call add_differences(lanes%base(i), along%other(i), along%step(i), times(from:to), &
            along%open(from:to), x_slope(from:to), v_slope(from:to), lanes%steady(i))
        end associate
      end do
    end do
    do i = 1, size(start, 2)
      if (.not. skipped(i) .and. any(along%open(first(i) + 1:first(i + 1)))) lanes%steady(i) = .false.
    end do
  end subroutine differentiate_along

  !> Flies the neighbours of `wanted` segments a step forth (`turn` 1) or back (2); where there is none, none is wanted.
  pure subroutine fly_neighbours(family, row, turn, start, first, times, wanted, along)
    type(family_t), intent(in) :: family
    integer, intent(in) :: row, turn, first(:)
    real(wp), intent(in) :: start(:, :), times(:)
    logical, intent(inout) :: wanted(:)
    type(direction_t), intent(inout) :: along
    integer :: i, k
    along%start = start
    k = row - size(family%further)
    if (k > 0) then
      do i = 1, size(start, 2)
        along%start(:, i) = moved_start(family, start(:, i), k, turn)
        along%step(i) = along%start(k, i) - start(k, i)
        wanted(i) = wanted(i) .and. start_allowed(family%moving, along%start(:, i)) .and. abs(along%step(i)) > 0
      end do
      along%asked = wanted
      call fly(family%moving, along%start, first, times, along%asked, along%other)
    else if (turn == 1) then
      call fly_variant(family%further(row), first, times, wanted, along)
    else
      call fly_variant(family%back(row), first, times, wanted, along)
    end if
  end subroutine fly_neighbours

  pure subroutine fly_variant(variant, first, times, wanted, along)
    type(variant_t), intent(in) :: variant
    integer, intent(in) :: first(:)
    real(wp), intent(in) :: times(:)
    logical, intent(inout) :: wanted(:)
    type(direction_t), intent(inout) :: along
    integer :: i
    along%step = variant%step
    wanted = wanted .and. abs(variant%step) > 0
    along%asked = wanted
    if (.not. any(wanted)) return
    ! A start beyond the neighbour's own barrier: the event loop has the reason.
    do i = 1, size(wanted)
      if (wanted(i)) along%asked(i) = start_allowed(variant%moving, along%start(:, i))
    end do
    call fly(variant%moving, along%start, first, times, along%asked, along%other)
  end subroutine fly_variant

end module segments_in_lanes
