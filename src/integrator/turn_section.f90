! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The section of a machine without a clock: the motion is looked at where the watched coordinate turns round, at its maxima (at
!> its minima where a rigid stop cuts the maxima off), so that the phase of a limit cycle, which nothing decides, is left out.
!> An angle that goes round has no maxima: its section is the passage of the half turn as well. Both are one coordinate,
!>   s = x at a maximum, s = +-(turn/2 + |v|/w) at the half turn, upwards or downwards,
!> which is continuous where the maximum comes to the half turn.
module turn_section
  use multibody_motion, only: advance_to_turn, multibody_motion_t
  use multibody_section, only: coordinates_of_multibody, multibody_at, multibody_point, scales_of_multibody, &
    watched_speed
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use motion, only: advance, motion_t, start_state
  use motion_state, only: append_word, mode_slip_minus, move_turn, state_t, tally_t, word_period
  use section_size, only: most_coordinates
  use status, only: reason_time_over
  implicit none
  private

  public :: advance_body_to_turn, advance_multibody_to_turn, body_at_turn, body_turn_point, coordinates_at_turn, &
    motion_at_turn, multibody_at_turn, multibody_turn_point, scales_at_turn, turn_coordinate

  !> Longest return to the section, in periods of the slowest mode: a belt may carry a body for long.
  integer, parameter, public :: longest_return = 256

contains

  !> Number of coordinates of a structure on the section: the speed that is zero there is none.
  pure integer function coordinates_at_turn(moving) result(n)
    type(multibody_motion_t), intent(in) :: moving
    n = coordinates_of_multibody(moving) - 1
  end function coordinates_at_turn

  !> A body with the coordinate `s` on the section.
  pure type(state_t) function body_at_turn(moving, s) result(state)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: s
    real(wp) :: motion(2)
    motion = motion_at_turn(moving%machine%turn, moving%machine%drive_frequency, s)
    state = start_state(moving, motion(1), motion(2), 0.0_wp)
  end function body_at_turn

  !> The coordinate of a body on the section.
  pure real(wp) function body_turn_point(moving, state) result(s)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    s = turn_coordinate(moving%machine%turn, moving%machine%drive_frequency, state%x, state%v)
  end function body_turn_point

  !> x and v for the coordinate `s` of the section of a body. `turn`: of an angle, 0 of a position; `frequency` is w [rad/s].
  pure function motion_at_turn(turn, frequency, s) result(motion)
    real(wp), intent(in) :: turn, frequency, s
    real(wp) :: motion(2)
    motion = [s, 0.0_wp]
    if (turn > 0 .and. abs(s) > turn/2) motion = [-sign(turn/2, s), sign(abs(s) - turn/2, s)*frequency]
  end function motion_at_turn

  !> The coordinate s of the section for x and v on it.
  pure real(wp) function turn_coordinate(turn, frequency, x, v) result(s)
    real(wp), intent(in) :: turn, frequency, x, v
    s = x
    if (is_over(turn, x, v)) s = sign(turn/2 + abs(v)/frequency, v)
  end function turn_coordinate

  pure logical function passes_half_turn(moving, state) result(passes)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    passes = is_over(moving%machine%turn, state%x, state%v)
  end function passes_half_turn

  !> Whether an angle is at half a turn and moves.
  pure logical function is_over(turn, x, v)
    real(wp), intent(in) :: turn, x, v
    is_over = turn > 0 .and. abs(x) >= turn/2 .and. abs(v) > 0
  end function is_over

  !> Moves a body to the section and starts the clock anew; `lasted` [s] is the time that it took. `reason` is
  !> `reason_time_over` where it does not come to the section.
  pure subroutine advance_body_to_turn(moving, state, lasted, tally, reason)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(inout) :: state
    real(wp), intent(out) :: lasted
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    real(wp) :: start, until
    start = state%time
    until = start + longest_return*moving%machine%period
    do
      call advance(moving, state, until, tally, reason, slip_speed=0.0_wp, matching_point=moving%machine%turn/2)
      if (reason /= 0) exit
      if (state%time >= until) reason = reason_time_over
      if (reason /= 0) exit
      if (passes_half_turn(moving, state)) then
        call move_turn(moving%machine%turn, sign(moving%machine%turn, state%v), state, tally)
        exit
      end if
      if (state%mode == mode_slip_minus) exit
    end do
    lasted = state%time - start
    state%time = 0
    call append_word(tally, word_period)
  end subroutine advance_body_to_turn

  !> A structure with the coordinates `point` on the section.
  pure type(multibody_state_t) function multibody_at_turn(moving, point) result(state)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    integer :: at
    at = watched_speed(moving)
    state = multibody_at(moving, [point(:at - 1), 0.0_wp, point(at:coordinates_of_multibody(moving) - 1)])
    state%phase(moving%section) = -1
    state%left(moving%section) = 1
  end function multibody_at_turn

  !> Coordinates of a structure on the section, zeros after the last.
  pure function multibody_turn_point(moving, state) result(point)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    real(wp) :: point(most_coordinates)
    point = multibody_point(moving, state)
    associate (at => watched_speed(moving))
      point(at:) = [point(at + 1:), 0.0_wp]
    end associate
  end function multibody_turn_point

  !> Moves a structure to the section, see `advance_to_turn`.
  pure subroutine advance_multibody_to_turn(moving, state, lasted, tally, reason)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(out) :: lasted
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance_to_turn(moving, longest_return*moving%machine%period, state, lasted, tally, reason)
  end subroutine advance_multibody_to_turn

  !> Sizes of the coordinates of a structure in a motion over `half_range` of the position.
  pure function scales_at_turn(moving, half_range) result(scales)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    scales = scales_of_multibody(moving, half_range)
    associate (at => watched_speed(moving))
      scales(at:) = [scales(at + 1:), 1.0_wp]
    end associate
  end function scales_at_turn

end module turn_section
