! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction joints whose forces only act as a sum.
module shared_friction
  use friction_law, only: falls, friction_t, same_shape
  use multibody, only: joint_friction, joint_t, multibody_t
  use kinds, only: wp
  implicit none
  private

  public :: merge_friction

contains

  !> Rigid friction on the same row against the same surface becomes one joint: only the sum of what they hold is determined.
  !> `first` and `second` are joints whose laws do not add up to one, 0 without any.
  pure subroutine merge_friction(machine, first, second)
    type(multibody_t), intent(inout) :: machine
    integer, intent(out) :: first, second
    type(joint_t), allocatable :: joints(:)
    logical :: kept(size(machine%joints))
    integer :: i, k, count_kept
    kept = .true.
    first = 0
    second = 0
    do i = 1, size(machine%joints)
      do k = 1, i - 1
        if (.not. kept(i) .or. .not. kept(k) .or. .not. alike(machine%joints(i), machine%joints(k))) cycle
        if (adds_up(machine%joints(k)%friction, machine%joints(i)%friction) .and. .not. &
            (allocated(machine%joints(k)%load) .or. allocated(machine%joints(i)%load))) then
          machine%joints(k)%friction = total(machine%joints(k)%friction, machine%joints(i)%friction)
          kept(i) = .false.
        else
          first = k
          second = i
          return
        end if
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

  !> Both rub on the same surface along the same row.
  pure logical function alike(a, b)
    type(joint_t), intent(in) :: a, b
    integer :: way
    alike = .false.
    if (a%kind /= joint_friction .or. b%kind /= joint_friction) return
    do way = -1, 1, 2
      if (.not. same(sum(abs(a%row - way*b%row)))) cycle
      alike = same(a%offset%rate - way*b%offset%rate) .and. same_waves(a, b, way)
      return
    end do
  end function alike

  pure logical function same_waves(a, b, way) result(are)
    type(joint_t), intent(in) :: a, b
    integer, intent(in) :: way
    are = allocated(a%offset%harmonic) .eqv. allocated(b%offset%harmonic)
    if (.not. are .or. .not. allocated(a%offset%harmonic)) return
    are = size(a%offset%harmonic) == size(b%offset%harmonic)
    if (are) are = same(sum(abs(a%offset%harmonic - way*b%offset%harmonic)))
  end function same_waves

  !> Whether the forces of two laws add up to one law. What fades does so by its break-away force, which a law with one of its own
  !> would change.
  pure logical function adds_up(a, b)
    type(friction_t), intent(in) :: a, b
    adds_up = same_shape(a, b)
    if (adds_up) return
    if (fades(a) .and. fades(b)) then
      adds_up = same(a%fading_speed - b%fading_speed)
    else if (fades(a) .or. fades(b)) then
      adds_up = even(a) .or. even(b)
    else
      adds_up = .not. (a%excess > 0 .and. b%excess > 0) .or. same_decay(a, b) &
                .or. .not. (a%second_excess > 0 .or. b%second_excess > 0)
    end if
  end function adds_up

  pure logical function fades(law)
    type(friction_t), intent(in) :: law
    fades = law%fading_speed > 0
  end function fades

  !> The same force at break-away as while sliding, at any speed.
  pure logical function even(law)
    type(friction_t), intent(in) :: law
    even = .not. falls(law) .and. same(law%break_away - law%kinetic)
  end function even

  !> Whether both excesses fall alike with the speed.
  pure logical function same_decay(a, b)
    type(friction_t), intent(in) :: a, b
    same_decay = same(a%stribeck_velocity - b%stribeck_velocity) .and. same(a%stribeck_exponent - b%stribeck_exponent) &
                 .and. .not. b%second_excess > 0
  end function same_decay

  !> The law whose forces are the sum of those of two that add up.
  pure type(friction_t) function total(a, b) result(law)
    type(friction_t), intent(in) :: a, b
    law = a
    law%kinetic = a%kinetic + b%kinetic
    law%break_away = a%break_away + b%break_away
    law%drag = a%drag + b%drag
    law%fading_speed = max(a%fading_speed, b%fading_speed)
    if (.not. b%excess > 0) return
    if (.not. a%excess > 0) then
      law%excess = b%excess
      law%stribeck_velocity = b%stribeck_velocity
      law%stribeck_exponent = b%stribeck_exponent
      law%second_excess = b%second_excess
      law%second_velocity = b%second_velocity
      law%second_exponent = b%second_exponent
    else if (same_decay(a, b)) then
      law%excess = a%excess + b%excess
    else
      law%second_excess = b%excess
      law%second_velocity = b%stribeck_velocity
      law%second_exponent = b%stribeck_exponent
    end if
  end function total

  pure logical function same(difference)
    real(wp), intent(in) :: difference
    same = .not. abs(difference) > 0
  end function same

end module shared_friction
