! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Square real matrices in the Matrix Market exchange format (Boisvert, Pozo, Remington, NISTIR 5935, 1996): coordinate or array,
!> general, symmetric or skew-symmetric. The Python package reads them by the same rules (structures/matrix_market.py).
module matrix_market
  use errors, only: error_t
  use kinds, only: int64, real64
  use status, only: exit_no_input
  use structure_data, only: most_file_coordinates
  use text, only: parse_integer, parse_number, replace_all, split, starts_with, to_text
  use toml_bindings, only: read_text_file
  implicit none
  private

  public :: read_matrix_market

  !> Where the reader is.
  type :: cursor_t
    !> `line` is nothing at the end of the file.
    character(len=:), allocatable :: text, line
    integer(int64) :: from = 1
    integer :: number = 0
  end type cursor_t

  !> Contents of the first line.
  type :: header_t
    !> Entries come with row and column; they are whole numbers.
    logical :: coordinate, whole
    character(len=16) :: symmetry
  end type header_t

  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

contains

  !> The matrix of the file `path`. `problem` is allocated if there is one, and names the line, what was found and what is
  !> allowed; `missing`: the file cannot be read.
  subroutine read_matrix_market(path, matrix, problem, missing)
    character(len=*), intent(in) :: path
    real(real64), allocatable, intent(out) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    logical, intent(out) :: missing
    type(cursor_t) :: cursor
    type(error_t), allocatable :: error
    type(header_t) :: header
    integer :: sizes(3)
    call read_text_file(path, cursor%text, error)
    missing = .false.
    if (allocated(error)) then
      missing = error%code == exit_no_input
      problem = error%message
      return
    end if
    if (starts_with(cursor%text, byte_order_mark)) cursor%from = 1 + len(byte_order_mark)
    call read_header(cursor, header, problem)
    if (.not. allocated(problem)) call read_sizes(cursor, header%coordinate, sizes, problem)
    if (.not. allocated(problem)) then
      allocate (matrix(sizes(1), sizes(1)), source=0.0_real64)
      if (header%coordinate) then
        call read_coordinates(cursor, header, sizes(3), matrix, problem)
      else
        call read_array(cursor, header, matrix, problem)
      end if
    end if
    if (.not. allocated(problem)) then
      if (next_line(cursor)) problem = 'found '//shown(cursor)//', allowed nothing after the last number'
    end if
    if (allocated(problem)) problem = path//':'//to_text(cursor%number)//': '//problem
  end subroutine read_matrix_market

  !> Goes to the next line that has something; comments are passed over.
  logical function next_line(cursor)
    type(cursor_t), intent(inout) :: cursor
    integer(int64) :: length
    next_line = .false.
    do while (cursor%from <= len(cursor%text, int64))
      length = index(cursor%text(cursor%from:), new_line('a'), kind=int64) - 1
      if (length < 0) length = len(cursor%text, int64) - cursor%from + 1
      cursor%line = replace_all(cursor%text(cursor%from:cursor%from + length - 1), achar(13), '')
      cursor%line = trim(adjustl(replace_all(cursor%line, achar(9), ' ')))
      cursor%from = cursor%from + length + 1
      cursor%number = cursor%number + 1
      next_line = len(cursor%line) > 0 .and. (cursor%number == 1 .or. .not. starts_with(cursor%line, '%'))
      if (next_line) return
    end do
    if (allocated(cursor%line)) deallocate (cursor%line)
  end function next_line

  subroutine read_header(cursor, header, problem)
    type(cursor_t), intent(inout) :: cursor
    type(header_t), intent(out) :: header
    character(len=:), allocatable, intent(out) :: problem
    character(len=*), parameter :: allowed = ', allowed ''%%MatrixMarket matrix coordinate|array real|double|integer '// &
      'general|symmetric|skew-symmetric'''
    character(len=:), allocatable :: words(:)
    integer :: count
    count = 0
    if (next_line(cursor)) then
      allocate (character(len=len(cursor%line)) :: words(5))
      call split(lower(cursor%line), words, count)
    end if
    if (count == 5) then
      header = header_t(words(3) == 'coordinate', words(4) == 'integer', words(5))
      if (words(1) == '%%matrixmarket' .and. words(2) == 'matrix' .and. any(words(3) == ['coordinate', 'array     ']) .and. &
          any(words(4) == ['real   ', 'double ', 'integer']) .and. &
          any(words(5) == ['general       ', 'symmetric     ', 'skew-symmetric'])) return
    end if
    problem = 'found '//shown(cursor)//allowed
  end subroutine read_header

  !> Rows, columns and, of a list of coordinates, entries.
  subroutine read_sizes(cursor, coordinate, sizes, problem)
    type(cursor_t), intent(inout) :: cursor
    logical, intent(in) :: coordinate
    integer, intent(out) :: sizes(3)
    character(len=:), allocatable, intent(out) :: problem
    logical :: good
    sizes = 0
    good = next_line(cursor)
    if (good) call take_integers(cursor%line, 0, sizes(:merge(3, 2, coordinate)), good)
    if (.not. good .or. any(sizes < 0)) then
      problem = 'found '//shown(cursor)//', allowed the numbers of rows and columns'
      if (coordinate) problem = problem//' and entries'
    else if (sizes(1) /= sizes(2) .or. sizes(1) < 1 .or. sizes(1) > most_file_coordinates) then
      problem = 'found '//to_text(sizes(1))//' rows and '//to_text(sizes(2))//' columns, allowed as many of both, at most '// &
                to_text(most_file_coordinates)//': separatrix-structure reduces a larger model'
    end if
  end subroutine read_sizes

  !> Takes the whole numbers that a line begins with; `more` words follow them, and nothing else.
  pure subroutine take_integers(line, more, numbers, good)
    character(len=*), intent(in) :: line
    integer, intent(in) :: more
    integer, intent(inout) :: numbers(:)
    logical, intent(out) :: good
    character(len=len(line)) :: words(size(numbers))
    integer :: i, count, status
    call split(line, words, count)
    good = count == size(numbers) + more
    do i = 1, size(numbers)
      if (.not. good) exit
      call parse_integer(trim(words(i)), numbers(i), status)
      good = status == 0
    end do
  end subroutine take_integers

  !> Takes the number at the end of a line.
  pure subroutine take_value(line, whole, value, good)
    character(len=*), intent(in) :: line
    logical, intent(in) :: whole
    real(real64), intent(out) :: value
    logical, intent(out) :: good
    character(len=:), allocatable :: word
    integer :: status
    word = line(index(line, ' ', back=.true.) + 1:)
    call parse_number(word, value, status)
    good = status == 0
    if (whole) good = good .and. verify(word, '+-0123456789') == 0
  end subroutine take_value

  subroutine read_coordinates(cursor, header, entries, matrix, problem)
    type(cursor_t), intent(inout) :: cursor
    type(header_t), intent(in) :: header
    integer, intent(in) :: entries
    real(real64), intent(inout) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    logical :: given(size(matrix, 1), size(matrix, 2)), good
    real(real64) :: value
    integer :: i, at(2)
    given = .false.
    do i = 1, entries
      at = 0
      good = next_line(cursor)
      if (good) call take_integers(cursor%line, 1, at, good)
      if (good) call take_value(cursor%line, header%whole, value, good)
      if (.not. good .or. minval(at) < 1 .or. maxval(at) > size(matrix, 1)) then
        problem = 'found '//to_text(i - 1)//' entries and then '//shown(cursor)//', allowed '//to_text(entries)// &
                  ' lines of row, column and number, up to '//to_text(size(matrix, 1))//number_rule(header)
      else if (given(at(1), at(2))) then
        problem = 'found '//shown(cursor)//', this row and column again'
        if (header%symmetry /= 'general') problem = problem//' ('//trim(header%symmetry)//': one triangle is the whole)'
        problem = problem//', allowed each entry once'
      else if (header%symmetry == 'skew-symmetric' .and. at(1) == at(2) .and. abs(value) > 0) then
        problem = 'found '//shown(cursor)//' on the diagonal of a skew-symmetric matrix, allowed 0'
      end if
      if (allocated(problem)) return
      call put(matrix, at(1), at(2), header%symmetry, value)
      given(at(1), at(2)) = .true.
      if (header%symmetry /= 'general') given(at(2), at(1)) = .true.
    end do
  end subroutine read_coordinates

  !> Column by column; of a symmetric matrix the lower triangle.
  subroutine read_array(cursor, header, matrix, problem)
    type(cursor_t), intent(inout) :: cursor
    type(header_t), intent(in) :: header
    real(real64), intent(inout) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    integer :: none(0)
    real(real64) :: value
    logical :: good
    integer :: row, column, first
    do column = 1, size(matrix, 2)
      first = 1
      if (header%symmetry == 'symmetric') first = column
      if (header%symmetry == 'skew-symmetric') first = column + 1
      do row = first, size(matrix, 1)
        good = next_line(cursor)
        if (good) call take_integers(cursor%line, 1, none, good)
        if (good) call take_value(cursor%line, header%whole, value, good)
        if (.not. good) then
          problem = 'found '//shown(cursor)//', allowed a number for row '//to_text(row)//' of column '// &
                    to_text(column)//', one a line'//number_rule(header)
          return
        end if
        call put(matrix, row, column, header%symmetry, value)
      end do
    end do
  end subroutine read_array

  !> How a number is written, for messages.
  pure function number_rule(header) result(rule)
    type(header_t), intent(in) :: header
    character(len=:), allocatable :: rule
    rule = ' (finite, with a decimal point: 2.75, 2.5e3, 2.5D+03)'
    if (header%whole) rule = ' (whole, as the header states integer)'
  end function number_rule

  pure subroutine put(matrix, row, column, symmetry, value)
    real(real64), intent(inout) :: matrix(:, :)
    integer, intent(in) :: row, column
    character(len=*), intent(in) :: symmetry
    real(real64), intent(in) :: value
    matrix(row, column) = matrix(row, column) + value
    if (row == column .or. symmetry == 'general') return
    matrix(column, row) = matrix(column, row) + merge(value, -value, symmetry == 'symmetric')
  end subroutine put

  pure function lower(word) result(small)
    character(len=*), intent(in) :: word
    character(len=len(word)) :: small
    integer :: i
    small = word
    do i = 1, len(word)
      if (word(i:i) >= 'A' .and. word(i:i) <= 'Z') small(i:i) = achar(iachar(word(i:i)) + 32)
    end do
  end function lower

  !> The beginning of the line, or that there is none, for messages.
  pure function shown(cursor) result(text)
    type(cursor_t), intent(in) :: cursor
    character(len=:), allocatable :: text
    integer :: i
    if (.not. allocated(cursor%line)) then
      text = 'the end of the file'
      return
    end if
    text = trim(cursor%line(:min(len(cursor%line), 60)))
    do i = 1, len(text)
      if (iachar(text(i:i)) < 32 .or. iachar(text(i:i)) > 126) text(i:i) = '?'
    end do
    text = ''''//text//''''
  end function shown

end module matrix_market
