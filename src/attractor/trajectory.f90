! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One trajectory from its start to its label: a pure function of the machine, the frozen catalogue and
!> the start, so that a map does not depend on order, tile or rank.
module trajectory
  use attractors, only: attractor_t, features_t, find_box, find_capture, regime_at_rest, regime_of, &
    regime_stuck
  use energy, only: energy_of_body
  use kinds, only: int64, wp
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: log_t, record_sample, reset_tally, state_t, tally_t
  use pair_flight, only: body_state
  use pair_trajectory, only: pair_course_t, run_pair
  use status, only: reason_settled, reason_time_over
  implicit none
  private

  public :: run_trajectory

  type, public :: span_t
    !> Length of a trajectory and of the window at its end over which it is described [s].
    real(wp) :: duration = 50, window = 12.5_wp
    !> An uncaptured trajectory goes on up to this multiple of the duration.
    real(wp) :: extension = 4
    !> End at capture, described by the attractor; otherwise run the whole duration.
    logical :: stop_when_captured = .true.
  end type span_t

  type, public :: outcome_t
    !> Code of module `status`.
    integer :: reason = 0
    !> Label of the attractor, 0 = none, and its period in drive periods.
    integer :: attractor = 0, period = 0
    !> Of the attractor once captured, else of the window.
    type(features_t) :: features
    !> Of the window at the end of the duration; empty if the trajectory ended before.
    type(features_t) :: window
    !> From the start to capture [s]; negative if not captured.
    real(wp) :: settle_time = -1
    !> State at the end of the duration, or where the trajectory ended.
    real(wp) :: x = 0, v = 0
    integer(int64) :: impacts = 0
    real(wp) :: last_impact_speed = 0
  end type outcome_t

  !> A trajectory under way.
  type :: course_t
    type(state_t) :: state
    type(tally_t) :: tally
    !> Time since the start [s].
    real(wp) :: elapsed = 0
    !> Counts before the last reset of the tally.
    integer(int64) :: impacts = 0, slips = 0
    real(wp) :: last_impact_speed = 0
    real(wp) :: grazing_margin = huge(1.0_wp)
    integer :: captured = 0
    integer :: reason = 0
  end type course_t

