! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which starts lead to attractors that are known already: in lanes, many at once, before the others are searched one by one.
module known_starts
  use attractors, only: attractor_t, kind_chaotic, kind_not_known
  use kinds, only: wp
  use lane_types, only: lane_count
  use single_trajectory, only: outcome_t
  use status, only: reason_settled
  use trajectories, only: run_trajectories
  use trajectory_slots, only: ensemble_t
  implicit none
  private

  public :: note_known_starts

  !> Starts that are flown at a time, between two looks at signals; fewer than `fewest` are not worth lanes.
  integer, parameter :: block = 4*lane_count, fewest = 8

contains

  !> Marks in `known` the starts (one column each, as in `run_trajectories`) after number `done` that settle at an attractor of the
  !> `catalogue` within the span, up to one block of lanes from the first that is not known. `looked_at`: the last start of which
  !> that is decided now; `useful` becomes false where lanes decide less than half of a block, as they do near chaos, or there are
  !> no lanes.
  pure subroutine note_known_starts(ensemble, catalogue, starts, done, known, looked_at, useful)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: done
    logical, intent(inout) :: known(:), useful
    integer, intent(out) :: looked_at
    type(outcome_t), allocatable :: outcomes(:)
    integer, allocatable :: open(:)
    integer :: i
    looked_at = size(known)
    useful = useful .and. ensemble%flow%available
    if (.not. useful .or. all(catalogue%kind == kind_chaotic .or. catalogue%kind == kind_not_known)) return
    open = pack([(i, i=done + 1, size(known))], .not. known(done + 1:))
    open = open(:min(size(open), block))
    if (size(open) < fewest) return
    allocate (outcomes(size(open)))
    call run_trajectories(ensemble, catalogue, starts(:, open), outcomes)
    known(open) = outcomes%reason == reason_settled
    looked_at = open(size(open))
    useful = 2*count(known(open)) >= size(open)
  end subroutine note_known_starts

end module known_starts
