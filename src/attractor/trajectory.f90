! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One trajectory from its start to its label: a pure function of the machine, the frozen catalogue and
!> the start, so that a map does not depend on order, tile or rank.
module trajectory
  use attractors, only: attractor_t, features_t, find_box, regime_at_rest, regime_non_impact
  use capture, only: captor_of, stays_in_family
  use kinds, only: int64, wp
  use motion, only: motion_t
  use motion_features, only: features_over
  use motion_state, only: log_t, place_of, tally_t
  use strobe, only: advance_past_event, advance_strobe, advance_strobe_period, begin_tally, energy_now, record_end, &
    section_point, start_strobe, strobe_t
  use status, only: reason_settled, reason_time_over
  use turn_section, only: is_undriven
  implicit none
  private

  public :: run_trajectory, run_from_section, begin_course, begin_record, end_record, go_on, is_recorded, go_past_event, &
    go_to_stop, pass_stop, sections_ahead, ends_captured, conclude, fit_window

  type, public :: span_t
    !> Length of a trajectory and of the window at its end over which it is described [s].
    real(wp) :: duration = 50, window = 12.5_wp
    !> An uncaptured trajectory goes on up to this multiple of the duration.
    real(wp) :: extension = 4
    !> End at capture, described by the attractor; otherwise run the whole duration.
    logical :: stop_when_captured = .true.
    !> The window is to be a whole number of drive periods; see `fit_window`.
    logical :: whole_periods = .false.
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
    !> Events, and steps of flights that take them, until then.
    integer(int64) :: events = 0, steps = 0
  end type outcome_t

  !> Parts of a trajectory: up to the window, the window, and on until captured.
  integer, parameter, public :: phase_transient = 1, phase_window = 2, phase_extension = 3, phase_over = 4

  !> A trajectory under way. It moves from stop to stop: the stroboscopic sections, and the ends of its phases.
  type, extends(strobe_t), public :: course_t
    type(tally_t) :: tally
    integer :: phase = phase_transient
    !> Time since the start [s], up to the last stop.
    real(wp) :: elapsed = 0
    !> Where it stops next, and where it stopped last [s after the section].
    real(wp) :: until = 0, since = 0
    !> Counts before the last reset of the tally.
    integer(int64) :: impacts = 0
    real(wp) :: last_impact_speed = 0
    real(wp) :: grazing_margin = huge(1.0_wp)
    integer :: captured = 0
    integer :: reason = 0
  end type course_t

