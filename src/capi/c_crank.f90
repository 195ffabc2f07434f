! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The function of include/separatrix.h that flies segments of a machine with a motor.
module c_crank
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  use c_segments, only: check_directions, check_length, check_samples, check_tolerance
  use c_text, only: answer
  use crank_segments, only: crank_report_t, crank_rows, crank_samples_t, propagate_crank
  use errors, only: error_t, fail
  use kinds, only: wp
  use model_type, only: check_values, model_options, model_t
  use motor_choices, only: has_motor, has_ramp
  use status, only: exit_bad_case
  use variants, only: family_t, prepare_family
  implicit none
  private

  public :: separatrix_crank_segments

contains

  integer(c_int) function separatrix_crank_segments(model, chosen_count, chosen, values, direction_count, directions, &
      segment_count, start, first, times, derivatives, tolerance, motion, jacobian, impacts, steady, reason, impact_capacity, &
      impact_count, impact_segment, impact, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count, direction_count, segment_count, derivatives, impact_capacity
    integer(c_int), intent(in) :: chosen(chosen_count), first(segment_count + 1)
    real(c_double), value :: tolerance
    real(c_double), intent(in) :: values(chosen_count), directions(chosen_count, direction_count)
    real(c_double), intent(in) :: start(crank_rows, segment_count), times(*)
    real(c_double), intent(inout) :: motion(crank_rows, *)
    real(c_double), intent(inout) :: jacobian(direction_count + crank_rows, crank_rows, *)
    integer(c_int), intent(inout) :: impacts(segment_count), steady(segment_count), reason(segment_count)
    integer(c_int), intent(out) :: impact_count
    integer(c_int), intent(inout) :: impact_segment(impact_capacity)
    real(c_double), intent(inout) :: impact(4, impact_capacity)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(crank_samples_t) :: samples
    type(crank_report_t) :: report
    integer :: kept
    call c_f_pointer(model, self)
    impact_count = 0
    call check_samples(segment_count, first, times, error)
    if (.not. allocated(error)) then
      call fly(self, chosen + 1, values, directions, start, first, times(:first(segment_count + 1)), derivatives /= 0, &
               tolerance, samples, report, error)
    end if
    if (.not. allocated(error)) then
      motion(:, :size(samples%motion, 2)) = samples%motion
      if (derivatives /= 0) jacobian(:, :, :size(samples%motion, 2)) = samples%slope
      impacts = report%impacts
      steady = merge(1, 0, report%steady)
      reason = report%reason
      impact_count = size(report%impact_segment)
      kept = min(impact_count, impact_capacity)
      impact_segment(:kept) = report%impact_segment(:kept) - 1
      impact(:, :kept) = report%impact(:, :kept)
    end if
    code = answer(error, message, message_size)
  end function separatrix_crank_segments

  subroutine fly(self, chosen, values, directions, start, first, times, derivatives, tolerance, samples, report, error)
    type(model_t), intent(in) :: self
    integer, intent(in) :: chosen(:), first(:)
    real(wp), intent(in) :: values(:), directions(:, :), start(:, :), times(:), tolerance
    logical, intent(in) :: derivatives
    type(crank_samples_t), intent(out) :: samples
    type(crank_report_t), intent(out) :: report
    type(error_t), allocatable, intent(out) :: error
    type(family_t) :: family
    call check_values(self, chosen, values, error)
    if (.not. allocated(error)) call check_directions(directions, derivatives, error)
    if (.not. allocated(error)) call check_tolerance(tolerance, error)
    if (allocated(error)) return
    if (.not. has_motor(self%the_case%laws)) then
      call fail(error, exit_bad_case, 'motor: not found, allowed for segments of a crank a machine with a motor')
    else if (has_ramp(self%the_case%laws)) then
      call fail(error, exit_bad_case, 'motor.ramp_time: found a ramp, whose instant no start of a segment states')
    else
      call prepare_family(self%the_case%laws, model_options(self, tolerance), self%parameters(chosen), &
                          values, directions, derivatives, family, error)
    end if
    if (.not. allocated(error)) call check_length(family%period, times, error)
    if (.not. allocated(error)) call propagate_crank(family, start, first, times, derivatives, samples, report)
  end subroutine fly

end module c_crank
