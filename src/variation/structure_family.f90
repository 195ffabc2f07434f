! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure over a parameter of its laws, and the map from one section to the next with derivatives by the start and by the
!> parameter. Of a machine without a clock the section is an event, and the time to it changes with both.
module structure_family
  use body_family, only: family_t, likeness
  use build_motion, only: bodies_of
  use errors, only: error_t, fail
  use guarded_march, only: most_equations
  use guards, only: meets_lower, meets_upper
  use hybrid_machine, only: event_t, hybrid_t, most_states
  use multibody, only: integral_of, is_stop, joint_contact, joint_elastic, joint_friction, joint_soft, joint_spring, multibody_t, &
    most_joints
  use multibody_motion, only: multibody_motion_t
  use multibody_section, only: start_of_multibody
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t
  use multibody_machine, only: multibody_machine_t
  use motion_state, only: flight_adaptive, tally_t
  use status, only: exit_bad_case
  use structure, only: structure_of, structure_t
  use structure_modes, only: count_joints, phases_in
  use structure_walk, only: fly_structure_on
  use timed_actions, only: acts_on_time
  use variations, only: neighbourhood_t, period_slope, vary
  implicit none
  private

  public :: structure_of_family, map_of_family, why_not_varied, vary_section, state_at_start, &
    least_dimension

contains

  !> Why the variations of a structure are not known; '' if they are.
  pure function why_not_varied(moving) result(why)
    type(multibody_motion_t), intent(in) :: moving
    character(len=:), allocatable :: why
    type(structure_t) :: trial
    integer :: j
    why = ''
    trial = structure_of(moving, [1.0_wp, 1.0_wp])
    if (trial%n > most_states) why = 'it has too many coordinates'
    if (trial%n > most_equations/2 .and. (.not. moving%machine%linear .or. moving%options%flight == flight_adaptive)) then
      why = 'it has too many coordinates for a law that is not linear'
    end if
    if (acts_on_time(moving%machine)) why = 'impulses, samples of a controller or forces depend on the time since the start'
    if (integral_of(moving%machine) > 0) why = 'a controller adds up what it sees'
    do j = 1, count_joints(moving%machine)
      associate (joint => moving%machine%joints(j))
        if (joint%contact%by_impact .and. joint%kind == joint_soft) why = 'the damping of a contact is set by each impact'
        if (abs(joint%offset%rate) > 0 .and. (is_stop(joint%kind) .or. joint%kind == joint_spring)) then
          why = 'a stop or a spring runs on with its surface'
        end if
        if (allocated(joint%memory)) why = 'friction has a memory'
        if (allocated(joint%load)) why = 'a force is an expression'
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
    type(multibody_machine_t) :: machine
    real(wp) :: sizes(2)
    logical :: known
    laws = family%laws
    if (allocated(family%path)) call change_parameter(laws, family%path, value, known)
    call bodies_of(laws, family%options, machine, error)
    if (allocated(error)) return
    if (machine%has_driver) call refuse_two_bodies(machine%bodies%machine, error)
    if (allocated(error)) return
    why = why_not_varied(machine%bodies)
    if (len(why) > 0) then
      call fail(error, exit_bad_case, 'body: the variations of this machine are not known: '//why)
      return
    end if
    associate (scales => machine%bodies%machine)
      sizes(1) = merge(scales%length_scale, 1.0_wp, scales%length_scale > 0)
      sizes(2) = sizes(1)*scales%frequency
    end associate
    if (family%sizes(1) > 0) sizes = family%sizes
    structure = structure_of(machine%bodies, sizes)
  end subroutine structure_of_family

  !> What two bodies have in their own tables and no variations; code 65.
  pure subroutine refuse_two_bodies(machine, error)
    type(multibody_t), intent(in) :: machine
    type(error_t), allocatable, intent(out) :: error
    if (allocated(machine%controller)) then
      call fail(error, exit_bad_case, 'drive.law: found a controller, allowed force, sine: variations of two bodies have no '// &
                'law for its integral and samples')
    else if (.not. machine%driven) then
      call fail(error, exit_bad_case, 'drive.law: found two bodies without a periodic drive, allowed force, sine: their '// &
                'variations are known from one drive period to the next')
    else if (allocated(machine%impulses)) then
      call fail(error, exit_bad_case, 'body.impulse: found an impulse, allowed 0 N s: variations of two bodies have no law for it')
    end if
  end subroutine refuse_two_bodies

  !> The state at a start of `machine_t`.
  pure type(multibody_state_t) function state_at_start(structure, start) result(state)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: start(:)
    state = start_of_multibody(structure%frame%moving, start)
  end function state_at_start

  !> Image of a section point after so many sections, its derivatives by the point (and by the parameter).
  pure subroutine map_of_family(machines, point, sections, image, by_start, tally, ok, by_parameter)
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
      call fly_structure_on(structure, point, sections, image, events, mode, tally, ok, certain)
      ok = ok .and. certain
      if (.not. ok) return
      call vary_section(machines, structure, mode, point, events, sections, image, by_start, ok, by_parameter)
    end select
  end subroutine map_of_family

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
    class(hybrid_t), intent(in) :: structure
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
