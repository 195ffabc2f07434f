! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Effects added to a machine that are not one of its own laws with other numbers, and what a sensor shows. While
!> sliding in direction s = +1 or -1 at the position x, the spring stretched by l, they add the force
!>   F - c s v^2 - c3 v^3 - b s v + k3 l^3 + q(l) + r(x) - (K + E)(h - 1) s - a h - g_s(|v|) s,  h = max(0, 1 + slope x + p(x)),
!> K + E being the dry friction of the machine, g_+, g_-, p, q and r functions given by tables. Free play g in series with
!> the linear spring k l makes its force k d(l): nothing within the play and l -+ g/2 beyond it, with corners that parabolas
!> may round within e of them. Dahl's friction -h z takes the
!> position of all dry friction. As the velocity keeps its sign over a slip, z' = sigma (1 - z s/K) v has the closed form
!>   z = s K + (z_0 - s K) exp(-sigma s (x - x_0)/K),  K the level in that direction.
module effect_law
  use curve_law, only: continued_at, curve_of, curve_t, integral_of, most_bent, slope_of, steepest
  use elementary, only: exponential
  use friction_law, only: friction_t, stribeck_excess
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, value_of
  implicit none
  private

  public :: add_to_effects, add_to_sensor, replace_friction, finish_effects, effect_force, effect_energy, &
    effect_losses, friction_factor, break_away_level, dahl_level, dahl_force, constant_force, observed, &
    friction_change, change_over_bounce, slip_in_series, extension_force, extension_slope, extension_bounds, position_force

  real(wp), parameter :: farthest_behind = 100

  !> The effects whose force lanes have a series for (`lane_preparation`): machines with others fly in the event loop.
  character(len=*), parameter :: with_series(12) = [character(len=27) :: 'quadratic_drag', 'cubic_damping', 'asymmetric_friction', &
    'position_dependent_friction', 'cubic_spring', 'offset_force', 'dahl', 'friction_curve', 'friction_position_curve', &
    'spring_curve', 'force_curve', 'backlash']

  type, public :: effects_t
    !> Any force at all, one that leaves no closed form, and one that lanes have no series for.
    logical :: present = .false., nonlinear = .false., unknown_to_lanes = .false.
    !> A force that only the position of body and foot sets, beside the cubic spring and the offset; any that the position changes.
    logical :: by_position_table = .false., by_position = .false.
    !> A force that a table gives.
    logical :: by_table = .false.
    !> Dry friction; any force that is another one after the motion has turned round.
    logical :: dry = .false., turns_round = .false.
    !> c [N s^2/m^2], b [N s/m], a [N], slope [1/m], k3 [N/m^3], F [N].
    real(wp) :: quadratic_drag = 0, asymmetric_viscous = 0, asymmetric_coulomb = 0, friction_slope = 0, cubic = 0, offset = 0
    !> c3 [N s^3/m^3].
    real(wp) :: cubic_damping = 0
    !> Dahl's friction: sigma [N/m], 0 = none, and mean sliding level [N].
    real(wp) :: dahl_stiffness = 0, dahl_sliding = 0
    !> g_+ and g_- [N] over the speed [m/s], p over the position [m]; without knots where there is none.
    type(curve_t) :: upwards, downwards, over_position
    !> q [N] over the extension [m], r [N] over the position [m].
    type(curve_t) :: spring, force
    !> Free play: d(l) - l [m] over the extension, without knots where there is none, and k [N/m] of the spring in series with it.
    type(curve_t) :: play
    real(wp) :: series_stiffness = 0
  end type effects_t

  !> A slip: its direction, and where it began with which z [N]. The pieces of the tables that it keeps to, -1 = those that it
  !> happens to be in.
  type, public :: slip_memory_t
    real(wp) :: direction = 1, x = 0, z = 0
    integer :: in_spring = -1, in_play = -1, in_force = -1, in_position = -1, in_speed = -1
  end type slip_memory_t

  !> What is recorded at t: (1 + gain) x(t - delay) + bias.
  type, public :: sensor_t
    real(wp) :: bias = 0, gain = 0, delay = 0
  end type sensor_t

