! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of a linear mode: to the first guard that is triggered, or to a time.
module linear_flight
  use flight_path, only: begin_path, path_at, path_t, series_step, terms
  use guard_functions, only: prepare_search, search_t
  use guard_search, only: find_first
  use guards, only: guards_of, joint_guard_t, meets_lower, meets_upper
  use multibody, only: multibody_t
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use path_rows, only: guard_row, size_of_row
  use series_zero, only: first_zero, order
  implicit none
  private

  public :: fly_linear

  !> Extremes of the watched coordinate and its largest speed, how near stops were, and what a flight cost.
  type, public :: watch_t
    real(wp) :: extremes(2) = [huge(1.0_wp), -huge(1.0_wp)]
    real(wp) :: top_speed = -huge(1.0_wp)
    logical :: needs_speed = .false.
    !> Smallest gap at which a stop was missed [m]; of closed-form flights, and costly.
    real(wp) :: margin = huge(1.0_wp)
    logical :: needs_margin = .false.
    integer :: evaluations = 0
  end type watch_t

  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)

contains

  !> Flies from `state` to `until` [s after the section] at most. `list` are the guards, `triggered` those triggered together at
  !> the end, none if the time is over. `path` is that of the flight.
  pure subroutine fly_linear(machine, flow, state, until, list, count_guards, triggered, path, watch)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: until
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(out) :: count_guards
    logical, intent(out) :: triggered(:)
    type(path_t), intent(out) :: path
    type(watch_t), intent(inout) :: watch
    real(wp) :: time
    call guards_of(machine, flow, state, list, count_guards)
    call begin_path(machine, flow, state, path)
    if (flow%modal) then
      call fly_modal(machine, flow, path, list(:count_guards), until - path%start, state, time, triggered, watch)
    else
      call fly_series(machine, flow, path, list, count_guards, until - path%start, state, time, triggered, watch)
    end if
    state%time = path%start + time
    if (.not. any(triggered)) state%time = until
  end subroutine fly_linear

  !> The same in closed form.
  pure subroutine fly_modal(machine, flow, path, list, duration, state, time, triggered, watch)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: list(:)
    real(wp), intent(in) :: duration
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(out) :: time
    logical, intent(out) :: triggered(:)
    type(watch_t), intent(inout) :: watch
    type(search_t) :: search
    complex(wp), target :: exponent(size(flow%exponent)), term(size(flow%exponent), size(list) + 1), &
      turn(size(path%turning), size(list) + 1)
    real(wp), target :: decay(size(exponent)), size_of_exponent(size(exponent)), size_of_term(size(exponent), size(list) + 1), &
      power(0:3, size(list) + 1), steady(0:6, size(list) + 1), blur(0:3, size(list)), lift(size(list))
    integer :: evaluations
    search%exponent => exponent
    search%term => term
    search%turn => turn
    search%decay => decay
    search%size_of_exponent => size_of_exponent
    search%size_of_term => size_of_term
    search%power => power
    search%steady => steady
    search%blur => blur
    search%lift => lift
    call prepare_search(machine, flow, path, list, size(list), machine%watched, search)
    call find_first(search, list, path%start, duration, watch%needs_speed, watch%needs_margin, time, triggered, &
                    watch%extremes, watch%top_speed, watch%margin, evaluations)
    watch%evaluations = watch%evaluations + evaluations
    call path_at(machine, flow, path, time, state%q, state%v)
  end subroutine fly_modal

  !> The same by intervals of the exponential series.
  pure subroutine fly_series(machine, flow, path, list, count_guards, duration, state, time, triggered, watch)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(joint_guard_t), intent(in) :: list(:)
    integer, intent(in) :: count_guards
    real(wp), intent(in) :: duration
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(out) :: time
    logical, intent(out) :: triggered(:)
    type(watch_t), intent(inout) :: watch
    real(wp), dimension(size(path%unknowns)) :: y, size_of_y
    real(wp) :: powers(size(path%unknowns), 0:terms), row(size(path%unknowns), count_guards)
    real(wp) :: length, p(0:order), gap(0:terms, count_guards), root(max(count_guards, 1)), lift(count_guards), first, fraction
    integer :: g, i, k, n, intervals
    n = machine%n
    triggered = .false.
    y = path%unknowns
    do g = 1, count_guards
      row(:, g) = guard_row(machine, flow, path, list(g))
    end do
    intervals = max(1, ceiling(flow%rate*duration))
    length = duration/intervals
    time = 0
    lift = 0
    do i = 1, intervals
      call series_step(path%matrix, y, length, powers)
      size_of_y = abs(y)
      ! A position on its way through zero has the rounding of its amplitude.
      size_of_y(:n) = size_of_y(:n) + length*size_of_y(n + 1:2*n)
      root = 2
      do g = 1, count_guards
        p = 0
        p(:terms) = matmul(row(:, g), powers)
        if (i == 1 .and. list(g)%from_zero) p(0) = 0
        if (i == 1 .or. lift(g) > 0) call drop_rounding(size_of_row(machine, flow, path, list(g)), path%matrix, size_of_y, &
                                                        length, i == 1, p, lift(g))
        p(0) = p(0) + lift(g)
        root(g) = first_zero(p)
        gap(:, g) = p(:terms)
      end do
      if (watch%needs_margin) call note_misses(list(:count_guards), gap, root, min(1.0_wp, minval(root)), watch%margin)
      call watch_series(powers(machine%watched, :), powers(n + machine%watched, :), min(1.0_wp, minval(root)), watch)
      first = minval(root(:max(count_guards, 1)))
      if (count_guards > 0 .and. first <= 1) then
        triggered(:count_guards) = root(:count_guards) <= first + 8*spacing(path%start + duration)/length
        fraction = first
        y = powers(:, terms)
        do k = terms - 1, 0, -1
          y = y*fraction + powers(:, k)
        end do
        time = time + fraction*length
        exit
      end if
      y = sum(powers, dim=2)
      time = time + length
      watch%evaluations = watch%evaluations + 1
    end do
    state%q(:n) = y(:n)
    state%v(:n) = y(n + 1:2*n)
  end subroutine fly_series

  !> Extremes of the watched coordinate up to a fraction of an interval, from its series and that of its speed.
  pure subroutine watch_series(position, speed, fraction, watch)
    real(wp), intent(in) :: position(0:), speed(0:), fraction
    type(watch_t), intent(inout) :: watch
    real(wp) :: at, factors(ubound(speed, 1))
    integer :: k
    factors = [(k, k=1, size(factors))]
    watch%extremes = [min(watch%extremes(1), position(0), value(position, fraction)), &
                      max(watch%extremes(2), position(0), value(position, fraction))]
    watch%top_speed = max(watch%top_speed, speed(0), value(speed, fraction))
    if (watch%needs_speed) then
      at = zero_of(factors*speed(1:), fraction)
      watch%top_speed = max(watch%top_speed, value(speed, at))
    end if
    at = zero_of(speed, fraction)
    watch%extremes = [min(watch%extremes(1), value(position, at)), max(watch%extremes(2), value(position, at))]
  end subroutine watch_series

  !> Where a series changes its sign up to a fraction of an interval, 0 if it does not.
  pure real(wp) function zero_of(p, fraction) result(at)
    real(wp), intent(in) :: p(0:), fraction
    real(wp) :: low, high
    integer :: i
    at = 0
    if (value(p, 0.0_wp)*value(p, fraction) >= 0) return
    low = 0
    high = fraction
    do i = 1, 40
      at = (low + high)/2
      if (value(p, at)*value(p, low) > 0) then
        low = at
      else
        high = at
      end if
    end do
  end function zero_of

  !> Gaps that stop closing on an interval up to a `fraction` of it, from their series; those triggered there have a `root` at it.
  pure subroutine note_misses(list, gap, root, fraction, margin)
    type(joint_guard_t), intent(in) :: list(:)
    real(wp), intent(in) :: gap(0:, :), root(:), fraction
    real(wp), intent(inout) :: margin
    real(wp) :: low, high, at, factors(ubound(gap, 1))
    integer :: g, i, k
    factors = [(k, k=1, size(factors))]
    do g = 1, size(list)
      if (.not. any(list(g)%meaning == [meets_upper, meets_lower]) .or. root(g) <= fraction) cycle
      associate (slope => factors*gap(1:, g))
        if (.not. slope(1) < 0 .or. value(slope, fraction) < -rounding*sum(abs(slope))) cycle
        low = 0
        high = fraction
        do i = 1, 60
          at = (low + high)/2
          if (value(slope, at) < 0) low = at
          if (.not. value(slope, at) < 0) high = at
        end do
      end associate
      margin = min(margin, max(value(gap(:, g), high), 0.0_wp))
    end do
  end subroutine note_misses

  !> A polynomial with coefficients by rising powers.
  pure real(wp) function value(p, t)
    real(wp), intent(in) :: p(0:), t
    integer :: k
    value = p(ubound(p, 1))
    do k = ubound(p, 1) - 1, 0, -1
      value = value*t + p(k)
    end do
  end function value

  !> Drops the leading terms of a series, where it `starts`, that are no more than the rounding of what they are sums of: `sizes`
  !> times those of the unknowns. One that is nothing else is raised by its rounding, `lift`: it is triggered when below that.
  pure subroutine drop_rounding(sizes, matrix, unknowns, length, starts, p, lift)
    real(wp), intent(in) :: sizes(:), matrix(:, :), unknowns(:), length
    logical, intent(in) :: starts
    real(wp), intent(inout) :: p(0:), lift
    real(wp) :: term(size(unknowns)), none(0:3)
    integer :: k
    term = unknowns
    do k = 0, 3
      if (k > 0) term = matmul(abs(matrix), term)*(length/k)
      none(k) = rounding*sum(sizes*term)
    end do
    if (starts) then
      do k = 0, 3
        if (abs(p(k)) > none(k)) return
        p(k) = 0
      end do
    end if
    lift = max(lift, sum(none) + tiny(lift))
  end subroutine drop_rounding

end module linear_flight
