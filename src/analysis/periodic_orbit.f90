! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Periodic orbits with a given sequence of events, stable or not, of one body over a parameter. Unknowns are the state on the
!> section, the instants of the events, and the parameter; equations are the guards at those instants, the return to the
!> section, and one linear condition. All are smooth functions, also where an impact becomes a graze or an instant passes
!> another, so that an orbit can be followed up to and beyond the end of its event sequence.
module periodic_orbit
  use body_family, only: body_neighbourhood, family_t, fly_periods
  use errors, only: error_t
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use matrices, only: eigenvalues, solve
  use motion_state, only: tally_t
  use one_body, only: one_body_t, rests_on_barrier
  use variations, only: by_difference, neighbourhood_t, vary
  implicit none
  private

  public :: orbit_of_motion, correct_orbit, tangent_of, direct, same_sequence, is_admissible, rotate_to_section, scales_of_orbit, &
    move_along, section_points, shoot

  integer, parameter, public :: states = 2
  !> Orbits with more events are not followed.
  integer, parameter, public :: most_events = 60
  integer, parameter :: most_newton = 12
  !> Newton's method has converged when a step, in natural sizes, is below this.
  real(wp), parameter :: converged_step = 1e-11_wp
  !> A motion with the events of an orbit at other instants than this share of 1/frequency is not that orbit.
  real(wp), parameter :: likeness = 1e-5_wp

  !> An orbit of `periods` drive periods at the value `parameter`.
  type, public :: orbit_t
    integer :: periods = 1
    !> Mode at the section.
    integer :: mode = 0
    real(wp) :: parameter = 0, y(states) = 0
    type(event_t), allocatable :: events(:)
    !> Of the map over the period of the orbit.
    complex(wp) :: multipliers(states) = 0
    real(wp) :: matrix(states, states) = 0
  end type orbit_t

