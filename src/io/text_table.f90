! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A table written line by line. gfortran does not report that a full disk has lost lines, so the length of the file is
!> compared with what was written.
module text_table
  use errors, only: error_t, fail
  use files, only: free_bytes, is_special
  use kinds, only: int64
  use status, only: exit_io
  use text, only: to_text
  implicit none
  private

  type, public :: table_t
    character(len=:), allocatable, private :: path
    integer, private :: unit = 0
    logical, private :: failed = .false.
    integer(int64), private :: bytes = 0
    character(len=256), private :: message = ''
  contains
    procedure :: create
    procedure :: line
    procedure :: close => close_table
  end type table_t

contains

  !> Begins the table, replacing what has its name.
  subroutine create(self, path)
    class(table_t), intent(out) :: self
    character(len=*), intent(in) :: path
    integer :: status
    self%path = path
    open (newunit=self%unit, file=path, status='replace', action='write', iostat=status, iomsg=self%message)
    self%failed = status /= 0
  end subroutine create

  !> Adds a line.
  subroutine line(self, text)
    class(table_t), intent(inout) :: self
    character(len=*), intent(in) :: text
    integer :: status
    if (self%failed) return
    write (self%unit, '(a)', iostat=status, iomsg=self%message) text
    self%failed = status /= 0
    self%bytes = self%bytes + len(text) + 1
  end subroutine line

  !> Ends it; code 74 if anything went wrong since it was begun.
  subroutine close_table(self, error)
    class(table_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: found
    integer :: status
    if (.not. self%failed) then
      close (self%unit, iostat=status, iomsg=self%message)
      self%failed = status /= 0
    end if
    if (self%failed) then
      call fail(error, exit_io, "'"//self%path//"': "//trim(self%message))
      return
    end if
    if (is_special(self%path)) return
    inquire (file=self%path, size=found)
    if (found < self%bytes) call fail(error, exit_io, "'"//self%path//"' was cut after "//to_text(found)//' of '// &
                                      to_text(self%bytes)//' bytes; the disk has '//to_text(free_bytes(self%path))//' left')
  end subroutine close_table

end module text_table
