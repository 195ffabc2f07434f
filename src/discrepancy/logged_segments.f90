! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Segments flown by an event loop that writes a log: period by period to the last sample.
module logged_segments
  use kinds, only: wp
  use machine_type, only: section_state_t
  use motion_state, only: log_t, tally_t
  use segment_machine, only: begin_flight, end_flight, flown_segment_t, segment_machine_t
  implicit none
  private

  type, abstract, extends(segment_machine_t), public :: logged_segments_t
  contains
    procedure(begin_interface), deferred :: begin
    procedure(move_interface), deferred :: move
    procedure(take_interface), deferred :: take
    procedure :: fly
  end type logged_segments_t

  abstract interface
    !> The state at a start that is allowed, and its time [s on the clock of the log]; `reason` is not 0 if there is none.
    pure subroutine begin_interface(self, start, section, origin, tally, reason)
      import :: section_state_t, logged_segments_t, tally_t, wp
      class(logged_segments_t), intent(in) :: self
      real(wp), intent(in) :: start(:)
      type(section_state_t), intent(inout) :: section
      real(wp), intent(out) :: origin
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
    end subroutine begin_interface

    !> Moves to `until` [s after the section], or without it over a drive period.
    pure subroutine move_interface(self, section, tally, reason, log, until)
      import :: log_t, section_state_t, logged_segments_t, tally_t, wp
      class(logged_segments_t), intent(in) :: self
      type(section_state_t), intent(inout) :: section
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
      type(log_t), intent(inout) :: log
      real(wp), intent(in), optional :: until
    end subroutine move_interface

    !> Puts samples, unless the flight was given up, and impacts of a log into a flight; the last samples are of the state now.
    pure subroutine take_interface(self, section, tally, log, flight)
      import :: flown_segment_t, log_t, section_state_t, logged_segments_t, tally_t
      class(logged_segments_t), intent(in) :: self
      type(section_state_t), intent(in) :: section
      type(tally_t), intent(in) :: tally
      type(log_t), intent(in) :: log
      type(flown_segment_t), intent(inout) :: flight
    end subroutine take_interface
  end interface

contains

  pure subroutine fly(self, start, times, log, flight)
    class(logged_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:), times(:)
    type(log_t), intent(inout) :: log
    type(flown_segment_t), intent(out) :: flight
    type(section_state_t) :: section
    type(tally_t) :: tally
    call begin_flight(self, size(times), log, flight)
    if (self%allows(start)) call self%begin(start, section, flight%origin, tally, flight%reason)
    if (flight%reason == 0) then
      log%instants = flight%origin + times
      if (size(times) > 0) call move_to(self, log%instants(size(times)), section, tally, log, flight%reason)
    end if
    call self%take(section, tally, log, flight)
    call end_flight(flight)
  end subroutine fly

  !> Moves to `until` [s on the clock of the log].
  pure subroutine move_to(self, until, section, tally, log, reason)
    class(logged_segments_t), intent(in) :: self
    real(wp), intent(in) :: until
    type(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout) :: log
    integer, intent(inout) :: reason
    do while (until - log%origin >= self%period)
      call self%move(section, tally, reason, log)
      if (reason /= 0) return
      ! Budgets are of one period.
      tally%events = 0
      tally%steps = 0
    end do
    call self%move(section, tally, reason, log, until - log%origin)
  end subroutine move_to

end module logged_segments
