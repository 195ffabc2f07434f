! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body over a parameter of its laws, and the stroboscopic map of it with derivatives by the start and by the parameter.
module body_family
  use body_events, only: events_of_body
  use body_machine, only: body_machine_t
  use build_motion, only: body_of, kind_bodies, kind_of
  use errors, only: error_t, fail
  use hybrid_machine, only: event_t
  use kinds, only: real64, wp
  use law_table, only: change_parameter, law_choice_t
  use motion, only: advance_period, motion_t, start_state
  use motion_state, only: log_t, mode_stick, open_log, options_t, reset_tally, state_t, tally_t
  use one_body, only: mode_of_body, one_body_of, one_body_t, why_not_varied
  use status, only: exit_bad_case, reason_not_smooth
  use text, only: to_text
  use variations, only: neighbourhood_t, period_slope, vary
  implicit none
  private

  public :: body_of_family, fly_periods, map_with_variation, size_of_motion, vary_period

  !> The flights lead from event to event to this share of the size of the motion, or the variation is not known.
  real(wp), parameter, public :: likeness = 1e-6_wp

  !> A machine whose parameter `path` of the laws may be changed; no path: it has none.
  type, public :: family_t
    type(law_choice_t), allocatable :: laws(:)
    character(len=:), allocatable :: path
    type(options_t) :: options
    !> Range of the parameter: its neighbours stay in it.
    real(wp) :: lowest = -huge(1.0_wp), highest = huge(1.0_wp)
    !> Size of the parameter below which steps do not shrink.
    real(wp) :: parameter_size = 1
    !> Sizes of x and v, the same for all machines; 0: each has its own.
    real(wp) :: sizes(2) = 0
  end type family_t

