! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Positions on which the motion of a jointed structure depends: a structure that nothing ties to the ground may be anywhere.
module section_directions
  use eigen, only: symmetric_eigen
  use jointed, only: joint_friction, joint_section, jointed_t, most_degrees
  use kinds, only: wp
  implicit none
  private

  public :: directions_of

contains

  !> Directions of the positions on which forces and stops depend, orthonormal columns: the bodies themselves if all count.
  pure subroutine directions_of(machine, directions, count_directions)
    type(jointed_t), intent(in) :: machine
    real(wp), intent(out) :: directions(most_degrees, most_degrees)
    integer, intent(out) :: count_directions
    real(wp), dimension(machine%n, machine%n) :: depends, vectors
    real(wp) :: values(machine%n)
    integer :: i, j, n
    n = machine%n
    ! Without its signs: a negative stiffness would cancel what a joint adds.
    call symmetric_eigen(machine%stiffness/max(maxval(abs(machine%stiffness)), tiny(1.0_wp)), values, vectors)
    do i = 1, n
      depends(:, i) = matmul(vectors, abs(values)*vectors(i, :))
    end do
    do j = 1, size(machine%joints)
      if (machine%joints(j)%kind == joint_friction .or. machine%joints(j)%kind == joint_section) cycle
      do i = 1, n
        depends(:, i) = depends(:, i) + machine%joints(j)%row*machine%joints(j)%row(i)
      end do
    end do
    call symmetric_eigen(depends, values, vectors)
    count_directions = count(abs(values) > 1e-12_wp*maxval(abs(values)))
    directions = 0
    if (count_directions == n) then
      do i = 1, n
        directions(i, i) = 1
      end do
    else
      directions(:n, :count_directions) = vectors(:, pack([(i, i=1, n)], abs(values) > 1e-12_wp*maxval(abs(values))))
    end if
  end subroutine directions_of

end module section_directions
