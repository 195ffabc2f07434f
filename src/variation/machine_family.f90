! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines over a parameter of their laws, whatever they are made of: one body, with a motor or without, or a structure.
module machine_family
  use body_family, only: body_neighbourhood, body_of_family, family_t
  use build_motion, only: has_several
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t, neighbourhood_t
  use kinds, only: wp
  use motor_body, only: motor_body_t
  use motor_choices, only: has_motor
  use motor_family, only: motor_body_of_family, motor_neighbourhood
  use one_body, only: one_body_t
  use structure, only: structure_t
  use structure_family, only: structure_neighbourhood, structure_of_family
  implicit none
  private

  public :: machine_of_family, machine_neighbourhood

contains

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  subroutine machine_of_family(family, value, machine, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    class(hybrid_t), allocatable, intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(one_body_t) :: body
    type(structure_t) :: structure
    type(motor_body_t) :: driven
    if (has_motor(family%laws)) then
      call motor_body_of_family(family, value, driven, error)
      if (.not. allocated(error)) allocate (machine, source=driven)
    else if (has_several(family%laws)) then
      call structure_of_family(family, value, structure, error)
      if (.not. allocated(error)) allocate (machine, source=structure)
    else
      call body_of_family(family, value, body, error)
      if (.not. allocated(error)) allocate (machine, source=body)
    end if
  end subroutine machine_of_family

  !> The machine and its neighbours in the parameter.
  pure subroutine machine_neighbourhood(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(out) :: machines
    type(error_t), allocatable, intent(out) :: error
    if (has_motor(family%laws)) then
      call motor_neighbourhood(family, value, machines, error)
    else if (has_several(family%laws)) then
      call structure_neighbourhood(family, value, machines, error)
    else
      call body_neighbourhood(family, value, machines, error)
    end if
  end subroutine machine_neighbourhood

end module machine_family
