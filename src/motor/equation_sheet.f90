! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Equations by name: variables, parameters, and expressions of both, on one tape.
module equation_sheet
  use errors, only: error_t, fail
  use expression_text, only: read_expression
  use kinds, only: wp
  use status, only: exit_internal
  use tape, only: new_tape, parameter_node, tape_t, variable
  use tape_derivative, only: differentiate
  use text, only: number_in
  implicit none
  private

  public :: new_sheet, add_variable, add_parameter, add_optional, add_node, read_node, define, define_slope, node_of, &
    parameter_number

  integer, parameter, public :: name_length = 24

  type, public :: sheet_t
    type(tape_t) :: tape
    character(len=name_length), allocatable :: names(:)
    !> Node of each name; number of the parameter of that name, 0 if it is none.
    integer, allocatable :: nodes(:), numbers(:)
    real(wp), allocatable :: parameters(:)
    integer :: variables = 0
    !> The first expression that could not be read, or name that was there.
    type(error_t), allocatable :: error
  end type sheet_t

contains

  !> A sheet without names.
  pure subroutine new_sheet(sheet)
    type(sheet_t), intent(out) :: sheet
    call new_tape(sheet%tape)
    allocate (sheet%names(0), sheet%nodes(0), sheet%numbers(0), sheet%parameters(0))
  end subroutine new_sheet

  !> The next variable.
  pure subroutine add_variable(sheet, name)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name
    integer :: node
    sheet%variables = sheet%variables + 1
    call variable(sheet%tape, sheet%variables, node)
    call add_name(sheet, name, node, 0)
  end subroutine add_variable

  !> A parameter: its value may change later, the tape does not.
  pure subroutine add_parameter(sheet, name, value)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value
    integer :: node
    sheet%parameters = [sheet%parameters, value]
    call parameter_node(sheet%tape, size(sheet%parameters), node)
    call add_name(sheet, name, node, size(sheet%parameters))
  end subroutine add_parameter

  !> A parameter that is often zero: the terms that it makes zero are then left out of the tape.
  pure subroutine add_optional(sheet, name, value)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: value
    if (abs(value) > 0) then
      call add_parameter(sheet, name, value)
    else
      call define(sheet, name, '0')
    end if
  end subroutine add_optional

  !> Gives the expression `text` a name.
  pure subroutine define(sheet, name, text)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name, text
    integer :: node
    call read_node(sheet, name, text, node)
    call add_name(sheet, name, node, 0)
  end subroutine define

  !> Node of the expression `text`, which has a name in errors alone.
  pure subroutine read_node(sheet, name, text, node)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name, text
    integer, intent(out) :: node
    type(error_t), allocatable :: error
    call read_expression(text, sheet%names, sheet%nodes, sheet%tape, node, error)
    if (.not. allocated(error)) return
    node = 1
    if (allocated(sheet%error)) return
    error%message = trim(name)//' = '//text//': '//error%message
    call move_alloc(error, sheet%error)
  end subroutine read_node

  !> Gives the derivative of `of` by the variable `by` a name.
  pure subroutine define_slope(sheet, name, of, by)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name, of, by
    integer :: slope(1)
    call differentiate(sheet%tape, [node_of(sheet, of)], node_of(sheet, by), slope)
    call add_name(sheet, name, slope(1), 0)
  end subroutine define_slope

  !> Gives a node of the tape a name.
  pure subroutine add_node(sheet, name, node)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name
    integer, intent(in) :: node
    call add_name(sheet, name, node, 0)
  end subroutine add_node

  !> Node of a name; 0 if there is none.
  pure elemental integer function node_of(sheet, name) result(node)
    type(sheet_t), intent(in) :: sheet
    character(len=*), intent(in) :: name
    node = number_in(sheet%names, name)
    if (node > 0) node = sheet%nodes(node)
  end function node_of

  !> Number of the parameter of a name; 0 if there is none.
  pure integer function parameter_number(sheet, name) result(number)
    type(sheet_t), intent(in) :: sheet
    character(len=*), intent(in) :: name
    number = number_in(sheet%names, name)
    if (number > 0) number = sheet%numbers(number)
  end function parameter_number

  pure subroutine add_name(sheet, name, node, number)
    type(sheet_t), intent(inout) :: sheet
    character(len=*), intent(in) :: name
    integer, intent(in) :: node, number
    character(len=name_length) :: padded
    padded = name
    if (number_in(sheet%names, padded) > 0 .and. .not. allocated(sheet%error)) then
      call fail(sheet%error, exit_internal, trim(name)//': defined twice')
    end if
    sheet%names = [sheet%names, padded]
    sheet%nodes = [sheet%nodes, node]
    sheet%numbers = [sheet%numbers, number]
  end subroutine add_name

end module equation_sheet
