! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One trajectory from its start to its label: a pure function of the machine, the frozen catalogue and
!> the start, so that a map does not depend on order, tile or rank.
module single_trajectory
  use attractors, only: attractor_t, features_t, find_box, regime_at_rest, regime_non_impact
  use capture, only: attractor_reached, stays_in_family
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use motion_features, only: features_over
  use motion_state, only: log_t, position_of, tally_t
  use status, only: reason_settled, reason_time_over
  implicit none
  private

  public :: run_trajectory, run_from_section, begin_trajectory, begin_record, end_record, go_on, is_recorded, go_past_event, &
    go_to_stop, pass_stop, sections_ahead, end_of_phase, ends_converged, conclude, fit_window

  type, public :: span_t
    !> Length of a trajectory and of the window at its end over which it is described [s].
    real(wp) :: duration = 50, window = 12.5_wp
    !> A trajectory that has not converged goes on up to this multiple of the duration.
    real(wp) :: extension = 4
    !> End at convergence, described by the attractor; otherwise run the whole duration.
    logical :: stop_when_converged = .true.
    !> The window is to be a whole number of drive periods; see `fit_window`.
    logical :: whole_periods = .false.
  end type span_t

  type, public :: outcome_t
    !> Code of module `status`.
    integer :: reason = 0
    !> Label of the attractor, 0 = none, and its period in drive periods.
    integer :: attractor = 0, period = 0
    !> Of the attractor once converged, else of the window.
    type(features_t) :: features
    !> Of the window at the end of the duration; empty if the trajectory ended before.
    type(features_t) :: window
    !> From the start to convergence [s]; negative if not converged.
    real(wp) :: settle_time = -1
    !> State at the end of the duration, or where the trajectory ended.
    real(wp) :: x = 0, v = 0
    integer(int64) :: impacts = 0
    real(wp) :: last_impact_speed = 0
    !> Events, and steps of flights that take them, until then.
    integer(int64) :: events = 0, steps = 0
    !> Of a motor there: crank angle [rad] and speed [rad/s], current [A] or integral [rad].
    real(wp) :: crank(3) = 0
  end type outcome_t

  !> Parts of a trajectory: up to the window, the window, and on until converged.
  integer, parameter, public :: phase_transient = 1, phase_window = 2, phase_extension = 3, phase_over = 4

  !> A trajectory under way. It moves from stop to stop: the stroboscopic sections, and the ends of its phases.
  type, extends(section_state_t), public :: trajectory_state_t
    type(tally_t) :: tally
    integer :: phase = phase_transient
    !> Time since the start [s], up to the last stop.
    real(wp) :: elapsed = 0
    !> Where it stops next, and where it stopped last [s after the section].
    real(wp) :: until = 0, since = 0
    !> Counts before the last reset of the tally.
    integer(int64) :: impacts = 0
    real(wp) :: last_impact_speed = 0, grazing_margin = huge(1.0_wp)
    integer :: converged = 0, reason = 0
  end type trajectory_state_t

