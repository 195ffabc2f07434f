! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Defaults of a case that change the physics: they are reported, the others are the absence of something.
module assumptions
  use case_parameters, only: parameter_value
  use case_source, only: case_source_t, find
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, parameter_row_t, rows_of, part_family, part_kind, &
    part_law, path_of, value_of
  use law_texts, only: is_own
  use text, only: to_text
  implicit none
  private

  public :: assumed_by_default

  !> The optional parameters whose default is a choice; docs/case-file.md lists them.
  character(len=20), parameter :: choices_of_physics(10) = [character(len=20) :: 'gravity', 'stribeck_exponent', 'exponent', &
    'falloff', 'tension', 'speed', 'harmonic', 'side', 'in_sequence', 'periodic']

contains

  !> What the laws of a case have by default and matters, parted by semicolons: 'body.gravity = 9.81 m/s^2; ...'. What is `varied`
  !> along an axis is not.
  pure function assumed_by_default(source, laws, varied) result(text)
    type(case_source_t), intent(in) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: varied(:)
    character(len=:), allocatable :: text, path
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, k
    text = ''
    do i = 1, size(laws)
      rows = rows_of(laws(i))
      do k = 1, size(rows)
        if (.not. rows(k)%optional .or. .not. any(choices_of_physics == rows(k)%name)) cycle
        path = path_of(laws(i))//'.'//trim(rows(k)%name)
        if (find(source, path) > 0 .or. any(varied == path) .or. .not. matters(laws, i, rows(k)%name)) cycle
        if (len(text) > 0) text = text//'; '
        text = text//path//' = '//shown(value_of(laws(i), rows(k)%name))
        if (rows(k)%unit /= '1') text = text//' '//trim(rows(k)%unit)
        if (rows(k)%name == 'periodic') text = text//' ('//repetition(laws(i))//')'
      end do
    end do
  end function assumed_by_default

  !> A number, a whole one without a point.
  pure function shown(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(value)
    if (index(text, '.0', back=.true.) == len(text) - 1) text = text(:len(text) - 2)
  end function shown

  !> How the samples of a measured force repeat.
  pure function repetition(law) result(text)
    type(law_choice_t), intent(in) :: law
    character(len=:), allocatable :: text
    integer :: steps
    steps = size(list_of(law, 'force')) - 1
    text = 'the last sample repeats the first'
    if (value_of(law, 'periodic') > 0) then
      steps = steps + 1
      text = 'the first sample follows the last'
    end if
    text = text//': period '//to_text(steps*value_of(law, 'interval'), 6)//' s'
  end function repetition

  !> Whether a parameter of law number `i` has any influence on the motion.
  pure logical function matters(laws, i, name)
    type(law_choice_t), intent(in) :: laws(:)
    integer, intent(in) :: i
    character(len=*), intent(in) :: name
    integer :: k
    matters = .true.
    select case (name)
    case ('gravity')
      ! The normal force of dry friction, and nothing else.
      matters = .not. any(is_own(laws) .and. laws%family == 'friction')
      if (matters) matters = parameter_value(laws, 'friction.kinetic_coefficient', 0.0_wp) > 0 .or. &
                parameter_value(laws, 'friction.static_coefficient', 0.0_wp) > 0
    case ('stribeck_exponent')
      matters = .not. (laws(i)%family == part_family .and. part_law(laws(i)%name) == 'coulomb_load')
      if (.not. matters) matters = value_of(laws(i), 'stribeck_velocity') > 0
      if (laws(i)%family == part_family .and. part_law(laws(i)%name) == 'lugre') matters = value_of(laws(i), 'static_force') > &
        value_of(laws(i), 'force')
    case ('tension')
      ! Without damping a barrier does not pull.
      matters = index(laws(i)%name, 'restitution') > 0
      if (.not. matters) matters = value_of(laws(i), 'damping') > 0
    case ('in_sequence')
      matters = count([(laws(k)%family == part_family .and. part_kind(laws(k)%name) == 'contact', k=1, size(laws))]) > 1
    end select
  end function matters

end module assumptions
