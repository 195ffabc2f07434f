! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One slip against a soft barrier, in the penetration p and its rate, so that rounding does not grow with the
!> stiffness: until the velocity falls to zero, the body leaves the barrier, or the time is over. Where the force
!> formula would pull and may not, the force is nil; the surface counts as recovered as soon as it would push again.
module contact_flight
  use contact_law, only: contact_at_speed, contact_force, contact_margin, contact_pushes, contact_t, margin_is_curved
  use drive_law, only: foot_motion, next_sample
  use effect_law, only: dahl_force, slip_memory_t
  use energy, only: balance_instant, gauss_position, gauss_points, gauss_weight, record_with_balance
  use exact_flight, only: flight_barrier, flight_failed, flight_speed_reached, flight_time_over
  use friction_law, only: power, sliding_friction
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, march_time_over, take_step, &
    watched_system_t
  use kinds, only: wp
  use march_pace, only: pace_t, watch_pace
  use motion_state, only: log_t, mode_slip_minus, mode_slip_plus, options_t, sample_due, &
    sample_time, state_t, tally_t
  use oscillator, only: extra_force, oscillator_t
  use polynomial, only: degree, maximum_until, value_at
  use restoring_law, only: restoring_force
  use table_pieces, only: enter_pieces, list_ends, margin_of_end, most_ends, piece_end_t, extension_above, push_ends, push_returns
  implicit none
  private

  public :: contact_side, fly_contact

  !> Guards: velocity zero, end of contact, change between pushing and not; after them the ends of pieces of tables.
  integer, parameter :: turning = 1, leaving = 2, cut = 3, most_guards = cut + most_ends
  !> Halvings of the golden section that finds a peak of the force.
  integer, parameter :: most_sections = 40
  real(wp), parameter :: golden = (sqrt(5.0_wp) - 1)/2

  !> A body pressed on the barrier on `side` +1 (upper) or -1. Unknowns: p [m], p' [m/s], work done on the barrier [J].
  type, extends(watched_system_t) :: pressed_t
    type(oscillator_t) :: machine
    !> Time at which the march starts [s after the section], position of the surface [m].
    real(wp) :: start = 0, surface = 0
    integer :: side = 1, direction = 1
    logical :: pushing = .true.
    type(slip_memory_t) :: memory
  contains
    procedure :: slope => pressed_slope
    procedure :: margin => extension_margin
  end type pressed_t

