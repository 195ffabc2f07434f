! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What the layers above the event loops have to know of a machine, whichever it is.
module machine_facts
  use contact_law, only: contact_t
  use effect_law, only: sensor_t
  use kinds, only: wp
  use section_state, only: scales_t
  implicit none
  private

  type, public :: machine_facts_t
    !> Time from section to section [s], and its circular frequency [rad/s].
    real(wp) :: period = 0, drive_frequency = 0
    !> The section comes once in a period. Otherwise `advance` ends there, with `passed`, where it comes before the given time, and
    !> the period is only a scale.
    logical :: timed = .true.
    !> The section is where the motion turns round, not at a given time.
    logical :: by_event = .false.
    !> An angle repeats after this [rad]; 0 of a position.
    real(wp) :: turn = 0
    !> Rigid stops that bound the first coordinate of the section [m].
    real(wp) :: lower = -huge(1.0_wp), upper = huge(1.0_wp)
    !> The stops of the watched body, where they belong to no joint; whether there is anything to hit.
    type(contact_t) :: stops
    logical :: has_stops = .false.
    !> Whether a body that leans on a soft stop uses up steps.
    logical :: presses_by_steps = .false.
    !> Frequency ratio of the drive, and distance of the samples of a measured force [s]; 0 without.
    real(wp) :: drive_ratio = 0, sample_interval = 0
    integer :: force_samples = 0
    !> Whether a drive repeats, so that its period is the time between two sections.
    logical :: has_drive_period = .false.
    !> Whether the motion depends on the time at all, and whether a drive gives a time: without one the section may be an event.
    logical :: undriven = .false., has_clock = .true.
    !> Whether the state on the section determines what follows.
    logical :: has_section = .true.
    !> Whether a driving body moves beside the watched one: what does not slip may then well move.
    logical :: has_driver = .false.
    !> Whether a period without slip is followed by none with any: a body at rest under periodic forces, or two that move as one
    !> in a way that is given.
    logical :: rest_lasts = .true.
    !> Whether all positions of rest are one set: friction and stops with linear springs make it convex; two bodies rest by moving
    !> as one.
    logical :: one_rest_set = .false.
    !> Whether slips of one body are flown on a closed form; whether that is so in every mode.
    logical :: exact = .false., closed_form = .false.
    !> Whether the motion between the stops is that of a linear, damped oscillator with a closed form: then it has one motion
    !> without impact, which attracts.
    logical :: linear = .false.
    !> Number of a coordinate of the section that is a velocity.
    integer :: speed_number = 2
    !> Amplitude [m] of a motion below which it is rounding: a thousandth of what the forces do.
    real(wp) :: smallest_motion = 1e-3_wp
    type(scales_t) :: sizes
    type(sensor_t) :: sensor
  end type machine_facts_t

end module machine_facts
