! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The equations of a mode in which the force of a joint is not linear. What is linear of the mode are the rows of its exponential
!> series; the unknowns are the displacements since the start and the speeds, so that a brief contact loses no digits to the size of
!> the coordinates.
module marched_system
  use elementary, only: sine_cosine
  use flight_path, only: path_t
  use guarded_march, only: watched_system_t
  use friction_law, only: sliding_friction
  use multibody, only: joint_friction, joint_soft, joint_spring, joint_t, memory_t, multibody_t, most_joints
  use marched_load, only: choose_branches, load_at, marched_load_t, set_load, set_rows, switch_at
  use multibody_state, only: factor_now, is_curved, joint_force, joint_motion, multibody_state_t, spring_terms
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  implicit none
  private

  public :: marched_t, set_system, unknowns, forces_at, position_now, digits_of_forces, sizes_of_guards, sizes_of_terms

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
    real(wp), allocatable :: position(:, :), speed(:, :), strength(:, :), push(:, :), lean(:, :)
    !> Sliding friction under a constant normal force: its speed is all that is looked at.
    logical :: is_plain(most_joints) = .false.
    !> Normal forces of friction, and which of them a joint has, 0 for none.
    type(marched_load_t), allocatable :: loads(:)
    integer :: load_of(most_joints) = 0
    !> Of a guard: which normal force is part of it, by what it is multiplied, which of its switching functions the guard is.
    integer, allocatable :: guard_load(:), switch(:)
    real(wp), allocatable :: level(:)
    !> Sizes of what the forces of constraints are sums of, as `guard` and `lean`; 0 for other guards.
    real(wp), allocatable :: size_of_guard(:, :), size_of_lean(:, :)
  contains
    procedure :: slope => marched_slope
    procedure :: margin => marched_margin
  end type marched_t

