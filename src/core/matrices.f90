! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Small matrices in reproducible arithmetic.
module matrices
  use kinds, only: wp
  implicit none
  private

  public :: solve, cholesky, determinant_of, spectral_radius, eigenvalues

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

  !> The determinant, by elimination with row exchanges.
  pure real(wp) function determinant_of(m) result(determinant)
    real(wp), intent(in) :: m(:, :)
    real(wp) :: a(size(m, 1), size(m, 1)), row(size(m, 1))
    integer :: i, k, n
    n = size(m, 1)
    if (n == 2) then
      determinant = m(1, 1)*m(2, 2) - m(1, 2)*m(2, 1)
      return
    end if
    a = m
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
  end function determinant_of

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
      determinant = determinant_of(a)
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

  !> The eigenvalues, largest modulus first, of a conjugate pair the one with positive imaginary part first: in closed form up
  !> to two rows, else the roots of the characteristic polynomial (Faddeev and LeVerrier) by the simultaneous iteration of
  !> Weierstrass, which serves few rows. `known_determinant`: better than the entries of two rows give it.
  pure function eigenvalues(a, known_determinant) result(values)
    real(wp), intent(in) :: a(:, :)
    real(wp), intent(in), optional :: known_determinant
    complex(wp) :: values(size(a, 1)), moved
    real(wp) :: half_trace, determinant, root
    integer :: i, k
    select case (size(a, 1))
    case (1)
      values = cmplx(a(1, 1), 0.0_wp, wp)
    case (2)
      half_trace = (a(1, 1) + a(2, 2))/2
      determinant = determinant_of(a)
      if (present(known_determinant)) determinant = known_determinant
      root = ((a(1, 1) - a(2, 2))/2)**2 + a(1, 2)*a(2, 1)
      if (root < 0) then
        values = cmplx(half_trace, sqrt(-root)*[1.0_wp, -1.0_wp], wp)
      else
        ! The smaller one from the product: the difference would cancel.
        values = cmplx(half_trace + sign(sqrt(root), half_trace), 0.0_wp, wp)
        if (abs(values(1)) > 0) values(2) = cmplx(determinant/real(values(1)), 0.0_wp, wp)
      end if
    case default
      values = roots(characteristic(a))
    end select
    do i = 2, size(values)
      moved = values(i)
      do k = i - 1, 1, -1
        if (.not. precedes(moved, values(k))) exit
        values(k + 1) = values(k)
      end do
      values(k + 1) = moved
    end do
  end function eigenvalues

  pure logical function precedes(one, other)
    complex(wp), intent(in) :: one, other
    real(wp), parameter :: rounding = 1e-12_wp
    if (abs(abs(one) - abs(other)) > rounding*abs(one)) then
      precedes = abs(one) > abs(other)
    else
      precedes = aimag(one) > aimag(other)
    end if
  end function precedes

  !> Coefficients of det(x - a), that of x^(n-1) first; the leading one is 1.
  pure function characteristic(a) result(coefficients)
    real(wp), intent(in) :: a(:, :)
    real(wp) :: coefficients(size(a, 1)), m(size(a, 1), size(a, 1)), last
    integer :: i, k
    m = 0
    last = 1
    do k = 1, size(a, 1)
      do i = 1, size(a, 1)
        m(i, i) = m(i, i) + last
      end do
      m = matmul(a, m)
      last = -sum([(m(i, i), i=1, size(a, 1))])/k
      coefficients(k) = last
    end do
  end function characteristic

  !> Roots of x^n + c(1) x^(n-1) + ... + c(n), all at once; real ones to rounding have no imaginary part.
  pure function roots(c) result(z)
    real(wp), intent(in) :: c(:)
    complex(wp) :: z(size(c)), value, product_of_differences, step
    real(wp) :: reach
    integer, parameter :: most_rounds = 500
    integer :: i, k, round
    logical :: moving
    reach = 1 + maxval(abs(c))
    z = [(reach**0.5_wp*cmplx(0.4_wp, 0.9_wp, wp)**i, i=1, size(c))]
    do round = 1, most_rounds
      moving = .false.
      do i = 1, size(c)
        value = 1
        do k = 1, size(c)
          value = value*z(i) + c(k)
        end do
        product_of_differences = product(z(i) - pack(z, [(k /= i, k=1, size(c))]))
        if (.not. abs(product_of_differences) > 0) cycle
        step = value/product_of_differences
        z(i) = z(i) - step
        moving = moving .or. abs(step) > 4*epsilon(reach)*abs(z(i))
      end do
      if (.not. moving) exit
    end do
    where (abs(aimag(z)) <= 1e-9_wp*maxval(abs(z))) z = cmplx(real(z), 0.0_wp, wp)
  end function roots

end module matrices
