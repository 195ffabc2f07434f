! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What `separatrix trajectory` reports of a motion at its end: of drive periods only where there is a drive, of impacts only where
!> there is something to hit.
module trajectory_report
  use angle_units, only: unit_of
  use attractors, only: attractor_t, features_t, kind_rest, regime_names
  use crank_report, only: report_crank
  use kinds, only: wp
  use machine_type, only: machine_t
  use motion_state, only: log_t, options_t
  use restoring_law, only: position_is_angle
  use session, only: session_t
  use status, only: is_given_up, reason_event_budget, reason_left_domain, reason_name, reason_time_over
  use text, only: to_text
  use single_trajectory, only: outcome_t, span_t
  implicit none
  private

  public :: report, counted_over, explained, ended_after

contains

  !> Two lines: the steady motion, and how the run ended.
  subroutine report(session, moving, span, outcome, cycle, log)
    type(session_t), intent(inout) :: session
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(outcome_t), intent(in) :: outcome
    type(attractor_t), intent(in) :: cycle
    type(log_t), intent(in) :: log
    associate (f => outcome%window, journal => session%journal, is_angle => position_is_angle(session%the_case%laws))
      if (outcome%reason /= reason_time_over) then
        call journal%line('end', trim(merge('given up', 'ended   ', is_given_up(outcome%reason)))//' before the end: '// &
          explained(outcome%reason)//' after '//to_text(ended_after(moving, outcome%reason, log), 6)//' s; '// &
          to_text(log%events)//' events recorded until then')
        return
      end if
      call journal%line('steady', trim(regime_names(f%regime))//': amplitude '//to_text(f%amplitude, 6)// &
        ' '//unit_of('m', is_angle)//', v_max '//to_text(f%v_max, 6)//' '//unit_of('m/s', is_angle)// &
        impacts_text(moving, span, f, cycle, is_angle)//' ('//taken_over(moving, span, cycle)//')', &
        '"amplitude": '//to_text(f%amplitude)//', "v_max": '// &
        to_text(f%v_max)//', "impacts_per_period": '//to_text(f%impacts_per_period)// &
        ', "mean_impact_speed": '//to_text(f%mean_impact_speed))
      call report_crank(journal, session%the_case%laws, span%window, log)
      call journal%line('end', to_text(log%events)//' events, '//to_text(log%samples)//' samples, '// &
        name_of_period(moving)//' '// &
        to_text(moving%period, 6)//' s, ended as '//reason_name(outcome%reason))
    end associate
  end subroutine report

  !> What the time between two sections is.
  pure function name_of_period(moving) result(name)
    class(machine_t), intent(in) :: moving
    character(len=:), allocatable :: name
    name = 'unit of time'
    if (moving%has_mode()) name = 'period of the slowest mode'
    if (moving%has_drive_period) name = 'drive period'
    if (.not. moving%timed) name = 'turn without load'
  end function name_of_period

  !> When a motion ended [s], to the distance of two samples: as far as it is recorded, or where it left the domain.
  pure real(wp) function ended_after(moving, reason, log) result(time)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: reason
    type(log_t), intent(in) :: log
    type(options_t) :: options
    integer :: i
    time = 0
    options = moving%options()
    if (log%samples > 0) time = log%sample_data(1, log%samples)
    if (log%events > 0) time = max(time, log%event_data(1, log%events))
    if (reason /= reason_left_domain) return
    do i = log%samples, 1, -1
      if (abs(log%sample_data(2, i)) <= options%domain) exit
      time = log%sample_data(1, i)
    end do
  end function ended_after

  !> ', 1.0 impacts per period at 0.2 m/s', of a machine that has something to hit; without a drive, or in less than a period of
  !> it, per second.
  pure function impacts_text(moving, span, features, cycle, is_angle) result(text)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(features_t), intent(in) :: features
    type(attractor_t), intent(in) :: cycle
    logical, intent(in) :: is_angle
    character(len=:), allocatable :: text
    text = ''
    if (.not. moving%has_stops) return
    if (moving%has_drive_period .and. .not. is_short(moving, span)) then
      text = ', '//to_text(features%impacts_per_period, 5)//' impacts per period'
    else
      text = ', '//to_text(features%impacts_per_period/counted_over(moving, cycle), 5)//' impacts per second'
    end if
    text = text//' at '//to_text(features%mean_impact_speed, 6)//' '//unit_of('m/s', is_angle)
  end function impacts_text

  !> The time [s] for which `impacts_per_period` stands: of a limit cycle, one of its returns.
  pure real(wp) function counted_over(moving, cycle) result(time)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: cycle
    time = moving%period
    if (cycle%by_event .and. cycle%period > 0 .and. cycle%duration > 0) time = cycle%duration/cycle%period
  end function counted_over

  !> Whether a run holds no period of the drive.
  pure logical function is_short(moving, span)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    is_short = span%duration < moving%period
  end function is_short

  !> What steady values are taken over.
  pure function taken_over(moving, span, cycle) result(text)
    class(machine_t), intent(in) :: moving
    type(span_t), intent(in) :: span
    type(attractor_t), intent(in) :: cycle
    character(len=:), allocatable :: text
    if (cycle%period > 0) then
      text = 'over its cycle of period '//to_text(cycle%period)
      if (.not. moving%has_drive_period) text = 'over its cycle of '//to_text(cycle%period*moving%period, 6)//' s'
      if (cycle%by_event) text = 'over its limit cycle of '//to_text(cycle%duration, 10)//' s'
      if (cycle%kind == kind_rest .and. .not. moving%has_drive_period) text = 'at rest'
      if (cycle%kind == kind_rest .and. .not. cycle%rests) text = 'at its equilibrium'
    else if (span%whole_periods .and. moving%has_drive_period .and. .not. is_short(moving, span)) then
      text = 'last '//to_text(nint(span%window/moving%period))//' drive periods'
      if (.not. moving%timed) text = 'last '//to_text(span%window, 6)//' s'
    else
      text = 'last '//to_text(span%window, 6)//' s'
    end if
  end function taken_over

  !> The reason, and what counts where that is not plain.
  pure function explained(reason) result(text)
    integer, intent(in) :: reason
    character(len=:), allocatable :: text
    text = reason_name(reason)
    if (reason == reason_event_budget) text = text//' (flights count, not only impacts; raise integrator.event_budget)'
  end function explained

end module trajectory_report
