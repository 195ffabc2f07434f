! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What those who look at a motion have to know of the machine, whatever it is: one body, two or several.
module machine_facts
  use kinds, only: wp
  use motion, only: motion_t
  use pair, only: driven_by_motion, impact_mass
  use pair_damper, only: is_damper
  implicit none
  private

  public :: is_one_body, has_driver, rides_along, rest_lasts, smallest_motion, contact_sizes

contains

  !> Whether `moving%machine` says all of the machine.
  pure logical function is_one_body(moving)
    type(motion_t), intent(in) :: moving
    is_one_body = .not. allocated(moving%pair) .and. .not. allocated(moving%jointed)
  end function is_one_body

  !> Whether there is a driving body beside the one that is looked at.
  pure logical function has_driver(moving)
    type(motion_t), intent(in) :: moving
    has_driver = allocated(moving%pair)
  end function has_driver

  !> Whether bodies that do not slip may well move: they ride along.
  pure logical function rides_along(moving)
    type(motion_t), intent(in) :: moving
    rides_along = allocated(moving%pair)
  end function rides_along

  !> Whether a period without slip is followed by none with any: a body at rest under periodic forces, or two that move
  !> as one in a way that is given.
  pure logical function rest_lasts(moving)
    type(motion_t), intent(in) :: moving
    rest_lasts = .true.
    if (allocated(moving%pair)) rest_lasts = moving%pair%machine%drive == driven_by_motion
  end function rest_lasts

  !> Half range [m] of a motion below which it is one of the rounding: a thousandth of what the forces do.
  pure real(wp) function smallest_motion(moving) result(smallest)
    type(motion_t), intent(in) :: moving
    smallest = 1e-3_wp
    if (moving%machine%restoring%stiffness > 0) then
      smallest = 1e-3_wp*moving%machine%force_scale/moving%machine%restoring%stiffness
    end if
    if (allocated(moving%pair)) then
      smallest = 1e-3_wp*moving%pair%force_scale/(moving%machine%mass*moving%machine%drive_frequency**2)
    end if
  end function smallest_motion

  !> What presses a contact: the mass that an impact feels [kg], the size of the forces [N], and whether it is flown in closed form.
  pure subroutine contact_sizes(moving, mass, force, closed_form)
    type(motion_t), intent(in) :: moving
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    mass = moving%machine%mass
    force = moving%machine%force_scale
    closed_form = moving%pressed%available
    if (.not. allocated(moving%pair)) return
    mass = impact_mass(moving%pair%machine)
    force = moving%pair%force_scale
    closed_form = is_damper(moving%pair)
  end subroutine contact_sizes

end module machine_facts
