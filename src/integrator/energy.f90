! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where the energy of one body goes. With the extension s = l0 + x_A - x of a linear spring, E = m v^2/2 + c s^2/2 and
!>   E' = -(dry friction)|v| - b v^2 + c s x_A' - (force of a soft barrier) p'.
!> Effects add k3 s^4/4 - F x and the like to E, k3 s^3 x_A' and the like to the work of the drive, and their own losses; what
!> Dahl's friction holds elastically counts as lost until it gives it back.
!> The powers are integrated by Gauss's rule over short pieces of a flight.
module energy
  use drive_law, only: foot_motion, measured_force
  use effect_law, only: effect_energy, effect_losses, slip_memory_t, extension_force
  use exact_flow, only: begin_segment, evaluate, flow_t, kinematics_t, segment_t
  use friction_law, only: stribeck_excess
  use kinds, only: wp
  use motion_state, only: energy_balance_t, log_t, put_sample_balance, record_sample, state_t
  use oscillator, only: oscillator_t
  use restoring_law, only: restoring_energy, restoring_force
  implicit none
  private

  public :: energy_of_body, balance_instant, balance_exact, balance_rest, record_with_balance

  !> Gauss's rule with 8 points on [0, 1] (Abramowitz, Stegun, 25.4.30).
  integer, parameter, public :: gauss_points = 8
  real(wp), parameter :: half_position(4) = [0.1834346424956498049394761_wp, 0.5255324099163289858177390_wp, &
                                          0.7966664774136267395915539_wp, 0.9602898564975362316835609_wp]
  real(wp), parameter :: half_weight(4) = [0.3626837833783619829651504_wp, 0.3137066458778872873379622_wp, &
                                           0.2223810344533744705443560_wp, 0.1012285362903762591525314_wp]
  real(wp), parameter, public :: gauss_position(gauss_points) = 0.5_wp + 0.5_wp*[half_position, -half_position]
  real(wp), parameter, public :: gauss_weight(gauss_points) = 0.5_wp*[half_weight, half_weight]

  !> Longest piece over which the powers of an exact flight are integrated, in radians of its fastest part.
  real(wp), parameter :: longest_piece = 1.0_wp
  !> After so many of its times nothing is left of the fast decay of an overdamped motion.
  real(wp), parameter :: fast_decays = 40

