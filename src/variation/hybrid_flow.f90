! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Flights of a body on a tape, with a motor or by expressions, between its events, forwards or back, with their derivatives by the
!> start: Taylor series of the equations and of their variational equations on one tape. Within a flight the motor passes from piece
!> to piece and the switching functions change their branches; where the rates jump, so do the derivatives (Aizerman and
!> Gantmakher 1958).
module hybrid_flow
  use kinds, only: wp
  use motor_pieces, only: has_pieces, motor_piece_t, piece_of, set_parameters, stop_at_piece, value_of
  use motor_system, only: motor_system_t, w_at, y_at
  use motor_torque, only: motor_control_t
  use operations, only: op_add, op_constant, op_cos, op_multiply, op_negative, op_parameter, op_select, op_sin, op_square, &
    op_subtract, op_variable
  use series_flight, only: flight_t, series_order
  use switch_branches, only: choose_branches
  use tape, only: tape_t
  use tape_derivative, only: differentiate
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate
  use tape_variation, only: add_variations
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  !> Steps after which a flight is given up: a turn of a crank takes some twenty.
  integer, parameter :: most_steps = 20000
  !> Parts of a step at whose ends it is looked whether a switching function has crossed zero.
  integer, parameter :: parts = 16
  !> Points of a step at which its series is put into the equations; by how much a state may then change over the step, in sizes;
  !> how often a step is halved for that.
  integer, parameter :: looks = 4, most_halvings = 40
  real(wp), parameter :: defect = 1e-12_wp
  !> Changes of rates at a switch that are rounding, as a share of the rates.
  real(wp), parameter :: rounding = 1e-13_wp

  public :: add_slope_nodes, fly, new_flow, rates_in, slopes_in, values_in

  !> A system z' = f(z), with the derivatives of its variables from `first` on by these at the start, one column after the other.
  type, public :: hybrid_flow_t
    type(tape_t) :: tape
    !> The same without derivatives: it has the first nodes.
    type(flight_t) :: plain
    integer :: n = 0, first = 1, varied = 0
    !> Nodes of variables and of their rates.
    integer, allocatable :: states(:), rates(:)
    !> Derivatives of the switching functions by the varied variables.
    integer, allocatable :: switch_slopes(:, :)
    !> The equations change from piece to piece of a motor.
    type(motor_control_t) :: control
    !> Curves may be so narrow that a series does not show them.
    logical :: may_be_narrow = .false.
  end type hybrid_flow_t

