! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How a motion changes with its start and with a parameter: derivatives of the flights, multiplied by a saltation at every
!> event. With the guard g, the jump R and the slopes f before and after an event, dt = -(g_y dy + g_p)/(g_y f + g_t) is
!> how much later it comes, and behind it dy+ = R_y (dy + f dt) + R_t dt + R_p - f+ dt (Aizerman and Gantmakher 1958; di
!> Bernardo et al., Piecewise-smooth Dynamical Systems, 2008, section 2.5).
module variations
  use hybrid_machine, only: event_t, hybrid_t, neighbourhood_t
  use kinds, only: wp
  use matrices, only: determinant_of
  use motion_state, only: event_stick
  implicit none
  private

  public :: neighbourhood_t, vary, vary_beside_graze, join_parts, by_difference, period_slope, stencil_offset

  !> Where the machines next to one are, in steps of the parameter, and what their results weigh in the derivative, times the
  !> step: central, or one-sided where the parameter can go no further. Of fourth order.
  real(wp), parameter :: offset_of(4, -1:1) = reshape([-1.0_wp, -2.0_wp, -3.0_wp, -4.0_wp, -2.0_wp, -1.0_wp, 1.0_wp, 2.0_wp, &
    1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp], [4, 3])
  real(wp), parameter :: weight_of(4, -1:1) = reshape([-48.0_wp, 36.0_wp, -16.0_wp, 3.0_wp, 1.0_wp, -8.0_wp, 8.0_wp, -1.0_wp, &
    48.0_wp, -36.0_wp, 16.0_wp, -3.0_wp], [4, 3])/12
  real(wp), parameter :: own_weight(-1:1) = [25.0_wp, 0.0_wp, -25.0_wp]/12

  !> Rates of a state that differ by no more, in natural sizes, do so by rounding.
  real(wp), parameter :: nothing = 1e-11_wp

  !> Derivative of a map one of whose events is met all but tangentially, at the `rate` of its guard: base - column row/rate.
  type, public :: split_t
    real(wp), allocatable :: base(:, :), column(:), row(:)
    real(wp) :: rate = 0
    !> How much larger than the base the terms are of which it is the difference.
    real(wp) :: lost = 1
  end type split_t

