! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The forces of a machine for flights in lanes by series: per unit of mass, and a soft barrier whose contacts have a series.
module lane_series_law
  use contact_law, only: contact_kelvin_voigt
  use curve_law, only: continued_at, curve_t, piece_limits, pieces_of
  use effect_law, only: effects_t
  use elementary, only: exponential, logarithm
  use kinds, only: wp
  use lane_types, only: contact_series_t, factor_over_position, lane_flow_t, law_t, most_harmonics, over_position, over_play, &
    over_speed, over_speed_downwards, over_extension, series_order, table_t
  use motion, only: motion_t
  use oscillator, only: oscillator_t
  implicit none
  private

  public :: set_law, set_contact

contains

  !> The forces but those of a soft barrier, per unit of mass, for series.
  pure subroutine set_law(moving, flow)
    type(motion_t), intent(in) :: moving
    type(lane_flow_t), intent(inout) :: flow
    real(wp) :: length
    associate (law => moving%machine, m => flow%machine, l => flow%machine%law, friction => moving%machine%friction, &
               effects => moving%machine%effects)
      l%stiffness = merge(law%restoring%stiffness, 0.0_wp, law%restoring%is_linear)/law%mass
      l%pendulum = merge(0.0_wp, law%restoring%stiffness, law%restoring%is_linear)/law%mass
      l%cubic = effects%cubic/law%mass
      l%viscous = friction%damping/law%mass
      l%asymmetric_viscous = effects%asymmetric_viscous/law%mass
      l%quadratic = effects%quadratic_drag/law%mass
      l%cubic_damping = effects%cubic_damping/law%mass
      l%kinetic = friction%kinetic/law%mass
      if (.not. effects%dahl_stiffness > 0) l%asymmetric = effects%asymmetric_coulomb/law%mass
      l%offset = effects%offset/law%mass
      l%length = law%restoring%free_length + law%drive%mean
      l%excess = [friction%excess, friction%second_excess]/law%mass
      l%velocity = [friction%stribeck_velocity, friction%second_velocity]
      l%exponent = [friction%stribeck_exponent, friction%second_exponent]
      l%edge = friction%layer_speed
      l%rest_friction = l%kinetic + sum(l%excess)
      l%dahl_stiffness = effects%dahl_stiffness
      l%dahl_level = [effects%dahl_sliding, -effects%dahl_sliding] + effects%asymmetric_coulomb
      l%inverse_mass = 1/law%mass
      m%cosine(:m%harmonics) = law%drive%cosine
      m%sine(:m%harmonics) = law%drive%sine
      length = 1
      if (law%restoring%stiffness > 0) length = law%force_scale/law%restoring%stiffness
      if (length > 0) l%log_scale = logarithm(length)
      l%foot_rate = rates_of(m%drive_frequency)
      if (effects%by_table) call set_tables(effects, l)
    end associate
  end subroutine set_law

  !> (n w)^k/k! for the harmonics n = 1 ... of a drive of the angular frequency w [rad/s], with the signs of the derivatives of a
  !> cosine and a sine.
  pure function rates_of(frequency) result(rate)
    real(wp), intent(in) :: frequency
    real(wp) :: rate(0:series_order - 1, most_harmonics), size
    integer :: n, k
    do n = 1, most_harmonics
      size = 1
      do k = 0, series_order - 1
        if (k > 0) size = size*(n*frequency/k)
        rate(k, n) = merge(size, -size, mod(k, 4) < 2)
      end do
    end do
  end function rates_of

  !> The forces that tables give, per unit of mass.
  pure subroutine set_tables(effects, law)
    type(effects_t), intent(in) :: effects
    type(law_t), intent(inout) :: law
    law%has_tables = 1
    law%table(over_extension) = table_of(effects%spring, law%inverse_mass)
    law%table(over_position) = table_of(effects%force, law%inverse_mass)
    law%table(factor_over_position) = table_of(effects%over_position, 1.0_wp)
    law%table(over_play) = table_of(effects%play, effects%series_stiffness*law%inverse_mass)
    law%table(over_speed) = table_of(effects%upwards, law%inverse_mass)
    law%table(over_speed_downwards) = table_of(effects%downwards, law%inverse_mass)
    law%change_at_rest = law%inverse_mass*[continued_at(effects%upwards, 0.0_wp), continued_at(effects%downwards, 0.0_wp)]
  end subroutine set_tables

  !> A curve times a factor, by its pieces.
  pure type(table_t) function table_of(curve, factor) result(table)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: factor
    real(wp) :: limits(2)
    integer :: last, i
    last = curve%count
    if (last == 0) return
    table%knots = last
    table%from(0) = curve%at(1)
    table%from(1:last) = curve%at(:last)
    table%c(:, :last) = factor*pieces_of(curve)
    do i = 0, last
      limits = piece_limits(curve, i)
      table%low(i) = limits(1)
      table%high(i) = limits(2)
    end do
  end function table_of

  !> A soft barrier whose contacts have a series in the root of the penetration: p^n with a whole 2n, a linear one that may pull.
  pure subroutine set_contact(law, contact, available)
    type(oscillator_t), intent(in) :: law
    type(contact_series_t), intent(out) :: contact
    logical, intent(inout) :: available
    integer :: twice
    twice = nint(2*law%contact%exponent)
    contact%stiffness = law%contact%stiffness/law%mass
    contact%damping = law%contact%damping
    contact%twice_exponent = 2
    contact%by_impact = merge(1, 0, law%contact%by_impact)
    if (law%contact%kind == contact_kelvin_voigt) then
      contact%linear = 1
      contact%damping = law%contact%damping/law%mass
      available = available .and. (law%contact%tension .or. .not. law%contact%damping > 0)
    else
      contact%twice_exponent = twice
      available = available .and. abs(2*law%contact%exponent - twice) <= 0 .and. twice >= 2 .and. twice <= 6
    end if
    contact%log_stiffness = logarithm(contact%stiffness)
    call set_foot(law, contact)
  end subroutine set_contact

  !> A degree with which the polynomial of the foot holds over a step of a contact, up to an error of 1e-13 in the velocity.
  pure subroutine set_foot(law, contact)
    type(oscillator_t), intent(in) :: law
    type(contact_series_t), intent(inout) :: contact
    integer, parameter :: most = 16
    real(wp) :: speed, w, step, error, stiffness
    integer :: degree, n
    speed = max(law%foot_speed_bound, tiny(speed)**0.25_wp)
    ! A contact at this speed lasts about 3/w, of which a step is a tenth.
    associate (power => contact%twice_exponent + 2)
      w = exponential(logarithm(contact%stiffness)*2/power + logarithm(speed)*(power - 4)/power)
    end associate
    step = 0.3_wp/w
    stiffness = law%natural_frequency**2
    do degree = 3, most
      error = sum([(sqrt(law%drive%cosine(n)**2 + law%drive%sine(n)**2)*(n*law%drive_frequency)**(degree + 1), &
                   n=1, size(law%drive%cosine))])
      error = stiffness*error/gamma(degree + 3.0_wp)
      contact%foot_terms = degree
      contact%foot_time = law%period
      if (error > 0) contact%foot_time = exponential(logarithm(1e-13_wp*speed/error)/(degree + 2))
      if (contact%foot_time >= step) exit
    end do
    contact%log_foot_time = logarithm(0.5_wp*contact%foot_time)
  end subroutine set_foot

end module lane_series_law
