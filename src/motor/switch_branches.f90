! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The branches of switching functions with which a motion begins: where a function is zero, its first terms decide.
module switch_branches
  use kinds, only: wp
  use operations, only: op_add, op_select, op_subtract
  use series_flight, only: branches_of, flight_t, flight_wrong_branch, go_on_with, sizes_of_state
  use tape, only: tape_t
  use tape_series, only: expand, prepare_series, series_t
  use tape_value, only: evaluate, sizes_of_nodes, starting_branches
  implicit none
  private

  public :: choose_branches, pass_switches

  !> Events without progress in time after which a motion is given up.
  integer, parameter, public :: most_idle_events = 32
  !> Terms that decide.
  integer, parameter :: low_order = 6

contains

  !> Signs of the switching functions at the variables `z`. `zeros`: order of the zero that a function has there, 0 for none, -1
  !> if it stays zero. `fits` is false if the motion leaves no branch on the side of that branch, or a function that stays zero
  !> has different branches: forces jump where the motion can only slide along the jump. `are_zero` are known to be so.
  pure subroutine choose_branches(flight, z, parameters, branches, zeros, fits, are_zero)
    type(flight_t), intent(in) :: flight
    real(wp), intent(in) :: z(:), parameters(:)
    integer, intent(out) :: branches(:), zeros(:)
    logical, intent(out) :: fits
    logical, intent(in), optional :: are_zero(:)
    type(series_t) :: series
    real(wp) :: value(flight%tape%count), least
    integer :: faults(flight%tape%count), nodes(size(branches)), before(size(branches)), k, try, fault
    fits = .true.
    if (size(branches) == 0) return
    nodes = flight%tape%switches%argument
    call evaluate(flight%tape, z, parameters, value, faults)
    branches = merge(1, -1, value(nodes) >= 0)
    call prepare_series(flight%tape, low_order, flight%rates, nodes, branches, series)
    call expand(flight%tape, z, parameters, series, fault)
    do k = 1, size(branches)
      ! Rounding of its terms, and of the time at which it crossed zero.
      least = size_of(flight%tape, value, nodes(k)) + abs(series%c(1, nodes(k))*z(1))
      zeros(k) = merge(1, 0, abs(value(nodes(k))) <= 16*epsilon(1.0_wp)*least)
    end do
    if (present(are_zero)) zeros = merge(1, 0, are_zero)
    if (all(zeros == 0)) return
    do try = 1, 2*size(branches) + 2
      before = branches
      call prepare_series(flight%tape, low_order, flight%rates, nodes, branches, series)
      call expand(flight%tape, z, parameters, series, fault)
      fits = fault <= 0
      if (fault > 0) return
      do k = 1, size(branches)
        if (zeros(k) /= 0) call leave_zero(series%c(:, nodes(k)), branches(k), zeros(k))
      end do
      fits = all(branches == before)
      if (fits) exit
    end do
    if (fits) fits = .not. jumps(flight%tape, series, zeros)
  end subroutine choose_branches

  !> Goes on with the other branches of forces where their switching functions crossed zero; no branch fits where that happens
  !> again and again at one time.
  pure subroutine pass_switches(flight, last, idle, status)
    type(flight_t), intent(inout) :: flight
    real(wp), intent(inout) :: last
    integer, intent(inout) :: idle, status
    if (.not. any(flight%crossed(size(flight%guards) - size(flight%tape%switches) + 1:))) return
    idle = merge(0, idle + 1, flight%time > last)
    last = flight%time
    call pass_zeros(flight)
    if (idle >= most_idle_events) status = flight_wrong_branch
  end subroutine pass_switches

  !> Goes on with the other branches where functions crossed zero at the end of a step. Others may be zero there, too, as in
  !> if(x < 0, max(-k*x, 0), 0): their signs are rounding, and their first terms decide.
  pure subroutine pass_zeros(flight)
    type(flight_t), intent(inout) :: flight
    real(wp) :: value(flight%tape%count), sizes(flight%tape%count)
    integer, dimension(size(flight%tape%switches)) :: nodes, branches, zeros
    logical, dimension(size(flight%tape%switches)) :: crossed, are_zero
    integer :: faults(flight%tape%count), own
    logical :: fits
    nodes = flight%tape%switches%argument
    own = size(flight%guards) - size(nodes)
    crossed = flight%crossed(own + 1:)
    call evaluate(flight%tape, flight%state, flight%parameters, value, faults)
    sizes = sizes_of_nodes(flight%tape, value, sizes_of_state(flight))
    are_zero = crossed .or. (abs(value(nodes)) <= 16*epsilon(1.0_wp)*sizes(nodes) .and. faults(nodes) == 0)
    fits = any(are_zero .and. .not. crossed)
    if (fits) call choose_branches(flight, flight%state, flight%parameters, branches, zeros, fits, are_zero)
    if (.not. fits) then
      zeros = flight%zeros(own + 1:)
      call change_branches(flight, crossed, branches)
    end if
    call go_on_with(flight, branches, zeros)
  end subroutine pass_zeros

  !> The other branch of the functions that crossed zero at the end of a step, and those that their sign there gives of functions
  !> that were in no branch before.
  pure subroutine change_branches(flight, crossed, branches)
    type(flight_t), intent(in) :: flight
    logical, intent(in) :: crossed(:)
    integer, intent(out) :: branches(:)
    integer :: before(size(branches))
    before = branches_of(flight)
    call starting_branches(flight%tape, flight%state, flight%parameters, branches)
    where (crossed)
      branches = -before
    else where (flight%is_active(size(flight%guards) - size(branches) + 1:) .or. branches == 0)
      branches = before
    end where
  end subroutine change_branches

  !> Branch and order of a function by its first coefficient that is not zero, `c(1)` being that of order 0.
  pure subroutine leave_zero(c, branch, order)
    real(wp), intent(in) :: c(:)
    integer, intent(inout) :: branch
    integer, intent(out) :: order
    do order = 1, size(c) - 1
      if (abs(c(order + 1)) > 0) then
        branch = merge(1, -1, c(order + 1) > 0)
        return
      end if
    end do
    order = -1
  end subroutine leave_zero

  !> Whether a function that stays zero selects between values that differ.
  pure logical function jumps(tape, series, zeros)
    type(tape_t), intent(in) :: tape
    type(series_t), intent(in) :: series
    integer, intent(in) :: zeros(:)
    integer :: i
    jumps = .false.
    do i = 1, tape%count
      associate (node => tape%nodes(i))
        if (node%operation /= op_select .or. .not. series%is_used(i)) cycle
        if (zeros(node%first) >= 0) cycle
        associate (a => series%c(0, node%second), b => series%c(0, node%third))
          jumps = jumps .or. abs(a - b) > 16*epsilon(1.0_wp)*(abs(a) + abs(b))
        end associate
      end associate
    end do
  end function jumps

  !> Magnitude of what a node is a sum of.
  pure real(wp) function size_of(tape, value, node)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: value(:)
    integer, intent(in) :: node
    associate (it => tape%nodes(node))
      size_of = abs(value(node))
      if (it%operation == op_add .or. it%operation == op_subtract) size_of = abs(value(it%first)) + abs(value(it%second))
    end associate
  end function size_of

end module switch_branches
