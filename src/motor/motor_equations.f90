! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body, the motor that drives it and what lies between, as equations on one tape: z' = f(z) of the state
!> z = (phi, w, x, v [, y]) with the crank angle [rad] and its speed [rad/s], position [m] and velocity [m/s] of the body, and
!> the current [A] or the integral of the control [rad] where the motor has one.
!>
!> A mechanism moves the foot of the spring, or an unbalance on the body turns with the crank:
!>   J(phi) w' + J'(phi) w^2/2 = L(w, y) - h w - H0 sgn w - c s x_A'(phi),   m v' = c s - b v + F,   s = l0 + x_A(phi) - x
!>   J w' - m_e v' sin phi = L - h w - H0 sgn w,   m v' - m_e (w' sin phi + w^2 cos phi) = c (l0 - x) - b v + F
!> The signs of slip and of the turning, `slip` and `turning`, are parameters. Either of body and crank may be held.
module motor_equations
  use constants, only: two_pi
  use contact_law, only: contact_constant, contact_of
  use crank_mechanism, only: add_mechanism
  use equation_sheet, only: add_optional, add_parameter, add_variable, define, new_sheet, node_of, parameter_number, read_node
  use errors, only: error_t, fail
  use friction_law, only: friction_of
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use motor_choices, only: number_of_family, refuse_laws, speed_of
  use motor_system, only: both_held, body_held, both_move, crank_held, far, guard_body_down, guard_body_up, guard_count, &
    guard_crank_down, guard_crank_up, guard_fastest, guard_ramp_end, low_order, &
    motor_system_t, phi_at, v_at, w_at, x_at, y_at
  use motor_torque, only: add_motor, control_guards
  use restoring_law, only: restoring_of, restoring_t
  use series_flight, only: guard_t, set_branches, start_flight
  use status, only: exit_bad_case, exit_internal
  use tape_parts, only: needed
  use tape_series, only: prepare_series
  use tape_value, only: evaluate, evaluate_some
  use text, only: to_text
  implicit none
  private

  public :: build_motor_equations, foot_half_range

  character(len=*), parameter :: suffix(4) = [character(len=12) :: '', '_body_held', '_crank_held', '_both_held']

