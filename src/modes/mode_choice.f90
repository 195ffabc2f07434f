! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which joints stick and which contacts stay closed: of all that may, at once, by the accelerations and forces at an instant.
!> With a break-away level equal to that of sliding it is a convex problem, whose accelerations are unique (Gauss'
!> principle). Where the level at rest is higher, all joints that it cannot hold go together, with the force of sliding.
!> Ties are settled by the same problem for the next derivative, twice; what is still tied sticks, or stays closed.
module mode_choice
  use boxed_forces, only: solve_boxed
  use jointed, only: joint_contact, joint_friction, jointed_t, most_joints
  use jointed_state, only: free_force, is_held, joint_force, joint_motion, jointed_state_t
  use kinds, only: wp
  implicit none
  private

  public :: choose_mode, project, accelerations_of

  !> Rounding of forces and accelerations, as a share of their sizes.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)

  !> What the choice is made of: the joints in question, their rows, and the drift of the free structure along them.
  type :: question_t
    integer :: count = 0
    integer :: joint(most_joints) = 0
    real(wp), dimension(most_joints) :: lower = 0, upper = 0
    !> Not in question any more: no force is sought.
    logical :: fixed(most_joints) = .false.
    real(wp) :: g(most_joints, most_joints) = 0
    real(wp) :: tolerance = 0
  end type question_t

