! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h that fly segments of structures, coordinate by coordinate.
module c_coordinates
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_f_pointer, c_int, c_ptr, c_size_t
  use build_motion, only: bodies_of, has_several
  use c_segments, only: check_directions, check_length, check_samples, check_tolerance
  use c_text, only: answer, to_c
  use coordinate_segments, only: coordinate_report_t, coordinate_samples_t, propagate_coordinates
  use errors, only: error_t, fail
  use multibody, only: integral_of, is_stop, multibody_t
  use multibody_machine, only: multibody_machine_t
  use kinds, only: wp
  use model_type, only: check_values, model_options, model_t
  use status, only: exit_bad_case, exit_usage
  use text, only: to_text
  use timed_actions, only: acts_on_time
  use variants, only: family_t, prepare_family
  implicit none
  private

  public :: separatrix_coordinate, separatrix_coordinate_segments, separatrix_contact

contains

  integer(c_int) function separatrix_coordinate(model, index, name, name_size, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: index
    character(kind=c_char), intent(inout) :: name(*), message(*)
    integer(c_size_t), value :: name_size, message_size
    type(error_t), allocatable :: error
    type(multibody_t) :: machine
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
    if (.not. has_several(self%the_case%laws)) return
    call bodies_of(self%the_case%laws, model_options(self, self%the_case%integrator%tolerance), several, error)
    if (.not. allocated(error)) machine = several%bodies%machine
  end subroutine build

  integer(c_int) function separatrix_coordinate_segments(model, chosen_count, chosen, values, direction_count, directions, &
      segment_count, coordinate_count, start, first, times, derivatives, tolerance, motion, jacobian, impacts, steady, reason, &
      impact_capacity, impact_count, impact_segment, impact, message, message_size) bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count, direction_count, segment_count, coordinate_count, derivatives, impact_capacity
    integer(c_int), intent(in) :: chosen(chosen_count), first(segment_count + 1)
    real(c_double), value :: tolerance
    real(c_double), intent(in) :: values(chosen_count), start(2*coordinate_count + 1, segment_count), times(*)
    real(c_double), intent(in) :: directions(chosen_count, direction_count)
    real(c_double), intent(inout) :: motion(2*coordinate_count, *)
    real(c_double), intent(inout) :: jacobian(direction_count + 2*coordinate_count + 1, 2*coordinate_count, *)
    integer(c_int), intent(inout) :: impacts(segment_count), steady(segment_count), reason(segment_count)
    integer(c_int), intent(out) :: impact_count
    integer(c_int), intent(inout) :: impact_segment(impact_capacity)
    real(c_double), intent(inout) :: impact(5, impact_capacity)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(error_t), allocatable :: error
    type(coordinate_samples_t) :: samples
    type(coordinate_report_t) :: report
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
      ! They are counted from 0 there.
      impact(2, :kept) = impact(2, :kept) - 1
    end if
    code = answer(error, message, message_size)
  end function separatrix_coordinate_segments

  subroutine fly(self, chosen, values, directions, start, first, times, derivatives, tolerance, samples, report, error)
    type(model_t), intent(in) :: self
    integer, intent(in) :: chosen(:), first(:)
    real(wp), intent(in) :: values(:), directions(:, :), start(:, :), times(:), tolerance
    logical, intent(in) :: derivatives
    type(coordinate_samples_t), intent(out) :: samples
    type(coordinate_report_t), intent(out) :: report
    type(error_t), allocatable, intent(out) :: error
    type(family_t) :: family
    type(multibody_t) :: machine
    call check_values(self, chosen, values, error)
    if (.not. allocated(error)) call check_directions(directions, derivatives, error)
    if (.not. allocated(error)) call check_tolerance(tolerance, error)
    if (allocated(error)) return
    call prepare_family(self%the_case%laws, model_options(self, tolerance), self%parameters(chosen), values, directions, &
                        derivatives, family, error)
    if (allocated(error)) return
    if (allocated(family%driven)) then
      call fail(error, exit_bad_case, 'motor: found a machine with a motor, whose segments separatrix_crank_segments flies')
      return
    else if (.not. allocated(family%bodies)) then
      call fail(error, exit_bad_case, 'body.law: found "'//trim(self%the_case%laws(1)%name)//'", allowed for segments of '// &
                'coordinates structure')
      return
    end if
    machine = family%bodies%machine
    call check_machine(machine, size(start, 1) - 1, error)
    if (.not. allocated(error)) call check_length(machine%period, times, error)
    if (.not. allocated(error)) call propagate_coordinates(family, start, first, times, derivatives, samples, report)
  end subroutine fly

  !> A start has all that the motion depends on. Code 65, or 64 for the wrong number of coordinates.
  subroutine check_machine(machine, rows, error)
    type(multibody_t), intent(in) :: machine
    integer, intent(in) :: rows
    type(error_t), allocatable, intent(out) :: error
    if (rows /= 2*machine%n) then
      call fail(error, exit_usage, 'coordinate_count: found '//to_text(rows/2)//', the structure has '//to_text(machine%n))
    else if (runs_on(machine)) then
      call fail(error, exit_bad_case, 'drive: found a stop that runs on, which no start of a segment states')
    else if (acts_on_time(machine)) then
      call fail(error, exit_bad_case, 'drive: found impulses, or samples of a controller, at times of their own: segments '// &
                'have other starts')
    else if (integral_of(machine) > 0) then
      call fail(error, exit_bad_case, 'drive: found a controller that adds up what it sees, which no start of a segment states')
    end if
  end subroutine check_machine

  !> Whether stops of two bodies move on for ever.
  pure logical function runs_on(machine)
    type(multibody_t), intent(in) :: machine
    runs_on = .false.
    if (allocated(machine%driver)) runs_on = abs(machine%driver%stops_run) > 0
  end function runs_on

end module c_coordinates
