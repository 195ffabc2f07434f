! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Small matrices in reproducible arithmetic.
module matrices
  use kinds, only: wp
  implicit none
  private

  public :: solve, cholesky, spectral_radius

  !> Squarings by which |A^(2^k)|^(1/2^k) comes near the spectral radius.
  integer, parameter :: squarings = 20

contains

  !> a x = b by elimination with partial pivoting; `ok` is false for a singular matrix.
  pure subroutine solve(a, b, x, ok)
    real(wp), intent(in) :: a(:, :), b(:)
    real(wp), intent(out) :: x(:)
    logical, intent(out) :: ok
    real(wp) :: m(size(b), size(b) + 1), row(size(b) + 1)
    integer :: i, k, n
    n = size(b)
    m(:, :n) = a
    m(:, n + 1) = b
    x = 0
    ok = .false.
    do k = 1, n
      i = k - 1 + maxloc(abs(m(k:, k)), 1)
      if (.not. abs(m(i, k)) > 0) return
      row = m(i, :)
      m(i, :) = m(k, :)
      m(k, :) = row
      do i = k + 1, n
        m(i, k:) = m(i, k:) - m(i, k)/m(k, k)*m(k, k:)
      end do
    end do
    do k = n, 1, -1
      x(k) = (m(k, n + 1) - sum(m(k, k + 1:n)*x(k + 1:)))/m(k, k)
    end do
    ok = .true.
  end subroutine solve

  !> The lower triangular L of a positive definite matrix L L'.
  pure function cholesky(a) result(l)
    real(wp), intent(in) :: a(:, :)
    real(wp) :: l(size(a, 1), size(a, 1))
    integer :: i, k
    l = 0
    do k = 1, size(a, 1)
      l(k, k) = sqrt(a(k, k) - sum(l(k, :k - 1)**2))
      do i = k + 1, size(a, 1)
        l(i, k) = (a(i, k) - sum(l(i, :k - 1)*l(k, :k - 1)))/l(k, k)
      end do
    end do
  end function cholesky

  !> Largest modulus of the eigenvalues: in closed form up to two rows, else by Gelfand's formula, which misses by a
  !> relative 2e-5 at most.
  pure real(wp) function spectral_radius(a) result(radius)
    real(wp), intent(in) :: a(:, :)
    real(wp) :: half_trace, determinant, discriminant, power(size(a, 1), size(a, 1)), size_of_power
    integer :: k, i
    select case (size(a, 1))
    case (1)
      radius = abs(a(1, 1))
    case (2)
      half_trace = (a(1, 1) + a(2, 2))/2
      determinant = a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1)
      discriminant = half_trace**2 - determinant
      if (discriminant >= 0) then
        radius = abs(half_trace) + sqrt(discriminant)
      else
        radius = sqrt(determinant)
      end if
    case default
      power = a
      radius = 1
      do k = 0, squarings
        size_of_power = norm2(power)
        do i = 1, k
          size_of_power = sqrt(size_of_power)
        end do
        radius = radius*size_of_power
        if (.not. radius > 0) return
        power = power/norm2(power)
        power = matmul(power, power)
      end do
    end select
  end function spectral_radius

end module matrices
