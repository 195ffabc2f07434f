! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the crank of a motor does over turns from a section point on.
module crank_turns
  use attractors, only: attractor_t, kind_cycle
  use crank_summary, only: crank_summary_t, summarize_crank
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: log_t, open_log, tally_t
  use motor_choices, only: has_motor
  implicit none
  private

  public :: summarize_attractor, summarize_turns

  !> Samples of a turn of mean length.
  integer, parameter :: samples = 256

contains

  !> Summary of the `turns` turns after a `start` on the section; they take about `lasts` [s]. Not numbers if the motion had to be
  !> given up, or without a motor.
  pure subroutine summarize_turns(laws, machine, start, turns, lasts, summary)
    type(law_choice_t), intent(in) :: laws(:)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    integer, intent(in) :: turns
    real(wp), intent(in) :: lasts
    type(crank_summary_t), intent(out) :: summary
    type(section_state_t) :: section
    type(tally_t) :: tally
    type(log_t) :: log
    integer :: i, reason
    if (.not. has_motor(laws) .or. turns == 0 .or. .not. lasts > 0) then
      call summarize_crank(laws, log, 0, 0, summary)
      return
    end if
    call open_log(log, lasts/(turns*samples))
    section = start
    call machine%begin_tally(section, tally)
    reason = 0
    do i = 1, turns
      log%next_sample = 0
      call machine%advance_to_section(section, tally, reason, log)
      if (reason /= 0) exit
    end do
    if (reason == 0) call machine%sample(section, log)
    call summarize_crank(laws, log, 1, merge(log%samples, 0, reason == 0), summary)
  end subroutine summarize_turns

  !> Summary of a cycle; not numbers of an attractor that is none.
  pure subroutine summarize_attractor(laws, machine, attractor, summary)
    type(law_choice_t), intent(in) :: laws(:)
    class(machine_t), intent(in) :: machine
    type(attractor_t), intent(in) :: attractor
    type(crank_summary_t), intent(out) :: summary
    integer :: turns
    turns = merge(attractor%period, 0, attractor%kind == kind_cycle)
    if (turns == 0) then
      call summarize_turns(laws, machine, section_state_t(), 0, 0.0_wp, summary)
    else
      call summarize_turns(laws, machine, machine%state_at(attractor%points(:, 1)), turns, attractor%duration, summary)
    end if
  end subroutine summarize_attractor

end module crank_turns
