! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Run-up and run-down: a parameter is held at one value after the other while the body and the crank
!> go on as they are. Each hold lasts a whole number of drive periods, so that the crank is at the section when
!> the parameter changes and its angle carries over exactly.
module sweep
  use attractors, only: features_t, most_coordinates, regime_impact, regime_non_impact
  use circle, only: point_near
  use errors, only: error_t
  use grid, only: grid_t, machine_with
  use kinds, only: int64, wp
  use motion, only: motion_t
  use motion_state, only: reset_tally, tally_t
  use span_check, only: check_periods
  use status, only: reason_time_over
  use strobe, only: advance_strobe_period, coordinates_of, features_over, resume_strobe, scales_of, section_point, strobe_t
  use trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: hold_parameter, bracket_limit

  !> Relative distance at which section points count as the same when a period is read off.
  real(wp), parameter :: same_point = 0.02_wp

  !> What is seen at the end of one hold.
  type, public :: hold_t
    integer :: reason = 0
    integer :: period = 0
    type(features_t) :: features
    !> Last section points, rows x [m] and v [m/s]; not numbers after a hold that was given up, like the features.
    real(wp), allocatable :: samples(:, :)
    type(strobe_t) :: state
    !> By what limits are told: the regime of two bodies, of one body whether there are impacts.
    integer :: mark = 0
  end type hold_t

contains

  !> Holds parameter `path` at `value` for at least the duration, starting from `state` with the crank at `crank_angle`;
  !> features are over the window. The reason is `time_over` unless the hold had to be given up.
  subroutine hold_parameter(grid, span, path, value, state, crank_angle, samples, held, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value, crank_angle
    type(strobe_t), intent(in) :: state
    integer, intent(in) :: samples
    type(hold_t), intent(out) :: held
    type(error_t), allocatable, intent(out) :: error
    type(motion_t) :: moving
    type(tally_t) :: tally
    real(wp) :: points(most_coordinates, samples), sizes(most_coordinates)
    integer :: periods, in_window, i, n
    call machine_with(grid, path, value, moving, error)
    if (.not. allocated(error)) call check_periods(span, moving%machine%period, error)
    if (allocated(error)) return
    in_window = max(1, ceiling(span%window/moving%machine%period))
    periods = max(ceiling(span%duration/moving%machine%period), in_window, samples)
    allocate (held%samples(2, samples), source=ieee_value(1.0_wp, ieee_quiet_nan))
    held%state = resume_strobe(moving, state, crank_angle)
    call reset_tally(tally, held%state%state, allocated(moving%pair))
    do i = 1, periods
      if (i == periods - in_window + 1) then
        tally%wants_v_max = .true.
        call reset_tally(tally, held%state%state, allocated(moving%pair))
      end if
      call advance_strobe_period(moving, held%state, tally, held%reason)
      if (held%reason /= 0) then
        held%samples = ieee_value(1.0_wp, ieee_quiet_nan)
        held%features = no_features()
        return
      end if
      if (i <= periods - samples) cycle
      held%samples(:, i - periods + samples) = [held%state%state%x, held%state%state%v]
      points(:, i - periods + samples) = section_point(moving, held%state)
    end do
    held%reason = reason_time_over
    held%features = features_over(moving, tally, real(in_window, wp))
    held%mark = merge(regime_impact, regime_non_impact, held%features%impacts_per_period > 0)
    if (allocated(moving%pair)) held%mark = held%features%regime
    n = coordinates_of(moving)
    sizes = scales_of(moving, held%features%amplitude)
    held%period = period_of(points(:n, :), sizes(:n), moving%machine%turn)
    held%features%word = 0
    if (held%period > 0) held%features%word = word_of(moving, held%state, held%period)
  end subroutine hold_parameter

  !> Features of a hold without an end: not numbers.
  pure function no_features() result(features)
    type(features_t) :: features
    real(wp) :: none
    none = ieee_value(1.0_wp, ieee_quiet_nan)
    features%impacts_per_period = none
    features%mean_impact_speed = none
    features%amplitude = none
    features%x_max = none
    features%x_min = none
    features%v_max = none
    features%rotation = none
  end function no_features

  !> Event word of the `period` drive periods that follow a state.
  pure integer(int64) function word_of(moving, state, period) result(word)
    type(motion_t), intent(in) :: moving
    type(strobe_t), intent(in) :: state
    integer, intent(in) :: period
    type(strobe_t) :: probe
    type(tally_t) :: tally
    integer :: i, reason
    probe = state
    call reset_tally(tally, probe%state, allocated(moving%pair))
    do i = 1, period
      call advance_strobe_period(moving, probe, tally, reason)
      if (reason /= 0) exit
    end do
    word = tally%word
  end function word_of

  !> Smallest number of drive periods after which the samples repeat, 0 if none up to half of them does.
  pure integer function period_of(samples, size_of_motion, turn) result(period)
    real(wp), intent(in) :: samples(:, :), size_of_motion(:), turn
    integer :: p, i
    logical :: repeats
    period = 0
    do p = 1, size(samples, 2)/2
      repeats = .true.
      do i = 1, size(samples, 2) - p
        repeats = repeats .and. norm2((point_near(samples(:, i + p), samples(:, i), turn) - samples(:, i)) &
                                      /(size_of_motion + tiny(1.0_wp))) <= same_point
      end do
      if (repeats) then
        period = p
        return
      end if
    end do
  end function period_of

  !> Halves the interval in which the mark of a hold changes from `mark` while the parameter moves from `value` (state given)
  !> to `beyond`, until it is at most `tolerance` wide or a hold has to be given up. Every hold starts from the last state
  !> before the change. `next` comes in as the mark at `beyond` and goes out as that behind the limit.
  subroutine bracket_limit(grid, span, path, value, beyond, state, mark, tolerance, next, bracket, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value, beyond, tolerance
    type(strobe_t), intent(in) :: state
    integer, intent(in) :: mark
    integer, intent(inout) :: next
    real(wp), intent(out) :: bracket(2)
    type(error_t), allocatable, intent(out) :: error
    type(hold_t) :: held
    type(strobe_t) :: last
    real(wp) :: near, far, middle
    near = value
    far = beyond
    last = state
    do while (abs(far - near) > tolerance)
      middle = 0.5_wp*(near + far)
      if (.not. (abs(middle - near) > 0 .and. abs(middle - far) > 0)) exit
      call hold_parameter(grid, span, path, middle, last, 0.0_wp, 0, held, error)
      if (allocated(error)) return
      if (held%reason /= reason_time_over) exit
      if (held%mark == mark) then
        near = middle
        last = held%state
      else
        far = middle
        next = held%mark
      end if
    end do
    bracket = [min(near, far), max(near, far)]
  end subroutine bracket_limit

end module sweep
