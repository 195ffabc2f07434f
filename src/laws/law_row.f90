! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a row of the catalogue of laws holds.
module law_row
  use kinds, only: real64, wp
  implicit none
  private

  !> Lengths of the names of families and laws.
  integer, parameter, public :: family_length = 9, law_length = 32
  integer, parameter, public :: unit_length = 20

  real(wp), parameter, public :: none_above = real(huge(1.0_real64), wp), none_below = -none_above

  type, public :: law_row_t
    character(len=family_length) :: family
    character(len=law_length) :: name
    character(len=96) :: meaning
    character(len=96) :: source
  end type law_row_t

  !> What is known of an effect beyond its law: the function that it is one shape of, and over what; what it changes ('flight',
  !> 'barrier' or 'sensor'), which decides how its derivatives are found; its parameters in which what it does is linear near
  !> zero, and those that are positive sizes; the law or parameter that a machine must have for it. Lists are parted by blanks.
  type, public :: effect_trait_t
    character(len=law_length) :: name
    character(len=32) :: family
    character(len=8) :: acts
    character(len=20) :: amplitudes, sizes
    character(len=20) :: needs
  end type effect_trait_t

  !> Two effects that can be the same motion, and when.
  type, public :: effect_confusion_t
    character(len=law_length) :: one, other
    character(len=112) :: reason
  end type effect_confusion_t

  !> The values that a parameter may have, with the upper bound, and with the lower one unless it is open.
  type, public :: range_t
    real(wp) :: lower, upper
    logical :: lower_open = .false.
  end type range_t

  type(range_t), parameter, public :: any_value = range_t(none_below, none_above), not_negative = range_t(0.0_wp, none_above), &
    positive = range_t(0.0_wp, none_above, lower_open=.true.), zero_to_one = range_t(0.0_wp, 1.0_wp), &
    positive_to_one = range_t(0.0_wp, 1.0_wp, lower_open=.true.)

  !> One parameter of one law, in the SI unit given.
  type, public :: parameter_row_t
    character(len=family_length) :: family
    character(len=law_length) :: law
    character(len=20) :: name
    character(len=unit_length) :: unit
    type(range_t) :: range
    character(len=88) :: meaning
    !> An optional parameter takes its default.
    logical :: optional = .false.
    real(wp) :: default = 0
    !> A list of any length instead of one number.
    logical :: list = .false.
  end type parameter_row_t

end module law_row
