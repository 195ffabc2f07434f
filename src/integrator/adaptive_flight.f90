! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One slip by the embedded Runge-Kutta pair of `dormand_prince_table`, for whatever is not linear. Events
!> are isolated on the continuous extension by its Bernstein coefficients, then the step is taken
!> again to the event itself, so that the state carries the error of the method and not of the extension. The same
!> as `guarded_march` to the bit, but for two unknowns only and faster: basins with a Stribeck layer need it.
module adaptive_flight
  use constants, only: unreachable
  use dormand_prince_table, only: error_3, error_5, extension, node, stage
  use drive_law, only: foot_motion, next_sample
  use effect_law, only: dahl_force, slip_memory_t
  use energy, only: book_instant, gauss_place, gauss_points, gauss_weight, record_with_book
  use exact_flight, only: flight_barrier, flight_failed, flight_layer_left, flight_speed_reached, &
    flight_time_over
  use friction_law, only: sliding_friction
  use kinds, only: wp
  use motion_state, only: book_t, log_t, mode_slip_plus, options_t, sample_due, sample_time, state_t, tally_t
  use oscillator, only: extra_force, oscillator_t
  use polynomial, only: degree, first_fall, maximum_until, value_at
  use restoring_law, only: restoring_force
  implicit none
  private

  public :: fly_adaptive

  integer, parameter :: most_polish = 6, most_equations = 2

  !> What a slip needs to know of the machine and where it must end.
  type :: slip_t
    real(wp) :: direction = 1
    !> Barrier ahead [m] and speed at which the Stribeck layer is left [m/s].
    real(wp) :: barrier = 0, exit_speed = 0
    !> Size of position and velocity below which errors are absolute [m, m/s].
    real(wp) :: scale(2) = 1
    type(slip_memory_t) :: memory
  end type slip_t

