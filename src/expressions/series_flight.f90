! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Certified motion of z' = f(z) by Taylor series of one order, to the first zero of a guard.
!>
!> The length of a step follows from the last coefficients (Jorba & Zou 2005). A step is accepted if an enclosure is proven
!> (`enclosures`). With the same bound for each guard, no zero before the one that ends the motion is possible: see `bernstein`.
module series_flight
  use bernstein, only: first_crossing
  use elementary, only: exponential, logarithm
  use enclosures, only: bounds_t, enclose, enclosure_t, forget_bounds, least_margin, prepare_enclosure, restart_enclosure, &
    series_order, widest_margin
  use kinds, only: wp
  use operations, only: op_select, op_variable
  use step_length, only: is_plain, natural_step, size_of_arguments, sum_of_sizes
  use tape, only: tape_t
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate
  implicit none
  private

  public :: start_flight, restart_flight, set_branches, go_on_with, branches_of, sizes_of_state, advance_flight, &
    value_in_flight, keep_bounds, take_bounds, series_order

  !> How a motion ended: at its last time; at a guard; where an operation is not defined; where no step, however short, is
  !> proven; at the budget of steps; at its start, whose branches are not those of the state.
  integer, parameter, public :: flight_reached = 0, flight_crossed = 1, flight_left_domain = 2, flight_no_progress = 3, &
    flight_step_budget = 4, flight_wrong_branch = 5

  integer, parameter :: most_tries = 200
  !> Steps in which the time does not change, after which a motion into a pole is given up.
  integer, parameter :: most_idle_steps = 100
  !> Shortest step, as a part of the time.
  real(wp), parameter :: shortest = 0.01_wp*epsilon(1.0_wp)

  !> A function of the state that ends a motion where it crosses zero.
  type, public :: guard_t
    integer :: node = 0
    !> 1 upwards, -1 downwards, 0 both.
    integer :: direction = 0
  end type guard_t

  type, public :: flight_t
    type(tape_t) :: tape
    real(wp), allocatable :: parameters(:)
    integer, allocatable :: rates(:)
    !> The guards of the caller, then the switching functions of the tape; those that the branches use are active.
    type(guard_t), allocatable :: guards(:)
    logical, allocatable :: is_active(:)
    real(wp), allocatable :: state(:)
    real(wp) :: time = 0
    !> Order of the zero that each guard has at the start, 0 for none: such a zero is no crossing. Set to 1 for the guards that
    !> ended the last motion and to 0 for others; the caller sets what its event changes.
    integer, allocatable :: zeros(:)
    !> The guards that crossed at the end.
    logical, allocatable :: crossed(:)
    !> Node of the operation that is not defined.
    integer :: fault = 0
    !> Steps, enclosures tried for them, and decisions that even short steps left to rounding.
    integer :: steps = 0, tries = 0, uncertain = 0
    integer :: step_budget = 1000000
    !> By which the caller knows the system; 0: none.
    integer :: label = 0
    type(series_t), private :: series
    type(enclosure_t), private :: around
    !> Node of each variable of the tape among the states, 0 for other states; the polynomials of the states in the fraction of a
    !> step.
    integer, allocatable, private :: variables(:)
    real(wp), allocatable, private :: path(:, :)
    !> Powers of the step, in units of the series.
    real(wp), private :: powers(0:series_order) = 1
    !> Nodes of the active guards that are more than a variable and a constant.
    integer, allocatable, private :: curved(:)
    !> Length of the last proven step, as a part of that by the last coefficients.
    real(wp), private :: proven = 1
    !> A power of two near the step behind.
    real(wp), private :: next_unit = 1
    !> The last motion ended at its last time.
    logical, private :: goes_on = .false.
  end type flight_t

