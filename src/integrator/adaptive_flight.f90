! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One slip by the embedded Runge-Kutta pair of `dormand_prince_table`, for whatever is not linear. Events
!> are isolated on the continuous extension by its Bernstein coefficients, then the step is taken
!> again to the event itself, so that the state carries the error of the method and not of the extension. The march is that
!> of `guarded_march`, compiled for two unknowns and the slopes of one body: basins with a Stribeck layer need its speed.
module adaptive_flight
  use constants, only: unreachable
  use dormand_prince_table, only: error_3, error_5, extension, node, stage
  use drive_law, only: foot_motion, next_sample
  use effect_law, only: context_t => slip_memory_t, dahl_force
  use energy, only: balance_instant, gauss_position, gauss_points, gauss_weight, record_with_balance
  use exact_flight, only: flight_barrier, flight_failed, flight_layer_left, flight_speed_reached, &
    flight_time_over
  use friction_law, only: sliding_friction
  use kinds, only: wp
  use march_pace, only: pace_t, watch_pace
  use motion_state, only: energy_balance_t, log_t, mode_slip_plus, options_t, sample_due, sample_time, state_t, tally_t
  use oscillator, only: extra_force, system_t => oscillator_t
  use polynomial, only: degree, first_zero, interpolate, maximum_until, value_at
  use restoring_law, only: restoring_force
  use table_pieces, only: enter_pieces, list_ends, margin_of_end, most_ends, piece_end_t, extension_above
  implicit none
  private

  public :: fly_adaptive

  !> Position and velocity.
  integer, parameter :: most_equations = 2
  !> Barrier, speed zero, exit speed, the ends of pieces of tables.
  integer, parameter :: most_guards = 3 + most_ends, crosses_knot = -1

  include 'march_types.inc'

