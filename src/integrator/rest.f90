! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The body at rest: which way it goes on from zero velocity (Filippov's rule with static and kinetic
!> level), how long friction or a barrier holds it, and how a sequence of ever smaller impacts ends.
module rest
  use certified_step, only: departure_step, positive_step
  use contact_law, only: contact_constant, contact_force, restitution_at
  use curve_law, only: piece_at, piece_limits
  use effect_law, only: break_away_level, change_over_bounce, friction_change, friction_factor
  use drive_law, only: foot_motion, measured_force, next_sample
  use friction_law, only: friction_t, power
  use kinds, only: wp
  use motion_state, only: mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, &
    mode_upper_barrier, state_t
  use oscillator, only: holding_force, oscillator_t
  implicit none
  private

  public :: mode_from_rest, hold, chatter_time, chatter_speed

  !> Relative change of the acceleration over what is left of a chatter sequence at which it is
  !> completed analytically.
  real(wp), parameter :: chatter_uniformity = 1e-6_wp
  !> Longest rest of a chatter sequence that is completed, in periods: as for structures, and under a force that no spring
  !> makes. Such a force is as uniform over a bounce of any height.
  real(wp), parameter :: longest_rest = 1e-2_wp, longest_rest_under_load = 1e-6_wp
  !> The uniformity where a bounce no longer rises above the rounding of the position, so that it cannot be flown.
  real(wp), parameter :: unflown_uniformity = 0.5_wp
  !> A bounce that takes less than this share of a period ends a chatter sequence whose restitution still changes.
  real(wp), parameter :: briefest_bounce = 1e-12_wp

