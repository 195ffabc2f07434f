! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Multipliers of periodic orbits: eigenvalues of the derivative of their map, of any number of coordinates.
module multipliers
  use eigen, only: general_eigen
  use kinds, only: wp
  use matrices, only: eigenvalues
  implicit none
  private

  public :: multipliers_of, shifted_determinant

contains

  !> Eigenvalues, largest modulus first; with imaginary parts that are none left out.
  pure function multipliers_of(matrix) result(values)
    real(wp), intent(in) :: matrix(:, :)
    complex(wp) :: values(size(matrix, 1)), vectors(size(matrix, 1), size(matrix, 1)), moved
    logical :: ok
    integer :: i, k
    if (size(matrix, 1) <= 2 .or. .not. all(abs(matrix) < sqrt(huge(1.0_wp)))) then
      values = matrix(1, 1)
      if (size(matrix, 1) <= 2) values = eigenvalues(matrix)
      return
    end if
    call general_eigen(matrix, values, vectors, ok)
    if (.not. ok) values = sqrt(huge(1.0_wp))
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
    real(wp) :: a(size(m, 1), size(m, 1)), row(size(m, 1))
    integer :: i, k, n
    n = size(m, 1)
    if (n == 2) then
      determinant = (m(1, 1) + shift)*(m(2, 2) + shift) - m(1, 2)*m(2, 1)
      return
    end if
    a = m
    do i = 1, n
      a(i, i) = a(i, i) + shift
    end do
    determinant = 1
    do k = 1, n
      i = k - 1 + maxloc(abs(a(k:, k)), 1)
      determinant = determinant*a(i, k)
      if (.not. abs(determinant) > 0) return
      if (i /= k) then
        row = a(i, :)
        a(i, :) = a(k, :)
        a(k, :) = row
        determinant = -determinant
      end if
      do i = k + 1, n
        a(i, k:) = a(i, k:) - a(i, k)/a(k, k)*a(k, k:)
      end do
    end do
  end function shifted_determinant

end module multipliers