contains

  !> A motion of a system: rates of its variables and guards are nodes of the tape. The caller sets time and state,
  !> and the branches where they are not all the first.
  pure subroutine start_flight(flight, tape, rates, guards, parameters)
    type(flight_t), intent(out) :: flight
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: rates(:)
    type(guard_t), intent(in) :: guards(:)
    real(wp), intent(in) :: parameters(:)
    integer :: k, n
    flight%tape = tape
    flight%rates = rates
    flight%parameters = parameters
    n = size(guards) + size(tape%switches)
    flight%guards = [guards, (guard_t(tape%switches(k)%argument), k=1, size(tape%switches))]
    allocate (flight%is_active(n), flight%zeros(n), flight%crossed(n), flight%state(size(rates)))
    flight%zeros = 0
    flight%crossed = .false.
    flight%state = 0
    allocate (flight%path(0:series_order, size(rates)), flight%variables(size(rates)))
    flight%variables = 0
    do k = 1, tape%count
      if (tape%nodes(k)%operation /= op_variable) cycle
      if (tape%nodes(k)%first <= size(rates)) flight%variables(tape%nodes(k)%first) = k
    end do
    call set_branches(flight, [(1, k=1, size(tape%switches))])
  end subroutine start_flight

  !> A flight of the same system anew, as `start_flight` leaves it but for parameters, directions of guards, branches and which
  !> guards are active: the caller sets these.
  pure subroutine restart_flight(flight)
    type(flight_t), intent(inout) :: flight
    flight%zeros = 0
    flight%crossed = .false.
    flight%fault = 0
    flight%steps = 0
    flight%tries = 0
    flight%uncertain = 0
    flight%proven = 1
    flight%next_unit = 1
    flight%goes_on = .false.
    call restart_enclosure(flight%around)
  end subroutine restart_flight

  !> Chooses the branch of every switching function by a sign.
  pure subroutine set_branches(flight, branches)
    type(flight_t), intent(inout) :: flight
    integer, intent(in) :: branches(:)
    integer :: i, own
    logical :: is_prepared
    own = size(flight%guards) - size(branches)
    is_prepared = allocated(flight%series%branches)
    if (is_prepared) is_prepared = all(flight%series%branches == branches)
    if (is_prepared) then
      call forget_bounds(flight%around)
    else
      call prepare_series(flight%tape, series_order, flight%rates, flight%guards(:own)%node, branches, flight%series, &
                          only_used=.true.)
      call prepare_enclosure(flight%tape, flight%rates, flight%guards(:own)%node, branches, flight%around)
    end if
    flight%is_active = .true.
    flight%is_active(own + 1:) = .false.
    do i = 1, flight%tape%count
      if (flight%tape%nodes(i)%operation == op_select .and. flight%series%is_used(i)) then
        flight%is_active(own + flight%tape%nodes(i)%first) = .true.
      end if
    end do
    flight%curved = [integer ::]
    do i = 1, size(flight%guards)
      if (flight%is_active(i) .and. .not. is_plain(flight%tape, flight%guards(i)%node)) then
        flight%curved = [flight%curved, flight%guards(i)%node]
      end if
    end do
  end subroutine set_branches

  !> Goes on with these branches of switching functions. `zeros`: order of the zero that a function has, -1 if it stays zero.
  pure subroutine go_on_with(flight, branches, zeros)
    type(flight_t), intent(inout) :: flight
    integer, intent(in) :: branches(:), zeros(:)
    logical :: watched(size(flight%guards) - size(branches))
    integer :: own
    own = size(watched)
    watched = flight%is_active(:own)
    call set_branches(flight, branches)
    flight%is_active(:own) = watched
    flight%is_active(own + 1:) = flight%is_active(own + 1:) .and. zeros >= 0
    flight%zeros(own + 1:) = max(zeros, 0)
    ! Other forces allow other steps.
    flight%proven = 1
  end subroutine go_on_with

  pure function branches_of(flight) result(branches)
    type(flight_t), intent(in) :: flight
    integer :: branches(size(flight%series%branches))
    branches = flight%series%branches
  end function branches_of

  !> What the state at the end of a step is a sum of, for its rounding.
  pure function sizes_of_state(flight) result(sizes)
    type(flight_t), intent(in) :: flight
    real(wp) :: sizes(size(flight%rates))
    sizes = sum(abs(flight%path), dim=1)
  end function sizes_of_state

  !> Value of a node at the present state, in the present branches.
  pure real(wp) function value_in_flight(flight, node) result(value)
    type(flight_t), intent(in) :: flight
    integer, intent(in) :: node
    real(wp) :: values(flight%tape%count)
    integer :: faults(flight%tape%count)
    call evaluate(flight%tape, flight%state, flight%parameters, values, faults, flight%series%branches)
    value = values(node)
  end function value_in_flight

  !> Moves on to the time `until`, or to the first crossing of a guard. `status` states how it ended.
  pure subroutine advance_flight(flight, until, status)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: until
    integer, intent(out) :: status
    real(wp) :: step, fraction, longest, before
    integer :: i, idle
    logical :: goes_on
    goes_on = flight%goes_on
    flight%goes_on = .false.
    flight%crossed = .false.
    idle = 0
    do i = 1, flight%step_budget
      status = flight_reached
      flight%goes_on = flight%time >= until
      if (flight%goes_on) return
      call expand_in_unit(flight)
      status = flight_left_domain
      if (flight%fault > 0) return
      status = flight_crossed
      if (i == 1 .and. goes_on) call cross_at_start(flight)
      if (any(flight%crossed)) return
      status = flight_wrong_branch
      if (i == 1 .and. .not. branches_agree(flight)) return
      longest = until - flight%time
      call take_step(flight, longest, step, fraction, status)
      if (status == flight_no_progress .or. status == flight_left_domain) return
      flight%steps = flight%steps + 1
      before = flight%time
      call move(flight, step, min(fraction, 1.0_wp))
      idle = merge(0, idle + 1, flight%time > before)
      if (fraction > 1 .and. step >= longest) flight%time = until
      flight%zeros = merge(1, 0, flight%crossed)
      if (status == flight_crossed) return
      if (idle >= most_idle_steps) then
        status = flight_no_progress
        return
      end if
    end do
    status = flight_step_budget
  end subroutine advance_flight

  !> Guards that crossed zero at the end of the last motion, where rounding put them beyond it: no search from here finds that.
  pure subroutine cross_at_start(flight)
    type(flight_t), intent(inout) :: flight
    real(wp) :: value, slope, rounding
    integer :: g, own
    own = size(flight%guards) - size(flight%series%branches)
    do g = 1, size(flight%guards)
      if (.not. flight%is_active(g) .or. flight%zeros(g) > 0) cycle
      value = flight%series%c(0, flight%guards(g)%node)
      slope = flight%series%c(1, flight%guards(g)%node)/flight%series%unit
      rounding = 16*epsilon(1.0_wp)*(size_of_arguments(flight%tape, flight%series%c(0, :), flight%guards(g)%node) + &
                                     abs(slope*flight%time))
      if (abs(value) > rounding) cycle
      if (g > own) then
        flight%crossed(g) = flight%series%branches(g - own)*slope < 0 .and. flight%series%branches(g - own)*value <= 0
      else
        flight%crossed(g) = flight%guards(g)%direction*slope > 0 .and. flight%guards(g)%direction*value >= 0
      end if
    end do
    where (flight%crossed) flight%zeros = 1
  end subroutine cross_at_start

  !> Coefficients at the state, in a unit of time in which they do not overflow.
  pure subroutine expand_in_unit(flight)
    type(flight_t), intent(inout) :: flight
    integer :: try
    do try = 1, 30
      flight%series%unit = flight%next_unit
      call expand(flight%tape, flight%state, flight%parameters, flight%series, flight%fault)
      if (flight%fault >= 0) return
      flight%next_unit = scale(flight%next_unit, -30)
    end do
    flight%fault = abs(flight%fault)
  end subroutine expand_in_unit

  !> Whether the switching functions have the signs of their branches, or leave zero to that side.
  pure logical function branches_agree(flight)
    type(flight_t), intent(in) :: flight
    real(wp) :: value, rounding
    integer :: k, g, m
    branches_agree = .true.
    do k = 1, size(flight%series%branches)
      g = size(flight%guards) - size(flight%series%branches) + k
      if (.not. flight%is_active(g)) cycle
      m = min(flight%zeros(g), series_order)
      value = flight%series%c(m, flight%guards(g)%node)
      rounding = 0
      if (m == 0) rounding = 8*epsilon(1.0_wp)*size_of_arguments(flight%tape, flight%series%c(0, :), flight%guards(g)%node)
      if (abs(value) > rounding .and. ((value > 0) .neqv. flight%series%branches(k) > 0)) branches_agree = .false.
    end do
  end function branches_agree

  !> The longest proven step up to `longest`, and the fraction of it at which the first guard crosses zero; 2 without one.
  pure subroutine take_step(flight, longest, step, fraction, status)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: longest
    real(wp), intent(out) :: step, fraction
    integer, intent(out) :: status
    real(wp) :: natural, scaling
    integer :: try, fault
    logical :: is_certain, is_anew
    natural = natural_step(flight%series, flight%state, flight%curved)
    if (natural < 1e12_wp*flight%next_unit) then
      flight%next_unit = scale(1.0_wp, exponent(natural))
    else
      ! A polynomial has no natural step; but high orders may have vanished in a unit that is too short.
      flight%next_unit = max(flight%next_unit, scale(1.0_wp, exponent(min(natural, longest))))
    end if
    step = min(natural*min(1.0_wp, flight%proven), longest)
    fraction = 2
    fault = 0
    status = flight_reached
    is_anew = .false.
    associate (around => flight%around)
      around%margin = min(widest_margin, 64*around%margin)
      do try = 1, most_tries
        flight%tries = flight%tries + 1
        if (.not. step > shortest*max(abs(flight%time), longest)) exit
        call set_path(flight, step)
        call enclose(flight%tape, flight%parameters, flight%path, step, is_anew, around)
        if (around%fault > 0) then
          fault = around%fault
          step = 0.5_wp*step
          around%margin = max(least_margin, around%margin/16)
          cycle
        end if
        ! What the remainder allows: it grows with the step to the power of its order.
        scaling = exponential(logarithm(0.5_wp/max(around%excess, 1e-90_wp))/(series_order + 1))
        flight%proven = merge(step/natural*scaling, max(flight%proven, step/natural*scaling), around%is_own)
        ! Less than 1 by far more than rounding of the polynomials. The same bounds prove a step that is a little shorter.
        if (around%excess > 0.9_wp) then
          step = step*max(0.25_wp, scaling)
          if (scaling < 0.5_wp) cycle
          call set_path(flight, step)
        end if
        call find_crossing(flight, step, fraction, is_certain)
        if (is_certain .and. fraction <= 1) status = flight_crossed
        if (is_certain) return
        is_anew = .true.
        if (.not. around%is_own) cycle
        flight%proven = step/natural
        step = 0.5_wp*step
      end do
    end associate
    ! Next to the end of a domain steps may shrink before one leaves it: a longer one does.
    if (fault == 0) then
      call set_path(flight, 16*natural)
      call enclose(flight%tape, flight%parameters, flight%path, 16*natural, .true., flight%around)
      fault = max(0, flight%around%fault)
    end if
    flight%fault = fault
    status = merge(flight_left_domain, flight_no_progress, fault > 0)
  end subroutine take_step

  !> Polynomials of the states in the fraction of a step. The unit of the series is a power of two.
  pure subroutine set_path(flight, step)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: step
    integer :: i, k
    do k = 1, series_order
      flight%powers(k) = flight%powers(k - 1)*(step/flight%series%unit)
    end do
    do i = 1, size(flight%rates)
      if (flight%variables(i) > 0) then
        flight%path(:, i) = flight%series%c(:, flight%variables(i))*flight%powers
      else
        do k = 1, series_order
          flight%path(k, i) = flight%series%unit*flight%series%c(k - 1, flight%rates(i))/k*flight%powers(k)
        end do
      end if
      flight%path(0, i) = flight%state(i)
    end do
  end subroutine set_path

  !> First fraction of the step at which an active guard crosses zero, 2 without one, and the guards that do. `is_certain`
  !> is false if a shorter step could decide what this one leaves open.
  pure subroutine find_crossing(flight, step, fraction, is_certain)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: step
    real(wp), intent(out) :: fraction
    logical, intent(out) :: is_certain
    real(wp) :: at(size(flight%guards)), remainder, rounding, power
    integer :: g, k
    logical :: is_proven
    at = 2
    is_certain = .true.
    power = 1.01_wp
    do k = 1, series_order + 1
      power = power*(step/flight%around%bounds%unit)
    end do
    do g = 1, size(flight%guards)
      if (.not. flight%is_active(g)) cycle
      remainder = power*flight%around%bounds%last(flight%guards(g)%node)
      call cross(flight, g, remainder, at(g), rounding, is_proven)
      if (is_proven) cycle
      is_certain = is_certain .and. remainder <= rounding .and. flight%around%is_own
      if (remainder <= rounding .and. flight%around%is_own) flight%uncertain = flight%uncertain + 1
    end do
    fraction = min(2.0_wp, minval(at))
    flight%crossed = fraction <= 1 .and. at - fraction <= 8*epsilon(1.0_wp)*fraction
  end subroutine find_crossing

  !> First crossing of a guard within the step. A zero of order m at the start is divided out: the rest of the series, over
  !> the fraction to the power m, has the other zeros.
  pure subroutine cross(flight, g, remainder, at, rounding, is_proven)
    type(flight_t), intent(in) :: flight
    integer, intent(in) :: g
    real(wp), intent(in) :: remainder
    real(wp), intent(out) :: at, rounding
    logical, intent(out) :: is_proven
    real(wp) :: p(0:series_order), total
    integer :: k, m, node
    node = flight%guards(g)%node
    m = min(flight%zeros(g), series_order)
    at = 2
    rounding = 0
    is_proven = .true.
    p = flight%series%c(:, node)*flight%powers
    if (m == 0) then
      rounding = epsilon(1.0_wp)*size_of_arguments(flight%tape, flight%around%bounds%first, node)
      total = sum_of_sizes(p)
      ! The first term outweighs all others.
      if (abs(p(0)) > total + remainder + rounding + (series_order + 2)*epsilon(1.0_wp)*(abs(p(0)) + total)) return
    end if
    total = 0
    do k = m, series_order
      total = total + (k + 1)*abs(p(k))
    end do
    rounding = rounding + epsilon(1.0_wp)*total
    p(:series_order - m) = p(m:)
    p(series_order - m + 1:) = 0
    total = remainder + rounding
    if (abs(p(0)) > sum_of_sizes(p) + total) return
    call first_crossing(p, total, (series_order + 1 + m)*total, flight%guards(g)%direction, at, is_proven)
  end subroutine cross

  !> State and time after a fraction of the step whose path there is.
  pure subroutine move(flight, step, fraction)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(in) :: step, fraction
    real(wp) :: total, power(0:series_order)
    integer :: i, k
    power(0) = 1
    do k = 1, series_order
      power(k) = power(k - 1)*fraction
    end do
    do i = 1, size(flight%rates)
      total = 0
      do k = series_order, 0, -1
        total = total + flight%path(k, i)*power(k)
      end do
      flight%state(i) = total
    end do
    flight%time = flight%time + step*fraction
  end subroutine move

  !> Takes over bounds that a motion with the same tape, rates and guards has left, if it had the same parameters and branches.
  pure subroutine take_bounds(flight, bounds)
    type(flight_t), intent(inout) :: flight
    type(bounds_t), intent(in) :: bounds
    if (.not. bounds%are_known) return
    if (size(bounds%rest) /= size(flight%rates)) return
    if (any(abs(bounds%parameters - flight%parameters) > 0)) return
    if (any(bounds%branches /= flight%series%branches)) return
    flight%around%bounds = bounds
  end subroutine take_bounds

  !> The bounds that a motion has left.
  pure subroutine keep_bounds(flight, bounds)
    type(flight_t), intent(in) :: flight
    type(bounds_t), intent(inout) :: bounds
    if (flight%around%bounds%are_known) bounds = flight%around%bounds
  end subroutine keep_bounds

end module series_flight
