! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of two bodies in one mode, in closed form, up to the first guard that falls: relative velocity zero, a
!> stop, the break-away of the interface, or the release from the stop.
module pair_flight
  use constants, only: unreachable
  use kinds, only: wp
  use linear_flow, only: drop_rounding, expand, first_zero, is_above, most_unknowns, order, product_integral, series_of, &
    series_value, state_at, stretch_t, stride
  use motion_state, only: book_t, log_t, mode_held, mode_slip_minus, mode_slip_plus, mode_stick, note_position, record_sample, &
    sample_due, sample_time, state_t, tally_t
  use pair, only: driven_by_motion
  use pair_modes, only: at_cosine, at_one, at_sine, at_v1, at_v2, at_x1, at_x2, interface_row, of_driven, of_lower, of_minus, &
    of_plus, of_rate, of_slip, of_upper, pair_motion_t, pair_state_t, refresh, sense_of, speed_size, stop_row
  implicit none
  private

  public :: fly_pair, body_state, driver_of, energy_of, note_extremes

  !> Guards.
  integer, parameter, public :: guard_none = 0, guard_upper = of_upper, guard_lower = of_lower, guard_slip = of_slip, &
    guard_plus = of_plus, guard_minus = of_minus, guard_press = 6, guard_leave = 7
  integer, parameter :: guards = 7
  !> Of a contact with a soft stop: its end; no step is short enough.
  integer, parameter, public :: guard_separate = 8, guard_failed = 9
  !> Twice what `mode_together` takes for a tie, which it decides by the rate.
  real(wp), parameter :: tie_allowance = 64*epsilon(1.0_wp)

  !> A linear function of the unknowns that is positive as long as the mode lasts.
  type :: watch_t
    logical :: active = .false.
    real(wp) :: row(most_unknowns) = 0
    !> It has just been zero: it is so at the start, whatever rounding says.
    logical :: starts_at_zero = .false.
    !> A force falls when it is below zero by more than rounding.
    real(wp) :: allowance = 0
  end type watch_t

