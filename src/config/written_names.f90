! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Tables of a case that are read under other names: keys in messages are those of the file, and keys in its expressions become
!> those that are read.
module written_names
  use text, only: replace_all, starts_with
  implicit none
  private

  public :: as_read, as_written, column_as_written

  !> A table, or a key, as the file has it and as it is read.
  type, public :: read_as_t
    character(len=24) :: written = '', read = ''
  end type read_as_t

  !> Keys that only the tables as they are read may have.
  character(len=*), parameter, public :: of_parts_only(5) = [character(len=7) :: 'between', 'body', 'x0', 'v0', 'inertia']

  character(len=*), parameter :: of_names = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.'

contains

  !> A text about keys that are read, with those of the file; the first of several names goes first.
  pure function as_written(tables, string) result(text)
    type(read_as_t), intent(in) :: tables(:)
    character(len=*), intent(in) :: string
    character(len=:), allocatable :: text
    integer :: i
    text = string
    do i = 1, size(tables)
      text = replace_all(text, trim(tables(i)%read), trim(tables(i)%written))
    end do
  end function as_written

  !> An expression with the keys that are read; one that has these already remains.
  pure function as_read(tables, expression) result(text)
    type(read_as_t), intent(in) :: tables(:)
    character(len=*), intent(in) :: expression
    character(len=:), allocatable :: text
    integer :: from, past
    text = ''
    from = 1
    do while (from <= len(expression))
      past = verify(expression(from:), of_names)
      if (past == 0) past = len(expression) - from + 2
      if (past > 1) then
        text = text//name_as_read(tables, expression(from:from + past - 2))
        from = from + past - 1
      else
        text = text//expression(from:from)
        from = from + 1
      end if
    end do
  end function as_read

  pure function name_as_read(tables, name) result(new)
    type(read_as_t), intent(in) :: tables(:)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: new
    integer :: i
    new = name
    do i = 1, size(tables)
      if (starts_with(name//'.', trim(tables(i)%read)//'.')) return
    end do
    do i = 1, size(tables)
      if (.not. starts_with(name//'.', trim(tables(i)%written)//'.')) cycle
      new = trim(tables(i)%read)//name(len_trim(tables(i)%written) + 1:)
      return
    end do
  end function name_as_read

  !> The column of an expression of the file for a column of what is read.
  pure integer function column_as_written(tables, expression, column) result(written)
    type(read_as_t), intent(in) :: tables(:)
    character(len=*), intent(in) :: expression
    integer, intent(in) :: column
    integer :: k
    written = 1
    do k = 1, len(expression)
      ! Only before a name is what is read up to there known.
      if (scan(expression(k:k), of_names) > 0 .and. k > 1) then
        if (scan(expression(k - 1:k - 1), of_names) > 0) cycle
      end if
      if (len(as_read(tables, expression(:k - 1))) + 1 <= column) written = k
    end do
  end function column_as_written

end module written_names
