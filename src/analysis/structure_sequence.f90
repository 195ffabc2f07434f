! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The sequence of events of a structure on the other side of a point where a margin of a periodic orbit is zero, see module
!> `other_sequence`. Every event changes the phases of some joints, whatever those of the others are.
module structure_sequence
  use contact_law, only: contact_kelvin_voigt
  use guards, only: force_ends, leaves, meets_lower, meets_upper, slide_ends, slides_down, slides_up
  use hybrid_machine, only: event_t
  use multibody, only: joint_contact, joint_friction, joint_soft, most_joints
  use kinds, only: wp
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, event_release, &
    event_separation, event_stick, event_touch_lower, event_touch_upper, event_turning_point
  use orbit_margins, only: margin_t, of_gap, of_hold, of_impact, of_order, of_slip, of_stick, of_turning
  use periodic_orbit, only: orbit_t
  use structure, only: structure_t
  use structure_modes, only: mode_number, phases_in
  implicit none
  private

  public :: change_structure_sequence

  !> A joint whose phase an event leaves as it is.
  integer, parameter :: as_it_is = 9
  !> Events nearer to each other than this share of the period are at one instant.
  real(wp), parameter :: one_instant = 1e-6_wp

  !> An event and the phases that it gives to the joints.
  type :: link_t
    type(event_t) :: event
    integer :: phase(most_joints) = as_it_is
  end type link_t