contains

  !> Sets the phases of the joints in `at_rest` (friction with no sliding speed) and `touching` (+1, -1: contacts closed at
  !> a stop, with no speed). Those of the others stay. `ok` is false if no choice is found.
  pure subroutine choose_mode(machine, state, turning, at_rest, touching, ok)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    logical, intent(out) :: ok
    integer :: before(most_joints), released(most_joints), verdict(most_joints), round, j
    logical :: again, put_back(most_joints)
    before = state%phase
    released = 0
    put_back = .false.
    do round = 1, 2*size(machine%joints) + 2
      call answer(machine, state, turning, at_rest .and. released(:size(at_rest)) == 0, touching, before, verdict, ok)
      if (.not. ok) return
      again = .false.
      do j = 1, size(machine%joints)
        if (.not. at_rest(j) .or. released(j) /= 0) cycle
        if (verdict(j) /= 0 .and. drops(machine, j) .and. .not. put_back(j)) then
          released(j) = verdict(j)
          again = .true.
        end if
      end do
      call set_phases(machine, state, at_rest, touching, verdict, released)
      if (again) cycle
      call restick(machine, state, turning, released, put_back, again)
      if (.not. again) exit
    end do
  end subroutine choose_mode

  !> Whether the force of friction falls when it starts to slide.
  pure logical function drops(machine, j)
    type(jointed_t), intent(in) :: machine
    integer, intent(in) :: j
    drops = machine%joints(j)%friction%break_away > level_of_sliding(machine, j)*(1 + rounding)
  end function drops

  !> Friction at the start of a slide [N].
  pure real(wp) function level_of_sliding(machine, j) result(level)
    type(jointed_t), intent(in) :: machine
    integer, intent(in) :: j
    call joint_force(machine%joints(j), 1, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, level)
    level = -level
  end function level_of_sliding

  pure subroutine set_phases(machine, state, at_rest, touching, verdict, released)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(inout) :: state
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:), verdict(:), released(:)
    integer :: j
    do j = 1, size(machine%joints)
      if (at_rest(j)) then
        state%phase(j) = merge(released(j), verdict(j), released(j) /= 0)
      else if (touching(j) /= 0) then
        state%phase(j) = merge(touching(j), 0, verdict(j) == 0)
      end if
    end do
  end subroutine set_phases

  !> A released joint that the forces drive against its own direction is held again, once.
  pure subroutine restick(machine, state, turning, released, put_back, again)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(inout) :: released(:)
    logical, intent(inout) :: put_back(:)
    logical, intent(inout) :: again
    real(wp) :: a(machine%n), s, u, given
    integer :: j
    if (all(released == 0)) return
    call accelerations_of(machine, state, turning, a)
    do j = 1, size(machine%joints)
      if (released(j) == 0) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
      if (released(j)*(sum(machine%joints(j)%row*a) + given) >= 0) cycle
      released(j) = 0
      put_back(j) = .true.
      again = .true.
    end do
  end subroutine restick

  !> Accelerations with the phases as they are, and their rates.
  pure subroutine accelerations_of(machine, state, turning, a, jerk)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: a(:)
    real(wp), intent(out), optional :: jerk(:)
    type(question_t) :: question
    real(wp) :: force(machine%n), rate(machine%n)
    integer :: j
    call free_force(machine, state, turning, force)
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), state%phase(j))) call ask(question, j, -huge(1.0_wp), huge(1.0_wp))
    end do
    call set_mobility(machine, question)
    call hold_against(machine, question, state, turning, 2, force)
    a = matmul(machine%mobility, force)
    if (.not. present(jerk)) return
    call free_force(machine, state, turning, force, a, rate)
    call hold_against(machine, question, state, turning, 3, rate)
    jerk = matmul(machine%mobility, rate)
  end subroutine accelerations_of

  !> Adds to forces (or their rates) those of the constraints, so that derivative number `order` of their joint coordinates
  !> is zero.
  pure subroutine hold_against(machine, question, state, turning, order, force)
    type(jointed_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(inout) :: force(:)
    real(wp), dimension(most_joints) :: r, y, drift
    integer :: side(most_joints), i
    logical :: ok
    call drift_of(machine, question, state, turning, order, force, drift)
    side = 0
    call solve(question, drift, 0.0_wp, side, r, y, ok)
    do i = 1, question%count
      force = force + r(i)*machine%joints(question%joint(i))%row
    end do
  end subroutine hold_against

  !> One convex problem and its ties. `verdict` of friction: 0 sticks, +1, -1 starts to slide; of contacts: 0 stays closed, 1
  !> opens.
  pure subroutine answer(machine, state, turning, at_rest, touching, before, verdict, ok)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:), before(:)
    integer, intent(out) :: verdict(:)
    logical, intent(out) :: ok
    type(question_t) :: question
    type(jointed_state_t) :: trial
    real(wp), dimension(machine%n) :: force, rate, a, jerk, next
    real(wp), dimension(most_joints) :: r, y, drift, size_of_y
    integer :: side(most_joints), j, i
    verdict = 0
    trial = state
    do j = 1, size(machine%joints)
      if (at_rest(j)) then
        associate (level => machine%joints(j)%friction%break_away)
          call ask(question, j, -level, level)
        end associate
        trial%phase(j) = 0
        side(question%count) = -before(j)
      else if (touching(j) /= 0) then
        if (touching(j) > 0) call ask(question, j, -huge(1.0_wp), 0.0_wp)
        if (touching(j) < 0) call ask(question, j, 0.0_wp, huge(1.0_wp))
        trial%phase(j) = touching(j)
        side(question%count) = 0
      end if
    end do
    ok = .true.
    if (question%count == 0) return
    call set_mobility(machine, question)
    call free_force(machine, trial, turning, force)
    associate (n => question%count)
      call drift_of(machine, question, trial, turning, 2, force, drift)
      size_of_y = sizes(machine, question, trial, turning, force)
      call solve(question, drift, rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      call classify(machine, question, side, verdict)
      if (.not. is_tied(question, r, y, side, rounding*size_of_y)) return
      ! The next derivative decides among those that are tied.
      next = force
      do i = 1, n
        next = next + r(i)*machine%joints(question%joint(i))%row
      end do
      a = matmul(machine%mobility, next)
      call free_force(machine, trial, turning, force, a, rate)
      call narrow(question, r, y, side, rounding*size_of_y)
      call drift_of(machine, question, trial, turning, 3, rate, drift)
      size_of_y = sizes(machine, question, trial, turning, abs(force)*machine%frequency + abs(rate))
      call solve(question, drift, rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      call classify(machine, question, side, verdict)
      if (.not. is_tied(question, r, y, side, 64*rounding*size_of_y)) return
      next = rate
      do i = 1, n
        next = next + r(i)*machine%joints(question%joint(i))%row
      end do
      jerk = matmul(machine%mobility, next)
      call second_rate(machine, trial, turning, a, jerk, rate)
      call narrow(question, r, y, side, 64*rounding*size_of_y)
      call drift_of(machine, question, trial, turning, 4, rate, drift)
      size_of_y = sizes(machine, question, trial, turning, abs(force)*machine%frequency**2 + abs(rate))
      call solve(question, drift, 4096*rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      where (side(:n) /= 0 .and. abs(y(:n)) <= 4096*rounding*size_of_y(:n) .and. .not. question%fixed(:n)) side(:n) = 0
      call classify(machine, question, side, verdict)
    end associate
  end subroutine answer

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
    type(jointed_t), intent(in) :: machine
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
    type(jointed_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    type(jointed_state_t), intent(in) :: state
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
    type(jointed_t), intent(in) :: machine
    integer, intent(in) :: j, order
    type(jointed_state_t), intent(in) :: state
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

  !> Sizes of what the accelerations in question are sums of, for their rounding.
  pure function sizes(machine, question, state, turning, force) result(size_of_y)
    type(jointed_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: force(:)
    real(wp) :: size_of_y(most_joints), parts(machine%n), s, u, r, by_place, by_speed
    integer :: i, n
    n = machine%n
    parts = abs(force) + abs(machine%load) + matmul(abs(machine%damping), abs(state%v(:n))) &
            + matmul(abs(machine%stiffness), abs(state%q(:n)))
    do i = 1, size(turning)
      if (i <= size(machine%force, 2)) parts = parts + abs(real(machine%force(:, i)))*abs(real(turning(i))) &
                                                     + abs(aimag(machine%force(:, i)))*abs(aimag(turning(i)))
    end do
    do i = 1, size(machine%joints)
      if (machine%joints(i)%kind == joint_friction) parts = parts &
        + abs(machine%joints(i)%row)*machine%joints(i)%friction%break_away
      ! The force of a stiff joint is the small difference of large ones.
      call joint_motion(machine, i, state%q, state%v, state%time, turning, s, u)
      call joint_force(machine%joints(i), state%phase(i), state%slider(i), state%touch_speed(i), s, u, r, by_place, by_speed)
      associate (row => abs(machine%joints(i)%row))
        parts = parts + row*(abs(by_place)*sum(row*abs(state%q(:n))) + abs(by_speed)*sum(row*abs(state%v(:n))))
      end associate
    end do
    size_of_y = 0
    do i = 1, question%count
      size_of_y(i) = sum(abs(machine%joints(question%joint(i))%row)*matmul(abs(machine%mobility), parts))
    end do
  end function sizes

  !> Second rates of the forces, the laws taken as linear.
  pure subroutine second_rate(machine, state, turning, a, jerk, rate)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: a(:), jerk(:)
    real(wp), intent(out) :: rate(:)
    real(wp) :: s, u, r, by_place, by_speed
    integer :: m, j
    rate = -matmul(machine%damping, jerk) - matmul(machine%stiffness, a)
    do m = 1, size(machine%force, 2)
      rate = rate - (m*machine%frequency)**2*real(machine%force(:, m)*turning(m))
    end do
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        if (is_held(joint, state%phase(j)) .or. joint%kind == joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, r, by_place, by_speed)
        rate = rate + (by_place*(sum(joint%row*a) + surface(machine, j, state, turning, 2)) &
                       + by_speed*(sum(joint%row*jerk) + surface(machine, j, state, turning, 3)))*joint%row
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
        if ((r(i) - question%lower(i))*mobility <= tolerance) limit = -1
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

  pure subroutine classify(machine, question, side, verdict)
    type(jointed_t), intent(in) :: machine
    type(question_t), intent(in) :: question
    integer, intent(in) :: side(:)
    integer, intent(inout) :: verdict(:)
    integer :: i
    do i = 1, question%count
      if (machine%joints(question%joint(i))%kind == joint_contact) then
        verdict(question%joint(i)) = merge(0, 1, side(i) == 0)
      else
        verdict(question%joint(i)) = -side(i)
      end if
    end do
  end subroutine classify

  !> Moves the state onto what the phases hold: no sliding speed, gap and its rate zero; least in the metric of the masses.
  pure subroutine project(machine, state, turning)
    type(jointed_t), intent(in) :: machine
    type(jointed_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    type(question_t) :: question
    real(wp), dimension(most_joints) :: miss, gap, r, y
    real(wp) :: s, u
    integer :: side(most_joints), i, j
    logical :: ok
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), state%phase(j))) call ask(question, j, -huge(1.0_wp), huge(1.0_wp))
    end do
    if (question%count == 0) return
    call set_mobility(machine, question)
    gap = 0
    do i = 1, question%count
      j = question%joint(i)
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      miss(i) = u
      if (machine%joints(j)%kind /= joint_contact) cycle
      gap(i) = s - merge(machine%joints(j)%upper, machine%joints(j)%lower, state%phase(j) > 0)
    end do
    associate (n => question%count)
      side = 0
      call solve(question, miss, 0.0_wp, side, r, y, ok)
      do i = 1, n
        state%v(:machine%n) = state%v(:machine%n) + r(i)*matmul(machine%mobility, machine%joints(question%joint(i))%row)
      end do
      if (.not. any(abs(gap(:n)) > 0)) return
      do i = 1, n
        if (machine%joints(question%joint(i))%kind == joint_contact) cycle
        question%fixed(i) = .true.
      end do
      side = 0
      call solve(question, gap, 0.0_wp, side, r, y, ok)
      do i = 1, n
        state%q(:machine%n) = state%q(:machine%n) + r(i)*matmul(machine%mobility, machine%joints(question%joint(i))%row)
      end do
    end associate
  end subroutine project

end module mode_choice
