! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The variational equations of a system z' = f(z), on its tape: S' = f_z S for the derivatives S of z by its start.
module tape_variation
  use kinds, only: wp
  use operations, only: op_add, op_multiply
  use tape, only: constant, tape_t, variable
  use tape_algebra, only: binary
  use tape_derivative, only: differentiate
  implicit none
  private

  public :: add_variations

contains

  !> Adds the derivatives of the variables from `first` on by their start as variables after those of the system, one column after
  !> the other. `rates`: nodes of the rates of the system; `states`, `all_rates`: nodes of all variables, and of their rates.
  pure subroutine add_variations(tape, rates, first, states, all_rates)
    type(tape_t), intent(inout) :: tape
    integer, intent(in) :: rates(:), first
    integer, allocatable, intent(out) :: states(:), all_rates(:)
    integer :: slopes(size(rates), size(rates)), i, j, k, n, varied, term, sum_of, rate
    n = size(rates)
    varied = n - first + 1
    allocate (states(n + varied**2), all_rates(n + varied**2))
    do i = 1, size(states)
      call variable(tape, i, states(i))
    end do
    all_rates(:n) = rates
    do k = first, n
      call differentiate(tape, rates, states(k), slopes(:, k))
    end do
    do j = 1, varied
      do i = 1, varied
        call constant(tape, 0.0_wp, rate)
        do k = 1, varied
          call binary(tape, op_multiply, slopes(first - 1 + i, first - 1 + k), states(n + varied*(j - 1) + k), term)
          call binary(tape, op_add, rate, term, sum_of)
          rate = sum_of
        end do
        all_rates(n + varied*(j - 1) + i) = rate
      end do
    end do
  end subroutine add_variations

end module tape_variation
