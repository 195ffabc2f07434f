! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The complementarity problem of constraints with limited forces: y = G r + c with lower <= r <= upper, y >= 0 where r is
!> at its lower limit, y <= 0 at the upper, y = 0 between. G is symmetric and positive semidefinite: y is unique.
!> Principal pivoting by the least index, which ends (Murty 1974; with limits: Judice, Pires 1994).
module bounded_lcp
  use kinds, only: wp
  implicit none
  private

  public :: solve_bounded_lcp, depends_on, shared_inverse

  !> Constraints that depend on each other to this relative amount share their force evenly.
  real(wp), parameter, public :: dependent = 1e-10_wp
  !> Each takes the half of the digits off the error that sharing evenly brings.
  integer, parameter :: refinements = 2

contains

  !> `side` is -1, +1 at a limit, 0 between; what it holds at the start is tried first. `tolerance` is how much of y, and of
  !> r as y by its own mobility, counts as nothing; what is `fixed` has no force and keeps its
  !> side. `ok` is false if the pivoting does not end.
  pure subroutine solve_bounded_lcp(g, c, lower, upper, fixed, tolerance, side, r, y, ok)
    real(wp), intent(in) :: g(:, :), c(:), lower(:), upper(:), tolerance
    logical, intent(in) :: fixed(:)
    integer, intent(inout) :: side(:)
    real(wp), intent(out) :: r(:), y(:)
    logical, intent(out) :: ok
    real(wp) :: h(size(c), size(c))
    integer :: i, k, n, tries
    logical :: shared
    n = size(c)
    h = g
    shared = is_singular(g)
    if (shared) then
      h = regular(g)
    end if
    ok = .false.
    do i = 1, n
      if (side(i) < 0 .and. lower(i) <= -huge(1.0_wp)) side(i) = 0
      if (side(i) > 0 .and. upper(i) >= huge(1.0_wp)) side(i) = 0
    end do
    do tries = 1, 50*(n + 1)**2
      call forces_for(g, h, merge(refinements, 0, shared), c, lower, upper, fixed, side, r)
      y = matmul(g, r) + c
      k = 0
      do i = 1, n
        if (fixed(i)) cycle
        if (side(i) == 0) then
          if (r(i)*g(i, i) < lower(i)*g(i, i) - tolerance) k = -i
          if (r(i)*g(i, i) > upper(i)*g(i, i) + tolerance) k = i
          if (k /= 0) then
            side(i) = sign(1, k)
            exit
          end if
        else if (side(i)*y(i) > tolerance) then
          k = i
          side(i) = 0
          exit
        end if
      end do
      if (k == 0) then
        ok = .true.
        where (side == 0 .and. .not. fixed) y = 0
        return
      end if
    end do
  end subroutine solve_bounded_lcp

  !> Inverse of a positive semidefinite matrix, as far as it has one: of the forces that bring about a motion those that are shared
  !> evenly, X of X G X = X, symmetric.
  pure function shared_inverse(g) result(inverse)
    real(wp), intent(in) :: g(:, :)
    real(wp) :: inverse(size(g, 1), size(g, 1)), onto(size(g, 1), size(g, 1))
    ! What is no motion is taken from the right sides before it can grow.
    onto = transpose(shared_solution(g, g))
    inverse = shared_solution(g, onto)
  end function shared_inverse

  !> Solution of G x = b for each column of `b`, which must be in the range of G.
  pure function shared_solution(g, b) result(x)
    real(wp), intent(in) :: g(:, :), b(:, :)
    real(wp) :: x(size(g, 1), size(b, 2)), h(size(g, 1), size(g, 1))
    real(wp), dimension(size(g, 1)) :: zero
    logical, dimension(size(g, 1)) :: fixed
    integer :: i, side(size(g, 1))
    h = regular(g)
    zero = 0
    fixed = .false.
    side = 0
    do i = 1, size(b, 2)
      call forces_for(g, h, refinements, -b(:, i), zero, zero, fixed, side, x(:, i))
    end do
  end function shared_solution

  !> The matrix with a diagonal that is a little larger.
  pure function regular(g) result(h)
    real(wp), intent(in) :: g(:, :)
    real(wp) :: h(size(g, 1), size(g, 1))
    integer :: i
    h = g
    do i = 1, size(g, 1)
      h(i, i) = h(i, i)*(1 + sqrt(epsilon(1.0_wp)))
    end do
  end function regular

  !> Whether constraint `i` cannot move where those of `held` do not.
  pure logical function depends_on(g, i, held)
    real(wp), intent(in) :: g(:, :)
    integer, intent(in) :: i
    logical, intent(in) :: held(:)
    real(wp) :: m(size(g, 1), size(g, 1))
    integer :: k, j
    m = g
    do k = 1, size(g, 1)
      if (.not. held(k) .or. k == i .or. m(k, k) <= dependent*g(k, k)) cycle
      do j = 1, size(g, 1)
        if (j /= k) m(:, j) = m(:, j) - m(:, k)*(m(k, j)/m(k, k))
      end do
      m(:, k) = 0
    end do
    depends_on = m(i, i) <= dependent*g(i, i)
  end function depends_on

  !> Whether a positive semidefinite matrix has dependent rows.
  pure logical function is_singular(g)
    real(wp), intent(in) :: g(:, :)
    real(wp) :: m(size(g, 1), size(g, 1))
    integer :: i, k
    m = g
    is_singular = .false.
    do k = 1, size(g, 1)
      if (m(k, k) <= dependent*g(k, k)) then
        is_singular = .true.
        return
      end if
      do i = k + 1, size(g, 1)
        m(k + 1:, i) = m(k + 1:, i) - m(k + 1:, k)*(m(k, i)/m(k, k))
      end do
    end do
  end function is_singular

  !> Forces with those at a limit as given: of `g` by the regular matrix `h` near it, refined `refinements` times.
  pure subroutine forces_for(g, h, refinements, c, lower, upper, fixed, side, r)
    real(wp), intent(in) :: g(:, :), h(:, :), c(:), lower(:), upper(:)
    integer, intent(in) :: refinements
    logical, intent(in) :: fixed(:)
    integer, intent(in) :: side(:)
    real(wp), intent(out) :: r(:)
    real(wp) :: m(size(c), size(c)), b(size(c)), factor
    integer :: list(size(c)), i, k, count_free, round
    r = 0
    count_free = 0
    do i = 1, size(c)
      if (fixed(i)) cycle
      if (side(i) < 0) r(i) = lower(i)
      if (side(i) > 0) r(i) = upper(i)
      if (side(i) == 0) then
        count_free = count_free + 1
        list(count_free) = i
      end if
    end do
    if (count_free == 0) return
    do round = 0, refinements
      associate (free => list(:count_free))
        m(:count_free, :count_free) = h(free, free)
        b(:count_free) = -c(free) - matmul(g(free, :), r)
        do k = 1, count_free
          do i = k + 1, count_free
            factor = m(i, k)/m(k, k)
            m(i, k:count_free) = m(i, k:count_free) - factor*m(k, k:count_free)
            b(i) = b(i) - factor*b(k)
          end do
        end do
        do k = count_free, 1, -1
          b(k) = (b(k) - sum(m(k, k + 1:count_free)*b(k + 1:count_free)))/m(k, k)
        end do
        r(free) = r(free) + b(:count_free)
      end associate
    end do
  end subroutine forces_for

end module bounded_lcp
