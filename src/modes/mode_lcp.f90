! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The convex problem that a choice of modes puts: forces of its joints within their limits, each with no acceleration along its
!> joint unless it is at a limit. Derivatives of it settle ties.
module mode_lcp
  use bounded_lcp, only: depends_on, solve_bounded_lcp
  use multibody, only: joint_contact, joint_friction, joint_spring, multibody_t, most_joints
  use multibody_state, only: factor_now, is_held, joint_force, joint_motion, multibody_state_t, running_control
  use kinds, only: wp
  implicit none
  private

  public :: add_constraint, set_mobility, drift_of, sizes, second_rate, solve, is_degenerate, restrict_bounds, keep_loaded, &
    resolve_degeneracy

  !> What the choice is made of: the joints of the problem, their rows, and the drift of the free structure along them.
  type, public :: mode_lcp_t
    ! No component has an initial value: the whole of it would be copied wherever a mode is chosen.
    integer :: count
    integer :: joint(most_joints)
    real(wp), dimension(most_joints) :: lower, upper
    !> No longer part of the problem: no force is sought.
    logical :: fixed(most_joints)
    real(wp) :: g(most_joints, most_joints)
  end type mode_lcp_t

contains

  pure subroutine add_constraint(lcp, j, lower, upper)
    type(mode_lcp_t), intent(inout) :: lcp
    integer, intent(in) :: j
    real(wp), intent(in) :: lower, upper
    lcp%count = lcp%count + 1
    lcp%joint(lcp%count) = j
    lcp%lower(lcp%count) = lower
    lcp%upper(lcp%count) = upper
    lcp%fixed(lcp%count) = .false.
  end subroutine add_constraint

  !> W' M^-1 W.
  pure subroutine set_mobility(machine, lcp)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(inout) :: lcp
    integer :: i, k
    do i = 1, lcp%count
      do k = 1, lcp%count
        lcp%g(k, i) = sum(machine%joints(lcp%joint(k))%row &
                               *matmul(machine%mobility, machine%joints(lcp%joint(i))%row))
      end do
    end do
  end subroutine set_mobility

  !> Derivative number `order` of the joint coordinates of the problem without the forces sought: that of the free structure under
  !> `force` (or its rates), and that of the surfaces.
  pure subroutine drift_of(machine, lcp, state, turning, order, force, drift)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(in) :: force(:)
    real(wp), intent(out) :: drift(:)
    real(wp) :: a(machine%n)
    integer :: i
    a = matmul(machine%mobility, force)
    drift = 0
    do i = 1, lcp%count
      drift(i) = sum(machine%joints(lcp%joint(i))%row*a) &
                 + surface(machine, lcp%joint(i), state, turning, order)
    end do
  end subroutine drift_of

  !> Derivative number `order` >= 2 of the given part of a joint coordinate.
  pure real(wp) function surface(machine, j, state, turning, order)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, order
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer :: m
    surface = 0
    associate (offset => machine%joints(j)%offset)
      if (.not. allocated(offset%harmonic)) return
      do m = 1, size(offset%harmonic)
        surface = surface + real(offset%harmonic(m)*turning(m)*cmplx(0.0_wp, m*machine%frequency, wp)**order)
      end do
    end associate
    if (state%time /= state%time) surface = 0
  end function surface

  !> Sizes of what the accelerations of the problem, or their rates (derivative number `order`), are sums of, for their rounding.
  pure function sizes(machine, lcp, state, turning, order, force) result(size_of_y)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(in) :: force(:)
    real(wp) :: size_of_y(most_joints), parts(machine%n), positions(machine%n), s, u, r, by_position, by_speed, factor(0:2), &
      energy
    integer :: i, n
    n = machine%n
    positions = abs(state%q(:n)) + abs(state%v(:n)*state%time)
    energy = energy_scale(machine, state)
    parts = abs(force) + abs(machine%load) + matmul(abs(machine%damping), abs(state%v(:n))) &
            + matmul(abs(machine%stiffness), positions)
    if (allocated(machine%controller)) then
      call running_control(machine%controller, state, s, u)
      parts = parts + (abs(state%control) + abs(s))*abs(machine%controller%row)
    end if
    do i = 1, size(turning)
      if (i <= size(machine%force, 2)) parts = parts + abs(real(machine%force(:, i)))*abs(real(turning(i))) &
                                                     + abs(aimag(machine%force(:, i)))*abs(aimag(turning(i)))
    end do
    do i = 1, size(machine%joints)
      call factor_now(machine, i, state, turning, factor)
      if (machine%joints(i)%kind == joint_friction) parts = parts &
        + abs(machine%joints(i)%row)*(factor(0)*machine%joints(i)%friction%break_away)
      ! The force of a stiff joint is the small difference of large ones.
      call joint_motion(machine, i, state%q, state%v, state%time, turning, s, u)
      call joint_force(machine%joints(i), state%phase(i), state%slider(i), state%touch_speed(i), s, u, factor(0), r, by_position, &
                       by_speed)
      associate (row => abs(machine%joints(i)%row))
        parts = parts + row*(abs(by_position)*sum(row*abs(state%q(:n))) + abs(by_speed)*sum(row*abs(state%v(:n))))
        if (machine%joints(i)%kind /= joint_spring) cycle
        if (allocated(machine%joints(i)%load)) parts = parts + row*abs(r)
        parts = parts + row*(abs(by_position)*sum(row*positions) + magnitude_of_force(energy, abs(by_position), &
                                                                          sum(row*matmul(abs(machine%mobility), row)), order))
      end associate
    end do
    do i = 1, n
      parts(i) = parts(i) + magnitude_of_force(energy, max(machine%stiffness(i, i), 0.0_wp), machine%mobility(i, i), order)
    end do
    size_of_y = 0
    do i = 1, lcp%count
      size_of_y(i) = sum(abs(machine%joints(lcp%joint(i))%row)*matmul(abs(machine%mobility), parts)) &
                     + magnitude_of(machine, lcp%joint(i), order)
    end do
  end function sizes

  !> What the modes of a motion may bring to one coordinate, whatever of them is there now [J].
  pure real(wp) function energy_scale(machine, state) result(energy)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    associate (q => abs(state%q(:machine%n)), v => abs(state%v(:machine%n)))
      energy = 0.5_wp*sum(v*matmul(abs(machine%mass), v)) + 0.5_wp*sum(q*matmul(abs(machine%stiffness), q))
    end associate
  end function energy_scale

  !> Largest force, or a rate of it (derivative number `order` - 2), of a spring [N/m] under a body with a mobility [1/kg] that has
  !> an energy [J]: what positions on their way through zero are the rounding of.
  pure real(wp) function magnitude_of_force(energy, stiffness, mobility, order) result(force)
    real(wp), intent(in) :: energy, stiffness, mobility
    integer, intent(in) :: order
    force = sqrt(2*energy*stiffness)
    if (order > 2) force = force*sqrt(stiffness*mobility)**(order - 2)
  end function magnitude_of_force

  !> Bound on derivative number `order` of the given part of a joint coordinate.
  pure real(wp) function magnitude_of(machine, j, order) result(magnitude)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, order
    integer :: m
    magnitude = 0
    associate (offset => machine%joints(j)%offset)
      if (.not. allocated(offset%harmonic)) return
      do m = 1, size(offset%harmonic)
        magnitude = magnitude + (abs(real(offset%harmonic(m))) + abs(aimag(offset%harmonic(m))))*(m*machine%frequency)**order
      end do
    end associate
  end function magnitude_of

  !> Second rates of the forces, the laws taken as linear.
  pure subroutine second_rate(machine, state, turning, a, jerk, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: a(:), jerk(:)
    real(wp), intent(out) :: rate(:)
    real(wp) :: s, u, r, by_position, by_speed, factor(0:2)
    integer :: m, j
    rate = -matmul(machine%damping, jerk) - matmul(machine%stiffness, a)
    do m = 1, size(machine%force, 2)
      rate = rate - (m*machine%frequency)**2*real(machine%force(:, m)*turning(m))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        call factor_now(machine, j, state, turning, factor, a, jerk)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(0), r, by_position, by_speed)
        if (allocated(joint%memory)) then
          rate = rate + (by_position*sum(joint%memory%deflection*jerk) + by_speed*sum(joint%memory%slide%row*jerk))*joint%row
          cycle
        end if
        rate = rate + (by_position*(sum(joint%row*a) + surface(machine, j, state, turning, 2)) &
                       + by_speed*(sum(joint%row*jerk) + surface(machine, j, state, turning, 3)))*joint%row
        if (.not. (allocated(joint%strength) .or. allocated(joint%load))) cycle
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(1), r, by_position, by_speed)
        rate = rate + 2*(by_position*u + by_speed*(sum(joint%row*a) + surface(machine, j, state, turning, 2)))*joint%row
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(2), r)
        rate = rate + r*joint%row
      end associate
    end do
  end subroutine second_rate

  pure subroutine solve(lcp, drift, tolerance, side, r, y, ok)
    type(mode_lcp_t), intent(in) :: lcp
    real(wp), intent(in) :: drift(:), tolerance
    integer, intent(inout) :: side(:)
    real(wp), intent(out) :: r(:), y(:)
    logical, intent(out) :: ok
    integer :: n
    n = lcp%count
    call solve_bounded_lcp(lcp%g(:n, :n), drift(:n), lcp%lower(:n), lcp%upper(:n), lcp%fixed(:n), tolerance, &
                     side(:n), r(:n), y(:n), ok)
  end subroutine solve

  !> Whether a force is at its limit while the joint has no acceleration.
  pure logical function is_degenerate(lcp, r, y, side, tolerance)
    type(mode_lcp_t), intent(in) :: lcp
    real(wp), intent(in) :: r(:), y(:), tolerance(:)
    integer, intent(in) :: side(:)
    integer :: i
    is_degenerate = .false.
    do i = 1, lcp%count
      if (degenerate_at(lcp, i, r, y, side, tolerance(i)) /= 0) is_degenerate = .true.
    end do
  end function is_degenerate

  !> A joint at its limit that joints which hold keep from moving is no tie: friction slides at no speed, a contact lies open at
  !> its stop, and they bear what comes.
  pure subroutine keep_loaded(lcp, y, side, tolerance)
    type(mode_lcp_t), intent(inout) :: lcp
    real(wp), intent(in) :: y(:), tolerance(:)
    integer, intent(in) :: side(:)
    integer :: i
    associate (n => lcp%count)
      do i = 1, n
        if (lcp%fixed(i) .or. side(i) == 0 .or. .not. abs(y(i)) <= tolerance(i)) cycle
        lcp%fixed(i) = depends_on(lcp%g(:n, :n), i, side(:n) == 0)
      end do
    end associate
  end subroutine keep_loaded

  !> What no derivative decides sticks, or stays closed; a contact whose force a guard has seen end (`ends`) opens.
  pure subroutine resolve_degeneracy(machine, lcp, r, y, ends, tolerance, side)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    real(wp), intent(in) :: r(:), y(:), tolerance(:)
    logical, intent(in) :: ends(:)
    integer, intent(inout) :: side(:)
    integer :: i, limit
    do i = 1, lcp%count
      limit = degenerate_at(lcp, i, r, y, side, tolerance(i))
      if (limit == 0) cycle
      side(i) = merge(limit, 0, ends(lcp%joint(i)) .and. machine%joints(lcp%joint(i))%kind == joint_contact)
    end do
  end subroutine resolve_degeneracy

  !> The limit at which joint number `i` of the problem is degenerate, 0 if it is not.
  pure integer function degenerate_at(lcp, i, r, y, side, tolerance) result(limit)
    type(mode_lcp_t), intent(in) :: lcp
    integer, intent(in) :: i, side(:)
    real(wp), intent(in) :: r(:), y(:), tolerance
    real(wp) :: mobility
    limit = 0
    if (lcp%fixed(i)) return
    mobility = lcp%g(i, i)
    if (side(i) == 0) then
      if (abs(lcp%upper(i)) < huge(1.0_wp)) then
        if ((lcp%upper(i) - r(i))*mobility <= tolerance) limit = 1
      end if
      if (abs(lcp%lower(i)) < huge(1.0_wp)) then
        ! The rounding of a stiff joint can be more than lies between the limits.
        if ((r(i) - lcp%lower(i))*mobility <= tolerance .and. &
            (limit == 0 .or. r(i) - lcp%lower(i) < lcp%upper(i) - r(i))) limit = -1
      end if
    else if (abs(y(i)) <= tolerance) then
      limit = side(i)
    end if
  end function degenerate_at

  !> Limits of the rates of the forces: none for what holds, nothing for what slides or is open, one for what is degenerate, at the
  !> `rate` of the limit.
  pure subroutine restrict_bounds(lcp, r, y, side, tolerance, rate)
    type(mode_lcp_t), intent(inout) :: lcp
    real(wp), intent(in) :: r(:), y(:), tolerance(:), rate(:)
    integer, intent(in) :: side(:)
    integer :: i, limit
    do i = 1, lcp%count
      limit = degenerate_at(lcp, i, r, y, side, tolerance(i))
      if (limit /= 0 .and. .not. lcp%upper(i) > lcp%lower(i)) then
        ! No load: friction is at both limits.
        lcp%lower(i) = 0 - rate(i)
        lcp%upper(i) = rate(i)
      else if (limit > 0) then
        lcp%lower(i) = -huge(1.0_wp)
        lcp%upper(i) = rate(i)
      else if (limit < 0) then
        lcp%lower(i) = 0 - rate(i)
        lcp%upper(i) = huge(1.0_wp)
      else if (side(i) == 0) then
        lcp%lower(i) = -huge(1.0_wp)
        lcp%upper(i) = huge(1.0_wp)
      else
        lcp%fixed(i) = .true.
      end if
    end do
  end subroutine restrict_bounds

end module mode_lcp
