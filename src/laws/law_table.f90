! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The catalogue of laws, kept as data: name, parameters, units, bounds and source of each. The
!> case reader, `separatrix laws` and the documentation all come from it. Adding a law means one
!> pure procedure, rows here and a test.
module law_table
  use contact_rows, only: contact_laws, contact_parameters
  use drive_rows, only: drive_laws, drive_parameters, largest_angle, lemes
  use effect_rows, only: effect_laws, effect_parameters
  use expression_rows, only: expression_laws, expression_parameters
  use kinds, only: wp
  use memory_rows, only: memory_laws, memory_parameters
  use law_row, only: any_value, family_length, law_length, law_row_t, not_negative, parameter_row_t, positive
  use motor_rows, only: motor_laws, motor_parameters
  use pair_rows, only: pair_laws, pair_parameters
  use part_rows, only: part_laws, part_parameters
  use text, only: join
  implicit none
  private

  public :: law_row_t, parameter_row_t, find_law, law_names, parameters_of, rows_of, text_of, table_of, path_of, part_kind, &
    part_law, is_hidden, law_choice, value_of, list_of, set_value, change_parameter, split_element, is_start_parameter, &
    largest_angle

  !> The parts that a machine is composed of, one law each.
  character(len=*), parameter, public :: families(5) = [character(len=family_length) :: &
    'body', 'restoring', 'friction', 'contact', 'drive']

  !> What may be added to a machine of one body: any number of laws.
  character(len=*), parameter, public :: effect_family = 'effect'

  !> The motor of a drive whose power is limited: one law, or none.
  character(len=*), parameter, public :: motor_family = 'motor'

  !> Tables that add one law to those of one body, where the case has them. Their units are as in their rows, also beside an angle.
  character(len=*), parameter, public :: added_families(*) = [character(len=family_length) :: motor_family]

  !> Forces on one body and its further states, each with a name of its own; the law by expressions of any family.
  character(len=*), parameter, public :: force_family = 'force', state_family = 'state', own_law = 'expression'

  !> The parts of a machine of several bodies: any number of laws, each with a name of its own. Their laws are named
  !> 'table:law'.
  character(len=*), parameter, public :: part_family = 'part'
  integer, parameter, public :: label_length = 48

  !> The values of one parameter: one number, or a list.
  type, public :: parameter_value_t
    real(wp), allocatable :: values(:)
  end type parameter_value_t

  !> An expression of a law, by its key.
  type, public :: law_text_t
    character(len=law_length) :: key = ''
    character(len=:), allocatable :: text
  end type law_text_t

  !> A law with values for its parameters, in the order of `rows_of`.
  type, public :: law_choice_t
    character(len=family_length) :: family = ''
    character(len=law_length) :: name = ''
    !> Name of a part, force or state.
    character(len=label_length) :: label = ''
    type(parameter_value_t), allocatable :: parameters(:)
    !> Its rows are among these of the table `parameters`, which is long.
    integer, private :: first_row = 1, last_row = 0
    !> Expressions of a law by expressions, and the parameters that they name, after those of the table; else not allocated.
    type(law_text_t), allocatable :: texts(:)
    type(parameter_row_t), allocatable :: own(:)
    !> It is part of another law, in whose table the case has it.
    logical :: is_derived = .false.
  end type law_choice_t

  type(law_row_t), parameter :: other_laws(*) = [ &
    law_row_t('body', 'point_mass', 'one body on a horizontal guide', lemes), &
    law_row_t('restoring', 'linear', 'force c (l0 + x_A - x)', lemes), &
    law_row_t('restoring', 'pendulum', '-moment sin x; x is an angle, the mass an inertia', &
              'Huygens, Horologium Oscillatorium (1673)'), &
    law_row_t('restoring', 'none', 'no restoring force', ''), &
    law_row_t('friction', 'none', 'no friction', ''), &
    law_row_t('friction', 'coulomb', '-mu m g sgn v; sticks up to mu_s m g', lemes), &
    law_row_t('friction', 'viscous', '-b v', lemes), &
    law_row_t('friction', 'coulomb_viscous', '-mu m g sgn v - b v; sticks up to mu_s m g', 'sum of the two laws'), &
    law_row_t('friction', 'coulomb_stribeck', &
              '-(mu + (mu_s - mu) exp(-|v/v_s|^delta)) m g sgn v - b v; sticks up to mu_s m g', lemes)]

  type(parameter_row_t), parameter :: other_parameters(*) = [ &
    parameter_row_t('body', 'point_mass', 'mass', 'kg', positive, 'm'), &
    parameter_row_t('body', 'point_mass', 'gravity', 'm/s^2', not_negative, &
                    'g; normal force of the friction laws is m g', optional=.true., default=9.81_wp), &
    parameter_row_t('restoring', 'linear', 'stiffness', 'N/m', positive, 'c'), &
    parameter_row_t('restoring', 'linear', 'free_length', 'm', not_negative, 'l0, undeformed length of the spring', &
                    optional=.true.), &
    parameter_row_t('restoring', 'pendulum', 'moment', 'N m', positive, &
                    'm g a, weight times distance of the centre of mass'), &
    parameter_row_t('friction', 'coulomb', 'kinetic_coefficient', '1', not_negative, 'mu while sliding'), &
    parameter_row_t('friction', 'coulomb', 'static_coefficient', '1', not_negative, &
                    'mu_s at break-away; the kinetic coefficient if absent, never below it', optional=.true., &
                    default=-1.0_wp), &
    parameter_row_t('friction', 'viscous', 'damping', 'N s/m', not_negative, 'b'), &
    parameter_row_t('friction', 'coulomb_viscous', 'kinetic_coefficient', '1', not_negative, 'mu while sliding'), &
    parameter_row_t('friction', 'coulomb_viscous', 'static_coefficient', '1', not_negative, &
                    'mu_s at break-away; the kinetic coefficient if absent, never below it', optional=.true., &
                    default=-1.0_wp), &
    parameter_row_t('friction', 'coulomb_viscous', 'damping', 'N s/m', not_negative, 'b'), &
    parameter_row_t('friction', 'coulomb_stribeck', 'kinetic_coefficient', '1', not_negative, 'mu at high speed'), &
    parameter_row_t('friction', 'coulomb_stribeck', 'static_coefficient', '1', not_negative, &
                    'mu_s at zero speed and at break-away, never below the kinetic coefficient'), &
    parameter_row_t('friction', 'coulomb_stribeck', 'stribeck_velocity', 'm/s', positive, 'v_s'), &
    parameter_row_t('friction', 'coulomb_stribeck', 'stribeck_exponent', '1', positive, 'delta', optional=.true., &
                    default=1.0_wp), &
    parameter_row_t('friction', 'coulomb_stribeck', 'damping', 'N s/m', not_negative, 'b of a force -b v beside it', &
                    optional=.true.)]

  type(law_row_t), parameter, public :: laws( &
    size(other_laws) + size(drive_laws) + size(contact_laws) + size(pair_laws) + size(part_laws) + size(effect_laws) + &
    size(motor_laws) + size(expression_laws) + size(memory_laws)) = &
    [other_laws, drive_laws, contact_laws, pair_laws, part_laws, effect_laws, motor_laws, expression_laws, memory_laws]
  type(parameter_row_t), parameter, public :: parameters( &
    size(other_parameters) + size(drive_parameters) + size(contact_parameters) + size(pair_parameters) + &
    size(part_parameters) + size(effect_parameters) + size(motor_parameters) + size(expression_parameters) + &
    size(memory_parameters)) = &
    [other_parameters, drive_parameters, contact_parameters, pair_parameters, part_parameters, effect_parameters, &
     motor_parameters, expression_parameters, memory_parameters]

  character(len=1), parameter :: law_letters(*) = parameters%law(1:1), family_letters(*) = parameters%family(1:1)

