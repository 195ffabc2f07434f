! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies while the driven one presses a stop that is a spring with a linear damper: one flight in one mode, in closed
!> form. The unknowns are those of `linear_flow`, with penetration and its rate in the places of x2 and v2, so that rounding
!> does not grow with the stiffness.
module pair_damper
  use contact_law, only: contact_kelvin_voigt
  use kinds, only: wp
  use linear_flow, only: drop_rounding, expand, first_zero, linear_t, most_unknowns, order, prepare_linear, product_integral, &
    series_of, series_value, state_at, stretch_t
  use motion_state, only: book_t, flight_adaptive, log_t, note_position, record_sample, sample_due, sample_time, tally_t
  use pair, only: driven_by_motion
  use pair_flight, only: body_state, driver_of, energy_of, guard_failed, guard_minus, guard_none, guard_plus, guard_separate, &
    guard_slip, note_extremes
  use pair_modes, only: at_cosine, at_one, at_sine, at_v1, at_v2, at_x1, at_x2, pair_motion_t, pair_state_t, refresh, &
    speed_size, with_clocks
  use pair_pressing, only: of_rate, pressing_of, pressing_t, unknowns_of
  implicit none
  private

  public :: fly_damped, is_damper

  integer, parameter :: at_p = at_x2, at_rate = at_v2
  !> Those of `pair_flight` for the guards below.
  integer, parameter :: guard_of(5) = [guard_slip, guard_separate, guard_none, guard_plus, guard_minus]
  !> Guards: the bodies move together, m2 leaves the stop, change between pushing and not, break-away in either direction.
  integer, parameter :: slipping = 1, leaving = 2, cut = 3, plus = 4, minus = 5, guards = 5
  !> What is taken for a tie of forces, relative to their size: twice what `mode_pressed` takes.
  real(wp), parameter :: tie = 64*epsilon(1.0_wp)
  !> K/m [1/s^2] up to which powers of the matrix neither overflow nor vanish.
  real(wp), parameter :: stiffest = 1e24_wp

  !> One mode in contact. Rows are linear functions of the unknowns.
  type :: damped_t
    type(pressing_t) :: pressing
    type(linear_t) :: linear
    !> Force of the stop on m2, power of the drive per velocity of m1, guards.
    real(wp) :: force(most_unknowns) = 0, work(most_unknowns) = 0, rows(most_unknowns, guards) = 0
    logical :: active(guards) = .false.
    real(wp) :: allowance = 0
  end type damped_t

