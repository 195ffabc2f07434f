! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A jointed structure ready to move: the machine, how it is integrated, and the flows of the modes that it will meet.
module jointed_flows
  use jointed, only: jointed_t
  use kinds, only: wp
  use mode_flow, only: build_flow, harmonics_of, mode_flow_t
  use motion_state, only: flight_adaptive, options_t
  implicit none
  private

  public :: prepare_jointed, ready, with_matrix

  !> Machines with no more joints have the flows of all their modes ready.
  integer, parameter :: few_joints = 4
  type, public :: jointed_motion_t
    type(jointed_t) :: machine
    type(options_t) :: options
    type(mode_flow_t), allocatable :: flows(:)
    integer :: harmonics = 0
    !> Share by which the acceleration of a gap may change until its chatter has died away; 0: no chatter is completed.
    real(wp) :: chatter_share = 1e-5_wp
  end type jointed_motion_t

contains

  !> Prepares a machine.
  pure subroutine prepare_jointed(machine, options, moving)
    type(jointed_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(jointed_motion_t), intent(out) :: moving
    integer :: key, joints, i
    moving%machine = machine
    moving%options = options
    moving%harmonics = harmonics_of(machine)
    joints = size(machine%joints)
    if (joints <= few_joints) then
      allocate (moving%flows(2**joints))
      do key = 0, 2**joints - 1
        call build_flow(machine, key, with_matrix(moving), moving%flows(key + 1))
      end do
    else
      allocate (moving%flows(joints + 1))
      call build_flow(machine, 0, with_matrix(moving), moving%flows(1))
      do i = 1, joints
        call build_flow(machine, ibset(0, i - 1), with_matrix(moving), moving%flows(i + 1))
      end do
    end if
  end subroutine prepare_jointed

  !> Whether a flight may be marched: it needs the rows of the exponential series.
  pure logical function with_matrix(moving)
    type(jointed_motion_t), intent(in) :: moving
    with_matrix = moving%options%flight == flight_adaptive .or. .not. moving%machine%linear
  end function with_matrix

  !> Number of the flow that is ready for a mode, 0 if there is none.
  pure integer function ready(moving, key)
    type(jointed_motion_t), intent(in) :: moving
    integer, intent(in) :: key
    ready = 0
    if (key + 1 <= size(moving%flows)) then
      if (moving%flows(key + 1)%key == key) ready = key + 1
    end if
    if (ready == 0) ready = findloc(moving%flows%key, key, 1)
  end function ready

end module jointed_flows
