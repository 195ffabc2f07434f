! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Fortran face of the TOML shim (toml_shim.h): a text becomes a list of entries.
module toml_bindings
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_pointer, c_int, &
    c_int64_t, c_null_char, c_ptr
  use errors, only: error_t, fail
  use kinds, only: int64, real64
  use status, only: exit_bad_case, exit_internal, exit_no_input
  use text, only: to_text
  implicit none
  private

  public :: read_toml, read_text_file, first_bad_byte, hash_text

  !> Kinds of an entry.
  integer, parameter, public :: toml_integer = 1, toml_float = 2, toml_string = 3, &
    toml_boolean = 4, toml_table = 5, toml_array = 6, toml_date = 7

  integer(c_int), parameter :: field_path = 1, field_text = 2

  !> One key with its value. Elements of lists are numbered from 1: `drive.cosine[2]`.
  type, public :: toml_entry_t
    !> Path of the key: `friction.law`, `axis[1].count`.
    character(len=:), allocatable :: path
    integer :: kind = toml_table
    !> Line of the value, from 1.
    integer :: line = 0
    !> Value of an integer; 1 for true; number of elements of a list.
    integer(int64) :: integer = 0
    !> Value of a number.
    real(real64) :: real = 0
    !> Value of a text.
    character(len=:), allocatable :: string
  end type toml_entry_t

  interface
    function c_read_file(path, length, message) bind(c, name='separatrix_toml_read_file')
      import :: c_char, c_int64_t, c_ptr
      character(kind=c_char), intent(in) :: path(*)
      integer(c_int64_t), intent(out) :: length
      type(c_ptr), intent(out) :: message
      type(c_ptr) :: c_read_file
    end function c_read_file

    subroutine c_free_text(text) bind(c, name='separatrix_toml_free_text')
      import :: c_ptr
      type(c_ptr), value :: text
    end subroutine c_free_text

    function c_parse(text, length) bind(c, name='separatrix_toml_parse')
      import :: c_char, c_int64_t, c_ptr
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int64_t), value :: length
      type(c_ptr) :: c_parse
    end function c_parse

    subroutine c_free(document) bind(c, name='separatrix_toml_free')
      import :: c_ptr
      type(c_ptr), value :: document
    end subroutine c_free

    function c_error(document, buffer, capacity, line, column) bind(c, name='separatrix_toml_error')
      import :: c_char, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: document
      character(kind=c_char), intent(inout) :: buffer(*)
      integer(c_int64_t), value :: capacity
      integer(c_int), intent(out) :: line, column
      integer(c_int64_t) :: c_error
    end function c_error

    function c_count(document) bind(c, name='separatrix_toml_count')
      import :: c_int, c_ptr
      type(c_ptr), value :: document
      integer(c_int) :: c_count
    end function c_count

    subroutine c_value(document, entry, kind, line, integer, real) bind(c, name='separatrix_toml_value')
      import :: c_double, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: document
      integer(c_int), value :: entry
      integer(c_int), intent(out) :: kind, line
      integer(c_int64_t), intent(out) :: integer
      real(c_double), intent(out) :: real
    end subroutine c_value

    function c_text(document, entry, field, buffer, capacity) bind(c, name='separatrix_toml_text')
      import :: c_char, c_int, c_int64_t, c_ptr
      type(c_ptr), value :: document
      integer(c_int), value :: entry, field
      character(kind=c_char), intent(inout) :: buffer(*)
      integer(c_int64_t), value :: capacity
      integer(c_int64_t) :: c_text
    end function c_text

    pure function c_first_bad_byte(text, length) bind(c, name='separatrix_first_bad_byte')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int64_t), value :: length
      integer(c_int64_t) :: c_first_bad_byte
    end function c_first_bad_byte

    pure function c_fnv1a(text, length) bind(c, name='separatrix_fnv1a')
      import :: c_char, c_int64_t
      character(kind=c_char), intent(in) :: text(*)
      integer(c_int64_t), value :: length
      integer(c_int64_t) :: c_fnv1a
    end function c_fnv1a
  end interface

