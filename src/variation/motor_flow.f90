! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Flights of a machine with a motor between events, forwards or back, with their derivatives by the start: Taylor series of the
!> equations and of their variational equations on one tape.
module motor_flow
  use kinds, only: wp
  use motor_pieces, only: motor_piece_t, piece_of, set_parameters, stop_at_piece, value_of
  use motor_system, only: motor_system_t, w_at, y_at
  use motor_torque, only: motor_control_t
  use series_flight, only: series_order
  use tape, only: tape_t
  use tape_derivative, only: differentiate
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate
  use tape_variation, only: add_variations
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  !> Steps after which a flight is given up: a turn takes some twenty.
  integer, parameter :: most_steps = 20000

  public :: add_slopes, fly_on, new_flow, rates_at, step_of, with_piece

  !> A system z' = f(z) on its own tape, and that of z and of its derivatives by the start, one column after the other.
  type, public :: motor_flow_t
    type(tape_t) :: tape
    !> The same without derivatives: it has the first nodes.
    type(tape_t) :: plain
    integer :: n = 0
    !> Nodes of variables and of their rates.
    integer, allocatable :: states(:), rates(:)
    !> Its equations change from piece to piece.
    type(motor_control_t) :: control
  end type motor_flow_t

contains

  !> The equations of a mode (`motor_equations`), with their variational equations.
  pure subroutine new_flow(system, mode, flow)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: mode
    type(motor_flow_t), intent(out) :: flow
    flow%n = system%variables
    flow%control = system%control
    flow%tape = system%sheet%tape
    flow%plain = system%sheet%tape
    call add_variations(flow%tape, system%flights(mode, 0)%rates(:flow%n), 1, flow%states, flow%rates)
  end subroutine new_flow

  !> Derivatives of a node by the variables, as nodes.
  pure subroutine add_slopes(flow, node, slopes)
    type(motor_flow_t), intent(inout) :: flow
    integer, intent(in) :: node
    integer, intent(out) :: slopes(:)
    integer :: k
    do k = 1, flow%n
      call differentiate(flow%tape, [node], flow%states(k), slopes(k:k))
    end do
  end subroutine add_slopes

  !> The parameters in the piece of the motor in which a state is.
  pure function with_piece(flow, z, parameters) result(now)
    type(motor_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: now(size(parameters)), value(flow%plain%count)
    integer :: fault(flow%plain%count)
    now = parameters
    if (flow%control%curve%count == 0 .and. flow%control%command == 0) return
    call evaluate(flow%plain, z, parameters, value, fault)
    call set_parameters(flow%control, piece_of(flow%control, z, value), now)
  end function with_piece

  !> Rates of the variables.
  pure function rates_at(flow, z, parameters) result(rates)
    type(motor_flow_t), intent(in) :: flow
    real(wp), intent(in) :: z(:), parameters(:)
    real(wp) :: rates(flow%n), value(flow%plain%count)
    integer :: fault(flow%plain%count)
    call evaluate(flow%plain, z, with_piece(flow, z, parameters), value, fault)
    rates = value(flow%rates(:flow%n))
  end function rates_at

  !> Moves a state by a `duration` [s] of either sign; `sizes` of the variables set how small an error is. With `slopes` its
  !> derivative by the start, too. Where the equations are not defined nothing comes out that is a number.
  pure subroutine fly_on(flow, parameters, sizes, duration, z, slopes)
    type(motor_flow_t), intent(in) :: flow
    real(wp), intent(in) :: parameters(:), sizes(:), duration
    real(wp), intent(inout) :: z(:)
    real(wp), intent(out), optional :: slopes(:, :)
    real(wp) :: all(size(flow%states)), scales(size(flow%states))
    integer :: i, n
    n = flow%n
    if (.not. present(slopes)) then
      call take_steps(flow, flow%plain, n, parameters, sizes, duration, z)
      return
    end if
    all = 0
    all(:n) = z
    scales(:n) = sizes
    do i = 1, n
      all(n*i + i) = 1
      scales(n*i + 1:n*(i + 1)) = sizes/sizes(i)
    end do
    call take_steps(flow, flow%tape, size(all), parameters, scales, duration, all)
    z = all(:n)
    slopes = reshape(all(n + 1:), [n, n])
  end subroutine fly_on

  !> Steps of the series of a tape, that of a flow with or without derivatives, for its first `count` variables.
  pure subroutine take_steps(flow, tape, count, parameters, scales, duration, z)
    type(motor_flow_t), intent(in) :: flow
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: count
    real(wp), intent(in) :: parameters(:), scales(:), duration
    real(wp), intent(inout) :: z(:)
    type(series_t) :: series
    type(motor_piece_t) :: piece, next
    real(wp) :: left, step, now(size(parameters)), value(flow%plain%count)
    integer :: node_faults(flow%plain%count), fault, i, k
    associate (states => flow%states(:count))
      call prepare_series(tape, series_order, flow%rates(:count), [integer ::], [integer ::], series)
      left = duration
      now = parameters
      call evaluate(flow%plain, z(:flow%n), now, value, node_faults)
      piece = piece_of(flow%control, z, value)
      if (piece%held /= 0) call hold_integral(flow, piece%held, z)
      do i = 1, most_steps
        if (.not. abs(left) > 0) return
        call set_parameters(flow%control, piece, now)
        call expand(tape, z, now, series, fault)
        if (fault /= 0) exit
        step = step_of(series%c(:, states), max(scales, abs(z)))
        if (step >= abs(left)) step = abs(left)
        step = sign(step, left)
        call stop_at_piece(flow%control, series%c, [states(w_at), states(min(y_at, count))], step, piece, next)
        do k = 1, count
          z(k) = value_of(series%c(:, states(k)), step)
        end do
        if (next%held /= piece%held .and. next%held /= 0) call hold_integral(flow, next%held, z)
        piece = next
        left = left - step
      end do
    end associate
    if (abs(left) > 0) z = ieee_value(1.0_wp, ieee_quiet_nan)
  end subroutine take_steps

  !> The integral where it is held: nothing of what it was before is left in it.
  pure subroutine hold_integral(flow, side, z)
    type(motor_flow_t), intent(in) :: flow
    integer, intent(in) :: side
    real(wp), intent(inout) :: z(:)
    integer :: k
    z(y_at) = side*flow%control%largest_integral
    do k = flow%n + y_at, size(z), flow%n
      z(k) = 0
    end do
  end subroutine hold_integral

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

end module motor_flow
