! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What follows a triggered guard of a multibody structure: impacts, sticking and sliding, the completion of chatter.
module multibody_transition
  use simultaneous_impact, only: apply_impact
  use chatter, only: look_ahead
  use guards, only: force_ends, force_returns, joint_guard_t, leaves, lets_go, meets_lower, meets_upper, slide_ends, &
    slides_down, slides_up
  use multibody, only: joint_contact, joint_elastic, joint_friction, joint_soft, multibody_t, most_joints
  use multibody_flows, only: multibody_motion_t
  use multibody_state, only: joint_motion, multibody_state_t, rounding_of_speed, turning_at
  use kinds, only: int64, wp
  use mode_choice, only: accelerations_of, choose_mode, project
  use motion_state, only: append_word, tally_t, word_chatter_lower, word_chatter_upper, word_lower, word_stick, word_upper
  use touching_contacts, only: add_near, add_degenerate, close_gaps
  use two_bodies, only: slides_on
  implicit none
  private

  public :: transition, settle, assess_friction

  !> So many impacts, each within this share of a period after the last, are the end of a chatter of several contacts.
  integer, parameter :: long_burst = 60

contains

  !> Rigid contacts in `touching` that do not open stay closed if the forces require it; joints at rest stick or slide. `at_level`:
  !> a guard reports that their force has come to its limit.
  pure subroutine settle(moving, state, turning, at_rest, touching, ok, at_level)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    logical, intent(out) :: ok
    logical, intent(in), optional :: at_level(:)
    integer :: slow(most_joints), j
    real(wp) :: s, u
    associate (machine => moving%machine)
      slow = 0
      do j = 1, size(machine%joints)
        if (touching(j) == 0 .or. machine%joints(j)%kind /= joint_contact) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        state%phase(j) = 0
        state%left(j) = touching(j)
        if (abs(u) <= machine%negligible_speed + rounding_of_speed(machine, j, state)) slow(j) = touching(j)
      end do
      call close_gaps(machine, state, turning, slow)
      call choose_mode(machine, state, turning, at_rest, slow, ok, at_level)
      do j = 1, size(machine%joints)
        if (at_rest(j)) state%left(j) = abs(state%phase(j))
        if (slow(j) /= 0 .and. state%phase(j) /= 0) state%left(j) = 0
      end do
      call project(machine, state, turning)
    end associate
  end subroutine settle

  !> What triggered guards bring about. `without_progress`: what cannot be decided is held for an instant.
  pure subroutine transition(moving, state, list, triggered, without_progress, tally, ok)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: triggered(:), without_progress
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    complex(wp) :: turning(moving%harmonics)
    type(multibody_state_t) :: start
    integer :: touching(most_joints), hit(most_joints), j
    logical :: at_rest(most_joints), at_level(most_joints), plastic
    real(wp) :: speed(most_joints), lost
    integer(int64) :: chatters
    associate (machine => moving%machine)
      turning = turning_at(machine%frequency, state%time, moving%harmonics)
      start = state
      chatters = tally%chatters
      at_level = .false.
      at_rest = .false.
      touching = 0
      hit = 0
      call change_phases(machine, turning, list, triggered, state, tally, at_rest, touching, hit)
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind == joint_contact .and. state%phase(j) /= 0) touching(j) = state%phase(j)
      end do
      ok = .true.
      if (any(hit /= 0)) then
        call count_burst(machine, hit, turning, state, plastic)
        call add_degenerate(machine, state, turning, hit, touching)
        if (plastic) call add_near(machine, state, turning, touching)
        call apply_impact(machine, state, turning, touching, plastic, speed, lost, ok)
        do j = 1, size(machine%joints)
          if (hit(j) /= 0) call count_impact(tally, hit(j), abs(speed(j)))
        end do
      end if
      call assess_friction(machine, start, turning, any(hit /= 0), state, at_rest)
      if (without_progress) then
        call hold(moving, state, turning, at_rest, touching)
        return
      end if
      ! Impacts change the forces.
      do j = 1, size(list)
        if (.not. triggered(j) .or. any(hit /= 0)) cycle
        if (any(list(j)%meaning == [slides_up, slides_down, lets_go])) at_level(list(j)%joint) = .true.
      end do
      if (ok) call settle(moving, state, turning, at_rest, touching, ok, at_level)
      if (ok .and. any(hit /= 0)) call end_chatter(moving, start, touching, hit, turning, state, tally)
      call count_sticks(machine, start, state, tally%chatters > chatters, tally)
    end associate
  end subroutine transition

  !> Counts an impact in the burst that it belongs to; a long one that dies away is `plastic`: without loss it may go on for ever.
  pure subroutine count_burst(machine, hit, turning, state, plastic)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: hit(:)
    complex(wp), intent(in) :: turning(:)
    type(multibody_state_t), intent(inout) :: state
    logical, intent(out) :: plastic
    real(wp) :: fastest, s, u
    integer :: j
    fastest = 0
    do j = 1, size(machine%joints)
      if (hit(j) == 0) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      fastest = max(fastest, abs(u))
    end do
    if (state%burst <= 1) state%burst_speed = 0
    state%burst = state%burst + 1
    if (state%burst > 1) state%burst_speed = max(state%burst_speed, fastest)
    plastic = state%burst > long_burst .and. fastest <= state%burst_speed/2
  end subroutine count_burst

  !> Counts friction that has come to stick; of two bodies also where they have come to rest against a stop, the end of a chatter
  !> being in the word already.
  pure subroutine count_sticks(machine, before, state, chattered, tally)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: before, state
    logical, intent(in) :: chattered
    type(tally_t), intent(inout) :: tally
    integer :: j
    if (allocated(machine%driver)) then
      if (.not. slides_on(machine, before) .or. slides_on(machine, state)) return
      tally%sticks = tally%sticks + 1
      if (.not. chattered) call append_word(tally, word_stick)
      return
    end if
    do j = 1, size(machine%joints)
      if (machine%joints(j)%kind == joint_friction .and. before%phase(j) /= 0 .and. state%phase(j) == 0) then
        tally%sticks = tally%sticks + 1
        call append_word(tally, word_stick)
      end if
    end do
  end subroutine count_sticks

  !> What each triggered guard means for its own joint: its phase, or that it is at rest, touches, is hit.
  pure subroutine change_phases(machine, turning, list, triggered, state, tally, at_rest, touching, hit)
    type(multibody_t), intent(in) :: machine
    complex(wp), intent(in) :: turning(:)
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: triggered(:)
    type(multibody_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    logical, intent(inout) :: at_rest(:)
    integer, intent(inout) :: touching(:), hit(:)
    real(wp) :: s, u
    integer :: g, j
    do g = 1, size(list)
      if (.not. triggered(g)) cycle
      j = list(g)%joint
      select case (list(g)%meaning)
      case (slide_ends)
        if (machine%joints(j)%kind == joint_elastic) then
          call stop_slider(machine, j, state, turning)
          call append_word(tally, word_stick)
          tally%sticks = tally%sticks + 1
        else
          at_rest(j) = .true.
        end if
      case (slides_up, slides_down)
        if (machine%joints(j)%kind == joint_elastic) then
          state%phase(j) = merge(1, -1, list(g)%meaning == slides_up)
          ! The speed of the slide starts at zero where the spring has just been let go at rest, else it is what it is.
          call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
          state%left(j) = merge(1, 0, abs(u) <= rounding_of_speed(machine, j, state))
        end if
      case (meets_upper, meets_lower)
        touching(j) = merge(1, -1, list(g)%meaning == meets_upper)
        if (machine%joints(j)%kind == joint_soft) then
          call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
          state%phase(j) = touching(j)
          state%left(j) = touching(j)
          state%touch_speed(j) = abs(u)
          call count_impact(tally, touching(j), abs(u))
          touching(j) = 0
        else
          hit(j) = touching(j)
        end if
      case (lets_go)
        touching(j) = state%phase(j)
      case (leaves)
        state%left(j) = sign(1, state%phase(j))
        state%phase(j) = 0
      case (force_ends)
        state%phase(j) = 2*state%phase(j)
        state%left(j) = sign(1, state%phase(j))
      case (force_returns)
        state%phase(j) = state%phase(j)/2
        state%left(j) = sign(1, state%phase(j))
      end select
    end do
  end subroutine change_phases

  !> Which friction joints are at rest, and the directions of the others. One that stuck in the state `before` is at rest unless
  !> an impact has set it in motion: what its speed was then is rounding. What an impact leaves of a speed may be rounding, too.
  pure subroutine assess_friction(machine, before, turning, struck, state, at_rest)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: before
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: struck
    type(multibody_state_t), intent(inout) :: state
    logical, intent(inout) :: at_rest(:)
    real(wp) :: s, u, last, rounding
    integer :: j
    do j = 1, size(machine%joints)
      if (machine%joints(j)%kind /= joint_friction) cycle
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      rounding = rounding_of_speed(machine, j, state)
      if (struck) rounding = rounding + rounding_of_speed(machine, j, before)
      if (before%phase(j) == 0) then
        call joint_motion(machine, j, before%q, before%v, before%time, turning, s, last)
        at_rest(j) = .not. struck .or. abs(u - last) <= rounding
      else if (at_rest(j) .and. struck) then
        ! Its slide has just ended, unless the impact at the same instant sets it in motion.
        call joint_motion(machine, j, before%q, before%v, before%time, turning, s, last)
        at_rest(j) = abs(u - last) <= rounding
      end if
      if (abs(u) <= rounding) at_rest(j) = .true.
      if (.not. at_rest(j)) state%phase(j) = merge(1, -1, u > 0)
    end do
  end subroutine assess_friction

  !> The slider of elastic friction stops: its spring holds what friction was.
  pure subroutine stop_slider(machine, j, state, turning)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp) :: s, u
    call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
    state%slider(j) = s - state%phase(j)*machine%joints(j)%friction%kinetic/machine%joints(j)%stiffness
    state%left(j) = 0
    if (machine%joints(j)%friction%break_away <= machine%joints(j)%friction%kinetic) state%left(j) = state%phase(j)
    state%phase(j) = 0
  end subroutine stop_slider

  pure subroutine count_impact(tally, side, speed)
    type(tally_t), intent(inout) :: tally
    integer, intent(in) :: side
    real(wp), intent(in) :: speed
    tally%impacts = tally%impacts + 1
    tally%impact_speed_sum = tally%impact_speed_sum + speed
    tally%last_impact_speed = speed
    call append_word(tally, merge(word_upper, word_lower, side > 0))
  end subroutine count_impact

  !> Completes the chatter of one contact that has just rebounded from the state `before`, if the forces do not change until
  !> its end: then the state there is that of an impact without rebound now, and of the closed contact from then on, in all
  !> coordinates and for
  !> every restitution (the impulses act along one direction, and the conditions of a closed gap fix them).
  pure subroutine end_chatter(moving, before, touching, hit, turning, state, tally)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: before
    integer, intent(in) :: touching(:), hit(:)
    complex(wp), intent(in) :: turning(:)
    type(multibody_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    type(multibody_state_t) :: closed
    real(wp) :: speed(most_joints), lost
    integer :: j, i
    logical :: at_rest(most_joints), along(most_joints), ok
    associate (machine => moving%machine)
      j = findloc(hit /= 0, .true., 1)
      if (count(hit /= 0) /= 1 .or. state%phase(j) /= 0) return
      call look_ahead(moving, state, turning, j, hit(j), at_rest, along, ok)
      if (.not. ok) return
      closed = before
      call apply_impact(machine, closed, turning, touching, .true., speed, lost, ok)
      if (.not. ok) return
      do i = 1, size(machine%joints)
        if (machine%joints(i)%kind == joint_friction) closed%phase(i) = merge(0, state%phase(i), along(i))
      end do
      call settle(moving, closed, turning, at_rest .or. along, touching, ok)
      if (.not. ok .or. closed%phase(j) /= hit(j)) return
      do i = 1, size(machine%joints)
        if (i /= j .and. .not. along(i) .and. closed%phase(i) /= state%phase(i)) return
      end do
      state = closed
      tally%chatters = tally%chatters + 1
      call append_word(tally, merge(word_chatter_upper, word_chatter_lower, hit(j) > 0))
    end associate
  end subroutine end_chatter

  !> A soft contact that only just touches, with no speed, is pressed if the forces press it, else open.
  pure subroutine hold_soft(machine, j, turning, state)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    complex(wp), intent(in) :: turning(:)
    type(multibody_state_t), intent(inout) :: state
    real(wp) :: a(machine%n), kick(machine%n), s, u, given
    integer :: side
    associate (joint => machine%joints(j))
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u, given)
      side = 0
      if (abs(s - joint%upper) <= 1e-12_wp*machine%length_scale) side = 1
      if (abs(s - joint%lower) <= 1e-12_wp*machine%length_scale) side = -1
      if (side == 0 .or. abs(u) > machine%negligible_speed) return
      kick = matmul(machine%mobility, joint%row)
      state%v(:machine%n) = state%v(:machine%n) - kick*u/sum(joint%row*kick)
      state%phase(j) = 0
      call accelerations_of(machine, state, turning, a)
      if (side*(sum(joint%row*a) + given) > 0) state%phase(j) = side
      state%left(j) = side
    end associate
  end subroutine hold_soft

  !> What rounding cannot distinguish is held, for a billionth of a period.
  pure subroutine hold(moving, state, turning, at_rest, touching)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(in) :: at_rest(:)
    integer, intent(in) :: touching(:)
    integer :: j
    do j = 1, size(moving%machine%joints)
      if (at_rest(j)) state%phase(j) = 0
      if (touching(j) /= 0) state%phase(j) = touching(j)
      state%left(j) = 0
    end do
    call project(moving%machine, state, turning)
    do j = 1, size(moving%machine%joints)
      if (moving%machine%joints(j)%kind == joint_soft) call hold_soft(moving%machine, j, turning, state)
    end do
    state%time = state%time + 1e-9_wp*moving%machine%period
  end subroutine hold

end module multibody_transition
