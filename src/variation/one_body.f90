! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body as a hybrid machine, its state being x [m] and v [m/s]: slips, impacts, turning points, sticking, release, soft
!> contact, completed chatter.
module one_body
  use body_flight, only: fly_slip
  use slip_force, only: direction_in, on_lower, on_upper, pushes, quarter, slip_acceleration, slips_in, surface_of
  use contact_flight, only: contact_side
  use contact_law, only: contact_force_slopes, force_on_body, velocity_after_impact
  use effect_law, only: break_away_level
  use hybrid_machine, only: event_t, hybrid_t, neighbourhood_t
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion, only: motion_t
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, &
    event_turning_point, mode_lower_barrier, mode_stick, mode_upper_barrier, state_t, tally_t
  use oscillator, only: holding_force
  implicit none
  private

  public :: one_body_of, why_not_varied, mode_of_body, slips_in, direction_in, rests_on_barrier, turns_smoothly

  !> Steps of the differences that stand in for derivatives of laws, as a share of the natural size: of fourth order.
  real(wp), parameter :: step = merge(3e-4_wp, 1e-6_wp, epsilon(1.0_wp) > 1e-20_wp)

  !> Smallest distance of the neighbours in a parameter, as a share of its size.
  real(wp), parameter :: smallest_share = 1e-9_wp

  type, extends(hybrid_t), public :: one_body_t
    type(motion_t) :: moving
    !> Steps of the differences of laws.
    real(wp) :: step_of(2) = 1
  contains
    procedure :: rests => body_rests
    procedure :: fly => fly_body
    procedure :: slope => slope_of_body
    procedure :: guard => guard_of_body
    procedure :: jump => jump_of_body
    procedure :: begin => begin_body
    procedure :: go_on => go_on_with_body
    procedure :: fly_to_section => fly_body_to_section
    procedure :: fly_sections => fly_body_over_sections
    procedure :: map => map_of_body
    procedure :: starts_of_section => starts_of_body
    procedure :: narrowed
    procedure :: take_sizes
  end type one_body_t

  ! In the submodule `body_sections`: it uses modules that use this one.
  interface
    module pure subroutine begin_body(self, point, section, ok)
    class(one_body_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t), intent(out) :: section
    logical, intent(out) :: ok
  end subroutine begin_body

  module pure subroutine go_on_with_body(self, section, point, ok)
  class(one_body_t), intent(in) :: self
  type(section_state_t), intent(inout) :: section
  real(wp), intent(out) :: point(:)
  logical, intent(out) :: ok
end subroutine go_on_with_body

module pure subroutine fly_body_to_section(self, start, point, events, ok)
class(one_body_t), intent(in) :: self
real(wp), intent(in) :: start(:)
real(wp), intent(out) :: point(:)
type(event_t), allocatable, intent(out) :: events(:)
logical, intent(out) :: ok
end subroutine fly_body_to_section

module pure subroutine fly_body_over_sections(self, point, sections, collapsed, image, events, mode, tally, ok)
class(one_body_t), intent(in) :: self
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
logical, intent(in) :: collapsed
real(wp), intent(out) :: image(:)
type(event_t), allocatable, intent(out) :: events(:)
integer, intent(out) :: mode
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
end subroutine fly_body_over_sections

module pure subroutine map_of_body(self, machines, point, sections, image, by_start, tally, ok, by_parameter)
class(one_body_t), intent(in) :: self
type(neighbourhood_t), intent(in) :: machines
real(wp), intent(in) :: point(:)
integer, intent(in) :: sections
real(wp), intent(out) :: image(:), by_start(:, :)
type(tally_t), intent(out) :: tally
logical, intent(out) :: ok
real(wp), intent(out), optional :: by_parameter(:)
end subroutine map_of_body

module pure function starts_of_body(self, watched, spread) result(points)
class(one_body_t), intent(in) :: self
real(wp), intent(in) :: watched(:, :)
real(wp), intent(in), optional :: spread(:)
real(wp) :: points(self%n, size(watched, 2))
end function starts_of_body
end interface

contains

 !> Why the variations of a machine are not known, with the key of the case; nothing if they are: one body whose motion from a
 !> section of its drive depends on x and v alone.
pure function why_not_varied(moving) result(why)
  type(motion_t), intent(in) :: moving
  character(len=:), allocatable :: why
  why = ''
  associate (machine => moving%machine, law => moving%machine%friction)
    if (machine%drive%interval > 0) then
      why = 'drive.law: the variations of a body under a measured force are not known'
    else if (.not. machine%drive%ratio > 0) then
      why = 'drive.law: one body without a drive has no section; in parts, as [body.NAME], it has one where it turns round'
    else if (machine%effects%dahl_stiffness > 0) then
      why = 'effect.dahl: variations of this friction are not known'
    else if (machine%contact%by_impact) then
      why = 'contact.law: variations of a damping that each impact sets are not known'
    else if ((law%excess > 0 .and. law%stribeck_exponent < 1) .or. (law%second_excess > 0 .and. law%second_exponent < 1)) then
      why = 'friction.stribeck_exponent: below 1 the law has no derivative at rest'
    end if
  end associate
