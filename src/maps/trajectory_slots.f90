! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Trajectories in the slots of a lane batch: starts are loaded, stops served, and what no lane takes goes on in the event loop.
module trajectory_slots
  use attractors, only: attractor_t
  use lane_slots, only: add_capture, lane_bodies_t, lane_slots_t, flies_in_lane, put_into_lane, set_clock, take_clock, &
    take_from_lane
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_count, lane_flow_t, lane_flying, lane_idle, lane_left, lane_stopped
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use status, only: reason_left_domain
  use single_trajectory, only: begin_trajectory, conclude, end_of_phase, trajectory_state_t, ends_converged, go_past_event, &
    go_to_stop, outcome_t, pass_stop, phase_extension, phase_over, phase_window, run_trajectory, sections_ahead, span_t
  use, intrinsic :: iso_fortran_env, only: int64
  implicit none
  private

  public :: load_all, service_all, set_regions, slot_t

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

  !> The trajectory in a lane: number of its start among those of its thread (0 = none), whether the extremes of its window went
  !> unseen, and the slips that were counted up to its last stop.
  type :: slot_t
    integer :: start = 0
    type(trajectory_state_t) :: trajectory
    logical :: unseen = .false.
    integer(int64) :: slips = 0
  end type slot_t

contains

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

end module trajectory_slots
