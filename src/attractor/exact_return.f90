! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> States on the section that come back to the last bit. A completed chatter that is followed by rest forgets the motion before
!> it: the section map has rank 0 there, what follows is one finite sequence, and a return of it proves a cycle, whatever its
!> period. Near such a cycle the numbers of impacts differ from start to start, so that `refine_cycle` cannot verify it.
module exact_return
  use attractors, only: attractor_t, longest_exact_period, make_points, most_coordinates
  use circle, only: point_near
  use contraction, only: direction, directions, rings
  use cycle, only: unattractive
  use section_map, only: derivative, scale_of
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: eigenvalues
  use motion_features, only: cycle_word, features_over
  use motion_state, only: tally_t
  implicit none
  private

  public :: watch_returns, watch_anew, exact_cycle

  !> Distance, in units of the motion's size, at which states of an exact cycle count as the same: rounding may carry it
  !> through neighbouring numbers, several rounds of which come back exactly.
  real(wp), parameter :: same_state = 1e-9_wp
  !> Largest neighbourhood that is tried. The smallest, after the halvings, is 2e-15, several roundings: where starts so near do
  !> not stay with the cycle, the motion between two chatters magnifies rounding until another one could follow, and the return
  !> proves nothing.
  real(wp), parameter :: largest_radius = 0.02_wp
  integer, parameter :: most_halvings = 43
  !> A start has merged with the cycle when only this share of its distance is left, or rounding, and a chatter has been completed
  !> if one belongs to the cycle.
  real(wp), parameter :: merged = 1e-3_wp, rounding = 4e-15_wp

  !> Brent's search for a return: the state is compared with the one kept, which is replaced after 1, 2, 4, ... periods.
  type, public :: returns_t
    real(wp) :: kept(most_coordinates + 1) = huge(1.0_wp)
    integer :: kept_mode = 0, since = 0, stride = 1
    !> Chatters when the state was kept.
    integer(int64) :: kept_chatters = 0
    !> Drive periods of the last exact return (0 = none), and whether it led through a completed chatter.
    integer :: period = 0
    logical :: chattered = .false.
  end type returns_t

