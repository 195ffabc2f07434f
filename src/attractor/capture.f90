! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a motion under way has converged to an attractor of a catalogue.
module capture
  use attractors, only: attractor_t, find_capture, most_coordinates, squared_distance
  use kinds, only: wp
  use machine_type, only: copy_of, machine_t, section_state_t
  use motion_state, only: tally_t
  use rest_sets, only: rest_set_of
  implicit none
  private

  public :: attractor_reached, attractor_reached_at, stays_in_family

  !> Relative change of the speed of a crank in a turn below which it is steady.
  real(wp), parameter :: steady = 1e-9_wp

contains

  !> Index of the attractor to which the motion has converged at the end of a drive period, 0 if none. `slipped`: whether the body
  !> moved during the last whole period. For the cycles of a machine without a clock a copy goes on to the section.
  pure integer function attractor_reached(moving, catalogue, section, slipped) result(found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    class(section_state_t), intent(in) :: section
    logical, intent(in) :: slipped
    logical :: rests
    found = 0
    if (size(catalogue) == 0) return
    if (.not. (moving%timed .or. section%passed)) then
      if (moving%bound_to_rest(section)) found = rest_set_of(moving, catalogue, moving%point_of(section))
      return
    end if
    rests = moving%rest_lasts .and. .not. slipped
    if (rests .and. .not. moving%timed) rests = goes_on_turning(moving, section)
    found = attractor_reached_at(moving, catalogue, moving%point_of(section), .not. rests)
    if (found == 0 .and. any(catalogue%by_event)) found = attractor_at_turn(moving, catalogue, section)
  end function attractor_reached

  !> The attractor without a clock that the motion has reached at its next turn, 0 if none.
  pure integer function attractor_at_turn(moving, catalogue, section) result(found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    class(section_state_t), intent(in) :: section
    type(section_state_t) :: later
    type(tally_t) :: unused
    integer :: reason
    found = 0
    later = copy_of(section)
    call moving%advance_to_turn(later, unused, reason)
    if (reason == 0) found = find_capture(catalogue, moving%turn_point(later), .true., by_event=.true.)
  end function attractor_at_turn

  !> Whether a crank beside a body at rest keeps its speed, or gains: all that follows is then no slower.
  pure logical function goes_on_turning(moving, section) result(goes_on)
    class(machine_t), intent(in) :: moving
    class(section_state_t), intent(in) :: section
    type(section_state_t) :: later
    type(tally_t) :: tally
    integer :: reason
    later = copy_of(section)
    call moving%begin_tally(later, tally)
    call moving%advance_to_section(later, tally, reason)
    goes_on = reason == 0 .and. tally%slips == 0 .and. later%motor%w >= section%motor%w*(1 - steady)
  end function goes_on_turning

  !> The same of a section point; of one at rest the positions of rest to which it belongs come first.
  pure integer function attractor_reached_at(moving, catalogue, point, slipped) result(found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    logical, intent(in) :: slipped
    found = find_capture(catalogue, point, slipped)
    if (found == 0) return
    if (catalogue(found)%rests) found = rest_set_of(moving, catalogue, point)
    if (found == 0) found = find_capture(catalogue, point, .true.)
  end function attractor_reached_at

  !> Whether a motion on the section, with what was counted since its window began, has settled at one of a family of cycles, each
  !> at a position of its own between the stops, and stays there: it is in the neighbourhood verified without stops, and what is
  !> left of its drift, |d| p T/(1 - |multiplier|) with the multiplier of p periods, is less than half of the distance at which it
  !> misses the stops.
  pure logical function stays_in_family(moving, catalogue, section, tally)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    real(wp) :: point(most_coordinates), drift
    integer :: k, i, n
    stays_in_family = .false.
    if (tally%impacts > 0 .or. .not. any(catalogue%any_position)) return
    point = moving%point_of(section)
    do k = 1, size(catalogue)
      associate (attractor => catalogue(k), after => catalogue(k)%positions + 1)
        if (.not. attractor%any_position .or. attractor%multiplier >= 1) cycle
        n = attractor%coordinates
        do i = 1, attractor%period
          if (squared_distance(attractor, i, point(after:)) > attractor%capture_radius**2) cycle
          drift = attractor%scale(moving%speed_number - attractor%positions) &
                  *attractor%period*moving%period/(1 - attractor%multiplier) &
                  *sum(abs(point(after:after + n - 1) - attractor%points(:n, i))/attractor%scale(:n))
          stays_in_family = moving%stays_clear(section, tally, attractor%period, 2*drift)
          if (stays_in_family) return
        end do
      end associate
    end do
  end function stays_in_family

end module capture
