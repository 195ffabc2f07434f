! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which contacts touch, as far as rounding lets it be known.
module touching_contacts
  use multibody, only: joint_contact, multibody_t, most_joints
  use multibody_state, only: joint_motion, multibody_state_t
  use kinds, only: wp
  use mode_choice, only: project
  implicit none
  private

  public :: add_degenerate, add_near, close_gaps

  !> Impacts farther apart than this share of a period are not at once.
  real(wp), parameter :: longest_tie = 1e-11_wp

contains

  !> Contacts that close, or have opened, within the rounding of positions and of the clock take part in an impact: they
  !> touch. The rounding of positions on their way through zero is that of their magnitude, and a slow impact, of those that
  !> are `hit`, has no sharper time.
  pure subroutine add_degenerate(machine, state, turning, hit, touching)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: hit(:)
    integer, intent(inout) :: touching(:)
    real(wp) :: s, u, magnitude, reach, span
    integer :: j, phase(most_joints)
    logical :: alone
    alone = .true.
    magnitude = 16*epsilon(s)*magnitude_of(machine, state)
    span = 8*spacing(state%time)
    do j = 1, size(machine%joints)
      if (hit(j) == 0) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      span = max(span, min(longest_tie*machine%period, magnitude*sum(abs(machine%joints(j)%row))/max(abs(u), tiny(u))))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (joint%kind /= joint_contact .or. touching(j) /= 0) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        reach = magnitude*sum(abs(joint%row)) + 16*epsilon(s)*abs(joint%offset%mean) + abs(u)*span
        if (s >= joint%upper - reach) touching(j) = 1
        if (s <= joint%lower + reach) touching(j) = -1
        if (touching(j) /= 0) alone = .false.
      end associate
    end do
    if (alone) return
    phase = state%phase
    where (touching /= 0) state%phase = touching
    call project(machine, state, turning, speeds=.false.)
    state%phase = phase
  end subroutine add_degenerate

  !> Contacts that are all but closed take part in the end of a chatter of several.
  pure subroutine add_near(machine, state, turning, touching)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
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

  !> Takes gaps of contacts that touch, `slow`, from the positions where bodies on their way through zero have no digits of
  !> them: the rounding of their magnitude decides nothing.
  pure subroutine close_gaps(machine, state, turning, slow)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: slow(:)
    real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
    real(wp) :: s, u, gap, magnitude
    logical :: blurred(most_joints)
    integer :: j
    blurred = .false.
    magnitude = magnitude_of(machine, state)
    do j = 1, size(machine%joints)
      if (slow(j) == 0) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      gap = abs(s - merge(machine%joints(j)%upper, machine%joints(j)%lower, slow(j) > 0))
      associate (joint => machine%joints(j))
        blurred(j) = gap > rounding*(sum(abs(joint%row*state%q(:machine%n))) + abs(joint%offset%mean)) .and. &
          gap <= rounding*magnitude
      end associate
    end do
    if (.not. any(blurred)) return
    where (blurred) state%phase = slow
    call project(machine, state, turning)
    where (blurred) state%phase = 0
  end subroutine close_gaps

  !> How far positions go [m].
  pure real(wp) function magnitude_of(machine, state) result(magnitude)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    magnitude = maxval(abs(state%q(:machine%n))) + maxval(abs(state%v(:machine%n)))*machine%period
  end function magnitude_of

end module touching_contacts
