! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Certified Taylor flight of many bodies with a motor at once, in vectors (the kernel is C++: `tape_kernel.hpp`). What module
!> `lanes` states of one body holds here.
module tape_lanes
  use constants, only: two_pi
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_flow_t, lane_fresh
  use motion_state, only: mode_slip_minus, mode_slip_plus, state_t
  use motor_state, only: motor_state_t
  use tape_lane_types, only: most_tape_regions, most_tape_section, most_tape_variables, tape_batch_t, tape_machine_t, tape_region_t
  use, intrinsic :: iso_c_binding, only: c_int, c_size_t, c_sizeof
  implicit none
  private

  public :: tape_sizes, tape_flies, add_tape_region, occupy_tape_lane, tape_lane_state, set_tape_clock, take_tape_clock, &
    fly_tape_lanes, tape_batches

  interface
    !> Bytes of tape_machine and tape_batch as C++ has them.
    pure subroutine separatrix_tape_sizes(machine, batch) bind(c)
      import :: c_size_t
      integer(c_size_t), intent(out) :: machine, batch
    end subroutine separatrix_tape_sizes

    !> Batches that fly faster at once than one by one.
    pure function separatrix_tape_batches(width) result(count) bind(c)
      import :: c_int
      integer(c_int), value :: width
      integer(c_int) :: count
    end function separatrix_tape_batches

    pure subroutine separatrix_fly_tape(width, machine, control, batch, other_control, other_batch) bind(c)
      import :: c_int, lane_batch_t, tape_batch_t, tape_machine_t
      integer(c_int), value :: width
      type(tape_machine_t), intent(in) :: machine
      type(lane_batch_t), intent(inout) :: control
      type(tape_batch_t), intent(inout) :: batch
      type(lane_batch_t), intent(inout), optional :: other_control
      type(tape_batch_t), intent(inout), optional :: other_batch
    end subroutine separatrix_fly_tape
  end interface

contains

  !> Whether both sides of the boundary to C++ agree on the sizes of what they share.
  logical function tape_sizes()
    integer(c_size_t) :: machine, batch
    type(tape_machine_t), allocatable :: here
    type(tape_batch_t), allocatable :: there
    allocate (here, there)
    call separatrix_tape_sizes(machine, batch)
    tape_sizes = machine == c_sizeof(here) .and. batch == c_sizeof(there)
  end function tape_sizes

  !> Whether a lane can take a motion: the body slips, a crank turns forwards.
  pure logical function tape_flies(flow, state, crank) result(flies)
    type(lane_flow_t), intent(in) :: flow
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    flies = state%mode == mode_slip_plus .or. state%mode == mode_slip_minus
    if (flow%tape%clock == 0) flies = flies .and. crank%turning > 0 .and. crank%w > 0
  end function tape_flies

  !> The lanes can converge to attractor number `attractor` near its `point`; see `add_structure_region`.
  pure subroutine add_tape_region(batch, attractor, point, scale, metric, reach)
    type(tape_batch_t), intent(inout) :: batch
    integer, intent(in) :: attractor
    real(wp), intent(in) :: point(:), scale(:), metric(:), reach
    if (batch%regions == most_tape_regions .or. size(point) > most_tape_section) then
      batch%complete = 0
      return
    end if
    batch%regions = batch%regions + 1
    associate (region => batch%region(batch%regions))
      region = tape_region_t(attractor=real(attractor, wp), reach=reach)
      region%point(:size(point)) = point
      region%scaling(:size(point)) = 1/scale
      region%metric(:size(metric)) = metric
    end associate
  end subroutine add_tape_region

  !> Puts a motion into a lane.
  pure subroutine occupy_tape_lane(flow, lane, state, crank, control, batch)
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(lane_batch_t), intent(inout) :: control
    type(tape_batch_t), intent(inout) :: batch
    integer :: n
    n = flow%tape%variables
    control%status(lane) = lane_fresh
    batch%z(lane, 3:4) = [state%x, state%v]
    batch%z(lane, 5:n) = crank%own(:n - 4)
    if (flow%tape%clock > 0) then
      batch%z(lane, :2) = [crank%phi + state%time, state%time*flow%tape%phase_speed]
      batch%origin(lane) = crank%phi
    else
      batch%z(lane, :2) = [merge(crank%phi, 0.0_wp, crank%phi < two_pi), crank%w]
    end if
    batch%time(lane) = state%time
    batch%slip(lane) = merge(-1, 1, state%mode == mode_slip_minus)
    batch%limit(lane) = huge(1.0_wp)
    batch%crossed(lane) = 0
    batch%proven(lane) = 1
  end subroutine occupy_tape_lane

  !> The motion in a lane: where it stopped, of a crank with `passed` on the section `lasted` [s] after the last one, or at the
  !> start of the step that is left to the event loop.
  pure subroutine tape_lane_state(clock, lane, batch, state, crank, passed, lasted)
    logical, intent(in) :: clock
    integer, intent(in) :: lane
    type(tape_batch_t), intent(in) :: batch
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(inout) :: crank
    logical, intent(out) :: passed
    real(wp), intent(inout) :: lasted
    state%x = batch%z(lane, 3)
    state%v = batch%z(lane, 4)
    state%time = batch%time(lane)
    state%mode = merge(mode_slip_minus, mode_slip_plus, batch%slip(lane) < 0)
    passed = .false.
    if (clock) then
      crank%phi = batch%origin(lane)
      crank%own(:most_tape_variables - 4) = batch%z(lane, 5:)
      return
    end if
    crank%phi = batch%z(lane, 1)
    crank%w = batch%z(lane, 2)
    crank%own(1) = batch%z(lane, 5)
    crank%turning = 1
    passed = batch%passed(lane) > 0.5_wp
    if (passed) lasted = batch%lasted(lane)
  end subroutine tape_lane_state

  !> Where a lane's motion stopped last [s after the section], and when its phase ends [s after the start].
  pure subroutine set_tape_clock(batch, lane, since, phase_end)
    type(tape_batch_t), intent(inout) :: batch
    integer, intent(in) :: lane
    real(wp), intent(in) :: since, phase_end
    batch%since(lane) = since
    batch%phase_end(lane) = phase_end
    batch%passed(lane) = 0
  end subroutine set_tape_clock

  !> Where it stopped last, and where it is to stop: sections that it passed on the way have changed both.
  pure subroutine take_tape_clock(batch, control, lane, since, until)
    type(tape_batch_t), intent(in) :: batch
    type(lane_batch_t), intent(in) :: control
    integer, intent(in) :: lane
    real(wp), intent(out) :: since, until
    since = batch%since(lane)
    until = control%until(lane)
  end subroutine take_tape_clock

  !> Batches that the lanes of this width fly at once.
  pure integer function tape_batches(flow)
    type(lane_flow_t), intent(in) :: flow
    tape_batches = separatrix_tape_batches(int(flow%width, c_int))
  end function tape_batches

  !> Flies every occupied lane of a batch, and of another, until one has stopped or is left to the event loop.
  pure subroutine fly_tape_lanes(flow, control, batch, other_control, other_batch)
    type(lane_flow_t), intent(in) :: flow
    type(lane_batch_t), intent(inout) :: control
    type(tape_batch_t), intent(inout) :: batch
    type(lane_batch_t), intent(inout), optional :: other_control
    type(tape_batch_t), intent(inout), optional :: other_batch
    call separatrix_fly_tape(int(flow%width, c_int), flow%tape, control, batch, other_control, other_batch)
  end subroutine fly_tape_lanes

end module tape_lanes
