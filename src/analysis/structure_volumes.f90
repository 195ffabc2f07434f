! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> How volumes of the states of a structure change along a motion, by a formula: the sum of its exponents.
module structure_volumes
  use elementary, only: logarithm
  use exponents, only: spectrum_t
  use hybrid_machine, only: event_t
  use kinds, only: wp
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, event_touch_lower, &
    event_touch_upper, event_turning_point
  use multibody, only: joint_contact, joint_soft
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use structure, only: state_in, structure_t
  implicit none
  private

  public :: has_exact_sum, note_events, note_sum

contains

  !> Whether volumes change by a formula: linear damping, constant restitutions, friction that does not depend on the speed; no
  !> contact that is a spring.
  pure logical function has_exact_sum(structure)
    type(structure_t), intent(in) :: structure
    associate (machine => structure%frame%moving%machine)
      has_exact_sum = machine%linear .and. structure%has_clock .and. structure%positions == machine%n .and. &
                      .not. any(machine%joints%kind == joint_soft) .and. size(structure%frame%elastic) == 0
      if (size(machine%joints) > 0) has_exact_sum = has_exact_sum .and. &
        .not. any(machine%joints%kind == joint_contact .and. machine%joints%contact%kind /= 0)
    end associate
  end function has_exact_sum

  !> Adds the logarithms by which the events of a section change volumes; what is neither an impact nor a turning point has no
  !> formula.
  subroutine note_events(structure, events, spectrum)
    type(structure_t), intent(in) :: structure
    type(event_t), intent(in) :: events(:)
    type(spectrum_t), intent(inout) :: spectrum
    real(wp) :: e
    integer :: k
    do k = 1, size(events)
      associate (event => events(k))
        select case (event%kind)
        case (event_impact_upper, event_impact_lower)
          spectrum%impacts = spectrum%impacts + 1
          e = structure%frame%moving%machine%joints(event%joint)%contact%restitution
          if (e > 0) spectrum%sum_exact = spectrum%sum_exact + 2*logarithm(e)
          if (.not. e > 0) spectrum%has_sum = .false.
          spectrum%has_sum = spectrum%has_sum .and. event%before == event%after
        case (event_touch_upper, event_touch_lower)
          spectrum%impacts = spectrum%impacts + 1
        case (event_chatter_upper, event_chatter_lower)
          ! The impact with which the contact closes.
          spectrum%impacts = spectrum%impacts + 1
          spectrum%has_sum = .false.
        case (event_turning_point)
          spectrum%sum_exact = spectrum%sum_exact &
            + logarithm(abs(slide_rate(structure, event, event%after, event%departure)/ &
                            slide_rate(structure, event, event%before, event%arrival)))
        case default
          spectrum%has_sum = .false.
        end select
      end associate
    end do
  end subroutine note_events

  !> The sum by its formula, from that of the events of a motion of so long a duration [s].
  pure subroutine note_sum(structure, duration, left, spectrum)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: duration
    integer, intent(in) :: left
    type(spectrum_t), intent(inout) :: spectrum
    spectrum%sum_exact = spectrum%sum_exact/duration - damping_rate(structure)
    spectrum%has_sum = spectrum%has_sum .and. left == structure%n
  end subroutine note_sum

  !> Trace of the damping over the masses [1/s].
  pure real(wp) function damping_rate(structure)
    type(structure_t), intent(in) :: structure
    integer :: i
    damping_rate = 0
    associate (machine => structure%frame%moving%machine)
      do i = 1, machine%n
        damping_rate = damping_rate + sum(machine%mobility(i, :)*machine%damping(:, i))
      end do
    end associate
  end function damping_rate

  !> Acceleration of the joint of an event in a mode [m/s^2].
  pure real(wp) function slide_rate(structure, event, mode, y)
    type(structure_t), intent(in) :: structure
    type(event_t), intent(in) :: event
    integer, intent(in) :: mode
    real(wp), intent(in) :: y(:)
    type(multibody_state_t) :: state
    real(wp) :: slope(structure%n), s, u, given
    associate (machine => structure%frame%moving%machine, p => structure%positions)
      state = state_in(structure, mode, event%time, y(:structure%n))
      slope = structure%slope(mode, event%time, y(:structure%n))
      call joint_motion(machine, event%joint, state%q, state%v, event%time, &
                        turning_at(machine%frequency, event%time, structure%frame%moving%harmonics), s, u, given)
      slide_rate = sum(machine%joints(event%joint)%row* &
                       matmul(structure%frame%velocities, slope(p + 1:p + structure%frame%speeds))) + given
    end associate
  end function slide_rate

end module structure_volumes
