! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A cycle of the stroboscopic map: Newton's method to its fixed point, its multipliers, and the
!> neighbourhood that provably (by sampling its rings) contracts into it with the same events.
module cycle
  use attractors, only: attractor_t, features_t, longest_period, regime_of
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: int64, wp
  use motion, only: advance_period, motion_t, start_state
  use motion_state, only: mode_slip_minus, mode_slip_plus, reset_tally, state_t, tally_t
  implicit none
  private

  public :: map_point, refine_cycle

  integer, parameter :: most_newton = 20, most_halvings = 30, directions = 24
  real(wp), parameter :: rings(4) = [1.0_wp, 0.6_wp, 0.3_wp, 0.1_wp]

contains

  !> Image of a section point (x [m], v [m/s]) after `periods` drive periods and what happened on the
  !> way; `ok` is false if the trajectory had to be given up.
  pure subroutine map_point(moving, point, periods, image, tally, ok, wants_v_max)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(2)
    integer, intent(in) :: periods
    real(wp), intent(out) :: image(2)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    logical, intent(in), optional :: wants_v_max
    type(state_t) :: state
    integer :: i, reason
    state = start_state(moving, point(1), point(2), 0.0_wp)
    if (present(wants_v_max)) tally%wants_v_max = wants_v_max
    call reset_tally(tally, state)
    reason = 0
    do i = 1, periods
      call advance_period(moving, state, tally, reason)
      if (reason /= 0) exit
    end do
    image = [state%x, state%v]
    ok = reason == 0
  end subroutine map_point

  !> Turns a section point near a cycle of `period` into an attractor. `found` is false if Newton's
  !> method does not converge nearby, the cycle is not stable, or no neighbourhood contracts.
  pure subroutine refine_cycle(moving, guess, period, attractor, found)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: guess(2)
    integer, intent(in) :: period
    type(attractor_t), intent(out) :: attractor
    logical, intent(out) :: found
    real(wp) :: point(2), image(2), jacobian(2, 2)
    type(tally_t) :: tally
    integer :: i
    call map_point(moving, guess, period, image, tally, found)
    if (.not. found) return
    attractor%period = period
    attractor%scale = scale_of(moving, tally)
    point = guess
    call newton(moving, period, attractor%scale, point, found)
    if (.not. found) return
    call order_points(moving, attractor, point, found)
    if (.not. found) return
    do i = 1, attractor%period
      call differentiate(moving, attractor%points(:, i), attractor%period, attractor%scale, jacobian, found)
      if (.not. found) return
      if (i == 1) attractor%multiplier = largest_modulus(jacobian)
      found = attractor%multiplier < 1 - 1e-7_wp
      if (.not. found) return
      attractor%metric(:, i) = contracting_metric(jacobian)
    end do
    call map_point(moving, attractor%points(:, 1), attractor%period, image, tally, found, .true.)
    attractor%features = regime_of(tally, real(attractor%period, wp))
    call verify_neighbourhood(moving, attractor, found)
  end subroutine refine_cycle

  !> Half the range of the position, and that times the drive frequency.
  pure function scale_of(moving, tally) result(scale)
    type(motion_t), intent(in) :: moving
    type(tally_t), intent(in) :: tally
    real(wp) :: scale(2), floor
    floor = 1e-3_wp
    if (moving%machine%restoring%stiffness > 0) then
      floor = 1e-3_wp*moving%machine%force_scale/moving%machine%restoring%stiffness
    end if
    scale(1) = max((tally%x_max - tally%x_min)/2, floor, tiny(floor))
    scale(2) = scale(1)*moving%machine%drive_frequency
  end function scale_of

  !> Newton's method on P^period(z) - z, derivatives by central differences, steps no longer than a fifth of
  !> the motion's size; ends at rounding.
  pure subroutine newton(moving, period, scale, point, converged)
    type(motion_t), intent(in) :: moving
    integer, intent(in) :: period
    real(wp), intent(in) :: scale(2)
    real(wp), intent(inout) :: point(2)
    logical, intent(out) :: converged
    real(wp) :: image(2), miss(2), jacobian(2, 2), step(2), determinant, start(2), best
    type(tally_t) :: tally
    integer :: i
    start = point
    best = huge(best)
    do i = 1, most_newton
      call map_point(moving, point, period, image, tally, converged)
      if (.not. converged) return
      miss = (image - point)/scale
      if (norm2(miss) <= 64*epsilon(1.0_wp)) return
      if (i > 4 .and. norm2(miss) < 1e-11_wp .and. norm2(miss) >= best) return
      best = min(best, norm2(miss))
      call differentiate(moving, point, period, scale, jacobian, converged)
      if (.not. converged) return
      jacobian(1, 1) = jacobian(1, 1) - 1
      jacobian(2, 2) = jacobian(2, 2) - 1
      determinant = jacobian(1, 1)*jacobian(2, 2) - jacobian(1, 2)*jacobian(2, 1)
      converged = abs(determinant) > 0
      if (.not. converged) return
      step = [jacobian(1, 2)*miss(2) - jacobian(2, 2)*miss(1), &
              jacobian(2, 1)*miss(1) - jacobian(1, 1)*miss(2)]/determinant
      if (norm2(step) > 0.2_wp) step = 0.2_wp*step/norm2(step)
      point = point + scale*step
      point(1) = min(max(point(1), moving%machine%contact%lower), moving%machine%contact%upper)
      converged = norm2((point - start)/scale) < 1
      if (.not. converged) return
    end do
    converged = best < 1e-9_wp
  end subroutine newton

  !> Scaled derivative of P^period by central differences; one-sided at a barrier.
  pure subroutine differentiate(moving, point, period, scale, jacobian, ok)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(2), scale(2)
    integer, intent(in) :: period
    real(wp), intent(out) :: jacobian(2, 2)
    logical, intent(out) :: ok
    real(wp) :: ahead(2), behind(2), image_ahead(2), image_behind(2), h
    type(tally_t) :: tally
    integer :: k
    h = epsilon(1.0_wp)**(1.0_wp/3.0_wp)
    do k = 1, 2
      ahead = point
      behind = point
      ahead(k) = ahead(k) + h*scale(k)
      behind(k) = behind(k) - h*scale(k)
      ahead(1) = min(ahead(1), moving%machine%contact%upper)
      behind(1) = max(behind(1), moving%machine%contact%lower)
      call map_point(moving, ahead, period, image_ahead, tally, ok)
      if (.not. ok) return
      call map_point(moving, behind, period, image_behind, tally, ok)
      if (.not. ok) return
      jacobian(:, k) = (image_ahead - image_behind)/scale/((ahead(k) - behind(k))/scale(k))
    end do
  end subroutine differentiate

  !> Section points of the cycle, the one with the smallest position first; the period is reduced to the
  !> smallest one.
  pure subroutine order_points(moving, attractor, point, ok)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    real(wp), intent(in) :: point(2)
    logical, intent(out) :: ok
    real(wp) :: cycle_points(2, longest_period), image(2)
    type(tally_t) :: tally
    integer :: i
    cycle_points(:, 1) = point
    do i = 2, attractor%period
      call map_point(moving, cycle_points(:, i - 1), 1, image, tally, ok)
      if (.not. ok) return
      if (norm2((image - point)/attractor%scale) < 1e-8_wp) then
        attractor%period = i - 1
        exit
      end if
      cycle_points(:, i) = image
    end do
    ok = .true.
    i = minloc(cycle_points(1, :attractor%period), 1)
    attractor%points(:, :attractor%period) = cshift(cycle_points(:, :attractor%period), i - 1, 2)
  end subroutine order_points

  !> Largest modulus of the eigenvalues of a 2 x 2 matrix.
  pure real(wp) function largest_modulus(a)
    real(wp), intent(in) :: a(2, 2)
    real(wp) :: half_trace, determinant, discriminant
    half_trace = (a(1, 1) + a(2, 2))/2
    determinant = a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1)
    discriminant = half_trace**2 - determinant
    if (discriminant >= 0) then
      largest_modulus = abs(half_trace) + sqrt(discriminant)
    else
      largest_modulus = sqrt(determinant)
    end if
  end function largest_modulus

  !> S = sum over n of (M^n)' M^n, the metric in which a stable M contracts: s11, s12, s22.
  pure function contracting_metric(jacobian) result(metric)
    real(wp), intent(in) :: jacobian(2, 2)
    real(wp) :: metric(3), s(2, 2), m(2, 2)
    integer :: i
    s = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    m = jacobian
    do i = 1, 30
      s = s + matmul(transpose(m), matmul(s, m))
      m = matmul(m, m)
      if (maxval(abs(m)) < epsilon(1.0_wp)) exit
    end do
    metric = [s(1, 1), (s(1, 2) + s(2, 1))/2, s(2, 2)]
  end function contracting_metric

  !> Halves the capture radius until every sampled start on rings within it, around every point of the cycle,
  !> comes back after one period of the cycle nearer by what the linear part promises, with the events of the cycle.
  pure subroutine verify_neighbourhood(moving, attractor, found)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    logical, intent(out) :: found
    type(tally_t) :: reference(longest_period)
    real(wp) :: image(2), smallest
    integer :: i
    logical :: ok
    smallest = huge(smallest)
    do i = 1, attractor%period
      call map_point(moving, attractor%points(:, i), attractor%period, image, reference(i), ok)
      associate (s => attractor%metric(:, i))
        smallest = min(smallest, (s(1) + s(3))/2 - sqrt(((s(1) - s(3))/2)**2 + s(2)**2))
      end associate
    end do
    attractor%capture_radius = 0.5_wp*sqrt(smallest)
    do i = 1, most_halvings
      found = contracts(moving, attractor, reference)
      if (found) return
      attractor%capture_radius = attractor%capture_radius/2
    end do
  end subroutine verify_neighbourhood

  pure logical function contracts(moving, attractor, reference)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    type(tally_t), intent(in) :: reference(:)
    real(wp) :: radius, point(2), image(2), second(2), d(2), l11, l21, l22, promised, sine, cosine
    type(tally_t) :: tally
    type(state_t) :: state
    integer :: i, ring, k
    logical :: ok, at_rest
    contracts = .false.
    do i = 1, attractor%period
      state = start_state(moving, attractor%points(1, i), attractor%points(2, i), 0.0_wp)
      at_rest = state%mode /= mode_slip_plus .and. state%mode /= mode_slip_minus
      associate (s => attractor%metric(:, i))
        ! Cholesky factor of the metric: S = L L'.
        l11 = sqrt(s(1))
        l21 = s(2)/l11
        l22 = sqrt(s(3) - l21**2)
        promised = sqrt(max(0.0_wp, 1 - 1/((s(1) + s(3))/2 + sqrt(((s(1) - s(3))/2)**2 + s(2)**2))))
        promised = promised + 0.75_wp*(1 - promised)
        do ring = 1, size(rings)
          radius = rings(ring)*attractor%capture_radius
          do k = 1, directions
            call sine_cosine(k*two_pi/directions, sine, cosine)
            d(2) = radius*sine/l22
            d(1) = (radius*cosine - l21*d(2))/l11
            point = attractor%points(:, i) + attractor%scale*d
            if (point(1) > moving%machine%contact%upper .or. point(1) < moving%machine%contact%lower) cycle
            call map_point(moving, point, attractor%period, image, tally, ok)
            ! Around a section point at rest every start slips first; there the next round must have the events.
            if (ok .and. at_rest) call map_point(moving, image, attractor%period, second, tally, ok)
            if (.not. ok .or. .not. same_events(tally, reference(i))) return
            d = (image - attractor%points(:, i))/attractor%scale
            if (sqrt(s(1)*d(1)**2 + 2*s(2)*d(1)*d(2) + s(3)*d(2)**2) > promised*radius + 1e-12_wp) return
          end do
        end do
      end associate
    end do
    contracts = .true.
  end function contracts

  pure logical function same_events(a, b)
    type(tally_t), intent(in) :: a, b
    same_events = a%word == b%word .and. a%impacts == b%impacts .and. a%chatters == b%chatters &
                  .and. a%sticks == b%sticks
  end function same_events

end module cycle
