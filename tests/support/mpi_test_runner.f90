! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Runs the tests of an MPI suite: each once per number of ranks that it asks for, on the first
!> ranks of the job, while the others wait.
module mpi_test_runner
  use, intrinsic :: iso_fortran_env, only: int64, output_unit
  use mpi_f08, only: MPI_Abort, MPI_Allreduce, MPI_Bcast, MPI_Comm, MPI_Comm_free, MPI_Comm_rank, &
    MPI_Comm_size, MPI_Comm_split, MPI_COMM_NULL, MPI_COMM_WORLD, MPI_Finalize, MPI_Ibarrier, MPI_Init, &
    MPI_INTEGER, MPI_Request, MPI_STATUS_IGNORE, MPI_SUM, MPI_Test, MPI_UNDEFINED, MPI_Wait, operator(==)
  use mpi_test_method, only: MpiTestMethod, new_method
  use test_outcome, only: anyExceptions, asserted, record_failure, reset_outcome
  implicit none
  private

  public :: begin_suite, run_test, end_suite

  abstract interface
    subroutine test_procedure(this)
      import :: MpiTestMethod
      implicit none
      class(MpiTestMethod), intent(inout) :: this
    end subroutine test_procedure
  end interface

  !> How long a rank that failed waits for the others, which may be waiting for it.
  real, parameter :: patience_seconds = 10.0

  integer :: world_rank = 0, world_size = 1, passed = 0, failed = 0

contains

  subroutine begin_suite(name)
    character(len=*), intent(in) :: name
    call MPI_Init()
    call MPI_Comm_rank(MPI_COMM_WORLD, world_rank)
    call MPI_Comm_size(MPI_COMM_WORLD, world_size)
    if (world_rank == 0) write (output_unit, '(a)') name
  end subroutine begin_suite

  !> Runs a test on each of `npes` ranks. It passes if every rank's assertions hold and at least one
  !> rank asserts something.
  subroutine run_test(name, test, npes)
    character(len=*), intent(in) :: name
    procedure(test_procedure) :: test
    integer, intent(in) :: npes(:)
    integer :: i, counts(2), totals(2)
    do i = 1, size(npes)
      call reset_outcome()
      if (npes(i) > world_size) then
        if (world_rank == 0) call record_failure('needs more ranks than this job has')
      else
        call run_on_members(test, npes(i))
      end if
      counts = [asserted(), merge(1, 0, anyExceptions())]
      call MPI_Allreduce(counts, totals, 2, MPI_INTEGER, MPI_SUM, MPI_COMM_WORLD)
      if (world_rank == 0) call report(name, npes(i), totals)
    end do
  end subroutine run_test

  subroutine run_on_members(test, members)
    procedure(test_procedure) :: test
    integer, intent(in) :: members
    type(MpiTestMethod) :: method
    type(MPI_Comm) :: members_only, meeting
    integer :: colour
    colour = merge(1, MPI_UNDEFINED, world_rank < members)
    call MPI_Comm_split(MPI_COMM_WORLD, colour, world_rank, members_only)
    call MPI_Comm_split(MPI_COMM_WORLD, colour, world_rank, meeting)
    if (members_only == MPI_COMM_NULL) return
    method = new_method(members_only)
    call test(method)
    call meet(meeting)
    call MPI_Comm_free(meeting)
    call MPI_Comm_free(members_only)
  end subroutine run_on_members

  !> Waits for the other members. A rank that failed left the test early, so the others may never
  !> come: it then ends the job.
  subroutine meet(comm)
    type(MPI_Comm), intent(in) :: comm
    type(MPI_Request) :: request
    logical :: done
    integer(int64) :: start, now, rate
    call MPI_Ibarrier(comm, request)
    if (.not. anyExceptions()) then
      call MPI_Wait(request, MPI_STATUS_IGNORE)
      return
    end if
    call system_clock(start, rate)
    do
      call MPI_Test(request, done, MPI_STATUS_IGNORE)
      if (done) exit
      call system_clock(now)
      if (real(now - start) > patience_seconds*real(rate)) then
        call record_failure('the other ranks are still waiting for the one that failed')
        call MPI_Abort(MPI_COMM_WORLD, 1)
      end if
    end do
  end subroutine meet

  subroutine report(name, members, totals)
    character(len=*), intent(in) :: name
    integer, intent(in) :: members, totals(2)
    if (totals(1) == 0 .and. totals(2) == 0) call record_failure(name//' asserts nothing')
    if (totals(2) > 0 .or. totals(1) == 0) then
      failed = failed + 1
      write (output_unit, '(3a,i0,a)') 'FAILED  ', name, ' [npes=', members, ']'
    else
      passed = passed + 1
      write (output_unit, '(3a,i0,a)') 'ok      ', name, ' [npes=', members, ']'
    end if
    flush (output_unit)
  end subroutine report

  !> Prints the counts and ends the program, with the same code on every rank.
  subroutine end_suite()
    if (world_rank == 0) then
      write (output_unit, '(i0,a,i0,a)') passed, ' passed, ', failed, ' failed'
      flush (output_unit)
    end if
    call MPI_Bcast(failed, 1, MPI_INTEGER, 0, MPI_COMM_WORLD)
    call MPI_Finalize()
    stop merge(1, 0, failed > 0), quiet=.true.
  end subroutine end_suite

end module mpi_test_runner