contains

  !> Flies from `state` (mode slip_plus or slip_minus) up to `time_end` [s after the section], `barrier` [m]
  !> being the barrier ahead. Ends at speed zero, at the barrier, when the speed has risen to `exit_speed` [m/s], at
  !> the time, or before it outside of the domain. The state returned is that just before the event.
  pure subroutine fly_adaptive(machine, options, state, time_end, exit_speed, barrier, tally, outcome, log)
    type(system_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end, exit_speed, barrier
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(march_t) :: march
    type(guard_t) :: guards(most_guards)
    type(pace_t) :: pace
    integer :: ends(most_guards), count_guards, triggered, plain_guards
    real(wp) :: direction, until
    logical :: hopeless
    direction = merge(1.0_wp, -1.0_wp, state%mode == mode_slip_plus)
    march%context = context_t(direction, state%x, state%z)
    call list_guards(direction, barrier, exit_speed, guards, ends, plain_guards)
    count_guards = plain_guards
    if (machine%effects%by_table) call keep_to_pieces(machine, state%time, [state%x, state%v], march%context, guards, ends, &
                                                      count_guards)
    call set_out(2, march, machine, options%tolerance, scale_of(machine, state), machine%period, state%time, [state%x, state%v])
    do
      outcome = flight_time_over
      if (march%time >= time_end) exit
      until = next_sample(machine%drive, march%time, time_end)
      call step_on(2, march, machine, guards(:count_guards), until, triggered)
      tally%steps = tally%steps + march%tries
      call watch_pace(march%time, time_end, options%step_budget, pace, hopeless)
      ! What it would take is more than there is.
      if (hopeless) tally%steps = options%step_budget + 1
      if (triggered == march_failed .or. tally%steps > options%step_budget) then
        outcome = flight_failed
        exit
      end if
      if (march%fraction > 0 .or. triggered > 0) call look_along(machine, march, state, tally, log)
      if (triggered > 0) then
        outcome = ends(triggered)
        if (outcome /= crosses_knot) exit
        count_guards = plain_guards
        call keep_to_pieces(machine, march%time, march%y, march%context, guards, ends, count_guards)
        call find_slope(machine, march%context, 2, march%time, march%y, march%slopes(:, 1))
      end if
      ! An unstable spring drives a body to infinity within a finite time.
      if (abs(march%y(1)) > options%domain) exit
    end do
    state%time = min(march%time, time_end)
    state%x = march%y(1)
    state%v = march%y(2)
    if (outcome == flight_barrier) state%x = barrier
    if (outcome == flight_speed_reached .or. direction*state%v < 0) state%v = 0
    if (machine%effects%dahl_stiffness > 0) state%z = dahl_force(machine%effects, march%context, state%x)
  end subroutine fly_adaptive

  !> What ends a slip in `direction`, and the outcomes: of several at one instant the barrier comes first, then speed zero.
  pure subroutine list_guards(direction, barrier, exit_speed, guards, ends, count_guards)
    real(wp), intent(in) :: direction, barrier, exit_speed
    type(guard_t), intent(out) :: guards(most_guards)
    integer, intent(out) :: ends(most_guards), count_guards
    count_guards = 1
    guards(1) = guard_t(direction*barrier, [-direction, 0.0_wp])
    ends(1) = flight_barrier
    if (abs(barrier) >= unreachable) count_guards = 0
    count_guards = count_guards + 1
    guards(count_guards) = guard_t(0.0_wp, [0.0_wp, direction])
    ends(count_guards) = flight_speed_reached
    if (exit_speed >= unreachable) return
    count_guards = count_guards + 1
    guards(count_guards) = guard_t(exit_speed, [0.0_wp, -direction])
    ends(count_guards) = flight_layer_left
  end subroutine list_guards

  !> Keeps `slip` to the pieces of the tables that it is in at `time` [s after the section] in the state `y`, so that no step
  !> meets a kink, and adds guards for where it leaves them.
  pure subroutine keep_to_pieces(machine, time, y, slip, guards, ends, count_guards)
    type(system_t), intent(in) :: machine
    real(wp), intent(in) :: time, y(2)
    type(context_t), intent(inout) :: slip
    type(guard_t), intent(inout) :: guards(most_guards)
    integer, intent(inout) :: ends(most_guards), count_guards
    type(piece_end_t) :: pieces(most_ends)
    integer :: i, count_ends
    call enter_pieces(machine%effects, y(1), y(2), extension_at(machine, time, y(1)), slip)
    call list_ends(machine%effects, slip, pieces, count_ends)
    do i = 1, count_ends
      associate (guard => guards(count_guards + i))
        guard = guard_t()
        call margin_of_end(pieces(i), slip%direction, guard%constant, guard%coefficients, guard%margin)
      end associate
    end do
    ends(count_guards + 1:count_guards + count_ends) = crosses_knot
    count_guards = count_guards + count_ends
  end subroutine keep_to_pieces

  pure real(wp) function extension_at(machine, time, x) result(spring_extension)
    type(system_t), intent(in) :: machine
    real(wp), intent(in) :: time, x
    real(wp) :: foot
    call foot_motion(machine%drive, machine%drive_frequency*time, foot)
    spring_extension = machine%restoring%free_length + foot - x
  end function extension_at

  !> Size of position and velocity below which errors are absolute [m, m/s].
  pure function scale_of(machine, state) result(scale)
    type(system_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp) :: scale(2), length
    length = 1
    if (machine%restoring%stiffness > 0) length = machine%force_scale/machine%restoring%stiffness
    if (length <= 0) length = max(abs(state%x), abs(state%v)/machine%drive_frequency, tiny(length))
    scale = 1e-3_wp*length*[1.0_wp, machine%drive_frequency]
  end function scale_of

  !> Velocity and acceleration.
  pure subroutine find_slope(machine, slip, n, time, y, slope)
    type(system_t), intent(in) :: machine
    type(context_t), intent(in) :: slip
    integer, intent(in) :: n
    real(wp), intent(in) :: time, y(n)
    real(wp), intent(out) :: slope(n)
    real(wp) :: spring_extension
    spring_extension = extension_at(machine, time, y(1))
    slope(1) = y(2)
    slope(2) = (restoring_force(machine%restoring, spring_extension) &
                + sliding_friction(machine%friction, y(2), slip%direction))/machine%mass
    if (machine%extra) slope(2) = slope(2) + extra_force(machine, slip, time, y(1), y(2), spring_extension)/machine%mass
  end subroutine find_slope

  !> How far the extension of the spring is below or above a constant [m].
  pure real(wp) function margin_of(machine, guard, time, y)
    type(system_t), intent(in) :: machine
    type(guard_t), intent(in) :: guard
    real(wp), intent(in) :: time, y(:)
    margin_of = guard%constant + merge(1, -1, guard%margin == extension_above)*extension_at(machine, time, y(1))
  end function margin_of

  !> Largest velocity, energy and samples of the step behind; `state` gives what a sample does not change.
  pure subroutine look_along(machine, march, state, tally, log)
    type(system_t), intent(in) :: machine
    type(march_t), intent(in) :: march
    type(state_t), intent(in) :: state
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: sample
    real(wp) :: t, done
    if (tally%needs_v_max .and. march%context%direction > 0) then
      tally%v_max = maximum_until(march%path(:, 2), march%fraction, max(tally%v_max, march%path(0, 2)))
    end if
    if (.not. present(log)) return
    done = 0
    if (log%sample_interval > 0) then
      do
        sample = state
        sample%time = sample_time(log)
        if (.not. sample_due(log, march%from + march%fraction*march%length)) exit
        t = (sample%time - march%from)/march%length
        sample%x = value_at(march%path(:, 1), t)
        sample%v = value_at(march%path(:, 2), t)
        if (t > done) then
          call balance_piece(machine, march, done, t, log%balance)
          done = t
        end if
        call record_with_balance(machine, sample, log)
      end do
    end if
    call balance_piece(machine, march, done, march%fraction, log%balance)
  end subroutine look_along

  !> Where the energy went between two fractions of the step behind.
  pure subroutine balance_piece(machine, march, from, until, balance)
    type(system_t), intent(in) :: machine
    type(march_t), intent(in) :: march
    real(wp), intent(in) :: from, until
    type(energy_balance_t), intent(inout) :: balance
    real(wp) :: t
    integer :: k
    if (.not. balance%kept) return
    do k = 1, gauss_points
      t = from + (until - from)*gauss_position(k)
      call balance_instant(machine, march%context, march%from + t*march%length, value_at(march%path(:, 1), t), &
                        value_at(march%path(:, 2), t), (until - from)*march%length*gauss_weight(k), balance)
    end do
  end subroutine balance_piece

  include 'march_steps.inc'

end module adaptive_flight
