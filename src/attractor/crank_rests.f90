! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The rest of a machine whose crank its bearing holds: it comes to no section, and all its positions are one attractor.
module crank_rests
  use attractors, only: attractor_t, kind_rest, make_points, regime_at_rest
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: tally_t
  use rest_sets, only: rest_set_of
  implicit none
  private

  public :: add_crank_rest

  !> Longest returns over which a body that comes to rest is followed: it then rests to rounding.
  integer, parameter :: most_returns = 16

contains

  !> Adds to a catalogue without one the rest at which a motion is or to which it is bound, if it is.
  pure subroutine add_crank_rest(moving, section, catalogue)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    type(section_state_t) :: later
    type(attractor_t) :: found
    type(tally_t) :: tally
    integer :: i, reason
    if (.not. moving%bound_to_rest(section)) return
    if (rest_set_of(moving, catalogue, moving%point_of(section)) > 0) return
    later = section
    do i = 1, most_returns
      call moving%begin_tally(later, tally)
      call moving%advance_to_section(later, tally, reason)
      if (tally%slips == 0) exit
    end do
    found%rests = .true.
    found%kind = kind_rest
    found%period = 1
    found%coordinates = moving%coordinates()
    call make_points(found, 1)
    found%points(:, 1) = moving%point_of(later)
    found%section = [later%state%x, 0.0_wp, later%motor%phi, 0.0_wp]
    found%features%regime = regime_at_rest
    found%features%x_max = later%state%x
    found%features%x_min = later%state%x
    catalogue = [catalogue, found]
  end subroutine add_crank_rest

end module crank_rests
