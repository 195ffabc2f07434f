! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which effects the laws of a machine admit.
module effect_check
  use contact_law, only: contact_of, contact_t, force_table, softening
  use curve_law, only: is_positive, knots_problem, most_knots
  use errors, only: error_t, fail
  use friction_law, only: add_to_friction, friction_of, friction_t
  use kinds, only: real64, wp
  use law_table, only: effect_family, law_choice_t, list_of, value_of
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: refuse_effects

  !> Corners of a play that are rounded within less, in shares of its gap, are not resolved.
  real(wp), parameter :: least_rounding = 1e-9_wp
  !> Of the force of a contact over its penetration.
  real(wp), parameter :: least_exponent = 0.5_wp

contains

  !> Refuses effects of one body that its laws do not admit. The message begins with the key.
  pure subroutine refuse_effects(choices, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family /= effect_family) cycle
      select case (choices(i)%name)
      case ('restitution_slope', 'restitution_curve', 'compliant_contact', 'kelvin_voigt_contact', 'contact_curve', &
            'contact_hardening', 'second_barrier')
        problem = contact_problem(choices, choices(i))
      case ('drive_ripple')
        problem = ripple_problem(choices, choices(i))
      case ('dahl')
        problem = dahl_problem(choices)
      case ('friction_curve')
        problem = table_problem(choices(i), 'speed', 'upwards')
        if (len(problem) == 0) problem = table_problem(choices(i), 'speed', 'downwards')
        if (has_effect(choices, 'dahl')) problem = ': found with effect.dahl, allowed one of them'
      case ('friction_position_curve')
        problem = table_problem(choices(i), 'position', 'change')
      case ('force_curve')
        problem = table_problem(choices(i), 'position', 'force')
      case ('spring_curve')
        problem = table_problem(choices(i), 'extension', 'force')
      case ('backlash')
        problem = ''
        if (value_of(choices(i), 'rounding') > 0 .and. value_of(choices(i), 'rounding') < least_rounding) problem = &
          '.rounding: found '//number(value_of(choices(i), 'rounding'))//', allowed 0 (sharp corners) or at least '// &
          number(least_rounding)
        if (name_of(choices, 'restoring') /= 'linear') problem = ': found with restoring.law = "'// &
          name_of(choices, 'restoring')//'", allowed with "linear"'
      case ('drive_harmonics')
        problem = harmonics_problem(choices, choices(i))
      case ('asymmetric_friction')
        problem = asymmetry_problem(choices, choices(i))
      case default
        cycle
      end select
      if (len(problem) == 0) cycle
      call fail(error, exit_bad_case, 'effect.'//trim(choices(i)%name)//problem)
      return
    end do
  end subroutine refuse_effects

  !> What is wrong with an effect of the contact, '' if nothing.
  pure function contact_problem(choices, effect) result(problem)
    type(law_choice_t), intent(in) :: choices(:), effect
    character(len=:), allocatable :: problem, law
    real(wp) :: upper, lower, position
    problem = ''
    law = name_of(choices, 'contact')
    select case (effect%name)
    case ('restitution_slope', 'restitution_curve')
      if (effect%name == 'restitution_curve') then
        problem = table_problem(effect, 'speed', 'change')
        if (has_effect(choices, 'restitution_slope')) problem = ': found with effect.restitution_slope, allowed one of them'
      end if
      if (law /= 'newton') problem = ': found with contact.law = "'//law//'", allowed with "newton"'
      if (len(soft_effect(choices, '')) > 0) problem = ': found with effect.'//soft_effect(choices, '')//', allowed one of them'
    case ('compliant_contact', 'kelvin_voigt_contact', 'contact_curve')
      if (effect%name == 'contact_curve') problem = force_problem(effect)
      if (len(soft_effect(choices, effect%name)) > 0) problem = ': found with effect.'//soft_effect(choices, effect%name)// &
                                                                ', allowed one of them'
      if (index(law, 'newton') /= 1) problem = ': found with contact.law = "'//law//'", allowed with the rigid ones: newton, '// &
                                               'newton_linear, newton_power, newton_viscoelastic'
    case ('contact_hardening')
      problem = hardening_problem(choices, effect)
    case default
      if (law == 'none') then
        problem = ': found with contact.law = "none", allowed with one barrier'
        return
      end if
      upper = value_of(choices(position_of(choices, 'contact')), 'upper')
      lower = value_of(choices(position_of(choices, 'contact')), 'lower')
      position = value_of(effect, 'position')
      if ((upper < huge(upper)) .eqv. (lower > -huge(lower))) then
        problem = ': found with two barriers, allowed with one'
      else if (upper < huge(upper) .and. position > upper) then
        problem = '.position: found '//number(position)//' m, allowed at most contact.upper = '//number(upper)//' m'
      else if (lower > -huge(lower) .and. position < lower) then
        problem = '.position: found '//number(position)//' m, allowed at least contact.lower = '//number(lower)//' m'
      end if
    end select
  end function contact_problem

  !> What is wrong with another exponent of a soft contact, '' if nothing.
  pure function hardening_problem(choices, effect) result(problem)
    type(law_choice_t), intent(in) :: choices(:), effect
    character(len=:), allocatable :: problem
    type(contact_t) :: law
    problem = ''
    if (position_of(choices, 'contact') > 0) law = contact_of(choices(position_of(choices, 'contact')), mass=1.0_wp)
    if (.not. law%soft) then
      problem = ': found with contact.law = "'//name_of(choices, 'contact')//'", allowed with the soft ones'
    else if (law%exponent + value_of(effect, 'change') < least_exponent) then
      problem = '.change: found '//number(value_of(effect, 'change'))//', allowed at least '// &
                number(least_exponent - law%exponent)//': the exponent of a contact is at least '//number(least_exponent)
    end if
  end function hardening_problem

  !> Another effect than `but` that makes the barriers soft, '' if there is none.
  pure function soft_effect(choices, but) result(name)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: but
    character(len=:), allocatable :: name
    integer :: i
    name = ''
    do i = 1, size(softening)
      if (softening(i) /= but .and. has_effect(choices, softening(i))) name = trim(softening(i))
    end do
  end function soft_effect

  !> What is wrong with a table of an effect, '' if nothing. `implied` knots are not in the list, which is as much shorter.
  pure function table_problem(effect, knots, values, implied) result(problem)
    type(law_choice_t), intent(in) :: effect
    character(len=*), intent(in) :: knots, values
    integer, intent(in), optional :: implied
    character(len=:), allocatable :: problem
    problem = knots_problem(list_of(effect, knots), size(list_of(effect, values)))
    if (present(implied)) then
      if (size(list_of(effect, knots)) > most_knots - implied) problem = 'allowed 2 to '//to_text(most_knots - implied)//' knots'
    end if
    if (len(problem) > 0) problem = '.'//knots//': found '//to_text(size(list_of(effect, knots)))//' knots and '// &
                                    to_text(size(list_of(effect, values)))//' values of '//values//', '//problem
  end function table_problem

  !> What is wrong with the table of a contact, '' if nothing.
  pure function force_problem(effect) result(problem)
    type(law_choice_t), intent(in) :: effect
    character(len=:), allocatable :: problem
    problem = table_problem(effect, 'penetration', 'force', implied=1)
    if (len(problem) > 0) return
    if (.not. is_positive(force_table(effect))) problem = '.force: found a barrier that pulls at some depth; allowed values '// &
                                                'whose curve is above 0 everywhere and does not fall behind the last'
  end function force_problem

  pure function harmonics_problem(choices, effect) result(problem)
    type(law_choice_t), intent(in) :: choices(:), effect
    character(len=:), allocatable :: problem
    problem = drive_problem(choices)
    if (size(list_of(effect, 'cosine')) /= size(list_of(effect, 'sine'))) then
      problem = '.sine: found '//to_text(size(list_of(effect, 'sine')))//' values, allowed as many as cosine has, '// &
                to_text(size(list_of(effect, 'cosine')))
    end if
  end function harmonics_problem

  !> What is wrong with an effect of the drive where the foot does not turn with a crank, '' if nothing.
  pure function drive_problem(choices) result(problem)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: problem, law
    problem = ''
    law = name_of(choices, 'drive')
    if (law /= 'harmonic' .and. law /= 'fourier' .and. law /= 'crank_lever_rod') problem = &
      ': found with drive.law = "'//law//'", allowed with harmonic, fourier, crank_lever_rod'
  end function drive_problem

  pure function ripple_problem(choices, effect) result(problem)
    type(law_choice_t), intent(in) :: choices(:), effect
    character(len=:), allocatable :: problem
    problem = drive_problem(choices)
    if (len(problem) > 0) return
    if (abs(value_of(effect, 'harmonic') - anint(value_of(effect, 'harmonic'))) > 0) then
      problem = '.harmonic: found '//number(value_of(effect, 'harmonic'))//', allowed a whole number'
    end if
  end function ripple_problem

  !> Dahl's friction replaces break-away and the Stribeck excess.
  pure function dahl_problem(choices) result(problem)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: problem
    problem = ''
    if (has_effect(choices, 'stribeck')) problem = ': found with effect.stribeck, allowed one of them'
    if (has_effect(choices, 'static_excess')) problem = ': found with effect.static_excess, allowed one of them'
  end function dahl_problem

  !> Neither direction may have negative dry friction.
  pure function asymmetry_problem(choices, effect) result(problem)
    type(law_choice_t), intent(in) :: choices(:), effect
    character(len=:), allocatable :: problem
    type(friction_t) :: friction
    real(wp) :: normal_force
    integer :: i
    normal_force = 0
    i = position_of(choices, 'body')
    if (i > 0) normal_force = value_of(choices(i), 'mass')*value_of(choices(i), 'gravity')
    i = position_of(choices, 'friction')
    if (i > 0) friction = friction_of(choices(i), normal_force)
    do i = 1, size(choices)
      if (choices(i)%family == effect_family) call add_to_friction(friction, choices(i))
    end do
    problem = ''
    if (abs(value_of(effect, 'coulomb')) > friction%kinetic) then
      problem = '.coulomb: found '//number(value_of(effect, 'coulomb'))//' N, allowed at most the sliding friction of the '// &
                'machine, '//number(friction%kinetic)//' N, in magnitude'
    end if
  end function asymmetry_problem

  !> Position of the choice of a family, 0 if there is none.
  pure integer function position_of(choices, family)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: family
    position_of = findloc(choices%family == family, .true., dim=1)
  end function position_of

  !> Name of the law of a family.
  pure function name_of(choices, family) result(name)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: family
    character(len=:), allocatable :: name
    name = 'none'
    if (position_of(choices, family) > 0) name = trim(choices(position_of(choices, family))%name)
  end function name_of

  pure logical function has_effect(choices, name)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: name
    has_effect = any(choices%family == effect_family .and. choices%name == name)
  end function has_effect

  !> A value in a message, also where numbers are longer than doubles.
  pure function number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(real(value, real64))
  end function number

end module effect_check
