! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies while the driven one presses a soft stop, friction between them still acting: one flight in one mode (slip
!> in either direction, stick), in the penetration p and its rate. Where the force formula would pull and may not, the
!> force is nil; the surface counts as recovered as soon as it would push again.
module pair_contact
  use contact_flight, only: raise_peak_force
  use contact_law, only: contact_at_speed, contact_force, contact_margin, contact_t
  use elementary, only: sine_cosine
  use friction_law, only: power
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, march_time_over, take_step, &
    watched_system_t
  use kinds, only: wp
  use linear_flow, only: most_unknowns
  use motion_state, only: book_t, event_touch_lower, event_touch_upper, log_t, mode_stick, note_position, record_event, &
    record_sample, sample_due, sample_time, tally_t, word_lower, word_upper, append_word
  use pair, only: driven_by_motion, impact_mass, pair_t
  use pair_flight, only: body_state, driver_of, energy_of, guard_failed, guard_minus, guard_none, guard_plus, &
    guard_separate, guard_slip
  use pair_modes, only: at_control, at_cosine, at_integral, at_one, at_ramp, at_sine, at_v1, at_v2, at_x1, at_x2, &
    mode_of_slip, pair_motion_t, pair_state_t, refresh, sense_of
  use polynomial, only: degree, maximum_until, value_at
  implicit none
  private

  public :: fly_pressed, touch_stop, mode_pressed

  !> Guards of a march: slip stops, the body leaves the stop, change between pushing and not, break-away in either
  !> direction.
  integer, parameter :: slipping = 1, leaving = 2, cut = 3, plus = 4, minus = 5
  !> Unknowns: x1, v1, p, v2, integral of the control error, energy put into the stop, lost to damping, put in by the
  !> drive.
  integer, parameter :: of_x1 = 1, of_v1 = 2, of_p = 3, of_v2 = 4, of_integral = 5, of_contact = 6, of_damping = 7, &
    of_work = 8, unknowns = 8
  !> What is taken for a tie of forces, relative to their size.
  real(wp), parameter :: tie = 32*epsilon(1.0_wp)

  type, extends(watched_system_t) :: pressing_t
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

  !> m2 meets the soft stop on `side`: counts the impact and chooses the mode, as a linear damper pushes at once.
  pure subroutine touch_stop(moving, state, side, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer, intent(in) :: side
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    associate (machine => moving%machine, y => state%y)
      state%touch = side
      state%pressed = side
      state%penetration = 0
      y(at_x2) = merge(machine%upper, machine%lower, side > 0)
      state%touch_speed = side*y(at_v2)
      if (machine%carried) then
        y(at_x2) = y(at_x2) + y(at_x1)
        state%touch_speed = side*(y(at_v2) - y(at_v1))
      end if
      state%touch_speed = max(0.0_wp, state%touch_speed)
      if (state%touch_speed > moving%negligible_speed) then
        tally%impacts = tally%impacts + 1
        tally%last_impact_speed = state%touch_speed
        tally%impact_speed_sum = tally%impact_speed_sum + state%touch_speed
        call append_word(tally, merge(word_upper, word_lower, side > 0))
      end if
      if (present(log)) call record_event(log, merge(event_touch_upper, event_touch_lower, side > 0), body_state(state), &
                                          y(at_v2), driver_of(state))
      if (state%mode == mode_stick) call mode_pressed(moving, state)
    end associate
  end subroutine touch_stop

  !> Sets the mode that follows where v1 = v2 and m2 presses a soft stop. A tie sticks.
  pure subroutine mode_pressed(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    type(pressing_t) :: pressing
    real(wp) :: force, y(unknowns)
    state%mode = mode_stick
    pressing = pressing_of(moving, state)
    y = unknowns_of(state)
    force = interface_force(pressing, 0.0_wp, y)
    if (abs(force) - moving%machine%friction > tie*(moving%force_scale + abs(force))) then
      state%mode = mode_of_slip(nint(sign(1.0_wp, force)))
    end if
  end subroutine mode_pressed

  !> Flies from `state` up to `time_end` [s after the section] in its mode; `fallen` is the guard that fell (those of
  !> `pair_flight`). `hold`: only leaving the stop ends it.
  pure subroutine fly_pressed(moving, state, time_end, hold, fallen, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    logical, intent(in) :: hold
    integer, intent(out) :: fallen
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(pressing_t) :: pressing
    type(march_t) :: march
    type(pair_state_t) :: start
    type(book_t) :: book
    real(wp) :: y(unknowns), scale(unknowns), duration, time
    integer :: fell
    call refresh(moving, state)
    pressing = pressing_of(moving, state)
    y = unknowns_of(state)
    call sizes_of(moving, pressing, y, scale, duration)
    start = state
    if (present(log)) book = log%book
    call begin_march(march, pressing, moving%options%tolerance, 1e-3_wp*scale, duration, 0.0_wp, y)
    do
      call take_step(march, pressing, guards_of(moving, pressing, hold), time_end - pressing%start, fell)
      tally%steps = tally%steps + 1
      if (tally%steps > moving%options%step_budget) fell = march_failed
      call look_along(moving, pressing, march, start, book, tally, log)
      if (fell == cut) then
        pressing%pushing = .not. pressing%pushing
        y = march%y(:unknowns)
        time = march%time
        call begin_march(march, pressing, moving%options%tolerance, 1e-3_wp*scale, duration, time, y)
      else if (fell /= march_goes_on) then
        exit
      end if
    end do
    call take_over(pressing, march%time, march%y(:unknowns), state)
    if (fell == march_time_over) state%time = time_end
    state%time = min(state%time, time_end)
    fallen = guard_none
    select case (fell)
    case (slipping)
      fallen = guard_slip
    case (plus)
      fallen = guard_plus
    case (minus)
      fallen = guard_minus
    case (march_failed)
      fallen = guard_failed
    case (leaving)
      fallen = guard_separate
      state%y(at_x2) = state%y(at_x2) - pressing%side*state%penetration
      state%penetration = 0
      state%pressed = 0
    end select
    call refresh(moving, state)
    call note_position(tally, body_state(state))
  end subroutine fly_pressed

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
    pressing%pushing = pressing%contact%tension .or. margin_at(pressing, unknowns_of(state)) >= 0
  end function pressing_of

  pure function unknowns_of(state) result(y)
    type(pair_state_t), intent(in) :: state
    real(wp) :: y(unknowns)
    y = [state%y(at_x1), state%y(at_v1), state%penetration, state%y(at_v2), state%y(at_integral), 0.0_wp, 0.0_wp, 0.0_wp]
  end function unknowns_of

  !> The state at `time` [s] of a march.
  pure subroutine take_over(pressing, time, y, state)
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: time, y(unknowns)
    type(pair_state_t), intent(inout) :: state
    associate (machine => pressing%machine)
      state%time = pressing%start + time
      state%penetration = y(of_p)
      state%y(at_x1) = y(of_x1)
      state%y(at_v1) = y(of_v1)
      state%y(at_x2) = merge(machine%upper, machine%lower, pressing%side > 0) + pressing%carried*y(of_x1) &
                       + pressing%side*y(of_p)
      state%y(at_v2) = y(of_v2)
      if (pressing%sense == 0) state%y(at_v2) = y(of_v1)
      state%y(at_integral) = y(of_integral)
      state%y(at_ramp) = pressing%ramp + machine%velocity*time
    end associate
  end subroutine take_over

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

  !> Rate of penetration.
  pure real(wp) function rate_of(pressing, y)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(:)
    rate_of = pressing%side*(y(of_v2) - pressing%carried*y(of_v1))
    if (pressing%carried == 1 .and. pressing%sense == 0) rate_of = 0
  end function rate_of

  !> Force of the stop on m2, away from it.
  pure real(wp) function force_of(pressing, y)
    class(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(:)
    force_of = 0
    if (pressing%pushing) force_of = contact_force(pressing%contact, y(of_p), rate_of(pressing, y))
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
      slope(of_p) = rate_of(self, y)
      slope(of_v2) = a2
      slope(of_integral) = sum(self%reference*z) - y(of_x1)
      slope(of_contact) = force*rate_of(self, y)
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
    margin_at = sum(contact_margin(pressing%contact)*[1.0_wp, y(of_p), rate_of(pressing, y)])
  end function margin_at

  pure function guards_of(moving, pressing, hold) result(guards)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    logical, intent(in) :: hold
    type(guard_t) :: guards(minus)
    real(wp) :: margin(3)
    guards%constant = 1
    if (pressing%sense /= 0) then
      guards(slipping)%constant = 0
      guards(slipping)%coefficients([of_v1, of_v2]) = [1, -1]*pressing%sense
    end if
    if (pressing%carried == 0 .or. pressing%sense /= 0) then
      guards(leaving)%constant = 0
      guards(leaving)%coefficients(of_p) = 1
    end if
    if (.not. pressing%contact%tension) then
      margin = merge(1, -1, pressing%pushing)*contact_margin(pressing%contact)
      guards(cut)%constant = margin(1)
      guards(cut)%coefficients([of_p, of_v2]) = [margin(2), pressing%side*margin(3)]
      if (pressing%carried == 1) guards(cut)%coefficients(of_v1) = -pressing%side*margin(3)
    end if
    if (pressing%sense == 0) then
      guards([plus, minus])%margin = [1, 2]
      guards([plus, minus])%constant = 2*tie*(moving%force_scale + moving%machine%friction)
    end if
    if (.not. hold) return
    guards([slipping, plus, minus]) = guard_t(constant=1.0_wp)
  end function guards_of

  !> Sizes of the unknowns in this contact and its duration, from the approach, the forces that press, and the penetration
  !> itself.
  pure subroutine sizes_of(moving, pressing, y, scale, duration)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(unknowns)
    real(wp), intent(out) :: scale(unknowns), duration
    real(wp) :: mass, speed, depth, frequency, pressure
    mass = impact_mass(moving%machine)
    speed = abs(rate_of(pressing, y))
    pressure = moving%force_scale + moving%machine%friction
    associate (law => pressing%contact)
      depth = max(abs(y(of_p)), power((law%exponent + 1)*mass*speed**2/(2*law%stiffness), 1/(law%exponent + 1)))
      if (depth <= 0) depth = power(pressure/law%stiffness, 1/law%exponent)
      depth = max(depth, tiny(depth)**0.25_wp)
      frequency = sqrt(law%stiffness*power(depth, law%exponent - 1)/mass)
    end associate
    speed = max(speed, depth*frequency)
    scale = mass*speed**2
    scale([of_x1, of_v1, of_p, of_v2]) = [depth, speed, depth, speed]
    scale(of_integral) = depth/frequency
    duration = 3/frequency
  end subroutine sizes_of

  !> Extremes, samples and energy of the step behind; `book` is that at the start of the march's flight.
  pure subroutine look_along(moving, pressing, march, state, book, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    type(march_t), intent(in) :: march
    type(pair_state_t), intent(in) :: state
    type(book_t), intent(in) :: book
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    real(wp) :: path(0:degree), rate(0:degree), surface
    if (.not. march%fraction > 0) return
    surface = merge(moving%machine%upper, moving%machine%lower, pressing%side > 0)
    path = pressing%side*march%path(:, of_p) + pressing%carried*march%path(:, of_x1)
    path(0) = path(0) + surface
    tally%x_max = max(tally%x_max, maximum_until(path, march%fraction))
    tally%x_min = min(tally%x_min, -maximum_until(-path, march%fraction))
    if (tally%wants_v_max) tally%v_max = max(tally%v_max, maximum_until(march%path(:, of_v2), march%fraction))
    if (.not. present(log)) return
    rate = pressing%side*(march%path(:, of_v2) - pressing%carried*march%path(:, of_v1))
    log%peak_penetration = max(log%peak_penetration, maximum_until(march%path(:, of_p), march%fraction))
    if (pressing%pushing) call raise_peak_force(march%path(:, of_p), rate, march%fraction, pressing%contact, log%peak_force)
    call sample_along(moving, pressing, march, state, book, log)
    log%contact_work = log%contact_work - log%book%contact
    log%book = book_at(pressing, march%y(:unknowns), state, book)
    log%contact_work = log%contact_work + log%book%contact
  end subroutine look_along

  !> Samples of the step behind.
  pure subroutine sample_along(moving, pressing, march, state, book, log)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    type(march_t), intent(in) :: march
    type(pair_state_t), intent(in) :: state
    type(book_t), intent(in) :: book
    type(log_t), intent(inout) :: log
    type(pair_state_t) :: sample
    type(book_t) :: now
    real(wp) :: y(unknowns), t
    integer :: k
    if (log%sample_interval <= 0) return
    do
      t = max(0.0_wp, (sample_time(log) - pressing%start - march%from)/march%length)
      if (t >= march%fraction .or. .not. sample_due(log, pressing%start + march%time)) exit
      y = [(value_at(march%path(:, k), t), k=1, unknowns)]
      sample = state
      call take_over(pressing, march%from + t*march%length, y, sample)
      sample%time = sample_time(log)
      now = book_at(pressing, y, state, book)
      now%at_end = energy_of(moving, sample)
      call record_sample(log, body_state(sample), driver_of(sample), now)
    end do
  end subroutine sample_along

  !> Where the energy went by a state of the march, `state` and `book` being those at its start.
  pure function book_at(pressing, y, state, book) result(now)
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: y(unknowns)
    type(pair_state_t), intent(in) :: state
    type(book_t), intent(in) :: book
    type(book_t) :: now
    real(wp) :: slid
    now = book
    slid = (1 - pressing%carried)*(y(of_x1) - state%y(at_x1)) - pressing%side*(y(of_p) - state%penetration)
    now%friction = book%friction + pressing%sense*pressing%machine%friction*slid
    now%contact = book%contact + y(of_contact)
    now%damping = book%damping + y(of_damping)
    now%work = book%work + y(of_work)
  end function book_at

end module pair_contact
