! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of a mode in which the force of a joint is not linear, by high-order steps. What is linear of the mode are
!> the rows of its exponential series; the unknowns are the displacements since the start and the speeds, so that a brief
!> contact loses no digits to the size of the coordinates.
module marched_flight
  use contact_law, only: contact_t
  use flight_path, only: begin_series, constant_forces, guard_row, path_t
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, march_time_over, take_step, &
    watched_system_t
  use guards, only: guards_of, joint_guard_t, most_guards
  use jointed, only: joint_soft, joint_t, jointed_t, most_joints
  use jointed_state, only: is_curved, joint_force, joint_motion, jointed_state_t, strength_now, turning_at
  use elementary, only: exponential, logarithm, sine_cosine
  use kinds, only: wp
  use linear_flight, only: watch_t
  use mode_flow, only: harmonics_of, mode_flow_t
  use polynomial, only: degree, maximum_until
  implicit none
  private

  public :: begin_flight, step_flight

  !> Rounding of a guard, as a share of the sizes of its terms.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
  !> Displacements of so many depths of a contact leave that digits enough.
  real(wp), parameter :: far = 1e2_wp

  !> Displacements and speeds, 1, the time since the start, cosines and sines of the drive are what rows refer to.
  type, extends(watched_system_t) :: marched_t
    integer :: n = 0, harmonics = 0, count_joints = 0, count_guards = 0
    real(wp) :: frequency = 0, start = 0
    !> Accelerations, one column each; guards.
    real(wp), allocatable :: acceleration(:, :), guard(:, :)
    !> Joints whose force is not linear: their coordinates (of a contact those beyond its stop) and speeds, what their forces are
    !> multiplied by, what these do to accelerations and guards.
    type(joint_t), allocatable :: joints(:)
    integer :: phase(most_joints) = 0
    real(wp) :: touch_speed(most_joints) = 0
    real(wp), allocatable :: place(:, :), speed(:, :), strength(:, :), push(:, :), lean(:, :)
  contains
    procedure :: slope => marched_slope
    procedure :: margin => marched_margin
  end type marched_t

  !> A flight on its way.
  type, public :: marched_flight_t
    type(marched_t) :: system
    type(march_t) :: march
    type(guard_t) :: guards(most_guards)
    type(joint_guard_t) :: list(most_guards)
    integer :: count_guards = 0
    !> Sizes of the guards, for their rounding; coordinates at the start [m].
    real(wp) :: size_of_guard(most_guards) = 0
    real(wp), allocatable :: origin(:)
    !> Depth of the thinnest contact that is pressed [m], huge without one.
    real(wp) :: depth = huge(1.0_wp)
  end type marched_flight_t

