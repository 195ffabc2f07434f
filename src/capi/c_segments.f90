! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h that fly segments.
module c_segments
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  use c_text, only: answer, compute, computed, enter
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t
  use model_type, only: check_values, laws_with_force, model_options, model_t
  use segment_machine, only: impact_contact, impact_numbers
  use segments, only: propagate, report_t, samples_t
  use status, only: exit_bad_case, exit_usage
  use text, only: to_text
  use variants, only: family_t, prepare_family
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: separatrix_segment_numbers, separatrix_propagate

  !> Drive periods that a segment may last.
  real(wp), parameter :: most_periods = 1e5_wp

  !> `separatrix_segments` of the header, member by member.
  type, bind(c) :: segments_t
    integer(c_int) :: chosen_count
    integer(c_int) :: direction_count
    integer(c_int) :: segment_count
    integer(c_int) :: start_numbers
    integer(c_int) :: sample_numbers
    integer(c_int) :: force_count
    integer(c_int) :: derivatives
    integer(c_int) :: impact_capacity
    real(c_double) :: tolerance
    real(c_double) :: force_interval
    type(c_ptr) :: chosen
    type(c_ptr) :: values
    type(c_ptr) :: directions
    type(c_ptr) :: start
    type(c_ptr) :: first
    type(c_ptr) :: times
    type(c_ptr) :: force
    type(c_ptr) :: motion
    type(c_ptr) :: jacobian
    type(c_ptr) :: impacts
    type(c_ptr) :: steady
    type(c_ptr) :: reason
    type(c_ptr) :: impact_segment
    type(c_ptr) :: impact
    integer(c_int) :: impact_count
  end type segments_t

  !> What a call is given, as Fortran has it.
  type :: given_t
    integer(c_int), pointer :: chosen(:), first(:)
    real(c_double), pointer :: values(:), directions(:, :), start(:, :), times(:), force(:)
  end type given_t

