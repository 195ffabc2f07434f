! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The names that expressions of a case may use, and their nodes: x, v, t, phase, speed; states and their rates; parameters of the
!> same table by their name, and of every table by 'table.name'.
module own_names
  use equation_sheet, only: sheet_t
  use errors, only: error_t, fail
  use expression_text, only: read_expression
  use kinds, only: wp
  use law_row, only: none_above
  use law_table, only: law_choice_t, parameter_row_t, part_family, path_of, rows_of, text_of
  use law_texts, only: is_own
  use operations, only: op_select, op_variable, operation_table
  use own_units, only: parameter_unit, quantities_of, quantity_t, unit_problem
  use status, only: exit_bad_case
  use tape, only: parameter_node, tape_t
  implicit none
  private

  public :: has_own, new_names, add_known, add_parameters, set_unit, read_own, depends_on

  integer, parameter, public :: known_length = 64

  type, public :: names_t
    character(len=known_length), allocatable :: names(:)
    integer, allocatable :: nodes(:)
    !> The choice whose table a parameter stands in, 0 for other names.
    integer, allocatable :: tables(:)
    !> Units of the variables and parameters of the tape, by their numbers, as far as they are known.
    type(quantity_t), allocatable :: of_variables(:), of_parameters(:)
    !> The position is an angle: forces are moments.
    logical :: is_angle = .false.
  end type names_t

contains

  !> Whether any law of one body has expressions.
  pure logical function has_own(choices)
    type(law_choice_t), intent(in) :: choices(:)
    has_own = any(is_own(choices) .and. choices%family /= part_family)
    ! The same equations: a force that is not on the foot of a spring has no closed form in the flights of one body.
    if (.not. has_own) has_own = any(choices%family == 'drive' .and. choices%name == 'force') .and. &
      any(choices%family == 'body' .and. choices%name == 'point_mass')
  end function has_own

  !> No names.
  pure subroutine new_names(names)
    type(names_t), intent(out) :: names
    allocate (names%names(0), names%nodes(0), names%tables(0), names%of_variables(0), names%of_parameters(0))
  end subroutine new_names

  !> Makes a name known.
  pure subroutine add_known(names, name, node, table)
    type(names_t), intent(inout) :: names
    character(len=*), intent(in) :: name
    integer, intent(in) :: node
    integer, intent(in), optional :: table
    character(len=known_length) :: padded
    padded = name
    names%names = [names%names, padded]
    names%nodes = [names%nodes, node]
    names%tables = [names%tables, 0]
    if (present(table)) names%tables(size(names%tables)) = table
  end subroutine add_known

  !> Makes the numbers of all choices known.
  pure subroutine add_parameters(names, choices, sheet)
    type(names_t), intent(inout) :: names
    type(law_choice_t), intent(in) :: choices(:)
    type(sheet_t), intent(inout) :: sheet
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, k, node
    do i = 1, size(choices)
      rows = rows_of(choices(i))
      do k = 1, size(rows)
        if (rows(k)%list) cycle
        if (abs(choices(i)%parameters(k)%values(1)) >= none_above) cycle
        sheet%parameters = [sheet%parameters, choices(i)%parameters(k)%values(1)]
        call parameter_node(sheet%tape, size(sheet%parameters), node)
        call add_known(names, path_of(choices(i))//'.'//trim(rows(k)%name), node)
        if (is_own(choices(i))) call add_known(names, trim(rows(k)%name), node, i)
        call set_unit(names, size(sheet%parameters), parameter_unit(trim(rows(k)%unit)))
      end do
    end do
  end subroutine add_parameters

  !> Sets the unit of a parameter of the tape.
  pure subroutine set_unit(names, number, unit)
    type(names_t), intent(inout) :: names
    integer, intent(in) :: number
    type(quantity_t), intent(in) :: unit
    type(quantity_t) :: unknown
    do while (size(names%of_parameters) < number)
      names%of_parameters = [names%of_parameters, unknown]
    end do
    names%of_parameters(number) = unit
  end subroutine set_unit

  !> Node of the expression `key` of choice number `i`; an error begins with the key in the case.
  pure subroutine read_own(names, choices, i, key, sheet, node, error)
    type(names_t), intent(in) :: names
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    character(len=*), intent(in) :: key
    type(sheet_t), intent(inout) :: sheet
    integer, intent(out) :: node
    type(error_t), allocatable, intent(out) :: error
    logical :: seen(size(names%names))
    seen = names%tables == 0 .or. names%tables == i
    call read_expression(text_of(choices(i), key), pack(names%names, seen), pack(names%nodes, seen), sheet%tape, node, error)
    if (.not. allocated(error)) call check_units(names, sheet, node, unit_of_key(names, choices(i), key), error)
    if (allocated(error)) error%message = path_of(choices(i))//'.'//key//': '//error%message
  end subroutine read_own

  !> What the units of parameters make of an expression fits together, and is in `wanted`.
  pure subroutine check_units(names, sheet, node, wanted, error)
    type(names_t), intent(in) :: names
    type(sheet_t), intent(in) :: sheet
    integer, intent(in) :: node
    character(len=*), intent(in) :: wanted
    type(error_t), allocatable, intent(inout) :: error
    type(quantity_t) :: quantity(sheet%tape%count), of_parameters(size(sheet%parameters))
    integer :: fault(sheet%tape%count)
    character(len=:), allocatable :: problem
    of_parameters(:size(names%of_parameters)) = names%of_parameters
    call quantities_of(sheet%tape, names%of_variables, of_parameters, quantity, fault)
    problem = unit_problem(sheet%tape, node, quantity, fault, wanted)
    if (len(problem) > 0) call fail(error, exit_bad_case, problem)
  end subroutine check_units

  !> The unit of the expression of a key; '' if it may have any.
  pure function unit_of_key(names, choice, key) result(unit)
    type(names_t), intent(in) :: names
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: key
    character(len=:), allocatable :: unit
    integer :: i
    unit = ''
    select case (key)
    case ('restitution')
      unit = '1'
    case ('period')
      unit = 's'
    case ('force', 'load')
      if (.not. names%is_angle) unit = 'N'
    case ('position')
      if (.not. names%is_angle) unit = 'm'
    case ('rate')
      i = findloc(choice%own%name == 'start', .true., dim=1)
      if (choice%own(i)%unit /= '1') unit = trim(choice%own(i)%unit)//'/s'
    end select
  end function unit_of_key

  !> Whether nodes depend on a variable, in any branch.
  pure function depends_on(tape, number) result(depends)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: number
    logical :: depends(tape%count)
    integer :: i
    do i = 1, tape%count
      associate (node => tape%nodes(i))
        depends(i) = .false.
        if (node%operation == op_variable) then
          depends(i) = node%first == number
        else if (node%operation == op_select) then
          depends(i) = depends(node%second) .or. depends(node%third) .or. depends(tape%switches(node%first)%argument)
        else if (operation_table(node%operation)%arguments > 0) then
          depends(i) = depends(node%first)
          if (operation_table(node%operation)%arguments > 1) depends(i) = depends(i) .or. depends(node%second)
        end if
      end associate
    end do
  end function depends_on

end module own_names
