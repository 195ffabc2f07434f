! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From laws to a machine ready to move.
module build_motion
  use body_machine, only: body_machine_t, prepare_body
  use build_multibody, only: is_multibody, multibody_of
  use build_pair, only: is_pair, pair_of
  use errors, only: error_t
  use multibody, only: multibody_t
  use multibody_machine, only: multibody_machine_t, set_structure
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use motor_choices, only: has_motor
  use motor_machine, only: motor_machine_t, prepare_motor_machine
  use own_machine, only: own_machine_t, prepare_own_machine
  use own_names, only: has_own
  use oscillator, only: build_oscillator, oscillator_t
  implicit none
  private

  public :: body_of, bodies_of, kind_of, machine_of, period_of

  !> One body; several, or two that friction or play couples; one with a motor; one by expressions.
  integer, parameter, public :: kind_body = 1, kind_bodies = 2, kind_motor = 3, kind_own = 4

contains

  !> Of which kind the machine is that `laws` describe.
  pure integer function kind_of(laws) result(kind)
    type(law_choice_t), intent(in) :: laws(:)
    kind = kind_body
    if (is_multibody(laws) .or. is_pair(laws)) kind = kind_bodies
    if (has_own(laws)) kind = kind_own
    if (has_motor(laws)) kind = kind_motor
  end function kind_of

  !> The machine that `laws` describe.
  subroutine machine_of(laws, options, machine, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    class(machine_t), allocatable, intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(body_machine_t) :: body
    type(multibody_machine_t) :: bodies
    type(motor_machine_t) :: driven
    type(own_machine_t) :: own
    select case (kind_of(laws))
    case (kind_motor)
      call prepare_motor_machine(laws, options, driven, error)
      if (.not. allocated(error)) allocate (machine, source=driven)
    case (kind_own)
      call prepare_own_machine(laws, options, own, error)
      if (.not. allocated(error)) allocate (machine, source=own)
    case (kind_bodies)
      call bodies_of(laws, options, bodies, error)
      if (.not. allocated(error)) allocate (machine, source=bodies)
    case default
      call body_of(laws, options, body, error)
      if (.not. allocated(error)) allocate (machine, source=body)
    end select
  end subroutine machine_of

  !> The machine of one body that `laws` describe.
  pure subroutine body_of(laws, options, machine, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(body_machine_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(oscillator_t) :: oscillator
    call build_oscillator(laws, oscillator, error)
    if (.not. allocated(error)) call prepare_body(oscillator, options, machine, error)
  end subroutine body_of

  !> The machine of several bodies, or of two that friction or play couples, that `laws` describe.
  pure subroutine bodies_of(laws, options, machine, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(multibody_machine_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(multibody_t) :: structure
    if (is_multibody(laws)) then
      call multibody_of(laws, structure, error)
    else
      call pair_of(laws, structure, error)
    end if
    if (.not. allocated(error)) call set_structure(structure, options, machine)
  end subroutine bodies_of

  !> Period of the section of the machine that `laws` describe [s].
  subroutine period_of(laws, period, error)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(out) :: period
    type(error_t), allocatable, intent(out) :: error
    class(machine_t), allocatable :: machine
    period = 0
    call machine_of(laws, options_t(), machine, error)
    if (.not. allocated(error)) period = machine%period
  end subroutine period_of

end module build_motion
