! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Springs, friction and contacts of a multibody structure, from the laws of a case.
module build_joints
  use assembly, only: add_body, add_joint, add_link, move_surface
  use build_load, only: set_expression
  use build_memory, only: add_bristles, add_elements, check_static, has_bristles
  use contact_law, only: contact_kelvin_voigt, contact_of, contact_t
  use errors, only: error_t, fail
  use friction_law, only: friction_of_part
  use multibody, only: joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, joint_t, multibody_t, wave_t
  use kinds, only: real64, wp
  use law_table, only: law_choice, law_choice_t, parameter_row_t, parameters_of, part_law, path_of, set_value, value_of
  use matrices, only: solve
  use reference_points, only: number, row_of
  use status, only: exit_bad_case
  use waves, only: modulation_of
  implicit none
  private

  public :: add_any_friction, add_contact, add_own_force, add_spring, joint_alone

contains

  !> A spring or a contact along the only coordinate of a machine of unit mass. Code 65 for another law.
  pure subroutine joint_alone(choice, machine, error)
    type(law_choice_t), intent(in) :: choice
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    call add_body(machine, 'joint', 1.0_wp, 0.0_wp)
    if (index(choice%name, 'spring:') == 1) then
      call add_spring(machine, choice, [1.0_wp], error)
    else if (index(choice%name, 'contact:') == 1) then
      call add_contact(machine, choice, [1.0_wp], [integer ::], error)
    else
      call fail(error, exit_bad_case, path_of(choice)//': found a law without a force of its own, allowed a spring or a contact')
    end if
  end subroutine joint_alone

  !> A spring: its linear part belongs to the structure, the rest is a joint; so is what its modulation adds.
  pure subroutine add_spring(machine, choice, row, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: row(:)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    type(wave_t) :: modulation
    real(wp) :: stiffness
    stiffness = 0
    joint%name = path_of(choice)
    joint%kind = joint_spring
    joint%row = row
    joint%offset%mean = -value_of(choice, 'free_length')
    select case (choice%name)
    case ('spring:linear')
      stiffness = value_of(choice, 'stiffness')
    case ('spring:polynomial')
      stiffness = value_of(choice, 'stiffness')
      joint%quadratic = value_of(choice, 'quadratic')
      joint%cubic = value_of(choice, 'cubic')
    case ('spring:pendulum')
      joint%moment = value_of(choice, 'moment')
    case ('spring:electrostatic')
      joint%attraction = value_of(choice, 'attraction')
      joint%gap = value_of(choice, 'gap')
    end select
    call add_link(machine, row, stiffness, value_of(choice, 'damping'), value_of(choice, 'free_length'))
    if (any(abs([joint%moment, joint%quadratic, joint%cubic, joint%attraction]) > 0)) call add_joint(machine, joint)
    modulation = modulation_of(choice)
    if (.not. any(abs(modulation%harmonic) > 0)) return
    if (.not. machine%frequency > 0) then
      call fail(error, exit_bad_case, path_of(choice)//'.modulation: found without a frequency, allowed beside a [drive.NAME] '// &
                'that has one; its amplitude may be 0')
      return
    end if
    joint%stiffness = stiffness
    joint%strength = modulation
    call add_joint(machine, joint)
  end subroutine add_spring

  !> A force along `row` by the expression of choice number `i`.
  pure subroutine add_own_force(machine, choices, i, row, rows, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    real(wp), intent(in) :: row(:), rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    joint%name = path_of(choices(i))
    joint%kind = joint_spring
    joint%row = row
    call set_expression(choices, i, rows, machine, joint, error)
    if (.not. allocated(error)) call add_joint(machine, joint)
  end subroutine add_own_force

  !> Friction of any law: dry, with a normal force of its own, or with memory.
  pure subroutine add_any_friction(machine, choices, i, rows, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    real(wp), intent(in) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    if (has_bristles(choices(i))) then
      call add_bristles(machine, choices(i), row_of(rows, choices(i)), error)
    else if (choices(i)%name == 'friction:maxwell_slip') then
      call add_elements(machine, choices(i), row_of(rows, choices(i)), error)
    else
      call add_friction(machine, choices(i), row_of(rows, choices(i)), error)
      if (all(choices(i)%name /= ['friction:coulomb_load', 'friction:expression  ']) .or. allocated(error)) return
      call set_expression(choices, i, rows, machine, machine%joints(size(machine%joints)), error)
    end if
  end subroutine add_any_friction

  pure subroutine add_friction(machine, choice, row, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: row(:)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    type(wave_t) :: belt
    joint%name = path_of(choice)
    joint%kind = joint_friction
    joint%row = row
    joint%friction = friction_of_part(choice)
    call check_static(choice, joint%friction%break_away, joint%friction%kinetic, error)
    if (allocated(error)) return
    if (choice%name == 'friction:elastic_coulomb') then
      joint%kind = joint_elastic
      joint%stiffness = value_of(choice, 'stiffness')
    end if
    belt%mean = value_of(choice, 'velocity')
    call move_surface(joint, machine%frequency, belt)
    call add_joint(machine, joint)
  end subroutine add_friction

  pure subroutine add_contact(machine, choice, row, given, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: row(:)
    integer, intent(in) :: given(:)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    joint%name = path_of(choice)
    joint%row = row
    ! None is the largest double, which other kinds exceed.
    if (value_of(choice, 'upper') < huge(1.0_real64)) joint%upper = value_of(choice, 'upper')
    if (value_of(choice, 'lower') > -huge(1.0_real64)) joint%lower = value_of(choice, 'lower')
    if (joint%upper >= huge(1.0_wp) .and. joint%lower <= -huge(1.0_wp)) then
      call fail(error, exit_bad_case, path_of(choice)//': found without a stop, allowed with upper, lower or both')
      return
    end if
    if (choice%name == 'contact:massless') then
      ! A point without mass on the flexibility of the modes left out is a spring that only pushes.
      joint%contact = contact_t(kind=contact_kelvin_voigt, soft=.true., stiffness=value_of(choice, 'stiffness'))
    else
      joint%contact = contact_of(law_of_one(choice), felt_mass(machine%mass, given, row))
    end if
    joint%kind = merge(joint_soft, joint_contact, joint%contact%soft)
    call add_joint(machine, joint)
  end subroutine add_contact

  !> The law of a contact without its ends.
  pure function law_of_one(choice) result(plain)
    type(law_choice_t), intent(in) :: choice
    type(law_choice_t) :: plain
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    plain = law_choice('contact', part_law(choice%name))
    rows = parameters_of(plain%family, plain%name)
    do i = 1, size(rows)
      call set_value(plain, trim(rows(i)%name), [value_of(choice, trim(rows(i)%name))])
    end do
  end function law_of_one

  !> Mass that a joint feels [kg]; coordinates whose motion is given have no end of it.
  pure real(wp) function felt_mass(mass, given, row)
    real(wp), intent(in) :: mass(:, :), row(:)
    integer, intent(in) :: given(:)
    integer, allocatable :: free(:)
    real(wp), allocatable :: push(:)
    integer :: i
    logical :: ok
    free = pack([(i, i=1, size(row))], [(all(given /= i), i=1, size(row))])
    allocate (push(size(free)))
    call solve(mass(free, free), row(free), push, ok)
    felt_mass = 1/max(sum(row(free)*push), tiny(felt_mass))
  end function felt_mass

end module build_joints