contains

  !> Begins a flight from `state`; `tolerance` is relative.
  pure subroutine begin_flight(machine, flow, state, tolerance, flight)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(jointed_state_t), intent(in) :: state
    real(wp), intent(in) :: tolerance
    type(marched_flight_t), intent(out) :: flight
    type(path_t) :: path
    real(wp) :: y(2*machine%n), scale(2*machine%n), contact_time, duration
    integer :: n
    n = machine%n
    call guards_of(machine, flow, state, flight%list, flight%count_guards)
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
    duration = machine%period
    ! Held bodies move as they are told: only the force of the contact knows how fast that is.
    if (size(flow%held) > 0) duration = min(duration, 3*contact_time)
    call begin_march(flight%march, flight%system, tolerance, scale, duration, 0.0_wp, y)
  end subroutine begin_flight

  !> What is integrated.
  pure subroutine set_system(machine, flow, state, path, system)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(jointed_state_t), intent(in) :: state
    type(path_t), intent(in) :: path
    type(marched_t), intent(inout) :: system
    real(wp) :: s, u
    real(wp) :: stop
    integer :: n, one, j, k
    n = machine%n
    one = 2*n + 1
    system%n = n
    system%harmonics = size(path%turning)
    system%frequency = machine%frequency
    system%start = state%time
    system%acceleration = transpose(path%matrix(n + 1:2*n, :))
    system%acceleration(one, :) = system%acceleration(one, :) + matmul(path%matrix(n + 1:2*n, :n), state%q(:n))
    system%count_joints = count([(is_curved(machine%joints(j), state%phase(j)), j=1, size(machine%joints))])
    allocate (system%joints(system%count_joints), system%push(n, system%count_joints))
    allocate (system%place(size(path%unknowns), system%count_joints), system%speed(size(path%unknowns), system%count_joints))
    allocate (system%strength(size(path%unknowns), system%count_joints), source=0.0_wp)
    k = 0
    do j = 1, size(machine%joints)
      if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
      k = k + 1
      system%joints(k) = machine%joints(j)
      stop = 0
      if (machine%joints(j)%kind == joint_soft) stop = stop_of(machine%joints(j), state%phase(j))
      system%joints(k)%upper = machine%joints(j)%upper - stop
      system%joints(k)%lower = machine%joints(j)%lower - stop
      system%phase(k) = state%phase(j)
      system%touch_speed(k) = state%touch_speed(j)
      system%push(:, k) = held_push(machine, flow, machine%joints(j)%row)
      call set_strength(machine%joints(j), one, system%strength(:, k))
      system%place(:, k) = flow%place_row(:, j)
      system%speed(:, k) = flow%speed_row(:, j)
      system%place(one + 1, k) = machine%joints(j)%offset%rate
      system%speed(one, k) = machine%joints(j)%offset%rate
      call joint_motion(machine, j, state%q, state%v, state%time, path%turning, s, u)
      ! A contact that begins is at its stop to the last digit.
      if (machine%joints(j)%kind == joint_soft .and. state%left(j) /= 0 .and. abs(s - stop) &
          <= 64*epsilon(1.0_wp)*(abs(s) + sum(abs(machine%joints(j)%row*state%q(:n))))) s = stop
      system%place(one, k) = s - stop
    end do
  end subroutine set_system

  !> What the force of a spring is multiplied by, as a row; the unknown number `one` is 1.
  pure subroutine set_strength(joint, one, row)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: one
    real(wp), intent(inout) :: row(:)
    integer :: m
    row(one) = 1
    if (.not. allocated(joint%strength)) return
    row(one) = joint%strength%mean
    do m = 1, size(joint%strength%harmonic)
      row(one + 2*m) = real(joint%strength%harmonic(m))
      row(one + 2*m + 1) = -aimag(joint%strength%harmonic(m))
    end do
  end subroutine set_strength

  !> Stop of a contact [m].
  pure real(wp) function stop_of(joint, phase)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    stop_of = merge(joint%upper, joint%lower, phase > 0)
  end function stop_of

  !> Accelerations under a force of 1 N along `row`, with the constraints held.
  pure function held_push(machine, flow, row) result(push)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    real(wp), intent(in) :: row(:)
    real(wp) :: push(machine%n), free(machine%n)
    integer :: i
    free = matmul(machine%mobility, row)
    push = free
    do i = 1, size(flow%independent)
      push = push - flow%carried(:, i)*sum(machine%joints(flow%held(flow%independent(i)))%row*free)
    end do
  end function held_push

  !> The guards as margins of the system; those that are zero now rise from there.
  pure subroutine set_guards(machine, flow, state, path, flight)
    type(jointed_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(jointed_state_t), intent(in) :: state
    type(path_t), intent(in) :: path
    type(marched_flight_t), intent(inout) :: flight
    real(wp) :: row(size(path%unknowns)), y(2*machine%n), start, rate, accelerations(machine%n)
    integer :: g, n, one, k, j
    n = machine%n
    one = 2*n + 1
    y(:n) = 0
    y(n + 1:) = state%v(:n)
    accelerations = matmul(abs(path%matrix(n + 1:2*n, :)), abs(path%unknowns)) &
                    + matmul(abs(flight%system%push), abs(forces_at(flight%system, unknowns(flight%system, 0.0_wp, y))) &
                                                      + digits_of_forces(machine, flight%system, state, path%turning))
    associate (system => flight%system)
      allocate (system%guard(size(path%unknowns), flight%count_guards), &
                system%lean(system%count_joints, flight%count_guards), source=0.0_wp)
      do g = 1, flight%count_guards
        associate (guard => flight%list(g))
          row = guard_row(machine, flow, path, guard)
          flight%size_of_guard(g) = sum(abs(row*path%unknowns)) + guard%blur(0)
          row(one) = row(one) + sum(row(:n)*state%q(:n))
          system%guard(:, g) = row
          k = 0
          do j = 1, size(machine%joints)
            if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
            k = k + 1
            if (guard%held > 0) system%lean(k, g) = -guard%force*sum(flow%reaction(guard%held, :)*machine%joints(j)%row)
          end do
          start = system%margin(g, 0.0_wp, y)
          flight%guards(g)%margin = g
          flight%guards(g)%from_zero = guard%from_zero .or. abs(start) <= rounding*flight%size_of_guard(g)
          if (flight%guards(g)%from_zero) flight%guards(g)%constant = -start
          flight%guards(g)%noise = 4096*epsilon(1.0_wp)*flight%size_of_guard(g)
          rate = sum(abs(row(:n)*state%v(:n))) + sum(abs(row(n + 1:2*n))*accelerations)
          if (guard%held > 0) rate = rate + guard%blur(1)
          flight%guards(g)%noise_rate = 4096*epsilon(1.0_wp)*rate
          call take_as_linear(system, g, flight%guards(g))
        end associate
      end do
    end associate
  end subroutine set_guards

  !> Sizes of what the forces of the joints that are not linear are small differences of [N]: stiff ones, far from the origin.
  pure function digits_of_forces(machine, system, state, turning) result(sizes)
    type(jointed_t), intent(in) :: machine
    type(marched_t), intent(in) :: system
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: sizes(system%count_joints), s, u, strength, r, by_place, by_speed
    integer :: j, k
    k = 0
    do j = 1, size(machine%joints)
      if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
      k = k + 1
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      call strength_now(machine%joints(j), machine%frequency, turning, strength)
      call joint_force(machine%joints(j), state%phase(j), state%slider(j), state%touch_speed(j), s, u, strength, r, by_place, &
                       by_speed)
      sizes(k) = abs(by_place)*(abs(s) + sum(abs(machine%joints(j)%row*state%q(:machine%n))))
    end do
  end function digits_of_forces

  !> A margin that depends on displacements and speeds alone is a linear guard.
  pure subroutine take_as_linear(system, g, guard)
    type(marched_t), intent(in) :: system
    integer, intent(in) :: g
    type(guard_t), intent(inout) :: guard
    associate (one => 2*system%n + 1)
      if (any(abs(system%guard(one + 1:, g)) > 0) .or. any(abs(system%lean(:, g)) > 0)) return
      guard%margin = 0
      guard%constant = guard%constant + system%guard(one, g)
      guard%coefficients(:one - 1) = system%guard(:one - 1, g)
    end associate
  end subroutine take_as_linear

  !> Sizes of displacements and speeds below which errors are absolute: shares of those of the motion, digits that the
  !> coordinates do not have excepted, or those of the contacts that are pressed. `length` is the depth of the thinnest one [m],
  !> `contact_time` that in which its force changes [s], huge without one.
  pure subroutine set_sizes(machine, system, state, y, scale, length, contact_time)
    type(jointed_t), intent(in) :: machine
    type(marched_t), intent(in) :: system
    type(jointed_state_t), intent(in) :: state
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
                abs(system%place(2*n + 1, k)))
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

  !> What rows refer to.
  pure function unknowns(self, time, y) result(z)
    class(marched_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: z(2*self%n + 2 + 2*self%harmonics)
    integer :: m, c
    c = 2*self%n + 2
    z(:c - 2) = y
    z(c - 1) = 1
    z(c) = time
    do m = 1, self%harmonics
      call sine_cosine(m*self%frequency*(self%start + time), z(c + 2*m), z(c + 2*m - 1))
    end do
  end function unknowns

  !> Forces of the joints that are not linear [N].
  pure function forces_at(self, z) result(force)
    class(marched_t), intent(in) :: self
    real(wp), intent(in) :: z(:)
    real(wp) :: force(self%count_joints)
    integer :: k
    do k = 1, self%count_joints
      call joint_force(self%joints(k), self%phase(k), 0.0_wp, self%touch_speed(k), place_now(self, k, z), &
                       sum(self%speed(:, k)*z), sum(self%strength(:, k)*z), force(k))
    end do
  end function forces_at

  !> Coordinate of joint number `k` of the system [m]. The part that is given changes by sum of amplitude (exp(i m Omega t) - 1),
  !> with exp(i x) - 1 = 2 i sin(x/2) exp(i x/2): a stiff contact is so thin that differences of positions have no digits of it.
  pure real(wp) function place_now(self, k, z) result(s)
    class(marched_t), intent(in) :: self
    integer, intent(in) :: k
    real(wp), intent(in) :: z(:)
    real(wp) :: sine, cosine, half, unused
    integer :: c, m
    c = 2*self%n + 2
    s = sum(self%place(:c, k)*z(:c))
    do m = 1, self%harmonics
      associate (a => self%place(c + 2*m - 1, k), b => self%place(c + 2*m, k))
        if (.not. (abs(a) > 0 .or. abs(b) > 0)) cycle
        call sine_cosine(m*self%frequency*z(c)/2, half, unused)
        call sine_cosine(m*self%frequency*(self%start + z(c)/2), sine, cosine)
        s = s + 2*half*(b*cosine - a*sine)
      end associate
    end do
  end function place_now

  !> Speeds and accelerations.
  pure function marched_slope(self, time, y) result(slope)
    class(marched_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y)), z(2*self%n + 2 + 2*self%harmonics), force(self%count_joints)
    integer :: i
    z = unknowns(self, time, y)
    force = forces_at(self, z)
    slope(:self%n) = y(self%n + 1:)
    do i = 1, self%n
      slope(self%n + i) = sum(self%acceleration(:, i)*z)
    end do
    do i = 1, self%count_joints
      slope(self%n + 1:) = slope(self%n + 1:) + self%push(:, i)*force(i)
    end do
  end function marched_slope

  !> Guard `number`.
  pure real(wp) function marched_margin(self, number, time, y) result(margin)
    class(marched_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    real(wp) :: z(2*self%n + 2 + 2*self%harmonics)
    z = unknowns(self, time, y)
    margin = sum(self%guard(:, number)*z)
    if (any(abs(self%lean(:, number)) > 0)) margin = margin + sum(self%lean(:, number)*forces_at(self, z))
  end function marched_margin

  !> One step, until `until` [s after the section] at most. `path` is the step; `fallen` are the guards that fell together at its
  !> end; `ended` says that the flight is over, `failed` that no step is small enough.
  pure subroutine step_flight(machine, flight, state, until, path, fallen, ended, failed, watch)
    type(jointed_t), intent(in) :: machine
    type(marched_flight_t), intent(inout) :: flight
    type(jointed_state_t), intent(inout) :: state
    real(wp), intent(in) :: until
    type(path_t), intent(inout) :: path
    logical, intent(out) :: fallen(most_guards), ended, failed
    type(watch_t), intent(inout) :: watch
    real(wp) :: before(most_guards), y(2*machine%n)
    integer :: fell, g, n
    n = machine%n
    if (maxval(abs(flight%march%y(:n))) > far*flight%depth) call count_anew(flight)
    y = flight%march%y(:2*n)
    do g = 1, flight%count_guards
      before(g) = value_of(flight, g, flight%march%time, y)
    end do
    call take_step(flight%march, flight%system, flight%guards(:flight%count_guards), until - flight%system%start, fell)
    watch%evaluations = watch%evaluations + 1
    fallen = .false.
    failed = fell == march_failed
    ended = fell /= march_goes_on
    y = flight%march%y(:2*n)
    if (fell > 0) then
      do g = 1, flight%count_guards
        if (before(g) > rounding*flight%size_of_guard(g)) fallen(g) = value_of(flight, g, flight%march%time, y) <= &
                                                                      rounding*flight%size_of_guard(g)
      end do
      fallen(fell) = .true.
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
    if (fell == march_time_over) state%time = until
  end subroutine step_flight

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
        system%place(c - 1, k) = place_now(system, k, z)
      end do
      do k = 1, n
        system%acceleration(c - 1, k) = system%acceleration(c - 1, k) + behind(system%acceleration(:, k))
      end do
      do g = 1, flight%count_guards
        system%guard(c - 1, g) = system%guard(c - 1, g) + behind(system%guard(:, g))
        if (flight%guards(g)%margin == 0) flight%guards(g)%constant = flight%guards(g)%constant + behind(system%guard(:, g))
      end do
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
    type(jointed_t), intent(in) :: machine
    type(path_t), intent(in) :: path
    real(wp), intent(in) :: fraction
    type(watch_t), intent(inout) :: watch
    real(wp) :: p(0:degree)
    p = path%step(:, machine%watched)
    watch%extremes(2) = max(watch%extremes(2), maximum_until(p, fraction))
    watch%extremes(1) = min(watch%extremes(1), -maximum_until(-p, fraction))
    if (.not. watch%wants_speed) return
    watch%top_speed = max(watch%top_speed, maximum_until(path%step(:, machine%n + machine%watched), fraction))
  end subroutine look_along

end module marched_flight
