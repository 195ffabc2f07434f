! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the crank of a motor does over a while, from the samples of a log: speed, torque, power and its shares, and the outcome of
!> a run-up.
module crank_summary
  use constants, only: two_pi
  use elementary, only: sine_cosine
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use motion_state, only: event_impact_lower, event_impact_upper, log_t
  use motor_choices, only: number_of_family, resonance_of, speed_of
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: crank_values, no_summary, summarize_crank

  !> Outcomes of a run-up.
  integer, parameter, public :: crank_not_known = 0, crank_stalled = 1, crank_rocking = 2, crank_reversed = 3, crank_turning = 4, &
    crank_captured = 5, crank_passed = 6, last_crank_outcome = 6
  character(len=*), parameter, public :: crank_outcomes(0:last_crank_outcome) = [character(len=9) :: 'not_known', 'stalled', &
    'rocking', 'reversed', 'turning', 'captured', 'passed']

  !> Cosine of the phase between drive and body below which it is not clear on which side of a resonance the motion is.
  real(wp), parameter :: clear_phase = 0.2_wp
  !> A crank is at rest that turns no faster than this share of its speed without load.
  real(wp), parameter :: at_rest = 1e-6_wp
  !> Least samples of a turn for a phase.
  integer, parameter :: least_samples = 12

  type, public :: crank_column_t
    character(len=15) :: name
    character(len=5) :: unit
    character(len=60) :: meaning
  end type crank_column_t

  !> Numbers of a summary, as files call them.
  type(crank_column_t), parameter, public :: crank_table(11) = [ &
    crank_column_t('crank_speed', 'rad/s', 'mean speed of the crank'), &
    crank_column_t('crank_speed_min', 'rad/s', 'least speed of the crank'), &
    crank_column_t('crank_speed_max', 'rad/s', 'largest speed of the crank'), &
    crank_column_t('torque', 'N m', 'mean torque of the motor'), &
    crank_column_t('torque_max', 'N m', 'largest size of the torque of the motor'), &
    crank_column_t('power', 'W', 'mean power of the motor at its shaft'), &
    crank_column_t('impact_power', 'W', 'mean power lost to impacts'), &
    crank_column_t('friction_power', 'W', 'mean power lost to dry friction of the body'), &
    crank_column_t('damping_power', 'W', 'mean power lost to viscous friction of the body'), &
    crank_column_t('bearing_power', 'W', 'mean power lost to the bearing of the crank'), &
    crank_column_t('heat_power', 'W', 'mean power lost to the resistance of the motor')]
  integer, parameter, public :: crank_numbers = size(crank_table)

  type, public :: crank_summary_t
    !> As in the table.
    real(wp) :: speed = 0, speed_min = 0, speed_max = 0, torque = 0, torque_max = 0, power = 0, impacts = 0, friction = 0, &
      damping = 0, bearing = 0, heat = 0
    integer :: outcome = crank_not_known
  end type crank_summary_t

