! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Of margins that pass zero together the one that is the cause: an impact that is lost, events that change their order, a stick
!> that is over.
module margin_cause
  use kinds, only: wp
  use motion_state, only: event_release, event_stick
  use orbit_margins, only: margin_t, margins_t, of_hold, of_impact, of_order, of_slip, of_stick, of_turning
  use periodic_orbit, only: orbit_t
  implicit none
  private

  public :: cause_of

  !> Margins within this of 0 are zero together.
  real(wp), parameter, public :: together = 1e-9_wp

contains

  !> The number of the margin that `candidate` is zero with, and because of; 0 without.
  pure integer function cause_of(orbit, margins, candidate) result(number)
    type(orbit_t), intent(in) :: orbit
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: candidate
    number = lost_impact(margins, candidate)
    if (number == 0) number = changed_order(orbit, margins, candidate)
    if (number == 0) number = ended_stick(orbit, margins, candidate)
  end function cause_of

  !> The number of an impact that loses its speed where friction between the same bodies would turn round with it: the slide's
  !> margin passes zero with it; 0 without.
  pure integer function lost_impact(margins, candidate) result(number)
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: candidate
    number = 0
    if (all(candidate%kind /= [of_turning, of_stick, of_slip, of_hold])) return
    do number = 1, size(margins%list)
      if (margins%list(number)%kind == of_impact .and. abs(margins%list(number)%value) <= together) return
    end do
    number = 0
  end function lost_impact

  !> The number of the order of two events of different joints that are exchanged, where what the first has just done to its own
  !> guard seems to be undone after the second: that margin passes zero with it; 0 without.
  pure integer function changed_order(orbit, margins, candidate) result(number)
    type(orbit_t), intent(in) :: orbit
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: candidate
    do number = 1, size(margins%list)
      associate (one => margins%list(number))
        if (one%kind /= of_order .or. one%event /= -candidate%event - 1 .or. .not. abs(one%value) <= together) cycle
        if (orbit%events(one%event - 1)%joint == candidate%joint .and. orbit%events(one%event)%joint /= candidate%joint) return
      end associate
    end do
    number = 0
  end function changed_order

  !> The number of the margin of a stick that is over as soon as it begins, where the order of its two events passes zero with it; 0
  !> without.
  pure integer function ended_stick(orbit, margins, candidate) result(number)
    type(orbit_t), intent(in) :: orbit
    type(margins_t), intent(in) :: margins
    type(margin_t), intent(in) :: candidate
    number = 0
    if (candidate%kind /= of_order) return
    associate (stick => orbit%events(candidate%event - 1), release => orbit%events(candidate%event))
      if (stick%kind /= event_stick .or. release%kind /= event_release .or. stick%joint /= release%joint) return
    end associate
    number = findloc(margins%list%kind == of_stick .and. margins%list%event == candidate%event - 1 .and. &
                     abs(margins%list%value) <= together, .true., 1)
  end function ended_stick

end module margin_cause
