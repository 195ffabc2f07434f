! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The functions of include/separatrix.h that find the attractors of a machine and label starts with them.
module c_labels
  use attractors, only: attractor_t
  use basin, only: catalogue_t, label_slices, search_starts
  use c_machine, only: is_start, prepare_machine, prepared_t
  use c_text, only: answer, compute, computed, enter
  use case_setup, only: span_of
  use discover, only: discover_attractors, sort_attractors
  use errors, only: error_t, fail
  use grid, only: grid_t
  use kinds, only: int64, wp
  use model_type, only: model_t
  use motor_choices, only: has_motor
  use point_columns, only: margin_or_infinite, outcome_values, point_values
  use status, only: exit_resumable, exit_usage
  use text, only: to_text
  use trajectories, only: block_size, run_trajectories
  use single_trajectory, only: outcome_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, c_loc, c_null_ptr, c_ptr, c_size_t
  implicit none
  private

  public :: separatrix_catalogue_open, separatrix_catalogue_search, separatrix_catalogue_search_from, separatrix_catalogue_size, &
    separatrix_catalogue_attractor, separatrix_catalogue_number, separatrix_catalogue_free, separatrix_labels, &
    separatrix_labels_from

  !> Numbers of an attractor.
  !> Coordinates of an attractor for which its arrays have room.
  integer, parameter :: room = 16
  integer, parameter :: of_attractor = 23 + 2*room

  !> What a catalogue's handle stands for.
  type :: labeller_t
    type(prepared_t) :: prepared
    type(attractor_t), allocatable :: attractors(:)
  end type labeller_t

