! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body by expressions over a parameter of its laws.
module own_family
  use body_family, only: family_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t
  use own_body, only: own_body_t, set_own_body, why_not_varied
  use own_machine, only: own_machine_t, prepare_own_machine
  use status, only: exit_bad_case
  implicit none
  private

  public :: own_body_of_family

contains

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  pure subroutine own_body_of_family(family, value, body, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(own_body_t), intent(out) :: body
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    character(len=:), allocatable :: why
    real(wp) :: sizes(2)
    logical :: known
    laws = family%laws
    if (allocated(family%path)) call change_parameter(laws, family%path, value, known)
    call prepare_own_machine(laws, family%options, body%machine, error)
    if (allocated(error)) return
    why = why_not_varied(body%machine)
    if (len(why) > 0) then
      call fail(error, exit_bad_case, why)
      return
    end if
    sizes = body%machine%sizes%length*[1.0_wp, body%machine%drive_frequency]
    if (family%sizes(1) > 0) sizes = family%sizes
    call set_own_body(sizes, turns_smoothly(laws, body%machine), body)
    if (any([body%flows%tape%is_full])) call fail(error, exit_bad_case, 'body.law: too many operations in the expressions of '// &
                                                  'the case for their derivatives')
  end subroutine own_body_of_family

  !> Whether no force depends on the direction of the motion: there is no dry friction.
  pure logical function turns_smoothly(laws, machine)
    type(law_choice_t), intent(in) :: laws(:)
    type(own_machine_t), intent(in) :: machine
    integer :: i
    turns_smoothly = .true.
    do i = 1, size(laws)
      if (laws(i)%family == 'friction') turns_smoothly = laws(i)%name == 'none' .or. laws(i)%name == 'viscous'
    end do
    turns_smoothly = turns_smoothly .and. .not. machine%motor%system%friction%break_away > 0
  end function turns_smoothly

end module own_family