contains

  !> The orbit near which a motion that starts at `y` on the section is for `periods` drive periods, not yet corrected.
  subroutine orbit_of_motion(machines, parameter, y, periods, orbit, ok)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: parameter, y(states)
    integer, intent(in) :: periods
    type(orbit_t), intent(out) :: orbit
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp) :: image(states)
    orbit%periods = periods
    orbit%parameter = parameter
    orbit%y = y
    ok = .false.
    select type (body => machines%centre)
    type is (one_body_t)
      call fly_periods(body, y, periods, .true., image, orbit%events, orbit%mode, tally, ok)
      if (ok) ok = size(orbit%events) <= most_events
    end select
  end subroutine orbit_of_motion

  !> Natural sizes of the unknowns: state, instants, parameter.
  pure function scales_of_orbit(machines, orbit, parameter_size) result(scales)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: parameter_size
    real(wp) :: scales(states + size(orbit%events) + 1)
    scales = 1
    select type (body => machines%centre)
    type is (one_body_t)
      scales(:states) = body%size_of
      scales(states + 1:) = body%size_of(1)/body%size_of(2)
    end select
    scales(size(scales)) = parameter_size
  end function scales_of_orbit

  !> What does not fit in the guesses: guards at the instants, then the miss of the return; with the derivatives by state and
  !> instants. The events of `orbit` are given the states before and after them.
  pure subroutine shoot(machine, orbit, miss, slopes)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(out) :: miss(:), slopes(:, :)
    real(wp), dimension(states) :: y, arrived, by_state, by_time
    real(wp) :: change(states, states + size(orbit%events)), flight(states, states), jump(states, states), t, guard_rate
    integer :: k, m, mode
    m = size(orbit%events)
    y = orbit%y
    mode = orbit%mode
    t = 0
    change = 0
    call machine%fly(mode, t, y, t, arrived, change(:, :states))
    y = arrived
    do k = 1, m
      associate (event => orbit%events(k))
        call machine%fly(mode, t, y, event%time, arrived, flight)
        change = matmul(flight, change)
        if (k > 1) change(:, states + k - 1) = change(:, states + k - 1) - matmul(flight, machine%slope(mode, t, y))
        t = event%time
        change(:, states + k) = change(:, states + k) + machine%slope(mode, t, arrived)
        event%before = mode
        event%arrival(:states) = arrived
        call machine%guard(event, t, arrived, miss(k), by_state, guard_rate)
        slopes(k, :) = matmul(by_state, change)
        slopes(k, states + k) = slopes(k, states + k) + guard_rate
        call machine%jump(event, t, arrived, y, jump, by_time)
        change = matmul(jump, change)
        change(:, states + k) = change(:, states + k) + by_time
        event%departure(:states) = y
        mode = event%after
      end associate
    end do
    call machine%fly(mode, t, y, orbit%periods*machine%period, arrived, flight)
    change = matmul(flight, change)
    if (m > 0) change(:, states + m) = change(:, states + m) - matmul(flight, machine%slope(mode, t, y))
    miss(m + 1:) = arrived - orbit%y
    slopes(m + 1:, :) = change
    do k = 1, states
      slopes(m + k, k) = slopes(m + k, k) - 1
    end do
  end subroutine shoot

  !> What does not fit in the guesses, as `shoot`, without the derivatives.
  pure subroutine shoot_only(machine, orbit, miss)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(out) :: miss(:)
    real(wp), dimension(states) :: y, arrived, by_state, by_time
    real(wp) :: jump(states, states), t, guard_rate
    integer :: k, m, mode
    m = size(orbit%events)
    mode = orbit%mode
    t = 0
    call machine%fly(mode, t, orbit%y, t, y)
    do k = 1, m
      associate (event => orbit%events(k))
        call machine%fly(mode, t, y, event%time, arrived)
        t = event%time
        call machine%guard(event, t, arrived, miss(k), by_state, guard_rate)
        call machine%jump(event, t, arrived, y, jump, by_time)
        mode = event%after
      end associate
    end do
    call machine%fly(mode, t, y, orbit%periods*machine%period, arrived)
    miss(m + 1:) = arrived - orbit%y
  end subroutine shoot_only

  !> The equations at an orbit and their derivatives by state, instants and parameter, in natural sizes.
  pure subroutine equations(machines, orbit, scales, miss, slopes)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: scales(:)
    real(wp), intent(out) :: miss(:), slopes(:, :)
    real(wp) :: near(size(miss), 4)
    integer :: i, n
    n = size(miss)
    call shoot(machines%centre, orbit, miss, slopes(:, :n))
    do i = 1, 4
      call shoot_only(machines%near(i), orbit, near(:, i))
    end do
    slopes(:, n + 1) = by_difference(machines, miss, near)
    do i = 1, n + 1
      slopes(:, i) = slopes(:, i)*scales(i)
    end do
    do i = 1, n
      associate (largest => maxval(abs(slopes(i, :))))
        if (.not. largest > 0) cycle
        miss(i) = miss(i)/largest
        slopes(i, :) = slopes(i, :)/largest
      end associate
    end do
  end subroutine equations

  !> Newton's method from a guess; in natural sizes the orbit moves only across `direction` (a row over state, instants and
  !> parameter): a direction along the parameter keeps that fixed. `steps` is the number of iterations. `machines` in the end
  !> are those of the orbit found.
  subroutine correct_orbit(family, machines, orbit, direction, ok, steps)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: direction(:)
    logical, intent(out) :: ok
    integer, intent(out), optional :: steps
    real(wp), dimension(size(direction)) :: scales, miss, step
    real(wp) :: slopes(size(direction), size(direction)), before, length
    type(error_t), allocatable :: error
    integer :: i, n
    n = size(direction)
    before = huge(before)
    length = huge(length)
    do i = 1, most_newton
      if (present(steps)) steps = i
      scales = scales_of_orbit(machines, orbit, family%parameter_size)
      call equations(machines, orbit, scales, miss(:n - 1), slopes(:n - 1, :))
      slopes(n, :) = direction
      miss(n) = 0
      call solve(slopes, -miss, step, ok)
      if (ok) ok = all(abs(step) <= 1e3_wp)
      if (.not. ok) return
      before = length
      length = norm2(step)
      call move_along(orbit, scales*step)
      if (abs(step(n)) > 0) call body_neighbourhood(family, orbit%parameter, machines, error)
      ok = .not. allocated(error)
      if (.not. ok) return
      ! It has come as near as rounding lets it.
      if (length < 1e-14_wp .or. (length < converged_step .and. length >= 0.1_wp*before)) exit
      ! Or what the next step would be is nil, the steps shrinking with the square.
      ok = length < 1e-7_wp .and. length*(length/before)**2 < 1e-17_wp
      if (ok) exit
    end do
    ok = ok .or. length < converged_step
    if (.not. ok) return
    call clean_rest(machines, orbit)
    call set_multipliers(machines, orbit)
  end subroutine correct_orbit

  !> Adds a change of state, instants and parameter (not scaled).
  pure subroutine move_along(orbit, change)
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: change(:)
    integer :: m
    m = size(orbit%events)
    orbit%y = orbit%y + change(:states)
    orbit%events%time = orbit%events%time + change(states + 1:states + m)
    orbit%parameter = orbit%parameter + change(size(change))
  end subroutine move_along

  !> A body that rests on a barrier at the section is there to the bit.
  pure subroutine clean_rest(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp) :: y(states)
    if (.not. rests_on_barrier(orbit%mode)) return
    call machines%centre%fly(orbit%mode, 0.0_wp, orbit%y, 0.0_wp, y)
    orbit%y = y
  end subroutine clean_rest

  !> Derivative of the map over the orbit's period, by saltation, and its eigenvalues; of an orbit that grazes they are not finite.
  pure subroutine set_multipliers(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp) :: miss(states + size(orbit%events)), slopes(states + size(orbit%events), states + size(orbit%events))
    logical :: ok
    call shoot(machines%centre, orbit, miss, slopes)
    call vary(machines, orbit%mode, orbit%y, orbit%events, orbit%periods*machines%centre%period, [huge(1.0_wp), huge(1.0_wp)], &
              orbit%matrix, ok)
    if (.not. ok) orbit%matrix = sqrt(huge(1.0_wp))
    orbit%multipliers = eigenvalues(orbit%matrix)
  end subroutine set_multipliers

  !> Direction in which the orbits go on, a unit vector in natural sizes, on the side of `along`.
  pure subroutine tangent_of(machines, orbit, parameter_size, along, tangent, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: parameter_size, along(:)
    real(wp), intent(out) :: tangent(:)
    logical, intent(out) :: ok
    real(wp) :: miss(size(along)), slopes(size(along), size(along)), right(size(along))
    integer :: n
    n = size(along)
    call equations(machines, orbit, scales_of_orbit(machines, orbit, parameter_size), miss(:n - 1), slopes(:n - 1, :))
    slopes(n, :) = along
    right = 0
    right(n) = 1
    call solve(slopes, right, tangent, ok)
    if (ok) tangent = tangent/norm2(tangent)
  end subroutine tangent_of

  !> The direction along the parameter alone, upwards or downwards.
  pure function direct(orbit, way) result(along)
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: way
    real(wp) :: along(states + size(orbit%events) + 1)
    along = 0
    along(size(along)) = way
  end function direct

  !> Whether two orbits have the same events in the same order.
  pure logical function same_sequence(one, other) result(same)
    type(orbit_t), intent(in) :: one, other
    same = one%periods == other%periods .and. size(one%events) == size(other%events)
    if (same) same = all(one%events%kind == other%events%kind) .and. all(one%events%side == other%events%side)
  end function same_sequence

  !> Whether the motion that starts at the orbit's section point really has its events at its instants.
  logical function is_admissible(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    type(orbit_t) :: motion
    real(wp) :: allowed
    call orbit_of_motion(machines, orbit%parameter, orbit%y, orbit%periods, motion, is_admissible)
    if (is_admissible) is_admissible = same_sequence(motion, orbit)
    if (.not. is_admissible) return
    allowed = likeness*machines%centre%period*max(1.0_wp, abs(orbit%multipliers(1))*1e-3_wp)
    is_admissible = all(abs(motion%events%time - orbit%events%time) <= allowed)
  end function is_admissible

  !> Where an instant has passed the section, the orbit is begun anew so that all instants lie within its period. `turned` tells
  !> whether it was.
  pure subroutine rotate_to_section(machines, orbit, turned)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    logical, intent(out) :: turned
    type(event_t) :: moved
    real(wp) :: span, y(states), from(states)
    integer :: m
    turned = .false.
    m = size(orbit%events)
    if (m == 0) return
    span = orbit%periods*machines%centre%period
    if (orbit%events(1)%time < 0) then
      moved = orbit%events(1)
      call machines%centre%fly(moved%after, moved%time, moved%departure(:states), 0.0_wp, y)
      orbit%mode = moved%after
      moved%time = moved%time + span
      orbit%events = [orbit%events(2:), moved]
    else if (orbit%events(m)%time > span) then
      moved = orbit%events(m)
      from = orbit%y
      if (m > 1) from = orbit%events(m - 1)%departure(:states)
      if (m > 1) call machines%centre%fly(moved%before, orbit%events(m - 1)%time, from, span, y)
      if (m == 1) call machines%centre%fly(moved%before, 0.0_wp, from, span, y)
      orbit%mode = moved%before
      moved%time = moved%time - span
      orbit%events = [moved, orbit%events(:m - 1)]
    else
      return
    end if
    orbit%y = y
    turned = .true.
  end subroutine rotate_to_section

  !> The section points of an orbit, period by period.
  pure function section_points(machines, orbit) result(points)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp) :: points(states, orbit%periods)
    real(wp) :: y(states), t, section
    integer :: i, k, mode
    points(:, 1) = orbit%y
    y = orbit%y
    t = 0
    mode = orbit%mode
    k = 0
    do i = 1, orbit%periods - 1
      section = i*machines%centre%period
      do while (k < size(orbit%events))
        if (orbit%events(k + 1)%time > section) exit
        k = k + 1
        y = orbit%events(k)%departure(:states)
        t = orbit%events(k)%time
        mode = orbit%events(k)%after
      end do
      call machines%centre%fly(mode, t, y, section, points(:, i + 1))
    end do
  end function section_points

end module periodic_orbit
