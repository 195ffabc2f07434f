! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Impacts of the driven body on its stop, and how a sequence of ever smaller ones ends.
module pair_impact
  use contact_law, only: contact_constant, restitution_at
  use kinds, only: wp
  use motion_state, only: append_word, event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, &
    log_t, mode_lower_barrier, mode_stick, mode_upper_barrier, record_event, tally_t, word_chatter_lower, &
    word_chatter_upper, word_lower, word_upper
  use pair, only: driven_by_motion, impact_mass
  use pair_flight, only: body_state, driver_of, fly_pair, guard_none
  use pair_modes, only: at_v1, at_v2, at_x1, at_x2, mode_of_slip, mode_together, pair_motion_t, pair_state_t, stands
  implicit none
  private

  public :: collide_pair, rest_on_stop

  !> Share of the driving speed, or relative change of the acceleration, at which a chatter sequence is completed.
  real(wp), parameter :: chatter_share = 1e-6_wp

contains

  !> m2 meets its stop on `side` +1 (upper) or -1: Newton's law for the velocity relative to the stop.
  pure subroutine collide_pair(moving, state, side, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer, intent(in) :: side
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(pair_state_t) :: before
    real(wp) :: speed, k, mass, driving_speed
    logical :: rounding
    before = state
    state%touch = side
    state%y(at_x2) = merge(moving%machine%upper, moving%machine%lower, side > 0)
    if (moving%machine%carried) state%y(at_x2) = state%y(at_x2) + state%y(at_x1)
    mass = impact_mass(moving%machine)
    driving_speed = state%y(at_v1)
    speed = side*state%y(at_v2)
    if (moving%machine%carried) speed = side*(state%y(at_v2) - state%y(at_v1))
    if (speed > 0) then
      k = restitution_at(moving%machine%contact, speed)
      rounding = stands(moving, state, speed)
      if (moving%clamped .or. speed <= moving%negligible_speed .or. rounding) k = 0
      call set_relative_velocity(moving, state, -side*k*speed)
      if (.not. rounding) call count_impact(tally, speed, merge(word_upper, word_lower, side > 0))
      if (present(log)) then
        log%book%contact = log%book%contact + 0.5_wp*mass*speed**2*(1 - k**2)
        if (moving%machine%carried .and. moving%machine%drive == driven_by_motion) then
          log%book%work = log%book%work - side*mass*(1 + k)*speed*driving_speed
        end if
        if (.not. rounding) call record_event(log, merge(event_impact_upper, event_impact_lower, side > 0), &
                                              body_state(before), state%y(at_v2), driver_of(before))
      end if
      if (k*speed > 0) then
        call leave_stop(moving, state, side)
        call complete_chatter(moving, state, side, k*speed, tally, log)
        return
      end if
    else if (speed < 0) then
      ! Rounding may carry a body that leaves a stop a bit beyond it.
      return
    end if
    call rest_on_stop(moving, state)
  end subroutine collide_pair

  pure subroutine count_impact(tally, speed, word)
    type(tally_t), intent(inout) :: tally
    real(wp), intent(in) :: speed
    integer, intent(in) :: word
    tally%impacts = tally%impacts + 1
    tally%last_impact_speed = speed
    tally%impact_speed_sum = tally%impact_speed_sum + speed
    call append_word(tally, word)
  end subroutine count_impact

  !> Gives m2 the velocity `relative` [m/s] against its stop; two bodies keep their momentum.
  pure subroutine set_relative_velocity(moving, state, relative)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: relative
    real(wp) :: common
    associate (m1 => moving%machine%mass, m2 => moving%machine%driven_mass, y => state%y)
      if (.not. moving%machine%carried) then
        y(at_v2) = relative
      else if (moving%machine%drive == driven_by_motion) then
        y(at_v2) = y(at_v1) + relative
      else
        common = (m1*y(at_v1) + m2*y(at_v2))/(m1 + m2)
        y(at_v1) = common - relative*m2/(m1 + m2)
        y(at_v2) = y(at_v1) + relative
      end if
    end associate
  end subroutine set_relative_velocity

  !> Mode of a body that rebounds from the stop on `side`.
  pure subroutine leave_stop(moving, state, side)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer, intent(in) :: side
    real(wp) :: w
    w = state%y(at_v1) - state%y(at_v2)
    if (abs(w) > 0) then
      state%mode = mode_of_slip(nint(sign(1.0_wp, w)))
    else
      state%touch = 0
      call mode_together(moving, state)
    end if
    state%touch = side
  end subroutine leave_stop

  !> Mode of a body at rest on the stop `state%touch`.
  pure subroutine rest_on_stop(moving, state)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer :: s
    if (moving%machine%carried) then
      state%y(at_v2) = state%y(at_v1)
      call mode_together(moving, state)
      return
    end if
    state%y(at_v2) = 0
    if (stands(moving, state, state%y(at_v1))) then
      if (moving%machine%drive /= driven_by_motion) state%y(at_v1) = 0
      call mode_together(moving, state)
      return
    end if
    s = nint(sign(1.0_wp, state%y(at_v1)))
    if (moving%clamped) state%touch = s
    if (s == state%touch) then
      state%mode = merge(mode_upper_barrier, mode_lower_barrier, s > 0)
    else
      state%mode = mode_of_slip(s)
    end if
  end subroutine rest_on_stop

  !> Completes the impacts on the stop on `side` where what presses m2 on it is uniform over what is left of them, m2
  !> having just left with the relative `speed` [m/s]. Out and back take bounce, and the speed shrinks by a constant.
  pure subroutine complete_chatter(moving, state, side, speed, tally, log)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    integer, intent(in) :: side
    real(wp), intent(in) :: speed
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(pair_state_t) :: later, resting
    type(tally_t) :: unused
    real(wp) :: out, back, shrink, left
    integer :: fallen
    call pressing(moving, state, side, speed, out, back)
    if (.not. back > 0) return
    shrink = restitution_at(moving%machine%contact, speed)*sqrt(back/out)
    if (shrink >= 1) return
    if (moving%machine%contact%kind /= contact_constant) then
      if (abs(moving%machine%contact%restitution*sqrt(back/out) - shrink) > chatter_share) return
    end if
    left = (speed/out + speed/sqrt(back*out))/(1 - shrink)
    later = state
    if (moving%machine%carried) then
      if (abs(rate_of_push(moving, state))*left > chatter_share*back) return
      call set_relative_velocity(moving, later, 0.0_wp)
    else
      if (speed > chatter_share*abs(state%y(at_v1))) return
      later%y(at_v2) = 0
    end if
    call rest_on_stop(moving, later)
    if (later%mode /= merge(mode_stick, merge(mode_upper_barrier, mode_lower_barrier, side > 0), moving%machine%carried)) return
    resting = later
    call fly_pair(moving, later, later%time + left, .false., fallen, unused)
    if (fallen /= guard_none) return
    state = resting
    tally%chatters = tally%chatters + 1
    call append_word(tally, merge(word_chatter_upper, word_chatter_lower, side > 0))
    if (.not. present(log)) return
    log%book%contact = log%book%contact + 0.5_wp*impact_mass(moving%machine)*speed**2
    if (moving%machine%carried .and. moving%machine%drive == driven_by_motion) then
      log%book%work = log%book%work + side*impact_mass(moving%machine)*speed*state%y(at_v1)
    end if
    ! The log has the instant of accumulation even where the clock stops before it.
    call record_event(log, merge(event_chatter_upper, event_chatter_lower, side > 0), body_state(later), &
                      later%y(at_v2), driver_of(later))
  end subroutine complete_chatter

  !> Accelerations of m2 relative to the stop after leaving it, against the motion on the way out and on the way back.
  pure subroutine pressing(moving, state, side, speed, out, back)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    integer, intent(in) :: side
    real(wp), intent(in) :: speed
    real(wp), intent(out) :: out, back
    real(wp) :: push
    associate (machine => moving%machine)
      out = 0
      back = 0
      if (.not. machine%carried) then
        ! Friction presses as long as m1 slides towards the stop faster than m2.
        if (side*state%y(at_v1) > speed) out = machine%friction/machine%driven_mass
        back = out
        return
      end if
      push = -side*sum(moving%push*state%y)
      if (machine%drive /= driven_by_motion) push = push/machine%mass
      out = push + machine%friction/impact_mass(moving%machine)
      back = push - machine%friction/impact_mass(moving%machine)
    end associate
  end subroutine pressing

  !> Rate of the relative acceleration that the drive causes [m/s^3].
  pure real(wp) function rate_of_push(moving, state) result(rate)
    type(pair_motion_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    rate = sum(moving%push*matmul(moving%modes(state%mode)%matrix, state%y))
    if (moving%machine%drive /= driven_by_motion) rate = rate/moving%machine%mass
  end function rate_of_push

end module pair_impact
