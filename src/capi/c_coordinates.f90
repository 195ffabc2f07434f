! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h that name coordinates and contacts of structures.
module c_coordinates
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_ptr, c_size_t
  use build_motion, only: bodies_of, kind_bodies, kind_of
  use c_text, only: answer, enter, to_c
  use errors, only: error_t, fail
  use multibody, only: is_stop, multibody_t
  use multibody_machine, only: multibody_machine_t
  use model_type, only: model_options, model_t
  use status, only: exit_usage
  use text, only: to_text
  implicit none
  private

  public :: separatrix_coordinate, separatrix_contact

contains

  integer(c_int) function separatrix_coordinate(model, index, name, name_size, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: name(*), message(*)
    integer(c_size_t), value :: name_size, message_size
    type(error_t), allocatable :: error
    type(multibody_t) :: machine
    call enter()
    call build(model, machine, error)
    if (.not. allocated(error)) then
      if (index < 0 .or. index >= machine%n) then
        call fail(error, exit_usage, 'coordinate index: found '//to_text(int(index))//', the structure has '//to_text(machine%n))
      else
        call to_c(trim(machine%names(index + 1)), name, name_size)
      end if
    end if
    code = answer(error, message, message_size)
  end function separatrix_coordinate

  integer(c_int) function separatrix_contact(model, index, name, name_size, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: name(*), message(*)
    integer(c_size_t), value :: name_size, message_size
    type(error_t), allocatable :: error
    type(multibody_t) :: machine
    integer, allocatable :: contacts(:)
    integer :: i
    call enter()
    call build(model, machine, error)
    if (.not. allocated(error)) then
      contacts = pack([(i, i=1, size(machine%joints))], is_stop(machine%joints%kind))
      if (index < 0 .or. index >= size(contacts)) then
        call fail(error, exit_usage, 'contact index: found '//to_text(int(index))//', the structure has '// &
                  to_text(size(contacts)))
      else
        call to_c(trim(machine%joints(contacts(index + 1))%name), name, name_size)
      end if
    end if
    code = answer(error, message, message_size)
  end function separatrix_contact

  !> The structure of a model as it is; that of one body has no coordinates.
  subroutine build(model, machine, error)
    type(c_ptr), intent(in) :: model
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(model_t), pointer :: self
    type(multibody_machine_t) :: several
    call c_f_pointer(model, self)
    allocate (machine%joints(0))
    if (kind_of(self%the_case%laws) /= kind_bodies) return
    call bodies_of(self%the_case%laws, model_options(self, self%the_case%integrator%tolerance), several, error)
    if (.not. allocated(error)) machine = several%bodies%machine
  end subroutine build

end module c_coordinates
