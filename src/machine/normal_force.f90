! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Normal forces of friction in a machine that is put together.
module normal_force
  use constants, only: two_pi
  use kinds, only: wp
  use multibody, only: joint_t, multibody_t
  use tape_value, only: evaluate
  implicit none
  private

  public :: number_contacts, size_of_load

contains

  !> Numbers of the contacts whose forces are normal forces of friction.
  pure subroutine number_contacts(machine)
    type(multibody_t), intent(inout) :: machine
    integer :: i, k
    do i = 1, size(machine%joints)
      if (.not. allocated(machine%joints(i)%load)) cycle
      associate (sources => machine%joints(i)%load%sources)
        do k = 1, size(sources)
          if (sources(k)%contact /= '') sources(k)%joint = findloc(machine%joints%name == sources(k)%contact, .true., 1)
        end do
      end associate
    end do
  end subroutine number_contacts

  !> Largest normal force of friction, or force by an expression, over a period where nothing is displaced [N]; 1 where it is part
  !> of the law.
  pure real(wp) function size_of_load(joint, frequency) result(largest)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: frequency
    integer, parameter :: points = 24
    real(wp), allocatable :: value(:), variables(:)
    integer, allocatable :: fault(:)
    integer :: i
    largest = 1
    if (.not. allocated(joint%load)) return
    largest = 0
    associate (load => joint%load)
      allocate (value(load%tape%count), fault(load%tape%count))
      allocate (variables(size(load%rates)), source=0.0_wp)
      do i = 0, points - 1
        variables(2) = two_pi*i/points
        if (frequency > 0) variables(1) = variables(2)/frequency
        call evaluate(load%tape, variables, load%parameters, value, fault)
        if (fault(load%node) == 0) largest = max(largest, abs(value(load%node)))
      end do
    end associate
  end function size_of_load

end module normal_force
