! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Periodic orbits with a given sequence of events, stable or not, of a machine over a parameter. Unknowns are the state on the
!> section, the instants of the events, and the parameter; equations are the guards at those instants, the return to the
!> section, and one linear condition. All are smooth functions, also where an impact becomes a graze or an instant passes
!> another, so that an orbit can be followed up to and beyond the end of its event sequence.
module periodic_orbit
  use body_family, only: family_t
  use constants, only: unreachable
  use errors, only: error_t
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood, machine_of_family
  use matrices, only: solve
  use multipliers, only: multipliers_beside_graze, multipliers_of
  use structure, only: structure_t
  use structure_family, only: vary_section
  use variations, only: by_difference, neighbourhood_t, split_t, vary, vary_beside_graze
  implicit none
  private

  public :: closing_time, correct_orbit, equations, move_along, parameter_slopes, scales_of_orbit, set_multipliers, shoot, &
    shoot_only

  integer, parameter :: most_newton = 12
  !> Newton's method has converged when a step, in natural sizes, is below this.
  real(wp), parameter :: converged_step = 1e-11_wp
  !> Where the equations hold to this, steps up to the other length are of rounding alone, as the equations resolve no more.
  real(wp), parameter :: rounding_of_equations = 5e-14_wp, settled_by_rounding = 1e-9_wp
  !> Newton's steps with the same derivatives by the parameter.
  integer, parameter :: newton_between = 4
  !> Orbits whose points on the section are within this in natural sizes are one.
  real(wp), parameter, public :: same_orbit = 1e-7_wp

  !> An orbit of `periods` drive periods at the value `parameter`.
  type, public :: orbit_t
    integer :: periods = 1
    !> Mode at the section.
    integer :: mode = 0
    real(wp) :: parameter = 0
    real(wp), allocatable :: y(:)
    type(event_t), allocatable :: events(:)
    !> Of the map over the period of the orbit.
    complex(wp), allocatable :: multipliers(:)
    real(wp), allocatable :: matrix(:, :)
  end type orbit_t

