! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> State of a motor, or of equations by expressions, beside that of the body.
module motor_state
  use enclosures, only: bounds_t
  use kinds, only: wp
  implicit none
  private

  !> Most states beside those of body and crank.
  integer, parameter, public :: most_own = 8

  type, public :: motor_state_t
    !> Crank angle, from 0 to 2 pi [rad], and its speed [rad/s]. Without a motor: what the time of the body is counted from [s].
    real(wp) :: phi = 0, w = 0
    !> Current [A], or integral of the speed control [rad]; states by expressions.
    real(wp) :: own(most_own) = 0
    !> 1 or -1: the crank turns this way; 0: its bearing holds it.
    integer :: turning = 1
    !> Since when it holds it [s after the section].
    real(wp) :: held_since = 0
    !> Turns taken off the angle; which way the crank last passed through zero. Backwards that is a section only if it was so the
    !> last time: a crank that rocks about zero passes its section once a cycle.
    integer :: turns = 0, passed_last = 1
    !> What a ramp changes, voltage [V] or speed without torque [rad/s], and whether it still does.
    real(wp) :: supply = 0
    logical :: ramps = .false.
    !> Of a speed control: at which limit its torque is, and at which its integral is held; 0: at none.
    integer :: limited = 0, held = 0
    !> Piece of a table of the torque.
    integer :: piece = 0
    !> Bounds that flights have left, by direction of slip and mode of the equations: they depend on neither time nor state.
    type(bounds_t), allocatable :: bounds(:, :)
  end type motor_state_t

end module motor_state
