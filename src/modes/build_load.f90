! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The normal force of friction between parts, or a force on them, from its expression. It may name the time and the phase of a
!> drive; x and v of the force; the sliding speed of friction; NAME.x and NAME.v of bodies and points; spring.NAME, the force by
!> which a spring presses its ends apart; contact.NAME, that of a soft contact; the parameters of its own table by their names, and
!> those of every table by their paths.
module build_load
  use angle_units, only: unit_of
  use errors, only: error_t, fail
  use expression_names, only: has_name
  use expression_text, only: read_expression
  use kinds, only: wp
  use law_row, only: none_above
  use load_checks, only: check_values, repeats
  use law_table, only: is_hidden, label_length, law_choice_t, parameter_row_t, part_family, part_kind, part_law, &
    path_of, rows_of, text_of, value_of
  use multibody, only: joint_t, load_t, multibody_t, source_t
  use operations, only: op_add, op_multiply, op_negative, op_subtract
  use own_units, only: parameter_unit, quantities_of, quantity_t, unit_problem
  use part_angles, only: is_of_angle
  use reference_points, only: is_reference_point, row_of
  use status, only: exit_bad_case
  use tape, only: constant, new_tape, parameter_node, variable
  use tape_algebra, only: binary, unary
  use tape_derivative, only: differentiate
  use tape_sign, only: positive_part
  implicit none
  private

  public :: set_expression

  integer, parameter :: name_length = 64

  !> Names of an expression and their nodes, with the units of variables and parameters.
  type :: names_t
    character(len=name_length), allocatable :: names(:)
    integer, allocatable :: nodes(:)
    type(quantity_t), allocatable :: of_variables(:), of_parameters(:)
  end type names_t

