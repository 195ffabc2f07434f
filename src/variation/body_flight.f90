! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A slip of one body over a given time, and its derivative by its start: on the closed form where that exists, also between
!> passages of a Stribeck layer, else on the equations of motion and of their variation. Modes are those of module `one_body`.
module body_flight
  use contact_law, only: contact_force, contact_force_slopes, contact_margin, margin_is_curved
  use drive_law, only: foot_motion
  use effect_law, only: slip_memory_t
  use elementary, only: exponential, sine_cosine
  use exact_flight, only: flight_speed_reached, fly_exact
  use exact_flow, only: begin_segment, evaluate, flow_t, kinematics_t, segment_t
  use friction_law, only: sliding_slope
  use guarded_march, only: begin_march, guard_t, march_failed, march_t, march_time_over, take_step, watched_system_t
  use kinds, only: wp
  use layer_transit, only: cross_layer
  use motion, only: motion_t
  use motion_state, only: state_t, tally_t
  use oscillator, only: oscillator_t
  use restoring_law, only: restoring_stiffness
  use slip_force, only: direction_in, pressed_side, pushes, quarter, slip_acceleration, surface_of
  use table_pieces, only: enter_pieces, list_ends, margin_of_end, most_ends, piece_end_t, extension_above, push_ends, push_returns
  implicit none
  private

  public :: fly_slip

  !> A Stribeck layer is marched through from its edge, and left at this multiple of it.
  real(wp), parameter :: layer_exit = 1.25_wp
  integer, parameter :: most_steps = 100000
  !> After a stop in the layer the law is followed up to this share of Stribeck's velocity.
  real(wp), parameter :: half_way = 0.5_wp
  !> Guards: the speed rises to where it is to end, the force of a barrier is cut off or comes back; after them the ends of pieces
  !> of tables.
  integer, parameter :: exits = 1, cut_off = 2, most_cuts = cut_off + most_ends

  !> Position and velocity, and after them the derivatives of both by the start, column by column.
  type, extends(watched_system_t) :: slip_t
    type(oscillator_t) :: machine
    !> Steps of the differences of laws.
    real(wp) :: step_of(2) = 1
    integer :: mode = 0
    real(wp) :: start = 0
    logical :: pushing = .true.
    !> The pieces of the tables that the slip keeps to.
    type(slip_memory_t) :: pieces
  contains
    procedure :: slope => slope_of_slip
    procedure :: margin => extension_margin
  end type slip_t

