! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The readers as one C function for fuzz_readers.cpp: bytes or a file in, exit code and length of the message out.
module fuzz_targets
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t
  use case_reader, only: load_case_text
  use case_setup, only: grid_of
  use case_type, only: case_t
  use command_line, only: command_t
  use contact_law, only: contact_t
  use errors, only: error_t, fail
  use force_record, only: read_force
  use grid, only: grid_t, slice_motion
  use hdf5, only: h5close_f
  use info_driver, only: run_info
  use kinds, only: int64, wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t
  use map_file, only: create_working, map_file_t, open_working
  use map_schema, only: schema_t, type_float32, type_int8
  use point_list, only: point_list_t, read_point_list
  use serial_team, only: serial_team_t
  use status, only: exit_bad_case
  use verify_driver, only: run_verify
  implicit none
  private

  integer, parameter :: target_case = 0, target_override = 1, target_points = 2, target_info = 3, target_verify = 4, &
    target_resume = 5, target_force = 6

  !> The case that overrides are put on.
  character(len=*), parameter :: nl = new_line('a')
  character(len=*), parameter :: base_case = '[body]'//nl//'mass = 1'//nl//'[restoring]'//nl//'law = "linear"'//nl// &
    'stiffness = 88.8'//nl//'free_length = 0.4'//nl//'[friction]'//nl//'law = "coulomb"'//nl// &
    'kinetic_coefficient = 0.2'//nl//'[contact]'//nl//'law = "newton"'//nl//'restitution = 0.5'//nl//'upper = 1.1'//nl// &
    '[drive]'//nl//'law = "fourier"'//nl//'ratio = 1.2'//nl//'mean = 0.3'//nl//'cosine = [0.09]'//nl//'sine = [0.0]'//nl// &
    '[[axis]]'//nl//'name = "x0"'//nl//'from = 0'//nl//'to = 1'//nl//'count = 5'//nl//'[[axis]]'//nl//'name = "v0"'//nl// &
    'values = [0, 1]'//nl

