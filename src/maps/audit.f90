! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What `verify` finds when it runs a sample of a file's points again, and which points these are.
module audit
  use kinds, only: int64, wp
  use random, only: uniform
  use single_trajectory, only: outcome_t
  implicit none
  private

  public :: note_deviation, sampled

  !> What the rerun of the sample showed.
  type, public :: audit_t
    integer :: points = 0, differing = 0, flips = 0, impact_count_differs = 0
    !> Of a refined map: points that were inferred, and those of them that were inferred wrongly.
    integer :: inferred = 0, inferred_differing = 0
    !> Points whose label changes: flips, and what was inferred wrongly.
    integer :: changes = 0
    !> Points of a boundary whose labels are right a little further from them than the file states.
    integer :: wider = 0
    !> Every point was run again.
    logical :: whole = .false.
    !> Points whose impacts and states were compared with those in quadruple precision: settled ones.
    integer :: compared = 0
    real(wp) :: x_deviation = 0, v_deviation = 0
    !> The positions are angles.
    logical :: is_angle = .false.
    character(len=:), allocatable :: first_difference
  end type audit_t

contains

  !> Indices of point `i` of the sample: each point once where the sample is the `whole`, else a random one.
  pure function sampled(shape, whole, seed, i) result(index)
    integer, intent(in) :: shape(:), seed, i
    logical, intent(in) :: whole
    integer :: index(size(shape))
    real(wp) :: random_numbers(size(shape))
    integer :: k, left
    if (.not. whole) then
      call uniform(int(seed, int64), int(i, int64), random_numbers)
      index = 1 + int(random_numbers*shape)
      return
    end if
    left = i - 1
    do k = 1, size(shape)
      index(k) = 1 + modulo(left, shape(k))
      left = left/shape(k)
    end do
  end function sampled

  !> Notes how a point differs from its run in quadruple precision, `results` as `run_reference` gives them.
  pure subroutine note_deviation(outcome, results, audit)
    type(outcome_t), intent(in) :: outcome
    real(wp), intent(in) :: results(6)
    type(audit_t), intent(inout) :: audit
    audit%compared = audit%compared + 1
    if (outcome%impacts /= nint(results(6), int64)) audit%impact_count_differs = audit%impact_count_differs + 1
    audit%x_deviation = max(audit%x_deviation, abs(outcome%x - results(4)))
    audit%v_deviation = max(audit%v_deviation, abs(outcome%v - results(5)))
  end subroutine note_deviation

end module audit
