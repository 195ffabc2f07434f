! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which contacts touch, as far as rounding lets it be known.
module touching_contacts
  use jointed, only: joint_contact, jointed_t, most_joints
  use jointed_state, only: joint_motion, jointed_state_t
  use kinds, only: wp
  use mode_choice, only: project
  implicit none
  private

  public :: add_tied, add_near, close_gaps

contains

  !> Contacts that close, or have opened, within the rounding of places and of the clock take part in an impact: they touch.
  pure subroutine add_tied(machine, state, turning, touching)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(inout) :: touching(:)
    real(wp) :: s, u, reach
    integer :: j
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (joint%kind /= joint_contact .or. touching(j) /= 0) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        reach = 16*epsilon(s)*(sum(abs(joint%row*state%q(:machine%n))) + abs(joint%offset%mean)) + abs(u)*8*spacing(state%time)
        if (s >= joint%upper - reach) touching(j) = 1
        if (s <= joint%lower + reach) touching(j) = -1
      end associate
    end do
  end subroutine add_tied

  !> Contacts that are all but closed take part in the end of a chatter of several.
  pure subroutine add_near(machine, state, turning, touching)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(inout) :: touching(:)
    real(wp) :: s, u
    integer :: j
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (joint%kind /= joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        if (joint%upper - s < 1e-9_wp*machine%length_scale) touching(j) = 1
        if (s - joint%lower < 1e-9_wp*machine%length_scale) touching(j) = -1
      end associate
    end do
  end subroutine add_near

  !> Takes gaps of contacts that touch, `slow`, from the places where bodies on their way through zero have no digits of them: the
  !> rounding of their swing decides nothing.
  pure subroutine close_gaps(machine, state, turning, slow)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: slow(:)
    real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
    real(wp) :: s, u, gap, swing
    logical :: blurred(most_joints)
    integer :: j
    blurred = .false.
    swing = maxval(abs(state%q(:machine%n))) + maxval(abs(state%v(:machine%n)))*machine%period
    do j = 1, size(machine%joints)
      if (slow(j) == 0) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      gap = abs(s - merge(machine%joints(j)%upper, machine%joints(j)%lower, slow(j) > 0))
      associate (joint => machine%joints(j))
        blurred(j) = gap > rounding*(sum(abs(joint%row*state%q(:machine%n))) + abs(joint%offset%mean)) .and. gap <= rounding*swing
      end associate
    end do
    if (.not. any(blurred)) return
    where (blurred) state%phase = slow
    call project(machine, state, turning)
    where (blurred) state%phase = 0
  end subroutine close_gaps

end module touching_contacts
