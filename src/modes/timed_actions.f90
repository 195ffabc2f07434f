! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What happens to a multibody structure at times of its own: the samples of a controller, impulses on bodies.
module timed_actions
  use simultaneous_impact, only: apply_impact
  use control, only: error_of
  use multibody, only: joint_contact, joint_friction, joint_section, multibody_t, most_joints, reads_clock
  use multibody_flows, only: multibody_motion_t
  use multibody_log, only: balance_change, record_change
  use multibody_energy, only: energy_of_multibody
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use multibody_transition, only: assess_friction, settle
  use kinds, only: wp
  use motion_state, only: event_impulse, log_t, put_column
  implicit none
  private

  public :: acts_on_time, next_action, act

contains

  !> Whether there is any such thing.
  pure logical function acts_on_time(machine)
    type(multibody_t), intent(in) :: machine
    acts_on_time = allocated(machine%impulses) .or. reads_clock(machine)
    if (allocated(machine%controller)) acts_on_time = acts_on_time .or. machine%controller%sample_time > 0
  end function acts_on_time

  !> Time of the next [s after the section], huge if there is none.
  pure real(wp) function next_action(machine, state) result(next)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    next = huge(next)
    if (allocated(machine%controller)) then
      if (machine%controller%sample_time > 0) next = state%samples*machine%controller%sample_time - state%clock
    end if
    next = min(next, next_impulse(machine, state))
  end function next_action

  pure real(wp) function next_impulse(machine, state) result(next)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    next = huge(next)
    if (.not. allocated(machine%impulses)) return
    if (state%struck < size(machine%impulses)) next = machine%impulses(state%struck + 1)%time - state%clock
  end function next_impulse

  !> What is due now. `ok` is false if no mode is found that follows.
  pure subroutine act(moving, state, ok, log)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    logical, intent(out) :: ok
    type(log_t), intent(inout), optional :: log
    complex(wp) :: turning(moving%harmonics)
    turning = turning_at(moving%machine%frequency, state%time, moving%harmonics)
    if (next_impulse(moving%machine, state) <= state%time) then
      call give_impulse(moving, state, turning, ok, log)
    else
      call take_sample(moving, state, turning, ok)
    end if
  end subroutine act

  !> A sampled controller looks at the error, and holds its force until the next sample.
  pure subroutine take_sample(moving, state, turning, ok)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(out) :: ok
    real(wp) :: error, rate
    integer :: touching(most_joints)
    logical :: at_rest(most_joints)
    associate (machine => moving%machine, controller => moving%machine%controller)
      call error_of(machine, state, turning, error, rate)
      state%control = controller%proportional*error + controller%integral*state%integral + controller%derivative*rate
      state%integral = state%integral + controller%sample_time*error
      state%samples = state%samples + 1
      call held_joints(machine, state, at_rest, touching)
      ok = .true.
      if (any(at_rest) .or. any(touching /= 0)) call settle(moving, state, turning, at_rest, touching, ok)
    end associate
  end subroutine take_sample

  !> Joints that stick, and contacts that are closed.
  pure subroutine held_joints(machine, state, at_rest, touching)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    logical, intent(out) :: at_rest(most_joints)
    integer, intent(out) :: touching(most_joints)
    integer :: j
    at_rest = .false.
    touching = 0
    do j = 1, size(machine%joints)
      at_rest(j) = machine%joints(j)%kind == joint_friction .and. state%phase(j) == 0
      if (machine%joints(j)%kind == joint_contact) touching(j) = state%phase(j)
    end do
  end subroutine held_joints

  !> The next impulse, which finite friction has no part in. Closed contacts that it presses are struck.
  pure subroutine give_impulse(moving, state, turning, ok, log)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp), intent(in) :: turning(:)
    logical, intent(out) :: ok
    type(log_t), intent(inout), optional :: log
    type(multibody_state_t) :: before, pushed
    integer :: touching(most_joints), j
    logical :: at_rest(most_joints), strikes
    real(wp) :: speed(most_joints), lost, s, u
    before = state
    ok = .true.
    associate (machine => moving%machine, n => moving%machine%n)
      state%struck = state%struck + 1
      associate (impulse => machine%impulses(state%struck))
        state%v(:n) = state%v(:n) + impulse%amount*matmul(machine%mobility, impulse%row)
      end associate
      pushed = state
      call held_joints(machine, before, at_rest, touching)
      strikes = .false.
      do j = 1, size(machine%joints)
        if (touching(j) == 0) cycle
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        strikes = strikes .or. touching(j)*u > machine%negligible_speed
      end do
      if (strikes) call apply_impact(machine, state, turning, touching, .false., speed, lost, ok)
      at_rest = .false.
      call assess_friction(machine, before, turning, .true., state, at_rest)
      if (ok) call settle(moving, state, turning, at_rest, touching, ok)
      if (.not. present(log) .or. .not. ok) return
      log%balance%work = log%balance%work + energy_of_multibody(machine, pushed) - energy_of_multibody(machine, before)
      call balance_change(machine, pushed, state, log)
      call record_change(machine, event_impulse, before, state, log)
      ! Instead of a joint stands the number after the last.
      call put_column(log%event_joint, log%events, &
                      [count(machine%joints%kind /= joint_section) + 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp])
    end associate
  end subroutine give_impulse

end module timed_actions
