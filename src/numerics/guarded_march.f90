! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A few ordinary differential equations, integrated step by step by the embedded Runge-Kutta pair of
!> `dormand_prince_table` until a guard falls to zero: a linear function of the state, or a margin of the system's own,
!> interpolated over the step. Guards are isolated on the continuous extension of a step, which the caller may look at,
!> then the step is taken again to the fall itself.
module guarded_march
  use dormand_prince_table, only: error_3, error_5, extension, node, stage
  use kinds, only: wp
  use polynomial, only: degree, first_fall, interpolate, value_at
  implicit none
  private

  public :: begin_march, take_step

  integer, parameter, public :: most_equations = 32
  !> How a step ended, where no guard fell; guards count from 1.
  integer, parameter, public :: march_goes_on = 0, march_time_over = -1, march_failed = -2

  integer, parameter :: most_polish = 6

  !> What is integrated.
  type, abstract, public :: system_t
  contains
    procedure(slope_function), deferred :: slope
  end type system_t

  !> With guards of its own that are not linear.
  type, abstract, extends(system_t), public :: watched_system_t
  contains
    procedure(margin_function), deferred :: margin
  end type watched_system_t

  abstract interface
    !> Time derivative of `y` [SI].
    pure function slope_function(self, time, y) result(slope)
      import :: system_t, wp
      class(system_t), intent(in) :: self
      real(wp), intent(in) :: time, y(:)
      real(wp) :: slope(size(y))
    end function slope_function

    !> Margin `number` of a system: positive as long as the march may go on.
    pure real(wp) function margin_function(self, number, time, y)
      import :: watched_system_t, wp
      class(watched_system_t), intent(in) :: self
      integer, intent(in) :: number
      real(wp), intent(in) :: time, y(:)
    end function margin_function
  end interface

  !> constant + sum of coefficients times the state. Positive, or leaving zero upwards, at the start.
  type, public :: guard_t
    real(wp) :: constant = 0
    real(wp) :: coefficients(most_equations) = 0
    !> Number of a margin of the system that is the guard instead; 0 = none.
    integer :: margin = 0
    !> It is zero when the march begins, and rises from there; what is no more than `noise`, or over a time `noise_rate` times
    !> it, is rounding.
    logical :: from_zero = .false.
    real(wp) :: noise = 0, noise_rate = 0
  end type guard_t

  type, public :: march_t
    !> Number of equations.
    integer :: n = 0
    !> No step has been taken.
    logical :: begins = .true.
    !> Now, and the state now.
    real(wp) :: time = 0, y(most_equations) = 0
    !> The step behind: its start, length, the fraction of the length that was gone, and the state over the fraction of
    !> the length, by rising powers.
    real(wp) :: from = 0, length = 0, fraction = 0, path(0:degree, most_equations) = 0
    !> The guard that fell, along that step.
    real(wp) :: fall(0:degree) = 0
    real(wp) :: tolerance = 0
    !> Size of each unknown below which errors are absolute.
    real(wp) :: scale(most_equations) = 1
    !> Length of the next step, and slopes of the stages; the first is that now.
    real(wp) :: next_length = 0, slopes(most_equations, 16) = 0
  end type march_t

