! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Positions of a motion at given instants, as a sensor sees them.
module sampling
  use kinds, only: wp
  use motion, only: advance, advance_period, motion_t, start_state
  use motion_state, only: state_t, tally_t
  use pair_modes, only: at_x1, at_x2, pair_motion_t, pair_state_t
  use pair_motion, only: advance_pair, advance_pair_period, start_pair
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
    if (allocated(moving%pair)) then
      call sample_pair(moving%pair, start, times, x, driver, reason)
    else
      driver = 0
      call sample_body(moving, start, times, x, reason)
    end if
  end subroutine sample_positions

  pure subroutine sample_body(moving, start, times, x, reason)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    real(wp), intent(out) :: x(:)
    integer, intent(out) :: reason
    type(state_t) :: state
    type(tally_t) :: tally
    real(wp) :: section
    integer :: i
    reason = 0
    state = start_state(moving, start(1), start(2), start(3))
    section = -state%time
    do i = 1, size(times)
      do while (times(i) - section >= moving%machine%period .and. reason == 0)
        call advance_period(moving, state, tally, reason)
        section = section + moving%machine%period
      end do
      if (reason == 0) call advance(moving, state, times(i) - section, tally, reason)
      x(i) = state%x
    end do
  end subroutine sample_body

  pure subroutine sample_pair(moving, start, times, x, driver, reason)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: start(3), times(:)
    real(wp), intent(out) :: x(:), driver(:)
    integer, intent(out) :: reason
    type(pair_state_t) :: state
    type(tally_t) :: tally
    integer :: i
    reason = 0
    state = start_pair(moving, start(1), start(2), [moving%machine%driver_x0, moving%machine%driver_v0], start(3))
    do i = 1, size(times)
      do while (times(i) - state%clock >= moving%machine%period .and. reason == 0)
        call advance_pair_period(moving, state, tally, reason)
      end do
      if (reason == 0) call advance_pair(moving, state, times(i) - state%clock, tally, reason)
      x(i) = state%y(at_x2)
      driver(i) = state%y(at_x1)
    end do
  end subroutine sample_pair

end module sampling
