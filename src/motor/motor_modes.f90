! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How a mode of a machine with a motor begins: its equations, the guards that end it, and which of these are zero at first.
module motor_modes
  use constants, only: two_pi
  use kinds, only: wp
  use motion_state, only: mode_lower_barrier, mode_slip_minus, mode_upper_barrier, state_t
  use motor_system, only: guard_back, guard_body_down, guard_body_up, guard_crank_down, guard_crank_up, guard_fastest, &
    guard_lower, guard_section, guard_standstill, guard_turning, guard_upper, motor_system_t, &
    stays_within_half_turn
  use motor_limits, only: active_limits
  use motor_now, only: parameters_now, state_vector
  use motor_rest, only: equation_mode, low_series, size_of_forces, slips, zero_order
  use motor_state, only: motor_state_t
  use series_flight, only: flight_t, keep_bounds, restart_flight, set_branches, take_bounds
  use switch_branches, only: choose_branches
  use tape_series, only: series_t
  implicit none
  private

  public :: begin_mode, end_mode, keep_angle

contains

  !> The equations and guards of the present mode.
  pure subroutine begin_mode(system, state, crank, needs_v_max, kept, flight, fault)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(inout) :: crank
    logical, intent(in) :: needs_v_max
    integer, intent(in) :: kept
    type(flight_t), intent(inout) :: flight
    integer, intent(out) :: fault
    type(series_t) :: series
    integer :: mode, own
    logical :: is_decided
    mode = equation_mode(slips(state%mode), crank%turning /= 0)
    if (.not. system%clock) call keep_angle(crank)
    call take_equations(system, mode, kept, flight)
    flight%state(:system%variables) = state_vector(system, state, crank)
    flight%state(system%variables + 1:) = 0
    flight%time = state%time
    flight%parameters = parameters_now(system, state, crank)
    call low_series(system, mode, state, crank, series, fault, values_only=.true.)
    own = size(flight%guards) - size(flight%tape%switches)
    if (own < size(flight%guards)) call begin_branches(flight, own)
    if (.not. allocated(crank%bounds)) allocate (crank%bounds(-1:1, 4))
    call take_bounds(flight, crank%bounds(merge(-1, 1, state%mode == mode_slip_minus), mode))
    flight%is_active(:own) = .false.
    call watch_guards(system, state, crank, needs_v_max, series, flight, is_decided)
    if (is_decided .or. fault /= 0) return
    call low_series(system, mode, state, crank, series, fault)
    call watch_guards(system, state, crank, needs_v_max, series, flight, is_decided)
  end subroutine begin_mode

  !> A flight of a mode, its own last one where it was in the same mode.
  pure subroutine take_equations(system, mode, kept, flight)
    type(motor_system_t), intent(in) :: system
    integer, intent(in) :: mode, kept
    type(flight_t), intent(inout) :: flight
    integer :: label
    label = mode + 4*kept
    if (flight%label == label) then
      call restart_flight(flight)
    else
      flight = system%flights(mode, kept)
      flight%label = label
    end if
  end subroutine take_equations

  !> The guards of the present mode, and which of them are zero at first: not decided where series of order 0 do not show that.
  pure subroutine watch_guards(system, state, crank, needs_v_max, series, flight, is_decided)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    logical, intent(in) :: needs_v_max
    type(series_t), intent(in) :: series
    type(flight_t), intent(inout) :: flight
    logical, intent(out) :: is_decided
    integer :: slip
    is_decided = .true.
    slip = merge(-1, 1, state%mode == mode_slip_minus)
    if (slips(state%mode)) then
      call watch(flight, guard_turning, -slip)
      if (slip > 0 .and. system%contact%upper < huge(1.0_wp)) call watch(flight, guard_upper, 1)
      if (slip < 0 .and. system%contact%lower > -huge(1.0_wp)) call watch(flight, guard_lower, -1)
      if (slip > 0 .and. needs_v_max) call watch(flight, guard_fastest, -1)
      if (.not. abs(state%v) > 0) call mark_start(flight, series, guard_turning, flight%rates(4), &
                                                  least(system, state, series), is_decided)
      if (stays_within_half_turn(system)) then
        call watch(flight, merge(guard_section, guard_back, slip > 0), slip)
        call mark_zeros(flight, series, [merge(guard_section, guard_back, slip > 0)], 0.0_wp, is_decided)
      end if
    else
      ! Between stops without room a body is at both.
      if (state%mode /= mode_upper_barrier .and. state%x < system%contact%upper) call watch(flight, guard_body_up, 1)
      if (state%mode /= mode_lower_barrier .and. state%x > system%contact%lower) call watch(flight, guard_body_down, -1)
      call mark_zeros(flight, series, [guard_body_up, guard_body_down], system%mass*least(system, state, series), is_decided)
    end if
    if (system%clock) return
    if (crank%turning /= 0) then
      call watch(flight, guard_standstill, -crank%turning)
      call watch(flight, merge(guard_section, guard_back, crank%turning > 0), crank%turning)
      if (.not. abs(crank%w) > 0) call mark_start(flight, series, guard_standstill, flight%rates(2), 0.0_wp, is_decided)
    else
      call watch(flight, guard_crank_up, 1)
      call watch(flight, guard_crank_down, -1)
      call mark_zeros(flight, series, [guard_crank_up, guard_crank_down], &
                      32*epsilon(1.0_wp)*abs(series%c(0, system%torque)), is_decided)
    end if
    call watch_motor(system, crank, series, flight, is_decided)
  end subroutine watch_guards

  !> What the next flight in this mode can use.
  pure subroutine end_mode(state, flight, crank)
    type(state_t), intent(in) :: state
    type(flight_t), intent(in) :: flight
    type(motor_state_t), intent(inout) :: crank
    call keep_bounds(flight, crank%bounds(merge(-1, 1, state%mode == mode_slip_minus), &
                                          equation_mode(slips(state%mode), crank%turning /= 0)))
  end subroutine end_mode

  !> The branches of the switching functions, whose guards follow the `own` ones.
  pure subroutine begin_branches(flight, own)
    type(flight_t), intent(inout) :: flight
    integer, intent(in) :: own
    integer :: branches(size(flight%guards) - own), zeros(size(flight%guards) - own)
    logical :: fits
    call choose_branches(flight, flight%state, flight%parameters, branches, zeros, fits)
    call set_branches(flight, branches)
    flight%zeros(own + 1:) = max(zeros, 0)
    flight%is_active(own + 1:) = flight%is_active(own + 1:) .and. zeros >= 0
  end subroutine begin_branches

  !> The guards of the motor itself.
  pure subroutine watch_motor(system, crank, series, flight, is_decided)
    type(motor_system_t), intent(in) :: system
    type(motor_state_t), intent(in) :: crank
    type(series_t), intent(in) :: series
    type(flight_t), intent(inout) :: flight
    logical, intent(inout) :: is_decided
    integer, allocatable :: guards(:), directions(:)
    real(wp) :: rounding
    integer :: i
    call active_limits(system, crank, guards, directions, rounding)
    do i = 1, size(guards)
      call watch(flight, guards(i), directions(i))
    end do
    call mark_zeros(flight, series, guards, rounding, is_decided)
  end subroutine watch_motor

  !> What rounding does to the acceleration of the body [m/s^2].
  pure real(wp) function least(system, state, series)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(series_t), intent(in) :: series
    if (system%clock) then
      least = 64*epsilon(1.0_wp)*size_of_forces(system, state, series%c(0, :))/system%mass
      return
    end if
    least = 64*epsilon(1.0_wp)*(system%stiffness*(abs(state%x) + abs(system%free_length)) + system%friction%break_away)/system%mass
  end function least

  pure subroutine watch(flight, guard, direction)
    type(flight_t), intent(inout) :: flight
    integer, intent(in) :: guard, direction
    flight%is_active(guard) = .true.
    flight%guards(guard)%direction = direction
  end subroutine watch

  !> A velocity that begins at zero; `rate` is the node of its rate.
  pure subroutine mark_start(flight, series, guard, rate, rounding, is_decided)
    type(flight_t), intent(inout) :: flight
    type(series_t), intent(in) :: series
    integer, intent(in) :: guard, rate
    real(wp), intent(in) :: rounding
    logical, intent(inout) :: is_decided
    is_decided = is_decided .and. (series%order > 0 .or. abs(series%c(0, rate)) > rounding)
    flight%zeros(guard) = zero_order(series%c(:, rate), rounding)
  end subroutine mark_start

  !> Guards that begin at zero.
  pure subroutine mark_zeros(flight, series, guards, rounding, is_decided)
    type(flight_t), intent(inout) :: flight
    type(series_t), intent(in) :: series
    integer, intent(in) :: guards(:)
    real(wp), intent(in) :: rounding
    logical, intent(inout) :: is_decided
    integer :: i
    do i = 1, size(guards)
      associate (c => series%c(:, flight%guards(guards(i))%node))
        if (.not. abs(c(1)) <= rounding) cycle
        is_decided = is_decided .and. series%order > 0
        flight%zeros(guards(i)) = zero_order(c(2:), 0.0_wp)
      end associate
    end do
  end subroutine mark_zeros

  !> The angle from 0 to 2 pi, whichever way the crank turns.
  pure subroutine keep_angle(crank)
    type(motor_state_t), intent(inout) :: crank
    if (crank%turning < 0 .and. crank%phi <= 0) then
      crank%phi = two_pi
      crank%turns = crank%turns - 1
    else if (crank%turning > 0 .and. crank%phi >= two_pi) then
      crank%phi = 0
      crank%turns = crank%turns + 1
    end if
  end subroutine keep_angle

end module motor_modes
