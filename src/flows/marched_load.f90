! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Normal forces of friction along a flight: expressions whose switching functions keep their branches until one crosses zero.
module marched_load
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use joint_forces, only: joint_force
  use kinds, only: wp
  use multibody, only: joint_t, load_t, multibody_t, wave_t
  use multibody_state, only: load_branches, load_variables, multibody_state_t, sizes_of_variables
  use tape_value, only: evaluate, sizes_of_nodes
  implicit none
  private

  public :: set_load, choose_branches, load_at, switch_at, sizes_of_switch, move_origin, set_rows

  !> A normal force, and what its sources are made of: rows over displacements and speeds since the start, 1, the time since the
  !> start, cosines and sines of the drive.
  type, public :: marched_load_t
    type(load_t) :: load
    integer, allocatable :: branches(:)
    real(wp), allocatable :: position(:, :), speed(:, :)
    !> Contacts whose forces are sources, in their phases.
    type(joint_t), allocatable :: contacts(:)
    integer, allocatable :: phase(:)
    real(wp), allocatable :: touch_speed(:)
    real(wp) :: frequency = 0
    !> Sizes of its variables at the start.
    real(wp), allocatable :: of_variables(:)
    !> Time of the section, where the time is counted from the start [s].
    real(wp) :: clock = 0
  end type marched_load_t

