! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What `separatrix trajectory` reports of a motor at the end of a motion: speed, torque and power over the window, and the outcome
!> of a run-up; in the log and as attributes.
module crank_report
  use crank_summary, only: crank_outcomes, crank_summary_t, crank_table, crank_values, summarize_crank
  use journal, only: journal_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use map_schema, only: schema_t
  use motion_state, only: log_t
  use motor_choices, only: has_motor, resonance_of
  use text, only: to_text
  implicit none
  private

  public :: describe_crank, report_crank

contains

  !> Summary over the samples of the last `window` [s]; `known`: there is a motor, and there are samples.
  subroutine summary_of_window(laws, window, log, summary, known)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: window
    type(log_t), intent(in) :: log
    type(crank_summary_t), intent(out) :: summary
    logical, intent(out) :: known
    integer :: first, last
    last = log%samples
    known = has_motor(laws) .and. last > 1
    if (.not. known) return
    first = min(1 + count(log%sample_data(1, :last) < log%sample_data(1, last) - window), last - 1)
    call summarize_crank(laws, log, first, last, summary)
  end subroutine summary_of_window

  !> One line, of a machine with a motor.
  subroutine report_crank(journal, laws, window, log)
    type(journal_t), intent(inout) :: journal
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: window
    type(log_t), intent(in) :: log
    type(crank_summary_t) :: crank
    character(len=:), allocatable :: outcome, ratio
    logical :: known
    call summary_of_window(laws, window, log, crank, known)
    if (.not. known) return
    outcome = trim(crank_outcomes(crank%outcome))
    ratio = ''
    if (resonance_of(laws) > 0) ratio = to_text(crank%speed/resonance_of(laws), 4)//' times the natural frequency, '
    call journal%line('crank', 'crank speed '//to_text(crank%speed, 7)//' rad/s ('//ratio//to_text(crank%speed_min, 5)//' to '// &
      to_text(crank%speed_max, 5)//'), torque '//to_text(crank%torque, 5)//' N m (at most '//to_text(crank%torque_max, 5)// &
      '), power '//to_text(crank%power, 5)//' W: '//outcome, '"speed": '//to_text(crank%speed)//', "outcome": "'//outcome//'"')
  end subroutine report_crank

  !> The same as attributes of a file.
  subroutine describe_crank(laws, window, log, schema)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: window
    type(log_t), intent(in) :: log
    type(schema_t), intent(inout) :: schema
    type(crank_summary_t) :: crank
    real(wp) :: values(size(crank_table))
    logical :: known
    integer :: i
    call summary_of_window(laws, window, log, crank, known)
    if (.not. known) return
    values = crank_values(crank)
    do i = 1, size(values)
      call schema%add_attribute('', trim(crank_table(i)%name), values(i))
    end do
    call schema%add_attribute('', 'crank_outcome', trim(crank_outcomes(crank%outcome)))
  end subroutine describe_crank

end module crank_report
