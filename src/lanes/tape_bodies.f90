! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The bodies that fly in lanes of tapes: with a motor, and of equations by expressions.
module tape_bodies
  use constants, only: two_pi
  use equation_sheet, only: node_of
  use kinds, only: wp
  use lane_types, only: lane_flow_t
  use motor_system, only: body_held, both_move, motor_system_t
  use operations, only: op_parameter, op_select, op_variable
  use tape_parts, only: needed
  use tape_body, only: far, tape_body_t
  use tape_preparation, only: prepare_tape_lanes
  use tape_value, only: evaluate
  implicit none
  private

  public :: prepare_motor_lanes, prepare_own_lanes

contains

  !> `flow%available` if a body with a motor can fly in lanes; `length` [m] is the size of its motion.
  pure subroutine prepare_motor_lanes(system, length, flow)
    type(motor_system_t), intent(in) :: system
    real(wp), intent(in) :: length
    type(lane_flow_t), intent(inout) :: flow
    type(tape_body_t) :: body
    flow%available = .false.
    ! Where the equations of a motor change on the way, the event loop goes on.
    if (system%control%supply > 0 .or. system%control%torque_limit > 0 .or. system%control%curve%count > 0) return
    call set_equations(system, body)
    body%parameters(system%turning) = 1
    body%sizes = [6.28_wp, system%no_load_speed, length, length*system%no_load_speed, system%own_size]
    body%sizes = body%sizes(:system%variables)
    body%time = 1/system%no_load_speed
    body%level = system%body_level
    body%friction = system%friction%kinetic + system%friction%excess
    body%damping = system%friction%damping
    body%stiffness = system%stiffness
    body%length = length + abs(system%free_length)
    if (system%moment > 0) then
      body%throws = node_of(system%sheet, 'cross')
      body%throw_factor = 1/system%rotor_inertia
    end if
    call prepare_tape_lanes(body, flow)
  end subroutine prepare_motor_lanes

  !> The same of a body by expressions; `scales` are the sizes of position, velocity and states, `period` [s] is that of its
  !> section, `domain` [m] is the farthest position.
  pure subroutine prepare_own_lanes(system, scales, period, domain, flow)
    type(motor_system_t), intent(in) :: system
    real(wp), intent(in) :: scales(:), period, domain
    type(lane_flow_t), intent(inout) :: flow
    type(tape_body_t) :: body
    ! Shortest rest of a chatter sequence that is not completed, as a part of the period.
    real(wp), parameter :: rest = 1.01e-2_wp
    logical :: slides, turns
    call set_equations(system, body)
    body%clock = .true.
    body%goes_on = system%aperiodic
    body%period = period
    body%domain = domain
    if (system%period > 0) body%phase_speed = two_pi/system%period
    body%sizes = [period, two_pi, scales]
    body%time = period/two_pi
    body%level = system%body_level
    body%held_by = node_of(system%sheet, 'static')
    body%bounce = system%restitution
    body%longest_rest = rest*merge(system%period, 1.0_wp, system%period > 0)
    body%length = scales(1)
    call look_at_slip(body, slides, turns)
    body%proves = slides .or. min(-body%lower, body%upper) < far
    body%turns_freely = system%period > 0 .and. .not. (body%proves .or. turns)
    body%passes = system%period > 0
    ! An angle is taken back by whole turns at every section.
    if (body%passes) body%passes = .not. system%turn > 0 .and. repeats(system, body)
    call prepare_tape_lanes(body, flow)
  end subroutine prepare_own_lanes

  !> Whether rates depend on the direction of slip, as dry friction does, or on the sign of the velocity.
  pure subroutine look_at_slip(body, slides, turns)
    type(tape_body_t), intent(in) :: body
    logical, intent(out) :: slides, turns
    logical :: is_used(body%tape%count)
    integer :: i
    is_used = needed(body%tape, body%rates)
    slides = .false.
    turns = .false.
    do i = 1, body%tape%count
      associate (node => body%tape%nodes(i))
        if (node%operation == op_parameter .and. node%first == body%slip) slides = slides .or. is_used(i)
        if (node%operation /= op_select .or. .not. is_used(i)) cycle
        associate (decider => body%tape%nodes(body%tape%switches(node%first)%argument))
          turns = turns .or. (decider%operation == op_variable .and. decider%first == body%velocity)
        end associate
      end associate
    end do
  end subroutine look_at_slip

  !> Whether the rates are the same a period later, without the clock being set back.
  pure logical function repeats(system, body)
    type(motor_system_t), intent(in) :: system
    type(tape_body_t), intent(in) :: body
    real(wp) :: z(system%variables), now(body%tape%count), later(body%tape%count)
    integer :: fault(body%tape%count), i, k
    integer, parameter :: points = 24
    real(wp), parameter :: same = 1e-9_wp, steps(10) = [(modulo(k*0.618_wp, 1.0_wp) - 0.45_wp, k=1, 10)]
    repeats = .true.
    do i = 1, points
      z(:2) = [body%period, two_pi]*(i - 0.3_wp)/points
      z(3:) = [(body%sizes(k)*steps(1 + modulo(i + k, 10)), k=3, system%variables)]
      call evaluate(body%tape, z, body%parameters, now, fault)
      z(:2) = z(:2) + [body%period, two_pi]
      call evaluate(body%tape, z, body%parameters, later, fault)
      repeats = repeats .and. all(abs(now(body%rates) - later(body%rates)) <= same*abs(now(body%rates)))
    end do
  end function repeats

  !> What both have.
  pure subroutine set_equations(system, body)
    type(motor_system_t), intent(in) :: system
    type(tape_body_t), intent(inout) :: body
    body%tape = system%flights(both_move, 0)%tape
    body%rates = system%flights(both_move, 0)%rates
    body%parameters = system%sheet%parameters
    body%hold = system%body_hold(body_held)
    body%slip = system%slip
    body%mass = system%mass
    body%upper = min(far, system%contact%upper)
    body%lower = max(-far, system%contact%lower)
    body%restitution = system%contact%restitution
  end subroutine set_equations

end module tape_bodies
