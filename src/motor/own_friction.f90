! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Friction and restitution over the speed, by an expression of the case or a law of the catalogue.
module own_friction
  use equation_sheet, only: add_node, add_optional, add_parameter, define, node_of
  use errors, only: error_t
  use friction_law, only: friction_of
  use kinds, only: wp
  use law_table, only: law_choice_t, own_law, value_of
  use law_texts, only: is_own
  use motor_choices, only: number_of_family
  use motor_system, only: motor_system_t
  use own_names, only: add_known, names_t, read_own
  use tape, only: constant
  use tape_algebra, only: choice
  use tape_sign, only: positive_part
  use text, only: to_text
  implicit none
  private

  public :: add_friction, add_restitution

contains

  !> Friction of a slipping body, and what holds it at rest.
  pure subroutine add_friction(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(in) :: names
    type(error_t), allocatable, intent(out) :: error
    type(names_t) :: over_speed
    integer :: node, zero, held
    associate (sheet => system%sheet)
      call define(sheet, 'speed', 'slip*v')
      call constant(sheet%tape, 0.0_wp, zero)
      if (choices(at)%name == own_law) then
        over_speed = names
        call add_known(over_speed, 'speed', node_of(sheet, 'speed'))
        call read_own(over_speed, choices, at, 'force', sheet, node, error)
        if (allocated(error)) return
        call add_node(sheet, 'resistance', node)
        over_speed%nodes(size(over_speed%nodes)) = zero
        call read_own(over_speed, choices, at, 'force', sheet, node, error)
        if (allocated(error)) return
        held = node
        ! A friction that pushes holds nothing.
        if (.not. sheet%tape%nodes(node)%is_steady) call choice(sheet%tape, node, 1, node, zero, held)
        call add_node(sheet, 'rest', held)
        call define(sheet, 'viscous', '0')
      else
        call add_load(choices, at, system, names, error)
        if (allocated(error)) return
        call add_catalogue_friction(system)
      end if
      call define(sheet, 'dry', 'slip*resistance')
      call define(sheet, 'friction', 'dry + viscous*v')
      call define(sheet, 'static', 'rest + least')
      system%rest_friction = node_of(sheet, 'rest')
    end associate
  end subroutine add_friction

  !> The normal force: that of an expression, none where it is negative, or the weight, which is then part of the law.
  pure subroutine add_load(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(in) :: names
    type(error_t), allocatable, intent(out) :: error
    integer :: node, load
    associate (sheet => system%sheet)
      if (is_own(choices(at))) then
        system%friction = friction_of(choices(at), 1.0_wp)
        call read_own(names, choices, at, 'load', sheet, node, error)
        if (allocated(error)) return
        call add_node(sheet, 'given_load', node)
        call positive_part(sheet%tape, sheet%parameters, node, load)
        call add_node(sheet, 'load', load)
      else
        system%friction = friction_of(choices(at), system%mass*value_of(choices(number_of_family(choices, 'body')), 'gravity'))
        call define(sheet, 'load', '1')
      end if
    end associate
  end subroutine add_load

  pure subroutine add_catalogue_friction(system)
    type(motor_system_t), intent(inout) :: system
    associate (sheet => system%sheet, law => system%friction)
      call add_optional(sheet, 'kinetic', law%kinetic)
      call add_parameter(sheet, 'excess', law%excess)
      call add_parameter(sheet, 'stribeck_velocity', law%stribeck_velocity)
      call add_optional(sheet, 'viscous', law%damping)
      call add_optional(sheet, 'break_away', law%break_away)
      call define(sheet, 'rest', 'load*break_away')
      if (law%excess > 0) then
        call define(sheet, 'resistance', 'load*(kinetic + excess*exp(-(speed/stribeck_velocity)^'// &
                    to_text(nint(law%stribeck_exponent))//'))')
      else
        call define(sheet, 'resistance', 'load*kinetic')
      end if
    end associate
  end subroutine add_catalogue_friction

  !> Restitution over the impact speed.
  pure subroutine add_restitution(choices, at, system, names, error)
    type(law_choice_t), intent(in) :: choices(:)
    integer, intent(in) :: at
    type(motor_system_t), intent(inout) :: system
    type(names_t), intent(in) :: names
    type(error_t), allocatable, intent(out) :: error
    type(names_t) :: over_speed
    if (choices(at)%name /= own_law) return
    over_speed = names
    call add_known(over_speed, 'speed', node_of(system%sheet, 'speed'))
    call read_own(over_speed, choices, at, 'restitution', system%sheet, system%restitution, error)
  end subroutine add_restitution

end module own_friction
