! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The branches of periodic orbits over a range of a parameter: orbits are searched at several values, each that lies on no branch
!> yet is followed, and so is what bifurcates where a period doubles. The result depends on the seeds and need not be complete.
module branch_search
  use body_family, only: family_t
  use branch_ends, only: join_ends
  use branch_point, only: branch_t, label_bp, label_gr, label_gr_fold, label_hb, label_pd, label_sn, point_t, set_sizes
  use equilibrium_branch, only: find_equilibria
  use errors, only: error_t
  use hopf_cycles, only: begin_cycle, mark_births
  use kinds, only: wp
  use hybrid_machine, only: hybrid_t
  use machine_family, only: machine_neighbourhood, machine_of_family
  use matrices, only: solve
  use multipliers, only: is_neutral
  use orbit_search, only: found_t
  use orbit_sections, only: section_points
  use orbit_symmetry, only: mark_symmetry
  use part_of_branch, only: lies_on
  use orbit_motion, only: is_admissible, orbit_of_motion, same_sequence
  use periodic_orbit, only: correct_orbit, move_along, orbit_t, scales_of_orbit
  use orbit_directions, only: crossing_direction, direct
  use search_jobs, only: trace
  use search_state, only: search_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: prepare_search, follow_seeds

  !> How far along the critical direction the doubled orbit is looked for, in natural sizes; largest number of drive periods of an
  !> orbit that is followed after a doubling.
  real(wp), parameter :: doubled_at = 3e-3_wp
  !> The same of a branch that crosses.
  real(wp), parameter :: crossed_at = 4e-3_wp