contains

  !> Starts at `time` [s] with the state `y`; errors are relative to |y| + `scale`. `longest` [s] bounds the trial of
  !> the first step.
  pure subroutine begin_march(march, system, tolerance, scale, longest, time, y)
    type(march_t), intent(out) :: march
    class(system_t), intent(in) :: system
    real(wp), intent(in) :: tolerance, scale(:), longest, time, y(:)
    real(wp) :: weight(size(y)), f(size(y)), h
    march%n = size(y)
    march%time = time
    march%y(:march%n) = y
    march%tolerance = tolerance
    march%scale(:march%n) = scale
    f = system%slope(time, y)
    march%slopes(:march%n, 1) = f
    weight = tolerance*(abs(y) + scale)
    h = trial_length(y, f, weight, longest)
    march%next_length = first_length(f, system%slope(time + h, y + h*f), weight, h)
  end subroutine begin_march

  !> One step, to `time_end` [s] at most. `fallen` is the guard that fell first, and the state then is that at its fall;
  !> or one of `march_goes_on`, `march_time_over`, `march_failed`.
  pure subroutine take_step(march, system, guards, time_end, fallen)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guards(:)
    real(wp), intent(in) :: time_end
    integer, intent(out) :: fallen
    real(wp) :: h, remaining, error, next(march%n)
    logical :: last
    fallen = march_time_over
    march%from = march%time
    march%fraction = 0
    remaining = time_end - march%time
    if (remaining <= 0) return
    do
      last = march%next_length >= remaining
      h = min(march%next_length, remaining)
      if (.not. h > 2*spacing(march%time + tiny(h))) then
        fallen = march_failed
        if (.not. last) return
        ! Less is left than the clock can tell.
        fallen = march_time_over
        march%time = time_end
        return
      end if
      call try_step(march, system, h, next, error)
      if (error <= 1) exit
      march%next_length = next_length_after(h, error)
    end do
    call extend(march, system, h, next)
    march%length = h
    call find_fall(march, system, guards, fallen)
    march%begins = .false.
    if (fallen == march_goes_on) then
      march%time = merge(time_end, march%from + h, last)
      march%slopes(:, 1) = march%slopes(:, 13)
      march%next_length = next_length_after(h, error)
    else
      call land(march, system, guards(fallen), next)
      march%time = min(march%from + march%fraction*h, time_end)
      march%slopes(:march%n, 1) = system%slope(march%time, next)
    end if
    march%y(:march%n) = next
    if (fallen == march_goes_on .and. last) fallen = march_time_over
  end subroutine take_step

  !> One step of order 8 and its error relative to the tolerance; slope 13 is that at the end.
  pure subroutine try_step(march, system, h, next, error)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    real(wp), intent(in) :: h
    real(wp), intent(out) :: next(march%n), error
    integer :: i, n
    n = march%n
    associate (y => march%y(:n))
      do i = 2, 12
        march%slopes(:n, i) = system%slope(march%time + node(i)*h, y + h*combine(n, march%slopes, i))
      end do
      next = y + h*combine(n, march%slopes, 13)
      march%slopes(:n, 13) = system%slope(march%time + h, next)
      error = error_of(n, march%slopes, h, march%tolerance*(max(abs(y), abs(next)) + march%scale(:n)))
    end associate
  end subroutine try_step

  !> Continuous extension of a step.
  pure subroutine extend(march, system, h, next)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    real(wp), intent(in) :: h, next(march%n)
    integer :: i, n
    n = march%n
    do i = 14, 16
      march%slopes(:n, i) = system%slope(march%time + node(i)*h, march%y(:n) + h*combine(n, march%slopes, i))
    end do
    call extend_path(n, march%slopes, h, march%y(:n), next, march%path)
  end subroutine extend

  !> The first guard that falls within the step; of several at one instant the first in the list.
  pure subroutine find_fall(march, system, guards, fallen)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guards(:)
    integer, intent(out) :: fallen
    real(wp) :: p(0:degree), t, first, noise
    integer :: i
    fallen = march_goes_on
    first = 1
    do i = 1, size(guards)
      if (guards(i)%margin > 0) then
        p = margin_along(march, system, guards(i))
      else
        p = matmul(march%path(:, :march%n), guards(i)%coefficients(:march%n))
        p(0) = p(0) + guards(i)%constant
      end if
      if (guards(i)%from_zero .and. march%begins) p(0) = 0
      noise = guards(i)%noise + guards(i)%noise_rate*march%length
      if (noise > 0 .and. all(abs(p) <= noise)) cycle
      t = first_fall(p)
      if (guards(i)%from_zero .and. march%begins .and. p(1) < -noise) t = 0
      if (t < first .or. (fallen == march_goes_on .and. t <= first)) then
        first = t
        fallen = i
        march%fall = p
      end if
    end do
    march%fraction = first
  end subroutine find_fall

  !> A margin of the system over the step behind.
  pure function margin_along(march, system, guard) result(p)
    type(march_t), intent(in) :: march
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guard
    real(wp) :: p(0:degree), place(0:degree), value(0:degree), y(march%n)
    integer :: i, k
    do i = 0, degree
      place(i) = i/real(degree, wp)
      y = [(value_at(march%path(:, k), place(i)), k=1, march%n)]
      value(i) = margin_of(system, guard, march%from + place(i)*march%length, y)
    end do
    p = interpolate(place, value)
  end function margin_along

  pure real(wp) function margin_of(system, guard, time, y)
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guard
    real(wp), intent(in) :: time, y(:)
    margin_of = guard%constant
    select type (system)
    class is (watched_system_t)
      margin_of = margin_of + system%margin(guard%margin, time, y)
    end select
  end function margin_of

  !> Takes the step again up to the fall of a guard, corrected by Newton.
  pure subroutine land(march, system, guard, next)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guard
    real(wp), intent(out) :: next(march%n)
    real(wp) :: error, miss, rate, correction
    integer :: i, k, n
    n = march%n
    do i = 1, most_polish
      call try_step(march, system, march%fraction*march%length, next, error)
      if (guard%margin > 0) then
        miss = -margin_of(system, guard, march%from + march%fraction*march%length, next)
        rate = value_at([(k*march%fall(k), k=1, degree), 0.0_wp], march%fraction)/march%length
      else
        miss = -guard%constant - sum(guard%coefficients(:n)*next)
        rate = sum(guard%coefficients(:n)*march%slopes(:n, 13))
      end if
      correction = 0
      if (abs(miss) < 0.01_wp*abs(rate)*march%length) correction = miss/(rate*march%length)
      if (march%fraction + correction <= 0 .or. march%fraction + correction > 1) exit
      if (abs(correction) <= 2*epsilon(1.0_wp)) exit
      march%fraction = march%fraction + correction
    end do
  end subroutine land

  include 'dormand_prince_step.inc'

end module guarded_march
