! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A motion that has come to no attracting cycle: the box of its section points, its features over many periods, and whether
!> neighbouring motions drift apart, or it is one of a family of cycles, without which nobody knows what it is: perhaps a long
!> transient.
module aperiodic
  use attractors, only: attractor_t, features_t, kind_chaotic, kind_family, kind_not_known, make_points, most_coordinates
  use capture, only: attractor_reached
  use circle, only: nearest_turn, point_near
  use cycle, only: unattractive
  use section_map, only: derivative, map_point
  use elementary, only: exponential, logarithm
  use exact_return, only: returns_t, watch_anew, watch_returns
  use kinds, only: int64, wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: eigenvalues
  use motion_features, only: features_over
  use motion_state, only: tally_t
  implicit none
  private

  public :: watch_long, find_family, outlast, meets_chaos, add_aperiodic

  !> Drive periods over which the motion is watched, and batches of them whose mean drifts are compared.
  integer, parameter :: box_periods = 512, batches = 16
  !> Drive periods after which a transient is no longer expected to end, on closed forms and where flights are marched.
  integer, parameter :: lasting_exact = 16384, lasting = 4096
  !> Distance of the neighbour, in units of the motion's size, and the smallest that is distinguished from rounding.
  real(wp), parameter :: neighbour = 1e-8_wp, rounding = 1e-15_wp
  !> The mean drift counts as positive if it is so many of its standard errors.
  real(wp), parameter :: errors_apart = 3
  !> Growth of the distance of neighbours a period (a logarithm) below which it may be that of a family, whose periods differ.
  real(wp), parameter :: slowest_drift = 1e-3_wp
  !> One of a family of cycles comes back to this, in units of the motion's size, and has a multiplier that is 1 to that.
  real(wp), parameter :: comes_back = 1e-10_wp, neutral = 1 - unattractive
  !> Share of a coordinate by which boxes of one motion may be apart.
  real(wp), parameter :: same_position = 1e-12_wp

