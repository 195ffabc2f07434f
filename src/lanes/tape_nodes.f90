! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The operations of a tape as instructions of lanes.
module tape_nodes
  use operations, only: op_add, op_atan, op_constant, op_cos, op_cosh, op_divide, op_exp, op_log, op_multiply, op_negative, &
    op_parameter, op_power, op_select, op_sin, op_sinh, op_sqrt, op_square, op_subtract, op_tan, op_tanh, op_variable, &
    operation_table
  use tape, only: node_t, tape_t
  use tape_body, only: tape_body_t
  use tape_lane_types, only: lane_check_t, lane_node_t, lane_term_t, most_tape_checks, most_tape_series, most_tape_switches, &
    op_cos_even, op_divide_steady, op_scale, op_select_slip, op_sin_even, op_slip, op_sum, tape_machine_t
  use tape_sums, only: tape_sum_t
  use, intrinsic :: iso_c_binding, only: c_int
  implicit none
  private

  public :: set_nodes

contains

  !> The instructions, and room for the series that later orders need; the variables have the first. `fits` is false for
  !> operations that lanes do not know, and for more series than they have room for.
  pure subroutine set_nodes(body, is_used, sums, sum_of, machine, fits)
    type(tape_body_t), intent(in) :: body
    logical, intent(in) :: is_used(:)
    type(tape_sum_t), intent(in) :: sums(:)
    integer, intent(in) :: sum_of(:)
    type(tape_machine_t), intent(inout) :: machine
    logical, intent(out) :: fits
    integer :: number(0:body%tape%count), series(body%tape%count), slopes(body%tape%count), i, kept, &
      switches(size(body%tape%switches))
    number = 0
    series = -1
    slopes = -1
    kept = size(body%rates)
    call number_nodes(body, is_used, number(1:), machine)
    do i = 1, body%tape%count
      if (body%tape%nodes(i)%operation == op_variable) series(i) = body%tape%nodes(i)%first - 1
    end do
    do i = 1, body%tape%count
      if (.not. is_used(i)) cycle
      call keep_series(body%tape, i, series, slopes, kept)
      if (all(body%tape%nodes(i)%operation /= [op_sin, op_cos])) cycle
      if (grows_evenly(body, body%tape%nodes(i)%first)) call keep(series(body%tape%nodes(i)%first), kept)
    end do
    call number_switches(body, is_used, switches)
    fits = maxval(switches) <= most_tape_switches
    machine%switches = max(0, maxval(switches))
    do i = 1, size(switches)
      if (switches(i) == 0 .or. .not. fits) cycle
      call keep(series(body%tape%switches(i)%argument), kept)
      machine%decider(switches(i)) = number(body%tape%switches(i)%argument)
      machine%decider_series(switches(i)) = series(body%tape%switches(i)%argument)
    end do
    if (.not. body%proves) call set_checks(body, is_used, number, series, kept, machine, fits)
    machine%hold = number(body%hold)
    machine%level = optional_number(body%held_by)
    machine%throws = optional_number(body%throws)
    machine%bounce = optional_number(body%bounce)
    machine%rate(:size(body%rates)) = number(body%rates)
    fits = fits .and. kept <= most_tape_series
    do i = 1, body%tape%count
      if (.not. (is_used(i) .and. fits)) cycle
      associate (made => machine%node(number(i) + 1))
        call set_node(body, i, number, series, slopes, switches, made, fits)
        if (made%operation == op_select_slip) machine%branches_by_slip = 1
        if (sum_of(i) > 0) call set_sum(sums(sum_of(i)), number, machine%terms, machine%term, made, fits)
      end associate
    end do

  contains

    pure integer function optional_number(node)
      integer, intent(in) :: node
      optional_number = -1
      if (node > 0) optional_number = number(node)
    end function optional_number

  end subroutine set_nodes

  !> Makes a node the sum of terms, which follow those before.
  pure subroutine set_sum(sum, number, terms, term, made, fits)
    type(tape_sum_t), intent(in) :: sum
    integer, intent(in) :: number(0:)
    integer(c_int), intent(inout) :: terms
    type(lane_term_t), intent(inout) :: term(:)
    type(lane_node_t), intent(inout) :: made
    logical, intent(inout) :: fits
    integer :: keys(size(sum%nodes)), i, at
    fits = fits .and. terms + size(sum%nodes) <= size(term)
    if (.not. fits) return
    made%operation = op_sum
    made%first = terms
    made%second = size(sum%nodes)
    made%other = -1
    if (sum%steady > 0) made%other = number(sum%steady)
    ! What an order makes last is added last, so that nothing waits for it before.
    keys = number(sum%nodes)
    do i = 1, size(sum%nodes)
      at = minloc(keys, 1)
      term(terms + i) = lane_term_t(number(sum%nodes(at)), number(sum%factors(at)))
      keys(at) = huge(keys)
    end do
    terms = terms + size(sum%nodes)
  end subroutine set_sum

  !> The nodes that may change more than their series shows: quotients, roots, powers and logarithms, whose divisor or argument may
  !> come near zero, and functions that are nearly constant far away.
  pure subroutine set_checks(body, is_used, number, series, kept, machine, fits)
    type(tape_body_t), intent(in) :: body
    logical, intent(in) :: is_used(:)
    integer, intent(in) :: number(0:)
    integer, intent(inout) :: series(:), kept
    type(tape_machine_t), intent(inout) :: machine
    logical, intent(inout) :: fits
    integer :: i, argument
    logical :: flattens
    do i = 1, body%tape%count
      associate (node => body%tape%nodes(i))
        if (.not. is_used(i) .or. node%is_steady) cycle
        flattens = any(node%operation == [op_exp, op_tanh, op_atan])
        if (.not. flattens .and. all(node%operation /= [op_divide, op_sqrt, op_power, op_log])) cycle
        argument = merge(node%second, node%first, node%operation == op_divide)
        if (body%tape%nodes(argument)%is_steady) cycle
        fits = fits .and. machine%checks < most_tape_checks
        if (.not. fits) return
        call keep(series(argument), kept)
        if (flattens) call keep(series(i), kept)
        machine%checks = machine%checks + 1
        machine%check(machine%checks) = lane_check_t(number(i), series(argument), merge(series(i), -1, flattens))
      end associate
    end do
  end subroutine set_checks

  !> Numbers the switching functions in use; one that is the velocity has the sign of slip, and no number.
  pure subroutine number_switches(body, is_used, switches)
    type(tape_body_t), intent(in) :: body
    logical, intent(in) :: is_used(:)
    integer, intent(out) :: switches(:)
    integer :: i
    switches = 0
    do i = 1, body%tape%count
      associate (node => body%tape%nodes(i))
        if (node%operation /= op_select .or. .not. is_used(i)) cycle
        if (switches(node%first) == 0 .and. .not. is_velocity(body, body%tape%switches(node%first)%argument)) then
          switches(node%first) = maxval(switches) + 1
        end if
      end associate
    end do
  end subroutine number_switches

  pure logical function is_velocity(body, node)
    type(tape_body_t), intent(in) :: body
    integer, intent(in) :: node
    is_velocity = body%tape%nodes(node)%operation == op_variable .and. body%tape%nodes(node)%first == body%velocity
  end function is_velocity

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
        if (node%operation == op_select) then
          kind(i) = max(kind(body%tape%switches(node%first)%argument), kind(node%second), kind(node%third))
          cycle
        end if
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
      case (op_sin, op_cos, op_tan, op_sinh, op_cosh, op_tanh)
        call keep(series(node%partner), kept)
        call keep(slopes(node%first), kept)
      case (op_log)
        call keep(slopes(i), kept)
        call keep(series(node%first), kept)
      case (op_atan)
        call keep(slopes(i), kept)
        call keep(series(node%partner), kept)
      case (op_power)
        call keep(series(i), kept)
        call keep(slopes(i), kept)
        call keep(series(node%first), kept)
        call keep(slopes(node%first), kept)
      end select
    end associate
  end subroutine keep_series

  !> One instruction.
  pure subroutine set_node(body, i, number, series, slopes, switches, made, fits)
    type(tape_body_t), intent(in) :: body
    integer, intent(in) :: i, number(0:), series(:), slopes(:), switches(:)
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
    case (op_parameter)
      made%value = body%parameters(node%first)
      if (node%first == body%slip) made%operation = op_slip
    case (op_select)
      made%first = number(node%second)
      made%second = number(node%third)
      made%other = number(body%tape%switches(node%first)%argument)
      made%value = switches(node%first) - 1
      if (switches(node%first) == 0) made%operation = op_select_slip
    case (op_add, op_subtract, op_multiply, op_divide, op_negative, op_square, op_sqrt, op_exp, op_log, op_sin, op_cos, op_power, &
          op_tan, op_atan, op_sinh, op_cosh, op_tanh)
      made%first = number(node%first)
      made%first_series = series(node%first)
      call set_arguments(body%tape, i, number, series, slopes, made)
      if (grows_evenly(body, node%first)) then
        if (node%operation == op_sin) made%operation = op_sin_even
        if (node%operation == op_cos) made%operation = op_cos_even
      end if
    case default
      fits = .false.
    end select
  end subroutine set_node

  !> Whether a node is a sum of what does not vary and of products of that with variables whose rates do not vary.
  pure recursive logical function grows_evenly(body, i) result(grows)
    type(tape_body_t), intent(in) :: body
    integer, intent(in) :: i
    associate (node => body%tape%nodes(i), nodes => body%tape%nodes)
      grows = node%is_steady
      if (grows) return
      select case (node%operation)
      case (op_variable)
        grows = nodes(body%rates(node%first))%is_steady
      case (op_add, op_subtract)
        grows = grows_evenly(body, node%first)
        if (grows) grows = grows_evenly(body, node%second)
      case (op_multiply)
        grows = nodes(node%first)%is_steady .or. nodes(node%second)%is_steady
        if (grows) grows = grows_evenly(body, node%first)
        if (grows) grows = grows_evenly(body, node%second)
      case (op_divide)
        grows = nodes(node%second)%is_steady
        if (grows) grows = grows_evenly(body, node%first)
      case (op_negative)
        grows = grows_evenly(body, node%first)
      end select
    end associate
  end function grows_evenly

  !> What else an operation takes.
  pure subroutine set_arguments(tape, i, number, series, slopes, made)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: i, number(0:), series(:), slopes(:)
    type(lane_node_t), intent(inout) :: made
    type(node_t) :: node
    node = tape%nodes(i)
    select case (node%operation)
    case (op_add, op_subtract, op_multiply, op_divide)
      made%second = number(node%second)
      made%second_series = series(node%second)
    case (op_exp)
      made%first_series = slopes(node%first)
      made%second_series = series(i)
    case (op_sin, op_cos, op_tan, op_sinh, op_cosh, op_tanh)
      made%first_series = slopes(node%first)
      made%second_series = series(node%partner)
    case (op_log)
      made%second_series = series(node%first)
    case (op_atan)
      made%second = number(node%partner)
      made%second_series = series(node%partner)
    case (op_power)
      made%second = number(node%second)
      made%first_series = slopes(node%first)
      made%second_series = series(node%first)
    end select
    if (node%is_steady) return
    if (node%operation == op_multiply) call put_steady_first(tape, node, made)
    if (node%operation == op_divide) then
      if (tape%nodes(node%second)%is_steady) made%operation = op_divide_steady
    end if
  end subroutine set_arguments

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

end module tape_nodes
