! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Body and crank at zero velocity: which way each goes on, and how a sequence of ever smaller impacts ends.
module motor_rest
  use constants, only: two_pi
  use kinds, only: wp
  use motion_state, only: mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, mode_upper_barrier, state_t
  use motor_now, only: node_values, parameters_now, restitution_of, state_vector
  use motor_state, only: motor_state_t
  use motor_system, only: body_held, both_held, both_move, crank_held, far, guard_body_down, guard_body_up, low_order, &
    motor_system_t, v_at
  use switch_branches, only: choose_branches
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate_some
  implicit none
  private

  public :: choose_body, choose_crank, enters_stop, equation_mode, hold_without_room, is_over, size_of_forces, slips, &
    turns_at_section, chatter_dies_out, low_series, zero_order

  !> As for machines with a given drive: relative change of the acceleration over what is left of a chatter sequence at which it
  !> is completed, and the same where a bounce is below the rounding of the position.
  real(wp), parameter :: chatter_uniformity = 1e-6_wp, unflown_uniformity = 0.5_wp
  !> Longest rest of a chatter sequence that is completed, in periods or turns, or in s; and under a force that no spring makes,
  !> which is as uniform over a bounce of any height.
  real(wp), parameter :: longest_rest = 1e-2_wp, longest_rest_under_load = 1e-6_wp

