! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A working file whose tail is lost gets its length back: HDF5 refuses a file that is shorter than it states. What was in
!> the tail is zero then, and its tiles do not match their checksums.
module map_repair
  use errors, only: error_t, fail
  use kinds, only: int64, int8
  use status, only: exit_io
  use superblock, only: short_bytes, stated_bytes
  use text, only: to_text
  implicit none
  private

  public :: restore_length

contains

  !> `missing`: bytes that were lost, now zero. Code 74 if even the start of the file is gone.
  subroutine restore_length(path, missing, error)
    character(len=*), intent(in) :: path
    integer(int64), intent(out) :: missing
    type(error_t), allocatable, intent(out) :: error
    integer(int8) :: header(short_bytes)
    integer(int64) :: expected, found
    integer :: unit, status
    logical :: readable
    character(len=256) :: message
    missing = 0
    message = ''
    open (newunit=unit, file=path, access='stream', form='unformatted', status='old', action='readwrite', iostat=status, &
          iomsg=message)
    if (status == 0) then
      inquire (unit=unit, size=found)
      read (unit, iostat=status, iomsg=message) header
      readable = status == 0
      if (readable) expected = stated_bytes(header)
      if (readable) readable = expected >= 0
      if (readable) then
        if (found < expected) then
          missing = expected - found
          write (unit, pos=expected, iostat=status, iomsg=message) 0_int8
        end if
      end if
      close (unit)
      if (.not. readable) then
        call fail(error, exit_io, ''''//path//''' is damaged: its start is gone, '//to_text(found)// &
                  ' bytes are left; --force begins again')
        return
      end if
    end if
    if (status /= 0) call fail(error, exit_io, ''''//path//''': '//trim(message))
  end subroutine restore_length

end module map_repair
