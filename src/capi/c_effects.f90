! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h about effects: the table of them, and a model with one added.
module c_effects
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_loc, c_null_ptr, c_ptr, c_size_t
  use c_text, only: answer, enter, from_c, to_c
  use effect_rows, only: effect_confusions, effect_traits
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, find_law, law_rows => laws, parameters
  use model_type, only: model_t, model_with_effect
  use status, only: exit_usage
  use text, only: to_text
  implicit none
  private

  public :: separatrix_effect, separatrix_effect_parameter, separatrix_effect_confusion, separatrix_model_with_effect

contains

  integer(c_int) function separatrix_effect(index, name, name_size, family, family_size, acts, acts_size, amplitudes, &
      amplitudes_size, sizes, sizes_size, needs, needs_size, message, message_size) bind(c) result(code)
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: name(*), family(*), acts(*), amplitudes(*), sizes(*), needs(*), message(*)
    integer(c_size_t), value :: name_size, family_size, acts_size, amplitudes_size, sizes_size, needs_size, message_size
    type(error_t), allocatable :: error
    call enter()
    call check_row(int(index), size(effect_traits), error)
    if (.not. allocated(error)) then
      associate (row => effect_traits(index + 1))
        call to_c(trim(row%name), name, name_size)
        call to_c(trim(row%family), family, family_size)
        call to_c(trim(row%acts), acts, acts_size)
        call to_c(trim(row%amplitudes), amplitudes, amplitudes_size)
        call to_c(trim(row%sizes), sizes, sizes_size)
        call to_c(trim(row%needs), needs, needs_size)
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_effect

  integer(c_int) function separatrix_effect_parameter(index, effect, effect_size, meaning, meaning_size, parameter, &
      parameter_size, unit, unit_size, numbers, message, message_size) bind(c) result(code)
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: effect(*), meaning(*), parameter(*), unit(*), message(*)
    integer(c_size_t), value :: effect_size, meaning_size, parameter_size, unit_size, message_size
    real(c_double), intent(out) :: numbers(4)
    type(error_t), allocatable :: error
    integer, allocatable :: rows(:)
    integer :: i
    call enter()
    numbers = 0
    rows = pack([(i, i=1, size(parameters))], parameters%family == effect_family)
    call check_row(int(index), size(rows), error)
    if (.not. allocated(error)) then
      associate (row => parameters(rows(index + 1)))
        call to_c(trim(row%law), effect, effect_size)
        call to_c(trim(law_rows(find_law(effect_family, trim(row%law)))%meaning), meaning, meaning_size)
        call to_c(trim(row%name), parameter, parameter_size)
        call to_c(trim(row%unit), unit, unit_size)
        numbers = [row%default, row%range%lower, row%range%upper, merge(1.0_wp, 0.0_wp, row%optional)]
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_effect_parameter

  integer(c_int) function separatrix_effect_confusion(index, one, one_size, other, other_size, reason, reason_size, message, &
      message_size) bind(c) result(code)
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: one(*), other(*), reason(*), message(*)
    integer(c_size_t), value :: one_size, other_size, reason_size, message_size
    type(error_t), allocatable :: error
    call enter()
    call check_row(int(index), size(effect_confusions), error)
    if (.not. allocated(error)) then
      associate (row => effect_confusions(index + 1))
        call to_c(trim(row%one), one, one_size)
        call to_c(trim(row%other), other, other_size)
        call to_c(trim(row%reason), reason, reason_size)
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_effect_confusion

  subroutine check_row(index, count, error)
    integer, intent(in) :: index, count
    type(error_t), allocatable, intent(out) :: error
    if (index >= 0 .and. index < count) return
    call fail(error, exit_usage, 'row of the effects: found '//to_text(index)//', allowed 0 to '//to_text(count - 1))
  end subroutine check_row

  integer(c_int) function separatrix_model_with_effect(model, effect, count, keys, values, extended, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: model
    character(kind=c_char), intent(in) :: effect(*)
    integer(c_int), value :: count
    type(c_ptr), intent(in) :: keys(count)
    real(c_double), intent(in) :: values(count)
    type(c_ptr), intent(out) :: extended
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    character(kind=c_char), pointer :: key(:)
    character(len=64) :: names(count)
    type(model_t), pointer :: self, new
    type(error_t), allocatable :: error
    integer :: i
    call enter()
    call c_f_pointer(model, self)
    do i = 1, count
      call c_f_pointer(keys(i), key, [len(names)])
      names(i) = from_c(key)
    end do
    allocate (new)
    call model_with_effect(self, from_c(effect), names, values, new, error)
    extended = c_null_ptr
    if (allocated(error)) then
      deallocate (new)
    else
      extended = c_loc(new)
    end if
    code = answer(error, message, message_size)
  end function separatrix_model_with_effect

end module c_effects
