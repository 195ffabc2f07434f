! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What `separatrix trajectory` reports of a motor at the end of a motion: speed, torque and power over the window, and the outcome
!> of a run-up.
module crank_report
  use constants, only: two_pi
  use journal, only: journal_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motion_state, only: log_t
  use motor_choices, only: has_motor, resonance_of
  use text, only: to_text
  implicit none
  private

  public :: crank_outcome, report_crank

contains

  !> One line, of a machine with a motor, over the samples of the last `window` [s].
  subroutine report_crank(journal, laws, window, log)
    type(journal_t), intent(inout) :: journal
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: window
    type(log_t), intent(in) :: log
    real(wp) :: mean, power, torque
    character(len=:), allocatable :: outcome, ratio
    integer :: first, last
    last = log%samples
    if (.not. has_motor(laws) .or. last < 2) return
    first = 1 + count(log%sample_data(1, :last) < log%sample_data(1, last) - window)
    first = min(first, last - 1)
    associate (angle => log%sample_driver(1, first:last), speed => log%sample_driver(2, first:last), &
               values => log%sample_coordinates(:, first:last))
      mean = (angle(size(angle)) - angle(1))/(log%sample_data(1, last) - log%sample_data(1, first))
      torque = sum(values(1, :))/size(angle)
      power = sum(values(3, :))/size(angle)
      outcome = crank_outcome(angle, speed, mean, resonance_of(laws))
      ratio = ''
      if (resonance_of(laws) > 0) ratio = to_text(mean/resonance_of(laws), 4)//' times the natural frequency, '
      call journal%line('crank', 'crank speed '//to_text(mean, 7)//' rad/s ('//ratio//to_text(minval(speed), 5)//' to '// &
        to_text(maxval(speed), 5)//'), torque '//to_text(torque, 5)//' N m (at most '//to_text(maxval(abs(values(1, :))), 5)// &
        '), power '//to_text(power, 5)//' W: '//outcome, '"speed": '//to_text(mean)//', "outcome": "'//outcome//'"')
    end associate
  end subroutine report_crank

  !> Outcome from angles [rad] and speeds [rad/s] over a while, their mean speed, and the speed at resonance (0: none).
  pure function crank_outcome(angle, speed, mean, resonance) result(outcome)
    real(wp), intent(in) :: angle(:), speed(:), mean, resonance
    character(len=:), allocatable :: outcome
    if (.not. any(abs(speed) > 0)) then
      outcome = 'stalled'
    else if (maxval(angle) - minval(angle) < two_pi .and. minval(speed)*maxval(speed) < 0) then
      outcome = 'rocking'
    else if (mean < 0) then
      outcome = 'reversed'
    else if (.not. resonance > 0) then
      outcome = 'turning'
    else
      outcome = trim(merge('passed  ', 'captured', mean > resonance))
    end if
  end function crank_outcome

end module crank_report
