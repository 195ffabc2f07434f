! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The end of a chatter of one contact: whether nothing changes until then, and when it is.
module chatter
  use contact_law, only: restitution_at
  use eigen, only: modulus
  use multibody, only: harmonics_in, joint_friction, joint_t, multibody_t, most_joints, offset_of
  use multibody_flows, only: multibody_motion_t
  use multibody_state, only: joint_motion, multibody_state_t
  use kinds, only: wp
  use mode_choice, only: accelerations_of
  implicit none
  private

  public :: look_ahead, rest_of_chatter

contains

  !> Whether the chatter of contact `j` on `side` ends so soon that nothing changes until then. Friction `at_rest` stays so, that
  !> `along` the contact turns with every bounce, and no other comes to rest. Bounces up with the acceleration a and down with
  !> b <= a take u/a + u/sqrt(a b), and the speed shrinks by e sqrt(b/a).
  pure subroutine look_ahead(moving, state, turning, j, side, at_rest, along, ends)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: j, side
    logical, intent(out) :: at_rest(:), along(:), ends
    type(multibody_state_t) :: back
    real(wp), dimension(moving%machine%n) :: a, jerk, a_back
    real(wp) :: s, u, given, opening, closing, change, last, speed, e, shrink
    integer :: i
    ends = .false.
    at_rest = .false.
    along = .false.
    associate (machine => moving%machine)
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
      call accelerations_of(machine, state, turning, a, jerk)
      opening = -side*(sum(machine%joints(j)%row*a) + given)
      change = abs(sum(machine%joints(j)%row*jerk)) + abs(given)*machine%frequency
      if (.not. opening < 0 .or. .not. -side*u > 0) return
      e = machine%joints(j)%contact%restitution
      if (e >= 1) return
      last = 2*abs(u)/(-opening*(1 - e))
      closing = opening
      call turn_back(machine, state, j, back, along)
      if (any(along)) then
        call accelerations_of(machine, back, turning, a_back)
        closing = -side*(sum(machine%joints(j)%row*a_back) + given)
        if (.not. (closing < 0 .and. closing >= opening)) return
        shrink = e*sqrt(closing/opening)
        last = max(last, (abs(u)/(-opening) + abs(u)/sqrt(closing*opening))/(1 - shrink))
      end if
      if (last*change > -closing*moving%chatter_share .or. last > 1e-2_wp*machine%period) return
      ! No speed goes through zero on the way.
      do i = 1, size(machine%joints)
        if (machine%joints(i)%kind /= joint_friction) cycle
        call joint_motion(machine, i, state%q, state%v, state%time, turning, s, speed, given)
        at_rest(i) = state%phase(i) == 0
        if (at_rest(i) .or. along(i)) cycle
        if (abs(speed) <= 2*last*abs(sum(machine%joints(i)%row*a) + given)) return
      end do
    end associate
    ends = .true.
  end subroutine look_ahead

  !> How long a chatter that was completed in the impact of contact `j` on `side`, from the state `before` it, would still have
  !> lasted [s]; see `look_ahead`.
  pure real(wp) function rest_of_chatter(moving, before, turning, j, side) result(rest)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: before
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: j, side
    type(multibody_state_t) :: out
    real(wp) :: a(moving%machine%n), s, u, given, opening, closing, e
    logical :: along(most_joints)
    associate (machine => moving%machine)
      call turn_back(machine, before, j, out, along)
      call joint_motion(machine, j, before%q, before%v, before%time, turning, s, u, given)
      call accelerations_of(machine, before, turning, a)
      closing = side*(sum(machine%joints(j)%row*a) + given)
      call accelerations_of(machine, out, turning, a)
      opening = side*(sum(machine%joints(j)%row*a) + given)
      e = restitution_at(machine%joints(j)%contact, abs(u))
    end associate
    rest = 0
    if (.not. min(closing, opening) > 0 .or. .not. e*sqrt(closing/opening) < 1) return
    rest = e*abs(u)*(1/opening + 1/sqrt(opening*closing))/(1 - e*sqrt(closing/opening))
  end function rest_of_chatter

  !> The state in which the friction `along` contact `j` slides the other way.
  pure subroutine turn_back(machine, state, j, back, along)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: j
    type(multibody_state_t), intent(out) :: back
    logical, intent(out) :: along(:)
    integer :: i
    back = state
    along = .false.
    do i = 1, size(machine%joints)
      if (machine%joints(i)%kind /= joint_friction .or. state%phase(i) == 0) cycle
      along(i) = moves_along(machine%joints(i), machine%joints(j))
      if (along(i)) back%phase(i) = -state%phase(i)
    end do
  end subroutine turn_back

  !> Whether friction slides at the speed of a gap, or a multiple of it.
  pure logical function moves_along(friction, contact)
    type(joint_t), intent(in) :: friction, contact
    real(wp) :: ratio
    integer :: m
    ratio = sum(friction%row*contact%row)/sum(contact%row**2)
    moves_along = abs(ratio) > 0 .and. all(abs(friction%row - ratio*contact%row) <= 8*epsilon(ratio)*abs(friction%row)) .and. &
      abs(friction%offset%rate - ratio*contact%offset%rate) <= 8*epsilon(ratio)*abs(friction%offset%rate)
    do m = 1, max(harmonics_in(friction%offset), harmonics_in(contact%offset))
      associate (own => offset_of(friction, m))
        moves_along = moves_along .and. modulus(own - ratio*offset_of(contact, m)) <= 8*epsilon(ratio)*modulus(own)
      end associate
    end do
  end function moves_along

end module chatter
