! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The function of include/separatrix.h that flies segments.
module c_segments
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  use c_text, only: answer
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t
  use model_type, only: check_values, laws_with_force, model_options, model_t
  use segments, only: propagate, report_t, samples_t
  use status, only: exit_bad_case, exit_usage
  use text, only: to_text
  use variants, only: family_t, prepare_family
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: separatrix_segments, check_directions, check_length, check_samples, check_tolerance

  !> Drive periods that a segment may last.
  real(wp), parameter :: most_periods = 1e5_wp

contains

  integer(c_int) function separatrix_segments(model, chosen_count, chosen, values, direction_count, directions, segment_count, &
      start, first, times, force_count, force_interval, force, derivatives, tolerance, x, v, jacobian, velocity_jacobian, &
      impacts, steady, reason, impact_capacity, impact_count, impact_segment, impact, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model, force
    integer(c_int), value :: chosen_count, direction_count, segment_count, force_count, derivatives, impact_capacity
    integer(c_int), intent(in) :: chosen(chosen_count), first(segment_count + 1)
    real(c_double), value :: force_interval, tolerance
    real(c_double), intent(in) :: values(chosen_count), start(3, segment_count), times(*)
    real(c_double), intent(in) :: directions(chosen_count, direction_count)
    real(c_double), intent(inout) :: x(*), v(*)
    real(c_double), intent(inout) :: jacobian(direction_count + 3, *), velocity_jacobian(direction_count + 3, *)
    integer(c_int), intent(inout) :: impacts(segment_count), steady(segment_count), reason(segment_count)
    integer(c_int), intent(out) :: impact_count
    integer(c_int), intent(inout) :: impact_segment(impact_capacity)
    real(c_double), intent(inout) :: impact(4, impact_capacity)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    real(c_double), target :: no_force(0)
    real(c_double), pointer :: own_force(:)
    type(error_t), allocatable :: error
    type(samples_t) :: samples
    type(report_t) :: report
    integer :: kept
    call c_f_pointer(model, self)
    ! NULL where there are no samples.
    own_force => no_force
    if (c_associated(force)) call c_f_pointer(force, own_force, [force_count])
    impact_count = 0
    call check_samples(segment_count, first, times, error)
    if (.not. allocated(error)) then
      call fly(self, chosen + 1, values, directions, start, first, times(:first(segment_count + 1)), force_interval, &
               own_force, derivatives /= 0, tolerance, samples, report, error)
    end if
    if (.not. allocated(error)) then
      x(:size(samples%x)) = samples%x
      v(:size(samples%x)) = samples%v
      if (derivatives /= 0) then
        jacobian(:, :size(samples%x)) = samples%x_slope
        velocity_jacobian(:, :size(samples%x)) = samples%v_slope
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

  subroutine fly(self, chosen, values, directions, start, first, times, interval, force, derivatives, tolerance, samples, &
                 report, error)
    type(model_t), intent(in) :: self
    integer, intent(in) :: chosen(:), first(:)
    real(wp), intent(in) :: values(:), directions(:, :), start(:, :), times(:), interval, force(:), tolerance
    logical, intent(in) :: derivatives
    type(samples_t), intent(out) :: samples
    type(report_t), intent(out) :: report
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    type(family_t) :: family
    call check_values(self, chosen, values, error)
    if (allocated(error)) return
    call check_directions(directions, derivatives, error)
    if (allocated(error)) return
    call check_tolerance(tolerance, error)
    if (allocated(error)) return
    call laws_with_force(self, interval, force, laws, error)
    if (allocated(error)) return
    call prepare_family(laws, model_options(self, tolerance), self%parameters(chosen), values, directions, derivatives, &
                        family, error)
    if (allocated(error)) return
    if (allocated(family%driven)) then
      call fail(error, exit_bad_case, 'motor: found a machine with a motor, whose segments separatrix_crank_segments flies')
      return
    else if (allocated(family%bodies)) then
      call fail(error, exit_bad_case, 'body.law: found "'//trim(laws(1)%name)//'", allowed for segments point_mass')
      return
    end if
    call check_length(family%moving%machine%period, times, error)
    if (.not. allocated(error)) call propagate(family, start, first, times, derivatives, samples, report)
  end subroutine fly

  !> Code 64 beyond the tolerances of an adaptive flight.
  subroutine check_tolerance(tolerance, error)
    real(wp), intent(in) :: tolerance
    type(error_t), allocatable, intent(out) :: error
    if (tolerance >= 1e-15_wp .and. tolerance <= 1e-3_wp) return
    call fail(error, exit_usage, 'tolerance: found '//to_text(tolerance)//', allowed from 1e-15 to 1e-3')
  end subroutine check_tolerance

  !> Directions are finite, and asked for only with derivatives. Code 64.
  subroutine check_directions(directions, derivatives, error)
    real(wp), intent(in) :: directions(:, :)
    logical, intent(in) :: derivatives
    type(error_t), allocatable, intent(out) :: error
    integer :: i, k
    if (.not. derivatives .and. size(directions, 2) > 0) then
      call fail(error, exit_usage, 'direction_count: found '//to_text(size(directions, 2))//', allowed 0 without derivatives')
      return
    end if
    do k = 1, size(directions, 2)
      do i = 1, size(directions, 1)
        if (.not. ieee_is_finite(directions(i, k))) then
          call fail(error, exit_usage, 'directions['//to_text(k - 1)//']['//to_text(i - 1)//']: found '// &
                    to_text(directions(i, k))//', allowed finite numbers')
          return
        end if
      end do
    end do
  end subroutine check_directions

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

  !> Samples lie within so many drive periods of `period` [s]. Code 64.
  subroutine check_length(period, times, error)
    real(wp), intent(in) :: period, times(:)
    type(error_t), allocatable, intent(out) :: error
    if (size(times) == 0) return
    if (maxval(times) > most_periods*period) then
      call fail(error, exit_usage, 'times: found '//to_text(maxval(times))//' s, allowed at most '// &
                to_text(most_periods)//' drive periods of '//to_text(period)//' s')
    end if
  end subroutine check_length

end module c_segments
