! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A multibody structure as a hybrid machine. Its state has the positions and the velocities on which anything depends (see
!> `section_directions`), and the extensions of the springs of elastic friction, which are constant while those slide.
module structure
  use guards, only: guards_of, joint_guard_t, meets_lower, meets_upper, room_for_guards, slide_ends, turns_round
  use hybrid_machine, only: event_t, hybrid_t, neighbourhood_t
  use machine_type, only: section_state_t
  use motion_state, only: tally_t
  use multibody, only: joint_contact, joint_elastic, most_joints
  use multibody_flows, only: multibody_motion_t
  use multibody_section, only: lay_out
  use multibody_state, only: free_force, joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use structure_flight, only: flow_of, fly_mode, force_slopes, frame_t, put_state, rates, surface_jerk
  use structure_impact, only: carried_by, apply_impact_with_slopes
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use structure_modes, only: phases_in, sliding_extension
  implicit none
  private

  public :: structure_of, state_in, coordinates_of, settle

  type, extends(hybrid_t), public :: structure_t
    type(frame_t) :: frame
  contains
    procedure :: rests => structure_rests
    procedure :: fly => fly_structure
    procedure :: slope => slope_of_structure
    procedure :: guard => guard_of_structure
    procedure :: jump => jump_of_structure
    procedure :: begin => begin_structure
    procedure :: go_on => go_on_with_structure
    procedure :: fly_to_section => fly_structure_to_section
    procedure :: fly_sections => fly_structure_over_sections
    procedure :: map => map_of_structure
    procedure :: starts_of_section => starts_of_structure
  end type structure_t

  ! In the submodule `structure_sections`: it uses modules that use this one.
  interface
    module pure subroutine begin_structure(self, point, section, ok)
    class(structure_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
  end subroutine begin_structure

  module pure subroutine go_on_with_structure(self, section, point, ok)
  class(structure_t), intent(in) :: self
  type(section_state_t), intent(inout) :: section
  real(wp), intent(out) :: point(:)
  logical, intent(out) :: ok
end subroutine go_on_with_structure

module pure subroutine fly_structure_to_section(self, start, point, events, ok)
class(structure_t), intent(in) :: self
real(wp), intent(in) :: start(:)
real(wp), intent(out) :: point(:)
type(event_t), allocatable, intent(out) :: events(:)
logical, intent(out) :: ok
end subroutine fly_structure_to_section

module pure subroutine fly_structure_over_sections(self, point, sections, collapsed, image, events, mode, tally, ok)
class(structure_t), intent(in) :: self
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
logical, intent(in) :: collapsed
real(wp), intent(out) :: image(:)
type(event_t), allocatable, intent(out) :: events(:)
integer, intent(out) :: mode
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
end subroutine fly_structure_over_sections

module pure subroutine map_of_structure(self, machines, point, sections, image, by_start, tally, ok, by_parameter)
class(structure_t), intent(in) :: self
type(neighbourhood_t), intent(in) :: machines
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
real(wp), intent(out) :: image(:), by_start(:, :)
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
real(wp), intent(out), optional :: by_parameter(:)
end subroutine map_of_structure

module pure function starts_of_structure(self, watched, spread) result(points)
class(structure_t), intent(in) :: self
real(wp), intent(in) :: watched(:, :)
real(wp), intent(in), optional :: spread(:)
real(wp) :: points(self%n, size(watched, 2))
end function starts_of_structure
end interface

contains

 !> The hybrid machine of a structure; `sizes` are those of a position [m] and of a speed [m/s].
pure function structure_of(moving, sizes) result(structure)
  type(multibody_motion_t), intent(in) :: moving
  real(wp), intent(in) :: sizes(2)
  type(structure_t) :: structure
  real(wp) :: q(moving%machine%n), v(moving%machine%n)
  integer :: positions, speeds, j, k
  associate (machine => moving%machine)
    structure%frame%moving = moving
    structure%frame%directions = moving%directions
    structure%frame%velocities = moving%speeds
    positions = size(moving%directions, 2)
    speeds = size(moving%speeds, 2)
    structure%frame%elastic = pack([(j, j=1, size(machine%joints))], machine%joints%kind == joint_elastic)
    structure%frame%positions = positions
    structure%frame%speeds = speeds
    structure%positions = positions
    structure%n = positions + speeds + size(structure%frame%elastic)
    structure%has_clock = moving%section == 0
    structure%period = machine%period
    allocate (structure%size_of(structure%n))
    structure%size_of = sizes(1)
    structure%size_of(positions + 1:positions + speeds) = sizes(2)
    allocate (structure%watched(2, structure%n), source=0.0_wp)
    do j = 1, positions + speeds
      call lay_out(moving, [(merge(1.0_wp, 0.0_wp, k == j), k=1, positions + speeds)], q, v)
      structure%watched(:, j) = [q(machine%watched), v(machine%watched)]
    end do
  end associate
end function structure_of

 !> The state of the event loop at `t` [s].
pure type(multibody_state_t) function state_in(self, mode, t, y) result(state)
  class(structure_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t, y(:)
  type(multibody_state_t) :: like
  like%phase = phases_in(self%frame%moving%machine, mode)
  call put_state(self%frame, like, t, y, state)
end function state_in

 !> The coordinates of a state of the event loop.
pure function coordinates_of(self, state) result(y)
  class(structure_t), intent(in) :: self
  type(multibody_state_t), intent(in) :: state
  real(wp) :: y(self%n), s, u
  complex(wp) :: turning(self%frame%moving%harmonics)
  integer :: j, k
  associate (machine => self%frame%moving%machine, n => self%positions + self%frame%speeds)
    y(:self%positions) = matmul(state%q(:machine%n), self%frame%directions)
    y(self%positions + 1:n) = matmul(state%v(:machine%n), self%frame%velocities)
    turning = turning_at(machine%frequency, state%time, self%frame%moving%harmonics)
    do k = 1, size(self%frame%elastic)
      j = self%frame%elastic(k)
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      y(n + k) = s - state%slider(j)
      if (state%phase(j) /= 0) y(n + k) = sliding_extension(machine, j, state%phase(j))
    end do
  end associate
end function coordinates_of

 !> Whether the joints that are held leave no coordinate free.
pure logical function structure_rests(self, mode)
  class(structure_t), intent(in) :: self
  integer, intent(in) :: mode
  integer, allocatable :: held(:)
  real(wp), allocatable :: carried(:, :)
  associate (machine => self%frame%moving%machine)
    call carried_by(machine, phases_in(machine, mode), .false., held, carried)
    structure_rests = size(held) == machine%n
  end associate
end function structure_rests

pure subroutine fly_structure(self, mode, t0, y0, t1, y1, flight)
  class(structure_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t0, y0(:), t1
  real(wp), intent(out) :: y1(:)
  real(wp), intent(out), optional :: flight(:, :)
  real(wp) :: change(size(y0), size(y0)), still(size(y0))
  if (abs(t1 - t0) > 0) then
    call fly_mode(self%frame, self%size_of, state_in(self, mode, t0, y0), y0, t1, y1, flight)
  else
    y1 = y0
    call settle(self, mode, t0, y1, change, still)
    if (present(flight)) flight = change
  end if
end subroutine fly_structure

 !> Moves a state onto what the joints of the mode hold, least in the metric of the masses: no sliding speed, a closed gap, the
 !> extension of a spring that slides; with the derivatives by the state and by the time at which this is done.
pure subroutine settle(self, mode, t, y, by_state, by_time)
  class(structure_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t
  real(wp), intent(inout) :: y(:)
  real(wp), intent(out) :: by_state(:, :), by_time(:)
  complex(wp) :: turning(self%frame%moving%harmonics)
  real(wp), allocatable :: carried(:, :)
  real(wp), dimension(self%frame%moving%machine%n) :: q, v
  real(wp) :: s, u, given, stop
  integer, allocatable :: held(:)
  integer :: phase(most_joints), i, j, k
  by_time = 0
  by_state = 0
  do k = 1, self%n
    by_state(k, k) = 1
  end do
  associate (machine => self%frame%moving%machine, d => self%frame%directions, e => self%frame%velocities, &
      p => self%positions, &
               n => self%positions + self%frame%speeds)
    phase = phases_in(machine, mode)
    turning = turning_at(machine%frequency, t, self%frame%moving%harmonics)
    call carried_by(machine, phase, .true., held, carried)
    q = matmul(d, y(:p))
    v = matmul(e, y(p + 1:n))
    do i = 1, size(held)
      j = held(i)
      associate (joint => machine%joints(j))
        call joint_motion(machine, j, q, v, t, turning, s, u)
        stop = merge(joint%upper, joint%lower, phase(j) > 0)
        y(:p) = y(:p) - matmul(carried(:, i), d)*(s - stop)
        by_time(:p) = by_time(:p) - matmul(carried(:, i), d)*(u - sum(joint%row*v))
        do k = 1, p
          by_state(:p, k) = by_state(:p, k) - matmul(carried(:, i), d)*sum(joint%row*d(:, k))
        end do
      end associate
    end do
    call carried_by(machine, phase, .false., held, carried)
    do i = 1, size(held)
      j = held(i)
      associate (joint => machine%joints(j))
        call joint_motion(machine, j, q, v, t, turning, s, u, given)
        y(p + 1:n) = y(p + 1:n) - matmul(carried(:, i), e)*u
        by_time(p + 1:n) = by_time(p + 1:n) - matmul(carried(:, i), e)*given
        do k = 1, n - p
          by_state(p + 1:n, p + k) = by_state(p + 1:n, p + k) - matmul(carried(:, i), e)*sum(joint%row*e(:, k))
        end do
      end associate
    end do
    do k = 1, size(self%frame%elastic)
      j = self%frame%elastic(k)
      if (phase(j) == 0) cycle
      y(n + k) = sliding_extension(machine, j, phase(j))
      by_state(n + k, :) = 0
    end do
  end associate
end subroutine settle

pure function slope_of_structure(self, mode, t, y) result(slope)
  class(structure_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t, y(:)
  real(wp) :: slope(size(y))
  type(multibody_state_t) :: state
  type(mode_flow_t) :: spare
  integer :: at
  state = state_in(self, mode, t, y)
  call flow_of(self%frame%moving, state%phase, at, spare)
  if (at > 0) then
    slope = rates(self%frame, self%frame%moving%flows(at), state)
  else
    slope = rates(self%frame, spare, state)
  end if
end function slope_of_structure

 !> The guard number `event%guard` of the joint, in the mode before the event.
pure subroutine guard_of_structure(self, event, t, y, value, by_state, by_time)
  class(structure_t), intent(in) :: self
  type(event_t), intent(in) :: event
  real(wp), intent(in) :: t, y(:)
  real(wp), intent(out) :: value, by_state(:), by_time
  type(multibody_state_t) :: state
  type(mode_flow_t) :: spare
  integer :: at
  state = state_in(self, event%before, t, y)
  if (event%guard == turns_round) state%phase(event%joint) = event%side
  call flow_of(self%frame%moving, state%phase, at, spare)
  if (at > 0) then
    call guard_in(self, self%frame%moving%flows(at), event, state, t, value, by_state, by_time)
  else
    call guard_in(self, spare, event, state, t, value, by_state, by_time)
  end if
end subroutine guard_of_structure

 !> The same, in a state and by its flow.
pure subroutine guard_in(self, flow, event, state, t, value, by_state, by_time)
  class(structure_t), intent(in) :: self
  type(mode_flow_t), intent(in) :: flow
  type(event_t), intent(in) :: event
  type(multibody_state_t), intent(in) :: state
  real(wp), intent(in) :: t
  real(wp), intent(out) :: value, by_state(:), by_time
  type(joint_guard_t) :: list(room_for_guards(self%frame%moving%machine))
  complex(wp) :: turning(self%frame%moving%harmonics)
  real(wp) :: s, u, given
  integer :: g, count_guards, i
  by_state = 0
  by_time = 0
  value = ieee_value(1.0_wp, ieee_quiet_nan)
  associate (machine => self%frame%moving%machine, p => self%positions, n => self%positions + self%frame%speeds)
    call guards_of(machine, flow, state, list, count_guards)
    do g = 1, count_guards
      if (list(g)%joint == event%joint .and. list(g)%meaning == event%guard) exit
    end do
    if (g > count_guards) return
    turning = turning_at(machine%frequency, t, self%frame%moving%harmonics)
    associate (guard => list(g), joint => machine%joints(event%joint))
      call joint_motion(machine, event%joint, state%q, state%v, t, turning, s, u, given)
      value = guard%constant + guard%position*s + guard%speed*u
      by_state(p + 1:n) = guard%speed*matmul(joint%row, self%frame%velocities)
      by_time = guard%speed*given
      i = findloc(self%frame%elastic, event%joint, 1)
      if (i > 0) then
        by_state(n + i) = guard%position
      else
        by_state(:p) = guard%position*matmul(joint%row, self%frame%directions)
        by_time = by_time + guard%position*(u - sum(joint%row*state%v(:machine%n)))
      end if
      if (guard%held > 0) call add_force(self, flow, state, turning, guard%held, guard%force, value, by_state, by_time)
    end associate
  end associate
end subroutine guard_in

 !> Adds `share` of the force of constraint number `held`; those that depend on others have none of their own.
pure subroutine add_force(self, flow, state, turning, held, share, value, by_state, by_time)
  class(structure_t), intent(in) :: self
  type(mode_flow_t), intent(in) :: flow
  type(multibody_state_t), intent(in) :: state
  complex(wp), intent(in) :: turning(:)
  integer, intent(in) :: held
  real(wp), intent(in) :: share
  real(wp), intent(inout) :: value, by_state(:), by_time
  real(wp) :: force(self%frame%moving%machine%n), slopes(self%frame%moving%machine%n, self%n)
  real(wp) :: rate(self%frame%moving%machine%n), s, u, given
  integer :: i
  if (size(flow%held) > size(flow%independent)) then
    value = ieee_value(1.0_wp, ieee_quiet_nan)
    return
  end if
  associate (machine => self%frame%moving%machine)
    call free_force(machine, state, turning, force)
    call force_slopes(self%frame, state, turning, slopes, rate)
    value = value - share*sum(flow%reaction(held, :)*force)
    by_state = by_state - share*matmul(flow%reaction(held, :), slopes)
    by_time = by_time - share*sum(flow%reaction(held, :)*rate)
    do i = 1, size(flow%held)
      call joint_motion(machine, flow%held(i), state%q, state%v, state%time, turning, s, u, given)
      value = value - share*flow%hold(held, i)*given
      by_time = by_time - share*flow%hold(held, i)*surface_jerk(machine, flow%held(i), turning)
    end do
  end associate
end subroutine add_force

pure subroutine jump_of_structure(self, event, t, y, after, by_state, by_time)
  class(structure_t), intent(in) :: self
  type(event_t), intent(in) :: event
  real(wp), intent(in) :: t, y(:)
  real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
  real(wp) :: struck(size(y), size(y)), at_time(size(y))
  real(wp), dimension(self%frame%moving%machine%n) :: speeds, at_speeds
  real(wp) :: by_speeds(self%frame%moving%machine%n, self%frame%moving%machine%n)
  complex(wp) :: turning(self%frame%moving%harmonics)
  integer :: side(most_joints), phase(most_joints), k
  logical :: hits
  after = y
  at_time = 0
  struck = 0
  do k = 1, self%n
    struck(k, k) = 1
  end do
  associate (machine => self%frame%moving%machine, e => self%frame%velocities, p => self%positions, &
               n => self%positions + self%frame%speeds)
    hits = event%guard == meets_upper .or. event%guard == meets_lower
    if (hits) hits = machine%joints(event%joint)%kind == joint_contact
    if (hits) then
      side = phases_in(machine, event%before)
      where (machine%joints%kind /= joint_contact) side(:size(machine%joints)) = 0
      side(event%joint) = event%side
      phase = phases_in(machine, event%after)
      turning = turning_at(machine%frequency, t, self%frame%moving%harmonics)
      call apply_impact_with_slopes(machine, state_in(self, event%before, t, y), turning, side, phase(event%joint) /= 0, &
                                speeds, by_speeds, at_speeds)
      after(p + 1:n) = matmul(speeds, e)
      struck(p + 1:n, p + 1:n) = matmul(transpose(e), matmul(by_speeds, e))
      at_time(p + 1:n) = matmul(at_speeds, e)
    end if
    ! A slider stops with its spring stretched by what friction was.
    k = findloc(self%frame%elastic, event%joint, 1)
    if (k > 0 .and. event%guard == slide_ends) then
      after(n + k) = sliding_extension(machine, event%joint, event%side)
      struck(n + k, :) = 0
    end if
    call settle(self, event%after, t, after, by_state, by_time)
    by_time = by_time + matmul(by_state, at_time)
    by_state = matmul(by_state, struck)
  end associate
end subroutine jump_of_structure

end module structure
