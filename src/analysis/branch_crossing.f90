! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Tests that change their sign on a branch of periodic orbits, and where another branch crosses it.
module branch_crossing
  use body_family, only: family_t
  use branch_point, only: step_to, trace_t
  use errors, only: error_t
  use inverse_interpolation, only: weights_at_zero
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use multipliers, only: shifted_determinant
  use periodic_orbit, only: set_multipliers
  implicit none
  private

  public :: locate_branch_point, test_value

  !> The parameter turns, a multiplier passes +1 or -1, two together pass the unit circle.
  integer, parameter, public :: no_test = 0, test_turn = 1, test_plus = 2, test_minus = 3, test_circle = 4

  !> A branch point is interpolated between so many points, this share of the step apart.
  integer, parameter :: nodes = 6
  real(wp), parameter :: apart = 0.04_wp
  !> So many are tried on each side: those that are too near cannot be computed. Where the multiplier found there is not the one
  !> looked for, they are taken so much farther apart, or nearer.
  integer, parameter :: most_tried = 12
  real(wp), parameter :: spreads(5) = [1.0_wp, 2.0_wp, 4.0_wp, 0.25_wp, 0.0625_wp]
  !> A multiplier this near to that looked for is it.
  real(wp), parameter :: near_multiplier = 1e-6_wp
  integer, parameter :: most_secants = 30
  !> A test this much smaller than at the ends of the step is near enough to its zero.
  real(wp), parameter :: near_enough = 1e-3_wp

contains

  !> Value of a test.
  pure real(wp) function test_value(test, trace) result(value)
    integer, intent(in) :: test
    type(trace_t), intent(in) :: trace
    associate (m => trace%now%orbit%matrix, tangent => trace%now%tangent)
      select case (test)
      case (test_turn)
        value = tangent(size(tangent))
      case (test_plus)
        value = shifted_determinant(m, -1.0_wp)
      case (test_minus)
        value = shifted_determinant(m, 1.0_wp)
      case default
        value = circle_test(m, trace%now%orbit%multipliers)
      end select
    end associate
  end function test_value

  !> Zero where two multipliers of a map have the product 1. One that is not known beside large ones counts as none.
  pure real(wp) function circle_test(m, multipliers) result(value)
    real(wp), intent(in) :: m(:, :)
    complex(wp), intent(in) :: multipliers(:)
    complex(wp) :: all_pairs
    integer :: i, k
    if (size(multipliers) == 2) then
      value = m(1, 1)*m(2, 2) - m(1, 2)*m(2, 1) - 1
      return
    end if
    all_pairs = 1
    do i = 2, size(multipliers)
      do k = 1, i - 1
        if (multipliers(i) /= multipliers(i) .or. multipliers(k) /= multipliers(k)) then
          all_pairs = -all_pairs
        else
          all_pairs = all_pairs*(multipliers(i)*multipliers(k) - 1)
        end if
      end do
    end do
    value = real(all_pairs, wp)
  end function circle_test

  !> The point of a step at which a test passes zero and another branch crosses. The equations are singular there, so that it is
  !> interpolated between points on both sides; `ok` is false if none could be, whatever its multipliers.
  subroutine locate_branch_point(family, trace, next, test, length, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace, next
    integer, intent(in) :: test
    real(wp), intent(in) :: length
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    type(trace_t) :: candidate
    real(wp) :: zero, miss, least
    integer :: i
    logical :: found
    call near_zero(family, trace, test_value(test, trace), test_value(test, next), test, length, zero)
    ok = .false.
    least = huge(least)
    do i = 1, size(spreads)
      call interpolate(family, trace, test, zero, spreads(i)*apart*length, candidate, found)
      if (.not. found) cycle
      miss = minval(abs(candidate%now%orbit%multipliers - merge(-1, 1, test == test_minus)))
      if (ok .and. .not. miss < least) cycle
      ok = .true.
      least = miss
      there = candidate
      if (least < near_multiplier) exit
    end do
  end subroutine locate_branch_point

  !> The zero of a test about `zero` from points `distance` apart.
  subroutine interpolate(family, trace, test, zero, distance, there, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    integer, intent(in) :: test
    real(wp), intent(in) :: zero, distance
    type(trace_t), intent(out) :: there
    logical, intent(out) :: ok
    type(trace_t) :: node
    type(error_t), allocatable :: error
    real(wp) :: value(nodes), all(size(trace%now%tangent), nodes), tangents(size(trace%now%tangent), nodes), weight(nodes)
    integer :: i, k, n, side, steps
    n = size(trace%now%tangent)
    k = 0
    do side = -1, 1, 2
      do i = 1, most_tried
        call step_to(family, trace, zero + side*(i - 0.5_wp)*distance, node, ok, steps)
        if (.not. ok) cycle
        k = k + 1
        value(k) = test_value(test, node)
        all(:, k) = [node%now%orbit%y, node%now%orbit%events%time, node%now%orbit%parameter]
        tangents(:, k) = node%now%tangent
        if (k == nodes/2 .or. k == nodes) exit
      end do
      ok = k == merge(nodes/2, nodes, side < 0)
      if (.not. ok) return
    end do
    call weights_at_zero(value, weight, ok)
    if (.not. ok) return
    there = node
    associate (orbit => there%now%orbit, position => matmul(all, weight))
      orbit%y = position(:size(orbit%y))
      orbit%events%time = position(size(orbit%y) + 1:n - 1)
      orbit%parameter = position(n)
      there%now%tangent = matmul(tangents, weight)
      there%now%tangent = there%now%tangent/norm2(there%now%tangent)
      call machine_neighbourhood(family, orbit%parameter, there%machines, error)
      ok = .not. allocated(error)
      if (ok) call set_multipliers(there%machines, orbit)
    end associate
  end subroutine interpolate

  !> About where a test is zero, by the secant rule for as long as the equations can be solved.
  subroutine near_zero(family, trace, first, last, test, length, zero)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: first, last, length
    integer, intent(in) :: test
    real(wp), intent(out) :: zero
    type(trace_t) :: there
    real(wp) :: low, high, f_low, f_high, f
    integer :: i, steps
    logical :: ok
    low = 0
    high = length
    f_low = first
    f_high = last
    do i = 1, most_secants
      zero = low + (high - low)*min(max(f_low/(f_low - f_high), 0.05_wp), 0.95_wp)
      call step_to(family, trace, zero, there, ok, steps)
      if (.not. ok) return
      f = test_value(test, there)
      if (abs(f) < near_enough*max(abs(first), abs(last))) return
      if (f < 0 .eqv. f_high < 0) then
        high = zero
        f_high = f
      else
        low = zero
        f_low = f
      end if
    end do
  end subroutine near_zero

end module branch_crossing
