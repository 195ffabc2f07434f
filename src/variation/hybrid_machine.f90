! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine as smooth flights between events: what linearisation, periodic orbits and their continuation need to know of it.
!> Every event has a guard, which is zero at it, and a jump. Flights are of a given duration and guards are smooth functions,
!> both also beyond the instant at which the real motion would have had another event.
module hybrid_machine
  use circle, only: point_near
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: tally_t
  implicit none
  private

  !> Largest number of coordinates of a state.
  integer, parameter, public :: most_states = 40

  !> One event of a motion.
  type, public :: event_t
    !> One of `event_...` in module `motion_state`.
    integer :: kind = 0
    !> Direction of the motion or side of the contact, +1 or -1, and of several joints which one.
    integer :: side = 0, joint = 0
    !> Of a structure: the triggered guard of the joint.
    integer :: guard = 0
    !> Mode of the flights before and after, as the machine numbers them.
    integer :: before = 0, after = 0
    !> Time since the section at which the motion began [s].
    real(wp) :: time = 0
    !> State just before and just after.
    real(wp) :: arrival(most_states) = 0, departure(most_states) = 0
  end type event_t

  !> A machine at one value of its parameters.
  type, abstract, public :: hybrid_t
    !> Number of coordinates of a state, and of those of them that are positions; velocities follow.
    integer :: n = 0, positions = 1
    !> Time from section to section [s]; without a clock an event is the section, and this a size of times.
    real(wp) :: period = 0
    logical :: has_clock = .true.
    !> The section is the passage of a crank: no cycle shrinks to nothing there.
    logical :: crank_section = .false.
    !> Natural sizes of the coordinates.
    real(wp), allocatable :: size_of(:)
    !> Rows that give position [m] and speed [m/s] of what is watched.
    real(wp), allocatable :: watched(:, :)
    !> The first coordinate repeats after this [rad]; 0 of a position.
    real(wp) :: turn = 0
    !> Rigid stops that bound it [m].
    real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
    !> Of one body: size of the forces [N]; positions at which it meets something below and above [m], and whether that is soft;
    !> whether a turning point is no event, as no force depends on the direction.
    real(wp) :: force_size = 1, barriers(2) = [-huge(1.0_wp), huge(1.0_wp)]
    logical :: soft = .false., smooth_turns = .false.
  contains
    procedure :: size_of_time
    procedure :: section_sizes
    procedure :: nearest_copy
    procedure :: within_stops
    procedure :: narrowed
    procedure :: take_sizes
    procedure(rests_interface), deferred :: rests
    procedure(fly_interface), deferred :: fly
    procedure(slope_interface), deferred :: slope
    procedure(guard_interface), deferred :: guard
    procedure(jump_interface), deferred :: jump
    procedure(begin_interface), deferred :: begin
    procedure(go_on_interface), deferred :: go_on
    procedure(fly_to_section_interface), deferred :: fly_to_section
    procedure(fly_sections_interface), deferred :: fly_sections
    procedure(map_interface), deferred :: map
    procedure(starts_interface), deferred :: starts_of_section
  end type hybrid_t

  !> A machine whose parameter is a little different.
  type, public :: neighbour_t
    class(hybrid_t), allocatable :: machine
  end type neighbour_t

  !> A machine and, for derivatives by a parameter, its four neighbours.
  type, public :: neighbourhood_t
    class(hybrid_t), allocatable :: centre
    type(neighbour_t), allocatable :: near(:)
    !> Distance of the neighbours in the parameter; `side` -1, 0 or 1: which stencil they make.
    real(wp) :: step = 1
    integer :: side = 0
  end type neighbourhood_t

  abstract interface
    !> Whether nothing moves in a mode.
    pure logical function rests_interface(self, mode)
      import :: hybrid_t
      class(hybrid_t), intent(in) :: self
      integer, intent(in) :: mode
    end function rests_interface

    !> The state `y1` that the mode brings `y0` at `t0` to at `t1` [s], and, which takes longer, its derivative by `y0`.
    pure subroutine fly_interface(self, mode, t0, y0, t1, y1, flight)
      import :: hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      integer, intent(in) :: mode
      real(wp), intent(in) :: t0, y0(:), t1
      real(wp), intent(out) :: y1(:)
      real(wp), intent(out), optional :: flight(:, :)
    end subroutine fly_interface

    !> Time derivative of the state in a mode.
    pure function slope_interface(self, mode, t, y) result(slope)
      import :: hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      integer, intent(in) :: mode
      real(wp), intent(in) :: t, y(:)
      real(wp) :: slope(size(y))
    end function slope_interface

    !> What is zero at an event, with its derivatives by the state and by the time.
    pure subroutine guard_interface(self, event, t, y, value, by_state, by_time)
      import :: event_t, hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      type(event_t), intent(in) :: event
      real(wp), intent(in) :: t, y(:)
      real(wp), intent(out) :: value, by_state(:), by_time
    end subroutine guard_interface

    !> The state after an event, with its derivatives by the state before and by the time.
    pure subroutine jump_interface(self, event, t, y, after, by_state, by_time)
      import :: event_t, hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      type(event_t), intent(in) :: event
      real(wp), intent(in) :: t, y(:)
      real(wp), intent(out) :: after(:), by_state(:, :), by_time(:)
    end subroutine jump_interface

    !> The state at a point of the section. `ok` is false for one beyond a stop.
    pure subroutine begin_interface(self, point, section, ok)
      import :: hybrid_t, section_state_t, wp
      class(hybrid_t), intent(in) :: self
      real(wp), intent(in) :: point(:)
      type(section_state_t), intent(out) :: section
      logical, intent(out) :: ok
    end subroutine begin_interface

    !> Takes a state on to the next section, where it is at `point`. `ok` is false if the trajectory had to be given up.
    pure subroutine go_on_interface(self, section, point, ok)
      import :: hybrid_t, section_state_t, wp
      class(hybrid_t), intent(in) :: self
      type(section_state_t), intent(inout) :: section
      real(wp), intent(out) :: point(:)
      logical, intent(out) :: ok
    end subroutine go_on_interface

    !> Flies from a start as `machine_t` has it to the first section: where it then is, and the events on the way. `ok` is false
    !> for a start beyond a stop, and if the trajectory had to be given up.
    pure subroutine fly_to_section_interface(self, start, point, events, ok)
      import :: event_t, hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      real(wp), intent(in) :: start(:)
      real(wp), intent(out) :: point(:)
      type(event_t), allocatable, intent(out) :: events(:)
      logical, intent(out) :: ok
    end subroutine fly_to_section_interface

    !> Flies from a section point over so many sections: where it then is, the mode in which it began, and the events on the way,
    !> with `collapsed` a completed chatter as one. `ok` is false if the trajectory had to be given up.
    pure subroutine fly_sections_interface(self, point, sections, collapsed, image, events, mode, tally, ok)
      import :: event_t, hybrid_t, tally_t, wp
      class(hybrid_t), intent(in) :: self
      real(wp), intent(in) :: point(:)
      integer, intent(in) :: sections
      logical, intent(in) :: collapsed
      real(wp), intent(out) :: image(:)
      type(event_t), allocatable, intent(out) :: events(:)
      integer, intent(out) :: mode
      type(tally_t), intent(out) :: tally
      logical, intent(out) :: ok
    end subroutine fly_sections_interface

    !> Image of a section point after so many sections, its derivatives by the point (and by the parameter in which `machines` are
    !> neighbours of this one), and what happened on the way. `ok` is false if the trajectory had to be given up or the derivatives
    !> are not known.
    pure subroutine map_interface(self, machines, point, sections, image, by_start, tally, ok, by_parameter)
      import :: hybrid_t, neighbourhood_t, tally_t, wp
      class(hybrid_t), intent(in) :: self
      type(neighbourhood_t), intent(in) :: machines
      real(wp), intent(in) :: point(:)
      integer, intent(in) :: sections
      real(wp), intent(out) :: image(:), by_start(:, :)
      type(tally_t), intent(out) :: tally
      logical, intent(out) :: ok
      real(wp), intent(out), optional :: by_parameter(:)
    end subroutine map_interface

    !> Section points (columns) for searches: `watched` (columns) are positions and speeds of what is watched. Other coordinates of
    !> every second point are those of the machine, those of the rest spread evenly over twice their sizes, or over the share
    !> `spread` of that, start by start.
    pure function starts_interface(self, watched, spread) result(points)
      import :: hybrid_t, wp
      class(hybrid_t), intent(in) :: self
      real(wp), intent(in) :: watched(:, :)
      real(wp), intent(in), optional :: spread(:)
      real(wp) :: points(self%n, size(watched, 2))
    end function starts_interface
  end interface