contains

  integer(c_int) function separatrix_segment_numbers(model, start_numbers, sample_numbers, message, message_size) &
    bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), intent(out) :: start_numbers, sample_numbers
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(family_t) :: family
    call enter()
    call c_f_pointer(model, self)
    start_numbers = 0
    sample_numbers = 0
    call prepare_family(self%the_case%laws, model_options(self, self%the_case%integrator%tolerance), self%parameters(:0), &
                        [real(wp) ::], reshape([real(wp) ::], [0, 0]), .false., family, error)
    if (.not. allocated(error)) then
      start_numbers = family%machine%start_numbers
      sample_numbers = family%machine%sample_numbers
    end if
    code = answer(error, message, message_size)
  end function separatrix_segment_numbers

  integer(c_int) function separatrix_propagate(model, segments, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    type(segments_t), intent(inout) :: segments
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(given_t) :: given
    type(samples_t) :: samples
    type(report_t) :: report
    call enter()
    call c_f_pointer(model, self)
    segments%impact_count = 0
    call take_given(segments, given, error)
    if (.not. allocated(error)) call check_results(segments, size(given%times), error)
    if (.not. allocated(error)) call fly(self, segments, given, samples, report, error)
    if (.not. allocated(error)) call hand_out(samples, report, segments)
    code = answer(error, message, message_size)
  end function separatrix_propagate

  !> What is given. Code 64 for a pointer that is NULL, offsets and times that do not ascend.
  subroutine take_given(segments, given, error)
    type(segments_t), intent(in) :: segments
    type(given_t), intent(out) :: given
    type(error_t), allocatable, intent(out) :: error
    associate (of => segments)
      call check_pointer('chosen', of%chosen, of%chosen_count, error)
      call check_pointer('values', of%values, of%chosen_count, error)
      call check_pointer('directions', of%directions, of%chosen_count*of%direction_count, error)
      call check_pointer('start', of%start, of%start_numbers*of%segment_count, error)
      call check_pointer('first', of%first, of%segment_count + 1, error)
      call check_pointer('force', of%force, of%force_count, error)
      if (min(of%direction_count, of%start_numbers, of%sample_numbers, of%impact_capacity) < 0) then
        call fail(error, exit_usage, 'segments: found a negative count')
      end if
      if (allocated(error)) return
      call c_f_pointer(of%chosen, given%chosen, [of%chosen_count])
      call c_f_pointer(of%values, given%values, [of%chosen_count])
      call c_f_pointer(of%directions, given%directions, [of%chosen_count, of%direction_count])
      call c_f_pointer(of%start, given%start, [of%start_numbers, of%segment_count])
      call c_f_pointer(of%first, given%first, [of%segment_count + 1])
      call c_f_pointer(of%force, given%force, [of%force_count])
      call check_offsets(given%first, error)
      if (.not. allocated(error)) call check_pointer('times', of%times, given%first(of%segment_count + 1), error)
      if (allocated(error)) return
      call c_f_pointer(of%times, given%times, [given%first(of%segment_count + 1)])
      call check_times(given%first, given%times, error)
    end associate
  end subroutine take_given

  !> Code 64 where results are to be put at NULL.
  subroutine check_results(segments, sample_count, error)
    type(segments_t), intent(in) :: segments
    integer, intent(in) :: sample_count
    type(error_t), allocatable, intent(out) :: error
    associate (of => segments)
      call check_pointer('motion', of%motion, sample_count, error)
      if (of%derivatives /= 0) call check_pointer('jacobian', of%jacobian, sample_count, error)
      call check_pointer('impacts', of%impacts, of%segment_count, error)
      call check_pointer('steady', of%steady, of%segment_count, error)
      call check_pointer('reason', of%reason, of%segment_count, error)
      call check_pointer('impact_segment', of%impact_segment, of%impact_capacity, error)
      call check_pointer('impact', of%impact, of%impact_capacity, error)
    end associate
  end subroutine check_results

  !> Code 64 for a pointer that is NULL, or a negative size.
  subroutine check_pointer(name, pointer, size, error)
    character(len=*), intent(in) :: name
    type(c_ptr), intent(in) :: pointer
    integer(c_int), intent(in) :: size
    type(error_t), allocatable, intent(inout) :: error
    if (allocated(error)) return
    if (size < 0) then
      call fail(error, exit_usage, name//': found a negative size')
    else if (size > 0 .and. .not. c_associated(pointer)) then
      call fail(error, exit_usage, name//': found NULL, allowed an array')
    end if
  end subroutine check_pointer

  subroutine fly(self, segments, given, samples, report, error)
    type(model_t), intent(in) :: self
    type(segments_t), intent(in) :: segments
    type(given_t), intent(in) :: given
    type(samples_t), intent(out) :: samples
    type(report_t), intent(out) :: report
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    type(family_t) :: family
    logical :: derivatives
    derivatives = segments%derivatives /= 0
    call check_values(self, given%chosen + 1, given%values, error)
    if (.not. allocated(error)) call check_directions(given%directions, derivatives, error)
    if (.not. allocated(error)) call check_tolerance(segments%tolerance, error)
    if (.not. allocated(error)) call laws_with_force(self, segments%force_interval, given%force, laws, error)
    if (allocated(error)) return
    call prepare_family(laws, model_options(self, segments%tolerance), self%parameters(given%chosen + 1), given%values, &
                        given%directions, derivatives, family, error)
    if (.not. allocated(error)) call check_machine(family, segments, error)
    if (.not. allocated(error)) call check_length(family%machine%period, given%times, error)
    if (allocated(error)) return
    call compute()
    call propagate(family, given%start, given%first, given%times, derivatives, samples, report)
    call computed()
  end subroutine fly

  !> A start has all that the motion depends on. Code 65, or 64 for the wrong number of numbers.
  subroutine check_machine(family, segments, error)
    type(family_t), intent(in) :: family
    type(segments_t), intent(in) :: segments
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: obstacle
    associate (machine => family%machine)
      obstacle = machine%obstacle()
      if (segments%start_numbers /= machine%start_numbers) then
        call fail(error, exit_usage, 'start_numbers: found '//to_text(segments%start_numbers)//', allowed '// &
                  to_text(machine%start_numbers)//' for this machine')
      else if (segments%sample_numbers /= machine%sample_numbers) then
        call fail(error, exit_usage, 'sample_numbers: found '//to_text(segments%sample_numbers)//', allowed '// &
                  to_text(machine%sample_numbers)//' for this machine')
      else if (len(obstacle) > 0) then
        call fail(error, exit_bad_case, obstacle)
      end if
    end associate
  end subroutine check_machine

  !> Impacts beyond the room are left out; contacts are counted from 0 there.
  subroutine hand_out(samples, report, segments)
    type(samples_t), intent(in) :: samples
    type(report_t), intent(in) :: report
    type(segments_t), intent(inout) :: segments
    real(c_double), pointer :: motion(:, :), jacobian(:, :, :), impact(:, :)
    integer(c_int), pointer :: impacts(:), steady(:), reason(:), impact_segment(:)
    integer :: kept
    call c_f_pointer(segments%motion, motion, shape(samples%motion))
    motion = samples%motion
    if (allocated(samples%slope)) then
      call c_f_pointer(segments%jacobian, jacobian, shape(samples%slope))
      jacobian = samples%slope
    end if
    call c_f_pointer(segments%impacts, impacts, [segments%segment_count])
    call c_f_pointer(segments%steady, steady, [segments%segment_count])
    call c_f_pointer(segments%reason, reason, [segments%segment_count])
    impacts = report%impacts
    steady = merge(1, 0, report%steady)
    reason = report%reason
    segments%impact_count = size(report%impact_segment)
    kept = min(segments%impact_count, segments%impact_capacity)
    call c_f_pointer(segments%impact_segment, impact_segment, [kept])
    call c_f_pointer(segments%impact, impact, [impact_numbers, kept])
    impact_segment = report%impact_segment(:kept) - 1
    impact = report%impact(:, :kept)
    impact(impact_contact, :) = impact(impact_contact, :) - 1
  end subroutine hand_out

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

  !> Offsets ascend from 0. Code 64.
  subroutine check_offsets(first, error)
    integer(c_int), intent(in) :: first(:)
    type(error_t), allocatable, intent(out) :: error
    if (first(1) == 0 .and. all(first(2:) >= first(:size(first) - 1))) return
    call fail(error, exit_usage, 'first: offsets must ascend from 0')
  end subroutine check_offsets

  !> Times ascend within each segment from 0 on. Code 64.
  subroutine check_times(first, times, error)
    integer(c_int), intent(in) :: first(:)
    real(wp), intent(in) :: times(:)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: before
    integer :: i, k
    do i = 1, size(first) - 1
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
  end subroutine check_times

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
