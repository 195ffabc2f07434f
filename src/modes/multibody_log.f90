! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is written down of the motion of a multibody structure when asked: samples, events, and where the energy went.
module multibody_log
  use flight_path, only: path_at, path_t
  use multibody, only: joint_elastic, joint_soft, multibody_t
  use multibody_energy, only: energy_of_multibody, powers, work_of_stops
  use multibody_state, only: is_held, joint_force, joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use mode_flow, only: harmonics_of, mode_flow_t
  use motion_state, only: log_t, mode_slip_minus, mode_slip_plus, mode_stick, put_column, put_in_order, record_event, &
    record_sample, sample_due, sample_time, state_t
  use two_bodies, only: contact_at, driver_now, mode_of_two
  implicit none
  private
  public :: watched_state, log_flight, log_event, log_sample, record_change, balance_change

  !> Gauss-Legendre nodes on (0, 1) and weights.
  real(wp), parameter :: node(4) = [0.069431844202973712388026755553595_wp, 0.33000947820757186759866712044838_wp, &
    0.66999052179242813240133287955162_wp, 0.93056815579702628761197324444640_wp]
  real(wp), parameter :: weight(4) = [0.17392742256872692868653197461100_wp, 0.32607257743127307131346802538900_wp, &
    0.32607257743127307131346802538900_wp, 0.17392742256872692868653197461100_wp]
  !> Decay times after which nothing is left of an exponential.
  real(wp), parameter :: gone = merge(70, 140, epsilon(1.0_wp) > 1e-20_wp)

