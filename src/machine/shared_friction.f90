! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction joints that are not to be told apart.
module shared_friction
  use friction_law, only: same_shape
  use jointed, only: joint_friction, joint_t, jointed_t
  use kinds, only: wp
  implicit none
  private

  public :: merge_friction

contains

  !> Rigid friction on the same row against the same surface becomes one joint: what each holds is not to be told apart.
  pure subroutine merge_friction(machine)
    type(jointed_t), intent(inout) :: machine
    type(joint_t), allocatable :: joints(:)
    logical :: kept(size(machine%joints))
    integer :: i, k, count_kept
    kept = .true.
    do i = 1, size(machine%joints)
      do k = 1, i - 1
        if (.not. kept(i) .or. .not. kept(k) .or. .not. alike(machine%joints(i), machine%joints(k))) cycle
        machine%joints(k)%friction%kinetic = machine%joints(k)%friction%kinetic + machine%joints(i)%friction%kinetic
        machine%joints(k)%friction%break_away = machine%joints(k)%friction%break_away &
          + machine%joints(i)%friction%break_away
        kept(i) = .false.
      end do
    end do
    if (all(kept)) return
    allocate (joints(count(kept)))
    count_kept = 0
    do i = 1, size(machine%joints)
      if (.not. kept(i)) cycle
      count_kept = count_kept + 1
      joints(count_kept) = machine%joints(i)
    end do
    call move_alloc(joints, machine%joints)
  end subroutine merge_friction

  pure logical function alike(a, b)
    type(joint_t), intent(in) :: a, b
    alike = a%kind == joint_friction .and. b%kind == joint_friction
    if (alike) alike = same(sum(abs(a%row - b%row))) .or. same(sum(abs(a%row + b%row)))
    if (alike) alike = same(a%offset%rate) .and. same(b%offset%rate) .and. .not. allocated(a%offset%harmonic) .and. &
                       .not. allocated(b%offset%harmonic)
    if (alike) alike = same_shape(a%friction, b%friction)
  end function alike

  pure logical function same(difference)
    real(wp), intent(in) :: difference
    same = .not. abs(difference) > 0
  end function same

end module shared_friction
