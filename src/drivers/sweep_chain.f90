! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The two chains of a sweep, run up and run down, each by one rank, and the limits between which impacts occur, or a regime
!> of two bodies.
module sweep_chain
  use crank_summary, only: crank_numbers, crank_values
  use errors, only: error_t
  use event_words, only: word_text
  use grid, only: grid_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use limit_kind, only: find_kind, kind_doubling, kind_not_known, kind_stick
  use machine_type, only: section_state_t
  use motor_choices, only: has_motor
  use status, only: reason_time_over
  use stop_check, only: check_stop
  use settling, only: marks_of_outcome, same_mark, settled_t
  use sweep, only: derive_held, hold_parameter, hold_t
  use sweep_limits, only: branch_end, limit_bracketed, limit_not_known, observe_limit
  use team, only: team_t
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: new_chains, run_chains

  !> Numbers kept of a hold before its samples: regime, reason, period, word, outcome of a crank, impacts per period, mean
  !> impact speed, amplitude, x_max, x_min, v_max, rotation, cycle time, and those of a crank; the first five are codes, 0 where
  !> a direction was not run, the rest is not a number there.
  integer, parameter :: hold_numbers = 13 + crank_numbers, hold_codes = 5
  integer, parameter, public :: hold_reason = 2, hold_outcome = 5, hold_impacts = 6, hold_cycle_time = 13, hold_crank = 14, &
    hold_derived = 14 + crank_numbers
  !> Numbers kept of each limit.
  integer, parameter :: limit_numbers = 11

  type, public :: limit_t
    !> Marks of the holds (see `hold_t`) before and behind it, and whether the parameter goes up.
    integer :: from = 0, to = 0
    logical :: up = .true.
    !> Values between which the change was seen in steps.
    real(wp) :: observed(2) = 0
    !> Values between which the settled motion comes to its end, if the outcome is `limit_bracketed`; else not numbers.
    real(wp) :: bracket(2) = 0
    integer :: outcome = limit_not_known
    !> Of a motor: what ends the cycle, at which value (not a number: not known), and the mean speed of the crank before and after
    !> the change in steps [rad/s].
    integer :: kind = kind_not_known
    real(wp) :: at = 0, speed(2) = 0
  end type limit_t

  !> Up (1) and down (2): numbers of each hold, and its section samples.
  type, public :: chains_t
    logical :: ran(2) = .false.
    real(wp), allocatable :: holds(:, :, :)
    real(wp), allocatable :: samples(:, :, :, :)
    type(limit_t), allocatable :: limits(:)
  end type chains_t

