! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies while the driven one presses a soft stop: the differential equations of one mode, in the penetration p and its
!> rate, so that rounding does not grow with the stiffness or with the velocity of the driving body.
module pair_pressing
  use contact_law, only: contact_at_speed, contact_force, contact_margin, contact_t
  use elementary, only: sine_cosine
  use friction_law, only: power
  use guarded_march, only: watched_system_t
  use kinds, only: wp
  use linear_flow, only: most_unknowns
  use pair, only: driven_by_controller, driven_by_motion, impact_mass, pair_t
  use pair_modes, only: at_control, at_cosine, at_integral, at_one, at_ramp, at_sine, at_v1, at_v2, at_x1, pair_motion_t, &
    pair_state_t, sense_of
  implicit none
  private

  public :: pressing_of, unknowns_of, interface_force, margin_at, sizes_of

  !> Unknowns: x1, v1, p, p', integral of the control error, energy put into the stop, lost to damping, put in by the
  !> drive.
  integer, parameter, public :: of_x1 = 1, of_v1 = 2, of_p = 3, of_rate = 4, of_integral = 5, of_contact = 6, of_damping = 7, &
    of_work = 8, unknowns = 8

  type, extends(watched_system_t), public :: pressing_t
    type(pair_t) :: machine
    type(contact_t) :: contact
    real(wp), dimension(most_unknowns) :: push = 0, drive = 0, reference = 0
    !> What the controller holds [N] and how far its reference has run [m], at the start of the march [s after the section].
    real(wp) :: control = 0, ramp = 0, start = 0
    !> Of the stop +1 upper or -1, and of v1 - v2, 0 while the bodies move together.
    integer :: side = 1, sense = 0
    !> 1 where m1 carries the stop, else 0.
    integer :: carried = 0
    logical :: pushing = .true.
  contains
    procedure :: slope => pressed_slope
    procedure :: margin => interface_margin
  end type pressing_t

