! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Crossing the thin Stribeck layer by collocation. The speed w replaces the time as the independent variable
!> (Henon's trick), so that the end of the layer is known:
!>   dt/dw = 1/A,  dx/dw = s w/A,  A = s (f(t) - omega^2 y) - 2 g w - (E/m) exp(-(w/v_s)^delta),
!> y the distance from the sliding equilibrium, s the direction. The exponential at the collocation points does
!> not depend on the motion, and time and position change little on the way, so a fixed-point iteration on Gauss points converges in
!> a few rounds. Where it does not, or the motion does not pass straight through, the adaptive flight takes over.
module layer_transit
  use constants, only: pi
  use elementary, only: exponential, sine_cosine
  use exact_flow, only: flow_t
  use kinds, only: wp
  use oscillator, only: oscillator_t
  implicit none
  private

  public :: prepare_transit, cross_layer, gauss

  integer, parameter :: points = 16, pieces = 3, order = 16, most_rounds = 30
  !> Ends of the pieces in units of v_s, for delta = 1 and 2; the last end is the edge of the layer.
  real(wp), parameter :: inner_ends(2, 2) = reshape([2.0_wp, 6.0_wp, 1.0_wp, 2.5_wp], [2, 2])
  !> Gauss points are too few for more than double precision: the reference library goes without.
  logical, parameter :: precise_enough = epsilon(1.0_wp) > 1e-17_wp
  !> A crossing is expected to last no longer than this multiple of its duration at the acceleration at its start.
  real(wp), parameter :: longest = 2
  !> The acceleration may not fall below this share of that at the start.
  real(wp), parameter :: smallest_share = 0.25_wp

  type, public :: transit_t
    logical :: available = .false.
    !> Edges of the layer at which it is entered and left [m/s].
    real(wp) :: entry = 0, exit = 0
    !> Ends of the pieces [m/s], from rest outwards; with the edge of entry (1) and of exit (2).
    real(wp) :: ends(0:pieces, 2) = 0
    !> Gauss points of each piece [m/s] and excess deceleration there [m/s^2].
    real(wp) :: speed(points, pieces, 2) = 0, excess(points, pieces, 2) = 0
    !> On [-1, 1]: weights, and integrals from -1 to each point.
    real(wp) :: weight(points) = 0, integral(points, points) = 0
    !> Sum over harmonics of the size of the (n + 1)th derivative of the forcing, over (n + 1)!.
    real(wp) :: remainder(order) = 0
  end type transit_t

contains

  !> Collocation points for a machine whose layer is left at `exit` [m/s].
  pure subroutine prepare_transit(machine, flow, exit, transit)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: exit
    type(transit_t), intent(out) :: transit
    real(wp) :: node(points), w, size_of_next
    integer :: which, k, n, i, delta
    associate (law => machine%friction)
      delta = nint(law%stribeck_exponent)
      transit%available = precise_enough .and. flow%available .and. .not. flow%overdamped .and. law%layer_speed > 0 &
        .and. .not. abs(law%stribeck_exponent - delta) > 0 .and. (delta == 1 .or. delta == 2) .and. law%second_excess <= 0
      if (.not. transit%available) return
      transit%entry = law%layer_speed
      transit%exit = exit
      call gauss(node, transit%weight, transit%integral)
      do which = 1, 2
        transit%ends(1:2, which) = inner_ends(:, delta)*law%stribeck_velocity
        transit%ends(pieces, which) = merge(transit%entry, transit%exit, which == 1)
        do k = 1, pieces
          associate (low => transit%ends(k - 1, which), high => transit%ends(k, which))
            transit%speed(:, k, which) = 0.5_wp*(low + high) + 0.5_wp*(high - low)*node
          end associate
          transit%excess(:, k, which) = law%excess/machine%mass &
            *exponential(-(transit%speed(:, k, which)/law%stribeck_velocity)**delta)
        end do
      end do
    end associate
    do n = 1, flow%harmonics
      w = n*flow%drive_frequency
      size_of_next = sqrt(flow%f_cos(n)**2 + flow%f_sin(n)**2)*w
      do i = 1, order
        size_of_next = size_of_next*w/(i + 1)
        transit%remainder(i) = transit%remainder(i) + size_of_next
      end do
    end do
  end subroutine prepare_transit

  !> Crosses the layer from its edge to rest (`inward`) or from rest to its outer edge, slipping in `direction`, from `time`
  !> [s] at `x` [m]; `ok` is false, and nothing changed, where it must be left to the adaptive flight. `by_start` are the
  !> derivatives of time and x at the end (rows) by those at the beginning.
  pure subroutine cross_layer(transit, flow, direction, inward, time_end, time, x, ok, by_start)
    type(transit_t), intent(in) :: transit
    type(flow_t), intent(in) :: flow
    integer, intent(in) :: direction
    logical, intent(in) :: inward
    real(wp), intent(in) :: time_end
    real(wp), intent(inout) :: time, x
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_start(2, 2)
    real(wp) :: taylor(0:order), elapsed, y, start_rate
    integer :: k, i, which, degree
    if (present(by_start)) by_start = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    call expand_forcing(flow, time, taylor)
    which = merge(1, 2, inward)
    elapsed = 0
    y = x - flow%equilibrium(direction)
    start_rate = direction*(taylor(0) - flow%natural**2*y)
    ok = (start_rate < 0) .eqv. inward
    if (.not. ok) return
    degree = min(order, enough_terms(transit, abs(start_rate), longest*transit%ends(pieces, which)/abs(start_rate)))
    do i = 1, pieces
      k = merge(pieces + 1 - i, i, inward)
      call cross_piece(transit, flow, taylor(:degree), real(direction, wp), which, k, inward, start_rate, elapsed, y, ok, &
                       by_start)
      if (.not. ok) return
    end do
    ok = time + elapsed <= time_end .and. enough_terms(transit, abs(start_rate), elapsed) <= degree
    if (.not. ok) return
    time = time + elapsed
    x = y + flow%equilibrium(direction)
  end subroutine cross_layer

  !> Degree up to which the forcing must be expanded for its error over `elapsed` [s] to be rounding beside `rate` [m/s^2];
  !> `order` + 1 if that is not enough.
  pure integer function enough_terms(transit, rate, elapsed) result(degree)
    type(transit_t), intent(in) :: transit
    real(wp), intent(in) :: rate, elapsed
    real(wp) :: power
    power = elapsed
    do degree = 1, order
      power = power*elapsed
      if (transit%remainder(degree)*power <= epsilon(1.0_wp)*rate) return
    end do
  end function enough_terms

  !> One piece: fixed-point iteration for time and position at the Gauss points.
  pure subroutine cross_piece(transit, flow, taylor, direction, which, k, inward, start_rate, elapsed, y, ok, change_by)
    type(transit_t), intent(in) :: transit
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: taylor(0:), direction, start_rate
    integer, intent(in) :: which, k
    logical, intent(in) :: inward
    real(wp), intent(inout) :: elapsed, y
    logical, intent(out) :: ok
    real(wp), intent(inout), optional :: change_by(2, 2)
    real(wp) :: time(points), position(points), before(points), rate(points), inverse(points), run(points), half, change, &
      last_change
    integer :: round
    half = 0.5_wp*(transit%ends(k, which) - transit%ends(k - 1, which))
    time = elapsed
    position = y
    ok = .false.
    change = 0
    do round = 1, most_rounds
      rate = direction*(polynomial(taylor, time) - flow%natural**2*position) &
             - 2*flow%decay*transit%speed(:, k, which) - transit%excess(:, k, which)
      if (inward) rate = -rate
      if (minval(rate) < smallest_share*abs(start_rate)) return
      inverse = half/rate
      run = direction*transit%speed(:, k, which)*inverse
      before = time
      if (inward) then
        ! From the outer end: what is left of the whole integral.
        time = elapsed + dot_product(transit%weight, inverse)
        position = y + dot_product(transit%weight, run)
        call add_integrals(transit, -inverse, -run, time, position)
      else
        time = elapsed
        position = y
        call add_integrals(transit, inverse, run, time, position)
      end if
      last_change = change
      change = maxval(abs(time - before))
      ! What the next round would change.
      if (change*min(1.0_wp, change/max(last_change, tiny(change))) <= 4*epsilon(1.0_wp)*(elapsed + half/minval(rate))) then
        elapsed = elapsed + dot_product(transit%weight, inverse)
        y = y + dot_product(transit%weight, run)
        ok = .true.
        if (.not. present(change_by)) return
        rate = merge(-direction, direction, inward)/rate
        call vary_piece(transit, direction*transit%speed(:, k, which), inward, rate*slope_of(taylor, time), &
                        -flow%natural**2*rate, inverse, change_by(:, 1))
        call vary_piece(transit, direction*transit%speed(:, k, which), inward, rate*slope_of(taylor, time), &
                        -flow%natural**2*rate, inverse, change_by(:, 2))
        return
      end if
    end do
  end subroutine cross_piece

  !> Takes a variation of time and position across a piece, by the same iteration: `by_time` and `by_position` are the relative
  !> derivatives of the deceleration at the points, `inverse` the weights of the time there.
  pure subroutine vary_piece(transit, velocity, inward, by_time, by_position, inverse, change)
    type(transit_t), intent(in) :: transit
    real(wp), intent(in) :: velocity(points), by_time(points), by_position(points), inverse(points)
    logical, intent(in) :: inward
    real(wp), intent(inout) :: change(2)
    real(wp) :: time(points), position(points), before(2, points), later(points), further(points)
    integer :: round
    time = change(1)
    position = change(2)
    do round = 1, most_rounds
      before(1, :) = time
      before(2, :) = position
      later = -inverse*(by_time*time + by_position*position)
      further = velocity*later
      time = change(1)
      position = change(2)
      if (inward) then
        time = time + dot_product(transit%weight, later)
        position = position + dot_product(transit%weight, further)
        call add_integrals(transit, -later, -further, time, position)
      else
        call add_integrals(transit, later, further, time, position)
      end if
      if (maxval(abs(time - before(1, :))) <= 4*epsilon(1.0_wp)*maxval(abs(time)) .and. &
          maxval(abs(position - before(2, :))) <= 4*epsilon(1.0_wp)*maxval(abs(position))) exit
    end do
    change = change + [dot_product(transit%weight, later), dot_product(transit%weight, further)]
  end subroutine vary_piece

  !> Adds the integrals from -1 to each point of what has the values `inverse` and `run` at the points. A few at a time, whose
  !> sums stay in registers.
  pure subroutine add_integrals(transit, inverse, run, time, position)
    type(transit_t), intent(in) :: transit
    real(wp), intent(in) :: inverse(points), run(points)
    real(wp), intent(inout) :: time(points), position(points)
    integer, parameter :: few = 8
    real(wp) :: t(few), p(few)
    integer :: first, i
    do first = 1, points, few
      t = time(first:first + few - 1)
      p = position(first:first + few - 1)
      !GCC$ novector
      do i = 1, points
        t = t + transit%integral(first:first + few - 1, i)*inverse(i)
        p = p + transit%integral(first:first + few - 1, i)*run(i)
      end do
      time(first:first + few - 1) = t
      position(first:first + few - 1) = p
    end do
  end subroutine add_integrals

  !> Taylor coefficients of the forcing about `time`.
  pure subroutine expand_forcing(flow, time, taylor)
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: time
    real(wp), intent(out) :: taylor(0:order)
    real(wp) :: s1, c1, s, c, next, value, slope, w
    integer :: n, i
    taylor = 0
    call sine_cosine(flow%drive_frequency*time, s1, c1)
    s = s1
    c = c1
    do n = 1, flow%harmonics
      w = n*flow%drive_frequency
      value = flow%f_cos(n)*c + flow%f_sin(n)*s
      slope = w*(flow%f_sin(n)*c - flow%f_cos(n)*s)
      do i = 0, order
        taylor(i) = taylor(i) + value
        next = -w*w*value/((i + 1)*(i + 2))
        value = slope
        slope = next
      end do
      next = c*c1 - s*s1
      s = s*c1 + c*s1
      c = next
    end do
  end subroutine expand_forcing

  !> Values at `t` of a polynomial, coefficients by rising power.
  pure function polynomial(coefficients, t) result(total)
    real(wp), intent(in) :: coefficients(0:), t(points)
    real(wp) :: total(points)
    integer :: i
    total = coefficients(ubound(coefficients, 1))
    do i = ubound(coefficients, 1) - 1, 0, -1
      total = total*t + coefficients(i)
    end do
  end function polynomial

  !> Derivatives at `t` of a polynomial.
  pure function slope_of(coefficients, t) result(slope)
    real(wp), intent(in) :: coefficients(0:), t(points)
    real(wp) :: slope(points)
    integer :: i
    slope = polynomial([(i*coefficients(i), i=1, ubound(coefficients, 1)), 0.0_wp], t)
  end function slope_of

  !> Gauss-Legendre points on [-1, 1], as many as `node` has room for, weights, and the integrals of the Lagrange polynomials
  !> from -1 to each point (first index).
  pure subroutine gauss(node, weight, integral)
    real(wp), intent(out) :: node(:), weight(:), integral(:, :)
    real(wp) :: p(-1:size(node)), table(-1:size(node), size(node)), slope, sine, cosine, before
    integer :: j, k, m, i, n
    n = size(node)
    do j = 1, n
      call sine_cosine(pi*(j - 0.25_wp)/(n + 0.5_wp), sine, cosine)
      node(j) = -cosine
      do i = 1, 20
        p = legendre(n, node(j))
        slope = n*(node(j)*p(n) - p(n - 1))/(node(j)**2 - 1)
        before = node(j)
        node(j) = before - p(n)/slope
        if (.not. abs(node(j) - before) > 0) exit
      end do
      p = legendre(n, node(j))
      table(:, j) = p
      slope = n*(node(j)*p(n) - p(n - 1))/(node(j)**2 - 1)
      weight(j) = 2/((1 - node(j)**2)*slope**2)
    end do
    do j = 1, n
      do k = 1, n
        integral(j, k) = (node(j) + 1)*weight(k)/2
        do m = 1, n - 1
          integral(j, k) = integral(j, k) + weight(k)/2*table(m, k)*(table(m + 1, j) - table(m - 1, j))
        end do
      end do
    end do
  end subroutine gauss

  !> Legendre polynomials of degree 0 to `n`; index -1 is unused.
  pure function legendre(n, t) result(p)
    integer, intent(in) :: n
    real(wp), intent(in) :: t
    real(wp) :: p(-1:n)
    integer :: m
    p(-1) = 0
    p(0) = 1
    p(1) = t
    do m = 1, n - 1
      p(m + 1) = ((2*m + 1)*t*p(m) - m*p(m - 1))/(m + 1)
    end do
  end function legendre

end module layer_transit
