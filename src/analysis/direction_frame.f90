! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Orthonormal directions that are carried along a motion, and how much they grow.
module direction_frame
  use elementary, only: logarithm
  use kinds, only: wp
  implicit none
  private

  public :: log_of, orthogonalise

contains

  !> Orthonormal columns that span what the first columns of `frame` do, and how long they were.
  pure subroutine orthogonalise(frame, growth)
    real(wp), intent(inout) :: frame(:, :)
    real(wp), intent(out) :: growth(:)
    real(wp) :: rest
    integer :: k, i, pass, unit
    do k = 1, size(growth)
      growth(k) = 0
      unit = 0
      do
        rest = norm2(frame(:, k))
        do pass = 1, 2
          do i = 1, k - 1
            frame(:, k) = frame(:, k) - frame(:, i)*sum(frame(:, i)*frame(:, k))
          end do
        end do
        if (unit == 0) growth(k) = norm2(frame(:, k))
        if (norm2(frame(:, k)) > 1e-12_wp*rest) exit
        ! A direction that is lost: any other replaces it.
        unit = unit + 1
        frame(:, k) = 0
        frame(min(unit, size(growth)), k) = 1
        if (unit > size(growth)) exit
      end do
      frame(:, k) = frame(:, k)/norm2(frame(:, k))
    end do
  end subroutine orthogonalise

  pure elemental real(wp) function log_of(x)
    real(wp), intent(in) :: x
    log_of = 0
    if (x > 0) log_of = logarithm(x)
  end function log_of

end module direction_frame
