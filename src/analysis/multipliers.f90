! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Multipliers of periodic orbits: eigenvalues of the derivative of their map, of any number of coordinates.
module multipliers
  use constants, only: unreachable
  use eigen, only: general_eigen, modulus, solve_complex
  use kinds, only: wp
  use matrices, only: determinant_of, eigenvalues
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: multipliers_of, multipliers_beside_graze, shifted_determinant, is_neutral

  !> Rounding of the entries of a map's derivative, as a share of its norm; what an eigenvalue must be known to, absolutely or as a
  !> share.
  real(wp), parameter :: rounding = 100*epsilon(1.0_wp), known_to = 1e-6_wp
  !> A multiplier this near to +1 is indistinguishable from it: where it is 1, as on a family of orbits and in a fold, Newton's
  !> method leaves the root of rounding in the orbit, and the curvature of the map times that in the multiplier.
  real(wp), parameter, public :: nearly_neutral = 1e-6_wp

contains

  !> Eigenvalues, largest modulus first; with imaginary parts that are none left out. `determinant`: of a matrix of two
  !> rows, from its factors: the entries of one with a large multiplier know the small one no more. Without it those that rounding
  !> of the entries hides, beside a graze, are not numbers.
  pure function multipliers_of(matrix, determinant) result(values)
    real(wp), intent(in) :: matrix(:, :)
    real(wp), intent(in), optional :: determinant
    complex(wp) :: values(size(matrix, 1)), vectors(size(matrix, 1), size(matrix, 1)), moved
    logical :: ok
    integer :: i, k
    if (size(matrix, 1) <= 2 .and. (present(determinant) .or. size(matrix, 1) == 1)) then
      values = eigenvalues(matrix, determinant)
      return
    else if (.not. all(abs(matrix) < unreachable)) then
      values = ieee_value(1.0_wp, ieee_quiet_nan)
      values(1) = matrix(1, 1)
      return
    end if
    if (size(matrix, 1) == 2) then
      values = eigenvalues(matrix)
      call leave_out_hidden(matrix, rounding*norm2(matrix), 2, values)
      return
    end if
    call general_eigen(matrix, values, vectors, ok)
    if (.not. ok) then
      values = ieee_value(1.0_wp, ieee_quiet_nan)
      values(1) = unreachable
      return
    end if
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
    call leave_out_hidden(matrix, rounding*norm2(matrix), 2, values)
  end function multipliers_of

  !> Makes those of the eigenvalues (largest first) that are not known no numbers: each moves, to first order, by the rounding of
  !> the matrix, at most `scatter`, times its condition |x||y|/|y'x| (Golub, Van Loan, Matrix Computations, 7.2.2), a double one by
  !> the root of that. Those before `first` are known.
  pure subroutine leave_out_hidden(matrix, scatter, first, values)
    real(wp), intent(in) :: matrix(:, :), scatter
    integer, intent(in) :: first
    complex(wp), intent(inout) :: values(:)
    complex(wp), dimension(size(values), size(values)) :: vectors, unit, left
    complex(wp) :: own(size(values))
    real(wp) :: miss
    integer :: i, k
    logical :: ok
    if (scatter < 1e-3_wp*known_to) return
    call general_eigen(matrix, own, vectors, ok)
    unit = 0
    do i = 1, size(values)
      unit(i, i) = 1
    end do
    if (ok) call solve_complex(vectors, unit, left, ok)
    do i = first, size(values)
      miss = sqrt(scatter)
      k = minloc(modulus(own - values(i)), 1)
      if (ok) miss = min(miss, scatter*norm2(modulus(vectors(:, k)))*norm2(modulus(left(k, :))))
      if (miss > known_to*max(1.0_wp, modulus(values(i)))) values(i) = ieee_value(1.0_wp, ieee_quiet_nan)
    end do
  end subroutine leave_out_hidden

  !> Eigenvalues of base - column row/rate, largest modulus first, where the rate is so small that but for one they are those of
  !> the limit: with the first axis along the row that of the rest of the base, less what the column makes of it. They are not
  !> numbers where the limit is not known to 1e-6; what the base is the difference of is `lost` times as large.
  pure function multipliers_beside_graze(base, column, row, rate, lost) result(values)
    real(wp), intent(in) :: base(:, :), column(:), row(:), rate, lost
    complex(wp) :: values(size(row))
    real(wp), dimension(size(row), size(row)) :: turn, turned
    real(wp), dimension(size(row)) :: axis, along
    real(wp) :: lead, scatter
    integer :: i, n
    n = size(row)
    values = ieee_value(1.0_wp, ieee_quiet_nan)
    if (.not. norm2(row) > 0) return
    ! Householder's reflection of the row onto the first axis.
    axis = row/norm2(row)
    axis(1) = axis(1) + sign(1.0_wp, axis(1))
    turn = -2*spread(axis, 2, n)*spread(axis, 1, n)/sum(axis**2)
    do i = 1, n
      turn(i, i) = turn(i, i) + 1
    end do
    turned = matmul(turn, matmul(base, turn))
    along = matmul(turn, column)
    lead = along(1)*sum(turn(1, :)*row)
    if (.not. abs(rate)*max(1.0_wp, maxval(abs(base)))**2 < known_to*abs(lead)) return
    ! A further event that grazes makes the base large, and what is left of it small.
    scatter = rounding*lost*norm2(turned)*(1 + norm2(along(2:)/along(1)))
    do i = 2, n
      turned(i, 2:) = turned(i, 2:) - along(i)/along(1)*turned(1, 2:)
    end do
    values(1) = -lead/rate
    values(2:) = multipliers_of(turned(2:, 2:))
    call leave_out_hidden(turned(2:, 2:), scatter, 1, values(2:))
  end function multipliers_beside_graze

  !> Whether one of the multipliers is indistinguishable from +1: the orbit is not isolated, or only just. Unknown multipliers do
  !> not count.
  pure logical function is_neutral(values)
    complex(wp), intent(in) :: values(:)
    is_neutral = any(abs(values - 1) < nearly_neutral)
  end function is_neutral

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