contains

  !> Adds the effect of a choice of the family `effect`, if it is one of these.
  pure subroutine add_to_effects(effects, choice)
    type(effects_t), intent(inout) :: effects
    type(law_choice_t), intent(in) :: choice
    select case (choice%name)
    case ('quadratic_drag')
      effects%quadratic_drag = value_of(choice, 'coefficient')
    case ('cubic_damping')
      effects%cubic_damping = value_of(choice, 'coefficient')
    case ('asymmetric_friction')
      effects%asymmetric_coulomb = value_of(choice, 'coulomb')
      effects%asymmetric_viscous = value_of(choice, 'viscous')
    case ('position_dependent_friction')
      effects%friction_slope = value_of(choice, 'slope')
    case ('cubic_spring')
      effects%cubic = value_of(choice, 'stiffness')
    case ('offset_force')
      effects%offset = value_of(choice, 'force')
    case ('dahl')
      effects%dahl_stiffness = value_of(choice, 'stiffness')
    case ('friction_curve')
      if (.not. any(abs([list_of(choice, 'upwards'), list_of(choice, 'downwards')]) > 0)) return
      effects%upwards = curve_of(list_of(choice, 'speed'), list_of(choice, 'upwards'))
      effects%downwards = curve_of(list_of(choice, 'speed'), list_of(choice, 'downwards'))
    case ('friction_position_curve')
      if (.not. any(abs(list_of(choice, 'change')) > 0)) return
      effects%over_position = curve_of(list_of(choice, 'position'), list_of(choice, 'change'))
    case ('spring_curve')
      if (.not. any(abs(list_of(choice, 'force')) > 0)) return
      effects%spring = curve_of(list_of(choice, 'extension'), list_of(choice, 'force'))
    case ('force_curve')
      if (.not. any(abs(list_of(choice, 'force')) > 0)) return
      effects%force = curve_of(list_of(choice, 'position'), list_of(choice, 'force'))
    case ('backlash')
      if (value_of(choice, 'gap') > 0) effects%play = play_of(value_of(choice, 'gap'), value_of(choice, 'rounding'))
    case default
      return
    end select
    effects%unknown_to_lanes = effects%unknown_to_lanes .or. .not. any(choice%name == with_series)
  end subroutine add_to_effects

  !> The same for what a sensor shows.
  pure subroutine add_to_sensor(sensor, choice)
    type(sensor_t), intent(inout) :: sensor
    type(law_choice_t), intent(in) :: choice
    select case (choice%name)
    case ('sensor_bias')
      sensor%bias = value_of(choice, 'bias')
    case ('sensor_gain')
      sensor%gain = value_of(choice, 'gain')
    case ('sensor_delay')
      sensor%delay = value_of(choice, 'delay')
    end select
  end subroutine add_to_sensor

  !> Dahl's friction, where it is, replaces the dry friction of the machine.
  pure subroutine replace_friction(effects, friction)
    type(effects_t), intent(inout) :: effects
    type(friction_t), intent(inout) :: friction
    if (.not. effects%dahl_stiffness > 0) return
    effects%dahl_sliding = friction%kinetic
    friction = friction_t(damping=friction%damping)
  end subroutine replace_friction

  !> Free play, where it is, is in series with a linear spring of `stiffness` [N/m].
  pure subroutine slip_in_series(effects, stiffness)
    type(effects_t), intent(inout) :: effects
    real(wp), intent(in) :: stiffness
    if (effects%play%count > 0) effects%series_stiffness = stiffness
  end subroutine slip_in_series

  !> What the effects together mean for those who fly, vary or prepare a machine.
  pure subroutine finish_effects(effects)
    type(effects_t), intent(inout) :: effects
    effects%by_position_table = effects%play%count > 0 .or. effects%spring%count > 0 .or. effects%force%count > 0
    effects%by_position = effects%by_position_table .or. any(abs([effects%cubic, effects%friction_slope]) > 0) .or. &
                       effects%over_position%count > 0
    effects%dry = abs(effects%asymmetric_coulomb) > 0 .or. effects%upwards%count > 0
    effects%turns_round = effects%dry .or. any(abs([effects%quadratic_drag, effects%asymmetric_viscous]) > 0)
    effects%by_table = any([effects%upwards%count, effects%over_position%count, effects%spring%count, effects%play%count, &
                            effects%force%count] > 0)
    effects%nonlinear = effects%dahl_stiffness > 0 .or. effects%by_position .or. effects%by_table .or. &
      effects%unknown_to_lanes .or. &
                        any(abs([effects%quadratic_drag, effects%cubic_damping, effects%asymmetric_viscous]) > 0)
    effects%present = effects%nonlinear .or. any(abs([effects%asymmetric_coulomb, effects%offset]) > 0)
  end subroutine finish_effects

  !> Force [N] on a body at `x` [m] that slips at `v` [m/s] in the direction and pieces of `slip`, the spring being stretched by
  !> `extension` [m]. Continued smoothly beyond v = 0, where a slip ends.
  pure real(wp) function effect_force(effects, friction, slip, x, v, extension) result(force)
    type(effects_t), intent(in) :: effects
    type(friction_t), intent(in) :: friction
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: x, v, extension
    real(wp) :: factor
    force = effects%offset - slip%direction*(effects%quadratic_drag*v + effects%asymmetric_viscous)*v + effects%cubic*extension**3
    if (effects%dahl_stiffness > 0) then
      force = force - friction_factor(effects, x, slip%in_position)*dahl_force(effects, slip, x)
    else if (abs(effects%friction_slope) > 0 .or. effects%over_position%count > 0) then
      factor = friction_factor(effects, x, slip%in_position)
      force = force - slip%direction*(factor - 1)*(friction%kinetic + stribeck_excess(friction, slip%direction*v)) &
              - factor*effects%asymmetric_coulomb
    else
      force = force - effects%asymmetric_coulomb
    end if
    if (effects%upwards%count > 0) force = force - slip%direction* &
      friction_change(effects, slip%direction, slip%direction*v, slip%in_speed)
    if (effects%cubic_damping > 0) force = force - effects%cubic_damping*v**3
    if (effects%by_position_table) force = force + play_and_table(effects, extension, slip%in_spring, slip%in_play) &
                                     + continued_at(effects%force, x, slip%in_force)
  end function effect_force

  !> Bound [N] on the change of the forces over a bounce of a given `speed` [m/s] and `height` [m] from a position where Dahl's
  !> friction is `z` [N] and the spring stretched by `extension` [m].
  pure real(wp) function change_over_bounce(effects, friction, z, extension, speed, height) result(change)
    type(effects_t), intent(in) :: effects
    type(friction_t), intent(in) :: friction
    real(wp), intent(in) :: z, extension, speed, height
    real(wp) :: bounds(2)
    change = (effects%quadratic_drag*speed + abs(effects%asymmetric_viscous))*speed + height* &
             (3*abs(effects%cubic)*extension**2 + 2*effects%dahl_stiffness + &
              (abs(effects%friction_slope) + steepest(effects%over_position))* &
              (friction%kinetic + friction%excess + friction%second_excess + abs(effects%asymmetric_coulomb) + abs(z)))
    change = change + max(steepest(effects%upwards), steepest(effects%downwards))*speed + effects%cubic_damping*speed**3
    if (.not. effects%by_position_table) return
    bounds = extension_bounds(effects)
    change = change + height*(bounds(1) + steepest(effects%force))
  end function change_over_bounce

  !> Force [N] by which cubic spring, table and free play change that of the spring at an `extension` [m].
  pure real(wp) function extension_force(effects, extension) result(force)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: extension
    force = effects%cubic*extension**3
    if (effects%by_position_table) force = force + play_and_table(effects, extension)
  end function extension_force

  pure real(wp) function play_and_table(effects, extension, in_spring, in_play) result(force)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: extension
    integer, intent(in), optional :: in_spring, in_play
    force = continued_at(effects%spring, extension, in_spring) &
            + effects%series_stiffness*continued_at(effects%play, extension, in_play)
  end function play_and_table

  !> d(l) - l [m] over the extension l for a play of `gap` [m]. Its corners are sharp, or rounded within `rounding` times the gap:
  !> with the slope 0 beyond the play and -1 within, a cubic between is a parabola.
  pure type(curve_t) function play_of(gap, rounding) result(play)
    real(wp), intent(in) :: gap, rounding
    real(wp) :: inner, outer
    if (.not. rounding > 0) then
      play%count = 2
      play%sharp = .true.
      play%at(:2) = [-gap/2, gap/2]
      play%value(:2) = [gap/2, -gap/2]
      play%slope(:2) = [-1, 0]
      return
    end if
    inner = (0.5_wp - rounding)*gap
    outer = (0.5_wp + rounding)*gap
    play%count = 4
    play%at(:4) = [-outer, -inner, inner, outer]
    play%value(:4) = [gap/2, inner, -inner, -gap/2]
    play%slope(:4) = [0, -1, -1, 0]
  end function play_of

  !> Derivative of `extension_force` by the extension [N/m].
  pure real(wp) function extension_slope(effects, extension) result(slope)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: extension
    slope = 3*effects%cubic*extension**2
    if (.not. effects%by_position_table) return
    slope = slope + slope_of(effects%spring, extension) + effects%series_stiffness*slope_of(effects%play, extension)
  end function extension_slope

  !> Bounds on the first [N/m] and second [N/m^2] derivative of the table over the extension and of the play. Those at a
  !> `extension` [m] hold up to the next sharp corner, the first with the sign of a sharp play.
  pure function extension_bounds(effects, extension) result(bounds)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in), optional :: extension
    real(wp) :: bounds(2), of_play(2)
    of_play = [steepest(effects%play), most_bent(effects%play)]
    if (present(extension) .and. effects%play%sharp) of_play = [slope_of(effects%play, extension), 0.0_wp]
    bounds = [steepest(effects%spring), most_bent(effects%spring)] + effects%series_stiffness*of_play
  end function extension_bounds

  !> r [N], a force over the position `x` [m].
  pure real(wp) function position_force(effects, x) result(force)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: x
    force = continued_at(effects%force, x)
  end function position_force

  !> Energy [J] of a body at `x` [m], the spring being stretched by `extension` [m], in what only the position sets.
  pure real(wp) function effect_energy(effects, x, extension) result(energy)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: x, extension
    energy = effects%cubic*extension**4/4 - effects%offset*x
    if (.not. effects%by_position_table) return
    energy = energy + integral_of(effects%spring, extension) + effects%series_stiffness*integral_of(effects%play, extension) &
             - integral_of(effects%force, x)
  end function effect_energy

  !> Power [W] that dry friction and damping lose to the effects beyond what the law of friction loses without them.
  pure function effect_losses(effects, friction, slip, x, v) result(losses)
    type(effects_t), intent(in) :: effects
    type(friction_t), intent(in) :: friction
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: x, v
    real(wp) :: losses(2), factor
    factor = friction_factor(effects, x)
    if (effects%dahl_stiffness > 0) then
      losses(1) = factor*dahl_force(effects, slip, x)*v
    else
      losses(1) = (factor - 1)*(friction%kinetic + stribeck_excess(friction, abs(v)))*abs(v) &
                  + factor*effects%asymmetric_coulomb*v
    end if
    losses(1) = losses(1) + friction_change(effects, slip%direction, abs(v))*abs(v)
    losses(2) = (effects%quadratic_drag*abs(v) + effects%asymmetric_viscous*slip%direction)*v**2 + effects%cubic_damping*v**4
  end function effect_losses

  !> h, by which the position `x` [m] changes dry friction.
  pure elemental real(wp) function friction_factor(effects, x, piece) result(factor)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: x
    integer, intent(in), optional :: piece
    factor = 1 + effects%friction_slope*x
    if (effects%over_position%count > 0) factor = factor + continued_at(effects%over_position, x, piece)
    factor = max(0.0_wp, factor)
  end function friction_factor

  !> g [N], by which the sliding speed `speed` [m/s] in `direction` +1 or -1 changes friction; smooth continuation below zero.
  pure real(wp) function friction_change(effects, direction, speed, piece) result(change)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: direction, speed
    integer, intent(in), optional :: piece
    change = 0
    if (effects%upwards%count == 0) return
    if (direction > 0) then
      change = continued_at(effects%upwards, speed, piece)
    else
      change = continued_at(effects%downwards, speed, piece)
    end if
  end function friction_change

  !> Largest force [N] in `direction` +1 or -1 that holds no body at `x` [m].
  pure real(wp) function break_away_level(effects, friction, x, direction) result(level)
    type(effects_t), intent(in) :: effects
    type(friction_t), intent(in) :: friction
    real(wp), intent(in) :: x
    integer, intent(in) :: direction
    level = 0
    if (effects%dahl_stiffness > 0) return
    level = friction_factor(effects, x)*(friction%break_away + direction*effects%asymmetric_coulomb)
    if (effects%upwards%count > 0) level = max(0.0_wp, level + friction_change(effects, real(direction, wp), 0.0_wp))
  end function break_away_level

  !> Dahl's z [N] after a long slip in `direction`; 0 at rest, and without Dahl's friction.
  pure elemental real(wp) function dahl_level(effects, direction) result(z)
    type(effects_t), intent(in) :: effects
    real(wp), intent(in) :: direction
    z = 0
    if (effects%dahl_stiffness > 0) z = direction*effects%dahl_sliding + abs(direction)*effects%asymmetric_coulomb
  end function dahl_level

  !> Dahl's z [N] where a slip has come to `x` [m].
  pure real(wp) function dahl_force(effects, slip, x) result(z)
    type(effects_t), intent(in) :: effects
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: x
    real(wp) :: level
    z = 0
    level = dahl_level(effects, slip%direction)
    ! A trial step may look far behind the start.
    if (abs(level) > 0) z = level + (slip%z - level)*exponential(min(farthest_behind, &
                                                                     -effects%dahl_stiffness*(x - slip%x)/level))
  end function dahl_force

  !> The part of the force [N] that is the same wherever the body slides.
  pure real(wp) function constant_force(effects) result(force)
    type(effects_t), intent(in) :: effects
    force = effects%offset - effects%asymmetric_coulomb
  end function constant_force

  !> What a sensor shows of a position [m].
  pure elemental real(wp) function observed(sensor, x)
    type(sensor_t), intent(in) :: sensor
    real(wp), intent(in) :: x
    observed = (1 + sensor%gain)*x + sensor%bias
  end function observed

end module effect_law