contains

  !> The equations of one law per family body, restoring, friction, contact, drive and motor. An error names the key.
  pure subroutine build_motor_equations(choices, system, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(motor_system_t), intent(out) :: system
    type(error_t), allocatable, intent(out) :: error
    integer :: at(6), i
    character(len=*), parameter :: needed(6) = [character(len=9) :: 'body', 'restoring', 'friction', 'contact', 'drive', 'motor']
    do i = 1, 6
      at(i) = number_of_family(choices, needed(i))
      if (at(i) == 0) then
        call fail(error, exit_bad_case, trim(needed(i))//'.law: missing; a machine with a motor needs it')
        return
      end if
    end do
    call refuse_laws(choices, choices(at(5)), choices(at(6)), error)
    if (allocated(error)) return
    call read_body(choices(at(1)), choices(at(2)), choices(at(3)), choices(at(4)), system)
    call refuse_forces(system, error)
    if (allocated(error)) return
    call new_sheet(system%sheet)
    call add_state(system, choices(at(6)))
    call add_mechanism(choices(at(5)), choices(at(6)), system%sheet)
    call add_motor(choices(at(6)), system%sheet, system%control)
    system%variables = system%sheet%variables
    system%no_load_speed = abs(speed_of(choices(at(6))))
    if (choices(at(6))%name == 'dc') system%own_size = max(abs(value_of(choices(at(6)), 'voltage'))/ &
                                                           value_of(choices(at(6)), 'resistance'), tiny(1.0_wp))
    call add_forces(system)
    if (choices(at(5))%name == 'unbalance') then
      call add_unbalance(choices(at(5)), system)
      if (.not. system%mass*value_of(choices(at(6)), 'inertia') > system%moment**2) then
        call fail(error, exit_bad_case, 'motor.inertia: found '//to_text(real(value_of(choices(at(6)), 'inertia'), kind(1d0)))// &
                  ' kg m^2, allowed above drive.moment^2/body.mass = '//to_text(real(system%moment**2/system%mass, kind(1d0)))// &
                  ' kg m^2: the moment of inertia of the unbalanced mass')
        return
      end if
    else
      call add_foot(system)
    end if
    call set_levels(system)
    call add_flights(system)
    if (allocated(system%sheet%error)) then
      call fail(error, exit_internal, 'equations of a motor: '//system%sheet%error%message)
    else if (system%sheet%tape%is_full) then
      call fail(error, exit_bad_case, 'drive.cosine: too many harmonics for a motor')
    end if
  end subroutine build_motor_equations

  pure subroutine read_body(body, restoring, friction, contact, system)
    type(law_choice_t), intent(in) :: body, restoring, friction, contact
    type(motor_system_t), intent(inout) :: system
    type(restoring_t) :: spring
    system%mass = value_of(body, 'mass')
    spring = restoring_of(restoring)
    system%stiffness = spring%stiffness
    if (.not. spring%is_linear) system%stiffness = -1
    system%free_length = spring%free_length
    system%friction = friction_of(friction, system%mass*value_of(body, 'gravity'))
    system%contact = contact_of(contact, system%mass)
  end subroutine read_body

  !> Laws of forces that have no equations here yet.
  pure subroutine refuse_forces(system, error)
    type(motor_system_t), intent(in) :: system
    type(error_t), allocatable, intent(out) :: error
    associate (delta => system%friction%stribeck_exponent)
      if (system%stiffness < 0) then
        call fail(error, exit_bad_case, 'restoring.law: found "pendulum", allowed with a motor: linear, none')
      else if (system%contact%soft .or. system%contact%kind /= contact_constant) then
        call fail(error, exit_bad_case, 'contact.law: allowed with a motor: newton, none')
      else if (system%friction%excess > 0 .and. (abs(delta - nint(delta)) > 0 .or. delta > 8)) then
        call fail(error, exit_bad_case, 'friction.stribeck_exponent: allowed with a motor: 1, 2, ... 8')
      end if
    end associate
  end subroutine refuse_forces

  !> Variables and the parameters of body and bearing.
  pure subroutine add_state(system, motor)
    type(motor_system_t), intent(inout) :: system
    type(law_choice_t), intent(in) :: motor
    associate (sheet => system%sheet)
      call add_variable(sheet, 'phi')
      call add_variable(sheet, 'w')
      call add_variable(sheet, 'x')
      call add_variable(sheet, 'v')
      call add_parameter(sheet, 'slip', 1.0_wp)
      call add_parameter(sheet, 'turning', 1.0_wp)
      call add_parameter(sheet, 'mass', system%mass)
      call add_optional(sheet, 'stiffness', system%stiffness)
      call add_optional(sheet, 'free_length', system%free_length)
      call add_optional(sheet, 'kinetic', system%friction%kinetic)
      call add_parameter(sheet, 'excess', system%friction%excess)
      call add_parameter(sheet, 'stribeck_velocity', system%friction%stribeck_velocity)
      call add_optional(sheet, 'damping', system%friction%damping)
      call add_parameter(sheet, 'static', system%friction%break_away)
      call add_parameter(sheet, 'upper', min(system%contact%upper, far))
      call add_parameter(sheet, 'lower', max(system%contact%lower, -far))
      call add_optional(sheet, 'bearing_damping', value_of(motor, 'bearing_damping'))
      call add_optional(sheet, 'bearing_friction', value_of(motor, 'bearing_friction'))
      call add_parameter(sheet, 'bearing_static', value_of(motor, 'bearing_friction'))
    end associate
    system%rotor_inertia = value_of(motor, 'inertia')
    system%crank_level = value_of(motor, 'bearing_friction')
    system%body_level = system%friction%break_away
    system%slip = parameter_number(system%sheet, 'slip')
    system%turning = parameter_number(system%sheet, 'turning')
  end subroutine add_state

  !> Spring, friction of a slipping body, bearing.
  pure subroutine add_forces(system)
    type(motor_system_t), intent(inout) :: system
    character(len=:), allocatable :: level
    level = 'kinetic'
    if (system%friction%excess > 0) level = level//' + excess*exp(-(slip*v/stribeck_velocity)^'// &
      to_text(nint(system%friction%stribeck_exponent))//')'
    associate (sheet => system%sheet)
      call define(sheet, 'extension', 'free_length + foot - x')
      call define(sheet, 'spring', 'stiffness*extension')
      call define(sheet, 'dry', 'slip*('//level//')')
      call define(sheet, 'friction', 'dry + damping*v')
      call define(sheet, 'bearing_dry', 'turning*bearing_friction')
      call define(sheet, 'drive_torque', 'torque - bearing_damping*w - bearing_dry')
    end associate
  end subroutine add_forces

  !> A mechanism moves the foot of the spring.
  pure subroutine add_foot(system)
    type(motor_system_t), intent(inout) :: system
    integer :: i
    associate (sheet => system%sheet)
      call define(sheet, 'load', 'spring*foot_slope')
      call define(sheet, 'w_rate', '(drive_torque - load - inertia_slope*w^2/2)/inertia')
      call define(sheet, 'w_rate_body_held', 'w_rate')
      call define(sheet, 'v_rate', '(spring - friction)/mass')
      call define(sheet, 'v_rate_crank_held', 'v_rate')
      call define(sheet, 'kinetic_energy', '(inertia*w^2 + mass*v^2)/2')
      do i = 1, 4
        call define(sheet, 'body_hold'//trim(suffix(i)), 'spring')
        call define(sheet, 'crank_hold'//trim(suffix(i)), 'torque - load')
      end do
    end associate
  end subroutine add_foot

  !> A rotor on the body.
  pure subroutine add_unbalance(drive, system)
    type(law_choice_t), intent(in) :: drive
    type(motor_system_t), intent(inout) :: system
    character(len=12), parameter :: body(4) = [character(len=12) :: 'hold_turning', 'hold_turning', 'spring', 'spring']
    character(len=13), parameter :: crank(4) = [character(len=13) :: 'hold_slipping', 'torque', 'hold_slipping', 'torque']
    integer :: i
    system%moment = value_of(drive, 'moment')
    associate (sheet => system%sheet)
      call add_parameter(sheet, 'moment', system%moment)
      call define(sheet, 'cross', 'moment*sin(phi)')
      call define(sheet, 'throw', 'moment*w^2*cos(phi)')
      call define(sheet, 'on_body', 'spring - friction + throw')
      call define(sheet, 'common', 'mass*inertia - cross^2')
      call define(sheet, 'v_rate', '(inertia*on_body + cross*drive_torque)/common')
      call define(sheet, 'w_rate', '(mass*drive_torque + cross*on_body)/common')
      call define(sheet, 'w_rate_body_held', 'drive_torque/inertia')
      call define(sheet, 'v_rate_crank_held', '(spring - friction)/mass')
      call define(sheet, 'load', '-cross*v_rate')
      call define(sheet, 'kinetic_energy', '(inertia*w^2 + mass*v^2)/2 - cross*w*v')
      call define(sheet, 'hold_turning', 'spring + throw + cross*w_rate_body_held')
      call define(sheet, 'hold_slipping', 'torque + cross*v_rate_crank_held')
      do i = 1, 4
        call define(sheet, 'body_hold'//trim(suffix(i)), trim(body(i)))
        call define(sheet, 'crank_hold'//trim(suffix(i)), trim(crank(i)))
      end do
    end associate
  end subroutine add_unbalance

  !> What holds body and crank is no less than what rounding does to the forces.
  pure subroutine set_levels(system)
    type(motor_system_t), intent(inout) :: system
    real(wp), parameter :: share = 256*epsilon(1.0_wp)
    real(wp) :: value(system%sheet%tape%count), force
    integer :: fault(system%sheet%tape%count)
    call evaluate(system%sheet%tape, at_angle(system, 0.0_wp), system%sheet%parameters, value, fault)
    associate (sheet => system%sheet, half_range => foot_half_range(system))
      force = system%stiffness*(system%free_length + abs(value(node_of(sheet, 'foot'))) + half_range) &
              + system%moment*system%no_load_speed**2
      system%body_level = max(system%body_level, share*force)
      system%crank_level = max(system%crank_level, share*(abs(value(node_of(sheet, 'torque'))) + force*half_range))
      sheet%parameters(parameter_number(sheet, 'static')) = system%body_level
      sheet%parameters(parameter_number(sheet, 'bearing_static')) = system%crank_level
    end associate
  end subroutine set_levels

  !> The motions of all modes.
  pure subroutine add_flights(system)
    type(motor_system_t), intent(inout) :: system
    type(guard_t) :: guards(guard_count)
    integer :: mode, kept, zero
    integer :: rates(system%variables), powers(3)
    associate (sheet => system%sheet)
      call define(sheet, 'zero', '0')
      zero = node_of(sheet, 'zero')
      call define(sheet, 'work', 'torque*w')
      call define(sheet, 'dry_loss', 'dry*v + bearing_dry*w')
      call define(sheet, 'viscous_loss', 'damping*v^2 + bearing_damping*w^2')
      powers = node_of(sheet, [character(len=12) :: 'work', 'dry_loss', 'viscous_loss'])
      call define(sheet, 'energy', 'kinetic_energy + spring*extension/2')
      system%torque = node_of(sheet, 'torque')
      system%kinetic = node_of(sheet, 'kinetic_energy')
      system%load = node_of(sheet, 'load')
      system%foot = node_of(sheet, 'foot')
      system%energy = node_of(sheet, 'energy')
      system%foot_slope = node_of(sheet, 'foot_slope')
      system%inertia = node_of(sheet, 'inertia')
      system%inertia_slope = node_of(sheet, 'inertia_slope')
      system%current = node_of(sheet, 'current')
      do mode = 1, 4
        call add_guards(mode, system, guards)
        system%body_hold(mode) = node_of(sheet, 'body_hold'//trim(suffix(mode)))
        system%crank_hold(mode) = node_of(sheet, 'crank_hold'//trim(suffix(mode)))
        rates(phi_at) = merge(zero, node_of(sheet, 'w'), mode >= crank_held)
        rates(w_at) = zero
        if (mode < crank_held) rates(w_at) = node_of(sheet, 'w_rate'//trim(suffix(mode)))
        rates(x_at) = merge(zero, node_of(sheet, 'v'), is_held(mode))
        rates(v_at) = zero
        if (.not. is_held(mode)) rates(v_at) = node_of(sheet, 'v_rate'//trim(suffix(mode)))
        if (system%control%has_own) rates(y_at) = node_of(sheet, 'y_rate')
        if (system%control%supply > 0) rates(system%control%supply) = node_of(sheet, 'ramp_rate')
        ! Nothing holds what moves.
        if (.not. is_held(mode)) guards([guard_body_up, guard_body_down])%node = zero
        if (mode < crank_held) guards([guard_crank_up, guard_crank_down])%node = zero
        call prepare_series(sheet%tape, low_order, rates, [guards%node, system%torque, system%load, system%foot, system%inertia], &
                            [integer ::], system%low(mode), only_used=.true.)
        do kept = 0, 1
          call start_flight(system%flights(mode, kept), sheet%tape, [rates, powers(:3*kept)], guards, sheet%parameters)
          call set_branches(system%flights(mode, kept), [integer ::])
        end do
      end do
    end associate
  end subroutine add_flights

  pure logical function is_held(mode)
    integer, intent(in) :: mode
    is_held = mode == body_held .or. mode == both_held
  end function is_held

  !> Guards of a mode; their directions are set when it begins.
  pure subroutine add_guards(mode, system, guards)
    integer, intent(in) :: mode
    type(motor_system_t), intent(inout) :: system
    type(guard_t), intent(out) :: guards(guard_count)
    character(len=:), allocatable :: text(:)
    character(len=:), allocatable :: name
    integer :: i, node
    text = [character(len=40) :: 'x - upper', 'x - lower', 'v', 'w', 'phi - 2*pi', 'phi', &
            'body_hold'//trim(suffix(mode))//' - static', 'body_hold'//trim(suffix(mode))//' + static', &
            'crank_hold'//trim(suffix(mode))//' - bearing_static', 'crank_hold'//trim(suffix(mode))//' + bearing_static', &
            'v_rate'//trim(merge(suffix(crank_held), suffix(both_move), mode == crank_held))]
    do i = 1, guard_fastest
      name = 'guard'//to_text(i)//trim(suffix(mode))
      call read_node(system%sheet, name, trim(text(i)), node)
      guards(i) = guard_t(node, 0)
    end do
    guards(guard_ramp_end:) = [(guard_t(node_of(system%sheet, control_guards(i)), 0), i=1, size(control_guards))]
  end subroutine add_guards

  !> All at rest with the crank at an angle [rad], after a ramp.
  pure function at_angle(system, phi) result(z)
    type(motor_system_t), intent(in) :: system
    real(wp), intent(in) :: phi
    real(wp) :: z(system%variables)
    z = 0
    z(phi_at) = phi
    if (system%control%supply > 0) z(system%control%supply) = system%control%to
  end function at_angle

  !> Half the range of the foot over a turn [m].
  pure real(wp) function foot_half_range(system) result(size_of)
    type(motor_system_t), intent(in) :: system
    integer, parameter :: angles = 32
    real(wp) :: value(system%sheet%tape%count), foot(angles)
    integer :: fault(system%sheet%tape%count), node, i
    integer, allocatable :: used(:)
    node = node_of(system%sheet, 'foot')
    used = pack([(i, i=1, system%sheet%tape%count)], needed(system%sheet%tape, [node]))
    do i = 1, angles
      call evaluate_some(system%sheet%tape, used, at_angle(system, i*two_pi/angles), system%sheet%parameters, value, fault, &
                         [integer ::])
      foot(i) = value(node)
    end do
    size_of = (maxval(foot) - minval(foot))/2
  end function foot_half_range

end module motor_equations
