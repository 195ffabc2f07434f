! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The end of a branch of orbits of even period in that of half its period: beyond it the equations have the same orbits once more,
!> with their halves exchanged.
module branch_parent
  use body_family, only: family_t
  use branch_passage, only: most_secants
  use branch_point, only: label_gr, label_not_known, label_pd, no_label, point_t, step_to, trace_t
  use graze_passage, only: at_graze
  use kinds, only: wp
  use orbit_margins, only: of_impact
  use orbit_sections, only: section_points
  use periodic_orbit, only: closing_time
  implicit none
  private

  public :: end_at_parent, swaps_halves

  !> Nearness of a multiplier to that of a doubling at the end of a branch.
  real(wp), parameter :: at_doubling = 1e-2_wp
  !> The halves of an orbit may be the same where they differ by less than the first, a share of what they did a step before; they
  !> are where they differ by less than the second, in natural sizes.
  real(wp), parameter :: same_halves = 1e-2_wp, no_difference = 1e-6_wp
  !> What is left of that difference where it is none.
  real(wp), parameter :: rounding_of_halves = 1e-6_wp

contains

  !> What the second half of an orbit of even period differs by from the first, in natural sizes: in the instants and states of the
  !> events, and without any in the section points, which jump where an impact passes the section. Nothing where the halves have
  !> other events.
  pure function halves_differ(trace) result(difference)
    type(trace_t), intent(in) :: trace
    real(wp), allocatable :: difference(:)
    real(wp) :: points(size(trace%now%orbit%y), trace%now%orbit%periods)
    integer :: k
    associate (orbit => trace%now%orbit, machine => trace%machines%centre, m => size(trace%now%orbit%events), &
               half => size(trace%now%orbit%events)/2, n => size(trace%now%orbit%y))
      allocate (difference(0))
      if (m == 0) then
        points = section_points(trace%machines, orbit)
        difference = (points(:, 1 + orbit%periods/2) - points(:, 1))/machine%size_of
        return
      end if
      if (modulo(m, 2) > 0) return
      do k = 1, half
        associate (one => orbit%events(k), other => orbit%events(half + k))
          if (one%kind /= other%kind .or. one%side /= other%side .or. one%joint /= other%joint) then
            difference = [real(wp) ::]
            return
          end if
          difference = [difference, (other%time - one%time - closing_time(machine, orbit)/2)/machine%size_of_time(), &
                        (machine%nearest_copy(other%arrival(:n), one%arrival(:n)) - one%arrival(:n))/machine%size_of]
        end associate
      end do
    end associate
  end function halves_differ

  !> Whether the halves of an orbit may have been exchanged: in between it was one of half the period.
  pure logical function swaps_halves(trace, next)
    type(trace_t), intent(in) :: trace, next
    swaps_halves = modulo(trace%now%orbit%periods, 2) == 0
    if (swaps_halves) swaps_halves = .not. still_differ(trace, next)
  end function swaps_halves

  !> Whether the halves of the orbit `next` differ as those of `trace` do: not the other way round, and not by rounding alone, as
  !> where a step has ended on the branch of half the period.
  pure logical function still_differ(trace, next)
    type(trace_t), intent(in) :: trace, next
    real(wp), allocatable :: before(:)
    before = halves_differ(trace)
    still_differ = sum(before*halves_differ(next)) >= rounding_of_halves*sum(before**2)
  end function still_differ

  !> The end of a branch in the orbit of half its period, from which it came by a doubling or in a graze; none if the halves are not
  !> the same anywhere on the step.
  subroutine end_at_parent(family, trace, length, points, ending)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: there, tried
    real(wp) :: low, high, middle, left
    logical :: ok, all_ok
    integer :: i, steps
    there = trace
    all_ok = .true.
    low = 0
    high = length
    do i = 1, most_secants
      middle = (low + high)/2
      call step_to(family, trace, middle, tried, ok, steps)
      ! At the end itself the equations are singular: it is approached from this side.
      if (ok) there = tried
      all_ok = all_ok .and. ok
      if (.not. ok .or. .not. still_differ(trace, there)) then
        high = middle
      else
        low = middle
      end if
      if (high - low <= 4*spacing(high)) exit
    end do
    left = norm2(halves_differ(there))
    ending = no_label
    if (all_ok .and. left > same_halves*norm2(halves_differ(trace))) return
    ending = label_not_known
    ! It began in a graze, or in a doubling, where the orbit of twice the period has a multiplier +1.
    if (any(there%margins%list%kind == of_impact .and. abs(there%margins%list%value) < at_graze)) then
      ending = label_gr
    else if (left < no_difference .or. minval(abs(there%now%orbit%multipliers - 1)) < at_doubling) then
      ending = label_pd
    end if
    there%now%label = ending
    points = [points, there%now]
  end subroutine end_at_parent

end module branch_parent
