! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One trajectory of two bodies over the whole duration. Its regime is that of the window at the end: attractors are not
!> looked for.
module pair_trajectory
  use kinds, only: int64, wp
  use motion_state, only: log_t, mode_stick, record_sample, tally_t
  use pair_flight, only: body_state, driver_of, energy_of
  use pair_modes, only: pair_motion_t, pair_state_t
  use pair_motion, only: advance_pair, advance_pair_period, start_pair
  implicit none
  private

  public :: run_pair

  type, public :: pair_course_t
    type(pair_state_t) :: state
    !> Counts over the window.
    type(tally_t) :: tally
    !> Of the whole duration.
    integer(int64) :: impacts = 0
    real(wp) :: last_impact_speed = 0
    !> Time since the start [s]; code of module `status` if the trajectory was given up.
    real(wp) :: elapsed = 0
    integer :: reason = 0
    logical :: in_window = .false.
  end type pair_course_t

contains

  !> Runs m2 from `x` [m], `v` [m/s] with the drive at `angle` [rad] for `duration` [s]; `window` [s] at its end is counted.
  pure subroutine run_pair(moving, duration, window, x, v, angle, course, log)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: duration, window, x, v, angle
    type(pair_course_t), intent(out) :: course
    type(log_t), intent(inout), optional :: log
    course%state = start_pair(moving, x, v, [moving%machine%driver_x0, moving%machine%driver_v0], angle)
    if (present(log)) then
      log%book%at_start = energy_of(moving, course%state)
      log%origin = -course%state%time
      if (log%sample_interval > 0) log%next_sample = ceiling(course%state%time/log%sample_interval)
    end if
    call run_until(moving, duration - window, course, log)
    call close_count(course)
    if (course%reason /= 0) return
    course%in_window = .true.
    course%tally%wants_v_max = .true.
    course%tally%x_max = x_of(course)
    course%tally%x_min = x_of(course)
    if (course%state%mode == mode_stick) course%tally%sticks = 1
    call run_until(moving, duration, course, log)
    course%impacts = course%impacts + course%tally%impacts
    if (course%tally%impacts > 0) course%last_impact_speed = course%tally%last_impact_speed
    if (.not. present(log)) return
    log%book%at_end = energy_of(moving, course%state)
    if (log%sample_interval > 0) call record_sample(log, body_state(course%state), &
                                                    driver_of(course%state), log%book)
  end subroutine run_pair

  pure real(wp) function x_of(course)
    type(pair_course_t), intent(in) :: course
    associate (body => body_state(course%state))
      x_of = body%x
    end associate
  end function x_of

  !> Counts anew; the budget of events goes on.
  pure subroutine close_count(course)
    type(pair_course_t), intent(inout) :: course
    integer(int64) :: events
    course%impacts = course%tally%impacts
    course%last_impact_speed = course%tally%last_impact_speed
    events = course%tally%events
    course%tally = tally_t(events=events)
  end subroutine close_count

  !> Moves on to a time since the start.
  pure subroutine run_until(moving, time_end, course, log)
    type(pair_motion_t), intent(in) :: moving
    real(wp), intent(in) :: time_end
    type(pair_course_t), intent(inout) :: course
    type(log_t), intent(inout), optional :: log
    real(wp) :: start
    do while (course%elapsed < time_end)
      start = course%state%time
      if (course%elapsed + (moving%machine%period - start) > time_end) then
        call advance_pair(moving, course%state, start + (time_end - course%elapsed), course%tally, course%reason, log)
        course%elapsed = time_end
        return
      end if
      call advance_pair_period(moving, course%state, course%tally, course%reason, log)
      if (course%reason /= 0) return
      course%elapsed = course%elapsed + (moving%machine%period - start)
    end do
  end subroutine run_until

end module pair_trajectory
