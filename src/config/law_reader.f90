! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables [body], [restoring], [friction], [contact], [drive], those of `added_families`, and [effect.NAME], by the law table.
module law_reader
  use case_parameters, only: find_parameter
  use case_source, only: case_source_t, description, enter_table, find, has_problems, know, know_all_below, report
  use case_values, only: take_text
  use drive_law, only: ends_with_its_first, moves_foot
  use force_record, only: read_force
  use kinds, only: wp
  use own_reader, only: read_own_law, read_own_tables
  use part_names, only: is_table
  use part_reader, only: has_parts, read_parts
  use law_row, only: law_length
  use law_table, only: added_families, effect_family, families, find_law, law_choice, law_choice_t, laws, list_of, motor_family, &
    own_law, parameter_row_t, parameters_of, part_family, set_value, table_of
  use pair_rows, only: pair_laws
  use restoring_law, only: position_is_angle
  use row_reader, only: take_row
  use suggest, only: nearest_word
  use text, only: join
  use toml_bindings, only: toml_string
  implicit none
  private

  public :: read_laws

contains

  !> Five laws in the order of `families`, then the effects. A body without a law is a point mass; any other family
  !> without a table has the law 'none'.
  subroutine read_laws(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(out) :: choices(:)
    character(len=law_length) :: body
    integer :: i
    allocate (choices(size(families)))
    if (has_parts(source)) then
      choices(1) = law_choice('body', 'structure')
      if (.not. is_table(source, 'body.in_sequence')) call read_parameters(source, .false., choices(1))
      do i = 2, size(families)
        choices(i) = law_choice(families(i), 'none')
      end do
      call read_effects(source, choices)
      call read_parts(source, choices)
      return
    end if
    call read_law(source, 'body', '', restores_an_angle(source), choices(1))
    body = choices(1)%name
    if (has_problems(source, 'body.law')) body = ''
    do i = 2, size(families)
      call read_law(source, trim(families(i)), body, position_is_angle(choices(:i - 1)), choices(i))
    end do
    call resolve_static_friction(choices)
    call read_added(source, choices)
    call read_own_tables(source, choices)
    call read_effects(source, choices)
  end subroutine read_laws

  !> Whether the restoring force is that of a pendulum, which makes the mass, read before it, an inertia.
  pure logical function restores_an_angle(source)
    type(case_source_t), intent(in) :: source
    integer :: at
    restores_an_angle = .false.
    at = find(source, 'restoring.law')
    if (at == 0) return
    if (source%entries(at)%entry%kind /= toml_string) return
    restores_an_angle = source%entries(at)%entry%string == 'pendulum'
  end function restores_an_angle

  !> The tables that a case may add, such as [motor]: a drive without has a given speed.
  subroutine read_added(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(law_choice_t) :: choice
    integer :: i
    do i = 1, size(added_families)
      call know(source, trim(added_families(i))//'.')
      if (.not. is_table(source, trim(added_families(i)))) cycle
      call read_law(source, trim(added_families(i)), '', .false., choice)
      choices = [choices, choice]
    end do
  end subroutine read_added

  !> The tables [effect.NAME], in the order of the law table.
  subroutine read_effects(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(law_choice_t) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, k
    logical :: found
    call enter_table(source, effect_family, found)
    do i = 1, size(laws)
      if (laws(i)%family /= effect_family) cycle
      choice = law_choice(effect_family, trim(laws(i)%name))
      call enter_table(source, table_of(effect_family, laws(i)%name), found)
      if (found) then
        call read_parameters(source, position_is_angle(choices), choice)
        choices = [choices, choice]
      else
        rows = parameters_of(effect_family, laws(i)%name)
        do k = 1, size(rows)
          call know(source, table_of(effect_family, laws(i)%name)//'.'//trim(rows(k)%name))
        end do
      end if
    end do
  end subroutine read_effects

  !> The law of a family beside the law `body` of [body], '' if that is not known; the laws before it make a position an angle
  !> or not.
  subroutine read_law(source, family, body, is_angle, choice)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: family, body
    logical, intent(in) :: is_angle
    type(law_choice_t), intent(out) :: choice
    character(len=:), allocatable :: name, default, names
    integer :: at
    logical :: found
    default = 'none'
    if (family == 'body') default = 'point_mass'
    choice = law_choice(family, default)
    names = laws_beside(family, body)
    call enter_table(source, family, found)
    at = find(source, family//'.law')
    if (at > 0) then
      if (source%entries(at)%entry%kind /= toml_string) then
        call report(source, family//'.law', 'found '//description(source%entries(at)%entry)//', allowed '//names)
        call know_all_below(source, family)
        return
      end if
    end if
    name = default
    call take_text(source, family//'.law', name)
    if (found .and. default == 'none' .and. at == 0) then
      call report(source, family//'.law', 'missing, allowed '//names)
      call know_all_below(source, family)
    else if (find_law(family, name) == 0) then
      call report(source, family//'.law', 'found "'//name//'"'//hint(family, name)//', allowed '//names//of_parts(family, name))
      call know_all_below(source, family)
    else if (.not. goes_with(family, name, body)) then
      ! Before its keys, which would be in vain.
      call report(source, family//'.law', 'found "'//name//'", '//whose(body)//' '//names)
      call know_all_below(source, family)
    else
      choice = law_choice(family, name)
      call read_parameters(source, is_angle, choice)
      if (name == own_law .or. has_load(source, choice)) call read_own_law(source, choice)
    end if
  end subroutine read_law

  !> Whether friction by a coefficient has a normal force of its own, an expression.
  pure logical function has_load(source, choice)
    type(case_source_t), intent(in) :: source
    type(law_choice_t), intent(in) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    rows = parameters_of(choice%family, choice%name)
    has_load = choice%family == 'friction' .and. any(rows%name == 'kinetic_coefficient') .and. find(source, 'friction.load') > 0
  end function has_load

  !> Whether a body can have a law of another family.
  pure logical function goes_with(family, law, body)
    character(len=*), intent(in) :: family, law, body
    logical :: of_two
    goes_with = .true.
    if (law == 'none' .or. len_trim(body) == 0) return
    if (law == own_law) then
      goes_with = body == 'point_mass'
      return
    end if
    of_two = any(pair_laws%family == family .and. pair_laws%name == law)
    if (body == 'point_mass') then
      goes_with = .not. of_two .or. (family == 'drive' .and. law == 'force')
    else if (family == 'drive') then
      goes_with = of_two
    else if (family == 'friction') then
      goes_with = law == 'viscous'
    else if (family == 'restoring') then
      goes_with = law == 'linear'
    end if
  end function goes_with

  !> Where a law that one body does not have is allowed: between parts.
  pure function of_parts(family, name) result(text)
    character(len=*), intent(in) :: family, name
    character(len=:), allocatable :: text
    text = ''
    if (find_law(part_family, family//':'//name) > 0) text = '; '//name//' in ['//family//'.NAME] beside [body.NAME]'
  end function of_parts

  !> The laws of a family that a body can have, for messages.
  pure function laws_beside(family, body) result(names)
    character(len=*), intent(in) :: family, body
    character(len=:), allocatable :: names
    integer :: i
    names = join(pack(laws%name, [(laws(i)%family == family .and. goes_with(family, laws(i)%name, body), i=1, size(laws))]), ', ')
  end function laws_beside

  !> What is missing for a law that the body cannot have, for messages.
  pure function whose(body) result(text)
    character(len=*), intent(in) :: body
    character(len=:), allocatable :: text
    text = 'allowed with two bodies'
    if (body == 'point_mass') text = 'allowed with two bodies (body.law = "friction_pair" or "backlash_pair"); with one'
  end function whose

  pure function hint(family, name) result(text)
    character(len=*), intent(in) :: family, name
    character(len=:), allocatable :: text, meant
    meant = nearest_word(name, pack(laws%name, laws%family == family))
    text = ''
    if (len(meant) > 0) text = ' (did you mean "'//meant//'"?)'
  end function hint

  subroutine read_parameters(source, is_angle, choice)
    type(case_source_t), intent(inout) :: source
    logical, intent(in) :: is_angle
    type(law_choice_t), intent(inout) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    logical :: from_file
    rows = parameters_of(choice%family, choice%name)
    from_file = .false.
    if (choice%name == 'measured_force') call read_force_file(source, choice, from_file)
    if (choice%family == 'drive' .and. moves_foot(choice%name)) call choose_speed(source, rows)
    do i = 1, size(rows)
      if (from_file .and. (rows(i)%name == 'interval' .or. rows(i)%name == 'force')) cycle
      call take_row(source, table_of(rows(i)%family, rows(i)%law), rows(i), is_angle, choice%parameters(i)%values)
    end do
    if (choice%name == 'measured_force' .and. find(source, 'drive.periodic') == 0) then
      call set_value(choice, 'periodic', [merge(0.0_wp, 1.0_wp, ends_with_its_first(list_of(choice, 'force')))])
    end if
  end subroutine read_parameters

  !> A drive of the foot has a ratio or a frequency, with a motor neither.
  subroutine choose_speed(source, rows)
    type(case_source_t), intent(inout) :: source
    type(parameter_row_t), intent(inout) :: rows(:)
    logical :: found(2)
    found = [find(source, 'drive.ratio') > 0, find(source, 'drive.frequency') > 0]
    if (is_table(source, motor_family)) then
      call refuse_speed(source, 'drive.ratio')
      call refuse_speed(source, 'drive.frequency')
    else if (all(found)) then
      call report(source, 'drive.frequency', 'found beside drive.ratio, allowed one of them')
    else if (.not. any(found)) then
      where (rows%name == 'ratio') rows%optional = .false.
    end if
  end subroutine choose_speed

  !> A motor sets the speed of its crank itself.
  subroutine refuse_speed(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    if (find(source, path) == 0) return
    call know(source, path)
    call report(source, path, 'found with a table [motor], allowed without: the motor sets the speed of the crank')
  end subroutine refuse_speed

  !> A measured force that is the name of a file, relative to the folder of the case; `found` is false if it is not.
  subroutine read_force_file(source, choice, found)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(inout) :: choice
    logical, intent(out) :: found
    character(len=:), allocatable :: path, problem
    real(wp), allocatable :: force(:)
    real(wp) :: interval
    integer :: at
    at = find(source, 'drive.force')
    found = at > 0
    if (found) found = source%entries(at)%entry%kind == toml_string
    if (.not. found) return
    path = source%entries(at)%entry%string
    if (index(path, '/') /= 1) path = source%name(:index(source%name, '/', back=.true.))//path
    call know(source, 'drive.force')
    call know(source, 'drive.interval')
    call read_force(path, 'force', interval, force, problem)
    if (allocated(problem)) then
      call report(source, 'drive.force', problem)
    else if (find(source, 'drive.interval') > 0) then
      call report(source, 'drive.interval', 'found beside the name of a file, allowed with a list')
    else
      call set_value(choice, 'interval', [interval])
      call set_value(choice, 'force', force)
    end if
  end subroutine read_force_file

  !> Break-away friction that is not given equals sliding friction.
  pure subroutine resolve_static_friction(choices)
    type(law_choice_t), intent(inout) :: choices(:)
    integer :: law, static, kinetic
    call find_parameter(choices, 'friction.static_coefficient', law, static)
    if (law > 0) then
      call find_parameter(choices, 'friction.kinetic_coefficient', law, kinetic)
    else
      call find_parameter(choices, 'friction.static_force', law, static)
      if (law == 0) return
      call find_parameter(choices, 'friction.force', law, kinetic)
    end if
    associate (parameters => choices(law)%parameters)
      if (parameters(static)%values(1) < 0) parameters(static)%values = parameters(kinetic)%values
    end associate
  end subroutine resolve_static_friction

end module law_reader