contains

  !> Runs from `x` [m], `v` [m/s], crank at `crank_angle` [rad]. With `log` every event and sample of the
  !> duration is written down.
  pure subroutine run_trajectory(moving, catalogue, span, x, v, crank_angle, outcome, log)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: x, v, crank_angle
    type(outcome_t), intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(course_t) :: course
    if (allocated(moving%pair)) then
      call run_two_bodies(moving, span, x, v, crank_angle, outcome, log)
      return
    end if
    course%state = start_state(moving, x, v, crank_angle)
    if (present(log)) then
      log%book%at_start = energy_of_body(moving%machine, course%state)
      log%origin = -course%state%time
      if (log%sample_interval > 0) log%next_sample = ceiling(course%state%time/log%sample_interval)
    end if
    call reset_tally(course%tally, course%state)
    call run_until(moving, catalogue, span, course, span%duration - span%window, outcome, log)
    if (ended(course, span)) then
      call note_state(course, outcome)
      call conclude(catalogue, course, outcome)
      return
    end if
    call open_window(course)
    call run_until(moving, catalogue, span, course, span%duration, outcome, log)
    outcome%window = regime_of(course%tally, span%window/moving%machine%period)
    call note_state(course, outcome)
    if (present(log)) then
      log%book%at_end = energy_of_body(moving%machine, course%state)
      if (log%sample_interval > 0) call record_sample(log, course%state)
    end if
    if (course%reason == 0 .and. course%captured == 0 .and. size(catalogue) > 0) then
      call wait_for_capture(moving, catalogue, span, course, outcome)
    end if
    call conclude(catalogue, course, outcome)
  end subroutine run_trajectory

  !> The same for two bodies, which no attractor captures.
  pure subroutine run_two_bodies(moving, span, x, v, angle, outcome, log)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: x, v, angle
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    type(pair_course_t) :: course
    type(state_t) :: body
    call run_pair(moving%pair, span%duration, span%window, x, v, angle, course, log)
    body = body_state(course%state)
    outcome%x = body%x
    outcome%v = body%v
    outcome%impacts = course%impacts
    outcome%last_impact_speed = course%last_impact_speed
    outcome%reason = merge(course%reason, reason_time_over, course%reason /= 0)
    if (course%reason /= 0) return
    outcome%window = regime_of(course%tally, span%window/moving%machine%period)
    if (outcome%window%regime == regime_at_rest) outcome%window%regime = regime_stuck
    outcome%features = outcome%window
    outcome%features%word = 0
  end subroutine run_two_bodies

  !> State and counts where the course is now.
  pure subroutine note_state(course, outcome)
    type(course_t), intent(in) :: course
    type(outcome_t), intent(inout) :: outcome
    outcome%x = course%state%x
    outcome%v = course%state%v
    outcome%impacts = course%impacts + course%tally%impacts
    outcome%last_impact_speed = latest_impact_speed(course)
  end subroutine note_state

  pure logical function ended(course, span)
    type(course_t), intent(in) :: course
    type(span_t), intent(in) :: span
    ended = course%reason /= 0 .or. (course%captured > 0 .and. span%stop_when_captured)
  end function ended

  !> Moves on to a time since the start, looking at every stroboscopic section on the way.
  pure subroutine run_until(moving, catalogue, span, course, time_end, outcome, log)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    real(wp), intent(in) :: time_end
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    do while (course%elapsed < time_end)
      if (course%elapsed + (moving%machine%period - course%state%time) > time_end) then
        call advance(moving, course%state, course%state%time + (time_end - course%elapsed), course%tally, &
                     course%reason, log)
        course%elapsed = time_end
        return
      end if
      call run_to_section(moving, catalogue, course, outcome, log)
      if (ended(course, span)) return
    end do
  end subroutine run_until

  !> Goes on after the duration, section by section, until captured or the extension is over.
  pure subroutine wait_for_capture(moving, catalogue, span, course, outcome)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    do
      call run_to_section(moving, catalogue, course, outcome)
      if (course%reason /= 0 .or. course%captured > 0) return
      if (course%elapsed >= span%extension*span%duration) return
    end do
  end subroutine wait_for_capture

  !> To the next stroboscopic section: has the motion been captured there?
  pure subroutine run_to_section(moving, catalogue, course, outcome, log)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    real(wp) :: start
    integer(int64) :: slips_before
    start = course%state%time
    slips_before = course%slips + course%tally%slips
    call advance_period(moving, course%state, course%tally, course%reason, log)
    course%elapsed = course%elapsed + (moving%machine%period - start)
    if (course%reason /= 0) return
    course%captured = find_capture(catalogue, course%state, start > 0 .or. &
                                   course%slips + course%tally%slips > slips_before)
    if (course%captured == 0) then
      outcome%settle_time = -1
    else if (outcome%settle_time < 0) then
      outcome%settle_time = course%elapsed
    end if
  end subroutine run_to_section

  !> Starts the statistics window.
  pure subroutine open_window(course)
    type(course_t), intent(inout) :: course
    course%impacts = course%impacts + course%tally%impacts
    course%slips = course%slips + course%tally%slips
    course%last_impact_speed = latest_impact_speed(course)
    course%grazing_margin = min(course%grazing_margin, course%tally%grazing_margin)
    course%tally%wants_v_max = .true.
    call reset_tally(course%tally, course%state)
  end subroutine open_window

  pure real(wp) function latest_impact_speed(course) result(speed)
    type(course_t), intent(in) :: course
    speed = course%last_impact_speed
    if (course%tally%impacts > 0) speed = course%tally%last_impact_speed
  end function latest_impact_speed

  !> Reason, label and features of a finished course.
  pure subroutine conclude(catalogue, course, outcome)
    type(attractor_t), intent(in) :: catalogue(:)
    type(course_t), intent(in) :: course
    type(outcome_t), intent(inout) :: outcome
    real(wp) :: margin
    integer :: box
    if (course%reason /= 0) then
      outcome%reason = course%reason
      return
    end if
    margin = min(course%grazing_margin, course%tally%grazing_margin)
    if (course%captured > 0) then
      outcome%reason = reason_settled
      outcome%attractor = catalogue(course%captured)%id
      outcome%period = catalogue(course%captured)%period
      outcome%features = catalogue(course%captured)%features
      outcome%features%grazing_margin = min(margin, outcome%features%grazing_margin)
    else
      outcome%reason = reason_time_over
      box = find_box(catalogue, course%state, outcome%window%regime)
      if (box > 0) outcome%attractor = catalogue(box)%id
      outcome%features = outcome%window
      outcome%features%word = 0
      outcome%features%grazing_margin = margin
    end if
  end subroutine conclude

end module trajectory