end function why_not_varied

 !> The hybrid machine of a body. `size_of_x` [m] is the size of the motion, for differences of laws.
pure function one_body_of(moving, size_of_x) result(body)
  type(motion_t), intent(in) :: moving
  real(wp), intent(in) :: size_of_x
  type(one_body_t) :: body
  body%moving = moving
  body%n = 2
  body%period = moving%machine%period
  body%turn = moving%machine%turn
  body%lower = moving%machine%contact%lower
  body%upper = moving%machine%contact%upper
  body%watched = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
  body%size_of = size_of_x*[1.0_wp, moving%machine%drive_frequency]
  body%step_of = body%size_of
  associate (law => moving%machine%friction)
    if (law%excess > 0) body%step_of(2) = min(body%step_of(2), law%stribeck_velocity)
    if (law%second_excess > 0) body%step_of(2) = min(body%step_of(2), law%second_velocity)
  end associate
  body%step_of = step*body%step_of
  body%force_size = max(moving%machine%force_scale, tiny(1.0_wp))
  body%smooth_turns = turns_smoothly(body)
  associate (contact => moving%machine%contact)
    body%soft = contact%soft
    body%barriers = [contact%lower, contact%upper]
    if (contact%soft) body%barriers = [contact%soft_lower, contact%soft_upper]
  end associate
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

pure logical function body_rests(self, mode)
  class(one_body_t), intent(in) :: self
  integer, intent(in) :: mode
  body_rests = self%n > 0 .and. .not. slips_in(mode)
end function body_rests

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
    turns_smoothly = turns_smoothly .and. .not. machine%effects%turns_round
  end associate
end function turns_smoothly

pure subroutine fly_body(self, mode, t0, y0, t1, y1, flight)
  class(one_body_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t0, y0(:), t1
  real(wp), intent(out) :: y1(:)
  real(wp), intent(out), optional :: flight(:, :)
  if (slips_in(mode)) then
    call fly_slip(self%moving, self%size_of, self%step_of, mode, t0, y0, t1, y1, flight)
    return
  end if
  y1 = [y0(1), 0.0_wp]
  if (mode == mode_upper_barrier) y1(1) = self%moving%machine%contact%upper
  if (mode == mode_lower_barrier) y1(1) = self%moving%machine%contact%lower
  if (.not. present(flight)) return
  flight = 0
  if (mode == mode_stick) flight(1, 1) = 1
end subroutine fly_body

pure function slope_of_body(self, mode, t, y) result(slope)
  class(one_body_t), intent(in) :: self
  integer, intent(in) :: mode
  real(wp), intent(in) :: t, y(:)
  real(wp) :: slope(size(y))
  slope = 0
  associate (machine => self%moving%machine)
    if (slips_in(mode)) slope = [y(2), slip_acceleration(machine, mode, pushes(machine, mode, y), t, y(1), y(2))]
  end associate
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
      value = y(1) - surface_of(self%moving%machine, event%side)
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
      if (side /= 0) pressed = contact_force_slopes(machine%contact, side*(x - surface_of(self%moving%machine, side)), 0.0_wp)
      if (side /= 0) by_x = by_x + direction*pressed(1)
    end if
    call holding_force(machine, x, machine%drive_frequency*t, force, by_time, curvature)
  end associate
  by_time = -direction*by_time

contains

  !> Without the force of a soft barrier.
  pure real(wp) function level_at(position) result(level)
    real(wp), intent(in) :: position
    real(wp) :: holding, rate, bound
    associate (machine => self%moving%machine)
      call holding_force(machine, position, machine%drive_frequency*t, holding, rate, bound)
      level = machine%friction%break_away
      if (machine%effects%present) level = break_away_level(machine%effects, machine%friction, position, direction)
      level = level - direction*(holding - force_on_body(machine%contact, position, 0.0_wp))
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
        h = step*max(abs(y(2)), 1e-3_wp*self%size_of(2))
        by_state(2, 2) = quarter(velocity_after_impact(contact, y(2) - 2*h), velocity_after_impact(contact, y(2) - h), &
                                   velocity_after_impact(contact, y(2) + h), velocity_after_impact(contact, y(2) + 2*h))/h
      end if
      ! Without rebound nothing is left but the instant.
      if (.not. abs(by_state(2, 2)) > 0) then
        by_state = 0
        after(1) = merge(contact%upper, contact%lower, event%kind == event_impact_upper)
      end if
    case (event_turning_point, event_stick)
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

 !> Events of the neighbours must stay within a thin Stribeck layer.
pure real(wp) function narrowed(self, share)
  class(one_body_t), intent(in) :: self
  real(wp), intent(in) :: share
  narrowed = share
  if (self%moving%layer > 0) narrowed = &
    min(share, max(smallest_share, 1.6_wp*(self%moving%machine%friction%stribeck_velocity/self%size_of(2))**2))
end function narrowed

pure subroutine take_sizes(self, other)
  class(one_body_t), intent(inout) :: self
  class(hybrid_t), intent(in) :: other
  self%size_of = other%size_of
  select type (other)
  type is (one_body_t)
    self%step_of = other%step_of
  end select
end subroutine take_sizes

end module one_body
