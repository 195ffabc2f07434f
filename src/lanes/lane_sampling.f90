! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Flights of many bodies in lanes that are looked at on their way: position and velocity at given times, and every impact (the
!> kernel is C++: `lane_samples.hpp`).
module lane_sampling
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_count, lane_flow_t, lane_flying, lane_fresh, lane_stopped, impact_rows, &
    machine_t, most_impacts
  use lanes, only: occupy_lane, take_counts
  use motion_state, only: mode_slip_minus, mode_slip_plus, state_t, tally_t
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  implicit none
  private

  public :: can_sample, sample_in_lanes

  !> Flights, and steps of series, after which a body is left to the event loop.
  real(wp), parameter :: most_flights = 4000, most_steps = 20000

  !> A flight that was looked at.
  type, public :: sampled_t
    !> False: the event loop must fly it.
    logical :: flown = .false.
    real(wp), allocatable :: x(:), v(:)
    integer :: impacts = 0
    !> By impact: time [s, on the clock of the start], speeds before and after [m/s] (after a soft contact: when it ends, not a
    !> number if it lasts), +1 upper or -1 lower barrier.
    real(wp) :: impact(impact_rows, most_impacts) = 0
    !> Smallest distance to a barrier at a turning point that missed it [m].
    real(wp) :: grazing_margin = huge(1.0_wp)
  end type sampled_t

  interface
    pure subroutine separatrix_sample_lanes(width, machine, batch, most, count, times, taken, x, v, impacts, impact, &
                                              most_steps, steps) bind(c)
      import :: c_double, c_int, c_int64_t, impact_rows, lane_batch_t, lane_count, machine_t, most_impacts
      integer(c_int), value :: width
      type(machine_t), intent(in) :: machine
      type(lane_batch_t), intent(inout) :: batch
      integer(c_int64_t), value :: most
      integer(c_int64_t), intent(in) :: count(lane_count)
      real(c_double), intent(in) :: times(most, lane_count)
      integer(c_int64_t), intent(inout) :: taken(lane_count), impacts(lane_count)
      real(c_double), value :: most_steps
      real(c_double), intent(inout) :: x(most, lane_count), v(most, lane_count), impact(impact_rows, most_impacts, lane_count), &
        steps(lane_count)
    end subroutine separatrix_sample_lanes
  end interface

contains

  !> Whether flights of a machine can be looked at: not those of a structure, on a GPU, or through a thin Stribeck layer.
  pure logical function can_sample(flow)
    type(lane_flow_t), intent(in) :: flow
    can_sample = flow%available .and. flow%width > 0 .and. .not. allocated(flow%structure) .and. flow%gpu < 0 .and. &
      .not. flow%machine%layer%excess > 0
  end function can_sample

  !> Flies bodies from `start`; samples of body i are at `times(first(i) + 1:first(i + 1))` [s] behind its start, ascending from 0.
  pure subroutine sample_in_lanes(flow, start, first, times, sampled)
    type(lane_flow_t), intent(in) :: flow
    type(state_t), intent(in) :: start(:)
    integer, intent(in) :: first(:)
    real(wp), intent(in) :: times(:)
    type(sampled_t), intent(inout) :: sampled(:)
    integer :: i
    do i = 1, size(start), lane_count
      associate (last => min(i + lane_count - 1, size(start)))
        call sample_batch(flow, start(i:last), first(i:last + 1), times, sampled(i:last))
      end associate
    end do
  end subroutine sample_in_lanes

  !> The same for at most as many bodies as there are lanes.
  pure subroutine sample_batch(flow, start, first, times, sampled)
    type(lane_flow_t), intent(in) :: flow
    type(state_t), intent(in) :: start(:)
    integer, intent(in) :: first(:)
    real(wp), intent(in) :: times(:)
    type(sampled_t), intent(inout) :: sampled(:)
    type(lane_batch_t) :: batch
    type(tally_t) :: tally
    real(wp), allocatable :: at(:, :), x(:, :), v(:, :)
    real(wp) :: impact(impact_rows, most_impacts, lane_count), steps(lane_count)
    integer(c_int64_t), dimension(lane_count) :: count, taken, impacts
    integer :: lane, most
    most = max(1, maxval(first(2:) - first(:size(start))))
    allocate (at(most, lane_count), x(most, lane_count), v(most, lane_count))
    count = 0
    taken = 0
    impacts = 0
    steps = 0
    do lane = 1, size(start)
      associate (given => times(first(lane) + 1:first(lane + 1)))
        if (size(given) == 0 .or. .not. slips(start(lane))) cycle
        count(lane) = size(given)
        at(:size(given), lane) = start(lane)%time + given
        call occupy_lane(flow, lane, start(lane), .true., batch)
        batch%until(lane) = at(size(given), lane)
        batch%budget(lane) = most_flights
      end associate
    end do
    do while (any(batch%status >= lane_fresh .or. abs(batch%status - lane_flying) < 0.5_wp))
      call separatrix_sample_lanes(int(flow%width, c_int), flow%machine, batch, int(most, c_int64_t), count, at, taken, x, v, &
                                   impacts, impact, most_steps, steps)
    end do
    do lane = 1, size(start)
      associate (one => sampled(lane), n => int(count(lane)))
        one%flown = abs(batch%status(lane) - lane_stopped) < 0.5_wp .and. taken(lane) == count(lane) .and. &
          impacts(lane) <= most_impacts .or. first(lane + 1) == first(lane)
        if (.not. one%flown) cycle
        tally = tally_t()
        call take_counts(batch, lane, tally)
        one%grazing_margin = tally%grazing_margin
        one%x = x(:n, lane)
        one%v = v(:n, lane)
        ! A sample for which no root was found is not a number; the event loop has the reason of what leaves the domain.
        one%flown = all(abs(one%x) <= flow%machine%domain)
        one%impacts = int(impacts(lane))
        one%impact(:, :one%impacts) = impact(:, :one%impacts, lane)
      end associate
    end do
  end subroutine sample_batch

  pure logical function slips(state)
    type(state_t), intent(in) :: state
    slips = state%mode == mode_slip_plus .or. state%mode == mode_slip_minus
  end function slips

end module lane_sampling
