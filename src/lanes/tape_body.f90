! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body whose equations are a tape, as lanes take it.
module tape_body
  use kinds, only: wp
  use tape, only: tape_t
  implicit none
  private

  !> Stops that are not there [m].
  real(wp), parameter, public :: far = 1e30_wp

  !> A moving body with its equations while it slips and the phase advances. The variables are the phase [rad], its speed, position
  !> and velocity, and further states.
  type, public :: tape_body_t
    type(tape_t) :: tape
    real(wp), allocatable :: parameters(:)
    !> Nodes of the rates of the variables, of the force that acts on the body at rest, of what holds it there (0: `level`), of what
    !> an impact throws the speed of the phase by per change of velocity (0: nothing), and of the restitution (0: a number).
    integer, allocatable :: rates(:)
    integer :: hold = 0, held_by = 0, throws = 0, bounce = 0
    !> Number of the parameter that is the sign of slip, and of the variable that is the velocity.
    integer :: slip = 0, velocity = 4
    !> No crank: the first variable is the time [s], the second one a phase, and the section comes once in a `period` [s]. The time
    !> goes on there if nothing repeats.
    logical :: clock = .false., goes_on = .false.
    real(wp) :: period = 0, phase_speed = 0
    !> What a step leaves out is proven; turning points are no events; lanes pass the end of a period within a step. See
    !> `tape_machine`.
    logical :: proves = .true., turns_freely = .false., passes = .false.
    !> Sizes of the variables, and a time [s].
    real(wp), allocatable :: sizes(:)
    real(wp) :: time = 1
    !> Stops [m], restitution, what friction holds [N], and what bounds the end of a chatter sequence.
    real(wp) :: upper = far, lower = -far, restitution = 0, level = 0, friction = 0, damping = 0, stiffness = 0, mass = 1, &
      length = 1, throw_factor = 0
    !> Impacts after which the body would bounce for longer [s] do not end a chatter sequence; 0: unknown. Farthest position [m].
    real(wp) :: longest_rest = 0, domain = far
  end type tape_body_t

end module tape_body
