! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Rigid barriers with Newton's law of restitution.
module contact_law
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  implicit none
  private

  public :: contact_of, velocity_after_impact

  type, public :: contact_t
    !> Ratio of the speeds after and before an impact.
    real(wp) :: restitution = 1
    !> Positions of the barriers [m]; huge means none.
    real(wp) :: upper = huge(1.0_wp)
    real(wp) :: lower = -huge(1.0_wp)
  end type contact_t

contains

  !> The law that a choice of the family `contact` names.
  pure function contact_of(choice) result(law)
    type(law_choice_t), intent(in) :: choice
    type(contact_t) :: law
    if (choice%name == 'newton') then
      law = contact_t(value_of(choice, 'restitution'), value_of(choice, 'upper'), &
                      value_of(choice, 'lower'))
    end if
  end function contact_of

  !> Newton: v+ = -k v- [m/s].
  pure elemental real(wp) function velocity_after_impact(law, v)
    type(contact_t), intent(in) :: law
    real(wp), intent(in) :: v
    velocity_after_impact = -law%restitution*v
  end function velocity_after_impact

end module contact_law
