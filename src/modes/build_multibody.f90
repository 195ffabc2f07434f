! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From the parts of a case to a multibody structure.
module build_multibody
  use assembly, only: add_body, add_force, finish, give_motion
  use build_control, only: add_controllers, add_impulses
  use build_joints, only: add_any_friction, add_contact, add_own_force, add_spring
  use build_load, only: set_expression
  use build_memory, only: add_deflections
  use errors, only: error_t, fail
  use multibody, only: is_stop, joint_t, multibody_t, together_newton, together_sequence, wave_t
  use kinds, only: wp
  use law_table, only: effect_family, law_choice_t, list_of, part_family, path_of, text_of, value_of
  use part_angles, only: mass_of, names_of_angles
  use reference_points, only: add_structures, body_name, is_reference_point, name_coordinates, number, reference_point_of, &
    row_of
  use status, only: exit_bad_case
  use waves, only: wave_of, wave_of_load
  implicit none
  private

  public :: complete, is_multibody, join_parts, multibody_of

  !> What parts refer to while they are joined: the rows of the reference points (columns), and coordinates of given motion.
  type, public :: joined_t
    real(wp), allocatable :: rows(:, :)
    integer, allocatable :: given(:)
  end type joined_t

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
    type(joined_t) :: joined
    call join_parts(choices, machine, joined, error)
    if (.not. allocated(error)) call check_parts(choices, machine, error)
    if (.not. allocated(error)) call complete(choices, joined, machine, error)
  end subroutine multibody_of

  !> Bodies, springs, joints and forces of a machine, which `complete` makes one that moves.
  pure subroutine join_parts(choices, machine, joined, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(out) :: machine
    type(joined_t), intent(out) :: joined
    type(error_t), allocatable, intent(out) :: error
    integer, allocatable :: coordinate(:)
    type(wave_t) :: wave
    integer :: i
    call refuse_others(choices, error)
    if (allocated(error)) return
    do i = 1, size(choices)
      if (choices(i)%family == 'body') machine%together = merge(together_sequence, together_newton, &
                                                                 value_of(choices(i), 'in_sequence') > 0.5_wp)
    end do
    machine%angles = names_of_angles(choices)
    call add_bodies(choices, machine)
    call add_structures(choices, machine, joined%rows, error)
    if (.not. allocated(error)) call set_frequency(choices, machine, error)
    if (.not. allocated(error)) call name_coordinates(choices, machine, joined%rows, coordinate, error)
    if (allocated(error)) return
    call add_deflections(choices, machine, joined%rows)
    joined%given = given_of(choices, coordinate)
    do i = 1, size(choices)
      call add_part(choices, i, joined, machine, error)
      if (allocated(error)) return
    end do
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:motion') cycle
      call find_motion(machine, choices, i, joined%rows, wave, error)
      if (allocated(error)) return
      call give_motion(machine, trim(machine%names(coordinate(reference_point_of(choices(i))))), wave)
    end do
  end subroutine join_parts

  !> A spring, a joint or a force: choice number `i`.
  pure subroutine add_part(choices, i, joined, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    type(joined_t), intent(in) :: joined
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(wave_t) :: wave
    associate (choice => choices(i), rows => joined%rows)
      select case (choice%name)
      case ('drive:force')
        wave = wave_of(choice)
        call add_force(machine, rows(:, reference_point_of(choice)), wave%mean, wave%harmonic)
      case ('drive:expression')
        call add_own_force(machine, choices, i, rows(:, reference_point_of(choice)), rows, error)
      case ('drive:base')
        call add_base(machine, choices, i, rows, error)
      case ('spring:expression')
        call add_own_force(machine, choices, i, row_of(rows, choice), rows, error)
      case default
        if (index(choice%name, 'spring:') == 1) call add_spring(machine, choice, row_of(rows, choice), error)
        if (index(choice%name, 'friction:') == 1) call add_any_friction(machine, choices, i, rows, error)
        if (index(choice%name, 'contact:') == 1) call add_contact(machine, choice, row_of(rows, choice), joined%given, error)
      end select
    end associate
  end subroutine add_part

  !> What the parts of a case must have: a frequency with a given motion, and room between stops.
  pure subroutine check_parts(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(in) :: machine
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:motion' .or. machine%frequency > 0 .or. allocated(error)) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.frequency: missing, allowed more than 0 rad/s')
    end do
    do i = 1, size(machine%joints)
      associate (joint => machine%joints(i))
        if (.not. is_stop(joint%kind) .or. joint%lower < joint%upper .or. allocated(error)) cycle
        call fail(error, exit_bad_case, trim(joint%name)//'.lower: found '//number(joint%lower)// &
                  ' m, allowed less than upper = '//number(joint%upper)//' m')
      end associate
    end do
  end subroutine check_parts

  !> The machine that moves: controllers once every joint and force is there, and impulses once given motions have left it.
  pure subroutine complete(choices, joined, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(joined_t), intent(in) :: joined
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    call add_controllers(choices, joined%rows, joined%given, machine, error)
    if (.not. allocated(error)) call finish(machine, error)
    if (.not. allocated(error)) call add_impulses(choices, joined%rows, joined%given, machine, error)
  end subroutine complete

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

end module build_multibody