contains

  !> The normal force of joint `j` from `state` on, over `size_of_rows` unknowns.
  pure subroutine set_load(machine, j, state, size_of_rows, marched)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j, size_of_rows
    type(multibody_state_t), intent(in) :: state
    type(marched_load_t), intent(out) :: marched
    integer :: i
    marched%load = machine%joints(j)%load
    marched%frequency = machine%frequency
    if (marched%load%slip > 0) marched%load%parameters(marched%load%slip) = state%phase(j)
    if (marched%load%by_clock) marched%clock = state%clock
    marched%of_variables = sizes_of_variables(machine, marched%load, state)
    associate (sources => marched%load%sources)
      allocate (marched%position(size_of_rows, size(sources)), marched%speed(size_of_rows, size(sources)), source=0.0_wp)
      allocate (marched%contacts(size(sources)), marched%phase(size(sources)), marched%touch_speed(size(sources)))
      do i = 1, size(sources)
        call set_rows(machine, state, sources(i)%row, sources(i)%offset, marched%position(:, i), marched%speed(:, i))
        marched%phase(i) = 0
        marched%touch_speed(i) = 0
        if (sources(i)%joint == 0) cycle
        marched%contacts(i) = machine%joints(sources(i)%joint)
        marched%phase(i) = state%phase(sources(i)%joint)
        marched%touch_speed(i) = state%touch_speed(sources(i)%joint)
      end do
    end associate
  end subroutine set_load

  !> Rows of a coordinate w'q + offset(t) and of its speed.
  pure subroutine set_rows(machine, state, row, offset, position, speed)
    type(multibody_t), intent(in) :: machine
    type(multibody_state_t), intent(in) :: state
    real(wp), intent(in) :: row(:)
    type(wave_t), intent(in) :: offset
    real(wp), intent(inout) :: position(:), speed(:)
    real(wp) :: w
    integer :: n, one, m
    n = machine%n
    one = 2*n + 1
    position(:n) = row
    position(one) = sum(row*state%q(:n)) + offset%mean + offset%rate*state%time
    position(one + 1) = offset%rate
    speed(n + 1:2*n) = row
    speed(one) = offset%rate
    if (.not. allocated(offset%harmonic)) return
    do m = 1, size(offset%harmonic)
      w = m*machine%frequency
      position(one + 2*m:one + 2*m + 1) = [real(offset%harmonic(m)), -aimag(offset%harmonic(m))]
      speed(one + 2*m:one + 2*m + 1) = -w*[aimag(offset%harmonic(m)), real(offset%harmonic(m))]
    end do
  end subroutine set_rows

  !> Branches from `state` on, under the accelerations `a`.
  pure subroutine choose_branches(machine, marched, state, turning, a)
    type(multibody_t), intent(in) :: machine
    type(marched_load_t), intent(inout) :: marched
    type(multibody_state_t), intent(in) :: state
    complex(wp), intent(in) :: turning(:)
    real(wp), intent(in) :: a(:)
    real(wp) :: variables(size(marched%load%rates))
    call load_variables(machine, marched%load, state, turning, variables, a)
    if (.not. allocated(marched%branches)) allocate (marched%branches(size(marched%load%tape%switches)))
    call load_branches(marched%load, marched%load%parameters, variables, marched%of_variables, marched%branches)
  end subroutine choose_branches

  !> Values of the nodes of a normal force at a `time` since the section [s].
  pure subroutine values_at(marched, time, z, value, fault)
    type(marched_load_t), intent(in) :: marched
    real(wp), intent(in) :: time, z(:)
    real(wp), intent(out) :: value(marched%load%tape%count)
    integer, intent(out) :: fault(marched%load%tape%count)
    real(wp) :: variables(size(marched%load%rates)), force
    integer :: i
    variables = 0
    variables(:2) = [marched%clock + time, marched%frequency*time]
    do i = 1, size(marched%load%sources)
      associate (motion => variables(4*i - 1:4*i))
        motion = [sum(marched%position(:, i)*z), sum(marched%speed(:, i)*z)]
        if (marched%load%sources(i)%joint == 0) cycle
        call joint_force(marched%contacts(i), marched%phase(i), 0.0_wp, marched%touch_speed(i), motion(1), motion(2), 1.0_wp, force)
        motion(1) = -sign(1, marched%phase(i))*force
      end associate
    end do
    call evaluate(marched%load%tape, variables, marched%load%parameters, value, fault, marched%branches)
  end subroutine values_at

  !> Normal force [N]; not a number where the expression is not defined, so that the motion is given up.
  pure real(wp) function load_at(marched, time, z) result(load)
    type(marched_load_t), intent(in) :: marched
    real(wp), intent(in) :: time, z(:)
    real(wp) :: value(marched%load%tape%count)
    integer :: fault(marched%load%tape%count)
    call values_at(marched, time, z, value, fault)
    load = value(marched%load%node)
    if (fault(marched%load%node) > 0) load = ieee_value(load, ieee_quiet_nan)
  end function load_at

  !> Switching function `number`, positive on its branch.
  pure real(wp) function switch_at(marched, number, time, z) result(margin)
    type(marched_load_t), intent(in) :: marched
    integer, intent(in) :: number
    real(wp), intent(in) :: time, z(:)
    real(wp) :: value(marched%load%tape%count)
    integer :: fault(marched%load%tape%count)
    call values_at(marched, time, z, value, fault)
    margin = marched%branches(number)*value(marched%load%tape%switches(number)%argument)
  end function switch_at

  !> Size of what a switching function is a sum of.
  pure real(wp) function sizes_of_switch(marched, number, time, z) result(total)
    type(marched_load_t), intent(in) :: marched
    integer, intent(in) :: number
    real(wp), intent(in) :: time, z(:)
    real(wp), dimension(marched%load%tape%count) :: value, sizes
    integer :: fault(marched%load%tape%count)
    call values_at(marched, time, z, value, fault)
    sizes = sizes_of_nodes(marched%load%tape, value, marched%of_variables)
    associate (argument => marched%load%tape%switches(number)%argument)
      associate (node => marched%load%tape%nodes(argument))
        total = max(sizes(argument), maxval(abs(value([argument, max(node%first, 1), max(node%second, 1)]))))
      end associate
    end associate
  end function sizes_of_switch

  !> Counts displacements and time from `z` on; rows of coordinates have `n` displacements.
  pure subroutine move_origin(marched, n, z)
    type(marched_load_t), intent(inout) :: marched
    integer, intent(in) :: n
    real(wp), intent(in) :: z(:)
    integer :: i
    associate (position => marched%position, one => 2*n + 1)
      do i = 1, size(position, 2)
        position(one, i) = position(one, i) + sum(position(:n, i)*z(:n)) + position(one + 1, i)*z(one + 1)
      end do
    end associate
  end subroutine move_origin

end module marched_load
