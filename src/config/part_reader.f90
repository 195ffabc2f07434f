! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables of a machine of several bodies: [body.NAME], [structure.NAME], [spring.NAME], [friction.NAME],
!> [contact.NAME], [drive.NAME] and [watch].
module part_reader
  use case_parameters, only: is_of_position
  use case_source, only: case_source_t, description, enter_table, find, has_problems, know, know_all_below, report
  use case_values, only: take_text
  use drive_record, only: read_record
  use kinds, only: wp
  use law_table, only: find_law, is_hidden, label_length, law_choice, law_choice_t, laws, own_law, parameter_row_t, parameters, &
    parameters_of, part_family, part_kind, part_law, path_of, set_value, value_of
  use part_angles, only: is_joint, is_of_angle, turns
  use own_reader, only: read_own_law
  use part_names, only: check_columns, check_names, ground, names_of
  use row_reader, only: take_row
  use structure_reader, only: read_structure
  use suggest, only: nearest_word
  use text, only: join, number_in, to_text
  use toml_bindings, only: toml_array, toml_string, toml_table
  implicit none
  private

  public :: has_parts, read_parts

  !> Tables of parts, in the order in which they are kept; laws where a table gives none.
  character(len=8), parameter :: kinds_of_parts(5) = ['body    ', 'spring  ', 'friction', 'contact ', 'drive   ']
  character(len=8), parameter :: default_law(5) = ['mass    ', 'linear  ', 'coulomb ', '        ', '        ']
  !> Names of the reference points between which joints act: bodies, then points of structures.
  type :: bodies_t
    character(len=label_length), allocatable :: names(:)
    !> Displacement of one per force at another by the modes that structures leave out [m/N].
    real(wp), allocatable :: left_out(:, :)
  end type bodies_t

