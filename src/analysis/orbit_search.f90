! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Periodic orbits at one value of the parameter, stable and unstable: Newton's method on the map with its exact derivative, from
!> starts as they are, and from where the motions from them have settled.
module orbit_search
  use body_family, only: family_t
  use hybrid_machine, only: event_t
  use kinds, only: wp
  use matrices, only: solve
  use motion_state, only: tally_t
  use multipliers, only: is_neutral
  use orbit_sections, only: section_points
  use orbit_motion, only: is_admissible, orbit_of_motion
  use periodic_orbit, only: correct_orbit, orbit_t, same_orbit
  use orbit_directions, only: direct
  use search_watch, only: search_watch_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: find_orbits

  integer, parameter :: most_newton = 20, settling = 150
  !> Relative distance at which a section point counts as a return to an earlier one, and at which two orbits are one.
  real(wp), parameter :: near_return = 0.1_wp
  !> A motion has settled when it moves no further than this over a number of periods that every short one divides.
  real(wp), parameter :: at_rest = 1e-9_wp
  integer, parameter :: any_period = 12
  !> A motion this near to a stable orbit, and coming nearer, is on it.
  real(wp), parameter :: captured = 1e-5_wp
  !> Rate of change in natural sizes below which a motion is an equilibrium.
  real(wp), parameter :: all_but_at_rest = 1e-5_wp

  !> Orbits found at one value: their section points are in `points`, column by column.
  type, public :: found_t
    type(orbit_t), allocatable :: orbits(:)
    !> Orbits met that are not isolated; equilibria, which without a clock are met as cycles of no extent.
    integer :: families = 0, equilibria = 0
    !> Starts, and those whose motions were given up or left their domain.
    integer :: starts = 0, lost = 0
  end type found_t

