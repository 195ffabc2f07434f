! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Runs the tests of a suite one after the other in one process.
module test_runner
  use, intrinsic :: iso_fortran_env, only: output_unit
  use test_outcome, only: anyExceptions, asserted, record_failure, reset_outcome
  implicit none
  private

  public :: begin_suite, run_test, end_suite

  abstract interface
    subroutine test_procedure()
    end subroutine test_procedure
  end interface

  integer :: passed = 0, failed = 0

contains

  subroutine begin_suite(name)
    character(len=*), intent(in) :: name
    write (output_unit, '(a)') name
  end subroutine begin_suite

  !> A test passes if it asserts something and all of it holds.
  subroutine run_test(name, test)
    character(len=*), intent(in) :: name
    procedure(test_procedure) :: test
    call reset_outcome()
    call test()
    if (asserted() == 0) call record_failure(name//' asserts nothing')
    if (anyExceptions()) then
      failed = failed + 1
      write (output_unit, '(2a)') 'FAILED  ', name
    else
      passed = passed + 1
      write (output_unit, '(2a)') 'ok      ', name
    end if
    flush (output_unit)
  end subroutine run_test

  !> Prints the counts and ends the program.
  subroutine end_suite()
    write (output_unit, '(i0,a,i0,a)') passed, ' passed, ', failed, ' failed'
    flush (output_unit)
    stop merge(1, 0, failed > 0), quiet=.true.
  end subroutine end_suite

end module test_runner
