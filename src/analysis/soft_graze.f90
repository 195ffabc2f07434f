! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Grazes of soft contacts. Touch and separation are one there, and the equations of an orbit that has both are singular: a branch
!> is led into the contact with these a little apart, and the graze is located on the side of the orbit that has neither.
module soft_graze
  use body_family, only: family_t
  use branch_point, only: set_point, step_to, trace_t
  use kinds, only: wp
  use motion_state, only: event_separation, event_touch_lower, event_touch_upper
  use orbit_margins, only: margin_t, margins_t, of_gap, of_hold, of_impact, of_slip, of_stick, same_meaning
  use orbit_motion, only: is_admissible
  use periodic_orbit, only: correct_orbit, move_along, orbit_t, scales_of_orbit
  implicit none
  private

  public :: is_touch, vanishing_touch, touches_apart, enter_apart, enter_for, locate_missed_graze

  !> First look beyond the graze, in natural times between touch and separation.
  real(wp), parameter :: first_apart = 1e-3_wp
  !> A touch of this speed, in natural sizes, is about to be none: how near the singular equations let a graze be located.
  real(wp), parameter, public :: touching = 1e-4_wp
  integer, parameter :: most_secants = 20
  !> A gap of this share of the natural size is none.
  real(wp), parameter :: nil = 4*epsilon(1.0_wp)

contains

  !> Whether a margin is the speed of a touch, or of its end.
  pure logical function is_touch(orbit, margin)
    type(orbit_t), intent(in) :: orbit
    type(margin_t), intent(in) :: margin
    is_touch = margin%kind == of_impact
    if (is_touch) is_touch = any(orbit%events(margin%event)%kind == [event_touch_upper, event_touch_lower, event_separation])
  end function is_touch

  !> The number of the margin of a touch of a joint that is about to be none; 0 without.
  pure integer function vanishing_touch(orbit, margins, joint) result(number)
    type(orbit_t), intent(in) :: orbit
    type(margins_t), intent(in) :: margins
    integer, intent(in) :: joint
    do number = 1, size(margins%list)
      associate (one => margins%list(number))
        if (one%joint /= joint .or. .not. abs(one%value) <= touching) cycle
        if (is_touch(orbit, one)) return
      end associate
    end do
    number = 0
  end function vanishing_touch

  !> The direction over state, instants and parameter in which the touches of no duration of an orbit last longer; 0 without any.
  pure function touches_apart(orbit) result(apart)
    type(orbit_t), intent(in) :: orbit
    real(wp) :: apart(size(orbit%y) + size(orbit%events) + 1)
    integer :: i, k
    apart = 0
    do i = 1, size(orbit%events)
      associate (touch => orbit%events(i))
        if (touch%kind /= event_touch_upper .and. touch%kind /= event_touch_lower) cycle
        do k = i + 1, size(orbit%events)
          if (orbit%events(k)%kind == event_separation .and. orbit%events(k)%joint == touch%joint) exit
        end do
        if (k > size(orbit%events)) cycle
        if (abs(orbit%events(k)%time - touch%time) > 0) cycle
        apart(size(orbit%y) + i) = -1
        apart(size(orbit%y) + k) = 1
      end associate
    end do
    if (any(abs(apart) > 0)) apart = apart/norm2(apart)
  end function touches_apart

  !> A first point with new touches, or sticks, on the side on which its motion really has those events: `apart` is fixed and the
  !> parameter gives way. `beyond` has the orbit at the graze.
  subroutine enter_apart(family, at, apart, margin_room, beyond, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    real(wp), intent(in) :: apart(:), margin_room
    type(trace_t), intent(inout) :: beyond
    logical, intent(out) :: ok
    type(trace_t) :: there
    integer :: tries
    do tries = 0, 2
      call enter_for(family, at, beyond%now%orbit, first_apart*10**tries*apart, there, ok)
      if (ok) ok = all(there%margins%list%value > -margin_room)
      if (ok) ok = is_admissible(there%machines, there%now%orbit)
      if (ok) exit
    end do
    if (ok) beyond = there
  end subroutine enter_apart

  !> The point `apart` from the orbit `from` at a graze, over state, instants and parameter in natural sizes, all else giving way.
  subroutine enter_for(family, at, from, apart, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    type(orbit_t), intent(in) :: from
    real(wp), intent(in) :: apart(:)
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    real(wp) :: along(size(apart))
    along = apart/norm2(apart)
    there%machines = at%machines
    there%now%orbit = from
    call move_along(there%now%orbit, apart*scales_of_orbit(there%machines, from, family%parameter_size))
    call correct_orbit(family, there%machines, there%now%orbit, along, ok)
    if (ok) call set_point(family, there, along, ok)
  end subroutine enter_for

  !> The graze that an orbit is near which misses the barrier of `touch`, or where its margin `touch` of sticking is zero, by the
  !> secant rule over the length of the branch; `start` has the value of the parameter near which it is. `ok` is false if it is not
  !> found.
  subroutine locate_missed_graze(family, missing, touch, start, graze, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: missing
    type(margin_t), intent(in) :: touch
    real(wp), intent(in) :: start
    type(trace_t), intent(out) :: graze
    logical, intent(out) :: ok
    real(wp) :: before, now, s_before, s, next
    integer :: i, steps
    associate (rise => missing%now%tangent(size(missing%now%tangent))*family%parameter_size)
      ok = abs(rise) > 0
      if (.not. ok) return
      s = (start - missing%now%orbit%parameter)/rise
    end associate
    s_before = 0
    before = gap_of(missing, touch)
    do i = 1, most_secants
      call step_to(family, missing, s, graze, ok, steps)
      if (ok) now = gap_of(graze, touch)
      if (ok) ok = now < huge(now) .and. before < huge(before)
      if (.not. ok) return
      if (abs(now) <= nil .or. .not. abs(now - before) > 0) exit
      next = s - now*(s - s_before)/(now - before)
      if (.not. abs(next - s) > spacing(s)) exit
      s_before = s
      before = now
      s = next
    end do
    ok = abs(now) <= 1e3_wp*nil
  end subroutine locate_missed_graze

  !> The gap by which the barrier of a touch is missed, or the margin of a stick; huge where there is none.
  pure real(wp) function gap_of(trace, touch) result(gap)
    type(trace_t), intent(in) :: trace
    type(margin_t), intent(in) :: touch
    integer :: i
    gap = huge(gap)
    do i = 1, size(trace%margins%list)
      associate (one => trace%margins%list(i))
        if (any(touch%kind == [of_stick, of_slip, of_hold])) then
          if (same_meaning(one, touch)) gap = one%value
        else if (one%kind == of_gap .and. one%joint == touch%joint .and. one%side == touch%side) then
          gap = one%value
        end if
      end associate
    end do
  end function gap_of

end module soft_graze
