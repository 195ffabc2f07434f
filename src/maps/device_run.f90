! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Trajectories by the GPU of this process or by its processor. Where neither is asked for, both compute starts for a second each,
!> and the faster one takes those that follow. The outcome of a start depends on neither.
module device_run
  use attractors, only: attractor_t
  use errors, only: error_t
  use kinds, only: int64, wp
  use lane_gpu, only: gpu_half_t, open_gpu
  use lane_types, only: lane_count
  use single_trajectory, only: outcome_t
  use spread_order, only: new_spread_order, spread_order_t
  use system, only: monotonic_seconds
  use trajectories, only: batches_for, processor_block, run_on_gpu, run_trajectories
  use trajectory_slots, only: ensemble_t
  use work_watch, only: watch_t
  implicit none
  private

  public :: run_on_device, begin_trial, end_report

  integer, parameter, public :: on_processor = 1, on_gpu = 2, not_known = 0

  !> Each device is measured for so long [s].
  real(wp), parameter, public :: trial_seconds = 1

  !> With a counted clock a processor computes so many starts in a second.
  real(wp), parameter :: counted_rate = 1000

  !> What the processor and the GPU of this process have done while it was not known which is faster.
  type, public :: trial_t
    !> What computes from here on.
    integer :: taken = on_gpu
    integer(int64) :: starts(2) = 0
    real(wp) :: seconds(2) = 0
    !> For tests: how many times as fast as the processor the GPU is taken to be, by a clock that counts starts; 0 = measured.
    real(wp) :: counted = 0
    !> Something was measured that has not been reported.
    logical :: unreported = .false.
  contains
    procedure :: note
    procedure :: rate
  end type trial_t

  type(trial_t), protected, public :: trial

