! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The zero of one guard on a panel: proofs that it has none, and steps to it from the left.
module guard_zero
  use certified_step, only: positive_step
  use elementary, only: exponential, logarithm
  use guard_functions, only: bases_at, bound, derivatives, search_t
  use kinds, only: wp
  implicit none
  private

  public :: stays_positive, approach, walk

  !> Remainder of the quintic: |y - H| <= max|y^(6)| L^6/46080 in the middle of a panel.
  real(wp), parameter :: remainder = 46080
  integer, parameter :: most_steps = 200, most_halvings = 60, most_intervals = 50

contains

  !> Whether Bernstein's coefficients of the quintic lie above its remainder.
  pure logical function stays_positive(search, g, a, b, here, there)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b, here(0:3), there(0:3)
    real(wp) :: h, least, miss
    h = b - a
    least = least_of(h, here, there)
    stays_positive = .false.
    if (.not. least > 0) return
    miss = bound(search, g, 6, a, h)*h**6/remainder
    stays_positive = least > miss
  end function stays_positive

  !> Smallest of Bernstein's coefficients of the quintic over a panel of length `h` [s].
  pure real(wp) function least_of(h, here, there) result(least)
    real(wp), intent(in) :: h, here(0:3), there(0:3)
    least = min(here(0), here(0) + h*here(1)/5, here(0) + h*(2*here(1)/5 + h*here(2)/20), &
                there(0) - h*(2*there(1)/5 - h*there(2)/20), there(0) - h*there(1)/5, there(0))
  end function least_of

  !> As `approach`, of a guard that begins as rounding, to within its rounding: over intervals on which the quintic is that good.
  pure subroutine walk(search, g, a, b, root, evaluations)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b
    real(wp), intent(out) :: root
    integer, intent(inout) :: evaluations
    real(wp) :: here(0:3), there(0:3), sixth, length, low, high, middle
    integer :: i
    root = huge(root)
    if (a >= b) return
    sixth = bound(search, g, 6, a, b - a)
    length = b - a
    if (sixth*length**6 > 0.5_wp*remainder*search%lift(g)) length = &
      exponential(logarithm(max(0.5_wp*remainder*search%lift(g)/sixth, tiny(sixth)))/6)
    low = a
    here = guard_at(search, g, low)
    do while (low < b)
      high = min(low + length, b)
      if (.not. high > low) exit
      there = guard_at(search, g, high)
      evaluations = evaluations + 1
      if (there(0) <= 0 .or. .not. least_of(high - low, here, there) > -search%lift(g)) exit
      low = high
      here = there
    end do
    if (low >= b) return
    do i = 1, most_halvings
      middle = low + (high - low)/2
      if (.not. (middle > low .and. middle < high)) exit
      there = guard_at(search, g, middle)
      evaluations = evaluations + 1
      if (there(0) <= 0 .or. .not. least_of(middle - low, here, there) > -search%lift(g)) then
        high = middle
      else
        low = middle
        here = there
      end if
    end do
    root = high
  end subroutine walk

  !> From `a`, where guard `g` is positive, to its first zero before `b`; huge if there is none.
  pure subroutine approach(search, g, a, b, root, evaluations)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b
    real(wp), intent(out) :: root
    integer, intent(inout) :: evaluations
    real(wp) :: low, high, at
    integer :: i
    call step_on(search, g, a, b, root, at, evaluations)
    do i = 1, most_intervals
      if (at >= b .or. root < huge(root)) return
      call prove_on(search, g, at, b, low, high, evaluations)
      if (low >= b) return
      call step_on(search, g, low, high, root, at, evaluations)
    end do
    root = at
  end subroutine approach

  !> Steps from `a` that hold no zero, to the first, `root`, or to `at`, where they have become too many, `b` at most.
  pure subroutine step_on(search, g, a, b, root, at, evaluations)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b
    real(wp), intent(out) :: root, at
    integer, intent(inout) :: evaluations
    real(wp) :: d(0:3), third, step, falling
    integer :: i
    root = huge(root)
    at = b
    if (a >= b) return
    third = bound(search, g, 3, a, b - a)
    at = a
    do i = 1, most_steps
      d = guard_at(search, g, at)
      evaluations = evaluations + 1
      if (d(0) <= 0) then
        root = at
        if (d(1) < 0) root = max(a, at - d(0)/d(1))
        return
      end if
      ! Within the next interval no curvature is below this.
      falling = max(0.0_wp, -d(2) + third*(b - at)/3)
      step = positive_step(d(0), d(1), falling)
      if (at + step > b) then
        at = b
        return
      end if
      if (step <= 1e-9_wp*(b - a) .and. d(1) < 0) then
        root = at - d(0)/d(1)
        return
      end if
      if (at + step <= at) then
        root = at
        return
      end if
      at = at + step
    end do
  end subroutine step_on

  !> Where a guard has been small for long, on from `a` over intervals on which the quintic proves that it has no zero, as far as
  !> `low`; between that and `high` it does not, however short the interval.
  pure subroutine prove_on(search, g, a, b, low, high, evaluations)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b
    real(wp), intent(out) :: low, high
    integer, intent(inout) :: evaluations
    real(wp) :: here(0:3), there(0:3), length
    integer :: halvings
    low = a
    high = b
    here = guard_at(search, g, low)
    length = (b - a)/2
    halvings = 0
    do while (low < b)
      high = min(low + length, b)
      there = guard_at(search, g, high)
      evaluations = evaluations + 1
      if (stays_positive(search, g, low, high, here, there)) then
        low = high
        here = there
        length = 2*length
        halvings = halvings - 1
      else if (there(0) <= 0 .or. halvings >= most_halvings .or. .not. low + length/2 > low) then
        return
      else
        length = length/2
        halvings = halvings + 1
      end if
    end do
  end subroutine prove_on

  !> A guard and its first three derivatives at the time `t` [s].
  pure function guard_at(search, g, t) result(d)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: t
    real(wp) :: d(0:3)
    complex(wp) :: growth(search%terms), turning(size(search%turn, 1))
    call bases_at(search, t, growth, turning)
    d = derivatives(search, g, t, growth, turning)
  end function guard_at

end module guard_zero
