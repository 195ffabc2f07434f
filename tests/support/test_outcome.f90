! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the running test has asserted so far, on this process. Names follow pFUnit.
module test_outcome
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  private

  public :: anyExceptions, reset_outcome, record, record_failure, asserted

  !> Where an assertion stands.
  type, public :: SourceLocation
    character(len=256) :: file = '?'
    integer :: line = 0
  end type SourceLocation

  interface SourceLocation
    module procedure new_location
  end interface SourceLocation

  integer, protected :: assertion_count = 0
  logical, protected :: failed = .false.

contains

  pure type(SourceLocation) function new_location(file, line)
    character(len=*), intent(in) :: file
    integer, intent(in) :: line
    new_location%file = file
    new_location%line = line
  end function new_location

  !> Whether an assertion of this test has failed.
  logical function anyExceptions()
    anyExceptions = failed
  end function anyExceptions

  !> How many assertions this test has made.
  integer function asserted()
    asserted = assertion_count
  end function asserted

  !> To be called before each test.
  subroutine reset_outcome()
    assertion_count = 0
    failed = .false.
  end subroutine reset_outcome

  !> Counts an assertion and, if it does not hold, prints it.
  subroutine record(holds, what, message, location)
    logical, intent(in) :: holds
    character(len=*), intent(in) :: what
    character(len=*), intent(in), optional :: message
    type(SourceLocation), intent(in), optional :: location
    character(len=16) :: line
    character(len=:), allocatable :: text
    assertion_count = assertion_count + 1
    if (holds) return
    text = what
    if (present(message)) text = text//' ('//trim(message)//')'
    if (present(location)) then
      write (line, '(i0)') location%line
      text = trim(location%file)//':'//trim(line)//': '//text
    end if
    call record_failure(text)
  end subroutine record

  !> Marks the running test as failed and reports why, at once: an MPI test may hang afterwards.
  subroutine record_failure(text)
    character(len=*), intent(in) :: text
    failed = .true.
    write (output_unit, '(2a)') '  ', text
    flush (output_unit)
  end subroutine record_failure

end module test_outcome
