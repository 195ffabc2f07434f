! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The entries of the reference library: trajectories of a machine, run and labelled by the same code
!> as the maps but in quadruple precision. Doubles go in and out; nothing else is visible outside.
module reference_library
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_int, c_int64_t, c_null_char
  use attractors, only: attractor_t, packed_layout, unpack_attractor
  use build_motion, only: machine_of
  use errors, only: error_t
  use kinds, only: wp
  use law_fingerprint, only: fingerprint
  use law_table, only: law_choice, law_choice_t, laws
  use law_texts, only: unpack_texts
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use single_trajectory, only: outcome_t, run_trajectory, span_t
  implicit none
  private

  public :: separatrix_reference_laws, separatrix_reference_run

contains

  !> The fingerprint of what the program passes: rows of the laws and packed attractors.
  integer(c_int64_t) function separatrix_reference_laws() bind(c)
    separatrix_reference_laws = fingerprint() + packed_layout()
  end function separatrix_reference_laws

  !> Runs `points` trajectories. Laws and effects: row in the law table of each, their texts (`pack_texts`), lengths and values
  !> of their parameters one after the other. `numbers` = tolerance, domain, duration, window, extension, then 1 to stop at
  !> convergence; `starts` = x0, v0, crank angle per point. Result per point: reason, attractor, regime, x, v, impacts.
  !> Returns 0, or 1 if the machine cannot be built.
  integer(c_int) function separatrix_reference_run(law_count, law_rows, texts, lengths, values, flight, event_budget, numbers, &
      attractor_count, packed, points, starts, results) bind(c)
    integer(c_int), value :: law_count
    integer(c_int), intent(in) :: law_rows(law_count), lengths(*)
    character(kind=c_char), intent(in) :: texts(*)
    real(c_double), intent(in) :: values(*)
    integer(c_int), value :: flight
    integer(c_int64_t), value :: event_budget
    real(c_double), intent(in) :: numbers(6)
    integer(c_int), value :: attractor_count, points
    real(c_double), intent(in) :: packed(*), starts(3, points)
    real(c_double), intent(out) :: results(6, points)
    type(law_choice_t) :: choices(law_count)
    class(machine_t), allocatable :: moving
    type(attractor_t), allocatable :: catalogue(:)
    type(error_t), allocatable :: error
    type(options_t) :: options
    type(outcome_t) :: outcome
    type(span_t) :: span
    integer :: i, k, parameter, position
    separatrix_reference_run = 1
    position = 0
    parameter = 0
    do i = 1, law_count
      choices(i) = law_choice(trim(laws(law_rows(i))%family), trim(laws(law_rows(i))%name))
    end do
    call unpack_texts(text_at(texts), choices)
    do i = 1, law_count
      do k = 1, size(choices(i)%parameters)
        parameter = parameter + 1
        choices(i)%parameters(k)%values = real(values(position + 1:position + lengths(parameter)), wp)
        position = position + lengths(parameter)
      end do
    end do
    options%flight = flight
    options%event_budget = event_budget
    ! Its tolerance asks for more steps than the results that it checks took.
    options%step_budget = huge(options%step_budget)
    options%tolerance = numbers(1)
    options%domain = numbers(2)
    span = span_t(real(numbers(3), wp), real(numbers(4), wp), real(numbers(5), wp), numbers(6) > 0)
    call machine_of(choices, options, moving, error)
    if (allocated(error)) return
    allocate (catalogue(attractor_count))
    position = 0
    do i = 1, attractor_count
      catalogue(i) = unpack_attractor(real(packed(position + 1:position + nint(packed(position + 1))), wp))
      position = position + nint(packed(position + 1))
    end do
    do i = 1, points
      call run_trajectory(moving, catalogue, span, real(starts(:, i), wp), outcome)
      results(:, i) = real([real(outcome%reason, wp), real(outcome%attractor, wp), &
                            real(outcome%features%regime, wp), outcome%x, outcome%v, &
                            real(outcome%impacts, wp)], c_double)
    end do
    separatrix_reference_run = 0
  end function separatrix_reference_run

  !> A text that ends with a null.
  pure function text_at(characters) result(text)
    character(kind=c_char), intent(in) :: characters(*)
    character(len=:), allocatable :: text
    integer :: length, i
    length = 0
    do while (characters(length + 1) /= c_null_char)
      length = length + 1
    end do
    allocate (character(len=length) :: text)
    do i = 1, length
      text(i:i) = characters(i)
    end do
  end function text_at

end module reference_library