contains

  !> Runs the chains that `ran` asks for over `values` of the parameter `path`, from the grid's own start, and sends them to every
  !> rank. Cycles of at most `longest` drive periods are looked for.
  subroutine run_chains(team, journal, time_limit, grid, span, path, values, ran, samples, longest, tolerance, chains, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    real(wp), intent(in) :: time_limit
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(:), tolerance
    logical, intent(in) :: ran(2)
    integer, intent(in) :: samples, longest
    type(chains_t), intent(out) :: chains
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: mine(:), all_values(:), packed(:)
    logical :: here(2)
    integer :: direction, done
    chains = new_chains(size(values), samples, size(grid%derived))
    chains%ran = ran
    allocate (mine(0))
    here = ran .and. modulo([0, 1], team%size()) == team%rank()
    ! Both directions are one task: its progress never goes back.
    call journal%begin('values', count(here)*size(values, kind=int64), 0_int64)
    done = 0
    do direction = 1, 2
      if (.not. here(direction)) cycle
      call run_chain(journal, done, time_limit, grid, span, path, values, direction == 1, samples, longest, tolerance, packed, &
                     error)
      if (allocated(error)) exit
      done = done + size(values)
      mine = [mine, real(direction, wp), packed]
    end do
    call team%agree(error)
    if (allocated(error)) return
    call team%allgather(mine, all_values)
    call unpack_chains(all_values, samples, size(values), chains)
  end subroutine run_chains

  !> Chains over so many values, with so many samples and derived quantities of each, that were not run.
  pure function new_chains(values, samples, derived) result(chains)
    integer, intent(in) :: values, samples, derived
    type(chains_t) :: chains
    allocate (chains%holds(hold_numbers + derived, values, 2), chains%samples(2, samples, values, 2), &
              source=ieee_value(1.0_wp, ieee_quiet_nan))
    chains%holds(:hold_codes, :, :) = 0
    allocate (chains%limits(0))
  end function new_chains

  !> One chain as plain numbers: holds, samples, number of limits, and of each marks before and behind, the bracket in
  !> steps, that of the settled motion, its outcome, its kind and value, speeds. `done` values were run before.
  subroutine run_chain(journal, done, time_limit, grid, span, path, values, up, samples, longest, tolerance, packed, error)
    type(journal_t), intent(inout) :: journal
    integer, intent(in) :: done
    real(wp), intent(in) :: time_limit
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(:), tolerance
    logical, intent(in) :: up
    integer, intent(in) :: samples, longest
    real(wp), allocatable, intent(out) :: packed(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: holds(hold_numbers + size(grid%derived), size(values)), points(2, samples, size(values)), speed
    real(wp) :: limits(limit_numbers, size(values)), visited(size(values))
    type(hold_t) :: held
    type(settled_t) :: settled(size(values))
    type(section_state_t), allocatable :: state
    integer :: i, k, found, before, mark
    logical :: changed
    found = 0
    before = 0
    mark = 0
    visited = merge(values, values(size(values):1:-1), up)
    do i = 1, size(values)
      k = merge(i, size(values) + 1 - i, up)
      ! The first hold has no state to go on from.
      call hold_parameter(grid, span, path, visited(i), samples, longest, held, error, state)
      if (allocated(error)) return
      settled(i) = held%settled
      holds(:hold_numbers, k) = numbers_of(held)
      call derive_held(grid, span, path, visited(i), held, holds(hold_numbers + 1:, k))
      points(:, :, k) = held%samples
      ! A hold that had to be given up leaves the body where the last good one ended.
      if (held%reason == reason_time_over) then
        if (before > 0 .and. .not. same_mark(held%mark, mark)) then
          found = found + 1
          call find_limit(grid, span, path, visited, i, settled(:before), state, [mark, held%mark], longest, tolerance, &
                          limits(:, found), error)
          if (allocated(error)) return
          limits(limit_numbers - 1:, found) = [speed, held%crank%speed]
        else if (before > 0 .and. has_motor(grid%laws)) then
          call find_change(grid, path, visited([before, i]), settled([before, i]), mark, limits(:, found + 1), changed)
          if (changed) then
            found = found + 1
            limits(limit_numbers - 1:, found) = [speed, held%crank%speed]
          end if
        end if
        ! An outcome that is not known is none that has changed.
        if (held%mark >= marks_of_outcome .or. before == 0 .or. mark < marks_of_outcome) mark = held%mark
        before = i
        state = held%state
        speed = held%crank%speed
      end if
      call journal%progress(int(done + i, int64))
      call check_stop(journal, time_limit, 'running '//trim(path)//trim(merge(' up  ', ' down', up)), error)
      if (allocated(error)) return
    end do
    packed = packed_chain(holds, points, limits(:, :found))
  end subroutine run_chain

  pure function packed_chain(holds, points, limits) result(packed)
    real(wp), intent(in) :: holds(:, :), points(:, :, :), limits(:, :)
    real(wp), allocatable :: packed(:)
    packed = [reshape(holds, [size(holds)]), reshape(points, [size(points)]), real(size(limits, 2), wp), &
              reshape(limits, [size(limits)])]
  end function packed_chain

  !> A limit before number `beyond` of the values that are `visited`, the motion having settled as `settled` at those before that
  !> were not given up, and being in a `state` then; `marks` before and behind it. Numbers as in `run_chain`, without speeds.
  subroutine find_limit(grid, span, path, visited, beyond, settled, state, marks, longest, tolerance, numbers, error)
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: visited(:), tolerance
    type(settled_t), intent(in) :: settled(:)
    type(section_state_t), intent(in) :: state
    integer, intent(in) :: beyond, marks(2), longest
    real(wp), intent(out) :: numbers(:)
    type(error_t), allocatable, intent(out) :: error
    type(settled_t) :: last
    real(wp) :: observed(2), bracket(2), near, at
    integer :: next, outcome, kind
    numbers = 0
    next = marks(2)
    call observe_limit(grid, span, path, visited(size(settled)), visited(beyond), state, marks(1), tolerance, next, observed, error)
    if (allocated(error)) return
    call branch_end(grid, path, visited, settled, state, marks(1), longest, tolerance, bracket, outcome, error, last, near)
    if (allocated(error)) return
    kind = kind_not_known
    at = ieee_value(1.0_wp, ieee_quiet_nan)
    if (has_motor(grid%laws)) then
      if (outcome == limit_bracketed) then
        call find_kind(grid, path, last, near, bracket, kind, at)
      else
        call find_kind(grid, path, last, near, [min(near, observed(1)), max(near, observed(2))], kind, at)
      end if
    end if
    numbers(:limit_numbers - 2) = [real([marks(1), next], wp), observed, bracket, real([outcome, kind], wp), at]
  end subroutine find_limit

  !> A limit between two values at which the motion has the same `mark`: it settles at one of them only, or its period doubled or
  !> halved, or it began or ceased to stick. The simpler of the two cycles is followed to its bifurcation. `known`: it was found.
  subroutine find_change(grid, path, values, settled, mark, numbers, known)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(2)
    type(settled_t), intent(in) :: settled(2)
    integer, intent(in) :: mark
    real(wp), intent(out) :: numbers(:)
    logical, intent(out) :: known
    real(wp) :: none, at
    integer :: kind, simple
    logical :: doubles, sticks, settles
    known = .false.
    numbers = 0
    if (all(settled%period == 0)) return
    settles = all(settled%period > 0)
    sticks = settles .and. (has_stick(settled(1)) .neqv. has_stick(settled(2)))
    doubles = settles .and. maxval(settled%period) == 2*minval(settled%period)
    if (settles .and. .not. (doubles .or. sticks)) return
    simple = minloc(settled%period, 1, mask=settled%period > 0)
    if (sticks .and. .not. doubles) simple = merge(2, 1, has_stick(settled(1)))
    call find_kind(grid, path, settled(simple), values(simple), [minval(values), maxval(values)], kind, at)
    known = kind /= kind_not_known
    if (settles) known = (doubles .and. kind == kind_doubling) .or. (sticks .and. kind == kind_stick)
    none = ieee_value(1.0_wp, ieee_quiet_nan)
    numbers(:limit_numbers - 2) = [real([mark, mark], wp), minval(values), maxval(values), none, none, &
                                   real([limit_not_known, kind], wp), at]
  end subroutine find_change

  pure logical function has_stick(settled)
    type(settled_t), intent(in) :: settled
    has_stick = index(word_text(settled%features%word), 'S') > 0
  end function has_stick

  pure function numbers_of(held) result(numbers)
    type(hold_t), intent(in) :: held
    real(wp) :: numbers(hold_numbers)
    associate (f => held%features)
      numbers = [real(f%regime, wp), real(held%reason, wp), real(held%settled%period, wp), real(f%word, wp), &
                 real(held%crank%outcome, wp), f%impacts_per_period, f%mean_impact_speed, f%amplitude, f%x_max, f%x_min, &
                 f%v_max, f%rotation, held%settled%duration, crank_values(held%crank)]
    end associate
  end function numbers_of

  pure subroutine unpack_chains(all_values, samples, values, chains)
    real(wp), intent(in) :: all_values(:)
    integer, intent(in) :: samples, values
    type(chains_t), intent(inout) :: chains
    integer :: position, direction, i, count, numbers_of_hold
    numbers_of_hold = size(chains%holds, 1)
    position = 1
    do while (position <= size(all_values))
      direction = nint(all_values(position))
      position = position + 1
      chains%holds(:, :, direction) = reshape(all_values(position:position + numbers_of_hold*values - 1), &
                                              [numbers_of_hold, values])
      position = position + numbers_of_hold*values
      chains%samples(:, :, :, direction) = reshape(all_values(position:position + 2*samples*values - 1), &
                                                   [2, samples, values])
      position = position + 2*samples*values
      count = nint(all_values(position))
      do i = 1, count
        associate (numbers => all_values(position + limit_numbers*(i - 1) + 1:position + limit_numbers*i))
          chains%limits = [chains%limits, limit_t(nint(numbers(1)), nint(numbers(2)), direction == 1, numbers(3:4), numbers(5:6), &
                                                  nint(numbers(7)), nint(numbers(8)), numbers(9), numbers(10:11))]
        end associate
      end do
      position = position + limit_numbers*count + 1
    end do
  end subroutine unpack_chains

end module sweep_chain
