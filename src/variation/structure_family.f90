! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure over a parameter of its laws, and the map from one section to the next with derivatives by the start and by the
!> parameter. Of a machine without a clock the section is an event, and the time to it changes with both.
module structure_family
  use body_family, only: family_t, likeness, place_neighbour, share, sides_tried
  use build_motion, only: machine_of
  use errors, only: error_t, fail
  use guarded_march, only: most_equations
  use guards, only: leaves, lets_go, meets_lower, meets_upper, slide_ends, slides_down, slides_up
  use hybrid_machine, only: event_t, most_states
  use jointed, only: integral_of, is_stop, joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, jointed_t, &
    most_joints
  use jointed_motion, only: advance_jointed_period, advance_to_turn, jointed_motion_t, prepare_jointed, start_jointed
  use jointed_section, only: start_of_jointed
  use jointed_state, only: joint_motion, jointed_state_t, turning_at
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t
  use motion, only: motion_t
  use motion_state, only: event_barrier_release, event_chatter_lower, event_chatter_upper, event_impact_lower, &
    event_impact_upper, event_release, event_separation, event_stick, event_touch_lower, event_touch_upper, event_turning_point, &
    flight_adaptive, reset_tally, state_t, tally_t
  use pair_as_structure, only: start_as_structure, structure_of_pair
  use status, only: exit_bad_case
  use structure, only: coordinates_of, count_joints, mode_number, phases_in, settle, state_in, structure_of, structure_t
  use timed_actions, only: acts_on_time
  use transition_list, only: transition_t, transitions_t
  use turn_section, only: longest_return
  use variations, only: neighbourhood_t, period_slope, vary
  implicit none
  private

  public :: structure_of_family, structure_neighbourhood, fly_structure, map_of_structure, why_not_varied, vary_section, &
    start_of_structure, state_at_start, advance_section, advance_to_section, least_dimension

  !> A section point as near as this, in natural sizes, to what a joint holds is held.
  real(wp), parameter :: held_within = 1e-10_wp

