! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body as a hybrid machine, its state being x [m] and v [m/s]: slips on the closed form where that exists, else on the
!> equations of motion and of their variation; impacts, turning points, sticking, release, soft contact, completed chatter.
module one_body
  use contact_flight, only: contact_side
  use contact_law, only: contact_force, contact_force_slopes, contact_margin, force_on_body, velocity_after_impact
  use drive_law, only: foot_motion
  use effect_law, only: break_away_level, slip_memory_t
  use exact_flow, only: begin_segment, evaluate, flow_t, kinematics_t, segment_t
  use elementary, only: exponential, sine_cosine
  use friction_law, only: sliding_friction
  use guarded_march, only: begin_march, guard_t, march_failed, march_t, march_time_over, system_t, take_step
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion, only: motion_t
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, &
    event_turning_point, mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, mode_upper_barrier, state_t
  use oscillator, only: extra_force, holding_force
  use restoring_law, only: restoring_force
  implicit none
  private

  public :: one_body_of, has_variation, mode_of_body, slips_in, direction_in, rests_on_barrier, turns_smoothly

  !> Added to a slip's mode while the body presses the upper or the lower soft barrier.
  integer, parameter :: on_upper = 10, on_lower = 20
  !> Steps of the differences that stand in for derivatives of laws, as a share of the natural size: of fourth order.
  real(wp), parameter :: step = merge(3e-4_wp, 1e-6_wp, epsilon(1.0_wp) > 1e-20_wp)
  integer, parameter :: most_steps = 100000

  type, extends(hybrid_t), public :: one_body_t
    type(motion_t) :: moving
    !> Natural sizes of x and v, and the steps of the differences of laws.
    real(wp) :: size_of(2) = 1, step_of(2) = 1
  contains
    procedure :: fly => fly_body
    procedure :: slope => slope_of_body
    procedure :: guard => guard_of_body
    procedure :: jump => jump_of_body
  end type one_body_t

  !> Position, velocity, and the derivatives of both by the start, column by column.
  type, extends(system_t) :: varied_slip_t
    type(one_body_t) :: body
    integer :: mode = 0
    real(wp) :: start = 0
    logical :: pushing = .true.
  contains
    procedure :: slope => slope_of_varied
  end type varied_slip_t

