! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the crank of a motor does over turns from a section point on.
module crank_turns
  use attractors, only: attractor_t, kind_cycle
  use constants, only: two_pi
  use crank_summary, only: crank_stalled, crank_summary_t, summarize_crank
  use kinds, only: wp
  use law_table, only: law_choice_t, value_of
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: log_t, open_log, tally_t
  use motor_choices, only: number_of_family
  use motor_machine, only: motor_machine_t
  use held_crank, only: torque_when_held
  implicit none
  private

  public :: summarize_attractor, summarize_held, summarize_turns, summarize_while

  !> Samples of a turn of mean length.
  integer, parameter :: samples = 256

contains

  !> Summary of the `turns` turns after a `start` on the section; they take about `lasts` [s]. Not numbers if the motion had to be
  !> given up, or without a motor.
  pure subroutine summarize_turns(machine, start, turns, lasts, summary)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    integer, intent(in) :: turns
    real(wp), intent(in) :: lasts
    type(crank_summary_t), intent(out) :: summary
    type(log_t) :: log
    select type (machine)
    type is (motor_machine_t)
      if (turns > 0 .and. lasts > 0) call log_turns(machine, start, turns, lasts/(turns*samples), log)
      call summarize_crank(machine%laws, log, 1, log%samples, summary)
    class default
      call summarize_crank([law_choice_t ::], log, 1, 0, summary)
    end select
  end subroutine summarize_turns

  !> Summary of the motion of a machine with a motor for `lasts` [s] from a state on: x [m], v [m/s], crank angle [rad] and speed
  !> [rad/s], current [A] or integral [rad].
  pure subroutine summarize_while(machine, state, lasts, summary)
    class(machine_t), intent(in) :: machine
    real(wp), intent(in) :: state(5), lasts
    type(crank_summary_t), intent(out) :: summary
    type(log_t) :: log
    type(section_state_t) :: from
    select type (machine)
    type is (motor_machine_t)
      from%state%x = state(1)
      from%state%v = state(2)
      from%motor%w = state(4)
      from%motor%own(1) = state(5)
      call log_while(machine, machine%resume(from, state(3)), lasts, machine%period/samples, log)
      call summarize_crank(machine%laws, log, 1, log%samples, summary)
    end select
  end subroutine summarize_while

  !> A log of the time `lasts` [s], with samples at this interval [s]; none if the motion had to be given up.
  pure subroutine log_while(machine, from, lasts, interval, log)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: from
    real(wp), intent(in) :: lasts, interval
    type(log_t), intent(inout) :: log
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: since, left
    integer :: reason
    call open_log(log, interval)
    section = from
    call machine%begin_tally(section, tally)
    left = lasts
    do while (left > 0)
      since = section%state%time
      log%next_sample = ceiling(since/interval)
      call machine%advance(section, since + left, tally, reason, log)
      if (reason /= 0) log%samples = 0
      if (reason /= 0) return
      if (.not. section%passed) exit
      left = left - (section%lasted - since)
    end do
    call machine%sample(section, log)
  end subroutine log_while

  !> A log of turns, with samples at this interval [s]; none if the motion had to be given up.
  pure subroutine log_turns(machine, start, turns, interval, log)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    integer, intent(in) :: turns
    real(wp), intent(in) :: interval
    type(log_t), intent(inout) :: log
    type(section_state_t) :: section
    type(tally_t) :: tally
    integer :: i, reason
    call open_log(log, interval)
    section = start
    call machine%begin_tally(section, tally)
    do i = 1, turns
      log%next_sample = 0
      call machine%advance_to_section(section, tally, reason, log)
      if (reason /= 0) log%samples = 0
      if (reason /= 0) return
    end do
    call machine%sample(section, log)
  end subroutine log_turns

  !> Summary of a crank that its bearing holds for good.
  pure subroutine summarize_held(machine, section, summary)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: section
    type(crank_summary_t), intent(out) :: summary
    summary%outcome = crank_stalled
    select type (machine)
    type is (motor_machine_t)
      summary%torque = torque_when_held(machine%motor%system, section%state, section%motor)
      summary%torque_max = abs(summary%torque)
      associate (motor => machine%laws(number_of_family(machine%laws, 'motor')))
        if (motor%name == 'dc') summary%heat = value_of(motor, 'resistance')*(summary%torque/value_of(motor, 'torque_constant'))**2
      end associate
    end select
  end subroutine summarize_held

  !> Summary of a cycle or of rest; not numbers of any other attractor.
  pure subroutine summarize_attractor(machine, attractor, summary)
    class(machine_t), intent(in) :: machine
    type(attractor_t), intent(in) :: attractor
    type(crank_summary_t), intent(out) :: summary
    type(section_state_t) :: at_rest
    integer :: turns
    real(wp) :: lasts
    turns = merge(attractor%period, 0, attractor%kind == kind_cycle .or. attractor%rests)
    lasts = attractor%duration
    if (attractor%rests) lasts = two_pi/max(attractor%points(3, 1), tiny(lasts))
    if (attractor%rests .and. .not. attractor%points(3, 1) > 0) then
      at_rest%state%x = attractor%section(1)
      at_rest%motor%own(1) = attractor%points(4, 1)
      call summarize_held(machine, machine%resume(at_rest, attractor%section(3)), summary)
    else if (turns == 0) then
      call summarize_turns(machine, section_state_t(), 0, 0.0_wp, summary)
    else
      call summarize_turns(machine, machine%state_at(attractor%points(:, 1)), turns, lasts, summary)
    end if
  end subroutine summarize_attractor

end module crank_turns
