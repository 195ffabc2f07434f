! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Positions of a motion at given instants, as a sensor sees them.
module sampling
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: position_of, tally_t
  implicit none
  private

  public :: sample_positions

contains

  !> Position [m] at `times` [s], ascending, of a body started at `start` = x [m], v [m/s], crank angle [rad]; before the
  !> start it rests there. `driver` is that of the driving body of two. `reason` stays 0 unless the motion had to
  !> be given up.
  pure subroutine sample_positions(moving, start, times, x, driver, reason)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    real(wp), intent(out) :: x(:), driver(:)
    integer, intent(out) :: reason
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: section_time
    integer :: i
    reason = 0
    driver = 0
    call moving%start(start, section)
    section_time = -section%state%time
    do i = 1, size(times)
      do while (moving%timed .and. times(i) - section_time >= moving%period .and. reason == 0)
        call moving%advance_to_section(section, tally, reason)
        section_time = section_time + moving%period
      end do
      do while (reason == 0)
        call moving%advance(section, times(i) - section_time, tally, reason)
        if (.not. section%passed) exit
        section_time = section_time + section%lasted
      end do
      x(i) = position_of(section%state)
      associate (now => moving%driver(section))
        driver(i) = now(1)
      end associate
    end do
  end subroutine sample_positions

end module sampling
