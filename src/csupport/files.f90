! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> File operations that Fortran lacks. Errors name the file and the system's reason.
module files
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use bindings, only: c_append, c_error_text, c_file_exists, c_is_same_file, c_is_special, c_folder_status, c_free_bytes, &
    c_give_lock, c_open_append, c_publish_file, c_remove_file, c_reserve_file, c_take_lock
  use errors, only: error_t, fail
  use kinds, only: int64
  use status, only: exit_cannot_create, exit_io
  use system, only: from_c
  implicit none
  private

  public :: file_exists, is_empty, is_same_file, is_special, is_text, check_folder, free_bytes, reserve_file, publish_file, &
    remove_file, take_lock, give_lock, open_append, append_line, test_status

contains

  !> Whether something of this name exists.
  logical function file_exists(path)
    character(len=*), intent(in) :: path
    file_exists = c_file_exists(path//c_null_char) == 1
  end function file_exists

  !> Whether it exists and is no regular file: a folder, a device, a pipe.
  logical function is_special(path)
    character(len=*), intent(in) :: path
    is_special = c_is_special(path//c_null_char) == 1
  end function is_special

  !> Whether two names are of one file that exists, also by links.
  logical function is_same_file(path, other)
    character(len=*), intent(in) :: path, other
    is_same_file = c_is_same_file(path//c_null_char, other//c_null_char) == 1
  end function is_same_file

  !> Whether it is a file without a byte.
  logical function is_empty(path)
    character(len=*), intent(in) :: path
    integer(int64) :: bytes
    inquire (file=path, size=bytes)
    is_empty = bytes == 0
    if (is_empty) is_empty = .not. is_special(path)
  end function is_empty

  !> Whether a file begins like a text: its first bytes are no control characters but tabs and ends of lines. False for an
  !> empty file and one that cannot be read.
  logical function is_text(path)
    character(len=*), intent(in) :: path
    character(len=1) :: byte
    integer :: unit, status, i
    is_text = .false.
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='read', iostat=status)
    if (status /= 0) return
    do i = 1, 512
      read (unit, iostat=status) byte
      if (status /= 0) exit
      is_text = iachar(byte) >= 32 .and. iachar(byte) /= 127 .or. any(iachar(byte) == [9, 10, 13])
      if (.not. is_text) exit
    end do
    close (unit)
  end function is_text

  !> Code 73 unless a file can be created in the folder of `path`.
  subroutine check_folder(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    call test_status(c_folder_status(path//c_null_char), exit_cannot_create, 'cannot create', path, error)
  end subroutine check_folder

  !> Bytes free to this user where `path` lies; -1 if the system does not report them.
  integer(int64) function free_bytes(path)
    character(len=*), intent(in) :: path
    free_bytes = c_free_bytes(path//c_null_char)
  end function free_bytes

  !> Reserves the disk blocks of a file; code 73 on a full disk or quota.
  subroutine reserve_file(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    call test_status(c_reserve_file(path//c_null_char), exit_cannot_create, 'cannot reserve the space of', path, error)
  end subroutine reserve_file

  !> Makes the content of `from` durable, then renames it to `to` (replacing that); code 74.
  subroutine publish_file(from, to, error)
    character(len=*), intent(in) :: from, to
    type(error_t), allocatable, intent(out) :: error
    call test_status(c_publish_file(from//c_null_char, to//c_null_char), exit_io, 'cannot sync and rename to', to, error)
  end subroutine publish_file

  !> Removes a file; one that does not exist counts as removed; code 74.
  subroutine remove_file(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    call test_status(c_remove_file(path//c_null_char), exit_io, 'cannot remove', path, error)
  end subroutine remove_file

  !> Locks `path`, a file made for that, until `give_lock` or the end of the process; code 73 if another process has it.
  !> `lock` is what to give back; -1 on a file system without locks, with the system's reason in `refusal`.
  subroutine take_lock(path, lock, refusal, error)
    character(len=*), intent(in) :: path
    integer, intent(out) :: lock
    character(len=:), allocatable, intent(out) :: refusal
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: descriptor, number, refused
    number = c_take_lock(path//c_null_char, descriptor, refused)
    lock = descriptor
    if (refused /= 0) refusal = reason_of(refused)
    if (number < 0) then
      call fail(error, exit_cannot_create, "another run is at work on this file; it has the lock '"//path//"'")
    else
      call test_status(number, exit_cannot_create, 'cannot create', path, error)
    end if
  end subroutine take_lock

  !> Removes the file of a lock; does nothing for -1.
  subroutine give_lock(path, lock)
    character(len=*), intent(in) :: path
    integer, intent(in) :: lock
    call c_give_lock(path//c_null_char, int(lock, c_int))
  end subroutine give_lock

  !> Opens a file, made if there is none, for lines behind what is in it; code 73.
  subroutine open_append(path, descriptor, error)
    character(len=*), intent(in) :: path
    integer, intent(out) :: descriptor
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: opened
    call test_status(c_open_append(path//c_null_char, opened), exit_cannot_create, 'cannot write', path, error)
    descriptor = opened
  end subroutine open_append

  !> Writes a line to what `open_append` opened, or to stdout (1), at once; code 74. Fortran's own units lose the lines for
  !> which there is no space without a word. `name` is for the message.
  subroutine append_line(descriptor, name, line, error)
    integer, intent(in) :: descriptor
    character(len=*), intent(in) :: name, line
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: number
    number = c_append(int(descriptor, c_int), line//new_line(line), len(line, kind=int64) + 1)
    call test_status(number, exit_io, 'cannot write', name, error)
  end subroutine append_line

  !> An error with the system's reason unless its `number` is 0: `action` and `path` state what could not be done.
  subroutine test_status(number, code, action, path, error)
    integer(c_int), intent(in) :: number
    integer, intent(in) :: code
    character(len=*), intent(in) :: action, path
    type(error_t), allocatable, intent(out) :: error
    if (number /= 0) call fail(error, code, action//' '''//path//''': '//reason_of(number))
  end subroutine test_status

  !> The system's text for an errno.
  function reason_of(number) result(text)
    integer(c_int), intent(in) :: number
    character(len=:), allocatable :: text
    character(kind=c_char) :: reason(128)
    call c_error_text(number, reason, int(size(reason), c_int))
    text = from_c(reason)
  end function reason_of

end module files
