! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body by expressions as a hybrid machine. Its state is x [m], v [m/s] and the states of the case; the section is that of the
!> drive, and without one where x is largest or an angle comes to half a turn, as the last event of every return.
module own_body
  use guards, only: turns_round
  use hybrid_machine, only: event_t
  use constants, only: two_pi
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: log_t, mode_slip_minus, mode_stick, tally_t
  use motor_motion, only: advance_motor
  use motor_rest, only: slips
  use motor_system, only: body_held, both_move, guard_body_down, guard_body_up, phi_at, v_at, w_at, x_at
  use hybrid_flow, only: add_slope_nodes, fly, hybrid_flow_t, new_flow, rates_in, slopes_in, values_in
  use own_machine, only: own_machine_t
  use hybrid_body, only: event_of_section, guard_of_body, hybrid_body_t, jump_of_body, no_jump, rests_on_barrier
  use status, only: reason_time_over
  use turn_section, only: longest_return
  implicit none
  private

  public :: set_own_body, why_not_varied

  integer, parameter, public :: x_of = 1, v_of = 2
  !> A speed at an event that is none, in sizes, and one that has a direction alone: damping makes no force of it.
  real(wp), parameter :: no_speed = 1e-9_wp, direction_alone = 1e-30_wp
  !> A point this near to the section by an event, in sizes, is on it: it would be met again at once.
  real(wp), parameter :: near_section = 1e-9_wp

  type, extends(hybrid_body_t), public :: own_body_t
    type(own_machine_t) :: machine
    !> Flights of a body that slips, and of one that is held.
    type(hybrid_flow_t) :: flows(2)
    !> Derivatives by all variables of what is zero where the held body is released up (1) or down (2), nodes of the second tape,
    !> and of the restitution, nodes of the first tape.
    integer, allocatable :: release_slopes(:, :), restitution_slopes(:)
    real(wp), allocatable :: sizes(:)
  contains
    procedure :: rests => own_rests
    procedure :: rates_at
    procedure :: fly => fly_body
    procedure :: slope => slope_of_body
    procedure :: guard => guard_of_own
    procedure :: jump => jump_of_own
    procedure :: section_event => section_of_own
    procedure :: start => start_of_own
    procedure :: state_at => state_of_own
    procedure :: point_of => point_of_own
    procedure :: release_margin => margin_of_own
    procedure :: apply_impact => rebound
    procedure :: advance => advance_own
    procedure :: set_arrival => arrival_of_own
    procedure :: starts_of_section => starts_of_own
  end type own_body_t

