! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Saddle orbits of a machine: Newton's method on the map from section to section with its exact derivative, from points of the
!> section.
module saddle_search
  use event_words, only: canonical_word
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: int64, wp
  use matrices, only: solve
  use motion_state, only: tally_t
  use multipliers, only: multipliers_of
  use periodic_orbit, only: same_orbit
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: find_saddle, saddle_at, add_saddle, section_distance, distance_to_saddle, sides_of_saddle

  integer, parameter :: most_newton = 30
  !> Of natural sizes: Newton's method is not to go further at once, has converged.
  real(wp), parameter :: longest_step = 0.3_wp, converged = 1e-12_wp
  !> A multiplier nearer to the unit circle than this does not identify a saddle.
  real(wp), parameter :: neutral = 1e-6_wp
  !> Rate of change in natural sizes below which nothing moves.
  real(wp), parameter :: all_but_at_rest = 1e-5_wp

  !> A periodic orbit with one multiplier outside of the unit circle and the others inside: its stable set can be a boundary.
  type, public :: saddle_t
    !> Drive periods, or without a clock returns to the section.
    integer :: periods = 0
    !> Points on the section (columns), period by period: of one body x [m], v [m/s] at crank angle 0.
    real(wp), allocatable :: points(:, :)
    !> Of each of them the position [m] and the speed [m/s] of what is watched.
    real(wp), allocatable :: watched(:, :)
    !> Over the period of the orbit, the largest modulus first, and the derivative of the map they belong to, at the first point.
    complex(wp), allocatable :: multipliers(:)
    real(wp), allocatable :: matrix(:, :)
    !> Left eigenvectors of the multiplier outside of the unit circle (columns), one at each point. Their product with the
    !> displacement of a state from the orbit has the sign of the side of the stable set it is on; its size is how far from that
    !> set, in natural sizes, the state will be when it next passes the first point, or is there.
    real(wp), allocatable :: unstable(:, :)
    integer(int64) :: word = 0
  end type saddle_t

