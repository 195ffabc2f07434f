! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Square real matrices in the Matrix Market exchange format (Boisvert, Pozo, Remington, NISTIR 5935, 1996): coordinate or array,
!> general, symmetric or skew-symmetric.
module matrix_market
  use errors, only: error_t
  use kinds, only: int64, real64
  use status, only: exit_no_input
  use structure_data, only: most_file_coordinates
  use text, only: replace_all, starts_with, to_text
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
    character(len=16) :: layout, symmetry
    integer :: sizes(3)
    call read_text_file(path, cursor%text, error)
    missing = .false.
    if (allocated(error)) then
      missing = error%code == exit_no_input
      problem = error%message
      return
    end if
    call read_header(cursor, layout, symmetry, problem)
    if (.not. allocated(problem)) call read_sizes(cursor, layout, sizes, problem)
    if (.not. allocated(problem)) then
      allocate (matrix(sizes(1), sizes(1)), source=0.0_real64)
      if (layout == 'coordinate') then
        call read_coordinates(cursor, symmetry, sizes(3), matrix, problem)
      else
        call read_array(cursor, symmetry, matrix, problem)
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
      cursor%line = adjustl(replace_all(cursor%text(cursor%from:cursor%from + length - 1), achar(13), ''))
      cursor%from = cursor%from + length + 1
      cursor%number = cursor%number + 1
      next_line = len_trim(cursor%line) > 0 .and. (cursor%number == 1 .or. .not. starts_with(cursor%line, '%'))
      if (next_line) return
    end do
    if (allocated(cursor%line)) deallocate (cursor%line)
  end function next_line

  subroutine read_header(cursor, layout, symmetry, problem)
    type(cursor_t), intent(inout) :: cursor
    character(len=16), intent(out) :: layout, symmetry
    character(len=:), allocatable, intent(out) :: problem
    character(len=*), parameter :: allowed = ', allowed ''%%MatrixMarket matrix coordinate|array real|integer '// &
      'general|symmetric|skew-symmetric'''
    character(len=16) :: words(5)
    integer :: status
    words = ''
    status = 1
    if (next_line(cursor)) read (cursor%line, *, iostat=status) words
    words = [lower(words(1)), lower(words(2)), lower(words(3)), lower(words(4)), lower(words(5))]
    layout = words(3)
    symmetry = words(5)
    if (status == 0 .and. words(1) == '%%matrixmarket' .and. words(2) == 'matrix' .and. &
        (layout == 'coordinate' .or. layout == 'array') .and. (words(4) == 'real' .or. words(4) == 'integer') .and. &
        (symmetry == 'general' .or. symmetry == 'symmetric' .or. symmetry == 'skew-symmetric')) return
    problem = 'found '//shown(cursor)//allowed
  end subroutine read_header

  !> Rows, columns and, of a list of coordinates, entries.
  subroutine read_sizes(cursor, layout, sizes, problem)
    type(cursor_t), intent(inout) :: cursor
    character(len=*), intent(in) :: layout
    integer, intent(out) :: sizes(3)
    character(len=:), allocatable, intent(out) :: problem
    integer :: status
    sizes = 0
    status = 1
    if (next_line(cursor)) read (cursor%line, *, iostat=status) sizes(:merge(3, 2, layout == 'coordinate'))
    if (status /= 0 .or. any(sizes < 0)) then
      problem = 'found '//shown(cursor)//', allowed the numbers of rows and columns'
      if (layout == 'coordinate') problem = problem//' and entries'
    else if (sizes(1) /= sizes(2) .or. sizes(1) < 1 .or. sizes(1) > most_file_coordinates) then
      problem = 'found '//to_text(sizes(1))//' rows and '//to_text(sizes(2))//' columns, allowed as many of both, at most '// &
                to_text(most_file_coordinates)//': separatrix-structure reduces a larger model'
    end if
  end subroutine read_sizes

  subroutine read_coordinates(cursor, symmetry, entries, matrix, problem)
    type(cursor_t), intent(inout) :: cursor
    character(len=*), intent(in) :: symmetry
    integer, intent(in) :: entries
    real(real64), intent(inout) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    real(real64) :: value
    integer :: i, row, column, status
    do i = 1, entries
      status = 1
      row = 0
      column = 0
      if (next_line(cursor)) read (cursor%line, *, iostat=status) row, column, value
      if (status /= 0 .or. min(row, column) < 1 .or. max(row, column) > size(matrix, 1)) then
        problem = 'found '//to_text(i - 1)//' entries and then '//shown(cursor)//', allowed '//to_text(entries)// &
                  ' lines of row, column and number, up to '//to_text(size(matrix, 1))
        return
      end if
      ! Entries of one place add up.
      call put(matrix, row, column, symmetry, value)
    end do
  end subroutine read_coordinates

  !> Column by column; of a symmetric matrix the lower triangle.
  subroutine read_array(cursor, symmetry, matrix, problem)
    type(cursor_t), intent(inout) :: cursor
    character(len=*), intent(in) :: symmetry
    real(real64), intent(inout) :: matrix(:, :)
    character(len=:), allocatable, intent(out) :: problem
    real(real64) :: value
    integer :: row, column, first, status
    do column = 1, size(matrix, 2)
      first = 1
      if (symmetry == 'symmetric') first = column
      if (symmetry == 'skew-symmetric') first = column + 1
      do row = first, size(matrix, 1)
        status = 1
        if (next_line(cursor)) read (cursor%line, *, iostat=status) value
        if (status /= 0) then
          problem = 'found '//shown(cursor)//', allowed a number for row '//to_text(row)//' of column '// &
                    to_text(column)
          return
        end if
        call put(matrix, row, column, symmetry, value)
      end do
    end do
  end subroutine read_array

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
