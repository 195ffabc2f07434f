! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies while the driven one presses a soft stop, friction between them still acting: one flight in one mode (slip
!> in either direction, stick). Where the force formula would pull and may not, the force is nil; the surface counts as
!> recovered as soon as it would push again.
module pair_contact
  use contact_flight, only: raise_peak_force
  use contact_law, only: contact_margin
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, march_time_over, take_step
  use kinds, only: wp
  use motion_state, only: append_word, book_t, event_touch_lower, event_touch_upper, log_t, mode_stick, note_position, &
    record_event, record_sample, sample_due, sample_time, tally_t, word_lower, word_upper
  use pair_flight, only: body_state, driver_of, energy_of, guard_failed, guard_minus, guard_none, guard_plus, &
    guard_separate, guard_slip
  use pair_modes, only: at_integral, at_ramp, at_v1, at_v2, at_x1, at_x2, mode_of_slip, pair_motion_t, pair_state_t, refresh
  use pair_pressing, only: interface_force, of_contact, of_damping, of_integral, of_p, of_rate, of_v1, of_work, of_x1, &
    pressing_of, pressing_t, sizes_of, unknowns, unknowns_of
  use polynomial, only: degree, maximum_until, value_at
  implicit none
  private

  public :: fly_pressed, touch_stop, mode_pressed

  !> Guards of a march: slip stops, the body leaves the stop, change between pushing and not, break-away in either
  !> direction.
  integer, parameter :: slipping = 1, leaving = 2, cut = 3, plus = 4, minus = 5
  !> What is taken for a tie of forces, relative to their size.
  real(wp), parameter :: tie = 32*epsilon(1.0_wp)

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
    y = unknowns_of(pressing, state)
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
    y = unknowns_of(pressing, state)
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
      state%y(at_v2) = pressing%side*y(of_rate) + pressing%carried*y(of_v1)
      if (pressing%sense == 0) state%y(at_v2) = y(of_v1)
      state%y(at_integral) = y(of_integral)
      state%y(at_ramp) = pressing%ramp + machine%velocity*time
    end associate
  end subroutine take_over

  pure function guards_of(moving, pressing, hold) result(guards)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    logical, intent(in) :: hold
    type(guard_t) :: guards(minus)
    real(wp) :: margin(3)
    guards%constant = 1
    if (pressing%sense /= 0) then
      guards(slipping)%constant = 0
      guards(slipping)%coefficients([of_v1, of_rate]) = pressing%sense*[1 - pressing%carried, -pressing%side]
    end if
    if (pressing%carried == 0 .or. pressing%sense /= 0) then
      guards(leaving)%constant = 0
      guards(leaving)%coefficients(of_p) = 1
    end if
    if (.not. pressing%contact%tension) then
      margin = merge(1, -1, pressing%pushing)*contact_margin(pressing%contact)
      guards(cut)%constant = margin(1)
      guards(cut)%coefficients([of_p, of_rate]) = margin(2:)
    end if
    if (pressing%sense == 0) then
      guards([plus, minus])%margin = [1, 2]
      guards([plus, minus])%constant = 2*tie*(moving%force_scale + moving%machine%friction)
    end if
    if (.not. hold) return
    guards([slipping, plus, minus]) = guard_t(constant=1.0_wp)
  end function guards_of

  !> Extremes, samples and energy of the step behind; `book` is that at the start of the march's flight.
  pure subroutine look_along(moving, pressing, march, state, book, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pressing_t), intent(in) :: pressing
    type(march_t), intent(in) :: march
    type(pair_state_t), intent(in) :: state
    type(book_t), intent(in) :: book
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    real(wp) :: path(0:degree), velocity(0:degree), surface
    if (.not. march%fraction > 0) return
    surface = merge(moving%machine%upper, moving%machine%lower, pressing%side > 0)
    path = pressing%side*march%path(:, of_p) + pressing%carried*march%path(:, of_x1)
    path(0) = path(0) + surface
    tally%x_max = max(tally%x_max, maximum_until(path, march%fraction))
    tally%x_min = min(tally%x_min, -maximum_until(-path, march%fraction))
    velocity = pressing%side*march%path(:, of_rate) + pressing%carried*march%path(:, of_v1)
    if (tally%wants_v_max) tally%v_max = max(tally%v_max, maximum_until(velocity, march%fraction))
    if (.not. present(log)) return
    log%peak_penetration = max(log%peak_penetration, maximum_until(march%path(:, of_p), march%fraction))
    if (pressing%pushing) call raise_peak_force(march%path(:, of_p), march%path(:, of_rate), march%fraction, &
                                                pressing%contact, log%peak_force)
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
