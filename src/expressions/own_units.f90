! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Units of expressions: sums of unlike quantities, functions of quantities with a unit, and forces that are not in N.
!>
!> A number without a unit fits everywhere, and so does what it multiplies: equations may be dimensionless. Only what parameters
!> with units make of known quantities is compared.
module own_units
  use composed_units, only: base_count, composed_unit_t, read_unit
  use operations, only: op_add, op_arc_tangent, op_constant, op_divide, op_multiply, op_negative, op_parameter, &
    op_power, op_select, op_sqrt, op_square, op_subtract, op_variable, operation_table
  use tape, only: node_t, tape_t
  use text, only: to_text
  implicit none
  private

  public :: quantities_of, unit_problem, parameter_unit

  !> Exponents of the base units, times 2 so that roots are whole.
  type, public :: quantity_t
    integer :: exponents(base_count) = 0
    !> The unit is known; a parameter with a unit is part of it.
    logical :: is_known = .false., is_stated = .false.
  end type quantity_t

  character(len=*), parameter :: bases(base_count) = ['m ', 'kg', 's ', 'A ', 'K ']
  integer, parameter :: longest_exponent = 1000

contains

  !> Quantity of a parameter with a unit; that of a number or an angle is not known.
  pure type(quantity_t) function parameter_unit(text) result(quantity)
    character(len=*), intent(in) :: text
    type(composed_unit_t) :: unit
    integer :: column
    call read_unit(text, unit, column)
    if (column > 0) return
    quantity%exponents = unit%exponents
    quantity%is_known = any(unit%exponents /= 0)
    quantity%is_stated = quantity%is_known
  end function parameter_unit

  !> Quantities of all nodes from those of variables and parameters. `fault(i)`: the node, on which node i depends, whose arguments
  !> do not fit each other, or 0.
  pure subroutine quantities_of(tape, variables, parameters, quantity, fault)
    type(tape_t), intent(in) :: tape
    type(quantity_t), intent(in) :: variables(:), parameters(:)
    type(quantity_t), intent(out) :: quantity(tape%count)
    integer, intent(out) :: fault(tape%count)
    integer :: i, a, b
    logical :: fits
    do i = 1, tape%count
      fault(i) = 0
      associate (node => tape%nodes(i))
        select case (node%operation)
        case (op_constant)
          cycle
        case (op_variable)
          quantity(i) = variables(node%first)
        case (op_parameter)
          quantity(i) = parameters(node%first)
        case default
          a = node%first
          if (node%operation == op_select) a = node%third
          b = a
          if (operation_table(node%operation)%arguments > 1) b = node%second
          fault(i) = max(fault(a), fault(b))
          call combine(node, quantity(a), quantity(b), quantity(i), fits)
          if (.not. fits .and. fault(i) == 0) fault(i) = i
        end select
      end associate
    end do
  end subroutine quantities_of

  !> Quantity that an operation makes of two.
  pure subroutine combine(node, a, b, result, fits)
    type(node_t), intent(in) :: node
    type(quantity_t), intent(in) :: a, b
    type(quantity_t), intent(out) :: result
    logical, intent(out) :: fits
    fits = .true.
    select case (node%operation)
    case (op_add, op_subtract, op_select, op_arc_tangent)
      fits = .not. (a%is_stated .and. b%is_stated) .or. all(a%exponents == b%exponents)
      if (node%operation == op_arc_tangent .or. .not. (a%is_known .and. b%is_known)) return
      if (all(a%exponents == b%exponents)) result = quantity_t(a%exponents, .true., a%is_stated .or. b%is_stated)
    case (op_multiply)
      result = quantity_t(a%exponents + b%exponents, a%is_known .and. b%is_known, a%is_stated .or. b%is_stated)
    case (op_divide)
      result = quantity_t(a%exponents - b%exponents, a%is_known .and. b%is_known, a%is_stated .or. b%is_stated)
    case (op_negative)
      result = a
    case (op_square)
      result = quantity_t(2*a%exponents, a%is_known, a%is_stated)
    case (op_sqrt)
      result = quantity_t(a%exponents/2, a%is_known .and. all(modulo(a%exponents, 2) == 0), a%is_stated)
    case (op_power)
      result = quantity_t()
    case default
      fits = .not. a%is_stated .or. all(a%exponents == 0)
    end select
    if (maxval(abs(result%exponents)) > longest_exponent) result%is_known = .false.
    if (.not. result%is_known) result = quantity_t()
  end subroutine combine

  !> What is wrong with a node that should have the unit `wanted`, if anything; '' for any unit.
  pure function unit_problem(tape, node, quantity, fault, wanted) result(problem)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: node, fault(:)
    type(quantity_t), intent(in) :: quantity(:)
    character(len=*), intent(in) :: wanted
    character(len=:), allocatable :: problem
    type(quantity_t) :: expected
    integer :: a, b
    problem = ''
    if (fault(node) > 0) then
      associate (it => tape%nodes(fault(node)))
        a = it%first
        if (it%operation == op_select) a = it%third
        b = a
        if (operation_table(it%operation)%arguments > 1) b = it%second
        if (a == b) then
          problem = 'found '//trim(operation_table(it%operation)%name)//' of a quantity in '//spelled(quantity(a))// &
            ', allowed of a dimensionless number'
        else
          problem = 'found '//trim(operation_table(it%operation)%name)//' between '//spelled(quantity(a))//' and '// &
            spelled(quantity(b))//', allowed between equal units'
        end if
      end associate
    else if (len(wanted) > 0 .and. quantity(node)%is_stated) then
      expected = parameter_unit(wanted)
      if (any(expected%exponents /= quantity(node)%exponents)) problem = 'found a quantity in '//spelled(quantity(node))// &
        ', allowed in '//wanted
    end if
  end function unit_problem

  !> A unit in base units.
  pure function spelled(quantity) result(text)
    type(quantity_t), intent(in) :: quantity
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, base_count
      if (quantity%exponents(i) == 0) cycle
      if (len(text) > 0) text = text//' '
      text = text//trim(bases(i))
      if (quantity%exponents(i) == 2) cycle
      if (modulo(quantity%exponents(i), 2) == 0) then
        text = text//'^'//to_text(quantity%exponents(i)/2)
      else
        text = text//'^'//to_text(real(quantity%exponents(i), kind(1.0d0))/2)
      end if
    end do
    if (len(text) == 0) text = '1'
  end function spelled

end module own_units
