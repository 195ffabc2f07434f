! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body whose equations are a tape, made ready to fly in lanes: the tape as a list of instructions, and boxes of its variables
!> with the longest step for which the remainder is proven there.
module tape_preparation
  use elementary, only: exponential, logarithm
  use intervals, only: interval_t
  use kinds, only: wp
  use lane_types, only: lane_flow_t
  use motor_system, only: body_held, both_move, motor_system_t
  use equation_sheet, only: node_of
  use operations, only: op_add, op_constant, op_cos, op_divide, op_exp, op_log, op_multiply, op_negative, op_parameter, &
    op_sin, op_sqrt, op_square, op_subtract, op_variable, operation_table
  use tape, only: node_t, tape_t
  use tape_bounds, only: bound_coefficients
  use tape_lane_types, only: lane_node_t, lane_tape_order, most_tape_nodes, most_tape_series, most_tape_variables, &
    op_divide_steady, op_scale, op_slip, tape_levels, tape_machine_t, tape_speeds
  use tape_parts, only: needed
  use tape_series, only: prepare_series, series_t
  implicit none
  private

  public :: prepare_motor_lanes, prepare_tape_lanes

  !> From box to box: of the speed of the phase, of the other variables; share of a box that a remainder may have; last term of a
  !> step, as a share of the state.
  real(wp), parameter :: speed_growth = 1.3_wp, level_growth = 1.5_wp, margin = 1e-8_wp, &
    tolerance = 1e-12_wp
  !> Stops that are not there [m].
  real(wp), parameter :: far = 1e30_wp

  !> A moving body with its equations while it slips and the phase advances. The variables are the phase [rad], its speed, position
  !> and velocity, and further states.
  type, public :: tape_body_t
    type(tape_t) :: tape
    real(wp), allocatable :: parameters(:)
    !> Nodes of the rates of the variables, of the force that acts on the body at rest, and of what an impact throws the speed of
    !> the phase by per change of velocity (0: nothing).
    integer, allocatable :: rates(:)
    integer :: hold = 0, throws = 0
    !> Number of the parameter that is the sign of slip.
    integer :: slip = 0
    !> Sizes of the variables, and a time [s].
    real(wp), allocatable :: sizes(:)
    real(wp) :: time = 1
    !> Stops [m], restitution, what friction holds [N], and what bounds the end of a chatter sequence.
    real(wp) :: upper = far, lower = -far, restitution = 0, level = 0, friction = 0, damping = 0, stiffness = 0, mass = 1, &
      length = 1, throw_factor = 0
  end type tape_body_t

