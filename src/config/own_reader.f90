! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Tables of laws by expressions: their texts, and the parameters that these name, with units of their own.
module own_reader
  use case_source, only: case_source_t, description, find, know, report
  use case_values, only: take_text
  use composed_units, only: composed_unit_t, known_units, read_unit
  use expression_names, only: has_name
  use kinds, only: wp
  use law_row, only: any_value, unit_length
  use law_table, only: force_family, label_length, law_choice, law_choice_t, law_text_t, own_law, parameter_row_t, &
    parameter_value_t, parameters_of, part_family, path_of, state_family, text_of
  use memory_reader, only: write_out_memory
  use part_names, only: names_of
  use text, only: number_length, read_number, starts_with, to_text
  use toml_bindings, only: toml_float, toml_integer, toml_string
  use units, only: read_quantity
  implicit none
  private

  public :: read_own_law, read_own_tables

  integer, parameter :: longest_name = 20
  character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ', &
    name_letters = letters//'0123456789_'
  !> Names that mean something else in an expression.
  character(len=*), parameter :: taken(6) = [character(len=5) :: 'x', 'v', 't', 'phase', 'speed', 'pi']

contains

  !> The tables [force.NAME] and [state.NAME].
  subroutine read_own_tables(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    character(len=*), parameter :: kinds(2) = [character(len=5) :: force_family, state_family]
    character(len=label_length), allocatable :: names(:)
    character(len=:), allocatable :: law
    type(law_choice_t) :: choice
    integer :: k, i
    call write_out_memory(source, choices)
    do k = 1, 2
      call know(source, trim(kinds(k))//'.')
      names = names_of(source, trim(kinds(k)))
      do i = 1, size(names)
        choice = law_choice(trim(kinds(k)), own_law)
        choice%label = names(i)
        law = own_law
        call take_text(source, path_of(choice)//'.law', law)
        if (law /= own_law) call report(source, path_of(choice)//'.law', 'found "'//law//'", allowed expression')
        call check_name(source, path_of(choice), trim(names(i)), '')
        call read_own_law(source, choice)
        choices = [choices, choice]
      end do
    end do
    call refuse_shadows(source, choices)
  end subroutine read_own_tables

  !> Texts and parameters of a law by expressions, after the parameters of its rows.
  subroutine read_own_law(source, choice)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(inout) :: choice
    allocate (choice%texts(0), choice%own(0))
    select case (choice%family)
    case ('contact')
      call read_text(source, 'restitution', .true., choice)
    case (state_family)
      call read_text(source, 'rate', .true., choice)
    case ('drive')
      call read_text(source, 'position', .false., choice)
      call read_period(source, choice)
    case default
      call read_text(source, trim(force_key(choice)), .true., choice)
    end select
    call read_parameters(source, choice)
    if (has_load(choice) .or. choice%family == part_family) call refuse_unnamed(source, choice)
    if (choice%name == 'drive:motion') call refuse_series(source, choice)
    if (choice%family == state_family .and. all(choice%own%name /= 'start')) call add_own(choice, 'start', '1', 0.0_wp)
  end subroutine read_own_law

  !> Whether a law is friction of the catalogue, whose normal force is an expression.
  pure logical function has_load(choice)
    type(law_choice_t), intent(in) :: choice
    has_load = (choice%family == 'friction' .and. choice%name /= own_law) .or. choice%name == 'friction:coulomb_load'
  end function has_load

  !> The key of the expression that a law must have.
  pure function text_key(choice) result(key)
    type(law_choice_t), intent(in) :: choice
    character(len=:), allocatable :: key
    key = force_key(choice)
    if (choice%family == 'contact') key = 'restitution'
    if (choice%family == state_family) key = 'rate'
  end function text_key

  !> The key of the expression of a force.
  pure function force_key(choice) result(key)
    type(law_choice_t), intent(in) :: choice
    character(len=:), allocatable :: key
    key = 'force'
    if (has_load(choice)) key = 'load'
    if (choice%name == 'drive:base' .or. choice%name == 'drive:motion') key = 'position'
  end function force_key

  !> A motion is an expression or a series.
  subroutine refuse_series(source, choice)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: choice
    character(len=*), parameter :: keys(6) = [character(len=9) :: 'mean', 'amplitude', 'angle', 'cosine', 'sine', 'record']
    character(len=:), allocatable :: path
    integer :: i
    do i = 1, size(keys)
      path = path_of(choice)//'.'//trim(keys(i))
      if (find(source, path) > 0) call report(source, path, 'found beside a position, allowed one or the other')
    end do
  end subroutine refuse_series

  !> Beside keys of the catalogue a parameter that no expression names is a misspelt key.
  subroutine refuse_unnamed(source, choice)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: choice
    character(len=:), allocatable :: name, path
    integer :: i
    do i = 1, size(choice%own)
      name = trim(choice%own(i)%name)
      path = path_of(choice)//'.'//name
      if (has_name(text_of(choice, force_key(choice)), name) .or. has_name(text_of(choice, force_key(choice)), path)) cycle
      call report(source, path, 'unknown; allowed keys of the law, and parameters that '//trim(force_key(choice))//' contains')
    end do
  end subroutine refuse_unnamed

  !> An expression; a number is one, too.
  subroutine read_text(source, key, required, choice)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: key
    logical, intent(in) :: required
    type(law_choice_t), intent(inout) :: choice
    type(law_text_t) :: new
    character(len=:), allocatable :: path, text
    integer :: at
    path = path_of(choice)//'.'//trim(key)
    at = find(source, path)
    if (at > 0) then
      if (any(source%entries(at)%entry%kind == [toml_integer, toml_float])) then
        call know(source, path)
        choice%texts = [choice%texts, law_text_t(key, to_text(source%entries(at)%entry%real))]
        return
      end if
    end if
    text = ''
    call take_text(source, path, text, required=required)
    new = law_text_t(trim(key), text)
    if (len(text) > 0) choice%texts = [choice%texts, new]
  end subroutine read_text

  !> The period of a drive: a time, or an expression of parameters.
  subroutine read_period(source, choice)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(inout) :: choice
    character(len=:), allocatable :: problem
    real(wp) :: value
    integer :: at
    at = find(source, 'drive.period')
    call know(source, 'drive.period')
    if (at == 0) return
    associate (entry => source%entries(at)%entry)
      if (entry%kind == toml_integer .or. entry%kind == toml_float) then
        call add_own(choice, 'period', 's', entry%real)
      else if (entry%kind == toml_string) then
        call read_quantity(entry%string, 's', value, problem)
        if (allocated(problem)) then
          call read_text(source, 'period', .true., choice)
        else
          call add_own(choice, 'period', 's', value)
        end if
      else
        call report(source, 'drive.period', 'found '//description(entry)//', allowed a time or an expression')
      end if
    end associate
  end subroutine read_period

  !> Every other key of the table.
  subroutine read_parameters(source, choice)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(inout) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: table, name
    integer :: i
    table = path_of(choice)//'.'
    rows = parameters_of(choice%family, choice%name)
    do i = 1, size(source%entries)
      if (.not. starts_with(source%entries(i)%entry%path, table)) cycle
      name = source%entries(i)%entry%path(len(table) + 1:)
      if (name == 'law' .or. any(choice%texts%key == name) .or. any(rows%name == name)) cycle
      if (any(choice%own%name == name) .or. (choice%family == 'drive' .and. (name == 'period' .or. name == 'position'))) cycle
      ! A text that should be there and is not one has been reported.
      if (name == text_key(choice) .and. choice%family /= 'drive') cycle
      if (scan(name, '.["') > 0 .or. name == 'between') cycle
      call read_parameter(source, i, name, choice)
    end do
  end subroutine read_parameters

  !> A number, or a text with one and a unit.
  subroutine read_parameter(source, i, name, choice)
    type(case_source_t), intent(inout) :: source
    integer, intent(in) :: i
    character(len=*), intent(in) :: name
    type(law_choice_t), intent(inout) :: choice
    character(len=:), allocatable :: path, problem
    type(composed_unit_t) :: unit
    real(wp) :: value
    path = source%entries(i)%entry%path
    call know(source, path)
    if (.not. (name == 'start' .and. choice%family == state_family)) call check_name(source, path, name, path_of(choice))
    value = 0
    unit%si = '1'
    associate (entry => source%entries(i)%entry)
      select case (entry%kind)
      case (toml_integer, toml_float)
        value = entry%real
        if (.not. abs(value) <= huge(value)) problem = 'allowed a finite number'
      case (toml_string)
        call read_with_unit(entry%string, value, unit, problem)
      case default
        problem = 'allowed a number, or a text with a number and its unit'
      end select
      if (allocated(problem)) call report(source, path, 'found '//description(entry)//', '//problem)
    end associate
    call add_own(choice, name, unit%si, value)
  end subroutine read_parameter

  !> A number with a unit that may be composed.
  pure subroutine read_with_unit(string, value, unit, problem)
    character(len=*), intent(in) :: string
    real(wp), intent(out) :: value
    type(composed_unit_t), intent(inout) :: unit
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: spelling
    integer :: length, column, status, first
    value = 0
    first = verify(string//'.', ' ')
    length = number_length(string(first:))
    status = 1
    if (length > 0) call read_number(string(first:first + length - 1), value, status)
    if (status /= 0) then
      problem = 'allowed a number, or a text with a number and its unit, as in "20 N/m^3"'
      return
    end if
    spelling = string(first + length:)
    call read_unit(spelling, unit, column)
    if (column > 0) then
      problem = 'column '//to_text(first + length - 1 + column)//': allowed '//known_units()// &
        '; a number alone stands without quotes'
    else if (len(unit%si) > unit_length) then
      problem = 'allowed a unit of at most '//to_text(unit_length)//' characters'
    else
      value = value*unit%multiplier/unit%divisor
      if (.not. abs(value) <= huge(value)) problem = 'allowed a finite number'
    end if
  end subroutine read_with_unit

  subroutine add_own(choice, name, unit, value)
    type(law_choice_t), intent(inout) :: choice
    character(len=*), intent(in) :: name, unit
    real(wp), intent(in) :: value
    type(parameter_row_t) :: row
    type(parameter_value_t) :: new
    row = parameter_row_t(choice%family, choice%name, name, unit, any_value, 'of an expression')
    choice%own = [choice%own, row]
    new%values = [value + 0.0_wp]
    choice%parameters = [choice%parameters, new]
  end subroutine add_own

  !> A name of a parameter in `table`, or without one of a force or state.
  subroutine check_name(source, path, name, table)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, name, table
    if (verify(name, name_letters) > 0 .or. scan(name(:min(1, len(name))), letters) == 0 .or. len(name) > longest_name) then
      call report(source, path, 'found the name "'//name//'", allowed at most '//to_text(longest_name)// &
                  ' letters, digits and _, a letter first')
    else if (any(taken == name) .and. .not. (len(table) == 0 .and. starts_with(path, force_family))) then
      call report(source, path, 'found the name "'//name//'", which is reserved in expressions; allowed any other')
    end if
  end subroutine check_name

  !> No parameter has the name of a state.
  subroutine refuse_shadows(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), intent(in) :: choices(:)
    integer :: i, k
    do i = 1, size(choices)
      if (.not. allocated(choices(i)%own)) cycle
      do k = 1, size(choices)
        if (choices(k)%family /= state_family) cycle
        if (any(choices(i)%own%name == choices(k)%label)) call report(source, path_of(choices(i))//'.'// &
          trim(choices(k)%label), 'found a parameter with the name of a state, allowed any other')
      end do
    end do
  end subroutine refuse_shadows

end module own_reader
