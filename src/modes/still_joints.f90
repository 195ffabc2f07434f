! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which friction joints do not move. Where joints share a force, as in a ring of friction, one can be at its limit, with the
!> phase of a slide, while the others keep it where it is.
module still_joints
  use multibody, only: joint_elastic, joint_friction, multibody_t, most_joints
  use multibody_state, only: is_held, joint_motion, multibody_state_t
  use kinds, only: wp
  implicit none
  private

  public :: stand_still

  !> Share of a row that is left of it if it is a sum of others, as rounding has it.
  real(wp), parameter :: nothing = 1e-9_wp

contains

  !> Whether each joint is friction that does not slide: it sticks, or it has no speed and those that are held leave it none.
  pure function stand_still(machine, state, turning) result(still)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    logical :: still(size(machine%joints))
    real(wp) :: basis(machine%n, most_joints), rest(machine%n), s, u
    integer :: count_basis, j
    count_basis = 0
    do j = 1, size(machine%joints)
      if (.not. is_held(machine%joints(j), state%phase(j))) cycle
      rest = beyond(basis(:, :count_basis), machine%joints(j)%row)
      if (norm2(rest) <= nothing*norm2(machine%joints(j)%row)) cycle
      count_basis = count_basis + 1
      basis(:, count_basis) = rest/norm2(rest)
    end do
    do j = 1, size(machine%joints)
      still(j) = state%phase(j) == 0 .and. any(machine%joints(j)%kind == [joint_friction, joint_elastic])
      if (still(j) .or. machine%joints(j)%kind /= joint_friction) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      if (abs(u) > machine%negligible_speed) cycle
      still(j) = norm2(beyond(basis(:, :count_basis), machine%joints(j)%row)) <= nothing*norm2(machine%joints(j)%row)
    end do
  end function stand_still

  !> What is left of a row beyond the span of an orthonormal basis.
  pure function beyond(basis, row) result(rest)
    real(wp), intent(in) :: basis(:, :), row(:)
    real(wp) :: rest(size(row))
    integer :: i, pass
    rest = row
    do pass = 1, 2
      do i = 1, size(basis, 2)
        rest = rest - sum(basis(:, i)*rest)*basis(:, i)
      end do
    end do
  end function beyond

end module still_joints
