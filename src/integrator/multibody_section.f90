! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A multibody structure on the stroboscopic section: the positions and the velocities on which anything depends, and the extension
!> of the springs of elastic friction.
module multibody_section
  use eigen, only: undamped_modes
  use multibody, only: is_stop, joint_contact, joint_elastic, multibody_t
  use multibody_flows, only: without_contacts
  use multibody_motion, only: advance_multibody_period, multibody_motion_t, prepare_multibody, start_multibody
  use multibody_state, only: joint_motion, multibody_state_t, turning_at
  use kinds, only: wp
  use motion_state, only: tally_t
  use section_size, only: most_coordinates
  use text, only: replace_all
  use timed_actions, only: acts_on_time
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: coordinates_of_multibody, fits_section, start_of_multibody, lay_out, multibody_at, multibody_point, &
    fixes_column, free_multibody, has_known_mode, keeps_clear, scales_of_multibody, watched_speed

  !> Sums of the elements of orthonormal directions that are rounding.
  real(wp), parameter :: nothing = 1e-9_wp

contains

  !> Number of coordinates on the section.
  pure integer function coordinates_of_multibody(moving) result(n)
    type(multibody_motion_t), intent(in) :: moving
    n = size(moving%directions, 2) + size(moving%speeds, 2) + count(moving%machine%joints%kind == joint_elastic)
  end function coordinates_of_multibody

  !> Number of the coordinate that is the velocity of the watched position, in a motion without a clock.
  pure integer function watched_speed(moving) result(at)
    type(multibody_motion_t), intent(in) :: moving
    at = size(moving%directions, 2) + moving%machine%watched
  end function watched_speed

  !> Whether there is room for the coordinates, and they determine what follows: nothing acts at times of its own.
  pure logical function fits_section(moving)
    type(multibody_motion_t), intent(in) :: moving
    fits_section = coordinates_of_multibody(moving) <= most_coordinates .and. .not. acts_on_time(moving%machine)
  end function fits_section

  !> The same machine without stops, if that takes away just the first `positions` coordinates, positions; else 0.
  pure subroutine free_multibody(moving, free, positions)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_motion_t), intent(out) :: free
    integer, intent(out) :: positions
    positions = 0
    if (.not. moving%machine%driven .or. .not. any(is_stop(moving%machine%joints%kind))) return
    call prepare_multibody(without_contacts(moving%machine), moving%options, free)
    if (size(free%speeds, 2) == size(moving%speeds, 2)) positions = size(moving%directions, 2) - size(free%directions, 2)
  end subroutine free_multibody

  !> Whether a structure on the section comes no nearer to a stop in the next `periods` than displacements of all positions
  !> by `distance` [m] would close.
  pure logical function keeps_clear(moving, state, periods, distance)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    integer, intent(in) :: periods
    real(wp), intent(in) :: distance
    type(multibody_motion_t) :: narrower
    type(multibody_state_t) :: later
    type(tally_t) :: tally
    complex(wp) :: turning(moving%harmonics)
    real(wp) :: s, u, nearer
    integer :: j, i, reason
    keeps_clear = .false.
    narrower = moving
    turning = turning_at(moving%machine%frequency, state%time, moving%harmonics)
    do j = 1, size(moving%machine%joints)
      associate (joint => narrower%machine%joints(j))
        if (.not. is_stop(joint%kind)) cycle
        nearer = distance*sum(abs(joint%row))
        if (joint%upper < huge(1.0_wp)) joint%upper = joint%upper - nearer
        if (joint%lower > -huge(1.0_wp)) joint%lower = joint%lower + nearer
        call joint_motion(moving%machine, j, state%q, state%v, state%time, turning, s, u)
        if (state%phase(j) /= 0 .or. .not. (s < joint%upper .and. s > joint%lower)) return
      end associate
    end do
    later = state
    do i = 1, periods
      call advance_multibody_period(narrower, later, tally, reason)
      if (reason /= 0 .or. tally%impacts > 0) return
    end do
    keeps_clear = .true.
  end function keeps_clear

  !> A state with the watched position [m], its velocity [m/s] and the angle of the drive [rad] in `values`; what does not follow
  !> it as in the machine, or as the position and velocity of every coordinate that follow in `values`. A state that no mode fits,
  !> or that lies beyond a stop, is not a number.
  pure function start_of_multibody(moving, values) result(state)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: values(:)
    type(multibody_state_t) :: state
    real(wp) :: start(2, moving%machine%n)
    logical :: ok
    associate (machine => moving%machine)
      start = machine%start
      if (size(values) > 3) start = reshape(values(4:), [2, machine%n])
      start(1, :) = start(1, :) + machine%start_shape(:, 1)*(values(1) - start(1, machine%watched))
      start(2, :) = start(2, :) + machine%start_shape(:, 2)*(values(2) - start(2, machine%watched))
    end associate
    call start_multibody(moving, start(1, :), start(2, :), values(3), state, ok)
    if (ok) ok = is_allowed(moving, start(1, :), state%time)
    if (.not. ok) state%q = ieee_value(1.0_wp, ieee_quiet_nan)
  end function start_of_multibody

  !> Whether no rigid stop is violated by the positions `q` at `time`.
  pure logical function is_allowed(moving, q, time)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: q(:), time
    complex(wp) :: turning(moving%harmonics)
    real(wp) :: s, u, near
    integer :: j
    is_allowed = .true.
    turning = turning_at(moving%machine%frequency, time, moving%harmonics)
    do j = 1, size(moving%machine%joints)
      associate (joint => moving%machine%joints(j))
        if (joint%kind /= joint_contact) cycle
        call joint_motion(moving%machine, j, q, 0*q, time, turning, s, u)
        near = 64*epsilon(1.0_wp)*(sum(abs(joint%row*q)) + abs(joint%offset%mean))
        if (s > joint%upper + near .or. s < joint%lower - near) is_allowed = .false.
      end associate
    end do
  end function is_allowed

  !> Positions and velocities of all coordinates for those of the section, `point`; what these leave open is zero: of two bodies
  !> that nothing ties to the ground position and velocity of the driving one.
  pure subroutine lay_out(moving, point, q, v)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    real(wp), intent(out) :: q(:), v(:)
    integer :: positions, speeds
    positions = size(moving%directions, 2)
    speeds = size(moving%speeds, 2)
    q = matmul(moving%directions, point(:positions))
    v = matmul(moving%speeds, point(positions + 1:positions + speeds))
    if (.not. allocated(moving%machine%driver)) return
    associate (at => moving%machine%driver%at)
      if (at > 0 .and. all(abs(sum(moving%directions, 1)) < nothing)) q = q - q(at)
      if (at > 0 .and. all(abs(sum(moving%speeds, 1)) < nothing)) v = v - v(at)
    end associate
  end subroutine lay_out

  !> The state on the section with the coordinates `point`, see `lay_out`.
  pure function multibody_at(moving, point) result(state)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: point(:)
    type(multibody_state_t) :: state
    real(wp) :: q(moving%machine%n), v(moving%machine%n), s, u, limit
    complex(wp) :: turning(moving%harmonics)
    integer :: j, k
    logical :: ok
    call lay_out(moving, point, q, v)
    call start_multibody(moving, q, v, 0.0_wp, state, ok)
    turning = turning_at(moving%machine%frequency, 0.0_wp, moving%harmonics)
    k = size(moving%directions, 2) + size(moving%speeds, 2)
    do j = 1, size(moving%machine%joints)
      associate (joint => moving%machine%joints(j))
        if (joint%kind /= joint_elastic) cycle
        k = k + 1
        call joint_motion(moving%machine, j, state%q, state%v, 0.0_wp, turning, s, u)
        limit = joint%friction%kinetic/joint%stiffness
        state%slider(j) = s - point(k)
        ! Stretched by friction and on its way: it slides.
        if (abs(point(k)) >= limit*(1 - 64*epsilon(1.0_wp)) .and. point(k)*u > 0) state%phase(j) = merge(1, -1, u > 0)
      end associate
    end do
    if (.not. ok) state%q = ieee_value(1.0_wp, ieee_quiet_nan)
  end function multibody_at

  !> Coordinates of a state on the section, zeros after the last.
  pure function multibody_point(moving, state) result(point)
    type(multibody_motion_t), intent(in) :: moving
    type(multibody_state_t), intent(in) :: state
    real(wp) :: point(most_coordinates), q(moving%machine%n), s, u
    complex(wp) :: turning(moving%harmonics)
    integer :: n, positions, speeds, j, k
    point = 0
    if (.not. fits_section(moving)) return
    n = moving%machine%n
    positions = size(moving%directions, 2)
    speeds = size(moving%speeds, 2)
    q = state%q(:n)
    if (allocated(moving%machine%driver)) q = q - moving%machine%driver%running*state%clock
    point(:positions) = matmul(transpose(moving%directions), q)
    point(positions + 1:positions + speeds) = matmul(transpose(moving%speeds), state%v(:n))
    k = positions + speeds
    turning = turning_at(moving%machine%frequency, state%time, moving%harmonics)
    do j = 1, size(moving%machine%joints)
      associate (joint => moving%machine%joints(j))
        if (joint%kind /= joint_elastic) cycle
        k = k + 1
        call joint_motion(moving%machine, j, state%q, state%v, state%time, turning, s, u)
        point(k) = s - state%slider(j)
        if (state%phase(j) /= 0) point(k) = state%phase(j)*joint%friction%kinetic/joint%stiffness
      end associate
    end do
  end function multibody_point

  !> Sizes of the coordinates in a motion over `half_range` [m]. What may drift has those of what stops and forces allow.
  pure function scales_of_multibody(moving, half_range) result(scales)
    type(multibody_motion_t), intent(in) :: moving
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates), length
    integer :: positions, speeds
    positions = size(moving%directions, 2)
    speeds = size(moving%speeds, 2)
    length = max(half_range, 1e-3_wp*moving%machine%length_scale)
    if (speeds < moving%machine%n) length = min(length, moving%machine%length_scale)
    scales = length
    scales(positions + 1:positions + speeds) = length*moving%machine%frequency
  end function scales_of_multibody

  !> Whether the position or velocity that a column of samples shows is determined by the section alone.
  pure logical function fixes_column(moving, column)
    type(multibody_motion_t), intent(in) :: moving
    character(len=*), intent(in) :: column
    real(wp), parameter :: rounding = 1e-9_wp
    character(len=:), allocatable :: name
    integer :: i
    fixes_column = .true.
    do i = 1, moving%machine%n
      name = replace_all(trim(moving%machine%names(i)), '.', '_')
      if (column == name//'_x' .or. (column == 'x' .and. i == moving%machine%watched)) then
        fixes_column = norm2(moving%directions(i, :)) > 1 - rounding
      else if (column == name//'_v' .or. (column == 'v' .and. i == moving%machine%watched)) then
        fixes_column = norm2(moving%speeds(i, :)) > 1 - rounding
      end if
      if (.not. fixes_column) return
    end do
  end function fixes_column

  !> Whether the slowest mode of a machine is known: springs that are not in the stiffness matrix may make others.
  pure logical function has_known_mode(machine) result(fact)
    type(multibody_t), intent(in) :: machine
    real(wp) :: squares(machine%n), shapes(machine%n, machine%n)
    call undamped_modes(machine%stiffness, machine%mass, squares, shapes)
    fact = squares(machine%n) > 0 .and. all(.not. (abs(machine%joints%moment) > 0 .or. abs(machine%joints%attraction) > 0))
  end function has_known_mode

end module multibody_section