contains

  !> Adds to `found` the orbits that starts (columns x [m], v [m/s]) lead to: of `longest` drive periods at most where the motion
  !> settles, of up to two elsewhere. Every start is reported to `watch` twice.
  subroutine find_orbits(family, machines, value, starts, longest, found, watch)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    real(wp), intent(in) :: value, starts(:, :)
    integer, intent(in) :: longest
    type(found_t), intent(inout) :: found
    class(search_watch_t), intent(inout), optional :: watch
    real(wp) :: settled(size(starts, 1))
    integer :: i, n
    if (.not. allocated(found%orbits)) allocate (found%orbits(0))
    do i = 1, size(starts, 2)
      if (present(watch)) call watch%report_start()
      call settle(machines, starts(:, i), longest, found, settled, n)
      found%starts = found%starts + 1
      if (n < 0) found%lost = found%lost + 1
      if (n <= 0) cycle
      if (is_found(machines, settled, n, found)) cycle
      call try_newton(family, machines, value, settled, n, found)
    end do
    do i = 1, size(starts, 2)
      if (present(watch)) call watch%report_start()
      do n = 1, min(2, longest)
        call try_newton(family, machines, value, starts(:, i), n, found)
      end do
    end do
  end subroutine find_orbits

  !> Whether a section point is one of a known orbit.
  logical function is_found(machines, point, periods, found)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: periods
    type(found_t), intent(in) :: found
    real(wp), allocatable :: points(:, :)
    integer :: i, k
    is_found = .false.
    do i = 1, size(found%orbits)
      if (found%orbits(i)%periods /= periods) cycle
      points = section_points(machines, found%orbits(i))
      do k = 1, periods
        is_found = is_found .or. distance(machines, points(:, k), point) < same_orbit
      end do
    end do
  end function is_found

  !> Where a motion is after many periods, and after how many it is back there (0: it is not, or it has come to a known orbit;
  !> -1: it was given up or left its domain).
  subroutine settle(machines, start, longest, found, settled, periods)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: start(:)
    integer, intent(in) :: longest
    type(found_t), intent(in) :: found
    real(wp), intent(out) :: settled(:)
    integer, intent(out) :: periods
    real(wp), dimension(size(start)) :: image, next, then
    logical :: ok
    integer :: i
    periods = 0
    settled = start
    then = start
    do i = 1, settling
      call image_of(machines, settled, next, ok)
      if (.not. ok) then
        periods = -1
        return
      end if
      settled = next
      if (modulo(i, any_period) /= 0) cycle
      if (distance(machines, settled, then) < at_rest) exit
      if (has_converged(machines, settled, then, found)) return
      then = settled
    end do
    image = settled
    do i = 1, longest
      call image_of(machines, image, next, ok)
      if (.not. ok) return
      image = next
      if (distance(machines, image, settled) > near_return) cycle
      periods = i
      return
    end do
  end subroutine settle

  !> Whether a motion that was at `before` a number of periods ago approaches a known stable orbit.
  logical function has_converged(machines, point, before, found)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:), before(:)
    type(found_t), intent(in) :: found
    integer :: i
    real(wp) :: near
    has_converged = .false.
    do i = 1, size(found%orbits)
      if (maxval(abs(found%orbits(i)%multipliers)) >= 1) cycle
      near = distance(machines, point, found%orbits(i)%y)
      has_converged = near < captured .and. near < distance(machines, before, found%orbits(i)%y)
      if (has_converged) return
    end do
  end function has_converged

  !> Image of a section point.
  subroutine image_of(machines, point, image, ok)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    real(wp), intent(out) :: image(:)
    logical, intent(out) :: ok
    type(event_t), allocatable :: events(:)
    type(tally_t) :: tally
    integer :: mode
    call machines%centre%fly_sections(point, 1, .false., image, events, mode, tally, ok)
    ok = ok .and. all(abs(image) < huge(1.0_wp))
  end subroutine image_of

  !> Distance of two section points in natural sizes; an angle is on a circle.
  pure real(wp) function distance(machines, one, other)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: one(:), other(:)
    distance = norm2((machines%centre%nearest_copy(one, other) - other)/machines%centre%size_of)
  end function distance

  !> Newton's method on the map over `periods`, each step with the events of the motion then; what it comes to is added.
  subroutine try_newton(family, machines, value, start, periods, found)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    real(wp), intent(in) :: value, start(:)
    integer, intent(in) :: periods
    type(found_t), intent(inout) :: found
    real(wp), dimension(size(start)) :: point, image, step, sizes
    real(wp) :: slopes(size(start), size(start))
    type(tally_t) :: tally
    logical :: ok
    integer :: i, k
    point = start
    sizes = machines%centre%size_of
    do i = 1, most_newton
      call machines%centre%map(machines, point, periods, image, slopes, tally, ok)
      if (.not. ok) return
      do k = 1, size(start)
        slopes(k, k) = slopes(k, k) - 1
      end do
      call solve(slopes, point - machines%centre%nearest_copy(image, point), step, ok)
      if (.not. ok) return
      if (norm2(step/sizes) > 0.3_wp) step = 0.3_wp*step/norm2(step/sizes)
      point = point + step
      point = machines%centre%within_stops(point)
      if (norm2(step/sizes) < 1e-8_wp) exit
    end do
    if (.not. norm2(step/sizes) < 1e-6_wp) return
    ! Most starts lead to what others led to.
    if (.not. is_found(machines, point, periods, found)) call add_orbit(family, machines, value, point, periods, found)
  end subroutine try_newton

  !> Corrects the orbit near a section point and adds it, unless it is known, not real, or of a shorter period.
  subroutine add_orbit(family, machines, value, point, periods, found, added)
    type(family_t), intent(in) :: family
    type(neighbourhood_t), intent(inout) :: machines
    real(wp), intent(in) :: value, point(:)
    integer, intent(in) :: periods
    type(found_t), intent(inout) :: found
    logical, intent(out), optional :: added
    type(orbit_t) :: orbit
    real(wp), allocatable :: points(:, :)
    logical :: ok
    integer :: i, k
    if (present(added)) added = .false.
    call orbit_of_motion(machines, value, point, periods, orbit, ok)
    if (ok) call correct_orbit(family, machines, orbit, direct(orbit, 1), ok)
    if (.not. ok) return
    if (is_equilibrium(machines, orbit)) then
      found%equilibria = found%equilibria + 1
      return
    end if
    if (is_neutral(orbit%multipliers)) then
      found%families = found%families + 1
      return
    end if
    if (.not. is_admissible(machines, orbit)) return
    if (is_shorter(machines, orbit)) return
    points = section_points(machines, orbit)
    do i = 1, size(found%orbits)
      if (found%orbits(i)%periods /= periods) cycle
      do k = 1, periods
        if (distance(machines, points(:, k), found%orbits(i)%y) < same_orbit) return
      end do
    end do
    found%orbits = [found%orbits, orbit]
    if (present(added)) added = .true.
  end subroutine add_orbit

  !> Whether the motion of an orbit is back before its period is over: flown, since the points of a chatter are not on the orbit.
  logical function is_shorter(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp) :: point(size(orbit%y)), next(size(orbit%y))
    logical :: ok
    integer :: i
    is_shorter = .false.
    point = orbit%y
    do i = 1, orbit%periods - 1
      call image_of(machines, point, next, ok)
      if (.not. ok) return
      point = next
      is_shorter = distance(machines, point, orbit%y) < same_orbit
      if (is_shorter) return
    end do
  end function is_shorter

  !> Whether nothing moves on an orbit without a clock, in natural sizes; one that is all but at rest counts as well.
  pure logical function is_equilibrium(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    is_equilibrium = .not. machines%centre%has_clock
    if (.not. is_equilibrium) return
    associate (machine => machines%centre)
      is_equilibrium = norm2(machine%slope(orbit%mode, 0.0_wp, orbit%y)/machine%size_of)*machine%size_of_time() < all_but_at_rest
    end associate
  end function is_equilibrium

end module orbit_search
