! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Counter-based random numbers (Philox4x32-10): a pure function of seed and counter, so results
!> do not depend on order, rank or number of ranks.
module random
  use bindings, only: c_philox, c_uniform
  use kinds, only: int32, int64, real64
  implicit none
  private

  public :: uniform, philox

contains

  !> `size(values)` numbers in [0, 1) that belong to (seed, counter), 53 bits each.
  pure subroutine uniform(seed, counter, values)
    integer(int64), intent(in) :: seed, counter
    real(real64), intent(out), contiguous :: values(:)
    call c_uniform(seed, counter, size(values, kind=int64), values)
  end subroutine uniform

  !> The four words that belong to a counter of four words and a key of two.
  pure function philox(counter, key) result(words)
    integer(int32), intent(in) :: counter(4), key(2)
    integer(int32) :: words(4)
    call c_philox(counter, key, words)
  end function philox

end module random
