! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body with a motor as a hybrid machine without a clock. Its state is x [m], crank angle [rad], v [m/s], crank speed [rad/s], and
!> current [A] or integral [rad]. The section, the passage of the crank through a turn, is the last event of every cycle.
module motor_body
  use guards, only: turns_round
  use hybrid_machine, only: event_t
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: log_t, mode_stick, state_t, tally_t
  use hybrid_flow, only: add_slope_nodes, fly, hybrid_flow_t, new_flow, rates_in, values_in
  use motor_machine, only: motor_machine_t
  use motor_motion, only: advance_motor, start_motor
  use motor_system, only: body_held, both_move
  use motor_now, only: parameters_now
  use motor_rest, only: slips
  use motor_state, only: motor_state_t
  use status, only: reason_time_over
  use hybrid_body, only: event_of_section, guard_of_body, hybrid_body_t, jump_of_body, no_jump, rests_on_barrier
  implicit none
  private

  public :: set_motor_body, why_not_varied

  integer, parameter, public :: x_of = 1, angle_of = 2, v_of = 3, speed_of = 4, own_of = 5

  !> Longest return, in turns without load. Speeds of starts, as shares of that without load.
  integer, parameter :: longest = 256
  real(wp), parameter :: golden = 0.6180339887498949_wp, lowest_speed = 0.3_wp, highest_speed = 1.1_wp

  type, extends(hybrid_body_t), public :: motor_body_t
    type(motor_machine_t) :: machine
    !> Flights of a body that slips, and of one that is held.
    type(hybrid_flow_t) :: flows(2)
    !> Derivatives of the force that holds the body: nodes of the second tape.
    integer, allocatable :: hold_slopes(:)
    !> Variable of the equations for each coordinate of the state.
    integer, allocatable :: order(:)
  contains
    procedure :: fly => fly_body
    procedure :: slope => slope_of_body
    procedure :: guard => guard_of_motor
    procedure :: jump => jump_of_motor
    procedure :: start => start_of_motor
    procedure :: state_at => state_of_motor
    procedure :: point_of => point_of_motor
    procedure :: release_margin => margin_of_motor
    procedure :: apply_impact => take_velocity
    procedure :: advance => advance_turn
    procedure :: set_arrival => arrival_of_motor
    procedure :: section_event => passage
    procedure :: starts_of_section => starts_of_motor
  end type motor_body_t

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

  !> Makes the hybrid machine of a body whose `machine` is prepared. `sizes`: of a position [m] and of a speed [m/s].
  pure subroutine set_motor_body(sizes, body)
    real(wp), intent(in) :: sizes(2)
    type(motor_body_t), intent(inout) :: body
    integer, parameter :: order(5) = [3, 1, 4, 2, 5]
    associate (machine => body%machine, system => body%machine%motor%system)
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
      call new_flow(system, both_move, 1, .false., body%flows(1))
      call new_flow(system, body_held, 1, .false., body%flows(2))
      allocate (body%hold_slopes(body%n))
      call add_slope_nodes(body%flows(2), system%body_hold(body_held), 1, body%hold_slopes)
    end associate
  end subroutine set_motor_body

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

  pure subroutine start_of_motor(self, values, section, ok)
    class(motor_body_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
    call self%machine%start(values, section)
    ok = self%machine%allows(values)
  end subroutine start_of_motor

  pure type(section_state_t) function state_of_motor(self, point) result(section)
    class(motor_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    real(wp) :: own
    own = 0
    if (self%n == own_of) own = point(own_of)
    call start_motor(self%machine%motor, [point(x_of), point(v_of), 0.0_wp, point(speed_of), own], section%state, section%motor)
  end function state_of_motor

  pure function point_of_motor(self, section) result(y)
    class(motor_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    real(wp) :: y(self%n)
    y(:4) = [section%state%x, section%motor%phi, section%state%v, section%motor%w]
    if (self%n == own_of) y(own_of) = section%motor%own(1)
  end function point_of_motor

  pure subroutine fly_body(self, mode, t0, y0, t1, y1, flight)
    class(motor_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t0, y0(:), t1
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    real(wp) :: z(self%n), slopes(self%n, self%n), sizes(self%n)
    integer :: k
    k = merge(1, 2, slips(mode))
    associate (flow => self%flows(k), order => self%order)
      y1 = self%at_rest(mode, y0)
      z(order) = y1
      sizes(order) = self%size_of
      if (present(flight)) then
        call fly(flow, parameters_in(self, mode, y1), sizes, t1 - t0, z, slopes)
        flight = slopes(order, order)
        if (k == 2) flight(:, v_of) = 0
        if (rests_on_barrier(mode)) flight(:, x_of) = 0
      else
        call fly(flow, parameters_in(self, mode, y1), sizes, t1 - t0, z)
      end if
      y1 = z(order)
    end associate
  end subroutine fly_body

  pure function slope_of_body(self, mode, t, y) result(slope)
    class(motor_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t, y(:)
    real(wp) :: slope(size(y))
    real(wp) :: z(self%n), rates(self%n)
    z(self%order) = y + 0*t
    rates = rates_in(self%flows(merge(1, 2, slips(mode))), z, parameters_in(self, mode, y))
    slope = rates(self%order)
  end function slope_of_body

  pure subroutine guard_of_motor(self, event, t, y, value, by_state, by_time)
    class(motor_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: value, by_state(:), by_time
    if (event%guard /= turns_round) then
      call guard_of_body(self, event, t, y, value, by_state, by_time)
      return
    end if
    value = y(angle_of) - sign(two_pi, y(speed_of))
    by_state = 0
    by_state(angle_of) = 1
    by_time = 0
  end subroutine guard_of_motor

  pure subroutine margin_of_motor(self, side, t, y, margin, by_state, by_time)
    class(motor_body_t), intent(in) :: self
    integer, intent(in) :: side
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: margin, by_state(:), by_time
    real(wp) :: z(self%n), value(self%flows(2)%tape%count), slopes(self%n)
    by_time = 0
    z(self%order) = y
    associate (system => self%machine%motor%system)
      value = values_in(self%flows(2), z, parameters_in(self, mode_stick, y))
      margin = system%body_level - side*value(system%body_hold(body_held))
      slopes = value(self%hold_slopes)
      by_state = -side*slopes(self%order)
    end associate
  end subroutine margin_of_motor

  pure subroutine jump_of_motor(self, event, t, y, after, by_state, by_time)
    class(motor_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    if (event%guard /= turns_round) then
      call jump_of_body(self, event, t, y, after, by_state, by_time)
      return
    end if
    call no_jump(y, after, by_state, by_time)
    after(angle_of) = y(angle_of) - sign(two_pi, y(speed_of))
  end subroutine jump_of_motor

  !> The velocity times a factor, -e or 0 where a chatter ends; an unbalance throws the crank.
  pure subroutine take_velocity(self, ends, t, y, after, by_state, by_time)
    class(motor_body_t), intent(in) :: self
    logical, intent(in) :: ends
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(inout) :: after(:), by_state(:, :), by_time(:)
    real(wp) :: factor, sine, cosine, share
    associate (system => self%machine%motor%system)
      factor = merge(0.0_wp, -system%contact%restitution, ends)
      after(v_of) = factor*y(v_of)
      by_state(v_of, v_of) = factor
      if (.not. system%moment > 0) return
      call sine_cosine(y(angle_of), sine, cosine)
      share = system%moment/system%rotor_inertia*(factor - 1)
      after(speed_of) = y(speed_of) + share*sine*y(v_of)
      by_state(speed_of, v_of) = share*sine
      by_state(speed_of, angle_of) = share*cosine*y(v_of)
    end associate
  end subroutine take_velocity

  pure subroutine advance_turn(self, section, tally, reason, log)
    class(motor_body_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    logical :: passed
    if (.not. present(log)) then
      call self%machine%advance_to_section(section, tally, reason)
      return
    end if
    passed = .true.
    associate (state => section%state, crank => section%motor)
      call advance_motor(self%machine%motor, state, crank, state%time + longest*self%period, passed, tally, reason, log)
      if (reason == 0 .and. .not. (passed .and. crank%turning == crank%passed_last)) reason = reason_time_over
    end associate
  end subroutine advance_turn

  pure subroutine arrival_of_motor(self, log, i, sections, start, last, event)
    class(motor_body_t), intent(in) :: self
    type(log_t), intent(in) :: log
    integer, intent(in) :: i, sections
    real(wp), intent(in) :: start(:)
    type(event_t), intent(in) :: last
    type(event_t), intent(inout) :: event
    real(wp) :: flown(self%n)
    event%arrival([x_of, v_of]) = log%event_data(2:3, i)
    event%arrival([angle_of, speed_of]) = log%event_driver(:, i) - [sign(two_pi, start(speed_of))*sections, 0.0_wp]
    if (self%n < own_of) return
    call self%fly(last%after, last%time, last%departure(:self%n), event%time, flown)
    event%arrival(own_of) = flown(own_of)
  end subroutine arrival_of_motor

  !> The crank at the end of a turn.
  pure type(event_t) function passage(self, section) result(event)
    class(motor_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    event = event_of_section(self, section)
    event%guard = turns_round
    event%departure(angle_of) = 0
    event%arrival(angle_of) = sign(two_pi, section%motor%w)
  end function passage

  pure function starts_of_motor(self, watched, spread) result(points)
    class(motor_body_t), intent(in) :: self
    real(wp), intent(in) :: watched(:, :)
    real(wp), intent(in), optional :: spread(:)
    real(wp) :: points(self%n, size(watched, 2))
    real(wp) :: share
    integer :: i
    points = 0
    points(x_of, :) = watched(1, :)
    points(v_of, :) = watched(2, :)
    do i = 1, size(watched, 2)
      share = modulo(0.5_wp + i*golden, 1.0_wp)
      points(speed_of, i) = self%size_of(speed_of)*(lowest_speed + (highest_speed - lowest_speed)*share)
      if (modulo(i, 2) == 1 .and. abs(self%machine%own_start(1)) > 0) points(speed_of, i) = self%machine%own_start(1)
      if (self%n == own_of) points(own_of, i) = self%machine%own_start(2)
    end do
  end function starts_of_motor

end module motor_body