contains

  !> The entries of a TOML text in the order of the text, tables and lists included. A syntax error
  !> or a repeated key gives code 65 and `NAME:LINE:COLUMN: what was found`.
  subroutine read_toml(text, name, entries, error)
    character(len=*), intent(in) :: text, name
    type(toml_entry_t), allocatable, intent(out) :: entries(:)
    type(error_t), allocatable, intent(out) :: error
    type(c_ptr) :: document
    integer :: i
    document = c_parse(text, len(text, int64))
    if (.not. c_associated(document)) then
      call fail(error, exit_internal, name//': not enough memory to read the text')
      return
    end if
    call report_syntax(document, name, error)
    if (.not. allocated(error)) then
      allocate (entries(c_count(document)))
      do i = 1, size(entries)
        call c_value(document, i - 1, entries(i)%kind, entries(i)%line, entries(i)%integer, entries(i)%real)
        entries(i)%path = text_of(document, i, field_path)
        entries(i)%string = text_of(document, i, field_text)
      end do
    end if
    call c_free(document)
  end subroutine read_toml

  subroutine report_syntax(document, name, error)
    type(c_ptr), intent(in) :: document
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: message
    character(len=1) :: nothing
    integer(c_int) :: line, column
    integer(int64) :: length
    length = c_error(document, nothing, 0_int64, line, column)
    if (length == 0) return
    allocate (character(len=length) :: message)
    length = c_error(document, message, length, line, column)
    call fail(error, exit_bad_case, name//':'//to_text(line)//':'//to_text(column)//': '//message)
  end subroutine report_syntax

  function text_of(document, entry, field) result(text)
    type(c_ptr), intent(in) :: document
    integer, intent(in) :: entry
    integer(c_int), intent(in) :: field
    character(len=:), allocatable :: text
    character(len=1) :: nothing
    integer(int64) :: length
    length = c_text(document, entry - 1, field, nothing, 0_int64)
    allocate (character(len=length) :: text)
    length = c_text(document, entry - 1, field, text, length)
  end function text_of

  !> The bytes of a file. An unreadable file gives code 66 with the system's reason.
  subroutine read_text_file(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    type(c_ptr) :: bytes, message
    integer(int64) :: length
    bytes = c_read_file(path//c_null_char, length, message)
    if (c_associated(bytes)) then
      text = copied(bytes, length)
    else if (c_associated(message)) then
      call fail(error, exit_no_input, path//': cannot be read: '//terminated(message))
    else
      call fail(error, exit_internal, path//': not enough memory to read the file')
    end if
    call c_free_text(bytes)
    call c_free_text(message)
  end subroutine read_text_file

  function copied(bytes, length) result(text)
    type(c_ptr), intent(in) :: bytes
    integer(int64), intent(in) :: length
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer(int64) :: i
    call c_f_pointer(bytes, letters, [length])
    allocate (character(len=length) :: text)
    do i = 1, length
      text(i:i) = letters(i)
    end do
  end function copied

  function terminated(bytes) result(text)
    type(c_ptr), intent(in) :: bytes
    character(len=:), allocatable :: text
    character(kind=c_char), pointer :: letters(:)
    integer(int64) :: i
    call c_f_pointer(bytes, letters, [4096_int64])
    text = ''
    do i = 1, size(letters)
      if (letters(i) == c_null_char) exit
      text = text//letters(i)
    end do
  end function terminated

  !> Where (from 1) the first byte of a text is that is not UTF-8, or a control character other than the ends of lines and
  !> tabs; 0 if nowhere.
  pure integer(int64) function first_bad_byte(text)
    character(len=*), intent(in) :: text
    first_bad_byte = c_first_bad_byte(text, len(text, int64)) + 1
  end function first_bad_byte

  !> 64-bit FNV-1a hash of a text as 16 hexadecimal digits.
  pure function hash_text(text) result(digits)
    character(len=*), intent(in) :: text
    character(len=16) :: digits
    write (digits, '(z16.16)') c_fnv1a(text, len(text, int64))
  end function hash_text

end module toml_bindings
