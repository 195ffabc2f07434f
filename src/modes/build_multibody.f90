! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From the parts of a case to a multibody structure.
module build_multibody
  use assembly, only: add_body, add_force, add_joint, add_link, finish, give_motion, move_surface
  use build_control, only: add_controllers, add_impulses
  use build_load, only: set_expression
  use build_memory, only: add_bristles, add_deflections, add_elements, check_static, has_bristles
  use contact_law, only: contact_kelvin_voigt, contact_of, contact_t
  use errors, only: error_t, fail
  use friction_law, only: friction_of_part
  use multibody, only: joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, joint_t, multibody_t, &
    together_newton, together_sequence, wave_t
  use kinds, only: real64, wp
  use law_table, only: effect_family, law_choice, law_choice_t, list_of, parameter_row_t, parameters_of, part_family, part_law, &
    path_of, set_value, text_of, value_of
  use matrices, only: solve
  use part_angles, only: mass_of, names_of_angles
  use reference_points, only: add_structures, body_name, is_reference_point, name_coordinates, number, reference_point_of, row_of
  use status, only: exit_bad_case
  use waves, only: modulation_of, wave_of, wave_of_load
  implicit none
  private

  public :: is_multibody, joint_alone, multibody_of

contains

  !> Whether the laws describe a multibody structure.
  pure logical function is_multibody(choices)
    type(law_choice_t), intent(in) :: choices(:)
    integer :: i
    is_multibody = .false.
    do i = 1, size(choices)
      if (choices(i)%family == 'body') is_multibody = choices(i)%name == 'structure'
    end do
  end function is_multibody

  !> The machine of the parts. Messages begin with the key.
  pure subroutine multibody_of(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(wave_t) :: wave
    real(wp), allocatable :: rows(:, :)
    integer, allocatable :: coordinate(:)
    integer :: i
    call refuse_others(choices, error)
    if (allocated(error)) return
    do i = 1, size(choices)
      if (choices(i)%family == 'body') machine%together = merge(together_sequence, together_newton, &
                                                                 value_of(choices(i), 'in_sequence') > 0.5_wp)
    end do
    machine%angles = names_of_angles(choices)
    call add_bodies(choices, machine)
    call add_structures(choices, machine, rows, error)
    if (.not. allocated(error)) call set_frequency(choices, machine, error)
    if (.not. allocated(error)) call name_coordinates(choices, machine, rows, coordinate, error)
    if (allocated(error)) return
    call add_deflections(choices, machine, rows)
    do i = 1, size(choices)
      select case (choices(i)%name)
      case ('drive:force')
        wave = wave_of(choices(i))
        call add_force(machine, rows(:, reference_point_of(choices(i))), wave%mean, wave%harmonic)
      case ('drive:expression')
        call add_own_force(machine, choices, i, rows(:, reference_point_of(choices(i))), rows, error)
      case ('drive:base')
        call add_base(machine, choices, i, rows, error)
      case ('spring:expression')
        call add_own_force(machine, choices, i, row_of(rows, choices(i)), rows, error)
      case default
        if (index(choices(i)%name, 'spring:') == 1) call add_spring(machine, choices(i), row_of(rows, choices(i)), error)
        if (index(choices(i)%name, 'friction:') == 1) call add_any_friction(machine, choices, i, rows, error)
        if (index(choices(i)%name, 'contact:') == 1) call add_contact(machine, choices(i), row_of(rows, choices(i)), &
                                                                      given_of(choices, coordinate), error)
      end select
      if (allocated(error)) return
    end do
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:motion') cycle
      call find_motion(machine, choices, i, rows, wave, error)
      if (allocated(error)) return
      call give_motion(machine, trim(machine%names(coordinate(reference_point_of(choices(i))))), wave)
    end do
    associate (given => given_of(choices, coordinate))
      call add_controllers(choices, rows, given, machine, error)
      if (.not. allocated(error)) call finish(machine, error)
      if (.not. allocated(error)) call add_impulses(choices, rows, given, machine, error)
    end associate
  end subroutine multibody_of

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

  !> Refuses laws of machines of one or two bodies, and effects.
  pure subroutine refuse_others(choices, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i, bodies
    bodies = 0
    do i = 1, size(choices)
      if (choices(i)%family == effect_family) then
        call fail(error, exit_bad_case, path_of(choices(i))//': found with [body.NAME], allowed with one body')
        return
      else if (choices(i)%family /= 'body' .and. choices(i)%family /= part_family .and. choices(i)%name /= 'none') then
        call fail(error, exit_bad_case, trim(choices(i)%family)//'.law: found "'//trim(choices(i)%name)//'" with [body.NAME], '// &
                  'allowed in tables with a name: [spring.NAME], [friction.NAME], [contact.NAME], [drive.NAME]')
        return
      end if
      if (is_reference_point(choices(i))) bodies = bodies + 1
    end do
    if (bodies == 0) call fail(error, exit_bad_case, 'body: found no [body.NAME] and no point of a [structure.NAME], allowed '// &
                               'one or more')
  end subroutine refuse_others

  pure subroutine add_bodies(choices, machine)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    integer :: i
    do i = 1, size(choices)
      if (index(choices(i)%name, 'body:') /= 1) cycle
      call add_body(machine, body_name(choices(i), machine%n + 1), mass_of(choices(i)), value_of(choices(i), 'load'))
      if (choices(i)%name == 'body:watched') then
        machine%watched = machine%n
      else
        machine%start(:, machine%n) = [value_of(choices(i), 'x0'), value_of(choices(i), 'v0')]
      end if
    end do
  end subroutine add_bodies

  !> The frequency of the drives: one for all.
  pure subroutine set_frequency(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    real(wp) :: frequency
    do i = 1, size(choices)
      if (index(choices(i)%name, 'drive:') /= 1 .or. choices(i)%name == 'drive:impulse') cycle
      frequency = value_of(choices(i), 'frequency')
      if (.not. frequency > 0) cycle
      if (machine%frequency > 0 .and. abs(frequency - machine%frequency) > 0) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.frequency: found '//number(frequency)// &
                  ' rad/s, allowed that of the first drive, '//number(machine%frequency)//' rad/s: leave it out')
        return
      end if
      machine%frequency = frequency
    end do
    do i = 1, size(choices)
      if (index(choices(i)%name, 'drive:') /= 1 .or. choices(i)%name == 'drive:impulse' .or. machine%frequency > 0) cycle
      if (.not. varies(choices(i))) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.frequency: missing, allowed more than 0 rad/s')
      return
    end do
  end subroutine set_frequency

  !> Whether a drive is more than its mean.
  pure logical function varies(choice)
    type(law_choice_t), intent(in) :: choice
    varies = choice%name == 'drive:motion' .and. len(text_of(choice, 'position')) > 0
    if (varies) return
    if (any(choice%name == [character(len=16) :: 'drive:expression', 'drive:base'])) return
    varies = abs(value_of(choice, 'amplitude')) > 0 .or. size(list_of(choice, 'cosine')) + size(list_of(choice, 'sine')) > 0
  end function varies

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

  !> The motion of the ground, from which positions are seen: each body has the inertia of its acceleration.
  pure subroutine add_base(machine, choices, i, rows, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    real(wp), intent(in) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: row(size(rows, 1))
    integer :: k, body
    if (any(index(choices%name, 'structure:') == 1) .or. count(choices%name == 'drive:base') > 1) then
      call fail(error, exit_bad_case, path_of(choices(i))//'.law: found "base" beside another one or a [structure.NAME], '// &
                'allowed one, with bodies')
      return
    end if
    row = 0
    body = 0
    do k = 1, size(choices)
      if (index(choices(k)%name, 'body:') /= 1) cycle
      body = body + 1
      row = row + mass_of(choices(k))*rows(:, body)
    end do
    call add_own_force(machine, choices, i, row, rows, error)
  end subroutine add_base

  !> The given motion of choice number `i`, a series or an expression.
  pure subroutine find_motion(machine, choices, i, rows, wave, error)
    type(multibody_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    real(wp), intent(in) :: rows(:, :)
    type(wave_t), intent(out) :: wave
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    character(len=:), allocatable :: problem
    if (len(text_of(choices(i), 'position')) == 0) then
      wave = wave_of(choices(i))
      return
    end if
    call set_expression(choices, i, rows, machine, joint, error)
    if (allocated(error)) return
    if (joint%load%by_clock) then
      problem = 'found a motion that does not repeat with the period of the drive, allowed one that does; that of the ground '// &
                '(law = "base") may be any'
    else
      call wave_of_load(joint%load, machine%frequency, wave, problem)
    end if
    if (allocated(problem)) call fail(error, exit_bad_case, path_of(choices(i))//'.position: '//problem)
  end subroutine find_motion

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
      if (choices(i)%name /= 'friction:coulomb_load' .or. allocated(error)) return
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
    else if (.not. joint%lower < joint%upper) then
      call fail(error, exit_bad_case, path_of(choice)//'.lower: found '//number(joint%lower)//' m, allowed less than upper = '// &
                number(joint%upper)//' m')
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

  !> Coordinates whose motion is given.
  pure function given_of(choices, coordinate) result(given)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: coordinate(:)
    integer, allocatable :: given(:)
    integer :: i
    given = [integer ::]
    do i = 1, size(choices)
      if (choices(i)%name == 'drive:motion') given = [given, coordinate(reference_point_of(choices(i)))]
    end do
  end function given_of

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

end module build_multibody