contains

  !> The orbit at which `margin` is zero, with the sequence of events beyond; `known` is false where there is no rule.
  pure subroutine change_structure_sequence(machine, orbit, margin, other, known)
    type(structure_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(margin_t), intent(in) :: margin
    type(orbit_t), intent(out) :: other
    logical, intent(out) :: known
    type(link_t), allocatable :: chain(:)
    integer :: at, k, back
    other = orbit
    call take_apart(machine, orbit, chain)
    known = .true.
    k = margin%event
    ! Between events: after which.
    at = -k - 1
    select case (margin%kind)
    case (of_impact)
      call take_contact_out(machine, k, chain, known)
    case (of_gap)
      call put_contact_in(machine, margin, at, chain)
    case (of_turning)
      chain(k)%event%kind = event_stick
      back = chain(k)%phase(margin%joint)
      chain = [chain(:k), slide(margin%joint, back, margin%time), chain(k + 1:)]
      chain(k)%phase(margin%joint) = 0
    case (of_stick)
      call take_stick_out(k, chain, known)
    case (of_slip)
      known = machine%frame%moving%machine%joints(margin%joint)%kind == joint_friction
      if (.not. known) return
      associate (direction => direction_in(machine, orbit, at, margin%joint))
        chain = [chain(:at), stop(margin%joint, direction, margin%time), slide(margin%joint, direction, margin%time), &
                 chain(at + 1:)]
      end associate
    case (of_hold)
      known = machine%frame%moving%machine%joints(margin%joint)%kind == joint_friction
      if (.not. known) return
      chain = [chain(:at), slide(margin%joint, margin%side, margin%time), stop(margin%joint, margin%side, margin%time), &
               chain(at + 1:)]
    case (of_order)
      known = k > 1
      if (known) known = chain(k)%event%joint /= chain(k - 1)%event%joint
      if (known) chain(k - 1:k) = chain([k, k - 1])
    case default
      known = .false.
    end select
    if (known) call put_together(machine, chain, other)
  end subroutine change_structure_sequence

  !> What every event changes.
  pure subroutine take_apart(machine, orbit, chain)
    type(structure_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(link_t), allocatable, intent(out) :: chain(:)
    integer :: before(most_joints), after(most_joints), k
    allocate (chain(size(orbit%events)))
    before = phases_in(machine%frame%moving%machine, orbit%mode)
    do k = 1, size(chain)
      after = phases_in(machine%frame%moving%machine, orbit%events(k)%after)
      chain(k)%event = orbit%events(k)
      chain(k)%phase = merge(as_it_is, after, before == after)
      before = after
    end do
  end subroutine take_apart

  !> The modes between events from what those change.
  pure subroutine put_together(machine, chain, orbit)
    type(structure_t), intent(in) :: machine
    type(link_t), intent(in) :: chain(:)
    type(orbit_t), intent(inout) :: orbit
    integer :: phase(most_joints), k
    phase = phases_in(machine%frame%moving%machine, orbit%mode)
    orbit%events = chain%event
    do k = 1, size(chain)
      orbit%events(k)%before = mode_number(machine%frame%moving%machine, phase)
      where (chain(k)%phase /= as_it_is) phase = chain(k)%phase
      orbit%events(k)%after = mode_number(machine%frame%moving%machine, phase)
    end do
  end subroutine put_together

  !> Direction in which a joint slides after the event `k`.
  pure integer function direction_in(machine, orbit, k, joint) result(direction)
    type(structure_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k, joint
    integer :: phase(most_joints), mode
    mode = orbit%mode
    if (k > 0) mode = orbit%events(k)%after
    phase = phases_in(machine%frame%moving%machine, mode)
    direction = phase(joint)
  end function direction_in

  pure type(link_t) function slide(joint, direction, time) result(link)
    integer, intent(in) :: joint, direction
    real(wp), intent(in) :: time
    link%event = event_t(kind=event_release, side=direction, joint=joint, time=time, &
                         guard=merge(slides_up, slides_down, direction > 0))
    link%phase(joint) = direction
  end function slide

  pure type(link_t) function stop(joint, direction, time) result(link)
    integer, intent(in) :: joint, direction
    real(wp), intent(in) :: time
    link%event = event_t(kind=event_stick, side=direction, joint=joint, time=time, guard=slide_ends)
    link%phase(joint) = 0
  end function stop

  !> An impact, or a touch and its end.
  pure function contact(machine, margin) result(links)
    type(structure_t), intent(in) :: machine
    type(margin_t), intent(in) :: margin
    type(link_t), allocatable :: links(:)
    integer :: k
    associate (joint => machine%frame%moving%machine%joints(margin%joint))
      if (joint%kind == joint_contact) then
        allocate (links(1))
        links(1)%event%kind = merge(event_impact_upper, event_impact_lower, margin%side > 0)
      else if (joint%contact%kind == contact_kelvin_voigt .and. joint%contact%damping > 0 .and. .not. joint%contact%tension) then
        allocate (links(3))
        links(2)%event%guard = force_ends
        links(2)%phase(margin%joint) = 2*margin%side
      else
        allocate (links(2))
      end if
      links%event%joint = margin%joint
      links%event%side = margin%side
      links%event%time = margin%time
      links(1)%event%guard = merge(meets_upper, meets_lower, margin%side > 0)
      k = size(links)
      if (k == 1) return
      links(1)%event%kind = merge(event_touch_upper, event_touch_lower, margin%side > 0)
      links(1)%phase(margin%joint) = margin%side
      links(k)%event%kind = event_separation
      links(k)%event%guard = leaves
      links(k)%phase(margin%joint) = 0
    end associate
  end function contact

  !> Puts an impact or a touch in after the event `at`. Where friction between the same bodies turns round at that instant an
  !> impact replaces it: it turns the slide round itself.
  pure subroutine put_contact_in(machine, margin, at, chain)
    type(structure_t), intent(in) :: machine
    type(margin_t), intent(in) :: margin
    integer, intent(in) :: at
    type(link_t), allocatable, intent(inout) :: chain(:)
    type(link_t), allocatable :: links(:)
    integer :: k
    links = contact(machine, margin)
    do k = max(at, 1), merge(min(at + 1, size(chain)), 0, size(links) == 1)
      if (chain(k)%event%kind /= event_turning_point .or. .not. &
          abs(chain(k)%event%time - margin%time) <= one_instant*machine%period) cycle
      if (.not. are_parallel(machine, chain(k)%event%joint, margin%joint)) cycle
      links(1)%phase = chain(k)%phase
      chain(k) = links(1)
      return
    end do
    chain = [chain(:at), links, chain(at + 1:)]
  end subroutine put_contact_in

  !> Whether two joints move in proportion.
  pure logical function are_parallel(machine, one, other)
    type(structure_t), intent(in) :: machine
    integer, intent(in) :: one, other
    associate (joints => machine%frame%moving%machine%joints)
      are_parallel = abs(sum(joints(one)%row*joints(other)%row)) >= &
        (1 - 8*epsilon(1.0_wp))*norm2(joints(one)%row)*norm2(joints(other)%row)
    end associate
  end function are_parallel

  !> Without the impact or the touch `k`.
  pure subroutine take_contact_out(machine, k, chain, known)
    type(structure_t), intent(in) :: machine
    integer, intent(in) :: k
    type(link_t), allocatable, intent(inout) :: chain(:)
    logical, intent(out) :: known
    logical :: kept(size(chain))
    integer :: i, j
    j = chain(k)%event%joint
    kept = .true.
    kept(k) = .false.
    known = .not. any(chain(k)%event%kind == [event_chatter_upper, event_chatter_lower, event_separation])
    if (machine%frame%moving%machine%joints(j)%kind == joint_contact) then
      i = findloc(chain(k)%phase /= as_it_is, .true., 1)
      if (i > 0) then
        ! What else the impact has set free stays; friction between the same bodies turns round instead of it.
        known = known .and. count(chain(k)%phase /= as_it_is) == 1 .and. abs(chain(k)%phase(i)) == 1 .and. &
                machine%frame%moving%machine%joints(i)%kind == joint_friction .and. are_parallel(machine, i, j)
        chain(k)%event = event_t(kind=event_turning_point, side=-chain(k)%phase(i), joint=i, time=chain(k)%event%time, &
                                 guard=slide_ends)
        return
      end if
    else
      do i = k + 1, size(chain)
        if (chain(i)%event%joint /= j) cycle
        kept(i) = .false.
        if (chain(i)%event%kind == event_separation) exit
      end do
      known = known .and. i <= size(chain)
    end if
    if (known) chain = pack(chain, kept)
  end subroutine take_contact_out

  !> A stick of no duration: the joint slides on, or back.
  pure subroutine take_stick_out(k, chain, known)
    integer, intent(in) :: k
    type(link_t), allocatable, intent(inout) :: chain(:)
    logical, intent(out) :: known
    type(link_t) :: last
    known = k < size(chain)
    if (known) known = chain(k + 1)%event%joint == chain(k)%event%joint .and. chain(k + 1)%event%kind == event_release
    if (.not. known) return
    last = chain(k + 1)
    if (last%event%side == chain(k)%event%side) then
      chain = [chain(:k - 1), chain(k + 2:)]
    else
      chain(k)%event%kind = event_turning_point
      chain(k)%phase(last%event%joint) = last%event%side
      chain = [chain(:k), chain(k + 2:)]
    end if
  end subroutine take_stick_out

end module structure_sequence
