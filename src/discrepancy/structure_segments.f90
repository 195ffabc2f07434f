! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Segments of a structure: positions [m] and velocities [m/s] of all coordinates and the crank angle [rad] are its start,
!> positions and velocities a sample. Elastic friction has slid so far that its spring is stretched by all of the friction.
module structure_segments
  use kinds, only: wp
  use logged_segments, only: logged_segments_t
  use machine_type, only: section_state_t
  use motion_state, only: event_impact_lower, event_impact_upper, event_separation, event_touch_lower, event_touch_upper, log_t, &
    tally_t
  use multibody, only: integral_of, is_stop, joint_elastic
  use multibody_machine, only: multibody_machine_t
  use multibody_motion, only: advance_multibody, advance_multibody_period, multibody_motion_t
  use multibody_section, only: start_of_multibody
  use multibody_state, only: joint_motion, multibody_state_t, rounding_of_speed, turning_at
  use segment_machine, only: add_impact, flown_segment_t, impact_contact, not_a_number, speed_after
  use status, only: exit_bad_case
  use timed_actions, only: acts_on_time
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: segments_of_structure

  type, extends(logged_segments_t), public :: structure_segments_t
    type(multibody_motion_t) :: bodies
  contains
    procedure :: obstacle
    procedure :: set_steps
    procedure :: allows
    procedure :: begin
    procedure :: move
    procedure :: take
  end type structure_segments_t

contains

  pure function segments_of_structure(machine) result(segments)
    type(multibody_machine_t), intent(in) :: machine
    type(structure_segments_t) :: segments
    segments%bodies = machine%bodies
    segments%sample_numbers = 2*machine%bodies%machine%n
    segments%start_numbers = segments%sample_numbers + 1
  end function segments_of_structure

  pure function obstacle(self) result(text)
    class(structure_segments_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    associate (machine => self%bodies%machine)
      if (integral_of(machine) > 0) text = &
        'drive: found a controller that adds up what it sees, which no start of a segment states'
      if (acts_on_time(machine)) text = &
        'drive: found impulses, or samples of a controller, at times of their own: segments have other starts'
      if (.not. allocated(machine%driver)) return
      if (abs(machine%driver%stops_run) > 0) text = 'drive: found a stop that runs on, which no start of a segment states'
    end associate
  end function obstacle

  pure subroutine set_steps(self, unit, steps, speeds)
    class(structure_segments_t), intent(in) :: self
    real(wp), intent(in) :: unit(3)
    real(wp), intent(out) :: steps(:)
    logical, intent(out) :: speeds(:)
    associate (n => self%bodies%machine%n)
      steps(:n) = unit(1)
      steps(n + 1:2*n) = unit(2)
      steps(2*n + 1) = unit(3)
      speeds = .false.
      speeds(n + 1:2*n) = .true.
    end associate
  end subroutine set_steps

  !> Whether a start is beyond a stop, `begin` finds.
  pure logical function allows(self, start) result(allowed)
    class(structure_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    allowed = all(ieee_is_finite(start))
  end function allows

  pure subroutine begin(self, start, section, origin, tally, reason)
    class(structure_segments_t), intent(in) :: self
    real(wp), intent(in) :: start(:)
    type(section_state_t), intent(inout) :: section
    real(wp), intent(out) :: origin
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    associate (n => self%bodies%machine%n, watched => self%bodies%machine%watched)
      section%multibody = start_of_multibody(self%bodies, [start(watched), start(n + watched), start(2*n + 1), &
                                                           reshape(transpose(reshape(start(:2*n), [n, 2])), [2*n])])
    end associate
    reason = merge(0, exit_bad_case, ieee_is_finite(section%multibody%q(1)))
    call let_slide(self%bodies, section%multibody)
    origin = section%multibody%time
  end subroutine begin

  !> Elastic friction slides as its surfaces move.
  pure subroutine let_slide(moving, state)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(inout) :: state
    complex(wp) :: turning(moving%harmonics)
    real(wp) :: s, u
    integer :: j
    turning = turning_at(moving%machine%frequency, state%time, moving%harmonics)
    do j = 1, size(moving%machine%joints)
      if (moving%machine%joints(j)%kind /= joint_elastic) cycle
      call joint_motion(moving%machine, j, state%q, state%v, state%time, turning, s, u)
      if (abs(u) > rounding_of_speed(moving%machine, j, state)) state%phase(j) = merge(1, -1, u > 0)
    end do
  end subroutine let_slide

  pure subroutine move(self, section, tally, reason, log, until)
    class(structure_segments_t), intent(in) :: self
    type(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout) :: log
    real(wp), intent(in), optional :: until
    if (present(until)) then
      call advance_multibody(self%bodies, section%multibody, until, tally, reason, log)
    else
      call advance_multibody_period(self%bodies, section%multibody, tally, reason, log)
    end if
  end subroutine move

  !> Contacts are counted by themselves: a neighbour may have further joints.
  pure subroutine take(self, section, tally, log, flight)
    class(structure_segments_t), intent(in) :: self
    type(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    type(log_t), intent(in) :: log
    type(flown_segment_t), intent(inout) :: flight
    real(wp) :: side, after
    integer :: i, k, contact, done
    done = log%samples
    if (done > 0) flight%motion(:, :done) = log%sample_coordinates(:, :done)
    associate (n => self%bodies%machine%n, state => section%multibody)
      flight%motion(:, done + 1:) = spread([state%q(:n), state%v(:n)], 2, size(flight%motion, 2) - done)
    end associate
    do i = 1, log%events
      associate (kind => log%event_kind(i), joint => log%event_joint(:, i))
        after = abs(joint(4))
        contact = count(is_stop(self%bodies%machine%joints(:nint(joint(1)))%kind))
        select case (kind)
        case (event_impact_upper, event_touch_upper)
          side = 1
        case (event_impact_lower, event_touch_lower)
          side = -1
        case (event_separation)
          k = findloc(nint(flight%impact(impact_contact, :flight%count)), contact, dim=1, back=.true.)
          if (k > 0) flight%impact(speed_after, k) = abs(joint(3))
          cycle
        case default
          cycle
        end select
        if (kind == event_touch_upper .or. kind == event_touch_lower) after = not_a_number()
        call add_impact(flight, [log%event_data(1, i) - flight%origin, real(contact, wp), abs(joint(3)), after, side])
      end associate
    end do
  end subroutine take

end module structure_segments
