! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Directions in which periodic orbits go on over a parameter: along their tangent, across it, and along the parameter alone.
module orbit_directions
  use kinds, only: wp
  use matrices, only: solve
  use periodic_orbit, only: equations, orbit_t, parameter_slopes, scales_of_orbit, shoot_only
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: crossing_direction, depends_on_parameter, direct, tangent_of

contains

  !> Direction in which the orbits go on, a unit vector in natural sizes, on the side of `along`.
  pure subroutine tangent_of(machines, orbit, parameter_size, along, tangent, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: parameter_size, along(:)
    real(wp), intent(out) :: tangent(:)
    logical, intent(out) :: ok
    real(wp) :: miss(size(along)), slopes(size(along), size(along)), right(size(along))
    integer :: n
    n = size(along)
    call equations(machines%centre, orbit, scales_of_orbit(machines, orbit, parameter_size), parameter_slopes(machines, orbit), &
                   miss(:n - 1), slopes(:n - 1, :))
    slopes(n, :) = along
    right = 0
    right(n) = 1
    call solve(slopes, right, tangent, ok)
    if (ok) tangent = tangent/norm2(tangent)
  end subroutine tangent_of

  !> Direction of the branch that crosses at a branch point: the equations and `tangent` leave it free. A unit vector in natural
  !> sizes across the tangent.
  pure subroutine crossing_direction(machines, orbit, parameter_size, tangent, direction, ok)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(inout) :: orbit
    real(wp), intent(in) :: parameter_size, tangent(:)
    real(wp), intent(out) :: direction(:)
    logical, intent(out) :: ok
    real(wp) :: miss(size(tangent)), slopes(size(tangent), size(tangent)), next(size(tangent))
    integer :: i, n
    n = size(tangent)
    call equations(machines%centre, orbit, scales_of_orbit(machines, orbit, parameter_size), parameter_slopes(machines, orbit), &
                   miss(:n - 1), slopes(:n - 1, :))
    slopes(n, :) = tangent
    direction = [(1/(1 + 0.3_wp*i), i=1, n)]
    do i = 1, 3
      call solve(slopes, direction, next, ok)
      if (.not. ok) return
      direction = next/norm2(next)
    end do
    direction = direction - tangent*sum(tangent*direction)
    ok = norm2(direction) > 0.5_wp
    direction = direction/norm2(direction)
  end subroutine crossing_direction

  !> Whether an orbit depends on the parameter at all, to the bit.
  pure logical function depends_on_parameter(machines, orbit) result(depends)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp) :: own(size(orbit%y) + size(orbit%events)), near(size(own))
    integer :: i
    call shoot_only(machines%centre, orbit, own)
    depends = .false.
    do i = 1, size(machines%near)
      call shoot_only(machines%near(i)%machine, orbit, near)
      depends = depends .or. any(abs(near - own) > 0)
    end do
  end function depends_on_parameter

  !> The direction along the parameter alone, upwards or downwards.
  pure function direct(orbit, way) result(along)
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: way
    real(wp) :: along(size(orbit%y) + size(orbit%events) + 1)
    along = 0
    along(size(along)) = way
  end function direct

end module orbit_directions