contains

  !> Natural sizes of the unknowns: state, instants, parameter.
  pure function scales_of_orbit(machines, orbit, parameter_size) result(scales)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: parameter_size
    real(wp) :: scales(size(orbit%y) + size(orbit%events) + 1)
    scales(:size(orbit%y)) = machines%centre%size_of
    scales(size(orbit%y) + 1:) = machines%centre%size_of_time()
    scales(size(scales)) = parameter_size
  end function scales_of_orbit

  !> Time at which an orbit closes [s]: without a clock that of its last event, the section, which is unknown.
  pure real(wp) function closing_time(machine, orbit) result(time)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    time = orbit%periods*machine%period
    if (.not. machine%has_clock .and. size(orbit%events) > 0) time = orbit%events(size(orbit%events))%time
  end function closing_time

  !> What does not fit in the guesses: guards at the instants, then the miss of the return; with the derivatives by state and
  !> instants. The events of `orbit` are given the states before and after them.
  pure subroutine shoot(machine, orbit, miss, slopes)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(out) :: miss(:), slopes(:, :)
    real(wp), dimension(size(orbit%y)) :: y, arrived, by_state, by_time
    real(wp), dimension(size(orbit%y), size(orbit%y)) :: flight, jump
    real(wp) :: change(size(orbit%y), size(orbit%y) + size(orbit%events)), t, guard_rate
    integer :: k, m, mode, states
    states = size(orbit%y)
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
    call machine%fly(mode, t, y, closing_time(machine, orbit), arrived, flight)
    change = matmul(flight, change)
    if (m > 0 .and. machine%has_clock) change(:, states + m) = change(:, states + m) - matmul(flight, machine%slope(mode, t, y))
    miss(m + 1:) = machine%nearest_copy(arrived, orbit%y) - orbit%y
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
    real(wp), dimension(size(orbit%y)) :: y, arrived, by_state, by_time
    real(wp) :: jump(size(orbit%y), size(orbit%y)), t, guard_rate
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
    call machine%fly(mode, t, y, closing_time(machine, orbit), arrived)
    miss(m + 1:) = machine%nearest_copy(arrived, orbit%y) - orbit%y
  end subroutine shoot_only

  !> Derivatives of what does not fit by the parameter, from the neighbours of the machine.
  pure function parameter_slopes(machines, orbit) result(slopes)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp), dimension(size(orbit%y) + size(orbit%events)) :: slopes, own
    real(wp) :: near(size(own), 4)
    integer :: i
    call shoot_only(machines%centre, orbit, own)
    do i = 1, 4
      call shoot_only(machines%near(i)%machine, orbit, near(:, i))
    end do
    slopes = by_difference(machines, own, near)
  end function parameter_slopes

  !> The equations at an orbit and their derivatives by state, instants and parameter, the last as given, in natural sizes.
  pure subroutine equations(machine, orbit, scales, by_parameter, miss, slopes)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: scales(:), by_parameter(:)
    real(wp), intent(out) :: miss(:), slopes(:, :)
    integer :: i, n
    n = size(miss)
    call shoot(machine, orbit, miss, slopes(:, :n))
    slopes(:, n + 1) = by_parameter
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
  !> are those of the orbit found. Where rounding keeps steps from shrinking as far as they should, it is found if `roughly` will
  !> do.
  subroutine correct_orbit(family, machines, orbit, direction, ok, steps, roughly)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: direction(:)
    logical, intent(out) :: ok
    integer, intent(out), optional :: steps
    logical, intent(in), optional :: roughly
    real(wp), dimension(size(direction)) :: scales, miss, step
    real(wp) :: slopes(size(direction), size(direction)), by_parameter(size(direction) - 1), before, length
    type(error_t), allocatable :: error
    logical :: moved, near_enough
    integer :: i, n
    n = size(direction)
    near_enough = .false.
    before = huge(before)
    length = huge(length)
    moved = .false.
    do i = 1, most_newton
      if (present(steps)) steps = i
      ! Machines take time to build: the neighbours' derivatives are kept for a while, which costs an order of convergence at most.
      if (modulo(i, newton_between) == 1) then
        if (moved) call machine_neighbourhood(family, orbit%parameter, machines, error)
        if (.not. allocated(error)) by_parameter = parameter_slopes(machines, orbit)
        moved = .false.
      else if (moved) then
        call renew_centre(family, orbit%parameter, machines, error)
      end if
      ok = .not. allocated(error)
      if (.not. ok) return
      scales = scales_of_orbit(machines, orbit, family%parameter_size)
      call equations(machines%centre, orbit, scales, by_parameter, miss(:n - 1), slopes(:n - 1, :))
      slopes(n, :) = direction
      miss(n) = 0
      call solve(slopes, -miss, step, ok)
      if (ok) ok = all(abs(step) <= 1e3_wp)
      if (.not. ok) return
      before = length
      length = norm2(step)
      call move_along(orbit, scales*step)
      moved = moved .or. abs(step(n)) > 0
      ! It has come as near as rounding lets it.
      if (length < 1e-14_wp .or. (length < converged_step .and. length >= 0.1_wp*before)) exit
      ! Or what the next step would be is nil, even if the steps shrink no faster than so far: beside a graze they do so late.
      ok = i > 1 .and. length*(length/before) < 1e-15_wp
      if (ok) exit
      near_enough = .false.
      if (present(roughly)) near_enough = roughly .and. norm2(miss) < rounding_of_equations
      if (near_enough .and. length < settled_by_rounding .and. length >= 0.5_wp*before) exit
    end do
    ok = ok .or. length < converged_step .or. (near_enough .and. length < settled_by_rounding)
    if (ok .and. moved) call machine_neighbourhood(family, orbit%parameter, machines, error)
    ok = ok .and. .not. allocated(error)
    if (.not. ok) return
    call clean_rest(machines, orbit)
    call set_multipliers(machines, orbit)
  end subroutine correct_orbit

  !> The machine at a value of the parameter, its neighbours as they are.
  subroutine renew_centre(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(inout) :: machines
    type(error_t), allocatable, intent(out) :: error
    class(hybrid_t), allocatable :: machine
    call machine_of_family(family, value, machine, error)
    if (.not. allocated(error)) call move_alloc(machine, machines%centre)
  end subroutine renew_centre

  !> Adds a change of state, instants and parameter (not scaled).
  pure subroutine move_along(orbit, change)
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: change(:)
    integer :: m, states
    states = size(orbit%y)
    m = size(orbit%events)
    orbit%y = orbit%y + change(:states)
    orbit%events%time = orbit%events%time + change(states + 1:states + m)
    orbit%parameter = orbit%parameter + change(size(change))
  end subroutine move_along

  !> What rests at the section is where it is held to the bit.
  pure subroutine clean_rest(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp) :: y(size(orbit%y))
    if (.not. machines%centre%rests(orbit%mode)) return
    call machines%centre%fly(orbit%mode, 0.0_wp, orbit%y, 0.0_wp, y)
    orbit%y = y
  end subroutine clean_rest

  !> Derivative of the map over the orbit's period, by saltation, and its eigenvalues; of an orbit that grazes they are not finite.
  pure subroutine set_multipliers(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp) :: miss(size(orbit%y) + size(orbit%events)), slopes(size(miss), size(miss))
    real(wp), dimension(size(orbit%y)) :: unbounded, y
    real(wp), allocatable :: determinant
    logical :: ok
    unbounded = huge(1.0_wp)
    call shoot(machines%centre, orbit, miss, slopes)
    select type (structure => machines%centre)
    type is (structure_t)
      y = orbit%y
      call vary_section(machines, structure, orbit%mode, orbit%y, orbit%events, orbit%periods, y, orbit%matrix, ok)
    class default
      if (machines%centre%has_clock) then
        allocate (determinant)
        call vary(machines, orbit%mode, orbit%y, orbit%events, orbit%periods*machines%centre%period, unbounded, orbit%matrix, ok, &
                  determinant=determinant)
      else
        y = orbit%y
        call vary_section(machines, machines%centre, orbit%mode, orbit%y, orbit%events, orbit%periods, y, orbit%matrix, ok)
      end if
    end select
    if (.not. ok) then
      orbit%matrix = unreachable
      if (allocated(determinant)) deallocate (determinant)
    end if
    orbit%multipliers = multipliers_of(orbit%matrix, determinant)
    if (any(orbit%multipliers /= orbit%multipliers)) call add_hidden(machines, orbit)
  end subroutine set_multipliers

  !> Finite multipliers that rounding hides behind that of a graze: the event whose guard is met at the least rate apart from the
  !> others, or the two such events where it is not that one alone.
  pure subroutine add_hidden(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    type(split_t) :: split
    complex(wp) :: values(size(orbit%y))
    real(wp) :: speeds(size(orbit%events)), by_state(size(orbit%y)), value, by_time
    integer :: grazes(2), k, apart
    logical :: ok
    if (.not. machines%centre%has_clock .or. size(orbit%events) == 0) return
    associate (machine => machines%centre, n => size(orbit%y))
      do k = 1, size(orbit%events)
        associate (event => orbit%events(k))
          call machine%guard(event, event%time, event%arrival(:n), value, by_state, by_time)
          speeds(k) = abs(sum(by_state*machine%slope(event%before, event%time, event%arrival(:n))) + by_time)/ &
            max(norm2(by_state), tiny(1.0_wp))
        end associate
      end do
      do apart = 1, min(2, size(speeds))
        grazes(apart) = minloc(speeds, 1)
        speeds(grazes(apart)) = huge(1.0_wp)
        if (apart == 2) grazes = [minval(grazes), maxval(grazes)]
        call vary_beside_graze(machines, orbit%mode, orbit%y, orbit%events, closing_time(machine, orbit), grazes(:apart), split, ok)
        if (.not. ok) return
        do k = 1, n
          split%base(:, k) = split%base(:, k)*machine%size_of(k)/machine%size_of
        end do
        values = multipliers_beside_graze(split%base, split%column/machine%size_of, split%row*machine%size_of, split%rate, &
                                          split%lost)
        if (.not. all(values(2:) == values(2:))) cycle
        orbit%multipliers(2:) = values(2:)
        return
      end do
    end associate
  end subroutine add_hidden

end module periodic_orbit
