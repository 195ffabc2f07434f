! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Saddle orbits of one body: Newton's method on the stroboscopic map with its exact derivative, from points of the section.
module saddle_search
  use body_family, only: map_with_variation
  use circle, only: point_near
  use event_words, only: canonical_word
  use kinds, only: int64, wp
  use matrices, only: eigenvalues, solve
  use motion_state, only: tally_t
  use one_body, only: one_body_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: find_saddle, add_saddle, seek_saddles, section_distance, distance_to_saddle

  integer, parameter :: most_newton = 30
  !> Of natural sizes: Newton's method is not to go further at once, has converged, and two orbits are one.
  real(wp), parameter :: longest_step = 0.3_wp, converged = 1e-12_wp, same_orbit = 1e-7_wp
  !> A multiplier nearer to the unit circle than this does not tell a saddle.
  real(wp), parameter :: neutral = 1e-6_wp

  !> A periodic orbit with one multiplier outside and one inside of the unit circle.
  type, public :: saddle_t
    integer :: periods = 0
    !> Points on the section at crank angle 0 (columns x [m], v [m/s]), period by period.
    real(wp), allocatable :: points(:, :)
    !> Over the period of the orbit, the larger first, and the derivative of the map that they belong to, at the first point.
    real(wp) :: multipliers(2) = 0, matrix(2, 2) = 0
    integer(int64) :: word = 0
  end type saddle_t

contains

  !> Distance of two section points in natural sizes; an angle is on a circle.
  pure real(wp) function section_distance(body, one, other) result(distance)
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: one(2), other(2)
    distance = norm2((point_near(one, other, body%moving%machine%turn) - other)/body%size_of)
  end function section_distance

  !> Distance of a section point to the nearest of an orbit.
  pure real(wp) function distance_to_saddle(body, saddle, point) result(distance)
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddle
    real(wp), intent(in) :: point(2)
    integer :: k
    distance = huge(distance)
    do k = 1, saddle%periods
      distance = min(distance, section_distance(body, point, saddle%points(:, k)))
    end do
  end function distance_to_saddle

  !> The saddle that Newton's method comes to from `start` over `periods` drive periods; `ok` is false if it comes to none of this
  !> period.
  pure subroutine find_saddle(machines, body, start, periods, saddle, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: start(2)
    integer, intent(in) :: periods
    type(saddle_t), intent(out) :: saddle
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp) :: point(2), image(2), slopes(2, 2), step(2), length, before
    integer :: i, k
    point = start
    length = huge(length)
    do i = 1, most_newton
      call map_with_variation(machines, point, periods, image, slopes, tally, ok)
      if (.not. ok) return
      do k = 1, 2
        slopes(k, k) = slopes(k, k) - 1
      end do
      image = point_near(image, point, body%moving%machine%turn)
      call solve(slopes, point - image, step, ok)
      if (.not. ok) return
      before = length
      length = norm2(step/body%size_of)
      if (.not. length < huge(length)) then
        ok = .false.
        return
      end if
      if (length > longest_step) step = step*(longest_step/length)
      point = point + step
      point(1) = max(min(point(1), body%moving%machine%contact%upper), body%moving%machine%contact%lower)
      if (length < converged*1e-2_wp .or. (length < converged*1e2_wp .and. length >= 0.1_wp*before)) exit
    end do
    ok = length < converged*1e2_wp
    if (ok) call describe(machines, body, point_near(point, [0.0_wp, 0.0_wp], body%moving%machine%turn), periods, saddle, ok)
  end subroutine find_saddle

  !> Points, multipliers and word of the orbit through a fixed point; not `ok` if it is no saddle, or of a shorter period.
  pure subroutine describe(machines, body, point, periods, saddle, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: point(2)
    integer, intent(in) :: periods
    type(saddle_t), intent(inout) :: saddle
    logical, intent(out) :: ok
    type(tally_t) :: tally
    complex(wp) :: values(2)
    integer(int64) :: words(periods)
    real(wp) :: image(2), slopes(2, 2)
    integer :: k
    allocate (saddle%points(2, periods))
    saddle%periods = periods
    call map_with_variation(machines, point, periods, image, saddle%matrix, tally, ok)
    if (.not. ok) return
    values = eigenvalues(saddle%matrix)
    saddle%multipliers = real(values, wp)
    if (abs(saddle%multipliers(1)) < abs(saddle%multipliers(2))) saddle%multipliers = saddle%multipliers([2, 1])
    ok = all(abs(aimag(values)) <= 0) .and. abs(saddle%multipliers(1)) > 1 + neutral .and. &
         abs(saddle%multipliers(2)) < 1 - neutral
    if (.not. ok) return
    saddle%points(:, 1) = point
    do k = 1, periods
      call map_with_variation(machines, saddle%points(:, k), 1, image, slopes, tally, ok)
      if (.not. ok) return
      words(k) = tally%word
      if (k < periods) saddle%points(:, k + 1) = point_near(image, [0.0_wp, 0.0_wp], body%moving%machine%turn)
      if (k == periods) exit
      ok = section_distance(body, image, point) > same_orbit
      if (.not. ok) return
    end do
    saddle%word = canonical_word(words)
  end subroutine describe

  !> Adds an orbit unless it is among `saddles`; `number` is its place there.
  pure subroutine add_saddle(body, saddle, saddles, number)
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddle
    type(saddle_t), allocatable, intent(inout) :: saddles(:)
    integer, intent(out) :: number
    do number = 1, size(saddles)
      if (saddles(number)%periods /= saddle%periods) cycle
      if (distance_to_saddle(body, saddles(number), saddle%points(:, 1)) < same_orbit) return
    end do
    saddles = [saddles, saddle]
  end subroutine add_saddle

  !> Adds the saddles of up to `longest` drive periods that Newton's method comes to from `starts` (columns x, v).
  pure subroutine seek_saddles(machines, body, starts, longest, saddles)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: longest
    type(saddle_t), allocatable, intent(inout) :: saddles(:)
    type(saddle_t) :: saddle
    integer :: i, n, number
    logical :: ok
    do i = 1, size(starts, 2)
      do n = 1, longest
        call find_saddle(machines, body, starts(:, i), n, saddle, ok)
        if (ok) call add_saddle(body, saddle, saddles, number)
      end do
    end do
  end subroutine seek_saddles

end module saddle_search