contains

  !> Runs from a start, see `machine_t`. With `log` every event and sample of the duration is written down.
  pure subroutine run_trajectory(moving, catalogue, span, start, outcome, log)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: start(:)
    type(outcome_t), intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(trajectory_state_t) :: trajectory
    call begin_trajectory(moving, span, start, trajectory)
    call continue_trajectory(moving, catalogue, span, trajectory, outcome, log)
  end subroutine run_trajectory

  !> The same from a state on the section.
  pure subroutine run_from_section(moving, catalogue, span, section, outcome)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(section_state_t), intent(in) :: section
    type(outcome_t), intent(out) :: outcome
    type(trajectory_state_t) :: trajectory
    trajectory%section_state_t = section
    call set_off(moving, span, trajectory)
    call continue_trajectory(moving, catalogue, span, trajectory, outcome)
  end subroutine run_from_section

  !> Runs a started trajectory to its end.
  pure subroutine continue_trajectory(moving, catalogue, span, trajectory, outcome, log)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(inout) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    if (present(log)) call begin_record(moving, span, trajectory, log)
    do while (is_recorded(trajectory))
      call go_on(moving, catalogue, span, trajectory, outcome, log)
    end do
    if (present(log)) call end_record(moving, span, trajectory, log)
    do while (trajectory%phase == phase_extension)
      call go_on(moving, catalogue, span, trajectory, outcome)
    end do
    call conclude(moving, catalogue, trajectory, outcome)
  end subroutine continue_trajectory

  !> The part of a trajectory that is written down: all but the extension.
  pure logical function is_recorded(trajectory)
    type(trajectory_state_t), intent(in) :: trajectory
    is_recorded = trajectory%phase == phase_transient .or. trajectory%phase == phase_window
  end function is_recorded

  !> To the next stop, with what is due there.
  pure subroutine go_on(moving, catalogue, span, trajectory, outcome, log)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(inout) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    type(log_t), intent(inout), optional :: log
    logical :: slipped
    call go_to_stop(moving, trajectory, slipped, log)
    call pass_stop(moving, catalogue, span, slipped, trajectory, outcome)
  end subroutine go_on

  !> What a log holds of the state at the start of a trajectory, and when its first sample is due.
  pure subroutine begin_record(moving, span, trajectory, log)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(in) :: trajectory
    type(log_t), intent(inout) :: log
    integer :: i
    log%balance%at_start = moving%energy(trajectory)
    log%origin = -trajectory%state%time
    if (.not. log%sample_interval > 0) return
    log%next_sample = ceiling(trajectory%state%time/log%sample_interval)
    ! Sections do not come at given times: neither do the times of samples begin anew there.
    if (.not. moving%timed) log%instants = [(i*log%sample_interval, i=0, int(span%duration/log%sample_interval))]
  end subroutine begin_record

  !> What a log holds of the state at the end of the duration.
  pure subroutine end_record(moving, span, trajectory, log)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(in) :: trajectory
    type(log_t), intent(inout) :: log
    call moving%record_end(trajectory, log%sample_interval > 0 .and. trajectory%elapsed >= span%duration, log)
  end subroutine end_record

  !> The trajectory of a body from `start` (see `machine_t`).
  pure subroutine begin_trajectory(moving, span, start, trajectory)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    real(wp), intent(in) :: start(:)
    type(trajectory_state_t), intent(out) :: trajectory
    call moving%start(start, trajectory%section_state_t)
    call set_off(moving, span, trajectory)
  end subroutine begin_trajectory

  !> Counts and the first stop of a trajectory whose state is there.
  pure subroutine set_off(moving, span, trajectory)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(inout) :: trajectory
    call moving%begin_tally(trajectory%section_state_t, trajectory%tally)
    if (.not. span%duration - span%window > 0) call open_window(moving, trajectory)
    call set_stop(moving, span, trajectory)
  end subroutine set_off

  !> Moves to the next stop. `slipped`: whether the body moved on the way.
  pure subroutine go_to_stop(moving, trajectory, slipped, log)
    class(machine_t), intent(in) :: moving
    type(trajectory_state_t), intent(inout) :: trajectory
    logical, intent(out) :: slipped
    type(log_t), intent(inout), optional :: log
    integer(int64) :: slips
    slips = trajectory%tally%slips
    if (moving%timed .and. trajectory%until >= moving%period) then
      call moving%advance_to_section(trajectory, trajectory%tally, trajectory%reason, log)
    else
      call moving%advance(trajectory, trajectory%until, trajectory%tally, trajectory%reason, log)
    end if
    slipped = trajectory%tally%slips > slips
  end subroutine go_to_stop

  !> Moves past an event, one body past a turn to a slip at `speed` [m/s] or faster, if that comes before the next stop.
  pure subroutine go_past_event(moving, speed, trajectory)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: speed
    type(trajectory_state_t), intent(inout) :: trajectory
    call moving%advance_past_event(trajectory, speed, trajectory%until, trajectory%tally, trajectory%reason)
  end subroutine go_past_event

  !> Sections to come where only convergence has to be checked.
  pure integer function sections_ahead(moving, span, trajectory)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(in) :: trajectory
    sections_ahead = 0
    if (.not. moving%timed .or. trajectory%until < moving%period .or. trajectory%since > 0) return
    ! One is left out in case that rounding shifts the last.
    sections_ahead = max(0, int((end_of_phase(span, trajectory%phase) - trajectory%elapsed)/moving%period) - 2)
  end function sections_ahead

  !> Makes the window the nearest whole number of drive periods [s], at least one, that the duration holds, if it is to be so.
  pure subroutine fit_window(period, span)
    real(wp), intent(in) :: period
    type(span_t), intent(inout) :: span
    if (.not. span%whole_periods .or. span%duration < period) return
    span%window = min(max(1.0_wp, anint(span%window/period)), aint(span%duration/period))*period
  end subroutine fit_window

  !> Whether a trajectory ends as soon as it has converged.
  pure logical function ends_converged(span, trajectory)
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(in) :: trajectory
    ends_converged = span%stop_when_converged .or. trajectory%phase == phase_extension
  end function ends_converged

  !> What is due at a stop, the state being there: has the motion converged, is a phase over, where to stop next. `slipped`:
  !> whether the body moved since the last stop.
  pure subroutine pass_stop(moving, catalogue, span, slipped, trajectory, outcome)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(span_t), intent(in) :: span
    logical, intent(in) :: slipped
    type(trajectory_state_t), intent(inout) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    real(wp) :: phase_end
    logical :: ended
    phase_end = end_of_phase(span, trajectory%phase)
    if (trajectory%reason == 0) then
      if (.not. moving%timed) then
        trajectory%elapsed = merge(trajectory%elapsed + (trajectory%lasted - trajectory%since), phase_end, trajectory%passed)
        if (trajectory%passed .or. moving%bound_to_rest(trajectory)) then
          call note_section(moving, catalogue, slipped .or. trajectory%since > 0, trajectory, outcome)
        end if
      else if (trajectory%until >= moving%period) then
        trajectory%elapsed = trajectory%elapsed + (moving%period - trajectory%since)
        call note_section(moving, catalogue, slipped .or. trajectory%since > 0, trajectory, outcome)
      else
        trajectory%elapsed = phase_end
      end if
    end if
    ended = trajectory%reason /= 0 .or. (trajectory%converged > 0 .and. ends_converged(span, trajectory))
    if (.not. ended .and. trajectory%phase == phase_extension) then
      ended = stays_in_family(moving, catalogue, trajectory, trajectory%tally)
    end if
    if (ended .or. trajectory%elapsed >= phase_end) call end_phase(moving, span, size(catalogue) > 0, ended, trajectory, outcome)
    if (trajectory%phase /= phase_over) call set_stop(moving, span, trajectory)
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

  !> Where the trajectory stops next. In the extension only at sections.
  pure subroutine set_stop(moving, span, trajectory)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(trajectory_state_t), intent(inout) :: trajectory
    real(wp) :: left
    trajectory%since = trajectory%state%time
    trajectory%until = moving%period
    left = end_of_phase(span, trajectory%phase) - trajectory%elapsed
    if (moving%timed .and. (trajectory%phase == phase_extension .or. moving%period - trajectory%since <= left)) return
    trajectory%until = trajectory%since + left
  end subroutine set_stop

  !> On the section: converged, and since when?
  pure subroutine note_section(moving, catalogue, slipped, trajectory, outcome)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    logical, intent(in) :: slipped
    type(trajectory_state_t), intent(inout) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    ! While a ramp goes on, the machine is not yet that of the attractors.
    trajectory%converged = 0
    if (.not. trajectory%motor%ramps) trajectory%converged = attractor_reached(moving, catalogue, trajectory, slipped)
    if (trajectory%converged == 0) then
      outcome%settle_time = -1
    else if (outcome%settle_time < 0) then
      outcome%settle_time = trajectory%elapsed - merge(0.0_wp, trajectory%state%time - trajectory%motor%held_since, &
                                                       moving%timed .or. trajectory%passed)
    end if
  end subroutine note_section

  !> The phase is over, or with `ended` the trajectory is. A motion that has not converged goes on if there are attractors.
  pure subroutine end_phase(moving, span, can_converge, ended, trajectory, outcome)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    logical, intent(in) :: can_converge, ended
    type(trajectory_state_t), intent(inout) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    select case (trajectory%phase)
    case (phase_transient)
      if (ended) call note_state(trajectory, outcome)
      if (.not. ended) call open_window(moving, trajectory)
    case (phase_window)
      outcome%window = features_over(moving, trajectory%tally, span%window/moving%period)
      if (outcome%window%regime == regime_non_impact .and. in_balance(moving, trajectory)) outcome%window%regime = regime_at_rest
      call note_state(trajectory, outcome)
      trajectory%phase = merge(phase_over, phase_extension, ended .or. trajectory%converged > 0 .or. .not. can_converge)
      trajectory%tally%needs_v_max = .false.
    case default
      trajectory%phase = phase_over
    end select
    if (ended) trajectory%phase = phase_over
  end subroutine end_phase

  !> Whether the body has not moved, nor will it: nothing holds it, but no force is left.
  pure logical function in_balance(moving, trajectory)
    class(machine_t), intent(in) :: moving
    type(trajectory_state_t), intent(in) :: trajectory
    in_balance = moving%undriven .and. .not. abs(trajectory%state%v) > 0 .and. &
      .not. trajectory%tally%x_max > trajectory%tally%x_min
  end function in_balance

  !> State and counts where the trajectory is now.
  pure subroutine note_state(trajectory, outcome)
    type(trajectory_state_t), intent(in) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    outcome%x = position_of(trajectory%state)
    outcome%v = trajectory%state%v
    outcome%crank = [trajectory%motor%phi, trajectory%motor%w, trajectory%motor%own(1)]
    outcome%impacts = trajectory%impacts + trajectory%tally%impacts
    outcome%events = trajectory%tally%events
    outcome%steps = trajectory%tally%steps
    outcome%last_impact_speed = latest_impact_speed(trajectory)
  end subroutine note_state

  !> Starts the statistics window.
  pure subroutine open_window(moving, trajectory)
    class(machine_t), intent(in) :: moving
    type(trajectory_state_t), intent(inout) :: trajectory
    trajectory%phase = phase_window
    trajectory%impacts = trajectory%impacts + trajectory%tally%impacts
    trajectory%last_impact_speed = latest_impact_speed(trajectory)
    trajectory%grazing_margin = min(trajectory%grazing_margin, trajectory%tally%grazing_margin)
    trajectory%tally%needs_v_max = .true.
    call moving%begin_tally(trajectory%section_state_t, trajectory%tally)
  end subroutine open_window

  pure real(wp) function latest_impact_speed(trajectory) result(speed)
    type(trajectory_state_t), intent(in) :: trajectory
    speed = trajectory%last_impact_speed
    if (trajectory%tally%impacts > 0) speed = trajectory%tally%last_impact_speed
  end function latest_impact_speed

  !> Reason, label and features of a finished trajectory.
  pure subroutine conclude(moving, catalogue, trajectory, outcome)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(trajectory_state_t), intent(in) :: trajectory
    type(outcome_t), intent(inout) :: outcome
    real(wp) :: margin
    integer :: box
    if (trajectory%reason /= 0) then
      outcome%reason = trajectory%reason
      return
    end if
    margin = min(trajectory%grazing_margin, trajectory%tally%grazing_margin)
    if (trajectory%converged > 0) then
      outcome%reason = reason_settled
      outcome%attractor = catalogue(trajectory%converged)%id
      outcome%period = catalogue(trajectory%converged)%period
      outcome%features = catalogue(trajectory%converged)%features
      outcome%features%grazing_margin = min(margin, outcome%features%grazing_margin)
    else
      outcome%reason = reason_time_over
      box = 0
      if (size(catalogue) > 0) box = find_box(catalogue, moving%point_of(trajectory), outcome%window%regime)
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

end module single_trajectory