contains

  !> Mode of a body with zero velocity at `state%x`, `state%time`. At the edge of sticking the rate of
  !> the holding force decides; a barrier counts as holding whatever pushes against it.
  pure integer function mode_from_rest(machine, state) result(mode)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp) :: force, rate, curvature
    logical :: at_upper, at_lower, up, down
    call net_force(machine, state, force, rate, curvature)
    up = breaks_away(machine, state%x, 1, force, rate)
    down = breaks_away(machine, state%x, -1, -force, -rate)
    at_upper = state%x >= machine%contact%upper
    at_lower = state%x <= machine%contact%lower
    if (up .and. .not. at_upper) then
      mode = mode_slip_plus
    else if (down .and. .not. at_lower) then
      mode = mode_slip_minus
    else if (at_upper) then
      mode = mode_upper_barrier
    else if (at_lower) then
      mode = mode_lower_barrier
    else
      mode = mode_stick
    end if
  end function mode_from_rest

  !> The force that dry friction must hold, its rate and the bound on its second derivative, as in `holding_force`.
  pure subroutine net_force(machine, state, force, rate, curvature)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp), intent(out) :: force, rate, curvature
    real(wp) :: measured, measured_rate
    call holding_force(machine, state%x, machine%drive_frequency*state%time, force, rate, curvature)
    if (.not. machine%extra) return
    force = force - friction_factor(machine%effects, state%x)*state%z
    if (machine%drive%interval > 0) then
      call measured_force(machine%drive, state%time, measured, measured_rate)
      force = force + measured
      rate = rate + measured_rate
    end if
  end subroutine net_force

  !> Largest force in `direction` +1 or -1 that friction holds at `x` [m], in N.
  pure real(wp) function strongest_hold(machine, x, direction) result(level)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: x
    integer, intent(in) :: direction
    level = machine%friction%break_away
    if (machine%effects%present) level = break_away_level(machine%effects, machine%friction, x, direction)
  end function strongest_hold

  !> Whether a force and its rate, counted in `direction`, overcome the break-away force.
  pure logical function breaks_away(machine, x, direction, force, rate)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: x, force, rate
    integer, intent(in) :: direction
    real(wp) :: excess, rounding
    excess = force - strongest_hold(machine, x, direction)
    rounding = 32*epsilon(1.0_wp)*(machine%force_scale + abs(force))
    if (machine%contact%soft) rounding = rounding + soft_rounding(machine, x)
    if (abs(excess) <= rounding) then
      breaks_away = rate > 0
    else
      breaks_away = excess > 0
    end if
  end function breaks_away

  !> What the rounding of the position `x` [m] does to the force of a soft barrier [N].
  pure real(wp) function soft_rounding(machine, x)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: x
    real(wp) :: depth
    associate (law => machine%contact)
      depth = max(x - law%soft_upper, law%soft_lower - x)
      soft_rounding = 0
      if (depth >= 0) soft_rounding = contact_force(law, depth + 8*spacing(x), 0.0_wp) - contact_force(law, depth, 0.0_wp)
    end associate
  end function soft_rounding

  !> Keeps the body at rest until it is released or `time_end`. `state%mode` becomes the slip that follows;
  !> it stays as it is when the time is over.
  pure subroutine hold(machine, state, time_end)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    real(wp) :: force, rate, curvature, step_up, step_down, step, smallest, until
    logical :: up_open, down_open
    up_open = state%x < machine%contact%upper
    down_open = state%x > machine%contact%lower
    smallest = 4*epsilon(1.0_wp)*machine%period
    do
      call net_force(machine, state, force, rate, curvature)
      if (up_open .and. breaks_away(machine, state%x, 1, force, rate)) then
        state%mode = mode_slip_plus
        return
      else if (down_open .and. breaks_away(machine, state%x, -1, -force, -rate)) then
        state%mode = mode_slip_minus
        return
      end if
      step_up = huge(1.0_wp)
      step_down = huge(1.0_wp)
      if (up_open) step_up = holding_step(strongest_hold(machine, state%x, 1) - force, -rate, curvature)
      if (down_open) step_down = holding_step(strongest_hold(machine, state%x, -1) + force, rate, curvature)
      step = min(step_up, step_down, time_to_corner(machine, state))
      until = next_sample(machine%drive, state%time, time_end)
      if (step >= until - state%time) then
        state%time = until
        if (until >= time_end) return
      else
        state%time = state%time + max(step, smallest)
      end if
    end do
  end subroutine hold

  !> Time [s] for which the extension of the spring is proven to reach no sharp corner while the body rests.
  pure real(wp) function time_to_corner(machine, state) result(time)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp) :: foot, foot_rate, extension, limits(2), room
    integer :: i
    time = huge(time)
    if (.not. machine%effects%play%sharp) return
    call foot_motion(machine%drive, machine%drive_frequency*state%time, foot, foot_rate)
    extension = machine%restoring%free_length + foot - state%x
    limits = piece_limits(machine%effects%play, piece_at(machine%effects%play, extension))
    do i = 1, 2
      if (.not. abs(limits(i)) < huge(1.0_wp)) cycle
      room = abs(limits(i) - extension)
      time = min(time, positive_step(room, (3 - 2*i)*foot_rate*machine%drive_frequency, machine%foot_acceleration_bound))
    end do
  end function time_to_corner

  !> Time for which a reserve of force that changes at `rate` is proven to last. At the edge, where
  !> rounding hides which side it is on, the body was found to stay: step on at least a little.
  pure real(wp) function holding_step(reserve, rate, curvature) result(step)
    real(wp), intent(in) :: reserve, rate, curvature
    if (reserve > 0) then
      step = positive_step(reserve, rate, curvature)
    else
      step = departure_step(max(0.0_wp, rate), 0.0_wp, curvature, 0.0_wp)
    end if
  end function holding_step

  !> Time [s] until impacts on the barrier in `direction` +1 (upper) or -1 have died out, the body having
  !> just left it at `speed` [m/s]; -1 if they do not, or if what is left is not yet brief, with a uniform
  !> acceleration. One bounce with constant friction: out at a_out = (R + F)/m, back at a_in = (R - F)/m,
  !> the speed shrinks by k sqrt(a_in/a_out), so the times form a geometric series.
  pure real(wp) function chatter_time(machine, state, direction, speed) result(left)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    integer, intent(in) :: direction
    real(wp), intent(in) :: speed
    real(wp) :: force, rate, curvature, out, back, shrink, friction, changed(2), change, bounce
    left = -1
    call net_force(machine, state, force, rate, curvature)
    associate (law => machine%friction, effects => machine%effects)
      if (direction*force <= strongest_hold(machine, state%x, direction)) return
      friction = law%kinetic + law%excess + law%second_excess
      changed = 0
      if (effects%present) then
        changed = [friction_change(effects, -real(direction, wp), 0.0_wp), friction_change(effects, real(direction, wp), 0.0_wp)]
        friction = friction_factor(effects, state%x)*friction
        if (.not. effects%dahl_stiffness > 0) force = force - friction_factor(effects, state%x)*effects%asymmetric_coulomb
      end if
      out = (direction*force + friction + changed(1))/machine%mass
      back = (direction*force - friction - changed(2))/machine%mass
      if (back <= 0) return
      bounce = speed/out + speed/sqrt(back*out)
      shrink = sqrt(back/out)*chatter_restitution(machine, speed, bounce)
      if (shrink >= 1) return
      left = bounce/(1 - shrink)
      if (machine%drive%interval > 0 .and. left > next_sample(machine%drive, state%time, huge(left)) - state%time) left = -1
      if (left > time_to_corner(machine, state)) left = -1
      if (left < 0) return
      change = (abs(rate)*left + curvature*left**2/2 + law%damping*speed &
                + machine%restoring%stiffness*speed**2/(2*out))/machine%mass &
               + layer_change(law, speed)/machine%mass
      if (effects%nonlinear) change = change + effect_change(machine, state, speed, speed**2/(2*out))/machine%mass
      if (speed**2/(2*out) < position_rounding(machine, state%x)) then
        if (change > unflown_uniformity*back) left = -1
      else if (change > chatter_uniformity*back .or. left > longest_completion(machine)) then
        left = -1
      end if
    end associate
  end function chatter_time

  !> Longest rest of a chatter sequence [s] that is completed.
  pure real(wp) function longest_completion(machine) result(longest)
    type(oscillator_t), intent(in) :: machine
    logical :: loaded
    loaded = abs(machine%effects%offset) > 0 .or. .not. machine%natural_frequency > 0
    longest = merge(longest_rest_under_load, longest_rest, loaded)*machine%period
  end function longest_completion

  !> What rounding does to a position [m] that is the sum of an equilibrium and a response.
  pure real(wp) function position_rounding(machine, x) result(rounding)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: x
    real(wp) :: stiffness
    stiffness = max(machine%restoring%stiffness, machine%mass*machine%drive_frequency**2)
    rounding = 4*epsilon(x)*(abs(x) + machine%force_scale/stiffness)
  end function position_rounding

  !> The restitution over what is left of a chatter sequence; huge where it is not yet uniform.
  pure real(wp) function chatter_restitution(machine, speed, bounce) result(k)
    type(oscillator_t), intent(in) :: machine
    real(wp), intent(in) :: speed, bounce
    k = machine%contact%restitution
    if (machine%contact%kind == contact_constant) return
    k = restitution_at(machine%contact, speed)
    if (bounce <= briefest_bounce*machine%period) return
    if (abs(k - machine%contact%restitution) > chatter_uniformity) k = huge(k)
  end function chatter_restitution

  !> Speed [m/s] of rebound above which a chatter sequence is never completed: the acceleration changes too much on the
  !> way out alone, c v^2/(2 a_out m) > uniformity a_in, as both are at most the largest force over the mass.
  pure real(wp) function chatter_speed(machine) result(speed)
    type(oscillator_t), intent(in) :: machine
    real(wp) :: barrier, strongest
    barrier = 0
    if (machine%contact%upper < huge(1.0_wp)) barrier = abs(machine%contact%upper)
    if (machine%contact%lower > -huge(1.0_wp)) barrier = max(barrier, abs(machine%contact%lower))
    strongest = (machine%force_scale + machine%restoring%stiffness*barrier + machine%friction%kinetic + &
                 machine%friction%excess)/machine%mass
    speed = huge(1.0_wp)
    if (machine%natural_frequency > 0) speed = sqrt(2*chatter_uniformity)*strongest/machine%natural_frequency
  end function chatter_speed

  !> How much the forces of effects change over a bounce of a given speed [m/s] and height [m], in N.
  pure real(wp) function effect_change(machine, state, speed, height) result(change)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: speed, height
    real(wp) :: foot
    call foot_motion(machine%drive, machine%drive_frequency*state%time, foot)
    change = change_over_bounce(machine%effects, machine%friction, state%z, machine%restoring%free_length + foot - state%x, &
                                speed, height)
  end function effect_change

  !> How much the sliding friction changes between rest and `speed` [N].
  pure real(wp) function layer_change(law, speed)
    type(friction_t), intent(in) :: law
    real(wp), intent(in) :: speed
    layer_change = 0
    if (law%excess > 0) layer_change = &
      law%excess*min(1.0_wp, power(speed/law%stribeck_velocity, min(law%stribeck_exponent, 1.0_wp)))
    if (law%second_excess > 0) layer_change = layer_change + &
      law%second_excess*min(1.0_wp, power(speed/law%second_velocity, min(law%second_exponent, 1.0_wp)))
  end function layer_change

end module rest
