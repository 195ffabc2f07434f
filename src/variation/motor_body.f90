! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body with a motor as a hybrid machine without a clock. Its state is x [m], crank angle [rad], v [m/s], crank speed [rad/s], and
!> current [A] or integral [rad]. The section, the passage of the crank through a turn, is the last event of every cycle.
module motor_body
  use guards, only: turns_round
  use hybrid_machine, only: event_t, hybrid_t, neighbourhood_t
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, mode_lower_barrier, mode_stick, mode_upper_barrier, state_t, tally_t
  use motor_flow, only: add_slopes, fly_on, motor_flow_t, new_flow, rates_at, with_piece
  use motor_machine, only: motor_machine_t
  use motor_system, only: body_held, both_move
  use motor_now, only: parameters_now
  use motor_rest, only: slips
  use motor_state, only: motor_state_t
  use tape_value, only: evaluate
  implicit none
  private

  public :: motor_body_of, why_not_varied, point_of_crank, release_margin

  integer, parameter, public :: x_of = 1, angle_of = 2, v_of = 3, speed_of = 4, own_of = 5

  type, extends(hybrid_t), public :: motor_body_t
    type(motor_machine_t) :: machine
    !> Flights of a body that slips, and of one that is held.
    type(motor_flow_t) :: flows(2)
    !> Derivatives of the force that holds the body: nodes of the second tape.
    integer, allocatable :: hold_slopes(:)
    !> Variable of the equations for each coordinate of the state.
    integer, allocatable :: order(:)
  contains
    procedure :: rests => body_rests
    procedure :: fly => fly_body
    procedure :: slope => slope_of_body
    procedure :: guard => guard_of_body
    procedure :: jump => jump_of_body
    procedure :: begin => begin_motor
    procedure :: go_on => go_on_with_motor
    procedure :: fly_to_section => fly_motor_to_section
    procedure :: fly_sections => fly_motor_over_sections
    procedure :: map => map_of_motor
    procedure :: starts_of_section => starts_of_motor
  end type motor_body_t

  ! In the submodule `motor_sections`.
  interface
    module pure subroutine begin_motor(self, point, section, ok)
    class(motor_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
  end subroutine begin_motor

  module pure subroutine go_on_with_motor(self, section, point, ok)
  class(motor_body_t), intent(in) :: self
  type(section_state_t), intent(inout) :: section
  real(wp), intent(out) :: point(:)
  logical, intent(out) :: ok
end subroutine go_on_with_motor

module pure subroutine fly_motor_to_section(self, start, point, events, ok)
class(motor_body_t), intent(in) :: self
real(wp), intent(in) :: start(:)
real(wp), intent(out) :: point(:)
type(event_t), allocatable, intent(out) :: events(:)
logical, intent(out) :: ok
end subroutine fly_motor_to_section

module pure subroutine fly_motor_over_sections(self, point, sections, collapsed, image, events, mode, tally, ok)
class(motor_body_t), intent(in) :: self
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
logical, intent(in) :: collapsed
real(wp), intent(out) :: image(:)
type(event_t), allocatable, intent(out) :: events(:)
integer, intent(out) :: mode
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
end subroutine fly_motor_over_sections

module pure subroutine map_of_motor(self, machines, point, sections, image, by_start, tally, ok, by_parameter)
class(motor_body_t), intent(in) :: self
type(neighbourhood_t), intent(in) :: machines
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
real(wp), intent(out) :: image(:), by_start(:, :)
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
real(wp), intent(out), optional :: by_parameter(:)
end subroutine map_of_motor

module pure function starts_of_motor(self, watched, spread) result(points)
class(motor_body_t), intent(in) :: self
real(wp), intent(in) :: watched(:, :)
real(wp), intent(in), optional :: spread(:)
real(wp) :: points(self%n, size(watched, 2))
end function starts_of_motor
end interface

contains

 !> Why the variations of a machine are not known, with the key of the case; '' if they are.
pure function why_not_varied(machine) result(why)
  type(motor_machine_t), intent(in) :: machine
  character(len=:), allocatable :: why
  why = ''
  associate (system => machine%motor%system)
    if (system%control%supply > 0) then
      why = 'motor.ramp_time: during a ramp there are no cycles; motor.ramp_time = 0 is the machine after it'
    end if
  end associate
end function why_not_varied

 !> The hybrid machine. `sizes`: of a position [m] and of a speed [m/s].
pure function motor_body_of(machine, sizes) result(body)
  type(motor_machine_t), intent(in) :: machine
  real(wp), intent(in) :: sizes(2)
  type(motor_body_t) :: body
  integer, parameter :: order(5) = [3, 1, 4, 2, 5]
  body%machine = machine
  associate (system => machine%motor%system)
    body%n = system%variables
    body%positions = 2
    body%has_clock = .false.
    body%crank_section = .true.
    body%period = machine%period
    body%order = order(:body%n)
    body%lower = machine%lower
    body%upper = machine%upper
    body%barriers = [body%lower, body%upper]
    body%force_size = max(system%stiffness*sizes(1), system%body_level)
    body%smooth_turns = .not. system%friction%break_away > 0
    body%size_of = [sizes(1), 1.0_wp, sizes(2), machine%drive_frequency]
    if (body%n == own_of) body%size_of = [body%size_of, system%own_size]
    allocate (body%watched(2, body%n), source=0.0_wp)
    body%watched(1, x_of) = 1
    body%watched(2, v_of) = 1
    call new_flow(system, both_move, body%flows(1))
    call new_flow(system, body_held, body%flows(2))
    allocate (body%hold_slopes(body%n))
    call add_slopes(body%flows(2), system%body_hold(body_held), body%hold_slopes)
  end associate
end function motor_body_of

 !> The crank of a state; the flights know the piece of its motor.
pure type(motor_state_t) function crank_in(self, y) result(crank)
  class(motor_body_t), intent(in) :: self
  real(wp), intent(in) :: y(:)
  crank = motor_state_t(phi=y(angle_of), w=y(speed_of), turning=merge(-1, 1, y(speed_of) < 0))
  if (self%n == own_of) crank%own(1) = y(own_of)
end function crank_in

pure function parameters_in(self, mode, y) result(parameters)
  class(motor_body_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: y(:)
  real(wp) :: parameters(size(self%machine%motor%system%sheet%parameters))
  parameters = parameters_now(self%machine%motor%system, state_t(x=y(x_of), v=y(v_of), mode=mode), crank_in(self, y))
end function parameters_in

 !> The state of a body and its crank.
pure function point_of_crank(self, state, crank) result(y)
  class(motor_body_t), intent(in) :: self
  type(state_t), intent(in) :: state
  type(motor_state_t), intent(in) :: crank
  real(wp) :: y(self%n)
  y(:4) = [state%x, crank%phi, state%v, crank%w]
  if (self%n == own_of) y(own_of) = crank%own(1)
end function point_of_crank

pure logical function body_rests(self, mode)
  class(motor_body_t), intent(in) :: self
  integer, intent(in) :: mode
  body_rests = self%n > 0 .and. .not. slips(mode)
end function body_rests

pure subroutine fly_body(self, mode, t0, y0, t1, y1, flight)
  class(motor_body_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t0, y0(:), t1
  real(wp), intent(out) :: y1(:)
  real(wp), intent(out), optional :: flight(:, :)
  real(wp) :: z(self%n), slopes(self%n, self%n), sizes(self%n)
  integer :: k
  associate (flow => self%flows(merge(1, 2, slips(mode))), order => self%order)
    k = merge(1, 2, slips(mode))
    y1 = y0
    if (k == 2) y1(v_of) = 0
    if (mode == mode_upper_barrier) y1(x_of) = self%upper
    if (mode == mode_lower_barrier) y1(x_of) = self%lower
    z(order) = y1
    sizes(order) = self%size_of
    if (present(flight)) then
      call fly_on(flow, parameters_in(self, mode, y1), sizes, t1 - t0, z, slopes)
      flight = slopes(order, order)
      if (k == 2) flight(:, v_of) = 0
      if (rests_on_barrier(mode)) flight(:, x_of) = 0
    else
      call fly_on(flow, parameters_in(self, mode, y1), sizes, t1 - t0, z)
    end if
    y1 = z(order)
  end associate
end subroutine fly_body

pure logical function rests_on_barrier(mode)
  integer, intent(in) :: mode
  rests_on_barrier = mode == mode_upper_barrier .or. mode == mode_lower_barrier
end function rests_on_barrier

pure function slope_of_body(self, mode, t, y) result(slope)
  class(motor_body_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t, y(:)
  real(wp) :: slope(size(y))
  real(wp) :: z(self%n), rates(self%n)
  z(self%order) = y + 0*t
  rates = rates_at(self%flows(merge(1, 2, slips(mode))), z, parameters_in(self, mode, y))
  slope = rates(self%order)
end function slope_of_body

pure subroutine guard_of_body(self, event, t, y, value, by_state, by_time)
  class(motor_body_t), intent(in) :: self
  type(event_t), intent(in) :: event
  real(wp), intent(in) :: t, y(:)
  real(wp), intent(out) :: value, by_state(:), by_time
  by_state = 0
  by_time = 0*t
  if (event%guard == turns_round) then
    value = y(angle_of) - sign(two_pi, y(speed_of))
    by_state(angle_of) = 1
    return
  end if
  select case (event%kind)
  case (event_impact_upper, event_chatter_upper)
    value = y(x_of) - self%upper
    by_state(x_of) = 1
  case (event_impact_lower, event_chatter_lower)
    value = y(x_of) - self%lower
    by_state(x_of) = 1
  case (event_release, event_barrier_release)
    call release_margin(self, event%side, y, value, by_state)
  case default
    value = y(v_of)
    by_state(v_of) = 1
  end select
end subroutine guard_of_body

 !> By how much the force on a body at rest is less than what moves it to a `side` [N], and its derivatives.
pure subroutine release_margin(self, side, y, margin, by_state)
  class(motor_body_t), intent(in) :: self
  integer, intent(in) :: side
  real(wp), intent(in) :: y(:)
  real(wp), intent(out) :: margin, by_state(:)
  real(wp) :: z(size(self%flows(2)%states)), value(self%flows(2)%tape%count), slopes(self%n)
  integer :: fault(self%flows(2)%tape%count)
  z = 0
  z(self%order) = y
  associate (system => self%machine%motor%system)
    call evaluate(self%flows(2)%tape, z, with_piece(self%flows(2), z, parameters_in(self, mode_stick, y)), value, fault)
    margin = system%body_level - side*value(system%body_hold(body_held))
    slopes = value(self%hold_slopes)
    by_state = -side*slopes(self%order)
  end associate
end subroutine release_margin

pure subroutine jump_of_body(self, event, t, y, after, by_state, by_time)
  class(motor_body_t), intent(in) :: self
  type(event_t), intent(in) :: event
  real(wp), intent(in) :: t, y(:)
  real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
  integer :: k
  by_time = 0*t
  by_state = 0
  do k = 1, self%n
    by_state(k, k) = 1
  end do
  after = y
  if (event%guard == turns_round) then
    after(angle_of) = y(angle_of) - sign(two_pi, y(speed_of))
    return
  end if
  select case (event%kind)
  case (event_impact_upper, event_impact_lower)
    call take_velocity(self, -self%machine%motor%system%contact%restitution, y, after, by_state)
    ! Without rebound nothing is left of the position but the instant.
    if (.not. abs(after(v_of)) > 0) by_state(:, x_of) = 0
    if (.not. abs(after(v_of)) > 0) after(x_of) = merge(self%upper, self%lower, event%kind == event_impact_upper)
  case (event_chatter_upper, event_chatter_lower)
    call take_velocity(self, 0.0_wp, y, after, by_state)
  case default
    after(v_of) = 0
    by_state(v_of, v_of) = 0
  end select
  if (rests_on_barrier(event%after)) then
    by_state(:, x_of) = 0
    after(x_of) = merge(self%upper, self%lower, event%after == mode_upper_barrier)
  end if
end subroutine jump_of_body

 !> The velocity times a `factor`; an unbalance throws the crank.
pure subroutine take_velocity(self, factor, y, after, by_state)
  class(motor_body_t), intent(in) :: self
  real(wp), intent(in) :: factor, y(:)
  real(wp), intent(inout) :: after(:), by_state(:, :)
  real(wp) :: sine, cosine, share
  after(v_of) = factor*y(v_of)
  by_state(v_of, v_of) = factor
  associate (system => self%machine%motor%system)
    if (.not. system%moment > 0) return
    call sine_cosine(y(angle_of), sine, cosine)
    share = system%moment/system%rotor_inertia*(factor - 1)
    after(speed_of) = y(speed_of) + share*sine*y(v_of)
    by_state(speed_of, v_of) = share*sine
    by_state(speed_of, angle_of) = share*cosine*y(v_of)
  end associate
end subroutine take_velocity

end module motor_body
