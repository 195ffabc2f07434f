! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Capture neighbourhoods of cycles that are weakly damped, and of equilibria. One round of such a cycle takes away little more than
!> what the curvature of the map adds: the neighbourhood that contracts within a round is far smaller than the one from which
!> motions come in within some rounds.
module wide_capture
  use attractors, only: attractor_t, kind_rest, squared_distance
  use cycle, only: back_substituted, direction, directions, map_point, matrix_of, rests_at, same_events
  use elementary, only: logarithm
  use kinds, only: int64, wp
  use machine_type, only: machine_t
  use matrices, only: cholesky
  use motion_state, only: tally_t
  implicit none
  private

  public :: widen

  !> Multiplier from which a cycle is weakly damped.
  real(wp), parameter :: weak = 0.9_wp
  !> Radii of the starts: between a neighbourhood that is known and one of twice its radius.
  real(wp), parameter :: rings(2) = [1.0_wp, 0.7071_wp]
  !> What is to be left of a distance, and in how many times the rounds that the linear part would need.
  real(wp), parameter :: left = 0.5_wp, longer = 2
  integer, parameter :: fewest_rounds = 4, most_doublings = 24
  !> Drive periods that are spent on one attractor, where flights are in closed form and where they are not.
  integer(int64), parameter :: most_periods = 100000, most_marched = 10000

  !> Rounds in which a start is to come in, and drive periods that may still be spent.
  type :: effort_t
    integer :: rounds = fewest_rounds
    integer(int64) :: periods_left = 0
  end type effort_t

contains

  !> Doubles the verified capture radius of a cycle while every sampled start on rings beyond it, around every point of the cycle,
  !> comes in to half its distance within some rounds, each with the events of the cycle. By induction from ring to ring all come
  !> into the neighbourhood that was verified before.
  pure subroutine widen(moving, attractor)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    class(machine_t), allocatable :: turning
    if (attractor%rests .or. attractor%any_position .or. attractor%period == 0) return
    if (.not. (attractor%multiplier >= weak .or. attractor%kind == kind_rest)) return
    if (attractor%by_event .and. .not. moving%by_event) then
      allocate (turning, source=moving)
      turning%by_event = .true.
      call double_radius(turning, attractor)
    else
      call double_radius(moving, attractor)
    end if
  end subroutine widen

  pure subroutine double_radius(moving, attractor)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    type(tally_t) :: reference(attractor%period)
    type(attractor_t) :: wider
    real(wp) :: image(attractor%coordinates)
    type(effort_t) :: effort
    integer :: i
    logical :: ok
    effort%periods_left = merge(most_periods, most_marched, moving%exact .or. moving%closed_form)
    do i = 1, attractor%period
      associate (point => attractor%points(:attractor%coordinates, i))
        ! Where a body rests on the section, the events of one round are not those of the next.
        if (moving%has_clock .and. rests_at(moving, point)) return
        call map_point(moving, point, attractor%period, image, reference(i), ok)
      end associate
      ! A neighbour of an equilibrium never comes to rest.
      if (moving%undriven .and. reference(i)%slips == 0) reference(i)%sticks = 0
    end do
    if (attractor%multiplier > left) then
      effort%rounds = max(fewest_rounds, ceiling(longer*logarithm(left)/logarithm(attractor%multiplier)))
    end if
    wider = attractor
    do i = 1, most_doublings
      wider%capture_radius = 2*wider%capture_radius
      call come_in(moving, wider, reference, effort, ok)
      if (.not. ok) return
      attractor%capture_radius = wider%capture_radius
    end do
  end subroutine double_radius

  !> Whether every start on the rings does.
  pure subroutine come_in(moving, attractor, reference, effort, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    type(tally_t), intent(in) :: reference(:)
    type(effort_t), intent(inout) :: effort
    logical, intent(out) :: ok
    real(wp) :: lower(attractor%coordinates, attractor%coordinates), point(attractor%coordinates)
    integer :: i, ring, k, n
    ok = .true.
    n = attractor%coordinates
    do i = 1, attractor%period
      lower = cholesky(matrix_of(attractor%metric(:, i), n))
      do ring = 1, size(rings)
        do k = 1, merge(2, max(directions, 4*n), n == 1)
          point = attractor%points(:n, i) &
                  + attractor%scale(:n)*back_substituted(lower, rings(ring)*attractor%capture_radius*direction(k, n))
          if (point(1) > moving%upper .or. point(1) < moving%lower) cycle
          call halve(moving, attractor, i, reference(i), point, effort, ok)
          if (.not. ok) return
        end do
      end do
    end do
  end subroutine come_in

  !> Whether a start comes in to half its distance from the `i`-th point of the cycle.
  pure subroutine halve(moving, attractor, i, reference, start, effort, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    integer, intent(in) :: i
    type(tally_t), intent(in) :: reference
    real(wp), intent(in) :: start(:)
    type(effort_t), intent(inout) :: effort
    logical, intent(out) :: ok
    real(wp) :: point(size(start)), image(size(start))
    type(tally_t) :: tally
    integer :: round
    point = start
    do round = 1, effort%rounds
      effort%periods_left = effort%periods_left - attractor%period
      ok = effort%periods_left >= 0
      if (ok) call map_point(moving, point, attractor%period, image, tally, ok)
      if (ok) ok = same_events(tally, reference)
      if (.not. ok) return
      if (squared_distance(attractor, i, image) <= left**2*squared_distance(attractor, i, start)) return
      point = image
    end do
    ok = .false.
  end subroutine halve

end module wide_capture
