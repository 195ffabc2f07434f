! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Boxes that contain a motion over a step, and bounds of its next Taylor coefficients in them.
!>
!> With B the range of the Taylor polynomials widened by a margin, and M bounds over B of the next coefficients, |M h^(p+1)| less
!> than the margin proves that the solution stays in B and that the remainder is no larger (Nedialkov, Jackson & Pryce 2001).
!> Bounds cost more than a step. So they are sought for a box around several steps, and serve as long as the motion stays in it;
!> where they are too coarse, those of the step's own box decide.
module enclosures
  use bernstein, only: bernstein_of
  use intervals, only: hull, interval_t
  use kinds, only: wp
  use tape, only: tape_t
  use tape_bounds, only: bound_coefficients
  use tape_series, only: prepare_series, series_t
  implicit none
  private

  public :: prepare_enclosure, forget_bounds, restart_enclosure, enclose

  !> The last term of a step is then some epsilon of the first.
  integer, parameter, public :: series_order = merge(20, 36, epsilon(1.0_wp) > 1e-20_wp)
  !> Terms up to this order count with their signs where the range of a polynomial is sought.
  integer, parameter :: hull_order = 10
  !> Margins of enclosures, as parts of the state.
  real(wp), parameter, public :: widest_margin = epsilon(1.0_wp)**0.6_wp, least_margin = 16*epsilon(1.0_wp)
  !> Bounds over a box around several steps serve if the remainder is less than this part of its margin.
  real(wp), parameter :: most_excess = 0.25_wp
  !> Such a box is wider than the step's own by so many of its widths, on each side: more of them as long as bounds serve.
  real(wp), parameter :: least_widening = 4, most_widening = 64
  !> Otherwise the box may be that of a longer step, of at most so many: by one more where the remainder is less than this part of
  !> its margin.
  integer, parameter :: most_ahead = 4
  real(wp), parameter :: little_excess = 1e-4_wp
  !> Most steps until a wider box is tried again.
  integer, parameter :: longest_wait = 64

  !> Bounds over a box.
  type, public :: bounds_t
    logical :: are_known = .false.
    type(interval_t), allocatable :: box(:)
    real(wp), allocatable :: parameters(:)
    integer, allocatable :: branches(:)
    !> The coefficients are in this unit of time.
    real(wp) :: unit = 1
    !> Of each node: magnitude of its value and of the coefficient after the last one of a step; the latter of each state.
    real(wp), allocatable :: first(:), last(:), rest(:)
    !> Steps until a wider box is tried again, and how many it will be then.
    integer :: wait = 0, next_wait = 1
    real(wp) :: widening = 16
    !> Steps that the box is for where it is not wider.
    integer :: ahead = 1
  end type bounds_t

  type, public :: enclosure_t
    type(series_t) :: series
    type(bounds_t) :: bounds
    !> Whether other nodes depend on the value of a state.
    logical, allocatable :: matters(:)
    !> Margin as a part of the state; it is less where it would reach beyond the end of a domain.
    real(wp) :: margin = widest_margin
    !> Of the last enclosure: largest remainder over its margin, proven if it is less than 1; the node that is not defined; whether
    !> it was the step's own.
    real(wp) :: excess = 0
    integer :: fault = 0
    logical :: is_own = .true.
  end type enclosure_t

