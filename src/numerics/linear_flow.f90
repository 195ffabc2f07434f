! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Linear motions y' = A y in closed form, exp(A t) y, forcing and constants being unknowns of their own. Over a stretch
!> no longer than 1/rate, the rate being that of the fastest of them, the exponential series is rounded at `order`: the
!> motion then is a polynomial, whose derivatives certify the zeros of any linear function of y.
module linear_flow
  use certified_step, only: departure_step, positive_step, single_root_limit, taylor_root
  use kinds, only: wp
  implicit none
  private

  public :: prepare_linear, tabulate, expand, state_at, bound_of, is_above, stride, series_of, series_value, first_zero, &
    product_integral, drop_rounding

  integer, parameter, public :: most_unknowns = 10
  !> 1/21! is below the rounding of doubles by far; quadruple precision takes more terms.
  integer, parameter, public :: order = merge(20, 30, epsilon(1.0_wp) > 1e-20_wp)

  integer, parameter :: most_polish = 60
  integer, parameter :: squarings = 4
  !> Rounding of a sum, as a share of the sum of the absolute values; how many terms of a series are looked at.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
  integer, parameter :: last_of_rounding = 3
  !> Coefficients of a series that a bound knows by themselves.
  integer, parameter :: last_leading = 4

  type, public :: linear_t
    real(wp) :: matrix(most_unknowns, most_unknowns) = 0
    !> Bound on how fast the unknowns change [1/s], 0 for motions that are polynomials in time.
    real(wp) :: rate = 0
    !> Of a tabulated one over a full stretch, 1/rate long: the unknowns after it per unit of those before, their coefficients of
    !> each power per unit of each unknown, and the last power that it has.
    real(wp), allocatable :: stride(:, :), terms(:, :, :)
    integer :: last(most_unknowns) = 0
  end type linear_t

  !> A linear function of the unknowns over a full stretch: its first coefficients per unit of an unknown, a bound on the sum of
  !> the others, and the rounding of all. Only the unknowns `of` count.
  type, public :: bound_t
    integer :: count = 0, of(most_unknowns) = 0
    real(wp) :: leading(0:last_leading, most_unknowns) = 0, rest(most_unknowns) = 0, blur(most_unknowns) = 0
  end type bound_t

  !> A stretch of the motion: its length [s] and the unknowns by rising powers (columns) of the fraction of the length.
  type, public :: stretch_t
    real(wp) :: length = 0
    real(wp) :: path(most_unknowns, 0:order) = 0
  end type stretch_t

