! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a motion has settled on a cycle: its section points come back after some drive periods, each nearer than before, down
!> to rounding. That a point comes back to within some per cent proves nothing: chaos does, and so does a slow transient after
!> other periods than that of the cycle it ends on.
module settling
  use attractors, only: features_t, most_coordinates, regime_impact, regime_non_impact
  use circle, only: point_near
  use crank_summary, only: crank_summary_t
  use crank_turns, only: summarize_turns
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use motion_features, only: cycle_word, features_over
  use motion_state, only: tally_t
  implicit none
  private

  public :: settle, mark_of, same_mark, with_crank

  !> Distance of a section point from that one cycle before, in sizes of the motion: below the first the motion has settled, above
  !> the second it is nowhere near a cycle.
  real(wp), parameter :: at_rounding = 1e-10_wp, near = 0.02_wp
  !> Below this distance a period may be a multiple of that of the cycle: which, will show.
  real(wp), parameter :: undecided = 1e-6_wp
  !> More than any mark without a motor.
  integer, parameter, public :: marks_of_outcome = 64
  !> Returns shrink if they do by this factor within some rounds, far from a cycle within one: those of chaos do now and then.
  real(wp), parameter :: shrinking = 0.99_wp, approaching = 0.9_wp
  integer, parameter :: rounds_to_shrink = 4
  !> Most drive periods that a motion is followed, shrink though its returns may.
  integer, parameter :: most_periods = 65536

  type, public :: settled_t
    !> In drive periods, of a machine without a clock in turns; 0 = not known, as the motion has not settled.
    integer :: period = 0
    !> Time that one cycle takes [s], 0 where none is known.
    real(wp) :: duration = 0
    !> Has not settled, but is near a cycle: a slow transient, no chaos.
    logical :: near_cycle = .false.
    !> Where the search ended, on the section: on the cycle if the motion has settled, a whole number of cycles from the start.
    type(section_state_t) :: state
    !> Of one cycle, or of the last periods of a motion that has not settled; without the largest velocity.
    type(features_t) :: features
    !> See `mark_of`.
    integer :: mark = 0
    !> Of a motor, over the cycle, or the turns after a motion that has not settled.
    type(crank_summary_t) :: crank
    !> Not 0 if the motion had to be given up, see module `status`.
    integer :: reason = 0
  end type settled_t

