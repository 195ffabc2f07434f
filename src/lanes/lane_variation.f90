! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Bodies in lanes with two directions of change of each (the kernel is C++: `lane_variation.hpp`): machines with one linear
!> equation but for the sign of the friction, and a constant restitution. A change is that of the free part of the motion,
!> v + g x + i w_d x, at the start of the flight that the lane is on.
module lane_variation
  use elementary, only: exponential, sine_cosine
  use kinds, only: wp
  use lane_types, only: lane_batch_t, lane_count, lane_flow_t, machine_t
  use, intrinsic :: iso_c_binding, only: c_double, c_int
  implicit none
  private

  public :: carries_tangents, fly_lanes_with_tangents, tangents_at_state, put_tangents

  !> Mirrors `lane_tangents` of lane_types.hpp: two directions at right angles, and the product of the ratios of the accelerations
  !> behind and before turning points. Whoever reads them begins them anew.
  type, bind(c), public :: tangents_t
    real(c_double), dimension(lane_count) :: first_re = 1, first_im = 0, second_re = 0, second_im = 1, turns = 1
  end type tangents_t

  interface
    pure subroutine separatrix_vary_lanes(width, machine, batch, tangents) bind(c)
      import :: c_int, lane_batch_t, machine_t, tangents_t
      integer(c_int), value :: width
      type(machine_t), intent(in) :: machine
      type(lane_batch_t), intent(inout) :: batch
      type(tangents_t), intent(inout) :: tangents
    end subroutine separatrix_vary_lanes
  end interface

contains

  !> Whether the lanes of a machine can carry directions of change.
  pure logical function carries_tangents(flow)
    type(lane_flow_t), intent(in) :: flow
    associate (m => flow%machine)
      carries_tangents = flow%available .and. .not. allocated(flow%structure) .and. .not. m%several_modes > 0 .and. &
        .not. m%law%series > 0 .and. .not. m%layer%excess > 0 .and. .not. abs(m%restitution_law) > 0
    end associate
  end function carries_tangents

  !> Flies every occupied lane until it has stopped or is left to the event loop.
  pure subroutine fly_lanes_with_tangents(flow, batch, tangents)
    type(lane_flow_t), intent(in) :: flow
    type(lane_batch_t), intent(inout) :: batch
    type(tangents_t), intent(inout) :: tangents
    call separatrix_vary_lanes(int(flow%width, c_int), flow%machine, batch, tangents)
  end subroutine fly_lanes_with_tangents

  !> The directions of a lane (columns) as changes of x and v, where the body is that `lane_state` gives.
  pure function tangents_at_state(flow, batch, lane, tangents) result(directions)
    type(lane_flow_t), intent(in) :: flow
    type(lane_batch_t), intent(in) :: batch
    integer, intent(in) :: lane
    type(tangents_t), intent(in) :: tangents
    real(wp) :: directions(2, 2), re(2), im(2), sine, cosine
    re = [tangents%first_re(lane), tangents%second_re(lane)]
    im = [tangents%first_im(lane), tangents%second_im(lane)]
    associate (m => flow%machine, span => batch%time(lane) - batch%start(lane))
      call sine_cosine(m%damped*span, sine, cosine)
      directions(1, :) = (sine*re + cosine*im)/m%damped
      directions(2, :) = cosine*re - sine*im - m%decay*directions(1, :)
      directions = exponential(-m%decay*span)*directions
    end associate
  end function tangents_at_state

  !> Gives a lane directions, changes of x and v (columns), the second of which is turned to be at right angles to the first.
  pure subroutine put_tangents(flow, lane, directions, tangents)
    type(lane_flow_t), intent(in) :: flow
    integer, intent(in) :: lane
    real(wp), intent(in) :: directions(2, 2)
    type(tangents_t), intent(inout) :: tangents
    real(wp) :: re(2), im(2)
    re = directions(2, :) + flow%machine%decay*directions(1, :)
    im = flow%machine%damped*directions(1, :)
    associate (square => re(1)**2 + im(1)**2, along => re(1)*re(2) + im(1)*im(2))
      if (square > 0) then
        re(2) = re(2) - along/square*re(1)
        im(2) = im(2) - along/square*im(1)
      end if
    end associate
    tangents%first_re(lane) = re(1)
    tangents%first_im(lane) = im(1)
    tangents%second_re(lane) = re(2)
    tangents%second_im(lane) = im(2)
  end subroutine put_tangents

end module lane_variation