contains

  !> Flies from `state` (mode slip_plus or slip_minus) up to `time_end` [s after the section], `barrier` [m]
  !> being the barrier ahead. Ends at speed zero, at the barrier, when the speed has risen to `exit_speed`, at
  !> the time, or before it outside of the domain. The state returned is that just before the event.
  pure subroutine fly_adaptive(machine, options, state, time_end, exit_speed, barrier, tally, outcome, log)
    type(oscillator_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end, exit_speed, barrier
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(slip_t) :: slip
    real(wp) :: y(2), next(2), slopes(2, 16), path(0:degree, 2), h, until, remaining, error, fraction
    logical :: last
    slip = slip_of(machine, state, exit_speed, barrier)
    y = [state%x, state%v]
    slopes(:, 1) = slope(machine, slip, state%time, y)
    h = first_step(machine, slip, options%tolerance, state%time, y, slopes(:, 1))
    do
      outcome = flight_time_over
      if (state%time >= time_end) exit
      until = next_sample(machine%drive, state%time, time_end)
      remaining = until - state%time
      last = h >= remaining
      h = min(h, remaining)
      outcome = flight_failed
      tally%steps = tally%steps + 1
      if (tally%steps > options%step_budget) exit
      if (.not. h > 2*spacing(state%time + tiny(h))) then
        if (.not. last) exit
        ! Less is left than the clock can tell.
        state%time = until
        cycle
      end if
      call try_step(machine, slip, options%tolerance, state%time, y, h, slopes, next, error)
      if (.not. error <= 1) then
        h = next_length_after(h, error)
        cycle
      end if
      call extend(machine, slip, state%time, y, next, h, slopes, path)
      call first_event(slip, path, outcome, fraction)
      if (outcome == flight_failed) then
        call look_along(machine, state, y, path, h, 1.0_wp, slip, tally, log)
        state%time = merge(until, state%time + h, last)
        y = next
        slopes(:, 1) = slopes(:, 13)
        h = next_length_after(h, error)
        outcome = flight_time_over
        ! An unstable spring drives a body to infinity within a finite time.
        if (abs(y(1)) > options%domain) exit
        cycle
      end if
      call land(machine, slip, options%tolerance, outcome, state%time, y, h, fraction, slopes, next)
      call look_along(machine, state, y, path, h, fraction, slip, tally, log)
      state%time = min(state%time + fraction*h, time_end)
      y = next
      exit
    end do
    state%x = y(1)
    state%v = y(2)
    if (outcome == flight_barrier) state%x = barrier
    if (outcome == flight_speed_reached .or. slip%direction*state%v < 0) state%v = 0
    if (machine%effects%dahl_stiffness > 0) state%z = dahl_force(machine%effects, slip%memory, state%x)
  end subroutine fly_adaptive

  pure function slip_of(machine, state, exit_speed, barrier) result(slip)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: exit_speed, barrier
    type(slip_t) :: slip
    real(wp) :: length
    slip%direction = merge(1.0_wp, -1.0_wp, state%mode == mode_slip_plus)
    slip%memory = slip_memory_t(slip%direction, state%x, state%z)
    slip%barrier = barrier
    slip%exit_speed = exit_speed
    length = 1
    if (machine%restoring%stiffness > 0) length = machine%force_scale/machine%restoring%stiffness
    if (length <= 0) length = max(abs(state%x), abs(state%v)/machine%drive_frequency, tiny(length))
    slip%scale = 1e-3_wp*length*[1.0_wp, machine%drive_frequency]
  end function slip_of

  !> Velocity and acceleration.
  pure function slope(machine, slip, time, y)
    type(oscillator_t), intent(in) :: machine
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: time, y(2)
    real(wp) :: slope(2), foot, stretch
    call foot_motion(machine%drive, machine%drive_frequency*time, foot)
    stretch = machine%restoring%free_length + foot - y(1)
    slope(1) = y(2)
    slope(2) = (restoring_force(machine%restoring, stretch) &
                + sliding_friction(machine%friction, y(2), slip%direction))/machine%mass
    if (machine%extra) slope(2) = slope(2) + extra_force(machine, slip%memory, time, y(1), y(2), stretch)/machine%mass
  end function slope

  pure real(wp) function first_step(machine, slip, tolerance, time, y, f) result(h)
    type(oscillator_t), intent(in) :: machine
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: tolerance, time, y(2), f(2)
    real(wp) :: weight(2)
    weight = tolerance*(abs(y) + slip%scale)
    h = trial_length(y, f, weight, machine%period)
    h = first_length(f, slope(machine, slip, time + h, y + h*f), weight, h)
  end function first_step

  !> One step of order 8 and its error relative to the tolerance; slope 13 is that at the end.
  pure subroutine try_step(machine, slip, tolerance, time, y, h, slopes, next, error)
    type(oscillator_t), intent(in) :: machine
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: tolerance, time, y(2), h
    real(wp), intent(inout) :: slopes(2, 16)
    real(wp), intent(out) :: next(2), error
    integer :: i
    do i = 2, 12
      slopes(:, i) = slope(machine, slip, time + node(i)*h, y + h*combine(2, slopes, i))
    end do
    next = y + h*combine(2, slopes, 13)
    slopes(:, 13) = slope(machine, slip, time + h, next)
    error = error_of(2, slopes, h, tolerance*(max(abs(y), abs(next)) + slip%scale))
  end subroutine try_step

  !> Continuous extension of a step as polynomials in the fraction of the step.
  pure subroutine extend(machine, slip, time, y, next, h, slopes, path)
    type(oscillator_t), intent(in) :: machine
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: time, y(2), next(2), h
    real(wp), intent(inout) :: slopes(2, 16)
    real(wp), intent(inout) :: path(0:degree, 2)
    integer :: i
    do i = 14, 16
      slopes(:, i) = slope(machine, slip, time + node(i)*h, y + h*combine(2, slopes, i))
    end do
    call extend_path(2, slopes, h, y, next, path)
  end subroutine extend

  !> First event within a step; `flight_failed` stands for none.
  pure subroutine first_event(slip, path, outcome, fraction)
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: path(0:degree, 2)
    integer, intent(out) :: outcome
    real(wp), intent(out) :: fraction
    real(wp) :: p(0:degree), t
    outcome = flight_failed
    fraction = 2
    t = first_fall(slip%direction*path(:, 2))
    if (t <= 1) then
      outcome = flight_speed_reached
      fraction = t
    end if
    t = 2
    if (slip%exit_speed < unreachable) then
      p = -slip%direction*path(:, 2)
      p(0) = p(0) + slip%exit_speed
      t = first_fall(p)
    end if
    if (t < fraction .and. t <= 1) then
      outcome = flight_layer_left
      fraction = t
    end if
    t = 2
    if (abs(slip%barrier) < unreachable) then
      p = -slip%direction*path(:, 1)
      p(0) = p(0) + slip%direction*slip%barrier
      t = first_fall(p)
    end if
    if (t <= fraction .and. t <= 1) then
      outcome = flight_barrier
      fraction = t
    end if
  end subroutine first_event

  !> Takes the step again up to the event, corrected by Newton.
  pure subroutine land(machine, slip, tolerance, outcome, time, y, h, fraction, slopes, next)
    type(oscillator_t), intent(in) :: machine
    type(slip_t), intent(in) :: slip
    real(wp), intent(in) :: tolerance, time, y(2), h
    integer, intent(in) :: outcome
    real(wp), intent(inout) :: fraction, slopes(2, 16)
    real(wp), intent(out) :: next(2)
    real(wp) :: error, miss, rate, correction
    integer :: i
    do i = 1, most_polish
      call try_step(machine, slip, tolerance, time, y, fraction*h, slopes, next, error)
      select case (outcome)
      case (flight_barrier)
        miss = slip%barrier - next(1)
        rate = slopes(1, 13)
      case (flight_layer_left)
        miss = slip%direction*slip%exit_speed - next(2)
        rate = slopes(2, 13)
      case default
        miss = -next(2)
        rate = slopes(2, 13)
      end select
      correction = 0
      if (abs(miss) < 0.01_wp*abs(rate)*h) correction = miss/(rate*h)
      if (fraction + correction <= 0 .or. fraction + correction > 1) exit
      if (abs(correction) <= 2*epsilon(1.0_wp)) exit
      fraction = fraction + correction
    end do
  end subroutine land

  !> Largest velocity, energy and samples of a step up to `fraction` of it.
  pure subroutine look_along(machine, state, y, path, h, fraction, slip, tally, log)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: y(2), path(0:degree, 2), h, fraction
    type(slip_t), intent(in) :: slip
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: sample
    real(wp) :: t, done
    if (tally%wants_v_max .and. slip%direction > 0) then
      tally%v_max = max(tally%v_max, y(2), maximum_until(path(:, 2), fraction))
    end if
    if (.not. present(log)) return
    done = 0
    if (log%sample_interval > 0) then
      do
        sample = state
        sample%time = sample_time(log)
        if (.not. sample_due(log, state%time + fraction*h)) exit
        t = (sample%time - state%time)/h
        sample%x = value_at(path(:, 1), t)
        sample%v = value_at(path(:, 2), t)
        if (t > done) then
          call book_piece(machine, slip%memory, state%time, path, h, done, t, log%book)
          done = t
        end if
        call record_with_book(machine, sample, log)
      end do
    end if
    call book_piece(machine, slip%memory, state%time, path, h, done, fraction, log%book)
  end subroutine look_along

  !> Where the energy went between two fractions of a step from `time`.
  pure subroutine book_piece(machine, memory, time, path, h, from, until, book)
    type(oscillator_t), intent(in) :: machine
    type(slip_memory_t), intent(in) :: memory
    real(wp), intent(in) :: time, path(0:degree, 2), h, from, until
    type(book_t), intent(inout) :: book
    real(wp) :: t
    integer :: k
    if (.not. book%kept) return
    do k = 1, gauss_points
      t = from + (until - from)*gauss_place(k)
      call book_instant(machine, memory, time + t*h, value_at(path(:, 1), t), value_at(path(:, 2), t), &
                        (until - from)*h*gauss_weight(k), book)
    end do
  end subroutine book_piece

  include 'dormand_prince_step.inc'

end module adaptive_flight