contains

  !> Follows a motion from `start`, on the section, until it has settled on a cycle of at most `longest` drive periods, or its
  !> returns no longer shrink and `patience` drive periods are over. Without a clock it may settle on an equilibrium, or on a cycle
  !> with at most `longest` turns.
  pure subroutine settle(moving, start, longest, patience, settled)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: start
    integer, intent(in) :: longest, patience
    type(settled_t), intent(out) :: settled
    class(machine_t), allocatable :: turning
    type(settled_t) :: turned
    call settle_on_section(moving, start, longest, patience, settled)
    if (settled%period > 0 .or. settled%reason /= 0 .or. moving%has_clock) return
    allocate (turning, source=moving)
    turning%by_event = .true.
    call settle_on_section(turning, start, longest, patience, turned)
    if (turned%reason == 0) settled = turned
  end subroutine settle

  !> The same with the section as it is.
  pure subroutine settle_on_section(moving, start, longest, patience, settled)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: start
    integer, intent(in) :: longest, patience
    type(settled_t), intent(out) :: settled
    real(wp) :: points(most_coordinates, 2*longest), misses(longest), before(longest), miss, least
    type(tally_t) :: tally
    integer :: periods, rounds_left
    settled%state = start
    least = huge(least)
    before = huge(least)
    rounds_left = rounds_to_shrink
    periods = 0
    do while (periods < most_periods)
      call run_round(moving, points, tally, settled)
      if (settled%reason /= 0) return
      periods = periods + size(points, 2)
      misses = misses_of(moving, points, (tally%x_max - tally%x_min)/2)
      settled%period = period_of(misses, before)
      if (settled%period > 0) exit
      before = misses
      miss = minval(misses)
      rounds_left = rounds_left - 1
      settled%near_cycle = miss <= near
      if (miss <= merge(shrinking, approaching, settled%near_cycle)*least) then
        rounds_left = rounds_to_shrink
      else if (.not. settled%near_cycle) then
        rounds_left = 0
      end if
      least = min(least, miss)
      if (rounds_left <= 0 .and. periods >= patience) exit
    end do
    if (settled%period > 0) then
      call run_periods(moving, settled%period - modulo(periods, settled%period), tally, settled)
      if (settled%reason == 0) call run_periods(moving, settled%period, tally, settled)
      if (settled%reason /= 0) settled%period = 0
      if (moving%by_event) then
        settled%features = features_over(moving, tally, settled%duration/moving%period)
      else
        settled%features = features_over(moving, tally, real(max(1, settled%period), wp))
      end if
      settled%features%word = 0
      if (settled%period > 0) settled%features%word = cycle_word(moving, settled%state, settled%period)
    else
      settled%features = features_over(moving, tally, real(size(points, 2), wp))
      settled%features%word = 0
    end if
    if (.not. moving%timed) then
      call summarize_turns(moving, settled%state, merge(settled%period, longest, settled%period > 0), &
                           merge(settled%duration, longest*moving%period, settled%period > 0), settled%crank)
    end if
    settled%mark = with_crank(mark_of(moving, settled%features), settled%crank)
  end subroutine settle_on_section

  !> The mark of a machine with a motor: beside the other one the outcome of a run-up.
  pure integer function with_crank(mark, crank) result(both)
    integer, intent(in) :: mark
    type(crank_summary_t), intent(in) :: crank
    both = mark + marks_of_outcome*crank%outcome
  end function with_crank

  !> Whether two marks are the same as far as they are known.
  pure logical function same_mark(one, other) result(same)
    integer, intent(in) :: one, other
    same = modulo(one, marks_of_outcome) == modulo(other, marks_of_outcome)
    if (min(one, other) >= marks_of_outcome) same = one == other
  end function same_mark

  !> The mark by which limits are found: the regime of bodies that may ride along, else whether there are impacts.
  pure integer function mark_of(moving, features) result(mark)
    class(machine_t), intent(in) :: moving
    type(features_t), intent(in) :: features
    mark = merge(regime_impact, regime_non_impact, features%impacts_per_period > 0)
    if (moving%has_driver) mark = features%regime
  end function mark_of

  !> Drive periods whose section points are all kept.
  pure subroutine run_round(moving, points, tally, settled)
    class(machine_t), intent(in) :: moving
    real(wp), intent(out) :: points(:, :)
    type(tally_t), intent(out) :: tally
    type(settled_t), intent(inout) :: settled
    integer :: i
    call moving%begin_tally(settled%state, tally)
    do i = 1, size(points, 2)
      call moving%advance_to_section(settled%state, tally, settled%reason)
      if (settled%reason /= 0) return
      points(:, i) = moving%point_of(settled%state)
    end do
  end subroutine run_round

  pure subroutine run_periods(moving, periods, tally, settled)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: periods
    type(tally_t), intent(out) :: tally
    type(settled_t), intent(inout) :: settled
    integer :: i
    call moving%begin_tally(settled%state, tally)
    settled%duration = 0
    do i = 1, periods
      call moving%advance_to_section(settled%state, tally, settled%reason)
      if (settled%reason /= 0) return
      settled%duration = settled%duration + settled%state%lasted
    end do
  end subroutine run_periods

  !> How far the last section points, of twice the longest period, are from coming back after 1, 2, ... drive periods, in
  !> sizes of the motion. `half_range` [m] is that of the position.
  pure function misses_of(moving, points, half_range) result(misses)
    class(machine_t), intent(in) :: moving
    real(wp), intent(in) :: points(:, :), half_range
    real(wp) :: misses(size(points, 2)/2), sizes(most_coordinates)
    integer :: p, i, n, last
    n = moving%coordinates()
    sizes = moving%scales(half_range) + tiny(1.0_wp)
    last = size(points, 2)
    misses = 0
    do p = 1, last/2
      do i = min(last/2, last - 2*p + 1), last - p
        associate (later => point_near(points(:n, i + p), points(:n, i), moving%turn_on_section()))
          misses(p) = max(misses(p), norm2((later - points(:n, i))/sizes(:n)))
        end associate
      end do
    end do
  end function misses_of

  !> The smallest period with which a motion comes back to within rounding; 0 if there is none, or if it may turn out to be
  !> a multiple of one that is about to: a transient that turns round the cycle comes back earlier after some turns.
  pure integer function period_of(misses, before) result(period)
    real(wp), intent(in) :: misses(:), before(:)
    integer :: p, q
    period = 0
    do p = 1, size(misses)
      if (misses(p) > at_rounding) cycle
      do q = 1, p/2
        if (modulo(p, q) == 0 .and. misses(q) <= undecided .and. misses(q) <= shrinking*before(q)) return
      end do
      period = p
      return
    end do
  end function period_of

end module settling