contains

  !> The numbers of a summary in the order of the table.
  pure function crank_values(summary) result(values)
    type(crank_summary_t), intent(in) :: summary
    real(wp) :: values(crank_numbers)
    values = [summary%speed, summary%speed_min, summary%speed_max, summary%torque, summary%torque_max, summary%power, &
              summary%impacts, summary%friction, summary%damping, summary%bearing, summary%heat]
  end function crank_values

  !> Summary of the samples `first` to `last` of a machine with a motor; not numbers where there are less than two.
  pure subroutine summarize_crank(laws, log, first, last, summary)
    type(law_choice_t), intent(in) :: laws(:)
    type(log_t), intent(in) :: log
    integer, intent(in) :: first, last
    type(crank_summary_t), intent(out) :: summary
    real(wp) :: lasted, gone(5)
    if (last <= first) then
      summary = no_summary()
      return
    end if
    associate (motor => laws(number_of_family(laws, 'motor')))
      associate (t => log%sample_data(1, first:last), angle => log%sample_driver(1, first:last), &
                 w => log%sample_driver(2, first:last), values => log%sample_coordinates(:, first:last))
        lasted = t(size(t)) - t(1)
        gone = (log%sample_balance(:, last) - log%sample_balance(:, first))/lasted
        summary%speed = (angle(size(t)) - angle(1))/lasted
        summary%speed_min = minval(w)
        summary%speed_max = maxval(w)
        summary%torque = mean_of(t, values(1, :))
        summary%torque_max = maxval(abs(values(1, :)))
        summary%power = gone(4)
        summary%impacts = gone(3)
        associate (viscous => value_of(motor, 'bearing_damping')*mean_of(t, w**2), &
                   dry => value_of(motor, 'bearing_friction')*mean_of(t, abs(w)))
          summary%bearing = viscous + dry
          summary%friction = gone(1) - dry
          summary%damping = gone(2) - viscous
        end associate
        if (motor%name == 'dc') summary%heat = value_of(motor, 'resistance')*mean_of(t, values(4, :)**2)
        summary%outcome = outcome_of(laws, log, first, last, summary)
      end associate
    end associate
  end subroutine summarize_crank

  !> Of a motion that had to be given up: not numbers.
  pure type(crank_summary_t) function no_summary() result(summary)
    real(wp) :: none
    none = ieee_value(1.0_wp, ieee_quiet_nan)
    summary = crank_summary_t(none, none, none, none, none, none, none, none, none, none, none)
  end function no_summary

  !> Mean over time by the trapezoidal rule.
  pure real(wp) function mean_of(t, values) result(mean)
    real(wp), intent(in) :: t(:), values(:)
    integer :: n
    n = size(t)
    mean = sum((t(2:) - t(:n - 1))*(values(2:) + values(:n - 1)))/2/(t(n) - t(1))
  end function mean_of

  !> Outcome of a run-up. Without impacts the mean speed is above or below the resonance of body and spring. Impacts move the
  !> resonance: the body moves with what drives it below, and against it above.
  pure integer function outcome_of(laws, log, first, last, summary) result(outcome)
    type(law_choice_t), intent(in) :: laws(:)
    type(log_t), intent(in) :: log
    integer, intent(in) :: first, last
    type(crank_summary_t), intent(in) :: summary
    real(wp) :: phase
    associate (angle => log%sample_driver(1, first:last), resonance => resonance_of(laws))
      if (max(-summary%speed_min, summary%speed_max) <= at_rest*abs(speed_of(laws(number_of_family(laws, 'motor'))))) then
        outcome = crank_stalled
      else if (maxval(angle) - minval(angle) < two_pi .and. summary%speed_min*summary%speed_max < 0) then
        outcome = crank_rocking
      else if (summary%speed < 0) then
        outcome = crank_reversed
      else if (.not. resonance > 0) then
        outcome = crank_turning
      else if (.not. has_impacts(log, log%sample_data(1, first))) then
        outcome = merge(crank_passed, crank_captured, summary%speed > resonance)
      else
        phase = phase_of(laws, log, first, last)
        outcome = crank_not_known
        if (phase > clear_phase) outcome = crank_captured
        if (phase < -clear_phase) outcome = crank_passed
      end if
    end associate
  end function outcome_of

  !> Whether the body hit a stop since a time [s].
  pure logical function has_impacts(log, since) result(has)
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: since
    has = log%events > 0
    if (has) has = any((log%event_kind(:log%events) == event_impact_upper .or. log%event_kind(:log%events) == event_impact_lower) &
                       .and. log%event_data(1, :log%events) >= since)
  end function has_impacts

  !> Cosine of the phase between the first harmonics, over the angle of the crank, of what drives the body and of the body, over the
  !> whole turns before sample `last`; 0 where it is not known.
  pure real(wp) function phase_of(laws, log, first, last) result(phase)
    type(law_choice_t), intent(in) :: laws(:)
    type(log_t), intent(in) :: log
    integer, intent(in) :: first, last
    complex(wp) :: body, drive
    real(wp) :: together, apart
    integer :: from, to
    logical :: on_body
    phase = 0
    together = 0
    apart = 0
    on_body = laws(number_of_family(laws, 'drive'))%name == 'unbalance'
    to = last
    do
      from = to
      do while (from > first)
        if (log%sample_driver(1, from) <= log%sample_driver(1, to) - two_pi) exit
        from = from - 1
      end do
      if (log%sample_driver(1, from) > log%sample_driver(1, to) - two_pi .or. to - from < least_samples) exit
      associate (angle => log%sample_driver(1, from:to))
        body = harmonic_of(angle, log%sample_data(2, from:to))
        drive = 1
        if (.not. on_body) drive = harmonic_of(angle, log%sample_coordinates(6, from:to))
      end associate
      together = together + real(body*conjg(drive), wp)
      apart = apart + abs(body)*abs(drive)
      to = from
    end do
    if (apart > 0) phase = together/apart
  end function phase_of

  !> First harmonic of values over an angle that grows by a turn, without their mean.
  pure complex(wp) function harmonic_of(angle, values) result(harmonic)
    real(wp), intent(in) :: angle(:), values(:)
    real(wp) :: mean, sine, cosine
    integer :: i
    mean = mean_of(angle, values)
    harmonic = 0
    do i = 1, size(angle)
      call sine_cosine(angle(i), sine, cosine)
      associate (width => angle(min(i + 1, size(angle))) - angle(max(i - 1, 1)))
        harmonic = harmonic + width*(values(i) - mean)*cmplx(cosine, sine, wp)
      end associate
    end do
  end function harmonic_of

end module crank_summary
