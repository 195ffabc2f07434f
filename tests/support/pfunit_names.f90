! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

! Written by scripts/evidence/pfunit_check --write.

!> Names that pFUnit's module funit exports, beside those that its stand-in here gives a meaning.
module funit_names
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  public
  integer, parameter :: abstractmatcher = 0
  integer, parameter :: abstracttestparameter = 0
  integer, parameter :: all_of = 0
  integer, parameter :: allof = 0
  integer, parameter :: any_of = 0
  integer, parameter :: anyof = 0
  integer, parameter :: array_with_size = 0
  integer, parameter :: assert_that = 0
  integer, parameter :: assertall = 0
  integer, parameter :: assertany = 0
  integer, parameter :: assertexceptionraised = 0
  integer, parameter :: assertfail = 0
  integer, parameter :: assertnone = 0
  integer, parameter :: assertnotall = 0
  integer, parameter :: assertnotequal = 0
  integer, parameter :: assertsameshape = 0
  integer, parameter :: basetestrunner = 0
  integer, parameter :: catch = 0
  integer, parameter :: catchnext = 0
  integer, parameter :: contains_string = 0
  integer, parameter :: debuglistener = 0
  integer, parameter :: disable = 0
  integer, parameter :: empty_array = 0
  integer, parameter :: ends_with = 0
  integer, parameter :: equal_to = 0
  integer, parameter :: every = 0
  integer, parameter :: every_item = 0
  integer, parameter :: expectation = 0
  integer, parameter :: false = 0
  integer, parameter :: finalize = 0
  integer, parameter :: generic_run = 0
  integer, parameter :: get_context = 0
  integer, parameter :: ignore_all = 0
  integer, parameter :: ignore_differences = 0
  integer, parameter :: initialize = 0
  integer, parameter :: is = 0
  integer, parameter :: isarraywithsize = 0
  integer, parameter :: isequal = 0
  integer, parameter :: isnear = 0
  integer, parameter :: isnot = 0
  integer, parameter :: isrelativelynear = 0
  integer, parameter :: istrueorfalse = 0
  integer, parameter :: keep_all = 0
  integer, parameter :: listenerpointer = 0
  integer, parameter :: loadtests_interface = 0
  integer, parameter :: matchable = 0
  integer, parameter :: matcherdescription = 0
  integer, parameter :: namefilter = 0
  integer, parameter :: near = 0
  integer, parameter :: not = 0
  integer, parameter :: parallelcontext = 0
  integer, parameter :: parameterizedtestcase = 0
  integer, parameter :: predicate = 0
  integer, parameter :: relatively_near = 0
  integer, parameter :: remoterunner = 0
  integer, parameter :: resultprinter = 0
  integer, parameter :: robustrunner = 0
  integer, parameter :: run = 0
  integer, parameter :: serialcontext = 0
  integer, parameter :: starts_with = 0
  integer, parameter :: stringcontains = 0
  integer, parameter :: stringdescription = 0
  integer, parameter :: stringendswith = 0
  integer, parameter :: stringstartswith = 0
  integer, parameter :: stub = 0
  integer, parameter :: subject = 0
  integer, parameter :: taplistener = 0
  integer, parameter :: test = 0
  integer, parameter :: testannotation = 0
  integer, parameter :: testcase = 0
  integer, parameter :: testlistener = 0
  integer, parameter :: testlistenervector = 0
  integer, parameter :: testmethod = 0
  integer, parameter :: testresult = 0
  integer, parameter :: testrunner = 0
  integer, parameter :: testsuite = 0
  integer, parameter :: throw = 0
  integer, parameter :: timeoutannotation = 0
  integer, parameter :: trim_all = 0
  integer, parameter :: true = 0
  integer, parameter :: wascalled = 0
  integer, parameter :: wascalledonce = 0
  integer, parameter :: wasnotcalled = 0
  integer, parameter :: whitespaceoptions = 0
  integer, parameter :: xmlprinter = 0
end module funit_names

!> Names that pFUnit's module pfunit exports, beside those that its stand-in here gives a meaning.
module pfunit_names
  use, intrinsic :: iso_fortran_env, only: error_unit
  implicit none
  public
  integer, parameter :: funit_context = 0
  integer, parameter :: funit_finalize = 0
  integer, parameter :: funit_initialize = 0
  integer, parameter :: funit_run = 0
  integer, parameter :: funit_stub = 0
  integer, parameter :: mpicontext = 0
  integer, parameter :: mpitestcase = 0
  integer, parameter :: mpitestparameter = 0
end module pfunit_names
