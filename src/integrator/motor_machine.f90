! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The machine with a motor on its section, the passage of the crank through zero upwards: coordinates x, v, crank speed, and
!> current or integral of the control where the motor has one. A period is a turn of the crank; it lasts as long as it does.
module motor_machine
  use constants, only: two_pi, unreachable
  use contact_law, only: barrier_positions, beyond_barrier, contact_t
  use errors, only: error_t
  use kinds, only: wp
  use law_table, only: law_choice_t
  use machine_columns, only: machine_column_t, set_column
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: log_t, options_t, tally_t
  use motor_choices, only: start_of_motor
  use motor_equations, only: foot_half_range
  use motor_log, only: add_sample, motor_energy
  use motor_motion, only: advance_motor, motor_motion_t, prepare_motor, start_motor
  use held_crank, only: held_for_good
  use motor_system, only: y_at
  use section_size, only: most_coordinates
  use status, only: reason_time_over
  implicit none
  private

  public :: prepare_motor_machine

  !> Longest return to the section, in turns without load.
  integer, parameter :: longest_return = 256

  type, extends(machine_t), public :: motor_machine_t
    type(motor_motion_t) :: motor
    type(law_choice_t), allocatable :: laws(:)
    !> Size of the current [A] or the integral [rad].
    real(wp) :: own_size = 1
    !> Speed of the crank [rad/s] and current or integral where a start has none.
    real(wp) :: own_start(2) = 0
  contains
    procedure :: coordinates
    procedure :: start
    procedure :: allows
    procedure :: bound_to_rest
    procedure :: resume
    procedure :: state_at
    procedure :: point_of
    procedure :: scales
    procedure :: advance => advance_both
    procedure :: advance_past_event
    procedure :: advance_to_section
    procedure :: energy => energy_now
    procedure :: sample
    procedure :: without_stops
    procedure :: sample_columns
    procedure :: event_columns
    procedure :: kinetic_energies
    procedure :: has_mode
    procedure :: contact_sizes
    procedure :: options => options_now
    procedure :: set_options
  end type motor_machine_t

