! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One slip against a soft barrier: in closed form where the barrier is a spring with a linear damper, whose force never has to be
!> cut off, for then the body is one on a stiffer spring with more damping; adaptively otherwise.
module pressed_flight
  use contact_flight, only: fly_contact
  use contact_law, only: contact_kelvin_voigt
  use exact_flight, only: flight_barrier, fly_exact
  use exact_flow, only: flow_t, prepare_flow
  use kinds, only: wp
  use motion_state, only: log_t, mode_slip_plus, options_t, state_t, tally_t, watches_between_events
  use oscillator, only: oscillator_t
  implicit none
  private

  public :: prepare_pressed, fly_pressed_body

  !> Closed forms while a body presses the upper (1) or the lower (-1) barrier, in the distance from its surface.
  type, public :: pressed_flow_t
    logical :: available = .false.
    type(flow_t) :: flow(-1:1)
  end type pressed_flow_t

contains

  !> Closed forms of the contacts of a machine, where they have one.
  pure subroutine prepare_pressed(machine, pressed)
    type(oscillator_t), intent(in) :: machine
    type(pressed_flow_t), intent(out) :: pressed
    type(oscillator_t) :: stiffer
    real(wp) :: share, surface
    integer :: side
    associate (law => machine%contact)
      if (.not. (law%soft .and. law%kind == contact_kelvin_voigt)) return
      ! Without damping a pressed spring never pulls.
      if (law%damping > 0 .and. .not. law%tension) return
      if (machine%friction%layer_speed > 0 .or. .not. machine%restoring%is_linear) return
      pressed%available = .true.
      do side = -1, 1, 2
        surface = merge(law%soft_upper, law%soft_lower, side > 0)
        if (.not. abs(surface) < huge(1.0_wp)) cycle
        stiffer = machine
        stiffer%restoring%stiffness = machine%restoring%stiffness + law%stiffness
        share = machine%restoring%stiffness/stiffer%restoring%stiffness
        stiffer%restoring%free_length = share*(machine%restoring%free_length + machine%drive%mean - surface)
        stiffer%drive%mean = 0
        stiffer%drive%cosine = share*machine%drive%cosine
        stiffer%drive%sine = share*machine%drive%sine
        stiffer%friction%damping = machine%friction%damping + law%damping
        stiffer%natural_frequency = sqrt(stiffer%restoring%stiffness/machine%mass)
        call prepare_flow(stiffer, pressed%flow(side))
        ! The copy that a record is made of is flown by steps.
        pressed%available = pressed%available .and. pressed%flow(side)%available .and. .not. pressed%flow(side)%overdamped
      end do
    end associate
  end subroutine prepare_pressed

  !> Flies from `state` (mode slip_plus or slip_minus) up to `time_end` [s after the section], pressed on the barrier on
  !> `side`. Ends as `fly_contact` does. Samples, peaks and energy are those of a copy that is flown adaptively; a log of events
  !> alone, without a balance, needs none.
  pure subroutine fly_pressed_body(pressed, machine, options, side, state, time_end, tally, outcome, log)
    type(pressed_flow_t), intent(in) :: pressed
    type(oscillator_t), intent(in) :: machine
    type(options_t), intent(in) :: options
    integer, intent(in) :: side
    type(state_t), intent(inout) :: state
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: outcome
    type(log_t), intent(inout), optional :: log
    type(state_t) :: start
    type(tally_t) :: unused
    real(wp) :: surface, barrier
    integer :: direction, ended
    if (.not. pressed%available) then
      call fly_contact(machine, options, side, state, time_end, tally, outcome, log)
      return
    end if
    start = state
    surface = merge(machine%contact%soft_upper, machine%contact%soft_lower, side > 0)
    direction = merge(1, -1, state%mode == mode_slip_plus)
    barrier = direction*huge(1.0_wp)
    if (side*direction < 0) barrier = 0
    state%x = state%x - surface
    call fly_exact(pressed%flow(side), state, time_end, 0.0_wp, barrier, tally, outcome)
    state%x = surface + state%x
    if (outcome == flight_barrier) state%x = surface
    if (.not. present(log)) return
    if (watches_between_events(log)) call fly_contact(machine, options, side, start, state%time, unused, ended, log)
  end subroutine fly_pressed_body

end module pressed_flight
