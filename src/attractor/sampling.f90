! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Positions of a motion at given instants, as a sensor sees them.
module sampling
  use kinds, only: wp
  use motion, only: motion_t
  use motion_state, only: place_of, tally_t
  use strobe, only: advance_strobe, advance_strobe_period, driver_now, start_strobe, strobe_t
  implicit none
  private

  public :: sample_positions

contains

  !> Position [m] at `times` [s], ascending, of a body started at `start` = x [m], v [m/s], crank angle [rad]; before the
  !> start it rests there. `driver` is that of the driving body of two. `reason` stays 0 unless the motion had to
  !> be given up.
  pure subroutine sample_positions(moving, start, times, x, driver, reason)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    real(wp), intent(out) :: x(:), driver(:)
    integer, intent(out) :: reason
    type(strobe_t) :: strobe
    type(tally_t) :: tally
    real(wp) :: section
    integer :: i
    reason = 0
    driver = 0
    strobe = start_strobe(moving, start)
    section = -strobe%state%time
    do i = 1, size(times)
      do while (times(i) - section >= moving%machine%period .and. reason == 0)
        call advance_strobe_period(moving, strobe, tally, reason)
        section = section + moving%machine%period
      end do
      if (reason == 0) call advance_strobe(moving, strobe, times(i) - section, tally, reason)
      x(i) = place_of(strobe%state)
      associate (now => driver_now(moving, strobe))
        driver(i) = now(1)
      end associate
    end do
  end subroutine sample_positions

end module sampling
