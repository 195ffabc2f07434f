! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Flights of one mode of a machine with a motor by the embedded Runge-Kutta pair of `guarded_march`, to a tolerance: for short
!> segments with many samples, where the proofs of `series_flight` would cost more than the motion.
module motor_march
  use guarded_march, only: begin_march, guard_t, march_failed, march_goes_on, march_t, take_step, watched_system_t
  use kinds, only: wp
  use motor_system, only: guard_back, guard_count, guard_section, motor_system_t
  use operations, only: op_add, op_constant, op_multiply, op_parameter, op_subtract, op_variable, operate, operation_table
  use polynomial, only: value_at
  use series_flight, only: flight_t
  use tape, only: tape_t
  implicit none
  private

  public :: march_mode

  !> Steps of one mode after which it is given up, and what of a guard that begins at zero is rounding, as a part of the tolerance.
  integer, parameter :: most_steps = 100000
  real(wp), parameter :: rounding = 16

  !> The operations that rates, guards and a node to be sampled need, in the order of their evaluation.
  type, extends(watched_system_t) :: equations_t
    integer :: count = 0
    integer, allocatable :: operation(:), first(:), second(:), rates(:), guards(:), directions(:)
    !> Of what is no operation: its value.
    real(wp), allocatable :: value(:)
    integer :: sampled = 0
  contains
    procedure :: slope => slope_of_mode
    procedure :: margin => margin_of_mode
  end type equations_t

