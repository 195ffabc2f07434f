! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether the bearing holds a crank for good. The foot of the spring then stands still, and the energy of the body, which only
!> falls, bounds every load on the crank that is to come.
module held_crank
  use elementary, only: sine_cosine
  use kinds, only: wp
  use motion_state, only: state_t
  use motor_now, only: node_values
  use motor_rest, only: equation_mode, slips
  use motor_state, only: motor_state_t
  use motor_system, only: motor_system_t, y_at
  implicit none
  private

  public :: held_for_good, torque_when_held

contains

  !> Whether the crank is held and stays so, and the body rests or comes to rest.
  pure logical function held_for_good(system, state, crank) result(held)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: torques(2), loads(2)
    logical :: known
    held = .false.
    if (system%clock .or. crank%turning /= 0 .or. crank%ramps .or. system%stiffness < 0) return
    if (slips(state%mode) .and. .not. max(system%friction%damping, system%friction%kinetic) > 0) return
    call torques_to_come(system, state, crank, torques, known)
    if (.not. known) return
    loads = loads_to_come(system, state, crank)
    held = maxval(torques) - minval(loads) <= system%crank_level .and. maxval(loads) - minval(torques) <= system%crank_level
  end function held_for_good

  !> Torque of the motor at the end, the crank being held for good [N m].
  pure real(wp) function torque_when_held(system, state, crank) result(torque)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: torques(2)
    logical :: known
    call torques_to_come(system, state, crank, torques, known)
    torque = torques(2)
  end function torque_when_held

  !> Torque of the motor now and at the end [N m]: its own state goes monotonically to where its rate vanishes, or, of a speed
  !> control, to the limit.
  pure subroutine torques_to_come(system, state, crank, torques, known)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp), intent(out) :: torques(2)
    logical, intent(out) :: known
    real(wp) :: torque(0:1), rate(0:1), values(system%sheet%tape%count)
    type(motor_state_t) :: other
    integer :: i
    values = node_values(system, state, crank)
    torques = values(system%torque)
    known = .true.
    if (.not. system%control%has_own) return
    other = crank
    do i = 0, 1
      other%own(1) = i
      values = node_values(system, state, other)
      torque(i) = values(system%torque)
      rate(i) = values(system%flights(equation_mode(slips(state%mode), .false.), 0)%rates(y_at))
    end do
    if (system%control%torque_limit > 0) then
      if (abs(rate(0)) > 0) torques(2) = sign(system%control%torque_limit, rate(0))
    else if (abs(rate(1) - rate(0)) > 0) then
      torques(2) = torque(0) - (torque(1) - torque(0))*rate(0)/(rate(1) - rate(0))
    else
      known = .not. (abs(torque(1) - torque(0)) > 0 .and. abs(rate(0)) > 0)
    end if
  end subroutine torques_to_come

  !> Bounds of the load on the crank from now on [N m]: of a body at rest it does not change.
  pure function loads_to_come(system, state, crank) result(loads)
    type(motor_system_t), intent(in) :: system
    type(state_t), intent(in) :: state
    type(motor_state_t), intent(in) :: crank
    real(wp) :: loads(2), values(system%sheet%tape%count), force, most, sine, cosine
    values = node_values(system, state, crank)
    if (.not. slips(state%mode)) then
      loads = values(system%torque) - values(system%crank_hold(equation_mode(.false., .false.)))
      return
    end if
    associate (energy => max(values(system%energy), 0.0_wp), law => system%friction)
      force = sqrt(2*system%stiffness*energy)
      if (system%moment > 0) then
        call sine_cosine(crank%phi, sine, cosine)
        force = force + law%damping*sqrt(2*energy/system%mass) + max(law%break_away, law%kinetic + law%excess)
        most = system%moment*abs(sine)*force/system%mass
      else
        most = force*abs(values(system%foot_slope))
      end if
    end associate
    loads = [-most, most]
  end function loads_to_come

end module held_crank
