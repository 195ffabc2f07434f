! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What follows from the samples of a log: the foot of the spring, contact forces, kinetic energy.
module motion_history
  use contact_law, only: contact_at_speed, force_on_body
  use drive_law, only: foot_motion
  use multibody, only: integral_of
  use kinds, only: wp
  use machine_facts, only: has_driver, stops_of
  use motion, only: motion_t
  use motion_state, only: log_t
  implicit none
  private

  public :: contact_forces, foot_positions, kinetic_energies

contains

  !> Forces of soft barriers on the body [N] at the samples.
  pure function contact_forces(moving, log) result(forces)
    type(motion_t), intent(in) :: moving
    type(log_t), intent(in) :: log
    real(wp) :: forces(log%samples)
    real(wp), allocatable :: position(:, :)
    position = log%sample_data(2:3, :log%samples)
    if (has_driver(moving)) then
      if (moving%multibody%machine%driver%carries) position = position - log%sample_driver(:, :log%samples)
    end if
    forces = force_on_body(contact_at_speed(stops_of(moving), log%sample_touch(1, :log%samples)), position(1, :), position(2, :))
  end function contact_forces

  !> Positions of the foot of the spring [m] at the samples of a motion that began at `crank_angle` [rad].
  pure function foot_positions(moving, crank_angle, log) result(foot)
    type(motion_t), intent(in) :: moving
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    real(wp) :: foot(log%samples)
    integer :: i
    do i = 1, log%samples
      call foot_motion(moving%machine%drive, crank_angle + moving%machine%drive_frequency*log%sample_data(1, i), foot(i))
    end do
  end function foot_positions

  !> Kinetic energy [J] at the samples: that of a body whose motion is given is left out.
  pure function kinetic_energies(moving, log) result(kinetic)
    type(motion_t), intent(in) :: moving
    type(log_t), intent(in) :: log
    real(wp) :: kinetic(log%samples)
    real(wp), allocatable :: velocity(:)
    integer :: i
    if (allocated(moving%multibody)) then
      associate (machine => moving%multibody%machine)
        do i = 1, log%samples
          velocity = log%sample_coordinates(machine%n + 1:, i)
          if (integral_of(machine) > 0) velocity(integral_of(machine)) = 0
          kinetic(i) = 0.5_wp*sum(velocity*matmul(machine%mass, velocity))
        end do
      end associate
      return
    end if
    kinetic = 0.5_wp*moving%machine%mass*log%sample_data(3, :log%samples)**2
  end function kinetic_energies

end module motion_history
