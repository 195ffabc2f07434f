! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Calls the reference library: the same numerics in quadruple precision. It is loaded when it is first used, so that the program
!> is built and started without it.
module reference
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_procpointer, c_funptr, c_int, c_int64_t, &
    c_null_char, c_ptr
  use attractors, only: attractor_t, pack_attractor, packed_layout
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use law_fingerprint, only: fingerprint
  use law_table, only: find_law, law_choice_t
  use law_texts, only: pack_texts
  use motion_state, only: options_t
  use status, only: exit_internal, exit_no_input
  use single_trajectory, only: span_t
  implicit none
  private

  public :: run_reference

  !> Relative tolerance of the adaptive flight in quadruple precision.
  real(wp), parameter :: reference_tolerance = 1e-20_wp

  !> Looked for in the folder lib/ beside that of the program.
  character(len=*), parameter :: library = 'libseparatrix_reference.so'
  integer(c_int), parameter :: resolve_now = 2

  interface
    type(c_ptr) function open_library(name, mode) bind(c, name='dlopen')
      import :: c_char, c_int, c_ptr
      character(kind=c_char), intent(in) :: name(*)
      integer(c_int), value :: mode
    end function open_library

    type(c_funptr) function function_in(library, name) bind(c, name='dlsym')
      import :: c_char, c_funptr, c_ptr
      type(c_ptr), value :: library
      character(kind=c_char), intent(in) :: name(*)
    end function function_in
  end interface

  abstract interface
    function reference_run(law_count, law_rows, texts, lengths, values, flight, event_budget, numbers, &
        attractor_count, packed, points, starts, results) bind(c) result(status)
      import :: c_char, c_double, c_int, c_int64_t
      integer(c_int), value :: law_count
      integer(c_int), intent(in) :: law_rows(*), lengths(*)
      character(kind=c_char), intent(in) :: texts(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int), value :: flight
      integer(c_int64_t), value :: event_budget
      real(c_double), intent(in) :: numbers(*)
      integer(c_int), value :: attractor_count, points
      real(c_double), intent(in) :: packed(*), starts(*)
      real(c_double), intent(out) :: results(*)
      integer(c_int) :: status
    end function reference_run

    integer(c_int64_t) function reference_laws() bind(c)
      import :: c_int64_t
    end function reference_laws
  end interface

  procedure(reference_run), pointer :: separatrix_reference_run => null()

contains

  !> Runs `starts` (rows x0 [m], v0 [m/s], crank angle [rad]) on the machine of `laws` (one per
  !> family and any effects). Rows of `results`: reason, attractor, regime, x [m], v [m/s], impacts.
  subroutine run_reference(laws, options, span, catalogue, starts, results, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(span_t), intent(in) :: span
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: starts(:, :)
    real(wp), intent(out) :: results(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: rows(size(laws)), status
    integer(c_int), allocatable :: lengths(:)
    real(c_double), allocatable :: values(:), packed(:), out(:, :)
    integer :: i, k
    call load(error)
    if (allocated(error)) return
    allocate (lengths(0), values(0), packed(0), out(6, size(starts, 2)))
    do i = 1, size(laws)
      rows(i) = find_law(trim(laws(i)%family), trim(laws(i)%name))
      do k = 1, size(laws(i)%parameters)
        lengths = [lengths, size(laws(i)%parameters(k)%values)]
        values = [values, laws(i)%parameters(k)%values]
      end do
    end do
    do i = 1, size(catalogue)
      packed = [packed, pack_attractor(catalogue(i))]
    end do
    status = separatrix_reference_run(size(rows), rows, pack_texts(laws)//c_null_char, lengths, values, options%flight, &
      int(options%event_budget, int64), [reference_tolerance, options%domain, span%duration, span%window, &
      span%extension, merge(1.0_wp, 0.0_wp, span%stop_when_converged)], size(catalogue), packed, &
      size(starts, 2), starts, out)
    if (status /= 0) call fail(error, exit_internal, 'the reference library could not build the machine')
    results = out
  end subroutine run_reference

  !> Loads the library unless that has been done.
  subroutine load(error)
    type(error_t), allocatable, intent(out) :: error
    type(c_ptr) :: handle
    type(c_funptr) :: address
    procedure(reference_laws), pointer :: laws_of_library
    if (associated(separatrix_reference_run)) return
    handle = open_library(library//c_null_char, resolve_now)
    if (c_associated(handle)) then
      address = function_in(handle, 'separatrix_reference_laws'//c_null_char)
      laws_of_library => null()
      if (c_associated(address)) call c_f_procpointer(address, laws_of_library)
      if (.not. has_these_laws(laws_of_library)) then
        call fail(error, exit_no_input, 'the quadruple-precision library '//library// &
                  ' is of another build; cmake --build BUILD --target separatrix_reference renews it')
        return
      end if
      address = function_in(handle, 'separatrix_reference_run'//c_null_char)
      if (c_associated(address)) call c_f_procpointer(address, separatrix_reference_run)
    end if
    if (.not. associated(separatrix_reference_run)) call fail(error, exit_no_input, 'the quadruple-precision library '//library// &
      ' is not in lib/ beside the folder of the program; cmake --build BUILD --target separatrix_reference builds it')
  end subroutine load

  !> Whether a library has the laws of this program, row by row, and reads attractors as it packs them.
  logical function has_these_laws(laws_of_library)
    procedure(reference_laws), pointer, intent(in) :: laws_of_library
    has_these_laws = .false.
    if (associated(laws_of_library)) has_these_laws = laws_of_library() == fingerprint() + packed_layout()
  end function has_these_laws

end module reference
