! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A structure in an HDF5 file (docs/structure-files.md): the group /structure with mass, stiffness and damping, or frequency,
!> damping_ratio and damping, and a row for each named point in /structure/point.
module structure_file
  use constants, only: pi
  use errors, only: error_t
  use kinds, only: int64, real64
  use map_reader, only: open_reader, reader_t
  use status, only: exit_no_input
  use structure_data, only: most_file_coordinates, point_name_length, structure_data_t
  use text, only: to_text
  implicit none
  private

  public :: read_structure_file

  character(len=*), parameter :: group = '/structure', points = group//'/point'

contains

  !> Reads the file; see `structure_file_reader`. Frequencies are in Hz unless their attribute `units` is rad/s.
  subroutine read_structure_file(path, content, problem, missing)
    character(len=*), intent(in) :: path
    type(structure_data_t), intent(out) :: content
    character(len=:), allocatable, intent(out) :: problem
    logical, intent(out) :: missing
    type(reader_t) :: reader
    type(error_t), allocatable :: error, ignored
    integer :: n
    call open_reader(path, 'an HDF5 file with the group '//group, reader, error)
    missing = .false.
    if (allocated(error)) then
      missing = error%code == exit_no_input
      problem = error%message
      return
    end if
    if (.not. reader%has(group)) then
      problem = 'found no group '//group//', allowed a file of separatrix-structure'
    else if (reader%has(group//'/frequency')) then
      call read_modes(reader, content, n, problem)
    else
      call read_matrices(reader, content, n, problem)
    end if
    if (.not. allocated(problem)) call read_points(reader, n, content, problem)
    call reader%close(ignored)
    if (allocated(problem)) problem = path//': '//problem
  end subroutine read_structure_file

  subroutine read_matrices(reader, content, n, problem)
    type(reader_t), intent(in) :: reader
    type(structure_data_t), intent(inout) :: content
    integer, intent(out) :: n
    character(len=:), allocatable, intent(out) :: problem
    n = 0
    call read_square(reader, 'mass', n, content%mass, problem)
    if (.not. allocated(problem)) call read_square(reader, 'stiffness', n, content%stiffness, problem)
    if (allocated(problem)) return
    if (reader%has(group//'/damping')) call read_square(reader, 'damping', n, content%damping, problem)
  end subroutine read_matrices

  subroutine read_modes(reader, content, n, problem)
    type(reader_t), intent(in) :: reader
    type(structure_data_t), intent(inout) :: content
    integer, intent(out) :: n
    character(len=:), allocatable, intent(out) :: problem
    character(len=*), parameter :: name = group//'/frequency'
    type(error_t), allocatable :: error
    character(len=:), allocatable :: units
    n = 0
    call read_list(reader, 'frequency', n, content%frequency, problem)
    if (allocated(problem)) return
    units = 'Hz'
    if (reader%has_attribute(name, 'units')) call reader%text_attribute(name, 'units', units, error)
    if (units == 'Hz') then
      content%frequency = 2*pi*content%frequency
    else if (units /= 'rad/s') then
      problem = name//': found the units '''//units//''', allowed Hz, rad/s'
      return
    end if
    if (reader%has(group//'/damping_ratio')) call read_list(reader, 'damping_ratio', n, content%damping_ratio, problem)
    if (allocated(problem)) return
    if (reader%has(group//'/damping')) call read_square(reader, 'damping', n, content%damping, problem)
  end subroutine read_modes

  !> Points: a row of as many numbers as there are coordinates each.
  subroutine read_points(reader, n, content, problem)
    type(reader_t), intent(in) :: reader
    integer, intent(in) :: n
    type(structure_data_t), intent(inout) :: content
    character(len=:), allocatable, intent(out) :: problem
    type(error_t), allocatable :: error
    character(len=:), allocatable :: names(:)
    logical, allocatable :: are_groups(:)
    real(real64), allocatable :: row(:)
    integer :: i, length
    allocate (content%point_names(0), content%rows(0, n))
    if (.not. reader%has(points)) return
    call reader%children(points, names, are_groups, error)
    if (allocated(error)) then
      problem = error%message
      return
    end if
    deallocate (content%rows)
    allocate (content%rows(size(names), n))
    do i = 1, size(names)
      if (len_trim(names(i)) > point_name_length) then
        problem = points//': found the name '''//trim(names(i))//''', allowed up to '//to_text(point_name_length)//' letters'
        return
      end if
      length = n
      call read_list(reader, 'point/'//trim(names(i)), length, row, problem)
      if (allocated(problem)) return
      content%rows(i, :) = row
    end do
    content%point_names = names
  end subroutine read_points

  !> A list of `n` finite numbers; of any length if n is 0, which is then set.
  subroutine read_list(reader, name, n, values, problem)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: name
    integer, intent(inout) :: n
    real(real64), allocatable, intent(out) :: values(:)
    character(len=:), allocatable, intent(out) :: problem
    call read_shape(reader, name, 1, n, values, problem)
  end subroutine read_list

  !> A square matrix of `n` rows; of any size if n is 0, which is then set.
  subroutine read_square(reader, name, n, matrix, problem)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: name
    integer, intent(inout) :: n
    real(real64), allocatable, intent(out) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    real(real64), allocatable :: values(:)
    call read_shape(reader, name, 2, n, values, problem)
    if (.not. allocated(problem)) matrix = transpose(reshape(values, [n, n]))
  end subroutine read_square

  subroutine read_shape(reader, name, rank, n, values, problem)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: name
    integer, intent(in) :: rank
    integer, intent(inout) :: n
    real(real64), allocatable, intent(out) :: values(:)
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: path
    integer(int64), allocatable :: lengths(:)
    type(error_t), allocatable :: error
    integer :: i
    path = group//'/'//name
    if (.not. reader%has(path)) then
      problem = path//': missing'
      return
    end if
    call reader%lengths(path, lengths, error)
    if (.not. allocated(error)) then
      if (n == 0 .and. size(lengths) == rank .and. size(lengths) > 0) n = int(min(lengths(1), huge(n)*1_int64))
      if (size(lengths) /= rank) then
        problem = path//': found '//to_text(size(lengths))//' dimensions, allowed '//to_text(rank)
      else if (any(lengths /= n)) then
        problem = path//': found '//to_text(lengths(1))
        do i = 2, rank
          problem = problem//' x '//to_text(lengths(i))
        end do
        problem = problem//' numbers, allowed '//to_text(n)//repeat(' x '//to_text(n), rank - 1)
      else if (n < 1 .or. n > most_file_coordinates) then
        problem = path//': found '//to_text(n)//' coordinates, allowed 1 to '//to_text(most_file_coordinates)// &
                  ': separatrix-structure reduces a larger model'
      end if
      if (allocated(problem)) return
      call reader%read_values(path, values, error)
    end if
    if (allocated(error)) then
      problem = error%message
    else if (.not. all(abs(values) <= huge(values))) then
      problem = path//': found a number that is not finite'
    end if
  end subroutine read_shape

end module structure_file
