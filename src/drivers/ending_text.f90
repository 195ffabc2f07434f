! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Why nothing is known of the exponents of a motion.
module ending_text
  use angle_units, only: unit_of
  use eigenvalue_text, only: values_json, values_text
  use exponents, only: ending_t, rests_by_friction, rests_nowhere, rests_on_equilibrium, rests_on_stop, spectrum_t
  use journal, only: json_number, json_text
  use kinds, only: wp
  use law_table, only: law_choice_t, parameter_row_t, rows_of, state_family
  use restoring_law, only: position_is_angle
  use status, only: is_given_up, reason_left_domain, reason_name, reason_time_over
  use text, only: to_text
  implicit none
  private

  public :: why_json, why_not_known

contains

  !> In words, of a machine with these laws.
  pure function why_not_known(spectrum, laws) result(why)
    type(spectrum_t), intent(in) :: spectrum
    type(law_choice_t), intent(in) :: laws(:)
    character(len=:), allocatable :: why
    associate (ending => spectrum%ending)
      if (ending%rest /= rests_nowhere) then
        why = rest_text(ending, laws)
      else if (spectrum%at_rest) then
        why = 'the motion comes to rest: after '//to_text(spectrum%passed)//' sections nothing is left that '// &
              'turns round; the eigenvalues of an equilibrium are those that `separatrix branches` gives'
      else if (is_given_up(spectrum%reason)) then
        why = 'the motion was given up: '//reason_name(spectrum%reason)
      else if (spectrum%reason == reason_left_domain) then
        why = 'the motion grows without bound, or leaves the domain (run.domain)'
      else if (spectrum%reason == reason_time_over .and. ending%lasted > 0) then
        why = 'the body does not turn round within '//to_text(ending%lasted, 6)//' s'
        if (ending%impacts > 0) why = why//', with '//to_text(ending%impacts)//' impacts'
        why = why//'. Its section without a drive is where it turns round; a [drive] with a period gives one at equal times'
      else
        why = 'the motion met an event tangentially, or rests where nothing holds it'
      end if
    end associate
  end function why_not_known

  !> Where it rests, and what holds it.
  pure function rest_text(ending, laws) result(text)
    type(ending_t), intent(in) :: ending
    type(law_choice_t), intent(in) :: laws(:)
    character(len=:), allocatable :: text
    text = trim(merge('the motion comes to rest', 'the motion rests        ', ending%moved))
    select case (ending%rest)
    case (rests_on_equilibrium)
      text = text//' at the '//stability_of(ending%eigenvalues)//'equilibrium '
    case (rests_by_friction)
      text = text//', held by friction at '
    case (rests_on_stop)
      text = text//', held by the barrier at '
    end select
    text = text//'x = '//coordinates(ending%point, laws)
    if (allocated(ending%eigenvalues)) text = text//', eigenvalues '//values_text(ending%eigenvalues)
  end function rest_text

  !> Of an equilibrium, with a space behind it; empty where its eigenvalues do not decide it.
  pure function stability_of(values) result(text)
    complex(wp), intent(in) :: values(:)
    character(len=:), allocatable :: text
    !> As a share of the largest.
    real(wp), parameter :: rounding = 1e-9_wp
    text = ''
    associate (room => rounding*maxval(abs(values)))
      if (all(real(values) < -room)) text = 'stable '
      if (any(real(values) > room)) text = 'unstable '
    end associate
  end function stability_of

  !> Position and states, with their units.
  pure function coordinates(point, laws) result(text)
    real(wp), intent(in) :: point(:)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=:), allocatable :: text, unit
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i, k
    text = to_text(point(1), 9)//' '//unit_of('m', position_is_angle(laws))
    k = 2
    do i = 1, size(laws)
      if (laws(i)%family /= state_family .or. k >= size(point)) cycle
      k = k + 1
      rows = rows_of(laws(i))
      unit = trim(rows(findloc(rows%name == 'start', .true., dim=1))%unit)
      text = text//', '//trim(laws(i)%label)//' = '//to_text(point(k), 9)
      if (unit /= '1') text = text//' '//unit
    end do
  end function coordinates

  !> The same as fields of a line of JSON, with a comma before each.
  pure function why_json(spectrum) result(text)
    type(spectrum_t), intent(in) :: spectrum
    character(len=:), allocatable :: text
    character(len=*), parameter :: names(3) = [character(len=11) :: 'equilibrium', 'friction', 'barrier']
    text = ''
    if (is_given_up(spectrum%reason) .or. any(spectrum%reason == [reason_left_domain, reason_time_over])) then
      text = ', "reason": '//json_text(reason_name(spectrum%reason))
    end if
    associate (ending => spectrum%ending)
      if (ending%rest == rests_nowhere) return
      text = text//', "rest": '//json_text(trim(names(ending%rest)))//', "x": '//json_number(ending%point(1))
      if (allocated(ending%eigenvalues)) text = text//', "eigenvalues": '//values_json(ending%eigenvalues)
    end associate
  end function why_json

end module ending_text
