! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Exact flight for a batch of multibody structures at once, in vectors (the kernel is C++: `structure_kernel.hpp`). What module
!> `lanes` states of one body holds here.
module structure_lanes
  use multibody, only: joint_contact, joint_friction, joint_soft, multibody_t
  use multibody_motion, only: multibody_motion_t
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_flow_t, lane_fresh
  use motion_state, only: tally_t
  use structure_functions, only: never_pulls
  use structure_types, only: structure_batch_t, structure_machine_t, structure_region_t, structure_regions
  use, intrinsic :: iso_c_binding, only: c_int, c_size_t, c_sizeof
  implicit none
  private

  public :: structure_sizes, structure_flies, add_structure_region, occupy_structure_lane, structure_lane_state, &
    take_structure_counts, fly_structure_lanes

  interface
    !> Bytes of structure_machine and structure_batch as C++ has them.
    pure subroutine separatrix_structure_sizes(machine, batch) bind(c)
      import :: c_size_t
      integer(c_size_t), intent(out) :: machine, batch
    end subroutine separatrix_structure_sizes

    pure subroutine separatrix_fly_structures(width, machine, control, batch) bind(c)
      import :: c_int, lane_batch_t, structure_batch_t, structure_machine_t
      integer(c_int), value :: width
      type(structure_machine_t), intent(in) :: machine
      type(lane_batch_t), intent(inout) :: control
      type(structure_batch_t), intent(inout) :: batch
    end subroutine separatrix_fly_structures
  end interface

