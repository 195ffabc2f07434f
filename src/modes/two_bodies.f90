! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a structure is called where one body drives the watched one through friction and stops: its mode, and how the driving
!> body moves.
module two_bodies
  use multibody, only: harmonics_in, is_stop, joint_contact, joint_friction, multibody_t, wave_value
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use mode_flow, only: harmonics_of
  use motion_state, only: mode_held, mode_lower_barrier, mode_slip_minus, mode_slip_plus, mode_stick, mode_upper_barrier, sticks_in
  implicit none
  private

  public :: driver_now, mode_of_two, slides_on, contact_at, keeps_within

contains

  !> Position and velocity of the driving body.
  pure function driver_now(machine, state) result(motion)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp) :: motion(2)
    complex(wp) :: turning(harmonics_in(machine%driver%motion))
    associate (driver => machine%driver)
      if (driver%at > 0) then
        motion = [state%q(driver%at), state%v(driver%at)]
      else
        turning = turning_at(machine%frequency, state%time, size(turning))
        call wave_value(driver%motion, machine%frequency, state%time, turning, motion(1), motion(2))
        motion(1) = motion(1) + driver%motion%rate*state%clock
      end if
    end associate
  end function driver_now

  !> Number of the joint that is the stops, 0 without any.
  pure integer function contact_at(machine) result(at)
    type(multibody_t), intent(in) :: machine
    at = findloc(is_stop(machine%joints%kind), .true., 1)
  end function contact_at

  !> Whether the watched body is between its stops, if these are rigid, but for rounding.
  pure logical function keeps_within(machine, state)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp) :: turning(harmonics_of(machine))
    real(wp) :: s, u, near
    integer :: j
    keeps_within = .true.
    j = contact_at(machine)
    if (j == 0) return
    if (machine%joints(j)%kind /= joint_contact) return
    associate (joint => machine%joints(j))
      turning = turning_at(machine%frequency, state%time, size(turning))
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      near = 16*epsilon(1.0_wp)*(abs(s) + sum(abs(joint%row*state%q(:machine%n))))
      keeps_within = s <= joint%upper + near .and. s >= joint%lower - near
    end associate
  end function keeps_within

  !> The mode of both bodies: they slip by the sign of v1 - v2, stick, the watched one leans on its stop on the ground while the
  !> other slides on, or both are held there.
  pure integer function mode_of_two(machine, state) result(mode)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp) :: driver(2)
    integer :: friction, contact, sense, side
    friction = findloc(machine%joints%kind, joint_friction, 1)
    contact = contact_at(machine)
    side = 0
    if (contact > 0) then
      if (machine%joints(contact)%kind == joint_contact) side = state%phase(contact)
    end if
    if (side /= 0 .and. machine%driver%carries) then
      sense = 0
    else if (friction > 0) then
      sense = -state%phase(friction)
    else
      driver = driver_now(machine, state)
      sense = merge(1, -1, driver(2) >= state%v(machine%watched))
    end if
    if (side /= 0 .and. sense /= 0) then
      ! Stops without room bear on either side.
      if (.not. machine%joints(contact)%upper > machine%joints(contact)%lower) side = sense
    end if
    if (side /= 0 .and. .not. machine%driver%carries) then
      mode = mode_held
      if (sense /= 0) mode = merge(mode_upper_barrier, mode_lower_barrier, side > 0)
    else if (sense == 0) then
      mode = mode_stick
    else
      mode = merge(mode_slip_plus, mode_slip_minus, sense > 0)
    end if
  end function mode_of_two

  !> Whether the one body slides over the other.
  pure logical function slides_on(machine, state)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    slides_on = .not. sticks_in(mode_of_two(machine, state), .true.)
  end function slides_on

end module two_bodies
