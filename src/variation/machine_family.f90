! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines over a parameter of their laws, whatever they are made of: one body, with a motor or without, or a structure.
module machine_family
  use body_family, only: body_of_family, family_t
  use build_motion, only: kind_bodies, kind_body, kind_motor, kind_of, kind_own
  use errors, only: error_t, fail
  use hybrid_machine, only: hybrid_t, neighbour_t, neighbourhood_t
  use kinds, only: wp
  use motor_body, only: motor_body_t
  use motor_family, only: motor_body_of_family
  use one_body, only: one_body_t
  use own_body, only: own_body_t
  use own_family, only: own_body_of_family
  use status, only: exit_bad_case
  use structure, only: structure_t
  use structure_family, only: structure_of_family
  use variations, only: stencil_offset
  implicit none
  private

  public :: machine_of_family, machine_neighbourhood

  !> Distance of the neighbours, as a share of the parameter's size.
  real(wp), parameter :: share = merge(2e-4_wp, 1e-7_wp, epsilon(1.0_wp) > 1e-20_wp)
  !> Neighbours on both sides; where there is no such machine, above or below.
  integer, parameter :: sides_tried(3) = [0, 1, -1]

contains

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  pure subroutine machine_of_family(family, value, machine, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    class(hybrid_t), allocatable, intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    if (allocated(machine)) deallocate (machine)
    select case (kind_of(family%laws))
    case (kind_motor)
      allocate (motor_body_t :: machine)
    case (kind_bodies)
      allocate (structure_t :: machine)
    case (kind_own)
      allocate (own_body_t :: machine)
    case (kind_body)
      allocate (one_body_t :: machine)
    case default
      call fail(error, exit_bad_case, 'the variations of this kind of machine are not known')
      return
    end select
    ! Not built and then copied: machines with equations on tapes are large.
    select type (machine)
    type is (motor_body_t)
      call motor_body_of_family(family, value, machine, error)
    type is (structure_t)
      call structure_of_family(family, value, machine, error)
    type is (own_body_t)
      call own_body_of_family(family, value, machine, error)
    type is (one_body_t)
      call body_of_family(family, value, machine, error)
    end select
    if (allocated(error)) deallocate (machine)
  end subroutine machine_of_family

  !> The machine and its neighbours in the parameter.
  pure subroutine machine_neighbourhood(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(out) :: machines
    type(error_t), allocatable, intent(out) :: error
    integer :: side
    call machine_of_family(family, value, machines%centre, error)
    if (allocated(error) .or. .not. allocated(family%path)) return
    machines%step = machines%centre%narrowed(share)*max(abs(value), family%parameter_size)
    do side = 1, size(sides_tried)
      machines%side = sides_tried(side)
      call build_neighbours(family, value, machines, error)
      if (.not. allocated(error)) return
    end do
  end subroutine machine_neighbourhood

  !> The neighbours on one side; code 65 if one is out of the parameter's range, or cannot be built.
  pure subroutine build_neighbours(family, value, machines, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(neighbourhood_t), intent(inout) :: machines
    type(error_t), allocatable, intent(out) :: error
    type(neighbour_t), allocatable :: near(:)
    real(wp) :: there
    integer :: i
    allocate (near(4))
    do i = 1, size(near)
      there = value + stencil_offset(machines%side, i)*machines%step
      if (there < family%lowest .or. there > family%highest) call fail(error, exit_bad_case, 'parameter out of its range')
      if (.not. allocated(error)) call machine_of_family(family, there, near(i)%machine, error)
      if (allocated(error)) return
      call near(i)%machine%take_sizes(machines%centre)
    end do
    call move_alloc(near, machines%near)
  end subroutine build_neighbours

end module machine_family
