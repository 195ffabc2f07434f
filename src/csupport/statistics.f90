! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Confidence limits of counted shares.
module statistics
  use bindings, only: c_share_upper_limit
  use kinds, only: int64, real64
  implicit none
  private

  public :: share_upper_limit

  !> The share that, with probability `confidence`, is not exceeded when `found` of `sample` were seen (Clopper and
  !> Pearson 1934); 1 for an empty sample.
  interface share_upper_limit
    module procedure share_limit, share_limit_of_many
  end interface share_upper_limit

contains

  real(real64) function share_limit(found, sample, confidence)
    integer, intent(in) :: found, sample
    real(real64), intent(in) :: confidence
    share_limit = c_share_upper_limit(int(found, int64), int(sample, int64), confidence)
  end function share_limit

  real(real64) function share_limit_of_many(found, sample, confidence)
    integer(int64), intent(in) :: found, sample
    real(real64), intent(in) :: confidence
    share_limit_of_many = c_share_upper_limit(found, sample, confidence)
  end function share_limit_of_many

end module statistics