contains

  !> The state `y1` that a slip brings `y0` at `t0` to at `t1` [s], and its derivative by `y0`. `sizes` are those of x and v,
  !> `steps` of the differences of laws.
  pure subroutine fly_slip(moving, sizes, steps, mode, t0, y0, t1, y1, flight)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: sizes(2), steps(2), t0, y0(:), t1
    integer, intent(in) :: mode
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    real(wp) :: position(2)
    integer :: side
    side = pressed_side(mode)
    if (side == 0 .and. moving%exact .and. .not. moving%layer > 0) then
      call fly_closed(moving%flow, direction_in(mode), t0, y0, t1, y1, flight)
    else if (side /= 0 .and. moving%pressed%available) then
      position = [surface_of(moving%machine, side), 0.0_wp]
      call fly_closed(moving%pressed%flow(side), direction_in(mode), t0, y0 - position, t1, y1, flight)
      y1 = y1 + position
    else
      call fly_by_steps(moving, sizes, steps, mode, t0, y0, t1, y1, flight)
    end if
  end subroutine fly_slip

  !> The same where it has no closed form from end to end. Apart from it, for a copy of the machine costs more than a closed form.
  pure subroutine fly_by_steps(moving, sizes, steps, mode, t0, y0, t1, y1, flight)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: sizes(2), steps(2), t0, y0(:), t1
    integer, intent(in) :: mode
    real(wp), intent(out) :: y1(:)
    real(wp), intent(out), optional :: flight(:, :)
    type(slip_t) :: system
    real(wp) :: t
    system%machine = moving%machine
    system%step_of = steps
    system%mode = mode
    y1 = y0
    t = t0
    if (present(flight)) flight = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    if (pressed_side(mode) == 0 .and. moving%exact .and. t1 > t0) then
      call cross_layers(moving, system, sizes, t, t1, y1, flight)
    else
      call march(moving, system, sizes, t, t1, huge(1.0_wp), y1, flight)
    end if
  end subroutine fly_by_steps

  !> With z = y' + g y + i w_d y a linear slip is z' = (-g + i w_d) z + forcing: its derivative by the start is a decaying
  !> rotation.
  pure subroutine fly_closed(flow, direction, t0, y0, t1, y1, flight)
    type(flow_t), intent(in) :: flow
    integer, intent(in) :: direction
    real(wp), intent(in) :: t0, y0(2), t1
    real(wp), intent(out) :: y1(2)
    real(wp), intent(out), optional :: flight(2, 2)
    type(segment_t) :: segment
    type(kinematics_t) :: now
    call begin_segment(flow, t0, y0(1), y0(2), direction, segment)
    call evaluate(flow, segment, t1 - t0, now)
    y1 = [now%x, now%v]
    if (present(flight)) flight = closed_derivative(flow, t1 - t0)
  end subroutine fly_closed

  pure function closed_derivative(flow, span) result(flight)
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: span
    real(wp) :: flight(2, 2), s, c
    if (flow%overdamped) then
      associate (slow => flow%slow, fast => flow%fast)
        s = exponential(-slow*span)/(fast - slow)
        c = exponential(-fast*span)/(fast - slow)
        flight(:, 1) = [fast*s - slow*c, -slow*fast*(s - c)]
        flight(:, 2) = [s - c, fast*c - slow*s]
      end associate
      return
    end if
    call sine_cosine(flow%damped*span, s, c)
    s = s/flow%damped
    flight(:, 1) = [c + flow%decay*s, -flow%natural**2*s]
    flight(:, 2) = [s, c - flow%decay*s]
    flight = exponential(-flow%decay*span)*flight
  end function closed_derivative

  !> Outside the layer, where Stribeck's excess is nil to rounding, on the closed form, from edge to edge; inside in one stroke
  !> where the body passes straight through, else by steps.
  pure subroutine cross_layers(moving, system, sizes, t, t1, y, flight)
    type(motion_t), intent(in) :: moving
    type(slip_t), intent(inout) :: system
    real(wp), intent(in) :: sizes(2), t1
    real(wp), intent(inout) :: t, y(2)
    real(wp), intent(inout), optional :: flight(2, 2)
    type(state_t) :: state
    type(tally_t) :: unused
    integer :: direction, outcome, i
    logical :: ok
    direction = direction_in(system%mode)
    do i = 1, most_steps
      if (direction*y(2) > moving%layer) then
        state = state_t(x=y(1), v=y(2), mode=system%mode, time=t)
        call fly_exact(moving%flow, state, t1, moving%layer, direction*huge(1.0_wp), unused, outcome)
        if (present(flight)) flight = matmul(closed_derivative(moving%flow, state%time - t), flight)
        y = [state%x, state%v]
        t = state%time
        ok = outcome == flight_speed_reached .and. t < t1
      else
        ok = .not. abs(y(2)) > 0 .and. t < t1
      end if
      if (ok) call cross_straight(moving, system, t1, t, y, ok, flight)
      if (.not. ok .and. .not. direction*y(2) > moving%layer) then
        call march(moving, system, sizes, t, t1, layer_exit*moving%layer, y, flight)
      end if
      if (t >= t1) exit
    end do
    ! A layer that is crossed in one stroke may end a little later.
    if (t > t1) call march(moving, system, sizes, t, t1, huge(1.0_wp), y, flight)
  end subroutine cross_layers

  !> From the edge of the layer to rest, or from rest to its edge. With the speed as the independent variable the variations are
  !> those of time and position; `t1` may be passed on the way to rest, by half of it.
  pure subroutine cross_straight(moving, system, t1, t, y, ok, flight)
    type(motion_t), intent(in) :: moving
    type(slip_t), intent(in) :: system
    real(wp), intent(in) :: t1
    real(wp), intent(inout) :: t, y(2)
    logical, intent(out) :: ok
    real(wp), intent(inout), optional :: flight(2, 2)
    real(wp) :: time, x, v, rate, across(2, 2), into(2, 2), out_of(2, 2)
    integer :: direction
    logical :: inward
    ok = moving%transit%available
    if (.not. ok) return
    direction = direction_in(system%mode)
    inward = abs(y(2)) > 0
    time = t
    x = y(1)
    if (present(flight)) then
      call cross_layer(moving%transit, moving%flow, direction, inward, huge(t1), time, x, ok, across)
    else
      call cross_layer(moving%transit, moving%flow, direction, inward, huge(t1), time, x, ok)
    end if
    if (inward) ok = ok .and. time - t1 < 0.5_wp*(time - t)
    if (.not. inward) ok = ok .and. time <= t1
    if (.not. ok) return
    v = direction*merge(0.0_wp, moving%transit%exit, inward)
    if (present(flight)) then
      rate = slip_acceleration(system%machine, system%mode, .false., t, y(1), y(2))
      into = reshape([0.0_wp, 1.0_wp, -1/rate, -y(2)/rate], [2, 2])
      rate = slip_acceleration(system%machine, system%mode, .false., time, x, v)
      out_of = reshape([-v, -rate, 1.0_wp, 0.0_wp], [2, 2])
      flight = matmul(out_of, matmul(across, matmul(into, flight)))
    end if
    t = time
    y = [x, v]
    if (.not. inward .or. t >= t1) return
    rate = slip_acceleration(system%machine, system%mode, .false., t, x, v)
    if ((t1 - t)*abs(rate) <= half_way*system%machine%friction%stribeck_velocity) return
    ! The slip has ended here; what is asked long after is asked on the way to a solution, and any continuation will do.
    y = y + (t1 - t)*[0.5_wp*(t1 - t)*rate, rate]
    if (present(flight)) flight(1, :) = flight(1, :) + (t1 - t)*flight(2, :)
    t = t1
  end subroutine cross_straight

  !> By steps up to `t1`, but no further than to where the speed rises to `exit`; backwards by the mirrored equations.
  pure subroutine march(moving, system, sizes, t, t1, exit, y, flight)
    type(motion_t), intent(in) :: moving
    type(slip_t), intent(inout) :: system
    real(wp), intent(in) :: sizes(2), t1, exit
    real(wp), intent(inout) :: t, y(2)
    real(wp), intent(inout), optional :: flight(2, 2)
    type(march_t) :: steps
    type(guard_t) :: cut(most_cuts)
    real(wp) :: scale(6), time, span, all(6)
    integer :: triggered, i, n, mode, count_cuts
    span = t1 - t
    if (.not. abs(span) > 0) return
    n = merge(6, 2, present(flight))
    all = [y, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp]
    scale = [sizes, 1.0_wp, sizes(2)/sizes(1), sizes(1)/sizes(2), 1.0_wp]
    mode = system%mode
    system%start = t
    if (span < 0) system%start = -t
    if (span < 0) system%mode = -mode
    system%pushing = pushes(system%machine, mode, y)
    time = 0
    triggered = cut_off
    do i = 1, most_steps
      if (triggered > 0) then
        call list_cuts(system, mode, exit, time, all(1:2), cut, count_cuts)
        call begin_march(steps, system, moving%options%tolerance, scale(:n), abs(span), time, all(:n))
      end if
      call take_step(steps, system, cut(:count_cuts), abs(span), triggered)
      time = steps%time
      all(:n) = steps%y(:n)
      if (triggered == march_time_over .or. triggered == march_failed .or. triggered == exits) then
        exit
      else if (triggered == cut_off) then
        system%pushing = .not. system%pushing
      end if
    end do
    t = t1
    if (triggered == exits) t = t + sign(time, span) - span
    y = all(1:2)
    if (present(flight)) flight = matmul(reshape(all(3:6), [2, 2]), flight)
    if (triggered /= march_time_over .and. triggered /= exits) y = huge(1.0_wp)
    if (.not. y(1) < huge(1.0_wp)) t = t1
    system%mode = mode
  end subroutine march

  !> What cuts a march from the state `y` on at `time`; never, where there is no such thing. Keeps the slip to the pieces of the
  !> tables that it is in there.
  pure subroutine list_cuts(system, mode, exit, time, y, cut, count_cuts)
    type(slip_t), intent(inout) :: system
    integer, intent(in) :: mode
    real(wp), intent(in) :: exit, time, y(2)
    type(guard_t), intent(out) :: cut(most_cuts)
    integer, intent(out) :: count_cuts
    real(wp) :: margin(3)
    integer :: side
    side = pressed_side(mode)
    cut%constant = 1
    count_cuts = cut_off
    if (exit < huge(exit)) then
      cut(exits)%constant = exit
      cut(exits)%coefficients(2) = -direction_in(mode)
    end if
    if (side /= 0 .and. .not. system%machine%contact%tension) then
      margin = merge(1, -1, system%pushing)*contact_margin(system%machine%contact)
      cut(cut_off)%constant = margin(1) - side*surface_of(system%machine, side)*margin(2)
      cut(cut_off)%coefficients(1:2) = side*margin(2:3)
      if (margin_is_curved(system%machine%contact)) cut(cut_off) = guard_t(margin=merge(push_ends, push_returns, system%pushing))
    end if
    if (system%machine%effects%by_table) call keep_to_pieces(system, direction_in(mode), time, y, cut, count_cuts)
  end subroutine list_cuts

  pure subroutine keep_to_pieces(system, direction, time, y, cut, count_cuts)
    type(slip_t), intent(inout) :: system
    integer, intent(in) :: direction
    real(wp), intent(in) :: time, y(2)
    type(guard_t), intent(inout) :: cut(most_cuts)
    integer, intent(inout) :: count_cuts
    type(piece_end_t) :: ends(most_ends)
    integer :: i, count_ends
    system%pieces%direction = direction
    call enter_pieces(system%machine%effects, y(1), y(2), extension_margin(system, extension_above, time, y), system%pieces)
    call list_ends(system%machine%effects, system%pieces, ends, count_ends)
    do i = 1, count_ends
      associate (guard => cut(count_cuts + i))
        call margin_of_end(ends(i), real(direction, wp), guard%constant, guard%coefficients(1:2), guard%margin)
      end associate
    end do
    count_cuts = count_cuts + count_ends
  end subroutine keep_to_pieces

  !> The extension [m] of the spring, or the force of the soft barrier [N], with the sign that it has in a margin.
  pure real(wp) function extension_margin(self, number, time, y) result(margin)
    class(slip_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    real(wp) :: foot
    if (any(number == [push_ends, push_returns])) then
      margin = merge(1, -1, number == push_ends)*push_at(self, y)
      return
    end if
    call foot_motion(self%machine%drive, self%machine%drive_frequency*sign(1, self%mode)*(self%start + time), foot)
    margin = merge(1, -1, number == extension_above)*(self%machine%restoring%free_length + foot - y(1))
  end function extension_margin

  !> Force that the formula of the soft barrier gives [N].
  pure real(wp) function push_at(slip, y)
    class(slip_t), intent(in) :: slip
    real(wp), intent(in) :: y(:)
    integer :: side
    side = pressed_side(abs(slip%mode))
    push_at = contact_force(slip%machine%contact, side*(y(1) - surface_of(slip%machine, side)), side*y(2))
  end function push_at

  pure function slope_of_slip(self, time, y) result(slope)
    class(slip_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y)), t, by(2)
    integer :: way, mode
    way = sign(1, self%mode)
    mode = abs(self%mode)
    t = way*(self%start + time)
    slope(1:2) = [y(2), slip_acceleration(self%machine, mode, self%pushing, t, y(1), y(2), self%pieces)]
    if (size(y) > 2) then
      by = acceleration_slopes(self, mode, t, y(1), y(2))
      slope(3:4) = [y(4), sum(by*y(3:4))]
      slope(5:6) = [y(6), sum(by*y(5:6))]
    end if
    slope = way*slope
  end function slope_of_slip

  !> Derivatives of the acceleration by x and v; of effects by differences.
  pure function acceleration_slopes(self, mode, t, x, v) result(by)
    class(slip_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t, x, v
    real(wp) :: by(2), foot
    integer :: side
    associate (machine => self%machine)
      if (machine%extra) then
        by(1) = quarter(free_at(-2, 0), free_at(-1, 0), free_at(1, 0), free_at(2, 0))/self%step_of(1)
        by(2) = quarter(free_at(0, -2), free_at(0, -1), free_at(0, 1), free_at(0, 2))/self%step_of(2)
      else
        foot = 0
        if (.not. machine%restoring%is_linear) call foot_motion(machine%drive, machine%drive_frequency*t, foot)
        by(1) = -restoring_stiffness(machine%restoring, machine%restoring%free_length + foot - x)/machine%mass
        by(2) = sliding_slope(machine%friction, v, real(direction_in(mode), wp))/machine%mass
      end if
      side = pressed_side(mode)
      if (side /= 0 .and. self%pushing) by = by - &
        contact_force_slopes(machine%contact, side*(x - surface_of(machine, side)), side*v)/machine%mass
    end associate

  contains

    !> Acceleration without the barrier, off the state by steps.
    pure real(wp) function free_at(i, k) result(a)
      integer, intent(in) :: i, k
      a = slip_acceleration(self%machine, mode, .false., t, x + i*self%step_of(1), v + k*self%step_of(2), self%pieces)
    end function free_at

  end function acceleration_slopes

end module body_flight
