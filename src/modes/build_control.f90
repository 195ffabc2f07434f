! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From the drives of a case to the controller and the impulses of a structure.
module build_control
  use control, only: add_controller, add_impulse
  use errors, only: error_t, fail
  use multibody, only: controller_t, impulse_t, multibody_t
  use kinds, only: wp
  use law_table, only: law_choice_t, path_of, value_of
  use reference_points, only: reference_point_of
  use status, only: exit_bad_case
  use waves, only: wave_of
  implicit none
  private

  public :: add_controllers, add_impulses

contains

  !> The controllers, once every joint and force is there; `rows` are those of the positions (columns), `given` the coordinates
  !> whose motion is given.
  pure subroutine add_controllers(choices, rows, given, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp), intent(in) :: rows(:, :)
    integer, intent(in) :: given(:)
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(controller_t) :: controller
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:controller') cycle
      if (size(given) > 0 .or. allocated(machine%controller)) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.law: found a controller beside another, or beside a body whose '// &
                  'motion is given, allowed one controller')
        return
      end if
      controller%row = rows(:, reference_point_of(choices(i)))
      controller%reference = wave_of(choices(i))
      controller%proportional = value_of(choices(i), 'proportional')
      controller%integral = value_of(choices(i), 'integral')
      controller%derivative = value_of(choices(i), 'derivative')
      controller%sample_time = value_of(choices(i), 'sample_time')
      call add_controller(machine, controller, trim(choices(i)%label)//'.1', error)
      if (allocated(error)) return
    end do
  end subroutine add_controllers

  !> The impulses on a machine that is complete: `given` coordinates have left it.
  pure subroutine add_impulses(choices, rows, given, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp), intent(in) :: rows(:, :)
    integer, intent(in) :: given(:)
    type(multibody_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(impulse_t) :: impulse
    integer :: i, k
    do i = 1, size(choices)
      if (choices(i)%name /= 'drive:impulse') cycle
      associate (row => rows(:, reference_point_of(choices(i))))
        impulse%row = pack(row, [(all(given /= k), k=1, size(row))])
      end associate
      if (.not. any(abs(impulse%row) > 0)) then
        call fail(error, exit_bad_case, path_of(choices(i))//'.body: found a body whose motion is given, allowed one that is free')
        return
      end if
      ! The integral of a controller is the last coordinate.
      if (size(impulse%row) < machine%n) impulse%row = [impulse%row, 0.0_wp]
      impulse%amount = value_of(choices(i), 'impulse')
      impulse%time = value_of(choices(i), 'time')
      call add_impulse(machine, impulse)
    end do
  end subroutine add_impulses

end module build_control
