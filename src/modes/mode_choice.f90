! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which joints stick and which contacts stay closed: of all that may, at once, by the accelerations and forces at an instant.
!> With a break-away level equal to that of sliding it is a convex problem, whose accelerations are unique (Gauss'
!> principle). Where the level at rest is higher, all joints that it cannot hold go together, with the force of sliding.
!> Ties are settled by the same problem for the next derivative, twice; what is still degenerate sticks, or stays closed, unless
!> its guard has just triggered.
module mode_choice
  use multibody, only: joint_contact, multibody_t, most_joints
  use multibody_state, only: factor_now, free_force, is_held, joint_force, joint_motion, multibody_state_t
  use kinds, only: wp
  use mode_lcp, only: add_constraint, drift_of, is_degenerate, keep_loaded, restrict_bounds, mode_lcp_t, second_rate, &
    set_mobility, resolve_degeneracy, &
    sizes, solve
  implicit none
  private

  public :: choose_mode, project, accelerations_of

  !> Rounding of forces and accelerations, as a share of their sizes.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
  !> A force with a triggered guard is at its limit if it is this near, as a share of its size.
  real(wp), parameter :: near_level = sqrt(epsilon(1.0_wp))

contains

  !> Sets the phases of the joints in `at_rest` (friction with no sliding speed) and `touching` (+1, -1: contacts closed at
  !> a stop, with no speed). Those of the others stay. `ok` is false if no choice is found. The force of those `at_level` has just
  !> come to its limit: one near it is taken as there, whatever the rounding of the flight was.
  pure subroutine choose_mode(machine, state, turning, at_rest, touching, ok, at_level)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    logical, intent(out) :: ok
    logical, intent(in), optional :: at_level(:)
    logical :: near(most_joints)
    integer :: before(most_joints), released(most_joints), verdict(most_joints), round, j
    logical :: again, put_back(most_joints)
    before = state%phase
    released = 0
    near = .false.
    if (present(at_level)) near = at_level
    put_back = .false.
    do round = 1, 2*size(machine%joints) + 2
      call answer(machine, state, turning, at_rest .and. released(:size(at_rest)) == 0, touching, near, before, verdict, ok)
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
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    drops = machine%joints(j)%friction%break_away > level_of_sliding(machine, j)*(1 + rounding)
  end function drops

  !> Friction at the start of a slide [N].
  pure real(wp) function level_of_sliding(machine, j) result(level)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    call joint_force(machine%joints(j), 1, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, level)
    level = -level
  end function level_of_sliding

  pure subroutine set_phases(machine, state, at_rest, touching, verdict, released)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
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
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
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
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(out) :: a(:)
    real(wp), intent(out), optional :: jerk(:)
    type(mode_lcp_t) :: lcp
    real(wp) :: force(machine%n), rate(machine%n)
    integer :: j
    call free_force(machine, state, turning, force)
    lcp%count = 0
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), state%phase(j))) call add_constraint(lcp, j, -huge(1.0_wp), huge(1.0_wp))
    end do
    call set_mobility(machine, lcp)
    call hold_against(machine, lcp, state, turning, 2, force)
    a = matmul(machine%mobility, force)
    if (.not. present(jerk)) return
    call free_force(machine, state, turning, force, a, rate)
    call hold_against(machine, lcp, state, turning, 3, rate)
    jerk = matmul(machine%mobility, rate)
  end subroutine accelerations_of

  !> Adds to forces (or their rates) those of the constraints, so that derivative number `order` of their joint coordinates
  !> is zero.
  pure subroutine hold_against(machine, lcp, state, turning, order, force)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    integer, intent(in) :: order
    real(wp), intent(inout) :: force(:)
    real(wp), dimension(most_joints) :: r, y, drift
    integer :: side(most_joints)
    logical :: ok
    call drift_of(machine, lcp, state, turning, order, force, drift)
    side = 0
    call solve(lcp, drift, 0.0_wp, side, r, y, ok)
    call add_forces(machine, lcp, r, force)
  end subroutine hold_against

  !> Adds the forces `r` of the joints in `lcp` [N], or their rates, to those on the coordinates.
  pure subroutine add_forces(machine, lcp, r, force)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    real(wp), intent(in) :: r(:)
    real(wp), intent(inout) :: force(:)
    integer :: i
    do i = 1, lcp%count
      force = force + r(i)*machine%joints(lcp%joint(i))%row
    end do
  end subroutine add_forces

  !> One convex problem and its ties. `verdict` of friction: 0 sticks, +1, -1 starts to slide; of contacts: 0 stays closed, 1
  !> opens.
  pure subroutine answer(machine, state, turning, at_rest, touching, near, before, verdict, ok)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:), near(:)
    integer, intent(in) :: touching(:), before(:)
    integer, intent(out) :: verdict(:)
    logical, intent(out) :: ok
    type(mode_lcp_t) :: lcp
    type(multibody_state_t) :: trial
    real(wp), dimension(machine%n) :: force, rate, a, jerk, next
    real(wp), dimension(most_joints) :: r, y, drift, size_of_y, blur
    real(wp) :: level_rate(most_joints, 2)
    integer :: side(most_joints)
    verdict = 0
    trial = state
    call ask_all(machine, at_rest, touching, before, lcp, trial%phase, side)
    ok = .true.
    if (lcp%count == 0) return
    call set_mobility(machine, lcp)
    call press_joints(machine, trial, turning, lcp)
    call free_force(machine, trial, turning, force)
    associate (n => lcp%count)
      call drift_of(machine, lcp, trial, turning, 2, force, drift)
      size_of_y = sizes(machine, lcp, trial, turning, 2, force)
      call solve(lcp, drift, rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      blur = rounding*size_of_y
      where (near(lcp%joint(:n))) blur(:n) = near_level*size_of_y(:n)
      call keep_loaded(lcp, y, side, blur)
      call classify(machine, lcp, side, verdict)
      if (.not. is_degenerate(lcp, r, y, side, blur)) return
      ! The next derivative decides among those that are degenerate.
      next = force
      call add_forces(machine, lcp, r, next)
      a = matmul(machine%mobility, next)
      call free_force(machine, trial, turning, force, a, rate)
      level_rate = rates_of_levels(machine, lcp, trial, turning, a)
      call restrict_bounds(lcp, r, y, side, blur, level_rate(:, 1))
      call add_forces(machine, lcp, side(:n)*merge(level_rate(:n, 1), 0.0_wp, lcp%fixed(:n)), rate)
      call drift_of(machine, lcp, trial, turning, 3, rate, drift)
      size_of_y = sizes(machine, lcp, trial, turning, 3, abs(force)*machine%frequency + abs(rate))
      call solve(lcp, drift, rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      call keep_loaded(lcp, y, side, 64*rounding*size_of_y)
      call classify(machine, lcp, side, verdict)
      if (.not. is_degenerate(lcp, r, y, side, 64*rounding*size_of_y)) return
      next = rate
      call add_forces(machine, lcp, r, next)
      jerk = matmul(machine%mobility, next)
      call second_rate(machine, trial, turning, a, jerk, rate)
      level_rate = rates_of_levels(machine, lcp, trial, turning, a, jerk)
      call restrict_bounds(lcp, r, y, side, 64*rounding*size_of_y, level_rate(:, 2))
      call add_forces(machine, lcp, side(:n)*merge(level_rate(:n, 2), 0.0_wp, lcp%fixed(:n)), rate)
      call drift_of(machine, lcp, trial, turning, 4, rate, drift)
      size_of_y = sizes(machine, lcp, trial, turning, 4, abs(force)*machine%frequency**2 + abs(rate))
      call solve(lcp, drift, 4096*rounding*maxval(size_of_y(:n)), side, r, y, ok)
      if (.not. ok) return
      call keep_loaded(lcp, y, side, 4096*rounding*size_of_y)
      call resolve_degeneracy(machine, lcp, r, y, near, 4096*rounding*size_of_y, side)
      call classify(machine, lcp, side, verdict)
    end associate
  end subroutine answer

  !> Multiplies the limits of friction by its normal forces.
  pure subroutine press_joints(machine, state, turning, lcp)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    type(mode_lcp_t), intent(inout) :: lcp
    real(wp) :: factor(0:2)
    integer :: i
    do i = 1, lcp%count
      if (.not. allocated(machine%joints(lcp%joint(i))%load)) cycle
      call factor_now(machine, lcp%joint(i), state, turning, factor)
      lcp%lower(i) = lcp%lower(i)*factor(0)
      lcp%upper(i) = lcp%upper(i)*factor(0)
    end do
  end subroutine press_joints

  !> First two rates of the limits of friction [N/s, N/s^2], 0 where the normal force is part of the law.
  pure function rates_of_levels(machine, lcp, state, turning, a, jerk) result(rates)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: a(:)
    real(wp), intent(in), optional :: jerk(:)
    real(wp) :: rates(most_joints, 2), factor(0:2)
    integer :: i
    rates = 0
    do i = 1, lcp%count
      associate (joint => machine%joints(lcp%joint(i)))
        if (.not. allocated(joint%load)) cycle
        call factor_now(machine, lcp%joint(i), state, turning, factor, a, jerk)
        rates(i, :) = joint%friction%break_away*factor(1:2)
      end associate
    end do
  end function rates_of_levels

  !> Asks for the forces of all joints at rest and of all contacts that touch, which are held in `phase`; `side` is where the
  !> search for the answer begins: friction that slid before is first tried at the limit that it came from.
  pure subroutine ask_all(machine, at_rest, touching, before, lcp, phase, side)
    type(multibody_t), intent(in) :: machine
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:), before(:)
    type(mode_lcp_t), intent(inout) :: lcp
    integer, intent(inout) :: phase(:)
    integer, intent(out) :: side(:)
    integer :: j
    side = 0
    lcp%count = 0
    do j = 1, size(machine%joints)
      if (at_rest(j)) then
        associate (level => machine%joints(j)%friction%break_away)
          call add_constraint(lcp, j, -level, level)
        end associate
        phase(j) = 0
        side(lcp%count) = -before(j)
      else if (touching(j) /= 0) then
        ! Stops without room hold either way.
        associate (clamps => .not. machine%joints(j)%upper > machine%joints(j)%lower)
          call add_constraint(lcp, j, merge(-huge(1.0_wp), 0.0_wp, touching(j) > 0 .or. clamps), &
                   merge(huge(1.0_wp), 0.0_wp, touching(j) < 0 .or. clamps))
        end associate
        phase(j) = touching(j)
      end if
    end do
  end subroutine ask_all

  pure subroutine classify(machine, lcp, side, verdict)
    type(multibody_t), intent(in) :: machine
    type(mode_lcp_t), intent(in) :: lcp
    integer, intent(in) :: side(:)
    integer, intent(inout) :: verdict(:)
    integer :: i
    do i = 1, lcp%count
      if (machine%joints(lcp%joint(i))%kind == joint_contact) then
        verdict(lcp%joint(i)) = merge(0, 1, side(i) == 0)
      else
        verdict(lcp%joint(i)) = -side(i)
      end if
    end do
  end subroutine classify

  !> Moves the state onto what the phases hold: no sliding speed, gap and its rate zero; least in the metric of the masses. With
  !> `speeds` false only the gaps.
  pure subroutine project(machine, state, turning, speeds)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in), optional :: speeds
    type(mode_lcp_t) :: lcp
    real(wp), dimension(most_joints) :: miss, gap, r, y
    real(wp) :: s, u
    integer :: side(most_joints), i, j
    logical :: ok
    lcp%count = 0
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), state%phase(j))) call add_constraint(lcp, j, -huge(1.0_wp), huge(1.0_wp))
    end do
    if (lcp%count == 0) return
    call set_mobility(machine, lcp)
    gap = 0
    do i = 1, lcp%count
      j = lcp%joint(i)
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      miss(i) = u
      if (machine%joints(j)%kind /= joint_contact) cycle
      gap(i) = s - merge(machine%joints(j)%upper, machine%joints(j)%lower, state%phase(j) > 0)
    end do
    associate (n => lcp%count)
      side = 0
      if (present(speeds)) miss = merge(miss, 0.0_wp, speeds)
      call solve(lcp, miss, 0.0_wp, side, r, y, ok)
      do i = 1, n
        state%v(:machine%n) = state%v(:machine%n) + r(i)*matmul(machine%mobility, machine%joints(lcp%joint(i))%row)
      end do
      if (.not. any(abs(gap(:n)) > 0)) return
      do i = 1, n
        if (machine%joints(lcp%joint(i))%kind == joint_contact) cycle
        lcp%fixed(i) = .true.
      end do
      side = 0
      call solve(lcp, gap, 0.0_wp, side, r, y, ok)
      do i = 1, n
        state%q(:machine%n) = state%q(:machine%n) + r(i)*matmul(machine%mobility, machine%joints(lcp%joint(i))%row)
      end do
    end associate
  end subroutine project

end module mode_choice
