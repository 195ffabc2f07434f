! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a transition of a multibody structure is reported as: its events, and what it does to the energy.
module transition_log
  use chatter, only: rest_of_chatter
  use guards, only: joint_guard_t, leaves, lets_go, meets_lower, meets_upper, slide_ends, slides_down, slides_up
  use multibody, only: joint_contact, joint_friction, joint_soft, multibody_t
  use multibody_flows, only: multibody_motion_t
  use multibody_log, only: balance_change, log_event
  use multibody_state, only: multibody_state_t, turning_at
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, &
    event_turning_point, log_t
  use still_joints, only: stand_still
  use timed_actions, only: next_action
  implicit none
  private

  public :: log_transition, log_action

contains

  !> Events and losses of a transition. Friction sticks or is released as it stops to move or begins to, whatever its force.
  pure subroutine log_transition(moving, before, after, list, triggered, log)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: before, after
    type(joint_guard_t), intent(in) :: list(:)
    logical, intent(in) :: triggered(:)
    type(log_t), intent(inout) :: log
    type(multibody_state_t) :: struck
    complex(wp) :: turning(moving%harmonics)
    logical, dimension(size(moving%machine%joints)) :: reported, stood, stands
    real(wp) :: rest
    integer :: g, j, kind
    associate (machine => moving%machine)
      struck = after
      struck%time = before%time
      call balance_change(machine, before, struck, log)
      turning = turning_at(machine%frequency, before%time, moving%harmonics)
      stood = stand_still(machine, before, turning)
      stands = stand_still(machine, struck, turning)
      reported = .false.
      do g = 1, size(list)
        if (.not. triggered(g)) cycle
        j = list(g)%joint
        select case (list(g)%meaning)
        case (slide_ends)
          kind = merge(event_stick, event_turning_point, stands(j))
        case (slides_up, slides_down)
          if (stands(j)) cycle
          kind = event_release
        case (meets_upper, meets_lower)
          kind = merge(event_impact_upper, event_impact_lower, list(g)%meaning == meets_upper)
          if (machine%joints(j)%kind == joint_soft) then
            kind = merge(event_touch_upper, event_touch_lower, list(g)%meaning == meets_upper)
          end if
        case (lets_go)
          if (after%phase(j) /= 0) cycle
          kind = event_barrier_release
        case (leaves)
          kind = event_separation
        case default
          cycle
        end select
        reported(j) = .true.
        call log_event(machine, kind, j, before, struck, log)
        if (machine%joints(j)%kind == joint_contact .and. after%phase(j) /= 0 .and. before%phase(j) == 0 .and. &
            machine%joints(j)%contact%restitution > 0 .and. machine%joints(j)%upper > machine%joints(j)%lower) then
          kind = merge(event_chatter_upper, event_chatter_lower, after%phase(j) > 0)
          rest = rest_of_chatter(moving, before, turning, j, after%phase(j))
          ! In a row the impacts of others can take the rebound away.
          if (.not. rest > 0 .and. count(machine%joints%kind == joint_contact) > 1) cycle
          ! Reported at the instant where the impacts accumulate, even where the clock stops before it; what is given or sampled
          ! first comes first.
          call log_event(machine, kind, j, struck, struck, log, at=min(before%time + rest, next_action(machine, before)))
        end if
      end do
      ! What an impact or a cascade does to other joints.
      call log_friction(machine, before, struck, stood, stands, reported, log)
    end associate
  end subroutine log_transition

  !> Friction that holds from here on, or no longer, where that is not `reported` yet; of two bodies it is part of its cause.
  pure subroutine log_friction(machine, before, after, stood, stands, reported, log)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: before, after
    logical, intent(in) :: stood(:), stands(:), reported(:)
    type(log_t), intent(inout) :: log
    integer :: j
    if (allocated(machine%driver)) return
    do j = 1, size(machine%joints)
      if (reported(j) .or. machine%joints(j)%kind /= joint_friction .or. (stood(j) .eqv. stands(j))) cycle
      call log_event(machine, merge(event_stick, event_release, stands(j)), j, before, after, log)
    end do
  end subroutine log_friction

  !> What the sample of a controller or an impulse does to joints: friction holds or lets go, contacts open.
  pure subroutine log_action(moving, before, after, log)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: before, after
    type(log_t), intent(inout) :: log
    complex(wp) :: turning(moving%harmonics)
    logical :: reported(size(moving%machine%joints))
    integer :: j
    associate (machine => moving%machine)
      turning = turning_at(machine%frequency, before%time, moving%harmonics)
      reported = .false.
      call log_friction(machine, before, after, stand_still(machine, before, turning), stand_still(machine, after, turning), &
                        reported, log)
      do j = 1, size(machine%joints)
        if (machine%joints(j)%kind /= joint_contact .or. before%phase(j) == 0 .or. after%phase(j) /= 0) cycle
        call log_event(machine, event_barrier_release, j, before, after, log)
      end do
    end associate
  end subroutine log_action

end module transition_log