contains

  !> Why the variations of a structure are not known; '' if they are.
  pure function why_not_varied(moving) result(why)
    type(jointed_motion_t), intent(in) :: moving
    character(len=:), allocatable :: why
    type(structure_t) :: trial
    integer :: j
    why = ''
    trial = structure_of(moving, [1.0_wp, 1.0_wp])
    if (trial%n > most_states) why = 'it has too many coordinates'
    if (trial%n > most_equations/2 .and. (.not. moving%machine%linear .or. moving%options%flight == flight_adaptive)) then
      why = 'it has too many coordinates for a law that is not linear'
    end if
    if (acts_on_time(moving%machine)) why = 'impulses, or samples of a controller, come at times of their own'
    if (integral_of(moving%machine) > 0) why = 'a controller adds up what it sees'
    do j = 1, count_joints(moving%machine)
      associate (joint => moving%machine%joints(j))
        if (joint%contact%by_impact .and. joint%kind == joint_soft) why = 'the damping of a contact is set by each impact'
        if (abs(joint%offset%rate) > 0 .and. (is_stop(joint%kind) .or. joint%kind == joint_spring)) then
          why = 'a stop or a spring runs on with its surface'
        end if
        if (joint%kind /= joint_friction) cycle
        if (joint%friction%excess > 0 .and. joint%friction%stribeck_exponent < 1) why = 'a Stribeck law is vertical at rest'
        if (joint%friction%second_excess > 0 .and. joint%friction%second_exponent < 1) why = 'a Stribeck law is vertical at rest'
      end associate
    end do
  end function why_not_varied

  !> The structure with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  pure subroutine structure_of_family(family, value, structure, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(structure_t), intent(out) :: structure
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    character(len=:), allocatable :: why
    type(motion_t) :: moving
    type(jointed_t) :: machine
    real(wp) :: sizes(2)
    logical :: known
    laws = family%laws
    if (allocated(family%path)) call change_parameter(laws, family%path, value, known)
    call machine_of(laws, family%options, moving, error)
    if (allocated(error)) return
    if (allocated(moving%pair)) then
      call structure_of_pair(moving%pair%machine, machine, error)
      if (allocated(error)) return
      allocate (moving%jointed)
      call prepare_jointed(machine, family%options, moving%jointed)
    end if
    why = why_not_varied(moving%jointed)
    if (len(why) > 0) then
      call fail(error, exit_bad_case, 'body: the variations of this structure are not known: '//why)
      return
    end if
    associate (scales => moving%jointed%machine)
      sizes(1) = merge(scales%length_scale, 1.0_wp, scales%length_scale > 0)
      sizes(2) = sizes(1)*scales%frequency
    end associate
    if (family%sizes(1) > 0) sizes = family%sizes
    structure = structure_of(moving%jointed, sizes)
    if (allocated(moving%pair)) structure%pair = moving%pair%machine
  end subroutine structure_of_family

  !> The state at a start as `start_strobe` has it.
  pure type(jointed_state_t) function state_at_start(structure, start) result(state)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: start(:)
    real(wp), allocatable :: own(:)
    own = start
    if (allocated(structure%pair)) own = start_as_structure(structure%pair, start)
    state = start_of_jointed(structure%frame%moving, own(1), own(2), own(3), own(4:))
  end function state_at_start

  !> The structure and its neighbours in the parameter.
  pure subroutine structure_neighbourhood(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(out) :: machines
    type(error_t), allocatable, intent(out) :: error
    type(structure_t) :: centre, near(4)
    real(wp) :: there
    integer :: i, side
    call structure_of_family(family, value, centre, error)
    if (allocated(error)) return
    allocate (machines%centre, source=centre)
    if (.not. allocated(family%path)) return
    machines%step = share*max(abs(value), family%parameter_size)
    do side = 1, 3
      machines%side = sides_tried(side)
      if (allocated(error)) deallocate (error)
      do i = 1, 4
        call place_neighbour(family, value, machines, i, there, error)
        if (.not. allocated(error)) call structure_of_family(family, there, near(i), error)
        if (allocated(error)) exit
        near(i)%size_of = centre%size_of
      end do
      if (.not. allocated(error)) exit
    end do
    if (allocated(error)) return
    allocate (machines%near, source=near)
  end subroutine structure_neighbourhood

  !> The state with the coordinates `point` on the section, on what its joints hold if it is all but there. `ok` is false for one
  !> beyond a stop.
  pure subroutine start_of_structure(structure, point, state, ok)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: point(:)
    type(jointed_state_t), intent(out) :: state
    logical, intent(out) :: ok
    type(jointed_state_t) :: raw
    real(wp) :: y(structure%n), by_state(structure%n, structure%n), by_time(structure%n), s, u, length, speed
    complex(wp) :: turning(structure%frame%moving%harmonics)
    integer :: j, k
    length = structure%size_of(1)
    speed = structure%size_of(structure%places + 1)
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
            k = structure%places + machine%n + findloc(structure%frame%elastic, j, 1)
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
      call start_jointed(moving, raw%q(:machine%n), raw%v(:machine%n), 0.0_wp, state, ok)
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
    type(jointed_state_t), intent(inout) :: state
    real(wp), intent(out) :: lasted
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(transitions_t), intent(inout), optional :: transitions
    associate (moving => structure%frame%moving)
      if (structure%has_clock) then
        call advance_jointed_period(moving, state, tally, reason, transitions=transitions)
        lasted = moving%machine%period
      else
        call advance_to_turn(moving, longest_return*moving%machine%period, state, lasted, tally, reason, transitions)
      end if
    end associate
  end subroutine advance_to_section

  !> Flies a structure on over one section: the transitions become events, whose times count on from `offset` [s], which becomes the
  !> time of the section. `ok` is false if the motion had to be given up, `certain` where a transition is not known to be smooth.
  pure subroutine advance_section(structure, state, offset, events, count_events, tally, ok, certain)
    type(structure_t), intent(in) :: structure
    type(jointed_state_t), intent(inout) :: state
    real(wp), intent(inout) :: offset
    type(event_t), allocatable, intent(inout) :: events(:)
    integer, intent(inout) :: count_events
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    logical, intent(inout) :: certain
    type(transitions_t) :: transitions
    type(event_t), allocatable :: more(:)
    real(wp) :: lasted
    integer :: reason, i
    call advance_to_section(structure, state, lasted, tally, reason, transitions)
    ok = reason == 0
    if (.not. ok) return
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
  pure subroutine fly_structure(structure, point, sections, image, events, mode, tally, ok, certain)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    logical, intent(out), optional :: certain
    type(jointed_state_t) :: state
    type(state_t) :: watched
    real(wp) :: offset
    integer :: i, count_events
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
        call advance_section(structure, state, offset, events, count_events, tally, ok, smooth)
        if (.not. ok) exit
      end do
    end if
    if (ok) image = coordinates_of(structure, state)
    events = events(:count_events)
    if (present(certain)) certain = smooth
  end subroutine fly_structure

  !> Image of a section point after so many sections, its derivatives by the point (and by the parameter).
  pure subroutine map_of_structure(machines, point, sections, image, by_start, tally, ok, by_parameter)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: sections
    real(wp), intent(out) :: image(:), by_start(:, :)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(:)
    type(event_t), allocatable :: events(:)
    integer :: mode
    logical :: certain
    by_start = 0
    if (present(by_parameter)) by_parameter = 0
    image = point
    ok = .false.
    select type (structure => machines%centre)
    type is (structure_t)
      call fly_structure(structure, point, sections, image, events, mode, tally, ok, certain)
      ok = ok .and. certain
      if (.not. ok) return
      call vary_section(machines, structure, mode, point, events, sections, image, by_start, ok, by_parameter)
    end select
  end subroutine map_of_structure

  !> Directions that a motion leaves of its start: a joint that sticks takes one, a closed contact two, a slider one, an impact
  !> without rebound one, an event section one.
  pure integer function least_dimension(structure, mode, events) result(least)
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode
    type(event_t), intent(in) :: events(:)
    integer :: k
    least = dimension_in(mode)
    do k = 1, size(events)
      least = min(least, dimension_in(events(k)%after))
      if (leaves_no_speed(events(k))) least = min(least, max(dimension_in(events(k)%after) - 1, 0))
    end do
    if (.not. structure%has_clock) least = least - 1

  contains

    pure logical function leaves_no_speed(event)
      type(event_t), intent(in) :: event
      leaves_no_speed = any(event%guard == [meets_upper, meets_lower])
      associate (contact => structure%frame%moving%machine%joints(event%joint)%contact)
        if (leaves_no_speed) leaves_no_speed = contact%kind == 0 .and. .not. contact%restitution > 0
      end associate
    end function leaves_no_speed

    pure integer function dimension_in(number)
      integer, intent(in) :: number
      integer :: phase(most_joints), j
      associate (machine => structure%frame%moving%machine)
        phase = phases_in(machine, number)
        dimension_in = structure%n
        do j = 1, count_joints(machine)
          associate (kind => machine%joints(j)%kind)
            if (kind == joint_friction .and. phase(j) == 0) dimension_in = dimension_in - 1
            if (kind == joint_contact .and. phase(j) /= 0) dimension_in = dimension_in - 2
            if (kind == joint_elastic .and. phase(j) /= 0) dimension_in = dimension_in - 1
          end associate
        end do
        dimension_in = max(dimension_in, 0)
      end associate
    end function dimension_in

  end function least_dimension

  !> Derivatives of the map over so many sections along a motion with `events` from `point` to `image`: without a clock those of the
  !> flow, less what the section takes out of them.
  pure subroutine vary_section(machines, structure, mode, point, events, sections, image, by_start, ok, by_parameter)
    type(neighbourhood_t), intent(in) :: machines
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode, sections
    real(wp), intent(in) :: point(:), image(:)
    type(event_t), intent(in) :: events(:)
    real(wp), intent(out) :: by_start(:, :)
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(:)
    real(wp) :: t_end, slope(structure%n), by_state(structure%n), value, rate, tolerance(structure%n)
    integer :: last_mode
    t_end = sections*structure%period
    last_mode = mode
    if (size(events) > 0) last_mode = events(size(events))%after
    if (.not. structure%has_clock) t_end = events(size(events))%time
    tolerance = likeness*structure%size_of*sections
    call vary(machines, mode, point, events, t_end, tolerance, by_start, ok, by_parameter)
    if (.not. ok) return
    if (structure%has_clock) then
      if (present(by_parameter)) by_parameter = by_parameter + sections*period_slope(machines)* &
        structure%slope(last_mode, t_end, image)
      return
    end if
    slope = structure%slope(last_mode, t_end, events(size(events))%departure(:structure%n))
    call structure%guard(events(size(events)), t_end, events(size(events))%arrival(:structure%n), value, by_state, rate)
    rate = rate + sum(by_state*slope)
    ok = abs(rate) > 0
    if (.not. ok) return
    if (present(by_parameter)) by_parameter = by_parameter - slope*(sum(by_state*by_parameter)/rate)
    by_start = by_start - spread(slope, 2, structure%n)*spread(matmul(by_state, by_start)/rate, 1, structure%n)
  end subroutine vary_section

end module structure_family