contains

  !> Kinetic energy and what restoring forces and effects store [J].
  pure real(wp) function energy_of_body(machine, state) result(energy)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp) :: foot
    call foot_motion(machine%drive, machine%drive_frequency*state%time, foot)
    associate (extension => machine%restoring%free_length + foot - state%x)
      energy = 0.5_wp*machine%mass*state%v**2 + restoring_energy(machine%restoring, extension)
      if (machine%effects%present) energy = energy + effect_energy(machine%effects, state%x, extension)
    end associate
  end function energy_of_body

  !> Adds `weight` [s] times the powers at `time` [s after the section], `x`, `v` of a slip.
  pure subroutine balance_instant(machine, slip, time, x, v, weight, balance)
    type(oscillator_t), intent(in) :: machine
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: time, x, v, weight
    type(energy_balance_t), intent(inout) :: balance
    real(wp) :: foot, rate, extension, measured, losses(2)
    if (.not. balance%kept) return
    call foot_motion(machine%drive, machine%drive_frequency*time, foot, rate)
    associate (law => machine%friction)
      balance%friction = balance%friction + weight*(law%kinetic + stribeck_excess(law, abs(v)))*abs(v)
      balance%damping = balance%damping + weight*law%damping*v**2
    end associate
    extension = machine%restoring%free_length + foot - x
    balance%work = balance%work + weight*restoring_force(machine%restoring, extension)*rate*machine%drive_frequency
    if (machine%effects%present) then
      losses = effect_losses(machine%effects, machine%friction, slip, x, v)
      balance%friction = balance%friction + weight*losses(1)
      balance%damping = balance%damping + weight*losses(2)
      balance%work = balance%work + weight*extension_force(machine%effects, extension)*rate*machine%drive_frequency
    end if
    if (machine%drive%interval > 0) then
      call measured_force(machine%drive, time, measured, rate)
      balance%work = balance%work + weight*measured*v
    end if
  end subroutine balance_instant

  !> Writes a sample down with the energy then; the balance of the log is that until the sample.
  pure subroutine record_with_balance(machine, sample, log)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: sample
    type(log_t), intent(inout) :: log
    if (log%balance%kept) then
      log%balance%at_end = energy_of_body(machine, sample)
      call record_sample(log, sample, balance=log%balance)
    else
      call record_sample(log, sample)
    end if
  end subroutine record_with_balance

  !> An exact flight from `start` to `time_end` [s after the section], slipping in `direction`, and the balances of the
  !> samples from number `first` on, which it has written down.
  pure subroutine balance_exact(machine, flow, start, direction, time_end, first, log)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(in) :: flow
    type(state_t), intent(in) :: start
    integer, intent(in) :: direction, first
    real(wp), intent(in) :: time_end
    type(log_t), intent(inout) :: log
    type(segment_t) :: segment
    type(slip_memory_t) :: slip
    type(state_t) :: sample
    real(wp) :: done
    integer :: i
    if (.not. log%balance%kept) return
    slip = slip_memory_t(direction=direction, x=start%x)
    call begin_segment(flow, start%time, start%x, start%v, direction, segment)
    done = 0
    do i = first, log%samples
      sample = start
      sample%time = log%sample_data(1, i) - log%origin
      sample%x = log%sample_data(2, i)
      sample%v = log%sample_data(3, i)
      if (sample%time > start%time + done) then
        call balance_piece(machine, flow, segment, slip, start%time, done, sample%time - start%time, log%balance)
        done = sample%time - start%time
      end if
      log%balance%at_end = energy_of_body(machine, sample)
      call put_sample_balance(log, i, log%balance)
    end do
    if (time_end > start%time + done) then
      call balance_piece(machine, flow, segment, slip, start%time, done, time_end - start%time, log%balance)
    end if
  end subroutine balance_exact

  !> Part of an exact flight, between two times since its start.
  pure subroutine balance_piece(machine, flow, segment, slip, start, from, until, balance)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: start, from, until
    type(energy_balance_t), intent(inout) :: balance
    real(wp) :: fast_until
    if (flow%overdamped) then
      ! The fast part has gone by then.
      fast_until = min(until, max(from, fast_decays/flow%fast))
      call balance_part(machine, flow, segment, slip, start, [from, fast_until], flow%fast, balance)
      call balance_part(machine, flow, segment, slip, start, [fast_until, until], &
                     max(flow%slow, flow%harmonics*flow%drive_frequency), balance)
    else
      call balance_part(machine, flow, segment, slip, start, [from, until], &
                     max(flow%natural, flow%harmonics*flow%drive_frequency), balance)
    end if
  end subroutine balance_piece

  !> The same where nothing changes faster than `rate` [1/s].
  pure subroutine balance_part(machine, flow, segment, slip, start, span, rate, balance)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(in) :: flow
    type(segment_t), intent(in) :: segment
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: start, span(2), rate
    type(energy_balance_t), intent(inout) :: balance
    type(kinematics_t) :: now
    real(wp) :: piece, elapsed
    integer :: pieces, i, k
    if (.not. span(2) > span(1)) return
    pieces = max(1, ceiling((span(2) - span(1))*rate/longest_piece))
    piece = (span(2) - span(1))/pieces
    do i = 1, pieces
      do k = 1, gauss_points
        elapsed = span(1) + (i - 1 + gauss_position(k))*piece
        call evaluate(flow, segment, elapsed, now)
        call balance_instant(machine, slip, start + elapsed, now%x, now%v, gauss_weight(k)*piece, balance)
      end do
    end do
  end subroutine balance_part

  !> A body at rest from `before` to `now`: what the drive does to the spring.
  pure subroutine balance_rest(machine, before, now, balance)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: before, now
    type(energy_balance_t), intent(inout) :: balance
    type(state_t) :: rest
    if (.not. balance%kept) return
    rest = before
    rest%v = 0
    balance%work = balance%work - energy_of_body(machine, rest)
    rest%time = now%time
    balance%work = balance%work + energy_of_body(machine, rest)
  end subroutine balance_rest

end module energy