contains

  !> The watched coordinate as that of one body.
  pure type(state_t) function watched_state(machine, state) result(body)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    integer :: j
    body%x = state%q(machine%watched)
    body%v = state%v(machine%watched)
    body%time = state%time
    body%mode = merge(mode_slip_plus, mode_slip_minus, body%v >= 0)
    do j = 1, size(machine%joints)
      if (is_held(machine%joints(j), state%phase(j))) body%mode = mode_stick
    end do
    if (.not. allocated(machine%driver)) return
    body%x = body%x + machine%driver%stops_run*state%clock
    body%mode = mode_of_two(machine, state)
    if (contact_at(machine) > 0) body%touch_speed = state%touch_speed(contact_at(machine))
  end function watched_state

  !> Samples and energy of a flight from the state `start`, `duration` [s] long.
  pure subroutine log_flight(machine, flow, path, start, duration, log)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(multibody_state_t), intent(in) :: start
    real(wp), intent(in) :: duration
    type(log_t), intent(inout) :: log
    type(multibody_state_t) :: state
    real(wp) :: before, next
    if (allocated(machine%driver) .and. log%balance%kept) call note_peaks(machine, flow, path, start, duration, log)
    state = start
    before = 0
    do while (log%sample_interval > 0)
      if (.not. sample_due(log, path%start + duration)) exit
      next = max(before, sample_time(log) - path%start)
      call balance_flight(machine, flow, path, start, before, next, log)
      call path_at(machine, flow, path, next, state%q, state%v)
      state%time = path%start + next
      call log_sample(machine, state, log)
      before = next
    end do
    call balance_flight(machine, flow, path, start, before, duration, log)
  end subroutine log_flight

  !> Largest force and penetration of a soft stop along a flight.
  pure subroutine note_peaks(machine, flow, path, start, duration, log)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(multibody_state_t), intent(in) :: start
    real(wp), intent(in) :: duration
    type(log_t), intent(inout) :: log
    !> Looks in a panel; what is left of a panel at every step of a golden section, and the steps.
    integer, parameter :: looks = 8, steps = 50
    real(wp), parameter :: golden = 0.61803398874989484820458683436564_wp
    real(wp) :: low, high, from, until, length, width(2), found(2), best(2), at(2)
    integer :: j, i, k, panels
    j = contact_at(machine)
    if (j == 0) return
    if (machine%joints(j)%kind /= joint_soft .or. start%phase(j) == 0 .or. .not. duration > 0) return
    best = 0
    at = 0
    width = 0
    from = 0
    do while (from < duration)
      call next_interval(machine, flow, path, from, duration, until, panels)
      length = (until - from)/(looks*panels)
      do i = 0, looks*panels
        found = pressed(from + i*length)
        at = merge(from + i*length, at, found > best)
        width = merge(length, width, found > best)
        best = max(best, found)
      end do
      from = until
    end do
    do k = 1, 2
      low = max(0.0_wp, at(k) - width(k))
      high = min(duration, at(k) + width(k))
      do i = 1, steps
        associate (left => high - golden*(high - low), right => low + golden*(high - low))
          found = pressed(left) - pressed(right)
          best = max(best, pressed(left))
          if (found(k) > 0) then
            high = right
          else
            low = left
          end if
        end associate
      end do
    end do
    log%peak_force = max(log%peak_force, best(1))
    log%peak_penetration = max(log%peak_penetration, best(2))
  contains
    !> Force and penetration at `t` [s after the start of the path].
    pure function pressed(t)
      real(wp), intent(in) :: t
      real(wp) :: pressed(2), s, u
      complex(wp) :: turning(harmonics_of(machine))
      type(multibody_state_t) :: state
      state = start
      call path_at(machine, flow, path, t, state%q, state%v)
      turning = turning_at(machine%frequency, path%start + t, size(turning))
      call joint_motion(machine, j, state%q, state%v, path%start + t, turning, s, u)
      call joint_force(machine%joints(j), state%phase(j), 0.0_wp, state%touch_speed(j), s, u, 1.0_wp, pressed(1))
      pressed(1) = abs(pressed(1))
      pressed(2) = max(s - machine%joints(j)%upper, machine%joints(j)%lower - s)
    end function pressed
  end subroutine note_peaks

  !> Writes a state down as a sample.
  pure subroutine log_sample(machine, state, log)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    type(log_t), intent(inout) :: log
    if (log%balance%kept) log%balance%at_end = energy_of_multibody(machine, state)
    if (allocated(machine%driver)) then
      call record_sample(log, watched_state(machine, state), driver_now(machine, state), log%balance)
    else
      call record_sample(log, watched_state(machine, state), balance=log%balance)
    end if
    call put_column(log%sample_coordinates, log%samples, [state%q(:machine%n), state%v(:machine%n)])
  end subroutine log_sample

  !> Adds up the powers from `first` to `last` [s after the start of the path], by panels for what is still fast there.
  pure subroutine balance_flight(machine, flow, path, start, first, last, log)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    type(multibody_state_t), intent(in) :: start
    real(wp), intent(in) :: first, last
    type(log_t), intent(inout) :: log
    real(wp) :: length, friction, damping, contact, work, from, until, t
    type(multibody_state_t) :: state
    integer :: panels, i, k
    if (.not. log%balance%kept) return
    state = start
    from = first
    do while (from < last)
      call next_interval(machine, flow, path, from, last, until, panels)
      length = (until - from)/panels
      do i = 1, panels
        do k = 1, size(node)
          t = from + (i - 1 + node(k))*length
          call path_at(machine, flow, path, t, state%q, state%v)
          state%time = path%start + t
          call powers(machine, flow, state, friction, damping, contact, work)
          log%balance%friction = log%balance%friction + weight(k)*length*friction
          log%balance%damping = log%balance%damping + weight(k)*length*damping
          log%balance%contact = log%balance%contact + weight(k)*length*contact
          log%contact_work = log%contact_work + weight(k)*length*contact
          log%balance%work = log%balance%work + weight(k)*length*work
        end do
      end do
      from = until
    end do
  end subroutine balance_flight

  !> An interval from `first` [s after the start of the path] to `last` at most, `until` the fastest part has decayed; its panels.
  pure subroutine next_interval(machine, flow, path, first, last, until, panels)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(path_t), intent(in) :: path
    real(wp), intent(in) :: first, last
    real(wp), intent(out) :: until
    integer, intent(out) :: panels
    real(wp) :: fastest
    integer :: k
    until = last
    fastest = machine%frequency*max(1, size(path%turning))
    if (path%length > 0) then
      ! A step of a marched flight is a polynomial.
      fastest = 0
    else if (flow%modal) then
      k = maxloc(flow%size_of_exponent, 1, -real(flow%exponent)*first < gone)
      if (k > 0) then
        fastest = max(fastest, flow%size_of_exponent(k))
        if (-real(flow%exponent(k))*last > gone) until = min(last, max(gone/(-real(flow%exponent(k))), first + spacing(first)))
      end if
    else
      fastest = max(fastest, flow%rate)
    end if
    panels = max(1, ceiling(3*fastest*(until - first)))
  end subroutine next_interval

  !> What a transition took from the energy: of contacts, but for sliders that let go. A stop that moves does work.
  pure subroutine balance_change(machine, before, after, log)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: before, after
    type(log_t), intent(inout) :: log
    real(wp) :: lost, work
    if (.not. log%balance%kept) return
    lost = energy_of_multibody(machine, before) - energy_of_multibody(machine, after)
    if (any(machine%joints%kind == joint_elastic .and. before%phase(:size(machine%joints)) /= after%phase(:size(machine%joints)))) &
      then
      log%balance%friction = log%balance%friction + lost
    else
      work = work_of_stops(machine, before, after)
      log%balance%contact = log%balance%contact + lost + work
      log%balance%work = log%balance%work + work
    end if
  end subroutine balance_change

  !> Writes an event of a joint down: the watched coordinate before and after it, and the joint's own; its time is that of
  !> the state before it, or `at` [s].
  pure subroutine log_event(machine, kind, j, before, after, log, at)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: kind, j
    type(multibody_state_t), intent(in) :: before, after
    type(log_t), intent(inout) :: log
    real(wp), intent(in), optional :: at
    complex(wp) :: turning(harmonics_of(machine))
    real(wp) :: s, u, u_after
    turning = turning_at(machine%frequency, before%time, size(turning))
    call joint_motion(machine, j, after%q, after%v, before%time, turning, s, u_after)
    call joint_motion(machine, j, before%q, before%v, before%time, turning, s, u)
    call record_change(machine, kind, before, after, log)
    call put_column(log%event_joint, log%events, [real(j, wp), s, u, u_after])
    if (present(at)) log%event_data(1, log%events) = log%origin + at
    call put_in_order(log)
  end subroutine log_event

  !> Writes an event down as the watched body sees it, and of two where the driving one is.
  pure subroutine record_change(machine, kind, before, after, log)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: kind
    type(multibody_state_t), intent(in) :: before, after
    type(log_t), intent(inout) :: log
    if (allocated(machine%driver)) then
      call record_event(log, kind, watched_state(machine, before), after%v(machine%watched), driver_now(machine, before))
    else
      call record_event(log, kind, watched_state(machine, before), after%v(machine%watched))
    end if
  end subroutine record_change

end module multibody_log