contains

  !> Row of a law in `laws`, 0 if there is none.
  pure integer function find_law(family, name)
    character(len=*), intent(in) :: family, name
    integer :: i
    find_law = 0
    do i = 1, size(laws)
      if (laws(i)%family == family .and. laws(i)%name == name) find_law = i
    end do
  end function find_law

  !> The known laws of a family, for messages: 'coulomb, viscous, ...'.
  pure function law_names(family) result(names)
    character(len=*), intent(in) :: family
    character(len=:), allocatable :: names
    names = join(pack(laws%name, laws%family == family), ', ')
  end function law_names

  !> The parameter rows of a law, in table order.
  pure function parameters_of(family, law) result(rows)
    character(len=*), intent(in) :: family, law
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, first, last
    call find_rows(family, law, first, last)
    rows = pack(parameters(first:last), [(is_of(i, family, law), i=first, last)])
  end function parameters_of

  !> The first and the last row of a law in `parameters`; 1 and 0 if it has none.
  pure subroutine find_rows(family, law, first, last)
    character(len=*), intent(in) :: family, law
    integer, intent(out) :: first, last
    integer :: i
    first = 1
    last = 0
    do i = 1, size(parameters)
      if (.not. is_of(i, family, law)) cycle
      if (last == 0) first = i
      last = i
    end do
  end subroutine find_rows

  !> The rows of a choice: those of its law, then of the parameters that its expressions name.
  pure function rows_of(choice) result(rows)
    type(law_choice_t), intent(in) :: choice
    type(parameter_row_t), allocatable :: rows(:)
    rows = parameters_of(choice%family, choice%name)
    if (allocated(choice%own)) rows = [rows, choice%own]
  end function rows_of

  !> The expression of a key; '' if there is none.
  pure function text_of(choice, key) result(text)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: key
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    if (.not. allocated(choice%texts)) return
    do i = 1, size(choice%texts)
      if (choice%texts(i)%key == key) text = choice%texts(i)%text
    end do
  end function text_of

  !> Whether a row of `parameters` is one of a law. First letters are compared first: fits build thousands of machines, and rows
  !> are many.
  pure logical function is_of(row, family, law)
    integer, intent(in) :: row
    character(len=*), intent(in) :: family, law
    is_of = .false.
    if (law_letters(row) /= law(1:1) .or. family_letters(row) /= family(1:1)) return
    is_of = parameters(row)%law == law .and. parameters(row)%family == family
  end function is_of

  !> Name of the table of a law in a case file, which the paths of its parameters begin with: the family, of an effect
  !> 'effect.NAME'.
  pure function table_of(family, law) result(table)
    character(len=*), intent(in) :: family, law
    character(len=:), allocatable :: table
    table = trim(family)
    if (family == effect_family) table = table//'.'//trim(law)
  end function table_of

  !> Table of a choice in a case file: that of its law, of a part 'table.NAME', of the point P of the structure S, whose label
  !> is 'S.P', 'structure.S.point.P'.
  pure function path_of(choice) result(path)
    type(law_choice_t), intent(in) :: choice
    character(len=:), allocatable :: path
    integer :: mark
    if (choice%family == part_family) then
      path = part_kind(choice%name)//'.'//trim(choice%label)
      mark = index(choice%label, '.')
      if (mark > 0) path = 'structure.'//choice%label(:mark)//'point'//trim(choice%label(mark:))
    else if (choice%family == force_family .or. choice%family == state_family) then
      path = trim(choice%family)//'.'//trim(choice%label)
    else
      path = table_of(choice%family, choice%name)
    end if
  end function path_of

  !> The table that the law of a part stands in: 'friction' of 'friction:coulomb'.
  pure function part_kind(law) result(table)
    character(len=*), intent(in) :: law
    character(len=:), allocatable :: table
    table = law(:index(law, ':') - 1)
  end function part_kind

  !> The law of a part without its table: 'coulomb' of 'friction:coulomb'.
  pure function part_law(law) result(name)
    character(len=*), intent(in) :: law
    character(len=:), allocatable :: name
    name = trim(law(index(law, ':') + 1:))
  end function part_law

  !> Whether a row has no key: it is set by names of bodies, or by the short form of a pair.
  pure logical function is_hidden(row)
    type(parameter_row_t), intent(in) :: row
    is_hidden = row%family == part_family .and. (index(row%law, 'point:') == 1 .or. &
                                                 any(row%name == [character(len=10) :: 'first_end', 'second_end', 'body', 'rate']))
  end function is_hidden

  !> Whether a path names how a motor, a state, a body of several, or a coordinate of a structure starts: 'motor.crank_speed',
  !> 'state.NAME.start', 'body.NAME.x0', 'structure.NAME.v0[2]'. Such a parameter does not change the machine.
  pure logical function is_start_parameter(path)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: name
    integer :: element, mark
    call split_element(path, name, element)
    mark = index(name, '.', back=.true.)
    is_start_parameter = path == 'motor.crank_speed' .or. path == 'motor.start_current' .or. path == 'motor.start_integral'
    if (index(name, 'state.') == 1) is_start_parameter = name(mark + 1:) == 'start' .and. mark > 6
    if (is_start_parameter) return
    is_start_parameter = (name(mark + 1:) == 'x0' .or. name(mark + 1:) == 'v0') .and. &
      ((index(name, 'body.') == 1 .and. mark > 5 .and. element == 0) .or. (index(name, 'structure.') == 1 .and. element > 0))
  end function is_start_parameter

  !> A law with every parameter at its default (zero where it has none, empty lists): set the
  !> others before use. Stops nothing: an unknown law has no parameters.
  pure function law_choice(family, name) result(choice)
    character(len=*), intent(in) :: family, name
    type(law_choice_t) :: choice
    integer :: i, row
    choice%family = family
    choice%name = name
    call find_rows(family, name, choice%first_row, choice%last_row)
    allocate (choice%parameters(count([(is_of(i, family, name), i=choice%first_row, choice%last_row)])))
    i = 0
    do row = choice%first_row, choice%last_row
      if (.not. is_of(row, family, name)) cycle
      i = i + 1
      if (parameters(row)%list) then
        allocate (choice%parameters(i)%values(0))
      else
        choice%parameters(i)%values = [parameters(row)%default]
      end if
    end do
  end function law_choice

  !> The number that a choice holds for a parameter; the parameter must belong to the law.
  pure real(wp) function value_of(choice, parameter)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: parameter
    value_of = choice%parameters(position_of(choice, parameter))%values(1)
  end function value_of

  !> The list that a choice holds for a parameter; the parameter must belong to the law.
  pure function list_of(choice, parameter) result(values)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: parameter
    real(wp), allocatable :: values(:)
    values = choice%parameters(position_of(choice, parameter))%values
  end function list_of

  !> Sets a parameter of a choice to one number or a list; the parameter must belong to the law.
  pure subroutine set_value(choice, parameter, values)
    type(law_choice_t), intent(inout) :: choice
    character(len=*), intent(in) :: parameter
    real(wp), intent(in) :: values(:)
    choice%parameters(position_of(choice, parameter))%values = values
  end subroutine set_value

  !> A path without the number of an element, 'drive.sine' of 'drive.sine[2]', and the number; 0 where it has none, -1 if what
  !> stands in the brackets is not a number.
  pure subroutine split_element(path, list, element)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: list
    integer, intent(out) :: element
    integer :: open, status
    list = trim(path)
    element = 0
    open = index(list, '[', back=.true.)
    if (open == 0 .or. list(len(list):) /= ']') return
    element = -1
    if (open + 1 < len(list) .and. verify(list(open + 1:len(list) - 1), '0123456789') == 0) then
      read (list(open + 1:len(list) - 1), *, iostat=status) element
      if (status /= 0 .or. element == 0) element = -1
    end if
    list = list(:open - 1)
  end subroutine split_element

  !> Changes the parameter `path` = 'family.parameter' or 'effect.NAME.parameter' among `choices`, of a list its element
  !> 'family.parameter[2]'; `found` is false if none has it. A static coefficient that equals the kinetic one moves with it.
  pure subroutine change_parameter(choices, path, value, found)
    type(law_choice_t), intent(inout) :: choices(:)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    logical, intent(out) :: found
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: name, list
    real(wp) :: before
    integer :: i, k, mark, element
    found = .false.
    call split_element(path, list, element)
    mark = index(list, '.', back=.true.)
    name = trim(list(mark + 1:))
    do i = 1, size(choices)
      if (path_of(choices(i)) /= list(:mark - 1)) cycle
      rows = rows_of(choices(i))
      k = findloc(rows%name == name .and. (rows%list .eqv. element > 0), .true., dim=1)
      if (k == 0) cycle
      if (element > size(choices(i)%parameters(k)%values)) cycle
      found = .true.
      before = choices(i)%parameters(k)%values(max(element, 1))
      choices(i)%parameters(k)%values(max(element, 1)) = value
      k = findloc(rows%name == 'static_coefficient' .or. rows%name == 'static_force', .true., dim=1)
      if ((name /= 'kinetic_coefficient' .and. name /= 'force') .or. k == 0) cycle
      if (.not. abs(choices(i)%parameters(k)%values(1) - before) > 0) choices(i)%parameters(k)%values = [value]
    end do
  end subroutine change_parameter

  pure integer function position_of(choice, parameter)
    type(law_choice_t), intent(in) :: choice
    character(len=*), intent(in) :: parameter
    integer :: i, first, last
    first = choice%first_row
    last = choice%last_row
    ! The name of a choice may have been changed.
    if (.not. is_of(first, choice%family, choice%name)) call find_rows(choice%family, choice%name, first, last)
    position_of = 0
    do i = first, last
      if (.not. is_of(i, choice%family, choice%name)) cycle
      position_of = position_of + 1
      if (parameters(i)%name == parameter) return
    end do
    error stop 'law_table: a parameter that the law does not have'
  end function position_of

end module law_table