contains

  !> Makes room for the bounds of a system, see `prepare_series`; those of another one are forgotten.
  pure subroutine prepare_enclosure(tape, rates, wanted, branches, around)
    type(tape_t), intent(in) :: tape
    integer, intent(in) :: rates(:), wanted(:), branches(:)
    type(enclosure_t), intent(inout) :: around
    logical :: is_argument(0:tape%count)
    integer :: i
    call prepare_series(tape, series_order + 1, rates, wanted, branches, around%series, only_used=.true.)
    around%bounds%are_known = .false.
    around%bounds%branches = branches
    is_argument = .false.
    is_argument(wanted) = .true.
    is_argument(tape%switches%argument) = .true.
    associate (program => around%series%program)
      do i = 1, size(program)
        is_argument([program(i)%a, program(i)%b, program(i)%partner]) = .true.
      end do
      around%matters = [(.false., i=1, size(rates))]
      do i = 1, size(program)
        if (program(i)%variable > 0) around%matters(program(i)%variable) = is_argument(program(i)%node)
      end do
    end associate
  end subroutine prepare_enclosure

  !> Forgets the bounds, as `prepare_enclosure` does.
  pure subroutine forget_bounds(around)
    type(enclosure_t), intent(inout) :: around
    around%bounds%are_known = .false.
    around%bounds%branches = around%series%branches
  end subroutine forget_bounds

  !> As at first, with no bounds.
  pure subroutine restart_enclosure(around)
    type(enclosure_t), intent(inout) :: around
    type(enclosure_t) :: first
    call forget_bounds(around)
    around%margin = first%margin
    around%excess = first%excess
    around%fault = first%fault
    around%is_own = first%is_own
    around%bounds%wait = first%bounds%wait
    around%bounds%next_wait = first%bounds%next_wait
    around%bounds%widening = first%bounds%widening
    around%bounds%ahead = first%bounds%ahead
  end subroutine restart_enclosure

  !> Encloses a step: by the bounds there are, unless they are sought `anew`, or by new ones. `path`: the polynomials of the states
  !> in the fraction of the step.
  pure subroutine enclose(tape, parameters, path, step, anew, around)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:), path(0:, :), step
    logical, intent(in) :: anew
    type(enclosure_t), intent(inout) :: around
    type(interval_t) :: own(size(path, 2))
    real(wp) :: margin(size(path, 2))
    around%is_own = .false.
    around%fault = 0
    around%excess = huge(1.0_wp)
    if (around%bounds%are_known .and. .not. anew) then
      call range_by_sizes(path, around%margin, own, margin)
      call try_known(own, margin, step, around)
      if (around%excess <= most_excess) return
    end if
    call range_of_path(path, around%margin, own, margin)
    if (.not. anew) then
      if (around%bounds%are_known) call try_known(own, margin, step, around)
      if (around%excess > most_excess) call try_wider(tape, parameters, own, margin, step, around)
      if (around%excess > most_excess) call try_ahead(tape, parameters, path, own, margin, step, around)
      if (around%excess <= most_excess) return
    end if
    around%is_own = .true.
    call seek_bounds(tape, parameters, own, margin, step, around)
    if (around%excess <= little_excess) around%bounds%ahead = max(2, around%bounds%ahead)
  end subroutine enclose

  !> The bounds there are, if they hold in a box.
  pure subroutine try_known(own, margin, step, around)
    type(interval_t), intent(in) :: own(:)
    real(wp), intent(in) :: margin(:), step
    type(enclosure_t), intent(inout) :: around
    associate (box => around%bounds%box)
      if (all(.not. around%matters .or. (own%low >= box%low .and. own%high <= box%high))) then
        around%excess = excess_of(around, margin, step)
      end if
    end associate
  end subroutine try_known

  !> Bounds over a box wider than a step's own.
  pure subroutine try_wider(tape, parameters, own, margin, step, around)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:), margin(:), step
    type(interval_t), intent(in) :: own(:)
    type(enclosure_t), intent(inout) :: around
    around%bounds%wait = around%bounds%wait - 1
    if (around%bounds%wait > 0) return
    call seek_bounds(tape, parameters, widened(own, around%bounds%widening), margin, step, around)
    associate (bounds => around%bounds)
      if (around%excess <= most_excess) then
        bounds%next_wait = 1
        bounds%widening = min(most_widening, 2*bounds%widening)
      else
        bounds%widening = max(least_widening, bounds%widening/4)
        bounds%wait = bounds%next_wait
        bounds%next_wait = min(longest_wait, 2*bounds%next_wait)
      end if
    end associate
  end subroutine try_wider

  !> Bounds over the box of a longer step, where these proved shorter ones.
  pure subroutine try_ahead(tape, parameters, path, own, margin, step, around)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:), path(0:, :), margin(:), step
    type(interval_t), intent(in) :: own(:)
    type(enclosure_t), intent(inout) :: around
    type(interval_t) :: further(size(own))
    real(wp) :: longer(0:ubound(path, 1), size(own)), widths(size(own)), power
    integer :: k
    if (around%bounds%ahead <= 1) return
    power = 1
    do k = 0, ubound(path, 1)
      longer(k, :) = path(k, :)*power
      power = power*around%bounds%ahead
    end do
    call range_of_path(longer, around%margin, further, widths)
    call seek_bounds(tape, parameters, hull(own, further), margin, step, around)
    associate (bounds => around%bounds)
      if (around%excess > most_excess) then
        bounds%ahead = bounds%ahead - 1
      else if (around%excess <= little_excess) then
        bounds%ahead = min(most_ahead, bounds%ahead + 1)
      end if
    end associate
  end subroutine try_ahead

  !> Bounds over a box, and what they make of a step.
  pure subroutine seek_bounds(tape, parameters, box, margin, step, around)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:), margin(:), step
    type(interval_t), intent(in) :: box(:)
    type(enclosure_t), intent(inout) :: around
    around%excess = huge(1.0_wp)
    call find_bounds(tape, parameters, box, step, around)
    if (around%fault == 0) around%excess = excess_of(around, margin, step)
  end subroutine seek_bounds

  pure elemental type(interval_t) function widened(own, widening)
    type(interval_t), intent(in) :: own
    real(wp), intent(in) :: widening
    real(wp) :: more
    more = widening*(own%high - own%low)
    widened = interval_t(own%low - more, own%high + more)
  end function widened

  !> Ranges of the states by the magnitudes of their terms, with margins.
  pure subroutine range_by_sizes(path, share, box, margin)
    real(wp), intent(in) :: path(0:, :), share
    type(interval_t), intent(out) :: box(:)
    real(wp), intent(out) :: margin(:)
    real(wp) :: reach
    integer :: i
    do i = 1, size(box)
      reach = sum(abs(path(1:, i)))
      margin(i) = share*(abs(path(0, i)) + reach)
      box(i) = interval_t(path(0, i) - reach - 2*margin(i), path(0, i) + reach + 2*margin(i))
    end do
  end subroutine range_by_sizes

  !> Closer ranges: where a polynomial rises or falls throughout, of its ends, otherwise by its hull. Of terms
  !> of high orders the magnitudes serve.
  pure subroutine range_of_path(path, share, box, margin)
    real(wp), intent(in) :: path(0:, :), share
    type(interval_t), intent(out) :: box(:)
    real(wp), intent(out) :: margin(:)
    real(wp) :: b(0:hull_order), total, rest
    integer :: i, k
    real(wp), parameter :: least = 1e-70_wp
    do i = 1, size(box)
      total = 0
      do k = 2, ubound(path, 1)
        total = total + k*abs(path(k, i))
      end do
      if (abs(path(1, i)) >= total) then
        total = sum(path(:, i))
        box(i) = interval_t(min(path(0, i), total), max(path(0, i), total))
      else
        b = bernstein_of(path(:hull_order, i))
        rest = sum(abs(path(hull_order + 1:, i)))
        box(i) = interval_t(minval(b) - rest, maxval(b) + rest)
      end if
      margin(i) = share*max(abs(box(i)%low), abs(box(i)%high)) + least
      box(i) = interval_t(box(i)%low - margin(i), box(i)%high + margin(i))
    end do
  end subroutine range_of_path

  !> Bounds over a box, in a unit of time near the step.
  pure subroutine find_bounds(tape, parameters, box, step, around)
    type(tape_t), intent(in) :: tape
    real(wp), intent(in) :: parameters(:), step
    type(interval_t), intent(in) :: box(:)
    type(enclosure_t), intent(inout) :: around
    associate (bounds => around%bounds, series => around%series)
      series%unit = scale(1.0_wp, exponent(step))
      call bound_coefficients(tape, box, parameters, series, around%fault)
      bounds%are_known = around%fault == 0
      if (.not. bounds%are_known) return
      bounds%box = box
      bounds%parameters = parameters
      bounds%unit = series%unit
      bounds%first = series%c(0, :)
      bounds%last = series%c(series_order + 1, :)
      bounds%rest = series%unit*series%c(series_order, series%rates)/(series_order + 1)
    end associate
  end subroutine find_bounds

  !> The largest remainder over a step as a part of its margin.
  pure real(wp) function excess_of(around, margin, step) result(excess)
    type(enclosure_t), intent(in) :: around
    real(wp), intent(in) :: margin(:), step
    real(wp) :: power
    integer :: i
    ! Not by **: how compilers multiply for it differs.
    power = 1.01_wp
    do i = 0, series_order
      power = power*(step/around%bounds%unit)
    end do
    excess = 0
    do i = 1, size(margin)
      excess = max(excess, around%bounds%rest(i)*power/margin(i))
    end do
    if (.not. excess <= huge(1.0_wp)) excess = huge(1.0_wp)
  end function excess_of

end module enclosures