contains

  !> Sets the expression of joint `joint`, choice number `i`; `rows` are those of the reference points. Errors name the key.
  pure subroutine set_expression(choices, i, rows, machine, joint, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    real(wp), intent(in) :: rows(:, :)
    type(multibody_t), intent(in) :: machine
    type(joint_t), intent(inout) :: joint
    type(error_t), allocatable, intent(out) :: error
    type(names_t) :: names
    character(len=:), allocatable :: key, text, wanted
    logical :: is_load, is_base, of_time
    integer :: node
    is_load = index(choices(i)%name, 'friction:') == 1
    is_base = choices(i)%name == 'drive:base'
    of_time = is_base .or. choices(i)%name == 'drive:motion'
    text = 'force'
    if (choices(i)%name == 'friction:coulomb_load') text = 'load'
    if (of_time) text = 'position'
    key = path_of(choices(i))//'.'//text
    text = text_of(choices(i), text)
    wanted = unit_of(merge('m', 'N', of_time), is_of_angle(choices, i))
    if (is_base) wanted = unit_of('m', size(machine%angles) > 0)
    allocate (joint%load)
    associate (load => joint%load)
      call new_tape(load%tape)
      allocate (names%names(0), names%nodes(0), names%of_variables(0), names%of_parameters(0), load%sources(0), load%parameters(0))
      allocate (load%rates(0))
      call add_clock(machine, load, names)
      if (.not. (is_load .or. of_time)) call add_own_coordinate(joint%row, is_of_angle(choices, i), load, names)
      if (.not. of_time) call add_coordinates(choices, text, rows, load, names)
      call add_parameters(choices, i, load, names)
      if (is_load) call add_speed(choices(i), text, is_of_angle(choices, i), joint%row, load, names)
      if (.not. of_time) call add_springs(choices, text, rows, load, names)
      if (.not. of_time) call add_contacts(choices, text, rows, load, names, error)
      if (allocated(error)) then
        error%message = key//': '//error%message
        return
      end if
      call read_expression(text, names%names, names%nodes, load%tape, node, error)
      if (.not. allocated(error)) call check_unit(choices, load, names, node, wanted, error)
      if (is_base .and. .not. allocated(error)) call accelerate(machine, load, node, error)
      if (.not. allocated(error)) call check_values(is_load, load, node, error)
      if (allocated(error)) then
        error%message = key//': '//error%message
        return
      end if
      load%node = node
      load%by_clock = has_name(text, 't') .and. .not. repeats(machine, load, node)
      if (is_load) call positive_part(load%tape, load%parameters, node, load%node)
    end associate
  end subroutine set_expression

  pure subroutine add_name(names, name, node)
    type(names_t), intent(inout) :: names
    character(len=*), intent(in) :: name
    integer, intent(in) :: node
    character(len=name_length) :: padded
    padded = name
    names%names = [names%names, padded]
    names%nodes = [names%nodes, node]
  end subroutine add_name

  !> The next variable, with the node of its rate and its unit.
  pure subroutine add_variable(load, names, rate, unit, node)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    integer, intent(in) :: rate
    character(len=*), intent(in) :: unit
    integer, intent(out) :: node
    type(quantity_t) :: quantity
    quantity = parameter_unit(trim(unit))
    quantity%is_stated = .false.
    if (unit == 'rad') quantity%is_known = .true.
    call variable(load%tape, size(load%rates) + 1, node)
    load%rates = [load%rates, rate]
    names%of_variables = [names%of_variables, quantity]
  end subroutine add_variable

  !> Time, and the phase where there is a drive.
  pure subroutine add_clock(machine, load, names)
    type(multibody_t), intent(in) :: machine
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    integer :: one, speed, node
    call constant(load%tape, 1.0_wp, one)
    call constant(load%tape, machine%frequency, speed)
    call add_variable(load, names, one, 's', node)
    call add_name(names, 't', node)
    call add_variable(load, names, speed, '1', node)
    if (machine%frequency > 0) call add_name(names, 'phase', node)
  end subroutine add_clock

  !> Numbers of the case.
  pure subroutine add_parameters(choices, i, load, names)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: i
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: unit
    integer :: k, r, node, count_own
    logical :: turning
    do k = 1, size(choices)
      rows = rows_of(choices(k))
      turning = choices(k)%family == part_family
      if (turning) turning = is_of_angle(choices, k)
      count_own = 0
      if (allocated(choices(k)%own)) count_own = size(choices(k)%own)
      do r = 1, size(rows)
        if (rows(r)%list .or. is_hidden(rows(r))) cycle
        if (abs(choices(k)%parameters(r)%values(1)) >= none_above) cycle
        load%parameters = [load%parameters, choices(k)%parameters(r)%values(1)]
        call parameter_node(load%tape, size(load%parameters), node)
        call add_name(names, path_of(choices(k))//'.'//trim(rows(r)%name), node)
        if (k == i) call add_name(names, trim(rows(r)%name), node)
        unit = trim(rows(r)%unit)
        ! Those of an expression have units of their own.
        if (r <= size(rows) - count_own) unit = unit_of(unit, turning)
        names%of_parameters = [names%of_parameters, parameter_unit(unit)]
      end do
    end do
  end subroutine add_parameters

  !> A source and its four variables; `nodes` are those of its value and rate.
  pure subroutine add_source(source, units, load, names, nodes)
    type(source_t), intent(in) :: source
    character(len=5), intent(in) :: units(2)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    integer, intent(out) :: nodes(2)
    type(source_t), allocatable :: sources(:)
    integer :: zero, i, made(4), first
    call constant(load%tape, 0.0_wp, zero)
    first = size(load%rates)
    do i = 1, 4
      call add_variable(load, names, zero, merge(units(min(i, 2)), '1    ', i <= 2), made(i))
    end do
    load%rates(first + 1:first + 3) = made(2:4)
    allocate (sources(size(load%sources) + 1))
    do i = 1, size(load%sources)
      sources(i) = load%sources(i)
    end do
    sources(size(sources)) = source
    call move_alloc(sources, load%sources)
    nodes = made(:2)
  end subroutine add_source

  !> The coordinate of the joint along `row`, second minus first, as x and v.
  pure subroutine add_own_coordinate(row, is_angle, load, names)
    real(wp), intent(in) :: row(:)
    logical, intent(in) :: is_angle
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    type(source_t) :: source
    integer :: nodes(2)
    source%row = row
    call add_source(source, units_of_motion(is_angle), load, names, nodes)
    call add_name(names, 'x', nodes(1))
    call add_name(names, 'v', nodes(2))
  end subroutine add_own_coordinate

  !> The sliding speed, from zero on whichever way the surfaces slide, if the text names it.
  pure subroutine add_speed(choice, text, is_angle, row, load, names)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: text
    logical, intent(in) :: is_angle
    real(wp), intent(in) :: row(:)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    type(source_t) :: source
    real(wp) :: belt
    integer :: nodes(2), slip, surface, sliding, speed
    if (.not. has_name(text, 'speed')) then
      call add_name(names, 'speed', 1)
      return
    end if
    source%row = row
    call add_source(source, units_of_motion(is_angle), load, names, nodes)
    belt = value_of(choice, 'velocity')
    ! The direction of a start at rest; that of a motion is set where it slides.
    load%parameters = [load%parameters, merge(-1.0_wp, 1.0_wp, belt > 0), belt]
    load%slip = size(load%parameters) - 1
    names%of_parameters = [names%of_parameters, quantity_t(is_known=.true.), parameter_unit(unit_of('m/s', is_angle))]
    call parameter_node(load%tape, load%slip, slip)
    call parameter_node(load%tape, load%slip + 1, surface)
    call binary(load%tape, op_subtract, nodes(2), surface, sliding)
    call binary(load%tape, op_multiply, slip, sliding, speed)
    call add_name(names, 'speed', speed)
  end subroutine add_speed

  !> Units of a position and its velocity.
  pure function units_of_motion(is_angle) result(units)
    logical, intent(in) :: is_angle
    character(len=5) :: units(2)
    units = [character(len=5) :: unit_of('m', is_angle), unit_of('m/s', is_angle)]
  end function units_of_motion

  !> Positions and velocities of the bodies and points that the text names.
  pure subroutine add_coordinates(choices, text, rows, load, names)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: text
    real(wp), intent(in) :: rows(:, :)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    character(len=:), allocatable :: label
    type(source_t) :: source
    integer :: i, k, nodes(2)
    k = 0
    do i = 1, size(choices)
      if (.not. is_reference_point(choices(i))) cycle
      k = k + 1
      label = trim(choices(i)%label)
      if (.not. (has_name(text, label//'.x') .or. has_name(text, label//'.v'))) then
        ! Messages list it; the text does not refer to it.
        call add_name(names, label//'.x', 1)
        call add_name(names, label//'.v', 1)
        cycle
      end if
      source%row = rows(:, k)
      call add_source(source, units_of_motion(is_of_angle(choices, i)), load, names, nodes)
      call add_name(names, label//'.x', nodes(1))
      call add_name(names, label//'.v', nodes(2))
    end do
  end subroutine add_coordinates

  !> Forces of springs, with their dampers, that the text names.
  pure subroutine add_springs(choices, text, rows, load, names)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: text
    real(wp), intent(in) :: rows(:, :)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    character(len=2), parameter :: letters(6) = ['s ', 'u ', 'k ', 'k2', 'k3', 'c ']
    type(source_t) :: source
    type(error_t), allocatable :: error
    integer :: i, k, at(6), force
    real(wp) :: numbers(4)
    do i = 1, size(choices)
      if (.not. any(choices(i)%name == [character(len=label_length) :: 'spring:linear', 'spring:polynomial'])) cycle
      if (.not. has_name(text, path_of(choices(i)))) then
        call add_name(names, path_of(choices(i)), 1)
        cycle
      end if
      source%row = row_of(rows, choices(i))
      source%offset%mean = -value_of(choices(i), 'free_length')
      call add_source(source, units_of_motion(is_of_angle(choices, i)), load, names, at(:2))
      numbers = [value_of(choices(i), 'stiffness'), 0.0_wp, 0.0_wp, value_of(choices(i), 'damping')]
      if (part_law(choices(i)%name) == 'polynomial') numbers(2:3) = [value_of(choices(i), 'quadratic'), &
                                                                     value_of(choices(i), 'cubic')]
      do k = 1, 4
        load%parameters = [load%parameters, numbers(k)]
        call parameter_node(load%tape, size(load%parameters), at(k + 2))
        names%of_parameters = [names%of_parameters, quantity_t()]
      end do
      call read_expression('-(s*(k + s*(k2 + s*k3)) + c*u)', letters, at, load%tape, force, error)
      call add_name(names, path_of(choices(i)), force)
    end do
  end subroutine add_springs

  !> Forces of soft contacts that the text names.
  pure subroutine add_contacts(choices, text, rows, load, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    character(len=*), intent(in) :: text
    real(wp), intent(in) :: rows(:, :)
    type(load_t), intent(inout) :: load
    type(names_t), intent(inout) :: names
    type(error_t), allocatable, intent(out) :: error
    type(source_t) :: source
    integer :: i, nodes(2)
    do i = 1, size(choices)
      if (index(choices(i)%name, 'contact:') /= 1) cycle
      if (.not. has_name(text, path_of(choices(i)))) then
        if (index(part_law(choices(i)%name), 'newton') /= 1) call add_name(names, path_of(choices(i)), 1)
        cycle
      end if
      if (index(part_law(choices(i)%name), 'newton') == 1) then
        call fail(error, exit_bad_case, 'found '//path_of(choices(i))//', which is rigid; allowed soft contacts, whose force '// &
                  'follows from the penetration')
        return
      end if
      source%row = row_of(rows, choices(i))
      source%contact = path_of(choices(i))
      call add_source(source, merge(['N m  ', 'N m/s'], ['N    ', 'N/s  '], is_of_angle(choices, i)), load, names, nodes)
      call add_name(names, path_of(choices(i)), nodes(1))
    end do
  end subroutine add_contacts

  !> The expression is in `unit`, if its parameters have units.
  pure subroutine check_unit(choices, load, names, node, unit, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(load_t), intent(in) :: load
    type(names_t), intent(in) :: names
    integer, intent(in) :: node
    character(len=*), intent(in) :: unit
    type(error_t), allocatable, intent(inout) :: error
    type(quantity_t) :: quantity(load%tape%count)
    integer :: fault(load%tape%count)
    character(len=:), allocatable :: problem
    if (any(choices%name == 'spring:pendulum')) return
    call quantities_of(load%tape, names%of_variables, names%of_parameters, quantity, fault)
    problem = unit_problem(load%tape, node, quantity, fault, unit)
    if (len(problem) > 0) call fail(error, exit_bad_case, problem)
  end subroutine check_unit

  !> Makes the negative acceleration of a position over time, two derivatives. A jump or a corner would be an impulse on each body.
  pure subroutine accelerate(machine, load, node, error)
    type(multibody_t), intent(in) :: machine
    type(load_t), intent(inout) :: load
    integer, intent(inout) :: node
    type(error_t), allocatable, intent(inout) :: error
    integer :: time, phase, speed, made, round, by_time(1), by_phase(1)
    if (.not. all(load%tape%nodes(load%tape%switches%argument)%is_steady)) then
      call fail(error, exit_bad_case, 'found abs, sign, min, max or if of the time, allowed a smooth function: bodies on a '// &
                'ground that jumps have no finite acceleration')
      return
    end if
    call variable(load%tape, 1, time)
    call variable(load%tape, 2, phase)
    call constant(load%tape, machine%frequency, speed)
    do round = 1, 2
      call differentiate(load%tape, [node], time, by_time)
      call differentiate(load%tape, [node], phase, by_phase)
      call binary(load%tape, op_multiply, speed, by_phase(1), made)
      call binary(load%tape, op_add, by_time(1), made, node)
    end do
    made = node
    call unary(load%tape, op_negative, made, node)
  end subroutine accelerate

end module build_load
