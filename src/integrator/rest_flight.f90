! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The body at rest until it is released.
module rest_flight
  use energy, only: balance_rest, record_with_balance
  use kinds, only: wp
  use motion_state, only: event_barrier_release, event_release, log_t, mode_stick, note_position, record_event, sample_due, &
    sample_time, state_t, tally_t
  use oscillator, only: oscillator_t
  use rest, only: hold
  implicit none
  private

  public :: rest_on

contains

  !> Rest until release or the end of the time.
  pure subroutine rest_on(machine, state, time_end, tally, log)
    type(oscillator_t), intent(in) :: machine
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    type(log_t), intent(inout), optional :: log
    type(state_t) :: start, sample, before
    integer :: kind
    start = state
    call note_position(tally, state)
    tally%v_max = max(tally%v_max, 0.0_wp)
    call hold(machine, state, time_end)
    if (.not. present(log)) return
    if (log%sample_interval > 0) then
      sample = start
      do
        before = sample
        sample%time = sample_time(log)
        if (.not. sample_due(log, state%time)) exit
        call balance_rest(machine, before, sample, log%balance)
        call record_with_balance(machine, sample, log)
      end do
      start = before
    end if
    call balance_rest(machine, start, state, log%balance)
    if (state%mode == start%mode) return
    kind = merge(event_release, event_barrier_release, start%mode == mode_stick)
    call record_event(log, kind, state, 0.0_wp)
  end subroutine rest_on

end module rest_flight
