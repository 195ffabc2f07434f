! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From laws to a machine ready to move, of one body, two, or several.
module build_motion
  use build_multibody, only: is_multibody, multibody_of
  use errors, only: error_t
  use multibody, only: multibody_t
  use multibody_motion, only: prepare_multibody
  use kinds, only: int64, wp
  use law_table, only: law_choice_t
  use motion, only: motion_t, prepare_motion
  use motion_state, only: options_t
  use oscillator, only: build_oscillator, oscillator_t
  use pair, only: build_pair, is_pair, pair_t
  use pair_as_structure, only: structure_of_pair
  implicit none
  private

  public :: machine_of, period_of, limit_budgets

contains

  !> The machine that `laws` describe.
  pure subroutine machine_of(laws, options, moving, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    type(oscillator_t) :: machine
    type(multibody_t) :: structure
    if (is_multibody(laws)) then
      call multibody_of(laws, structure, error)
    else if (is_pair(laws)) then
      call structure_of_two(laws, structure, error)
    else
      call build_oscillator(laws, machine, error)
      if (.not. allocated(error)) call prepare_motion(machine, options, moving, error)
      return
    end if
    if (.not. allocated(error)) call set_structure(structure, options, moving)
  end subroutine machine_of

  !> The structure of two bodies that friction couples.
  pure subroutine structure_of_two(laws, machine, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(multibody_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(pair_t) :: pair
    call build_pair(laws, pair, error)
    if (.not. allocated(error)) call structure_of_pair(pair, machine, error)
  end subroutine structure_of_two

  !> A machine of several bodies, in `moving%multibody`; `moving%machine` has its section, and the mass that is watched.
  pure subroutine set_structure(machine, options, moving)
    type(multibody_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    type(motion_t), intent(out) :: moving
    moving%options = options
    moving%machine%mass = machine%mass(machine%watched, machine%watched)
    moving%machine%period = machine%period
    moving%machine%drive_frequency = machine%frequency
    allocate (moving%machine%drive%cosine(0), moving%machine%drive%sine(0), moving%multibody)
    call prepare_multibody(machine, options, moving%multibody)
  end subroutine set_structure

  !> So many events and steps a trajectory may take at most, or fewer where it may take fewer already.
  pure subroutine limit_budgets(moving, events, steps)
    type(motion_t), intent(inout) :: moving
    integer(int64), intent(in) :: events, steps
    moving%options%event_budget = min(moving%options%event_budget, events)
    moving%options%step_budget = min(moving%options%step_budget, steps)
    if (allocated(moving%multibody)) moving%multibody%options = moving%options
  end subroutine limit_budgets

  !> Period of the section of the machine that `laws` describe [s].
  pure subroutine period_of(laws, period, error)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(out) :: period
    type(error_t), allocatable, intent(out) :: error
    type(oscillator_t) :: machine
    type(pair_t) :: pair
    type(multibody_t) :: multibody
    period = 0
    if (is_multibody(laws)) then
      call multibody_of(laws, multibody, error)
      if (.not. allocated(error)) period = multibody%period
    else if (is_pair(laws)) then
      call build_pair(laws, pair, error)
      if (.not. allocated(error)) period = pair%period
    else
      call build_oscillator(laws, machine, error)
      if (.not. allocated(error)) period = machine%period
    end if
  end subroutine period_of

end module build_motion
