! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A multibody structure ready to move: the machine, how it is integrated, and the flows of the modes that it will meet.
module multibody_flows
  use multibody, only: is_stop, joint_contact, joint_section, joint_t, multibody_t, most_degrees
  use kinds, only: int64, wp
  use mode_flow, only: build_flow, harmonics_of, mode_flow_t
  use motion_state, only: flight_adaptive, options_t
  use section_directions, only: directions_of, speeds_of
  implicit none
  private

  public :: prepare_multibody, ready, with_matrix, without_contacts

  !> Machines with no more joints have the flows of all their modes ready.
  integer, parameter :: few_joints = 4
  type, public :: multibody_motion_t
    type(multibody_t) :: machine
    type(options_t) :: options
    type(mode_flow_t), allocatable :: flows(:)
    !> Directions (columns) of the positions that are coordinates on the section.
    real(wp), allocatable :: directions(:, :)
    !> Those of the velocities.
    real(wp), allocatable :: speeds(:, :)
    !> By how much stops are missed is noted: of two bodies, and where one position counts, for the stops alone, as motions without
    !> impacts are then families, one at every position between them.
    logical :: notes_misses = .false.
    integer :: harmonics = 0
    !> Number of the joint that is the section of a machine without a clock; 0: the section is a time.
    integer :: section = 0
    !> Share by which the acceleration of a gap may change until its chatter has died away; 0: no chatter is completed.
    real(wp) :: chatter_share = 1e-5_wp
  end type multibody_motion_t

contains

  !> Prepares a machine.
  pure subroutine prepare_multibody(machine, options, moving)
    type(multibody_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(multibody_motion_t), intent(out) :: moving
    real(wp) :: directions(most_degrees, most_degrees)
    integer(int64) :: key
    integer :: joints, i, positions
    moving%machine = machine
    moving%options = options
    moving%harmonics = harmonics_of(machine)
    call directions_of(machine, directions, positions)
    moving%directions = directions(:machine%n, :positions)
    call speeds_of(machine, directions, positions)
    moving%speeds = directions(:machine%n, :positions)
    if (machine%driven .and. machine%linear .and. options%flight /= flight_adaptive .and. size(moving%directions, 2) == 1) then
      call directions_of(without_contacts(machine), directions, positions)
      moving%notes_misses = positions == 0
    end if
    if (allocated(machine%driver)) moving%notes_misses = any(is_stop(machine%joints%kind))
    joints = size(machine%joints)
    if (.not. machine%driven .and. .not. machine%section_time > 0) then
      moving%section = joints + 1
      moving%machine%joints = [machine%joints, section_of(machine)]
    end if
    if (joints <= few_joints) then
      allocate (moving%flows(2**joints))
      do key = 0, 2_int64**joints - 1
        call build_flow(moving%machine, key, with_matrix(moving), moving%flows(key + 1))
      end do
    else
      allocate (moving%flows(joints + 1))
      call build_flow(moving%machine, 0_int64, with_matrix(moving), moving%flows(1))
      do i = 1, joints
        call build_flow(moving%machine, ibset(0_int64, i - 1), with_matrix(moving), moving%flows(i + 1))
      end do
    end if
  end subroutine prepare_multibody

  !> The same machine without stops.
  pure type(multibody_t) function without_contacts(machine) result(free)
    type(multibody_t), intent(in) :: machine
    integer :: j
    free = machine
    free%joints = machine%joints(pack([(j, j=1, size(machine%joints))], .not. is_stop(machine%joints%kind)))
  end function without_contacts

  !> The section of a machine without a clock: the maxima of the watched coordinate; its minima where a rigid stop cuts the
  !> maxima off, for there the speed jumps.
  pure type(joint_t) function section_of(machine) result(section)
    type(multibody_t), intent(in) :: machine
    integer :: j
    logical :: upper, lower
    upper = .false.
    lower = .false.
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j), along => machine%joints(j)%row(machine%watched))
        if (joint%kind /= joint_contact) cycle
        upper = upper .or. (along > 0 .and. joint%upper < huge(along)) .or. (along < 0 .and. joint%lower > -huge(along))
        lower = lower .or. (along > 0 .and. joint%lower > -huge(along)) .or. (along < 0 .and. joint%upper < huge(along))
      end associate
    end do
    section%name = 'section'
    section%kind = joint_section
    allocate (section%row(machine%n), source=0.0_wp)
    section%row(machine%watched) = merge(-1, 1, upper .and. .not. lower)
  end function section_of

  !> Whether a flight may be marched: it needs the rows of the exponential series.
  pure logical function with_matrix(moving)
    type(multibody_motion_t), intent(in) :: moving
    with_matrix = moving%options%flight == flight_adaptive .or. .not. moving%machine%linear
  end function with_matrix

  !> Number of the flow that is ready for a mode, 0 if there is none.
  pure integer function ready(moving, key)
    type(multibody_motion_t), intent(in) :: moving
    integer(int64), intent(in) :: key
    ready = 0
    if (key < size(moving%flows)) then
      if (moving%flows(key + 1)%key == key) ready = int(key) + 1
    end if
    if (ready == 0) ready = findloc(moving%flows%key, key, 1)
  end function ready

end module multibody_flows
