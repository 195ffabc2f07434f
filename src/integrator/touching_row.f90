! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bodies that touch in a row at the start, where the order of their impacts matters.
module touching_row
  use multibody, only: joint_contact, multibody_t, together_newton
  use multibody_section, only: start_of_multibody
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use multibody_flows, only: multibody_motion_t
  implicit none
  private

  public :: names_in_row

contains

  !> Names of the rigid contacts that are closed at the `start` (x [m], v [m/s], crank angle [rad] of the watched body) and whose
  !> impacts change the speed of another one, as 'ab, bc'; '' if there are none, or if impacts come one after the other.
  pure function names_in_row(moving, start) result(names)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3)
    character(len=:), allocatable :: names
    type(multibody_state_t) :: state
    integer :: i, j
    names = ''
    associate (machine => moving%machine)
      if (machine%together /= together_newton) return
      state = start_of_multibody(moving, start)
      do j = 1, size(machine%joints)
        if (.not. rebounds(machine, j) .or. (state%phase(j) == 0 .and. state%left(j) == 0)) cycle
        if (.not. any([(rebounds(machine, i) .and. i /= j .and. yields_with(machine, j, i), i=1, size(machine%joints))])) cycle
        if (len(names) > 0) names = names//', '
        names = names//trim(machine%joints(j)%name)
      end do
    end associate
  end function names_in_row

  !> Whether joint `j` is a rigid contact with a rebound.
  pure logical function rebounds(machine, j)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    rebounds = .false.
    if (machine%joints(j)%kind == joint_contact) rebounds = machine%joints(j)%contact%restitution > 0
  end function rebounds

  !> Whether an impulse of joint `i` changes the speed of joint `j`.
  pure logical function yields_with(machine, j, i)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, i
    real(wp) :: kick(machine%n)
    kick = matmul(machine%mobility, machine%joints(j)%row)
    yields_with = abs(sum(machine%joints(i)%row*kick)) > 1e-12_wp*sum(machine%joints(j)%row*kick)
  end function yields_with

end module touching_row
