! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many short segments of a motion, each from a start of its own, sampled at given times, with the derivatives of the samples along
!> directions in the space of the machine's parameters and by the start. A record is compared with them segment by segment, so that
!> a small error of the model does not grow into another motion.
module segments
  use kinds, only: wp
  use motion_state, only: log_t
  use segment_machine, only: flown_segment_t, impact_contact, impact_numbers, impact_side, impact_time, not_a_number, &
    segment_machine_t, speed_before
  use variants, only: family_t, variant_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  implicit none
  private

  public :: propagate

  !> Drive periods of a segment for lanes: their clock starts anew at no section.
  real(wp), parameter :: most_periods_in_lanes = 8

  !> Samples of all segments, one after the other: number of the sample, sample.
  type, public :: samples_t
    real(wp), allocatable :: motion(:, :)
    !> Derivatives: first directions, then numbers of the start; then as `motion`.
    real(wp), allocatable :: slope(:, :, :)
  end type samples_t

  !> What happened in each segment, and every impact.
  type, public :: report_t
    integer, allocatable :: impacts(:), reason(:)
    logical, allocatable :: steady(:)
    !> Segment of each impact, and its numbers (module `segment_machine`) by column.
    integer, allocatable :: impact_segment(:)
    real(wp), allocatable :: impact(:, :)
    !> Segments that flew in lanes with all their neighbours.
    integer :: in_lanes = 0
  end type report_t

  !> Segments on their way together: in lanes, or one by one in the event loop.
  type :: batch_t
    real(wp), allocatable :: start(:, :), times(:)
    integer, allocatable :: first(:)
    logical :: in_lanes = .false.
    !> Segments of this batch.
    logical, allocatable :: chosen(:)
    type(log_t) :: log
  end type batch_t

  !> The neighbours of a batch along one direction: which segments want one, samples without a difference yet, starts and steps.
  type :: neighbours_t
    logical, allocatable :: wanted(:), open(:)
    real(wp), allocatable :: start(:, :), step(:)
    type(flown_segment_t), allocatable :: flights(:)
  end type neighbours_t

