! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Machines of every kind that lanes know, by number.
module lane_machines
  use body_machine, only: body_machine_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machines, only: build_machine, laws_from, set_parameter, uniform
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  implicit none
  private

  public :: machine_number, machine_of_modes, machine_of_series, machine_of_tables, machine_of_contacts, put_gpu_on_host

  character(len=*), parameter :: variable = 'SEPARATRIX_GPU_ON_HOST'//c_null_char, one = '1'//c_null_char

  interface
    integer(c_int) function set_environment(name, value, replace) bind(c, name='setenv')
      import :: c_char, c_int, one, variable
      character(kind=c_char), intent(in) :: name(len(variable)), value(len(one))
      integer(c_int), value :: replace
    end function set_environment
  end interface

contains

  !> Machine number i: every friction with a closed form, one or two barriers, every law of restitution, ratios on both sides of
  !> resonance.
  function machine_number(i) result(moving)
    integer, intent(in) :: i
    type(body_machine_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    character(len=*), parameter :: frictions(0:3) = [character(len=51) :: 'none', 'coulomb kinetic_coefficient=0.2', &
      'viscous damping=0.4', 'coulomb_viscous kinetic_coefficient=0.1 damping=0.3']
    character(len=*), parameter :: contacts(0:4) = [character(len=60) :: 'newton restitution=0.5', 'newton restitution=0.9', &
      'newton_linear slope=0.1', 'newton_power restitution=0.9 yield_speed=0.1 falloff=0.25', &
      'newton_viscoelastic first=0.3 second=0.02']
    laws = laws_from('body point_mass mass=1 gravity=9.81; restoring linear stiffness=88.8 free_length=0.4;'// &
      'contact '//trim(contacts(modulo(i, 5)))//' upper=1.1; friction '//trim(frictions(modulo(i, 4)))//';'// &
      'drive fourier ratio=1 mean=0.31 cosine=0.095,0.01,-0.02 sine=0,0.028,-0.027')
    call set_parameter(laws, 'drive.ratio', uniform(0.4_wp, 2.3_wp))
    if (modulo(i, 5) < 2) call set_parameter(laws, 'contact.restitution', uniform(0.2_wp, 1.0_wp))
    if (modulo(i, 3) == 0) call set_parameter(laws, 'contact.lower', -0.1_wp)
    if (modulo(i, 15) == 5) laws = [laws, laws_from('effect restitution_curve speed=0,0.5,1,2,4 change=0,-0.1,0.05,-0.2,0.1')]
    moving = build_machine(laws)
  end function machine_number

  !> Machine number i with an equation of its own in each mode: soft barriers that may pull or not, one or two, friction that
  !> depends on the direction or the position.
  function machine_of_modes(i) result(moving)
    integer, intent(in) :: i
    type(body_machine_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    character(len=*), parameter :: contacts(0:3) = [character(len=60) :: 'kelvin_voigt stiffness=1e4 damping=20', &
      'kelvin_voigt stiffness=1e5 damping=100 tension=1', 'newton restitution=0.7', 'kelvin_voigt stiffness=500 damping=0']
    character(len=*), parameter :: effects(0:2) = [character(len=80) :: 'offset_force force=1', &
      'position_dependent_friction slope=0.3', 'viscous damping=0.3; effect asymmetric_friction viscous=0.2']
    laws = laws_from('body point_mass mass=1 gravity=9.81; restoring linear stiffness=88.8 free_length=0.4;'// &
      'contact '//trim(contacts(modulo(i, 4)))//' upper=1.1; friction coulomb kinetic_coefficient=0.1;'// &
      'drive fourier ratio=1 mean=0.31 cosine=0.095,0.01,-0.02 sine=0,0.028,-0.027; effect '//trim(effects(modulo(i, 3))))
    call set_parameter(laws, 'drive.ratio', uniform(0.4_wp, 2.3_wp))
    if (modulo(i, 5) == 0) call set_parameter(laws, 'contact.lower', -0.1_wp)
    moving = build_machine(laws)
  end function machine_of_modes

  !> Machine number i without a closed form: springs, drag and friction that lanes expand in series.
  function machine_of_series(i) result(moving)
    integer, intent(in) :: i
    type(body_machine_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    character(len=*), parameter :: effects(0:6) = [character(len=90) :: 'cubic_spring stiffness=20', &
      'quadratic_drag coefficient=0.05', 'dahl stiffness=300', 'stribeck excess=1 velocity=0.2 exponent=2', &
      'position_dependent_friction slope=0.3; effect cubic_spring stiffness=-5', 'asymmetric_friction viscous=0.2 coulomb=0.3', &
      'stribeck excess=1 velocity=0.05; effect position_dependent_friction slope=0.2']
    character(len=*), parameter :: springs(0:1) = [character(len=40) :: 'linear stiffness=88.8 free_length=0.4', &
      'pendulum moment=60']
    laws = laws_from('body point_mass mass=1 gravity=9.81; restoring '//trim(springs(i/40))//'; contact newton restitution=0.7 '// &
      'upper=1.1; friction coulomb kinetic_coefficient=0.1; drive fourier ratio=1 mean=0.31 cosine=0.095,0.01,-0.02 '// &
      'sine=0,0.028,-0.027; effect '//trim(effects(modulo(i, 7))))
    call set_parameter(laws, 'drive.ratio', uniform(0.4_wp, 2.3_wp))
    if (modulo(i, 5) == 0) call set_parameter(laws, 'contact.lower', -0.1_wp)
    moving = build_machine(laws)
  end function machine_of_series

  !> Machine number i with a force that a table gives, or two, or free play, or damping by the cube of the speed, or friction that
  !> falls to zero on the way.
  function machine_of_tables(i) result(moving)
    integer, intent(in) :: i
    type(body_machine_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    character(len=*), parameter :: effects(0:9) = [character(len=130) :: &
      'friction_curve speed=0,0.5,2,5 upwards=0.4,0,0.1,0.4 downwards=0.1,0.3,0.2,0.3', &
      'friction_curve speed=0.2,0.5,2,5 upwards=0.4,0,0.1,0.4 downwards=0.1,0.3,0.2,0.3; effect asymmetric_friction coulomb=0.2', &
      'spring_curve extension=-0.4,0,0.3,0.6 force=-5,0,2,9', 'force_curve position=0,0.3,0.5,1 force=1,-1,2,0', &
      'friction_position_curve position=0,0.5,1 change=0.3,-0.2,0.4', &
      'friction_position_curve position=0,0.5,1 change=0.3,-0.2,0.4; effect stribeck excess=1 velocity=0.2', &
      'backlash gap=0.1', 'cubic_damping coefficient=0.1; effect spring_curve extension=-0.4,0,0.3 force=-5,0,2', &
      'friction_position_curve position=0.1,0.4,0.8,1.1 change=0.5,-1.2,-1.2,0.5', 'position_dependent_friction slope=-1.5']
    laws = laws_from('body point_mass mass=1 gravity=9.81; restoring linear stiffness=88.8 free_length=0.4; contact newton '// &
      'restitution=0.7 upper=1.1; friction coulomb kinetic_coefficient=0.1; drive fourier ratio=1 mean=0.31 '// &
      'cosine=0.095,0.01,-0.02 sine=0,0.028,-0.027; effect '//trim(effects(modulo(i, 10))))
    call set_parameter(laws, 'drive.ratio', uniform(0.4_wp, 2.3_wp))
    if (modulo(i, 5) == 0) call set_parameter(laws, 'contact.lower', -0.1_wp)
    moving = build_machine(laws)
  end function machine_of_tables

  !> Machine number i whose contacts are expanded in series: exponents that lanes know, damping of every impact, free flights in
  !> closed form and in series.
  function machine_of_contacts(i) result(moving)
    integer, intent(in) :: i
    type(body_machine_t) :: moving
    type(law_choice_t), allocatable :: laws(:)
    character(len=*), parameter :: contacts(0:5) = [character(len=60) :: 'hunt_crossley stiffness=1e6 damping=0.1', &
      'hunt_crossley stiffness=2e4 damping=0.1 exponent=1', 'flores stiffness=1e6 restitution=0.6', &
      'hunt_crossley stiffness=1e7 damping=0 exponent=2.5', 'kelvin_voigt stiffness=1e4 damping=20 tension=1', &
      'hunt_crossley_exact stiffness=3e3 restitution=0.46']
    character(len=*), parameter :: effects(0:10) = [character(len=110) :: 'cubic_spring stiffness=20', 'offset_force force=1', &
      'dahl stiffness=300', 'viscous damping=0.3', 'stribeck excess=0.3 velocity=0.1', 'offset_force force=-20', &
      'stribeck excess=0.3 velocity=0.03 exponent=1', 'backlash gap=0.1 rounding=0.2', &
      'friction_curve speed=0,0.5,2,5 upwards=0.4,0,0.1,0.4 downwards=0.1,0.3,0.2,0.3', &
      'spring_curve extension=-1,0,1 force=-5,0,6; effect force_curve position=0,1.09,1.1,1.13 force=0,0,0.5,2', &
      'friction_position_curve position=0,0.5,1.1,1.14 change=0.3,-0.2,0.4,0']
    laws = laws_from('body point_mass mass=2 gravity=9.81; restoring linear stiffness=88.8 free_length=0.4; contact '// &
      trim(contacts(modulo(i, 6)))//' upper=1.1; friction coulomb kinetic_coefficient=0.1; drive fourier ratio=1 '// &
      'mean=0.31 cosine=0.095,0.01,-0.02 sine=0,0.028,-0.027; effect '//trim(effects(modulo(i, 11))))
    call set_parameter(laws, 'drive.ratio', uniform(0.4_wp, 2.3_wp))
    if (modulo(i, 3) == 0) call set_parameter(laws, 'contact.lower', -0.1_wp)
    moving = build_machine(laws)
  end function machine_of_contacts

  !> The host does what a GPU would do; not with $SEPARATRIX_TEST_GPU, which has a GPU tested.
  subroutine put_gpu_on_host()
    integer :: length
    call get_environment_variable('SEPARATRIX_TEST_GPU', length=length)
    if (length > 0) return
    if (set_environment(variable, one, 1_c_int) /= 0) error stop 'no room in the environment'
  end subroutine put_gpu_on_host

end module lane_machines
