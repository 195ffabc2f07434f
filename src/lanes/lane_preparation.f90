! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine made ready to fly in lanes: in closed form, or in series.
module lane_preparation
  use contact_law, only: contact_hunt_crossley, contact_kelvin_voigt
  use effect_law, only: constant_force
  use elementary, only: exponential, logarithm
  use exact_flow, only: largest_damping_ratio
  use kinds, only: wp
  use lane_curve, only: restitution_curve_of
  use lane_series_law, only: set_law, set_contact
  use lane_types, only: lane_flow_t, layer_nodes, machine_t, mode_t, most_harmonics
  use layer_transit, only: gauss
  use motion, only: motion_t
  use motion_state, only: flight_adaptive
  use oscillator, only: oscillator_t
  use rest, only: chatter_speed
  implicit none
  private

  public :: prepare_lanes

  real(wp), parameter :: half_pi = acos(-1.0_wp)/2
  !> Over so many radians of the fastest part Taylor's remainder after four terms is below rounding.
  real(wp), parameter :: taylor_span = 2.5e-4_wp

  !> A harmonic is too near resonance for the periodic response if that grows to more than this multiple of the forcing.
  real(wp), parameter :: largest_amplification = 500

  !> Of a Stribeck layer with exponent 1 and 2, in units of v_s: the edge, where the excess friction is below 1e-11 of that at
  !> rest, a speed a little below, and the length of the variable of the nodes.
  real(wp), parameter :: edges(2) = [26.0_wp, 5.1_wp], levels(2) = [25.0_wp, 5.0_wp], lengths(2) = [4.0_wp, 2.0_wp]
  !> The nodes are enough up to this share of the excess friction in the acceleration.
  real(wp), parameter :: steepest = 0.35_wp
  !> A layer is thin if its edge is below this share of the speeds that the drive gives: only what is faster flies in lanes
  !> then. A thicker one is no layer but friction that depends on the speed, for series.
  real(wp), parameter :: thickest = 0.25_wp

