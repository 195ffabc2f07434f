! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A function given by its values at a few knots: cubic between two of them (Hermite), with one slope at each, so that it is
!> continuous with its derivative; beyond the first and the last it is constant, or goes on straight. The slope at a knot is
!> that of the polynomial through five knots, it in the middle if they allow: the error falls with the fourth power of their
!> distance, and the function is linear in the values.
module curve_law
  use kinds, only: wp
  implicit none
  private

  public :: curve_of, value_at, continued_at, slope_of, integral_of, steepest, most_bent, piece_at, piece_limits, pieces_of, &
    is_positive, knots_problem

  integer, parameter, public :: most_knots = 16

  type, public :: curve_t
    integer :: count = 0
    !> Knots, ascending; values and slopes there.
    real(wp) :: at(most_knots) = 0, value(most_knots) = 0, slope(most_knots) = 0
    !> Straight from knot to knot, with the slope of a knot from there on, and constant before the first: corners, no curve.
    logical :: sharp = .false.
  end type curve_t

contains

  !> What is wrong with knots `at` and their number of values, '' if nothing.
  pure function knots_problem(at, values) result(problem)
    real(wp), intent(in) :: at(:)
    integer, intent(in) :: values
    character(len=:), allocatable :: problem
    problem = ''
    if (size(at) < 2 .or. size(at) > most_knots) then
      problem = 'allowed 2 to 16 knots'
    else if (values /= size(at)) then
      problem = 'allowed as many values as knots'
    else if (any(at(2:) <= at(:size(at) - 1))) then
      problem = 'allowed ascending knots'
    end if
  end function knots_problem

  !> The curve through `values` at the knots `at`, in which `knots_problem` finds no problem.
  pure type(curve_t) function curve_of(at, values) result(curve)
    real(wp), intent(in) :: at(:), values(:)
    integer :: i, first, last
    curve%count = size(at)
    curve%at(:size(at)) = at
    curve%value(:size(at)) = values
    do i = 1, size(at)
      first = max(1, min(i - 2, size(at) - 4))
      last = min(size(at), first + 4)
      curve%slope(i) = slope_at(at(first:last), values(first:last), i - first + 1)
    end do
  end function curve_of

  !> Derivative at knot `i` of the polynomial through all of them (Lagrange).
  pure real(wp) function slope_at(at, values, i) result(slope)
    real(wp), intent(in) :: at(:), values(:)
    integer, intent(in) :: i
    real(wp) :: weight
    integer :: j, k
    slope = 0
    do j = 1, size(at)
      if (j == i) cycle
      ! The two terms of a difference, so that a constant has slope 0 to the bit.
      weight = 1/(at(j) - at(i))
      do k = 1, size(at)
        if (k /= i .and. k /= j) weight = weight*(at(i) - at(k))/(at(j) - at(k))
      end do
      slope = slope + weight*(values(j) - values(i))
    end do
  end function slope_at

  !> Value at `x`; constant beyond the knots.
  pure real(wp) function value_at(curve, x) result(value)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: x
    value = 0
    if (curve%count == 0) return
    value = curve%value(1)
    if (x <= curve%at(1)) return
    value = curve%value(curve%count)
    if (x >= curve%at(curve%count)) return
    value = continued_at(curve, x)
  end function value_at

  !> Value at `x`; straight on beyond the knots, so that the derivative is continuous everywhere. With `piece` from 0 on that of
  !> this piece, continued beyond its knots: a function without any kink.
  pure real(wp) function continued_at(curve, x, piece) result(value)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: x
    integer, intent(in), optional :: piece
    real(wp) :: width, s, r
    integer :: i
    value = 0
    if (curve%count == 0) return
    i = -1
    if (present(piece)) i = piece
    if (i < 0) i = piece_at(curve, x)
    if (curve%sharp) then
      value = curve%value(max(1, i))
      if (i > 0) value = value + curve%slope(i)*(x - curve%at(i))
      return
    end if
    if (i == 0 .or. i == curve%count) then
      i = max(1, i)
      value = curve%value(i) + curve%slope(i)*(x - curve%at(i))
      return
    end if
    width = curve%at(i + 1) - curve%at(i)
    s = (x - curve%at(i))/width
    r = 1 - s
    value = curve%value(i)*r*r*(1 + 2*s) + curve%value(i + 1)*s*s*(3 - 2*s) + &
            width*s*r*(curve%slope(i)*r - curve%slope(i + 1)*s)
  end function continued_at

  !> The piece that `x` is in: 0 before the first knot, to `count` from the last on.
  pure integer function piece_at(curve, x) result(piece)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: x
    piece = count(curve%at(:curve%count) <= x)
  end function piece_at

  !> Where a motion that is in a piece leaves it, downwards and upwards: beyond its knots by a small share of its width, so that
  !> it begins the next piece inside. Of the derivative that changes there, the second or at a corner the first, a power of that
  !> share remains.
  pure function piece_limits(curve, piece) result(limits)
    type(curve_t), intent(in) :: curve
    integer, intent(in) :: piece
    real(wp) :: limits(2), overlap
    overlap = merge(1e-9_wp, 1e-6_wp, curve%sharp)
    limits = [-1, 1]*huge(1.0_wp)
    associate (at => curve%at, last => curve%count)
      if (piece > 0) limits(1) = at(piece) - overlap*(at(max(2, piece)) - at(max(2, piece) - 1))
      if (piece < last) limits(2) = at(piece + 1) + overlap*(at(max(2, piece + 1)) - at(max(2, piece + 1) - 1))
    end associate
  end function piece_limits

  !> Derivative at `x` of the curve that goes straight on beyond the knots; at a corner that from there on.
  pure real(wp) function slope_of(curve, x) result(slope)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: x
    real(wp) :: width, s
    integer :: i
    slope = 0
    if (curve%count == 0) return
    if (curve%sharp) then
      i = piece_at(curve, x)
      if (i > 0) slope = curve%slope(i)
      return
    end if
    slope = curve%slope(1)
    if (x <= curve%at(1)) return
    slope = curve%slope(curve%count)
    if (x >= curve%at(curve%count)) return
    i = count(curve%at(:curve%count) <= x)
    width = curve%at(i + 1) - curve%at(i)
    s = (x - curve%at(i))/width
    slope = 6*s*(1 - s)*(curve%value(i + 1) - curve%value(i))/width + (1 - s)*(1 - 3*s)*curve%slope(i) &
            - s*(2 - 3*s)*curve%slope(i + 1)
  end function slope_of

  !> The curve that goes straight on beyond the knots by its pieces, 0 before the first knot to `count` behind the last:
  !> c0 + c1 u + c2 u^2 + c3 u^3, u from the knot before, in piece 0 from the first.
  pure function pieces_of(curve) result(c)
    type(curve_t), intent(in) :: curve
    real(wp) :: c(0:3, 0:curve%count), width, mean
    integer :: i
    c = 0
    c(:1, 0) = [curve%value(1), merge(0.0_wp, curve%slope(1), curve%sharp)]
    do i = 1, curve%count
      c(:1, i) = [curve%value(i), curve%slope(i)]
      if (i == curve%count .or. curve%sharp) cycle
      width = curve%at(i + 1) - curve%at(i)
      mean = (curve%value(i + 1) - curve%value(i))/width
      c(2:, i) = [(3*mean - 2*curve%slope(i) - curve%slope(i + 1))/width, &
                  (curve%slope(i) + curve%slope(i + 1) - 2*mean)/width**2]
    end do
  end function pieces_of

  !> Integral from the first knot to `x` of the curve that goes straight on beyond the knots.
  pure real(wp) function integral_of(curve, x) result(total)
    type(curve_t), intent(in) :: curve
    real(wp), intent(in) :: x
    real(wp) :: width, s, beyond
    integer :: i
    total = 0
    if (curve%count == 0) return
    if (curve%sharp) then
      total = min(0.0_wp, x - curve%at(1))*curve%value(1)
      do i = 1, curve%count
        beyond = x - curve%at(i)
        if (beyond <= 0) exit
        if (i < curve%count) beyond = min(beyond, curve%at(i + 1) - curve%at(i))
        total = total + beyond*(curve%value(i) + curve%slope(i)*beyond/2)
      end do
      return
    end if
    do i = 1, curve%count - 1
      width = curve%at(i + 1) - curve%at(i)
      s = min(1.0_wp, (x - curve%at(i))/width)
      if (s <= 0) exit
      total = total + width*(curve%value(i)*s*(1 + s**2*(s/2 - 1)) + curve%value(i + 1)*s**3*(1 - s/2) + &
                             width*s**2*(curve%slope(i)*(0.5_wp + s*(s/4 - 2/3.0_wp)) + &
                                         curve%slope(i + 1)*s*(s/4 - 1/3.0_wp)))
    end do
    beyond = min(0.0_wp, x - curve%at(1))
    total = total + beyond*(curve%value(1) + curve%slope(1)*beyond/2)
    associate (last => curve%count)
      beyond = max(0.0_wp, x - curve%at(last))
      total = total + beyond*(curve%value(last) + curve%slope(last)*beyond/2)
    end associate
  end function integral_of

  !> Largest second derivative in magnitude: that of a cubic is linear, so at a knot. Corners are none.
  pure real(wp) function most_bent(curve)
    type(curve_t), intent(in) :: curve
    real(wp) :: width, mean
    integer :: i
    most_bent = 0
    if (curve%sharp) return
    do i = 1, curve%count - 1
      width = curve%at(i + 1) - curve%at(i)
      mean = (curve%value(i + 1) - curve%value(i))/width
      most_bent = max(most_bent, abs(6*mean - 4*curve%slope(i) - 2*curve%slope(i + 1))/width, &
                      abs(6*mean - 2*curve%slope(i) - 4*curve%slope(i + 1))/width)
    end do
  end function most_bent

  !> Whether a curve that begins with value 0 is above 0 from there on, beyond the last knot too.
  pure logical function is_positive(curve)
    type(curve_t), intent(in) :: curve
    real(wp) :: width, c(0:3), position(4), q
    integer :: i, k
    is_positive = .false.
    if (curve%slope(curve%count) < 0) return
    do i = 1, curve%count - 1
      width = curve%at(i + 1) - curve%at(i)
      ! The cubic in s; that of the first interval is divided by s.
      c = [curve%value(i), width*curve%slope(i), 3*(curve%value(i + 1) - curve%value(i)) - &
           width*(2*curve%slope(i) + curve%slope(i + 1)), 2*(curve%value(i) - curve%value(i + 1)) + &
           width*(curve%slope(i) + curve%slope(i + 1))]
      if (i == 1) c = [c(1:), 0.0_wp]
      ! Where it may be least: at its ends, where its derivative is 0.
      q = -c(2) - sign(sqrt(max(0.0_wp, c(2)**2 - 3*c(1)*c(3))), c(2))
      position = [epsilon(q), 1.0_wp, quotient(q, 3*c(3)), quotient(c(1), q)]
      do k = 1, size(position)
        if (position(k) <= 0 .or. position(k) > 1) cycle
        if (.not. c(0) + position(k)*(c(1) + position(k)*(c(2) + position(k)*c(3))) > 0) return
      end do
    end do
    is_positive = .true.

  contains

    !> a/b; 0 where b is 0.
    pure real(wp) function quotient(a, b)
      real(wp), intent(in) :: a, b
      quotient = 0
      if (abs(b) > 0) quotient = a/b
    end function quotient

  end function is_positive

  !> A bound on the derivative: that of 6 s (1 - s) d + (1 - s)(1 - 3 s) m_i - s (2 - 3 s) m_{i+1}, d the mean slope.
  pure real(wp) function steepest(curve)
    type(curve_t), intent(in) :: curve
    integer :: i
    steepest = 0
    if (curve%sharp) then
      steepest = maxval(abs(curve%slope))
      return
    end if
    do i = 1, curve%count - 1
      steepest = max(steepest, 1.5_wp*abs(curve%value(i + 1) - curve%value(i))/(curve%at(i + 1) - curve%at(i)) &
                     + abs(curve%slope(i)) + abs(curve%slope(i + 1)))
    end do
  end function steepest

end module curve_law