contains

  !> The motion with the matrix `matrix` [SI].
  pure function prepare_linear(matrix) result(linear)
    real(wp), intent(in) :: matrix(most_unknowns, most_unknowns)
    type(linear_t) :: linear
    real(wp) :: power(most_unknowns, most_unknowns), size_of_matrix, size_of_power
    integer :: i
    linear%matrix = matrix
    size_of_matrix = maxval(sum(abs(matrix), dim=1))
    if (size_of_matrix <= 0) return
    ! Gelfand: |A^k|^(1/k) falls to the spectral radius as k grows, whatever the units of the unknowns.
    power = matrix/size_of_matrix
    do i = 1, squarings
      power = matmul(power, power)
    end do
    size_of_power = maxval(sum(abs(power), dim=1))
    do i = 1, squarings
      size_of_power = sqrt(size_of_power)
    end do
    linear%rate = size_of_matrix*size_of_power
  end function prepare_linear

  !> Tables for a motion that has many flights; none where nothing but powers of time is in it.
  pure subroutine tabulate(linear)
    type(linear_t), intent(inout) :: linear
    real(wp) :: term(most_unknowns, most_unknowns)
    integer :: k, j
    if (.not. linear%rate > 0) return
    allocate (linear%terms(most_unknowns, 0:order, most_unknowns))
    term = 0
    do k = 1, most_unknowns
      term(k, k) = 1
    end do
    linear%stride = term
    linear%terms(:, 0, :) = term
    do k = 1, order
      term = matmul(linear%matrix, term)/(linear%rate*k)
      linear%stride = linear%stride + term
      linear%terms(:, k, :) = term
      do j = 1, most_unknowns
        if (any(abs(term(:, j)) > 0)) linear%last(j) = k
      end do
    end do
  end subroutine tabulate

  !> The unknowns after a full stretch.
  pure function stride(linear, y) result(after)
    type(linear_t), intent(in) :: linear
    real(wp), intent(in) :: y(most_unknowns)
    real(wp) :: after(most_unknowns)
    integer :: j
    after = 0
    do j = 1, most_unknowns
      if (abs(y(j)) > 0) after = after + linear%stride(:, j)*y(j)
    end do
  end function stride

  !> What bounds the linear function `row` of the unknowns over a full stretch.
  pure function bound_of(linear, row) result(bound)
    type(linear_t), intent(in) :: linear
    real(wp), intent(in) :: row(most_unknowns)
    type(bound_t) :: bound
    real(wp) :: terms(0:order, most_unknowns), term(most_unknowns)
    integer :: k, j
    if (.not. linear%rate > 0) return
    term = row
    terms(0, :) = term
    do k = 1, order
      term = matmul(term, linear%matrix)/(linear%rate*k)
      terms(k, :) = term
    end do
    do j = 1, most_unknowns
      if (.not. any(abs(terms(:, j)) > 0)) cycle
      bound%count = bound%count + 1
      bound%of(bound%count) = j
      bound%leading(:, bound%count) = terms(:last_leading, j)
      bound%rest(bound%count) = sum(abs(terms(last_leading + 1:, j)))
      bound%blur(bound%count) = rounding*sum(abs(terms(:, j)))
    end do
  end function bound_of

  !> Whether `side` times a linear function is certainly positive all along a full stretch from `y`, or all but at its start
  !> where it starts `from_zero`; `sizes` are those of the unknowns, for their rounding. The coefficients of Bernstein's
  !> polynomials of the first terms lie above what the others can do.
  pure logical function is_above(bound, side, y, sizes, from_zero)
    type(bound_t), intent(in) :: bound
    real(wp), intent(in) :: side, y(most_unknowns), sizes(most_unknowns)
    logical, intent(in) :: from_zero
    real(wp) :: c(0:last_leading), against, least
    integer :: i
    is_above = .false.
    if (bound%count == 0) return
    c = 0
    against = 0
    do i = 1, bound%count
      associate (j => bound%of(i))
        c = c + bound%leading(:, i)*y(j)
        against = against + bound%rest(i)*abs(y(j)) + bound%blur(i)*abs(sizes(j))
      end associate
    end do
    c = side*c
    if (from_zero) then
      least = min(c(1), c(1) + c(2)/3, c(1) + (2*c(2) + c(3))/3, c(1) + c(2) + c(3) + c(4))
    else
      least = min(c(0), c(0) + c(1)/4, c(0) + (3*c(1) + c(2))/6, c(0) + (3*c(1) + 2*c(2) + c(3))/4, &
                  c(0) + c(1) + c(2) + c(3) + c(4))
    end if
    is_above = least > against
  end function is_above

  !> The stretch from the state `y`, `longest` [s] at most.
  pure subroutine expand(linear, y, longest, stretch)
    type(linear_t), intent(in) :: linear
    real(wp), intent(in) :: y(most_unknowns), longest
    type(stretch_t), intent(out) :: stretch
    real(wp) :: power(0:order)
    integer :: k, j
    stretch%length = longest
    if (linear%rate*longest > 1) stretch%length = 1/linear%rate
    if (allocated(linear%terms)) then
      do j = 1, most_unknowns
        if (.not. abs(y(j)) > 0) cycle
        do k = 0, linear%last(j)
          stretch%path(:, k) = stretch%path(:, k) + linear%terms(:, k, j)*y(j)
        end do
      end do
      if (linear%rate*longest > 1) return
      power(0) = 1
      do k = 1, order
        power(k) = power(k - 1)*(linear%rate*longest)
        stretch%path(:, k) = stretch%path(:, k)*power(k)
      end do
      return
    end if
    stretch%path(:, 0) = y
    do k = 1, order
      do j = 1, most_unknowns
        if (abs(stretch%path(j, k - 1)) > 0) stretch%path(:, k) = &
          stretch%path(:, k) + linear%matrix(:, j)*(stretch%path(j, k - 1)*(stretch%length/k))
      end do
    end do
  end subroutine expand

  !> The unknowns at a fraction of a stretch.
  pure function state_at(stretch, fraction) result(y)
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: fraction
    real(wp) :: y(most_unknowns)
    integer :: k
    y = stretch%path(:, order)
    do k = order - 1, 0, -1
      y = y*fraction + stretch%path(:, k)
    end do
  end function state_at

  !> A linear function of the unknowns along a stretch, by rising powers of the fraction.
  pure function series_of(stretch, row) result(p)
    type(stretch_t), intent(in) :: stretch
    real(wp), intent(in) :: row(most_unknowns)
    real(wp) :: p(0:order)
    integer :: j
    p = 0
    do j = 1, most_unknowns
      if (abs(row(j)) > 0) p = p + row(j)*stretch%path(j, :)
    end do
  end function series_of

  !> Value of a series at a fraction, and its first two derivatives.
  pure subroutine series_value(p, t, value, rate, curvature)
    real(wp), intent(in) :: p(0:order), t
    real(wp), intent(out) :: value
    real(wp), intent(out), optional :: rate, curvature
    real(wp) :: first, half_second
    integer :: k
    value = p(order)
    first = 0
    half_second = 0
    do k = order - 1, 0, -1
      half_second = half_second*t + first
      first = first*t + value
      value = value*t + p(k)
    end do
    if (present(rate)) rate = first
    if (present(curvature)) curvature = 2*half_second
  end subroutine series_value

  !> Drops the leading terms of the series of `row` from the state `y` that are no more than the rounding of what they
  !> are sums of, so that the first that is more tells which way a function goes on from zero.
  pure subroutine drop_rounding(linear, row, y, length, p)
    type(linear_t), intent(in) :: linear
    real(wp), intent(in) :: row(most_unknowns), y(most_unknowns), length
    real(wp), intent(inout) :: p(0:order)
    real(wp) :: term(most_unknowns)
    integer :: k
    term = abs(y)
    do k = 0, last_of_rounding
      if (k > 0) term = matmul(abs(linear%matrix), term)*(length/k)
      if (abs(p(k)) > rounding*sum(abs(row)*term)) return
      p(k) = 0
    end do
  end subroutine drop_rounding

  !> First fraction in (0, 1] at which a series that is positive at 0, or leaves zero upwards there, has fallen to zero;
  !> 2 if it stays positive or is zero throughout, 0 if it falls at once. Nothing can hide: the steps are certified by
  !> bounds on the second and third derivative over the stretch, and from zero also by the first term of the series.
  pure real(wp) function first_zero(p) result(t)
    real(wp), intent(in) :: p(0:order)
    real(wp) :: value, rate, curvature, second_bound, third_bound, step, limit
    integer :: k
    real(wp), parameter :: smallest = 4*epsilon(1.0_wp)
    second_bound = 0
    third_bound = 0
    do k = 2, order
      second_bound = second_bound + k*(k - 1)*abs(p(k))
      third_bound = third_bound + k*(k - 1)*(k - 2)*abs(p(k))
    end do
    t = 2
    if (.not. any(abs(p) > 0)) return
    t = 0
    value = p(0)
    rate = p(1)
    curvature = 2*p(2)
    if (value > 0) then
      step = positive_step(value, rate, second_bound)
    else
      step = leading_step(p)
      if (step > 0) step = max(step, departure_step(rate, curvature, second_bound, third_bound))
    end if
    do
      if (step <= smallest) return
      if (value > 0) then
        limit = single_root_limit(value, rate, second_bound)
        if (t + limit <= 1) then
          call polish(p, t, t + limit)
          return
        end if
      end if
      if (t >= 1) exit
      t = min(t + step, 1.0_wp)
      call series_value(p, t, value, rate, curvature)
      step = 0
      if (value > 0) step = positive_step(value, rate, second_bound)
    end do
    t = 2
  end function first_zero

  !> A fraction up to which a series that is zero at 0 stays positive, as one of its terms before the first negative one
  !> outweighs all negative ones; 0 if there is none.
  pure real(wp) function leading_step(p) result(step)
    real(wp), intent(in) :: p(0:order)
    real(wp) :: against
    integer :: k
    step = 0
    against = sum(max(-p, 0.0_wp))
    do k = 0, order
      if (p(k) < 0) return
      if (p(k) > 0) step = max(step, min(1.0_wp, 0.99_wp*p(k)/max(against, tiny(against))))
    end do
  end function leading_step

  !> The one root between `t`, where the series is positive, and `last`.
  pure subroutine polish(p, t, last)
    real(wp), intent(in) :: p(0:order), last
    real(wp), intent(inout) :: t
    real(wp) :: low, high, next, step, value, rate, curvature
    integer :: i
    low = t
    high = last
    do i = 1, most_polish
      call series_value(p, t, value, rate, curvature)
      if (value > 0) then
        low = t
      else
        high = t
      end if
      next = t + taylor_root(value, rate, curvature)
      if (.not. (next >= low .and. next <= high)) next = 0.5_wp*(low + high)
      step = next - t
      t = next
      if (abs(step) <= epsilon(1.0_wp)*t .or. high - low <= 0) exit
    end do
  end subroutine polish

  !> Integral of the product of two series from 0 to a fraction, in units of the stretch.
  pure real(wp) function product_integral(p, q, fraction) result(total)
    real(wp), intent(in) :: p(0:order), q(0:order), fraction
    real(wp) :: coefficient
    integer :: i, k
    total = 0
    do k = 2*order, 0, -1
      coefficient = 0
      do i = max(0, k - order), min(k, order)
        coefficient = coefficient + p(i)*q(k - i)
      end do
      total = total*fraction + coefficient/(k + 1)
    end do
    total = total*fraction
  end function product_integral

end module linear_flow