contains

  !> The soft barrier that a body at `x` [m] moving in `direction` +1 or -1 is in contact with: +1 upper, -1 lower, 0
  !> none.
  pure integer function contact_side(contact, x, direction) result(side)
    type(contact_t), intent(in) :: contact
    real(wp), intent(in) :: x
    integer, intent(in) :: direction
    side = 0
    if (x < contact%soft_lower .or. (direction < 0 .and. x <= contact%soft_lower)) side = -1
    if (x > contact%soft_upper .or. (direction > 0 .and. x >= contact%soft_upper)) side = 1
  end function contact_side

  !> Flies from `state` (mode slip_plus or slip_minus) up to `time_end` [s after the section], pressed on the barrier
  !> on `side`. Ends as `fly_exact` does; `flight_barrier` is the end of the contact, with x on the surface.
  pure subroutine fly_contact(machine, options, side, state, time_end, tally, outcome, log)
    type(oscillator_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    integer, intent(in) :: side
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(pressed_t) :: pressed
    type(march_t) :: march
    type(guard_t) :: guards(most_guards)
    type(pace_t) :: pace
    real(wp) :: y(3), scale(3), duration, time, until
    integer :: triggered, count_guards
    logical :: hopeless
    pressed%machine = machine
    pressed%machine%contact = contact_at_speed(machine%contact, state%touch_speed)
    pressed%side = side
    pressed%start = state%time
    pressed%surface = merge(machine%contact%soft_upper, machine%contact%soft_lower, side > 0)
    pressed%direction = merge(1, -1, state%mode == mode_slip_plus)
    pressed%memory = slip_memory_t(real(pressed%direction, wp), state%x, state%z)
    y = [side*(state%x - pressed%surface), side*state%v, 0.0_wp]
    pressed%pushing = pressed%machine%contact%tension .or. contact_pushes(pressed%machine%contact, y(1), y(2))
    call sizes_of(pressed, y, scale, duration)
    call list_guards(pressed, 0.0_wp, y, guards, count_guards)
    call begin_march(march, pressed, options%tolerance, 1e-3_wp*scale, duration, 0.0_wp, y)
    do
      until = next_sample(machine%drive, pressed%start + march%time, time_end)
      call take_step(march, pressed, guards(:count_guards), until - pressed%start, triggered)
      if (triggered == march_time_over .and. until < time_end) triggered = march_goes_on
      tally%steps = tally%steps + 1
      call watch_pace(pressed%start + march%time, time_end, options%step_budget, pace, hopeless)
      ! What it would take is more than there is.
      if (hopeless) tally%steps = options%step_budget + 1
      if (tally%steps > options%step_budget) triggered = march_failed
      call look_along(march, pressed, state%touch_speed, tally, log)
      if (triggered >= cut) then
        if (triggered == cut) pressed%pushing = .not. pressed%pushing
        y = march%y(:3)
        time = march%time
        call list_guards(pressed, time, y, guards, count_guards)
        call begin_march(march, pressed, options%tolerance, 1e-3_wp*scale, duration, time, y)
      else if (triggered /= march_goes_on) then
        exit
      end if
    end do
    state%time = merge(time_end, min(pressed%start + march%time, time_end), triggered == march_time_over)
    state%x = pressed%surface + side*march%y(1)
    state%v = side*march%y(2)
    outcome = outcome_of(triggered)
    if (outcome == flight_barrier) state%x = pressed%surface
    if (outcome == flight_speed_reached .or. pressed%direction*state%v < 0) state%v = 0
    if (machine%effects%dahl_stiffness > 0) state%z = dahl_force(machine%effects, pressed%memory, state%x)
  end subroutine fly_contact

  !> The outcome of a flight that ended so.
  pure integer function outcome_of(triggered) result(outcome)
    integer, intent(in) :: triggered
    select case (triggered)
    case (march_failed)
      outcome = flight_failed
    case (march_time_over)
      outcome = flight_time_over
    case (turning)
      outcome = flight_speed_reached
    case default
      outcome = flight_barrier
    end select
  end function outcome_of

  !> p', p'' and the power put into the barrier.
  pure function pressed_slope(self, time, y) result(slope)
    class(pressed_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y)), extension, force, push
    associate (machine => self%machine)
      extension = extension_at(self, time, y)
      force = restoring_force(machine%restoring, extension) &
              + sliding_friction(machine%friction, self%side*y(2), real(self%direction, wp))
      if (machine%extra) force = force + extra_force(machine, self%memory, self%start + time, &
                                                     self%surface + self%side*y(1), self%side*y(2), extension)
      push = 0
      if (self%pushing) push = contact_force(machine%contact, y(1), y(2))
      slope = [y(2), (self%side*force - push)/machine%mass, push*y(2)]
    end associate
  end function pressed_slope

  pure real(wp) function extension_at(pressed, time, y) result(extension)
    class(pressed_t), intent(in) :: pressed
    real(wp), intent(in) :: time, y(:)
    real(wp) :: foot
    associate (machine => pressed%machine)
      call foot_motion(machine%drive, machine%drive_frequency*(pressed%start + time), foot)
      extension = machine%restoring%free_length + foot - (pressed%surface + pressed%side*y(1))
    end associate
  end function extension_at

  !> The extension [m] of the spring, or the force of the barrier [N], with the sign that it has in a margin.
  pure real(wp) function extension_margin(self, number, time, y) result(margin)
    class(pressed_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    if (any(number == [push_ends, push_returns])) then
      margin = merge(1, -1, number == push_ends)*contact_force(self%machine%contact, y(1), y(2))
    else
      margin = merge(1, -1, number == extension_above)*extension_at(self, time, y)
    end if
  end function extension_margin

  !> What ends the contact or changes its forces from the state `y` on at `time` [s after its start]; keeps it to the pieces of
  !> the tables that it is in there.
  pure subroutine list_guards(pressed, time, y, guards, count_guards)
    type(pressed_t), intent(inout) :: pressed
    real(wp), intent(in) :: time, y(3)
    type(guard_t), intent(out) :: guards(most_guards)
    integer, intent(out) :: count_guards
    type(piece_end_t) :: pieces(most_ends)
    real(wp) :: margin(3), constant, row(2)
    integer :: inward, i, count_ends
    inward = pressed%side*pressed%direction
    guards(turning)%coefficients(2) = inward
    guards(leaving)%constant = 1
    if (inward < 0) then
      guards(leaving)%constant = 0
      guards(leaving)%coefficients(1) = 1
    end if
    guards(cut)%constant = 1
    if (.not. pressed%machine%contact%tension) then
      margin = merge(1, -1, pressed%pushing)*contact_margin(pressed%machine%contact)
      guards(cut)%constant = margin(1)
      guards(cut)%coefficients(1:2) = margin(2:3)
      if (margin_is_curved(pressed%machine%contact)) guards(cut) = guard_t(margin=merge(push_ends, push_returns, pressed%pushing))
    end if
    count_guards = cut
    associate (effects => pressed%machine%effects, side => pressed%side)
      if (.not. effects%by_table) return
      call enter_pieces(effects, pressed%surface + side*y(1), side*y(2), extension_at(pressed, time, y), pressed%memory)
      call list_ends(effects, pressed%memory, pieces, count_ends)
      do i = 1, count_ends
        associate (guard => guards(cut + i))
          call margin_of_end(pieces(i), pressed%memory%direction, constant, row, guard%margin)
          guard%constant = constant + row(1)*pressed%surface
          guard%coefficients(1:2) = side*row
        end associate
      end do
    end associate
    count_guards = cut + count_ends
  end subroutine list_guards

  !> Sizes of the unknowns in this contact and its duration, from the speed, the forces that press, and the penetration
  !> itself.
  pure subroutine sizes_of(pressed, y, scale, duration)
    type(pressed_t), intent(in) :: pressed
    real(wp), intent(in) :: y(3)
    real(wp), intent(out) :: scale(3), duration
    real(wp) :: unpressed(3), slope(3), pressing, depth, frequency
    unpressed = [0.0_wp, y(2:)]
    slope = pressed_slope(pressed, 0.0_wp, unpressed)
    associate (machine => pressed%machine, law => pressed%machine%contact)
      pressing = abs(machine%mass*slope(2)) + machine%force_scale + machine%mass*machine%foot_acceleration_bound
      depth = max(abs(y(1)), power((law%exponent + 1)*machine%mass*y(2)**2/(2*law%stiffness), 1/(law%exponent + 1)))
      if (depth <= 0) depth = power(pressing/law%stiffness, 1/law%exponent)
      depth = max(depth, tiny(depth)**0.25_wp)
      frequency = sqrt(law%stiffness*power(depth, law%exponent - 1)/machine%mass)
      scale(1) = depth
      scale(2) = max(abs(y(2)), depth*frequency)
      scale(3) = machine%mass*scale(2)**2
      duration = 3/frequency
    end associate
  end subroutine sizes_of

  !> Samples and extremes of the step behind.
  pure subroutine look_along(march, pressed, touch_speed, tally, log)
    type(march_t), intent(in) :: march
    type(pressed_t), intent(in) :: pressed
    real(wp), intent(in) :: touch_speed
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: sample
    real(wp) :: t, done
    if (.not. march%fraction > 0) return
    if (tally%needs_v_max .and. pressed%direction > 0) then
      tally%v_max = maximum_until(pressed%side*march%path(:, 2), march%fraction, tally%v_max)
    end if
    if (.not. present(log)) return
    log%peak_penetration = max(log%peak_penetration, march%y(1))
    ! Searches of orbits, which keep no balance, need no forces; to find a peak takes longer than the step.
    if (pressed%pushing .and. log%balance%kept) call raise_peak_force(march%path(:, 1), march%path(:, 2), march%fraction, &
                                                                      pressed%machine%contact, log%peak_force)
    done = 0
    sample%mode = merge(mode_slip_plus, mode_slip_minus, pressed%direction > 0)
    sample%touch_speed = touch_speed
    do while (log%sample_interval > 0)
      sample%time = sample_time(log)
      t = max(0.0_wp, (sample%time - pressed%start - march%from)/march%length)
      if (t >= march%fraction .or. .not. sample_due(log, pressed%start + march%time)) exit
      sample%x = pressed%surface + pressed%side*value_at(march%path(:, 1), t)
      sample%v = pressed%side*value_at(march%path(:, 2), t)
      call balance_piece(pressed, march, done, t, log)
      done = t
      call record_with_balance(pressed%machine, sample, log)
    end do
    call balance_piece(pressed, march, done, march%fraction, log)
  end subroutine look_along

  !> Where the energy went between two fractions of the step behind. The barrier's part is that until the second one.
  pure subroutine balance_piece(pressed, march, from, until, log)
    type(pressed_t), intent(in) :: pressed
    type(march_t), intent(in) :: march
    real(wp), intent(in) :: from, until
    type(log_t), intent(inout) :: log
    real(wp) :: t, work
    integer :: k
    if (.not. log%balance%kept) return
    do k = 1, gauss_points
      t = from + (until - from)*gauss_position(k)
      call balance_instant(pressed%machine, pressed%memory, pressed%start + march%from + t*march%length, &
                        pressed%surface + pressed%side*value_at(march%path(:, 1), t), &
                        pressed%side*value_at(march%path(:, 2), t), (until - from)*march%length*gauss_weight(k), log%balance)
    end do
    work = value_at(march%path(:, 3), until) - value_at(march%path(:, 3), from)
    if (until >= march%fraction) work = march%y(3) - value_at(march%path(:, 3), from)
    log%balance%contact = log%balance%contact + work
    log%contact_work = log%contact_work + work
  end subroutine balance_piece

  !> Raises `peak` to the largest force up to a `fraction` of a step, over which penetration and rate are polynomials: a
  !> golden section around the largest of a few.
  pure subroutine raise_peak_force(p, rate, fraction, contact, peak)
    real(wp), intent(in) :: p(0:degree), rate(0:degree), fraction
    type(contact_t), intent(in) :: contact
    real(wp), intent(inout) :: peak
    integer, parameter :: parts = 8
    real(wp) :: force(0:parts), low, high, a, b
    integer :: i
    force = [(force_at(i*fraction/parts), i=0, parts)]
    i = maxloc(force, dim=1) - 1
    low = max(i - 1, 0)*fraction/parts
    high = min(i + 1, parts)*fraction/parts
    if (2*maxval(force) < peak) return
    do i = 1, most_sections
      a = high - golden*(high - low)
      b = low + golden*(high - low)
      if (force_at(a) > force_at(b)) then
        high = b
      else
        low = a
      end if
    end do
    peak = max(peak, maxval(force), force_at(0.5_wp*(low + high)))

  contains

    pure real(wp) function force_at(t)
      real(wp), intent(in) :: t
      force_at = contact_force(contact, value_at(p, t), value_at(rate, t))
    end function force_at

  end subroutine raise_peak_force

end module contact_flight