contains

  !> Whether the variations of a machine are known: one body whose motion from a section depends on x and v alone.
  pure logical function has_variation(moving)
    type(motion_t), intent(in) :: moving
    has_variation = .not. allocated(moving%pair) .and. .not. allocated(moving%jointed)
    if (.not. has_variation) return
    has_variation = .not. moving%machine%effects%dahl_stiffness > 0 .and. .not. moving%machine%drive%interval > 0 .and. &
                    .not. moving%machine%contact%by_impact
    ! A Stribeck law that is vertical at rest has no derivative there.
    associate (law => moving%machine%friction)
      if (law%excess > 0) has_variation = has_variation .and. law%stribeck_exponent >= 1
      if (law%second_excess > 0) has_variation = has_variation .and. law%second_exponent >= 1
    end associate
  end function has_variation

  !> The hybrid machine of a body. `size_of_x` [m] is the size of the motion, for differences of laws.
  pure function one_body_of(moving, size_of_x) result(body)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: size_of_x
    type(one_body_t) :: body
    body%moving = moving
    body%n = 2
    body%period = moving%machine%period
    body%size_of = size_of_x*[1.0_wp, moving%machine%drive_frequency]
    body%step_of = body%size_of
    associate (law => moving%machine%friction)
      if (law%excess > 0) body%step_of(2) = min(body%step_of(2), law%stribeck_velocity)
      if (law%second_excess > 0) body%step_of(2) = min(body%step_of(2), law%second_velocity)
    end associate
    body%step_of = step*body%step_of
  end function one_body_of

  !> Mode of a state of the event loop.
  pure integer function mode_of_body(self, state) result(mode)
    class(one_body_t), intent(in) :: self
    type(state_t), intent(in) :: state
    mode = state%mode
    if (.not. slips_in(mode)) return
    select case (contact_side(self%moving%machine%contact, state%x, direction_in(mode)))
    case (1)
      mode = mode + on_upper
    case (-1)
      mode = mode + on_lower
    end select
    if (.not. self%moving%machine%contact%soft) mode = state%mode
  end function mode_of_body

  !> Whether the body slips in a mode.
  pure elemental logical function slips_in(mode)
    integer, intent(in) :: mode
    slips_in = modulo(mode, 10) == mode_slip_plus .or. modulo(mode, 10) == mode_slip_minus
  end function slips_in

  !> Direction of the slip, 0 at rest.
  pure elemental integer function direction_in(mode)
    integer, intent(in) :: mode
    direction_in = 0
    if (modulo(mode, 10) == mode_slip_plus) direction_in = 1
    if (modulo(mode, 10) == mode_slip_minus) direction_in = -1
  end function direction_in

  !> Whether the body rests on a rigid barrier, which makes it forget where it came from.
  pure elemental logical function rests_on_barrier(mode)
    integer, intent(in) :: mode
    rests_on_barrier = mode == mode_upper_barrier .or. mode == mode_lower_barrier
  end function rests_on_barrier

  !> Whether a turning point is no event: no force depends on the direction of the motion.
  pure logical function turns_smoothly(self)
    class(one_body_t), intent(in) :: self
    associate (machine => self%moving%machine)
      turns_smoothly = .not. (machine%friction%kinetic > 0 .or. machine%friction%excess > 0 .or. machine%friction%break_away > 0)
      if (machine%effects%present) turns_smoothly = turns_smoothly .and. .not. (abs(machine%effects%quadratic_drag) > 0 .or. &
        abs(machine%effects%asymmetric_viscous) > 0 .or. abs(machine%effects%asymmetric_coulomb) > 0)
    end associate
  end function turns_smoothly

  !> Side of the soft barrier that is pressed in a mode, 0 without.
  pure elemental integer function pressed_side(mode)
    integer, intent(in) :: mode
    pressed_side = 0
    if (mode > on_upper .and. mode < on_lower) pressed_side = 1
    if (mode > on_lower) pressed_side = -1
  end function pressed_side

  pure subroutine fly_body(self, mode, t0, y0, t1, y1, flight)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t0, y0(:), t1
    real(wp), intent(out) :: y1(:), flight(:, :)
    integer :: side
    side = pressed_side(mode)
    if (.not. slips_in(mode)) then
      y1 = [y0(1), 0.0_wp]
      flight = 0
      if (mode == mode_stick) flight(1, 1) = 1
      if (mode == mode_upper_barrier) y1(1) = self%moving%machine%contact%upper
      if (mode == mode_lower_barrier) y1(1) = self%moving%machine%contact%lower
    else if (side == 0 .and. self%moving%exact .and. .not. self%moving%layer > 0) then
      call fly_closed(self%moving%flow, direction_in(mode), t0, y0, t1, y1, flight)
    else if (side /= 0 .and. self%moving%pressed%available) then
      call fly_closed(self%moving%pressed%flow(side), direction_in(mode), t0, y0 - [surface_of(self, side), 0.0_wp], t1, y1, &
                      flight)
      y1(1) = y1(1) + surface_of(self, side)
    else
      call march_body(self, mode, t0, y0, t1, y1, flight)
    end if
  end subroutine fly_body

  !> With z = y' + g y + i w_d y a linear slip is z' = (-g + i w_d) z + forcing: its derivative by the start is a decaying
  !> rotation.
  pure subroutine fly_closed(flow, direction, t0, y0, t1, y1, flight)
    type(flow_t), intent(in) :: flow
    integer, intent(in) :: direction
    real(wp), intent(in) :: t0, y0(2), t1
    real(wp), intent(out) :: y1(2), flight(2, 2)
    type(segment_t) :: segment
    type(kinematics_t) :: now
    real(wp) :: s, c
    call begin_segment(flow, t0, y0(1), y0(2), direction, segment)
    call evaluate(flow, segment, t1 - t0, now)
    y1 = [now%x, now%v]
    call sine_cosine(flow%damped*(t1 - t0), s, c)
    s = s/flow%damped
    flight(:, 1) = [c + flow%decay*s, -flow%natural**2*s]
    flight(:, 2) = [s, c - flow%decay*s]
    flight = exponential(-flow%decay*(t1 - t0))*flight
  end subroutine fly_closed

  !> The same for any other slip. Forward in time only; backwards from the end by the mirrored equations.
  pure subroutine march_body(self, mode, t0, y0, t1, y1, flight)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t0, y0(2), t1
    real(wp), intent(out) :: y1(2), flight(2, 2)
    type(varied_slip_t) :: system
    type(march_t) :: march
    type(guard_t) :: cut(1)
    real(wp) :: y(6), scale(6), time, span
    integer :: fallen, i
    y1 = y0
    flight = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    span = t1 - t0
    if (.not. abs(span) > 0) return
    system%body = self
    system%mode = mode
    system%start = t0
    ! Backward in time the slope is turned round.
    if (span < 0) system%start = -t0
    y = [y0, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp]
    scale = [self%size_of, 1.0_wp, self%size_of(2)/self%size_of(1), self%size_of(1)/self%size_of(2), 1.0_wp]
    if (span < 0) system%mode = -mode
    system%pushing = pushes(self, mode, y0)
    cut = cut_of(self, mode, system%pushing)
    time = 0
    call begin_march(march, system, self%moving%options%tolerance, scale, abs(span), time, y)
    do i = 1, most_steps
      call take_step(march, system, cut, abs(span), fallen)
      if (fallen == march_time_over .or. fallen == march_failed) exit
      if (fallen > 0) then
        system%pushing = .not. system%pushing
        cut = cut_of(self, mode, system%pushing)
        y = march%y(:6)
        time = march%time
        call begin_march(march, system, self%moving%options%tolerance, scale, abs(span), time, y)
      end if
    end do
    y1 = march%y(1:2)
    flight = reshape(march%y(3:6), [2, 2])
    if (fallen /= march_time_over) y1 = huge(1.0_wp)
  end subroutine march_body

  !> Whether the force of a soft barrier that may not pull is there: not on a flight off it, and not where it would pull.
  pure logical function pushes(self, mode, y)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(2)
    integer :: side
    side = pressed_side(mode)
    pushes = side /= 0
    if (.not. pushes .or. self%moving%machine%contact%tension) return
    pushes = sum(contact_margin(self%moving%machine%contact)*[1.0_wp, side*(y(1) - surface_of(self, side)), side*y(2)]) >= 0
  end function pushes

  !> The guard at which the force of a soft barrier is cut off or comes back; never, where it is not.
  pure function cut_of(self, mode, pushing) result(cut)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    logical, intent(in) :: pushing
    type(guard_t) :: cut(1)
    real(wp) :: margin(3)
    integer :: side
    side = pressed_side(mode)
    cut(1)%constant = 1
    if (side == 0 .or. self%moving%machine%contact%tension) return
    margin = merge(1, -1, pushing)*contact_margin(self%moving%machine%contact)
    cut(1)%constant = margin(1) - side*surface_of(self, side)*margin(2)
    cut(1)%coefficients(1:2) = side*margin(2:3)
  end function cut_of

  pure function slope_of_varied(self, time, y) result(slope)
    class(varied_slip_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y)), by_x, by_v, t, pressed(2)
    integer :: way, mode, side
    way = sign(1, self%mode)
    mode = abs(self%mode)
    t = way*(self%start + time)
    by_x = quarter(free_at(-2, 0), free_at(-1, 0), free_at(1, 0), free_at(2, 0))/self%body%step_of(1)
    by_v = quarter(free_at(0, -2), free_at(0, -1), free_at(0, 1), free_at(0, 2))/self%body%step_of(2)
    side = pressed_side(mode)
    if (side /= 0 .and. self%pushing) then
      associate (machine => self%body%moving%machine)
        pressed = contact_force_slopes(machine%contact, side*(y(1) - surface_of(self%body, side)), side*y(2))/machine%mass
      end associate
      by_x = by_x - pressed(1)
      by_v = by_v - pressed(2)
    end if
    slope(1:2) = [y(2), acceleration(self%body, mode, self%pushing, t, y(1), y(2))]
    slope(3:4) = [y(4), by_x*y(3) + by_v*y(4)]
    slope(5:6) = [y(6), by_x*y(5) + by_v*y(6)]
    slope = way*slope

  contains

    !> Acceleration without the barrier, off the state by steps.
    pure real(wp) function free_at(i, k) result(a)
      integer, intent(in) :: i, k
      a = acceleration(self%body, mode, .false., t, y(1) + i*self%body%step_of(1), y(2) + k*self%body%step_of(2))
    end function free_at

  end function slope_of_varied

  !> Difference of fourth order of the values two and one steps back, one and two further: derivative times the step.
  pure real(wp) function quarter(far_back, back, further, far) result(change)
    real(wp), intent(in) :: far_back, back, further, far
    change = (8*(further - back) - (far - far_back))/12
  end function quarter

  !> Acceleration [m/s^2] in a slip; `pushing`: a soft barrier acts.
  pure real(wp) function acceleration(self, mode, pushing, t, x, v) result(a)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    logical, intent(in) :: pushing
    real(wp), intent(in) :: t, x, v
    real(wp) :: foot, stretch, direction
    integer :: side
    direction = direction_in(mode)
    associate (machine => self%moving%machine)
      call foot_motion(machine%drive, machine%drive_frequency*t, foot)
      stretch = machine%restoring%free_length + foot - x
      a = restoring_force(machine%restoring, stretch) + sliding_friction(machine%friction, v, direction)
      if (machine%extra) a = a + extra_force(machine, slip_memory_t(direction, x, 0.0_wp), t, x, v, stretch)
      side = pressed_side(mode)
      if (side /= 0 .and. pushing) a = a - side*contact_force(machine%contact, side*(x - surface_of(self, side)), side*v)
      a = a/machine%mass
    end associate
  end function acceleration

  pure real(wp) function surface_of(self, side) result(surface)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: side
    surface = merge(self%moving%machine%contact%soft_upper, self%moving%machine%contact%soft_lower, side > 0)
  end function surface_of

  pure function slope_of_body(self, mode, t, y) result(slope)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: mode
    real(wp), intent(in) :: t, y(:)
    real(wp) :: slope(size(y))
    slope = 0
    if (slips_in(mode)) slope = [y(2), acceleration(self, mode, pushes(self, mode, y), t, y(1), y(2))]
  end function slope_of_body

  pure subroutine guard_of_body(self, event, t, y, value, by_state, by_time)
    class(one_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: value, by_state(:), by_time
    by_state = [1.0_wp, 0.0_wp]
    by_time = 0
    associate (contact => self%moving%machine%contact)
      select case (event%kind)
      case (event_impact_upper, event_chatter_upper)
        value = y(1) - contact%upper
      case (event_impact_lower, event_chatter_lower)
        value = y(1) - contact%lower
      case (event_touch_upper, event_touch_lower, event_separation)
        value = y(1) - surface_of(self, event%side)
      case (event_release, event_barrier_release)
        call release_margin(self, event%side, t, y(1), value, by_state(1), by_time)
      case default
        value = y(2)
        by_state = [0.0_wp, 1.0_wp]
      end select
    end associate
  end subroutine guard_of_body

  !> By how much the force on a body at rest at `x` [m] is less than what it takes to move it in `direction` [N], and its
  !> derivatives by x and by the time.
  pure subroutine release_margin(self, direction, t, x, margin, by_x, by_time)
    class(one_body_t), intent(in) :: self
    integer, intent(in) :: direction
    real(wp), intent(in) :: t, x
    real(wp), intent(out) :: margin, by_x, by_time
    real(wp) :: h, curvature, force, pressed(2)
    integer :: side
    h = self%step_of(1)
    by_x = quarter(level_at(x - 2*h), level_at(x - h), level_at(x + h), level_at(x + 2*h))/h
    margin = level_at(x)
    associate (machine => self%moving%machine)
      if (machine%contact%soft) then
        margin = margin - direction*force_on_body(machine%contact, x, 0.0_wp)
        side = contact_side(machine%contact, x, 0)
        if (side /= 0) pressed = contact_force_slopes(machine%contact, side*(x - surface_of(self, side)), 0.0_wp)
        if (side /= 0) by_x = by_x + direction*pressed(1)
      end if
      call holding_force(machine, x, machine%drive_frequency*t, force, by_time, curvature)
    end associate
    by_time = -direction*by_time

  contains

    !> Without the force of a soft barrier.
    pure real(wp) function level_at(place) result(level)
      real(wp), intent(in) :: place
      real(wp) :: holding, rate, bound
      associate (machine => self%moving%machine)
        call holding_force(machine, place, machine%drive_frequency*t, holding, rate, bound)
        level = machine%friction%break_away
        if (machine%effects%present) level = break_away_level(machine%effects, machine%friction, place, direction)
        level = level - direction*(holding - force_on_body(machine%contact, place, 0.0_wp))
      end associate
    end function level_at

  end subroutine release_margin

  pure subroutine jump_of_body(self, event, t, y, after, by_state, by_time)
    class(one_body_t), intent(in) :: self
    type(event_t), intent(in) :: event
    real(wp), intent(in) :: t, y(:)
    real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    real(wp) :: h
    by_time = 0*t
    by_state = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    after = y
    associate (contact => self%moving%machine%contact)
      select case (event%kind)
      case (event_impact_upper, event_impact_lower)
        after(2) = velocity_after_impact(contact, y(2))
        by_state(2, 2) = -contact%restitution
        if (contact%kind /= 0) then
          h = step*abs(y(2))
          by_state(2, 2) = quarter(velocity_after_impact(contact, y(2) - 2*h), velocity_after_impact(contact, y(2) - h), &
                                   velocity_after_impact(contact, y(2) + h), velocity_after_impact(contact, y(2) + 2*h))/h
        end if
      case (event_stick)
        after(2) = 0
        by_state(2, 2) = 0
      case (event_release)
        after(2) = 0
      case (event_barrier_release)
        by_state = 0
        after = [merge(contact%lower, contact%upper, event%side > 0), 0.0_wp]
      end select
      if (rests_on_barrier(event%after)) then
        by_state = 0
        after = [merge(contact%upper, contact%lower, event%after == mode_upper_barrier), 0.0_wp]
      end if
    end associate
  end subroutine jump_of_body

end module one_body
