! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction for the tests, written as text: the structure that they are, and the names that theory has
!> for their motion.
module pairs
  use multibody_machine, only: multibody_machine_t
  use build_motion, only: bodies_of
  use errors, only: error_t
  use machine_type, only: section_state_t
  use multibody, only: joint_soft
  use multibody_log, only: watched_state
  use multibody_motion, only: start_multibody
  use multibody_state, only: joint_motion, turning_at
  use kinds, only: int64, wp
  use machines, only: laws_from
  use motion_state, only: log_t, options_t, tally_t
  use two_bodies, only: contact_at
  implicit none
  private

  public :: build_pair_from, start_pair, move_pair, advance_pair, advance_pair_period, energy_of

  integer, parameter, public :: at_x1 = 1, at_v1 = 2, at_x2 = 3, at_v2 = 4

  !> Where both bodies are, in which mode, and whether a stop is pressed (+1 the upper, -1 the lower one) and how deep.
  type, extends(section_state_t), public :: pair_state_t
    real(wp) :: y(4) = 0, penetration = 0
    integer :: mode = 0, pressed = 0
  end type pair_state_t

contains

  !> Two bodies ready to move; ends the test program if they are refused.
  function build_pair_from(text, event_budget) result(moving)
    character(len=*), intent(in) :: text
    integer(int64), intent(in), optional :: event_budget
    type(multibody_machine_t) :: moving
    type(options_t) :: options
    type(error_t), allocatable :: error
    if (present(event_budget)) options%event_budget = event_budget
    call bodies_of(laws_from(text), options, moving, error)
    if (allocated(error)) error stop 'pairs: '//error%message
  end function build_pair_from

  !> m2 at `x`, `v` and m1 at `driver` (position, velocity), with the drive at `angle` [rad]. `driver` is not looked at where the
  !> motion of m1 is given.
  function start_pair(moving, x, v, driver, angle) result(state)
    type(multibody_machine_t), intent(in) :: moving
    real(wp), intent(in) :: x, v, driver(2), angle
    type(pair_state_t) :: state
    real(wp) :: start(2, moving%bodies%machine%n)
    logical :: ok
    associate (machine => moving%bodies%machine)
      start = 0
      if (machine%driver%at > 0) start(:, machine%driver%at) = driver
      start(:, machine%watched) = [x, v]
      allocate (state%multibody)
      call start_multibody(moving%bodies, start(1, :), start(2, :), angle, state%multibody, ok)
    end associate
    if (.not. ok) error stop 'pairs: no mode to start in'
    call look(moving, state)
  end function start_pair

  !> Moves on by `duration` [s] over any number of sections.
  subroutine move_pair(moving, state, duration, tally, reason, log)
    type(multibody_machine_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: duration
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    real(wp) :: left
    left = duration
    reason = 0
    do while (left >= moving%period - state%multibody%time)
      left = left - (moving%period - state%multibody%time)
      call advance_pair_period(moving, state, tally, reason, log)
      if (reason /= 0) return
    end do
    if (left > 0) call advance_pair(moving, state, state%multibody%time + left, tally, reason, log)
  end subroutine move_pair

  !> To a time within the period.
  subroutine advance_pair(moving, state, time_end, tally, reason, log)
    type(multibody_machine_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call moving%advance(state, time_end, tally, reason, log)
    call look(moving, state)
  end subroutine advance_pair

  subroutine advance_pair_period(moving, state, tally, reason, log)
    type(multibody_machine_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call moving%advance_to_section(state, tally, reason, log)
    call look(moving, state)
  end subroutine advance_pair_period

  real(wp) function energy_of(moving, state)
    type(multibody_machine_t), intent(in) :: moving
    type(pair_state_t), intent(in) :: state
    energy_of = moving%energy(state)
  end function energy_of

  !> What the state is called.
  subroutine look(moving, state)
    type(multibody_machine_t), intent(in) :: moving
    type(pair_state_t), intent(inout) :: state
    complex(wp) :: turning(moving%bodies%harmonics)
    real(wp) :: s, u
    integer :: stop
    associate (machine => moving%bodies%machine, now => state%multibody)
      state%state = watched_state(machine, now)
      state%y = [moving%driver(state), state%state%x, state%state%v]
      state%mode = state%state%mode
      state%pressed = 0
      state%penetration = 0
      stop = contact_at(machine)
      if (stop == 0) return
      if (machine%joints(stop)%kind /= joint_soft) return
      state%pressed = sign(min(1, abs(now%phase(stop))), now%phase(stop))
      if (state%pressed == 0) return
      turning = turning_at(machine%frequency, now%time, size(turning))
      call joint_motion(machine, stop, now%q, now%v, now%time, turning, s, u)
      state%penetration = max(s - machine%joints(stop)%upper, machine%joints(stop)%lower - s)
    end associate
  end subroutine look

end module pairs
