! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h, which documents them, but for those of the other modules of this folder. Between calls
!> only the contents of handles are kept.
module c_interface
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_loc, c_null_ptr, c_ptr, c_size_t
  use build_motion, only: machine_of
  use c_text, only: answer, enter, from_c, to_c
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t
  use model_type, only: check_values, find_parameter, model_from_text, model_options, model_t, model_written_out, &
    read_model, text_with
  use parameter_list, only: put_values
  use status, only: exit_usage
  use text, only: to_text
  implicit none
  private

  public :: separatrix_model_read, separatrix_model_from_text, separatrix_model_free, separatrix_parameter_count, &
    separatrix_parameter, separatrix_find_parameter, separatrix_drive_frequency, separatrix_model_text, &
    separatrix_model_written_out

contains

  integer(c_int) function separatrix_model_read(path, model, message, message_size) bind(c) result(code)
    character(kind=c_char), intent(in) :: path(*)
    type(c_ptr), intent(out) :: model
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: new
    type(error_t), allocatable :: error
    call enter()
    allocate (new)
    call read_model(from_c(path), new, error)
    call hand_out(new, model, error)
    code = answer(error, message, message_size)
  end function separatrix_model_read

  integer(c_int) function separatrix_model_from_text(text, directory, model, message, message_size) bind(c) result(code)
    character(kind=c_char), intent(in) :: text(*), directory(*)
    type(c_ptr), intent(out) :: model
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: new
    type(error_t), allocatable :: error
    call enter()
    allocate (new)
    call model_from_text(from_c(text), from_c(directory), new, error)
    call hand_out(new, model, error)
    code = answer(error, message, message_size)
  end function separatrix_model_from_text

  integer(c_int) function separatrix_model_written_out(model, longer, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    type(c_ptr), intent(out) :: longer
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self, new
    type(error_t), allocatable :: error
    call enter()
    call c_f_pointer(model, self)
    allocate (new)
    call model_written_out(self, new, error)
    call hand_out(new, longer, error)
    code = answer(error, message, message_size)
  end function separatrix_model_written_out

  subroutine hand_out(new, model, error)
    type(model_t), pointer, intent(inout) :: new
    type(c_ptr), intent(out) :: model
    type(error_t), allocatable, intent(in) :: error
    model = c_null_ptr
    if (allocated(error)) then
      deallocate (new)
    else
      model = c_loc(new)
    end if
  end subroutine hand_out

  subroutine separatrix_model_free(model) bind(c)
    type(c_ptr), value :: model
    type(model_t), pointer :: old
    if (.not. c_associated(model)) return
    call c_f_pointer(model, old)
    deallocate (old)
  end subroutine separatrix_model_free

  integer(c_int) function separatrix_parameter_count(model) bind(c) result(count)
    type(c_ptr), value :: model
    type(model_t), pointer :: self
    call c_f_pointer(model, self)
    count = size(self%parameters)
  end function separatrix_parameter_count

  integer(c_int) function separatrix_parameter(model, index, path, path_size, unit, unit_size, numbers, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: path(*), unit(*), message(*)
    integer(c_size_t), value :: path_size, unit_size, message_size
    real(c_double), intent(out) :: numbers(3)
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    call enter()
    call c_f_pointer(model, self)
    numbers = 0
    if (index < 0 .or. index >= size(self%parameters)) then
      call fail(error, exit_usage, 'parameter index: found '//to_text(int(index))//', allowed 0 to '// &
                to_text(size(self%parameters) - 1))
    else
      associate (one => self%parameters(index + 1))
        call to_c(trim(one%path), path, path_size)
        call to_c(trim(one%unit), unit, unit_size)
        numbers = [one%value, one%lower, one%upper]
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_parameter

  integer(c_int) function separatrix_find_parameter(model, path, index, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    character(kind=c_char), intent(in) :: path(*)
    integer(c_int), intent(out) :: index
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    integer :: position
    call enter()
    call c_f_pointer(model, self)
    call find_parameter(self, from_c(path), position, error)
    index = position - 1
    code = answer(error, message, message_size)
  end function separatrix_find_parameter

  integer(c_int) function separatrix_drive_frequency(model, chosen_count, chosen, values, frequency, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count
    integer(c_int), intent(in) :: chosen(chosen_count)
    real(c_double), intent(in) :: values(chosen_count)
    real(c_double), intent(out) :: frequency
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    class(machine_t), allocatable :: moving
    type(law_choice_t), allocatable :: laws(:)
    call enter()
    call c_f_pointer(model, self)
    frequency = 0
    call check_values(self, chosen + 1, values, error)
    if (.not. allocated(error)) then
      laws = self%the_case%laws
      call put_values(laws, self%parameters(chosen + 1), values)
      call machine_of(laws, model_options(self, self%the_case%integrator%tolerance), moving, error)
    end if
    if (.not. allocated(error)) frequency = moving%drive_frequency
    code = answer(error, message, message_size)
  end function separatrix_drive_frequency

  integer(c_int) function separatrix_model_text(model, chosen_count, chosen, values, text, text_size, length, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count
    integer(c_int), intent(in) :: chosen(chosen_count)
    real(c_double), intent(in) :: values(chosen_count)
    character(kind=c_char), intent(inout) :: text(*), message(*)
    integer(c_size_t), value :: text_size, message_size
    integer(c_size_t), intent(out) :: length
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    character(len=:), allocatable :: written
    call enter()
    call c_f_pointer(model, self)
    length = 0
    call check_values(self, chosen + 1, values, error)
    if (.not. allocated(error)) call text_with(self, chosen + 1, values, written, error)
    if (.not. allocated(error)) then
      length = len(written, c_size_t)
      call to_c(written, text, text_size)
    end if
    code = answer(error, message, message_size)
  end function separatrix_model_text

end module c_interface