contains

  !> Runs the reader `which` on `length` bytes; the readers of files find them in `path`.
  subroutine fuzz_target(which, bytes, length, path, path_length, code, message_length) bind(c)
    integer(c_int), value :: which
    integer(c_int64_t), value :: length, path_length
    character(kind=c_char), intent(in) :: bytes(length), path(path_length)
    integer(c_int), intent(out) :: code, message_length
    type(error_t), allocatable :: error
    integer :: ignored
    select case (which)
    case (target_case)
      call read_case(text_of(bytes), error)
    case (target_override)
      call read_override(text_of(bytes), error)
    case (target_points)
      call read_points(text_of(path), error)
    case (target_info)
      call run_info(text_of(path), .true., error)
    case (target_verify)
      call read_verify(text_of(path), error)
    case (target_resume)
      call read_working(text_of(path), error)
    case (target_force)
      call read_forces(text_of(path), error)
    end select
    ! After an error the program ends, and leaves objects open that would keep the next file from being read anew.
    if (which >= target_info .and. which <= target_resume) call h5close_f(ignored)
    code = 0
    message_length = 0
    if (.not. allocated(error)) return
    code = error%code
    message_length = len(error%message)
  end subroutine fuzz_target

  !> A case as the map commands take it: read, checked, and the machine of its first slice built.
  subroutine read_case(text, error)
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=1) :: no_overrides(0)
    type(case_t) :: the_case
    call load_case_text(text, 'case.toml', no_overrides, the_case, error)
    if (.not. allocated(error)) call build_machine(the_case, error)
  end subroutine read_case

  subroutine build_machine(the_case, error)
    type(case_t), intent(in) :: the_case
    type(error_t), allocatable, intent(out) :: error
    type(grid_t) :: grid
    class(machine_t), allocatable :: moving
    grid = grid_of(the_case, the_case%axes)
    call slice_motion(grid, 0_int64, moving, error)
  end subroutine build_machine

  subroutine read_override(text, error)
    character(len=*), intent(in) :: text
    type(error_t), allocatable, intent(out) :: error
    type(case_t) :: the_case
    call load_case_text(base_case, 'case.toml', [text], the_case, error)
    if (.not. allocated(error)) call build_machine(the_case, error)
  end subroutine read_override

  subroutine read_points(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(point_list_t) :: list
    type(contact_t) :: contact
    type(law_choice_t) :: laws(0)
    contact%upper = 1.1_wp
    call read_point_list(path, 1.2_wp, contact, laws, list, error)
  end subroutine read_points

  !> The record of a force, as a case names it.
  subroutine read_forces(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: interval
    real(wp), allocatable :: force(:)
    character(len=:), allocatable :: problem
    call read_force(path, 'force', interval, force, problem)
    if (allocated(problem)) call fail(error, exit_bad_case, problem)
  end subroutine read_forces

  subroutine read_verify(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(command_t) :: command
    command%name = 'verify'
    command%path = path
    command%sample = 1
    command%quiet = .true.
    command%json = .true.
    call run_verify(command, error)
  end subroutine read_verify

  !> A working file is resumed: opened, rechecked, and the tiles that count as done are read.
  subroutine read_working(part, error)
    character(len=*), intent(in) :: part
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(map_file_t) :: file
    type(serial_team_t) :: alone
    real(wp), allocatable :: values(:, :)
    integer :: tile
    call open_working(part(:len(part) - len('.part')), small_schema(), ['x0', 'v0'], [2_int64, 3_int64], alone, file, error)
    if (.not. allocated(error)) then
      do tile = 1, file%tile_count()
        if (file%tile_done(tile)) call file%read_tile(tile, values, error)
        if (allocated(error)) exit
      end do
    end if
    call file%close(alone, ignored)
  end subroutine read_working

  !> Writes a working file with some tiles done, to be resumed.
  subroutine fuzz_make_working(path, path_length) bind(c)
    integer(c_int64_t), value :: path_length
    character(kind=c_char), intent(in) :: path(path_length)
    type(error_t), allocatable :: error
    type(map_file_t) :: file
    type(serial_team_t) :: alone
    real(wp) :: values(6, 2)
    integer :: tile, i
    call create_working(text_of(path), small_schema(), ['x0', 'v0'], [2_int64, 3_int64], .true., alone, file, error)
    values = reshape([(real(modulo(i, 6), wp), i=1, 12)], [6, 2])
    do tile = 1, 4
      if (.not. allocated(error)) call file%write_tile(tile, values, error)
    end do
    if (.not. allocated(error)) call file%close(alone, error)
    if (allocated(error)) error stop 'fuzz_make_working'
  end subroutine fuzz_make_working

  function small_schema() result(schema)
    type(schema_t) :: schema
    integer :: i
    call schema%add_attribute('', 'format', 'separatrix')
    call schema%add_attribute('provenance', 'case_identity', 'basin 0123456789abcdef')
    call schema%add_attribute('provenance', 'case_text', base_case)
    call schema%add_dimension('x0', 8_int64)
    call schema%add_dimension('v0', 6_int64)
    call schema%add_variable('x0', type_float32, ['x0'], units='m', data=[(0.1_wp*i, i=0, 7)])
    call schema%add_variable('regime', type_int8, ['x0', 'v0'], units='1', flag_values=[0, 1], flag_meanings='a b', tiled=.true.)
    call schema%add_variable('x_max', type_float32, ['x0', 'v0'], units='m', tiled=.true.)
  end function small_schema

  function text_of(bytes) result(text)
    character(kind=c_char), intent(in) :: bytes(:)
    character(len=:), allocatable :: text
    integer :: i
    allocate (character(len=size(bytes)) :: text)
    do i = 1, size(bytes)
      text(i:i) = bytes(i)
    end do
  end function text_of

end module fuzz_targets