contains

  !> Whether both sides of the boundary to C++ agree on the sizes of what they share.
  logical function structure_sizes()
    integer(c_size_t) :: machine, batch
    type(structure_machine_t), allocatable :: here
    type(structure_batch_t), allocatable :: there
    allocate (here, there)
    call separatrix_structure_sizes(machine, batch)
    structure_sizes = machine == c_sizeof(here) .and. batch == c_sizeof(there)
  end function structure_sizes

  !> Whether a lane can take a structure: all rigid contacts are open, and its mode is one that lanes know.
  pure logical function structure_flies(flow, moving, state) result(flies)
    type(lane_flow_t), intent(in) :: flow
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    integer :: j, key, bit
    flies = state%q(1) - state%q(1) == 0
    key = 0
    bit = 0
    do j = 1, size(moving%machine%joints)
      select case (moving%machine%joints(j)%kind)
      case (joint_contact)
        flies = flies .and. state%phase(j) == 0
      case (joint_friction)
        if (state%phase(j) == 0) key = ibset(key, bit)
        bit = bit + 1
      case (joint_soft)
        if (abs(state%phase(j)) == 1) key = ibset(key, bit)
        bit = bit + 1
      end select
    end do
    flies = flies .and. flow%structure%mode(key + 1)%known > 0
  end function structure_flies

  !> The lanes can converge to attractor number `attractor` near its `point` of the section (positions, speeds): where the square
  !> of the distance from that, in coordinates times 1/`scale` and the `metric` (upper triangle), is at most `reach`.
  !> The section's coordinates lie along directions of its own, at right angles; positions share a scale, and so do speeds.
  pure subroutine add_structure_region(moving, batch, attractor, point, scale, metric, reach)
    type(multibody_motion_t), intent(in) :: moving
    type(structure_batch_t), intent(inout) :: batch
    integer, intent(in) :: attractor
    real(wp), intent(in) :: point(:), scale(:), metric(:), reach
    real(wp), dimension(size(point), size(point)) :: onto, form
    integer :: i, j, n
    n = moving%machine%n
    if (batch%regions == structure_regions .or. any(abs(scale(2:n) - scale(1)) > 0) .or. &
        any(abs(scale(n + 2:) - scale(n + 1)) > 0)) then
      batch%complete = 0
      return
    end if
    onto = 0
    onto(:n, :n) = transpose(moving%directions)
    onto(n + 1:, n + 1:) = transpose(moving%speeds)
    do j = 1, 2*n
      form(:j, j) = metric((j*(j - 1))/2 + 1:(j*(j + 1))/2)
      form(j, :j) = form(:j, j)
    end do
    form = matmul(transpose(onto), matmul(form, onto))
    batch%regions = batch%regions + 1
    associate (region => batch%region(batch%regions))
      region = structure_region_t(attractor=real(attractor, wp), reach=reach)
      region%point(:2*n) = matmul(transpose(onto), point)
      region%scaling(:2*n) = 1/scale
      region%metric(:size(metric)) = [((form(i, j), i=1, j), j=1, 2*n)]
    end associate
  end subroutine add_structure_region

  !> Puts a structure into a lane, which will fly it to the section.
  pure subroutine occupy_structure_lane(moving, lane, state, control, batch)
    type(multibody_motion_t), intent(in) :: moving
    integer, intent(in) :: lane
    type(multibody_state_t), intent(in) :: state
    type(lane_batch_t), intent(inout) :: control
    type(structure_batch_t), intent(inout) :: batch
    integer :: j
    control%status(lane) = lane_fresh
    control%until(lane) = moving%machine%period
    associate (n => moving%machine%n)
      batch%q(lane, :n) = state%q(:n)
      batch%v(lane, :n) = state%v(:n)
    end associate
    batch%time(lane) = state%time
    batch%left(lane) = 0
    batch%rising(lane) = 0
    batch%burst(lane) = state%burst
    do j = 1, size(moving%machine%joints)
      batch%phase(lane, j) = state%phase(j)
      if (state%left(j) == 0) cycle
      ! Of two joints at their limits one is taken for an event just past.
      batch%left(lane) = left_limit(moving, state, j)
    end do
  end subroutine occupy_structure_lane

  !> The function that is zero as joint `j` has just changed its phase, with the sign of the side of its limit. Slides and pressed
  !> contacts set off from their lower limits; a contact that never pulls begins with a push.
  pure integer function left_limit(moving, state, j) result(left)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: j
    real(wp) :: position, speed, stop
    real(wp), parameter :: far_from_nothing = 1e-6_wp
    associate (machine => moving%machine, joint => moving%machine%joints(j), phase => state%phase(j))
      left = -j
      if (joint%kind /= joint_friction .and. phase == 0) left = sign(j, state%left(j))
      if (.not. never_pulls(joint) .or. phase == 0) return
      if (abs(phase) == 2) left = -push_of(machine, j)
      if (abs(phase) == 2) return
      call joint_motion(machine, j, state%q, state%v, state%time, turning_at(machine%frequency, state%time, moving%harmonics), &
                        position, speed)
      stop = merge(joint%upper, joint%lower, phase > 0)
      position = joint%contact%stiffness*(position - stop)
      speed = joint%contact%damping*speed
      if (abs(position + speed) > far_from_nothing*(abs(position) + abs(speed))) left = 0
    end associate
  end function left_limit

  !> Number of the function that is the force of soft contact `j` where it is not pressed, -1 without one.
  pure integer function push_of(machine, j)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    push_of = -1
    if (never_pulls(machine%joints(j))) push_of = size(machine%joints) + count(never_pulls(machine%joints(:j)))
  end function push_of

  !> The structure in a lane: where it stopped, or at the start of the flight that is left to the event loop.
  pure subroutine structure_lane_state(moving, batch, lane, state)
    type(multibody_motion_t), intent(in) :: moving
    type(structure_batch_t), intent(in) :: batch
    integer, intent(in) :: lane
    type(multibody_state_t), intent(inout) :: state
    integer :: j, left
    associate (n => moving%machine%n)
      state%q(:n) = batch%q(lane, :n)
      state%v(:n) = batch%v(lane, :n)
    end associate
    state%time = batch%time(lane)
    do j = 1, size(moving%machine%joints)
      state%phase(j) = nint(batch%phase(lane, j))
      state%left(j) = 0
      left = nint(abs(batch%left(lane)))
      if (left == j .or. left == push_of(moving%machine, j)) state%left(j) = nint(sign(1.0_wp, batch%left(lane)))
    end do
    state%burst = nint(batch%burst(lane))
  end subroutine structure_lane_state

  !> Moves what lanes count of structures beyond that of one body to a tally.
  pure subroutine take_structure_counts(batch, lane, tally)
    type(structure_batch_t), intent(inout) :: batch
    integer, intent(in) :: lane
    type(tally_t), intent(inout) :: tally
    tally%sticks = tally%sticks + nint(batch%sticks(lane), kind(tally%sticks))
    batch%sticks(lane) = 0
  end subroutine take_structure_counts

  !> Flies every occupied lane until it has stopped or is left to the event loop.
  pure subroutine fly_structure_lanes(flow, control, batch)
    type(lane_flow_t), intent(in) :: flow
    type(lane_batch_t), intent(inout) :: control
    type(structure_batch_t), intent(inout) :: batch
    call separatrix_fly_structures(int(flow%width, c_int), flow%structure, control, batch)
  end subroutine fly_structure_lanes

end module structure_lanes
