! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines with a motor, for suites. Y: a scotch yoke, no friction, no stop; I: the same with dry friction and a stop; R, RI: an
!> unbalance in place of the yoke; P: lever mechanism, dry friction and a stop. All but P have a DC motor without inductance.
module motor_machines
  use kinds, only: wp
  use law_table, only: law_choice, law_choice_t, set_value
  implicit none
  private

  public :: machine_of_letter, yoke, unbalanced, lever, set_dc, set_friction

  real(wp), parameter, public :: stiffness = 88.82643960980423_wp
  integer, parameter, public :: body = 1, restoring = 2, friction = 3, contact = 4, drive = 5, motor = 6

contains

  !> 'Y', 'I', 'R', 'RI' at a voltage [V], 'P' with a no-load speed [rad/s].
  function machine_of_letter(letter, value) result(laws)
    character(len=*), intent(in) :: letter
    real(wp), intent(in) :: value
    type(law_choice_t) :: laws(6)
    select case (letter)
    case ('Y')
      laws = yoke(0.02_wp, 0.5_wp, value)
    case ('I')
      laws = yoke(0.03_wp, 0.2_wp, value)
      call set_friction(laws, 0.3_wp, 0.45_wp)
    case ('R')
      laws = unbalanced(0.02_wp, 0.5_wp, value)
    case ('RI')
      laws = unbalanced(0.03_wp, 0.2_wp, value)
      call set_friction(laws, 0.3_wp, 0.45_wp)
    case default
      laws = lever(value)
    end select
    if (letter == 'I' .or. letter == 'RI') call set_stop(laws, 0.12_wp, 0.7_wp)
  end function machine_of_letter

  !> Body of mass 1 on the spring, viscous friction.
  subroutine set_body(damping, laws)
    real(wp), intent(in) :: damping
    type(law_choice_t), intent(inout) :: laws(6)
    laws(body) = law_choice('body', 'point_mass')
    call set_value(laws(body), 'mass', [1.0_wp])
    call set_value(laws(body), 'gravity', [1.0_wp])
    laws(restoring) = law_choice('restoring', 'linear')
    call set_value(laws(restoring), 'stiffness', [stiffness])
    laws(friction) = law_choice('friction', 'viscous')
    call set_value(laws(friction), 'damping', [damping])
    laws(contact) = law_choice('contact', 'none')
  end subroutine set_body

  function yoke(amplitude, damping, voltage) result(laws)
    real(wp), intent(in) :: amplitude, damping, voltage
    type(law_choice_t) :: laws(6)
    call set_body(damping, laws)
    laws(drive) = law_choice('drive', 'harmonic')
    call set_value(laws(drive), 'amplitude', [amplitude])
    call set_dc(voltage, 0.0_wp, laws)
  end function yoke

  function unbalanced(moment, damping, voltage) result(laws)
    real(wp), intent(in) :: moment, damping, voltage
    type(law_choice_t) :: laws(6)
    laws = yoke(0.0_wp, damping, voltage)
    laws(drive) = law_choice('drive', 'unbalance')
    call set_value(laws(drive), 'moment', [moment])
  end function unbalanced

  !> DC motor of the torque constant 0.5 N m/A and 5 ohm with an inductance [H].
  subroutine set_dc(voltage, inductance, laws)
    real(wp), intent(in) :: voltage, inductance
    type(law_choice_t), intent(inout) :: laws(6)
    laws(motor) = law_choice('motor', 'dc')
    call set_value(laws(motor), 'voltage', [voltage])
    call set_value(laws(motor), 'torque_constant', [0.5_wp])
    call set_value(laws(motor), 'resistance', [5.0_wp])
    call set_value(laws(motor), 'inductance', [inductance])
    call set_value(laws(motor), 'inertia', [0.05_wp])
    call set_value(laws(motor), 'bearing_damping', [0.002_wp])
  end subroutine set_dc

  !> Dry friction [N] sliding and at rest beside the viscous.
  subroutine set_friction(laws, kinetic, static)
    type(law_choice_t), intent(inout) :: laws(6)
    real(wp), intent(in) :: kinetic, static
    real(wp) :: damping
    damping = 0
    if (laws(friction)%name == 'viscous') damping = laws(friction)%parameters(1)%values(1)
    laws(friction) = law_choice('friction', 'coulomb_viscous')
    call set_value(laws(friction), 'kinetic_coefficient', [kinetic])
    call set_value(laws(friction), 'static_coefficient', [static])
    call set_value(laws(friction), 'damping', [damping])
  end subroutine set_friction

  subroutine set_stop(laws, upper, restitution)
    type(law_choice_t), intent(inout) :: laws(6)
    real(wp), intent(in) :: upper, restitution
    laws(contact) = law_choice('contact', 'newton')
    call set_value(laws(contact), 'upper', [upper])
    call set_value(laws(contact), 'lower', [-huge(1.0_wp)])
    call set_value(laws(contact), 'restitution', [restitution])
  end subroutine set_stop

  !> The lever mechanism of the published case with inertias of its links; linear motor of 10 N m.
  function lever(no_load_speed) result(laws)
    real(wp), intent(in) :: no_load_speed
    type(law_choice_t) :: laws(6)
    character(len=*), parameter :: lengths(8) = [character(len=14) :: 'crank', 'pivot_distance', 'lever', 'rod', 'pivot_angle', &
      'guide_height', 'side', 'shift']
    real(wp), parameter :: values(8) = [0.05_wp, 0.075_wp, 0.225_wp, 0.2_wp, -117*3.14159265358979323846264338327950288_wp/180, &
      -0.1_wp, 1.0_wp, 0.224_wp]
    integer :: i
    call set_body(0.0_wp, laws)
    call set_value(laws(restoring), 'free_length', [0.4_wp])
    call set_friction(laws, 1.962_wp, 1.962_wp)
    call set_stop(laws, 1.1_wp, 0.5_wp)
    laws(drive) = law_choice('drive', 'crank_lever_rod')
    do i = 1, 8
      call set_value(laws(drive), trim(lengths(i)), [values(i)])
    end do
    laws(motor) = law_choice('motor', 'linear')
    call set_value(laws(motor), 'stall_torque', [10.0_wp])
    call set_value(laws(motor), 'no_load_speed', [no_load_speed])
    call set_value(laws(motor), 'inertia', [0.5_wp])
    call set_value(laws(motor), 'lever_inertia', [0.00675_wp])
    call set_value(laws(motor), 'rod_mass', [0.3_wp])
    call set_value(laws(motor), 'rod_inertia', [0.001_wp])
    call set_value(laws(motor), 'foot_mass', [0.3_wp])
  end function lever

end module motor_machines
