! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Two bodies coupled by dry friction alone. The driving body m1 has spring, viscous damping and drive; the driven body
!> m2 feels the interface and a stop:
!>   m1 v1' = u - a1 v1 + a2 (l0 - x1) - f,   m2 v2' = f - F_c,   f in b Sgn(v1 - v2).
!> The stop bounds x2 (fixed to the ground) or x2 - x1 (carried by m1: backlash).
module pair
  use constants, only: two_pi
  use contact_law, only: barrier_positions, contact_of, contact_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: effect_family, law_choice_t, table_of, value_of
  use status, only: exit_bad_case
  implicit none
  private

  public :: build_pair, is_pair

  !> How m1 is driven: by a force, by its motion being given, by a controller that follows a reference.
  integer, parameter, public :: driven_by_force = 0, driven_by_motion = 1, driven_by_controller = 2

  type, public :: pair_t
    !> m1 and m2 [kg]; of m1 a given motion takes no notice.
    real(wp) :: mass = 1, driven_mass = 1
    !> a2 [N/m], l0 [m], a1 [N s/m], b [N].
    real(wp) :: stiffness = 0, free_length = 0, damping = 0, friction = 0
    integer :: drive = driven_by_force
    !> Force [N], motion [m] or reference [m]: mean + amplitude cos(phi) + quadrature sin(phi), phi = frequency t
    !> [rad/s], + velocity t [m/s].
    real(wp) :: mean = 0, amplitude = 0, quadrature = 0, frequency = 0, velocity = 0
    !> Controller: u = P e + I (integral of e) + D e', e = reference - x1; sampled at equal times [s], 0 = continuous.
    real(wp) :: proportional = 0, integral = 0, derivative = 0, sample_time = 0
    type(contact_t) :: contact
    !> Upper and lower stop [m]; huge means none.
    real(wp) :: upper = huge(1.0_wp), lower = -huge(1.0_wp)
    !> The stop is carried by m1.
    logical :: carried = .false.
    !> Impulse on m2 [N s] and its time since the start [s].
    real(wp) :: impulse = 0, impulse_time = 0
    !> Position [m] and velocity [m/s] of m1 at the start.
    real(wp) :: driver_x0 = 0, driver_v0 = 0
    !> Period of the section [s]: of the drive, the spring with both bodies, or one second.
    real(wp) :: period = 1
  end type pair_t

contains

  !> Whether the laws describe two bodies.
  pure logical function is_pair(choices)
    type(law_choice_t), intent(in) :: choices(:)
    integer :: i
    is_pair = .false.
    do i = 1, size(choices)
      if (choices(i)%family == 'body') is_pair = choices(i)%name == 'friction_pair' .or. choices(i)%name == 'backlash_pair'
    end do
  end function is_pair

  !> The machine of one law per family. Refuses laws that a pair does not admit; the message begins with the key.
  pure subroutine build_pair(choices, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(pair_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: positions(2)
    integer :: i
    do i = 1, size(choices)
      if (choices(i)%family == 'body') call take_bodies(choices(i), machine)
    end do
    do i = 1, size(choices)
      select case (choices(i)%family)
      case ('restoring')
        if (choices(i)%name == 'linear') then
          machine%stiffness = value_of(choices(i), 'stiffness')
          machine%free_length = value_of(choices(i), 'free_length')
        end if
      case ('friction')
        if (choices(i)%name == 'viscous') then
          machine%damping = value_of(choices(i), 'damping')
        else if (choices(i)%name /= 'none') then
          call fail(error, exit_bad_case, 'friction.law: found "'//trim(choices(i)%name)//'", allowed with two bodies '// &
                    'none, viscous: it acts between the ground and the driving body')
          return
        end if
      case ('drive')
        call take_drive(choices(i), machine, error)
        if (allocated(error)) return
      case (effect_family)
        call fail(error, exit_bad_case, table_of(effect_family, choices(i)%name)//': found with two bodies, allowed with '// &
                  'body.law = "point_mass"')
        return
      end select
    end do
    do i = 1, size(choices)
      if (choices(i)%family == 'contact') machine%contact = contact_of(choices(i), impact_mass(machine))
    end do
    positions = barrier_positions(machine%contact)
    machine%upper = positions(1)
    machine%lower = positions(2)
    if (machine%frequency > 0) then
      machine%period = two_pi/machine%frequency
    else if (machine%stiffness > 0 .and. machine%drive /= driven_by_motion) then
      machine%period = two_pi*sqrt((machine%mass + machine%driven_mass)/machine%stiffness)
    end if
  end subroutine build_pair

  !> The mass that an impact between the two bodies sees, or of m2 with the ground or with a given motion [kg].
  pure real(wp) function impact_mass(machine)
    type(pair_t), intent(in) :: machine
    impact_mass = machine%driven_mass
    if (machine%carried .and. machine%drive /= driven_by_motion) impact_mass = &
      machine%mass*machine%driven_mass/(machine%mass + machine%driven_mass)
  end function impact_mass

  pure subroutine take_bodies(choice, machine)
    type(law_choice_t), intent(in) :: choice
    type(pair_t), intent(inout) :: machine
    machine%carried = choice%name == 'backlash_pair'
    machine%mass = value_of(choice, 'mass')
    machine%driven_mass = value_of(choice, 'driven_mass')
    machine%friction = value_of(choice, 'friction')
    machine%driver_x0 = value_of(choice, 'driver_x0')
    machine%driver_v0 = value_of(choice, 'driver_v0')
    machine%impulse = value_of(choice, 'impulse')
    machine%impulse_time = value_of(choice, 'impulse_time')
  end subroutine take_bodies

  pure subroutine take_drive(choice, machine, error)
    type(law_choice_t), intent(in) :: choice
    type(pair_t), intent(inout) :: machine
    type(error_t), allocatable, intent(out) :: error
    select case (choice%name)
    case ('none')
      return
    case ('force')
      machine%mean = value_of(choice, 'mean')
    case ('velocity')
      machine%drive = driven_by_motion
    case ('sine')
      machine%drive = driven_by_motion
    case ('pid_velocity', 'pid_sine')
      machine%drive = driven_by_controller
      machine%proportional = value_of(choice, 'proportional')
      machine%integral = value_of(choice, 'integral')
      machine%derivative = value_of(choice, 'derivative')
      machine%sample_time = value_of(choice, 'sample_time')
    case default
      call fail(error, exit_bad_case, 'drive.law: found "'//trim(choice%name)//'", allowed with two bodies none, force, '// &
                'velocity, sine, pid_velocity, pid_sine')
      return
    end select
    select case (choice%name)
    case ('velocity', 'pid_velocity')
      machine%velocity = value_of(choice, 'velocity')
    case ('force')
      machine%amplitude = value_of(choice, 'amplitude')
      machine%frequency = value_of(choice, 'frequency')
    case default
      machine%quadrature = value_of(choice, 'amplitude')
      machine%frequency = value_of(choice, 'frequency')
    end select
  end subroutine take_drive

end module pair
