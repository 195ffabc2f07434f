! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which attractor a settled state is at: rest, an equilibrium, or a cycle.
module identification
  use attractors, only: attractor_t, find_capture, kind_rest, longest_period, make_points, most_coordinates, regime_at_rest
  use circle, only: point_near
  use cycle, only: refine_cycle
  use section_map, only: map_point
  use exact_return, only: exact_cycle, returns_t
  use kinds, only: wp
  use machine_type, only: machine_t, section_state_t
  use matrices, only: solve
  use motion_features, only: cycle_word, features_over
  use motion_state, only: tally_t
  implicit none
  private

  public :: identify, motion_without_impact

  !> Relative distance at which a section point counts as a return to an earlier one.
  real(wp), parameter :: return_tolerance = 0.05_wp

contains

  !> The one motion without impact of a linear damped oscillator, if it stays clear of the barriers: its map is linear, so that
  !> the images of three points give it.
  pure subroutine motion_without_impact(moving, found, ok)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    class(machine_t), allocatable :: free
    type(tally_t) :: tally
    real(wp) :: origin(2), image(2), columns(2, 2), point(2), unit(2), scale(2)
    integer :: k
    call moving%without_stops(free, k)
    scale = [1.0_wp, moving%drive_frequency]
    call map_point(free, [0.0_wp, 0.0_wp], 1, origin, tally, ok)
    do k = 1, 2
      unit = 0
      unit(k) = scale(k)
      if (ok) call map_point(free, unit, 1, image, tally, ok)
      columns(:, k) = -(image - origin)/scale(k)
      columns(k, k) = columns(k, k) + 1
    end do
    if (ok) call solve(columns, origin, point, ok)
    if (ok) call map_point(free, point, 1, image, tally, ok)
    if (ok) ok = tally%x_max < moving%upper .and. tally%x_min > moving%lower
    if (ok) call refine_cycle(moving, point, 1, found, ok)
    if (ok) found%section = moving%watched_at(found%points(:, 1))
  end subroutine motion_without_impact

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine identify(moving, section, returns, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    type(returns_t), intent(in) :: returns
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    ok = .false.
    if (returns%period > 0 .and. returns%chattered) call exact_cycle(moving, section, returns%period, found, ok)
    if (.not. ok) call recognise(moving, section, min(max_period, longest_period), found, ok)
    if (.not. ok .and. returns%period > 0) call exact_cycle(moving, section, returns%period, found, ok)
    if (.not. moving%undriven) return
    if (ok) then
      call take_as_one_point(moving, found)
      call find_equilibrium(found)
    else
      call recognise_equilibrium(moving, section, found, ok)
      if (.not. ok .and. .not. moving%has_clock) then
        call recognise_by_event(moving, section, min(max_period, longest_period), found, ok)
      end if
    end if
  end subroutine identify

  !> The equilibrium that a state approaches: what is left of its motion shrinks with the motion, and never looks like a return.
  pure subroutine recognise_equilibrium(moving, section, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    real(wp) :: point(most_coordinates)
    point = moving%point_of(section)
    call refine_cycle(moving, point(:moving%coordinates()), 1, found, ok)
    if (.not. ok) return
    found%section = moving%watched_at(found%points(:, 1))
    call find_equilibrium(found)
    ok = found%kind == kind_rest .and. find_capture([found], point, .true.) > 0
  end subroutine recognise_equilibrium

  !> Rest that nothing but the springs decides is one point, which attracts from all around, not a set held by friction.
  pure subroutine take_as_one_point(moving, found)
    class(machine_t), intent(in) :: moving
    type(attractor_t), intent(inout) :: found
    type(attractor_t) :: point
    logical :: ok
    if (.not. found%rests) return
    call refine_cycle(moving, found%points(:found%coordinates, 1), 1, point, ok)
    if (.not. ok) return
    point%section = found%section
    found = point
  end subroutine take_as_one_point

  !> A motion that does not change from one time to any later one: an equilibrium.
  pure subroutine find_equilibrium(found)
    type(attractor_t), intent(inout) :: found
    if (found%rests .or. found%features%amplitude > 1e-9_wp*found%scale(1)) return
    found%kind = kind_rest
    found%duration = 0
    associate (f => found%features)
      f%regime = regime_at_rest
      f%x_max = found%section(1)
      f%x_min = f%x_max
      f%amplitude = 0
      f%v_max = 0
    end associate
  end subroutine find_equilibrium

  !> The limit cycle of a machine without a clock at which a settled state is, by its returns to where it turns round.
  pure subroutine recognise_by_event(moving, section, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    class(machine_t), allocatable :: turning
    type(section_state_t) :: later
    type(tally_t) :: unused
    integer :: reason
    allocate (turning, source=moving)
    turning%by_event = .true.
    later = section
    call turning%advance_to_section(later, unused, reason)
    ok = reason == 0
    if (ok) call recognise(turning, later, max_period, found, ok)
    ! What turns round by rounding alone is on no cycle, nor is what creeps into rest where forces jump.
    if (ok) ok = found%features%amplitude > max(1e-9_wp*max(abs(found%features%x_max), abs(found%features%x_min)), &
                                                1e-4_wp*moving%smallest_motion)
  end subroutine recognise_by_event

  !> The attractor at which a settled state is, if it is at rest or periodic.
  pure subroutine recognise(moving, section, max_period, found, ok)
    class(machine_t), intent(in) :: moving
    type(section_state_t), intent(in) :: section
    integer, intent(in) :: max_period
    type(attractor_t), intent(out) :: found
    logical, intent(out) :: ok
    type(section_state_t) :: later
    type(tally_t) :: tally
    real(wp) :: points(most_coordinates, 0:2*longest_period)
    class(machine_t), allocatable :: free
    integer :: i, p, reason, n, first, positions
    later = section
    call moving%begin_tally(later, tally)
    points(:, 0) = moving%point_of(later)
    do i = 1, 2*max_period
      call moving%advance_to_section(later, tally, reason)
      ok = reason == 0
      if (.not. ok) return
      points(:, i) = moving%point_of(later)
    end do
    n = moving%coordinates()
    if (tally%slips == 0) then
      found%rests = .true.
      found%kind = kind_rest
      found%period = 1
      found%coordinates = n
      call make_points(found, 1)
      found%points(:, 1) = points(:, 0)
      found%turn = moving%turn
      found%features = features_over(moving, tally, real(2*max_period, wp))
      found%features%v_max = 0
      found%features%word = cycle_word(moving, section, 1)
      found%section = moving%watched_at(points(:, 0))
      return
    end if
    positions = 0
    if (tally%impacts == 0) call moving%without_stops(free, positions)
    first = positions + 1
    associate (sizes => moving%scales((tally%x_max - tally%x_min)/2))
      do p = 1, max_period
        if (.not. returns(points(first:n, :2*max_period), p, sizes(first:n), moving%turn_on_section())) cycle
        if (positions == 0) then
          call refine_cycle(moving, points(:n, 2*max_period), p, found, ok)
          if (ok) found%section = moving%watched_at(found%points(:, 1))
        else
          call refine_cycle(free, points(first:n, 2*max_period), p, found, ok)
          found%any_position = .true.
          found%positions = positions
          if (ok) ok = comes_back(moving, free, found)
          if (ok) found%section = moving%watched_at([points(:positions, 2*max_period), found%points(:, 1)])
        end if
        if (ok) return
      end do
    end associate
    ok = .false.
  end subroutine recognise

  !> Whether a cycle of the machine without stops ends at the position where it began: else it drifts towards a stop.
  pure logical function comes_back(moving, free, cycle)
    class(machine_t), intent(in) :: moving, free
    type(attractor_t), intent(in) :: cycle
    type(section_state_t) :: section
    type(tally_t) :: unused
    real(wp) :: before(most_coordinates), after(most_coordinates)
    integer :: i, reason
    section = free%state_at(cycle%points(:cycle%coordinates, 1))
    before = moving%point_of(section)
    do i = 1, cycle%period
      call free%advance_to_section(section, unused, reason)
    end do
    after = moving%point_of(section)
    comes_back = all(abs(after(:cycle%positions) - before(:cycle%positions)) <= 1e-9_wp*maxval(cycle%scale(:cycle%coordinates)))
  end function comes_back

  !> Whether every one of a run of section points comes back after `p` periods.
  pure logical function returns(points, p, size_of_motion, turn)
    real(wp), intent(in) :: points(:, 0:), size_of_motion(:), turn
    integer, intent(in) :: p
    integer :: i
    returns = .false.
    do i = 0, ubound(points, 2) - p
      if (norm2((point_near(points(:, i + p), points(:, i), turn) - points(:, i))/size_of_motion) > return_tolerance) return
    end do
    returns = .true.
  end function returns

end module identification