contains

  !> From here on a process with a GPU uses it, or, if it `measures`, what proves to be faster; `counted` is that of `trial_t`.
  subroutine begin_trial(measures, counted)
    logical, intent(in) :: measures
    real(wp), intent(in), optional :: counted
    trial = trial_t(taken=merge(not_known, on_gpu, measures))
    if (present(counted)) trial%counted = counted
  end subroutine begin_trial

  !> What was measured so far is known to the user.
  subroutine end_report()
    trial%unreported = .false.
  end subroutine end_report

  !> Notes that a device computed so many starts in so many seconds; the faster is taken when both were measured long enough.
  pure subroutine note(self, device, starts, seconds)
    class(trial_t), intent(inout) :: self
    integer, intent(in) :: device, starts
    real(wp), intent(in) :: seconds
    real(wp) :: passed
    passed = seconds
    if (self%counted > 0) passed = starts/(counted_rate*merge(self%counted, 1.0_wp, device == on_gpu))
    self%starts(device) = self%starts(device) + starts
    self%seconds(device) = self%seconds(device) + passed
    self%unreported = .true.
    if (all(self%seconds >= trial_seconds)) self%taken = merge(on_gpu, on_processor, self%rate(on_gpu) > self%rate(on_processor))
  end subroutine note

  !> Starts per second of a device, 0 where it was not measured.
  pure real(wp) function rate(self, device)
    class(trial_t), intent(in) :: self
    integer, intent(in) :: device
    rate = self%starts(device)/max(self%seconds(device), tiny(rate))
  end function rate

  !> `run_trajectories` on the GPU of the ensemble, if it has one and that is not slower; the watch is looked at on the way. Code 75
  !> if the GPU fails; then, and where `whole` is false because the watch requested a stop, there are no outcomes.
  subroutine run_on_device(ensemble, catalogue, starts, outcomes, whole, error, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    type(outcome_t), intent(out) :: outcomes(:)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    whole = .true.
    if (.not. ensemble%flow%available .or. ensemble%flow%gpu < 0) then
      call run_trajectories(ensemble, catalogue, starts, outcomes)
    else if (trial%taken == not_known) then
      call run_on_both(ensemble, catalogue, starts, outcomes, whole, error, watch)
    else if (trial%taken == on_gpu) then
      call run_on_gpu(ensemble, catalogue, starts, outcomes, whole, error, watch)
    else
      call run_on_processor(ensemble, catalogue, starts, outcomes, whole, watch)
    end if
  end subroutine run_on_device

  !> As many starts as a GPU is given, by the processor: the watch is looked at as often as where no GPU is.
  subroutine run_on_processor(ensemble, catalogue, starts, outcomes, whole, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(out) :: whole
    class(watch_t), intent(inout), optional :: watch
    integer :: first, last
    whole = .true.
    do first = 1, size(starts, 2), processor_block
      last = min(first + processor_block - 1, size(starts, 2))
      call run_trajectories(ensemble, catalogue, starts(:, first:last), outcomes(first:last))
      call look(watch, whole)
      if (.not. whole) return
    end do
  end subroutine run_on_processor

  !> Blocks of starts that lie evenly over all of them, as neighbours cost alike: by the processor until it has been measured,
  !> by the GPU until that has been, then the others by the faster one.
  subroutine run_on_both(ensemble, catalogue, starts, outcomes, whole, error, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(gpu_half_t) :: halves(2)
    type(spread_order_t) :: order
    integer :: blocks, done, count
    whole = .true.
    blocks = (size(starts, 2) + processor_block - 1)/processor_block
    order = new_spread_order(blocks)
    done = 0
    do while (done < blocks .and. trial%seconds(on_processor) < trial_seconds)
      call run_some(ensemble, catalogue, starts, positions_of(order, done, 1, size(starts, 2)), on_processor, outcomes, whole, &
                    error, watch)
      if (.not. whole) return
      done = done + 1
    end do
    if (done == blocks) return
    ! Before the clock runs: the first call of all makes the GPU ready, which takes long.
    call open_gpu(ensemble%flow%gpu, batches_for(size(starts, 2)), halves, error)
    if (allocated(error)) return
    do while (done < blocks)
      count = blocks - done
      ! At least what fills it: one that is half empty is slow. Then as many as it has had, so that a slow one is soon known.
      if (trial%taken == not_known) count = min(count, int(max(2_int64*lane_count*size(halves(1)%batches), &
                                                               trial%starts(on_gpu))/processor_block) + 1)
      call run_some(ensemble, catalogue, starts, positions_of(order, done, count, size(starts, 2)), &
                    merge(on_processor, on_gpu, trial%taken == on_processor), outcomes, whole, error, watch)
      if (allocated(error) .or. .not. whole) return
      done = done + count
    end do
  end subroutine run_on_both

  !> The starts at some positions, by a device; noted while it is not known which is faster.
  subroutine run_some(ensemble, catalogue, starts, positions, device, outcomes, whole, error, watch)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: positions(:), device
    type(outcome_t), intent(inout) :: outcomes(:)
    logical, intent(out) :: whole
    type(error_t), allocatable, intent(out) :: error
    class(watch_t), intent(inout), optional :: watch
    type(outcome_t), allocatable :: found(:)
    real(wp) :: begun
    allocate (found(size(positions)))
    begun = monotonic_seconds()
    whole = .true.
    if (device == on_gpu) then
      call run_on_gpu(ensemble, catalogue, starts(:, positions), found, whole, error, watch)
    else
      call run_on_processor(ensemble, catalogue, starts(:, positions), found, whole, watch)
    end if
    if (allocated(error) .or. .not. whole) return
    if (trial%taken == not_known) call trial%note(device, size(positions), monotonic_seconds() - begun)
    outcomes(positions) = found
  end subroutine run_some

  !> Positions, among so many starts, of `count` blocks behind the first `done` of an order.
  pure function positions_of(order, done, count, starts) result(positions)
    type(spread_order_t), intent(in) :: order
    integer, intent(in) :: done, count, starts
    integer, allocatable :: positions(:)
    integer :: number, k, i, first, last
    allocate (positions(processor_block*count))
    k = 0
    do number = done + 1, done + count
      first = (order%item(number) - 1)*processor_block + 1
      last = min(first + processor_block - 1, starts)
      positions(k + 1:k + last - first + 1) = [(i, i=first, last)]
      k = k + last - first + 1
    end do
    positions = positions(:k)
  end function positions_of

  subroutine look(watch, whole)
    class(watch_t), intent(inout), optional :: watch
    logical, intent(inout) :: whole
    logical :: stop_now
    if (.not. present(watch)) return
    call watch%look(stop_now)
    whole = .not. stop_now
  end subroutine look

end module device_run
