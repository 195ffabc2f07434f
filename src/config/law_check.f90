! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold between the values of one choice of laws.
module law_check
  use angle_units, only: unit_of
  use build_multibody, only: is_multibody, multibody_of
  use build_motion, only: kind_bodies, kind_body, kind_motor, kind_of, kind_own, machine_of
  use build_pair, only: pair_of
  use case_parameters, only: parameter_value
  use case_source, only: case_source_t, has_problems, report
  use case_type, only: contact_law, drive_position => drive_law, restoring_law
  use drive_law, only: ends_with_its_first, is_given, moves_foot
  use effect_check, only: refuse_effects
  use errors, only: error_t
  use motor_choices, only: has_motor
  use motor_equations, only: build_motor_equations
  use motor_system, only: motor_system_t
  use multibody, only: multibody_t
  use kinds, only: wp
  use law_table, only: added_families, effect_family, force_family, law_choice_t, list_of, state_family, value_of
  use lever_reach, only: check_assembly
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use oscillator, only: refuse_pair
  use own_equations, only: build_own_equations
  use restoring_law, only: position_is_angle
  use text, only: to_text
  implicit none
  private

  public :: check_laws, is_good

contains

  !> Whether no problem is known in any of these tables.
  pure logical function is_good(source, tables)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: tables(:)
    integer :: i
    is_good = .true.
    do i = 1, size(tables)
      is_good = is_good .and. .not. has_problems(source, trim(tables(i)))
    end do
  end function is_good

  !> The conditions within one choice of laws, of the tables without a problem; `at` names the combination of axis values.
  subroutine check_laws(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    logical :: good(3), whole
    good = [is_good(source, ['friction']), is_good(source, ['contact']), is_good(source, ['drive'])]
    whole = all(good) .and. is_good(source, [character(len=len(added_families)) :: 'body', 'restoring', &
                                               effect_family, added_families, force_family, state_family])
    if (good(1)) call check_friction(source, laws, at)
    if (good(2)) call check_barriers(source, laws, at)
    if (whole) call check_bodies(source, laws, at)
    if (.not. good(3)) return
    if (is_good(source, ['restoring']) .and. moves_foot(trim(laws(drive_position)%name)) .and. .not. has_motor(laws) .and. &
        laws(restoring_law)%name /= 'linear') then
      call report(source, trim(merge('drive.ratio    ', 'drive.frequency', is_given(laws(drive_position), 'ratio'))), &
                  'found with restoring.law = "'//trim(laws(restoring_law)%name)//'", allowed with "linear": the drive '// &
                  'moves the foot of that spring')
    end if
    select case (laws(drive_position)%name)
    case ('fourier')
      call check_series(source, laws(drive_position))
    case ('crank_lever_rod')
      call check_lever(source, laws(drive_position), at)
    case ('measured_force')
      call check_force(source, laws(drive_position), at)
    end select
  end subroutine check_laws

  subroutine check_friction(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    real(wp) :: static, kinetic
    kinetic = parameter_value(laws, 'friction.kinetic_coefficient', 0.0_wp)
    static = parameter_value(laws, 'friction.static_coefficient', kinetic)
    if (static < kinetic) then
      call report(source, 'friction.static_coefficient', 'found '//to_text(static)// &
                  ', allowed at least the kinetic_coefficient '//to_text(kinetic)//at)
    end if
    kinetic = parameter_value(laws, 'friction.force', 0.0_wp)
    static = parameter_value(laws, 'friction.static_force', kinetic)
    if (static < kinetic) then
      call report(source, 'friction.static_force', 'found '//to_text(static)//' '//unit_of('N', position_is_angle(laws))// &
                  ', allowed at least the force '//to_text(kinetic)//at)
    end if
  end subroutine check_friction

  subroutine check_barriers(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    character(len=:), allocatable :: unit
    real(wp) :: upper, lower, tension
    tension = parameter_value(laws, 'contact.tension', 1.0_wp)
    if (tension > 0 .and. tension < 1) call report(source, 'contact.tension', 'found '//to_text(tension)//', allowed 0 or 1'//at)
    if (laws(contact_law)%name == 'none') return
    upper = value_of(laws(contact_law), 'upper')
    lower = value_of(laws(contact_law), 'lower')
    if (upper >= huge(upper) .and. lower <= -huge(lower)) then
      call report(source, 'contact.law', 'found "'//trim(laws(contact_law)%name)// &
                  '" without a barrier, allowed with upper, lower or both')
    else if (lower > upper) then
      unit = ' '//unit_of('m', position_is_angle(laws))
      call report(source, 'contact.lower', 'found '//to_text(lower)//unit//', allowed at most upper = '//to_text(upper)//unit//at)
    end if
  end subroutine check_barriers

  !> A record has a step, and one period does not have its first sample twice.
  subroutine check_force(source, drive, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: drive
    character(len=*), intent(in) :: at
    real(wp) :: periodic
    associate (force => list_of(drive, 'force'))
      periodic = value_of(drive, 'periodic')
      if (periodic > 0 .and. periodic < 1) then
        call report(source, 'drive.periodic', 'found '//to_text(periodic)//', allowed 0 or 1'//at)
      else if (size(force) < 2) then
        call report(source, 'drive.force', 'found '//to_text(size(force))//' samples, allowed two or more')
      else if (periodic > 0 .and. ends_with_its_first(force)) then
        call report(source, 'drive.periodic', 'found 1 with the first sample, '//to_text(force(1))// &
                    ' N, once more at the end of drive.force; allowed without it, or 0'//at)
      end if
    end associate
  end subroutine check_force

  !> A machine of each kind has laws of its own, and effects laws that they belong to.
  subroutine check_bodies(source, laws, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: at
    type(multibody_t) :: multibody
    type(error_t), allocatable :: error
    type(motor_system_t) :: system
    class(machine_t), allocatable :: machine
    select case (kind_of(laws))
    case (kind_motor)
      call build_motor_equations(laws, system, error)
    case (kind_own)
      call build_own_equations(laws, system, error)
    case (kind_bodies)
      if (.not. is_multibody(laws)) then
        call pair_of(laws, multibody, error)
      else if (is_good(source, ['spring   ', 'structure'])) then
        call multibody_of(laws, multibody, error)
      end if
    case (kind_body)
      call refuse_pair(laws, error)
      if (.not. allocated(error)) call refuse_effects(laws, error)
    case default
      call machine_of(laws, options_t(), machine, error)
    end select
    if (.not. allocated(error)) return
    call report(source, error%message(:index(error%message, ':') - 1), error%message(index(error%message, ':') + 2:)//at)
  end subroutine check_bodies

  subroutine check_series(source, drive)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: drive
    integer :: cosines, sines
    cosines = size(list_of(drive, 'cosine'))
    sines = size(list_of(drive, 'sine'))
    if (sines /= cosines) then
      call report(source, 'drive.sine', 'found '//to_text(sines)//' numbers, allowed as many as cosine has: '// &
                  to_text(cosines))
    end if
  end subroutine check_series

  subroutine check_lever(source, drive, at)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: drive
    character(len=*), intent(in) :: at
    character(len=:), allocatable :: problem
    real(wp) :: side
    side = value_of(drive, 'side')
    if (abs(side) /= 1) call report(source, 'drive.side', 'found '//to_text(side)//', allowed +1 or -1'//at)
    if (value_of(drive, 'crank') >= value_of(drive, 'pivot_distance')) then
      call report(source, 'drive.crank', 'found '//to_text(value_of(drive, 'crank'))// &
                  ' m, allowed less than pivot_distance = '//to_text(value_of(drive, 'pivot_distance'))//' m'//at)
    else
      problem = check_assembly(drive)
      if (len(problem) > 0) call report(source, 'drive.rod', problem//at)
    end if
  end subroutine check_lever

end module law_check
