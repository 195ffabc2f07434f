! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A cycle of the stroboscopic map: Newton's method to its fixed point, its multipliers, and the
!> neighbourhood that provably (by sampling its rings) contracts into it with the same events.
module cycle
  use attractors, only: attractor_t, longest_period, make_points, metric_numbers, most_coordinates, squared_distance
  use circle, only: point_near
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: cholesky, eigenvalues, solve, spectral_radius
  use motion_features, only: cycle_word, features_over
  use motion_state, only: mode_slip_minus, mode_slip_plus, tally_t
  use section_slopes, only: slopes_of
  implicit none
  private

  public :: map_point, refine_cycle, scale_of, derivative, direction, back_substituted, matrix_of, rests_at, &
    same_events, contracting_metric, eigenvalue_bounds, least_eigenvalue

  integer, parameter :: most_newton = 20, most_halvings = 30
  !> A cycle attracts if its largest multiplier is below this: nearer to 1 rounding of the derivatives decides.
  real(wp), parameter, public :: unattractive = 1 - 1e-7_wp
  !> Differences that change by less when their step is quartered are taken as they are; divisions tried otherwise.
  real(wp), parameter :: smooth = 1e-6_wp
  integer, parameter :: most_divisions = 7
  !> The metric of a speed that only a body at rest is near.
  real(wp), parameter :: at_rest_only = 1e30_wp
  !> Directions and radii of the starts by which a neighbourhood is tested.
  integer, parameter, public :: directions = 24
  real(wp), parameter, public :: rings(4) = [1.0_wp, 0.6_wp, 0.3_wp, 0.1_wp]

