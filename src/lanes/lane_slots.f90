! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The lanes of a machine, of one body or of several with joints: what can be in them, what comes out of them.
module lane_slots
  use machine_type, only: machine_t, section_state_t
  use body_machine, only: body_machine_t
  use multibody_log, only: watched_state
  use kinds, only: wp
  use lane_preparation, only: prepare_lanes
  use lane_types, only: lane_batch_t, lane_flow_t, regions_t
  use lanes, only: add_region, fly_lanes, lane_state, occupy_lane, take_counts
  use multibody_machine, only: multibody_machine_t
  use motor_machine, only: motor_machine_t
  use own_machine, only: own_machine_t
  use motor_system, only: x_at
  use motion_state, only: mode_slip_minus, mode_slip_plus, options_t, take_turns, tally_t
  use structure_lanes, only: add_structure_region, fly_structure_lanes, occupy_structure_lane, structure_flies, &
    structure_lane_state, take_structure_counts
  use structure_preparation, only: prepare_structure_lanes
  use structure_types, only: structure_batch_t
  use tape_lane_types, only: tape_batch_t
  use tape_lanes, only: add_tape_region, fly_tape_lanes, occupy_tape_lane, set_tape_clock, take_tape_clock, tape_batches, &
    tape_flies, tape_lane_state
  use tape_bodies, only: prepare_motor_lanes, prepare_own_lanes
  implicit none
  private

  public :: prepare_flow, open_lanes, add_capture, flies_in_lane, put_into_lane, take_from_lane, set_clock, take_clock, &
    advance_lanes, advance_batches, batches_at_once

  !> Motions in lanes that are not those of one body in a closed form: of several bodies, of a body whose equations are a tape.
  type, public :: lane_bodies_t
    type(structure_batch_t), allocatable :: structures
    type(tape_batch_t), allocatable :: tapes
  end type lane_bodies_t

  !> Every lane is controlled by `batch`.
  type, public :: lane_slots_t
    type(lane_batch_t) :: batch
    !> What one body can converge to.
    type(regions_t) :: regions
    type(lane_bodies_t) :: bodies
  end type lane_slots_t

