! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h, which says what they do. Nothing is kept between calls but what a handle holds.
module c_interface
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_loc, c_null_ptr, c_ptr, c_size_t
  use build_motion, only: machine_of
  use c_text, only: from_c, to_c
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, find_law, law_choice_t, laws, parameters
  use model_type, only: check_values, find_parameter, model_from_text, model_options, model_t, read_model, text_with
  use motion, only: motion_t
  use parameter_list, only: put_values
  use segments, only: propagate, report_t, samples_t
  use status, only: exit_done, exit_usage
  use text, only: to_text
  use variants, only: family_t, prepare_family
  implicit none
  private

  public :: separatrix_model_read, separatrix_model_from_text, separatrix_model_free, separatrix_parameter_count, &
    separatrix_parameter, separatrix_find_parameter, separatrix_drive_frequency, separatrix_segments, separatrix_model_text, &
    separatrix_effect_parameter

  !> Drive periods that a segment may last.
  real(wp), parameter :: most_periods = 1e5_wp

contains

  integer(c_int) function separatrix_model_read(path, model, message, message_size) bind(c) result(code)
    character(kind=c_char), intent(in) :: path(*)
    type(c_ptr), intent(out) :: model
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: new
    type(error_t), allocatable :: error
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
    allocate (new)
    call model_from_text(from_c(text), from_c(directory), new, error)
    call hand_out(new, model, error)
    code = answer(error, message, message_size)
  end function separatrix_model_from_text

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
    type(motion_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    call c_f_pointer(model, self)
    frequency = 0
    call check_values(self, chosen + 1, values, error)
    if (.not. allocated(error)) then
      laws = self%the_case%laws
      call put_values(laws, self%parameters(chosen + 1), values)
      call machine_of(laws, model_options(self, self%the_case%integrator%tolerance), moving, error)
    end if
    if (.not. allocated(error)) frequency = moving%machine%drive_frequency
    code = answer(error, message, message_size)
  end function separatrix_drive_frequency

  integer(c_int) function separatrix_segments(model, chosen_count, chosen, values, segment_count, start, first, times, &
      derivatives, tolerance, x, v, jacobian, velocity_jacobian, impacts, steady, reason, impact_capacity, impact_count, &
      impact_segment, impact, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count, segment_count, derivatives, impact_capacity
    integer(c_int), intent(in) :: chosen(chosen_count), first(segment_count + 1)
    real(c_double), intent(in) :: values(chosen_count), start(3, segment_count), times(*)
    real(c_double), value :: tolerance
    real(c_double), intent(inout) :: x(*), v(*)
    real(c_double), intent(inout) :: jacobian(chosen_count + 3, *), velocity_jacobian(chosen_count + 3, *)
    integer(c_int), intent(inout) :: impacts(segment_count), steady(segment_count), reason(segment_count)
    integer(c_int), intent(out) :: impact_count
    integer(c_int), intent(inout) :: impact_segment(impact_capacity)
    real(c_double), intent(inout) :: impact(4, impact_capacity)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(family_t) :: family
    type(samples_t) :: samples
    type(report_t) :: report
    integer :: m, kept
    call c_f_pointer(model, self)
    impact_count = 0
    call check_values(self, chosen + 1, values, error)
    if (.not. allocated(error)) call check_samples(segment_count, first, times, error)
    if (.not. allocated(error) .and. .not. (tolerance >= 1e-15_wp .and. tolerance <= 1e-3_wp)) then
      call fail(error, exit_usage, 'tolerance: found '//to_text(tolerance)//', allowed from 1e-15 to 1e-3')
    end if
    if (.not. allocated(error)) call prepare_family(self%the_case%laws, model_options(self, tolerance), &
      self%parameters(chosen + 1), values, derivatives /= 0, family, error)
    m = first(segment_count + 1)
    if (.not. allocated(error)) call check_length(family, times(:m), error)
    if (.not. allocated(error)) then
      call propagate(family, start, first, times(:m), derivatives /= 0, samples, report)
      x(:m) = samples%x
      v(:m) = samples%v
      if (derivatives /= 0) then
        jacobian(:, :m) = samples%x_slope
        velocity_jacobian(:, :m) = samples%v_slope
      end if
      impacts = report%impacts
      steady = merge(1, 0, report%steady)
      reason = report%reason
      impact_count = size(report%impact_segment)
      kept = min(impact_count, impact_capacity)
      impact_segment(:kept) = report%impact_segment(:kept) - 1
      impact(:, :kept) = report%impact(:, :kept)
    end if
    code = answer(error, message, message_size)
  end function separatrix_segments

  !> Offsets ascend from 0, and times within each segment from 0 on. Code 64.
  subroutine check_samples(segment_count, first, times, error)
    integer, intent(in) :: segment_count, first(:)
    real(wp), intent(in) :: times(*)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: before
    integer :: i, k
    if (first(1) /= 0 .or. any(first(2:) < first(:segment_count))) then
      call fail(error, exit_usage, 'first: offsets must ascend from 0')
      return
    end if
    do i = 1, segment_count
      before = 0
      do k = first(i) + 1, first(i + 1)
        if (.not. (times(k) >= before .and. times(k) <= huge(before))) then
          call fail(error, exit_usage, 'times['//to_text(k - 1)//']: found '//to_text(times(k))//' s in segment '// &
                    to_text(i - 1)//', allowed at least '//to_text(before)//' s, finite')
          return
        end if
        before = times(k)
      end do
    end do
  end subroutine check_samples

  subroutine check_length(family, times, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: times(:)
    type(error_t), allocatable, intent(out) :: error
    if (size(times) == 0) return
    if (maxval(times) > most_periods*family%moving%machine%period) then
      call fail(error, exit_usage, 'times: found '//to_text(maxval(times))//' s, allowed at most '// &
                to_text(most_periods)//' drive periods of '//to_text(family%moving%machine%period)//' s')
    end if
  end subroutine check_length

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

  integer(c_int) function separatrix_effect_parameter(index, effect, effect_size, meaning, meaning_size, parameter, &
      parameter_size, unit, unit_size, numbers, message, message_size) bind(c) result(code)
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: effect(*), meaning(*), parameter(*), unit(*), message(*)
    integer(c_size_t), value :: effect_size, meaning_size, parameter_size, unit_size, message_size
    real(c_double), intent(out) :: numbers(4)
    type(error_t), allocatable :: error
    integer, allocatable :: rows(:)
    integer :: i
    numbers = 0
    rows = pack([(i, i=1, size(parameters))], parameters%family == effect_family)
    if (index < 0 .or. index >= size(rows)) then
      call fail(error, exit_usage, 'row of the effects: found '//to_text(int(index))//', allowed 0 to '// &
                to_text(size(rows) - 1))
    else
      associate (row => parameters(rows(index + 1)))
        call to_c(trim(row%law), effect, effect_size)
        call to_c(trim(laws(find_law(effect_family, trim(row%law)))%meaning), meaning, meaning_size)
        call to_c(trim(row%name), parameter, parameter_size)
        call to_c(trim(row%unit), unit, unit_size)
        numbers = [row%default, row%lower, row%upper, merge(1.0_wp, 0.0_wp, row%optional)]
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_effect_parameter

  !> The code of an error, its message in the buffer of the caller.
  integer(c_int) function answer(error, message, message_size) result(code)
    type(error_t), allocatable, intent(in) :: error
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), intent(in) :: message_size
    code = exit_done
    if (allocated(error)) then
      code = error%code
      call to_c(error%message, message, message_size)
    else
      call to_c('', message, message_size)
    end if
  end function answer

end module c_interface
