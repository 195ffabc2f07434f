! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The function of include/separatrix.h that reads a case with settings on top, as `--set` puts them.
module c_settings
  use, intrinsic :: iso_c_binding, only: c_char, c_f_pointer, c_int, c_loc, c_null_ptr, c_ptr, c_size_t
  use c_text, only: answer, enter, from_c
  use case_reader, only: load_case_text
  use errors, only: error_t
  use model_type, only: model_t
  use parameter_list, only: list_parameters
  implicit none
  private

  public :: separatrix_model_with

  interface
    pure function length_of_c_text(text) bind(c, name='strlen') result(length)
      import :: c_ptr, c_size_t
      type(c_ptr), value :: text
      integer(c_size_t) :: length
    end function length_of_c_text
  end interface

contains

  integer(c_int) function separatrix_model_with(text, name, setting_count, settings, model, message, message_size) &
      bind(c) result(code)
    character(kind=c_char), intent(in) :: text(*), name(*)
    integer(c_int), value :: setting_count
    type(c_ptr), intent(in) :: settings(setting_count)
    type(c_ptr), intent(out) :: model
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: new
    type(error_t), allocatable :: error
    call enter()
    allocate (new)
    model = c_null_ptr
    call load_case_text(from_c(text), from_c(name), padded(settings), new%the_case, error)
    if (allocated(error)) then
      deallocate (new)
    else
      new%parameters = list_parameters(new%the_case%laws)
      model = c_loc(new)
    end if
    code = answer(error, message, message_size)
  end function separatrix_model_with

  !> Texts of C as texts of one length.
  function padded(texts) result(lines)
    type(c_ptr), intent(in) :: texts(:)
    character(len=:), allocatable :: lines(:)
    character(kind=c_char), pointer :: characters(:)
    integer(c_size_t), allocatable :: lengths(:)
    integer :: i, j
    allocate (lengths(size(texts)))
    do i = 1, size(texts)
      lengths(i) = length_of_c_text(texts(i))
    end do
    allocate (character(len=int(max(1_c_size_t, maxval([lengths, 0_c_size_t])))) :: lines(size(texts)))
    lines = ''
    do i = 1, size(texts)
      call c_f_pointer(texts(i), characters, [lengths(i)])
      do j = 1, size(characters)
        lines(i)(j:j) = characters(j)
      end do
    end do
  end function padded

end module c_settings
