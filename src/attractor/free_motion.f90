! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is known in closed form of the motion of one body between its barriers.
module free_motion
  use elementary, only: exponential, sine_cosine
  use kinds, only: wp
  use motion, only: motion_t
  implicit none
  private

  public :: is_linear, free_multipliers

contains

  !> Whether the motion of one body between its barriers is that of a linear, damped oscillator with a closed form: then it has
  !> one motion without impact, which attracts.
  pure logical function is_linear(moving)
    type(motion_t), intent(in) :: moving
    is_linear = moving%exact .and. moving%layer <= 0 .and. moving%flow%decay > 0 .and. &
                .not. moving%machine%friction%kinetic > 0 .and. .not. moving%machine%friction%break_away > 0
  end function is_linear

  !> Multipliers of a motion of such an oscillator over some drive periods: exp((-g +- i w_d) t), or exp(-slow t) and exp(-fast t).
  pure function free_multipliers(moving, periods) result(multipliers)
    type(motion_t), intent(in) :: moving
    integer, intent(in) :: periods
    complex(wp) :: multipliers(2)
    real(wp) :: time, sine, cosine
    time = periods*moving%machine%period
    if (moving%flow%overdamped) then
      multipliers = exponential(-[moving%flow%slow, moving%flow%fast]*time)
      return
    end if
    call sine_cosine(moving%flow%damped*time, sine, cosine)
    multipliers = exponential(-moving%flow%decay*time)*cmplx(cosine, abs(sine)*[1.0_wp, -1.0_wp], wp)
  end function free_multipliers

end module free_motion
