! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Multipliers of periodic orbits: eigenvalues of the derivative of their map, of any number of coordinates.
module multipliers
  use constants, only: unreachable
  use eigen, only: general_eigen
  use kinds, only: wp
  use matrices, only: determinant_of, eigenvalues
  implicit none
  private

  public :: multipliers_of, shifted_determinant

contains

  !> Eigenvalues, largest modulus first; with imaginary parts that are none left out. `determinant`: of a matrix of two
  !> rows, from its factors: the entries of one with a large multiplier know the small one no more.
  pure function multipliers_of(matrix, determinant) result(values)
    real(wp), intent(in) :: matrix(:, :)
    real(wp), intent(in), optional :: determinant
    complex(wp) :: values(size(matrix, 1)), vectors(size(matrix, 1), size(matrix, 1)), moved
    logical :: ok
    integer :: i, k
    if (size(matrix, 1) <= 2 .or. .not. all(abs(matrix) < unreachable)) then
      values = matrix(1, 1)
      if (size(matrix, 1) <= 2) values = eigenvalues(matrix, determinant)
      return
    end if
    call general_eigen(matrix, values, vectors, ok)
    if (.not. ok) values = unreachable
    where (abs(aimag(values)) <= 1e-12_wp*maxval(abs(values))) values = cmplx(real(values), 0.0_wp, wp)
    do i = 2, size(values)
      moved = values(i)
      do k = i - 1, 1, -1
        if (abs(moved) < abs(values(k))*(1 + 1e-12_wp) .and. &
            .not. (abs(moved) > abs(values(k))*(1 - 1e-12_wp) .and. aimag(moved) > aimag(values(k)))) exit
        values(k + 1) = values(k)
      end do
      values(k + 1) = moved
    end do
  end function multipliers_of

  !> det(M + shift).
  pure real(wp) function shifted_determinant(m, shift) result(determinant)
    real(wp), intent(in) :: m(:, :), shift
    real(wp) :: shifted(size(m, 1), size(m, 1))
    integer :: i
    shifted = m
    do i = 1, size(m, 1)
      shifted(i, i) = shifted(i, i) + shift
    end do
    determinant = determinant_of(shifted)
  end function shifted_determinant

end module multipliers