contains

  !> Sets the values and sizes of a search. Code 65 if a machine of the range cannot be built or has no variations.
  subroutine prepare_search(search, values, error)
    type(search_t), intent(inout) :: search
    integer, intent(in) :: values
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    class(hybrid_t), allocatable :: machine
    call set_sizes(search%plan, search%family, error)
    if (allocated(error)) return
    call machine_of_family(search%family, (search%plan%lowest + search%plan%highest)/2, machine, error)
    if (allocated(error)) return
    search%watch = machine%watched
    search%has_clock = machine%has_clock
    associate (low => search%plan%lowest, high => search%plan%highest)
      search%values = [(low + (high - low)*(i - 0.5_wp)/values, i=1, values)]
    end associate
    allocate (search%found(values), search%branches(0))
  end subroutine prepare_search

  !> Follows every seed that is on no branch yet, value by value, and the doubled orbits of what is found.
  subroutine follow_seeds(search)
    type(search_t), intent(inout) :: search
    type(found_t), allocatable :: seeds(:)
    integer :: i, k
    seeds = search%found
    do i = 1, size(seeds)
      search%seeds = search%seeds + size(seeds(i)%orbits)
      deallocate (search%found(i)%orbits)
      allocate (search%found(i)%orbits(0))
    end do
    do i = 1, size(seeds)
      if (allocated(search%traced)) deallocate (search%traced)
      do k = 1, size(seeds(i)%orbits)
        if (size(search%branches) >= search%most_branches) exit
        if (is_known(search, i, seeds(i)%orbits(k))) cycle
        search%expected = seeds(i)%orbits(k + 1:)
        call follow_new(search, seeds(i)%orbits(k))
      end do
    end do
    search%expected = seeds(1)%orbits(:0)
    call follow_births(search)
    call leave_out_parts(search)
    call join_ends(search%family, search%branches)
    call mark_births(search%family, search%watch, search%equilibria, search%branches)
    do i = 1, size(search%branches)
      call mark_symmetry(search%family, search%branches(i))
    end do
  end subroutine follow_seeds

  !> Follows the equilibria, and the cycles that are born at their Hopf points.
  subroutine follow_births(search)
    type(search_t), intent(inout) :: search
    type(orbit_t) :: orbit
    integer :: e, i
    logical :: ok
    call find_equilibria(search%family, search%plan, search%values, search%starts, search%equilibria)
    do e = 1, size(search%equilibria)
      do i = 1, size(search%equilibria(e)%points)
        if (search%equilibria(e)%points(i)%label /= label_hb) cycle
        call begin_cycle(search%family, search%equilibria(e)%points(i), orbit, ok)
        if (ok) call follow_new(search, orbit)
      end do
    end do
  end subroutine follow_births

  !> Leaves out branches that lie on another one: one may end, for want of points or of a sequence of events, where the other
  !> goes on.
  subroutine leave_out_parts(search)
    type(search_t), intent(inout) :: search
    logical :: kept(size(search%branches))
    integer :: b, c
    kept = .true.
    do b = 1, size(kept)
      do c = 1, size(kept)
        if (c == b .or. .not. kept(c)) cycle
        kept(b) = .not. lies_on(search%branches(b), search%branches(c), search%family)
        if (.not. kept(b)) exit
      end do
    end do
    search%branches = pack(search%branches, kept)
  end subroutine leave_out_parts

  !> Whether an orbit at the value number `i` is on a branch.
  logical function is_known(search, i, orbit) result(known)
    type(search_t), intent(inout) :: search
    integer, intent(in) :: i
    type(orbit_t), intent(in) :: orbit
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp) :: points(size(orbit%y), orbit%periods)
    integer :: j, k
    known = .false.
    call machine_neighbourhood(search%family, search%values(i), machines, error)
    if (allocated(error)) return
    points = section_points(machines, orbit)
    do j = 1, size(search%found(i)%orbits)
      if (search%found(i)%orbits(j)%periods /= orbit%periods) cycle
      do k = 1, orbit%periods
        known = known .or. norm2((points(:, k) - search%found(i)%orbits(j)%y)/machines%centre%size_of) < 1e-6_wp
      end do
    end do
  end function is_known

  !> Follows one orbit, notes where its branch passes the values of the search, and follows what doubles and what crosses.
  recursive subroutine follow(search, seed)
    type(search_t), intent(inout) :: search
    type(orbit_t), intent(in) :: seed
    type(branch_t) :: found
    type(orbit_t) :: other
    integer :: i, side
    logical :: ok
    call trace(search, seed, found)
    if (is_of_family(found)) then
      i = minloc(abs(search%values - seed%parameter), 1)
      search%found(i)%families = search%found(i)%families + 1
      return
    end if
    search%branches = [search%branches, found]
    ! Where none of the seeds depends on the parameter, an orbit further on may.
    search%depends = search%depends .or. any(found%points%label == label_gr .or. found%points%label == label_gr_fold .or. &
                                             found%points%label == label_pd .or. found%points%label == label_sn)
    call note_passages(search, found)
    do i = 1, size(found%points)
      select case (found%points(i)%label)
      case (label_pd)
        ! The end of a branch in the doubling that it came from has a multiplier +1.
        if (minval(abs(found%points(i)%orbit%multipliers + 1)) > 1e-3_wp) cycle
        if (2*seed%periods > search%longest_followed) cycle
        call double(search, found%points(i)%orbit, other, ok)
        if (ok) call follow_new(search, other)
      case (label_bp)
        do side = 1, -1, -2
          call cross(search, found%points(i), side, other, ok)
          if (ok) call follow_new(search, other)
        end do
      end select
    end do
  end subroutine follow

  !> Whether an orbit that cannot be followed has a multiplier +1, as far as a stick phase lets it be known: it is one of a family,
  !> or beside a fold.
  pure logical function is_of_family(found)
    type(branch_t), intent(in) :: found
    is_of_family = size(found%points) == 1
    if (is_of_family) is_of_family = is_neutral(found%points(1)%orbit%multipliers)
  end function is_of_family

  !> Follows an orbit that is on no branch yet.
  recursive subroutine follow_new(search, orbit)
    type(search_t), intent(inout) :: search
    type(orbit_t), intent(in) :: orbit
    if (size(search%branches) >= search%most_branches) return
    if (.not. on_branch(search, orbit)) call follow(search, orbit)
  end subroutine follow_new

  !> An orbit of the branch that crosses at a branch point, on one side of it, corrected across its direction.
  subroutine cross(search, point, side, other, ok)
    type(search_t), intent(in) :: search
    type(point_t), intent(in) :: point
    integer, intent(in) :: side
    type(orbit_t), intent(out) :: other
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp) :: direction(size(point%tangent)), sizes(size(point%tangent))
    integer :: tries
    ok = .false.
    call machine_neighbourhood(search%family, point%orbit%parameter, machines, error)
    if (allocated(error)) return
    do tries = 0, 2
      other = point%orbit
      call crossing_direction(machines, other, search%family%parameter_size, point%tangent, direction, ok)
      if (.not. ok) return
      sizes = scales_of_orbit(machines, other, search%family%parameter_size)
      call move_along(other, side*crossed_at*4**tries*direction*sizes)
      call machine_neighbourhood(search%family, other%parameter, machines, error)
      if (allocated(error)) return
      call correct_orbit(search%family, machines, other, direction, ok)
      if (ok) ok = is_admissible(machines, other)
      if (ok) return
      call machine_neighbourhood(search%family, point%orbit%parameter, machines, error)
    end do
  end subroutine cross

  !> The orbits at which a branch passes the values of the search.
  subroutine note_passages(search, found)
    type(search_t), intent(inout) :: search
    type(branch_t), intent(in) :: found
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    type(orbit_t) :: orbit
    integer :: i, k
    logical :: ok
    do k = 1, size(search%values)
      do i = 1, size(found%points) - 1
        associate (one => found%points(i)%orbit, next => found%points(i + 1)%orbit, value => search%values(k))
          if (.not. (one%parameter - value)*(next%parameter - value) <= 0) cycle
          orbit = one
          if (abs(next%parameter - value) < abs(one%parameter - value)) orbit = next
          orbit%parameter = value
          call machine_neighbourhood(search%family, value, machines, error)
          if (allocated(error)) cycle
          call correct_orbit(search%family, machines, orbit, direct(orbit, 1), ok)
          if (ok) search%found(k)%orbits = [search%found(k)%orbits, orbit]
        end associate
      end do
    end do
  end subroutine note_passages

  !> Whether a branch passes through an orbit: compared at the points of the branches of its period that are next in the
  !> parameter.
  logical function on_branch(search, orbit) result(known)
    type(search_t), intent(in) :: search
    type(orbit_t), intent(in) :: orbit
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    type(orbit_t) :: there
    real(wp) :: points(size(orbit%y), orbit%periods)
    integer :: b, i, k, end_of
    logical :: ok
    known = .false.
    call machine_neighbourhood(search%family, orbit%parameter, machines, error)
    if (allocated(error)) return
    points = section_points(machines, orbit)
    do b = 1, size(search%branches)
      associate (line => search%branches(b)%points)
        if (line(1)%orbit%periods /= orbit%periods) cycle
        do i = 1, size(line) - 1
          if (.not. (line(i)%orbit%parameter - orbit%parameter)*(line(i + 1)%orbit%parameter - orbit%parameter) <= 0) cycle
          do end_of = 0, 1
            there = line(i + end_of)%orbit
            there%parameter = orbit%parameter
            call correct_orbit(search%family, machines, there, direct(there, 1), ok)
            if (.not. ok) cycle
            do k = 1, orbit%periods
              known = known .or. norm2((points(:, k) - there%y)/machines%centre%size_of) < 1e-6_wp
            end do
            if (known) return
          end do
        end do
      end associate
    end do
  end function on_branch

  !> The orbit of twice the period beside a doubling, corrected across the direction of the multiplier -1.
  subroutine double(search, orbit, doubled, ok)
    type(search_t), intent(in) :: search
    type(orbit_t), intent(in) :: orbit
    type(orbit_t), intent(out) :: doubled
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp), allocatable :: along(:), sizes(:), direction(:)
    integer :: side, tries
    ok = .false.
    call machine_neighbourhood(search%family, orbit%parameter, machines, error)
    if (allocated(error)) return
    sizes = machines%centre%size_of
    along = doubling_direction(orbit%matrix)/sizes
    along = along/norm2(along)
    do side = 1, -1, -2
      do tries = 0, 2
        ! Newton's method may have left the range of the parameter.
        call machine_neighbourhood(search%family, orbit%parameter, machines, error)
        call orbit_of_motion(machines, orbit%parameter, orbit%y + side*doubled_at/3**tries*along*sizes, 2*orbit%periods, &
                             doubled, ok)
        if (.not. ok) cycle
        allocate (direction(size(along) + size(doubled%events) + 1), source=0.0_wp)
        direction(:size(along)) = along
        call correct_orbit(search%family, machines, doubled, direction, ok)
        deallocate (direction)
        if (ok) ok = is_admissible(machines, doubled) .and. .not. is_repeated(machines, doubled)
        if (ok) ok = abs(doubled%parameter - orbit%parameter) < 0.1_wp*search%family%parameter_size
        if (ok) return
      end do
    end do
  end subroutine double

  !> Whether the second half of an orbit is the first once more.
  pure logical function is_repeated(machines, orbit)
    type(neighbourhood_t), intent(in) :: machines
    type(orbit_t), intent(in) :: orbit
    real(wp) :: points(size(orbit%y), orbit%periods)
    points = section_points(machines, orbit)
    is_repeated = norm2((points(:, 1 + orbit%periods/2) - points(:, 1))/machines%centre%size_of) < 1e-2_wp*doubled_at
  end function is_repeated

  !> The direction e of (M + 1) e = 0: of two coordinates across the larger row of M + 1, of more by inverse iteration.
  pure function doubling_direction(m) result(along)
    real(wp), intent(in) :: m(:, :)
    real(wp) :: along(size(m, 1)), shifted(size(m, 1), size(m, 1)), next(size(m, 1))
    logical :: ok
    integer :: i
    if (size(m, 1) == 2) then
      along = [-m(1, 2), m(1, 1) + 1]
      if (abs(m(2, 2) + 1) + abs(m(2, 1)) > abs(m(1, 1) + 1) + abs(m(1, 2))) along = [m(2, 2) + 1, -m(2, 1)]
      return
    end if
    shifted = m
    do i = 1, size(along)
      shifted(i, i) = shifted(i, i) + 1
      along(i) = 1/(1 + 0.3_wp*i)
    end do
    do i = 1, 3
      call solve(shifted, along, next, ok)
      if (.not. ok) return
      along = next/norm2(next)
    end do
  end function doubling_direction

end module branch_search
