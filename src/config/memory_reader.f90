! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction of one body with memory, written out as a state and a force by expressions of the parameters of its table. The laws
!> are those of `bristle_law`.
module memory_reader
  use angle_units, only: unit_of
  use case_source, only: case_source_t, report
  use law_row, only: any_value
  use law_table, only: force_family, law_choice, law_choice_t, law_text_t, own_law, parameter_row_t, parameter_value_t, &
    state_family
  use memory_rows, only: memory_names
  use part_names, only: is_table
  use restoring_law, only: position_is_angle
  implicit none
  private

  public :: write_out_memory

  !> Names of the state and of the force.
  character(len=*), parameter :: state_name = 'deflection', force_name = 'friction'
  !> Square of a difference of exponents that is none.
  character(len=*), parameter :: whole = '1e-20'
  character(len=*), parameter :: u = '(v - friction.velocity)', z = state_name, s0 = 'friction.stiffness', &
    share = s0//'*'//z//'/friction.force'

contains

  !> Appends the state and the force of the friction of `choices` to them, if it has a memory.
  subroutine write_out_memory(source, choices)
    type(case_source_t), intent(inout) :: source
    type(law_choice_t), allocatable, intent(inout) :: choices(:)
    type(law_choice_t) :: state
    type(parameter_row_t) :: row
    type(parameter_value_t) :: zero
    character(len=:), allocatable :: law
    integer :: at
    at = findloc(choices%family, 'friction', dim=1)
    law = trim(choices(at)%name)
    if (all(memory_names /= law)) return
    call refuse_name(source, state_family//'.'//state_name)
    call refuse_name(source, force_family//'.'//force_name)
    state = written_out(state_family, state_name, 'rate', rate_text(law))
    row = parameter_row_t(state_family, own_law, 'start', unit_of('m', position_is_angle(choices)), any_value, 'of an expression')
    state%own = [row]
    zero%values = [0]
    state%parameters = [zero]
    choices = [choices, state, written_out(force_family, force_name, 'force', force_text(law))]
  end subroutine write_out_memory

  !> A law by an expression without parameters of its own.
  function written_out(family, label, key, text) result(choice)
    character(len=*), intent(in) :: family, label, key, text
    type(law_choice_t) :: choice
    choice = law_choice(family, own_law)
    choice%label = label
    choice%is_derived = .true.
    allocate (choice%own(0))
    choice%texts = [law_text_t(key, text)]
  end function written_out

  !> z' over u and z.
  pure function rate_text(law) result(text)
    character(len=*), intent(in) :: law
    character(len=:), allocatable :: text
    select case (law)
    case ('dahl')
      ! The deflection only approaches F/s0, from either side: the power keeps off its singularity there.
      text = u//'*if('//u//' > 0, '//left('-')//', '//left('+')//')'
    case ('bouc_wen')
      text = u//'*(1 - (friction.shape*sign('//u//'*'//z//') + 1 - friction.shape)*'// &
        unless_whole('friction.exponent', '1', 'abs('//share//')')//')'
    case default
      text = u//' - abs('//u//')*'//s0//'*'//z//'/(friction.force + (friction.static_force - friction.force)'// &
        '*exp(-'//unless_whole('friction.stribeck_exponent', '2', '(abs('//u//')/friction.stribeck_velocity)')//'))'
    end select
  end function rate_text

  !> |w|^n sgn w of w = 1 -+ z/z_m.
  pure function left(sign) result(text)
    character(len=1), intent(in) :: sign
    character(len=:), allocatable :: text
    text = '(1 '//sign//' '//share//')'
    text = text//'*if((friction.exponent - 1)^2 > '//whole//', max(abs('//text//'), 1e-9)^(friction.exponent - 1), 1)'
  end function left

  !> A power of `base` of the exponent of a key, as a product where it is the whole number `n`: that has a Taylor series at zero,
  !> too.
  pure function unless_whole(key, n, base) result(text)
    character(len=*), intent(in) :: key, n, base
    character(len=:), allocatable :: text
    text = 'if(('//key//' - '//n//')^2 > '//whole//', '//base//'^'//key//', '//base//'^'//n//')'
  end function unless_whole

  pure function force_text(law) result(text)
    character(len=*), intent(in) :: law
    character(len=:), allocatable :: text
    text = '-'//s0//'*'//z
    if (law == 'lugre') text = text//' - friction.bristle_damping*'//state_family//'.'//state_name//'.rate - friction.damping*'//u
  end function force_text

  !> The case has no table of the same name.
  subroutine refuse_name(source, table)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: table
    if (is_table(source, table)) call report(source, table, 'found the name that friction with memory has, allowed any other')
  end subroutine refuse_name

end module memory_reader
