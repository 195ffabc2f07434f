! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Quantities that a case derives from a motion: mean, rms and drift of expressions, mean powers. An expression may name the columns
!> of a trajectory, t, and parameters of the machine by their keys.
module derived_quantities
  use errors, only: error_t
  use expression_names, only: has_name
  use expression_text, only: read_expression
  use kinds, only: wp
  use law_table, only: is_hidden, law_choice_t, parameter_row_t, path_of, rows_of
  use machine_columns, only: machine_column_t
  use machine_type, only: machine_t
  use motion_state, only: log_t, open_log
  use tape, only: constant, new_tape, tape_t, variable
  use tape_value, only: evaluate
  implicit none
  private

  public :: compile, values_at_samples, is_power, depends_on_position, is_fixed

  integer, parameter, public :: longest_derived = 20
  character(len=*), parameter, public :: derived_kinds(4) = [character(len=5) :: 'mean', 'rms', 'drift', 'power']
  !> Whose mean power: the order of the energy balance of a log.
  character(len=*), parameter, public :: power_names(4) = [character(len=8) :: 'friction', 'damping', 'contacts', 'drive']
  integer, parameter :: longest_path = 96
  !> Columns that every trajectory has, and t for the first.
  character(len=*), parameter :: own_columns(4) = [character(len=4) :: 't', 'time', 'x', 'v']

  type, public :: derived_t
    character(len=longest_derived) :: name = ''
    !> One of `derived_kinds`; of a power one of `power_names`, else an expression.
    character(len=5) :: quantity = 'mean'
    character(len=:), allocatable :: expression, unit
  end type derived_t

  !> Expressions on a tape, whose variables are the columns of a trajectory in order.
  type, public :: compiled_t
    type(tape_t) :: tape
    !> Node of each quantity; 0 of a power.
    integer, allocatable :: nodes(:)
  end type compiled_t

