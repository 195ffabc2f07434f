! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What is reported where HDF5 fails.
module h5_errors
  use errors, only: error_t, fail
  use files, only: free_bytes
  use kinds, only: int64
  use status, only: exit_cannot_create, exit_io
  use text, only: to_text
  implicit none
  private

  public :: h5_failed

contains

  !> Whether the step failed; then sets the error, unless there is one already.
  logical function h5_failed(status, action, object, path, error)
    integer, intent(in) :: status
    character(len=*), intent(in) :: action, object, path
    type(error_t), allocatable, intent(inout) :: error
    character(len=:), allocatable :: message
    integer(int64) :: free
    h5_failed = status < 0 .or. allocated(error)
    if (.not. h5_failed .or. allocated(error)) return
    if (is_reading(action) .and. object /= '') then
      call fail(error, exit_io, "'"//path//"' is damaged (HDF5 cannot "//action//" '"//object//"')")
      return
    end if
    message = 'HDF5 cannot '//action//' '
    if (object /= '') message = message//''''//object//''' of '
    message = message//''''//path//''''
    free = free_bytes(path)
    if (free >= 0 .and. free < 2**20) message = message//': the disk has '//to_text(free)//' bytes left'
    call fail(error, merge(exit_cannot_create, exit_io, action == 'create the file'), message)
  end function h5_failed

  !> Whether a failure of the action means that what the library wrote is not as it was.
  pure logical function is_reading(action)
    character(len=*), intent(in) :: action
    is_reading = any(action(:scan(action//' ', ' ') - 1) == [character(len=4) :: 'open', 'list', 'read', 'find'])
  end function is_reading

end module h5_errors
