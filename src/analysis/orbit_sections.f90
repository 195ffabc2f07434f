! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The section points of a periodic orbit, and how it is begun anew where an instant passes the section.
module orbit_sections
  use guards, only: turns_round
  use hybrid_machine, only: event_t, hybrid_t, most_states
  use kinds, only: wp
  use periodic_orbit, only: orbit_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: rotate_to_section, section_points, begun_at

contains

  !> Where an instant has passed the section, the orbit is begun anew so that all instants lie within its period. `turned`: whether
  !> it was.
  pure subroutine rotate_to_section(machines, orbit, turned)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    logical, intent(out) :: turned
    type(event_t) :: moved
    real(wp), dimension(size(orbit%y)) :: y, from
    real(wp) :: span
    integer :: m
    turned = .false.
    m = size(orbit%events)
    if (m == 0) return
    if (.not. machines%centre%has_clock) then
      call rotate_to_event(machines%centre, orbit, turned)
      return
    end if
    span = orbit%periods*machines%centre%period
    if (orbit%events(1)%time < 0) then
      moved = orbit%events(1)
      call machines%centre%fly(moved%after, moved%time, moved%departure(:size(y)), 0.0_wp, y)
      orbit%mode = moved%after
      moved%time = moved%time + span
      orbit%events = [orbit%events(2:), moved]
    else if (orbit%events(m)%time > span) then
      moved = orbit%events(m)
      from = orbit%y
      if (m > 1) from = orbit%events(m - 1)%departure(:size(y))
      if (m > 1) call machines%centre%fly(moved%before, orbit%events(m - 1)%time, from, span, y)
      if (m == 1) call machines%centre%fly(moved%before, 0.0_wp, from, span, y)
      orbit%mode = moved%before
      moved%time = moved%time - span
      orbit%events = [moved, orbit%events(:m - 1)]
    else
      return
    end if
    orbit%y = y
    turned = .true.
  end subroutine rotate_to_section

  !> The same without a clock: the last event is the section.
  pure subroutine rotate_to_event(machine, orbit, turned)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(inout) :: orbit
    logical, intent(out) :: turned
    type(event_t) :: moved, section
    real(wp) :: y(size(orbit%y)), turn(most_states)
    integer :: m
    turned = .false.
    m = size(orbit%events)
    if (m < 2) return
    section = orbit%events(m)
    ! Every turn of a crank begins at the angle 0.
    turn = 0
    if (machine%crank_section) turn = section%arrival - section%departure
    if (orbit%events(1)%time < 0) then
      moved = orbit%events(1)
      call machine%fly(moved%after, moved%time, moved%departure(:size(y)), 0.0_wp, y)
      orbit%mode = moved%after
      moved%time = moved%time + section%time
      moved%arrival = moved%arrival + turn
      moved%departure = moved%departure + turn
      orbit%events = [orbit%events(2:m - 1), moved, section]
    else if (orbit%events(m - 1)%time > section%time) then
      moved = orbit%events(m - 1)
      if (m > 2) then
        associate (last => orbit%events(m - 2))
          call machine%fly(moved%before, last%time, last%departure(:size(y)), section%time, y)
        end associate
      else
        call machine%fly(moved%before, 0.0_wp, orbit%y, section%time, y)
      end if
      orbit%mode = moved%before
      moved%time = moved%time - section%time
      moved%arrival = moved%arrival - turn
      moved%departure = moved%departure - turn
      y = y - turn(:size(y))
      orbit%events = [moved, orbit%events(:m - 2), section]
    else
      return
    end if
    orbit%events(m)%after = orbit%mode
    orbit%y = y
    turned = .true.
  end subroutine rotate_to_event

  !> The section points of an orbit, period by period.
  pure function section_points(machines, orbit) result(points)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp) :: points(size(orbit%y), orbit%periods)
    real(wp) :: y(size(orbit%y)), t, section
    integer :: i, k, mode
    points = spread(orbit%y, 2, orbit%periods)
    if (.not. machines%centre%has_clock) then
      i = 1
      do k = 1, size(orbit%events) - 1
        if (orbit%events(k)%guard /= turns_round .or. i == orbit%periods) cycle
        i = i + 1
        points(:, i) = orbit%events(k)%departure(:size(y))
      end do
      return
    end if
    y = orbit%y
    t = 0
    mode = orbit%mode
    k = 0
    do i = 1, orbit%periods - 1
      section = i*machines%centre%period
      do while (k < size(orbit%events))
        if (orbit%events(k + 1)%time > section) exit
        k = k + 1
        y = orbit%events(k)%departure(:size(y))
        t = orbit%events(k)%time
        mode = orbit%events(k)%after
      end do
      call machines%centre%fly(mode, t, y, section, points(:, i + 1))
    end do
  end function section_points

  !> The orbit begun at its section point number `k`: the same events from there on. Their states stay as they are, and so do the
  !> multipliers.
  pure type(orbit_t) function begun_at(machines, orbit, k) result(begun)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    real(wp) :: points(size(orbit%y), orbit%periods), from, span
    integer :: before, i
    begun = orbit
    if (k == 1) return
    points = section_points(machines, orbit)
    begun%y = points(:, k)
    if (machines%centre%has_clock) then
      from = (k - 1)*machines%centre%period
      span = orbit%periods*machines%centre%period
      before = count(orbit%events%time <= from)
    else
      before = 0
      do i = 1, k - 1
        before = before + findloc(orbit%events(before + 1:)%guard, turns_round, 1)
      end do
      from = orbit%events(before)%time
      span = orbit%events(size(orbit%events))%time
    end if
    if (before > 0) begun%mode = orbit%events(before)%after
    begun%events = [orbit%events(before + 1:), orbit%events(:before)]
    begun%events%time = begun%events%time - from
    i = size(orbit%events) - before
    begun%events(i + 1:)%time = begun%events(i + 1:)%time + span
  end function begun_at

end module orbit_sections