contains

  !> Whether a case has tables [body.NAME] or [structure.NAME]. A body may have the name of a key of [body]: it has a mass or an
  !> inertia.
  pure logical function has_parts(source)
    type(case_source_t), intent(in) :: source
    character(len=label_length), allocatable :: names(:)
    integer :: i
    has_parts = .false.
    names = names_of(source, 'body')
    do i = 1, size(names)
      has_parts = has_parts .or. find(source, 'body.'//trim(names(i))//'.mass') > 0
      has_parts = has_parts .or. find(source, 'body.'//trim(names(i))//'.inertia') > 0
      if (.not. any(parameters%family == 'body' .and. parameters%name == names(i))) has_parts = .true.
    end do
    if (size(names_of(source, 'structure')) > 0) has_parts = .true.
  end function has_parts

  !> The laws of the five families, none but 'structure', then every part.
  subroutine read_parts(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(bodies_t) :: bodies
    character(len=label_length), allocatable :: names(:)
    character(len=:), allocatable :: watched
    type(law_choice_t), allocatable :: structures(:)
    real(wp), allocatable :: left_out(:, :)
    integer :: i, k
    logical :: found
    do i = 1, size(kinds_of_parts)
      ! Tables that may be there are named where one is misspelt.
      call know(source, trim(kinds_of_parts(i))//'.')
      call enter_table(source, trim(kinds_of_parts(i)), found)
    end do
    bodies%names = names_of(source, 'body')
    call check_names(source, 'body', bodies%names)
    names = names_of(source, 'structure')
    call check_names(source, 'structure', names)
    allocate (structures(0))
    allocate (bodies%left_out(size(bodies%names), size(bodies%names)), source=0.0_wp)
    do k = 1, size(names)
      call read_structure(source, trim(names(k)), k, structures, left_out)
      call append_block(bodies%left_out, left_out)
    end do
    bodies%names = [bodies%names, pack(structures%label, index(structures%name, 'point:') == 1)]
    call check_columns(source, bodies%names, structures)
    call read_watch(source, bodies, watched)
    do i = 1, size(kinds_of_parts)
      names = names_of(source, trim(kinds_of_parts(i)))
      if (i > 1) call refuse_keys(source, trim(kinds_of_parts(i)))
      if (i > 1) call check_names(source, trim(kinds_of_parts(i)), names)
      do k = 1, size(names)
        call add_part(source, trim(kinds_of_parts(i)), trim(default_law(i)), trim(names(k)), watched, bodies, choices)
      end do
      if (i > 1) cycle
      do k = 1, size(structures)
        if (structures(k)%name == 'point:row' .and. structures(k)%label == watched) structures(k)%name = 'point:watched'
      end do
      choices = [choices, structures]
    end do
    do i = 1, size(choices)
      if (choices(i)%family /= part_family .or. .not. any(kinds_of_parts == part_kind(choices(i)%name))) cycle
      if (is_joint(choices(i))) call refuse_unlike(source, choices, i)
      call read_values(source, bodies, is_of_angle(choices, i), is_of_angle(choices, i, .true.), choices(i))
    end do
  end subroutine read_parts

  !> Keys of a table without the name of a part, as one body has them.
  subroutine refuse_keys(source, kind)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: kind
    integer :: i, first
    first = 0
    do i = 1, size(source%entries)
      associate (entry => source%entries(i)%entry)
        if (index(entry%path, kind//'.') /= 1 .or. entry%kind == toml_table) cycle
        if (scan(entry%path(len(kind) + 2:), '.[') > 0) cycle
        call know(source, entry%path)
        if (first == 0) first = i
      end associate
    end do
    if (first > 0) call report(source, source%entries(first)%entry%path, 'found beside [body.NAME], allowed in tables with a '// &
                               'name, ['//kind//'.NAME]')
  end subroutine refuse_keys

  !> The body or point that the start and the results refer to: the first, unless [watch] names another.
  subroutine read_watch(source, bodies, watched)
    type(case_source_t), intent(inout) :: source
    type(bodies_t), intent(in) :: bodies
    character(len=:), allocatable, intent(out) :: watched
    logical :: found
    call enter_table(source, 'watch', found)
    watched = ''
    if (size(bodies%names) == 0) then
      call know_all_below(source, 'watch')
      if (.not. has_problems(source)) call report(source, 'structure', 'found no body and no point, allowed '// &
        '[structure.NAME.point] with one or more')
      return
    end if
    watched = trim(bodies%names(1))
    call take_text(source, 'watch.body', watched)
    if (.not. any(bodies%names == watched)) call report(source, 'watch.body', 'found "'//watched//'"'// &
      hint(watched, bodies%names)//', allowed '//join(bodies%names, ', '))
  end subroutine read_watch

  pure function hint(word, names) result(text)
    character(len=*), intent(in) :: word
    character(len=label_length), intent(in) :: names(:)
    character(len=:), allocatable :: text, meant
    meant = nearest_word(word, names)
    text = ''
    if (len(meant) > 0) text = ' (did you mean "'//meant//'"?)'
  end function hint

  !> Appends a part with the bodies it acts on. Its values are read once all joints determine what turns.
  subroutine add_part(source, kind, default, name, watched, bodies, choices)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: kind, default, name, watched
    type(bodies_t), intent(in) :: bodies
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(law_choice_t) :: choice
    character(len=:), allocatable :: law, path
    logical :: found
    path = kind//'.'//name
    call enter_table(source, path, found)
    law = default
    if (kind == 'body') then
      if (name == watched) law = 'watched'
      if (name == watched) call refuse_start(source, path)
    else
      call take_text(source, path//'.law', law)
    end if
    if (find_law(part_family, kind//':'//law) == 0 .or. len(law) == 0) then
      if (len(law) == 0 .and. find(source, path//'.law') == 0) then
        call report(source, path//'.law', 'missing, allowed '//laws_of(kind))
      else
        call report(source, path//'.law', 'found "'//law//'", allowed '//laws_of(kind))
      end if
      call know_all_below(source, path)
      return
    end if
    choice = law_choice(part_family, kind//':'//law)
    choice%label = name
    if (kind == 'drive' .and. law /= 'base') call read_body(source, path, bodies, choice)
    if (kind == 'body' .and. find(source, path//'.inertia') > 0) call set_value(choice, 'inertia', [1.0_wp])
    if (kind /= 'drive' .and. kind /= 'body') call read_ends(source, path, bodies, choice)
    choices = [choices, choice]
  end subroutine add_part

  !> The values of a part; its positions are angles, and it turns, or not.
  subroutine read_values(source, bodies, is_angle, turning, choice)
    type(case_source_t), intent(inout) :: source
    type(bodies_t), intent(in) :: bodies
    logical, intent(in) :: is_angle, turning
    type(law_choice_t), intent(inout) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: path
    integer :: i
    logical :: from_record
    path = path_of(choice)
    if (part_kind(choice%name) == 'body') call check_mass(source, path)
    from_record = .false.
    if (choice%name == 'drive:force' .or. choice%name == 'drive:motion') call read_record(source, path, choice, from_record)
    rows = parameters_of(choice%family, choice%name)
    do i = 1, size(rows)
      if (is_hidden(rows(i)) .or. (from_record .and. .not. is_of_position(rows(i)))) cycle
      call take_row(source, path, rows(i), merge(is_angle, turning, is_of_position(rows(i))), choice%parameters(i)%values)
    end do
    if (choice%name == 'friction:coulomb_load') then
      call read_own_law(source, choice)
      if (value_of(choice, 'static_coefficient') < 0) call set_value(choice, 'static_coefficient', &
                                                                      [value_of(choice, 'kinetic_coefficient')])
    else if (part_law(choice%name) == own_law .or. choice%name == 'drive:base' .or. &
             (choice%name == 'drive:motion' .and. find(source, path//'.position') > 0)) then
      call read_own_law(source, choice)
    else if (part_kind(choice%name) == 'friction' .and. any(rows%name == 'static_force')) then
      ! Break-away friction that is not given equals sliding friction.
      if (value_of(choice, 'static_force') < 0) call set_value(choice, 'static_force', [value_of(choice, 'force')])
    end if
    if (choice%name == 'contact:massless') call set_flexibility(source, path, bodies, choice)
  end subroutine read_values

  !> A body has a mass, or an inertia if it turns.
  subroutine check_mass(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    logical :: found(2)
    found = [find(source, path//'.mass') > 0, find(source, path//'.inertia') > 0]
    if (all(found)) call report(source, path//'.inertia', 'found beside a mass, allowed one of them')
    if (.not. any(found)) call report(source, path//'.mass', 'missing, allowed a mass, or an inertia of a body that turns', &
                                      missing=.true.)
  end subroutine check_mass

  !> A joint takes the difference of two angles, or of two positions.
  subroutine refuse_unlike(source, choices, joint)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: joint
    integer, allocatable :: points(:)
    integer :: ends(2), i
    points = pack([(i, i=1, size(choices))], index(choices%name, 'body:') == 1 .or. index(choices%name, 'point:') == 1)
    ends = nint([value_of(choices(joint), 'first_end'), value_of(choices(joint), 'second_end')])
    if (any(ends < 1) .or. any(ends > size(points))) return
    associate (first => choices(points(ends(1))), second => choices(points(ends(2))))
      if (any(index([first%name, second%name], 'body:') /= 1)) return
      if (turns(first) .neqv. turns(second)) call report(source, path_of(choices(joint))//'.between', 'found a body with an '// &
        'inertia and one with a mass, allowed two of a kind: an expression between each and the ground can have lever arms')
    end associate
  end subroutine refuse_unlike

  !> A matrix as the last block on the diagonal of another.
  pure subroutine append_block(matrix, block)
    real(wp), allocatable, intent(inout) :: matrix(:, :)
    real(wp), intent(in) :: block(:, :)
    real(wp), allocatable :: larger(:, :)
    integer :: n
    n = size(matrix, 1)
    allocate (larger(n + size(block, 1), n + size(block, 1)), source=0.0_wp)
    larger(:n, :n) = matrix
    larger(n + 1:, n + 1:) = block
    call move_alloc(larger, matrix)
  end subroutine append_block

  !> A massless contact without a stiffness has that of the modes which the structures at its ends leave out.
  subroutine set_flexibility(source, path, bodies, choice)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bodies_t), intent(in) :: bodies
    type(law_choice_t), intent(inout) :: choice
    real(wp) :: flexibility
    integer :: ends(2)
    if (value_of(choice, 'stiffness') > 0 .or. has_problems(source)) return
    ends = nint([value_of(choice, 'first_end'), value_of(choice, 'second_end')])
    flexibility = 0
    if (ends(1) > 0) flexibility = flexibility + bodies%left_out(ends(1), ends(1))
    if (ends(2) > 0) flexibility = flexibility + bodies%left_out(ends(2), ends(2))
    if (all(ends > 0)) flexibility = flexibility - 2*bodies%left_out(ends(1), ends(2))
    if (flexibility > 0) then
      call set_value(choice, 'stiffness', [1/flexibility])
    else
      call report(source, path//'.stiffness', 'missing, allowed more than 0 N/m, or between points of a structure of which '// &
                  'structure.NAME.modes leaves modes out: their flexibility is the contact''s')
    end if
  end subroutine set_flexibility

  !> The watched body starts at the values of [start].
  subroutine refuse_start(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    character(len=2), parameter :: keys(2) = ['x0', 'v0']
    integer :: i
    do i = 1, size(keys)
      call know(source, path//'.'//keys(i))
      if (find(source, path//'.'//keys(i)) > 0) call report(source, path//'.'//keys(i), 'found for the watched body, allowed '// &
        'as start.'//keys(i)//', or with another body in watch.body')
    end do
  end subroutine refuse_start

  !> Laws of a table of parts, for messages.
  pure function laws_of(kind) result(names)
    character(len=*), intent(in) :: kind
    character(len=:), allocatable :: names
    integer :: i
    names = ''
    do i = 1, size(laws)
      if (laws(i)%family /= part_family) cycle
      if (part_kind(laws(i)%name) /= kind) cycle
      if (len(names) > 0) names = names//', '
      names = names//part_law(laws(i)%name)
    end do
  end function laws_of

  !> body = "NAME" of a drive.
  subroutine read_body(source, path, bodies, choice)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bodies_t), intent(in) :: bodies
    type(law_choice_t), intent(inout) :: choice
    character(len=:), allocatable :: name
    integer :: problems
    name = ''
    problems = size(source%problems)
    call take_text(source, path//'.body', name, required=.true.)
    if (size(source%problems) > problems) return
    call set_value(choice, 'body', [real(number_of(source, path//'.body', name, .false., bodies), wp)])
  end subroutine read_body

  !> between = ["A", "B"], or ["A"] for the ground and A.
  subroutine read_ends(source, path, bodies, choice)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(bodies_t), intent(in) :: bodies
    type(law_choice_t), intent(inout) :: choice
    character(len=:), allocatable :: key, element
    integer :: at, i, count_ends, ends(2)
    key = path//'.between'
    call know(source, key)
    at = find(source, key)
    if (at == 0) then
      call report(source, key, 'missing, allowed one or two of '//join(bodies%names, ', ')//', ground')
      return
    end if
    count_ends = 0
    if (source%entries(at)%entry%kind == toml_array) count_ends = int(source%entries(at)%entry%integer)
    if (count_ends < 1 .or. count_ends > 2) then
      call report(source, key, 'found '//description(source%entries(at)%entry)//', allowed a list of one or two bodies')
      call know_all_below(source, key)
      return
    end if
    ends = 0
    do i = 1, count_ends
      element = key//'['//to_text(i)//']'
      call know(source, element)
      at = find(source, element)
      if (source%entries(at)%entry%kind /= toml_string) then
        call report(source, element, 'found '//description(source%entries(at)%entry)//', allowed the name of a body')
        return
      end if
      ends(i + 2 - count_ends) = number_of(source, element, source%entries(at)%entry%string, .true., bodies)
      if (ends(i + 2 - count_ends) < 0) return
    end do
    if (ends(1) == ends(2)) then
      call report(source, key, 'found the same end twice, allowed two bodies, or one for it and the ground')
      return
    end if
    call set_value(choice, 'first_end', [real(ends(1), wp)])
    call set_value(choice, 'second_end', [real(ends(2), wp)])
  end subroutine read_ends

  !> Number of a body, 0 the ground, -1 if there is none of that name.
  integer function number_of(source, key, name, or_ground, bodies) result(number)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: key, name
    logical, intent(in) :: or_ground
    type(bodies_t), intent(in) :: bodies
    number = number_in(bodies%names, name)
    if (number > 0 .or. (or_ground .and. name == ground)) return
    number = -1
    ! Of a structure that could not be read nobody knows the points.
    if (index(name, '.') > 1) then
      if (has_problems(source, 'structure.'//name(:index(name, '.') - 1))) return
    end if
    call report(source, key, 'found "'//name//'"'//hint(name, bodies%names)//', allowed '//join(bodies%names, ', ')// &
                trim(merge(', ground', '        ', or_ground)))
  end function number_of

end module part_reader
