! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction with memory between parts: bristles with a deflection of their own, and elements of spring and slider in parallel.
module build_memory
  use assembly, only: add_body, add_joint, index_of, move_surface
  use bristle_law, only: bristle_of
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t, list_of, path_of, value_of
  use reference_points, only: number
  use multibody, only: joint_bristle, joint_elastic, joint_t, multibody_t, wave_t
  use status, only: exit_bad_case
  use text, only: to_text
  implicit none
  private

  public :: has_bristles, add_deflections, add_bristles, add_elements, check_static

contains

  !> Whether a part is friction whose deflection is a coordinate.
  pure elemental logical function has_bristles(choice)
    type(law_choice_t), intent(in) :: choice
    has_bristles = choice%name == 'friction:dahl' .or. choice%name == 'friction:bouc_wen' .or. choice%name == 'friction:lugre'
  end function has_bristles

  !> The coordinates whose velocities are deflections, after all others; `rows` of reference points get zeros there.
  pure subroutine add_deflections(choices, machine, rows)
    type(law_choice_t), intent(in) :: choices(:)
    type(multibody_t), intent(inout) :: machine
    real(wp), allocatable, intent(inout) :: rows(:, :)
    real(wp), allocatable :: larger(:, :)
    integer :: i, before
    before = machine%n
    do i = 1, size(choices)
      if (has_bristles(choices(i))) call add_body(machine, deflection_of(choices(i)), value_of(choices(i), 'stiffness'), 0.0_wp)
    end do
    if (machine%n == before) return
    allocate (larger(machine%n, size(rows, 2)), source=0.0_wp)
    larger(:before, :) = rows
    call move_alloc(larger, rows)
    if (.not. allocated(machine%start_shape)) return
    allocate (larger(machine%n, 2), source=0.0_wp)
    larger(:before, :) = machine%start_shape
    call move_alloc(larger, machine%start_shape)
  end subroutine add_deflections

  pure function deflection_of(choice) result(name)
    type(law_choice_t), intent(in) :: choice
    character(len=:), allocatable :: name
    name = trim(choice%label)//'.1'
  end function deflection_of

  !> Code 65 for a `static` level of friction below that of sliding [N, or 1 where they are coefficients].
  pure subroutine check_static(choice, static, sliding, error)
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: static, sliding
    type(error_t), allocatable, intent(inout) :: error
    if (.not. static < sliding) return
    if (choice%name == 'friction:coulomb_load') then
      call fail(error, exit_bad_case, path_of(choice)//'.static_coefficient: found '//number(static)// &
                ', allowed at least the kinetic_coefficient '//number(sliding))
    else
      call fail(error, exit_bad_case, path_of(choice)//'.static_force: found '//number(static)// &
                ' N, allowed at least the force '//number(sliding)//' N')
    end if
  end subroutine check_static

  !> The joints of bristles between surfaces along `row`. Code 65 for a static force below that of sliding.
  pure subroutine add_bristles(machine, choice, row, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: row(:)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    type(wave_t) :: belt
    if (choice%name == 'friction:lugre') then
      call check_static(choice, value_of(choice, 'static_force'), value_of(choice, 'force'), error)
    end if
    if (allocated(error)) return
    joint%name = path_of(choice)
    joint%kind = joint_bristle
    joint%row = row
    belt%mean = value_of(choice, 'velocity')
    call move_surface(joint, machine%frequency, belt)
    allocate (joint%memory)
    joint%memory%law = bristle_of(choice)
    joint%memory%slide%row = row
    joint%memory%slide%offset = joint%offset
    joint%memory%deflection = 0*row
    joint%memory%deflection(index_of(machine, deflection_of(choice))) = 1
    call add_joint(machine, joint)
    joint%row = joint%memory%deflection
    joint%offset = wave_t()
    joint%memory%on_deflection = .true.
    call add_joint(machine, joint)
  end subroutine add_bristles

  !> Elements of spring and slider in parallel. Code 65 for lists of different lengths.
  pure subroutine add_elements(machine, choice, row, error)
    type(multibody_t), intent(inout) :: machine
    type(law_choice_t), intent(in) :: choice
    real(wp), intent(in) :: row(:)
    type(error_t), allocatable, intent(out) :: error
    type(joint_t) :: joint
    type(wave_t) :: belt
    real(wp), allocatable :: stiffness(:), force(:)
    integer :: i
    stiffness = list_of(choice, 'stiffness')
    force = list_of(choice, 'force')
    if (size(stiffness) /= size(force) .or. size(force) == 0) then
      call fail(error, exit_bad_case, path_of(choice)//'.force: found '//to_text(size(force))// &
                ' numbers, allowed as many as stiffness has: '//to_text(size(stiffness)))
      return
    end if
    joint%kind = joint_elastic
    joint%row = row
    belt%mean = value_of(choice, 'velocity')
    call move_surface(joint, machine%frequency, belt)
    do i = 1, size(force)
      joint%name = path_of(choice)//'.'//to_text(i)
      joint%stiffness = stiffness(i)
      joint%friction%kinetic = force(i)
      joint%friction%break_away = force(i)
      call add_joint(machine, joint)
    end do
  end subroutine add_elements

end module build_memory
