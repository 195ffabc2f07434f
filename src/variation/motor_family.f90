! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A body with a motor over a parameter of its laws.
module motor_family
  use body_family, only: family_t
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: change_parameter, law_choice_t
  use motor_body, only: motor_body_t, set_motor_body, why_not_varied
  use motor_machine, only: motor_machine_t, prepare_motor_machine
  use status, only: exit_bad_case
  implicit none
  private

  public :: motor_body_of_family

contains

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  pure subroutine motor_body_of_family(family, value, body, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(motor_body_t), intent(out) :: body
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    character(len=:), allocatable :: why
    real(wp) :: sizes(2)
    logical :: known
    laws = family%laws
    if (allocated(family%path)) call change_parameter(laws, family%path, value, known)
    call prepare_motor_machine(laws, family%options, body%machine, error)
    if (allocated(error)) return
    why = why_not_varied(body%machine)
    if (len(why) > 0) then
      call fail(error, exit_bad_case, why)
      return
    end if
    sizes = reach_of(body%machine)*[1.0_wp, body%machine%drive_frequency]
    if (family%sizes(1) > 0) sizes = family%sizes
    call set_motor_body(sizes, body)
  end subroutine motor_body_of_family

  !> Size of the positions [m]: at resonance that of the foot times the quality of the oscillator, up to ten, and as far as a stop
  !> allows.
  pure real(wp) function reach_of(machine) result(reach)
    type(motor_machine_t), intent(in) :: machine
    real(wp), parameter :: most_quality = 10
    real(wp) :: quality, room
    associate (system => machine%motor%system, length => machine%sizes%length)
      quality = most_quality
      if (system%friction%damping > 0) quality = sqrt(system%stiffness*system%mass)/system%friction%damping
      reach = length*max(1.0_wp, min(quality, most_quality))
      room = min(system%contact%upper - system%free_length, system%free_length - system%contact%lower)
      if (machine%has_stops) reach = min(reach, max(length, abs(room)))
    end associate
  end function reach_of

end module motor_family