contains

  !> Lanes of `flow%width` for one body: in closed form where its equation is linear
  !> in every mode of slip, or has a thin Stribeck layer, without a harmonic at resonance; else in series where all forces have one.
  pure subroutine prepare_lanes(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    if (moving%exact .and. .not. moving%machine%contact%soft) then
      call prepare_plain(moving, flow)
    else
      call prepare_modes(moving, flow)
    end if
    if (flow%available .or. moving%exact .and. .not. moving%layer > 0) return
    flow = lane_flow_t(width=flow%width, gpu=flow%gpu)
    call prepare_series(moving, flow)
  end subroutine prepare_lanes

  !> What does not depend on the mode.
  pure subroutine set_common(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    associate (m => flow%machine, law => moving%machine)
      m%drive_frequency = law%drive_frequency
      m%period = law%period
      m%kinetic = law%friction%kinetic/law%mass
      ! A tie is left to the event loop.
      m%break_away = (law%friction%break_away + 1e-12_wp*law%force_scale)/law%mass
      m%restitution = law%contact%restitution
      m%restitution_law = law%contact%kind
      m%coefficients = law%contact%coefficients
      m%curve = restitution_curve_of(law%contact%change)
      m%slow = chatter_speed(law)
      m%domain = moving%options%domain
      m%harmonics = size(law%drive%cosine)
    end associate
  end subroutine set_common

  !> One equation for all slips but for the sign of the friction.
  pure subroutine prepare_plain(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    real(wp) :: fastest
    flow%available = moving%flow%harmonics <= most_harmonics
    if (.not. flow%available) return
    call set_common(moving, flow)
    associate (from => moving%flow, m => flow%machine, law => moving%machine)
      m%natural = from%natural
      m%damped = from%damped
      m%decay = from%decay
      m%rest = from%equilibrium(0)
      m%offset = from%equilibrium(0) - from%equilibrium(1)
      m%upper = law%contact%upper
      m%lower = law%contact%lower
      m%bound_free = from%natural**7/from%damped
      fastest = max(from%natural, from%harmonics*from%drive_frequency)
      m%close = taylor_span/fastest
      m%stride = 0.15_wp*law%period
      call set_response(m, from%natural, from%decay, from%f_cos, from%f_sin, m%cosine, m%sine, m%bound_periodic, flow%available)
    end associate
    if (moving%layer > 0) call set_layer(moving, flow)
  end subroutine prepare_plain

  !> One equation for each mode of slip: a barrier that is a spring with a damper, friction that depends on the direction or
  !> linearly on the position.
  pure subroutine prepare_modes(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    integer :: pressed_on, direction
    associate (law => moving%machine, m => flow%machine)
      flow%available = has_linear_modes(law) .and. moving%options%flight /= flight_adaptive
      if (.not. flow%available) return
      call set_common(moving, flow)
      m%several_modes = 1
      m%natural = law%natural_frequency
      m%decay = law%friction%damping/(2*law%mass)
      m%upper = min(law%contact%upper, law%contact%soft_upper)
      m%lower = max(law%contact%lower, law%contact%soft_lower)
      m%friction_slope = law%effects%friction_slope
      if (law%contact%kind == contact_hunt_crossley) then
        call set_law(moving, flow)
        call set_contact(law, m%contact, flow%available)
        if (.not. flow%available) return
      end if
      m%force_rate = law%natural_frequency**2*law%foot_speed_bound
      do pressed_on = 0, 2
        if (pressed_on > 0 .and. .not. law%contact%kind == contact_kelvin_voigt) cycle
        if (abs(surface_of(law, pressed_on)) >= huge(1.0_wp)) cycle
        do direction = -1, 1, 2
          call set_mode(law, pressed_on, direction, m, m%mode(2*pressed_on + (1 - direction)/2), flow%available)
        end do
      end do
    end associate
  end subroutine prepare_modes

  !> Whether the force on a slipping body is linear in position and speed, in every mode.
  pure logical function has_linear_modes(law) result(linear)
    type(oscillator_t), intent(in) :: law
    associate (effects => law%effects)
      linear = law%restoring%is_linear .and. law%restoring%stiffness > 0 .and. .not. law%drive%interval > 0 .and. &
        law%friction%layer_speed <= 0 .and. size(law%drive%cosine) <= most_harmonics
      linear = linear .and. .not. any(abs([effects%quadratic_drag, effects%cubic_damping, effects%cubic, &
                                           effects%dahl_stiffness]) > 0)
      linear = linear .and. .not. effects%by_table
      linear = linear .and. .not. (abs(effects%friction_slope) > 0 .and. abs(effects%asymmetric_coulomb) > 0)
    end associate
  end function has_linear_modes

  !> The surface [m] that a body presses on, by `pressed_on` as in lane_types.hpp (0: none, and zero).
  pure real(wp) function surface_of(law, pressed_on)
    type(oscillator_t), intent(in) :: law
    integer, intent(in) :: pressed_on
    surface_of = 0
    if (pressed_on == 1) surface_of = law%contact%soft_upper
    if (pressed_on == 2) surface_of = law%contact%soft_lower
  end function surface_of

  !> The mode of a slip in `direction` +1 or -1. `available` becomes false where it has no closed form for lanes.
  pure subroutine set_mode(law, pressed_on, direction, m, mode, available)
    type(oscillator_t), intent(in) :: law
    integer, intent(in) :: pressed_on, direction
    type(machine_t), intent(in) :: m
    type(mode_t), intent(inout) :: mode
    logical, intent(inout) :: available
    real(wp) :: stiffness, damping, force, pressing, fastest
    logical :: leaving
    mode%origin = surface_of(law, pressed_on)
    pressing = merge(1, 0, pressed_on > 0)
    associate (dry => direction*law%friction%kinetic, effects => law%effects)
      stiffness = law%restoring%stiffness + pressing*law%contact%stiffness + dry*effects%friction_slope
      damping = law%friction%damping + pressing*law%contact%damping + direction*effects%asymmetric_viscous
      force = law%restoring%stiffness*(law%restoring%free_length + law%drive%mean - mode%origin) - &
        dry*(1 + effects%friction_slope*mode%origin)
      if (effects%present) force = force + constant_force(effects)
    end associate
    mode%decay = damping/(2*law%mass)
    available = available .and. stiffness > 0
    if (.not. available) return
    mode%natural = sqrt(stiffness/law%mass)
    ! A negative damping would let the free part grow beyond its bounds.
    available = mode%decay >= 0 .and. mode%decay <= largest_damping_ratio*mode%natural
    if (.not. available) return
    mode%rest = force/stiffness
    mode%damped = sqrt((mode%natural - mode%decay)*(mode%natural + mode%decay))
    leaving = (pressed_on == 1 .and. direction < 0) .or. (pressed_on == 2 .and. direction > 0)
    mode%barrier = merge(m%upper, m%lower, direction > 0)
    mode%leads_to = merge((3 - direction)/2, -1, law%contact%soft)
    if (pressed_on > 0) then
      mode%barrier = merge(0.0_wp, direction*huge(1.0_wp), leaving)
      mode%leads_to = 0
      mode%guess = half_pi/mode%damped
      if (leaving .and. .not. law%contact%tension) mode%lead = law%contact%damping/law%contact%stiffness
    end if
    fastest = max(mode%natural, m%harmonics*m%drive_frequency)
    mode%close = taylor_span/fastest
    mode%stride = min(0.15_wp*m%period, 1/mode%natural)
    mode%bound_free = mode%natural**7/mode%damped
    mode%sixth_free = mode%natural**6/mode%damped
    call set_response(m, mode%natural, mode%decay, law%restoring%stiffness/law%mass*law%drive%cosine, &
                      law%restoring%stiffness/law%mass*law%drive%sine, mode%cosine, mode%sine, mode%bound_periodic, available, &
                      mode%sixth_periodic)
  end subroutine set_mode

  !> Nodes for the passage through a Stribeck layer, exponent 1 or 2: Gauss's in q = exp(-u/length), u = w/v_s.
  pure subroutine set_layer(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    real(wp) :: node(layer_nodes), weight(layer_nodes), integral(layer_nodes, layer_nodes), q(layer_nodes), &
      share(layer_nodes), last, speeds
    integer :: delta, n, j
    flow%available = flow%available .and. moving%transit%available .and. moving%flow%decay <= 0
    if (.not. flow%available) return
    associate (law => moving%machine%friction, layer => flow%machine%layer)
      delta = nint(law%stribeck_exponent)
      call gauss(node, weight, integral)
      layer%excess = law%excess/moving%machine%mass
      layer%thickness = law%stribeck_velocity
      layer%edge = law%stribeck_velocity*edges(delta)
      layer%level = law%stribeck_velocity*levels(delta)
      layer%steepest = steepest
      speeds = sum([(n*flow%machine%drive_frequency*sqrt(flow%machine%cosine(n)**2 + flow%machine%sine(n)**2), &
                     n=1, flow%machine%harmonics)])
      layer%precision = 16*epsilon(1.0_wp)*speeds
      flow%available = layer%edge <= thickest*speeds
      if (.not. flow%available) return
      ! The speed rises while q falls from 1 to its last.
      last = exponential(-edges(delta)/lengths(delta))
      q = 0.5_wp*(1 + last) - 0.5_wp*(1 - last)*node
      layer%speed = -law%stribeck_velocity*lengths(delta)*logarithm(q)
      share = exponential(-(layer%speed/law%stribeck_velocity)**delta)
      layer%force = layer%excess*share
      associate (extension => law%stribeck_velocity*lengths(delta)*0.5_wp*(1 - last)/q)
        layer%weight = extension*weight
        do j = 1, layer_nodes
          layer%from_rest(:, j) = extension(j)*integral(:, j)
          layer%from_edge(:, j) = layer%weight(j) - layer%from_rest(:, j)
        end do
      end associate
      layer%first_from_rest = matmul(layer%from_rest, share)
      layer%first_from_edge = matmul(layer%from_edge, share)
      layer%second_from_rest = 0.5_wp*matmul(layer%from_rest, share**2)
      layer%second_from_edge = 0.5_wp*matmul(layer%from_edge, share**2)
      ! A body that leaves a barrier within the layer is left to the event loop.
      flow%slowest = layer%edge
      flow%resumes = .true.
      flow%machine%slow = max(flow%machine%slow, layer%edge)
    end associate
  end subroutine set_layer

  !> What has a series: every spring and friction but exponents of a Stribeck law other than 1 and 2, barriers that are rigid or
  !> whose contacts have one. Lanes know no coordinate on a circle.
  pure subroutine prepare_series(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    associate (law => moving%machine, friction => moving%machine%friction, effects => moving%machine%effects)
      flow%available = .not. law%drive%interval > 0 .and. size(law%drive%cosine) <= most_harmonics .and. .not. law%turn > 0
      if (friction%excess > 0) flow%available = flow%available .and. has_series(friction%stribeck_exponent)
      if (friction%second_excess > 0) flow%available = flow%available .and. has_series(friction%second_exponent)
      if (effects%dahl_stiffness > 0) flow%available = flow%available .and. &
        effects%dahl_sliding > 2*abs(effects%asymmetric_coulomb)
      if (law%contact%soft) call set_contact(law, flow%machine%contact, flow%available)
      if (.not. flow%available) return
      call set_common(moving, flow)
      call set_law(moving, flow)
      flow%machine%law%series = 1
      flow%machine%friction_slope = effects%friction_slope
      flow%machine%upper = min(law%contact%upper, law%contact%soft_upper)
      flow%machine%lower = max(law%contact%lower, law%contact%soft_lower)
      flow%machine%stride = 0.25_wp*law%period
    end associate

  contains

    pure logical function has_series(exponent)
      real(wp), intent(in) :: exponent
      has_series = abs(exponent - 1) <= 0 .or. abs(exponent - 2) <= 0
    end function has_series

  end subroutine prepare_series

  !> Periodic response of y'' + 2 g y' + w^2 y = sum f_cos cos + f_sin sin with bounds on its seventh and sixth derivative; not
  !> available at resonance.
  pure subroutine set_response(m, natural, decay, f_cos, f_sin, cosine, sine, seventh, available, sixth)
    type(machine_t), intent(in) :: m
    real(wp), intent(in) :: natural, decay, f_cos(:), f_sin(:)
    real(wp), intent(inout) :: cosine(:), sine(:), seventh
    logical, intent(inout) :: available
    real(wp), intent(inout), optional :: sixth
    real(wp) :: w, stiff, drag, size_squared
    integer :: n
    do n = 1, m%harmonics
      w = n*m%drive_frequency
      stiff = (natural - w)*(natural + w)
      drag = 2*decay*w
      size_squared = stiff**2 + drag**2
      if (size_squared*largest_amplification**2 < natural**4) then
        available = .false.
        return
      end if
      cosine(n) = (stiff*f_cos(n) - drag*f_sin(n))/size_squared
      sine(n) = (stiff*f_sin(n) + drag*f_cos(n))/size_squared
      seventh = seventh + sqrt(cosine(n)**2 + sine(n)**2)*w**7
      if (present(sixth)) sixth = sixth + sqrt(cosine(n)**2 + sine(n)**2)*w**6
    end do
  end subroutine set_response

end module lane_preparation