contains

  !> Whether contacts of these bodies are flown here.
  pure logical function is_damper(moving)
    type(pair_motion_t), intent(in) :: moving
    associate (law => moving%machine%contact)
      is_damper = law%kind == contact_kelvin_voigt .and. moving%options%flight /= flight_adaptive &
        .and. law%stiffness <= stiffest*min(moving%machine%mass, moving%machine%driven_mass)
    end associate
  end function is_damper

  !> Flies from `state` up to `time_end` [s after the section] in its mode; `fallen` is the guard that fell (those of
  !> `pair_flight`). `hold`: only leaving the stop ends it.
  pure subroutine fly_damped(moving, state, time_end, hold, fallen, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    logical, intent(in) :: hold
    integer, intent(out) :: fallen
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(damped_t) :: damped
    type(stretch_t) :: stretch
    real(wp) :: y(most_unknowns), time, first
    integer :: fell
    logical :: begins, was_cut
    call refresh(moving, state)
    damped%pressing = pressing_of(moving, state)
    y = state%y
    associate (of_contact => unknowns_of(damped%pressing, state))
      y([at_p, at_rate]) = [state%penetration, of_contact(of_rate)]
    end associate
    call set_mode(moving, hold, damped)
    time = state%time
    begins = .true.
    was_cut = .false.
    do
      call expand(damped%linear, y, time_end - time, stretch)
      call find_first(moving, state, damped, y, begins, was_cut, stretch, first, fell)
      call look_along(moving, damped, stretch, first, time, state, tally, log)
      tally%steps = tally%steps + 1
      y = state_at(stretch, first)
      begins = .false.
      was_cut = fell == cut
      if (fell == 0 .and. stretch%length >= time_end - time) time = time_end
      if (fell /= 0 .or. time < time_end) time = min(time + first*stretch%length, time_end)
      if (tally%steps > moving%options%step_budget) exit
      if (fell == cut) then
        damped%pressing%pushing = .not. damped%pressing%pushing
        call set_mode(moving, hold, damped)
        begins = .true.
      else if (fell /= 0 .or. time >= time_end) then
        exit
      end if
    end do
    call take_over(damped%pressing, time, y, state)
    fallen = guard_none
    if (fell > 0) fallen = guard_of(fell)
    if (tally%steps > moving%options%step_budget) fallen = guard_failed
    if (fallen == guard_separate) then
      state%y(at_x2) = state%y(at_x2) - damped%pressing%side*state%penetration
      state%penetration = 0
      state%pressed = 0
    end if
    call refresh(moving, state)
    call note_position(tally, body_state(state))
  end subroutine fly_damped

  !> Equations and guards of the mode.
  pure subroutine set_mode(moving, hold, damped)
    type(pair_motion_t), intent(in) :: moving
    logical, intent(in) :: hold
    type(damped_t), intent(inout) :: damped
    real(wp) :: bodies(most_unknowns, most_unknowns), a1(most_unknowns), a2(most_unknowns), one(most_unknowns)
    one = 0
    one(at_one) = 1
    associate (machine => moving%machine, side => damped%pressing%side, sense => damped%pressing%sense, &
               carried => damped%pressing%carried, force => damped%force)
      force = 0
      if (damped%pressing%pushing) force([at_p, at_rate]) = [machine%contact%stiffness, machine%contact%damping]
      a1 = moving%push
      if (sense == 0) then
        a1 = moving%together
        if (machine%drive /= driven_by_motion) a1 = a1 - (1 - carried)*side*force/(machine%mass + machine%driven_mass)
        a2 = a1
      else
        if (machine%drive /= driven_by_motion) a1 = (a1 + carried*side*force - sense*machine%friction*one)/machine%mass
        a2 = (sense*machine%friction*one - side*force)/machine%driven_mass
      end if
      bodies = 0
      bodies(at_x1, at_v1) = 1
      bodies(at_v1, :) = a1
      bodies(at_p, at_rate) = 1
      bodies(at_rate, :) = side*(a2 - carried*a1)
      damped%linear = prepare_linear(with_clocks(moving, bodies))
      damped%work = moving%drive
      if (machine%drive == driven_by_motion) damped%work = machine%driven_mass*a2 + (1 - carried)*side*force
      call set_guards(moving, machine%driven_mass*a2 + side*force, hold, one, damped)
    end associate
  end subroutine set_mode

  !> `interface` is the force that keeps the bodies together.
  pure subroutine set_guards(moving, interface, hold, one, damped)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: interface(most_unknowns), one(most_unknowns)
    logical, intent(in) :: hold
    type(damped_t), intent(inout) :: damped
    associate (law => moving%machine%contact, pressing => damped%pressing, rows => damped%rows)
      rows = 0
      rows([at_v1, at_rate], slipping) = pressing%sense*[1 - pressing%carried, -pressing%side]
      rows(at_p, leaving) = 1
      rows([at_p, at_rate], cut) = merge(1, -1, pressing%pushing)*[law%stiffness, law%damping]
      rows(:, plus) = moving%machine%friction*one - interface
      rows(:, minus) = moving%machine%friction*one + interface
      damped%allowance = tie*(moving%force_scale + moving%machine%friction)
      damped%active = [pressing%sense /= 0, pressing%carried == 0 .or. pressing%sense /= 0, .not. law%tension, &
                       pressing%sense == 0, pressing%sense == 0]
      if (hold) damped%active([slipping, plus, minus]) = .false.
    end associate
  end subroutine set_guards

  !> The guard that falls first over a stretch, 0 if none does, and at which fraction. `begins`: it is the first of a mode;
  !> `was_cut`: at its start the force is zero, whatever rounding says.
  pure subroutine find_first(moving, state, damped, y, begins, was_cut, stretch, first, fell)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(damped_t), intent(in) :: damped
    real(wp), intent(in) :: y(most_unknowns)
    logical, intent(in) :: begins, was_cut
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(out) :: first
    integer, intent(out) :: fell
    real(wp) :: p(0:order), sizes(most_unknowns), t
    integer :: i
    sizes = y
    sizes([at_cosine, at_sine]) = 1
    sizes(at_v1) = speed_size(moving, state)
    first = 1
    fell = 0
    do i = 1, guards
      if (.not. damped%active(i)) cycle
      p = series_of(stretch, damped%rows(:, i))
      if (i == plus .or. i == minus) p(0) = p(0) + damped%allowance
      if (i == cut .and. was_cut) p(0) = 0
      if (begins) call drop_rounding(damped%linear, damped%rows(:, i), sizes, stretch%length, p)
      t = first_zero(p)
      if (t < first .or. (t <= first .and. fell == 0)) then
        first = t
        fell = i
      end if
    end do
  end subroutine find_first

  !> The state at `time` [s after the section] and the unknowns `y` of a contact.
  pure subroutine take_over(pressing, time, y, state)
    type(pressing_t), intent(in) :: pressing
    real(wp), intent(in) :: time, y(most_unknowns)
    type(pair_state_t), intent(inout) :: state
    associate (machine => pressing%machine)
      state%time = time
      state%penetration = y(at_p)
      state%y = y
      state%y(at_x2) = merge(machine%upper, machine%lower, pressing%side > 0) + pressing%carried*y(at_x1) + pressing%side*y(at_p)
      state%y(at_v2) = pressing%side*y(at_rate) + pressing%carried*y(at_v1)
      if (pressing%sense == 0) state%y(at_v2) = y(at_v1)
    end associate
  end subroutine take_over

  !> Extremes, samples and energy of a stretch from `time` [s after the section] up to a fraction of it.
  pure subroutine look_along(moving, damped, stretch, last, time, state, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(damped_t), intent(in) :: damped
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last, time
    type(pair_state_t), intent(in) :: state
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(stretch_t) :: bodies
    type(pair_state_t) :: sample
    type(book_t) :: book
    real(wp) :: t
    bodies = stretch
    associate (pressing => damped%pressing, machine => moving%machine)
      bodies%path(at_x2, :) = pressing%side*stretch%path(at_p, :) + pressing%carried*stretch%path(at_x1, :)
      bodies%path(at_x2, 0) = bodies%path(at_x2, 0) + merge(machine%upper, machine%lower, pressing%side > 0)
      bodies%path(at_v2, :) = pressing%side*stretch%path(at_rate, :) + pressing%carried*stretch%path(at_v1, :)
      if (pressing%sense == 0) bodies%path(at_v2, :) = stretch%path(at_v1, :)
    end associate
    call note_extremes(bodies, last, tally)
    if (.not. present(log)) return
    log%peak_penetration = max(log%peak_penetration, largest(stretch%path(at_p, :), last))
    log%peak_force = max(log%peak_force, largest(series_of(stretch, damped%force), last))
    book = log%book
    do while (log%sample_interval > 0)
      t = max(0.0_wp, (sample_time(log) - time)/stretch%length)
      if (t >= last .or. .not. sample_due(log, time + last*stretch%length)) exit
      sample = state
      call take_over(damped%pressing, time + t*stretch%length, state_at(stretch, t), sample)
      sample%time = sample_time(log)
      log%book = book
      call book_stretch(moving, damped, stretch, t, log%book)
      log%book%at_end = energy_of(moving, sample)
      call record_sample(log, body_state(sample), driver_of(sample), log%book)
    end do
    log%book = book
    call book_stretch(moving, damped, stretch, last, log%book)
    log%contact_work = log%contact_work + (log%book%contact - book%contact)
  end subroutine look_along

  !> Where the energy of a stretch went, up to a fraction of it.
  pure subroutine book_stretch(moving, damped, stretch, last, book)
    type(pair_motion_t), intent(in) :: moving
    type(damped_t), intent(in) :: damped
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last
    type(book_t), intent(inout) :: book
    real(wp) :: change(most_unknowns), v1(0:order), rate(0:order)
    change = state_at(stretch, last) - stretch%path(:, 0)
    v1 = stretch%path(at_v1, :)
    rate = stretch%path(at_rate, :)
    associate (machine => moving%machine, pressing => damped%pressing, length => stretch%length)
      book%friction = book%friction + pressing%sense*machine%friction &
        *((1 - pressing%carried)*change(at_x1) - pressing%side*change(at_p))
      book%contact = book%contact + length*product_integral(series_of(stretch, damped%force), rate, last)
      if (machine%drive /= driven_by_motion .and. machine%damping > 0) book%damping = book%damping &
        + machine%damping*length*product_integral(v1, v1, last)
      if (any(abs(damped%work) > 0)) book%work = book%work &
        + length*product_integral(series_of(stretch, damped%work), v1, last)
    end associate
  end subroutine book_stretch

  !> The largest value of a series up to a fraction: at an end, or where its rate first changes sign.
  pure real(wp) function largest(p, last)
    real(wp), intent(in) :: p(0:order), last
    real(wp) :: rate(0:order), value
    integer :: k
    rate(order) = 0
    rate(:order - 1) = [((k + 1)*p(k + 1), k=0, order - 1)]
    call series_value(p, last, value)
    largest = max(p(0), value)
    call series_value(p, min(first_zero(sign(1.0_wp, rate(0))*rate), last), value)
    largest = max(largest, value)
  end function largest

end module pair_damper
