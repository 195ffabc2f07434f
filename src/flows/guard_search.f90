! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The first zero of guards along a path, proven: nothing lies before it. Over panels the quintic through value, slope and
!> curvature at both ends, in Bernstein's form, and a bound on the sixth derivative show that a guard stays positive; where they do
!> not, steps certified by the third derivative lead to its zero from the left.
module guard_search
  use elementary, only: exponential, logarithm
  use guard_functions, only: bases_at, bound, derivatives, search_t
  use guard_zero, only: approach, stays_positive, walk
  use guards, only: joint_guard_t, meets_lower, meets_upper
  use kinds, only: wp
  implicit none
  private

  public :: find_first

  !> Rounding of sums, as a share of the sum of absolute values.
  real(wp), parameter :: rounding = 64*epsilon(1.0_wp)
  integer, parameter :: most_turning_steps = 20
  !> After so many panels their length is looked at again: what was fast may have died away.
  integer, parameter :: panels_between = 8
  !> Where misses are noted a panel is no longer than so many radians of the fastest part: a rate turns once within.
  real(wp), parameter, public :: most_radians = 2.5_wp
  !> An exponential of minus this is nothing.
  real(wp), parameter :: gone = 40

contains

  !> The first that is triggered within `duration` [s]: `time` is that of the first, `triggered` all guards that are triggered with
  !> it to within rounding; time = duration and none triggered if there is none. `extremes` are those of the watched coordinate on
  !> the way, `top_speed` the largest of its speeds if `needs_speed`; `margin` the smallest gap at which a stop was missed [m] if
  !> `needs_margin`.
  pure subroutine find_first(search, list, origin, duration, needs_speed, needs_margin, time, triggered, extremes, top_speed, &
                             margin, evaluations)
    type(search_t), intent(inout) :: search
    type(joint_guard_t), intent(in) :: list(:)
    real(wp), intent(in) :: origin, duration
    logical, intent(in) :: needs_speed, needs_margin
    real(wp), intent(out) :: time
    logical, intent(out) :: triggered(:)
    real(wp), intent(inout) :: extremes(2), top_speed, margin
    integer, intent(out) :: evaluations
    complex(wp) :: growth(search%terms), turning(size(search%turn, 1))
    real(wp), dimension(0:3, search%functions) :: here, there
    real(wp), dimension(search%guards) :: certified, root
    real(wp) :: a, b, length, longest, tie
    integer :: g, panels
    evaluations = 1
    triggered = .false.
    a = 0
    call bases_at(search, a, growth, turning)
    do g = 1, search%functions
      here(:, g) = derivatives(search, g, a, growth, turning)
    end do
    length = panel_length(search, 0.0_wp, duration)
    longest = huge(longest)
    if (needs_margin) longest = longest_panel(search, 0.0_wp)
    length = min(length, longest)
    panels = 0
    tie = 8*spacing(max(origin, origin + duration))
    time = duration
    call look_at_start(search, list, here, length, certified, triggered)
    if (any(triggered)) time = 0
    call note_extremes(search, here(:, search%functions), extremes, top_speed)
    if (any(triggered)) return
    do while (a < time)
      b = min(a + length, time)
      if (time - b < 1e-6_wp*length) b = time
      call bases_at(search, b, growth, turning)
      evaluations = evaluations + 1
      do g = 1, search%functions
        there(:, g) = derivatives(search, g, b, growth, turning)
      end do
      call search_panel(search, a, b, here, there, tie, certified, time, root, evaluations)
      if (any(root(:search%guards) <= time)) then
        triggered(:search%guards) = root(:search%guards) <= time + tie
        call watch(search, a, time, here(:, search%functions), there(:, search%functions), time < b, needs_speed, extremes, &
                   top_speed, evaluations)
        if (needs_margin) call note_misses(search, list, a, time, here, triggered, margin, evaluations)
        return
      end if
      call watch(search, a, b, here(:, search%functions), there(:, search%functions), .false., needs_speed, extremes, &
                 top_speed, evaluations)
      if (needs_margin) call note_misses(search, list, a, b, here, triggered, margin, evaluations)
      a = b
      here = there
      panels = panels + 1
      if (mod(panels, panels_between) == 0 .and. time > a) then
        b = panel_length(search, a, time - a)
        if (needs_margin) longest = longest_panel(search, a)
        if (b > 2*length) length = min(b, longest)
      end if
    end do
  end subroutine find_first

  !> Length of a panel from the time `t` on where misses are noted [s]; what has died away turns no rate.
  pure real(wp) function longest_panel(search, t) result(length)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: t
    real(wp) :: fastest
    integer :: k
    fastest = max(size(search%turn, 1)*search%frequency, tiny(fastest))
    do k = 1, search%terms
      if (-search%decay(k)*t < gone) fastest = max(fastest, search%size_of_exponent(k))
    end do
    length = most_radians/fastest
  end function longest_panel

  !> The zeros of the guards, each its `root` [s], on the panel from `a` to `b` [s], where the values are `here` and `there`;
  !> huge where there is none before `time`, which becomes that of the first. Zeros within `tie` of it are found too.
  pure subroutine search_panel(search, a, b, here, there, tie, certified, time, root, evaluations)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: a, b, here(0:, :), there(0:, :), tie, certified(:)
    real(wp), intent(inout) :: time
    real(wp), intent(out) :: root(:)
    integer, intent(inout) :: evaluations
    integer :: g
    root = huge(1.0_wp)
    do g = 1, search%guards
      if (certified(g) >= b) cycle
      if (certified(g) <= a) then
        if (stays_positive(search, g, a, b, here(:, g), there(:, g))) cycle
      end if
      if (search%lift(g) > 0) then
        call walk(search, g, a, min(b, time + tie), root(g), evaluations)
      else
        call approach(search, g, max(a, certified(g)), min(b, time + tie), root(g), evaluations)
      end if
      if (root(g) < time) time = root(g)
    end do
  end subroutine search_panel

  !> Guards that are zero at the start, where the values are `here`: those that are triggered at once, and how long within `length`
  !> [s] the others are `certified` not to be. One that is nothing but rounding is triggered when it is below that.
  pure subroutine look_at_start(search, list, here, length, certified, triggered)
    type(search_t), intent(inout) :: search
    type(joint_guard_t), intent(in) :: list(:)
    real(wp), intent(inout) :: here(0:, :)
    real(wp), intent(in) :: length
    real(wp), intent(out) :: certified(:)
    logical, intent(inout) :: triggered(:)
    real(wp) :: none, sizes(0:3)
    logical :: idle
    integer :: g, order
    certified = 0
    do g = 1, search%guards
      sizes(0) = bound(search, g, 0, 0.0_wp, 0.0_wp) + search%blur(0, g)
      none = rounding*sizes(0)
      if (.not. (list(g)%from_zero .or. here(0, g) <= none)) cycle
      sizes(1:) = [(bound(search, g, order, 0.0_wp, length) + search%blur(order, g), order=1, 3)]
      call departure(here(1:3, g), sizes, bound(search, g, 4, 0.0_wp, length), length, certified(g), idle)
      triggered(g) = .not. idle .and. certified(g) <= 0
      if (.not. idle) cycle
      search%lift(g) = none - min(here(0, g), 0.0_wp) + tiny(none)
      search%power(0, g) = search%power(0, g) + search%lift(g)
      here(0, g) = here(0, g) + search%lift(g)
    end do
  end subroutine look_at_start

  pure subroutine note_extremes(search, now, extremes, top_speed)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: now(0:3)
    real(wp), intent(inout) :: extremes(2), top_speed
    if (search%functions == 0) return
    extremes = [min(extremes(1), now(0)), max(extremes(2), now(0))]
    top_speed = max(top_speed, now(1))
  end subroutine note_extremes

  !> Extremes of the watched coordinate between `a` and `b`, with its derivatives there.
  pure subroutine watch(search, a, b, here, there, stale, needs_speed, extremes, top_speed, evaluations)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: a, b, here(0:3), there(0:3)
    logical, intent(in) :: stale, needs_speed
    real(wp), intent(inout) :: extremes(2), top_speed
    integer, intent(inout) :: evaluations
    complex(wp) :: growth(search%terms), turning(size(search%turn, 1))
    real(wp) :: last(0:3), d(0:3), at
    last = there
    if (stale) then
      call bases_at(search, b, growth, turning)
      evaluations = evaluations + 1
      last = derivatives(search, search%functions, b, growth, turning)
    end if
    call note_extremes(search, last, extremes, top_speed)
    if (here(1)*last(1) < 0) then
      call turning_point(search, search%functions, 1, a, b, here, last, extremes(2) - extremes(1), at, d)
      call note_extremes(search, d, extremes, top_speed)
    end if
    if (needs_speed .and. here(2) > 0 .and. last(2) < 0) then
      call turning_point(search, search%functions, 2, a, b, here, last, 0.0_wp, at, d)
      call note_extremes(search, d, extremes, top_speed)
    end if
  end subroutine watch

  !> Where derivative number `order` of function `g` is zero between `a` and `b`, from those there, and all of them: Newton's steps
  !> in a bracket. The value is good to a share of itself and of `range`.
  pure subroutine turning_point(search, g, order, a, b, here, last, range, t, found)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g, order
    real(wp), intent(in) :: a, b, here(0:3), last(0:3), range
    real(wp), intent(out) :: t, found(0:3)
    real(wp) :: low, high, next
    complex(wp) :: now(search%terms), turn(size(search%turn, 1))
    integer :: i
    low = a
    high = b
    t = a + (b - a)*min(0.95_wp, max(0.05_wp, here(order)/(here(order) - last(order))))
    do i = 1, most_turning_steps
      call bases_at(search, t, now, turn)
      found = derivatives(search, g, t, now, turn)
      if (order == 1 .and. abs(found(1))*(high - low) <= 1e-10_wp*(range + abs(found(0)))) return
      if (found(order)*here(order) > 0) low = t
      if (.not. found(order)*here(order) > 0) high = t
      next = t - found(order)/found(order + 1)
      if (.not. (next > low .and. next < high)) next = low + (high - low)/2
      if (abs(next - t) <= 1e-12_wp*(b - a)) return
      t = next
    end do
  end subroutine turning_point

  !> Gaps that stop closing between `a`, with the derivatives `here`, and `b`, where some are `triggered`. The rate of a gap has
  !> one extreme on a panel at most: where it has, either side is looked at.
  pure subroutine note_misses(search, list, a, b, here, triggered, margin, evaluations)
    type(search_t), intent(in) :: search
    type(joint_guard_t), intent(in) :: list(:)
    real(wp), intent(in) :: a, b, here(0:, :)
    logical, intent(in) :: triggered(:)
    real(wp), intent(inout) :: margin
    integer, intent(inout) :: evaluations
    complex(wp) :: growth(search%terms), turning(size(search%turn, 1))
    real(wp) :: last(0:3), middle(0:3), between
    logical :: bends
    integer :: g
    do g = 1, search%guards
      if (.not. any(list(g)%meaning == [meets_upper, meets_lower])) cycle
      call bases_at(search, b, growth, turning)
      evaluations = evaluations + 1
      last = derivatives(search, g, b, growth, turning)
      bends = here(2, g)*last(2) < 0
      between = a
      middle = here(:, g)
      if (bends) call turning_point(search, g, 2, a, b, here(:, g), last, 0.0_wp, between, middle)
      if (bends) call note_miss(search, g, a, between, here(:, g), middle, margin)
      if (.not. triggered(g)) call note_miss(search, g, between, b, middle, last, margin)
    end do
  end subroutine note_misses

  !> Gap `g`, if it stops closing between `a` and `b`, with its derivatives there. A rate of nothing but rounding is none: what
  !> friction holds the contact between moves as one.
  pure subroutine note_miss(search, g, a, b, here, last, margin)
    type(search_t), intent(in) :: search
    integer, intent(in) :: g
    real(wp), intent(in) :: a, b, here(0:), last(0:)
    real(wp), intent(inout) :: margin
    real(wp) :: least(0:3), at, none
    none = rounding*(bound(search, g, 1, a, b - a) + search%blur(1, g))
    if (.not. here(1) < -none .or. last(1) < -none) return
    least = last
    if (last(1) > 0) call turning_point(search, g, 1, a, b, here, last, 0.0_wp, at, least)
    margin = min(margin, max(least(0), 0.0_wp))
  end subroutine note_miss

  !> Length of the panels from the time `t` on: the quintic is to be good to about a thousandth of each guard's size.
  pure real(wp) function panel_length(search, t, duration) result(length)
    type(search_t), intent(in) :: search
    real(wp), intent(in) :: t, duration
    real(wp) :: size_now, sixth
    integer :: g
    length = duration
    do g = 1, search%functions
      sixth = bound(search, g, 6, t, 0.0_wp)
      size_now = bound(search, g, 0, t, 0.0_wp)
      if (.not. sixth*length**6 > 46*size_now) cycle
      length = min(length, exponential(logarithm(46*size_now/sixth)/6))
    end do
    length = max(length, 1e-6_wp*duration, tiny(length))
    if (length < duration) length = duration/ceiling(duration/length)
  end function panel_length

  !> A time up to which a function that is zero at 0 stays positive, from its first three derivatives and a bound on the
  !> fourth, `longest` at most; `sizes` bound the value and the derivatives for their rounding. 0 if it falls at once; `idle` if
  !> nothing but rounding is there, or what departs is no more by then and does not come back before.
  pure subroutine departure(d, sizes, fourth, longest, certified, idle)
    real(wp), intent(in) :: d(3), sizes(0:3), fourth, longest
    real(wp), intent(out) :: certified
    logical, intent(out) :: idle
    real(wp), parameter :: factorial(4) = [1.0_wp, 2.0_wp, 6.0_wp, 24.0_wp]
    real(wp) :: against
    integer :: first, i
    certified = 0
    idle = .false.
    do first = 1, 3
      if (abs(d(first)) > rounding*sizes(first)) exit
    end do
    if (first > 3) then
      idle = .true.
      return
    end if
    if (d(first) < 0) return
    certified = longest
    do i = first + 1, 4
      against = fourth
      if (i < 4) against = max(-d(min(i, 3)), 0.0_wp)
      if (.not. against > 0) cycle
      ! A share of the first term for each of the others.
      associate (ratio => 0.3_wp*d(first)/factorial(first)*factorial(i)/against)
        select case (i - first)
        case (1)
          certified = min(certified, ratio)
        case (2)
          certified = min(certified, sqrt(ratio))
        case default
          certified = min(certified, exponential(logarithm(max(ratio, tiny(ratio)))/3))
        end select
      end associate
    end do
    if (d(first)*certified**first/factorial(first) > rounding*sizes(0)) return
    if (first == 1 .and. d(2) < -rounding*sizes(2)) then
      associate (back => -2*d(1)/d(2))
        if (abs(d(3))*back**2/6 + fourth*back**3/24 <= 0.5_wp*d(1)) return
      end associate
    end if
    certified = 0
    idle = .true.
  end subroutine departure

end module guard_search
