! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Calls the reference library: the same numerics in quadruple precision.
module reference
  use, intrinsic :: iso_c_binding, only: c_double, c_int, c_int64_t
  use attractors, only: attractor_t, pack_attractor
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use law_table, only: find_law, law_choice_t
  use motion_state, only: options_t
  use status, only: exit_internal
  use trajectory, only: span_t
  implicit none
  private

  public :: run_reference

  !> Relative tolerance of the adaptive flight in quadruple precision.
  real(wp), parameter :: reference_tolerance = 1e-20_wp

  interface
    function separatrix_reference_run(law_count, law_rows, lengths, values, flight, event_budget, numbers, &
        attractor_count, packed, points, starts, results) bind(c) result(status)
      import :: c_double, c_int, c_int64_t
      integer(c_int), value :: law_count
      integer(c_int), intent(in) :: law_rows(*), lengths(*)
      real(c_double), intent(in) :: values(*)
      integer(c_int), value :: flight
      integer(c_int64_t), value :: event_budget
      real(c_double), intent(in) :: numbers(*)
      integer(c_int), value :: attractor_count, points
      real(c_double), intent(in) :: packed(*), starts(*)
      real(c_double), intent(out) :: results(*)
      integer(c_int) :: status
    end function separatrix_reference_run
  end interface

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
    status = separatrix_reference_run(size(rows), rows, lengths, values, options%flight, &
      int(options%event_budget, int64), [reference_tolerance, options%domain, span%duration, span%window, &
      span%extension, merge(1.0_wp, 0.0_wp, span%stop_when_captured)], size(catalogue), packed, &
      size(starts, 2), starts, out)
    if (status /= 0) call fail(error, exit_internal, 'the reference library could not build the machine')
    results = out
  end subroutine run_reference

end module reference
