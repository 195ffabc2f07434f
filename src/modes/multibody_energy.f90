! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Energy of a multibody structure, and the powers that change it.
module multibody_energy
  use control, only: active_force, bodies_of
  use contact_law, only: contact_at_speed, contact_force, contact_t
  use multibody, only: joint_bristle, joint_contact, joint_soft, joint_spring, joint_t, multibody_t, most_joints, wave_value
  use multibody_state, only: free_force, is_held, joint_energy, joint_force, joint_motion, multibody_state_t, factor_now, &
    turning_at
  use kinds, only: wp
  use matrices, only: solve
  use mode_flow, only: harmonics_of, mode_flow_t
  use motion_state, only: sample_time, state_t
  implicit none
  private

  public :: energy_of_multibody, powers, work_of_stops

contains

  !> Energy of the bodies, the springs and the springs of the joints [J]; a constant force has that of its weight. Of two bodies
  !> (`driver_t`) what presses a stop and the drive have none.
  pure real(wp) function energy_of_multibody(machine, state) result(energy)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    complex(wp) :: turning(harmonics_of(machine))
    type(multibody_state_t) :: bodies
    real(wp) :: s, u
    integer :: j
    turning = turning_at(machine%frequency, state%time, size(turning))
    bodies = bodies_of(machine, state)
    associate (q => bodies%q(:machine%n), v => bodies%v(:machine%n))
      energy = 0.5_wp*sum(v*matmul(machine%mass, v)) + 0.5_wp*sum(q*matmul(machine%stiffness, q)) - sum(machine%load*q)
      if (has_continuous_control(machine)) then
        associate (controller => machine%controller)
          energy = energy - 0.5_wp*sum(q*matmul(controller%stiffness, q)) + sum(controller%load*q)
        end associate
      end if
    end associate
    energy = energy + machine%rest_energy
    if (allocated(machine%driver)) then
      energy = energy + sum(machine%driver%push*state%q(:machine%n))
      return
    end if
    do j = 1, size(machine%joints)
      call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
      energy = energy + joint_energy(machine%joints(j), state%phase(j), state%slider(j), s)
    end do
  end function energy_of_multibody

  !> Whether the matrices of a machine have a controller in them.
  pure logical function has_continuous_control(machine)
    type(multibody_t), intent(in) :: machine
    has_continuous_control = .false.
    if (allocated(machine%controller)) has_continuous_control = .not. machine%controller%sample_time > 0
  end function has_continuous_control

  !> Powers lost to friction, dampers and contacts, and put in by forces and moving surfaces [W].
  pure subroutine powers(machine, flow, state, friction, damping, contact, work)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(out) :: friction, damping, contact, work
    complex(wp) :: turning(harmonics_of(machine))
    real(wp) :: force(machine%n), held(most_joints), curvature(most_joints), s, u, r, value, rate, &
      factor(0:2)
    type(multibody_state_t) :: bodies
    integer :: i, j, m
    turning = turning_at(machine%frequency, state%time, size(turning))
    bodies = bodies_of(machine, state)
    associate (v => bodies%v(:machine%n))
      damping = sum(v*matmul(machine%damping, v))
      work = 0
      if (has_continuous_control(machine)) damping = damping - sum(v*matmul(machine%controller%damping, v))
      if (allocated(machine%controller)) work = sum(v*active_force(machine, state))
      if (allocated(machine%driver)) work = work + sum(v*machine%driver%push)
      do m = 1, size(machine%force, 2)
        work = work + sum(v*real(machine%force(:, m)*turning(m)))
      end do
    end associate
    friction = 0
    contact = 0
    call free_force(machine, state, turning, force)
    do i = 1, size(flow%held)
      call wave_value(machine%joints(flow%held(i))%offset, machine%frequency, state%time, turning, value, rate, curvature(i))
    end do
    associate (h => size(flow%held))
      held(:h) = -matmul(flow%reaction, force) - matmul(flow%hold, curvature(:h))
    end associate
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        call wave_value(joint%offset, machine%frequency, state%time, turning, value, rate)
        if (is_held(joint, state%phase(j))) then
          i = findloc(flow%held, j, 1)
          if (i > 0) work = work - held(i)*rate
          cycle
        end if
        call joint_motion(machine, j, state%q, state%v, state%time, turning, s, u)
        call factor_now(machine, j, state, turning, factor)
        call joint_force(joint, state%phase(j), state%slider(j), state%touch_speed(j), s, u, factor(0), r)
        work = work - r*rate
        if (allocated(joint%strength) .or. (joint%kind == joint_spring .and. allocated(joint%load))) work = work + r*u
        if (joint%kind == joint_bristle) then
          friction = friction - r*merge(s, u, joint%memory%on_deflection)
        else if (joint%kind == joint_soft) then
          if (allocated(machine%driver)) then
            contact = contact - r*u
          else if (abs(state%phase(j)) == 1) then
            contact = contact + damping_of_contact(joint, state%phase(j), state%touch_speed(j), s, u)
          end if
        else if (state%phase(j) /= 0 .and. joint%kind /= joint_spring) then
          friction = friction - r*u
        end if
      end associate
    end do
  end subroutine powers

  !> Power lost in a pressed contact [W].
  pure real(wp) function damping_of_contact(joint, phase, touch_speed, s, u) result(power)
    type(joint_t), intent(in) :: joint
    integer, intent(in) :: phase
    real(wp), intent(in) :: touch_speed, s, u
    type(contact_t) :: law
    real(wp) :: p
    law = contact_at_speed(joint%contact, touch_speed)
    p = merge(s - joint%upper, joint%lower - s, phase > 0)
    power = (contact_force(law, p, phase*u) - contact_force(law, p, 0.0_wp))*phase*u
  end function damping_of_contact

  !> Work that stops which move have done in an impact [J]: the impulses of all contacts at their stops give the change of the
  !> speeds.
  pure real(wp) function work_of_stops(machine, before, after) result(work)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: before, after
    complex(wp) :: turning(harmonics_of(machine))
    real(wp), dimension(machine%n, most_joints) :: row, kick
    real(wp), dimension(most_joints) :: rate, impulse
    real(wp) :: value, s, u, near
    integer :: j, k
    logical :: found
    work = 0
    k = 0
    turning = turning_at(machine%frequency, before%time, size(turning))
    associate (n => machine%n)
      do j = 1, size(machine%joints)
        associate (joint => machine%joints(j))
          if (joint%kind /= joint_contact) cycle
          call joint_motion(machine, j, before%q, before%v, before%time, turning, s, u)
          near = 1e-9_wp*max(machine%length_scale, sum(abs(joint%row*before%q(:n))))
          if (s < joint%upper - near .and. s > joint%lower + near) cycle
          k = k + 1
          row(:, k) = joint%row
          kick(:, k) = matmul(machine%mobility, joint%row)
          call wave_value(joint%offset, machine%frequency, before%time, turning, value, rate(k))
        end associate
      end do
      if (.not. any(abs(rate(:k)) > 0)) return
      call solve(matmul(transpose(row(:, :k)), kick(:, :k)), matmul(after%v(:n) - before%v(:n), row(:, :k)), impulse(:k), found)
      if (found) work = -sum(rate(:k)*impulse(:k))
    end associate
  end function work_of_stops

end module multibody_energy
