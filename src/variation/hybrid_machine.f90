! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine as smooth flights between events: what linearisation, periodic orbits and their continuation need to know of it.
!> Every event has a guard, which is zero at it, and a jump. Flights are of a given duration and guards are smooth functions,
!> both also beyond the instant at which the real motion would have had another event.
module hybrid_machine
  use kinds, only: wp
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
    !> Natural sizes of the coordinates.
    real(wp), allocatable :: size_of(:)
  contains
    procedure :: size_of_time
    procedure(rests_interface), deferred :: rests
    procedure(fly_interface), deferred :: fly
    procedure(slope_interface), deferred :: slope
    procedure(guard_interface), deferred :: guard
    procedure(jump_interface), deferred :: jump
  end type hybrid_t

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
  end interface

contains

  !> Natural size of times [s].
  pure real(wp) function size_of_time(self)
    class(hybrid_t), intent(in) :: self
    size_of_time = self%size_of(1)/self%size_of(self%positions + 1)
  end function size_of_time

end module hybrid_machine