contains

  !> Image of a section point (its coordinates, SI) after `periods` drive periods and what happened on the
  !> way; `ok` is false if the trajectory had to be given up. `duration` [s] is the time that it took.
  pure subroutine map_point(moving, point, periods, image, tally, ok, needs_v_max, duration)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: periods
    real(wp), intent(out) :: image(:)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    logical, intent(in), optional :: needs_v_max
    real(wp), intent(out), optional :: duration
    type(section_state_t) :: section
    real(wp) :: reached(most_coordinates)
    integer :: i, reason
    section = moving%state_at(point)
    if (present(needs_v_max)) tally%needs_v_max = needs_v_max
    call moving%begin_tally(section, tally)
    reason = 0
    if (present(duration)) duration = 0
    do i = 1, periods
      call moving%advance_to_section(section, tally, reason)
      if (present(duration)) duration = duration + section%lasted
      if (reason /= 0) exit
    end do
    reached = moving%point_of(section)
    image = reached(:size(image))
    ok = reason == 0
  end subroutine map_point

  !> Turns a section point near a cycle of `period` into an attractor. `found` is false if Newton's
  !> method does not converge nearby, the cycle is not stable, or no neighbourhood contracts.
  pure subroutine refine_cycle(moving, guess, period, attractor, found)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: guess(:)
    integer, intent(in) :: period
    type(attractor_t), intent(out) :: attractor
    logical, intent(out) :: found
    real(wp) :: point(size(guess)), image(size(guess)), jacobian(size(guess), size(guess))
    type(tally_t) :: tally
    integer :: i, n
    n = size(guess)
    call map_point(moving, guess, period, image, tally, found)
    if (.not. found) return
    attractor%coordinates = n
    attractor%by_event = moving%by_event
    attractor%turn = moving%turn_on_section()
    attractor%period = period
    attractor%scale = scale_of(moving, tally)
    point = guess
    call newton(moving, period, attractor%scale(:n), point, found)
    if (.not. found) return
    call order_points(moving, attractor, point, found)
    if (.not. found) return
    do i = 1, attractor%period
      call derivative(moving, attractor%points(:n, i), attractor%period, attractor%scale(:n), jacobian, found)
      if (.not. found) return
      if (i == 1) attractor%multiplier = spectral_radius(jacobian)
      if (i == 1) attractor%multipliers(:n) = eigenvalues(jacobian)
      found = attractor%multiplier < unattractive
      if (.not. found) return
      attractor%metric(:, i) = contracting_metric(jacobian)
    end do
    call map_point(moving, attractor%points(:n, 1), attractor%period, image, tally, found, .true., attractor%duration)
    ! Rounding may put the point and its image on different sides of the matching point.
    if (attractor%turn > 0) tally%turns = tally%turns + nint((image(1) - attractor%points(1, 1))/attractor%turn)
    if (moving%by_event) then
      attractor%features = features_over(moving, tally, attractor%duration/moving%period)
    else
      attractor%features = features_over(moving, tally, real(attractor%period, wp))
    end if
    if (attractor%period > 1) attractor%features%word = &
      cycle_word(moving, moving%state_at(attractor%points(:n, 1)), attractor%period)
    if (moving%linear .and. tally%impacts == 0) then
      attractor%multipliers(:2) = moving%free_multipliers(attractor%period)
      attractor%multiplier = abs(attractor%multipliers(1))
    end if
    call verify_neighbourhood(moving, attractor, found)
  end subroutine refine_cycle

  !> Scales of the coordinates, from half the range of the position.
  pure function scale_of(moving, tally) result(scale)
    class(machine_t), intent(in) :: moving
    type(tally_t), intent(in) :: tally
    real(wp) :: scale(most_coordinates)
    scale = max(moving%scales(max((tally%x_max - tally%x_min)/2, moving%smallest_motion)), tiny(1.0_wp))
  end function scale_of

  !> Newton's method on P^period(z) - z, derivatives by variations, or by central differences where those are not known, steps no
  !> longer than a fifth of the motion's size; ends at rounding.
  pure subroutine newton(moving, period, scale, point, converged)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: period
    real(wp), intent(in) :: scale(:)
    real(wp), intent(inout) :: point(:)
    logical, intent(out) :: converged
    real(wp), dimension(size(point)) :: image, miss, step, start
    real(wp) :: jacobian(size(point), size(point)), best
    type(tally_t) :: tally
    integer :: i, k
    start = point
    best = huge(best)
    do i = 1, most_newton
      call map_point(moving, point, period, image, tally, converged)
      if (.not. converged) return
      miss = (point_near(image, point, moving%turn_on_section()) - point)/scale
      if (norm2(miss) <= 64*epsilon(1.0_wp)) return
      if (i > 4 .and. norm2(miss) < 1e-11_wp .and. norm2(miss) >= best) return
      best = min(best, norm2(miss))
      call slopes_of(moving, point, period, scale, jacobian, converged)
      if (.not. converged) call differentiate(moving, point, period, scale, jacobian, converged)
      if (.not. converged) return
      do k = 1, size(point)
        jacobian(k, k) = jacobian(k, k) - 1
      end do
      call solve(jacobian, -miss, step, converged)
      if (.not. converged) return
      if (norm2(step) > 0.2_wp) step = 0.2_wp*step/norm2(step)
      point = point + scale*step
      point(1) = min(max(point(1), moving%lower), moving%upper)
      converged = norm2((point - start)/scale) < 1
      if (.not. converged) return
    end do
    converged = best < 1e-9_wp
  end subroutine newton

  !> Scaled derivative of P^period, by variations where they are known: not of a motion from turn to turn, under a measured force,
  !> and of the laws that `why_not_varied` names. There it is by differences. Next to a graze the map is linear only in a range that
  !> shrinks like the square of the impact speed: where a quarter of their step gives another result, it is divided on until the
  !> results agree best.
  pure subroutine derivative(moving, point, period, scale, jacobian, ok)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:), scale(:)
    integer, intent(in) :: period
    real(wp), intent(out) :: jacobian(:, :)
    logical, intent(out) :: ok
    real(wp), dimension(size(point), size(point)) :: coarse, fine
    real(wp) :: share, best, change
    integer :: k
    call slopes_of(moving, point, period, scale, jacobian, ok)
    if (ok) return
    share = 1
    best = huge(best)
    call differentiate(moving, point, period, scale, coarse, ok)
    jacobian = coarse
    do k = 1, most_divisions
      if (.not. ok) return
      share = share/4
      call differentiate(moving, point, period, scale, fine, ok, share)
      if (.not. ok) return
      change = norm2(fine - coarse)
      if (k == 1 .and. change <= smooth*max(1.0_wp, norm2(coarse))) return
      if (change < best) jacobian = fine
      best = min(best, change)
      coarse = fine
    end do
  end subroutine derivative

  !> Scaled derivative of P^period by central differences over `share` of the usual step; one-sided at a barrier.
  pure subroutine differentiate(moving, point, period, scale, jacobian, ok, share)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:), scale(:)
    integer, intent(in) :: period
    real(wp), intent(out) :: jacobian(:, :)
    logical, intent(out) :: ok
    real(wp), intent(in), optional :: share
    real(wp), dimension(size(point)) :: ahead, behind, image_ahead, image_behind
    real(wp) :: h
    type(tally_t) :: tally
    integer :: k
    h = epsilon(1.0_wp)**(1.0_wp/3.0_wp)
    if (present(share)) h = share*h
    do k = 1, size(point)
      ahead = point
      behind = point
      ahead(k) = ahead(k) + h*scale(k)
      behind(k) = behind(k) - h*scale(k)
      ahead(1) = min(ahead(1), moving%upper)
      behind(1) = max(behind(1), moving%lower)
      call map_point(moving, ahead, period, image_ahead, tally, ok)
      if (.not. ok) return
      call map_point(moving, behind, period, image_behind, tally, ok)
      if (.not. ok) return
      image_ahead = point_near(image_ahead, image_behind, moving%turn_on_section())
      jacobian(:, k) = (image_ahead - image_behind)/scale/((ahead(k) - behind(k))/scale(k))
    end do
  end subroutine differentiate

  !> Section points of the cycle, the one with the smallest first coordinate first; the period is reduced to the
  !> smallest one.
  pure subroutine order_points(moving, attractor, point, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    real(wp), intent(in) :: point(:)
    logical, intent(out) :: ok
    real(wp) :: cycle_points(size(point), longest_period), image(size(point))
    type(tally_t) :: tally
    integer :: i, n
    n = size(point)
    cycle_points(:, 1) = point_near(point, 0*point, attractor%turn)
    do i = 2, attractor%period
      call map_point(moving, cycle_points(:, i - 1), 1, image, tally, ok)
      if (.not. ok) return
      if (norm2((point_near(image, point, attractor%turn) - point)/attractor%scale(:n)) < 1e-8_wp) then
        attractor%period = i - 1
        exit
      end if
      cycle_points(:, i) = image
    end do
    ok = .true.
    i = minloc(cycle_points(1, :attractor%period), 1)
    call make_points(attractor, attractor%period)
    attractor%points(:n, :attractor%period) = cshift(cycle_points(:, :attractor%period), i - 1, 2)
  end subroutine order_points

  !> S = sum over k of (M^k)' M^k, the metric in which a stable M contracts: its upper triangle, column by column.
  pure function contracting_metric(jacobian) result(metric)
    real(wp), intent(in) :: jacobian(:, :)
    real(wp) :: metric(metric_numbers(size(jacobian, 1)))
    real(wp), dimension(size(jacobian, 1), size(jacobian, 1)) :: s, m
    integer :: i, j, k
    s = 0
    do i = 1, size(s, 1)
      s(i, i) = 1
    end do
    m = jacobian
    do i = 1, 30
      s = s + matmul(transpose(m), matmul(s, m))
      m = matmul(m, m)
      if (maxval(abs(m)) < epsilon(1.0_wp)) exit
    end do
    do j = 1, size(s, 1)
      do k = 1, j
        metric((j*(j - 1))/2 + k) = (s(k, j) + s(j, k))/2
      end do
    end do
  end function contracting_metric

  !> Halves the capture radius until every sampled start on rings within it, around every point of the cycle,
  !> comes back after one period of the cycle nearer by what the linear part promises, with the events of the cycle.
  pure subroutine verify_neighbourhood(moving, attractor, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    logical, intent(out) :: found
    type(tally_t) :: reference(longest_period)
    real(wp) :: image(attractor%coordinates)
    integer :: i
    logical :: ok
    do i = 1, attractor%period
      call map_point(moving, attractor%points(:attractor%coordinates, i), attractor%period, image, reference(i), ok)
      ! A neighbour of an equilibrium never comes to rest.
      if (moving%undriven .and. reference(i)%slips == 0) reference(i)%sticks = 0
    end do
    call halve_radius(moving, attractor, reference, found)
    if (found .or. attractor%coordinates /= 2 .or. .not. moving%has_clock) return
    ! Where more than sliding friction holds the body, any kick sets it sliding for good: near are those at rest alone.
    do i = 1, attractor%period
      if (rests_at(moving, attractor%points(:2, i))) attractor%metric(2:3, i) = [0.0_wp, at_rest_only]
    end do
    if (any(attractor%metric(3, :attractor%period) >= at_rest_only)) call halve_radius(moving, attractor, reference, found)
  end subroutine verify_neighbourhood

  pure subroutine halve_radius(moving, attractor, reference, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    type(tally_t), intent(in) :: reference(:)
    logical, intent(out) :: found
    integer :: i
    attractor%capture_radius = 0.5_wp*sqrt(least_eigenvalue(attractor))
    do i = 1, most_halvings
      found = contracts(moving, attractor, reference)
      if (found) return
      attractor%capture_radius = attractor%capture_radius/2
    end do
  end subroutine halve_radius

  !> Whether friction, or a stop, holds the body at a section point.
  pure logical function rests_at(moving, point)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    section = moving%state_at(point)
    rests_at = section%state%mode /= mode_slip_plus .and. section%state%mode /= mode_slip_minus
  end function rests_at

  !> The least eigenvalue of the metrics of a cycle.
  pure real(wp) function least_eigenvalue(attractor) result(least)
    type(attractor_t), intent(in) :: attractor
    real(wp) :: bounds(2)
    integer :: i
    least = huge(least)
    do i = 1, attractor%period
      bounds = eigenvalue_bounds(attractor, i)
      least = min(least, bounds(1))
    end do
  end function least_eigenvalue

  !> Bounds of the eigenvalues of the metric at the `i`-th point: exact up to two coordinates, else 1, which none is below,
  !> and their sum.
  pure function eigenvalue_bounds(attractor, i) result(bounds)
    type(attractor_t), intent(in) :: attractor
    integer, intent(in) :: i
    real(wp) :: bounds(2)
    integer :: k
    associate (s => attractor%metric(:, i))
      select case (attractor%coordinates)
      case (1)
        bounds = s(1)
      case (2)
        bounds = (s(1) + s(3))/2 + [-1, 1]*sqrt(((s(1) - s(3))/2)**2 + s(2)**2)
        if (s(3) >= at_rest_only) bounds = s(1)
      case default
        bounds = [1.0_wp, sum([(s((k*(k + 1))/2), k=1, attractor%coordinates)])]
      end select
    end associate
  end function eigenvalue_bounds

  pure logical function contracts(moving, attractor, reference)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    type(tally_t), intent(in) :: reference(:)
    real(wp) :: radius, promised, bounds(2), lower(attractor%coordinates, attractor%coordinates)
    real(wp), dimension(attractor%coordinates) :: centre, point, image, second
    type(tally_t) :: tally
    integer :: i, ring, k, n
    logical :: ok, at_rest
    contracts = .false.
    n = attractor%coordinates
    do i = 1, attractor%period
      centre = attractor%points(:n, i)
      at_rest = rests_at(moving, centre)
      lower = cholesky(matrix_of(attractor%metric(:, i), n))
      bounds = eigenvalue_bounds(attractor, i)
      promised = sqrt(max(0.0_wp, 1 - 1/bounds(2)))
      promised = promised + 0.75_wp*(1 - promised)
      do ring = 1, size(rings)
        radius = rings(ring)*attractor%capture_radius
        do k = 1, max(directions, 4*n)
          point = centre + attractor%scale(:n)*back_substituted(lower, radius*direction(k, n))
          if (n == 2 .and. attractor%metric(min(3, size(attractor%metric, 1)), i) >= at_rest_only) point(2) = centre(2)
          if (point(1) > moving%upper .or. point(1) < moving%lower) cycle
          call map_point(moving, point, attractor%period, image, tally, ok)
          ! Around a section point at rest every start slips first; there the next round must have the events.
          if (ok .and. at_rest) call map_point(moving, image, attractor%period, second, tally, ok)
          if (.not. ok .or. .not. same_events(tally, reference(i))) return
          if (sqrt(squared_distance(attractor, i, image)) > promised*radius + 1e-12_wp) return
        end do
      end do
    end do
    contracts = .true.
  end function contracts

  !> Unit vectors: round a circle, there and back on a line, in more dimensions along the axes and spread over the sphere
  !> by an additive recurrence.
  pure function direction(k, n) result(unit)
    integer, intent(in) :: k, n
    real(wp) :: unit(n), sine, cosine
    integer :: j
    !> Square roots of primes.
    real(wp), parameter :: irrational(most_coordinates) = sqrt([ &
      2.0_wp, 3.0_wp, 5.0_wp, 7.0_wp, 11.0_wp, 13.0_wp, 17.0_wp, 19.0_wp, 23.0_wp, 29.0_wp, 31.0_wp, 37.0_wp, 41.0_wp, &
      43.0_wp, 47.0_wp, 53.0_wp, 59.0_wp, 61.0_wp, 67.0_wp, 71.0_wp, 73.0_wp, 79.0_wp, 83.0_wp, 89.0_wp, 97.0_wp, 101.0_wp, &
      103.0_wp, 107.0_wp, 109.0_wp, 113.0_wp, 127.0_wp, 131.0_wp, 137.0_wp, 139.0_wp, 149.0_wp, 151.0_wp, 157.0_wp, 163.0_wp, &
      167.0_wp, 173.0_wp, 179.0_wp, 181.0_wp, 191.0_wp, 193.0_wp, 197.0_wp, 199.0_wp, 211.0_wp, 223.0_wp, 227.0_wp, 229.0_wp, &
      233.0_wp, 239.0_wp, 241.0_wp, 251.0_wp, 257.0_wp, 263.0_wp, 269.0_wp, 271.0_wp, 277.0_wp, 281.0_wp, 283.0_wp, 293.0_wp, &
      307.0_wp, 311.0_wp, 313.0_wp, 317.0_wp, 331.0_wp, 337.0_wp, 347.0_wp, 349.0_wp, 353.0_wp, 359.0_wp, 367.0_wp, 373.0_wp, &
      379.0_wp, 383.0_wp, 389.0_wp, 397.0_wp, 401.0_wp, 409.0_wp, 419.0_wp, 421.0_wp, 431.0_wp, 433.0_wp, 439.0_wp, 443.0_wp, &
      449.0_wp, 457.0_wp, 461.0_wp, 463.0_wp, 467.0_wp, 479.0_wp, 487.0_wp, 491.0_wp, 499.0_wp, 503.0_wp, 509.0_wp, 521.0_wp, &
      523.0_wp, 541.0_wp, 547.0_wp, 557.0_wp, 563.0_wp, 569.0_wp, 571.0_wp, 577.0_wp, 587.0_wp, 593.0_wp, 599.0_wp, 601.0_wp, &
      607.0_wp, 613.0_wp, 617.0_wp, 619.0_wp, 631.0_wp, 641.0_wp, 643.0_wp, 647.0_wp, 653.0_wp, 659.0_wp, 661.0_wp, 673.0_wp, &
      677.0_wp, 683.0_wp, 691.0_wp, 701.0_wp, 709.0_wp, 719.0_wp])
    if (n == 2) then
      call sine_cosine(k*two_pi/directions, sine, cosine)
      unit = [cosine, sine]
    else if (k <= 2*n .or. n == 1) then
      unit = 0
      unit(1 + modulo(k, 2*n)/2) = merge(1, -1, modulo(k, 2) == 1)
    else
      unit = [(2*modulo(k*irrational(j), 1.0_wp) - 1, j=1, n)]
      unit = unit/norm2(unit)
    end if
  end function direction

  !> x with L' x = b.
  pure function back_substituted(lower, b) result(x)
    real(wp), intent(in) :: lower(:, :), b(:)
    real(wp) :: x(size(b))
    integer :: k
    do k = size(b), 1, -1
      x(k) = (b(k) - sum(lower(k + 1:, k)*x(k + 1:)))/lower(k, k)
    end do
  end function back_substituted

  !> The symmetric matrix with this upper triangle.
  pure function matrix_of(triangle, n) result(s)
    real(wp), intent(in) :: triangle(:)
    integer, intent(in) :: n
    real(wp) :: s(n, n)
    integer :: j, k
    do j = 1, n
      do k = 1, j
        s(k, j) = triangle((j*(j - 1))/2 + k)
        s(j, k) = s(k, j)
      end do
    end do
  end function matrix_of

  pure logical function same_events(a, b)
    type(tally_t), intent(in) :: a, b
    same_events = a%word == b%word .and. a%impacts == b%impacts .and. a%chatters == b%chatters &
                  .and. a%sticks == b%sticks
  end function same_events

end module cycle
