! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From laws to a machine ready to move, of one body, two, or several.
module build_motion
  use build_jointed, only: is_jointed, jointed_of
  use constants, only: two_pi
  use errors, only: error_t, fail
  use jointed, only: jointed_t
  use jointed_motion, only: prepare_jointed
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motion, only: motion_t, prepare_motion
  use motion_state, only: flight_adaptive, options_t
  use oscillator, only: build_oscillator, oscillator_t
  use pair, only: build_pair, is_pair, pair_t
  use pair_modes, only: prepare_pair
  use status, only: exit_bad_case
  implicit none
  private

  public :: machine_of, period_of

contains

  !> The machine that `laws` describe. Two bodies are in `moving%pair`; `moving%machine` then has their section,
  !> contact and stops, and nothing that moves.
  pure subroutine machine_of(laws, options, moving, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    type(oscillator_t) :: machine
    type(pair_t) :: pair
    if (is_jointed(laws)) then
      call jointed_machine_of(laws, options, moving, error)
      return
    end if
    if (.not. is_pair(laws)) then
      call build_oscillator(laws, machine, error)
      if (.not. allocated(error)) call prepare_motion(machine, options, moving, error)
      return
    end if
    call build_pair(laws, pair, error)
    if (allocated(error)) return
    if (options%flight == flight_adaptive) then
      call fail(error, exit_bad_case, 'integrator.flight = "adaptive": two bodies are flown in closed form; use "auto"')
      return
    end if
    moving%options = options
    moving%machine%mass = pair%driven_mass
    moving%machine%period = pair%period
    moving%machine%drive_frequency = two_pi/pair%period
    moving%machine%contact = pair%contact
    allocate (moving%machine%drive%cosine(0), moving%machine%drive%sine(0), moving%pair)
    call prepare_pair(pair, options, moving%pair)
  end subroutine machine_of

  !> A machine of several bodies, in `moving%jointed`; `moving%machine` has its section, and the mass that is watched.
  pure subroutine jointed_machine_of(laws, options, moving, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    type(jointed_t) :: machine
    call jointed_of(laws, machine, error)
    if (allocated(error)) return
    moving%options = options
    moving%machine%mass = machine%mass(machine%watched, machine%watched)
    moving%machine%period = machine%period
    moving%machine%drive_frequency = machine%frequency
    allocate (moving%machine%drive%cosine(0), moving%machine%drive%sine(0), moving%jointed)
    call prepare_jointed(machine, options, moving%jointed)
  end subroutine jointed_machine_of

  !> Period of the section of the machine that `laws` describe [s].
  pure subroutine period_of(laws, period, error)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(out) :: period
    type(error_t), allocatable, intent(out) :: error
    type(oscillator_t) :: machine
    type(pair_t) :: pair
    type(jointed_t) :: jointed
    period = 0
    if (is_jointed(laws)) then
      call jointed_of(laws, jointed, error)
      if (.not. allocated(error)) period = jointed%period
    else if (is_pair(laws)) then
      call build_pair(laws, pair, error)
      if (.not. allocated(error)) period = pair%period
    else
      call build_oscillator(laws, machine, error)
      if (.not. allocated(error)) period = machine%period
    end if
  end subroutine period_of

end module build_motion
