! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whether a branch has come back to the orbit in which it began, and its last point there.
module branch_return
  use body_family, only: family_t
  use branch_point, only: point_t, step_to, trace_t
  use kinds, only: wp
  use orbit_sections, only: section_points
  use orbit_motion, only: same_sequence
  use periodic_orbit, only: orbit_t, scales_of_orbit
  implicit none
  private

  public :: return_share, close_up

contains

  !> The share of a step at which a branch of the same events has passed the orbit in which it began, maybe at another of its
  !> section points; 0 if it has not.
  pure real(wp) function return_share(first, before, trace, parameter_size) result(share)
    type(orbit_t), intent(in) :: first
    type(trace_t), intent(in) :: before, trace
    real(wp), intent(in) :: parameter_size
    real(wp) :: points(size(first%y), first%periods), miss, across
    integer :: k
    share = 0
    if (.not. same_sequence(first, trace%now%orbit) .or. .not. same_sequence(first, before%now%orbit)) return
    points = section_points(trace%machines, first)
    do k = 1, first%periods
      call place_on_step(points(:, k), first%parameter, before, trace, parameter_size, share, across, miss)
      if (share > 0 .and. share <= 1 .and. across < miss) return
    end do
    share = 0
  end function return_share

  !> Where a section point lies beside a step, as a share of it; its distance `across`, and that which is thought none, in natural
  !> sizes. The share is 0 for a step of no length.
  pure subroutine place_on_step(y, parameter, before, trace, parameter_size, share, across, none)
    real(wp), intent(in) :: y(:), parameter, parameter_size
    type(trace_t), intent(in) :: before, trace
    real(wp), intent(out) :: share, across, none
    real(wp) :: step(size(y) + 1), way(size(y) + 1)
    share = 0
    across = huge(across)
    none = 0
    associate (now => trace%now%orbit, last => before%now%orbit, sizes => trace%machines%centre%size_of)
      step = [(now%y - last%y)/sizes, (now%parameter - last%parameter)/parameter_size]
      if (.not. norm2(step) > 0) return
      way = [(y - last%y)/sizes, (parameter - last%parameter)/parameter_size]
      share = sum(way*step)/sum(step**2)
      across = norm2(way - share*step)
      none = 0.1_wp*norm2(step)
    end associate
  end subroutine place_on_step

  !> Ends a closed branch where it began, at a share of its last step: what was located beyond has been there from the beginning.
  !> `known` points come before that step.
  subroutine close_up(family, before, trace, share, points, known)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: before, trace
    real(wp), intent(in) :: share
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(in) :: known
    type(trace_t) :: there
    logical :: kept(size(points)), ok
    real(wp) :: at, across, none
    integer :: i, steps
    kept = .true.
    do i = known + 1, size(points)
      call place_on_step(points(i)%orbit%y, points(i)%orbit%parameter, before, trace, family%parameter_size, at, across, none)
      kept(i) = at < share
    end do
    associate (now => trace%now%orbit, last => before%now%orbit)
      call step_to(family, before, share*norm2([now%y - last%y, now%events%time - last%events%time, now%parameter - &
                   last%parameter]/scales_of_orbit(trace%machines, now, family%parameter_size)), there, ok, steps)
    end associate
    if (.not. ok) there = trace
    points = [pack(points, kept), there%now]
  end subroutine close_up

end module branch_return
