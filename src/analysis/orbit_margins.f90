! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How far a periodic orbit is from having another sequence of events: margins that are positive as long as the motion really
!> has its events and no others, and pass through zero where it grazes a barrier, begins or ends to stick, or is released no more.
module orbit_margins
  use hybrid_machine, only: most_states
  use kinds, only: wp
  use motion_state, only: event_impact_lower, event_impact_upper
  implicit none
  private

  public :: is_impact, is_between, same_meaning

  !> What a margin is of: the speed of an impact or of a touch; the distance to a barrier that is missed; the excess of the
  !> force at a turning point over what would hold the body; the reserve of friction at the beginning of a stick; the rate at
  !> which the force reaches break-away; the speed in a slip; the time between two events; the reserve of friction while a joint
  !> sticks; the force while a contact is closed.
  integer, parameter, public :: of_impact = 1, of_gap = 2, of_turning = 3, of_stick = 4, of_release = 5, of_slip = 6, &
    of_order = 7, of_hold = 8, of_press = 9
  !> Looks along a flight, per period of the section; steps of the secant rule at most.
  integer, parameter, public :: looks = 96, most_secants = 60

  type, public :: margin_t
    real(wp) :: value = huge(1.0_wp)
    integer :: kind = 0
    !> Which event, or after which one; the side of a gap, or the direction of a slip.
    integer :: event = 0, side = 0
    !> Instant [s].
    real(wp) :: time = 0
    !> Of a structure: the joint, and its guard.
    integer :: joint = 0, guard = 0
  end type margin_t

  !> The margins of an orbit: one per event and kind, then the smallest gaps above and below and the slowest slip. Extremes of x.
  type, public :: margins_t
    type(margin_t), allocatable :: list(:)
    real(wp) :: x_max = -huge(1.0_wp), x_min = huge(1.0_wp)
  end type margins_t

  !> A flight of an orbit: after which event (0: from the section), in which mode, from when to when [s], and where it starts.
  type, public :: orbit_flight_t
    integer :: event = 0, mode = 0
    real(wp) :: from = 0, until = 0, start(most_states) = 0
  end type orbit_flight_t

contains

  pure elemental logical function is_impact(kind)
    integer, intent(in) :: kind
    is_impact = kind == event_impact_upper .or. kind == event_impact_lower
  end function is_impact

  !> Whether a margin is of what does not happen, within a flight.
  pure elemental logical function is_between(margin)
    type(margin_t), intent(in) :: margin
    is_between = any(margin%kind == [of_gap, of_slip, of_hold, of_press])
  end function is_between

  !> Whether a margin of one orbit means what that of another means.
  pure logical function same_meaning(one, other) result(same)
    type(margin_t), intent(in) :: one, other
    same = one%kind == other%kind .and. one%joint == other%joint .and. one%guard == other%guard
    if (any(one%kind == [of_gap, of_hold])) same = same .and. one%side == other%side
    if (.not. is_between(one)) same = same .and. one%event == other%event
  end function same_meaning

end module orbit_margins