contains

  !> The equations of a mode (`motor_equations`), with the variational equations of the variables from `first` on. `is_own`: they
  !> are expressions of a case, with curves of any width.
  pure subroutine new_flow(system, mode, first, is_own, flow)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: mode, first
    logical, intent(in) :: is_own
    type(hybrid_flow_t), intent(out) :: flow
    !> Operations of polynomials and oscillations, whose series show what is ahead.
    integer, parameter :: wide(11) = [op_constant, op_variable, op_parameter, op_add, op_subtract, op_multiply, op_negative, &
                                      op_square, op_sin, op_cos, op_select]
    integer :: k
    flow%control = system%control
    flow%first = first
    flow%plain = system%flights(mode, 0)
    flow%tape = flow%plain%tape
    flow%n = system%variables
    associate (tape => flow%plain%tape)
      flow%may_be_narrow = is_own .and. .not. all([(any(tape%nodes(k)%operation == wide), k=1, tape%count)])
    end associate
    flow%varied = flow%n - first + 1
    call add_variations(flow%tape, flow%plain%rates(:flow%n), first, flow%states, flow%rates)
    allocate (flow%switch_slopes(flow%varied, size(flow%tape%switches)))
    do k = 1, size(flow%tape%switches)
      call add_slope_nodes(flow, flow%tape%switches(k)%argument, first, flow%switch_slopes(:, k))
    end do
  end subroutine new_flow

  !> Derivatives of a node by the variables from `first` on, as nodes.
  pure subroutine add_slope_nodes(flow, node, first, slopes)
    type(hybrid_flow_t), intent(inout) :: flow
    integer, intent(in) :: node, first
    integer, intent(out) :: slopes(:)
    integer :: k
    do k = first, flow%n
      call differentiate(flow%tape, [node], flow%states(k), slopes(k - first + 1:k - first + 1))
    end do
  end subroutine add_slope_nodes

  !> Values of all nodes; those that are not defined are no number.
  pure function values_in(flow, z, parameters) result(value)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: value(flow%tape%count)
    real(wp) :: all(size(flow%states))
    integer :: fault(flow%tape%count)
    all = 0
    all(:flow%n) = z
    call evaluate(flow%tape, all, with_piece(flow, z, parameters), value, fault, branches_at(flow, z, parameters, 1))
    where (fault > 0) value = ieee_value(1.0_wp, ieee_quiet_nan)
  end function values_in

  !> Rates of the variables.
  pure function rates_in(flow, z, parameters) result(rates)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: rates(flow%n), value(flow%plain%tape%count)
    integer :: fault(flow%plain%tape%count), branches(size(flow%tape%switches))
    branches = branches_at(flow, z, parameters, 1)
    call evaluate(flow%plain%tape, z, with_piece(flow, z, parameters), value, fault, branches(:size(flow%plain%tape%switches)))
    where (fault > 0) value = ieee_value(1.0_wp, ieee_quiet_nan)
    rates = value(flow%rates(:flow%n))
  end function rates_in

  !> Derivatives of the rates of the varied variables by these.
  pure function slopes_in(flow, z, parameters) result(slopes)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: slopes(flow%varied, flow%varied), all(size(flow%states)), value(flow%tape%count)
    integer :: fault(flow%tape%count), i
    all = 0
    all(:flow%n) = z
    do i = 1, flow%varied
      all(flow%n + flow%varied*(i - 1) + i) = 1
    end do
    call evaluate(flow%tape, all, with_piece(flow, z, parameters), value, fault, branches_at(flow, z, parameters, 1))
    where (fault > 0) value = ieee_value(1.0_wp, ieee_quiet_nan)
    slopes = reshape(value(flow%rates(flow%n + 1:)), shape(slopes))
  end function slopes_in

  !> The parameters in the piece of the motor in which the variables are.
  pure function with_piece(flow, z, parameters) result(now)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: now(size(parameters))
    now = parameters
    if (has_pieces(flow%control)) call set_parameters(flow%control, piece_at(flow, z, parameters), now)
  end function with_piece

  pure type(motor_piece_t) function piece_at(flow, z, parameters) result(piece)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: value(flow%plain%tape%count)
    integer :: fault(flow%plain%tape%count)
    if (.not. has_pieces(flow%control)) return
    call evaluate(flow%plain%tape, z(:flow%n), parameters, value, fault)
    piece = piece_of(flow%control, z, value)
  end function piece_at

  !> Signs of the switching functions of a motion that leaves `z` in a direction of time, 1 or -1.
  pure function branches_at(flow, z, parameters, direction) result(branches)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    integer, intent(in) :: direction
    integer :: branches(size(flow%tape%switches)), zeros(size(flow%plain%tape%switches)), faults(flow%tape%count), own
    real(wp) :: whole(size(flow%states)), value(flow%tape%count)
    logical :: fits
    own = size(zeros)
    call choose_branches(flow%plain, z, parameters, branches(:own), zeros, fits)
    ! Back in time a zero of odd order is left to the other side.
    if (direction < 0) where (zeros > 0 .and. modulo(zeros, 2) == 1) branches(:own) = -branches(:own)
    if (size(branches) == own) return
    ! Derivatives of powers have switches of their own.
    whole = 0
    whole(:flow%n) = z
    call evaluate(flow%tape, whole, parameters, value, faults)
    branches(own + 1:) = merge(1, -1, value(flow%tape%switches(own + 1:)%argument) >= 0)
  end function branches_at

  !> Moves the variables by a `duration` [s] of either sign; `sizes` set how small an error is. With `slopes` their derivatives by
  !> the start, too. Where the equations are not defined nothing comes out that is a number.
  pure subroutine fly(flow, parameters, sizes, duration, z, slopes)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: parameters(:), sizes(:), duration
    real(wp), intent(inout) :: z(:)
    real(wp), intent(out), optional :: slopes(:, :)
    real(wp) :: all(size(flow%states)), scales(size(flow%states))
    integer :: i, n, m
    n = flow%n
    m = flow%varied
    if (.not. present(slopes)) then
      call take_steps(flow, flow%plain%tape, n, parameters, sizes, duration, z)
      return
    end if
    all = 0
    all(:n) = z
    scales(:n) = sizes
    do i = 1, m
      all(n + m*(i - 1) + i) = 1
      scales(n + m*(i - 1) + 1:n + m*i) = sizes(flow%first:)/sizes(flow%first - 1 + i)
    end do
    call take_steps(flow, flow%tape, size(all), parameters, scales, duration, all)
    z = all(:n)
    slopes = reshape(all(n + 1:), [m, m])
  end subroutine fly

  !> Steps of the series of a tape, that of a flow with or without derivatives, for its first `count` variables.
  pure subroutine take_steps(flow, tape, count, parameters, scales, duration, z)
    type(hybrid_flow_t), intent(in) :: flow
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: count
    real(wp), intent(in) :: parameters(:), scales(:), duration
    real(wp), intent(inout) :: z(:)
    type(series_t) :: series
    type(motor_piece_t) :: piece, next
    real(wp) :: left, step, whole, now(size(parameters)), before(flow%n), crossing(size(tape%switches))
    integer :: branches(size(flow%tape%switches)), fault, i, k
    logical :: crossed(size(tape%switches))
    associate (arguments => tape%switches%argument, states => flow%states(:count))
      left = duration
      now = parameters
      piece = piece_at(flow, z, now)
      if (piece%held /= 0) call hold_integral(flow, piece%held, z)
      if (.not. abs(left) > 0) return
      branches = branches_at(flow, z(:flow%n), parameters, merge(1, -1, left > 0))
      call prepare_series(tape, series_order, flow%rates(:count), arguments, branches(:size(crossed)), series)
      do i = 1, most_steps
        if (.not. abs(left) > 0) return
        call set_parameters(flow%control, piece, now)
        call expand(tape, z, now, series, fault)
        if (fault /= 0) exit
        step = sign(min(step_of(series%c(:, states), max(scales, abs(z(:count)))), abs(left)), left)
        do k = 0, most_halvings
          call stop_at_switch(series, arguments, step, crossed)
          whole = step
          call stop_at_piece(flow%control, series%c, [states(w_at), states(min(y_at, count))], step, piece, next)
          if (abs(step) < abs(whole)) crossed = .false.
          if (.not. flow%may_be_narrow) exit
          if (follows(flow, series, now, max(scales(:flow%n), abs(z(:flow%n))), step)) exit
          step = step/2
        end do
        if (k > most_halvings) exit
        do k = 1, count
          z(k) = value_of(series%c(:, states(k)), step)
        end do
        if (next%held /= piece%held .and. next%held /= 0) call hold_integral(flow, next%held, z)
        piece = next
        left = left - step
        if (.not. any(crossed)) cycle
        before = [(slope_of(series%c(:, states(k)), step), k=1, flow%n)]
        crossing = [(slope_of(series%c(:, arguments(k)), step), k=1, size(arguments))]
        where (crossed) series%branches = -series%branches
        call prepare_series(tape, series_order, flow%rates(:count), arguments, [series%branches], series)
        if (count > flow%n) call pass_switch(flow, now, before, crossed, crossing, series, z)
      end do
    end associate
    if (abs(left) > 0) z = ieee_value(1.0_wp, ieee_quiet_nan)
  end subroutine take_steps

  !> Whether a series follows the equations over a step: the last terms of the series of a narrow curve, such as that of Stribeck,
  !> may be negligible far from it, although the step reaches it.
  pure logical function follows(flow, series, parameters, scales, step)
    type(hybrid_flow_t), intent(in) :: flow
    type(series_t), intent(in) :: series
    real(wp), intent(in) :: parameters(:), scales(:), step
    real(wp) :: z(flow%n), slopes(flow%n), value(flow%plain%tape%count)
    integer :: faults(flow%plain%tape%count), i, k
    follows = .true.
    do i = looks, 1, -1
      do k = 1, flow%n
        z(k) = value_of(series%c(:, flow%states(k)), step*i/looks)
        slopes(k) = slope_of(series%c(:, flow%states(k)), step*i/looks)
      end do
      call evaluate(flow%plain%tape, z, parameters, value, faults, series%branches(:size(flow%plain%tape%switches)))
      follows = all(abs(value(flow%plain%rates(:flow%n)) - slopes)*abs(step) <= defect*scales)
      if (.not. follows) return
    end do
  end function follows

  !> The integral where it is held: nothing of what it was before is left in it.
  pure subroutine hold_integral(flow, side, z)
    type(hybrid_flow_t), intent(in) :: flow
    integer, intent(in) :: side
    real(wp), intent(inout) :: z(:)
    integer :: k
    z(y_at) = side*flow%control%largest_integral
    do k = flow%n + y_at - flow%first + 1, size(z), flow%varied
      z(k) = 0
    end do
  end subroutine hold_integral

  !> Shortens a step to where the first switching functions leave the side of their branches.
  pure subroutine stop_at_switch(series, arguments, step, crossed)
    type(series_t), intent(in) :: series
    integer, intent(in) :: arguments(:)
    real(wp), intent(inout) :: step
    logical, intent(out) :: crossed(:)
    real(wp) :: inside, beyond, middle
    integer :: i
    crossed = .false.
    do i = 1, parts
      if (.not. any(left_at(step*i/parts))) cycle
      inside = step*(i - 1)/parts
      beyond = step*i/parts
      do
        middle = (inside + beyond)/2
        if (.not. (abs(middle - inside) > 0 .and. abs(middle - beyond) > 0)) exit
        if (any(left_at(middle))) then
          beyond = middle
        else
          inside = middle
        end if
      end do
      crossed = left_at(beyond)
      step = beyond
      return
    end do

  contains

    pure function left_at(t) result(is_left)
      real(wp), intent(in) :: t
      logical :: is_left(size(arguments))
      integer :: k
      do k = 1, size(arguments)
        is_left(k) = series%is_used(arguments(k)) .and. series%branches(k)*value_of(series%c(:, arguments(k)), t) < 0
      end do
    end function left_at

  end subroutine stop_at_switch

  !> The derivatives where branches change: dz+ = dz- - (f- - f+) g_z dz-/(g_z f- + g_t). `before`: the rates f-; `crossing`: the
  !> rates of the switching functions g.
  pure subroutine pass_switch(flow, parameters, before, crossed, crossing, series, z)
    type(hybrid_flow_t), intent(in) :: flow
    real(wp), intent(in) :: parameters(:), before(:), crossing(:)
    logical, intent(in) :: crossed(:)
    type(series_t), intent(in) :: series
    real(wp), intent(inout) :: z(:)
    real(wp) :: value(flow%tape%count), jump(flow%varied), change(flow%varied, flow%varied)
    integer :: fault(flow%tape%count), k
    associate (first => flow%first, n => flow%n, m => flow%varied)
      call evaluate(flow%tape, z, parameters, value, fault, series%branches)
      jump = before(first:) - value(flow%rates(first:n))
      where (abs(jump) <= rounding*(abs(before(first:)) + abs(value(flow%rates(first:n))))) jump = 0
      if (.not. any(abs(jump) > 0)) return
      ! Two jumps at one instant: which comes first of a neighbour is not known.
      k = findloc(crossed, .true., dim=1)
      change = reshape(z(n + 1:), [m, m])
      change = change - spread(jump, 2, m)*spread(matmul(value(flow%switch_slopes(:, k)), change)/crossing(k), 1, m)
      if (count(crossed) > 1) change = ieee_value(1.0_wp, ieee_quiet_nan)
      z(n + 1:) = reshape(change, [m*m])
    end associate
  end subroutine pass_switch

  !> The step whose last two terms are rounding (Jorba & Zou 2005).
  pure real(wp) function step_of(c, scales) result(step)
    real(wp), intent(in) :: c(0:, :), scales(:)
    real(wp) :: share
    integer :: k
    step = huge(step)
    do k = ubound(c, 1) - 1, ubound(c, 1)
      share = maxval(abs(c(k, :))/scales)
      if (share > 0) step = min(step, (epsilon(1.0_wp)/4/share)**(1.0_wp/k))
    end do
  end function step_of

  !> Derivative of a series.
  pure real(wp) function slope_of(c, t) result(slope)
    real(wp), intent(in) :: c(0:), t
    integer :: k
    slope = 0
    do k = ubound(c, 1), 1, -1
      slope = slope*t + k*c(k)
    end do
  end function slope_of

end module hybrid_flow
