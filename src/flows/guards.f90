! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What ends a flight of a multibody structure: functions that are positive as long as the joints stay in their phases, all
!> of one form, constant + position s + speed u + force lambda of a joint.
module guards
  use contact_law, only: contact_kelvin_voigt
  use multibody, only: count_switches, joint_contact, joint_elastic, joint_friction, joint_section, joint_soft, joint_spring, &
    multibody_t
  use multibody_state, only: multibody_state_t
  use kinds, only: wp
  use mode_flow, only: mode_flow_t
  implicit none
  private

  public :: guards_of, room_for_guards

  !> What a triggered guard means: a slide ends; friction gives way upwards or downwards; the upper or lower stop is reached; a
  !> closed contact is let go; a pressed one is without force; one without force pushes again; a soft stop is left; the watched
  !> coordinate turns round; the expression of a normal force changes its branch.
  integer, parameter, public :: slide_ends = 1, slides_up = 2, slides_down = 3, meets_upper = 4, meets_lower = 5, &
    lets_go = 6, force_ends = 7, force_returns = 8, leaves = 9, turns_round = 10, changes_branch = 11

  type, public :: joint_guard_t
    integer :: joint = 0, meaning = 0
    real(wp) :: constant = 0, position = 0, speed = 0, force = 0
    !> Number of the joint among the constraints of the mode.
    integer :: held = 0
    !> By what the normal force of the joint is multiplied in it; number of a switching function of that, 0 for other guards.
    real(wp) :: level = 0
    integer :: switch = 0
    !> It is zero now and rises.
    logical :: from_zero = .false.
    !> Size of the terms that its value and first three derivatives are sums of, beyond what the motion shows: large coordinates
    !> that cancel.
    real(wp) :: blur(0:3) = 0
  end type joint_guard_t

