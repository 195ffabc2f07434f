! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Capture neighbourhoods of cycles that are weakly damped, and of equilibria. The metric that `cycle` takes promises next to
!> nothing in directions that the linear part turns before it shortens them, so that the slightest curvature of the map breaks the
!> promise. Here the metric is one in which the linear part shortens all directions alike.
module wide_capture
  use attractors, only: attractor_t, kind_rest
  use capture_metric, only: contracting_metric, eigenvalue_bounds, least_eigenvalue
  use contraction, only: contracts, rests_at
  use kinds, only: wp
  use machine_type, only: machine_t
  use motion_state, only: tally_t
  use section_map, only: derivative, map_point
  implicit none
  private

  public :: widen

  !> Multiplier from which a cycle is weakly damped.
  real(wp), parameter :: weak = 0.9_wp
  !> Parts of what the multiplier takes away in a round: that which the metric keeps in all directions, that which starts must lose.
  real(wp), parameter :: kept = 0.9_wp, asked = 0.225_wp
  !> The first radius that is tried, in the metric; largest distance from a cycle that moves, in its size.
  real(wp), parameter :: first_radius = 1e-4_wp, farthest = 0.5_wp
  real(wp), parameter :: growth = 1.5_wp
  integer, parameter :: most_steps = 60

contains

  !> Gives a verified cycle a metric in which its map shortens all directions alike, and the largest radius up to which every
  !> sampled start on rings around every point is nearer after one period of the cycle, by a part of what the multiplier promises,
  !> with the events of the cycle. Nothing is changed where that captures no more than before.
  pure subroutine widen(moving, attractor)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    class(machine_t), allocatable :: turning
    if (attractor%rests .or. attractor%any_position .or. attractor%period == 0) return
    if (.not. (attractor%multiplier >= weak .or. attractor%kind == kind_rest)) return
    if (attractor%by_event .and. .not. moving%by_event) then
      allocate (turning, source=moving)
      turning%by_event = .true.
      call grow(turning, attractor)
    else
      call grow(moving, attractor)
    end if
  end subroutine widen

  pure subroutine grow(moving, attractor)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    type(tally_t) :: reference(attractor%period)
    type(attractor_t) :: wider
    real(wp) :: image(attractor%coordinates), jacobian(attractor%coordinates, attractor%coordinates), radius, &
      promised(attractor%period)
    integer :: i
    logical :: ok
    wider = attractor
    do i = 1, attractor%period
      associate (n => attractor%coordinates, point => attractor%points(:attractor%coordinates, i))
        ! Where a body rests on the section, the events of one round are not those of the next.
        if (moving%has_clock .and. rests_at(moving, point)) return
        call map_point(moving, point, attractor%period, image, reference(i), ok)
        if (ok) call derivative(moving, point, attractor%period, attractor%scale(:n), jacobian, ok)
        if (.not. ok) return
        wider%metric(:, i) = contracting_metric(jacobian/(1 - kept*(1 - attractor%multiplier)))
      end associate
      ! A neighbour of an equilibrium never comes to rest.
      if (moving%undriven .and. reference(i)%slips == 0) reference(i)%sticks = 0
    end do
    promised = 1 - asked*(1 - attractor%multiplier)
    radius = first_radius
    wider%capture_radius = 0
    do i = 1, most_steps
      if (attractor%kind /= kind_rest .and. radius > farthest*sqrt(least_eigenvalue(wider))) exit
      if (.not. contracts(moving, wider, reference, radius, promised, settles=.false.)) exit
      wider%capture_radius = radius
      radius = growth*radius
    end do
    if (reach_of(wider) > reach_of(attractor)) attractor = wider
  end subroutine grow

  !> Smallest semi-axis of the neighbourhoods of a cycle, in the scales of its coordinates.
  pure real(wp) function reach_of(attractor) result(reach)
    type(attractor_t), intent(in) :: attractor
    real(wp) :: bounds(2)
    integer :: i
    reach = huge(reach)
    do i = 1, attractor%period
      bounds = eigenvalue_bounds(attractor, i)
      reach = min(reach, attractor%capture_radius/sqrt(bounds(2)))
    end do
  end function reach_of

end module wide_capture
