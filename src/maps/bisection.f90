! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where the label changes on the way from one start to another: intervals are halved, many at a time, each by the forward map and
!> with the labels of the map. Where a third label is met both halves are followed.
module bisection
  use attractors, only: attractor_t
  use kinds, only: wp
  use start_label, only: label_not_known, label_of
  use trajectories, only: run_trajectories
  use trajectory_slots, only: ensemble_t
  use single_trajectory, only: outcome_t
  implicit none
  private

  public :: label_starts, halve_intervals, join_slivers

  !> Intervals that one edge may fall into: beyond, of an interval with a third label in it the upper part is not followed, and the
  !> next interval begins with another label than the one below ends with.
  integer, parameter :: most_intervals = 6
  !> Starts that do not converge in time lie between two basins in a sliver; one narrower than this share of its edge is taken for
  !> the boundary itself.
  real(wp), parameter :: sliver = 1e-3_wp

  !> A piece of an edge on which the label changes: positions 0 to 1 along the edge, and the labels there.
  type, public :: interval_t
    integer :: edge = 0
    real(wp) :: low = 0, high = 1
    integer :: below = 0, above = 0
    !> It is not halved any more.
    logical :: done = .false.
  end type interval_t

contains

  !> Labels of `starts` (columns as `point_start` of module `grid` has them).
  pure subroutine label_starts(ensemble, catalogue, starts, labels)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(out) :: labels(:)
    type(outcome_t), allocatable :: outcomes(:)
    integer :: i
    allocate (outcomes(size(starts, 2)))
    call run_trajectories(ensemble, catalogue, starts, outcomes)
    do i = 1, size(labels)
      labels(i) = label_of(outcomes(i))
    end do
  end subroutine label_starts

  !> Halves every interval once that is wider than `tolerance` (a share, one of each edge); edge e leads from the start
  !> `from(:, e)` to `to(:, e)`. `left` intervals are not done yet.
  pure subroutine halve_intervals(ensemble, catalogue, from, to, tolerance, intervals, left)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: from(:, :), to(:, :), tolerance(:)
    type(interval_t), allocatable, intent(inout) :: intervals(:)
    integer, intent(out) :: left
    integer, allocatable :: open_ones(:), labels(:)
    real(wp), allocatable :: starts(:, :), middle(:)
    type(interval_t), allocatable :: more(:)
    integer :: number(size(from, 2)), i, k, count
    open_ones = pack([(i, i=1, size(intervals))], .not. intervals%done)
    left = size(open_ones)
    if (left == 0) return
    allocate (starts(size(from, 1), left), middle(left), labels(left), more(left))
    do k = 1, left
      associate (one => intervals(open_ones(k)))
        middle(k) = one%low + (one%high - one%low)/2
        starts(:, k) = from(:, one%edge) + middle(k)*(to(:, one%edge) - from(:, one%edge))
      end associate
    end do
    call label_starts(ensemble, catalogue, starts, labels)
    number = 0
    do k = 1, size(intervals)
      number(intervals(k)%edge) = number(intervals(k)%edge) + 1
    end do
    count = 0
    do k = 1, left
      call take_half(intervals(open_ones(k)), middle(k), labels(k), number(intervals(open_ones(k))%edge) < most_intervals, &
                     more(count + 1), i)
      count = count + i
    end do
    do k = 1, left
      associate (one => intervals(open_ones(k)))
        one%done = one%done .or. one%high - one%low <= tolerance(one%edge)
      end associate
    end do
    if (count > 0) then
      do k = 1, count
        more(k)%done = more(k)%high - more(k)%low <= tolerance(more(k)%edge)
      end do
      intervals = [intervals, more(:count)]
    end if
    left = size(intervals) - sum(merge(1, 0, intervals%done))
  end subroutine halve_intervals

  !> The half of an interval in which its label changes. With a third label in the middle it keeps the lower half, and if it
  !> `may_split` the upper is `other`, and `others` is 1.
  pure subroutine take_half(one, middle, label, may_split, other, others)
    type(interval_t), intent(inout) :: one
    real(wp), intent(in) :: middle
    integer, intent(in) :: label
    logical, intent(in) :: may_split
    type(interval_t), intent(inout) :: other
    integer, intent(out) :: others
    others = 0
    if (label == one%above) then
      one%high = middle
    else if (label == one%below) then
      one%low = middle
    else
      if (may_split) then
        others = 1
        other = interval_t(edge=one%edge, low=middle, high=one%high, below=label, above=one%above)
      end if
      one%high = middle
      one%above = label
    end if
  end subroutine take_half

  !> Sorts intervals along their edges, and joins two with a sliver of starts between them that are not known.
  pure subroutine join_slivers(intervals)
    type(interval_t), allocatable, intent(inout) :: intervals(:)
    logical :: kept(size(intervals))
    integer :: i, last
    call sort_intervals(intervals)
    kept = .true.
    last = 1
    do i = 2, size(intervals)
      associate (one => intervals(last), next => intervals(i))
        if (one%edge == next%edge .and. one%above == label_not_known .and. next%low - one%high <= sliver .and. &
            one%below /= label_not_known .and. next%above /= label_not_known) then
          one%high = next%high
          one%above = next%above
          kept(i) = .false.
          if (one%above == one%below) kept(last) = .false.
        end if
      end associate
      if (kept(i)) last = i
    end do
    intervals = pack(intervals, kept)
  end subroutine join_slivers

  !> By edge and position: insertion, for they are nearly in order.
  pure subroutine sort_intervals(intervals)
    type(interval_t), intent(inout) :: intervals(:)
    type(interval_t), allocatable :: sorted(:)
    integer, allocatable :: first(:)
    type(interval_t) :: one
    integer :: i, k
    if (size(intervals) == 0) return
    ! Counted by edge, then in order within each.
    allocate (first(maxval(intervals%edge) + 1), source=0)
    do i = 1, size(intervals)
      first(intervals(i)%edge + 1) = first(intervals(i)%edge + 1) + 1
    end do
    first(1) = 1
    do i = 2, size(first)
      first(i) = first(i) + first(i - 1)
    end do
    allocate (sorted(size(intervals)))
    do i = 1, size(intervals)
      k = first(intervals(i)%edge)
      sorted(k) = intervals(i)
      first(intervals(i)%edge) = k + 1
    end do
    do i = 2, size(sorted)
      one = sorted(i)
      k = i - 1
      do while (k >= 1)
        if (sorted(k)%edge /= one%edge .or. sorted(k)%low <= one%low) exit
        sorted(k + 1) = sorted(k)
        k = k - 1
      end do
      sorted(k + 1) = one
    end do
    intervals = sorted
  end subroutine sort_intervals

end module bisection