contains

  !> Moves a flight of `begin_mode` to `time_end` [s], or to the first of its active guards but those of a turn, which `crossed`
  !> then has. Puts variables and the value of the node `sampled` (0: none) at those of `times` that it passes into columns of
  !> `samples`; `next` is the first time that is left. `sizes` of the variables: errors are relative to the sum of value and size.
  pure subroutine march_mode(system, flight, sizes, tolerance, time_end, times, next, samples, failed)
    type(motor_system_t), intent(in) :: system
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: sizes(:), tolerance, time_end, times(:)
    integer, intent(inout) :: next
    real(wp), intent(inout) :: samples(:, :)
    logical, intent(out) :: failed
    type(equations_t) :: equations
    type(guard_t), allocatable :: guards(:)
    integer, allocatable :: watched(:)
    type(march_t) :: march
    integer :: i, n, triggered
    n = system%variables
    flight%crossed = .false.
    call watched_guards(flight, watched)
    call take_equations(flight%tape, flight%parameters, flight%rates(:n), flight%guards(watched)%node, &
                        flight%guards(watched)%direction, system%current, equations)
    allocate (guards(size(watched)))
    do i = 1, size(watched)
      guards(i)%margin = i
      guards(i)%from_zero = flight%zeros(watched(i)) > 0
      if (guards(i)%from_zero) guards(i)%noise = rounding*tolerance*size_of(equations, i, flight%state(:n), sizes)
    end do
    call begin_march(march, equations, tolerance, sizes, time_end - flight%time, flight%time, flight%state(:n))
    failed = .true.
    do i = 1, most_steps
      call take_step(march, equations, guards, time_end, triggered)
      if (triggered == march_failed) return
      call put_samples(march, equations, times, next, samples)
      if (triggered /= march_goes_on) exit
    end do
    failed = triggered == march_goes_on
    flight%state(:n) = march%y(:n)
    flight%time = march%time
    if (triggered > 0) flight%crossed(watched(triggered)) = .true.
  end subroutine march_mode

  !> Guards that may end the mode: the angle goes on beyond a turn.
  pure subroutine watched_guards(flight, watched)
    type(flight_t), intent(in) :: flight
    integer, allocatable, intent(out) :: watched(:)
    integer :: i
    watched = pack([(i, i=1, guard_count)], flight%is_active(:guard_count))
    watched = pack(watched, watched /= guard_section .and. watched /= guard_back)
  end subroutine watched_guards

  !> How large a guard is next to a state: what its size changes it by.
  pure real(wp) function size_of(equations, guard, state, sizes)
    type(equations_t), intent(in) :: equations
    integer, intent(in) :: guard
    real(wp), intent(in) :: state(:), sizes(:)
    integer :: k
    real(wp) :: moved(size(state))
    size_of = 0
    do k = 1, size(state)
      moved = state
      moved(k) = state(k) + sizes(k)
      size_of = max(size_of, abs(equations%margin(guard, 0.0_wp, moved) - equations%margin(guard, 0.0_wp, state)))
    end do
  end function size_of

  pure subroutine put_samples(march, equations, times, next, samples)
    type(march_t), intent(in) :: march
    type(equations_t), intent(in) :: equations
    real(wp), intent(in) :: times(:)
    integer, intent(inout) :: next
    real(wp), intent(inout) :: samples(:, :)
    real(wp) :: value(equations%count)
    integer :: k, n
    n = march%n
    do while (next <= size(times))
      if (times(next) > march%time) exit
      do k = 1, n
        samples(k, next) = value_at(march%path(:, k), (times(next) - march%from)/march%length)
      end do
      if (equations%sampled > 0) then
        value = values_of(equations, samples(:n, next))
        samples(n + 1, next) = value(equations%sampled)
      end if
      next = next + 1
    end do
  end subroutine put_samples

  !> Takes the operations that are needed from a tape.
  pure subroutine take_equations(tape, parameters, rates, guards, directions, sampled, equations)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:)
    integer, intent(in) :: rates(:), guards(:), directions(:), sampled
    type(equations_t), intent(out) :: equations
    logical :: needed(0:tape%count)
    integer :: at(0:tape%count), i, k
    needed = .false.
    needed([rates, guards, sampled]) = .true.
    do i = tape%count, 1, -1
      if (.not. needed(i)) cycle
      associate (it => tape%nodes(i))
        if (is_leaf(it%operation)) cycle
        needed(it%first) = .true.
        if (operation_table(it%operation)%arguments > 1) needed(it%second) = .true.
      end associate
    end do
    needed(0) = .false.
    equations%count = count(needed)
    allocate (equations%operation(equations%count), equations%first(equations%count), equations%second(equations%count))
    allocate (equations%value(equations%count))
    at = 0
    k = 0
    do i = 1, tape%count
      if (.not. needed(i)) cycle
      k = k + 1
      at(i) = k
      associate (it => tape%nodes(i))
        equations%operation(k) = it%operation
        equations%first(k) = it%first
        equations%second(k) = 0
        equations%value(k) = it%value
        if (it%operation == op_parameter) equations%value(k) = parameters(it%first)
        if (is_leaf(it%operation)) cycle
        equations%first(k) = at(it%first)
        equations%second(k) = at(it%first)
        if (operation_table(it%operation)%arguments > 1) equations%second(k) = at(it%second)
      end associate
    end do
    equations%rates = at(rates)
    equations%guards = at(guards)
    equations%directions = directions
    equations%sampled = at(sampled)
  end subroutine take_equations

  pure logical function is_leaf(operation)
    integer, intent(in) :: operation
    is_leaf = operation == op_constant .or. operation == op_variable .or. operation == op_parameter
  end function is_leaf

  !> Values of all operations; what is not defined is zero.
  pure function values_of(equations, y) result(value)
    class(equations_t), intent(in) :: equations
    real(wp), intent(in) :: y(:)
    real(wp) :: value(equations%count)
    logical :: is_defined
    integer :: i
    do i = 1, equations%count
      select case (equations%operation(i))
      case (op_variable)
        value(i) = y(equations%first(i))
      case (op_constant, op_parameter)
        value(i) = equations%value(i)
        ! Most operations are these, and always defined.
      case (op_add)
        value(i) = value(equations%first(i)) + value(equations%second(i))
      case (op_subtract)
        value(i) = value(equations%first(i)) - value(equations%second(i))
      case (op_multiply)
        value(i) = value(equations%first(i))*value(equations%second(i))
      case default
        call operate(equations%operation(i), value(equations%first(i)), value(equations%second(i)), value(i), is_defined)
      end select
    end do
  end function values_of

  pure function slope_of_mode(self, time, y) result(slope)
    class(equations_t), intent(in) :: self
    real(wp), intent(in) :: time, y(:)
    real(wp) :: slope(size(y))
    real(wp) :: value(self%count)
    value = values_of(self, y)
    slope = value(self%rates) + 0*time
  end function slope_of_mode

  !> A guard, positive before it crosses zero in its direction.
  pure real(wp) function margin_of_mode(self, number, time, y) result(margin)
    class(equations_t), intent(in) :: self
    integer, intent(in) :: number
    real(wp), intent(in) :: time, y(:)
    real(wp) :: value(self%count)
    value = values_of(self, y)
    margin = -self%directions(number)*value(self%guards(number)) + 0*time
  end function margin_of_mode

end module motor_march