contains

  !> How lanes fly a machine, if its options ask for lanes.
  pure subroutine prepare_flow(moving, flow)
    class(machine_t), intent(in) :: moving
    type(lane_flow_t), intent(out) :: flow
    type(options_t) :: options
    options = moving%options()
    flow%width = options%lane_width
    if (flow%width <= 0) return
    select type (moving)
    type is (multibody_machine_t)
      call prepare_structure_lanes(moving%bodies, flow)
    type is (body_machine_t)
      flow%gpu = options%gpu
      call prepare_lanes(moving%body, flow)
    type is (motor_machine_t)
      call prepare_motor_lanes(moving%motor%system, moving%sizes%length, flow)
    type is (own_machine_t)
      if (moving%by_event) return
      associate (n => moving%coordinates(), scales => moving%scales(moving%sizes%length))
        call prepare_own_lanes(moving%motor%system, scales(:n), moving%period, options%domain, flow)
      end associate
    end select
  end subroutine prepare_flow

  !> Empty lanes for a machine.
  pure subroutine open_lanes(moving, lane_slots)
    class(machine_t), intent(in) :: moving
    type(lane_slots_t), intent(out) :: lane_slots
    select type (moving)
    type is (multibody_machine_t)
      allocate (lane_slots%bodies%structures)
    class is (motor_machine_t)
      allocate (lane_slots%bodies%tapes)
    end select
  end subroutine open_lanes

  !> The lanes can converge to attractor number `attractor` near its `point`; see `add_region`, `add_structure_region`. What does
  !> not fit makes every lane stop at every section.
  pure subroutine add_capture(moving, lane_slots, attractor, point, scale, metric, reach)
    class(machine_t), intent(in) :: moving
    type(lane_slots_t), intent(inout) :: lane_slots
    integer, intent(in) :: attractor
    real(wp), intent(in) :: point(:), scale(:), metric(:), reach
    select type (moving)
    type is (multibody_machine_t)
      if (all([size(point), moving%coordinates()] == 2*moving%bodies%machine%n)) then
        call add_structure_region(moving%bodies, lane_slots%bodies%structures, attractor, point, scale, metric, reach)
        return
      end if
      lane_slots%bodies%structures%complete = 0
    type is (body_machine_t)
      if (all([size(point), moving%coordinates()] == 2)) then
        call add_region(lane_slots%regions, attractor, point, scale, metric(:3), reach)
        return
      end if
    class is (motor_machine_t)
      if (size(point) == moving%coordinates()) then
        call add_tape_region(lane_slots%bodies%tapes, attractor, point, scale, metric, reach)
        return
      end if
      lane_slots%bodies%tapes%complete = 0
    end select
    lane_slots%regions%complete = 0
  end subroutine add_capture

  !> Whether a lane can take a motion: one body that slips fast enough, a structure in a mode that lanes know.
  pure logical function flies_in_lane(moving, flow, section) result(flies)
    class(machine_t), intent(in) :: moving
    type(lane_flow_t), intent(in) :: flow
    class(section_state_t), intent(in) :: section
    flies = .false.
    select type (moving)
    type is (multibody_machine_t)
      flies = structure_flies(flow, moving%bodies, section%multibody)
    type is (body_machine_t)
      flies = (section%state%mode == mode_slip_plus .or. section%state%mode == mode_slip_minus) .and. &
        abs(section%state%v) >= flow%slowest
    class is (motor_machine_t)
      flies = tape_flies(flow, section%state, section%motor)
    end select
  end function flies_in_lane

  !> Puts a motion into a lane of a batch, which will fly it to the section. `new`: without memory of flights before.
  pure subroutine put_into_lane(moving, flow, lane, section, new, batch, bodies)
    class(machine_t), intent(in) :: moving
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    class(section_state_t), intent(in) :: section
    logical, intent(in) :: new
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    select type (moving)
    type is (multibody_machine_t)
      call occupy_structure_lane(moving%bodies, lane, section%multibody, batch, bodies%structures)
    type is (body_machine_t)
      call occupy_lane(flow, lane, section%state, new, batch)
    class is (motor_machine_t)
      call occupy_tape_lane(flow, lane, section%state, section%motor, batch, bodies%tapes)
    end select
  end subroutine put_into_lane

  !> The motion in a lane, where it stopped or at the start of the flight that is left to the event loop; what the lane has
  !> counted goes to the tally. Not a function: the copy of its result, just written, would delay every stop.
  pure subroutine take_from_lane(moving, lane, batch, bodies, section, tally)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: lane
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    select type (moving)
    type is (multibody_machine_t)
      if (.not. allocated(section%multibody)) allocate (section%multibody)
      call structure_lane_state(moving%bodies, bodies%structures, lane, section%multibody)
      section%state = watched_state(moving%bodies%machine, section%multibody)
      call take_structure_counts(bodies%structures, lane, tally)
    type is (body_machine_t)
      call lane_state(batch, lane, section%state)
    class is (motor_machine_t)
      call tape_lane_state(moving%motor%system%clock, lane, bodies%tapes, section%state, section%motor, section%passed, &
                           section%lasted)
    end select
    call take_counts(batch, lane, tally)
    if (.not. allocated(bodies%tapes) .or. .not. moving%turn > 0) return
    call take_turns(moving%turn, section%state, tally)
    bodies%tapes%z(lane, x_at) = section%state%x
  end subroutine take_from_lane

  !> For a lane whose sections do not come at given times: where its motion stopped last [s after the section], and when its phase
  !> ends [s after the start].
  pure subroutine set_clock(bodies, lane, since, phase_end)
    type(lane_bodies_t), intent(inout) :: bodies
    integer, intent(in) :: lane
    real(wp), intent(in) :: since, phase_end
    if (allocated(bodies%tapes)) call set_tape_clock(bodies%tapes, lane, since, phase_end)
  end subroutine set_clock

  !> Where such a motion stopped last, and where it is to stop, after the sections that it passed in the lane.
  pure subroutine take_clock(bodies, batch, lane, since, until)
    type(lane_bodies_t), intent(in) :: bodies
    type(lane_batch_t), intent(in) :: batch
    integer, intent(in) :: lane
    real(wp), intent(inout) :: since, until
    if (allocated(bodies%tapes)) call take_tape_clock(bodies%tapes, batch, lane, since, until)
  end subroutine take_clock

  !> Batches that are worth flying at once.
  pure integer function batches_at_once(flow)
    type(lane_flow_t), intent(in) :: flow
    batches_at_once = 1
    if (allocated(flow%tape)) batches_at_once = tape_batches(flow)
  end function batches_at_once

  !> `advance_lanes` of as many batches as are worth flying at once.
  pure subroutine advance_batches(flow, lane_slots)
    type(lane_flow_t), intent(in) :: flow
    type(lane_slots_t), intent(inout) :: lane_slots(:)
    if (size(lane_slots) == 1) then
      call advance_lanes(flow, lane_slots(1))
    else
      call fly_tape_lanes(flow, lane_slots(1)%batch, lane_slots(1)%bodies%tapes, lane_slots(2)%batch, lane_slots(2)%bodies%tapes)
    end if
  end subroutine advance_batches

  !> Flies every occupied lane until it has stopped or is left to the event loop.
  pure subroutine advance_lanes(flow, lane_slots)
    type(lane_flow_t), intent(in) :: flow
    type(lane_slots_t), intent(inout) :: lane_slots
    if (allocated(lane_slots%bodies%structures)) then
      call fly_structure_lanes(flow, lane_slots%batch, lane_slots%bodies%structures)
    else if (allocated(lane_slots%bodies%tapes)) then
      call fly_tape_lanes(flow, lane_slots%batch, lane_slots%bodies%tapes)
    else
      call fly_lanes(flow, lane_slots%regions, lane_slots%batch)
    end if
  end subroutine advance_lanes

end module lane_slots
