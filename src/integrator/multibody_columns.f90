! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Columns of the log of several bodies: the driving body, all coordinates of a structure, the joint of each event. What the samples
!> show.
module multibody_columns
  use angle_units, only: unit_of
  use kinds, only: wp
  use machine_columns, only: machine_column_t, set_column
  use motion_state, only: log_t
  use multibody, only: integral_of, joint_section, multibody_t
  use text, only: replace_all
  implicit none
  private

  public :: coordinate_columns, driver_columns, energies_of_motion, is_still, joint_columns

contains

  !> Position and velocity of the driving body.
  pure function driver_columns(driver) result(columns)
    real(wp), intent(in) :: driver(:, :)
    type(machine_column_t), allocatable :: columns(:)
    allocate (columns(2))
    call set_column(columns(1), 'driver_x', 'm', 'position of the driving body', driver(1, :))
    call set_column(columns(2), 'driver_v', 'm/s', 'velocity of the driving body', driver(2, :))
  end function driver_columns

  !> Position and velocity of every coordinate of a structure; inner ones have a number instead of a point's name.
  pure function coordinate_columns(machine, log) result(columns)
    type(multibody_t), intent(in) :: machine
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    character(len=:), allocatable :: name, column
    real(wp), allocatable :: samples(:, :)
    character(len=5) :: units(2)
    logical :: inner
    integer :: i
    allocate (columns(2*machine%n), samples(2*machine%n, log%samples))
    if (log%samples > 0) samples = log%sample_coordinates(:, :log%samples)
    do i = 1, machine%n
      name = trim(machine%names(i))
      column = replace_all(name, '.', '_')
      inner = index(name, '.') > 0 .and. verify(name(index(name, '.') + 1:), '0123456789') == 0
      units = [character(len=5) :: unit_of('m', is_angle(machine, i)), unit_of('m/s', is_angle(machine, i))]
      if (inner) units = [character(len=5) :: '1', '1/s']
      call set_column(columns(2*i - 1), column//'_x', trim(units(1)), trim(merge('coordinate', 'position  ', inner))//' of '// &
                      name, samples(i, :))
      call set_column(columns(2*i), column//'_v', trim(units(2)), trim(merge('rate    ', 'velocity', inner))//' of '//name, &
                      samples(machine%n + i, :))
    end do
  end function coordinate_columns

  !> The joint of each event, its coordinate and rates.
  pure function joint_columns(machine, log) result(columns)
    type(multibody_t), intent(in) :: machine
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    character(len=:), allocatable :: names
    real(wp), allocatable :: joints(:, :)
    integer :: i, count_joints
    logical :: turns
    allocate (columns(0))
    count_joints = count(machine%joints%kind /= joint_section)
    if (count_joints == 0) return
    names = ''
    do i = 1, count_joints
      names = names//trim(machine%joints(i)%name)//' '
    end do
    if (allocated(machine%impulses)) names = names//'impulse'
    allocate (joints(4, log%events))
    if (log%events > 0) joints = log%event_joint(:, :log%events)
    deallocate (columns)
    allocate (columns(4))
    call set_column(columns(1), 'joint', '1', 'joint', joints(1, :))
    columns(1)%meanings = trim(names)
    turns = all([(joins_angles(machine, i), i=1, count_joints)])
    call set_column(columns(2), 'joint_x', unit_of('m', turns), 'joint coordinate: second body minus first', joints(2, :))
    call set_column(columns(3), 'joint_v_before', unit_of('m/s', turns), 'its rate just before the event', joints(3, :))
    call set_column(columns(4), 'joint_v_after', unit_of('m/s', turns), 'its rate just after the event', joints(4, :))
  end function joint_columns

  !> Whether a coordinate is an angle.
  pure logical function is_angle(machine, i)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: i
    is_angle = .false.
    if (allocated(machine%angles)) is_angle = any(machine%angles == machine%names(i))
  end function is_angle

  !> Whether a joint acts between angles.
  pure logical function joins_angles(machine, j)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: j
    integer :: i
    joins_angles = any([(is_angle(machine, i) .and. abs(machine%joints(j)%row(i)) > 0, i=1, machine%n)])
  end function joins_angles

  !> Kinetic energy [J] at every sample; the integral of a controller has none.
  pure function energies_of_motion(machine, log) result(values)
    type(multibody_t), intent(in) :: machine
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    real(wp), allocatable :: velocity(:)
    integer :: i
    do i = 1, log%samples
      velocity = log%sample_coordinates(machine%n + 1:, i)
      if (integral_of(machine) > 0) velocity(integral_of(machine)) = 0
      values(i) = 0.5_wp*sum(velocity*matmul(machine%mass, velocity))
    end do
  end function energies_of_motion

  !> Whether all velocities are rounding at the samples from `since` [s] on, and the `amplitude` [m] is.
  pure logical function is_still(machine, amplitude, since, log)
    type(multibody_t), intent(in) :: machine
    real(wp), intent(in) :: amplitude, since
    type(log_t), intent(in) :: log
    integer :: i
    is_still = .false.
    if (amplitude > machine%negligible_speed*machine%period) return
    do i = log%samples, 1, -1
      if (log%sample_data(1, i) < since) exit
      if (any(abs(log%sample_coordinates(machine%n + 1:, i)) > machine%negligible_speed)) return
    end do
    is_still = .true.
  end function is_still

end module multibody_columns