contains

  integer(c_int) function separatrix_catalogue_open(model, chosen_count, chosen, values, catalogue, message, message_size) &
      bind(c) result(code)
    type(c_ptr), value :: model
    integer(c_int), value :: chosen_count
    integer(c_int), intent(in) :: chosen(chosen_count)
    real(c_double), intent(in) :: values(chosen_count)
    type(c_ptr), intent(out) :: catalogue
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(model_t), pointer :: self
    type(labeller_t), pointer :: new
    type(error_t), allocatable :: error
    call enter()
    call c_f_pointer(model, self)
    catalogue = c_null_ptr
    allocate (new)
    allocate (new%attractors(0))
    call prepare_machine(self, chosen + 1, values, span_of(self%the_case), .true., new%prepared, error)
    if (allocated(error)) then
      deallocate (new)
    else
      catalogue = c_loc(new)
    end if
    code = answer(error, message, message_size)
  end function separatrix_catalogue_open

  subroutine separatrix_catalogue_free(catalogue) bind(c)
    type(c_ptr), value :: catalogue
    type(labeller_t), pointer :: old
    if (.not. c_associated(catalogue)) return
    call c_f_pointer(catalogue, old)
    deallocate (old)
  end subroutine separatrix_catalogue_free

  integer(c_int) function separatrix_catalogue_search(catalogue, start_count, start, stop_flag, message, message_size) &
      bind(c) result(code)
    type(c_ptr), value :: catalogue, start, stop_flag
    integer(c_int), value :: start_count
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    code = separatrix_catalogue_search_from(catalogue, start_count, 3_c_int, start, stop_flag, message, message_size)
  end function separatrix_catalogue_search

  integer(c_int) function separatrix_catalogue_search_from(catalogue, start_count, start_size, start, stop_flag, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: catalogue, start, stop_flag
    integer(c_int), value :: start_count, start_size
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(labeller_t), pointer :: self
    real(c_double), pointer :: given(:, :)
    real(wp), allocatable :: starts(:, :)
    type(error_t), allocatable :: error
    integer :: i
    call enter()
    call c_f_pointer(catalogue, self)
    associate (prepared => self%prepared, settings => self%prepared%the_case%attractors)
      if (start_count < 0) then
        starts = search_starts(prepared%grid, settings%sample, settings%seed)
      else if (start_count == 0) then
        allocate (starts(3, 0))
      else
        call check_size(self%prepared, start_size, error)
        allocate (starts(3, 0))
        if (.not. allocated(error)) then
          call c_f_pointer(start, given, [start_size, start_count])
          starts = given
        end if
      end if
      do i = 1, size(starts, 2)
        if (asked_to_stop(stop_flag)) then
          call fail(error, exit_resumable, 'stopped while searching for attractors')
          exit
        end if
        if (.not. is_start(prepared, starts(:, i))) cycle
        call compute()
        call discover_attractors(prepared%ensemble%moving, prepared%ensemble%span, starts(:, i:i), settings%max_period, &
                                 self%attractors)
        call computed()
      end do
    end associate
    call sort_attractors(self%attractors)
    code = answer(error, message, message_size)
  end function separatrix_catalogue_search_from

  !> A start is 3 numbers; of a motor also 5. Code 64.
  subroutine check_size(prepared, start_size, error)
    type(prepared_t), intent(in) :: prepared
    integer(c_int), intent(in) :: start_size
    type(error_t), allocatable, intent(out) :: error
    if (start_size == 3) return
    if (has_motor(prepared%the_case%laws)) then
      if (start_size /= 5) call fail(error, exit_usage, 'start_size: found '//to_text(int(start_size))// &
                                     ', allowed with a motor 3, 5')
    else
      call fail(error, exit_usage, 'start_size: found '//to_text(int(start_size))//', allowed without a motor 3')
    end if
  end subroutine check_size

  !> Whether the flag of the caller, who may set it from another thread, is not 0.
  logical function asked_to_stop(stop_flag)
    type(c_ptr), intent(in) :: stop_flag
    integer(c_int), pointer, volatile :: flag
    asked_to_stop = .false.
    if (.not. c_associated(stop_flag)) return
    call c_f_pointer(stop_flag, flag)
    asked_to_stop = flag /= 0
  end function asked_to_stop

  integer(c_int) function separatrix_catalogue_size(catalogue) bind(c) result(count)
    type(c_ptr), value :: catalogue
    type(labeller_t), pointer :: self
    call c_f_pointer(catalogue, self)
    count = size(self%attractors)
  end function separatrix_catalogue_size

  integer(c_int) function separatrix_catalogue_attractor(catalogue, index, numbers, point_capacity, point_count, points, &
      message, message_size) bind(c) result(code)
    type(c_ptr), value :: catalogue
    integer(c_int), value :: index, point_capacity
    real(c_double), intent(out) :: numbers(of_attractor), points(room, point_capacity)
    integer(c_int), intent(out) :: point_count
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(labeller_t), pointer :: self
    type(error_t), allocatable :: error
    integer :: shown
    call enter()
    call c_f_pointer(catalogue, self)
    numbers = 0
    points = ieee_value(1.0_wp, ieee_quiet_nan)
    point_count = 0
    if (index < 0 .or. index >= size(self%attractors)) then
      call fail(error, exit_usage, 'attractor: found '//to_text(int(index))//', allowed 0 to '//to_text(size(self%attractors) - 1))
    else if (self%attractors(index + 1)%coordinates > room) then
      call fail(error, exit_usage, 'attractor: found '//to_text(self%attractors(index + 1)%coordinates)// &
                ' coordinates on the section, allowed at most '//to_text(room))
    else
      associate (one => self%attractors(index + 1), f => self%attractors(index + 1)%features)
        numbers = [real(one%id, wp), real(f%regime, wp), real(one%period, wp), real(f%word, wp), one%section, one%multiplier, &
                   one%capture_radius, f%amplitude, f%x_max, f%x_min, f%v_max, f%impacts_per_period, f%mean_impact_speed, &
                   margin_or_infinite(f%grazing_margin), merge(1.0_wp, 0.0_wp, one%rests), merge(1.0_wp, 0.0_wp, &
                   one%any_position), &
                   real(one%coordinates, wp), merge(1.0_wp, 0.0_wp, self%prepared%ensemble%moving%has_driver), &
                   real(one%kind, wp), one%duration, real(one%multipliers(:room)), aimag(one%multipliers(:room))]
        if (.not. one%rests) point_count = merge(2, one%period, one%period == 0)
        shown = min(point_count, point_capacity)
        points(:one%coordinates, :shown) = one%points(:one%coordinates, :shown)
      end associate
    end if
    code = answer(error, message, message_size)
  end function separatrix_catalogue_attractor

  integer(c_int) function separatrix_catalogue_number(count, catalogues, axis_count, shape, message, message_size) bind(c) &
      result(code)
    integer(c_int), value :: count, axis_count
    type(c_ptr), intent(in) :: catalogues(count)
    integer(c_int), intent(in) :: shape(axis_count)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(error_t), allocatable :: error
    type(catalogue_t), allocatable :: slices(:)
    type(labeller_t), pointer :: one
    type(grid_t) :: grid
    integer :: i
    call enter()
    if (product(int(shape, int64)) /= count .or. any(shape < 1)) then
      call fail(error, exit_usage, 'shape: allowed '//to_text(int(count))//' slices in all')
    else
      grid%shape = shape
      grid%parameter_axes = [(i, i=1, axis_count)]
      grid%slices = count
      allocate (slices(count))
      do i = 1, count
        call c_f_pointer(catalogues(i), one)
        slices(i)%attractors = one%attractors
      end do
      call label_slices(grid, slices)
      do i = 1, count
        call c_f_pointer(catalogues(i), one)
        one%attractors%id = slices(i)%attractors%id
      end do
    end if
    code = answer(error, message, message_size)
  end function separatrix_catalogue_number

  integer(c_int) function separatrix_labels(catalogue, start_count, start, values, stop_flag, message, message_size) bind(c) &
      result(code)
    type(c_ptr), value :: catalogue, stop_flag
    integer(c_int), value :: start_count
    real(c_double), intent(in) :: start(3, start_count)
    real(c_double), intent(inout) :: values(point_values, start_count)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    code = separatrix_labels_from(catalogue, start_count, 3_c_int, start, values, stop_flag, message, message_size)
  end function separatrix_labels

  integer(c_int) function separatrix_labels_from(catalogue, start_count, start_size, start, values, stop_flag, message, &
      message_size) bind(c) result(code)
    type(c_ptr), value :: catalogue, stop_flag
    integer(c_int), value :: start_count, start_size
    real(c_double), intent(in) :: start(start_size, start_count)
    real(c_double), intent(inout) :: values(point_values, start_count)
    character(kind=c_char), intent(inout) :: message(*)
    integer(c_size_t), value :: message_size
    type(labeller_t), pointer :: self
    type(error_t), allocatable :: error
    integer :: first, last, points
    call enter()
    call c_f_pointer(catalogue, self)
    points = block_size(self%prepared%ensemble)
    call check_size(self%prepared, start_size, error)
    last = merge(start_count, 0_c_int, allocated(error))
    do while (last < start_count)
      first = last + 1
      last = min(last + points, start_count)
      if (asked_to_stop(stop_flag)) then
        values(:, first:) = 0
        call fail(error, exit_resumable, 'stopped after '//to_text(first - 1)//' of '//to_text(int(start_count))//' starts')
        exit
      end if
      call compute()
      call label_block(self, start(:, first:last), values(:, first:last))
      call computed()
    end do
    code = answer(error, message, message_size)
  end function separatrix_labels_from

  !> Values of a few starts, in the order of the file; all 0 where a start is not allowed.
  subroutine label_block(self, starts, values)
    type(labeller_t), intent(in) :: self
    real(wp), intent(in) :: starts(:, :)
    real(wp), intent(inout) :: values(:, :)
    type(outcome_t) :: outcomes(size(starts, 2))
    integer, allocatable :: allowed(:)
    integer :: i
    allowed = pack([(i, i=1, size(starts, 2))], [(is_start(self%prepared, starts(:, i)), i=1, size(starts, 2))])
    call run_trajectories(self%prepared%ensemble, self%attractors, starts(:, allowed), outcomes(:size(allowed)))
    values = 0
    do i = 1, size(allowed)
      values(:, allowed(i)) = outcome_values(outcomes(i))
    end do
  end subroutine label_block

end module c_labels