contains

  !> Why the variations of a machine are not known, with the key of the case; '' if they are.
  pure function why_not_varied(machine) result(why)
    type(own_machine_t), intent(in) :: machine
    character(len=:), allocatable :: why
    why = ''
    if (machine%motor%system%aperiodic) then
      why = 'drive.period: missing, needed here: '//machine%section_obstacle()
    end if
  end function why_not_varied

  !> Makes the hybrid machine of a body whose `machine` is prepared. `sizes`: of a position [m] and of a speed [m/s];
  !> `smooth_turns`: no force depends on the direction.
  pure subroutine set_own_body(sizes, smooth_turns, body)
    real(wp), intent(in) :: sizes(2)
    logical, intent(in) :: smooth_turns
    type(own_body_t), intent(inout) :: body
    real(wp) :: scales(body%machine%motor%system%variables - x_at + 1)
    integer :: k
    associate (machine => body%machine, system => body%machine%motor%system)
      body%n = system%variables - x_at + 1
      body%positions = 1
      body%period = machine%period
      body%turn = machine%turn
      body%has_clock = machine%has_clock
      machine%by_event = .not. machine%has_clock
      body%lower = machine%lower
      body%upper = machine%upper
      body%barriers = [body%lower, body%upper]
      body%force_size = system%mass*sizes(2)*machine%drive_frequency
      body%smooth_turns = smooth_turns
      body%size_of = machine%scales(sizes(1))
      if (machine%by_event) body%size_of = [body%size_of(1), sizes(2), body%size_of(2:)]
      body%size_of = body%size_of(:body%n)
      body%size_of(v_of) = sizes(2)
      scales = body%size_of
      body%sizes = [machine%period, two_pi, scales]
      allocate (body%watched(2, body%n), source=0.0_wp)
      body%watched(1, x_of) = 1
      body%watched(2, v_of) = 1
      call new_flow(system, both_move, x_at, .true., body%flows(1))
      call new_flow(system, body_held, x_at, .true., body%flows(2))
      allocate (body%release_slopes(system%variables, 2), body%restitution_slopes(system%variables))
      associate (guards => system%flights(body_held, 0)%guards)
        do k = 1, 2
          call add_slope_nodes(body%flows(2), guards(merge(guard_body_up, guard_body_down, k == 1))%node, phi_at, &
                             body%release_slopes(:, k))
        end do
      end associate
      if (system%restitution > 0) call add_slope_nodes(body%flows(1), system%restitution, phi_at, body%restitution_slopes)
    end associate
  end subroutine set_own_body

  !> The variables of the equations at a time since the first section.
  pure function variables_at(self, t, y) result(z)
    class(own_body_t), intent(in) :: self
    real(wp), intent(in) :: t, y(:)
    real(wp) :: z(self%n + w_at)
    real(wp) :: time
    time = t - self%period*floor(t/self%period)
    z(:w_at) = time*[1.0_wp, two_pi/self%period]
    z(x_at:) = y
  end function variables_at

  !> The parameters of a body that slips in a direction.
  pure function parameters_in(self, slip) result(parameters)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: slip
    real(wp) :: parameters(size(self%machine%motor%system%sheet%parameters))
    parameters = self%machine%motor%system%sheet%parameters
    parameters(self%machine%motor%system%slip) = slip
  end function parameters_in

  pure integer function slip_in(mode)
    integer, intent(in) :: mode
    slip_in = merge(-1, 1, mode == mode_slip_minus)
  end function slip_in

  !> Whether something holds the body: without friction it rests where the forces are zero, as it would in a flight.
  pure logical function own_rests(self, mode)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: mode
    own_rests = .not. slips(mode) .and. .not. (self%smooth_turns .and. mode == mode_stick)
  end function own_rests

  !> Rates of a body without a clock in a mode, and their derivatives.
  pure subroutine rates_at(self, mode, y, rates, slopes)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: rates(:), slopes(:, :)
    real(wp) :: z(self%n + w_at), all(self%n + w_at)
    z = variables_at(self, 0.0_wp, y)
    associate (flow => self%flows(merge(2, 1, self%rests(mode))), parameters => parameters_in(self, slip_in(mode)))
      all = rates_in(flow, z, parameters)
      rates = all(x_at:)
      slopes = slopes_in(flow, z, parameters)
    end associate
  end subroutine rates_at

  pure subroutine fly_body(self, mode, t0, y0, t1, y1, flight)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t0, y0(:), t1
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    real(wp) :: z(self%n + w_at), slopes(self%n, self%n), parameters(size(self%machine%motor%system%sheet%parameters))
    real(wp) :: t, until
    integer :: k, turn, last
    k = merge(2, 1, self%rests(mode))
    y1 = y0
    if (k == 2) y1 = self%at_rest(mode, y0)
    if (present(flight)) then
      flight = 0
      do turn = 1, self%n
        flight(turn, turn) = 1
      end do
    end if
    parameters = parameters_in(self, slip_in(mode))
    t = t0
    turn = floor(t/self%period)
    last = floor(t1/self%period)
    ! Back from a section.
    if (t1 < t0 .and. .not. t0 > turn*self%period) turn = turn - 1
    do
      z(:w_at) = (t - turn*self%period)*[1.0_wp, two_pi/self%period]
      z(x_at:) = y1
      until = t1
      if (last > turn) until = (turn + 1)*self%period
      if (last < turn) until = max(turn*self%period, t1)
      if (present(flight)) then
        call fly(self%flows(k), parameters, self%sizes, until - t, z, slopes)
        if (abs(until - t) > 0) flight = matmul(slopes, flight)
      else
        call fly(self%flows(k), parameters, self%sizes, until - t, z)
      end if
      y1 = z(x_at:)
      t = until
      if (.not. abs(t1 - t) > 0) exit
      turn = turn + merge(1, -1, t1 > t0)
    end do
    if (.not. present(flight)) return
    if (k == 2) flight(:, v_of) = 0
    if (k == 2) flight(v_of, :) = 0
    if (rests_on_barrier(mode)) flight(:, x_of) = 0
    if (rests_on_barrier(mode)) flight(x_of, :) = 0
  end subroutine fly_body

  pure function slope_of_body(self, mode, t, y) result(slope)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t, y(:)
    real(wp) :: slope(size(y))
    real(wp) :: z(self%n + w_at), rates(self%n + w_at)
    z = variables_at(self, t, y)
    ! Where it comes to rest, the branches are those of the side from which it comes.
    if (slips(mode) .and. abs(z(v_at)) < no_speed*self%size_of(v_of)) z(v_at) = slip_in(mode)*direction_alone*self%size_of(v_of)
    rates = rates_in(self%flows(merge(2, 1, self%rests(mode))), z, parameters_in(self, slip_in(mode)))
    slope = rates(x_at:)
    if (.not. self%rests(mode)) slope(x_of) = y(v_of)
  end function slope_of_body

  pure subroutine margin_of_own(self, side, t, y, margin, by_state, by_time)
    class(own_body_t), intent(in) :: self
    integer, intent(in) :: side
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: margin, by_state(:), by_time
    real(wp) :: value(self%flows(2)%tape%count), slopes(self%n + w_at)
    integer :: k
    k = merge(1, 2, side > 0)
    value = values_in(self%flows(2), variables_at(self, t, y), parameters_in(self, 1))
    associate (guards => self%machine%motor%system%flights(body_held, 0)%guards)
      margin = -side*value(guards(merge(guard_body_up, guard_body_down, side > 0))%node)
    end associate
    slopes = -side*value(self%release_slopes(:, k))
    by_time = slopes(1) + slopes(w_at)*two_pi/self%period
    by_state = slopes(x_at:)
  end subroutine margin_of_own

  !> The velocity after an impact is v+ = -e v, where e may depend on everything.
  pure subroutine rebound(self, ends, t, y, after, by_state, by_time)
    class(own_body_t), intent(in) :: self
    logical, intent(in) :: ends
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(inout) :: after(:), by_state(:, :), by_time(:)
    real(wp) :: value(self%flows(1)%tape%count), slopes(self%n + w_at), restitution
    if (ends) then
      after(v_of) = 0
      by_state(v_of, v_of) = 0
      return
    end if
    slopes = 0
    restitution = self%machine%motor%system%contact%restitution
    if (self%machine%motor%system%restitution > 0) then
      value = values_in(self%flows(1), variables_at(self, t, y), parameters_in(self, merge(-1, 1, y(v_of) < 0)))
      restitution = value(self%machine%motor%system%restitution)
      slopes = value(self%restitution_slopes)
    end if
    after(v_of) = -restitution*y(v_of)
    by_state(v_of, :) = -y(v_of)*slopes(x_at:)
    by_state(v_of, v_of) = by_state(v_of, v_of) - restitution
    by_time(v_of) = -y(v_of)*(slopes(1) + slopes(w_at)*two_pi/self%period)
  end subroutine rebound

  pure subroutine start_of_own(self, values, section, ok)
    class(own_body_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
    call self%machine%start(values, section)
    ok = self%machine%allows(values)
  end subroutine start_of_own

  pure type(section_state_t) function state_of_own(self, point) result(section)
    class(own_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    real(wp) :: on(2)
    if (self%has_clock) then
      section = self%machine%state_at(point)
    else
      on = point(:v_of)
      if (self%turn > 0 .and. abs(abs(on(1)) - self%turn/2) <= near_section*self%turn .and. abs(on(2)) > 0) then
        on(1) = -sign(self%turn/2, on(2))
      else if (abs(on(2)) <= near_section*self%size_of(v_of)) then
        on(2) = 0
      end if
      call self%machine%start([on, 0.0_wp, point(v_of + 1:)], section)
    end if
  end function state_of_own

  pure function point_of_own(self, section) result(point)
    class(own_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    real(wp) :: point(self%n)
    point = [section%state%x, section%state%v, section%motor%own(:self%n - v_of)]
  end function point_of_own

  pure subroutine advance_own(self, section, tally, reason, log)
    class(own_body_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: start
    integer :: i
    logical :: passed
    if (self%has_clock) then
      call self%machine%advance_to_section(section, tally, reason, log)
      return
    end if
    start = section%state%time
    ! A flight knows its events to the rounding of all of it: one of 256 periods would end no sequence of small bounces.
    do i = 1, longest_return
      passed = .true.
      call advance_motor(self%machine%motor, section%state, section%motor, start + i*self%period, passed, tally, reason, log)
      if (reason /= 0 .or. passed) return
    end do
    reason = reason_time_over
  end subroutine advance_own

  !> The section of a machine without a clock: the velocity is zero, or the angle, upwards or downwards, half a turn.
  pure subroutine guard_of_own(self, event, t, y, value, by_state, by_time)
    class(own_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: value, by_state(:), by_time
    if (event%guard /= turns_round) then
      call guard_of_body(self, event, t, y, value, by_state, by_time)
      return
    end if
    by_state = 0
    by_time = 0
    if (event%side == 0) then
      value = y(v_of)
      by_state(v_of) = 1
    else
      value = y(x_of) - event%side*self%turn/2
      by_state(x_of) = 1
    end if
  end subroutine guard_of_own

  pure subroutine jump_of_own(self, event, t, y, after, by_state, by_time)
    class(own_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    if (event%guard == turns_round) then
      call no_jump(y, after, by_state, by_time)
      after(x_of) = y(x_of) - event%side*self%turn
    else
      call jump_of_body(self, event, t, y, after, by_state, by_time)
    end if
  end subroutine jump_of_own

  pure type(event_t) function section_of_own(self, section) result(event)
    class(own_body_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    event = event_of_section(self, section)
    event%guard = turns_round
    if (self%turn > 0 .and. abs(section%state%x) >= self%turn/2 .and. abs(section%state%v) > 0) then
      event%side = merge(1, -1, section%state%v > 0)
      event%arrival(x_of) = section%state%x + event%side*self%turn
    end if
  end function section_of_own

  pure subroutine arrival_of_own(self, log, i, sections, start, last, event)
    class(own_body_t), intent(in) :: self
    type(log_t), intent(in) :: log
    integer, intent(in) :: i, sections
    real(wp), intent(in) :: start(:)
    type(event_t), intent(in) :: last
    type(event_t), intent(inout) :: event
    real(wp) :: y(self%n)
    y = last%departure(:self%n)
    if (self%n > v_of) call self%fly(last%after, last%time, last%departure(:self%n), event%time, y)
    event%arrival(:self%n) = [log%event_data(2:3, i), y(3:)]
  end subroutine arrival_of_own

  pure function starts_of_own(self, watched, spread) result(points)
    class(own_body_t), intent(in) :: self
    real(wp), intent(in) :: watched(:, :)
    real(wp), intent(in), optional :: spread(:)
    real(wp) :: points(self%n, size(watched, 2))
    real(wp) :: share
    integer :: i, k
    points(x_of, :) = watched(1, :)
    points(v_of, :) = merge(watched(2, :), 0.0_wp, self%has_clock)
    share = 2
    do i = 1, 60
      share = (1 + share)**(1/real(self%n - 1, wp))
    end do
    do i = 1, size(watched, 2)
      points(3:, i) = self%machine%starts
      if (modulo(i, 2) == 1) cycle
      do k = 3, self%n
        points(k, i) = 2*self%size_of(k)*(2*modulo(0.5_wp + i*share**(2 - k), 1.0_wp) - 1)
        if (present(spread)) points(k, i) = self%machine%starts(k - v_of) + spread(i)*(points(k, i) - self%machine%starts(k - v_of))
      end do
    end do
  end function starts_of_own

end module own_body
