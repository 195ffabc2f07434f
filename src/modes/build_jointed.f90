! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From the parts of a case to a jointed structure.
module build_jointed
  use assembly, only: add_body, add_force, add_joint, add_link, finish, give_motion, index_of, move_surface, row_between
  use contact_law, only: contact_of
  use elementary, only: sine_cosine
  use errors, only: error_t, fail
  use jointed, only: joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, joint_t, jointed_t, &
    together_newton, together_sequence, wave_t
  use kinds, only: real64, wp
  use law_table, only: effect_family, law_choice, law_choice_t, list_of, parameter_row_t, parameters_of, part_family, part_law, &
    path_of, set_value, value_of
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: is_jointed, jointed_of, watched_body

contains

  !> Whether the laws describe a jointed structure.
  pure logical function is_jointed(choices)
    type(law_choice_t), intent(in) :: choices(:)
    integer :: i
    is_jointed = .false.
    do i = 1, size(choices)
      if (choices(i)%family == 'body') is_jointed = choices(i)%name == 'structure'
    end do
  end function is_jointed

  !> Name of the body that the start and the results refer to; '' if there is none.
  pure function watched_body(choices) result(name)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=:), allocatable :: name
    integer :: i
    name = ''
    do i = 1, size(choices)
      if (choices(i)%name == 'body:watched') name = trim(choices(i)%label)
    end do
  end function watched_body

  !> The machine of the parts. Messages begin with the key.
  pure subroutine jointed_of(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(jointed_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(wave_t) :: wave
    integer :: i
    call refuse_others(choices, error)
    if (allocated(error)) return
    do i = 1, size(choices)
      if (choices(i)%family == 'body') machine%together = merge(together_sequence, together_newton, &
                                                                 value_of(choices(i), 'in_sequence') > 0.5_wp)
    end do
    call add_bodies(choices, machine)
    call set_frequency(choices, machine, error)
    if (allocated(error)) return
    do i = 1, size(choices)
      select case (choices(i)%name)
      case ('spring:linear')
        call add_link(machine, row_of(machine, choices(i)), value_of(choices(i), 'stiffness'), value_of(choices(i), 'damping'), &
                      value_of(choices(i), 'free_length'))
      case ('spring:polynomial', 'spring:pendulum')
        call add_spring(machine, choices(i))
      case ('drive:force')
        wave = wave_of(choices(i))
        call add_force(machine, unit_row(machine, choices(i)), wave%mean, wave%harmonic)
      case default
        if (index(choices(i)%name, 'friction:') == 1) call add_friction(machine, choices(i), error)
        if (index(choices(i)%name, 'contact:') == 1) call add_contact(machine, choices, i, error)
      end select
      if (allocated(error)) return
    end do
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:motion') cycle
      if (.not. machine%frequency > 0) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.frequency: missing, allowed more than 0 rad/s')
        return
      end if
      call check_given(choices, i, machine, error)
      if (allocated(error)) return
      call give_motion(machine, trim(machine%names(nint(value_of(choices(i), 'body')))), wave_of(choices(i)))
    end do
    call finish(machine, error)
  end subroutine jointed_of

  !> A body whose motion is given is not the watched one, and has one motion.
  pure subroutine check_given(choices, i, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    type(jointed_t), intent(in) :: machine
    type(error_t), allocatable, intent(out) :: error
    integer :: body, k
    body = nint(value_of(choices(i), 'body'))
    if (body == machine%watched) then
      call fail(error, exit_bad_case, path_of(choices(i))//'.body: found the watched body, allowed one that is not: name '// &
                'another in watch.body')
      return
    end if
    do k = 1, i - 1
      if (choices(k)%name /= 'drive:motion') cycle
      if (nint(value_of(choices(k), 'body')) /= body) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.body: found a body whose motion '//path_of(choices(k))// &
                ' gives, allowed one motion each')
    end do
  end subroutine check_given

  !> Laws of machines of one or two bodies, and effects, have no place here.
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
      if (index(choices(i)%name, 'body:') == 1) bodies = bodies + 1
    end do
    if (bodies == 0) call fail(error, exit_bad_case, 'body: found no table [body.NAME], allowed one or more')
  end subroutine refuse_others

  pure subroutine add_bodies(choices, machine)
    type(law_choice_t), intent(in) :: choices(:)
    type(jointed_t), intent(inout) :: machine
    integer :: i
    do i = 1, size(choices)
      if (index(choices(i)%name, 'body:') /= 1) cycle
      call add_body(machine, body_name(choices(i), machine%n + 1), value_of(choices(i), 'mass'), value_of(choices(i), 'load'))
      if (choices(i)%name == 'body:watched') then
        machine%watched = machine%n
      else
        machine%start(:, machine%n) = [value_of(choices(i), 'x0'), value_of(choices(i), 'v0')]
      end if
    end do
  end subroutine add_bodies

  !> Its label, or its number where the labels are not known.
  pure function body_name(choice, number) result(name)
    type(law_choice_t), intent(in) :: choice
    integer, intent(in) :: number
    character(len=:), allocatable :: name
    name = trim(choice%label)
    if (len(name) == 0) name = 'body '//to_text(number)
  end function body_name

  pure function number(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(real(value, real64))
  end function number

  !> The frequency of the drives: one for all.
  pure subroutine set_frequency(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(jointed_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    real(wp) :: frequency
    do i = 1, size(choices)
      if (index(choices(i)%name, 'drive:') /= 1) cycle
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
      if (index(choices(i)%name, 'drive:') /= 1 .or. machine%frequency > 0) cycle
      if (.not. varies(choices(i))) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.frequency: missing, allowed more than 0 rad/s')
      return
    end do
  end subroutine set_frequency

  !> Whether a drive is more than its mean.
  pure logical function varies(choice)
    type(law_choice_t), intent(in) :: choice
    varies = abs(value_of(choice, 'amplitude')) > 0 .or. size(list_of(choice, 'cosine')) + size(list_of(choice, 'sine')) > 0
  end function varies

  !> mean + amplitude cos(phi + angle) + sum a_n cos(n phi) + b_n sin(n phi).
  pure function wave_of(choice) result(wave)
    type(law_choice_t), intent(in) :: choice
    type(wave_t) :: wave
    real(wp) :: sine, cosine
    integer :: n
    wave%mean = value_of(choice, 'mean')
    associate (a => list_of(choice, 'cosine'), b => list_of(choice, 'sine'))
      allocate (wave%harmonic(max(1, size(a), size(b))), source=(0.0_wp, 0.0_wp))
      do n = 1, size(a)
        wave%harmonic(n) = wave%harmonic(n) + a(n)
      end do
      do n = 1, size(b)
        wave%harmonic(n) = wave%harmonic(n) - cmplx(0.0_wp, b(n), wp)
      end do
    end associate
    call sine_cosine(value_of(choice, 'angle'), sine, cosine)
    wave%harmonic(1) = wave%harmonic(1) + value_of(choice, 'amplitude')*cmplx(cosine, sine, wp)
  end function wave_of

  pure function row_of(machine, choice) result(row)
    type(jointed_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp) :: row(machine%n)
    integer :: first, second
    row = 0
    first = nint(value_of(choice, 'first'))
    second = nint(value_of(choice, 'second'))
    if (first > 0) row(first) = row(first) - 1
    if (second > 0) row(second) = row(second) + 1
  end function row_of

  pure function unit_row(machine, choice) result(row)
    type(jointed_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp) :: row(machine%n)
    row = 0
    row(nint(value_of(choice, 'body'))) = 1
  end function unit_row

  !> A spring whose force is not linear: its linear part belongs to the structure.
  pure subroutine add_spring(machine, choice)
    type(jointed_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    type(joint_t) :: joint
    real(wp) :: stiffness
    stiffness = 0
    joint%name = path_of(choice)
    joint%kind = joint_spring
    joint%row = row_of(machine, choice)
    joint%offset%mean = -value_of(choice, 'free_length')
    if (choice%name == 'spring:pendulum') then
      joint%moment = value_of(choice, 'moment')
    else
      stiffness = value_of(choice, 'stiffness')
      joint%quadratic = value_of(choice, 'quadratic')
      joint%cubic = value_of(choice, 'cubic')
    end if
    call add_link(machine, joint%row, stiffness, value_of(choice, 'damping'), value_of(choice, 'free_length'))
    if (abs(joint%moment) + abs(joint%quadratic) + abs(joint%cubic) > 0) call add_joint(machine, joint)
  end subroutine add_spring

  pure subroutine add_friction(machine, choice, error)
    type(jointed_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    type(wave_t) :: belt
    real(wp) :: static
    joint%name = path_of(choice)
    joint%kind = joint_friction
    joint%row = row_of(machine, choice)
    joint%friction%kinetic = value_of(choice, 'force')
    static = value_of(choice, 'static_force')
    if (static < 0) static = joint%friction%kinetic
    if (static < joint%friction%kinetic) then
      call fail(error, exit_bad_case, path_of(choice)//'.static_force: found '//number(static)//' N, allowed at least the '// &
                'force '//number(joint%friction%kinetic)//' N')
      return
    end if
    joint%friction%break_away = static
    select case (choice%name)
    case ('friction:elastic_coulomb')
      joint%kind = joint_elastic
      joint%stiffness = value_of(choice, 'stiffness')
    case ('friction:coulomb_viscous')
      joint%friction%damping = value_of(choice, 'damping')
    case ('friction:coulomb_stribeck')
      joint%friction%excess = static - joint%friction%kinetic
      joint%friction%stribeck_velocity = value_of(choice, 'stribeck_velocity')
      joint%friction%stribeck_exponent = value_of(choice, 'stribeck_exponent')
    case ('friction:coulomb_hyperbolic')
      if (static > joint%friction%kinetic) joint%fading_speed = value_of(choice, 'fading_velocity')
    end select
    belt%mean = value_of(choice, 'velocity')
    call move_surface(joint, machine%frequency, belt)
    call add_joint(machine, joint)
  end subroutine add_friction

  pure subroutine add_contact(machine, choices, i, error)
    type(jointed_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t) :: choice
    type(joint_t) :: joint
    choice = choices(i)
    joint%name = path_of(choice)
    joint%row = row_of(machine, choice)
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
    joint%contact = contact_of(law_of_one(choice), felt_mass(machine, choices, joint%row))
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

  !> Mass that a joint feels [kg]; a body whose motion is given has no end of it.
  pure real(wp) function felt_mass(machine, choices, row)
    type(jointed_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: choices(:)
    real(wp), intent(in) :: row(:)
    real(wp) :: mobility
    integer :: i, k
    mobility = 0
    do k = 1, machine%n
      if (any([(choices(i)%name == 'drive:motion' .and. is_of_body(choices(i), k), i=1, size(choices))])) cycle
      mobility = mobility + row(k)**2/machine%mass(k, k)
    end do
    felt_mass = 1/max(mobility, tiny(mobility))
  end function felt_mass

  !> Whether a drive is that of body number `k`.
  pure logical function is_of_body(choice, k)
    type(law_choice_t), intent(in) :: choice
    integer, intent(in) :: k
    is_of_body = .false.
    if (index(choice%name, 'drive:') == 1) is_of_body = nint(value_of(choice, 'body')) == k
  end function is_of_body

end module build_jointed
