! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A cycle of the stroboscopic map: Newton's method to its fixed point, its multipliers, and the
!> neighbourhood that provably (by sampling its rings) contracts into it with the same events.
module cycle
  use attractors, only: attractor_t, longest_period, make_points
  use capture_metric, only: at_rest_only, contracting_metric, eigenvalue_bounds, least_eigenvalue
  use circle, only: point_near
  use contraction, only: contracts, rests_at
  use kinds, only: wp
  use machine_type, only: machine_t
  use matrices, only: eigenvalues, solve, spectral_radius
  use motion_features, only: cycle_word, features_over
  use motion_state, only: tally_t
  use section_map, only: derivative, differentiate, map_point, scale_of
  use section_slopes, only: slopes_of
  implicit none
  private

  public :: refine_cycle

  integer, parameter :: most_newton = 20, most_halvings = 30
  !> A cycle attracts if its largest multiplier is below this: nearer to 1 rounding of the derivatives decides.
  real(wp), parameter, public :: unattractive = 1 - 1e-7_wp

contains

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
      ! Turns of a whole cycle: those in the time of a small oscillation mean nothing.
      attractor%features%rotation = real(tally%turns, wp)
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
    real(wp) :: bounds(2), promised(attractor%period)
    integer :: i
    do i = 1, attractor%period
      bounds = eigenvalue_bounds(attractor, i)
      promised(i) = sqrt(max(0.0_wp, 1 - 1/bounds(2)))
    end do
    promised = promised + 0.75_wp*(1 - promised)
    attractor%capture_radius = 0.5_wp*sqrt(least_eigenvalue(attractor))
    do i = 1, most_halvings
      found = contracts(moving, attractor, reference, attractor%capture_radius, promised, settles=.true.)
      if (found) return
      attractor%capture_radius = attractor%capture_radius/2
    end do
  end subroutine halve_radius

end module cycle
