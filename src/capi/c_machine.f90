! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The machine of a model with other values, ready for whole trajectories as the program flies them.
module c_machine
  use axis, only: axis_t
  use basin, only: open_ensemble
  use case_check, only: beyond
  use case_setup, only: grid_of
  use case_type, only: case_t
  use errors, only: error_t
  use lane_slots, only: prepare_flow
  use grid, only: grid_t, slice_motion
  use kinds, only: int64, wp
  use model_type, only: check_values, model_t
  use parameter_list, only: put_values
  use span_check, only: check_periods
  use trajectory_slots, only: describe_all, describe_regime, ensemble_t
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  implicit none
  private

  public :: is_start, prepare_machine, start_problem

  !> The case with its values, the starts of its axes as a grid of one slice, and the machine.
  type, public :: prepared_t
    type(case_t) :: the_case
    type(grid_t) :: grid
    type(ensemble_t) :: ensemble
  end type prepared_t

contains

  !> A model with `values` in the parameters `chosen`, for trajectories of `span`, of a drive period or more if they are
  !> `to_label`. Code 64 or 65 if the values, or the machine with them, are refused.
  subroutine prepare_machine(model, chosen, values, span, to_label, prepared, error)
    type(model_t), intent(in) :: model
    integer, intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    type(span_t), intent(in) :: span
    logical, intent(in) :: to_label
    type(prepared_t), intent(out) :: prepared
    type(error_t), allocatable, intent(out) :: error
    type(axis_t), allocatable :: axes(:)
    integer :: i
    call check_values(model, chosen, values, error)
    if (allocated(error)) return
    prepared%the_case = model%the_case
    call put_values(prepared%the_case%laws, model%parameters(chosen), values)
    allocate (axes(0))
    do i = 1, size(model%the_case%axes)
      associate (one => model%the_case%axes(i))
        if (any(one%name == [character(len=20) :: 'x0', 'v0', 'crank_angle', 'motor.crank_speed', 'motor.start_current', &
                             'motor.start_integral'])) axes = [axes, one]
      end associate
    end do
    prepared%grid = grid_of(prepared%the_case, axes)
    if (to_label) then
      call open_ensemble(prepared%grid, span, 0_int64, describe_all, prepared%ensemble, error)
      return
    end if
    associate (ensemble => prepared%ensemble)
      call slice_motion(prepared%grid, 0_int64, ensemble%moving, error)
      if (.not. allocated(error)) call check_periods(span, ensemble%moving%period, error)
      if (allocated(error)) return
      ensemble%span = span
      ensemble%describe = describe_regime
      call prepare_flow(ensemble%moving, ensemble%flow)
    end associate
  end subroutine prepare_machine

  !> Why a start [x0, v0, crank angle] cannot be flown; '' if it can.
  pure function start_problem(prepared, start) result(problem)
    type(prepared_t), intent(in) :: prepared
    real(wp), intent(in) :: start(3)
    character(len=:), allocatable :: problem
    type(axis_t) :: no_axes(0)
    problem = 'found a number that is not finite'
    if (.not. all(ieee_is_finite(start))) return
    problem = ''
    if (prepared%ensemble%moving%allows(start)) return
    problem = beyond(prepared%the_case, no_axes, start(1))
    if (len(problem) == 0) problem = 'found bodies beyond a stop of a [contact.NAME], allowed within all of them'
  end function start_problem

  !> Whether a start of 3 numbers or more is one: finite, and not beyond a barrier. Of what is asked of many starts by many
  !> threads no text is made.
  pure logical function is_start(prepared, start)
    type(prepared_t), intent(in) :: prepared
    real(wp), intent(in) :: start(:)
    is_start = all(ieee_is_finite(start))
    if (is_start) is_start = prepared%ensemble%moving%allows(start)
  end function is_start

end module c_machine