contains

  !> What is integrated.
  pure subroutine set_system(machine, flow, state, path, system)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
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
    allocate (system%position(size(path%unknowns), system%count_joints), system%speed(size(path%unknowns), system%count_joints))
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
      system%is_plain(k) = machine%joints(j)%kind == joint_friction .and. .not. allocated(machine%joints(j)%load) .and. &
        .not. allocated(machine%joints(j)%strength)
      system%position(:, k) = flow%position_row(:, j)
      system%speed(:, k) = flow%speed_row(:, j)
      system%position(one + 1, k) = machine%joints(j)%offset%rate
      system%speed(one, k) = machine%joints(j)%offset%rate
      call joint_motion(machine, j, state%q, state%v, state%time, path%turning, s, u)
      ! A contact that begins is at its stop to the last digit.
      if (machine%joints(j)%kind == joint_soft .and. state%left(j) /= 0 .and. abs(s - stop) &
          <= 64*epsilon(1.0_wp)*(abs(s) + sum(abs(machine%joints(j)%row*state%q(:n))))) s = stop
      system%position(one, k) = s - stop
      if (allocated(machine%joints(j)%memory)) call set_memory(machine, state, machine%joints(j)%memory, system%position(:, k), &
                                                               system%speed(:, k))
    end do
    call set_loads(machine, state, path, system)
  end subroutine set_system

  !> The rows of the deflection and the sliding speed of friction with memory, instead of a coordinate and its speed.
  pure subroutine set_memory(machine, state, memory, position, speed)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    type(memory_t), intent(in) :: memory
    real(wp), intent(inout) :: position(:), speed(:)
    real(wp) :: unused(size(position))
    unused = 0
    speed = 0
    call set_rows(machine, state, memory%slide%row, memory%slide%offset, unused, speed)
    position = 0
    position(machine%n + 1:2*machine%n) = memory%deflection
  end subroutine set_memory

  !> Normal forces of friction; their branches follow from the motion that begins.
  pure subroutine set_loads(machine, state, path, system)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    type(path_t), intent(in) :: path
    type(marched_t), intent(inout) :: system
    real(wp) :: y(2*machine%n), slope(2*machine%n)
    integer :: j, k, loads, round
    allocate (system%loads(count([(allocated(machine%joints(j)%load), j=1, size(machine%joints))])))
    if (size(system%loads) == 0) return
    k = 0
    loads = 0
    do j = 1, size(machine%joints)
      if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
      k = k + 1
      if (.not. allocated(machine%joints(j)%load)) cycle
      loads = loads + 1
      system%load_of(k) = loads
      call set_load(machine, j, state, size(path%unknowns), system%loads(loads))
    end do
    slope = 0
    y(:machine%n) = 0
    y(machine%n + 1:) = state%v(:machine%n)
    ! The accelerations need branches themselves: those of the values first.
    do round = 1, 2
      do k = 1, loads
        call choose_branches(machine, system%loads(k), state, path%turning, slope(machine%n + 1:))
      end do
      slope = system%slope(0.0_wp, y)
    end do
  end subroutine set_loads

  !> What the force of joint number `k` of the system is multiplied by.
  pure real(wp) function factor_at(self, k, z) result(factor)
    class(marched_t), intent(in) :: self
    integer, intent(in) :: k
    real(wp), intent(in) :: z(:)
    if (self%load_of(k) > 0) then
      factor = load_at(self%loads(self%load_of(k)), self%start + z(2*self%n + 2), z)
    else
      factor = sum(self%strength(:, k)*z)
    end if
  end function factor_at

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
    type(multibody_t), intent(in) :: machine
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
      if (self%is_plain(k)) then
        force(k) = sliding_friction(self%joints(k)%friction, product_of(size(z), self%speed(:, k), z), real(self%phase(k), wp))
      else
        call joint_force(self%joints(k), self%phase(k), 0.0_wp, self%touch_speed(k), position_now(self, k, z), &
                         sum(self%speed(:, k)*z), factor_at(self, k, z), force(k))
      end if
    end do
  end function forces_at

  !> A row times what it refers to; arrays of known size, which sections are not.
  pure real(wp) function product_of(n, row, z)
    integer, intent(in) :: n
    real(wp), intent(in) :: row(n), z(n)
    product_of = sum(row*z)
  end function product_of

  !> Coordinate of joint number `k` of the system [m]. The part that is given changes by sum of amplitude (exp(i m Omega t) - 1),
  !> with exp(i x) - 1 = 2 i sin(x/2) exp(i x/2): a stiff contact is so thin that differences of positions have no digits of it.
  pure real(wp) function position_now(self, k, z) result(s)
    class(marched_t), intent(in) :: self
    integer, intent(in) :: k
    real(wp), intent(in) :: z(:)
    real(wp) :: sine, cosine, half, unused
    integer :: c, m
    c = 2*self%n + 2
    s = sum(self%position(:c, k)*z(:c))
    do m = 1, self%harmonics
      associate (a => self%position(c + 2*m - 1, k), b => self%position(c + 2*m, k))
        if (.not. (abs(a) > 0 .or. abs(b) > 0)) cycle
        call sine_cosine(m*self%frequency*z(c)/2, half, unused)
        call sine_cosine(m*self%frequency*(self%start + z(c)/2), sine, cosine)
        s = s + 2*half*(b*cosine - a*sine)
      end associate
    end do
  end function position_now

  !> Speeds and accelerations.
  pure function marched_slope(self, time, y) result(slope)
    class(marched_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y)), z(2*self%n + 2 + 2*self%harmonics), force(self%count_joints)
    z = unknowns(self, time, y)
    force = forces_at(self, z)
    slope(:self%n) = z(self%n + 1:2*self%n)
    call accelerate(self%n, size(z), self%count_joints, self%acceleration, z, self%push, force, slope(self%n + 1:))
  end function marched_slope

  !> What is linear of the accelerations, and the other forces.
  pure subroutine accelerate(n, terms, joints, rows, z, push, force, acceleration)
    integer, intent(in) :: n, terms, joints
    real(wp), intent(in) :: rows(terms, n), z(terms), push(n, joints), force(joints)
    real(wp), intent(out) :: acceleration(n)
    integer :: i, k
    do i = 1, n
      acceleration(i) = sum(rows(:, i)*z)
    end do
    do k = 1, joints
      acceleration = acceleration + push(:, k)*force(k)
    end do
  end subroutine accelerate

  !> Accelerations with each term replaced by its size, those of a nonlinear force and what its slopes make of the sizes of its
  !> coordinate and speed: near an equilibrium the terms cancel, and their rounding is left. `origin` are the coordinates at the
  !> start [m].
  pure function sizes_of_terms(self, origin, time, y) result(sizes)
    class(marched_t), intent(in) :: self
    real(wp), intent(in) :: origin(:), time, y(:)
    real(wp) :: sizes(self%n), z(2*self%n + 2 + 2*self%harmonics), term, force, by_position, by_speed, strength, s
    integer :: i, k
    z = unknowns(self, time, y)
    do i = 1, self%n
      sizes(i) = sum(abs(self%acceleration(:, i)*z))
    end do
    do k = 1, self%count_joints
      s = position_now(self, k, z)
      strength = factor_at(self, k, z)
      call joint_force(self%joints(k), self%phase(k), 0.0_wp, self%touch_speed(k), s, sum(self%speed(:, k)*z), strength, force, &
                       by_position, by_speed)
      term = abs(force)
      if (self%joints(k)%kind == joint_spring) term = spring_terms(self%joints(k), s, strength)
      if (allocated(self%joints(k)%memory)) then
        sizes = sizes + abs(self%push(:, k))*(term + abs(by_position*s) + abs(by_speed)*sum(abs(self%speed(:, k)*z)))
        cycle
      end if
      term = term + abs(by_position)*(abs(s) + sum(abs(self%joints(k)%row)*(abs(origin) + abs(y(:self%n))))) &
             + abs(by_speed)*sum(abs(self%speed(:, k)*z))
      sizes = sizes + abs(self%push(:, k))*term
    end do
  end function sizes_of_terms

  !> Guard `number`.
  pure real(wp) function marched_margin(self, number, time, y) result(margin)
    class(marched_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    real(wp) :: z(2*self%n + 2 + 2*self%harmonics)
    z = unknowns(self, time, y)
    if (self%switch(number) > 0) then
      margin = switch_at(self%loads(self%guard_load(number)), self%switch(number), self%start + time, z)
      return
    end if
    margin = sum(self%guard(:, number)*z)
    if (self%guard_load(number) > 0) margin = margin + self%level(number)*load_at(self%loads(self%guard_load(number)), &
                                                                                  self%start + time, z)
    if (any(abs(self%lean(:, number)) > 0)) margin = margin + sum(self%lean(:, number)*forces_at(self, z))
  end function marched_margin

  !> Sizes of what the guards that are forces of constraints are sums of, with what rows refer to at `z`; 0 for the others.
  pure function sizes_of_guards(system, z) result(sizes)
    type(marched_t), intent(in) :: system
    real(wp), intent(in) :: z(:)
    real(wp) :: sizes(size(system%guard, 2))
    sizes = matmul(abs(z), system%size_of_guard) + matmul(abs(forces_at(system, z)), system%size_of_lean)
  end function sizes_of_guards

  !> Forces [N], one for each joint that is not linear, of which rounding takes a share: a displacement is known to a share of the
  !> positions it is the difference of, and the force to that times its slope.
  pure function digits_of_forces(machine, system, state, turning) result(sizes)
    type(multibody_t), intent(in) :: machine
    type(marched_t), intent(in) :: system
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: sizes(system%count_joints), s, u, factor(0:2), r, by_position, by_speed
    integer :: j, k
    k = 0
    do j = 1, size(machine%joints)
      if (.not. is_curved(machine%joints(j), state%phase(j))) cycle
      k = k + 1
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      call factor_now(machine, j, state, turning, factor)
      call joint_force(machine%joints(j), state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(0), r, by_position, &
                       by_speed)
      sizes(k) = abs(by_position*s)
      if (.not. allocated(machine%joints(j)%memory)) sizes(k) = abs(by_position)*(abs(s) + sum(abs(machine%joints(j)%row &
                                                                                               *state%q(:machine%n))))
    end do
  end function digits_of_forces

end module marched_system
