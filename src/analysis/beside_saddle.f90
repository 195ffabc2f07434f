! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Starts beside a saddle, on the two sides of its stable set: where they come to.
module beside_saddle
  use body_family, only: family_t
  use eigen, only: general_eigen
  use elementary, only: exponential, logarithm
  use errors, only: error_t
  use exponents, only: spectrum_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use machine_type, only: section_state_t
  use saddle_search, only: distance_to_saddle, find_saddle, saddle_t, section_distance
  use structure_exponents, only: exponents_from_section
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: set_beside, settle, arrives, verdict_of, is_chaotic

  !> Starts on a side.
  integer, parameter :: most_starts = 12
  !> Of natural sizes: distance of the starts from the saddle, at which a motion has come to an attractor, and of its return.
  real(wp), parameter :: first_step = 1e-3_wp, capture = 1e-4_wp, settled = 1e-9_wp
  !> Least multiplier above 1 of a saddle whose starts leave it in a reasonable time.
  real(wp), parameter, public :: least_growth = 1e-2_wp
  integer, parameter :: longest_period = 12
  !> Sections over which the exponent of a motion is taken.
  integer, parameter :: chaos_periods = 4096
  !> What the starts of a side do: none reaches the attractor of the other side, some, all, or it is not known.
  integer, parameter, public :: not_known = 0, none_reach = 1, some_reach = 2, all_reach = 3

  !> The starts beside the saddle at a value of the parameter.
  type, public :: beside_t
    type(neighbourhood_t) :: machines
    type(saddle_t) :: saddle
    real(wp), allocatable :: direction(:)
    real(wp) :: growth = 1
    !> Turns of the orbit in which a start leaves the saddle and settles.
    integer :: turns = 0
  end type beside_t

  !> Points of an attractor, period by period; none: not settled.
  type, public :: cycle_points_t
    real(wp), allocatable :: points(:, :)
  end type cycle_points_t

contains

  !> The saddle near `guess` at a value of the parameter, and its unstable direction on the side of `along`.
  subroutine set_beside(family, value, guess, periods, along, beside, ok)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value, guess(:), along(:)
    integer, intent(in) :: periods
    type(beside_t), intent(out) :: beside
    logical, intent(out) :: ok
    type(error_t), allocatable :: error
    complex(wp), dimension(size(guess), size(guess)) :: vectors
    complex(wp) :: values(size(guess)), vector(size(guess))
    call machine_neighbourhood(family, value, beside%machines, error)
    ok = .not. allocated(error)
    if (.not. ok) return
    call find_saddle(beside%machines, guess, periods, beside%saddle, ok)
    if (ok) ok = distance_to_saddle(beside%machines%centre, beside%saddle, guess) < 0.1_wp
    if (ok) ok = real(beside%saddle%multipliers(1)) > 1 + least_growth
    if (ok) call general_eigen(beside%saddle%matrix, values, vectors, ok)
    if (.not. ok) return
    beside%growth = real(beside%saddle%multipliers(1), wp)
    associate (sizes => beside%machines%centre%size_of)
      vector = vectors(:, maxloc(real(values), 1))/sizes
      ! A real vector times a number that is not.
      vector = vector/vector(maxloc(abs(vector), 1))
      beside%direction = sizes*real(vector, wp)/norm2(real(vector, wp))
      if (sum(beside%direction*along/sizes**2) < 0) beside%direction = -beside%direction
    end associate
    beside%turns = 100 + int(-2*logarithm(first_step)/logarithm(beside%growth))
  end subroutine set_beside

  !> A start of a side.
  pure function start_beside(beside, side, offset) result(y)
    type(beside_t), intent(in) :: beside
    integer, intent(in) :: side
    real(wp), intent(in) :: offset
    real(wp) :: y(size(beside%direction))
    y = beside%saddle%points(:, 1) + merge(1, -1, side == 1)*first_step*exponential(offset*logarithm(beside%growth))* &
      beside%direction
  end function start_beside

  !> The periodic attractor that a start of a side settles on; no points: none.
  pure subroutine settle(beside, side, settles)
    type(beside_t), intent(in) :: beside
    integer, intent(in) :: side
    type(cycle_points_t), intent(out) :: settles
    type(section_state_t) :: walk
    real(wp) :: y(size(beside%direction)), points(size(y), 0:2*longest_period)
    integer :: k, n
    logical :: ok
    allocate (settles%points(size(y), 0))
    call beside%machines%centre%begin(start_beside(beside, side, 0.37_wp), walk, ok)
    if (.not. ok) return
    do k = 1, beside%turns*beside%saddle%periods + 2*longest_period
      call beside%machines%centre%go_on(walk, y, ok)
      if (.not. ok) return
      n = k - beside%turns*beside%saddle%periods
      if (n >= 0) points(:, n) = y
    end do
    do n = 1, longest_period
      if (section_distance(beside%machines%centre, points(:, n), points(:, 0)) > settled) cycle
      if (section_distance(beside%machines%centre, points(:, 2*n), points(:, n)) > settled) cycle
      if (distance_to_saddle(beside%machines%centre, beside%saddle, points(:, 0)) < 10*first_step) return
      settles%points = points(:, 1:n)
      return
    end do
  end subroutine settle

  !> Whether a start of a side comes to an attractor within `turns` of the orbit.
  pure logical function arrives(beside, side, settles, offset, turns)
    type(beside_t), intent(in) :: beside
    integer, intent(in) :: side, turns
    type(cycle_points_t), intent(in) :: settles
    real(wp), intent(in) :: offset
    type(section_state_t) :: walk
    real(wp) :: y(size(beside%direction))
    integer :: j, k
    logical :: ok
    arrives = .false.
    call beside%machines%centre%begin(start_beside(beside, side, offset), walk, ok)
    if (.not. ok) return
    do k = 1, turns*beside%saddle%periods
      call beside%machines%centre%go_on(walk, y, ok)
      if (.not. ok) return
      do j = 1, size(settles%points, 2)
        arrives = section_distance(beside%machines%centre, y, settles%points(:, j)) < capture
        if (arrives) return
      end do
    end do
  end function arrives

  !> How many of some starts of a side, evenly spread, come to an attractor within `turns` of the orbit.
  pure integer function verdict_of(beside, side, settles, turns) result(verdict)
    type(beside_t), intent(in) :: beside
    integer, intent(in) :: side, turns
    type(cycle_points_t), intent(in) :: settles
    logical :: there(most_starts)
    integer :: i
    there = [(arrives(beside, side, settles, (i - 0.5_wp)/most_starts, turns), i=1, most_starts)]
    verdict = some_reach
    if (.not. any(there)) verdict = none_reach
    if (all(there)) verdict = all_reach
  end function verdict_of

  !> Whether a start of a side comes to a motion with a positive exponent, at three standard errors. What only settles slowly, or on
  !> a long period, has none.
  logical function is_chaotic(beside, side)
    type(beside_t), intent(in) :: beside
    integer, intent(in) :: side
    type(spectrum_t) :: spectrum
    real(wp) :: series(1)
    call exponents_from_section(beside%machines, start_beside(beside, side, 0.37_wp), beside%turns*beside%saddle%periods, &
                                chaos_periods, spectrum, series)
    is_chaotic = spectrum%known
    if (is_chaotic) is_chaotic = spectrum%exponents(1) > 3*spectrum%errors(1)
  end function is_chaotic

end module beside_saddle
