! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of a mode in which the force of a joint is not linear, by high-order steps of `marched_system`.
module marched_flight
  use contact_law, only: contact_t
  use flight_path, only: begin_series, constant_forces, path_t
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, march_time_over, take_step
  use guards, only: guards_of, joint_guard_t, room_for_guards
  use multibody, only: joint_soft, multibody_t
  use multibody_state, only: is_curved, multibody_state_t, turning_at
  use elementary, only: exponential, logarithm
  use kinds, only: wp
  use linear_flight, only: watch_t
  use marched_load, only: load_at, move_origin, sizes_of_switch
  use marched_system, only: digits_of_forces, forces_at, marched_t, position_now, set_system, sizes_of_guards, sizes_of_terms, &
    unknowns
  use mode_flow, only: harmonics_of, mode_flow_t
  use path_rows, only: guard_row, size_of_row
  use polynomial, only: degree, maximum_until
  implicit none
  private

  public :: begin_flight, step_flight

  !> Rounding of a guard, as a share of the sizes of its terms.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
  !> That of a guard along a step.
  real(wp), parameter :: noise_share = 4096*epsilon(1.0_wp)
  !> That of an acceleration, as a share of the sizes of its terms.
  real(wp), parameter :: force_rounding = 8*epsilon(1.0_wp)
  !> Displacements of so many depths of a contact leave that digits enough.
  real(wp), parameter :: far = 1e2_wp

  !> A flight on its way.
  type, public :: marched_flight_t
    type(marched_t) :: system
    type(march_t) :: march
    type(guard_t), allocatable :: guards(:)
    type(joint_guard_t), allocatable :: list(:)
    integer :: count_guards = 0
    !> Sizes of the guards, for their rounding; coordinates at the start [m].
    real(wp), allocatable :: size_of_guard(:), origin(:)
    !> Depth of the thinnest contact that is pressed [m], huge without one.
    real(wp) :: depth = huge(1.0_wp)
  end type marched_flight_t

