! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The limit cycles that are born at a Hopf point: one of a given small size beside it, from the plane of the eigenvectors, and
!> which ends of branches of cycles are such points.
module hopf_cycles
  use body_family, only: family_t
  use branch_point, only: branch_t, label_hb, label_not_known, no_label, point_t
  use constants, only: two_pi
  use equilibrium, only: eigen_of, equilibrium_t
  use equilibrium_branch, only: equilibria_t
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use orbit_motion, only: is_admissible, orbit_of_motion
  use periodic_orbit, only: closing_time, correct_orbit, orbit_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: begin_cycle, mark_births

  !> Sizes of the cycle that are tried, in natural sizes.
  real(wp), parameter :: sizes_tried(4) = [0.02_wp, 0.005_wp, 0.1_wp, 0.001_wp]
  !> A branch ends in a Hopf point that is as near in the parameter, as a share of its range, and in the logarithm of the period,
  !> with a cycle of at most this extent in natural sizes.
  real(wp), parameter :: near_parameter = 1e-3_wp, near_period = 0.02_wp, smallest_extent = 0.05_wp

  !> The imaginary parts of a pair differ by rounding.
  real(wp), parameter :: of_pair = 1e-9_wp

contains

  !> A cycle beside a Hopf point, its parameter being what its size makes it. `ok` is false where none is found.
  subroutine begin_cycle(family, point, orbit, ok)
    type(family_t), intent(in) :: family
    type(equilibrium_t), intent(in) :: point
    type(orbit_t), intent(out) :: orbit
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp) :: along(size(point%y)), start(size(point%y))
    real(wp), allocatable :: direction(:)
    integer :: i
    do i = 1, size(sizes_tried)
      call machine_neighbourhood(family, point%parameter, machines, error)
      ok = .not. allocated(error)
      if (.not. ok) return
      along = at_maximum(machines%centre, point)
      start = point%y + sizes_tried(i)*along*machines%centre%size_of
      call orbit_of_motion(machines, point%parameter, start, 1, orbit, ok)
      if (.not. ok) cycle
      allocate (direction(size(along) + size(orbit%events) + 1), source=0.0_wp)
      direction(:size(along)) = along/norm2(along)
      call correct_orbit(family, machines, orbit, direction, ok)
      deallocate (direction)
      if (ok) ok = is_admissible(machines, orbit)
      if (ok) ok = abs(orbit%parameter - point%parameter) < 0.3_wp*family%parameter_size
      if (ok) ok = norm2((orbit%y - point%y)/machines%centre%size_of) > 0.3_wp*sizes_tried(i)
      if (ok) return
    end do
  end subroutine begin_cycle

  !> The state on the cycle where the watched position is largest, over its size there, in natural sizes.
  pure function at_maximum(machine, point) result(along)
    class(hybrid_t), intent(in) :: machine
    type(equilibrium_t), intent(in) :: point
    real(wp) :: along(size(point%y)), rows(2, size(point%y))
    complex(wp), allocatable :: values(:), vectors(:, :)
    complex(wp) :: position
    integer :: k
    call eigen_of(machine, point, values, vectors)
    k = minloc(abs(real(values)), 1)
    rows = machine%watched
    position = sum(rows(1, :)*machine%size_of*vectors(:, k))
    along = 0
    if (.not. abs(position) > 0) return
    along = real(vectors(:, k)/position, wp)*machine%size_of(1)
    if (.not. maxval(abs(along)) < 1e3_wp) along = 0
  end function at_maximum

  !> Ends the branches of cycles that shrink to a point in the Hopf point that they shrink to; where there is none, what that is, is
  !> not known.
  subroutine mark_births(family, watch, equilibria, branches)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: watch(:, :)
    type(equilibria_t), intent(in) :: equilibria(:)
    type(branch_t), intent(inout) :: branches(:)
    type(point_t) :: limit
    integer :: b, side
    logical :: found
    do b = 1, size(branches)
      do side = 1, 2
        if (branches(b)%ending(side) /= label_hb) cycle
        associate (line => branches(b))
          limit = line%points(merge(1, size(line%points), side == 1))
          call find_birth(family, watch, equilibria, limit, found)
          line%points(merge(1, size(line%points), side == 1))%label = merge(no_label, label_not_known, found)
          if (.not. found) line%ending(side) = label_not_known
          if (.not. found) cycle
          if (side == 1) line%points = [limit, line%points]
          if (side == 2) line%points = [line%points, limit]
        end associate
      end do
    end do
  end subroutine mark_births

  !> The Hopf point that a small cycle shrinks to, as a cycle of no extent: it has two multipliers 1, one of them the trivial one,
  !> beside those of the other eigenvalues.
  subroutine find_birth(family, watch, equilibria, limit, found)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: watch(:, :)
    type(equilibria_t), intent(in) :: equilibria(:)
    type(point_t), intent(inout) :: limit
    logical, intent(out) :: found
    real(wp) :: frequency, at(2)
    integer :: e, i, k, last
    found = .false.
    do e = 1, size(equilibria)
      do i = 1, size(equilibria(e)%points)
        associate (point => equilibria(e)%points(i))
          if (point%label /= label_hb) cycle
          if (.not. is_birth(family, point, limit%orbit, limit%x_max - limit%x_min)) cycle
          found = .true.
          k = minloc(abs(real(point%values)), 1)
          frequency = abs(aimag(point%values(k)))
          at = matmul(watch, point%y)
          limit%label = label_hb
          limit%x_max = at(1)
          limit%x_min = at(1)
          limit%orbit%parameter = point%parameter
          limit%orbit%y = point%y
          limit%orbit%events(size(limit%orbit%events))%time = two_pi/frequency
          limit%orbit%multipliers = 0
          limit%orbit%multipliers(1) = 1
          last = 1
          do k = 1, size(point%values)
            if (abs(abs(aimag(point%values(k))) - frequency) <= of_pair*frequency) cycle
            last = last + 1
            if (last < size(limit%orbit%multipliers)) limit%orbit%multipliers(last) = exp(point%values(k)*(two_pi/frequency))
          end do
          return
        end associate
      end do
    end do
  end subroutine find_birth

  !> Whether a cycle of a given extent [m] is one that is about to vanish in a Hopf point.
  logical function is_birth(family, point, orbit, extent)
    type(family_t), intent(in) :: family
    type(equilibrium_t), intent(in) :: point
    type(orbit_t), intent(in) :: orbit
    real(wp), intent(in) :: extent
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp) :: frequency
    is_birth = abs(orbit%parameter - point%parameter) < near_parameter*family%parameter_size .and. orbit%periods == 1
    if (.not. is_birth) return
    call machine_neighbourhood(family, point%parameter, machines, error)
    is_birth = .not. allocated(error)
    if (.not. is_birth) return
    frequency = abs(aimag(point%values(minloc(abs(real(point%values)), 1))))
    is_birth = extent < smallest_extent*machines%centre%size_of(1) .and. &
               norm2((orbit%y - point%y)/machines%centre%size_of) < smallest_extent .and. &
               abs(closing_time(machines%centre, orbit)*frequency/two_pi - 1) < near_period
  end function is_birth

end module hopf_cycles