contains

  !> Runs from `x` [m], `v` [m/s], crank at `crank_angle` [rad]; `others`: see `start_strobe`. With `log` every event and
  !> sample of the duration is written down.
  pure subroutine run_trajectory(moving, catalogue, span, x, v, crank_angle, outcome, log, others)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: x, v, crank_angle
    type(outcome_t), intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    real(wp), intent(in), optional :: others(:)
    type(course_t) :: course
    if (present(others)) then
      call begin_course(moving, span, [x, v, crank_angle, others], course)
    else
      call begin_course(moving, span, [x, v, crank_angle], course)
    end if
    call run_course(moving, catalogue, span, course, outcome, log)
  end subroutine run_trajectory

  !> The same from a state on the section.
  pure subroutine run_from_section(moving, catalogue, span, strobe, outcome)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(strobe_t), intent(in) :: strobe
    type(outcome_t), intent(out) :: outcome
    type(course_t) :: course
    course%strobe_t = strobe
    call set_off(moving, span, course)
    call run_course(moving, catalogue, span, course, outcome)
  end subroutine run_from_section

  !> Runs a course that has been set off to its end.
  pure subroutine run_course(moving, catalogue, span, course, outcome, log)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    if (present(log)) call begin_record(moving, course, log)
    do while (is_recorded(course))
      call go_on(moving, catalogue, span, course, outcome, log)
    end do
    if (present(log)) call end_record(moving, span, course, log)
    do while (course%phase == phase_extension)
      call go_on(moving, catalogue, span, course, outcome)
    end do
    call conclude(moving, catalogue, course, outcome)
  end subroutine run_course

  !> The part of a course that is written down: all but the extension.
  pure logical function is_recorded(course)
    type(course_t), intent(in) :: course
    is_recorded = course%phase == phase_transient .or. course%phase == phase_window
  end function is_recorded

  !> To the next stop, with what is due there.
  pure subroutine go_on(moving, catalogue, span, course, outcome, log)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    logical :: slipped
    call go_to_stop(moving, course, slipped, log)
    call pass_stop(moving, catalogue, span, slipped, course, outcome)
  end subroutine go_on

  !> What a log holds of the state at the start of a course, and when its first sample is due.
  pure subroutine begin_record(moving, course, log)
    type(motion_t), intent(in) :: moving
    type(course_t), intent(in) :: course
    type(log_t), intent(inout) :: log
    log%book%at_start = energy_now(moving, course)
    log%origin = -course%state%time
    if (log%sample_interval > 0) log%next_sample = ceiling(course%state%time/log%sample_interval)
  end subroutine begin_record

  !> What a log holds of the state at the end of the duration.
  pure subroutine end_record(moving, span, course, log)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(course_t), intent(in) :: course
    type(log_t), intent(inout) :: log
    call record_end(moving, course, log%sample_interval > 0 .and. course%elapsed >= span%duration, log)
  end subroutine end_record

  !> A body set off from a `start` as `start_strobe` has it.
  pure subroutine begin_course(moving, span, start, course)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: start(:)
    type(course_t), intent(out) :: course
    course%strobe_t = start_strobe(moving, start)
    call set_off(moving, span, course)
  end subroutine begin_course

  !> Counts and the first stop of a course whose state is there.
  pure subroutine set_off(moving, span, course)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    call begin_tally(moving, course%strobe_t, course%tally)
    if (.not. span%duration - span%window > 0) call open_window(moving, course)
    call set_stop(moving, span, course)
  end subroutine set_off

  !> Moves to the next stop. `slipped` tells whether the body moved on the way.
  pure subroutine go_to_stop(moving, course, slipped, log)
    type(motion_t), intent(in) :: moving
    type(course_t), intent(inout) :: course
    logical, intent(out) :: slipped
    type(log_t), intent(inout), optional :: log
    integer(int64) :: slips
    slips = course%tally%slips
    if (course%until >= moving%machine%period) then
      call advance_strobe_period(moving, course, course%tally, course%reason, log)
    else
      call advance_strobe(moving, course, course%until, course%tally, course%reason, log)
    end if
    slipped = course%tally%slips > slips
  end subroutine go_to_stop

  !> Moves past an event, one body past a turn to a slip at `speed` [m/s] or faster, if that comes before the next stop.
  pure subroutine go_past_event(moving, speed, course)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: speed
    type(course_t), intent(inout) :: course
    call advance_past_event(moving, course, speed, course%until, course%tally, course%reason)
  end subroutine go_past_event

  !> Sections to come where nothing is due but the question whether the motion has been captured.
  pure integer function sections_ahead(moving, span, course)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(course_t), intent(in) :: course
    sections_ahead = 0
    if (course%until < moving%machine%period .or. course%since > 0) return
    ! One is left out in case that rounding shifts the last.
    sections_ahead = max(0, int((end_of_phase(span, course%phase) - course%elapsed)/moving%machine%period) - 2)
  end function sections_ahead

  !> Makes the window the nearest whole number of drive periods [s], at least one, that the duration holds, if it is to be so.
  pure subroutine fit_window(period, span)
    real(wp), intent(in) :: period
    type(span_t), intent(inout) :: span
    if (.not. span%whole_periods .or. span%duration < period) return
    span%window = min(max(1.0_wp, anint(span%window/period)), aint(span%duration/period))*period
  end subroutine fit_window

  !> Whether a course is over as soon as it is captured.
  pure logical function ends_captured(span, course)
    type(span_t), intent(in) :: span
    type(course_t), intent(in) :: course
    ends_captured = span%stop_when_captured .or. course%phase == phase_extension
  end function ends_captured

  !> What is due at a stop, the state being there: has the motion been captured, is a phase over, where to stop next.
  !> `slipped` tells whether the body moved since the last stop.
  pure subroutine pass_stop(moving, catalogue, span, slipped, course, outcome)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    logical, intent(in) :: slipped
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    real(wp) :: phase_end
    logical :: ended
    phase_end = end_of_phase(span, course%phase)
    if (course%reason == 0) then
      if (course%until >= moving%machine%period) then
        course%elapsed = course%elapsed + (moving%machine%period - course%since)
        call note_section(moving, catalogue, slipped .or. course%since > 0, course, outcome)
      else
        course%elapsed = phase_end
      end if
    end if
    ended = course%reason /= 0 .or. (course%captured > 0 .and. ends_captured(span, course))
    if (.not. ended .and. course%phase == phase_extension) then
      ended = stays_in_family(moving, catalogue, course, course%tally)
    end if
    if (ended .or. course%elapsed >= phase_end) call end_phase(moving, span, size(catalogue) > 0, ended, course, outcome)
    if (course%phase /= phase_over) call set_stop(moving, span, course)
  end subroutine pass_stop

  !> Time since the start at which a phase ends [s].
  pure real(wp) function end_of_phase(span, phase)
    type(span_t), intent(in) :: span
    integer, intent(in) :: phase
    select case (phase)
    case (phase_transient)
      end_of_phase = span%duration - span%window
    case (phase_window)
      end_of_phase = span%duration
    case default
      end_of_phase = span%extension*span%duration
    end select
  end function end_of_phase

  !> Where the course stops next. In the extension only at sections.
  pure subroutine set_stop(moving, span, course)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(course_t), intent(inout) :: course
    real(wp) :: left
    course%since = course%state%time
    course%until = moving%machine%period
    left = end_of_phase(span, course%phase) - course%elapsed
    if (course%phase == phase_extension .or. moving%machine%period - course%since <= left) return
    course%until = course%since + left
  end subroutine set_stop

  !> On the section: captured, and since when?
  pure subroutine note_section(moving, catalogue, slipped, course, outcome)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    logical, intent(in) :: slipped
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    course%captured = captor_of(moving, catalogue, course, slipped)
    if (course%captured == 0) then
      outcome%settle_time = -1
    else if (outcome%settle_time < 0) then
      outcome%settle_time = course%elapsed
    end if
  end subroutine note_section

  !> The phase is over, or with `ended` the course is. An uncaptured motion goes on if there is anything to be captured by.
  pure subroutine end_phase(moving, span, can_be_captured, ended, course, outcome)
    type(motion_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    logical, intent(in) :: can_be_captured, ended
    type(course_t), intent(inout) :: course
    type(outcome_t), intent(inout) :: outcome
    select case (course%phase)
    case (phase_transient)
      if (ended) call note_state(course, outcome)
      if (.not. ended) call open_window(moving, course)
    case (phase_window)
      outcome%window = features_over(moving, course%tally, span%window/moving%machine%period)
      if (outcome%window%regime == regime_non_impact .and. in_balance(moving, course)) outcome%window%regime = regime_at_rest
      call note_state(course, outcome)
      course%phase = merge(phase_over, phase_extension, ended .or. course%captured > 0 .or. .not. can_be_captured)
      course%tally%wants_v_max = .false.
    case default
      course%phase = phase_over
    end select
    if (ended) course%phase = phase_over
  end subroutine end_phase

  !> Whether the body has not moved, nor will it: nothing holds it, but no force is left.
  pure logical function in_balance(moving, course)
    type(motion_t), intent(in) :: moving
    type(course_t), intent(in) :: course
    in_balance = is_undriven(moving) .and. .not. abs(course%state%v) > 0 .and. .not. course%tally%x_max > course%tally%x_min
  end function in_balance

  !> State and counts where the course is now.
  pure subroutine note_state(course, outcome)
    type(course_t), intent(in) :: course
    type(outcome_t), intent(inout) :: outcome
    outcome%x = place_of(course%state)
    outcome%v = course%state%v
    outcome%impacts = course%impacts + course%tally%impacts
    outcome%events = course%tally%events
    outcome%steps = course%tally%steps
    outcome%last_impact_speed = latest_impact_speed(course)
  end subroutine note_state

  !> Starts the statistics window.
  pure subroutine open_window(moving, course)
    type(motion_t), intent(in) :: moving
    type(course_t), intent(inout) :: course
    course%phase = phase_window
    course%impacts = course%impacts + course%tally%impacts
    course%last_impact_speed = latest_impact_speed(course)
    course%grazing_margin = min(course%grazing_margin, course%tally%grazing_margin)
    course%tally%wants_v_max = .true.
    call begin_tally(moving, course%strobe_t, course%tally)
  end subroutine open_window

  pure real(wp) function latest_impact_speed(course) result(speed)
    type(course_t), intent(in) :: course
    speed = course%last_impact_speed
    if (course%tally%impacts > 0) speed = course%tally%last_impact_speed
  end function latest_impact_speed

  !> Reason, label and features of a finished course.
  pure subroutine conclude(moving, catalogue, course, outcome)
    type(motion_t), intent(in) :: moving
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
      box = 0
      if (size(catalogue) > 0) box = find_box(catalogue, section_point(moving, course), outcome%window%regime)
      outcome%features = outcome%window
      if (box > 0) then
        outcome%attractor = catalogue(box)%id
        ! The window happened to be without some of the events of a motion that is not periodic.
        if (catalogue(box)%features%regime /= outcome%window%regime) outcome%features = catalogue(box)%features
      end if
      outcome%features%word = 0
      outcome%features%grazing_margin = margin
    end if
  end subroutine conclude

end module trajectory
