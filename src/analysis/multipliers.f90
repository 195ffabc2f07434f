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

  !> Eigenvalues, largest modulus first; with imaginary parts that are none left out. With the `determinant` of a matrix of two
  !> coordinates that is known better than from its entries, the product is that.
  pure function multipliers_of(matrix, determinant) result(values)
    real(wp), intent(in) :: matrix(:, :)
    real(wp), intent(in), optional :: determinant
    complex(wp) :: values(size(matrix, 1)), vectors(size(matrix, 1), size(matrix, 1)), moved
    logical :: ok
    integer :: i, k
    if (size(matrix, 1) <= 2 .or. .not. all(abs(matrix) < sqrt(huge(1.0_wp)))) then
      values = matrix(1, 1)
      if (size(matrix, 1) <= 2) values = eigenvalues(matrix)
      if (size(matrix, 1) == 2 .and. present(determinant)) call set_product(determinant, values)
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

  !> Gives two multipliers the product that is known: the smaller of real ones is the less known, of a pair the modulus.
  pure subroutine set_product(determinant, values)
    real(wp), intent(in) :: determinant
    complex(wp), intent(inout) :: values(2)
    real(wp) :: rest
    if (.not. (abs(values(1)) > 0 .and. abs(determinant) < huge(determinant))) return
    if (abs(aimag(values(1))) > 0) then
      rest = determinant - real(values(1))**2
      if (rest > 0) values = cmplx(real(values(1)), [sqrt(rest), -sqrt(rest)], wp)
    else
      values(2) = cmplx(determinant/real(values(1)), 0.0_wp, wp)
    end if
  end subroutine set_product

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
