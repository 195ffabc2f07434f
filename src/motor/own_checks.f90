! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What must hold of equations by expressions before they move, and the size of their forces.
module own_checks
  use constants, only: two_pi
  use equation_sheet, only: add_parameter, node_of, parameter_number
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: force_family, law_choice_t, own_law, path_of, state_family
  use law_texts, only: is_own
  use motor_system, only: far, motor_system_t, phi_at, v_at, w_at, x_at
  use own_names, only: depends_on
  use status, only: exit_bad_case
  use tape_turns, only: growth_over_a_turn
  use tape_value, only: evaluate
  use text, only: to_text
  implicit none
  private

  public :: check_period, check_values, set_scales, set_turn

  !> Points of a period at which forces are looked at; share of its size by which a periodic one may differ by rounding.
  integer, parameter :: points = 24
  real(wp), parameter :: same = 1e-9_wp

contains

  !> The force below which rounding moves a body from rest: a share of the forces at the origin.
  pure subroutine set_scales(system)
    type(motor_system_t), intent(inout) :: system
    real(wp), parameter :: share = 256*epsilon(1.0_wp)
    real(wp) :: z(system%variables), value(system%sheet%tape%count), largest
    integer :: fault(system%sheet%tape%count), i
    largest = 0
    do i = 0, points - 1
      z = 0
      z(:w_at) = [merge(system%period, 1.0_wp, system%period > 0), two_pi]*i/points
      call evaluate(system%sheet%tape, z, system%sheet%parameters, value, fault)
      largest = max(largest, sum(abs(value(system%forces))) + abs(value(system%rest_friction)))
    end do
    system%body_level = share*largest
    system%sheet%parameters(parameter_number(system%sheet, 'least')) = share*largest
  end subroutine set_scales

  !> An angle is on a circle if nothing changes with a whole turn and no stop is in the way.
  pure subroutine set_turn(system)
    type(motor_system_t), intent(inout) :: system
    real(wp) :: z(system%variables), value(system%sheet%tape%count)
    integer :: fault(system%sheet%tape%count), i
    if (system%contact%upper < far .or. system%contact%lower > -far) return
    z = 0
    associate (sheet => system%sheet)
      call evaluate(sheet%tape, z, sheet%parameters, value, fault)
      associate (growth => growth_over_a_turn(sheet%tape, x_at, value), &
                 nodes => [node_of(sheet, [character(len=6) :: 'v_rate', 'hold', 'static', 'foot']), &
                           (node_of(sheet, 'rate '//to_text(i)), i=1, system%variables - v_at)])
        if (any(abs(growth(nodes)) > 0)) return
      end associate
      system%turn = two_pi
      call add_parameter(sheet, 'half_turn', system%turn/2)
    end associate
  end subroutine set_turn

  !> Friction and restitution that depend on parameters alone.
  pure subroutine check_values(choices, at, system, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at(5)
    type(motor_system_t), intent(in) :: system
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: z(system%variables), value(system%sheet%tape%count)
    integer :: fault(system%sheet%tape%count)
    z = 0
    call evaluate(system%sheet%tape, z, system%sheet%parameters, value, fault)
    associate (nodes => system%sheet%tape%nodes, rest => system%rest_friction, restitution => system%restitution)
      if (choices(at(3))%name == own_law .and. nodes(rest)%is_steady) then
        if (fault(rest) > 0 .or. value(rest) < 0) call fail(error, exit_bad_case, 'friction.force: found '// &
          shown(value(rest))//' N at rest, allowed at least 0: friction acts against the motion')
      end if
      if (choices(at(3))%name /= own_law .and. is_own(choices(at(3)))) then
        associate (load => node_of(system%sheet, 'given_load'))
          if (nodes(load)%is_steady .and. (fault(load) > 0 .or. value(load) < 0)) call fail(error, exit_bad_case, &
            'friction.load: found '//shown(value(load))//' N, allowed at least 0')
        end associate
      end if
      if (restitution == 0 .or. allocated(error)) return
      if (fault(restitution) > 0 .or. abs(value(restitution) - 0.5_wp) > 0.5_wp) then
        if (nodes(restitution)%is_steady) call fail(error, exit_bad_case, 'contact.restitution: found '// &
          shown(value(restitution))//', allowed from 0 to 1')
      end if
    end associate
  end subroutine check_values

  !> What depends on the time repeats with the period of the drive, if that is stated.
  pure subroutine check_period(choices, system, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(motor_system_t), intent(in) :: system
    type(error_t), allocatable, intent(out) :: error
    integer :: i, force, state, node
    logical :: depends(system%sheet%tape%count)
    if (.not. system%period > 0) return
    depends = depends_on(system%sheet%tape, phi_at)
    force = 0
    state = 0
    do i = 1, size(choices)
      if (.not. is_own(choices(i))) cycle
      node = 0
      select case (choices(i)%family)
      case ('restoring', force_family)
        force = force + 1
        node = node_of(system%sheet, 'force'//to_text(force))
      case (state_family)
        state = state + 1
        node = node_of(system%sheet, 'rate '//to_text(state))
      case ('friction')
        node = node_of(system%sheet, 'resistance')
      case ('drive')
        node = system%foot
      case ('contact')
        node = system%restitution
      end select
      if (.not. depends(node)) cycle
      if (repeats(system, node)) cycle
      call fail(error, exit_bad_case, path_of(choices(i))//'.'//trim(choices(i)%texts(1)%key)//': found a function of t that '// &
                'does not repeat after drive.period = '//shown(system%period)//' s, allowed one that does, or no period')
      return
    end do
  end subroutine check_period

  !> Whether a node has the same values a period later, at some positions, velocities and states.
  pure logical function repeats(system, node)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: node
    real(wp) :: z(system%variables), now(system%sheet%tape%count), later(system%sheet%tape%count), largest, change
    integer :: fault(system%sheet%tape%count), fault_later(system%sheet%tape%count), i
    largest = 0
    change = 0
    do i = 0, points - 1
      z = 0
      z(x_at:) = modulo(i*0.618_wp, 1.0_wp) - 0.5_wp
      z(:w_at) = [system%period, two_pi]*(i + 0.318_wp)/points
      call evaluate(system%sheet%tape, z, system%sheet%parameters, now, fault)
      z(phi_at) = z(phi_at) + system%period
      call evaluate(system%sheet%tape, z, system%sheet%parameters, later, fault_later)
      if (max(fault(node), fault_later(node)) > 0) cycle
      largest = max(largest, abs(now(node)), abs(later(node)))
      change = max(change, abs(now(node) - later(node)))
    end do
    repeats = change <= same*largest
  end function repeats

  pure function shown(value) result(text)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: text
    text = to_text(real(value, kind(1d0)))
  end function shown

end module own_checks
