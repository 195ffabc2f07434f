! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The lanes of a machine, of one body or of several with joints: what can be in them, what comes out of them.
module fleet
  use multibody_log, only: watched_state
  use kinds, only: wp
  use lane_preparation, only: prepare_lanes
  use lane_types, only: lane_batch_t, lane_flow_t, regions_t
  use lanes, only: add_region, fly_lanes, lane_state, occupy_lane, take_counts
  use machine_facts, only: is_one_body
  use motion, only: motion_t
  use motion_state, only: mode_slip_minus, mode_slip_plus, tally_t
  use strobe, only: coordinates_of, strobe_t
  use structure_lanes, only: add_structure_region, fly_structure_lanes, occupy_structure_lane, structure_flies, &
    structure_lane_state, take_structure_counts
  use structure_preparation, only: prepare_structure_lanes
  use structure_types, only: structure_batch_t
  implicit none
  private

  public :: prepare_flow, open_fleet, add_capture, flies_in_lane, put_into_lane, take_from_lane, fly_fleet

  !> Every lane is controlled by `batch`; the motion of several bodies is in `structures`.
  type, public :: fleet_t
    type(lane_batch_t) :: batch
    !> What one body can be captured by.
    type(regions_t) :: regions
    type(structure_batch_t), allocatable :: structures
  end type fleet_t

contains

  !> How lanes fly a machine, if its options ask for lanes.
  pure subroutine prepare_flow(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(out) :: flow
    flow%width = moving%options%lane_width
    if (flow%width <= 0) return
    if (allocated(moving%multibody)) call prepare_structure_lanes(moving%multibody, flow)
    if (is_one_body(moving)) call prepare_lanes(moving, flow)
  end subroutine prepare_flow

  !> Empty lanes for a machine.
  pure subroutine open_fleet(moving, fleet)
    type(motion_t), intent(in) :: moving
    type(fleet_t), intent(out) :: fleet
    if (allocated(moving%multibody)) allocate (fleet%structures)
  end subroutine open_fleet

  !> The lanes can be captured by attractor number `attractor` near its `point`; see `add_region`, `add_structure_region`. What
  !> does not fit makes every lane stop at every section.
  pure subroutine add_capture(moving, fleet, attractor, point, scale, metric, reach)
    type(motion_t), intent(in) :: moving
    type(fleet_t), intent(inout) :: fleet
    integer, intent(in) :: attractor
    real(wp), intent(in) :: point(:), scale(:), metric(:), reach
    integer :: n
    logical :: fits
    n = 2
    if (allocated(moving%multibody)) n = 2*moving%multibody%machine%n
    fits = size(point) == n .and. coordinates_of(moving) == n
    if (.not. fits) then
      fleet%regions%complete = 0
      if (allocated(fleet%structures)) fleet%structures%complete = 0
    else if (allocated(moving%multibody)) then
      call add_structure_region(moving%multibody, fleet%structures, attractor, point, scale, metric, reach)
    else
      call add_region(fleet%regions, attractor, point, scale, metric(:3), reach)
    end if
  end subroutine add_capture

  !> Whether a lane can take a motion: one body that slips fast enough, a structure in a mode that lanes know.
  pure logical function flies_in_lane(moving, flow, strobe) result(flies)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(in) :: flow
    class(strobe_t), intent(in) :: strobe
    if (allocated(moving%multibody)) then
      flies = structure_flies(flow, moving%multibody, strobe%multibody)
    else
      flies = (strobe%state%mode == mode_slip_plus .or. strobe%state%mode == mode_slip_minus) .and. &
        abs(strobe%state%v) >= flow%slowest
    end if
  end function flies_in_lane

  !> Puts a motion into a lane of a batch, which will fly it to the section. `new`: without memory of flights before. Several
  !> bodies alone ask for `structures`.
  pure subroutine put_into_lane(moving, flow, lane, strobe, new, batch, structures)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    class(strobe_t), intent(in) :: strobe
    logical, intent(in) :: new
    type(lane_batch_t), intent(inout) :: batch
    type(structure_batch_t), allocatable, intent(inout) :: structures
    if (allocated(moving%multibody)) then
      call occupy_structure_lane(moving%multibody, lane, strobe%multibody, batch, structures)
    else
      call occupy_lane(flow, lane, strobe%state, new, batch)
    end if
  end subroutine put_into_lane

  !> The motion in a lane, where it stopped or at the start of the flight that is left to the event loop; what the lane has
  !> counted goes to the tally. Not a function: the copy of its result, just written, would stall every stop.
  pure subroutine take_from_lane(moving, lane, batch, structures, strobe, tally)
    type(motion_t), intent(in) :: moving
    integer, intent(in) :: lane
    type(lane_batch_t), intent(inout) :: batch
    type(structure_batch_t), allocatable, intent(inout) :: structures
    class(strobe_t), intent(inout) :: strobe
    type(tally_t), intent(inout) :: tally
    if (allocated(moving%multibody)) then
      call structure_lane_state(moving%multibody, structures, lane, strobe%multibody)
      strobe%state = watched_state(moving%multibody%machine, strobe%multibody)
      call take_structure_counts(structures, lane, tally)
    else
      call lane_state(batch, lane, strobe%state)
    end if
    call take_counts(batch, lane, tally)
  end subroutine take_from_lane

  !> Flies every occupied lane until it has stopped or is left to the event loop.
  pure subroutine fly_fleet(flow, fleet)
    type(lane_flow_t), intent(in) :: flow
    type(fleet_t), intent(inout) :: fleet
    if (allocated(fleet%structures)) then
      call fly_structure_lanes(flow, fleet%batch, fleet%structures)
    else
      call fly_lanes(flow, fleet%regions, fleet%batch)
    end if
  end subroutine fly_fleet

end module fleet
