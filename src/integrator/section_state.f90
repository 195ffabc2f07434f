! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The state of a machine of any kind on its section, and the sizes that a machine sets.
module section_state
  use kinds, only: wp
  use motion_state, only: state_t
  use motor_state, only: motor_state_t
  use multibody_state, only: multibody_state_t
  implicit none
  private

  public :: copy_of

  !> `state` is that of the body, or of the watched one of several; `multibody`, which is large, is there for several only.
  type, public :: section_state_t
    type(state_t) :: state
    type(multibody_state_t), allocatable :: multibody
    type(motor_state_t) :: motor
    !> The last `advance` ended on the section, where that does not come at given times.
    logical :: passed = .false.
    !> Time from the last section to this one [s].
    real(wp) :: lasted = 0
  end type section_state_t

  !> Length [m], time [s] and mass [kg] that a machine itself sets.
  type, public :: scales_t
    real(wp) :: length = 1, time = 1, mass = 1
  end type scales_t

contains

  !> A copy of a state, to be moved on its own.
  pure type(section_state_t) function copy_of(section) result(copy)
    class(section_state_t), intent(in) :: section
    copy%state = section%state
    if (allocated(section%multibody)) copy%multibody = section%multibody
    copy%motor = section%motor
    copy%passed = section%passed
    copy%lasted = section%lasted
  end function copy_of

end module section_state