contains

  !> Amplitude of x [m] that the drive alone causes, at least a thousandth of the length by which the forces extend the spring: a
  !> size for differences, never 0.
  pure real(wp) function size_of_motion(moving) result(length)
    type(motion_t), intent(in) :: moving
    length = 1
    associate (machine => moving%machine)
      if (machine%restoring%stiffness > 0) length = machine%force_scale/machine%restoring%stiffness
      length = max(length, sum(abs(machine%drive%cosine)) + sum(abs(machine%drive%sine)))
    end associate
    if (.not. length > 0) length = 1
  end function size_of_motion

  !> The machine with the parameter at `value`. Code 65 if it cannot be built or its variations are not known.
  pure subroutine body_of_family(family, value, body, error)
    type(family_t), intent(in) :: family
    real(wp), intent(in) :: value
    type(one_body_t), intent(out) :: body
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    type(body_machine_t) :: machine
    character(len=:), allocatable :: why
    logical :: known
    laws = family%laws
    if (allocated(family%path)) call change_parameter(laws, family%path, value, known)
    if (kind_of(laws) == kind_bodies) then
      call fail(error, exit_bad_case, 'body.law: found several bodies, allowed one: their variations are those of a structure')
      return
    end if
    call body_of(laws, family%options, machine, error)
    if (allocated(error)) return
    why = why_not_varied(machine%body)
    associate (contact => machine%body%machine%contact)
      if (contact%lower > contact%upper) why = 'contact.lower: found '//to_text(real(contact%lower, real64))// &
        ' m, allowed at most upper = '//to_text(real(contact%upper, real64))//' m'
    end associate
    if (len(why) > 0) then
      call fail(error, exit_bad_case, why)
      return
    end if
    body = one_body_of(machine%body, merge(family%sizes(1), size_of_motion(machine%body), family%sizes(1) > 0))
    if (family%sizes(2) > 0) body%size_of(2) = family%sizes(2)
  end subroutine body_of_family

  !> Image of a section point after `periods` drive periods, its derivatives by the point (and by the parameter), and the
  !> events on the way. `ok` is false if the trajectory had to be given up or the derivatives are not known.
  pure subroutine map_with_variation(machines, point, periods, image, by_start, tally, ok, by_parameter)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(2)
    integer, intent(in) :: periods
    real(wp), intent(out) :: image(2), by_start(2, 2)
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    real(wp), intent(out), optional :: by_parameter(2)
    type(event_t), allocatable :: events(:)
    integer :: mode
    by_start = 0
    if (present(by_parameter)) by_parameter = 0
    image = point
    ok = .false.
    select type (body => machines%centre)
    type is (one_body_t)
      call fly_periods(body, point, periods, .false., image, events, mode, tally, ok)
      if (ok) ok = .not. rests_unheld(body, mode, events)
      if (.not. ok) return
      call vary(machines, mode, point, events, periods*body%period, likeness*body%size_of*max(1, periods), by_start, ok, &
                by_parameter)
      ! The section comes when the drive has turned, and that may depend on the parameter.
      if (present(by_parameter)) by_parameter = by_parameter + periods*period_slope(machines)* &
        body%slope(mode_at_end(mode, events), periods*body%period, image)
    end select
  end subroutine map_with_variation

  !> Whether the body comes to rest in an equilibrium where nothing holds it: its neighbours do not stick.
  pure logical function rests_unheld(body, mode, events)
    type(one_body_t), intent(in) :: body
    integer, intent(in) :: mode
    type(event_t), intent(in) :: events(:)
    associate (friction => body%moving%machine%friction, effects => body%moving%machine%effects)
      rests_unheld = .not. (friction%kinetic > 0 .or. friction%break_away > 0 .or. friction%excess > 0 .or. effects%dry)
    end associate
    rests_unheld = rests_unheld .and. any([mode, events%after] == mode_stick)
  end function rests_unheld

  !> Flies a body from a section point over `periods` drive periods: where it then is, the mode in which it began, and the events
  !> on the way, with `collapsed` a completed chatter as one. `ok` is false if the trajectory had to be given up.
  pure subroutine fly_periods(body, point, periods, collapsed, image, events, mode, tally, ok)
    type(one_body_t), intent(in) :: body
    real(wp), intent(in) :: point(2)
    integer, intent(in) :: periods
    logical, intent(in) :: collapsed
    real(wp), intent(out) :: image(2)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(out) :: mode
    type(tally_t), intent(out) :: tally
    logical, intent(out) :: ok
    type(state_t) :: start, state
    type(log_t) :: log
    integer :: i, reason, last_mode
    image = point
    call open_log(log, 0.0_wp)
    log%balance%kept = .false.
    start = start_state(body%moving, point(1), point(2), 0.0_wp)
    mode = mode_of_body(body, start)
    state = start
    call reset_tally(tally, state, .false.)
    do i = 1, periods
      call advance_period(body%moving, state, tally, reason, log)
      ok = reason == 0
      if (.not. ok) return
    end do
    image = [state%x, state%v]
    call events_of_body(body, start, log, state, collapsed, events, last_mode)
  end subroutine fly_periods

  !> Moves a body to the next section, from one or from where it is: derivatives of its state there by that before, and the
  !> events on the way. `log` is the caller's, opened once, and holds them too. `reason` is 0 but where the trajectory had to
  !> be given up or the derivatives are not known (module `status`).
  pure subroutine vary_period(machines, body, state, log, events, by_start, reason)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(state_t), intent(inout) :: state
    type(log_t), intent(inout) :: log
    type(event_t), allocatable, intent(out) :: events(:)
    real(wp), intent(out) :: by_start(2, 2)
    integer, intent(out) :: reason
    type(state_t) :: start
    type(tally_t) :: tally
    logical :: ok
    integer :: mode
    by_start = 0
    log%events = 0
    log%origin = 0
    start = state
    call advance_period(body%moving, state, tally, reason, log)
    if (reason /= 0) return
    call events_of_body(body, start, log, state, .false., events, mode)
    reason = reason_not_smooth
    if (rests_unheld(body, start%mode, events)) return
    call vary(machines, mode_of_body(body, start), [start%x, start%v], events, body%period, likeness*body%size_of, by_start, ok, &
              t_start=start%time)
    if (ok) reason = 0
  end subroutine vary_period

  !> Mode after the last event of a motion that began in `mode`.
  pure integer function mode_at_end(mode, events)
    integer, intent(in) :: mode
    type(event_t), intent(in) :: events(:)
    mode_at_end = mode
    if (size(events) > 0) mode_at_end = events(size(events))%after
  end function mode_at_end

end module body_family