contains

  !> Flies every segment: its start is a column of `start`, its samples are at `times(first(i) + 1:first(i + 1))` [s], ascending
  !> from 0. A segment that cannot be flown has samples that are not numbers and a reason (module `status`; `exit_bad_case`: its
  !> start is not finite or beyond a rigid barrier). It is steady if its neighbours meet the same stops in the same order, none is
  !> grazed, and every sample has a derivative. A segment flies with all its neighbours in lanes, or in the event loop, so that they
  !> share their errors.
  pure subroutine propagate(family, start, first, times, derivatives, samples, report)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(in) :: derivatives
    type(samples_t), intent(out) :: samples
    type(report_t), intent(out) :: report
    type(flown_segment_t) :: flights(size(start, 2))
    type(batch_t) :: batch
    integer :: i, k, all
    all = size(start, 2)
    allocate (samples%motion(family%machine%sample_numbers, size(times)))
    if (derivatives) allocate (samples%slope(size(family%further) + size(start, 1), size(samples%motion, 1), size(times)))
    allocate (report%steady(all), source=.false.)
    batch%start = start
    batch%first = first
    batch%times = times
    allocate (batch%chosen(all))
    do i = 1, all
      batch%chosen(i) = first(i + 1) == first(i)
      if (.not. batch%chosen(i)) batch%chosen(i) = times(first(i + 1)) <= most_periods_in_lanes*family%machine%period
    end do
    batch%in_lanes = .true.
    call fly_batch(family, derivatives, batch, flights, samples, report%steady)
    report%in_lanes = count(batch%chosen)
    batch%chosen = .not. batch%chosen
    batch%in_lanes = .false.
    call fly_batch(family, derivatives, batch, flights, samples, report%steady)
    report%impacts = flights%count
    report%reason = flights%reason
    report%impact_segment = [(spread(i, 1, flights(i)%count), i=1, all)]
    allocate (report%impact(impact_numbers, size(report%impact_segment)))
    k = 0
    do i = 1, all
      report%impact(:, k + 1:k + flights(i)%count) = flights(i)%impact(:, :flights(i)%count)
      k = k + flights(i)%count
    end do
  end subroutine propagate

  !> Flies the segments of a batch and their neighbours. A segment that lanes leave, or a neighbour of it, is in the batch no more.
  pure subroutine fly_batch(family, derivatives, batch, flights, samples, steady)
    type(family_t), intent(in) :: family
    logical, intent(in) :: derivatives
    type(batch_t), intent(inout) :: batch
    type(flown_segment_t), intent(inout) :: flights(:)
    type(samples_t), intent(inout) :: samples
    logical, intent(inout) :: steady(:)
    type(flown_segment_t), allocatable :: adaptive(:)
    logical :: flown(size(flights))
    integer :: i, row
    call fly_all(family%machine, batch%start, batch, batch%chosen, flights)
    if (.not. any(batch%chosen)) return
    where (batch%chosen) steady = flights%reason == 0
    if (derivatives) then
      do i = 1, size(flights)
        if (.not. batch%chosen(i)) cycle
        steady(i) = steady(i) .and. .not. grazes(family, flights(i))
        samples%slope(:, :, batch%first(i) + 1:batch%first(i + 1)) = merge(0.0_wp, not_a_number(), flights(i)%reason == 0)
      end do
      allocate (adaptive(size(flights)))
      flown = batch%chosen .and. .not. batch%in_lanes
      if (allocated(family%adaptive)) call fly_all(family%adaptive%machine, batch%start, batch, flown, adaptive)
      do row = 1, size(samples%slope, 1)
        call differentiate(family, row, batch, flights, adaptive, samples%slope(row, :, :), steady)
        if (.not. any(batch%chosen)) return
      end do
    end if
    do i = 1, size(flights)
      if (batch%chosen(i)) call show_segment(family, batch%first(i) + 1, batch%first(i + 1), flights(i), samples)
    end do
  end subroutine fly_batch

  !> Flies segments from `start`; those that lanes leave are not `asked` for any more.
  pure subroutine fly_all(machine, start, batch, asked, flights)
    class(segment_machine_t), intent(in) :: machine
    real(wp), intent(in) :: start(:, :)
    type(batch_t), intent(inout) :: batch
    logical, intent(inout) :: asked(:)
    type(flown_segment_t), intent(inout) :: flights(:)
    integer :: i
    if (batch%in_lanes) then
      call machine%fly_in_lanes(start, batch%first, batch%times, asked, flights)
      return
    end if
    do i = 1, size(asked)
      if (asked(i)) call machine%fly(start(:, i), batch%times(batch%first(i) + 1:batch%first(i + 1)), batch%log, flights(i))
    end do
  end subroutine fly_all

  !> Derivatives along one direction, or by one number of the start, by differences between neighbours and the segments.
  pure subroutine differentiate(family, row, batch, flights, adaptive, slope, steady)
    type(family_t), intent(in) :: family
    integer, intent(in) :: row
    type(batch_t), intent(inout) :: batch
    type(flown_segment_t), intent(in) :: flights(:), adaptive(:)
    real(wp), intent(inout) :: slope(:, :)
    logical, intent(inout) :: steady(:)
    type(neighbours_t) :: near
    logical :: concerned(size(flights))
    integer :: i, k, turn
    k = row - size(family%further)
    concerned = flights%reason == 0
    if (k > 0) then
      if (.not. family%start_step(k) > 0) return
      ! A number that need not be given changes nothing.
      concerned = concerned .and. .not. ieee_is_nan(batch%start(k, :))
    else
      if (.not. abs(family%further(row)%step) > 0) return
      concerned = concerned .and. [(.not. is_untouched(family, family%further(row), flights(i)), i=1, size(flights))]
    end if
    near%open = spread(.true., 1, size(batch%times))
    allocate (near%flights(size(flights)))
    do turn = 1, 2
      near%wanted = [(batch%chosen(i) .and. concerned(i) .and. any(near%open(batch%first(i) + 1:batch%first(i + 1))), &
                      i=1, size(flights))]
      near%start = batch%start
      if (k > 0) then
        call fly_moved(family, k, turn, batch, near)
        call take_differences(flights, batch, near, slope, steady)
      else if (turn == 1) then
        call step_along(family%further(row), batch, flights, adaptive, near, slope, steady)
      else
        call step_along(family%back(row), batch, flights, adaptive, near, slope, steady)
      end if
    end do
    do i = 1, size(flights)
      if (.not. (batch%chosen(i) .and. concerned(i))) cycle
      if (any(near%open(batch%first(i) + 1:batch%first(i + 1)))) steady(i) = .false.
    end do
  end subroutine differentiate

  !> Whether a variant that differs at the barriers only cannot differ on a motion.
  pure logical function is_untouched(family, variant, flight)
    type(family_t), intent(in) :: family
    type(variant_t), intent(in) :: variant
    type(flown_segment_t), intent(in) :: flight
    is_untouched = .false.
    if (variant%contact_only .and. flight%count == 0) is_untouched = family%machine%never_meets(variant%machine, flight)
  end function is_untouched

  !> Flies neighbours whose starts are a step away in the number `k`, forth (`turn` 1) or back (2), where the barriers allow it.
  pure subroutine fly_moved(family, k, turn, batch, near)
    type(family_t), intent(in) :: family
    integer, intent(in) :: k, turn
    type(batch_t), intent(inout) :: batch
    type(neighbours_t), intent(inout) :: near
    logical :: asked(size(near%wanted))
    integer :: i, sense
    near%step = 0*near%start(k, :)
    do i = 1, size(asked)
      if (.not. near%wanted(i)) cycle
      sense = merge(-1, 1, family%is_speed(k) .and. near%start(k, i) < 0)
      if (turn == 2) sense = -sense
      near%start(k, i) = batch%start(k, i) + sense*family%start_step(k)
      near%step(i) = near%start(k, i) - batch%start(k, i)
      near%wanted(i) = abs(near%step(i)) > 0 .and. family%machine%allows(near%start(:, i))
    end do
    asked = near%wanted
    call fly_all(family%machine, near%start, batch, asked, near%flights)
    batch%chosen = batch%chosen .and. (asked .or. .not. near%wanted)
    near%wanted = asked
  end subroutine fly_moved

  !> The differences that a machine a step along a direction makes.
  pure subroutine step_along(variant, batch, flights, adaptive, near, slope, steady)
    type(variant_t), intent(in) :: variant
    type(batch_t), intent(inout) :: batch
    type(flown_segment_t), intent(in) :: flights(:), adaptive(:)
    type(neighbours_t), intent(inout) :: near
    real(wp), intent(inout) :: slope(:, :)
    logical, intent(inout) :: steady(:)
    logical :: asked(size(near%wanted))
    if (.not. abs(variant%step) > 0) return
    asked = near%wanted
    call fly_all(variant%machine, near%start, batch, asked, near%flights)
    batch%chosen = batch%chosen .and. (asked .or. .not. near%wanted)
    near%wanted = asked
    near%step = spread(variant%step, 1, size(asked))
    if (variant%leaves_exact .and. .not. batch%in_lanes) then
      call take_differences(adaptive, batch, near, slope, steady)
    else
      call take_differences(flights, batch, near, slope, steady)
    end if
  end subroutine step_along

  pure subroutine take_differences(base, batch, near, slope, steady)
    type(flown_segment_t), intent(in) :: base(:)
    type(batch_t), intent(in) :: batch
    type(neighbours_t), intent(inout) :: near
    real(wp), intent(inout) :: slope(:, :)
    logical, intent(inout) :: steady(:)
    integer :: i
    do i = 1, size(base)
      if (.not. near%wanted(i)) cycle
      associate (from => batch%first(i) + 1, to => batch%first(i + 1))
        call compare(base(i), near%flights(i), near%step(i), batch%times(from:to), near%open(from:to), slope(:, from:to), steady(i))
      end associate
    end do
  end subroutine take_differences

  !> Fills in the differences of a neighbour that is `step` away at the samples that are still open, but for those between an
  !> impact of the base and the same impact of the neighbour: there a velocity before it would be compared with one after it. A
  !> neighbour that could not be flown fills in none. Takes the steadiness away if the two do not meet the same stops.
  pure subroutine compare(base, other, step, times, open, slope, steady)
    type(flown_segment_t), intent(in) :: base, other
    real(wp), intent(in) :: step, times(:)
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: slope(:, :)
    integer, parameter :: what(2) = [impact_contact, impact_side]
    logical :: between(size(times))
    integer :: i
    if (other%reason /= 0) return
    if (other%count /= base%count) then
      steady = .false.
    else if (any(nint(other%impact(what, :base%count)) /= nint(base%impact(what, :base%count)))) then
      steady = .false.
    end if
    between = between_impacts(base, other, times)
    do i = 1, size(times)
      if (open(i) .and. .not. between(i)) slope(:, i) = (other%motion(:, i) - base%motion(:, i))/step
    end do
    open = open .and. between
  end subroutine compare

  !> Which of `times` lie between an impact of the base and the same impact of a neighbour, to rounding.
  pure function between_impacts(base, other, times) result(between)
    type(flown_segment_t), intent(in) :: base, other
    real(wp), intent(in) :: times(:)
    logical :: between(size(times))
    real(wp) :: rounding
    integer :: i
    between = .false.
    do i = 1, min(base%count, other%count)
      associate (here => base%impact(impact_time, i), there => other%impact(impact_time, i))
        rounding = 32*epsilon(1.0_wp)*(base%origin + here)
        between = between .or. (times >= min(here, there) - rounding .and. times <= max(here, there) + rounding)
      end associate
    end do
  end function between_impacts

  !> Whether a motion turns round so close to a barrier, or meets one so slowly, that the steps are not small against it.
  pure logical function grazes(family, flight)
    type(family_t), intent(in) :: family
    type(flown_segment_t), intent(in) :: flight
    grazes = flight%grazing_margin < family%least_clearance .or. &
             any(flight%impact(speed_before, :flight%count) < family%least_speed)
  end function grazes

  !> Samples `from` to `to` of a segment as sensors show them.
  pure subroutine show_segment(family, from, to, flight, samples)
    type(family_t), intent(in) :: family
    integer, intent(in) :: from, to
    type(flown_segment_t), intent(in) :: flight
    type(samples_t), intent(inout) :: samples
    if (allocated(samples%slope) .and. flight%reason == 0) then
      call family%machine%show(flight, samples%motion(:, from:to), family%of_sensor, samples%slope(:, :, from:to))
    else
      call family%machine%show(flight, samples%motion(:, from:to))
    end if
  end subroutine show_segment

end module segments