contains

  !> Flies from `state` up to `time_end` [s after the section] in its mode. `fallen` is the guard that fell, or
  !> `guard_none` at the end of the time. `hold`: nothing ends the mode.
  pure subroutine fly_pair(moving, state, time_end, hold, fallen, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    logical, intent(in) :: hold
    integer, intent(out) :: fallen
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(watch_t) :: watches(guards)
    type(stretch_t) :: stretch
    real(wp) :: p(0:order), t, first, sizes(most_unknowns)
    integer :: i
    logical :: begins, sure(guards)
    call refresh(moving, state)
    watches = watches_of(moving, state, hold)
    ! The ties that choose a mode are taken in units of the amplitudes.
    sizes = state%y
    sizes([at_cosine, at_sine]) = 1
    sizes(at_v1) = speed_size(moving, state)
    sizes(at_x1) = max(abs(sizes(at_x1)), moving%swing*sizes(at_v1))
    begins = .true.
    do
      sure = are_sure(moving, state, watches, sizes, begins)
      if (all(sure)) then
        if (moving%modes(state%mode)%rate*(time_end - state%time) > 1 .and. &
            turns_nowhere(moving, state, sizes, tally%wants_v_max)) then
          call pass_stretch(moving, state, time_end, tally, log)
          begins = .false.
          cycle
        end if
      end if
      call expand(moving%modes(state%mode), state%y, time_end - state%time, stretch)
      fallen = guard_none
      first = 1
      do i = 1, guards
        if (.not. watches(i)%active .or. sure(i)) cycle
        p = series_of(stretch, watches(i)%row)
        if (begins .and. watches(i)%starts_at_zero) then
          p(0) = 0
          if (p(1) >= -moving%negligible_speed*stretch%length) p(1) = max(p(1), 0.0_wp)
        end if
        p(0) = p(0) + watches(i)%allowance
        if (begins) call drop_rounding(moving%modes(state%mode), watches(i)%row, sizes, stretch%length, p)
        t = first_zero(p)
        if (t < first .or. (t <= first .and. fallen == guard_none)) then
          first = t
          fallen = i
        end if
      end do
      call look_along(moving, state, stretch, first, begins, tally, log)
      state%y = state_at(stretch, first)
      if (fallen == guard_none .and. stretch%length >= time_end - state%time) then
        state%time = time_end
        exit
      end if
      state%time = min(state%time + first*stretch%length, time_end)
      if (fallen /= guard_none) exit
      begins = .false.
    end do
    call refresh(moving, state)
    call note_position(tally, body_state(state))
    if (moving%machine%carried .and. fallen == guard_slip) then
      call note_miss(moving, -sense_of(state%mode), state%y(at_x2) - state%y(at_x1), tally)
    end if
  end subroutine fly_pair

  !> Moves over a full stretch in which nothing can be.
  pure subroutine pass_stretch(moving, state, time_end, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(stretch_t) :: stretch
    real(wp) :: after(most_unknowns)
    associate (linear => moving%modes(state%mode))
      after = stride(linear, state%y)
      tally%v_max = max(tally%v_max, state%y(at_v2), after(at_v2))
      if (present(log)) then
        call expand(linear, state%y, time_end - state%time, stretch)
        call write_down(moving, state, stretch, 1.0_wp, log)
      end if
      state%y = after
      state%time = min(state%time + 1/linear%rate, time_end)
    end associate
  end subroutine pass_stretch

  !> Which guards certainly do not fall along a full stretch; those that are not watched among them. `sizes` are those of the
  !> unknowns where the flight begins.
  pure function are_sure(moving, state, watches, sizes, begins) result(sure)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(watch_t), intent(in) :: watches(guards)
    real(wp), intent(in) :: sizes(most_unknowns)
    logical, intent(in) :: begins
    logical :: sure(guards)
    real(wp) :: side
    integer :: i
    do i = 1, guards
      sure(i) = .not. watches(i)%active
      if (sure(i) .or. i > guard_minus) cycle
      side = merge(sense_of(state%mode), 1, i == guard_slip)
      associate (bound => moving%bounds(i, state%mode))
        if (begins) then
          sure(i) = is_above(bound, side, state%y, sizes, watches(i)%starts_at_zero)
        else
          sure(i) = is_above(bound, side, state%y, state%y, .false.)
        end if
      end associate
    end do
  end function are_sure

  !> Whether m2 certainly goes on in one direction along a full stretch, or rests on a stop; its acceleration too, if the
  !> largest velocity is wanted.
  pure logical function turns_nowhere(moving, state, sizes, wants_v_max)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    real(wp), intent(in) :: sizes(most_unknowns)
    logical, intent(in) :: wants_v_max
    real(wp) :: rate
    turns_nowhere = .not. any([mode_slip_plus, mode_slip_minus, mode_stick] == state%mode)
    if (turns_nowhere) return
    turns_nowhere = is_above(moving%bounds(of_driven, state%mode), sign(1.0_wp, state%y(at_v2)), state%y, sizes, .false.)
    if (.not. (turns_nowhere .and. wants_v_max)) return
    rate = sum(moving%modes(state%mode)%matrix(at_v2, :)*state%y)
    turns_nowhere = is_above(moving%bounds(of_rate, state%mode), sign(1.0_wp, rate), state%y, sizes, .false.)
  end function turns_nowhere

  !> What ends the mode of a state.
  pure function watches_of(moving, state, hold) result(watches)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    logical, intent(in) :: hold
    type(watch_t) :: watches(guards)
    integer :: s
    associate (machine => moving%machine)
      s = sense_of(state%mode)
      select case (state%mode)
      case (mode_slip_plus, mode_slip_minus)
        watches(guard_slip)%active = .true.
        watches(guard_slip)%row(at_v1) = s
        watches(guard_slip)%row(at_v2) = -s
        call watch_stops(moving, state%touch, watches)
      case (mode_stick)
        if (.not. machine%carried) call watch_stops(moving, state%touch, watches)
        call watch_interface(moving, watches(guard_plus), 1)
        call watch_interface(moving, watches(guard_minus), -1)
        if (machine%carried .and. .not. machine%contact%soft) then
          watches(guard_plus)%active = state%touch /= -1 .and. .not. moving%clamped
          watches(guard_minus)%active = state%touch /= 1 .and. .not. moving%clamped
        end if
      case (mode_held)
        watches(guard_press)%active = .true.
        watches(guard_press)%row = -state%touch*moving%push
        watches(guard_press)%row(at_one) = watches(guard_press)%row(at_one) + moving%threshold
        watches(guard_press)%allowance = tie_allowance*moving%push_scale
        watches(guard_leave) = watches(guard_press)
        watches(guard_leave)%row = state%touch*moving%push
        if (moving%clamped) watches(guard_leave)%row(at_one) = watches(guard_leave)%row(at_one) + moving%threshold
      case default
        watches(guard_slip)%active = .true.
        watches(guard_slip)%row(at_v1) = s
      end select
      if (hold) watches%active = .false.
    end associate
  end function watches_of

  !> The stops, where m2 is not on them. From the one it has just left the distance is zero, whatever rounding says.
  pure subroutine watch_stops(moving, touch, watches)
    type(pair_motion_t), intent(in) :: moving
    integer, intent(in) :: touch
    type(watch_t), intent(inout) :: watches(guards)
    associate (machine => moving%machine, upper => watches(guard_upper), lower => watches(guard_lower))
      upper%active = machine%upper < unreachable
      lower%active = machine%lower > -unreachable
      if (upper%active) upper%row = stop_row(moving, 1)
      if (lower%active) lower%row = stop_row(moving, -1)
      upper%starts_at_zero = touch > 0
      lower%starts_at_zero = touch < 0
    end associate
  end subroutine watch_stops

  !> What the interface has left in `direction`.
  pure subroutine watch_interface(moving, watch, direction)
    type(pair_motion_t), intent(in) :: moving
    type(watch_t), intent(inout) :: watch
    integer, intent(in) :: direction
    watch%active = .true.
    watch%row = interface_row(moving, direction)
    watch%allowance = tie_allowance*moving%force_scale
  end subroutine watch_interface

  !> Extremes, samples and energy of a stretch up to a fraction of it; the flight `begins` with it or not.
  pure subroutine look_along(moving, state, stretch, last, begins, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last
    logical, intent(in) :: begins
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    real(wp) :: place
    integer :: direction
    call note_extremes(stretch, last, tally, direction, place)
    ! Not the stop that the flight begins on.
    if (begins .and. direction == state%touch) direction = 0
    if (direction /= 0 .and. .not. moving%machine%carried) call note_miss(moving, direction, place, tally)
    if (present(log)) call write_down(moving, state, stretch, last, log)
  end subroutine look_along

  !> Samples and energy of a stretch up to a fraction of it.
  pure subroutine write_down(moving, state, stretch, last, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last
    type(log_t), intent(inout) :: log
    type(pair_state_t) :: sample
    type(book_t) :: book
    real(wp) :: t
    book = log%book
    call book_stretch(moving, state, stretch, last, log%book)
    if (log%sample_interval <= 0) return
    do
      sample = state
      sample%time = sample_time(log)
      if (.not. sample_due(log, state%time + last*stretch%length)) exit
      t = max(0.0_wp, (sample%time - state%time)/stretch%length)
      sample%y = state_at(stretch, t)
      call record_at(moving, state, stretch, t, book, sample, log)
    end do
  end subroutine write_down

  !> Writes down a sample at a fraction of a stretch, `book` being that at its start.
  pure subroutine record_at(moving, state, stretch, t, book, sample, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state, sample
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: t
    type(book_t), intent(in) :: book
    type(log_t), intent(inout) :: log
    type(book_t) :: now
    now = book
    call book_stretch(moving, state, stretch, t, now)
    now%at_end = energy_of(moving, sample)
    call record_sample(log, body_state(sample), driver_of(sample), now)
  end subroutine record_at

  !> Turning points and largest velocity of m2. `turned` is the direction in which it was on its way to a turning point at
  !> `place` [m], 0 without one.
  pure subroutine note_extremes(stretch, last, tally, turned, place)
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last
    type(tally_t), intent(inout) :: tally
    integer, intent(out), optional :: turned
    real(wp), intent(out), optional :: place
    real(wp) :: v(0:order), a(0:order), x, t
    integer :: k, direction
    if (present(turned)) turned = 0
    if (present(place)) place = 0
    v = stretch%path(at_v2, :)
    k = findloc(abs(v) > 0, .true., dim=1) - 1
    direction = 0
    if (k >= 0) direction = nint(sign(1.0_wp, v(k)))
    t = first_zero(direction*v)
    if (t <= last .and. direction /= 0) then
      call series_value(stretch%path(at_x2, :), t, x)
      tally%x_max = max(tally%x_max, x)
      tally%x_min = min(tally%x_min, x)
      if (present(turned)) turned = direction
      if (present(place)) place = x
    end if
    if (.not. tally%wants_v_max) return
    a(order) = 0
    a(:order - 1) = [((k + 1)*v(k + 1), k=0, order - 1)]
    t = first_zero(sign(1.0_wp, a(0))*a)
    call series_value(v, min(t, last), x)
    tally%v_max = max(tally%v_max, v(0), x)
    call series_value(v, last, x)
    tally%v_max = max(tally%v_max, x)
  end subroutine note_extremes

  !> m2 has turned at `place` [m], as the stops count it, on its way in `direction`.
  pure subroutine note_miss(moving, direction, place, tally)
    type(pair_motion_t), intent(in) :: moving
    integer, intent(in) :: direction
    real(wp), intent(in) :: place
    type(tally_t), intent(inout) :: tally
    real(wp) :: stop_ahead
    stop_ahead = merge(moving%machine%upper, moving%machine%lower, direction > 0)
    tally%grazing_margin = min(tally%grazing_margin, direction*(stop_ahead - place))
  end subroutine note_miss

  !> Where the energy of a stretch went.
  pure subroutine book_stretch(moving, state, stretch, last, book)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: last
    type(book_t), intent(inout) :: book
    real(wp) :: change(most_unknowns), end_state(most_unknowns), v1(0:order)
    integer :: s
    end_state = state_at(stretch, last)
    change = end_state - stretch%path(:, 0)
    s = sense_of(state%mode)
    associate (machine => moving%machine)
      book%friction = book%friction + s*machine%friction*(change(at_x1) - change(at_x2))
      if (machine%drive == driven_by_motion) then
        book%work = book%work + s*machine%friction*change(at_x1)
        if (s == 0) book%work = book%work &
          + 0.5_wp*machine%driven_mass*change(at_v2)*(end_state(at_v2) + stretch%path(at_v2, 0))
      else
        v1 = stretch%path(at_v1, :)
        if (machine%damping > 0) book%damping = book%damping &
          + machine%damping*stretch%length*product_integral(v1, v1, last)
        if (any(abs(moving%drive) > 0)) book%work = book%work &
          + stretch%length*product_integral(series_of(stretch, moving%drive), v1, last)
      end if
    end associate
  end subroutine book_stretch

  !> The driven body as a single one, for tally and log.
  pure type(state_t) function body_state(state)
    type(pair_state_t), intent(in) :: state
    body_state = state_t(x=state%y(at_x2), v=state%y(at_v2), time=state%time, mode=state%mode, touch_speed=state%touch_speed)
  end function body_state

  !> Position and velocity of the driving body.
  pure function driver_of(state) result(driver)
    type(pair_state_t), intent(in) :: state
    real(wp) :: driver(2)
    driver = state%y([at_x1, at_v1])
  end function driver_of

  !> Energy of spring and bodies [J]; of a body whose motion is given, none.
  pure real(wp) function energy_of(moving, state) result(energy)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    associate (machine => moving%machine, y => state%y)
      energy = 0.5_wp*machine%driven_mass*y(at_v2)**2
      if (machine%drive == driven_by_motion) return
      energy = energy + 0.5_wp*machine%mass*y(at_v1)**2 + 0.5_wp*machine%stiffness*(y(at_x1) - machine%free_length)**2
    end associate
  end function energy_of

end module pair_flight
