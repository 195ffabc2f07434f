! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a motion under way has been captured by an attractor of a catalogue.
module capture
  use attractors, only: attractor_t, find_capture
  use kinds, only: wp
  use motion, only: motion_t
  use motion_state, only: tally_t
  use strobe, only: advance_to_section, copy_of, rest_lasts, section_point, strobe_t, turn_point
  implicit none
  private

  public :: captor_of

contains

  !> Index of the attractor that has captured the motion at the end of a drive period, 0 if none. `slipped` tells whether the body
  !> moved during the last whole period. For the cycles of a machine without a clock a copy goes on to the section.
  pure integer function captor_of(moving, catalogue, strobe, slipped) result(found)
    type(motion_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    class(strobe_t), intent(in) :: strobe
    logical, intent(in) :: slipped
    type(strobe_t) :: later
    type(tally_t) :: unused
    integer :: reason
    found = find_capture(catalogue, section_point(moving, strobe), slipped .or. .not. rest_lasts(moving))
    if (found > 0 .or. .not. any(catalogue%by_event)) return
    later = copy_of(strobe)
    call advance_to_section(moving, later, unused, reason)
    if (reason == 0) found = find_capture(catalogue, turn_point(moving, later), .true., by_event=.true.)
  end function captor_of

end module capture
