! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Run-up and run-down: a parameter is held at one value after the other while the body and the crank
!> go on as they are. Each hold lasts a whole number of drive periods, so that the crank is at the section when
!> the parameter changes and its angle carries over exactly.
module sweep
  use attractors, only: features_t, regime_at_rest
  use crank_summary, only: crank_summary_t, no_summary
  use crank_turns, only: summarize_held, summarize_turns
  use derived_values, only: derive_over
  use errors, only: error_t
  use grid, only: grid_t, machine_with
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t
  use machine_type, only: machine_t, section_state_t
  use motion_features, only: features_over
  use motion_state, only: tally_t
  use settling, only: mark_of, settle, settled_t, with_crank
  use span_check, only: check_periods
  use status, only: reason_time_over
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: hold_parameter, derive_held

  !> What is seen at the end of one hold.
  type, public :: hold_t
    integer :: reason = 0
    type(features_t) :: features
    !> Last section points, rows x [m] and v [m/s]; not numbers after a hold that was given up, like the features.
    real(wp), allocatable :: samples(:, :)
    type(section_state_t) :: state
    !> See `mark_of`.
    integer :: mark = 0
    !> Where the motion would end if the hold went on.
    type(settled_t) :: settled
    !> Of a motor, as long as the window, after it; over the cycle where one was found.
    type(crank_summary_t) :: crank
  end type hold_t

contains

  !> Holds parameter `path` at `value` for at least the duration, starting from the state at the end of another hold, `from`, or,
  !> without, from the start of the case; features are over the window; where a cycle was found, regime, impacts and rotation are
  !> its own. The reason is `time_over` unless the hold had to be given up. A cycle of at most `longest` drive periods is looked for
  !> in what would follow; 0 = none is.
  subroutine hold_parameter(grid, span, path, value, samples, longest, held, error, from)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    integer, intent(in) :: samples, longest
    type(hold_t), intent(out) :: held
    type(error_t), allocatable, intent(out) :: error
    type(section_state_t), intent(in), optional :: from
    class(machine_t), allocatable :: moving
    type(tally_t) :: tally
    integer :: periods, in_window, i
    call machine_with(grid, path, value, moving, error)
    if (.not. allocated(error)) call check_periods(span, moving%period, error)
    if (allocated(error)) return
    in_window = max(1, ceiling(span%window/moving%period))
    periods = max(ceiling(span%duration/moving%period), in_window, samples)
    allocate (held%samples(2, samples), source=ieee_value(1.0_wp, ieee_quiet_nan))
    if (present(from)) then
      held%state = moving%resume(from, 0.0_wp)
    else
      call moving%start(grid%start, held%state)
    end if
    call moving%begin_tally(held%state, tally)
    do i = 1, periods
      if (i == periods - in_window + 1) then
        tally%needs_v_max = .true.
        call moving%begin_tally(held%state, tally)
      end if
      call moving%advance_to_section(held%state, tally, held%reason)
      if (held%reason /= 0) then
        held%samples = ieee_value(1.0_wp, ieee_quiet_nan)
        held%features = no_features()
        held%crank = no_summary()
        if (held%reason == reason_time_over) call describe_held(moving, held)
        return
      end if
      if (i > periods - samples) held%samples(:, i - periods + samples) = [held%state%state%x, held%state%state%v]
    end do
    if (.not. moving%has_clock) call sample_turns(moving, held%state, held%samples)
    held%reason = reason_time_over
    held%features = features_over(moving, tally, real(in_window, wp))
    if (.not. moving%timed) then
      call summarize_turns(moving, held%state, in_window, in_window*moving%period, held%crank)
    end if
    held%mark = with_crank(mark_of(moving, held%features), held%crank)
    held%features%word = 0
    if (longest == 0) return
    call settle(moving, held%state, longest, 0, held%settled)
    held%features%word = held%settled%features%word
    if (held%settled%period == 0) return
    held%crank = held%settled%crank
    associate (seen => held%features, cycle => held%settled%features)
      seen%regime = cycle%regime
      seen%impacts_per_period = cycle%impacts_per_period
      seen%mean_impact_speed = cycle%mean_impact_speed
      seen%rotation = cycle%rotation
    end associate
  end subroutine hold_parameter

  !> Derived quantities of the motion at the end of a hold: over the cycle on which it settles, else over a window after it.
  subroutine derive_held(grid, span, path, value, held, values)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    type(hold_t), intent(in) :: held
    real(wp), intent(out) :: values(:)
    class(machine_t), allocatable :: moving
    type(law_choice_t), allocatable :: laws(:)
    type(error_t), allocatable :: error
    integer :: periods
    logical :: known
    values = ieee_value(1.0_wp, ieee_quiet_nan)
    if (size(values) == 0 .or. held%reason /= reason_time_over) return
    call machine_with(grid, path, value, moving, error)
    if (allocated(error)) return
    laws = grid%laws
    call change_parameter(laws, path, value, known)
    periods = held%settled%period
    if (periods > 0) then
      call derive_over(moving, laws, grid%derived, held%settled%state, &
                       merge(held%settled%duration, periods*moving%period, held%settled%duration > 0), real(periods, wp), values)
    else
      periods = max(1, ceiling(span%window/moving%period))
      call derive_over(moving, laws, grid%derived, held%state, periods*moving%period, real(periods, wp), values)
    end if
  end subroutine derive_held

  !> Features of a hold in which the bearing comes to hold the crank for good.
  pure subroutine describe_held(moving, held)
    class(machine_t), intent(in) :: moving
    type(hold_t), intent(inout) :: held
    if (.not. moving%bound_to_rest(held%state)) return
    held%features = features_t(regime=regime_at_rest, x_max=held%state%state%x, x_min=held%state%state%x)
    held%samples = spread([held%state%state%x, 0.0_wp], 2, size(held%samples, 2))
    call summarize_held(moving, held%state, held%crank)
    held%mark = with_crank(mark_of(moving, held%features), held%crank)
  end subroutine describe_held

  !> Where a machine without a clock turns round next, rows x [m] and v [m/s]; the state as it is, where it does not.
  pure subroutine sample_turns(moving, state, samples)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: state
    real(wp), intent(out) :: samples(:, :)
    type(section_state_t) :: later
    type(tally_t) :: unused
    integer :: i, reason
    samples = spread([state%state%x, state%state%v], 2, size(samples, 2))
    later = state
    do i = 1, size(samples, 2)
      call moving%advance_to_turn(later, unused, reason)
      if (reason /= 0) return
      samples(:, i) = [later%state%x, later%state%v]
    end do
  end subroutine sample_turns

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

end module sweep