contains

  pure logical function slips(mode)
    integer, intent(in) :: mode
    slips = mode == mode_slip_plus .or. mode == mode_slip_minus
  end function slips

  !> Whether a motion is on a stop and moves towards it, as one that starts there can.
  pure logical function enters_stop(system, state)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    enters_stop = slips(state%mode) .and. ((state%x >= system%contact%upper .and. state%v > 0) .or. &
                                           (state%x <= system%contact%lower .and. state%v < 0))
  end function enters_stop

  !> Whether a change of modes where the velocity is zero is a section: a maximum, or a minimum where only maxima are cut off.
  pure logical function turns_at_section(system, before, after) result(turns)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: before, after
    integer :: arriving
    arriving = merge(mode_slip_minus, mode_slip_plus, system%contact%upper < far .and. system%contact%lower <= -far)
    turns = before == arriving .and. after /= arriving
  end function turns_at_section

  !> Which equations hold.
  pure integer function equation_mode(body_slips, crank_turns) result(mode)
    logical, intent(in) :: body_slips, crank_turns
    mode = merge(merge(both_move, crank_held, crank_turns), merge(body_held, both_held, crank_turns), body_slips)
  end function equation_mode

  !> First Taylor coefficients of everything in a mode. The sign of slip is that of the mode of the body. `fault` is -1 if no
  !> branches of the switching functions fit the state. With `values_only` the series of a machine with a motor have order 0.
  pure subroutine low_series(system, mode, state, crank, series, fault, values_only)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: mode
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(series_t), intent(out) :: series
    integer, intent(out) :: fault
    logical, intent(in), optional :: values_only
    real(wp) :: parameters(size(system%sheet%parameters)), z(system%variables)
    integer :: branches(size(system%sheet%tape%switches)), zeros(size(system%sheet%tape%switches))
    logical :: fits
    parameters = parameters_now(system, state, crank)
    z = state_vector(system, state, crank)
    fits = .true.
    if (present(values_only) .and. .not. system%clock) then
      if (values_only) call low_values(system, mode, z, parameters, series, fault)
      if (values_only) return
    end if
    associate (flight => system%flights(mode, 0))
      if (system%clock) then
        call choose_branches(flight, z, parameters, branches, zeros, fits)
        call prepare_series(flight%tape, low_order, flight%rates, &
                            [flight%guards%node, system%torque, system%load, system%foot, system%inertia], branches, series)
      else
        series = system%low(mode)
      end if
      call expand(flight%tape, z, parameters, series, fault)
    end associate
    ! Coefficients that are too large count as not defined.
    fault = abs(fault)
    if (fault == 0 .and. .not. fits) fault = -1
  end subroutine low_series

  !> Values alone, as series of order 0.
  pure subroutine low_values(system, mode, z, parameters, series, fault)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: mode
    real(wp), intent(in) :: z(:), parameters(:)
    type(series_t), intent(inout) :: series
    integer, intent(out) :: fault
    integer :: faults(system%sheet%tape%count)
    associate (tape => system%flights(mode, 0)%tape, low => system%low(mode))
      allocate (series%c(0:0, tape%count))
      faults = 0
      call evaluate_some(tape, low%steady, z, parameters, series%c, faults, low%branches)
      call evaluate_some(tape, low%varying, z, parameters, series%c, faults, low%branches)
      fault = max(0, maxval(faults, mask=low%is_used))
    end associate
  end subroutine low_values

  !> Order of the zero of a rate's integral that is zero now: `c` are coefficients of the rate, `rounding` that of the first.
  pure integer function zero_order(c, rounding) result(order)
    real(wp), intent(in) :: c(0:), rounding
    do order = 1, ubound(c, 1)
      if (abs(c(order - 1)) > merge(rounding, 0.0_wp, order == 1)) return
    end do
  end function zero_order

  !> Mode of the body at zero velocity: at the edge of sticking the next terms of the force decide; a stop holds whatever pushes
  !> against it.
  pure subroutine choose_body(system, state, crank)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(inout) :: state
    type(motor_state_t), intent(in) :: crank
    type(series_t) :: series
    integer :: mode, fault
    logical :: up, down
    mode = equation_mode(.false., crank%turning /= 0)
    call low_series(system, mode, state, crank, series, fault, values_only=.true.)
    associate (guards => system%flights(mode, 0)%guards%node, rounding => force_rounding(system, state, crank, series))
      if (series%order == 0 .and. any(abs(series%c(0, guards([guard_body_up, guard_body_down]))) <= rounding)) then
        call low_series(system, mode, state, crank, series, fault)
      end if
      up = is_over(series%c(:, guards(guard_body_up)), 0.0_wp, rounding)
      down = is_over(-series%c(:, guards(guard_body_down)), 0.0_wp, rounding)
    end associate
    if (up .and. state%x < system%contact%upper) then
      state%mode = mode_slip_plus
    else if (down .and. state%x > system%contact%lower) then
      state%mode = mode_slip_minus
    else if (state%x >= system%contact%upper) then
      state%mode = mode_upper_barrier
    else if (state%x <= system%contact%lower) then
      state%mode = mode_lower_barrier
    else
      state%mode = mode_stick
    end if
  end subroutine choose_body

  !> A body between stops that leave no room does not move.
  pure subroutine hold_without_room(system, state)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(inout) :: state
    if (.not. system%contact%upper > system%contact%lower) state%v = 0
  end subroutine hold_without_room

  !> Which way the crank turns from standstill, or whether its bearing holds it.
  pure subroutine choose_crank(system, state, crank)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    type(series_t) :: series
    real(wp) :: rounding
    integer :: mode, fault
    mode = equation_mode(slips(state%mode), .false.)
    crank%turning = 0
    call low_series(system, mode, state, crank, series, fault)
    associate (c => series%c(:, system%crank_hold(mode)), level => system%crank_level)
      rounding = 32*epsilon(1.0_wp)*(abs(series%c(0, system%torque)) + abs(series%c(0, system%load)) + level)
      if (is_over(c, level, rounding)) then
        crank%turning = 1
      else if (is_over(-c, level, rounding)) then
        crank%turning = -1
      end if
    end associate
  end subroutine choose_crank

  !> Whether a force with the Taylor coefficients `c` overcomes what holds against it: where both are equal to rounding, the next
  !> terms decide.
  pure logical function is_over(c, level, rounding)
    real(wp), intent(in) :: c(0:), level, rounding
    integer :: k
    is_over = c(0) - level > rounding
    if (abs(c(0) - level) > rounding) return
    do k = 1, ubound(c, 1)
      is_over = c(k) > 0
      if (abs(c(k)) > 0) return
    end do
  end function is_over

  !> What rounding does to the force on the body [N].
  pure real(wp) function force_rounding(system, state, crank, series) result(rounding)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    type(series_t), intent(in) :: series
    if (system%clock) then
      rounding = 64*epsilon(1.0_wp)*size_of_forces(system, state, series%c(0, :))
      return
    end if
    rounding = system%stiffness*(abs(system%free_length) + abs(state%x) + abs(series%c(0, system%foot)))
    rounding = 32*epsilon(1.0_wp)*(rounding + system%body_level + system%moment*crank%w**2)
  end function force_rounding

  !> Size of the forces by expressions [N], from the values of the nodes: rounding is that of each, and that of the position.
  pure real(wp) function size_of_forces(system, state, values) result(total)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: values(:)
    total = sum(abs(values(system%forces))) + abs(values(system%force_slope)*state%x) + abs(values(system%rest_friction))
  end function size_of_forces

  !> Friction [N] on a body that comes to rest, and by how much speed and position of a bounce change it and the spring force.
  pure subroutine forces_of_bounce(system, state, crank, height, friction, change)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp), intent(in) :: height
    real(wp), intent(out) :: friction, change
    type(state_t) :: resting
    real(wp), allocatable :: moving(:), still(:)
    integer :: rate
    if (system%clock) then
      resting = state
      resting%v = 0
      moving = node_values(system, state, crank)
      still = node_values(system, resting, crank)
      friction = still(system%rest_friction)
      rate = system%flights(both_move, 0)%rates(v_at)
      change = system%mass*abs(moving(rate) - still(rate)) + abs(still(system%force_slope))*height
    else
      associate (law => system%friction, speed => abs(state%v))
        friction = law%kinetic + law%excess
        change = law%damping*speed + system%stiffness*height
        if (law%excess > 0) change = change + law%excess*min(1.0_wp, speed/law%stribeck_velocity)
      end associate
    end if
  end subroutine forces_of_bounce

  !> Whether impacts on the stop in `direction` 1 or -1 are over within `left` [s], the body having just left it. One bounce with
  !> constant friction: out at (R + F)/m, back at (R - F)/m, the speed shrinks by k sqrt(back/out), so that times form a
  !> geometric series. What they change is then less than the uniformity, so that the body may rest at once.
  pure subroutine chatter_dies_out(system, state, crank, direction, left, over)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    integer, intent(in) :: direction
    real(wp), intent(out) :: left
    logical, intent(out) :: over
    type(state_t) :: resting
    type(series_t) :: series
    real(wp) :: push, friction, out, back, change, shrink, height, speed
    integer :: mode, fault
    mode = equation_mode(.false., crank%turning /= 0)
    resting = state
    resting%v = 0
    left = 0
    over = .false.
    call low_series(system, mode, resting, crank, series, fault)
    if (fault /= 0) return
    speed = abs(state%v)
    associate (force => series%c(:, system%body_hold(mode)))
      push = direction*force(1)
      if (push <= system%body_level) return
      call forces_of_bounce(system, state, crank, speed**2/(2*push/system%mass), friction, change)
      out = (push + friction)/system%mass
      back = (push - friction)/system%mass
      if (back <= 0) return
      shrink = sqrt(back/out)*restitution_of(system, resting, crank)
      if (shrink >= 1) return
      left = (speed/out + speed/sqrt(back*out))/(1 - shrink)
      height = speed**2/(2*out)
      change = change + abs(force(2))*left + abs(force(3))*left**2
      change = change/(system%mass*back)
      over = change <= chatter_uniformity .and. left <= longest_completion(system, resting, crank)
      if (height < 8*epsilon(1.0_wp)*(abs(state%x) + abs(series%c(0, system%foot)) + system%free_length)) then
        over = change <= unflown_uniformity
      end if
    end associate
  end subroutine chatter_dies_out

  !> Longest rest of a chatter sequence [s] that is completed.
  pure real(wp) function longest_completion(system, resting, crank) result(longest)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: resting
    type(motor_state_t), intent(in) :: crank
    real(wp) :: values(system%sheet%tape%count)
    logical :: has_spring
    longest = 1
    if (system%period > 0) longest = system%period
    if (system%no_load_speed > 0) longest = two_pi/system%no_load_speed
    has_spring = system%stiffness > 0
    if (system%force_slope > 0) then
      values = node_values(system, resting, crank)
      has_spring = abs(values(system%force_slope)) > 0
    end if
    longest = longest*merge(longest_rest, longest_rest_under_load, has_spring)
  end function longest_completion

end module motor_rest
