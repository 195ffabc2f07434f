! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Many trajectories of one machine: in lanes where the machine allows, a lane that has come to the end being given the
!> next start. The outcome of a start does not depend on the others.
module trajectories
  use attractors, only: attractor_t
  use errors, only: error_t
  use lane_slots, only: add_capture, lane_bodies_t, lane_slots_t, flies_in_lane, advance_lanes, open_lanes, put_into_lane, &
    set_clock, take_clock, take_from_lane
  use kinds, only: wp
  use lane_gpu, only: await_half, gpu_half_t, gpu_threads, open_gpu, send_half
  use lane_types, only: lane_batch_t, lane_count, lane_flow_t, lane_flying, lane_idle, lane_left, lane_stopped
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use status, only: reason_left_domain
  use single_trajectory, only: begin_trajectory, conclude, end_of_phase, &
    trajectory_state_t, ends_converged, go_past_event, go_to_stop, &
    outcome_t, pass_stop, phase_extension, phase_over, phase_window, run_trajectory, sections_ahead, span_t
  use work_watch, only: watch_t
  use, intrinsic :: iso_fortran_env, only: int64
  implicit none
  private

  public :: run_trajectories, run_on_gpu, batches_for, block_size

  !> What is needed of the statistics window of a motion that has not converged.
  integer, parameter, public :: describe_regime = 1, describe_all = 2

  !> All that trajectories have in common.
  type, public :: ensemble_t
    class(machine_t), allocatable :: moving
    type(lane_flow_t) :: flow
    type(span_t) :: span
    !> With `describe_regime` the extremes, which take a search in every flight, are not asked for.
    integer :: describe = describe_all
  end type ensemble_t

  !> Starts that are worth giving to lanes at a time: enough to keep them full.
  integer, parameter, public :: processor_block = 4*lane_count

  !> Starts that a GPU is given at a time, where a tile has so many: its pool is refilled many times.
  integer, parameter :: gpu_block = 2**22

  !> Batches of a GPU that are served between two looks at the watch.
  integer, parameter :: batches_per_look = 256

  !> The trajectory in a lane: number of its start among those of its thread (0 = none), whether the extremes of its window went
  !> unseen, and the slips that were counted up to its last stop.
  type :: slot_t
    integer :: start = 0
    type(trajectory_state_t) :: trajectory
    logical :: unseen = .false.
    integer(int64) :: slips = 0
  end type slot_t

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
    type(slot_t) :: slots(lane_count)
    type(lane_slots_t) :: lanes
    integer :: i, next
    if (.not. ensemble%flow%available) then
      do i = 1, size(starts, 2)
        call run_trajectory(ensemble%moving, catalogue, ensemble%span, starts(:, i), outcomes(i))
      end do
      return
    end if
    call open_lanes(ensemble%moving, lanes)
    call set_regions(ensemble%moving, catalogue, lanes)
    next = 1
    call load_all(ensemble, catalogue, starts, next, slots, lanes%batch, lanes%bodies, outcomes)
    do while (any(slots%start > 0))
      call advance_lanes(ensemble%flow, lanes)
      call service_all(ensemble, catalogue, starts, next, slots, lanes%batch, lanes%bodies, outcomes)
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

  !> The first starts of a batch.
  pure subroutine load_all(ensemble, catalogue, starts, next, slots, batch, bodies, outcomes)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(inout) :: next
    type(slot_t), intent(inout) :: slots(:)
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    type(outcome_t), intent(inout) :: outcomes(:)
    integer :: lane
    do lane = 1, lane_count
      call load_slot(ensemble, catalogue, starts, lane, next, slots(lane), batch, bodies, outcomes)
    end do
  end subroutine load_all

  !> The lanes of a batch that has been flown: those that have stopped or are left, and the next starts.
  pure subroutine service_all(ensemble, catalogue, starts, next, slots, batch, bodies, outcomes)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(inout) :: next
    type(slot_t), intent(inout) :: slots(:)
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    type(outcome_t), intent(inout) :: outcomes(:)
    integer :: lane
    do lane = 1, lane_count
      if (slots(lane)%start == 0 .or. batch%status(lane) < 0.5_wp*(lane_flying + lane_stopped)) cycle
      call service(ensemble, catalogue, starts(:, slots(lane)%start), lane, slots(lane), batch, bodies, &
                  outcomes(slots(lane)%start))
      if (slots(lane)%trajectory%phase == phase_over) call load_slot(ensemble, catalogue, starts, lane, next, slots(lane), &
                                                                  batch, bodies, outcomes)
    end do
  end subroutine service_all

  !> Trajectories worth asking for at a time: enough to keep the lanes full, or one by one.
  pure integer function block_size(ensemble)
    type(ensemble_t), intent(in) :: ensemble
    block_size = merge(processor_block, 1, ensemble%flow%available)
    if (ensemble%flow%available .and. ensemble%flow%gpu >= 0) block_size = gpu_block
  end function block_size

  !> Puts the next start into a lane; a start that comes to its end in the event loop is done at once.
  pure subroutine load_slot(ensemble, catalogue, starts, lane, next, slot, batch, bodies, outcomes)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    integer, intent(in) :: lane
    integer, intent(inout) :: next
    type(slot_t), intent(inout) :: slot
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    type(outcome_t), intent(inout) :: outcomes(:)
    do while (next <= size(starts, 2))
      slot%start = next
      slot%unseen = .false.
      associate (start => starts(:, next), outcome => outcomes(next))
        next = next + 1
        call begin_trajectory(ensemble%moving, ensemble%span, start, slot%trajectory)
        call go_on(ensemble, catalogue, start, slot, outcome)
      end associate
      if (slot%trajectory%phase /= phase_over) then
        call put_into_lane(ensemble%moving, ensemble%flow, lane, slot%trajectory, .true., batch, bodies)
        call send_on(ensemble, catalogue, slot%trajectory, outcomes(slot%start), lane, batch, bodies)
        return
      end if
    end do
    slot%start = 0
    batch%status(lane) = lane_idle
  end subroutine load_slot

  !> Gives the lanes the attractors to which they can converge: what moves, to a cycle.
  pure subroutine set_regions(moving, catalogue, lanes)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(lane_slots_t), intent(inout) :: lanes
    integer :: k, i
    do k = 1, size(catalogue)
      associate (a => catalogue(k))
        if (a%rests .or. a%any_position) cycle
        do i = 1, a%period
          call add_capture(moving, lanes, k, a%points(:a%coordinates, i), a%scale(:a%coordinates), &
                           a%metric(:(a%coordinates*(a%coordinates + 1))/2, i), a%capture_radius**2)
        end do
      end associate
    end do
  end subroutine set_regions

  !> Sets where a lane stops: at every section where a motion may have settled in a family of which lanes do not know.
  pure subroutine send_on(ensemble, catalogue, trajectory, outcome, lane, batch, bodies)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    type(trajectory_state_t), intent(in) :: trajectory
    type(outcome_t), intent(in) :: outcome
    integer, intent(in) :: lane
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    type(options_t) :: options
    batch%until(lane) = trajectory%until
    call set_clock(bodies, lane, trajectory%since, end_of_phase(ensemble%span, trajectory%phase))
    batch%sections(lane) = sections_ahead(ensemble%moving, ensemble%span, trajectory)
    if (trajectory%phase == phase_extension .and. any(catalogue%any_position)) batch%sections(lane) = 0
    options = ensemble%moving%options()
    batch%budget(lane) = real(options%event_budget - trajectory%tally%events, wp)
    batch%leaves(lane) = merge(1, 0, ends_converged(ensemble%span, trajectory))
    batch%elapsed(lane) = trajectory%elapsed
    batch%reached(lane) = trajectory%converged
    batch%settled(lane) = outcome%settle_time
  end subroutine send_on

  !> A lane that has stopped, or is left to the event loop up to where a lane can take the trajectory again.
  pure subroutine service(ensemble, catalogue, start, lane, slot, batch, bodies, outcome)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: start(:)
    integer, intent(in) :: lane
    type(slot_t), intent(inout) :: slot
    type(lane_batch_t), intent(inout) :: batch
    type(lane_bodies_t), intent(inout) :: bodies
    type(outcome_t), intent(inout) :: outcome
    type(options_t) :: options
    logical :: slipped, left, taken
    options = ensemble%moving%options()
    left = batch%status(lane) > 0.5_wp*(lane_stopped + lane_left)
    associate (trajectory => slot%trajectory)
      trajectory%elapsed = batch%elapsed(lane)
      trajectory%converged = nint(batch%reached(lane))
      outcome%settle_time = batch%settled(lane)
      call take_from_lane(ensemble%moving, lane, batch, bodies, trajectory%section_state_t, trajectory%tally)
      call take_clock(bodies, batch, lane, trajectory%since, trajectory%until)
      if (.not. (left .or. abs(trajectory%state%x) <= options%domain)) trajectory%reason = reason_left_domain
      taken = .false.
      if (left .and. trajectory%reason == 0) then
        if (ensemble%flow%resumes) call go_past_events(ensemble, trajectory, taken)
        if (trajectory%reason == 0 .and. .not. (taken .or. trajectory%passed)) then
          call go_to_stop(ensemble%moving, trajectory, slipped)
        end if
      end if
      if (.not. taken) call pass_stop(ensemble%moving, catalogue, ensemble%span, trajectory%tally%slips > slot%slips, &
                                      trajectory, outcome)
      if (.not. taken) slot%slips = trajectory%tally%slips
      if (.not. taken .and. (left .or. .not. flies(ensemble, trajectory))) then
        call go_on(ensemble, catalogue, start, slot, outcome)
        taken = trajectory%phase /= phase_over
        if (.not. taken) return
      end if
      slot%unseen = slot%unseen .or. trajectory%phase == phase_window
      batch%status(lane) = lane_flying
      if (taken) call put_into_lane(ensemble%moving, ensemble%flow, lane, trajectory, .false., batch, bodies)
      call send_on(ensemble, catalogue, trajectory, outcome, lane, batch, bodies)
    end associate
  end subroutine service

  !> Goes past an event, a structure past several, to one after which a lane can take the trajectory, if that comes before the
  !> next stop.
  pure subroutine go_past_events(ensemble, trajectory, taken)
    type(ensemble_t), intent(in) :: ensemble
    type(trajectory_state_t), intent(inout) :: trajectory
    logical, intent(out) :: taken
    taken = .false.
    do while (.not. taken .and. trajectory%state%time < trajectory%until)
      call go_past_event(ensemble%moving, ensemble%flow%slowest, trajectory)
      if (trajectory%reason /= 0) return
      if (trajectory%passed) exit
      taken = trajectory%state%time < trajectory%until .and. flies(ensemble, trajectory)
      if (.not. (allocated(ensemble%flow%structure) .or. allocated(ensemble%flow%tape))) exit
    end do
  end subroutine go_past_events

  !> Goes on in the event loop until a lane can take the trajectory, or to its end.
  pure subroutine go_on(ensemble, catalogue, start, slot, outcome)
    type(ensemble_t), intent(in) :: ensemble
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: start(:)
    type(slot_t), intent(inout) :: slot
    type(outcome_t), intent(inout) :: outcome
    logical :: slipped, taken
    associate (trajectory => slot%trajectory)
      slot%slips = trajectory%tally%slips
      do while (trajectory%phase /= phase_over .and. .not. flies(ensemble, trajectory))
        if (allocated(ensemble%flow%tape)) then
          trajectory%passed = .false.
          call go_past_events(ensemble, trajectory, taken)
          if (taken) exit
        end if
        if (trajectory%reason == 0 .and. .not. trajectory%passed) call go_to_stop(ensemble%moving, trajectory, slipped)
        call pass_stop(ensemble%moving, catalogue, ensemble%span, trajectory%tally%slips > slot%slips, trajectory, outcome)
        slot%slips = trajectory%tally%slips
      end do
      slot%unseen = slot%unseen .or. trajectory%phase == phase_window
      slot%slips = trajectory%tally%slips
      if (trajectory%phase /= phase_over) return
      if (slot%unseen .and. trajectory%reason == 0 .and. trajectory%converged == 0 .and. ensemble%describe == describe_all) then
        ! It was within a capture neighbourhood when its window began, and left: once more, in the event loop.
        call run_trajectory(ensemble%moving, catalogue, ensemble%span, start, outcome)
      else
        call conclude(ensemble%moving, catalogue, trajectory, outcome)
      end if
    end associate
  end subroutine go_on

  !> Whether a lane can take a trajectory, and nobody needs the extremes of its window.
  pure logical function flies(ensemble, trajectory)
    type(ensemble_t), intent(in) :: ensemble
    type(trajectory_state_t), intent(in) :: trajectory
    flies = flies_in_lane(ensemble%moving, ensemble%flow, trajectory%section_state_t) .and. trajectory%phase /= phase_over .and. &
      (trajectory%phase /= phase_window .or. trajectory%converged > 0 .or. ensemble%describe == describe_regime)
  end function flies

end module trajectories
