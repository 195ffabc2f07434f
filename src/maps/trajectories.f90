! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many trajectories of one machine: in lanes where the machine allows, a lane that has come to the end being given the
!> next start. The outcome of a start does not depend on the others.
module trajectories
  use attractors, only: attractor_t
  use errors, only: error_t
  use lane_slots, only: lane_bodies_t, lane_slots_t, advance_batches, batches_at_once, open_lanes
  use kinds, only: wp
  use lane_gpu, only: await_half, gpu_half_t, gpu_threads, open_gpu, send_half
  use lane_types, only: lane_batch_t, lane_count
  use single_trajectory, only: outcome_t, run_trajectory
  use trajectory_slots, only: load_all, service_all, set_regions, ensemble_t, slot_t
  use work_watch, only: watch_t
  use, intrinsic :: iso_fortran_env, only: int64
  implicit none
  private

  public :: run_trajectories, run_on_gpu, batches_for, block_size

  !> Starts that are worth giving to lanes at a time: enough to keep them full.
  integer, parameter, public :: processor_block = 4*lane_count

  !> Starts that a GPU is given at a time, where a tile has so many: its pool is refilled many times.
  integer, parameter :: gpu_block = 2**22

  !> Batches of a GPU that are served between two looks at the watch.
  integer, parameter :: batches_per_look = 256

  !> Batches that are worth a thread.
  integer, parameter :: fewest_batches = 64

  !> What one thread serves: batches of a half and starts, from and to; the number among these of the start that comes next;
  !> whether any of its lanes is to fly.
  type :: part_t
    integer :: batches(2) = [1, 0], starts(2) = [1, 0], next = 1
    logical :: away = .false.
  end type part_t

