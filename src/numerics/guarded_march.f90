! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A few ordinary differential equations, integrated step by step by the embedded Runge-Kutta pair of `dormand_prince_table` until
!> a guard falls to zero: a linear function of the state, or a margin of the system's own, interpolated over the step. Guards are
!> isolated on the continuous extension of a step, which the caller may look at, then the step is taken again to the zero itself.
module guarded_march
  use dormand_prince_table, only: error_3, error_5, extension, node, stage
  use kinds, only: wp
  use polynomial, only: degree, first_zero, interpolate, value_at
  implicit none
  private

  public :: begin_march, take_step, system_t, watched_system_t, guard_t, march_t, most_equations, march_goes_on, march_time_over, &
    march_failed

  integer, parameter :: most_equations = 32

  !> What is integrated.
  type, abstract :: system_t
  contains
    procedure(slope_function), deferred :: slope
  end type system_t

  !> With guards of its own that are not linear.
  type, abstract, extends(system_t) :: watched_system_t
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

  !> Slopes need nothing beside the system.
  type :: context_t
  end type context_t

  include 'march_types.inc'

contains

  !> Starts at `time` [s] with the state `y`; errors are relative to |y| + `scale`. `longest` [s] bounds the trial of
  !> the first step.
  pure subroutine begin_march(march, system, tolerance, scale, longest, time, y)
    type(march_t), intent(out) :: march
    class(system_t), intent(in) :: system
    real(wp), intent(in) :: tolerance, scale(:), longest, time, y(:)
    call set_out(size(y), march, system, tolerance, scale, longest, time, y)
  end subroutine begin_march

  !> One step, to `time_end` [s] at most. `triggered` is the guard triggered first, and the state then is that at its zero; or one
  !> of `march_goes_on`, `march_time_over`, `march_failed`.
  pure subroutine take_step(march, system, guards, time_end, triggered)
    type(march_t), intent(inout) :: march
    class(system_t), intent(in) :: system
    type(guard_t), intent(in) :: guards(:)
    real(wp), intent(in) :: time_end
    integer, intent(out) :: triggered
    call step_on(march%n, march, system, guards, time_end, triggered)
    if (triggered > 0) march%slopes(:march%n, 1) = system%slope(march%time, march%y(:march%n))
  end subroutine take_step

  pure subroutine find_slope(system, context, n, time, y, slope)
    class(system_t), intent(in) :: system
    type(context_t), intent(in) :: context
    integer, intent(in) :: n
    real(wp), intent(in) :: time, y(most_equations)
    real(wp), intent(out) :: slope(most_equations)
    slope(:n) = system%slope(time, y(:n))
  end subroutine find_slope

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

  include 'march_steps.inc'

end module guarded_march
