! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Lyapunov exponents of a long motion of one body, gathered from as many motions as there are lanes: they start beside states
!> that the motion itself passes, far apart in time, and are on its attractor. Their halves are the batches of the standard error.
module exponents_in_lanes
  use body_family, only: vary_period
  use constants, only: pi
  use elementary, only: exponential, logarithm, sine_cosine
  use exponents, only: aligning, batches, conclude, fly_on, has_exact_sum, loses_direction, note_events, spectrum_t
  use hybrid_machine, only: event_t
  use kinds, only: int64, wp
  use lane_preparation, only: prepare_lanes
  use lane_types, only: lane_batch_t, lane_count, lane_flow_t, lane_flying, lane_idle, lane_left
  use lane_variation, only: carries_tangents, fly_lanes_with_tangents, put_tangents, tangents_at_state, tangents_t
  use lanes, only: lane_state, occupy_lane
  use motion, only: motion_t, start_state
  use motion_state, only: log_t, mode_slip_minus, mode_slip_plus, open_log, state_t
  use one_body, only: one_body_t
  use status, only: reason_left_domain
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: gathers_in_lanes, gather_exponents

  !> Below so many drive periods one motion is followed.
  integer, parameter :: least_periods = 100000
  !> Sections after which the lengths of the directions are taken: short enough for numbers of any contraction.
  integer, parameter :: sections_together = 16
  !> How far beside the motion the lanes start, as a share of its size: far more than rounding, far less than a basin.
  real(wp), parameter :: apart = 1e-7_wp
  !> Logarithm of how much a direction may grow and shrink again while it only turns.
  real(wp), parameter :: turning = 7
  !> Both halves of the motion in a lane, after the part in which its directions turn.
  integer, parameter :: halves = batches/lane_count

  !> What is summed up over all lanes and parts.
  type :: sums_t
    real(wp) :: first(batches) = 0, both(batches) = 0
    !> Logarithms by which the events of each lane change areas: one by one, in which order lanes stop depends on the vectors.
    real(wp) :: exact(lane_count) = 0
    logical :: singular = .false., dead = .false.
  end type sums_t

  !> Where a lane is: part 0 is that in which the directions turn. Sections left in the part, and those to the next stop.
  type :: progress_t
    integer :: part = 0, left = 0, ahead = 0
  end type progress_t