contains

  pure elemental logical function is_power(one)
    type(derived_t), intent(in) :: one
    is_power = one%quantity == 'power'
  end function is_power

  !> Puts the expressions of `wanted` on a tape; an error names the column of the text of number `faulty`.
  pure subroutine compile(machine, laws, wanted, compiled, faulty, error)
    class(machine_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: laws(:)
    type(derived_t), intent(in) :: wanted(:)
    type(compiled_t), intent(out) :: compiled
    integer, intent(out) :: faulty
    type(error_t), allocatable, intent(out) :: error
    character(len=longest_path), allocatable :: names(:)
    integer, allocatable :: nodes(:)
    integer :: i
    call new_tape(compiled%tape)
    allocate (compiled%nodes(size(wanted)), source=0)
    names = column_names(machine)
    allocate (nodes(size(names)))
    do i = 1, size(names)
      ! t and time are one.
      call variable(compiled%tape, max(1, i - 1), nodes(i))
    end do
    call add_parameters(laws, compiled%tape, names, nodes)
    do i = 1, size(wanted)
      faulty = i
      if (is_power(wanted(i))) cycle
      call read_expression(wanted(i)%expression, names, nodes, compiled%tape, compiled%nodes(i), error)
      if (allocated(error)) return
    end do
    faulty = 0
  end subroutine compile

  !> Names of the columns of a trajectory that are quantities.
  pure function column_names(machine) result(names)
    class(machine_t), intent(in) :: machine
    character(len=longest_path), allocatable :: names(:)
    type(machine_column_t), allocatable :: columns(:)
    type(log_t) :: log
    integer :: i
    call open_log(log, 1.0_wp)
    columns = machine%sample_columns(0.0_wp, log)
    names = [character(len=longest_path) :: own_columns]
    do i = 1, size(columns)
      if (len(columns(i)%meanings) == 0) names = [character(len=longest_path) :: names, columns(i)%name]
    end do
  end function column_names

  !> Parameters by their keys, as constants; lists have none.
  pure subroutine add_parameters(laws, tape, names, nodes)
    type(law_choice_t), intent(in) :: laws(:)
    type(tape_t), intent(inout) :: tape
    character(len=longest_path), allocatable, intent(inout) :: names(:)
    integer, allocatable, intent(inout) :: nodes(:)
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, k, node
    do i = 1, size(laws)
      rows = rows_of(laws(i))
      do k = 1, size(rows)
        if (rows(k)%list .or. size(laws(i)%parameters(k)%values) /= 1 .or. is_hidden(rows(k))) cycle
        call constant(tape, laws(i)%parameters(k)%values(1), node)
        names = [character(len=longest_path) :: names, path_of(laws(i))//'.'//trim(rows(k)%name)]
        nodes = [nodes, node]
      end do
    end do
  end subroutine add_parameters

  !> Whether an expression depends on more than time, speeds and parameters: of a set of positions of rest it then has no one value.
  pure logical function depends_on_position(machine, one)
    class(machine_t), intent(in) :: machine
    type(derived_t), intent(in) :: one
    character(len=longest_path), allocatable :: names(:)
    integer :: i
    depends_on_position = .false.
    names = column_names(machine)
    do i = 1, size(names)
      if (any(names(i) == [character(len=5) :: 't', 'time', 'v', 'drive']) .or. is_speed(trim(names(i)))) cycle
      if (has_name(one%expression, trim(names(i)))) depends_on_position = .true.
    end do
  end function depends_on_position

  !> Whether a cycle determines a quantity: it depends on no body that may be anywhere beside the cycle.
  pure logical function is_fixed(machine, one)
    class(machine_t), intent(in) :: machine
    type(derived_t), intent(in) :: one
    character(len=longest_path), allocatable :: names(:)
    integer :: i
    is_fixed = .true.
    names = column_names(machine)
    do i = 1, size(names)
      if (machine%fixes(trim(names(i)))) cycle
      if (is_power(one)) then
        if (is_speed(trim(names(i))) .or. names(i) == 'v') is_fixed = .false.
      else if (has_name(one%expression, trim(names(i)))) then
        is_fixed = .false.
      end if
    end do
  end function is_fixed

  pure logical function is_speed(name)
    character(len=*), intent(in) :: name
    is_speed = .false.
    if (len(name) > 2) is_speed = name(len(name) - 1:) == '_v'
  end function is_speed

  !> Values of the expressions (rows; 0 of a power) at the samples of a log that began with the crank at `crank_angle` [rad]. Not
  !> `ok` are those with an operation that is not defined somewhere.
  pure subroutine values_at_samples(machine, compiled, crank_angle, log, values, ok)
    class(machine_t), intent(in) :: machine
    type(compiled_t), intent(in) :: compiled
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    real(wp), allocatable, intent(out) :: values(:, :)
    logical, intent(out) :: ok(:)
    type(machine_column_t), allocatable :: columns(:)
    real(wp), allocatable :: variables(:, :), value(:)
    integer, allocatable :: fault(:)
    integer :: i, k, count_variables
    columns = machine%sample_columns(crank_angle, log)
    allocate (variables(3 + size(columns), log%samples))
    variables(:3, :) = log%sample_data(:, :log%samples)
    count_variables = 3
    do i = 1, size(columns)
      if (len(columns(i)%meanings) > 0) cycle
      count_variables = count_variables + 1
      variables(count_variables, :) = columns(i)%values
    end do
    allocate (values(size(compiled%nodes), log%samples), source=0.0_wp)
    allocate (value(compiled%tape%count), fault(compiled%tape%count))
    ok = .true.
    do k = 1, log%samples
      call evaluate(compiled%tape, variables(:count_variables, k), [real(wp) ::], value, fault)
      do i = 1, size(compiled%nodes)
        if (compiled%nodes(i) == 0) cycle
        ok(i) = ok(i) .and. fault(compiled%nodes(i)) == 0
        if (ok(i)) values(i, k) = value(compiled%nodes(i))
      end do
    end do
  end subroutine values_at_samples

end module derived_quantities
