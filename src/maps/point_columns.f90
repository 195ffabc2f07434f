! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is reported of each point of a map, in one table: name, type and unit in a file, meaning, and value. Files, verification,
!> the C interface and the merging of shares take it from here.
module point_columns
  use crank_summary, only: crank_summary_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motor_choices, only: has_motor
  use single_trajectory, only: outcome_t
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: crank_values_of, map_values, margin_or_infinite, outcome_values

  type, public :: point_column_t
    character(len=18) :: name
    !> As HDF5 files and numpy call it.
    character(len=7) :: type
    character(len=5) :: unit
    character(len=80) :: meaning
  end type point_column_t

  !> The first are the same for all that converged to one attractor; `regime`, `reason` and `crank_outcome` are codes. A new one
  !> goes before the last two, which only machines with a motor have.
  type(point_column_t), parameter, public :: point_table(15) = [ &
    point_column_t('regime', 'int8', '1', 'regime of the motion'), &
    point_column_t('attractor', 'int32', '1', 'label of the attractor in the catalogue, 0 = none'), &
    point_column_t('reason', 'int8', '1', 'why the trajectory ended'), &
    point_column_t('period', 'int16', '1', 'period in drive periods, 0 = not periodic'), &
    point_column_t('event_word', 'float64', '1', 'events of one period of the motion, three bits each'), &
    point_column_t('impacts_per_period', 'float32', '1', 'impacts per drive period'), &
    point_column_t('mean_impact_speed', 'float32', 'm/s', 'mean speed just before impact'), &
    point_column_t('amplitude', 'float32', 'm', 'half the range of the position'), &
    point_column_t('x_max', 'float32', 'm', 'largest position'), &
    point_column_t('x_min', 'float32', 'm', 'smallest position'), &
    point_column_t('v_max', 'float32', 'm/s', 'largest velocity towards the upper barrier'), &
    point_column_t('settle_time', 'float32', 's', 'time from the start to capture by the attractor'), &
    point_column_t('grazing_margin', 'float32', 'm', 'smallest distance to a barrier at a turning point that missed it'), &
    point_column_t('crank_outcome', 'int8', '1', 'outcome of a run-up of the crank'), &
    point_column_t('crank_speed', 'float32', 'rad/s', 'mean speed of the crank')]

  !> How many all machines have, and those with a motor more; how many of them are marks of the attractor, which distinguish points.
  integer, parameter, public :: point_values = 13, crank_point_values = 2, marks_of_attractor = 5
  !> Their columns. In a refined map the marks are followed by the origin of a point.
  integer, parameter, public :: at_regime = 1, at_attractor = 2, at_reason = 3, at_period = 4, at_event_word = 5, &
    at_impacts = 6, at_impact_speed = 7, at_amplitude = 8, at_x_max = 9, at_x_min = 10, at_v_max = 11, at_settle_time = 12, &
    at_margin = 13, at_origin = marks_of_attractor + 1

contains

  !> The values of a point, in the order of the table: settling time not a number where it did not converge, grazing margin
  !> infinite where no barrier was missed.
  pure function outcome_values(outcome) result(values)
    type(outcome_t), intent(in) :: outcome
    real(wp) :: values(point_values)
    associate (f => outcome%features)
      values(at_regime) = f%regime
      values(at_attractor) = outcome%attractor
      values(at_reason) = outcome%reason
      values(at_period) = outcome%period
      values(at_event_word) = real(f%word, wp)
      values(at_impacts) = f%impacts_per_period
      values(at_impact_speed) = f%mean_impact_speed
      values(at_amplitude) = f%amplitude
      values(at_x_max) = f%x_max
      values(at_x_min) = f%x_min
      values(at_v_max) = f%v_max
      values(at_settle_time) = outcome%settle_time
      if (outcome%settle_time < 0) values(at_settle_time) = ieee_value(1.0_wp, ieee_quiet_nan)
      values(at_margin) = margin_or_infinite(f%grazing_margin)
    end associate
  end function outcome_values

  !> How many values a point of a map has.
  pure integer function map_values(choices) result(number)
    type(law_choice_t), intent(in) :: choices(:)
    number = point_values
    if (has_motor(choices)) number = point_values + crank_point_values
  end function map_values

  !> The further values of a point of a machine with a motor.
  pure function crank_values_of(crank) result(values)
    type(crank_summary_t), intent(in) :: crank
    real(wp) :: values(crank_point_values)
    values = [real(crank%outcome, wp), crank%speed]
  end function crank_values_of

  !> The smallest distance to a barrier; infinite where no turning point missed one.
  elemental real(wp) function margin_or_infinite(margin)
    real(wp), intent(in) :: margin
    margin_or_infinite = margin
    if (.not. margin < huge(1.0_wp)) margin_or_infinite = ieee_value(1.0_wp, ieee_positive_inf)
  end function margin_or_infinite

end module point_columns
