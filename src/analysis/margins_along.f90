! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The margins of a periodic orbit of any machine: one walk over its events and flights.
module margins_along
  use body_margins, only: add_body_event, least_margins_t, least_of_flights, look_along_body
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use orbit_margins, only: margins_t, orbit_flight_t
  use periodic_orbit, only: closing_time, orbit_t
  use structure, only: structure_t
  use structure_margins, only: add_structure_event, look_along_structure
  implicit none
  private

  public :: margins_of_machine

contains

  !> The margins of an orbit whose events have their states; all in natural units. Of one body: one per event and kind, then the
  !> least within its flights. `events_only`: those between the events of a structure, which take longest, and its extremes are left
  !> out.
  pure function margins_of_machine(machine, orbit, events_only) result(margins)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    logical, intent(in), optional :: events_only
    type(margins_t) :: margins
    type(orbit_flight_t) :: flight
    type(least_margins_t) :: least
    integer :: k, m, n
    logical :: looks_too
    looks_too = .true.
    if (present(events_only)) looks_too = .not. events_only
    m = size(orbit%events)
    n = machine%n
    allocate (margins%list(0))
    flight%mode = orbit%mode
    flight%start(:n) = orbit%y
    do k = 0, m
      flight%event = k
      if (k > 0) then
        flight%mode = orbit%events(k)%after
        flight%from = orbit%events(k)%time
        flight%start = orbit%events(k)%departure
      end if
      flight%until = closing_time(machine, orbit)
      if (k < m) flight%until = orbit%events(k + 1)%time
      select type (machine)
      type is (structure_t)
        if (k > 0) call add_structure_event(machine, orbit, k, margins%list)
        if (looks_too .and. flight%until > flight%from) call look_along_structure(machine, orbit, flight, margins)
      class default
        if (k > 0) call add_body_event(machine, orbit, k, margins%list, least)
        call look_along_body(machine, orbit, flight, least, margins)
      end select
    end do
    select type (machine)
    type is (structure_t)
    class default
      margins%list = [margins%list, least_of_flights(least)]
    end select
  end function margins_of_machine

end module margins_along
