! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Where the energy of one body goes. With the stretch s = l0 + x_A - x of a linear spring, E = m v^2/2 + c s^2/2 and
!>   E' = -(dry friction)|v| - b v^2 + c s x_A' - (force of a soft barrier) p'.
!> Effects add k3 s^4/4 - F x to E, k3 s^3 x_A' to the work of the drive, and their own losses; what Dahl's friction
!> holds elastically counts as lost until it gives it back.
!> The powers are integrated by Gauss's rule over short pieces of a flight.
module energy
  use drive_law, only: foot_motion, measured_force
  use effect_law, only: effect_energy, effect_losses, slip_memory_t
  use exact_flow, only: begin_segment, evaluate, flow_t, kinematics_t, segment_t
  use friction_law, only: stribeck_excess
  use kinds, only: wp
  use motion_state, only: book_t, state_t
  use oscillator, only: oscillator_t
  use restoring_law, only: restoring_energy, restoring_force
  implicit none
  private

  public :: energy_of_body, book_instant, book_exact, book_rest

  !> Gauss's rule with 8 points on [0, 1] (Abramowitz, Stegun, 25.4.30).
  integer, parameter, public :: gauss_points = 8
  real(wp), parameter :: half_place(4) = [0.1834346424956498049394761_wp, 0.5255324099163289858177390_wp, &
                                          0.7966664774136267395915539_wp, 0.9602898564975362316835609_wp]
  real(wp), parameter :: half_weight(4) = [0.3626837833783619829651504_wp, 0.3137066458778872873379622_wp, &
                                           0.2223810344533744705443560_wp, 0.1012285362903762591525314_wp]
  real(wp), parameter, public :: gauss_place(gauss_points) = 0.5_wp + 0.5_wp*[half_place, -half_place]
  real(wp), parameter, public :: gauss_weight(gauss_points) = 0.5_wp*[half_weight, half_weight]

  !> Longest piece over which the powers of an exact flight are integrated, in radians of its fastest part.
  real(wp), parameter :: longest_piece = 1.0_wp

contains

  !> Kinetic energy and what restoring forces and effects store [J].
  pure real(wp) function energy_of_body(machine, state) result(energy)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: state
    real(wp) :: foot
    call foot_motion(machine%drive, machine%drive_frequency*state%time, foot)
    associate (stretch => machine%restoring%free_length + foot - state%x)
      energy = 0.5_wp*machine%mass*state%v**2 + restoring_energy(machine%restoring, stretch)
      if (machine%effects%present) energy = energy + effect_energy(machine%effects, state%x, stretch)
    end associate
  end function energy_of_body

  !> Adds `weight` [s] times the powers at `time` [s after the section], `x`, `v` of a slip.
  pure subroutine book_instant(machine, slip, time, x, v, weight, book)
    type(oscillator_t), intent(in) :: machine
    type(slip_memory_t), intent(in) :: slip
    real(wp), intent(in) :: time, x, v, weight
    type(book_t), intent(inout) :: book
    real(wp) :: foot, rate, stretch, measured, losses(2)
    if (.not. book%kept) return
    call foot_motion(machine%drive, machine%drive_frequency*time, foot, rate)
    associate (law => machine%friction)
      book%friction = book%friction + weight*(law%kinetic + stribeck_excess(law, abs(v)))*abs(v)
      book%damping = book%damping + weight*law%damping*v**2
    end associate
    stretch = machine%restoring%free_length + foot - x
    book%work = book%work + weight*restoring_force(machine%restoring, stretch)*rate*machine%drive_frequency
    if (machine%effects%present) then
      losses = effect_losses(machine%effects, machine%friction, slip, x, v)
      book%friction = book%friction + weight*losses(1)
      book%damping = book%damping + weight*losses(2)
      book%work = book%work + weight*machine%effects%cubic*stretch**3*rate*machine%drive_frequency
    end if
    if (machine%drive%interval > 0) then
      call measured_force(machine%drive, time, measured, rate)
      book%work = book%work + weight*measured*v
    end if
  end subroutine book_instant

  !> An exact flight from `start` to `time_end` [s after the section], slipping in `direction`.
  pure subroutine book_exact(machine, flow, start, direction, time_end, book)
    type(oscillator_t), intent(in) :: machine
    type(flow_t), intent(in) :: flow
    type(state_t), intent(in) :: start
    integer, intent(in) :: direction
    real(wp), intent(in) :: time_end
    type(book_t), intent(inout) :: book
    type(segment_t) :: segment
    type(kinematics_t) :: now
    type(slip_memory_t) :: slip
    real(wp) :: piece, elapsed
    integer :: pieces, i, k
    if (.not. book%kept) return
    slip = slip_memory_t(direction=direction, x=start%x)
    call begin_segment(flow, start%time, start%x, start%v, direction, segment)
    pieces = ceiling((time_end - start%time)*max(flow%natural, flow%harmonics*flow%drive_frequency)/longest_piece)
    piece = (time_end - start%time)/max(1, pieces)
    do i = 1, pieces
      do k = 1, gauss_points
        elapsed = (i - 1 + gauss_place(k))*piece
        call evaluate(flow, segment, elapsed, now)
        call book_instant(machine, slip, start%time + elapsed, now%x, now%v, gauss_weight(k)*piece, book)
      end do
    end do
  end subroutine book_exact

  !> A body at rest from `before` to `now`: what the drive does to the spring.
  pure subroutine book_rest(machine, before, now, book)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(in) :: before, now
    type(book_t), intent(inout) :: book
    type(state_t) :: rest
    if (.not. book%kept) return
    rest = before
    rest%v = 0
    book%work = book%work - energy_of_body(machine, rest)
    rest%time = now%time
    book%work = book%work + energy_of_body(machine, rest)
  end subroutine book_rest

end module energy