contains

  !> Offset of the neighbour `i` in steps.
  pure real(wp) function stencil_offset(side, i)
    integer, intent(in) :: side, i
    stencil_offset = offset_of(i, side)
  end function stencil_offset

  !> The derivative by the parameter of what is `own` of the machine and `near` of its neighbours (columns).
  pure function by_difference(machines, own, near) result(slope)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: own(:), near(:, :)
    real(wp) :: slope(size(own))
    slope = (own_weight(machines%side)*own + matmul(near, weight_of(:, machines%side)))/machines%step
  end function by_difference

  !> Derivatives of the state at `t_end` [s] of the motion that starts at the section, or at `t_start`, in `mode` with `y` and
  !> has `events`: by the start in `by_start`, by the parameter in `by_parameter`. `ok` is false if the flights do not lead from
  !> event to event within `tolerance` (in each coordinate), or where an event is met tangentially. `determinant`: of `by_start`,
  !> as the product over the flights and events, which keeps its digits where `by_start` has large entries.
  pure subroutine vary(machines, mode, y, events, t_end, tolerance, by_start, ok, by_parameter, determinant, t_start)
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:), t_end, tolerance(:)
    type(event_t), intent(in) :: events(:)
    real(wp), intent(out) :: by_start(:, :)
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(:), determinant
    real(wp), intent(in), optional :: t_start
    real(wp), dimension(size(y), size(y) + 1) :: change
    real(wp), dimension(size(y)) :: state, reached
    real(wp) :: time
    integer :: i, n, now
    logical :: forgets
    n = size(y)
    ok = .true.
    state = y
    time = 0
    if (present(t_start)) time = t_start
    now = mode
    change = 0
    ! What a start at rest may change is what the rest lets it.
    call machines%centre%fly(now, time, state, time, reached, change(:, :n))
    if (present(determinant)) determinant = determinant_of(change(:, :n))
    do i = 1, size(events) + 1
      if (i <= size(events)) then
        call cross_flight(machines, now, state, time, events(i)%time, change, reached, present(by_parameter), determinant)
        call salt(machines, events(i), change, present(by_parameter), forgets, ok, determinant)
        ! What is forgotten need not be followed.
        ok = ok .and. (forgets .or. all(abs(reached - events(i)%arrival(:n)) <= tolerance))
        if (.not. ok) return
        state = events(i)%departure(:n)
        time = events(i)%time
        now = events(i)%after
      else
        call cross_flight(machines, now, state, time, t_end, change, reached, present(by_parameter), determinant)
      end if
    end do
    by_start = change(:, :n)
    if (present(by_parameter)) by_parameter = change(:, n + 1)
    ok = all(abs(change) <= huge(1.0_wp))
  end subroutine vary

  !> What `vary` does, by the start, with the events of the numbers `grazes`, one or two that rise, apart: their large part is known
  !> to more digits than the sum.
  pure subroutine vary_beside_graze(machines, mode, y, events, t_end, grazes, split, ok)
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: mode, grazes(:)
    real(wp), intent(in) :: y(:), t_end
    type(event_t), intent(in) :: events(:)
    type(split_t), intent(out) :: split
    logical, intent(out) :: ok
    ! The columns of the events taken apart are carried along as any others.
    real(wp), dimension(size(y), size(y) + size(grazes)) :: change
    real(wp) :: rows(size(grazes), size(y) + size(grazes)), rates(size(grazes))
    real(wp), dimension(size(y), size(y)) :: r_y
    real(wp), dimension(size(y)) :: state, reached, g_y, r_t, before, after, jumped
    real(wp) :: time, value, g_t
    logical :: forgets
    integer :: i, n, now, k
    n = size(y)
    state = y
    time = 0
    now = mode
    change = 0
    ok = .true.
    k = 0
    call machines%centre%fly(now, time, state, time, reached, change(:, :n))
    do i = 1, size(events)
      call cross_flight(machines, now, state, time, events(i)%time, change, reached, .false.)
      associate (event => events(i))
        if (any(i == grazes)) then
          k = k + 1
          before = machines%centre%slope(event%before, event%time, event%arrival(:n))
          after = machines%centre%slope(event%after, event%time, event%departure(:n))
          call machines%centre%guard(event, event%time, event%arrival(:n), value, g_y, g_t)
          call machines%centre%jump(event, event%time, event%arrival(:n), jumped, r_y, r_t)
          rows(k, :) = matmul(g_y, change)
          rates(k) = sum(g_y*before) + g_t
          change = matmul(r_y, change)
          change(:, n + k) = matmul(r_y, before) + r_t - after
        else
          call salt(machines, event, change, .false., forgets, ok)
        end if
        if (.not. ok) return
        state = event%departure(:n)
        time = event%time
        now = event%after
      end associate
    end do
    call cross_flight(machines, now, state, time, t_end, change, reached, .false.)
    ok = all(abs(change) <= huge(1.0_wp)) .and. k == size(grazes)
    if (ok) call join_parts(n, change, rows, rates, split, ok)
  end subroutine vary_beside_graze

  !> One large part of one or two: with the changes of state y and of the instants a of the two events, what the start x makes of
  !> the end is B x - c1 a1 - c2 a2, with V1 a1 = r1 x and V2 a2 = r2 x - k a1. As a1 = (r2 x - V2 a2)/k that is
  !> (B - c1 r2/k) x - (c2 - c1 V2/k) a2, where -V1 V2/k a2 = (r1 - V1 r2/k) x. Not `ok` if the second event does not see the first.
  pure subroutine join_parts(n, change, rows, rates, split, ok)
    integer, intent(in) :: n
    real(wp), intent(in) :: change(:, :), rows(:, :), rates(:)
    type(split_t), intent(out) :: split
    logical, intent(out) :: ok
    real(wp) :: seen
    ok = .true.
    split%base = change(:, :n)
    split%row = rows(1, :n)
    split%column = change(:, n + 1)
    split%rate = rates(1)
    if (size(rates) == 1) return
    seen = rows(2, n + 1)
    ok = abs(seen) > 0
    if (.not. ok) return
    split%lost = norm2(split%base) + norm2(split%column)*norm2(rows(2, :n))/abs(seen)
    split%base = split%base - spread(split%column, 2, n)*spread(rows(2, :n), 1, n)/seen
    split%lost = split%lost/max(norm2(split%base), tiny(1.0_wp))
    split%row = split%row - rates(1)*rows(2, :n)/seen
    split%column = change(:, n + 2) - split%column*rates(2)/seen
    split%rate = -rates(1)*rates(2)/seen
  end subroutine join_parts

  !> Takes the variations along a flight.
  pure subroutine cross_flight(machines, mode, y, t0, t1, change, reached, with_parameter, determinant)
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:), t0, t1
    real(wp), intent(inout) :: change(:, :)
    real(wp), intent(out) :: reached(:)
    logical, intent(in) :: with_parameter
    real(wp), intent(inout), optional :: determinant
    real(wp) :: flight(size(y), size(y)), near(size(y), 4)
    integer :: i, n
    n = size(y)
    call machines%centre%fly(mode, t0, y, t1, reached, flight)
    change = matmul(flight, change)
    if (present(determinant)) determinant = determinant*determinant_of(flight)
    if (.not. with_parameter) return
    do i = 1, 4
      call machines%near(i)%machine%fly(mode, t0, y, t1, near(:, i))
    end do
    change(:, n + 1) = change(:, n + 1) + by_difference(machines, reached, near)
  end subroutine cross_flight

  !> Takes the variations across an event. `forgets`: the state after it is the same whatever came before, and lasts.
  pure subroutine salt(machines, event, change, with_parameter, forgets, ok, determinant)
    type(neighbourhood_t), intent(in) :: machines
    type(event_t), intent(in) :: event
    real(wp), intent(inout) :: change(:, :)
    logical, intent(in) :: with_parameter
    logical, intent(out) :: forgets, ok
    real(wp), intent(inout), optional :: determinant
    real(wp), dimension(size(change, 1)) :: before, after, jumped, g_y, r_t, unused_y
    real(wp), dimension(size(change, 1), size(change, 1)) :: r_y, saltation
    real(wp) :: later(size(change, 2)), value(1), values(1, 4), g_t, unused_t, rate
    real(wp) :: jumps(size(change, 1), 4), by_parameter(size(change, 1)), guard_by_parameter(1)
    integer :: i, k, n
    n = size(change, 1)
    by_parameter = 0
    guard_by_parameter = 0
    associate (t => event%time, y => event%arrival(:n))
      before = machines%centre%slope(event%before, t, y)
      after = machines%centre%slope(event%after, t, event%departure(:n))
      call machines%centre%guard(event, t, y, value(1), g_y, g_t)
      call machines%centre%jump(event, t, y, jumped, r_y, r_t)
      if (with_parameter) then
        do i = 1, 4
          call machines%near(i)%machine%guard(event, t, y, values(1, i), unused_y, unused_t)
          call machines%near(i)%machine%jump(event, t, y, jumps(:, i), saltation, unused_y)
        end do
        guard_by_parameter = by_difference(machines, value, values)
        by_parameter = by_difference(machines, jumped, jumps)
      end if
    end associate
    forgets = .not. (any(abs(r_y) > 0) .or. any(abs(after) > 0))
    if (forgets) then
      change = 0
      change(:, n + 1) = by_parameter
      if (present(determinant)) determinant = 0
      ok = .true.
      return
    end if
    rate = sum(g_y*before) + g_t
    ok = abs(rate) > 0
    if (.not. ok) return
    if (present(determinant)) then
      do k = 1, n
        saltation(:, k) = r_y(:, k) - (matmul(r_y, before) + r_t - after)*(g_y(k)/rate)
      end do
      determinant = determinant*determinant_of(saltation)
    end if
    if (sticks_as_it_was()) then
      change = matmul(r_y, change)
      change(:, n + 1) = change(:, n + 1) + by_parameter
      return
    end if
    later = -matmul(g_y, change)/rate
    later(n + 1) = later(n + 1) - guard_by_parameter(1)/rate
    do k = 1, size(change, 2)
      change(:, k) = matmul(r_y, change(:, k) + before*later(k)) + (r_t - after)*later(k)
    end do
    change(:, n + 1) = change(:, n + 1) + by_parameter

  contains

    !> Whether the motion before a stick differs from that after it in the speed that is lost alone, so that the instant does not
    !> matter; where the joint is slowest, rounding over a rate of nothing would be all that is left.
    pure logical function sticks_as_it_was()
      real(wp) :: differ(n)
      sticks_as_it_was = event%kind == event_stick
      if (.not. sticks_as_it_was) return
      differ = (matmul(r_y, before) + r_t - after)/machines%centre%size_of
      sticks_as_it_was = norm2(differ)*machines%centre%size_of_time() <= nothing
    end function sticks_as_it_was

  end subroutine salt

  !> Derivative of the period by the parameter.
  pure real(wp) function period_slope(machines) result(slope)
    type(neighbourhood_t), intent(in) :: machines
    real(wp) :: near(1, 4), value(1)
    integer :: i
    do i = 1, 4
      near(1, i) = machines%near(i)%machine%period
    end do
    value = by_difference(machines, [machines%centre%period], near)
    slope = value(1)
  end function period_slope

end module variations
