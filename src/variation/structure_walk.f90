! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The motion of a structure from one section to the next, with its events. Of a machine without a clock the section is an event
!> itself.
module structure_walk
  use guards, only: leaves, lets_go, meets_lower, meets_upper, slide_ends, slides_down, slides_up
  use hybrid_machine, only: event_t
  use multibody, only: joint_contact, joint_elastic, joint_friction, joint_soft, most_joints
  use multibody_motion, only: advance_multibody_period, advance_to_turn, start_multibody
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, event_turning_point, &
    reset_tally, state_t, tally_t
  use structure, only: coordinates_of, settle, state_in, structure_t
  use structure_modes, only: count_joints, mode_number
  use transition_list, only: transition_t, transitions_t
  use turn_section, only: longest_return
  implicit none
  private

  public :: start_of_structure, advance_to_section, advance_section, fly_structure_on

  !> A section point as near as this, in natural sizes, to what a joint holds is held.
  real(wp), parameter :: held_within = 1e-10_wp

contains

  !> The state with the coordinates `point` on the section, on what its joints hold if it is all but there. `ok` is false for one
  !> beyond a stop.
  pure subroutine start_of_structure(structure, point, state, ok)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: point(:)
    type(multibody_state_t), intent(out) :: state
    logical, intent(out) :: ok
    type(multibody_state_t) :: raw
    real(wp) :: y(structure%n), by_state(structure%n, structure%n), by_time(structure%n), s, u, length, speed
    complex(wp) :: turning(structure%frame%moving%harmonics)
    integer :: j, k
    length = structure%size_of(1)
    speed = structure%size_of(structure%positions + 1)
    associate (moving => structure%frame%moving, machine => structure%frame%moving%machine)
      y = point
      raw = state_in(structure, mode_number(machine, [(0, j=1, most_joints)]), 0.0_wp, y)
      turning = turning_at(machine%frequency, 0.0_wp, moving%harmonics)
      ok = .true.
      do j = 1, count_joints(machine)
        associate (joint => machine%joints(j))
          call joint_motion(machine, j, raw%q, raw%v, 0.0_wp, turning, s, u)
          select case (joint%kind)
          case (joint_friction)
            raw%phase(j) = merge(0, 1, abs(u) <= held_within*speed)
          case (joint_contact)
            ok = ok .and. s < joint%upper + 1e-6_wp*length .and. s > joint%lower - 1e-6_wp*length
            if (abs(s - joint%upper) <= held_within*length .and. abs(u) <= held_within*speed) raw%phase(j) = 1
            if (abs(s - joint%lower) <= held_within*length .and. abs(u) <= held_within*speed) raw%phase(j) = -1
          case (joint_elastic)
            k = structure%positions + structure%frame%speeds + findloc(structure%frame%elastic, j, 1)
            associate (limit => joint%friction%kinetic/joint%stiffness)
              raw%phase(j) = 0
              if (abs(point(k)) >= limit*(1 - held_within) .and. point(k)*u > 0) raw%phase(j) = merge(1, -1, u > 0)
            end associate
          end select
        end associate
      end do
      if (.not. ok) return
      call settle(structure, mode_number(machine, raw%phase), 0.0_wp, y, by_state, by_time)
      raw = state_in(structure, mode_number(machine, raw%phase), 0.0_wp, y)
      call start_multibody(moving, raw%q(:machine%n), raw%v(:machine%n), 0.0_wp, state, ok)
      do k = 1, size(structure%frame%elastic)
        j = structure%frame%elastic(k)
        state%slider(j) = raw%slider(j)
        state%phase(j) = raw%phase(j)
      end do
      if (.not. structure%has_clock) then
        state%phase(moving%section) = -1
        state%left(moving%section) = 1
      end if
    end associate
  end subroutine start_of_structure

  !> The event that a transition is, `offset` [s] after the section that the motion began at.
  pure function event_of(structure, transition, offset) result(event)
    type(structure_t), intent(in) :: structure
    type(transition_t), intent(in) :: transition
    real(wp), intent(in) :: offset
    type(event_t) :: event
    integer :: j
    associate (machine => structure%frame%moving%machine, before => transition%before, after => transition%after)
      j = transition%joint
      event%joint = j
      event%guard = transition%meaning
      event%before = mode_number(machine, before%phase)
      event%after = mode_number(machine, after%phase)
      event%time = offset + before%time
      event%arrival(:structure%n) = coordinates_of(structure, before)
      event%departure(:structure%n) = coordinates_of(structure, after)
      event%side = sign(1, before%phase(j))
      select case (transition%meaning)
      case (slide_ends)
        event%kind = merge(event_stick, event_turning_point, after%phase(j) == 0)
      case (slides_up, slides_down)
        event%kind = event_release
        event%side = merge(1, -1, transition%meaning == slides_up)
      case (meets_upper, meets_lower)
        event%side = merge(1, -1, transition%meaning == meets_upper)
        if (machine%joints(j)%kind == joint_soft) then
          event%kind = merge(event_touch_upper, event_touch_lower, event%side > 0)
        else if (after%phase(j) /= 0) then
          event%kind = merge(event_chatter_upper, event_chatter_lower, event%side > 0)
        else
          event%kind = merge(event_impact_upper, event_impact_lower, event%side > 0)
        end if
      case (lets_go)
        event%kind = event_barrier_release
      case (leaves)
        event%kind = event_separation
      end select
    end associate
  end function event_of

  !> Flies a structure on over one section, in which time `lasted` [s] passes; `reason` is not 0 if the motion had to be given up.
  pure subroutine advance_to_section(structure, state, lasted, tally, reason, transitions)
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(out) :: lasted
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(transitions_t), intent(inout), optional :: transitions
    associate (moving => structure%frame%moving)
      if (structure%has_clock) then
        call advance_multibody_period(moving, state, tally, reason, transitions=transitions)
        lasted = moving%machine%period
      else
        call advance_to_turn(moving, longest_return*moving%machine%period, state, lasted, tally, reason, transitions)
      end if
    end associate
  end subroutine advance_to_section

  !> Flies a structure on over one section: the transitions become events, whose times count on from `offset` [s], which becomes the
  !> time of the section. `reason` is not 0 if the motion had to be given up, `certain` false where a transition is not known to be
  !> smooth.
  pure subroutine advance_section(structure, state, offset, events, count_events, tally, reason, certain)
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(inout) :: offset
    type(event_t), allocatable, intent(inout) :: events(:)
    integer, intent(inout) :: count_events
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    logical, intent(inout) :: certain
    type(transitions_t) :: transitions
    type(event_t), allocatable :: more(:)
    real(wp) :: lasted
    integer :: i
    call advance_to_section(structure, state, lasted, tally, reason, transitions)
    if (reason /= 0) return
    if (count_events + transitions%count > size(events)) then
      allocate (more(2*(count_events + transitions%count)))
      more(:count_events) = events(:count_events)
      call move_alloc(more, events)
    end if
    do i = 1, transitions%count
      count_events = count_events + 1
      events(count_events) = event_of(structure, transitions%list(i), offset)
      certain = certain .and. transitions%list(i)%certain
    end do
    offset = offset + lasted
  end subroutine advance_section

  !> Flies a structure from a section point over so many sections: where it then is, the mode in which it began, and the events on
  !> the way, those of an event section too. `ok` is false if the trajectory had to be given up; `certain` is false where
  !> transitions were not of one guard alone.
  pure subroutine fly_structure_on(structure, point, sections, image, events, mode, tally, ok, certain)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    logical, intent(out), optional :: certain
    type(multibody_state_t) :: state
    type(state_t) :: watched
    real(wp) :: offset
    integer :: i, count_events, reason
    logical :: smooth
    image = point
    allocate (events(8))
    count_events = 0
    smooth = .true.
    mode = 0
    offset = 0
    call start_of_structure(structure, point, state, ok)
    if (ok) then
      mode = mode_number(structure%frame%moving%machine, state%phase)
      watched%x = state%q(structure%frame%moving%machine%watched)
      watched%v = state%v(structure%frame%moving%machine%watched)
      call reset_tally(tally, watched, .false.)
      do i = 1, sections
        call advance_section(structure, state, offset, events, count_events, tally, reason, smooth)
        ok = reason == 0
        if (.not. ok) exit
      end do
    end if
    if (ok) image = coordinates_of(structure, state)
    events = events(:count_events)
    if (present(certain)) certain = smooth
  end subroutine fly_structure_on

end module structure_walk
