! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One flight of one segment of a body, by whatever flew it, and what a flight of a neighbour makes of derivatives.
module segment_flight
  use contact_law, only: barrier_positions, beyond_barrier
  use kinds, only: wp
  use motion, only: motion_t
  use variants, only: family_t, sensor_bias, sensor_delay, sensor_gain, variant_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: start_allowed, moved_start, between_impacts, add_differences, differentiate_sensor, grazes, untouched

  type, public :: flight_t
    integer :: reason = 0, count = 0
    !> Start of the segment on the clock of the impacts [s].
    real(wp) :: origin = 0
    !> Rows of `impact` in `report_t`.
    real(wp), allocatable :: impact(:, :)
    real(wp), allocatable :: x(:), v(:)
    !> Smallest distance to a barrier at a turning point that missed it [m]; bounds of the position [m].
    real(wp) :: grazing_margin = huge(1.0_wp), x_max = -huge(1.0_wp), x_min = huge(1.0_wp)
  end type flight_t

contains

  !> Whether a start is finite and not beyond a rigid barrier.
  pure logical function start_allowed(moving, start)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3)
    start_allowed = all(ieee_is_finite(start))
    if (start_allowed) start_allowed = .not. beyond_barrier(moving%machine%contact, start(1))
  end function start_allowed

  !> The start a step away in coordinate `k`, forth (`turn` 1) or back (2). A velocity is first made larger, so that a slow body
  !> does not turn round.
  pure function moved_start(family, start, k, turn) result(moved)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: start(3)
    integer, intent(in) :: k, turn
    real(wp) :: moved(3)
    integer :: sense
    sense = merge(-1, 1, k == 2 .and. start(2) < 0)
    if (turn == 2) sense = -sense
    moved = start
    moved(k) = start(k) + sense*family%start_step(k)
  end function moved_start

  !> Which of `times` lie between an impact of the base and the same impact of a neighbour, to rounding; impacts are counted from a
  !> start at `origin` [s], which their instants have been taken off.
  pure function between_impacts(base, other, origin, times) result(between)
    real(wp), intent(in) :: base(:), other(:), origin, times(:)
    logical :: between(size(times))
    real(wp) :: rounding
    integer :: i
    between = .false.
    do i = 1, min(size(base), size(other))
      rounding = 32*epsilon(1.0_wp)*(origin + base(i))
      between = between .or. (times >= min(base(i), other(i)) - rounding .and. times <= max(base(i), other(i)) + rounding)
    end do
  end function between_impacts

  !> Fills in the differences of a neighbour that is `step` away at the samples that are still open, but for those
  !> between an impact of the base and the same impact of the neighbour: there a velocity before it would be compared with
  !> one after it. A neighbour that could not be flown fills in none. Takes the steadiness away if the two do not meet the same
  !> barriers.
  pure subroutine add_differences(base, other, step, times, open, x_slope, v_slope, steady)
    type(flight_t), intent(in) :: base, other
    real(wp), intent(in) :: step, times(:)
    logical, intent(inout) :: open(:), steady
    real(wp), intent(inout) :: x_slope(:), v_slope(:)
    logical :: between(size(times))
    integer :: i
    if (other%reason /= 0) return
    if (other%count /= base%count) then
      steady = .false.
    else if (any(abs(other%impact(4, :base%count) - base%impact(4, :base%count)) > 0)) then
      steady = .false.
    end if
    between = between_impacts(base%impact(1, :base%count), other%impact(1, :other%count), base%origin, times)
    do i = 1, size(times)
      if (.not. open(i) .or. between(i)) cycle
      x_slope(i) = (other%x(i) - base%x(i))/step
      v_slope(i) = (other%v(i) - base%v(i))/step
    end do
    open = open .and. between
  end subroutine add_differences

  !> From derivatives of the position to those of what the sensor shows, and those by the sensor's own parameters. A delay
  !> is an angle by which the crank was behind.
  pure subroutine differentiate_sensor(family, base, x_slope, v_slope)
    type(family_t), intent(in) :: family
    type(flight_t), intent(in) :: base
    real(wp), intent(inout) :: x_slope(:, :), v_slope(:, :)
    real(wp) :: behind
    integer :: row, crank
    crank = size(x_slope, 1)
    if (abs(family%moving%machine%sensor%gain) > 0) x_slope = (1 + family%moving%machine%sensor%gain)*x_slope
    do row = 1, size(family%further)
      associate (along => family%of_sensor(:, row))
        if (.not. any(abs(along) > 0)) cycle
        behind = along(sensor_delay)*family%moving%machine%drive_frequency
        x_slope(row, :) = x_slope(row, :) + along(sensor_bias) + along(sensor_gain)*base%x(:size(x_slope, 2)) &
                          - behind*x_slope(crank, :)
        v_slope(row, :) = v_slope(row, :) - behind*v_slope(crank, :)
      end associate
    end do
  end subroutine differentiate_sensor

  !> Whether a motion turns round so close to a barrier, or meets one so slowly, that the steps are not small against it.
  pure logical function grazes(family, flight)
    type(family_t), intent(in) :: family
    type(flight_t), intent(in) :: flight
    grazes = flight%grazing_margin < family%least_clearance .or. any(flight%impact(2, :flight%count) < family%least_speed)
  end function grazes

  !> Whether a variant that differs at the barriers only cannot differ on a motion.
  pure logical function untouched(moving, variant, flight)
    type(motion_t), intent(in) :: moving
    type(variant_t), intent(in) :: variant
    type(flight_t), intent(in) :: flight
    real(wp) :: here(2), there(2)
    untouched = .false.
    if (.not. variant%contact_only .or. flight%count > 0) return
    here = barrier_positions(moving%machine%contact)
    there = barrier_positions(variant%moving%machine%contact)
    untouched = flight%x_max < min(here(1), there(1)) .and. flight%x_min > max(here(2), there(2))
  end function untouched

end module segment_flight