contains

  !> Watches a motion of the given `amplitude` [m] over many drive periods. `known` if it converged to an attractor of the
  !> catalogue meanwhile, `ok` unless it had to be given up; else `found` describes it, and `returns` its returns.
  pure subroutine watch_long(moving, catalogue, amplitude, section, found, returns, known, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: amplitude
    type(section_state_t), intent(inout) :: section
    type(attractor_t), intent(out) :: found
    type(returns_t), intent(inout) :: returns
    logical, intent(out) :: known, ok
    type(tally_t) :: tally
    real(wp) :: before(most_coordinates), direction(most_coordinates), drift(box_periods), scale(most_coordinates)
    integer(int64) :: slips
    integer :: i, reason
    known = .false.
    tally%needs_v_max = .true.
    call moving%begin_tally(section, tally)
    call watch_anew(returns)
    found%coordinates = moving%coordinates()
    found%turn = moving%turn
    call make_points(found, 2)
    before = moving%point_of(section)
    found%points = spread(before, 2, 2)
    scale = max(moving%scales(amplitude), tiny(amplitude))
    direction = 0
    do i = 1, box_periods
      slips = tally%slips
      call moving%advance_to_section(section, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      associate (now => moving%point_of(section))
        known = attractor_reached(moving, catalogue, section, tally%slips > slips) > 0
        if (known) return
        call widen(found, spread(now, 2, 2))
        call follow_neighbour(moving, found%coordinates, scale, before, now, direction, drift(i))
        before = now
      end associate
      call watch_returns(moving, section, tally%chatters, returns)
    end do
    found%features = features_over(moving, tally, real(box_periods, wp))
    found%features%word = 0
    call assess_drift(drift, found)
  end subroutine watch_long

  !> Whether a motion of the given `amplitude` [m] that `watch_long` did not know, now at `section`, is one of a family of cycles
  !> of at most `max_period` drive periods: it comes back to rounding, and has a multiplier +1. Beside a fold of cycles it does not
  !> come back so well.
  pure subroutine find_family(moving, section, amplitude, max_period, found)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    real(wp), intent(in) :: amplitude
    integer, intent(in) :: max_period
    type(attractor_t), intent(inout) :: found
    real(wp), dimension(found%coordinates) :: point, image
    real(wp) :: jacobian(found%coordinates, found%coordinates), scale(most_coordinates), here(most_coordinates)
    type(tally_t) :: unused
    integer :: n, period
    logical :: ok
    if (found%kind /= kind_not_known) return
    n = found%coordinates
    scale = max(moving%scales(amplitude), tiny(amplitude))
    here = moving%point_of(section)
    point = here(:n)
    do period = 1, max_period
      call map_point(moving, point, period, image, unused, ok)
      if (.not. ok) return
      if (norm2((point_near(image, point, moving%turn) - point)/scale(:n)) <= comes_back) exit
    end do
    if (period > max_period) return
    call derivative(moving, point, period, scale(:n), jacobian, ok)
    if (.not. ok) return
    if (.not. minval(abs(eigenvalues(jacobian) - 1)) <= neutral) return
    found%kind = kind_family
    found%multiplier = 1
    found%duration = period*moving%period
  end subroutine find_family

  !> Goes on for many drive periods: neighbours drift apart on chaotic transients too, which end. `known` if the motion converges
  !> to an attractor of the catalogue, `ok` unless it had to be given up; it ends early where it comes back exactly, as `returns`
  !> records. `forgets` if it came to a completed chatter, after which there is one motion whatever came before: then nothing
  !> drifts apart for good.
  pure subroutine outlast(moving, catalogue, section, returns, known, forgets, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: catalogue(:)
    type(section_state_t), intent(inout) :: section
    type(returns_t), intent(inout) :: returns
    logical, intent(out) :: known, forgets, ok
    type(tally_t) :: tally
    integer(int64) :: slips
    integer :: i, reason
    known = .false.
    forgets = .false.
    ok = .true.
    call moving%begin_tally(section, tally)
    call watch_anew(returns)
    do i = 1, merge(lasting_exact, lasting, moving%exact)
      slips = tally%slips
      call moving%advance_to_section(section, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      known = attractor_reached(moving, catalogue, section, tally%slips > slips) > 0
      if (known) return
      forgets = tally%chatters > 0 .and. moving%coordinates() == 2
      call watch_returns(moving, section, tally%chatters, returns)
      if (returns%period > 0) return
    end do
  end subroutine outlast

  !> Whether the box of a motion meets that of an entry of its regime that is chaotic.
  pure logical function meets_chaos(catalogue, found)
    type(attractor_t), intent(in) :: catalogue(:), found
    integer :: k
    meets_chaos = .false.
    do k = 1, size(catalogue)
      if (catalogue(k)%kind /= kind_chaotic .or. catalogue(k)%features%regime /= found%features%regime) cycle
      meets_chaos = meets_chaos .or. boxes_meet(found, catalogue(k))
    end do
  end function meets_chaos

  !> Logarithm of the factor by which the distance to a neighbour in `direction` (0: any) grows from the section point `before` to
  !> the next, `now`; the direction becomes that of the neighbour there.
  pure subroutine follow_neighbour(moving, n, scale, before, now, direction, drift)
    class(machine_t), intent(in) :: moving
    integer, intent(in) :: n
    real(wp), intent(in) :: scale(:), before(:), now(:)
    real(wp), intent(inout) :: direction(:)
    real(wp), intent(out) :: drift
    type(section_state_t) :: twin
    type(tally_t) :: unused
    real(wp) :: start(n), reached(most_coordinates), distance
    integer :: reason
    if (.not. norm2(direction(:n)) > 0) direction(:n) = sqrt(1/real(n, wp))
    start = before(:n) + neighbour*scale(:n)*direction(:n)
    if (start(1) > moving%upper .or. start(1) < moving%lower) then
      start = before(:n) - neighbour*scale(:n)*direction(:n)
    end if
    twin = moving%state_at(start)
    call moving%advance_to_section(twin, unused, reason)
    reached = moving%point_of(twin)
    direction = 0
    reached = point_near(reached, now, moving%turn)
    direction(:n) = (reached(:n) - now(:n))/scale(:n)
    distance = norm2(direction(:n))
    ! A neighbour that had to be given up gives no information.
    if (reason /= 0 .or. .not. distance <= huge(distance)) then
      direction = 0
      drift = 0
      return
    end if
    drift = logarithm(max(distance, rounding)/neighbour)
    if (distance > rounding) then
      direction = direction/distance
    else
      direction = 0
    end if
  end subroutine follow_neighbour

  !> Chaotic if the mean drift is surely positive.
  pure subroutine assess_drift(drift, found)
    real(wp), intent(in) :: drift(:)
    type(attractor_t), intent(inout) :: found
    real(wp) :: means(batches), mean, error
    integer :: length, i
    length = size(drift)/batches
    means = [(sum(drift((i - 1)*length + 1:i*length))/length, i=1, batches)]
    mean = sum(means)/batches
    error = sqrt(sum((means - mean)**2)/(batches*(batches - 1)))
    found%multiplier = exponential(mean)
    found%kind = merge(kind_chaotic, kind_not_known, mean > max(errors_apart*error, slowest_drift))
  end subroutine assess_drift

  !> Adds what `watch_long` found to a catalogue. One of the same regime whose box meets it is widened instead; cycles of a family
  !> are one entry.
  pure subroutine add_aperiodic(moving, found, catalogue)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(in) :: found
    type(attractor_t), allocatable, intent(inout) :: catalogue(:)
    integer :: k
    do k = 1, size(catalogue)
      if (catalogue(k)%period /= 0 .or. catalogue(k)%features%regime /= found%features%regime) cycle
      if (belong_together(found, catalogue(k))) then
        ! What is not known does not widen what is.
        if (found%kind == kind_not_known .and. catalogue(k)%kind == kind_chaotic) return
        if (found%kind == kind_chaotic .and. catalogue(k)%kind == kind_not_known) then
          catalogue(k)%kind = kind_chaotic
          catalogue(k)%features = found%features
          catalogue(k)%multiplier = found%multiplier
        end if
        call widen(catalogue(k), found%points)
        if (found%kind == kind_family) call widen_features(found%features, catalogue(k)%features)
        catalogue(k)%section = moving%watched_at(catalogue(k)%points(:, 1))
        return
      end if
    end do
    catalogue = [catalogue, found]
    k = size(catalogue)
    catalogue(k)%section = moving%watched_at(found%points(:, 1))
  end subroutine add_aperiodic

  !> Whether two motions without a period of one regime are one entry.
  pure logical function belong_together(a, b)
    type(attractor_t), intent(in) :: a, b
    if (a%kind == kind_family .or. b%kind == kind_family) then
      belong_together = a%kind == b%kind .and. .not. abs(a%duration - b%duration) > 0 .and. &
        .not. abs(a%features%impacts_per_period - b%features%impacts_per_period) > 0
    else
      belong_together = boxes_meet(a, b)
    end if
  end function belong_together

  !> What the cycles of a family have at most: of the positions and speeds; of the distance to stops at least.
  pure subroutine widen_features(one, all_of_them)
    type(features_t), intent(in) :: one
    type(features_t), intent(inout) :: all_of_them
    all_of_them%x_max = max(all_of_them%x_max, one%x_max)
    all_of_them%x_min = min(all_of_them%x_min, one%x_min)
    all_of_them%amplitude = max(all_of_them%amplitude, one%amplitude)
    all_of_them%v_max = max(all_of_them%v_max, one%v_max)
    all_of_them%mean_impact_speed = max(all_of_them%mean_impact_speed, one%mean_impact_speed)
    all_of_them%grazing_margin = min(all_of_them%grazing_margin, one%grazing_margin)
  end subroutine widen_features

  !> Whether the boxes of two motions have a point in common.
  pure logical function boxes_meet(a, b)
    type(attractor_t), intent(in) :: a, b
    real(wp) :: box(most_coordinates, 2), room(most_coordinates)
    box = box_near(a%points(:, :2), b)
    ! Motions that rounding alone keeps from coming back have boxes of no size.
    room = same_position*maxval(abs(b%points(:, :2)), dim=2)
    boxes_meet = all(box(:, 1) <= b%points(:, 2) + room .and. box(:, 2) >= b%points(:, 1) - room)
  end function boxes_meet

  !> Widens the box of a motion by another; that of an angle up to the whole circle.
  pure subroutine widen(motion, box)
    type(attractor_t), intent(inout) :: motion
    real(wp), intent(in) :: box(:, :)
    real(wp) :: near(most_coordinates, 2)
    near = box_near(box, motion)
    motion%points(:, 1) = min(motion%points(:, 1), near(:, 1))
    motion%points(:, 2) = max(motion%points(:, 2), near(:, 2))
    if (motion%turn > 0 .and. motion%points(1, 2) - motion%points(1, 1) >= motion%turn) then
      motion%points(1, :2) = [-0.5_wp, 0.5_wp]*motion%turn
    end if
  end subroutine widen

  !> The box whole turns away that is nearest to that of a motion.
  pure function box_near(box, motion) result(near)
    real(wp), intent(in) :: box(:, :)
    type(attractor_t), intent(in) :: motion
    real(wp) :: near(most_coordinates, 2), middle
    near = box
    if (.not. motion%turn > 0) return
    middle = sum(box(1, :))/2
    near(1, :) = box(1, :) + (nearest_turn(middle, sum(motion%points(1, :2))/2, motion%turn) - middle)
  end function box_near

end module aperiodic
