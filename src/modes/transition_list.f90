! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The transitions of a motion of a multibody structure as they happen, for what varies it: the whole state on both sides.
module transition_list
  use multibody_state, only: multibody_state_t
  implicit none
  private

  public :: note_transition

  !> One transition: the joint whose guard was triggered, and which. `certain` is false where several were triggered together, or
  !> where a tie was held for an instant: the motions beside may go other ways.
  type, public :: transition_t
    type(multibody_state_t) :: before, after
    integer :: joint = 0, meaning = 0
    logical :: certain = .true.
  end type transition_t

  type, public :: transitions_t
    integer :: count = 0
    type(transition_t), allocatable :: list(:)
  end type transitions_t

contains

  !> Adds a transition.
  pure subroutine note_transition(transitions, one)
    type(transitions_t), intent(inout) :: transitions
    type(transition_t), intent(in) :: one
    type(transition_t), allocatable :: more(:)
    if (.not. allocated(transitions%list)) allocate (transitions%list(16))
    if (transitions%count == size(transitions%list)) then
      allocate (more(2*transitions%count))
      more(:transitions%count) = transitions%list
      call move_alloc(more, transitions%list)
    end if
    transitions%count = transitions%count + 1
    transitions%list(transitions%count) = one
  end subroutine note_transition

end module transition_list
