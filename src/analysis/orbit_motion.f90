! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Between a motion and a periodic orbit: the orbit that a motion suggests, and whether the motion from an orbit's section point is
!> that orbit.
module orbit_motion
  use kinds, only: wp
  use motion_state, only: tally_t
  use periodic_orbit, only: orbit_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: orbit_of_motion, same_sequence, is_admissible

  !> Orbits with more events are not followed.
  integer, parameter, public :: most_events = 60
  !> A motion with the events of an orbit at other instants than this share of 1/frequency is not that orbit.
  real(wp), parameter :: likeness = 1e-5_wp

contains

  !> The orbit near which a motion that starts at `y` on the section is for `periods` drive periods, not yet corrected.
  subroutine orbit_of_motion(machines, parameter, y, periods, orbit, ok)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: parameter, y(:)
    integer, intent(in) :: periods
    type(orbit_t), intent(out) :: orbit
    logical, intent(out) :: ok
    type(tally_t) :: tally
    integer :: i
    real(wp) :: image(size(y))
    orbit%periods = periods
    orbit%parameter = parameter
    orbit%y = y
    orbit%multipliers = [(cmplx(0.0_wp, 0.0_wp, wp), i=1, size(y))]
    allocate (orbit%matrix(size(y), size(y)), source=0.0_wp)
    call machines%centre%fly_sections(y, periods, .true., image, orbit%events, orbit%mode, tally, ok)
    if (ok) ok = size(orbit%events) <= most_events
  end subroutine orbit_of_motion

  !> Whether two orbits have the same events in the same order.
  pure logical function same_sequence(one, other) result(same)
    type(orbit_t), intent(in) :: one, other
    same = one%periods == other%periods .and. size(one%events) == size(other%events)
    if (same) same = all(one%events%kind == other%events%kind) .and. all(one%events%side == other%events%side) .and. &
      all(one%events%joint == other%events%joint) .and. all(one%events%guard == other%events%guard)
  end function same_sequence

  !> Whether the motion that starts at the orbit's section point really has its events at its instants.
  logical function is_admissible(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    type(orbit_t) :: motion
    real(wp) :: allowed
    call orbit_of_motion(machines, orbit%parameter, orbit%y, orbit%periods, motion, is_admissible)
    if (is_admissible) is_admissible = same_sequence(motion, orbit)
    if (.not. is_admissible) return
    allowed = likeness*machines%centre%period*max(1.0_wp, abs(orbit%multipliers(1))*1e-3_wp)
    is_admissible = all(abs(motion%events%time - orbit%events%time) <= allowed)
  end function is_admissible

end module orbit_motion
