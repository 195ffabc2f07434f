! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The doublings in which branches of twice the period end, and the branch points in which branches end that cross another.
module branch_ends
  use body_family, only: family_t
  use branch_point, only: branch_t, label_bp, label_not_known, label_pd
  use errors, only: error_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use orbit_sections, only: section_points
  use periodic_orbit, only: orbit_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: join_ends

  !> Nearness of an end to what was located, in multiplier and as a share of the range.
  real(wp), parameter :: nearly = 1e-3_wp
  !> The same of section points, in natural sizes: they go with the root of the parameter.
  real(wp), parameter :: near_points = 3e-2_wp

contains

  !> Puts the ends of branches that are in a doubling, or in a branch point, where it was located on the branch of half the period,
  !> or of the same: the equations are singular there.
  pure subroutine join_ends(family, branches)
    type(family_t), intent(in) :: family
    type(branch_t), intent(inout) :: branches(:)
    type(orbit_t) :: located
    integer :: b, k, times
    logical :: found
    do b = 1, size(branches)
      do k = 1, 2
        if (all(branches(b)%ending(k) /= [label_pd, label_not_known])) cycle
        associate (last => branches(b)%points(merge(1, size(branches(b)%points), k == 1)))
          do times = 1, 2
            if (times == 1 .and. branches(b)%ending(k) == label_pd) cycle
            call nearest_located(family, branches, last%orbit, times, branches(b)%ending(k) == label_pd, located, found)
            if (.not. found) cycle
            last%orbit%parameter = located%parameter
            last%orbit%y = located%y
            last%orbit%multipliers = located%multipliers**times
            last%label = merge(label_pd, label_bp, times == 2)
            branches(b)%ending(k) = last%label
            exit
          end do
        end associate
      end do
    end do
  end subroutine join_ends

  !> The doubling (`times` 2) or branch point (1) that an orbit ended in, of those of half its period, or of the same, nearby, with
  !> that section point in front that is nearest to the orbit's: twins of a symmetric machine double at one value of the parameter.
  !> `doubles`: it is known to be a doubling; else a multiplier +1 must decide.
  pure subroutine nearest_located(family, branches, ended, times, doubles, located, found)
    type(family_t), intent(in) :: family
    type(branch_t), intent(in) :: branches(:)
    type(orbit_t), intent(in) :: ended
    integer, intent(in) :: times
    logical, intent(in) :: doubles
    type(orbit_t), intent(out) :: located
    logical, intent(out) :: found
    real(wp) :: least, distance, point(size(ended%y))
    integer :: c, i, label, multiplier
    label = merge(label_pd, label_bp, times == 2)
    multiplier = merge(-1, 1, times == 2)
    found = minval(abs(ended%multipliers - 1)) <= nearly .or. doubles
    if (.not. found) return
    least = near_points
    do c = 1, size(branches)
      do i = 1, size(branches(c)%points)
        associate (there => branches(c)%points(i))
          if (times*there%orbit%periods /= ended%periods .or. there%label /= label) cycle
          if (minval(abs(there%orbit%multipliers - multiplier)) > nearly) cycle
          if (abs(ended%parameter - there%orbit%parameter) >= nearly*family%parameter_size) cycle
          call nearest_section_point(family, there%orbit, ended%y, point, distance)
          if (distance >= least) cycle
          least = distance
          located = there%orbit
          located%y = point
        end associate
      end do
    end do
    found = least < near_points
  end subroutine nearest_located

  !> The section point of an orbit that is nearest to `y`, and its distance in natural sizes: huge if the machine is not to be had.
  pure subroutine nearest_section_point(family, orbit, y, nearest, distance)
    type(family_t), intent(in) :: family
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: y(:)
    real(wp), intent(out) :: nearest(:), distance
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp) :: points(size(y), orbit%periods), there
    integer :: k
    distance = huge(distance)
    nearest = y
    call machine_neighbourhood(family, orbit%parameter, machines, error)
    if (allocated(error)) return
    points = section_points(machines, orbit)
    do k = 1, orbit%periods
      points(:, k) = machines%centre%nearest_copy(points(:, k), y)
      there = norm2((points(:, k) - y)/machines%centre%size_of)
      if (there >= distance) cycle
      distance = there
      nearest = points(:, k)
    end do
  end subroutine nearest_section_point

end module branch_ends
