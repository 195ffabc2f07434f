! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The convex problem that a choice of modes puts: forces of the joints in question within their limits, each with no
!> acceleration along its joint unless it is at a limit. Derivatives of it settle ties.
module mode_question
  use boxed_forces, only: depends_on, solve_boxed
  use multibody, only: joint_contact, joint_friction, joint_spring, multibody_t, most_joints
  use multibody_state, only: is_held, joint_force, joint_motion, multibody_state_t, running_control, spring_force, strength_now
  use kinds, only: wp
  implicit none
  private

  public :: ask, set_mobility, drift_of, sizes, second_rate, solve, is_tied, narrow, keep_loaded, settle_ties

  !> What the choice is made of: the joints in question, their rows, and the drift of the free structure along them.
  type, public :: question_t
    integer :: count = 0
    integer :: joint(most_joints) = 0
    real(wp), dimension(most_joints) :: lower = 0, upper = 0
    !> Not in question any more: no force is sought.
    logical :: fixed(most_joints) = .false.
    real(wp) :: g(most_joints, most_joints) = 0
    real(wp) :: tolerance = 0
  end type question_t

contains

  pure subroutine ask(question, j, lower, upper)
    type(question_t), intent(inout) :: question
    integer, intent(in) :: j
    real(wp), intent(in) :: lower, upper
    question%count = question%count + 1
    question%joint(question%count) = j
    question%lower(question%count) = lower
    question%upper(question%count) = upper
  end subroutine ask

  !> W' M^-1 W.
  pure subroutine set_mobility(machine, question)
    type(multibody_t), intent(in) :: machine
    type(question_t), intent(inout) :: question
    integer :: i, k
    do i = 1, question%count
      do k = 1, question%count
        question%g(k, i) = sum(machine%joints(question%joint(k))%row &
                               *matmul(machine%mobility, machine%joints(question%joint(i))%row))
      end do
    end do
  end subroutine set_mobility

  !> Derivative number `order` of the joint coordinates in question without the forces sought: that of the free structure
  !> under `force` (or its rates), and that of the surfaces.
  pure subroutine drift_of(machine, question, state, turning, order, force, drift)
    type(multibody_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(in) :: force(:)
    real(wp), intent(out) :: drift(:)
    real(wp) :: a(machine%n)
    integer :: i
    a = matmul(machine%mobility, force)
    drift = 0
    do i = 1, question%count
      drift(i) = sum(machine%joints(question%joint(i))%row*a) &
                 + surface(machine, question%joint(i), state, turning, order)
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

  !> Sizes of what the accelerations in question, or their rates (derivative number `order`), are sums of, for their rounding.
  pure function sizes(machine, question, state, turning, order, force) result(size_of_y)
    type(multibody_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(in) :: force(:)
    real(wp) :: size_of_y(most_joints), parts(machine%n), places(machine%n), s, u, r, by_place, by_speed, strength, energy
    integer :: i, n
    n = machine%n
    places = abs(state%q(:n)) + abs(state%v(:n)*state%time)
    energy = energy_of_swing(machine, state)
    parts = abs(force) + abs(machine%load) + matmul(abs(machine%damping), abs(state%v(:n))) &
            + matmul(abs(machine%stiffness), places)
    if (allocated(machine%controller)) then
      call running_control(machine%controller, state, s, u)
      parts = parts + (abs(state%control) + abs(s))*abs(machine%controller%row)
    end if
    do i = 1, size(turning)
      if (i <= size(machine%force, 2)) parts = parts + abs(real(machine%force(:, i)))*abs(real(turning(i))) &
                                                     + abs(aimag(machine%force(:, i)))*abs(aimag(turning(i)))
    end do
    do i = 1, size(machine%joints)
      if (machine%joints(i)%kind == joint_friction) parts = parts &
        + abs(machine%joints(i)%row)*machine%joints(i)%friction%break_away
      ! The force of a stiff joint is the small difference of large ones.
      call joint_motion(machine, i, state%q, state%v, state%time, turning, s, u)
      call strength_now(machine%joints(i), machine%frequency, turning, strength)
      call joint_force(machine%joints(i), state%phase(i), state%slider(i), state%touch_speed(i), s, u, strength, r, by_place, &
                       by_speed)
      associate (row => abs(machine%joints(i)%row))
        parts = parts + row*(abs(by_place)*sum(row*abs(state%q(:n))) + abs(by_speed)*sum(row*abs(state%v(:n))))
        if (machine%joints(i)%kind /= joint_spring) cycle
        parts = parts + row*(abs(by_place)*sum(row*places) + swing_of_force(energy, abs(by_place), &
                                                                          sum(row*matmul(abs(machine%mobility), row)), order))
      end associate
    end do
    do i = 1, n
      parts(i) = parts(i) + swing_of_force(energy, max(machine%stiffness(i, i), 0.0_wp), machine%mobility(i, i), order)
    end do
    size_of_y = 0
    do i = 1, question%count
      size_of_y(i) = sum(abs(machine%joints(question%joint(i))%row)*matmul(abs(machine%mobility), parts)) &
                     + swing_of(machine, question%joint(i), order)
    end do
  end function sizes

  !> What the modes of a motion may bring to one place, whatever of them is there now [J].
  pure real(wp) function energy_of_swing(machine, state) result(energy)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    associate (q => abs(state%q(:machine%n)), v => abs(state%v(:machine%n)))
      energy = 0.5_wp*sum(v*matmul(abs(machine%mass), v)) + 0.5_wp*sum(q*matmul(abs(machine%stiffness), q))
    end associate
  end function energy_of_swing

  !> Largest force, or a rate of it (derivative number `order` - 2), of a spring [N/m] under a body with a mobility [1/kg] that has
  !> an energy [J]: what places on their way through zero are the rounding of.
  pure real(wp) function swing_of_force(energy, stiffness, mobility, order) result(force)
    real(wp), intent(in) :: energy, stiffness, mobility
    integer, intent(in) :: order
    force = sqrt(2*energy*stiffness)
    if (order > 2) force = force*sqrt(stiffness*mobility)**(order - 2)
  end function swing_of_force

  !> Bound on derivative number `order` of the given part of a joint coordinate.
  pure real(wp) function swing_of(machine, j, order) result(swing)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, order
    integer :: m
    swing = 0
    associate (offset => machine%joints(j)%offset)
      if (.not. allocated(offset%harmonic)) return
      do m = 1, size(offset%harmonic)
        swing = swing + (abs(real(offset%harmonic(m))) + abs(aimag(offset%harmonic(m))))*(m*machine%frequency)**order
      end do
    end associate
  end function swing_of

  !> Second rates of the forces, the laws taken as linear.
  pure subroutine second_rate(machine, state, turning, a, jerk, rate)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: a(:), jerk(:)
    real(wp), intent(out) :: rate(:)
    real(wp) :: s, u, r, by_place, by_speed, strength, growth, curvature
    integer :: m, j
    rate = -matmul(machine%damping, jerk) - matmul(machine%stiffness, a)
    do m = 1, size(machine%force, 2)
      rate = rate - (m*machine%frequency)**2*real(machine%force(:, m)*turning(m))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        call strength_now(joint, machine%frequency, turning, strength, growth, curvature)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, strength, r, by_place, by_speed)
        rate = rate + (by_place*(sum(joint%row*a) + surface(machine, j, state, turning, 2)) &
                       + by_speed*(sum(joint%row*jerk) + surface(machine, j, state, turning, 3)))*joint%row
        if (.not. allocated(joint%strength)) cycle
        call spring_force(joint, s, growth, r, by_place)
        rate = rate + 2*by_place*u*joint%row
        call spring_force(joint, s, curvature, r)
        rate = rate + r*joint%row
      end associate
    end do
  end subroutine second_rate

  pure subroutine solve(question, drift, tolerance, side, r, y, ok)
    type(question_t), intent(in) :: question
    real(wp), intent(in) :: drift(:), tolerance
    integer, intent(inout) :: side(:)
    real(wp), intent(out) :: r(:), y(:)
    logical, intent(out) :: ok
    integer :: n
    n = question%count
    call solve_boxed(question%g(:n, :n), drift(:n), question%lower(:n), question%upper(:n), question%fixed(:n), tolerance, &
                     side(:n), r(:n), y(:n), ok)
  end subroutine solve

  !> Whether a force is at its limit while the joint has no acceleration.
  pure logical function is_tied(question, r, y, side, tolerance)
    type(question_t), intent(in) :: question
    real(wp), intent(in) :: r(:), y(:), tolerance(:)
    integer, intent(in) :: side(:)
    integer :: i
    is_tied = .false.
    do i = 1, question%count
      if (tied_at(question, i, r, y, side, tolerance(i)) /= 0) is_tied = .true.
    end do
  end function is_tied

  !> A joint at its limit that joints which hold keep from moving is no tie: friction slides at no speed, a contact lies open at
  !> its stop, and they bear what comes.
  pure subroutine keep_loaded(question, y, side, tolerance)
    type(question_t), intent(inout) :: question
    real(wp), intent(in) :: y(:), tolerance(:)
    integer, intent(in) :: side(:)
    integer :: i
    associate (n => question%count)
      do i = 1, n
        if (question%fixed(i) .or. side(i) == 0 .or. .not. abs(y(i)) <= tolerance(i)) cycle
        question%fixed(i) = depends_on(question%g(:n, :n), i, side(:n) == 0)
      end do
    end associate
  end subroutine keep_loaded

  !> What no derivative decides sticks, or stays closed; a contact whose force a guard has seen end (`ends`) opens.
  pure subroutine settle_ties(machine, question, r, y, ends, tolerance, side)
    type(multibody_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    real(wp), intent(in) :: r(:), y(:), tolerance(:)
    logical, intent(in) :: ends(:)
    integer, intent(inout) :: side(:)
    integer :: i, limit
    do i = 1, question%count
      limit = tied_at(question, i, r, y, side, tolerance(i))
      if (limit == 0) cycle
      side(i) = merge(limit, 0, ends(question%joint(i)) .and. machine%joints(question%joint(i))%kind == joint_contact)
    end do
  end subroutine settle_ties

  !> The limit at which joint number `i` in question is tied, 0 if it is not.
  pure integer function tied_at(question, i, r, y, side, tolerance) result(limit)
    type(question_t), intent(in) :: question
    integer, intent(in) :: i, side(:)
    real(wp), intent(in) :: r(:), y(:), tolerance
    real(wp) :: mobility
    limit = 0
    if (question%fixed(i)) return
    mobility = question%g(i, i)
    if (side(i) == 0) then
      if (abs(question%upper(i)) < huge(1.0_wp)) then
        if ((question%upper(i) - r(i))*mobility <= tolerance) limit = 1
      end if
      if (abs(question%lower(i)) < huge(1.0_wp)) then
        ! The rounding of a stiff joint can be more than lies between the limits.
        if ((r(i) - question%lower(i))*mobility <= tolerance .and. &
            (limit == 0 .or. r(i) - question%lower(i) < question%upper(i) - r(i))) limit = -1
      end if
    else if (abs(y(i)) <= tolerance) then
      limit = side(i)
    end if
  end function tied_at

  !> Limits of the rates of the forces: none for what holds, nothing for what slides or is open, one for what is tied.
  pure subroutine narrow(question, r, y, side, tolerance)
    type(question_t), intent(inout) :: question
    real(wp), intent(in) :: r(:), y(:), tolerance(:)
    integer, intent(in) :: side(:)
    integer :: i, limit
    do i = 1, question%count
      limit = tied_at(question, i, r, y, side, tolerance(i))
      if (limit > 0) then
        question%lower(i) = -huge(1.0_wp)
        question%upper(i) = 0
      else if (limit < 0) then
        question%lower(i) = 0
        question%upper(i) = huge(1.0_wp)
      else if (side(i) == 0) then
        question%lower(i) = -huge(1.0_wp)
        question%upper(i) = huge(1.0_wp)
      else
        question%fixed(i) = .true.
      end if
    end do
  end subroutine narrow

end module mode_question
