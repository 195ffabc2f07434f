! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many equidistant samples of one flight on the closed form. Exponentials and angles are computed once per block; within it
!> they are products with a table of the powers of one step, so that a sample costs a few multiplications and no more rounding
!> than `evaluate`.
module exact_samples
  use elementary, only: exponential, sine_cosine
  use exact_flow, only: evaluate, flow_t, kinematics_t, secular_factor, segment_t
  use kinds, only: wp
  implicit none
  private

  public :: evaluate_row

  integer, parameter :: block = 16

  !> Factors from the start of a block to each of its samples, real and imaginary part by column.
  type :: table_t
    real(wp) :: turn(block, 2) = 0, drive(block, 2) = 0
    !> secular_factor from the start of the block.
    real(wp) :: secular(block, 2) = 0
  end type table_t

contains

  !> Position [m] and velocity [m/s] at `from`, `from` + `interval`, ... [s after the start of the flight].
  pure subroutine evaluate_row(flow, segment, from, interval, x, v)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: from, interval
    real(wp), intent(out) :: x(:), v(:)
    type(table_t) :: table
    real(wp) :: x_block(block), v_block(block)
    type(kinematics_t) :: now
    integer :: first, count
    if (flow%overdamped) then
      do first = 1, size(x)
        call evaluate(flow, segment, from + (first - 1)*interval, now)
        x(first) = now%x
        v(first) = now%v
      end do
      return
    end if
    call fill_table(flow, interval, table)
    do first = 1, size(x), block
      count = min(block, size(x) - first + 1)
      call evaluate_block(flow, segment, from + (first - 1)*interval, table, x_block, v_block)
      x(first:first + count - 1) = x_block(:count)
      v(first:first + count - 1) = v_block(:count)
    end do
  end subroutine evaluate_row

  pure subroutine fill_table(flow, interval, table)
    type(flow_t), intent(in) :: flow
    real(wp), intent(in) :: interval
    type(table_t), intent(out) :: table
    complex(wp) :: factor
    integer :: k
    call powers(cmplx(-flow%decay, flow%damped, wp), interval, table%turn)
    call powers(cmplx(0, flow%drive_frequency, wp), interval, table%drive)
    if (flow%resonant == 0) return
    do k = 1, block
      factor = secular_factor(flow%detuning, (k - 1)*interval)
      table%secular(k, :) = [real(factor, wp), aimag(factor)]
    end do
  end subroutine fill_table

  !> exp(rate k interval), k = 0, 1, ... by halves: the rounding grows with the logarithm of k.
  pure subroutine powers(rate, interval, table)
    complex(wp), intent(in) :: rate
    real(wp), intent(in) :: interval
    real(wp), intent(out) :: table(block, 2)
    real(wp) :: step(2)
    integer :: k, half
    table(1, :) = [1.0_wp, 0.0_wp]
    half = 1
    do while (half < block)
      step = exponential_of(rate, half*interval)
      do k = 1, half
        table(half + k, 1) = table(k, 1)*step(1) - table(k, 2)*step(2)
        table(half + k, 2) = table(k, 2)*step(1) + table(k, 1)*step(2)
      end do
      half = 2*half
    end do
  end subroutine powers

  !> exp(rate s), real and imaginary part.
  pure function exponential_of(rate, s) result(parts)
    complex(wp), intent(in) :: rate
    real(wp), intent(in) :: s
    real(wp) :: parts(2), sine, cosine, size_of_it
    call sine_cosine(aimag(rate)*s, sine, cosine)
    size_of_it = 1
    if (abs(real(rate, wp)) > 0) size_of_it = exponential(real(rate, wp)*s)
    parts = size_of_it*[cosine, sine]
  end function exponential_of

  !> The samples of a block that begins at `elapsed` [s after the start of the flight].
  pure subroutine evaluate_block(flow, segment, elapsed, table, x, v)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    type(table_t), intent(in) :: table
    real(wp), intent(out) :: x(block), v(block)
    real(wp), dimension(block) :: z_re, z_im, turn_re, turn_im, c1, s1, c, s, next
    real(wp) :: at(2)
    integer :: n
    at = exponential_of(cmplx(-flow%decay, flow%damped, wp), elapsed)
    turn_re = at(1)*table%turn(:, 1) - at(2)*table%turn(:, 2)
    turn_im = at(2)*table%turn(:, 1) + at(1)*table%turn(:, 2)
    z_re = turn_re*segment%z_re - turn_im*segment%z_im
    z_im = turn_im*segment%z_re + turn_re*segment%z_im
    at = exponential_of(cmplx(0, flow%drive_frequency, wp), segment%start + elapsed)
    c1 = at(1)*table%drive(:, 1) - at(2)*table%drive(:, 2)
    s1 = at(2)*table%drive(:, 1) + at(1)*table%drive(:, 2)
    c = c1
    s = s1
    do n = 1, flow%harmonics
      z_re = z_re + (flow%p_re(n)*c + flow%q_re(n)*s)
      z_im = z_im + (flow%p_im(n)*c + flow%q_im(n)*s)
      next = c*c1 - s*s1
      s = s*c1 + c*s1
      c = next
    end do
    if (flow%resonant > 0) call add_resonant(flow, segment, elapsed, table, turn_re, turn_im, z_re, z_im)
    z_im = z_im/flow%damped
    x = segment%equilibrium + z_im
    v = z_re - flow%decay*z_im
  end subroutine evaluate_block

  !> The answer to the harmonic near resonance: the secular factor at a + s is that at a plus exp(detuning a) times that
  !> at s, whatever cancels being gone from both.
  pure subroutine add_resonant(flow, segment, elapsed, table, turn_re, turn_im, z_re, z_im)
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    real(wp), intent(in) :: elapsed
    type(table_t), intent(in) :: table
    real(wp), intent(in), dimension(block) :: turn_re, turn_im
    real(wp), intent(inout), dimension(block) :: z_re, z_im
    real(wp), dimension(block) :: factor_re, factor_im, answer_re, answer_im
    real(wp) :: at(2)
    complex(wp) :: factor
    at = exponential_of(flow%detuning, elapsed)
    factor = secular_factor(flow%detuning, elapsed)
    factor_re = real(factor, wp) + (at(1)*table%secular(:, 1) - at(2)*table%secular(:, 2))
    factor_im = aimag(factor) + (at(2)*table%secular(:, 1) + at(1)*table%secular(:, 2))
    answer_re = real(segment%resonant_start, wp)*factor_re - aimag(segment%resonant_start)*factor_im
    answer_im = aimag(segment%resonant_start)*factor_re + real(segment%resonant_start, wp)*factor_im
    z_re = z_re + (turn_re*answer_re - turn_im*answer_im)
    z_im = z_im + (turn_im*answer_re + turn_re*answer_im)
  end subroutine add_resonant

end module exact_samples
