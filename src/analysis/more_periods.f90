! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How many periods would decide what a motion is, where the errors of its exponents are what leaves it open: from how fast these
!> fall.
module more_periods
  use exponents, only: chaotic_from, motion_not_known, regular_to, spectrum_t, type_of_motion
  use kinds, only: wp
  implicit none
  private

  public :: periods_needed, test_is_open

  !> Room for what an estimate from one run may be off.
  real(wp), parameter :: margin = 1.5_wp
  !> More periods than that are no advice.
  real(wp), parameter :: most_periods = 1e8_wp

contains

  !> Periods that would decide, to two digits; 0 where the motion is known, or more periods are not known to decide. `k` is the
  !> 0-1 test.
  pure integer function periods_needed(spectrum, k) result(periods)
    type(spectrum_t), intent(in) :: spectrum
    real(wp), intent(in) :: k
    real(wp) :: bound, room, factor
    periods = 0
    if (.not. spectrum%known) return
    if (type_of_motion(spectrum, k) /= motion_not_known) return
    bound = what_decides(spectrum, k)
    room = 3*spectrum%errors(1) + spectrum%memory
    ! Where the errors are not what leaves it open, less of them is no help.
    if (.not. bound > 0 .or. bound >= room .or. abs(spectrum%exponents(1)) > room) return
    ! The memory of the directions goes with the inverse of the time, and the error at least with that of its root.
    factor = margin*(room/bound)**(1/spectrum%decay)
    if (factor*spectrum%periods < most_periods) periods = two_digits(factor*spectrum%periods)
  end function periods_needed

  !> Whether the 0-1 test is what leaves the motion open: between its limits, or against exponents that are clear.
  pure logical function test_is_open(spectrum, k)
    type(spectrum_t), intent(in) :: spectrum
    real(wp), intent(in) :: k
    test_is_open = (k > regular_to .and. k < chaotic_from) .or. &
                   abs(spectrum%exponents(1)) > 3*spectrum%errors(1) + spectrum%memory
    test_is_open = test_is_open .and. spectrum%known .and. type_of_motion(spectrum, k) == motion_not_known
  end function test_is_open

  !> What the room for errors must be less than, so that the motion is known whatever it is [1/s]; 0: there is no such bound.
  pure real(wp) function what_decides(spectrum, k) result(bound)
    type(spectrum_t), intent(in) :: spectrum
    real(wp), intent(in) :: k
    bound = 0
    if (k <= regular_to .and. spectrum%has_sum) then
      ! Quasi-periodic with an exponent of zero, or on a cycle with exponents that are all alike: equally far from each other.
      bound = -spectrum%sum_exact/size(spectrum%exponents)
    else if (k >= chaotic_from .and. spectrum%exponents(1) > spectrum%errors(1)) then
      bound = spectrum%exponents(1)
    end if
  end function what_decides

  !> A number rounded up to two digits.
  pure integer function two_digits(number)
    real(wp), intent(in) :: number
    real(wp) :: unit
    unit = 10.0_wp**max(0, floor(log10(number)) - 1)
    two_digits = nint(unit*ceiling(number/unit))
  end function two_digits

end module more_periods
