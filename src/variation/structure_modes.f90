! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Modes of a structure as numbers, by the phases of its joints.
module structure_modes
  use multibody, only: joint_section, multibody_t, most_joints
  use kinds, only: wp
  implicit none
  private

  public :: count_joints, mode_number, phases_in, sliding_extension

  !> Phases run from -2 to 2: digits of the number of a mode.
  integer, parameter :: digits_of_phase = 5

contains

  !> Number of joints without the section.
  pure integer function count_joints(machine) result(joints)
    type(multibody_t), intent(in) :: machine
    joints = count(machine%joints%kind /= joint_section)
  end function count_joints

  !> The number of a mode by the phases of its joints.
  pure integer function mode_number(machine, phase) result(mode)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: phase(:)
    integer :: j
    mode = 0
    do j = count_joints(machine), 1, -1
      mode = digits_of_phase*mode + phase(j) + 2
    end do
  end function mode_number

  !> The phases of the joints in a mode.
  pure function phases_in(machine, mode) result(phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: mode
    integer :: phase(most_joints), rest, j
    phase = 0
    rest = mode
    do j = 1, count_joints(machine)
      phase(j) = modulo(rest, digits_of_phase) - 2
      rest = rest/digits_of_phase
    end do
  end function phases_in

  !> Extension of the spring of elastic friction that slides [m].
  pure real(wp) function sliding_extension(machine, j, phase)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, phase
    sliding_extension = phase*machine%joints(j)%friction%kinetic/machine%joints(j)%stiffness
  end function sliding_extension

end module structure_modes