contains

  !> Most guards of a machine in any mode.
  pure integer function room_for_guards(machine)
    type(multibody_t), intent(in) :: machine
    room_for_guards = 3*size(machine%joints) + count_switches(machine)
  end function room_for_guards

  !> The guards of a state, at the beginning of `list`.
  pure subroutine guards_of(machine, flow, state, list, count_guards)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(out) :: count_guards
    integer :: j, phase, held
    real(wp) :: level, d, k
    logical :: changed
    count_guards = 0
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        phase = state%phase(j)
        changed = state%left(j) /= 0
        held = findloc(flow%held, j, 1)
        d = sign(1, phase)
        level = joint%friction%break_away
        select case (joint%kind)
        case (joint_friction)
          if (allocated(joint%load)) call switch_guards(machine, j, list, count_guards)
          if (phase == 0 .and. allocated(joint%load)) then
            call put(list, count_guards, joint_guard_t(j, slides_up, level=level, force=1.0_wp, held=held))
            call put(list, count_guards, joint_guard_t(j, slides_down, level=level, force=-1.0_wp, held=held))
          else if (phase == 0) then
            call put(list, count_guards, joint_guard_t(j, slides_up, constant=level, force=1.0_wp, held=held))
            call put(list, count_guards, joint_guard_t(j, slides_down, constant=level, force=-1.0_wp, held=held))
          else if (.not. flow%still(j)) then
            call put(list, count_guards, joint_guard_t(j, slide_ends, speed=d, from_zero=changed))
          end if
        case (joint_elastic)
          if (phase == 0) then
            ! r = -k (s - z) is above -level and below level.
            k = joint%stiffness
            call put(list, count_guards, joint_guard_t(j, slides_up, constant=level + k*state%slider(j), position=-k, &
                                                       from_zero=state%left(j) > 0))
            call put(list, count_guards, joint_guard_t(j, slides_down, constant=level - k*state%slider(j), position=k, &
                                                       from_zero=state%left(j) < 0))
          else
            call put(list, count_guards, joint_guard_t(j, slide_ends, speed=d, from_zero=changed))
          end if
        case (joint_contact)
          if (phase == 0) then
            if (.not. lies_still(machine, flow, state, j)) call gap_guards(machine, state, j, list, count_guards)
          else if (joint%upper > joint%lower) then
            call put(list, count_guards, joint_guard_t(j, lets_go, force=-d, held=held))
          end if
        case (joint_soft)
          call soft_guards(machine, state, j, list, count_guards)
        case (joint_spring)
          if (allocated(joint%load)) call switch_guards(machine, j, list, count_guards)
        case (joint_section)
          if (phase /= 0) call put(list, count_guards, joint_guard_t(j, turns_round, speed=d, from_zero=changed))
        end select
      end associate
    end do
    call set_blur(machine, flow, state, list(:count_guards))
  end subroutine guards_of

  !> Whether a joint has no speed and gets none in this mode.
  pure logical function lies_still(machine, flow, state, j)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: j
    real(wp) :: u
    associate (joint => machine%joints(j), v => state%v(:machine%n))
      u = sum(joint%row*v) + joint%offset%rate
      lies_still = flow%still(j) .and. abs(u) <= 64*epsilon(u)*(sum(abs(joint%row*v)) + abs(joint%offset%rate))
    end associate
  end function lies_still

  !> Sizes of sums for their rounding.
  pure subroutine set_blur(machine, flow, state, list)
    type(multibody_t), intent(in) :: machine
    type(mode_flow_t), intent(in) :: flow
    type(multibody_state_t), intent(in) :: state
    type(joint_guard_t), intent(inout) :: list(:)
    real(wp) :: force(machine%n), acceleration(machine%n), position, speed, change
    integer :: g, n
    n = machine%n
    force = abs(machine%load) + matmul(abs(flow%stiffness), abs(state%q(:n))) + matmul(abs(flow%damping), abs(state%v(:n)))
    acceleration = matmul(abs(machine%mobility), force)
    do g = 1, size(list)
      associate (guard => list(g), row => abs(machine%joints(list(g)%joint)%row))
        position = sum(row*abs(state%q(:n)))
        speed = sum(row*abs(state%v(:n)))
        change = sum(row*acceleration)
        guard%blur = abs(guard%position)*[position, speed, change, change*machine%frequency] &
                     + abs(guard%speed)*[speed, change, change*machine%frequency, change*machine%frequency**2]
        if (guard%held > 0) then
          change = sum(abs(flow%reaction(guard%held, :))*force)
          guard%blur = guard%blur + change*[1.0_wp, machine%frequency, machine%frequency**2, machine%frequency**3]
        end if
      end associate
    end do
  end subroutine set_blur

  pure subroutine put(list, count_guards, guard)
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(inout) :: count_guards
    type(joint_guard_t), intent(in) :: guard
    count_guards = count_guards + 1
    list(count_guards) = guard
  end subroutine put

  !> The switching functions of a normal force that vary.
  pure subroutine switch_guards(machine, j, list, count_guards)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(inout) :: count_guards
    integer :: i
    associate (tape => machine%joints(j)%load%tape)
      do i = 1, size(tape%switches)
        if (.not. tape%nodes(tape%switches(i)%argument)%is_steady) call put(list, count_guards, &
          joint_guard_t(j, changes_branch, switch=i))
      end do
    end associate
  end subroutine switch_guards

  !> The gaps to both stops.
  pure subroutine gap_guards(machine, state, j, list, count_guards)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: j
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(inout) :: count_guards
    associate (joint => machine%joints(j))
      if (joint%upper < huge(1.0_wp)) call put(list, count_guards, &
        joint_guard_t(j, meets_upper, constant=joint%upper, position=-1.0_wp, from_zero=state%left(j) > 0))
      if (joint%lower > -huge(1.0_wp)) call put(list, count_guards, &
        joint_guard_t(j, meets_lower, constant=-joint%lower, position=1.0_wp, from_zero=state%left(j) < 0))
    end associate
  end subroutine gap_guards

  !> A soft contact: its gap, or its penetration p = d (s - stop), and its force k p + c p', or 1 + a p'.
  pure subroutine soft_guards(machine, state, j, list, count_guards)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: j
    type(joint_guard_t), intent(inout) :: list(:)
    integer, intent(inout) :: count_guards
    real(wp) :: stop, k, c, d
    integer :: phase
    logical :: changed
    phase = state%phase(j)
    d = sign(1, phase)
    changed = state%left(j) /= 0
    associate (joint => machine%joints(j))
      if (phase == 0) then
        call gap_guards(machine, state, j, list, count_guards)
        return
      end if
      stop = merge(joint%upper, joint%lower, phase > 0)
      k = joint%contact%stiffness
      c = joint%contact%damping
      if (joint%contact%by_impact) c = c/max(state%touch_speed(j), tiny(1.0_wp))
      if (abs(phase) == 1) then
        if (joint%contact%kind /= contact_kelvin_voigt) then
          call put(list, count_guards, joint_guard_t(j, leaves, constant=-d*stop, position=d, from_zero=changed))
          if (c > 0) call put(list, count_guards, joint_guard_t(j, force_ends, constant=1.0_wp, speed=d*c))
        else if (joint%contact%tension .or. .not. c > 0) then
          call put(list, count_guards, joint_guard_t(j, leaves, constant=-d*stop, position=d, from_zero=changed))
        else
          ! Without tension the force ends before the surface is free.
          call put(list, count_guards, joint_guard_t(j, force_ends, constant=-k*d*stop, position=k*d, speed=c*d))
        end if
      else
        call put(list, count_guards, joint_guard_t(j, leaves, constant=-d*stop, position=d))
        if (joint%contact%kind /= contact_kelvin_voigt) then
          call put(list, count_guards, joint_guard_t(j, force_returns, constant=-1.0_wp, speed=-d*c, from_zero=changed))
        else
          call put(list, count_guards, joint_guard_t(j, force_returns, constant=k*d*stop, position=-k*d, speed=-c*d, &
                                                     from_zero=changed))
        end if
      end if
    end associate
  end subroutine soft_guards

end module guards