contains

  !> `flow%available` if a body with a motor can fly in lanes; `length` [m] is the size of its motion.
  pure subroutine prepare_motor_lanes(system, length, flow)
    type(motor_system_t), intent(in) :: system
    real(wp), intent(in) :: length
    type(lane_flow_t), intent(inout) :: flow
    type(tape_body_t) :: body
    flow%available = .false.
    ! Without a motor, and where the equations of a motor change on the way, the event loop goes on.
    if (system%clock .or. system%control%supply > 0 .or. system%control%torque_limit > 0 .or. system%control%curve%count > 0) return
    associate (flight => system%flights(both_move, 0))
      body%tape = flight%tape
      body%parameters = system%sheet%parameters
      body%rates = flight%rates
    end associate
    body%hold = system%body_hold(body_held)
    body%slip = system%slip
    body%parameters(system%turning) = 1
    body%sizes = [6.28_wp, system%no_load_speed, length, length*system%no_load_speed, system%own_size]
    body%sizes = body%sizes(:system%variables)
    body%time = 1/system%no_load_speed
    body%upper = min(far, system%contact%upper)
    body%lower = max(-far, system%contact%lower)
    body%restitution = system%contact%restitution
    body%level = system%body_level
    body%friction = system%friction%kinetic + system%friction%excess
    body%damping = system%friction%damping
    body%stiffness = system%stiffness
    body%mass = system%mass
    body%length = length + abs(system%free_length)
    if (system%moment > 0) then
      body%throws = node_of(system%sheet, 'cross')
      body%throw_factor = 1/system%rotor_inertia
    end if
    call prepare_tape_lanes(body, flow)
  end subroutine prepare_motor_lanes

  !> The same of any body with a tape.
  pure subroutine prepare_tape_lanes(body, flow)
    type(tape_body_t), intent(in) :: body
    type(lane_flow_t), intent(inout) :: flow
    logical :: is_used(body%tape%count)
    flow%available = .false.
    if (size(body%rates) > most_tape_variables .or. size(body%tape%switches) > 0) return
    is_used = needed(body%tape, [body%rates, body%hold, pack([body%throws], [body%throws > 0])], [integer ::])
    where (body%tape%nodes(:body%tape%count)%operation == op_variable) is_used = .true.
    if (count(is_used) > most_tape_nodes) return
    allocate (flow%tape)
    call set_constants(body, flow%tape)
    call set_nodes(body, is_used, flow%tape, flow%available)
    if (flow%available) call set_boxes(body, flow%tape, flow%available)
    if (flow%available) flow%resumes = .true.
    if (.not. flow%available) deallocate (flow%tape)
  end subroutine prepare_tape_lanes

  pure subroutine set_constants(body, machine)
    type(tape_body_t), intent(in) :: body
    type(tape_machine_t), intent(inout) :: machine
    machine%variables = size(body%rates)
    machine%unit = scale(1.0_wp, exponent(body%time))
    machine%tolerance = tolerance
    machine%sizes(:size(body%sizes)) = body%sizes
    machine%upper = body%upper
    machine%lower = body%lower
    machine%restitution = body%restitution
    machine%hold_level = body%level
    machine%friction = body%friction
    machine%damping = body%damping
    machine%stiffness = body%stiffness
    machine%mass = body%mass
    machine%length = body%length
    machine%throw_factor = body%throw_factor
  end subroutine set_constants

  !> The instructions, and room for the series that later orders need; the variables have the first. `fits` is false for
  !> operations that lanes do not know, and for more series than they have room for.
  pure subroutine set_nodes(body, is_used, machine, fits)
    type(tape_body_t), intent(in) :: body
    logical, intent(in) :: is_used(:)
    type(tape_machine_t), intent(inout) :: machine
    logical, intent(out) :: fits
    integer :: number(0:body%tape%count), series(body%tape%count), slopes(body%tape%count), i, kept
    number = 0
    series = -1
    slopes = -1
    kept = size(body%rates)
    call number_nodes(body, is_used, number(1:), machine)
    do i = 1, body%tape%count
      if (body%tape%nodes(i)%operation == op_variable) series(i) = body%tape%nodes(i)%first - 1
    end do
    do i = 1, body%tape%count
      if (is_used(i)) call keep_series(body%tape, i, series, slopes, kept)
    end do
    if (series(body%hold) < 0) call keep(series(body%hold), kept)
    if (body%throws > 0) then
      if (series(body%throws) < 0) call keep(series(body%throws), kept)
      machine%throws = series(body%throws)
    end if
    machine%hold = series(body%hold)
    machine%rate(:size(body%rates)) = number(body%rates)
    fits = kept <= most_tape_series
    do i = 1, body%tape%count
      if (is_used(i) .and. fits) call set_node(body, i, number, series, slopes, machine%node(number(i) + 1), fits)
    end do
  end subroutine set_nodes

  !> Numbers come first, then what depends on the sign of slip alone, then what varies in time.
  pure subroutine number_nodes(body, is_used, number, machine)
    type(tape_body_t), intent(in) :: body
    logical, intent(in) :: is_used(:)
    integer, intent(inout) :: number(:)
    type(tape_machine_t), intent(inout) :: machine
    integer :: kind(body%tape%count), i, k, arguments
    kind = 2
    do i = 1, body%tape%count
      associate (node => body%tape%nodes(i))
        if (.not. node%is_steady) cycle
        kind(i) = 0
        if (node%operation == op_parameter .and. node%first == body%slip) kind(i) = 1
        arguments = operation_table(node%operation)%arguments
        if (arguments > 0) kind(i) = max(kind(i), kind(node%first))
        if (arguments > 1) kind(i) = max(kind(i), kind(node%second))
      end associate
    end do
    machine%nodes = 0
    do k = 0, 2
      if (k == 1) machine%by_slip = machine%nodes
      if (k == 2) machine%varying = machine%nodes
      do i = 1, body%tape%count
        if (.not. is_used(i) .or. kind(i) /= k) cycle
        number(i) = machine%nodes
        machine%nodes = machine%nodes + 1
      end do
    end do
  end subroutine number_nodes

  pure subroutine keep(series, kept)
    integer, intent(inout) :: series
    integer, intent(inout) :: kept
    if (series >= 0) return
    series = kept
    kept = kept + 1
  end subroutine keep

  !> Numbers the series that the coefficients of a node are made from.
  pure subroutine keep_series(tape, i, series, slopes, kept)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i
    integer, intent(inout) :: series(:), slopes(:), kept
    associate (node => tape%nodes(i))
      if (node%is_steady) return
      select case (node%operation)
      case (op_multiply)
        if (tape%nodes(node%first)%is_steady .or. tape%nodes(node%second)%is_steady) return
        call keep(series(node%first), kept)
        call keep(series(node%second), kept)
      case (op_square)
        call keep(series(node%first), kept)
      case (op_divide)
        if (tape%nodes(node%second)%is_steady) return
        call keep(series(i), kept)
        call keep(series(node%second), kept)
      case (op_sqrt)
        call keep(series(i), kept)
      case (op_exp)
        call keep(series(i), kept)
        call keep(slopes(node%first), kept)
      case (op_sin, op_cos)
        call keep(series(node%partner), kept)
        call keep(slopes(node%first), kept)
      case (op_log)
        call keep(slopes(i), kept)
        call keep(series(node%first), kept)
      end select
    end associate
  end subroutine keep_series

  !> One instruction.
  pure subroutine set_node(body, i, number, series, slopes, made, fits)
    type(tape_body_t), intent(in) :: body
    integer, intent(in) :: i, number(0:), series(:), slopes(:)
    type(lane_node_t), intent(out) :: made
    logical, intent(inout) :: fits
    type(node_t) :: node
    node = body%tape%nodes(i)
    made%operation = node%operation
    made%value = node%value
    made%series = series(i)
    made%slopes = slopes(i)
    select case (node%operation)
    case (op_constant)
      return
    case (op_variable)
      made%first = node%first - 1
      return
    case (op_parameter)
      made%value = body%parameters(node%first)
      if (node%first == body%slip) made%operation = op_slip
      return
    case (op_add, op_subtract, op_multiply, op_divide, op_negative, op_square, op_sqrt, op_exp, op_log, op_sin, op_cos)
      made%first = number(node%first)
      made%first_series = series(node%first)
    case default
      fits = .false.
      return
    end select
    select case (node%operation)
    case (op_add, op_subtract, op_multiply, op_divide)
      made%second = number(node%second)
      made%second_series = series(node%second)
    case (op_exp)
      made%first_series = slopes(node%first)
      made%second_series = series(i)
    case (op_sin, op_cos)
      made%first_series = slopes(node%first)
      made%second_series = series(node%partner)
    case (op_log)
      made%second_series = series(node%first)
    end select
    if (node%is_steady) return
    if (node%operation == op_multiply) call put_steady_first(body%tape, node, made)
    if (node%operation == op_divide) then
      if (body%tape%nodes(node%second)%is_steady) made%operation = op_divide_steady
    end if
  end subroutine set_node

  !> A factor that does not vary comes first.
  pure subroutine put_steady_first(tape, node, made)
    type(tape_t), intent(in) :: tape
    type(node_t), intent(in) :: node
    type(lane_node_t), intent(inout) :: made
    integer :: other
    if (tape%nodes(node%second)%is_steady) then
      other = made%first
      made%first = made%second
      made%second = other
    else if (.not. tape%nodes(node%first)%is_steady) then
      return
    end if
    made%operation = op_scale
  end subroutine put_steady_first

  !> Boxes of every speed of the phase at every level of the other variables, and the longest step with a proven remainder in
  !> each; 0 where none is proven. Without the smallest none `fits`.
  pure subroutine set_boxes(body, machine, fits)
    type(tape_body_t), intent(in) :: body
    type(tape_machine_t), intent(inout) :: machine
    logical, intent(out) :: fits
    real(wp) :: half(size(body%rates)), rates(size(body%rates)), least
    integer :: level, speed, i, n, box
    logical :: is_bounded
    n = size(body%rates)
    machine%box(:n) = body%sizes
    machine%speed = [(speed_growth**i, i=1, tape_speeds)]
    machine%level_size = [(2*level_growth**i, i=0, tape_levels - 1)]
    do speed = 1, tape_speeds
      do level = 1, tape_levels
        box = (speed - 1)*tape_levels + level
        half = body%sizes*machine%level_size(level)
        half(2) = body%sizes(2)*machine%speed(speed)
        call bound_rates(body, half, machine%unit, rates, is_bounded)
        machine%longest(box) = 0
        if (.not. is_bounded) cycle
        least = 1e30_wp
        do i = 1, n
          if (rates(i) > 0) least = min(least, margin*half(i)/rates(i))
        end do
        machine%longest(box) = exponential(logarithm(least)/(lane_tape_order + 1))
        machine%remainder(:n, box) = rates*least
      end do
    end do
    fits = machine%longest(1) > 0
  end subroutine set_boxes

  !> Bounds of the first coefficients that the series leave out, in a unit of time, all over a box of half widths `half`.
  pure subroutine bound_rates(body, half, unit, rates, is_bounded)
    type(tape_body_t), intent(in) :: body
    real(wp), intent(in) :: half(:), unit
    real(wp), intent(out) :: rates(:)
    logical, intent(out) :: is_bounded
    type(interval_t) :: box(size(half))
    type(series_t) :: series
    real(wp) :: parameters(size(body%parameters))
    integer :: slip, fault
    real(wp), parameter :: turns = 12.6_wp, above = 1.01_wp
    box%low = -half
    box%high = half
    ! Any angle.
    box(1) = interval_t(-turns, turns)
    rates = 0
    is_bounded = .false.
    parameters = body%parameters
    call prepare_series(body%tape, lane_tape_order, body%rates, [integer ::], [integer ::], series)
    series%unit = unit
    do slip = -1, 1, 2
      if (body%slip > 0) parameters(body%slip) = slip
      call bound_coefficients(body%tape, box, parameters, series, fault)
      if (fault /= 0) return
      rates = max(rates, above*unit*series%c(lane_tape_order, body%rates)/(lane_tape_order + 1))
    end do
    is_bounded = .true.
  end subroutine bound_rates

end module tape_preparation
