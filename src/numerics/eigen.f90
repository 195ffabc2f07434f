! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Eigenvalues of small dense matrices in reproducible arithmetic, whatever the kind.
module eigen
  use kinds, only: wp
  use matrices, only: cholesky
  implicit none
  private

  public :: undamped_modes, symmetric_eigen, general_eigen, refine_mode, solve_complex, modulus

  integer, parameter :: most_sweeps = 60, most_iterations = 60

contains

  !> |z| without the mathematical library.
  pure elemental real(wp) function modulus(z)
    complex(wp), intent(in) :: z
    modulus = sqrt(real(z)**2 + aimag(z)**2)
  end function modulus

  !> The square root with a real part that is not negative.
  pure complex(wp) function root_of(z) result(root)
    complex(wp), intent(in) :: z
    real(wp) :: half
    half = sqrt((modulus(z) + abs(real(z)))/2)
    root = 0
    if (.not. half > 0) return
    if (real(z) >= 0) then
      root = cmplx(half, aimag(z)/(2*half), wp)
    else
      root = cmplx(abs(aimag(z))/(2*half), sign(half, aimag(z)), wp)
    end if
  end function root_of

  !> K phi = w2 M phi for symmetric K and positive definite M: `squares` ascending, the columns of `shapes` with
  !> phi' M phi = 1.
  pure subroutine undamped_modes(stiffness, mass, squares, shapes)
    real(wp), intent(in) :: stiffness(:, :), mass(:, :)
    real(wp), intent(out) :: squares(:), shapes(:, :)
    real(wp), dimension(size(mass, 1), size(mass, 1)) :: l, a
    integer :: i, k, n
    n = size(mass, 1)
    l = cholesky(mass)
    ! A = L^-1 K L^-T, by forward substitution on the columns, then on the rows.
    a = stiffness
    do k = 1, n
      do i = 1, n
        a(i, k) = (a(i, k) - sum(l(i, :i - 1)*a(:i - 1, k)))/l(i, i)
      end do
    end do
    do k = 1, n
      do i = 1, n
        a(k, i) = (a(k, i) - sum(l(i, :i - 1)*a(k, :i - 1)))/l(i, i)
      end do
    end do
    a = (a + transpose(a))/2
    call symmetric_eigen(a, squares, shapes)
    do k = 1, n
      do i = n, 1, -1
        shapes(i, k) = (shapes(i, k) - sum(l(i + 1:, i)*shapes(i + 1:, k)))/l(i, i)
      end do
    end do
  end subroutine undamped_modes

  !> Eigenvalues, ascending, and orthonormal eigenvectors of a symmetric matrix, by Jacobi's rotations in a fixed order.
  pure subroutine symmetric_eigen(matrix, values, vectors)
    real(wp), intent(in) :: matrix(:, :)
    real(wp), intent(out) :: values(:), vectors(:, :)
    real(wp) :: a(size(values), size(values)), other, total, column(size(values)), held
    integer :: sweep, i, k, n
    n = size(values)
    a = matrix
    vectors = 0
    do i = 1, n
      vectors(i, i) = 1
    end do
    total = sqrt(sum(a**2))
    do sweep = 1, most_sweeps
      other = 0
      do k = 2, n
        other = other + sum(a(:k - 1, k)**2)
      end do
      if (sqrt(other) <= tiny(1.0_wp) + epsilon(1.0_wp)**2*total) exit
      do k = 2, n
        do i = 1, k - 1
          call rotate(a, vectors, i, k)
        end do
      end do
    end do
    values = [(a(i, i), i=1, n)]
    do i = 1, n - 1
      k = i - 1 + minloc(values(i:), 1)
      held = values(i)
      values(i) = values(k)
      values(k) = held
      column = vectors(:, i)
      vectors(:, i) = vectors(:, k)
      vectors(:, k) = column
    end do
  end subroutine symmetric_eigen

  !> The rotation that makes a(i, k) zero.
  pure subroutine rotate(a, vectors, i, k)
    real(wp), intent(inout) :: a(:, :), vectors(:, :)
    integer, intent(in) :: i, k
    real(wp) :: half, t, c, s, first(size(a, 1)), second(size(a, 1))
    if (.not. abs(a(i, k)) > tiny(1.0_wp)) return
    half = (a(k, k) - a(i, i))/(2*a(i, k))
    t = sign(1.0_wp, half)/(abs(half) + sqrt(1 + half**2))
    c = 1/sqrt(1 + t**2)
    s = t*c
    first = a(:, i)
    second = a(:, k)
    a(:, i) = c*first - s*second
    a(:, k) = s*first + c*second
    first = a(i, :)
    second = a(k, :)
    a(i, :) = c*first - s*second
    a(k, :) = s*first + c*second
    a(i, k) = 0
    a(k, i) = 0
    first = vectors(:, i)
    second = vectors(:, k)
    vectors(:, i) = c*first - s*second
    vectors(:, k) = s*first + c*second
  end subroutine rotate

  !> Eigenvalues and eigenvectors (columns, largest entry 1) of any real matrix: Hessenberg form by reflections, then QR
  !> steps with Wilkinson's shift. `ok` is false if they do not converge.
  pure subroutine general_eigen(matrix, values, vectors, ok)
    real(wp), intent(in) :: matrix(:, :)
    complex(wp), intent(out) :: values(:), vectors(:, :)
    logical, intent(out) :: ok
    complex(wp), dimension(size(values), size(values)) :: t, u
    complex(wp) :: x(size(values)), gap
    real(wp) :: small
    integer :: i, j, k, n
    n = size(values)
    t = cmplx(matrix, kind=wp)
    u = 0
    do i = 1, n
      u(i, i) = 1
    end do
    call reduce_to_hessenberg(t, u)
    call reduce_to_triangle(t, u, ok)
    if (.not. ok) return
    small = max(epsilon(1.0_wp)*maxval(abs(matrix)), tiny(1.0_wp))
    do k = 1, n
      values(k) = t(k, k)
      x = 0
      x(k) = 1
      do i = k - 1, 1, -1
        gap = t(k, k) - t(i, i)
        if (modulus(gap) < small) gap = small
        x(i) = sum(t(i, i + 1:k)*x(i + 1:k))/gap
      end do
      do j = 1, n
        vectors(j, k) = sum(u(j, :k)*x(:k))
      end do
      j = maxloc(modulus(vectors(:, k)), 1)
      vectors(:, k) = vectors(:, k)/vectors(j, k)
    end do
  end subroutine general_eigen

  !> Reflections from both sides until nothing is left below the first subdiagonal; u collects them.
  pure subroutine reduce_to_hessenberg(t, u)
    complex(wp), intent(inout) :: t(:, :), u(:, :)
    complex(wp) :: v(size(t, 1)), phase
    real(wp) :: length
    integer :: i, k, n
    n = size(t, 1)
    do k = 1, n - 2
      if (.not. any(modulus(t(k + 2:, k)) > 0)) cycle
      v = 0
      v(k + 1:) = t(k + 1:, k)
      length = sqrt(sum(real(v)**2 + aimag(v)**2))
      phase = 1
      if (modulus(v(k + 1)) > 0) phase = v(k + 1)/modulus(v(k + 1))
      v(k + 1) = v(k + 1) + phase*length
      v = v/sqrt(sum(real(v)**2 + aimag(v)**2))
      do i = 1, n
        t(:, i) = t(:, i) - 2*v*sum(conjg(v)*t(:, i))
      end do
      do i = 1, n
        t(i, :) = t(i, :) - 2*conjg(v)*sum(t(i, :)*v)
        u(i, :) = u(i, :) - 2*conjg(v)*sum(u(i, :)*v)
      end do
      t(k + 2:, k) = 0
    end do
  end subroutine reduce_to_hessenberg

  !> Single-shift QR steps with deflation.
  pure subroutine reduce_to_triangle(t, u, ok)
    complex(wp), intent(inout) :: t(:, :), u(:, :)
    logical, intent(out) :: ok
    complex(wp) :: shift
    integer :: first, last, iteration, i
    ok = .true.
    last = size(t, 1)
    iteration = 0
    do while (last > 1)
      first = 1
      do i = last, 2, -1
        if (modulus(t(i, i - 1)) <= epsilon(1.0_wp)*(modulus(t(i, i)) + modulus(t(i - 1, i - 1)))) then
          t(i, i - 1) = 0
          first = i
          exit
        end if
      end do
      if (first == last) then
        last = last - 1
        iteration = 0
        cycle
      end if
      iteration = iteration + 1
      if (iteration > most_iterations) then
        ok = .false.
        return
      end if
      shift = wilkinson_shift(t(last - 1:last, last - 1:last))
      ! A shift of its own kind once in a while, against cycles.
      if (modulo(iteration, 11) == 10) shift = shift + cmplx(0.75_wp, 0.25_wp, wp)*modulus(t(last, last - 1))
      call qr_step(t, u, first, last, shift)
    end do
  end subroutine reduce_to_triangle

  !> The eigenvalue of a 2 by 2 matrix that is nearer to its last entry.
  pure complex(wp) function wilkinson_shift(b) result(shift)
    complex(wp), intent(in) :: b(2, 2)
    complex(wp) :: half, root
    half = (b(1, 1) - b(2, 2))/2
    root = root_of(half**2 + b(1, 2)*b(2, 1))
    if (real(conjg(half)*root) < 0) root = -root
    shift = b(2, 2)
    if (modulus(half + root) > 0) shift = b(2, 2) - b(1, 2)*b(2, 1)/(half + root)
  end function wilkinson_shift

  !> One QR step on the block from `first` to `last`, by plane rotations.
  pure subroutine qr_step(t, u, first, last, shift)
    complex(wp), intent(inout) :: t(:, :), u(:, :)
    integer, intent(in) :: first, last
    complex(wp), intent(in) :: shift
    complex(wp) :: s(size(t, 1)), row(size(t, 1)), column(size(t, 1))
    real(wp) :: c(size(t, 1)), length
    integer :: i
    do i = first, last
      t(i, i) = t(i, i) - shift
    end do
    do i = first, last - 1
      length = sqrt(modulus(t(i, i))**2 + modulus(t(i + 1, i))**2)
      c(i) = 1
      s(i) = 0
      if (length > 0) then
        if (modulus(t(i, i)) > 0) then
          c(i) = modulus(t(i, i))/length
          s(i) = t(i, i)/modulus(t(i, i))*conjg(t(i + 1, i))/length
        else
          c(i) = 0
          s(i) = 1
        end if
      end if
      row = t(i, :)
      t(i, i:) = c(i)*row(i:) + s(i)*t(i + 1, i:)
      t(i + 1, i:) = c(i)*t(i + 1, i:) - conjg(s(i))*row(i:)
    end do
    do i = first, last - 1
      column = t(:, i)
      t(:i + 1, i) = c(i)*column(:i + 1) + conjg(s(i))*t(:i + 1, i + 1)
      t(:i + 1, i + 1) = c(i)*t(:i + 1, i + 1) - s(i)*column(:i + 1)
      column = u(:, i)
      u(:, i) = c(i)*column + conjg(s(i))*u(:, i + 1)
      u(:, i + 1) = c(i)*u(:, i + 1) - s(i)*column
    end do
    do i = first, last
      t(i, i) = t(i, i) + shift
    end do
  end subroutine qr_step

  !> Refines a damped mode, l^2 w + l D w + K w = 0 with a diagonal K, by Newton's method: beside a large exponent a small one has
  !> lost its digits in any method for all of them at once. What does not converge stays as it is.
  pure subroutine refine_mode(stiffness, damping, exponent, shape)
    real(wp), intent(in) :: stiffness(:), damping(:, :)
    complex(wp), intent(inout) :: exponent, shape(:)
    complex(wp) :: m(size(shape) + 1, size(shape) + 1), miss(size(shape) + 1, 1), step(size(shape) + 1, 1), w(size(shape)), l
    integer, parameter :: most_steps = 8
    integer :: i, k, n, largest
    logical :: ok
    n = size(shape)
    largest = maxloc(modulus(shape), 1)
    l = exponent
    w = shape/shape(largest)
    do i = 1, most_steps
      m = 0
      m(:n, :n) = l*damping
      do k = 1, n
        m(k, k) = m(k, k) + (l**2 + stiffness(k))
      end do
      miss = 0
      miss(:n, 1) = -(l**2*w + l*matmul(damping, w) + stiffness*w)
      m(:n, n + 1) = 2*l*w + matmul(damping, w)
      m(n + 1, largest) = 1
      call solve_complex(m, miss, step, ok)
      if (.not. ok) return
      w = w + step(:n, 1)
      l = l + step(n + 1, 1)
      if (modulus(step(n + 1, 1)) > 4*epsilon(1.0_wp)*modulus(l)) cycle
      exponent = l
      shape = w
      return
    end do
  end subroutine refine_mode

  !> a x = b for several right-hand sides by elimination with partial pivoting; `ok` is false for a singular matrix.
  pure subroutine solve_complex(a, b, x, ok)
    complex(wp), intent(in) :: a(:, :), b(:, :)
    complex(wp), intent(out) :: x(:, :)
    logical, intent(out) :: ok
    complex(wp) :: m(size(a, 1), size(a, 1) + size(b, 2)), row(size(a, 1) + size(b, 2))
    integer :: i, k, n
    n = size(a, 1)
    m(:, :n) = a
    m(:, n + 1:) = b
    x = 0
    ok = .false.
    do k = 1, n
      i = k - 1 + maxloc(modulus(m(k:, k)), 1)
      if (.not. modulus(m(i, k)) > 0) return
      row = m(i, :)
      m(i, :) = m(k, :)
      m(k, :) = row
      do i = k + 1, n
        m(i, k:) = m(i, k:) - m(i, k)/m(k, k)*m(k, k:)
      end do
    end do
    do k = n, 1, -1
      x(k, :) = (m(k, n + 1:) - matmul(m(k, k + 1:n), x(k + 1:, :)))/m(k, k)
    end do
    ok = .true.
  end subroutine solve_complex

end module eigen
