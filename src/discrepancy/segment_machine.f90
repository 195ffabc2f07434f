! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine of which segments are flown: all that their engine needs. Another kind of machine is another extension of
!> `segment_machine_t`.
module segment_machine
  use kinds, only: wp
  use machine_type, only: scales_t
  use motion_state, only: log_t
  use status, only: exit_bad_case
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: add_impact, begin_flight, end_flight, not_a_number

  !> Numbers of an impact: time since the start of the segment [s], number of the contact, its speed before and after [m/s] (of a
  !> soft contact: when it ends, not a number if it lasts), +1 upper or -1 lower stop.
  integer, parameter, public :: impact_numbers = 5
  integer, parameter, public :: impact_time = 1, impact_contact = 2, speed_before = 3, speed_after = 4, impact_side = 5

  !> One flight of one segment.
  type, public :: flown_segment_t
    integer :: reason = 0, count = 0
    !> Start of the segment on the clock of the log [s].
    real(wp) :: origin = 0
    !> Column = impact; column = sample.
    real(wp), allocatable :: impact(:, :), motion(:, :)
    !> Smallest distance to a barrier at a turning point that missed it [m]; bounds of the position [m].
    real(wp) :: grazing_margin = huge(1.0_wp), x_max = -huge(1.0_wp), x_min = huge(1.0_wp)
  end type flown_segment_t

  type, abstract, public :: segment_machine_t
    !> Numbers of a start, and of a sample.
    integer :: start_numbers = 0, sample_numbers = 0
    type(scales_t) :: sizes
    !> Drive period, or turn of a motor without load [s].
    real(wp) :: period = 0
    !> No mode is flown adaptively.
    logical :: closed_form = .false.
  contains
    procedure(obstacle_interface), deferred :: obstacle
    procedure(steps_interface), deferred :: set_steps
    procedure(allows_interface), deferred :: allows
    procedure(fly_interface), deferred :: fly
    procedure :: fly_in_lanes
    procedure :: never_meets
    procedure :: show
  end type segment_machine_t

  abstract interface
    !> Why a start of a segment does not determine what follows; '' if it does.
    pure function obstacle_interface(self) result(text)
      import :: segment_machine_t
      class(segment_machine_t), intent(in) :: self
      character(len=:), allocatable :: text
    end function obstacle_interface

    !> Steps of the numbers of a start, from those of a position [m], a velocity [m/s] and an angle [rad]; 0: nothing depends on
    !> it. Numbers that are `speeds` are first made larger, so that what moves slowly does not turn round.
    pure subroutine steps_interface(self, unit, steps, speeds)
      import :: segment_machine_t, wp
      class(segment_machine_t), intent(in) :: self
      real(wp), intent(in) :: unit(3)
      real(wp), intent(out) :: steps(:)
      logical, intent(out) :: speeds(:)
    end subroutine steps_interface

    !> Whether a start has the numbers that it needs, and is not beyond a rigid barrier.
    pure logical function allows_interface(self, start)
      import :: segment_machine_t, wp
      class(segment_machine_t), intent(in) :: self
      real(wp), intent(in) :: start(:)
    end function allows_interface

    !> One segment, sampled at `times` [s since its start]. `log` is the caller's.
    pure subroutine fly_interface(self, start, times, log, flight)
      import :: flown_segment_t, log_t, segment_machine_t, wp
      class(segment_machine_t), intent(in) :: self
      real(wp), intent(in) :: start(:), times(:)
      type(log_t), intent(inout) :: log
      type(flown_segment_t), intent(out) :: flight
    end subroutine fly_interface
  end interface

contains

  !> Begins a flight that is not allowed until it is, with so many samples, and a log for it.
  pure subroutine begin_flight(machine, samples, log, flight)
    class(segment_machine_t), intent(in) :: machine
    integer, intent(in) :: samples
    type(log_t), intent(inout) :: log
    type(flown_segment_t), intent(inout) :: flight
    log%sample_interval = 1
    log%balance%kept = .false.
    log%origin = 0
    log%events = 0
    log%samples = 0
    log%next_sample = 0
    allocate (flight%motion(machine%sample_numbers, samples), flight%impact(impact_numbers, 4))
    flight%reason = exit_bad_case
  end subroutine begin_flight

  !> A flight that was given up has no samples.
  pure subroutine end_flight(flight)
    type(flown_segment_t), intent(inout) :: flight
    if (flight%reason /= 0) flight%motion = not_a_number()
  end subroutine end_flight

  !> Flies the segments that are `asked` for, where lanes can take them; those that they leave are not asked for any more.
  pure subroutine fly_in_lanes(self, start, first, times, asked, flights)
    class(segment_machine_t), intent(in) :: self
    real(wp), intent(in) :: start(:, :), times(:)
    integer, intent(in) :: first(:)
    logical, intent(inout) :: asked(:)
    type(flown_segment_t), intent(inout) :: flights(:)
    asked = .false.
  end subroutine fly_in_lanes

  !> Whether a flight without impacts stays away from the stops, also from those of a machine that differs in them alone.
  pure logical function never_meets(self, other, flight)
    class(segment_machine_t), intent(in) :: self, other
    type(flown_segment_t), intent(in) :: flight
    never_meets = .false.
  end function never_meets

  !> From a flight to what sensors show, and from its derivatives `slope` (number of the sample, sample, row: directions, then
  !> numbers of the start) to theirs. `of_sensor`: see `family_t`.
  pure subroutine show(self, flight, motion, of_sensor, slope)
    class(segment_machine_t), intent(in) :: self
    type(flown_segment_t), intent(in) :: flight
    real(wp), intent(out) :: motion(:, :)
    real(wp), intent(in), optional :: of_sensor(:, :)
    real(wp), intent(inout), optional :: slope(:, :, :)
    motion = flight%motion
  end subroutine show

  !> Adds an impact to a flight.
  pure subroutine add_impact(flight, impact)
    type(flown_segment_t), intent(inout) :: flight
    real(wp), intent(in) :: impact(impact_numbers)
    if (flight%count == size(flight%impact, 2)) flight%impact = reshape(flight%impact, [impact_numbers, 2*flight%count], &
                                                                        pad=[0.0_wp])
    flight%count = flight%count + 1
    flight%impact(:, flight%count) = impact
  end subroutine add_impact

  pure real(wp) function not_a_number()
    not_a_number = ieee_value(1.0_wp, ieee_quiet_nan)
  end function not_a_number

end module segment_machine
