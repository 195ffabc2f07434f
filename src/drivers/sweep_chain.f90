! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The two chains of a sweep, run up and run down, each by one rank, and the limits between which impacts occur.
module sweep_chain
  use attractors, only: features_t
  use errors, only: error_t
  use grid, only: grid_t
  use journal, only: journal_t
  use kinds, only: int64, wp
  use motion_state, only: state_t
  use status, only: reason_time_over
  use stop_check, only: check_stop
  use sweep, only: bracket_limit, hold_parameter, hold_t
  use team, only: team_t
  use trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: run_chains

  !> Numbers kept of a hold before its samples: regime, reason, period, word, impacts per period, mean
  !> impact speed, amplitude, x_max, x_min, v_max; the first four are codes, 0 where a direction was not run, the rest is
  !> not a number there.
  integer, parameter :: hold_numbers = 10, hold_codes = 4
  !> Most changes between impacting and not impacting that are kept of one chain.
  integer, parameter :: most_limits = 64

  type, public :: limit_t
    !> Impacts start (or stop) while the parameter goes up (or down).
    logical :: start = .true., up = .true.
    !> Values between which the change lies.
    real(wp) :: bracket(2) = 0
  end type limit_t

  !> Up (1) and down (2): numbers of each hold, and its section samples.
  type, public :: chains_t
    logical :: ran(2) = .false.
    real(wp), allocatable :: holds(:, :, :)
    real(wp), allocatable :: samples(:, :, :, :)
    type(limit_t), allocatable :: limits(:)
  end type chains_t

contains

  !> Runs the chains that `ran` asks for over `values` of the parameter `path`, from the grid's own start, and tells
  !> every rank.
  subroutine run_chains(team, journal, time_limit, grid, span, path, values, ran, samples, tolerance, chains, error)
    class(team_t), intent(in) :: team
    type(journal_t), intent(inout) :: journal
    real(wp), intent(in) :: time_limit
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(:), tolerance
    logical, intent(in) :: ran(2)
    integer, intent(in) :: samples
    type(chains_t), intent(out) :: chains
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: mine(:), all_values(:), packed(:)
    integer :: direction
    chains%ran = ran
    allocate (chains%holds(hold_numbers, size(values), 2), chains%samples(2, samples, size(values), 2), &
              source=ieee_value(1.0_wp, ieee_quiet_nan))
    chains%holds(:hold_codes, :, :) = 0
    allocate (chains%limits(0), mine(0))
    do direction = 1, 2
      if (.not. ran(direction) .or. modulo(direction - 1, team%size()) /= team%rank()) cycle
      call journal%begin('values', size(values, kind=int64), 0_int64)
      call run_chain(journal, time_limit, grid, span, path, values, direction == 1, samples, tolerance, packed, error)
      if (allocated(error)) exit
      mine = [mine, real(direction, wp), packed]
    end do
    call team%agree(error)
    if (allocated(error)) return
    call team%allgather(mine, all_values)
    call unpack_chains(all_values, samples, size(values), chains)
  end subroutine run_chains

  !> One chain as plain numbers: holds, samples, number of limits, and start, lower, upper of each.
  subroutine run_chain(journal, time_limit, grid, span, path, values, up, samples, tolerance, packed, error)
    type(journal_t), intent(inout) :: journal
    real(wp), intent(in) :: time_limit
    type(grid_t), intent(in) :: grid
    type(span_t), intent(in) :: span
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: values(:), tolerance
    logical, intent(in) :: up
    integer, intent(in) :: samples
    real(wp), allocatable, intent(out) :: packed(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: holds(hold_numbers, size(values)), points(2, samples, size(values)), bracket(2)
    real(wp) :: limits(3, most_limits)
    type(hold_t) :: held
    type(state_t) :: state
    integer :: i, k, found, before
    logical :: impacting, impacted
    state%x = grid%start(1)
    state%v = grid%start(2)
    found = 0
    before = 0
    impacted = .false.
    do i = 1, size(values)
      k = merge(i, size(values) + 1 - i, up)
      call hold_parameter(grid, span, path, values(k), state, merge(grid%start(3), 0.0_wp, i == 1), samples, held, error)
      if (allocated(error)) return
      holds(:, k) = numbers_of(held)
      points(:, :, k) = held%samples
      ! A hold that had to be given up leaves the body where the last good one ended.
      if (held%reason == reason_time_over) then
        impacting = held%features%impacts_per_period > 0
        if (before > 0 .and. (impacting .neqv. impacted) .and. found < most_limits) then
          call bracket_limit(grid, span, path, values(before), values(k), state, impacted, tolerance, bracket, error)
          if (allocated(error)) return
          found = found + 1
          limits(:, found) = [merge(1.0_wp, 0.0_wp, impacting), bracket]
        end if
        impacted = impacting
        before = k
        state = held%state
      end if
      call journal%progress(int(i, int64))
      call check_stop(journal, time_limit, 'running '//trim(path)//' up and down', error)
      if (allocated(error)) return
      ! A hold that had to be given up leaves the body where the last good one ended.
      if (held%reason == 0) state = held%state
    end do
    packed = [reshape(holds, [size(holds)]), reshape(points, [size(points)]), real(found, wp), &
              reshape(limits(:, :found), [3*found])]
  end subroutine run_chain

  pure function numbers_of(held) result(numbers)
    type(hold_t), intent(in) :: held
    real(wp) :: numbers(hold_numbers)
    associate (f => held%features)
      numbers = [real(f%regime, wp), real(held%reason, wp), real(held%period, wp), real(f%word, wp), &
                 f%impacts_per_period, f%mean_impact_speed, f%amplitude, f%x_max, f%x_min, f%v_max]
    end associate
  end function numbers_of

  pure subroutine unpack_chains(all_values, samples, values, chains)
    real(wp), intent(in) :: all_values(:)
    integer, intent(in) :: samples, values
    type(chains_t), intent(inout) :: chains
    integer :: position, direction, i, count
    position = 1
    do while (position <= size(all_values))
      direction = nint(all_values(position))
      position = position + 1
      chains%holds(:, :, direction) = reshape(all_values(position:position + hold_numbers*values - 1), &
                                              [hold_numbers, values])
      position = position + hold_numbers*values
      chains%samples(:, :, :, direction) = reshape(all_values(position:position + 2*samples*values - 1), &
                                                   [2, samples, values])
      position = position + 2*samples*values
      count = nint(all_values(position))
      do i = 1, count
        chains%limits = [chains%limits, limit_t(all_values(position + 3*i - 2) > 0, direction == 1, &
                                                all_values(position + 3*i - 1:position + 3*i))]
      end do
      position = position + 3*count + 1
    end do
  end subroutine unpack_chains

end module sweep_chain
