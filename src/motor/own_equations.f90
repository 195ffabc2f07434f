! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body whose forces, states, friction, restitution or drive are expressions of the case, as equations on one tape:
!>   m x'' = c (l0 + x_A(t) - x) + forces(x, x', t, states) - F(|x'|) sgn x',   states' = rates(x, x', t, states).
!> Laws of the catalogue stand beside expressions. The time is a variable: it is counted from the section where a drive has a
!> period, else from the start. So is the phase, from 0 to 2 pi over a period.
module own_equations
  use constants, only: two_pi
  use contact_law, only: contact_of
  use drive_law, only: drive_of, drive_t
  use equation_sheet, only: add_node, add_optional, add_parameter, add_variable, define, define_slope, new_sheet, node_of, &
    parameter_number
  use errors, only: error_t, fail
  use expression_names, only: has_name
  use kinds, only: wp
  use law_table, only: effect_family, force_family, law_choice_t, own_law, path_of, state_family, text_of, value_of
  use motor_choices, only: number_of_family
  use motor_state, only: most_own
  use motor_system, only: far, motor_system_t, v_at
  use own_checks, only: check_period, check_values, set_scales, set_turn
  use own_flights, only: add_own_flights
  use own_friction, only: add_friction, add_restitution
  use own_names, only: add_known, add_parameters, depends_on, names_t, new_names, read_own, set_unit
  use own_units, only: parameter_unit, quantity_t
  use restoring_law, only: position_is_angle, restoring_of, restoring_t
  use status, only: exit_bad_case, exit_internal
  use tape_value, only: evaluate
  use text, only: to_text
  implicit none
  private

  public :: build_own_equations

  character(len=*), parameter :: needed(5) = [character(len=9) :: 'body', 'restoring', 'friction', 'contact', 'drive']

contains

  !> The equations of one law per family body, restoring, friction, contact, drive, and any forces and states. An error begins
  !> with the key.
  pure subroutine build_own_equations(choices, system, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(motor_system_t), intent(out) :: system
    type(error_t), allocatable, intent(out) :: error
    type(names_t) :: names
    integer :: at(5), i
    do i = 1, 5
      at(i) = number_of_family(choices, needed(i))
    end do
    call refuse_others(choices, at, error)
    if (allocated(error)) return
    system%clock = .true.
    system%mass = value_of(choices(at(1)), 'mass')
    system%contact = contact_of(choices(at(4)), system%mass)
    call add_variables(choices, system, names, error)
    if (.not. allocated(error)) call add_drive(choices, at(5), system, names, error)
    if (.not. allocated(error)) call add_rates(choices, system, names, error)
    if (.not. allocated(error)) call add_forces(choices, at(2), system, names, error)
    if (.not. allocated(error)) call add_friction(choices, at(3), system, names, error)
    if (.not. allocated(error)) call add_restitution(choices, at(4), system, names, error)
    if (allocated(error)) return
    call add_motion(system)
    call check_sheet(system, error)
    if (allocated(error)) return
    call set_scales(system)
    call check_values(choices, at, system, error)
    if (.not. allocated(error)) call check_period(choices, system, error)
    if (allocated(error)) return
    if (names%is_angle) call set_turn(system)
    call add_own_flights(system)
    call check_sheet(system, error)
  end subroutine build_own_equations

  !> All equations are on the tape.
  pure subroutine check_sheet(system, error)
    type(motor_system_t), intent(in) :: system
    type(error_t), allocatable, intent(out) :: error
    if (allocated(system%sheet%error)) then
      call fail(error, exit_internal, 'equations by expressions: '//system%sheet%error%message)
    else if (system%sheet%tape%is_full) then
      call fail(error, exit_bad_case, 'body.law: too many operations in the expressions of the case')
    end if
  end subroutine check_sheet

  !> Laws that expressions do not go with.
  pure subroutine refuse_others(choices, at, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at(5)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: exponent
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family == effect_family) call fail(error, exit_bad_case, 'effect.'//trim(choices(i)%name)// &
                                                        ': not allowed with laws by expressions; a [force.NAME] can replace it')
      if (allocated(error)) return
    end do
    if (choices(at(1))%name /= 'point_mass') then
      call fail(error, exit_bad_case, 'body.law: found "'//trim(choices(at(1))%name)//'", allowed with laws by expressions: '// &
                'point_mass')
      return
    end if
    exponent = 1
    if (choices(at(3))%name == 'coulomb_stribeck') exponent = value_of(choices(at(3)), 'stribeck_exponent')
    if (all(choices(at(4))%name /= [character(len=10) :: 'none', 'newton', own_law])) then
      call fail(error, exit_bad_case, 'contact.law: allowed with laws by expressions: none, newton, expression')
    else if (choices(at(5))%name == 'measured_force') then
      call fail(error, exit_bad_case, 'drive.law: found "measured_force", allowed with laws by expressions: none, harmonic, '// &
                'fourier, crank_lever_rod, expression')
    else if (abs(exponent - nint(exponent)) > 0 .or. exponent > 8) then
      call fail(error, exit_bad_case, 'friction.stribeck_exponent: allowed with laws by expressions: 1, 2, ... 8')
    else if (count(choices%family == state_family) > most_own) then
      call fail(error, exit_bad_case, 'state: found '//to_text(count(choices%family == state_family))//' states, allowed '// &
                to_text(most_own))
    end if
  end subroutine refuse_others

  !> Variables, and the names of all numbers of the case.
  pure subroutine add_variables(choices, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(out) :: names
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: seen(3) = ['x', 'v', 't']
    integer :: i
    call new_names(names)
    associate (sheet => system%sheet)
      call new_sheet(sheet)
      call add_variable(sheet, 't')
      call add_variable(sheet, 'phase')
      call add_variable(sheet, 'x')
      call add_variable(sheet, 'v')
      do i = 1, 3
        call add_known(names, seen(i), node_of(sheet, seen(i)))
      end do
      names%is_angle = position_is_angle(choices)
      names%of_variables = [variable_unit('s'), quantity_t(), variable_unit('m'), variable_unit('m/s')]
      if (names%is_angle) names%of_variables(3:4) = quantity_t()
      do i = 1, size(choices)
        if (choices(i)%family /= state_family) cycle
        if (any(names%names == choices(i)%label)) then
          call fail(error, exit_bad_case, path_of(choices(i))//': found the name of a variable, allowed any other')
          return
        end if
        call add_variable(sheet, 'state '//to_text(i))
        call add_known(names, trim(choices(i)%label), node_of(sheet, 'state '//to_text(i)))
        associate (row => choices(i)%own(findloc(choices(i)%own%name == 'start', .true., dim=1)))
          names%of_variables = [names%of_variables, variable_unit(trim(row%unit))]
        end associate
      end do
      system%variables = sheet%variables
      call add_parameter(sheet, 'slip', 1.0_wp)
      call add_parameter(sheet, 'turning', 1.0_wp)
      call add_parameter(sheet, 'mass', system%mass)
      call add_parameter(sheet, 'upper', min(system%contact%upper, far))
      call add_parameter(sheet, 'lower', max(system%contact%lower, -far))
      call add_parameter(sheet, 'least', 0.0_wp)
      system%slip = parameter_number(sheet, 'slip')
      system%turning = parameter_number(sheet, 'turning')
      call set_unit(names, system%slip, quantity_t(is_known=.true.))
      call add_parameters(names, choices, sheet)
    end associate
  end subroutine add_variables

  !> Unit of a variable, which every equation has.
  pure type(quantity_t) function variable_unit(text) result(quantity)
    character(len=*), intent(in) :: text
    quantity = parameter_unit(text)
    quantity%is_stated = .false.
  end function variable_unit

  !> Period of the drive, and the foot of the spring.
  pure subroutine add_drive(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(inout) :: names
    type(error_t), allocatable, intent(out) :: error
    type(restoring_t) :: spring
    type(drive_t) :: drive
    integer :: node, i
    spring = restoring_of(choices(number_of_family(choices, 'restoring')))
    if (choices(at)%name == own_law) then
      call read_period(choices, at, system, names, error)
      if (allocated(error)) return
    else
      drive = drive_of(choices(at))
      if (drive%ratio > 0 .and. spring%stiffness > 0) system%period = two_pi/(drive%ratio*sqrt(spring%stiffness/system%mass))
      if (drive%frequency > 0) system%period = two_pi/drive%frequency
      if (choices(at)%name == 'force') system%period = two_pi/value_of(choices(at), 'frequency')
    end if
    associate (sheet => system%sheet)
      if (system%period > 0) then
        call add_parameter(sheet, 'clock_speed', two_pi/system%period)
        call add_known(names, 'phase', node_of(sheet, 'phase'))
      end if
      if (text_of(choices(at), 'position') /= '') then
        call read_own(names, choices, at, 'position', sheet, node, error)
        if (.not. allocated(error)) call add_node(sheet, 'foot', node)
      else if (choices(at)%name /= own_law .and. system%period > 0) then
        call add_optional(sheet, 'mean', drive%mean)
        call define(sheet, 'foot0', 'mean')
        do i = 1, size(drive%cosine)
          call add_optional(sheet, 'cosine'//to_text(i), drive%cosine(i))
          call add_optional(sheet, 'sine'//to_text(i), drive%sine(i))
          call define(sheet, 'foot'//to_text(i), 'foot'//to_text(i - 1)//' + cosine'//to_text(i)//'*cos('//to_text(i)// &
                      '*phase) + sine'//to_text(i)//'*sin('//to_text(i)//'*phase)')
        end do
        call define(sheet, 'foot', 'foot'//to_text(size(drive%cosine)))
      else
        call define(sheet, 'foot', '0')
      end if
      if (.not. system%period > 0) call define(sheet, 'clock_speed', '0')
    end associate
  end subroutine add_drive

  !> The period that a drive by expressions states, by an expression of parameters or a number.
  pure subroutine read_period(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(in) :: names
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    real(wp) :: variables(system%variables)
    integer, allocatable :: faults(:)
    integer :: node, i
    logical :: is_good
    variables = 0
    if (text_of(choices(at), 'period') /= '') then
      call read_own(names, choices, at, 'period', system%sheet, node, error)
      if (allocated(error)) return
      allocate (values(system%sheet%tape%count), faults(system%sheet%tape%count))
      call evaluate(system%sheet%tape, variables, system%sheet%parameters, values, faults)
      system%period = values(node)
      is_good = system%sheet%tape%nodes(node)%is_steady .and. faults(node) == 0
    else
      is_good = .true.
      if (.not. allocated(choices(at)%own)) return
      i = findloc(choices(at)%own%name == 'period', .true., dim=1)
      if (i == 0) return
      system%period = choices(at)%parameters(size(choices(at)%parameters) - size(choices(at)%own) + i)%values(1)
    end if
    if (is_good .and. system%period > 0) return
    call fail(error, exit_bad_case, 'drive.period: found '//to_text(real(system%period, kind(1d0)))// &
              ' s, allowed a positive number, or an expression of parameters that is one')
  end subroutine read_period

  !> Rates of the states. A rate may use that of another state, as state.NAME.rate, in any order but without an algebraic loop.
  pure subroutine add_rates(choices, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(inout) :: names
    type(error_t), allocatable, intent(out) :: error
    logical :: is_open(size(choices))
    integer :: i, before, node
    is_open = choices%family == state_family
    do
      before = count(is_open)
      do i = 1, size(choices)
        if (.not. is_open(i)) cycle
        if (open_rate(choices, is_open, text_of(choices(i), 'rate')) > 0) cycle
        call read_own(names, choices, i, 'rate', system%sheet, node, error)
        if (allocated(error)) return
        is_open(i) = .false.
        call add_node(system%sheet, 'rate '//to_text(count(choices(:i)%family == state_family)), node)
        call add_known(names, path_of(choices(i))//'.rate', node)
      end do
      if (.not. any(is_open)) return
      if (count(is_open) == before) exit
    end do
    i = findloc(is_open, .true., dim=1)
    call fail(error, exit_bad_case, path_of(choices(i))//'.rate: found '// &
              path_of(choices(open_rate(choices, is_open, text_of(choices(i), 'rate'))))// &
              '.rate, which needs this rate itself (an algebraic loop)')
  end subroutine add_rates

  !> Number of a state that is still open and whose rate a text uses; 0 if there is none.
  pure integer function open_rate(choices, is_open, text) result(number)
    type(law_choice_t), intent(in) :: choices(:)
    logical, intent(in) :: is_open(:)
    character(len=*), intent(in) :: text
    integer :: i
    number = 0
    do i = 1, size(choices)
      if (.not. is_open(i)) cycle
      if (has_name(text, path_of(choices(i))//'.rate')) number = i
    end do
  end function open_rate

  !> The spring and all forces but friction.
  pure subroutine add_forces(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(inout) :: names
    type(error_t), allocatable, intent(out) :: error
    type(restoring_t) :: spring
    integer :: i, node, forces
    spring = restoring_of(choices(at))
    associate (sheet => system%sheet)
      if (choices(at)%name == 'pendulum') then
        call add_parameter(sheet, 'moment', spring%stiffness)
        call define(sheet, 'spring', 'moment*sin(foot - x)')
        call define(sheet, 'stored', 'moment*(1 - cos(foot - x))')
      else if (choices(at)%name /= own_law) then
        system%stiffness = spring%stiffness
        system%free_length = spring%free_length
        call add_optional(sheet, 'stiffness', spring%stiffness)
        call add_optional(sheet, 'free_length', spring%free_length)
        call define(sheet, 'extension', 'free_length + foot - x')
        call define(sheet, 'spring', 'stiffness*extension')
        call define(sheet, 'stored', 'spring*extension/2')
      else
        call define(sheet, 'spring', '0')
        call define(sheet, 'stored', '0')
      end if
      call define(sheet, 'total0', '0')
      forces = 0
      do i = 1, size(choices)
        if (choices(i)%family /= force_family .and. .not. (i == at .and. choices(i)%name == own_law)) cycle
        call read_own(names, choices, i, 'force', sheet, node, error)
        if (allocated(error)) return
        forces = forces + 1
        call add_node(sheet, 'force'//to_text(forces), node)
        call define(sheet, 'total'//to_text(forces), 'total'//to_text(forces - 1)//' + force'//to_text(forces))
      end do
      associate (drive => choices(number_of_family(choices, 'drive')))
        if (drive%name == 'force') then
          call add_optional(sheet, 'drive_mean', value_of(drive, 'mean'))
          call add_optional(sheet, 'drive_amplitude', value_of(drive, 'amplitude'))
          call define(sheet, 'force'//to_text(forces + 1), 'drive_mean + drive_amplitude*cos(phase)')
          call define(sheet, 'total'//to_text(forces + 1), 'total'//to_text(forces)//' + force'//to_text(forces + 1))
          forces = forces + 1
        end if
      end associate
      call define(sheet, 'forces', 'total'//to_text(forces))
      call define(sheet, 'hold', 'spring + forces')
      system%forces = [node_of(sheet, 'spring'), (node_of(sheet, 'force'//to_text(i)), i=1, forces)]
    end associate
    call name_forces(choices, at, system, names)
  end subroutine add_forces

  !> Makes forces known to friction and restitution: `force.NAME`, and `restoring` of the spring.
  pure subroutine name_forces(choices, at, system, names)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(in) :: system
    type(names_t), intent(inout) :: names
    integer :: i, forces
    forces = 1
    if (choices(at)%name /= own_law) call add_known(names, 'restoring', system%forces(1))
    do i = 1, size(choices)
      if (choices(i)%family /= force_family .and. .not. (i == at .and. choices(i)%name == own_law)) cycle
      forces = forces + 1
      call add_known(names, path_of(choices(i)), system%forces(forces))
    end do
  end subroutine name_forces

  !> Accelerations, powers and energies, and what they depend on.
  pure subroutine add_motion(system)
    type(motor_system_t), intent(inout) :: system
    integer :: time, i
    associate (sheet => system%sheet)
      call define(sheet, 'zero', '0')
      call define(sheet, 'one', '1')
      call define(sheet, 'v_rate', '(hold - friction)/mass')
      call define(sheet, 'kinetic_energy', 'mass*v^2/2')
      call define(sheet, 'work', 'forces*v')
      call define_slope(sheet, 'stored_slope', 'stored', 't')
      call define_slope(sheet, 'stored_over_phase', 'stored', 'phase')
      call define(sheet, 'power', 'work + stored_slope + stored_over_phase*clock_speed')
      call define(sheet, 'dry_loss', 'dry*v')
      call define(sheet, 'viscous_loss', 'viscous*v^2')
      call define(sheet, 'energy', 'kinetic_energy + stored')
      call define_slope(sheet, 'force_slope', 'hold', 'x')
      system%force_slope = node_of(sheet, 'force_slope')
      system%foot = node_of(sheet, 'foot')
      system%kinetic = node_of(sheet, 'kinetic_energy')
      system%energy = node_of(sheet, 'energy')
      system%stored = node_of(sheet, 'stored')
      system%torque = node_of(sheet, 'zero')
      system%load = node_of(sheet, 'zero')
      system%inertia = node_of(sheet, 'one')
      system%current = node_of(sheet, 'zero')
      system%body_hold = node_of(sheet, 'hold')
      associate (depends => depends_on(sheet%tape, 1))
        time = count(depends([node_of(sheet, 'v_rate'), system%foot, (node_of(sheet, 'rate '//to_text(i)), &
                                                                      i=1, system%variables - v_at)]))
        if (system%restitution > 0) time = time + count([depends(system%restitution)])
      end associate
    end associate
    system%aperiodic = time > 0 .and. .not. system%period > 0
  end subroutine add_motion

end module own_equations