contains

  !> Prepares the machine that `choices` describe. Code 65 and the key if a law does not go with a motor.
  pure subroutine prepare_motor_machine(choices, options, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(options_t), intent(in) :: options
    type(motor_machine_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    call prepare_motor(choices, options, machine%motor, error)
    if (allocated(error)) return
    machine%laws = choices
    machine%own_start = start_of_motor(choices)
    call set_facts(machine)
  end subroutine prepare_motor_machine

  !> What the layers above have to know.
  pure subroutine set_facts(machine)
    type(motor_machine_t), intent(inout) :: machine
    associate (system => machine%motor%system)
      machine%timed = .false.
      machine%drive_frequency = system%no_load_speed
      machine%period = two_pi/system%no_load_speed
      machine%has_drive_period = .true.
      ! The force on a body at rest then depends on the angle alone.
      machine%rest_lasts = .not. (system%moment > 0 .or. system%control%has_own .or. system%control%supply > 0)
      machine%stops = system%contact
      machine%lower = system%contact%lower
      machine%upper = system%contact%upper
      machine%has_stops = any(abs(barrier_positions(system%contact)) < unreachable)
      machine%sizes%time = 1/system%no_load_speed
      machine%sizes%mass = system%mass
      machine%sizes%length = foot_half_range(system) + system%moment/system%mass
      if (system%stiffness > 0) machine%sizes%length = machine%sizes%length + system%friction%break_away/system%stiffness
      if (.not. machine%sizes%length > 0) machine%sizes%length = 1
      machine%smallest_motion = 1e-3_wp*machine%sizes%length
      machine%own_size = system%own_size
    end associate
  end subroutine set_facts

  pure integer function coordinates(self) result(n)
    class(motor_machine_t), intent(in) :: self
    n = merge(4, 3, self%motor%system%control%has_own)
  end function coordinates

  pure subroutine start(self, values, section)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    real(wp) :: all(5)
    integer :: n
    n = min(5, size(values))
    all(4:) = self%own_start
    all(:n) = values(:n)
    call start_motor(self%motor, all, section%state, section%motor)
  end subroutine start

  !> The same after a ramp.
  pure function start_settled(self, values) result(section)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(5)
    type(section_state_t) :: section
    call start_motor(self%motor, values, section%state, section%motor, settled=.true.)
  end function start_settled

  pure logical function allows(self, values) result(allowed)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    allowed = .not. beyond_barrier(self%motor%system%contact, values(1))
  end function allows

  !> Whether the bearing holds the crank for good.
  pure logical function bound_to_rest(self, section) result(rests)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    rests = held_for_good(self%motor%system, section%state, section%motor)
  end function bound_to_rest

  pure function resume(self, before, angle) result(section)
    class(motor_machine_t), intent(in) :: self
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    section = start_settled(self, [before%state%x, before%state%v, angle, before%motor%w, before%motor%own(1)])
    ! What sticks stays so where both machines would hold it; the rest of the state has no memory.
    section%motor%turns = before%motor%turns
  end function resume

  pure function state_at(self, point) result(section)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    real(wp) :: y
    y = 0
    if (self%coordinates() > 3) y = point(4)
    section = start_settled(self, [point(1), point(2), 0.0_wp, point(3), y])
  end function state_at

  pure function point_of(self, section) result(point)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = 0
    point(:3) = [section%state%x, section%state%v, section%motor%w]
    if (self%coordinates() > 3) point(4) = section%motor%own(1)
  end function point_of

  pure function scales(self, half_range)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    scales = 1
    scales(:3) = [half_range, half_range*self%drive_frequency, self%drive_frequency]
    if (self%coordinates() > 3) scales(4) = self%own_size
  end function scales

  !> Moves to `time_end`, or to the section, with `passed`, if that comes first.
  pure subroutine advance_both(self, section, time_end, tally, reason, log)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    section%passed = .true.
    call advance_motor(self%motor, section%state, section%motor, time_end, section%passed, tally, reason, log)
    call take_section(section)
    if (section%passed .and. present(log)) log%origin = log%origin + section%lasted
  end subroutine advance_both

  !> Past one event, be it the section, with `passed`.
  pure subroutine advance_past_event(self, section, speed, time_end, tally, reason)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: speed, time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    section%passed = .true.
    call advance_motor(self%motor, section%state, section%motor, time_end, section%passed, tally, reason, one_event=.true.)
    call take_section(section)
  end subroutine advance_past_event

  !> The clock begins anew on the section.
  pure subroutine take_section(section)
    class(section_state_t), intent(inout) :: section
    if (.not. section%passed) return
    section%lasted = section%state%time
    section%state%time = 0
  end subroutine take_section

  pure subroutine advance_to_section(self, section, tally, reason, log)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call self%advance(section, section%state%time + longest_return*self%period, tally, reason, log)
    if (reason == 0 .and. .not. section%passed) reason = reason_time_over
  end subroutine advance_to_section

  pure real(wp) function energy_now(self, section) result(energy)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    energy = motor_energy(self%motor%system, section%state, section%motor)
  end function energy_now

  pure subroutine sample(self, section, log)
    class(motor_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(log_t), intent(inout) :: log
    call add_sample(self%motor%system, section%state, section%motor, log)
  end subroutine sample

  pure subroutine without_stops(self, free, positions)
    class(motor_machine_t), intent(in) :: self
    class(machine_t), allocatable, intent(inout) :: free
    integer, intent(out) :: positions
    type(motor_machine_t) :: same
    same = self
    same%motor%system%contact = contact_t()
    call set_facts(same)
    positions = 0
    allocate (free, source=same)
  end subroutine without_stops

  pure function sample_columns(self, crank_angle, log) result(columns)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    real(wp) :: values(4, log%samples)
    ! A motion that was given up at its start has no samples.
    if (log%samples > 0) values = log%sample_coordinates(:4, :log%samples)
    allocate (columns(6))
    call set_crank(log%sample_driver(:, :log%samples), columns)
    call set_column(columns(3), 'motor_torque', 'N m', 'torque of the motor', values(1, :))
    call set_column(columns(4), 'load_torque', 'N m', 'torque of spring or body against the motor', values(2, :))
    call set_column(columns(5), 'motor_power', 'W', 'power of the motor at its shaft', values(3, :))
    if (self%motor%system%current > 0) then
      call set_column(columns(6), 'current', 'A', 'current of the motor', values(4, :))
    else if (self%motor%system%control%has_own) then
      call set_column(columns(6), 'integral', 'rad', 'integral of the speed control', values(4, :))
    else
      columns = columns(:5)
    end if
  end function sample_columns

  pure function event_columns(self, log) result(columns)
    class(motor_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    allocate (columns(2))
    call set_crank(log%event_driver(:, :log%events), columns)
  end function event_columns

  pure subroutine set_crank(values, columns)
    real(wp), intent(in) :: values(:, :)
    type(machine_column_t), intent(inout) :: columns(:)
    call set_column(columns(1), 'crank_angle', 'rad', 'angle of the crank since the start', values(1, :))
    call set_column(columns(2), 'crank_speed', 'rad/s', 'speed of the crank', values(2, :))
  end subroutine set_crank

  pure function kinetic_energies(self, log) result(values)
    class(motor_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    if (log%samples > 0) values = log%sample_coordinates(5, :log%samples)
  end function kinetic_energies

  pure logical function has_mode(self) result(fact)
    class(motor_machine_t), intent(in) :: self
    fact = self%motor%system%stiffness > 0
  end function has_mode

  pure subroutine contact_sizes(self, mass, force, closed_form)
    class(motor_machine_t), intent(in) :: self
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    mass = self%motor%system%mass
    force = self%motor%system%stiffness*self%sizes%length
    closed_form = .false.
  end subroutine contact_sizes

  pure type(options_t) function options_now(self) result(options)
    class(motor_machine_t), intent(in) :: self
    options = self%motor%options
  end function options_now

  pure subroutine set_options(self, options)
    class(motor_machine_t), intent(inout) :: self
    type(options_t), intent(in) :: options
    self%motor%options = options
  end subroutine set_options

end module motor_machine