contains

  pure function pressing_of(moving, state) result(pressing)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(pressing_t) :: pressing
    pressing%machine = moving%machine
    pressing%contact = contact_at_speed(moving%machine%contact, state%touch_speed)
    pressing%push = moving%push
    pressing%drive = moving%drive
    pressing%reference = moving%reference
    pressing%control = state%y(at_control)
    pressing%ramp = state%y(at_ramp)
    pressing%start = state%time
    pressing%side = state%pressed
    pressing%sense = sense_of(state%mode)
    pressing%carried = merge(1, 0, moving%machine%carried)
    pressing%pushing = pressing%contact%tension .or. margin_at(pressing, unknowns_of(pressing, state)) >= 0
  end function pressing_of

  pure function unknowns_of(pressing, state) result(y)
    type(pressing_t), intent(in) :: pressing
    type(pair_state_t), intent(in) :: state
    real(wp) :: y(unknowns)
    y = 0
    y([of_x1, of_v1, of_p, of_integral]) = [state%y(at_x1), state%y(at_v1), state%penetration, state%y(at_integral)]
    y(of_rate) = pressing%side*(state%y(at_v2) - pressing%carried*state%y(at_v1))
    if (pressing%carried == 1 .and. pressing%sense == 0) y(of_rate) = 0
  end function unknowns_of

  !> All unknowns that drive and decide, at a state of the march.
  pure function full_state(pressing, time, y) result(z)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: time, y(:)
    real(wp) :: z(most_unknowns)
    z = 0
    z(at_x1) = y(of_x1)
    z(at_v1) = y(of_v1)
    call sine_cosine(pressing%machine%frequency*(pressing%start + time), z(at_sine), z(at_cosine))
    z(at_one) = 1
    z(at_integral) = y(of_integral)
    z(at_ramp) = pressing%ramp + pressing%machine%velocity*time
    z(at_control) = pressing%control
  end function full_state

  !> Force of the stop on m2, away from it.
  pure real(wp) function force_of(pressing, y)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(:)
    force_of = 0
    if (pressing%pushing) force_of = contact_force(pressing%contact, y(of_p), y(of_rate))
  end function force_of

  !> Acceleration that the bodies have together.
  pure real(wp) function together(pressing, z, force)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: z(most_unknowns), force
    together = sum(pressing%push*z)
    if (pressing%machine%drive == driven_by_motion) return
    together = (together - (1 - pressing%carried)*pressing%side*force)/(pressing%machine%mass + pressing%machine%driven_mass)
  end function together

  !> Force of the interface that keeps the bodies together.
  pure real(wp) function interface_force(pressing, time, y)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: time, y(:)
    real(wp) :: force
    force = force_of(pressing, y)
    interface_force = pressing%machine%driven_mass*together(pressing, full_state(pressing, time, y), force) &
                      + pressing%side*force
  end function interface_force

  !> What the interface has left upwards (1) and downwards (2) [N].
  pure real(wp) function interface_margin(self, number, time, y) result(margin)
    class(pressing_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    margin = self%machine%friction - merge(1, -1, number == 1)*interface_force(self, time, y)
  end function interface_margin

  pure function pressed_slope(self, time, y) result(slope)
    class(pressing_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y))
    real(wp) :: z(most_unknowns), force, a1, a2
    z = full_state(self, time, y)
    force = force_of(self, y)
    associate (machine => self%machine)
      if (self%sense == 0) then
        a1 = together(self, z, force)
        a2 = a1
      else
        a1 = sum(self%push*z)
        if (machine%drive /= driven_by_motion) then
          a1 = (a1 - self%sense*machine%friction + self%carried*self%side*force)/machine%mass
        end if
        a2 = (self%sense*machine%friction - self%side*force)/machine%driven_mass
      end if
      slope = 0
      slope(of_x1) = y(of_v1)
      slope(of_v1) = a1
      slope(of_p) = y(of_rate)
      slope(of_rate) = self%side*(a2 - self%carried*a1)
      if (machine%drive == driven_by_controller .and. .not. machine%sample_time > 0) then
        slope(of_integral) = sum(self%reference*z) - y(of_x1)
      end if
      slope(of_contact) = force*y(of_rate)
      if (machine%drive == driven_by_motion) then
        slope(of_work) = (machine%driven_mass*a2 + (1 - self%carried)*self%side*force)*y(of_v1)
      else
        slope(of_damping) = machine%damping*y(of_v1)**2
        slope(of_work) = sum(self%drive*z)*y(of_v1)
      end if
    end associate
  end function pressed_slope

  pure real(wp) function margin_at(pressing, y)
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(:)
    margin_at = sum(contact_margin(pressing%contact)*[1.0_wp, y(of_p), y(of_rate)])
  end function margin_at

  !> Sizes of the unknowns in this contact and its duration, from the approach, the forces that press, and the penetration
  !> itself.
  pure subroutine sizes_of(moving, pressing, y, scale, duration)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(unknowns)
    real(wp), intent(out) :: scale(unknowns), duration
    real(wp) :: slope(unknowns), mass, speed, depth, frequency, pressure
    slope = pressing%slope(0.0_wp, y)
    mass = impact_mass(moving%machine)
    speed = abs(y(of_rate))
    pressure = moving%force_scale + moving%machine%friction
    associate (law => pressing%contact)
      depth = max(abs(y(of_p)), power((law%exponent + 1)*mass*speed**2/(2*law%stiffness), 1/(law%exponent + 1)))
      if (depth <= 0) depth = power(pressure/law%stiffness, 1/law%exponent)
      depth = max(depth, tiny(depth)**0.25_wp)
      frequency = sqrt(law%stiffness*power(depth, law%exponent - 1)/mass)
    end associate
    speed = max(speed, depth*frequency)
    scale([of_p, of_rate, of_contact]) = [depth, speed, mass*speed**2]
    ! What goes by while the contact lasts is rounded on its own scale; energies that decide nothing do not shorten steps.
    scale([of_x1, of_v1, of_integral]) = 100*(abs(slope([of_x1, of_v1, of_integral]))/frequency) &
                                    + [depth, speed, depth/frequency]
    scale([of_damping, of_work]) = huge(1.0_wp)
    duration = 3/frequency
  end subroutine sizes_of

end module pair_pressing