contains

  !> Begins a flight from `state`; `tolerance` is relative.
  pure subroutine begin_flight(machine, flow, state, tolerance, flight)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: tolerance
    type(marched_flight_t), intent(out) :: flight
    type(path_t) :: path
    real(wp) :: y(2*machine%n), scale(2*machine%n), contact_time, duration
    integer :: g, n
    n = machine%n
    allocate (flight%list(room_for_guards(machine)))
    call guards_of(machine, flow, state, flight%list, flight%count_guards)
    allocate (flight%guards(flight%count_guards), flight%size_of_guard(flight%count_guards))
    path%start = state%time
    path%turning = turning_at(machine%frequency, state%time, harmonics_of(machine))
    call constant_forces(machine, state, path%force(:n), path%force_rate(:n))
    call begin_series(machine, flow, state, path)
    flight%origin = state%q(:n)
    call set_system(machine, flow, state, path, flight%system)
    call set_guards(machine, flow, state, path, flight)
    y(:n) = 0
    y(n + 1:) = state%v(:n)
    call set_sizes(machine, flight%system, state, y, scale, flight%depth, contact_time)
    do g = 1, flight%count_guards
      associate (guard => flight%guards(g), row => flight%system%guard(:n, g))
        ! One that is left without a speed.
        if (guard%is_left .and. abs(sum(row*state%v(:n))) <= rounding*sum(abs(row*state%v(:n)))) then
          guard%blur = tolerance*sum(abs(row)*scale(:n))
        end if
      end associate
    end do
    duration = machine%period
    ! Held bodies move as prescribed: only the force of the contact knows how fast that is.
    if (size(flow%held) > 0) duration = min(duration, 3*contact_time)
    call begin_march(flight%march, flight%system, tolerance, scale, duration, 0.0_wp, y)
  end subroutine begin_flight

  !> The guards as margins of the system; those that are zero now rise from there.
  pure subroutine set_guards(machine, flow, state, path, flight)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    type(path_t), intent(in) :: path
    type(marched_flight_t), intent(inout) :: flight
    real(wp), dimension(size(path%unknowns)) :: row, sizes
    real(wp) :: y(2*machine%n), start, rate, accelerations(machine%n)
    integer :: g, n, one, k, j
    n = machine%n
    one = 2*n + 1
    y(:n) = 0
    y(n + 1:) = state%v(:n)
    accelerations = matmul(abs(path%matrix(n + 1:2*n, :)), abs(path%unknowns)) &
                    + matmul(abs(flight%system%push), abs(forces_at(flight%system, unknowns(flight%system, 0.0_wp, y))) &
                                                      + digits_of_forces(machine, flight%system, state, path%turning))
    associate (system => flight%system)
      allocate (system%guard(size(path%unknowns), flight%count_guards), system%size_of_guard(size(path%unknowns), &
                flight%count_guards), system%lean(system%count_joints, flight%count_guards), &
                system%size_of_lean(system%count_joints, flight%count_guards), source=0.0_wp)
      allocate (system%guard_load(flight%count_guards), system%switch(flight%count_guards), source=0)
      allocate (system%level(flight%count_guards), source=0.0_wp)
      do g = 1, flight%count_guards
        associate (guard => flight%list(g))
          row = guard_row(machine, flow, path, guard)
          sizes = size_of_row(machine, flow, path, guard)
          flight%size_of_guard(g) = sum(sizes*abs(path%unknowns)) + guard%blur(0)
          row(one) = row(one) + sum(row(:n)*state%q(:n))
          system%guard(:, g) = row
          call set_load_guard(machine, state, unknowns(system, 0.0_wp, y), g, flight)
          k = 0
          do j = 1, size(machine%joints)
            if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
            k = k + 1
            if (guard%held == 0) cycle
            system%lean(k, g) = -guard%force*sum(flow%reaction(guard%held, :)*machine%joints(j)%row)
            system%size_of_lean(k, g) = abs(guard%force)*sum(abs(flow%reaction(guard%held, :)*machine%joints(j)%row))
          end do
          if (guard%held > 0) then
            system%size_of_guard(:, g) = sizes
            system%size_of_guard(one, g) = sizes(one) + sum(sizes(:n)*abs(state%q(:n)))
          end if
          start = system%margin(g, 0.0_wp, y)
          flight%guards(g)%margin = g
          flight%guards(g)%from_zero = guard%from_zero .or. abs(start) <= rounding*flight%size_of_guard(g)
          if (flight%guards(g)%from_zero) flight%guards(g)%constant = -start
          rate = sum(abs(row(:n)*state%v(:n))) + sum(abs(row(n + 1:2*n))*accelerations)
          if (guard%held > 0) rate = rate + guard%blur(1)
          if (system%guard_load(g) > 0) rate = rate + machine%frequency*flight%size_of_guard(g)
          associate (taken => flight%guards(g))
            taken%noise = noise_share*flight%size_of_guard(g)
            taken%noise_rate = noise_share*rate
            call take_as_linear(system, g, taken)
            taken%is_left = taken%from_zero .and. taken%margin == 0 .and. abs(guard%position) > 0 .and. &
              .not. abs(taken%constant) > 0
            taken%noise_bend = 0.5_wp*noise_share*sum(abs(row(:n))*accelerations)
          end associate
        end associate
      end do
    end associate
  end subroutine set_guards

  !> The part of guard `g` that is a normal force, or one of its switching functions, and its size.
  pure subroutine set_load_guard(machine, state, z, g, flight)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: z(:)
    integer, intent(in) :: g
    type(marched_flight_t), intent(inout) :: flight
    integer :: j, k
    associate (guard => flight%list(g), system => flight%system)
      if (.not. (guard%switch > 0 .or. abs(guard%level) > 0)) return
      k = count([(is_curved(machine%joints(j), state%phase(j)), j=1, guard%joint)])
      system%guard_load(g) = system%load_of(k)
      system%level(g) = guard%level
      system%switch(g) = guard%switch
      associate (load => system%loads(system%guard_load(g)))
        if (guard%switch > 0) then
          flight%size_of_guard(g) = sizes_of_switch(load, guard%switch, system%start, z)
        else
          flight%size_of_guard(g) = flight%size_of_guard(g) + guard%level*load_at(load, system%start, z)
        end if
      end associate
    end associate
  end subroutine set_load_guard

  !> A margin that depends on displacements and speeds alone is a linear guard.
  pure subroutine take_as_linear(system, g, guard)
    type(marched_t), intent(in) :: system
    integer, intent(in) :: g
    type(guard_t), intent(inout) :: guard
    associate (one => 2*system%n + 1)
      if (any(abs(system%guard(one + 1:, g)) > 0) .or. any(abs(system%lean(:, g)) > 0) .or. system%guard_load(g) > 0) return
      guard%margin = 0
      guard%constant = guard%constant + system%guard(one, g)
      guard%coefficients(:one - 1) = system%guard(:one - 1, g)
    end associate
  end subroutine take_as_linear

  !> Sizes of displacements and speeds below which errors are absolute: shares of those of the motion, digits that the
  !> coordinates do not have excepted, or those of the contacts that are pressed. `length` is the depth of the thinnest one [m],
  !> `contact_time` that in which its force changes [s], huge without one.
  pure subroutine set_sizes(machine, system, state, y, scale, length, contact_time)
    type(multibody_t), intent(in) :: machine
    type(marched_t), intent(in) :: system
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: scale(:), length, contact_time
    real(wp) :: slope(size(y)), mass, force, p, u
    integer :: k, n
    n = machine%n
    slope = system%slope(0.0_wp, y)
    length = 1e-3_wp*max(machine%length_scale, maxval(abs(y(n + 1:)))/machine%frequency, &
                         maxval(abs(slope(n + 1:)))/machine%frequency**2)
    ! Where nothing moves any size will do.
    if (.not. length > 1e9_wp*tiny(length)) length = 1
    scale(:n) = max(length, abs(state%q(:n)))
    scale(n + 1:) = length*machine%frequency
    length = huge(length)
    contact_time = huge(contact_time)
    do k = 1, system%count_joints
      if (system%joints(k)%kind /= joint_soft) cycle
      ! How deep a body of the contact's mass goes at its speed, rests under its force, or is held.
      associate (law => system%joints(k)%contact, row => system%joints(k)%row)
        mass = 1/sum(row*matmul(machine%mobility, row))
        u = abs(sum(row*y(n + 1:)))
        force = mass*abs(sum(row*slope(n + 1:)))
        p = max(depth(law, mass*u**2, 1.0_wp), depth(law, force, 0.0_wp), &
                abs(system%position(2*n + 1, k)))
        if (.not. p < length .or. .not. p > tiny(p)) cycle
        length = p
        scale(:n) = p
        scale(n + 1:) = sqrt(law%stiffness/mass*exponential((law%exponent + 1)*logarithm(p)))
        contact_time = p/max(maxval(scale(n + 1:)), tiny(p))
        scale(n + 1:) = max(u, scale(n + 1:))
      end associate
    end do
  end subroutine set_sizes

  !> p of K p^(n + more) = amount.
  pure real(wp) function depth(contact, amount, more)
    type(contact_t), intent(in) :: contact
    real(wp), intent(in) :: amount, more
    depth = 0
    if (amount > tiny(amount)*contact%stiffness) depth = exponential(logarithm(amount/contact%stiffness)/(contact%exponent + more))
  end function depth

  !> One step, until `until` [s after the section] at most. `path` is the step; `triggered` are the guards triggered together at
  !> its end; `ended`: the flight is over, `failed`: no step is small enough.
  pure subroutine step_flight(machine, flight, state, until, path, triggered, ended, failed, watch)
    type(multibody_t), intent(in) :: machine
    type(marched_flight_t), intent(inout) :: flight
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(in) :: until
    type(path_t), intent(inout) :: path
    logical, intent(out) :: triggered(:), ended, failed
    type(watch_t), intent(inout) :: watch
    real(wp) :: before(flight%count_guards), y(2*machine%n)
    integer :: triggered_guard, g, n
    n = machine%n
    if (maxval(abs(flight%march%y(:n))) > far*flight%depth) call count_anew(flight)
    call measure_noise(flight, min(flight%march%next_length, until - flight%system%start - flight%march%time))
    y = flight%march%y(:2*n)
    do g = 1, flight%count_guards
      before(g) = value_of(flight, g, flight%march%time, y)
    end do
    flight%march%slope_rounding(n + 1:2*n) = force_rounding*sizes_of_terms(flight%system, flight%origin, flight%march%time, y)
    call take_step(flight%march, flight%system, flight%guards(:flight%count_guards), until - flight%system%start, triggered_guard)
    watch%evaluations = watch%evaluations + 1
    triggered = .false.
    failed = triggered_guard == march_failed
    ended = triggered_guard /= march_goes_on
    y = flight%march%y(:2*n)
    if (triggered_guard > 0) then
      do g = 1, flight%count_guards
        if (before(g) > rounding*flight%size_of_guard(g)) triggered(g) = value_of(flight, g, flight%march%time, y) <= &
                                                                      rounding*flight%size_of_guard(g)
      end do
      triggered(triggered_guard) = .true.
    end if
    path%start = flight%system%start + flight%march%from
    path%length = 0
    if (flight%march%fraction > 0) then
      path%length = flight%march%length
      if (.not. allocated(path%step)) allocate (path%step(0:degree, 2*n))
      path%step(:, :) = flight%march%path(:, :2*n)
      path%step(0, :n) = path%step(0, :n) + flight%origin
      call look_along(machine, path, flight%march%fraction, watch)
    end if
    state%q(:n) = flight%origin + y(:n)
    state%v(:n) = y(n + 1:)
    state%time = flight%system%start + flight%march%time
    if (triggered_guard == march_time_over) state%time = until
  end subroutine step_flight

  !> Rounding of the forces of constraints, by what they are sums of now and, roughly, after the next step of `h` [s].
  pure subroutine measure_noise(flight, h)
    type(marched_flight_t), intent(inout) :: flight
    real(wp), intent(in) :: h
    real(wp), dimension(2*flight%system%n) :: y, ahead
    real(wp), dimension(flight%count_guards) :: sizes
    integer :: g
    if (.not. any(flight%list(:flight%count_guards)%held > 0)) return
    associate (system => flight%system, march => flight%march, n => flight%system%n)
      y = march%y(:2*n)
      ahead = y + h*march%slopes(:2*n, 1)
      ahead(:n) = ahead(:n) + 0.5_wp*h**2*march%slopes(n + 1:2*n, 1)
      sizes = max(sizes_of_guards(system, unknowns(system, march%time, y)), &
                  sizes_of_guards(system, unknowns(system, march%time + h, ahead)))
      do g = 1, flight%count_guards
        if (flight%list(g)%held > 0) flight%guards(g)%noise = noise_share*(flight%size_of_guard(g) + sizes(g)) &
                                                                  + tiny(1.0_wp)
      end do
    end associate
  end subroutine measure_noise

  !> Counts displacements and time from where the flight has come to: where a body leans on a contact that moves, both go far, and
  !> their difference is as thin as the contact.
  pure subroutine count_anew(flight)
    type(marched_flight_t), intent(inout) :: flight
    real(wp) :: z(2*flight%system%n + 2 + 2*flight%system%harmonics)
    integer :: k, g, c
    associate (system => flight%system, y => flight%march%y, n => flight%system%n)
      c = 2*n + 2
      z = unknowns(system, flight%march%time, y(:2*n))
      ! What the origin has no digits of stays.
      z(:n) = (flight%origin + y(:n)) - flight%origin
      flight%origin = flight%origin + z(:n)
      y(:n) = y(:n) - z(:n)
      do k = 1, system%count_joints
        system%position(c - 1, k) = position_now(system, k, z)
      end do
      do k = 1, size(system%loads)
        call move_origin(system%loads(k), n, z)
      end do
      do k = 1, n
        system%acceleration(c - 1, k) = system%acceleration(c - 1, k) + behind(system%acceleration(:, k))
      end do
      do g = 1, flight%count_guards
        system%guard(c - 1, g) = system%guard(c - 1, g) + behind(system%guard(:, g))
        system%size_of_guard(c - 1, g) = system%size_of_guard(c - 1, g) + sum(system%size_of_guard(:n, g)*abs(z(:n)))
        if (flight%guards(g)%margin == 0) flight%guards(g)%constant = flight%guards(g)%constant + behind(system%guard(:, g))
      end do
      flight%guards%is_left = .false.
      system%start = system%start + flight%march%time
      flight%march%time = 0
    end associate

  contains

    !> What displacements and time so far add to the constant of a row.
    pure real(wp) function behind(row)
      real(wp), intent(in) :: row(:)
      behind = sum(row(:flight%system%n)*z(:flight%system%n)) + row(c)*z(c)
    end function behind

  end subroutine count_anew

  !> Value of a guard.
  pure real(wp) function value_of(flight, g, time, y)
    type(marched_flight_t), intent(in) :: flight
    integer, intent(in) :: g
    real(wp), intent(in) :: time, y(:)
    value_of = flight%system%margin(g, time, y)
  end function value_of

  !> Extremes of the watched coordinate on a step up to a fraction of it.
  pure subroutine look_along(machine, path, fraction, watch)
    type(multibody_t), intent(in) :: machine
    type(path_t), intent(in) :: path
    real(wp), intent(in) :: fraction
    type(watch_t), intent(inout) :: watch
    real(wp) :: p(0:degree)
    p = path%step(:, machine%watched)
    watch%extremes(2) = maximum_until(p, fraction, watch%extremes(2))
    watch%extremes(1) = -maximum_until(-p, fraction, -watch%extremes(1))
    if (.not. watch%needs_speed) return
    watch%top_speed = maximum_until(path%step(:, machine%n + machine%watched), fraction, watch%top_speed)
  end subroutine look_along

end module marched_flight