contains

  !> Natural size of times [s].
  pure real(wp) function size_of_time(self)
    class(hybrid_t), intent(in) :: self
    size_of_time = self%size_of(1)/self%size_of(self%positions + 1)
  end function size_of_time

  !> Natural sizes of a position and of a speed.
  pure function section_sizes(self) result(sizes)
    class(hybrid_t), intent(in) :: self
    real(wp) :: sizes(2)
    sizes = self%size_of([1, self%positions + 1])
  end function section_sizes

  !> The copy of a point nearest to another: an angle is on a circle.
  pure function nearest_copy(self, point, other) result(nearest)
    class(hybrid_t), intent(in) :: self
    real(wp), intent(in) :: point(:), other(:)
    real(wp) :: nearest(size(point))
    nearest = point_near(point, other, self%turn)
  end function nearest_copy

  !> A section point, moved to the barrier that it lies beyond.
  pure function within_stops(self, point) result(within)
    class(hybrid_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    real(wp) :: within(size(point))
    within = point
    within(1) = max(min(point(1), self%upper), self%lower)
  end function within_stops

  !> Distance of the neighbours, as a `share` of the parameter's size, or less.
  pure real(wp) function narrowed(self, share)
    class(hybrid_t), intent(in) :: self
    real(wp), intent(in) :: share
    narrowed = share
  end function narrowed

  !> The sizes of another machine, so that differences have the same steps in both.
  pure subroutine take_sizes(self, other)
    class(hybrid_t), intent(inout) :: self
    class(hybrid_t), intent(in) :: other
    self%size_of = other%size_of
  end subroutine take_sizes

end module hybrid_machine
