! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The machine of one body on its section.
module body_machine
  use angle_units, only: unit_of
  use body_section, only: body_at, body_point, coordinates_of_body, resumed_body, scales_of_body, start_of_body
  use constants, only: two_pi, unreachable
  use contact_law, only: barrier_positions, beyond_barrier, contact_at_speed, contact_t, force_on_body
  use drive_law, only: foot_motion, measured_force
  use elementary, only: exponential, sine_cosine
  use energy, only: energy_of_body, record_with_balance
  use errors, only: error_t
  use kinds, only: wp
  use machine_columns, only: machine_column_t, set_column
  use machine_type, only: machine_t, section_state_t
  use motion, only: advance, advance_period, motion_t, prepare_motion
  use motion_state, only: log_t, options_t, take_turns, tally_t
  use oscillator, only: oscillator_t
  use section_size, only: most_coordinates
  use turn_section, only: advance_body_to_turn, body_at_turn, body_turn_point
  implicit none
  private

  public :: prepare_body

  type, extends(machine_t), public :: body_machine_t
    type(motion_t) :: body
  contains
    procedure :: coordinates
    procedure :: start
    procedure :: allows
    procedure :: resume
    procedure :: state_at
    procedure :: point_of
    procedure :: turn_point
    procedure :: scales
    procedure :: advance => advance_body
    procedure :: advance_past_event
    procedure :: advance_to_section
    procedure :: advance_to_turn
    procedure :: energy => energy_now
    procedure :: sample
    procedure :: without_stops
    procedure :: sample_columns
    procedure :: contact_forces
    procedure :: kinetic_energies
    procedure :: has_mode
    procedure :: contact_sizes
    procedure :: free_multipliers
    procedure :: measured_force => force_samples
    procedure :: force_at
    procedure :: options => options_now
    procedure :: set_options
  end type body_machine_t

