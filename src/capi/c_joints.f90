! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The function of include/separatrix.h that has the force of a joint.
module c_joints
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  use build_joints, only: joint_alone
  use c_text, only: answer, enter, from_c
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t, path_of
  use model_type, only: check_values, model_t
  use multibody, only: joint_contact, joint_soft, joint_t, multibody_t
  use multibody_state, only: joint_force
  use parameter_list, only: put_values
  use status, only: exit_bad_case, exit_usage
  implicit none
  private

  public :: separatrix_joint_force

contains

  integer(c_int) function separatrix_joint_force(model, chosen_count, chosen, values, joint, sample_count, extension, speed, &
      force, by_extension, by_speed, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count, sample_count
    integer(c_int), intent(in) :: chosen(chosen_count)
    real(c_double), intent(in) :: values(chosen_count), extension(sample_count), speed(sample_count)
    character(kind=c_char), intent(in) :: joint(*)
    real(c_double), intent(inout) :: force(sample_count), by_extension(sample_count), by_speed(sample_count)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(multibody_t) :: machine
    integer :: i
    call enter()
    call c_f_pointer(model, self)
    call build(self, chosen + 1, values, from_c(joint), machine, error)
    if (.not. allocated(error)) then
      do i = 1, sample_count
        call force_along(machine, extension(i), speed(i), force(i), by_extension(i), by_speed(i))
      end do
    end if
    code = answer(error, message, message_size)
  end function separatrix_joint_force

  !> The joint with other values of parameters, in a machine of its own coordinate. Code 64 for an unknown one, 65 for a rigid one.
  subroutine build(self, chosen, values, path, machine, error)
    type(model_t), intent(in) :: self
    integer, intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    character(len=*), intent(in) :: path
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    integer :: i
    call check_values(self, chosen, values, error)
    if (allocated(error)) return
    laws = self%the_case%laws
    call put_values(laws, self%parameters(chosen), values)
    do i = 1, size(laws)
      if (path_of(laws(i)) /= path) cycle
      call joint_alone(laws(i), machine, error)
      if (allocated(error)) return
      if (any(machine%joints%kind == joint_contact)) call fail(error, exit_bad_case, path//': found a rigid contact, allowed '// &
                                                                'one with a force')
      return
    end do
    call fail(error, exit_usage, 'joint: found '//path//', which the machine does not have')
  end subroutine build

  !> Force that pulls the second end of the joint back, and its slopes.
  pure subroutine force_along(machine, s, u, force, by_extension, by_speed)
    type(multibody_t), intent(in) :: machine
    real(wp), intent(in) :: s, u
    real(wp), intent(out) :: force, by_extension, by_speed
    real(wp) :: r, slopes(2)
    integer :: j, side
    force = machine%stiffness(1, 1)*s + machine%damping(1, 1)*u - machine%load(1)
    by_extension = machine%stiffness(1, 1)
    by_speed = machine%damping(1, 1)
    do j = 1, size(machine%joints)
      associate (joint => machine%joints(j))
        side = side_of(joint, s)
        call joint_force(joint, side, 0.0_wp, abs(u), s + joint%offset%mean, u, 1.0_wp, r, slopes(1), slopes(2))
        ! A contact lets go before it would pull.
        if (side*r > 0 .and. .not. joint%contact%tension) cycle
        force = force - r
        by_extension = by_extension - slopes(1)
        by_speed = by_speed - slopes(2)
      end associate
    end do
  end subroutine force_along

  !> The stop beyond which a soft contact is: +1 upper, -1 lower, 0 none.
  pure integer function side_of(joint, s) result(side)
    type(joint_t), intent(in) :: joint
    real(wp), intent(in) :: s
    side = 0
    if (joint%kind /= joint_soft) return
    if (s > joint%upper) side = 1
    if (s < joint%lower) side = -1
  end function side_of

end module c_joints
