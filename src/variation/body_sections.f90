! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body from section to section of its drive.
submodule(one_body) body_sections
  use body_events, only: events_of_body
  use body_family, only: fly_periods, map_with_variation
  use motion, only: advance_period, start_state
  use motion_state, only: log_t, open_log
  implicit none

contains

  module procedure begin_body
    section%state = start_state(self%moving, point(1), point(2), 0.0_wp)
    ok = .true.
  end procedure begin_body

  module procedure go_on_with_body
    type(tally_t) :: tally
    integer :: reason
    call advance_period(self%moving, section%state, tally, reason)
    point = [section%state%x, section%state%v]
    ok = reason == 0
  end procedure go_on_with_body

  module procedure fly_body_to_section
    type(state_t) :: before, state
    type(tally_t) :: tally
    type(log_t) :: log
    integer :: reason, mode
    point = 0
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    before = start_state(self%moving, start(1), start(2), start(3))
    state = before
    call advance_period(self%moving, state, tally, reason, log)
    ok = reason == 0
    if (.not. ok) return
    point = [state%x, state%v]
    call events_of_body(self, before, log, state, .true., events, mode)
  end procedure fly_body_to_section

  module procedure fly_body_over_sections
    call fly_periods(self, point, sections, collapsed, image, events, mode, tally, ok)
  end procedure fly_body_over_sections

  module procedure map_of_body
    call map_with_variation(machines, point, sections, image, by_start, tally, ok, by_parameter)
  end procedure map_of_body

  module procedure starts_of_body
    points = watched
  end procedure starts_of_body

end submodule body_sections