contains

  !> Distance of two section points in natural sizes; an angle is on a circle.
  pure real(wp) function section_distance(machine, one, other) result(distance)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: one(:), other(:)
    distance = norm2((machine%nearest_copy(one, other) - other)/machine%size_of)
  end function section_distance

  !> Distance of a section point to the nearest of an orbit.
  pure real(wp) function distance_to_saddle(machine, saddle, point) result(distance)
    class(hybrid_t), intent(in) :: machine
    type(saddle_t), intent(in) :: saddle
    real(wp), intent(in) :: point(:)
    integer :: k
    distance = huge(distance)
    do k = 1, saddle%periods
      distance = min(distance, section_distance(machine, point, saddle%points(:, k)))
    end do
  end function distance_to_saddle

  !> Of two section points (columns), about the point of the orbit that is nearest to their middle: the larger of their distances
  !> to it, in natural sizes, and of each the product with `saddle%unstable` there, negative on one side of the stable set.
  pure subroutine sides_of_saddle(machine, saddle, points, distance, sides)
    class(hybrid_t), intent(in) :: machine
    type(saddle_t), intent(in) :: saddle
    real(wp), intent(in) :: points(:, :)
    real(wp), intent(out) :: distance, sides(2)
    real(wp) :: away(size(points, 1), 2), nearest
    integer :: k, i
    distance = huge(distance)
    nearest = huge(nearest)
    sides = 0
    do k = 1, saddle%periods
      do i = 1, 2
        away(:, i) = machine%nearest_copy(points(:, i), saddle%points(:, k)) - saddle%points(:, k)
      end do
      associate (middle => norm2((away(:, 1) + away(:, 2))/machine%size_of))
        if (middle >= nearest) cycle
        nearest = middle
      end associate
      distance = max(norm2(away(:, 1)/machine%size_of), norm2(away(:, 2)/machine%size_of))
      sides = matmul(saddle%unstable(:, k), away)
    end do
  end subroutine sides_of_saddle

  !> The saddle that Newton's method comes to from `start` over `periods` sections; `ok` is false if it comes to none of this
  !> period.
  pure subroutine find_saddle(machines, start, periods, saddle, ok)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: start(:)
    integer, intent(in) :: periods
    type(saddle_t), intent(out) :: saddle
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp), dimension(size(start)) :: point, image, step
    real(wp) :: slopes(size(start), size(start)), length, before
    integer :: i, k
    point = start
    length = huge(length)
    do i = 1, most_newton
      call machines%centre%map(machines, point, periods, image, slopes, tally, ok)
      if (.not. ok) return
      do k = 1, size(start)
        slopes(k, k) = slopes(k, k) - 1
      end do
      image = machines%centre%nearest_copy(image, point)
      call solve(slopes, point - image, step, ok)
      if (.not. ok) return
      before = length
      length = norm2(step/machines%centre%size_of)
      if (.not. length < huge(length)) then
        ok = .false.
        return
      end if
      if (length > longest_step) step = step*(longest_step/length)
      point = machines%centre%within_stops(point + step)
      if (length < converged*1e-2_wp .or. (length < converged*1e2_wp .and. length >= 0.1_wp*before)) exit
    end do
    ok = length < converged*1e2_wp
    if (ok) call saddle_at(machines, machines%centre%nearest_copy(point, 0*point), periods, saddle, ok)
  end subroutine find_saddle

  !> Points, multipliers and word of the orbit through a fixed point; not `ok` if it is no saddle, or of a shorter period.
  pure subroutine saddle_at(machines, point, periods, saddle, ok)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: periods
    type(saddle_t), intent(out) :: saddle
    logical, intent(out) :: ok
    type(tally_t) :: tally
    integer(int64) :: words(periods)
    real(wp) :: image(size(point)), slopes(size(point), size(point), periods)
    integer :: k, n
    n = size(point)
    allocate (saddle%points(n, periods), saddle%matrix(n, n), saddle%unstable(n, periods))
    saddle%periods = periods
    call machines%centre%map(machines, point, periods, image, saddle%matrix, tally, ok)
    if (.not. ok) return
    saddle%multipliers = multipliers_of(saddle%matrix)
    associate (values => saddle%multipliers)
      ok = abs(aimag(values(1))) <= 0 .and. abs(values(1)) > 1 + neutral .and. all(abs(values(2:)) < 1 - neutral)
    end associate
    if (ok .and. .not. machines%centre%has_clock) ok = moves(machines%centre, point)
    if (.not. ok) return
    saddle%points(:, 1) = point
    do k = 1, periods
      call machines%centre%map(machines, saddle%points(:, k), 1, image, slopes(:, :, k), tally, ok)
      if (.not. ok) return
      words(k) = tally%word
      if (k == periods) exit
      saddle%points(:, k + 1) = machines%centre%nearest_copy(image, 0*image)
      ok = section_distance(machines%centre, image, point) > same_orbit
      if (.not. ok) return
    end do
    saddle%unstable(:, 1) = left_eigenvector(saddle%matrix, machines%centre%size_of)
    do k = periods, 2, -1
      saddle%unstable(:, k) = matmul(saddle%unstable(:, 1 + modulo(k, periods)), slopes(:, :, k))
    end do
    saddle%word = canonical_word(words)
    saddle%watched = matmul(machines%centre%watched, saddle%points)
  end subroutine saddle_at

  !> Left eigenvector of the one multiplier outside of the unit circle, by a high power of the matrix, all rows of which are along
  !> it. Its length is such that the product with a displacement is the distance from the stable set in units of `sizes`.
  pure function left_eigenvector(matrix, sizes) result(vector)
    real(wp), intent(in) :: matrix(:, :), sizes(:)
    real(wp) :: vector(size(sizes)), power(size(sizes), size(sizes))
    integer :: i
    !> The others have sizes below 1 - `neutral`: their share is gone after 2**40 factors.
    integer, parameter :: squarings = 40
    power = matrix
    do i = 1, squarings
      power = power/maxval(abs(power))
      power = matmul(power, power)
    end do
    vector = power(maxloc([(norm2(power(i, :)*sizes), i=1, size(sizes))], 1), :)
    vector = vector/norm2(vector*sizes)
  end function left_eigenvector

  !> Whether a machine without a clock moves from a section point: an equilibrium is met as a cycle of no extent.
  pure logical function moves(machine, point)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:)
    type(event_t), allocatable :: events(:)
    type(tally_t) :: tally
    real(wp) :: image(size(point))
    integer :: mode
    call machine%fly_sections(point, 1, .true., image, events, mode, tally, moves)
    if (moves) moves = norm2(machine%slope(mode, 0.0_wp, point)/machine%size_of)*machine%size_of_time() > all_but_at_rest
  end function moves

  !> Adds an orbit unless it is among `saddles`; `number` is its index there.
  pure subroutine add_saddle(machine, saddle, saddles, number)
    class(hybrid_t), intent(in) :: machine
    type(saddle_t), intent(in) :: saddle
    type(saddle_t), allocatable, intent(inout) :: saddles(:)
    integer, intent(out) :: number
    do number = 1, size(saddles)
      if (saddles(number)%periods /= saddle%periods) cycle
      if (distance_to_saddle(machine, saddles(number), saddle%points(:, 1)) < same_orbit) return
    end do
    saddles = [saddles, saddle]
  end subroutine add_saddle

end module saddle_search
