! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> As `segments`, of a structure: segments of a motion of all its coordinates, each from a start of its own, with the derivatives
!> of the samples along directions in the space of the parameters and by the start.
module coordinate_segments
  use multibody, only: is_stop, joint_elastic
  use multibody_motion, only: advance_multibody, advance_multibody_period, multibody_motion_t
  use multibody_section, only: start_of_multibody
  use multibody_state, only: joint_motion, multibody_state_t, rounding_of_speed, turning_at
  use kinds, only: wp
  use motion_state, only: event_impact_lower, event_impact_upper, event_separation, event_touch_lower, event_touch_upper, log_t, &
    tally_t
  use segment_flight, only: between_impacts
  use status, only: exit_bad_case
  use variants, only: family_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: propagate_coordinates

  !> Samples of all segments, one after the other: positions and then velocities of all coordinates (rows).
  type, public :: coordinate_samples_t
    real(wp), allocatable :: motion(:, :)
    !> Derivatives: first directions, then positions, velocities and crank angle of the start; then as `motion`.
    real(wp), allocatable :: slope(:, :, :)
  end type coordinate_samples_t

  !> What happened in each segment, and every impact.
  type, public :: coordinate_report_t
    integer, allocatable :: impacts(:), reason(:)
    logical, allocatable :: steady(:)
    !> Segment of each impact; rows of `impact`: time since the start of the segment [s], number of the contact, speeds of its ends
    !> against each other before and after [m/s] (of a soft contact: when it ends, not a number if it lasts), +1 upper or -1
    !> lower stop.
    integer, allocatable :: impact_segment(:)
    real(wp), allocatable :: impact(:, :)
  end type coordinate_report_t

  !> One flight of one segment.
  type :: run_t
    type(log_t) :: log
    integer :: reason = 0, count = 0
    !> Start of the segment on the clock of the log [s].
    real(wp) :: origin = 0
    !> Rows of `impact` in `coordinate_report_t`; positions and velocities (rows) at the samples.
    real(wp), allocatable :: impact(:, :), motion(:, :)
  end type run_t

