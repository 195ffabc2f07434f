! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a neighbourhood contracts into a cycle, by starts on rings around its points.
module contraction
  use attractors, only: attractor_t, most_coordinates, squared_distance
  use capture_metric, only: at_rest_only, matrix_of
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: cholesky
  use motion_state, only: mode_slip_minus, mode_slip_plus, tally_t
  use section_map, only: map_point
  implicit none
  private

  public :: contracts, direction, rests_at

  !> Directions and radii of the starts by which a neighbourhood is tested.
  integer, parameter, public :: directions = 24
  real(wp), parameter, public :: rings(4) = [1.0_wp, 0.6_wp, 0.3_wp, 0.1_wp]

contains

  !> Whether every start on the rings within `radius` around every point of a cycle has the events of `reference` and is, one period
  !> of the cycle later, nearer by the share `promised` of each point. `settles`: around a point at rest a start first slips for one
  !> round.
  pure logical function contracts(moving, attractor, reference, radius, promised, settles)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    type(tally_t), intent(in) :: reference(:)
    real(wp), intent(in) :: radius, promised(:)
    logical, intent(in) :: settles
    real(wp) :: distance, lower(attractor%coordinates, attractor%coordinates)
    real(wp), dimension(attractor%coordinates) :: centre, point, image, second
    type(tally_t) :: tally
    integer :: i, ring, k, n
    logical :: ok, at_rest
    contracts = .false.
    n = attractor%coordinates
    do i = 1, attractor%period
      centre = attractor%points(:n, i)
      at_rest = .false.
      if (settles) at_rest = rests_at(moving, centre)
      lower = cholesky(matrix_of(attractor%metric(:, i), n))
      do ring = 1, size(rings)
        distance = rings(ring)*radius
        do k = 1, merge(2, max(directions, 4*n), n == 1)
          point = centre + attractor%scale(:n)*back_substituted(lower, distance*direction(k, n))
          if (n == 2 .and. attractor%metric(min(3, size(attractor%metric, 1)), i) >= at_rest_only) point(2) = centre(2)
          if (point(1) > moving%upper .or. point(1) < moving%lower) cycle
          call map_point(moving, point, attractor%period, image, tally, ok)
          ! Around a section point at rest every start slips first; there the next round must have the events.
          if (ok .and. at_rest) call map_point(moving, image, attractor%period, second, tally, ok)
          if (.not. ok .or. .not. same_events(tally, reference(i))) return
          if (sqrt(squared_distance(attractor, i, image)) > promised(i)*distance + 1e-12_wp) return
        end do
      end do
    end do
    contracts = .true.
  end function contracts

  !> Whether friction, or a stop, holds the body at a section point.
  pure logical function rests_at(moving, point)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    section = moving%state_at(point)
    rests_at = section%state%mode /= mode_slip_plus .and. section%state%mode /= mode_slip_minus
  end function rests_at

  pure logical function same_events(a, b)
    type(tally_t), intent(in) :: a, b
    same_events = a%word == b%word .and. a%impacts == b%impacts .and. a%chatters == b%chatters &
                  .and. a%sticks == b%sticks
  end function same_events

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

end module contraction