contains

  !> Outcomes of `starts` (rows x0 [m], v0 [m/s], crank angle [rad], and what `start` of `machine_t` takes; one column each), by
  !> this processor.
  pure subroutine run_trajectories(ensemble, catalogue, starts, outcomes)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    type(outcome_t), intent(out) :: outcomes(:)
    type(slot_t), allocatable :: slots(:, :)
    type(lane_slots_t), allocatable :: lanes(:)
    integer :: i, next
    if (.not. ensemble%flow%available) then
      do i = 1, size(starts, 2)
        call run_trajectory(ensemble%moving, catalogue, ensemble%span, starts(:, i), outcomes(i))
      end do
      return
    end if
    i = merge(batches_at_once(ensemble%flow), 1, size(starts, 2) > lane_count)
    allocate (slots(lane_count, i), lanes(i))
    next = 1
    do i = 1, size(lanes)
      call open_lanes(ensemble%moving, lanes(i))
      call set_regions(ensemble%moving, catalogue, lanes(i))
      call load_all(ensemble, catalogue, starts, next, slots(:, i), lanes(i)%batch, lanes(i)%bodies, outcomes)
    end do
    do while (any(slots%start > 0))
      call advance_batches(ensemble%flow, lanes)
      do i = 1, size(lanes)
        call service_all(ensemble, catalogue, starts, next, slots(:, i), lanes(i)%batch, lanes(i)%bodies, outcomes)
      end do
    end do
  end subroutine run_trajectories

  !> A GPU's lanes: while one half of them flies, the threads serve the other. The watch is looked at whenever a
  !> half has come back and every few of its batches, until all outcomes are known. Code 75 if the GPU fails; then, and where
  !> `whole` is false because the watch requested a stop, there are no outcomes.
  subroutine run_on_gpu(ensemble, catalogue, starts, outcomes, whole, error, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(inout) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(slot_t), allocatable :: slots(:, :, :)
    type(part_t), allocatable :: parts(:)
    type(gpu_half_t) :: halves(2)
    type(lane_slots_t) :: lanes
    integer :: half, batches
    logical :: away(2), stop_now
    stop_now = .false.
    call open_gpu(ensemble%flow%gpu, batches_for(size(starts, 2)), halves, error)
    if (allocated(error)) return
    call open_lanes(ensemble%moving, lanes)
    call set_regions(ensemble%moving, catalogue, lanes)
    batches = size(halves(1)%batches)
    allocate (slots(lane_count, batches, 2))
    call share_out(batches, size(starts, 2), parts)
    do half = 1, 2
      call service_half(ensemble, catalogue, starts, .true., parts, slots(:, :, half), halves(half)%batches, outcomes, &
                       stop_now, watch)
      away(half) = any(parts%away) .and. .not. stop_now
      if (away(half)) call send_half(half, batches, ensemble%flow%machine, lanes%regions, error)
      if (allocated(error)) return
    end do
    half = 1
    do while (any(away))
      if (away(half)) then
        call await_half(half, error)
        if (allocated(error)) return
        ! A half that is away when the run is to stop is awaited all the same: the GPU writes into its batches.
        call service_half(ensemble, catalogue, starts, .false., parts, slots(:, :, half), halves(half)%batches, outcomes, &
                         stop_now, watch)
        away(half) = any(parts%away) .and. .not. stop_now
        if (away(half)) call send_half(half, batches, ensemble%flow%machine, lanes%regions, error)
        if (allocated(error)) return
      end if
      half = 3 - half
    end do
    whole = .not. stop_now
  end subroutine run_on_gpu

  !> Batches of each half of a pool that so many starts fill.
  pure integer function batches_for(starts)
    integer, intent(in) :: starts
    batches_for = max(1, (starts + 2*lane_count - 1)/(2*lane_count))
  end function batches_for

  !> A part of the batches and of the starts for each thread.
  pure subroutine share_out(batches, starts, parts)
    integer, intent(in) :: batches, starts
    type(part_t), allocatable, intent(out) :: parts(:)
    integer :: count, i
    count = max(1, min(gpu_threads, batches/fewest_batches))
    allocate (parts(count))
    do i = 1, count
      parts(i)%batches = 1 + [int((i - 1)*int(batches, int64)/count), int(i*int(batches, int64)/count) - 1]
      parts(i)%starts = 1 + [int((i - 1)*int(starts, int64)/count), int(i*int(starts, int64)/count) - 1]
    end do
  end subroutine share_out

  !> Half of the lanes, on the host: their first starts if they are `fresh`, else what is due after they have flown. The first
  !> thread, which is the caller, looks at the watch.
  subroutine service_half(ensemble, catalogue, starts, fresh, parts, slots, batches, outcomes, stop_now, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    logical, intent(in) :: fresh
    type(part_t), intent(inout) :: parts(:)
    type(slot_t), intent(inout) :: slots(:, :)
    type(lane_batch_t), intent(inout) :: batches(:)
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(inout) :: stop_now
    class(watch_t), intent(inout), optional :: watch
    integer :: i
    !$omp parallel do schedule(static, 1) num_threads(size(parts)) if (size(parts) > 1)
    do i = 1, size(parts)
      call service_part(ensemble, catalogue, starts, fresh, i == 1, parts(i), slots, batches, outcomes, stop_now, watch)
    end do
  end subroutine service_half

  !> What one thread does of that. No thread touches what belongs to another, but `stop_now`.
  subroutine service_part(ensemble, catalogue, starts, fresh, looks, part, slots, batches, outcomes, stop_now, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    logical, intent(in) :: fresh, looks
    type(part_t), intent(inout) :: part
    type(slot_t), intent(inout) :: slots(:, :)
    type(lane_batch_t), intent(inout) :: batches(:)
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(inout) :: stop_now
    class(watch_t), intent(inout), optional :: watch
    type(lane_bodies_t) :: none
    logical :: enough
    integer :: k
    part%away = .false.
    associate (first => part%starts(1), last => part%starts(2))
      do k = part%batches(1), part%batches(2)
        !$omp atomic read
        enough = stop_now
        if (looks .and. present(watch) .and. .not. enough .and. modulo(k, batches_per_look) == merge(0, 1, fresh)) then
          call watch%look(enough)
          !$omp atomic write
          stop_now = enough
        end if
        if (enough) return
        if (fresh) then
          batches(k) = lane_batch_t()
          call load_all(ensemble, catalogue, starts(:, first:last), part%next, slots(:, k), batches(k), none, &
                         outcomes(first:last))
        else
          call service_all(ensemble, catalogue, starts(:, first:last), part%next, slots(:, k), batches(k), none, &
                          outcomes(first:last))
        end if
        part%away = part%away .or. any(slots(:, k)%start > 0)
      end do
    end associate
  end subroutine service_part

  !> Trajectories worth asking for at a time: enough to keep the lanes full, or one by one.
  pure integer function block_size(ensemble)
    type(ensemble_t), intent(in) :: ensemble
    block_size = merge(processor_block, 1, ensemble%flow%available)
    if (ensemble%flow%available .and. ensemble%flow%gpu >= 0) block_size = gpu_block
  end function block_size

end module trajectories