contains

  !> Forgets the state kept, as the running count of chatters begins anew, not the return that was found.
  pure subroutine watch_anew(returns)
    type(returns_t), intent(inout) :: returns
    returns = returns_t(period=returns%period, chattered=returns%chattered)
  end subroutine watch_anew

  !> Notes the state on the next section; `chatters` is a running count.
  pure subroutine watch_returns(moving, section, chatters, returns)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer(int64), intent(in) :: chatters
    type(returns_t), intent(inout) :: returns
    real(wp) :: now(most_coordinates + 1)
    now = [moving%point_of(section), section%state%z]
    returns%since = returns%since + 1
    if (section%state%mode == returns%kept_mode .and. .not. any(abs(now - returns%kept) > 0)) then
      returns%period = returns%since
      returns%chattered = chatters > returns%kept_chatters
    else if (returns%since < returns%stride) then
      return
    else
      returns%stride = 2*returns%stride
    end if
    returns%kept = now
    returns%kept_mode = section%state%mode
    returns%kept_chatters = chatters
    returns%since = 0
  end subroutine watch_returns

  !> The attractor of a state on the section that comes back after `period` drive periods. `found` is false if it is not
  !> stable, one of a family, or its return owed to rounding. A cycle with a completed chatter has the multipliers 0.
  pure subroutine exact_cycle(moving, section, period, attractor, found)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: period
    type(attractor_t), intent(out) :: attractor
    logical, intent(out) :: found
    real(wp), allocatable :: points(:, :), jacobian(:, :)
    logical, allocatable :: chattered(:)
    type(section_state_t) :: first
    type(tally_t) :: tally
    integer :: n, i, start, reason
    found = .false.
    if (period > longest_exact_period) return
    n = moving%coordinates()
    attractor%coordinates = n
    attractor%turn = moving%turn
    allocate (points(most_coordinates, 0:period), jacobian(n, n), chattered(period))
    call collect(moving, section, period, points, chattered, tally, found)
    if (.not. found) return
    attractor%scale = scale_of(moving, tally)
    attractor%period = smallest_period(points(:n, 0:period - 1), attractor%scale(:n), attractor%turn)
    start = minloc(points(1, :attractor%period - 1), 1) - 1
    first = section
    do i = 1, start
      call moving%advance_to_section(first, tally, reason)
    end do
    call make_points(attractor, attractor%period)
    attractor%metric([(i*(i + 1)/2, i=1, n)], :) = 1
    tally%needs_v_max = .true.
    call collect(moving, first, attractor%period, points(:, :attractor%period), chattered(:attractor%period), tally, found)
    attractor%points = points(:, :attractor%period - 1)
    attractor%duration = attractor%period*moving%period
    attractor%features = features_over(moving, tally, real(attractor%period, wp))
    attractor%features%word = cycle_word(moving, first, attractor%period)
    attractor%section = moving%watched_at(attractor%points(:, 1))
    if (tally%chatters == 0) then
      call derivative(moving, attractor%points(:n, 1), attractor%period, attractor%scale(:n), jacobian, found)
      if (.not. found) return
      attractor%multipliers(:n) = eigenvalues(jacobian)
      attractor%multiplier = abs(attractor%multipliers(1))
      found = attractor%multiplier < unattractive
      if (.not. found) return
    end if
    call verify(moving, attractor, chattered(:attractor%period), found)
  end subroutine exact_cycle

  !> The largest neighbourhood that stays with the cycle, by halving the exponent of its radius: first around the points behind a
  !> chatter, from which rounding grows longest, then around all of them. `found` is false if not even the smallest one does.
  pure subroutine verify(moving, attractor, chattered, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: attractor
    logical, intent(in) :: chattered(:)
    logical, intent(out) :: found
    logical :: first(size(chattered)), every(size(chattered))
    integer :: good, bad, middle
    every = .true.
    ! The body may still be at rest on the first section behind a chatter.
    first = cshift(chattered, -1) .or. cshift(chattered, -2)
    if (.not. any(chattered)) first = every
    good = most_halvings
    bad = -1
    middle = good
    do
      attractor%capture_radius = largest_radius/2.0_wp**middle
      if (all_follow(moving, attractor, first, any(chattered))) then
        good = middle
      else
        bad = middle
      end if
      found = bad < most_halvings
      if (.not. found) return
      if (good - bad <= 1) exit
      middle = (good + bad)/2
    end do
    do middle = good, most_halvings
      attractor%capture_radius = largest_radius/2.0_wp**middle
      found = all_follow(moving, attractor, every, any(chattered))
      if (found) return
    end do
  end subroutine verify

  !> Section points of `periods` drive periods from a state on, what happened meanwhile, and whether a chatter was completed in
  !> each.
  pure subroutine collect(moving, section, periods, points, chattered, tally, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: periods
    real(wp), intent(out) :: points(:, 0:)
    logical, intent(out) :: chattered(:)
    type(tally_t), intent(inout) :: tally
    logical, intent(out) :: ok
    type(section_state_t) :: later
    integer(int64) :: before
    integer :: i, reason
    later = section
    call moving%begin_tally(later, tally)
    points(:, 0) = moving%point_of(later)
    chattered = .false.
    do i = 1, periods
      before = tally%chatters
      call moving%advance_to_section(later, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      points(:, i) = moving%point_of(later)
      chattered(i) = tally%chatters > before
    end do
  end subroutine collect

  !> The smallest part of a closed round of section points after which all of them are the same but for rounding.
  pure integer function smallest_period(points, scale, turn) result(period)
    real(wp), intent(in) :: points(:, 0:), scale(:), turn
    integer :: i, whole
    whole = size(points, 2)
    do period = 1, whole - 1
      if (modulo(whole, period) > 0) cycle
      do i = 0, whole - 1
        associate (later => point_near(points(:, modulo(i + period, whole)), points(:, i), turn))
          if (norm2((later - points(:, i))/scale) > same_state) exit
        end associate
      end do
      if (i == whole) return
    end do
    period = whole
  end function smallest_period

  !> Whether every sampled start on rings around the `chosen` points of the cycle merges with it within one round, or is nearer by a
  !> quarter after it.
  pure logical function all_follow(moving, attractor, chosen, chatters)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    logical, intent(in) :: chosen(:), chatters
    real(wp) :: point(attractor%coordinates)
    integer :: i, ring, k, n
    n = attractor%coordinates
    all_follow = .false.
    do i = 1, attractor%period
      if (.not. chosen(i)) cycle
      do ring = 1, size(rings)
        do k = 1, directions
          point = attractor%points(:n, i) + attractor%scale(:n)*rings(ring)*attractor%capture_radius*direction(k, n)
          if (point(1) > moving%upper .or. point(1) < moving%lower) cycle
          if (.not. follows(moving, attractor, i, point, rings(ring)*attractor%capture_radius, chatters)) return
        end do
      end do
    end do
    all_follow = .true.
  end function all_follow

  !> Whether a start `point` at a distance `radius` from the `i`-th point of the cycle does.
  pure logical function follows(moving, attractor, i, point, radius, chatters)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: attractor
    integer, intent(in) :: i
    real(wp), intent(in) :: point(:), radius
    logical, intent(in) :: chatters
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: reached(most_coordinates), distance
    integer :: k, n, reason
    follows = .false.
    n = attractor%coordinates
    section = moving%state_at(point)
    call moving%begin_tally(section, tally)
    do k = 1, attractor%period
      call moving%advance_to_section(section, tally, reason)
      if (reason /= 0) return
      associate (wanted => attractor%points(:, 1 + modulo(i + k - 1, attractor%period)))
        reached = point_near(moving%point_of(section), wanted, attractor%turn)
        distance = norm2((reached(:n) - wanted(:n))/attractor%scale(:n))
      end associate
      follows = distance <= max(merged*radius, rounding) .and. (tally%chatters > 0 .or. .not. chatters)
      if (follows) return
    end do
    follows = distance <= 0.75_wp*radius
  end function follows

end module exact_return