contains

  !> Flies every segment of a structure: `start` = positions [m], velocities [m/s], crank angle [rad] by column, its samples
  !> are at `times(first(i) + 1:first(i + 1))` [s], ascending from 0. Elastic friction has slid so far that its spring is stretched
  !> by all of the friction. Segments that cannot be flown, and steady ones: as in `propagate`.
  pure subroutine propagate_coordinates(family, start, first, times, derivatives, samples, report)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(in) :: derivatives
    type(coordinate_samples_t), intent(out) :: samples
    type(coordinate_report_t), intent(out) :: report
    type(run_t) :: base, adaptive, other
    integer :: i, total, rows
    rows = size(start, 1) - 1
    allocate (samples%motion(rows, size(times)))
    if (derivatives) allocate (samples%slope(size(family%further) + rows + 1, rows, size(times)))
    allocate (report%impacts(size(start, 2)), report%reason(size(start, 2)), report%steady(size(start, 2)))
    allocate (report%impact_segment(0), report%impact(5, 0))
    call open_run(base)
    call open_run(adaptive)
    call open_run(other)
    total = 0
    do i = 1, size(start, 2)
      associate (from => first(i) + 1, to => first(i + 1))
        call fly(family%bodies, start(:, i), times(from:to), base)
        samples%motion(:, from:to) = base%motion
        report%impacts(i) = base%count
        report%reason(i) = base%reason
        report%steady(i) = base%reason == 0
        if (derivatives) then
          if (any(base%impact(3, :base%count) < family%least_speed)) report%steady(i) = .false.
          if (allocated(family%adaptive)) call fly(family%adaptive%bodies, start(:, i), times(from:to), adaptive)
          call differentiate(family, start(:, i), times(from:to), base, adaptive, other, samples%slope(:, :, from:to), &
                             report%steady(i))
        end if
      end associate
      report%impact_segment = [report%impact_segment, spread(i, 1, base%count)]
      report%impact = reshape([report%impact, base%impact(:, :base%count)], [5, total + base%count])
      total = total + base%count
    end do
  end subroutine propagate_coordinates

  pure subroutine open_run(run)
    type(run_t), intent(out) :: run
    run%log%sample_interval = 1
    run%log%balance%kept = .false.
    allocate (run%impact(5, 16))
  end subroutine open_run

  !> One segment of one machine.
  pure subroutine fly(moving, start, times, run)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(inout) :: run
    type(multibody_state_t) :: state
    type(tally_t) :: tally
    integer :: n, done
    n = moving%machine%n
    run%count = 0
    run%reason = 0
    run%log%origin = 0
    run%log%events = 0
    run%log%samples = 0
    run%log%next_sample = 0
    if (allocated(run%motion)) deallocate (run%motion)
    allocate (run%motion(2*n, size(times)))
    if (all(ieee_is_finite(start))) then
      associate (watched => moving%machine%watched)
        state = start_of_multibody(moving, [start(watched), start(n + watched), start(2*n + 1), &
                                            reshape(transpose(reshape(start(:2*n), [n, 2])), [2*n])])
      end associate
      if (.not. ieee_is_finite(state%q(1))) run%reason = exit_bad_case
      call let_slide(moving, state)
    else
      run%reason = exit_bad_case
    end if
    if (run%reason == 0) then
      run%origin = state%time
      run%log%instants = state%time + times
      if (size(times) > 0) call fly_to(moving, run%log%instants(size(times)), state, tally, run)
    end if
    if (run%reason /= 0) then
      run%motion = not_a_number()
    else
      done = run%log%samples
      if (done > 0) run%motion(:, :done) = run%log%sample_coordinates(:, :done)
      run%motion(:, done + 1:) = spread([state%q(:n), state%v(:n)], 2, size(times) - done)
    end if
    call read_impacts(moving, run)
  end subroutine fly

  !> Elastic friction slides as its surfaces move.
  pure subroutine let_slide(moving, state)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp) :: turning(moving%harmonics)
    real(wp) :: s, u
    integer :: j
    turning = turning_at(moving%machine%frequency, state%time, moving%harmonics)
    do j = 1, size(moving%machine%joints)
      if (moving%machine%joints(j)%kind /= joint_elastic) cycle
      call joint_motion(moving%machine, j, state%q, state%v, state%time, turning, s, u)
      if (abs(u) > rounding_of_speed(moving%machine, j, state)) state%phase(j) = merge(1, -1, u > 0)
    end do
  end subroutine let_slide

  pure real(wp) function not_a_number()
    not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
  end function not_a_number

  !> Moves to `until` [s on the clock of the log].
  pure subroutine fly_to(moving, until, state, tally, run)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: until
    type(multibody_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    type(run_t), intent(inout) :: run
    do while (until - run%log%origin >= moving%machine%period)
      call advance_multibody_period(moving, state, tally, run%reason, run%log)
      if (run%reason /= 0) return
      ! Budgets are of one period.
      tally%events = 0
      tally%steps = 0
    end do
    call advance_multibody(moving, state, until - run%log%origin, tally, run%reason, run%log)
  end subroutine fly_to

  !> Takes the impacts out of the events. Contacts are counted by themselves: a neighbour may have further joints.
  pure subroutine read_impacts(moving, run)
    type(multibody_motion_t), intent(in) :: moving
    type(run_t), intent(inout) :: run
    real(wp) :: side, after
    integer :: i, k, contact
    do i = 1, run%log%events
      associate (kind => run%log%event_kind(i), joint => run%log%event_joint(:, i))
        after = abs(joint(4))
        contact = count(is_stop(moving%machine%joints(:nint(joint(1)))%kind))
        select case (kind)
        case (event_impact_upper, event_touch_upper)
          side = 1
        case (event_impact_lower, event_touch_lower)
          side = -1
        case (event_separation)
          k = findloc(nint(run%impact(2, :run%count)), contact, dim=1, back=.true.)
          if (k > 0) run%impact(4, k) = abs(joint(3))
          cycle
        case default
          cycle
        end select
        if (kind == event_touch_upper .or. kind == event_touch_lower) after = not_a_number()
        if (run%count == size(run%impact, 2)) run%impact = reshape(run%impact, [5, 2*run%count], pad=[0.0_wp])
        run%count = run%count + 1
        run%impact(:, run%count) = [run%log%event_data(1, i) - run%origin, real(contact, wp), abs(joint(3)), after, side]
      end associate
    end do
  end subroutine read_impacts

  !> Derivatives of the samples of one segment by differences between its neighbours and itself.
  pure subroutine differentiate(family, start, times, base, adaptive, other, slope, steady)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(in) :: base, adaptive
    type(run_t), intent(inout) :: other
    real(wp), intent(inout) :: slope(:, :, :)
    logical, intent(inout) :: steady
    logical :: open(size(times))
    real(wp) :: moved(size(start)), step
    integer :: k, n, row, sense, turn
    slope = merge(0.0_wp, not_a_number(), base%reason == 0)
    if (base%reason /= 0) return
    n = (size(start) - 1)/2
    do k = 1, size(start)
      open = .true.
      row = size(family%further) + k
      ! A velocity is made larger, so that a slow body does not turn round.
      sense = merge(-1, 1, k > n .and. k <= 2*n .and. start(k) < 0)
      do turn = 1, 2
        step = sense*family%start_step(merge(3, merge(1, 2, k <= n), k > 2*n))
        moved = start
        moved(k) = start(k) + step
        call compare(family%bodies, moved, moved(k) - start(k), times, base, other, open, slope(row, :, :), steady)
        if (.not. any(open)) exit
        sense = -sense
      end do
    end do
    do k = 1, size(family%further)
      open = .true.
      call step_along(family, k, 1, start, times, base, adaptive, other, open, slope(k, :, :), steady)
      if (any(open)) call step_along(family, k, -1, start, times, base, adaptive, other, open, slope(k, :, :), steady)
    end do
  end subroutine differentiate

  !> The difference that a machine a step along a direction makes, forth or back.
  pure subroutine step_along(family, k, sense, start, times, base, adaptive, other, open, slope, steady)
    type(family_t), intent(in) :: family
    integer, intent(in) :: k, sense
    real(wp), intent(in) :: start(:), times(:)
    type(run_t), intent(in) :: base, adaptive
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: slope(:, :)
    if (sense > 0) then
      associate (variant => family%further(k))
        if (.not. abs(variant%step) > 0) return
        if (variant%leaves_exact) then
          call compare(variant%bodies, start, variant%step, times, adaptive, other, open, slope, steady)
        else
          call compare(variant%bodies, start, variant%step, times, base, other, open, slope, steady)
        end if
      end associate
    else
      associate (variant => family%back(k))
        if (.not. abs(variant%step) > 0) return
        if (variant%leaves_exact) then
          call compare(variant%bodies, start, variant%step, times, adaptive, other, open, slope, steady)
        else
          call compare(variant%bodies, start, variant%step, times, base, other, open, slope, steady)
        end if
      end associate
    end if
  end subroutine step_along

  !> Flies a neighbour that is `step` away and fills in its differences at the samples that are still open, but for those
  !> between an impact of the base and the same impact of the neighbour. A neighbour that cannot be flown fills in none. Takes
  !> the steadiness away if the two do not meet the same stops in the same order.
  pure subroutine compare(moving, start, step, times, base, other, open, slope, steady)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(:), step, times(:)
    type(run_t), intent(in) :: base
    type(run_t), intent(inout) :: other
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: slope(:, :)
    logical :: between(size(times))
    integer :: i
    call fly(moving, start, times, other)
    if (other%reason /= 0) return
    if (other%count /= base%count) then
      steady = .false.
    else if (any(nint(other%impact([2, 5], :base%count)) /= nint(base%impact([2, 5], :base%count)))) then
      steady = .false.
    end if
    between = between_impacts(base%impact(1, :base%count), other%impact(1, :other%count), base%origin, times)
    do i = 1, size(times)
      if (open(i) .and. .not. between(i)) slope(:, i) = (other%motion(:, i) - base%motion(:, i))/step
    end do
    open = open .and. between
  end subroutine compare

end module coordinate_segments
