! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A measured force or motion out of a record: a CSV table with comment lines, a header row, and among others columns t [s] and
!> force [N] or x [m].
module force_record
  use errors, only: error_t
  use kinds, only: int64, wp
  use text, only: parse_number, replace_all, starts_with, to_text
  use toml_bindings, only: first_bad_byte, read_text_file
  implicit none
  private

  public :: read_force

  !> Largest deviation of a time from equal steps, in steps.
  real(wp), parameter :: uneven = 1e-3_wp

contains

  !> Time between samples [s] and samples of the column `name` of the record `path`; `problem` is allocated if there is one, and
  !> names the line, what was found and what is allowed.
  subroutine read_force(path, name, interval, force, problem)
    character(len=*), intent(in) :: path, name
    real(wp), intent(out) :: interval
    real(wp), allocatable, intent(out) :: force(:)
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: text, line
    type(error_t), allocatable :: error
    real(wp), allocatable :: rows(:, :)
    integer :: number, count, width, columns(2)
    integer(int64) :: from, length
    interval = 0
    allocate (force(0), rows(2, 1024))
    call read_text_file(path, text, error)
    if (allocated(error)) then
      problem = error%message
    else if (first_bad_byte(text) > 0) then
      problem = path//': found a byte that is no text, allowed UTF-8'
    end if
    if (allocated(problem)) return
    number = 0
    count = 0
    width = 0
    columns = 0
    from = 1
    do while (from <= len(text, int64))
      length = index(text(from:), new_line('a'), kind=int64) - 1
      if (length < 0) length = len(text, int64) - from + 1
      line = trim(replace_all(text(from:from + length - 1), achar(13), ''))
      from = from + length + 1
      number = number + 1
      if (len(line) == 0 .or. starts_with(line, '#')) cycle
      if (columns(1) == 0) then
        columns = [column_of(line, 't'), column_of(line, trim(name))]
        width = 1 + commas(line)
        if (any(columns == 0)) problem = 'found the header '''//line//''', allowed one with columns t and '//trim(name)
      else if (1 + commas(line) /= width) then
        problem = 'found '//to_text(1 + commas(line))//' values in '''//line//''', allowed '//to_text(width)// &
                  ' like the header, with decimal points'
      else
        if (count == size(rows, 2)) rows = reshape(rows, [2, 2*count], pad=[0.0_wp])
        count = count + 1
        call read_row(line, columns, rows(:, count), problem)
      end if
      if (allocated(problem)) problem = path//':'//to_text(number)//': '//problem
      if (allocated(problem)) return
    end do
    call check_steps(path, rows(1, :count), interval, problem)
    force = rows(2, :count)
  end subroutine read_force

  !> Number of the column named `name` in a header, 0 if there is none.
  pure integer function column_of(line, name) result(column)
    character(len=*), intent(in) :: line, name
    character(len=:), allocatable :: word
    column = 0
    do
      column = column + 1
      word = field(line, column)
      if (word == name) return
      if (column > commas(line)) exit
    end do
    column = 0
  end function column_of

  subroutine read_row(line, columns, row, problem)
    character(len=*), intent(in) :: line
    integer, intent(in) :: columns(2)
    real(wp), intent(inout) :: row(2)
    character(len=:), allocatable, intent(inout) :: problem
    character(len=:), allocatable :: word
    integer :: i, status
    do i = 1, 2
      word = field(line, columns(i))
      call parse_number(word, row(i), status)
      if (status /= 0) problem = 'found '''//word//''', allowed a finite number with a decimal point'
    end do
  end subroutine read_row

  !> The step of the times, which must be equal.
  subroutine check_steps(path, times, interval, problem)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: times(:)
    real(wp), intent(out) :: interval
    character(len=:), allocatable, intent(inout) :: problem
    integer :: i
    interval = 0
    if (size(times) < 2) then
      problem = path//': found '//to_text(size(times))//' samples, allowed two or more'
      return
    end if
    interval = (times(size(times)) - times(1))/(size(times) - 1)
    do i = 2, size(times)
      if (interval > 0 .and. abs(times(i) - times(1) - (i - 1)*interval) <= uneven*interval) cycle
      problem = path//': found t = '//to_text(times(i))//' s as sample '//to_text(i)//', allowed equal steps'
      return
    end do
  end subroutine check_steps

  pure integer function commas(line)
    character(len=*), intent(in) :: line
    integer :: i
    commas = count([(line(i:i) == ',', i=1, len(line))])
  end function commas

  !> The field of a line in a column, '' beyond the last.
  pure function field(line, column) result(word)
    character(len=*), intent(in) :: line
    integer, intent(in) :: column
    character(len=:), allocatable :: word
    integer :: from, to, i
    from = 1
    do i = 2, column
      to = index(line(from:), ',')
      if (to == 0) then
        word = ''
        return
      end if
      from = from + to
    end do
    to = index(line(from:)//',', ',') + from - 2
    word = trim(adjustl(line(from:to)))
  end function field

end module force_record
