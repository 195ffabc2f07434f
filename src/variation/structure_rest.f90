! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure without a clock where nothing moves: the modes in which it may be, its rates there with their derivatives, and what
!> keeps it in its mode.
module structure_rest
  use guards, only: guards_of, joint_guard_t, room_for_guards
  use hybrid_machine, only: event_t
  use multibody, only: is_stop, joint_elastic, joint_friction, most_joints
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  use structure, only: state_in, structure_t
  use structure_modes, only: count_joints, mode_number
  use structure_flight, only: flow_of, rate_slopes, rates
  implicit none
  private

  public :: modes_at_rest, rates_at_rest, margins_at_rest, misses_at_rest

  !> Stops that are tried one by one: three modes each.
  integer, parameter :: most_stops = 5

contains

  !> The modes that a structure may be at rest in without dry friction that holds it: surfaces slide as they run, stops are free,
  !> or pressed above or below. None where dry friction holds a joint, whose positions of rest are a continuum, and where
  !> there are too many stops.
  pure function modes_at_rest(structure) result(modes)
    type(structure_t), intent(in) :: structure
    integer, allocatable :: modes(:)
    real(wp) :: s, u
    real(wp), dimension(structure%frame%moving%machine%n) :: still
    integer :: phase(most_joints), stops(most_joints), sides(2, most_joints), tries, digit, i, j, count_stops
    complex(wp) :: turning(structure%frame%moving%harmonics)
    logical :: possible
    allocate (modes(0))
    still = 0
    phase = 0
    count_stops = 0
    associate (machine => structure%frame%moving%machine)
      turning = turning_at(machine%frequency, 0.0_wp, structure%frame%moving%harmonics)
      do j = 1, count_joints(machine)
        associate (joint => machine%joints(j))
          if (is_stop(joint%kind)) then
            count_stops = count_stops + 1
            stops(count_stops) = j
            sides(:, count_stops) = merge([1, -1], 0, [joint%upper < huge(1.0_wp), joint%lower > -huge(1.0_wp)])
          else if (joint%kind == joint_friction .or. joint%kind == joint_elastic) then
            call joint_motion(machine, j, still, still, 0.0_wp, turning, s, u)
            if (.not. abs(u) > machine%negligible_speed) return
            phase(j) = merge(1, -1, u > 0)
          end if
        end associate
      end do
      if (count_stops > most_stops) return
      do tries = 0, 3**count_stops - 1
        digit = tries
        possible = .true.
        do i = 1, count_stops
          phase(stops(i)) = 0
          if (modulo(digit, 3) > 0) phase(stops(i)) = sides(modulo(digit, 3), i)
          possible = possible .and. (modulo(digit, 3) == 0 .or. phase(stops(i)) /= 0)
          digit = digit/3
        end do
        if (possible) modes = [modes, mode_number(machine, phase)]
      end do
    end associate
  end function modes_at_rest

  !> Time derivatives of the coordinates in a mode, and the derivatives of those by the coordinates.
  pure subroutine rates_at_rest(structure, mode, y, slope, by_state)
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: slope(:), by_state(:, :)
    type(multibody_state_t) :: state
    type(mode_flow_t) :: spare
    integer :: at
    state = state_in(structure, mode, 0.0_wp, y)
    call flow_of(structure%frame%moving, state%phase, at, spare)
    if (at > 0) then
      slope = rates(structure%frame, structure%frame%moving%flows(at), state)
      call rate_slopes(structure%frame, structure%frame%moving%flows(at), state, by_state)
    else
      slope = rates(structure%frame, spare, state)
      call rate_slopes(structure%frame, spare, state, by_state)
    end if
  end subroutine rates_at_rest

  !> What is zero where nothing moves: the rates, and how far the coordinates are from what the mode holds.
  pure function misses_at_rest(structure, mode, y) result(misses)
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp) :: misses(2*size(y)), held(size(y))
    call structure%fly(mode, 0.0_wp, y, 0.0_wp, held)
    misses = [structure%slope(mode, 0.0_wp, y), y - held]
  end function misses_at_rest

  !> The guards of the mode, positive where it lasts; those of the section left out.
  pure function margins_at_rest(structure, mode, y) result(margins)
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    real(wp), allocatable :: margins(:)
    type(joint_guard_t) :: list(room_for_guards(structure%frame%moving%machine))
    type(multibody_state_t) :: state
    type(mode_flow_t) :: spare
    type(event_t) :: event
    real(wp) :: by_state(size(y)), by_time
    integer :: at, count_guards, g
    state = state_in(structure, mode, 0.0_wp, y)
    call flow_of(structure%frame%moving, state%phase, at, spare)
    if (at > 0) then
      call guards_of(structure%frame%moving%machine, structure%frame%moving%flows(at), state, list, count_guards)
    else
      call guards_of(structure%frame%moving%machine, spare, state, list, count_guards)
    end if
    allocate (margins(count_guards))
    event%before = mode
    do g = 1, count_guards
      event%joint = list(g)%joint
      event%guard = list(g)%meaning
      call structure%guard(event, 0.0_wp, y, margins(g), by_state, by_time)
    end do
  end function margins_at_rest

end module structure_rest