contains

  !> Whether the exponents of a motion over so many periods are gathered in lanes.
  pure logical function gathers_in_lanes(body, periods)
    type(one_body_t), intent(in) :: body
    integer, intent(in) :: periods
    gathers_in_lanes = periods >= least_periods .and. has_exact_sum(body)
    if (gathers_in_lanes) gathers_in_lanes = carries_tangents(flow_of(body))
  end function gathers_in_lanes

  !> Lanes for a machine, whatever lanes the case requests: the numbers are the same for any width.
  pure function flow_of(body) result(flow)
    type(one_body_t), intent(in) :: body
    type(lane_flow_t) :: flow
    flow%width = max(flow%width, body%moving%options%lane_width)
    call prepare_lanes(body%moving, flow)
  end function flow_of

  !> What `lyapunov_exponents` does. `section` has the positions of the one motion that begins at `state`.
  subroutine gather_exponents(machines, body, state, transient, periods, spectrum, section)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(state_t), intent(inout) :: state
    integer, intent(in) :: transient, periods
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: section(:)
    type(lane_flow_t) :: flow
    type(lane_batch_t) :: batch
    type(tangents_t) :: tangents
    type(progress_t) :: progress(lane_count)
    type(state_t) :: starts(lane_count)
    type(log_t) :: log
    type(sums_t) :: sums
    real(wp) :: duration
    integer :: lane
    section = 0
    spectrum%exponents = [0.0_wp, 0.0_wp]
    spectrum%errors = [0.0_wp, 0.0_wp]
    flow = flow_of(body)
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    call lead_the_way(body, state, log, transient, starts, section, spectrum%reason)
    if (spectrum%reason /= 0) return
    spectrum%point = [state%x, state%v]
    spectrum%has_sum = .true.
    batch%budget = real(body%moving%options%event_budget, wp)
    do lane = 1, lane_count
      ! Not all alike: on a cycle the parts would begin at the same point, or at the same turn of the directions, and what
      ! their halves differ by would look like no chance.
      progress(lane)%left = aligning + (lane*(lane + 1))/2
      call set_directions(lane, tangents)
      call set_off(flow, lane, starts(lane), .true., batch)
      call go_on(periods, lane, progress(lane), batch)
    end do
    do while (any(progress%part <= halves))
      call fly_lanes_with_tangents(flow, batch, tangents)
      do lane = 1, lane_count
        if (progress(lane)%part > halves) cycle
        if (abs(batch%status(lane) - lane_left) <= 0) then
          call take_over(machines, body, flow, lane, periods, log, batch, tangents, progress(lane), sums, spectrum)
          if (spectrum%reason /= 0) return
        else if (abs(batch%status(lane) - lane_flying) > 0) then
          ! Out of its domain it stops before it has to.
          if (batch%sections(lane) >= 0.5_wp) spectrum%reason = reason_left_domain
          if (spectrum%reason /= 0) return
          batch%status(lane) = lane_flying
          call settle(body, flow%machine%decay, lane, progress(lane), batch, tangents, sums, spectrum)
          call go_on(periods, lane, progress(lane), batch)
        end if
      end do
    end do
    spectrum%known = .true.
    duration = periods*body%period
    spectrum%sum_exact = sum(sums%exact)/duration - body%moving%machine%friction%damping/body%moving%machine%mass
    call conclude(sums%first*batches/duration, sums%both*batches/duration, sums%singular, sums%dead, spectrum)
    spectrum%memory = turning*lane_count/duration
    spectrum%periods = periods
    spectrum%mean_period = body%period
  end subroutine gather_exponents

  !> Two directions at right angles, in every lane others.
  pure subroutine set_directions(lane, tangents)
    integer, intent(in) :: lane
    type(tangents_t), intent(inout) :: tangents
    call sine_cosine(pi*lane/lane_count, tangents%first_im(lane), tangents%first_re(lane))
    tangents%second_re(lane) = -tangents%first_im(lane)
    tangents%second_im(lane) = tangents%first_re(lane)
  end subroutine set_directions

  !> Flies the one motion over `transient` and the sections; the lanes start beside what it passes in the second half of the
  !> transient, so far apart that they are no repetition of each other.
  subroutine lead_the_way(body, state, log, transient, starts, section, reason)
    type(one_body_t), intent(in) :: body
    type(state_t), intent(inout) :: state
    type(log_t), intent(inout) :: log
    integer, intent(in) :: transient
    type(state_t), intent(out) :: starts(lane_count)
    real(wp), intent(out) :: section(:)
    integer, intent(out) :: reason
    integer :: gap, i
    gap = max(transient/(2*lane_count), aligning)
    call fly_on(body, state, log, transient - lane_count*gap, reason)
    do i = 1, lane_count
      if (reason /= 0) return
      starts(i) = beside(body%moving, state, i*apart*body%size_of(1))
      call fly_on(body, state, log, gap, reason)
    end do
    do i = 1, size(section)
      if (reason /= 0) return
      call fly_on(body, state, log, 1, reason)
      section(i) = state%x
    end do
  end subroutine lead_the_way

  !> A state on the section beside another, away from the barriers.
  pure type(state_t) function beside(moving, state, distance)
    type(motion_t), intent(in) :: moving
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: distance
    real(wp) :: shift
    associate (contact => moving%machine%contact)
      shift = sign(distance, (contact%upper - state%x) - (state%x - contact%lower))
      shift = sign(min(distance, 1e-3_wp*(contact%upper/2 - contact%lower/2)), shift)
    end associate
    beside = start_state(moving, state%x + shift, state%v, 0.0_wp)
  end function beside

  !> Puts a body into a lane; one that does not slip is left to the event loop at once.
  pure subroutine set_off(flow, lane, state, new, batch)
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    type(state_t), intent(in) :: state
    logical, intent(in) :: new
    type(lane_batch_t), intent(inout) :: batch
    call occupy_lane(flow, lane, state, new, batch)
    batch%start(lane) = state%time
    if (state%mode /= mode_slip_plus .and. state%mode /= mode_slip_minus) batch%status(lane) = lane_left
  end subroutine set_off

  !> How far a lane flies to its next stop; none is left: it is idle.
  pure subroutine go_on(periods, lane, progress, batch)
    integer, intent(in) :: periods, lane
    type(progress_t), intent(inout) :: progress
    type(lane_batch_t), intent(inout) :: batch
    integer :: number
    if (progress%left == 0) then
      progress%part = progress%part + 1
      number = batch_of(lane, progress%part)
      if (progress%part <= halves) progress%left = last_of(number) - last_of(number - 1)
    end if
    if (progress%part > halves) then
      batch%status(lane) = lane_idle
      return
    end if
    progress%ahead = min(sections_together, progress%left)
    batch%sections(lane) = progress%ahead - 1
    batch%flights(lane) = 0

  contains

    !> The last period of a batch.
    pure integer function last_of(number)
      integer, intent(in) :: number
      last_of = int((int(number, int64)*periods)/batches)
    end function last_of

  end subroutine go_on

  !> The batch that a part of the motion in a lane makes: all first halves come before the second ones.
  pure integer function batch_of(lane, part)
    integer, intent(in) :: lane, part
    batch_of = lane + lane_count*(part - 1)
  end function batch_of

  !> Takes how much the directions of a lane have grown, and the events, to the sums, and makes the directions unit again.
  subroutine settle(body, decay, lane, progress, batch, tangents, sums, spectrum)
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: decay
    integer, intent(in) :: lane
    type(progress_t), intent(inout) :: progress
    type(lane_batch_t), intent(inout) :: batch
    type(tangents_t), intent(inout) :: tangents
    type(sums_t), intent(inout) :: sums
    type(spectrum_t), intent(inout) :: spectrum
    real(wp) :: first, second, shrink
    associate (re => tangents%first_re(lane), im => tangents%first_im(lane), turns => tangents%turns(lane))
      ! On the section, which is later than the start of the flight.
      shrink = exponential(-decay*(batch%time(lane) - batch%start(lane)))
      first = shrink*sqrt(re**2 + im**2)
      second = shrink*sqrt(tangents%second_re(lane)**2 + tangents%second_im(lane)**2)
      if (progress%part > 0) then
        associate (to => batch_of(lane, progress%part))
          sums%dead = sums%dead .or. .not. first > 0
          sums%singular = sums%singular .or. .not. second > 0
          if (first > 0) sums%first(to) = sums%first(to) + logarithm(first)
          if (first > 0 .and. second > 0) sums%both(to) = sums%both(to) + logarithm(first) + logarithm(second)
        end associate
        spectrum%impacts = spectrum%impacts + nint(batch%impacts(lane), int64)
        if (batch%impacts(lane) > 0) sums%exact(lane) = &
          sums%exact(lane) + 2*batch%impacts(lane)*logarithm(body%moving%machine%contact%restitution)
        sums%exact(lane) = sums%exact(lane) + logarithm(abs(turns))
      end if
      if (first > 0) then
        re = re/first
        im = im/first
      else
        re = 0.6_wp
        im = 0.8_wp
      end if
      tangents%second_re(lane) = -im
      tangents%second_im(lane) = re
      turns = 1
    end associate
    batch%impacts(lane) = 0
    progress%left = progress%left - progress%ahead
  end subroutine settle

  !> The event loop takes a lane over to the next section, and further while the body does not slip there.
  subroutine take_over(machines, body, flow, lane, periods, log, batch, tangents, progress, sums, spectrum)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane, periods
    type(log_t), intent(inout) :: log
    type(lane_batch_t), intent(inout) :: batch
    type(tangents_t), intent(inout) :: tangents
    type(progress_t), intent(inout) :: progress
    type(sums_t), intent(inout) :: sums
    type(spectrum_t), intent(inout) :: spectrum
    type(event_t), allocatable :: events(:)
    type(state_t) :: state
    real(wp) :: by_start(2, 2), directions(2, 2)
    call lane_state(batch, lane, state)
    ! At rest on the section: in what mode, lanes do not know.
    if (.not. (state%time > 0 .or. abs(state%v) > 0)) state = start_state(body%moving, state%x, state%v, 0.0_wp)
    directions = tangents_at_state(flow, batch, lane, tangents)
    do
      call vary_period(machines, body, state, log, events, by_start, spectrum%reason)
      if (spectrum%reason /= 0) return
      if (progress%part > 0) then
        sums%singular = sums%singular .or. any(loses_direction(events))
        spectrum%sum_exact = sums%exact(lane)
        call note_events(body, events, spectrum)
        sums%exact(lane) = spectrum%sum_exact
      end if
      call put_tangents(flow, lane, matmul(by_start, directions), tangents)
      call set_off(flow, lane, state, .false., batch)
      if (batch%sections(lane) < 0.5_wp) then
        call settle(body, flow%machine%decay, lane, progress, batch, tangents, sums, spectrum)
        call go_on(periods, lane, progress, batch)
      else
        batch%sections(lane) = batch%sections(lane) - 1
      end if
      if (abs(batch%status(lane) - lane_left) > 0) return
      directions = tangents_at_state(flow, batch, lane, tangents)
    end do
  end subroutine take_over

end module exponents_in_lanes
