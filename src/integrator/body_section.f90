! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body on the stroboscopic section: x and v, and what its laws remember, the force of Dahl's friction and the speed at
!> which a contact that lasts began.
module body_section
  use kinds, only: wp
  use motion, only: motion_t, start_state
  use motion_state, only: state_t, take_turns
  implicit none
  private

  public :: coordinates_of_body, start_of_body, resumed_body, body_at, body_point, scales_of_body

contains

  !> Number of coordinates on the section.
  pure integer function coordinates_of_body(moving) result(n)
    type(motion_t), intent(in) :: moving
    n = 2 + count(remembers(moving))
  end function coordinates_of_body

  !> What the laws of one body remember: the force of Dahl's friction, the speed at which a contact began.
  pure function remembers(moving)
    type(motion_t), intent(in) :: moving
    logical :: remembers(2)
    associate (machine => moving%machine)
      remembers = [machine%effects%dahl_stiffness > 0, machine%contact%soft .and. machine%contact%by_impact]
    end associate
  end function remembers

  !> A body at x [m], v [m/s] and the crank at an angle [rad].
  pure type(state_t) function start_of_body(moving, start) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:)
    state = start_state(moving, start(1), start(2), start(3))
    call take_turns(moving%machine%turn, state)
  end function start_of_body

  !> A body with the position, velocity and memory that it had in another machine, with the crank at `angle` [rad].
  pure type(state_t) function resumed_body(moving, before, angle) result(state)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    state = start_state(moving, before%x, before%v, angle, z=before%z, touch_speed=before%touch_speed)
    call take_turns(moving%machine%turn, state)
  end function resumed_body

  !> A body at a point of the section.
  pure type(state_t) function body_at(moving, point) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp) :: memory(2)
    memory = unpack(point(3:), remembers(moving), [0.0_wp, abs(point(2))])
    state = start_state(moving, point(1), point(2), 0.0_wp, z=memory(1), touch_speed=abs(memory(2)))
    call take_turns(moving%machine%turn, state)
  end function body_at

  !> The coordinates of a body on the section; the speed of a contact that is over is zero.
  pure function body_point(moving, state) result(point)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    real(wp), allocatable :: point(:)
    logical :: lasts
    associate (contact => moving%machine%contact)
      lasts = state%x > contact%soft_upper .or. state%x < contact%soft_lower
    end associate
    point = [state%x, state%v, pack([state%z, merge(state%touch_speed, 0.0_wp, lasts)], remembers(moving))]
  end function body_point

  !> Sizes of the coordinates in a motion over `half_range` [m] of the position.
  pure function scales_of_body(moving, half_range) result(scales)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp), allocatable :: scales(:)
    real(wp) :: w, length
    w = moving%machine%drive_frequency
    length = half_range
    if (moving%machine%turn > 0) length = min(length, moving%machine%turn/2)
    scales = [length*[1.0_wp, w], pack([moving%machine%effects%dahl_sliding, length*w], remembers(moving))]
  end function scales_of_body

end module body_section
