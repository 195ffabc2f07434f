! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The metric around the points of a cycle in which its linear part contracts.
module capture_metric
  use attractors, only: attractor_t, metric_numbers
  use kinds, only: wp
  implicit none
  private

  public :: contracting_metric, eigenvalue_bounds, least_eigenvalue, matrix_of

  !> The metric of a speed that only a body at rest is near.
  real(wp), parameter, public :: at_rest_only = 1e30_wp

contains

  !> S = sum over k of (M^k)' M^k, the metric in which a stable M contracts: its upper triangle, column by column.
  pure function contracting_metric(jacobian) result(metric)
    real(wp), intent(in) :: jacobian(:, :)
    real(wp) :: metric(metric_numbers(size(jacobian, 1)))
    real(wp), dimension(size(jacobian, 1), size(jacobian, 1)) :: s, m
    integer :: i, j, k
    s = 0
    do i = 1, size(s, 1)
      s(i, i) = 1
    end do
    m = jacobian
    do i = 1, 30
      s = s + matmul(transpose(m), matmul(s, m))
      m = matmul(m, m)
      if (maxval(abs(m)) < epsilon(1.0_wp)) exit
    end do
    do j = 1, size(s, 1)
      do k = 1, j
        metric((j*(j - 1))/2 + k) = (s(k, j) + s(j, k))/2
      end do
    end do
  end function contracting_metric

  !> The least eigenvalue of the metrics of a cycle.
  pure real(wp) function least_eigenvalue(attractor) result(least)
    type(attractor_t), intent(in) :: attractor
    real(wp) :: bounds(2)
    integer :: i
    least = huge(least)
    do i = 1, attractor%period
      bounds = eigenvalue_bounds(attractor, i)
      least = min(least, bounds(1))
    end do
  end function least_eigenvalue

  !> Bounds of the eigenvalues of the metric at the `i`-th point: exact up to two coordinates, else 1, which none is below,
  !> and their sum.
  pure function eigenvalue_bounds(attractor, i) result(bounds)
    type(attractor_t), intent(in) :: attractor
    integer, intent(in) :: i
    real(wp) :: bounds(2)
    integer :: k
    associate (s => attractor%metric(:, i))
      select case (attractor%coordinates)
      case (1)
        bounds = s(1)
      case (2)
        bounds = (s(1) + s(3))/2 + [-1, 1]*sqrt(((s(1) - s(3))/2)**2 + s(2)**2)
        if (s(3) >= at_rest_only) bounds = s(1)
      case default
        bounds = [1.0_wp, sum([(s((k*(k + 1))/2), k=1, attractor%coordinates)])]
      end select
    end associate
  end function eigenvalue_bounds

  !> The symmetric matrix with this upper triangle.
  pure function matrix_of(triangle, n) result(s)
    real(wp), intent(in) :: triangle(:)
    integer, intent(in) :: n
    real(wp) :: s(n, n)
    integer :: j, k
    do j = 1, n
      do k = 1, j
        s(k, j) = triangle((j*(j - 1))/2 + k)
        s(j, k) = s(k, j)
      end do
    end do
  end function matrix_of

end module capture_metric
