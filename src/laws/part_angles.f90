! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which reference points of a machine of several bodies have an angle for a position: bodies with an inertia, those that
!> a pendulum acts on, and those joined to them, as a joint takes the difference of two positions.
module part_angles
  use kinds, only: wp
  use law_row, only: none_above
  use law_table, only: label_length, law_choice_t, part_family, value_of
  implicit none
  private

  public :: is_joint, is_of_angle, mass_of, names_of_angles, turns, watched_is_angle

contains

  !> For each reference point, bodies and points of structures in the order of the choices, whether its position is an angle;
  !> `by_inertia`: that of a body with an inertia, or joined to one.
  pure function are_angles(choices, by_inertia) result(angles)
    type(law_choice_t), intent(in) :: choices(:)
    logical, intent(in), optional :: by_inertia
    logical, allocatable :: angles(:), before(:)
    integer :: ends(2), i, round
    allocate (angles(0))
    do i = 1, size(choices)
      if (is_reference_point(choices(i))) angles = [angles, turns(choices(i))]
    end do
    do round = 0, size(angles)
      before = angles
      do i = 1, size(choices)
        if (.not. is_joint(choices(i))) cycle
        ends = nint([value_of(choices(i), 'first_end'), value_of(choices(i), 'second_end')])
        if (any(ends > size(angles))) cycle
        if (choices(i)%name == 'spring:pendulum' .and. .not. present(by_inertia)) then
          angles(pack(ends, ends > 0)) = .true.
        else if (all(ends > 0)) then
          angles(ends) = any(angles(ends))
        end if
      end do
      if (all(angles .eqv. before)) exit
    end do
  end function are_angles

  !> Names of the reference points whose positions are angles.
  pure function names_of_angles(choices) result(names)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=label_length), allocatable :: names(:)
    integer :: i
    names = pack(choices%label, [(is_reference_point(choices(i)), i=1, size(choices))])
    names = pack(names, are_angles(choices))
  end function names_of_angles

  !> Whether the positions that a part (number `part` of the choices) has or acts on are angles. With `by_inertia`, whether all its
  !> units are those of rotation: beside a pendulum masses may stand for inertias.
  pure logical function is_of_angle(choices, part, by_inertia)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: part
    logical, intent(in), optional :: by_inertia
    logical, allocatable :: angles(:)
    integer :: ends(2), i
    angles = are_angles(choices, by_inertia)
    ends = 0
    if (is_reference_point(choices(part))) then
      ends(1) = count([(is_reference_point(choices(i)), i=1, part)])
    else if (is_joint(choices(part))) then
      ends = nint([value_of(choices(part), 'first_end'), value_of(choices(part), 'second_end')])
    else if (index(choices(part)%name, 'drive:') == 1) then
      ends(1) = nint(value_of(choices(part), 'body'))
    end if
    is_of_angle = any(angles(pack(ends, ends > 0 .and. ends <= size(angles))))
  end function is_of_angle

  !> Whether the position that the start and the results refer to is an angle.
  pure logical function watched_is_angle(choices) result(is_angle)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=label_length), allocatable :: names(:)
    integer :: i
    is_angle = .false.
    if (.not. any([(choices(i)%name == 'spring:pendulum' .or. turns(choices(i)), i=1, size(choices))])) return
    names = names_of_angles(choices)
    do i = 1, size(choices)
      if (choices(i)%name == 'body:watched' .or. choices(i)%name == 'point:watched') is_angle = any(names == choices(i)%label)
    end do
  end function watched_is_angle

  !> Whether a body has an inertia in place of a mass.
  pure logical function turns(choice)
    type(law_choice_t), intent(in) :: choice
    turns = .false.
    if (choice%name == 'body:watched' .or. choice%name == 'body:mass') turns = value_of(choice, 'inertia') < none_above
  end function turns

  !> Mass of a body [kg], or its moment of inertia [kg m^2].
  pure real(wp) function mass_of(choice)
    type(law_choice_t), intent(in) :: choice
    mass_of = value_of(choice, trim(merge('inertia', 'mass   ', turns(choice))))
  end function mass_of

  pure logical function is_reference_point(choice)
    type(law_choice_t), intent(in) :: choice
    is_reference_point = choice%family == part_family .and. (index(choice%name, 'body:') == 1 .or. index(choice%name, &
      'point:') == 1)
  end function is_reference_point

  !> Whether a part acts between two reference points, or one and the ground.
  pure logical function is_joint(choice)
    type(law_choice_t), intent(in) :: choice
    is_joint = choice%family == part_family .and. (index(choice%name, 'spring:') == 1 .or. &
                                                   index(choice%name, 'friction:') == 1 .or. index(choice%name, 'contact:') == 1)
  end function is_joint

end module part_angles