contains

  !> Prepares the machine of one body. Code 65 if flight `exact` is asked for where a mode has no closed form.
  pure subroutine prepare_body(oscillator, options, machine, error)
    type(oscillator_t), intent(in) :: oscillator
    type(options_t), intent(in) :: options
    type(body_machine_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    call prepare_motion(oscillator, options, machine%body, error)
    if (.not. allocated(error)) call set_facts(machine)
  end subroutine prepare_body

  !> What the layers above have to know of a prepared body.
  pure subroutine set_facts(machine)
    type(body_machine_t), intent(inout) :: machine
    associate (body => machine%body, one => machine%body%machine, drive => machine%body%machine%drive)
      machine%period = one%period
      machine%drive_frequency = one%drive_frequency
      machine%turn = one%turn
      machine%stops = one%contact
      machine%lower = one%contact%lower
      machine%upper = one%contact%upper
      machine%has_stops = any(abs(barrier_positions(one%contact)) < unreachable)
      machine%presses_by_steps = one%contact%soft .and. .not. body%pressed%available
      machine%sensor = one%sensor
      machine%drive_ratio = drive%ratio
      machine%sample_interval = drive%interval
      if (allocated(drive%force)) machine%force_samples = size(drive%force)
      machine%has_drive_period = drive%ratio > 0 .or. drive%interval > 0
      machine%undriven = .not. machine%has_drive_period .and. .not. one%effects%dahl_stiffness > 0 .and. &
                         .not. any(abs([drive%cosine, drive%sine]) > 0)
      ! An angle under forces that turn it has no clock.
      machine%has_clock = .not. one%turn > 0 .or. machine%has_drive_period .or. one%effects%dahl_stiffness > 0
      machine%exact = body%exact
      machine%closed_form = body%exact .and. .not. body%layer > 0 .and. .not. one%contact%soft
      machine%one_rest_set = body%exact
      machine%linear = body%exact .and. body%layer <= 0 .and. body%flow%decay > 0 .and. .not. one%friction%kinetic > 0 .and. &
                       .not. one%friction%break_away > 0
      machine%sizes%time = 1/one%drive_frequency
      machine%sizes%mass = one%mass
      if (one%restoring%stiffness > 0) machine%sizes%length = one%force_scale/one%restoring%stiffness
      if (.not. machine%sizes%length > 0) machine%sizes%length = 1
      if (one%restoring%stiffness > 0 .and. one%force_scale > 0) then
        machine%smallest_motion = 1e-3_wp*one%force_scale/one%restoring%stiffness
      end if
    end associate
  end subroutine set_facts

  pure integer function coordinates(self) result(n)
    class(body_machine_t), intent(in) :: self
    n = merge(1, coordinates_of_body(self%body), self%by_event)
  end function coordinates

  pure subroutine start(self, values, section)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    section%state = start_of_body(self%body, values)
  end subroutine start

  pure logical function allows(self, values) result(allowed)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    allowed = .not. beyond_barrier(self%body%machine%contact, values(1))
  end function allows

  pure function resume(self, before, angle) result(section)
    class(body_machine_t), intent(in) :: self
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    call self%start([before%state%x, before%state%v, angle], section)
    if (before%state%mode /= 0) section%state = resumed_body(self%body, before%state, angle)
  end function resume

  pure function state_at(self, point) result(section)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    if (self%by_event) then
      section%state = body_at_turn(self%body, point(1))
    else
      section%state = body_at(self%body, point)
    end if
  end function state_at

  pure function point_of(self, section) result(point)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = 0
    if (self%by_event) then
      point = self%turn_point(section)
    else
      point(:self%coordinates()) = body_point(self%body, section%state)
    end if
  end function point_of

  pure function turn_point(self, section) result(point)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = 0
    point(1) = body_turn_point(self%body, section%state)
  end function turn_point

  pure function scales(self, half_range)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    scales = 1
    if (self%by_event) then
      scales(1) = half_range
    else
      scales(:self%coordinates()) = scales_of_body(self%body, half_range)
    end if
  end function scales

  pure subroutine advance_body(self, section, time_end, tally, reason, log)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call advance(self%body, section%state, time_end, tally, reason, log)
  end subroutine advance_body

  pure subroutine advance_past_event(self, section, speed, time_end, tally, reason)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: speed, time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance(self%body, section%state, time_end, tally, reason, slip_speed=speed)
  end subroutine advance_past_event

  pure subroutine advance_to_section(self, section, tally, reason, log)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (self%by_event) then
      call self%advance_to_turn(section, tally, reason)
      return
    end if
    section%lasted = self%period
    call advance_period(self%body, section%state, tally, reason, log)
    call take_turns(self%turn, section%state, tally)
  end subroutine advance_to_section

  pure subroutine advance_to_turn(self, section, tally, reason)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance_body_to_turn(self%body, section%state, section%lasted, tally, reason)
  end subroutine advance_to_turn

  pure real(wp) function energy_now(self, section) result(energy)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    energy = energy_of_body(self%body%machine, section%state)
  end function energy_now

  pure subroutine sample(self, section, log)
    class(body_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(log_t), intent(inout) :: log
    call record_with_balance(self%body%machine, section%state, log)
  end subroutine sample

  pure subroutine without_stops(self, free, positions)
    class(body_machine_t), intent(in) :: self
    class(machine_t), allocatable, intent(inout) :: free
    integer, intent(out) :: positions
    type(body_machine_t) :: same
    same = self
    same%body%machine%contact = contact_t()
    call set_facts(same)
    positions = 0
    allocate (free, source=same)
  end subroutine without_stops

  !> Position of the foot of the spring at the samples.
  pure function sample_columns(self, crank_angle, log) result(columns)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    real(wp) :: foot(log%samples)
    integer :: i
    associate (machine => self%body%machine)
      do i = 1, log%samples
        call foot_motion(machine%drive, crank_angle + machine%drive_frequency*log%sample_data(1, i), foot(i))
      end do
      allocate (columns(1))
      call set_column(columns(1), 'drive', unit_of('m', machine%restoring%turn > 0), 'position of the foot of the spring', foot)
    end associate
  end function sample_columns

  pure function contact_forces(self, log) result(values)
    class(body_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    values = force_on_body(contact_at_speed(self%stops, log%sample_touch(1, :log%samples)), log%sample_data(2, :log%samples), &
                           log%sample_data(3, :log%samples))
  end function contact_forces

  pure function kinetic_energies(self, log) result(values)
    class(body_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    values = 0.5_wp*self%body%machine%mass*log%sample_data(3, :log%samples)**2
  end function kinetic_energies

  pure logical function has_mode(self) result(fact)
    class(body_machine_t), intent(in) :: self
    fact = self%body%machine%natural_frequency > 0
  end function has_mode

  pure subroutine contact_sizes(self, mass, force, closed_form)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    mass = self%body%machine%mass
    force = self%body%machine%force_scale
    closed_form = self%body%pressed%available
  end subroutine contact_sizes

  !> exp((-g +- i w_d) t), or exp(-slow t) and exp(-fast t).
  pure function free_multipliers(self, periods) result(multipliers)
    class(body_machine_t), intent(in) :: self
    integer, intent(in) :: periods
    complex(wp) :: multipliers(2)
    real(wp) :: time, sine, cosine
    time = periods*self%period
    associate (flow => self%body%flow)
      if (flow%overdamped) then
        multipliers = exponential(-[flow%slow, flow%fast]*time)
        return
      end if
      call sine_cosine(flow%damped*time, sine, cosine)
      multipliers = exponential(-flow%decay*time)*cmplx(cosine, abs(sine)*[1.0_wp, -1.0_wp], wp)
    end associate
  end function free_multipliers

  pure function force_samples(self) result(force)
    class(body_machine_t), intent(in) :: self
    real(wp) :: force(self%force_samples)
    if (self%force_samples > 0) force = self%body%machine%drive%force
  end function force_samples

  pure function force_at(self, crank_angle, times) result(force)
    class(body_machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle, times(:)
    real(wp) :: force(size(times)), rate, start
    integer :: i
    start = modulo(crank_angle, two_pi)/self%drive_frequency
    do i = 1, size(times)
      call measured_force(self%body%machine%drive, modulo(start + times(i), self%period), force(i), rate)
    end do
  end function force_at

  pure type(options_t) function options_now(self) result(options)
    class(body_machine_t), intent(in) :: self
    options = self%body%options
  end function options_now

  pure subroutine set_options(self, options)
    class(body_machine_t), intent(inout) :: self
    type(options_t), intent(in) :: options
    self%body%options = options
  end subroutine set_options

end module body_machine
