! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Exact flight for a batch of bodies at once, in vectors (the kernel is C++: `lane_kernel.hpp`). A lane flies until it
!> stops at its time, or is left to the event loop of module `motion` where something rare is due. What comes out of a lane does
!> not depend on its neighbours, nor on the width of the vectors.
module lanes
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_flow_t, lane_fresh, lane_left, machine_t, most_regions, region_t, &
    regions_t, separatrix_fly_lanes
  use motion_state, only: mode_slip_minus, mode_slip_plus, state_t, tally_t
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private

  public :: add_region, occupy_lane, lane_state, take_counts, fly_lanes

contains

  !> The lanes can converge to attractor number `attractor` near its point [x, v]: where the square of the distance from that, in
  !> scaled coordinates and a metric (xx, xv, vv), is at most `reach`. The first of several takes precedence.
  pure subroutine add_region(regions, attractor, point, scale, metric, reach)
    type(regions_t), intent(inout) :: regions
    integer, intent(in) :: attractor
    real(wp), intent(in) :: point(2), scale(2), metric(3), reach
    if (regions%count == most_regions) then
      regions%complete = 0
      return
    end if
    regions%count = regions%count + 1
    regions%region(regions%count) = region_t(real(attractor, wp), point(1), point(2), 1/scale(1), 1/scale(2), metric(1), &
                                             metric(2), metric(3), reach)
  end subroutine add_region

  !> Puts a slipping body into a lane, which will fly it to the section. `new`: without memory of flights before.
  pure subroutine occupy_lane(flow, lane, state, new, batch)
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    type(state_t), intent(in) :: state
    logical, intent(in) :: new
    type(lane_batch_t), intent(inout) :: batch
    batch%status(lane) = lane_fresh
    batch%until(lane) = flow%machine%period
    batch%time(lane) = state%time
    batch%x(lane) = state%x
    batch%v(lane) = state%v
    batch%direction(lane) = merge(1.0_wp, -1.0_wp, state%mode == mode_slip_plus)
    batch%z(lane) = state%z
    batch%touch(lane) = state%touch_speed
    if (flow%machine%several_modes > 0 .or. flow%machine%law%series > 0) call find_stop_side(flow%machine, lane, batch)
    if (.not. new) return
    batch%up_span(lane) = 0.4_wp*flow%machine%period
    batch%down_span(lane) = 0.4_wp*flow%machine%period
    batch%up_hits(lane) = 0
    batch%down_hits(lane) = 0
  end subroutine occupy_lane

  !> Free, or pressed on which barrier. A lane is left where the barrier would have to pull, and where friction has changed sign.
  pure subroutine find_stop_side(m, lane, batch)
    type(machine_t), intent(in) :: m
    integer, intent(in) :: lane
    type(lane_batch_t), intent(inout) :: batch
    integer :: stop_side
    associate (x => batch%x(lane), v => batch%v(lane), up => batch%direction(lane) > 0)
      if (m%friction_slope*x <= -1) batch%status(lane) = lane_left
      stop_side = 0
      if (m%contact%stiffness > 0 .or. (m%several_modes > 0 .and. m%mode(0)%leads_to >= 0)) then
        if (x > m%upper .or. (up .and. x >= m%upper)) stop_side = 1
        if (x < m%lower .or. (.not. up .and. x <= m%lower)) stop_side = 2
      end if
      batch%pressed_on(lane) = stop_side
      if (stop_side == 0 .or. (up .eqv. stop_side == 1)) return
      ! On the way out: modes 3 and 4.
      if (merge(x - m%upper, m%lower - x, stop_side == 1) < m%mode(2 + stop_side)%lead*abs(v)) batch%status(lane) = lane_left
    end associate
  end subroutine find_stop_side

  !> The body in a lane: where it stopped, or at the start of the flight that is left to the event loop. Not a function: the
  !> copy of its result, just written, would delay every stop.
  pure subroutine lane_state(batch, lane, state)
    type(lane_batch_t), intent(in) :: batch
    integer, intent(in) :: lane
    type(state_t), intent(out) :: state
    state%x = batch%x(lane)
    state%v = batch%v(lane)
    state%z = batch%z(lane)
    state%touch_speed = batch%touch(lane)
    state%time = batch%time(lane)
    state%mode = merge(mode_slip_minus, mode_slip_plus, batch%direction(lane) < 0)
  end subroutine lane_state

  !> Moves what a lane has counted to a tally.
  pure subroutine take_counts(batch, lane, tally)
    type(lane_batch_t), intent(inout) :: batch
    integer, intent(in) :: lane
    type(tally_t), intent(inout) :: tally
    tally%events = tally%events + int(batch%flights(lane), kind(tally%events))
    tally%slips = tally%slips + int(batch%flights(lane), kind(tally%slips))
    tally%impacts = tally%impacts + int(batch%impacts(lane), kind(tally%impacts))
    tally%impact_speed_sum = tally%impact_speed_sum + batch%speed_sum(lane)
    if (batch%impacts(lane) > 0) tally%last_impact_speed = batch%last_speed(lane)
    tally%grazing_margin = min(tally%grazing_margin, batch%margin(lane))
    batch%flights(lane) = 0
    batch%impacts(lane) = 0
    batch%speed_sum(lane) = 0
    batch%margin(lane) = huge(1.0_wp)
  end subroutine take_counts

  !> Flies every occupied lane until it has stopped or is left to the event loop.
  pure subroutine fly_lanes(flow, regions, batch)
    type(lane_flow_t), intent(in) :: flow
    type(regions_t), intent(in) :: regions
    type(lane_batch_t), intent(inout) :: batch
    call separatrix_fly_lanes(int(flow%width, c_int), flow%machine, regions, batch)
  end subroutine fly_lanes

end module lanes
