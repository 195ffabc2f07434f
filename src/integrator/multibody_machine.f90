! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The machine of several bodies with joints on its section. What moves is the watched body, of a pair the driven one.
module multibody_machine
  use contact_law, only: contact_at_speed, force_on_body
  use kinds, only: wp
  use machine_columns, only: machine_column_t
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: flight_adaptive, log_t, options_t, tally_t
  use multibody, only: is_stop, multibody_t
  use multibody_columns, only: coordinate_columns, driver_columns, energies_of_motion, is_still, joint_columns
  use multibody_flows, only: multibody_motion_t, prepare_multibody
  use multibody_energy, only: energy_of_multibody
  use multibody_log, only: log_sample, watched_state
  use multibody_motion, only: advance_multibody, advance_multibody_period, start_multibody
  use multibody_section, only: coordinates_of_multibody, fits_section, fixes_column, free_multibody, has_known_mode, &
    keeps_clear, multibody_at, multibody_point, scales_of_multibody, start_of_multibody
  use multibody_state, only: acts_as_spring, multibody_state_t
  use section_size, only: most_coordinates
  use text, only: to_text
  use timed_actions, only: acts_on_time
  use touching_row, only: names_in_row
  use turn_section, only: advance_multibody_to_turn, coordinates_at_turn, multibody_at_turn, multibody_turn_point, scales_at_turn
  use two_bodies, only: contact_at, driver_now, keeps_within
  implicit none
  private

  public :: set_structure

  type, extends(machine_t), public :: multibody_machine_t
    type(multibody_motion_t) :: bodies
  contains
    procedure :: coordinates
    procedure :: section_obstacle
    procedure :: start
    procedure :: allows
    procedure :: fixes
    procedure :: resume
    procedure :: state_at
    procedure :: point_of
    procedure :: turn_point
    procedure :: scales
    procedure :: advance
    procedure :: advance_past_event
    procedure :: advance_to_section
    procedure :: advance_to_turn
    procedure :: energy
    procedure :: sample
    procedure :: without_stops
    procedure :: stays_clear
    procedure :: sample_columns
    procedure :: event_columns
    procedure :: contact_forces
    procedure :: kinetic_energies
    procedure :: rests_at_end
    procedure :: has_mode
    procedure :: driver
    procedure :: contacts_in_row
    procedure :: contact_sizes
    procedure :: options => options_now
    procedure :: set_options
  end type multibody_machine_t

contains

  !> Prepares the machine of a structure.
  pure subroutine set_structure(structure, options, machine)
    type(multibody_t), intent(in) :: structure
    type(options_t), intent(in) :: options
    type(multibody_machine_t), intent(out) :: machine
    call prepare_multibody(structure, options, machine%bodies)
    call set_facts(machine)
    if (allocated(structure%driver)) call set_facts_of_two(machine)
  end subroutine set_structure

  !> What the layers above have to know of a prepared structure.
  pure subroutine set_facts(machine)
    type(multibody_machine_t), intent(inout) :: machine
    integer :: i
    associate (structure => machine%bodies%machine)
      machine%period = structure%period
      machine%drive_frequency = structure%frequency
      machine%has_stops = any(is_stop(structure%joints%kind))
      machine%has_drive_period = structure%driven
      machine%has_section = fits_section(machine%bodies)
      machine%has_clock = .not. (machine%bodies%section > 0 .and. machine%has_section)
      machine%undriven = .not. machine%has_clock
      machine%closed_form = structure%linear .and. machine%bodies%options%flight /= flight_adaptive
      machine%speed_number = size(machine%bodies%directions, 2) + 1
      if (structure%frequency > 0) machine%sizes%time = 1/structure%frequency
      if (structure%length_scale > 0) machine%sizes%length = structure%length_scale
      machine%sizes%mass = maxval([(structure%mass(i, i), i=1, structure%n)])
    end associate
  end subroutine set_facts

  !> The facts of two bodies one of which drives the other.
  pure subroutine set_facts_of_two(machine)
    type(multibody_machine_t), intent(inout) :: machine
    integer :: stop
    associate (structure => machine%bodies%machine)
      machine%has_driver = .true.
      machine%one_rest_set = .true.
      machine%rest_lasts = structure%driver%at == 0
      machine%smallest_motion = 1e-3_wp*structure%force_scale/ &
                                (structure%mass(structure%watched, structure%watched)*structure%frequency**2)
      stop = contact_at(structure)
      if (stop == 0) return
      machine%stops = structure%joints(stop)%contact
      machine%presses_by_steps = machine%stops%soft
    end associate
  end subroutine set_facts_of_two

  pure integer function coordinates(self) result(n)
    class(multibody_machine_t), intent(in) :: self
    n = coordinates_of_multibody(self%bodies)
    if (self%by_event) n = coordinates_at_turn(self%bodies)
  end function coordinates

  !> A section has no room for all coordinates, or a controller acts at times of its own, or an impulse is still to come.
  pure function section_obstacle(self) result(text)
    class(multibody_machine_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (self%has_section) return
    associate (machine => self%bodies%machine)
      text = 'the section has '//to_text(coordinates_of_multibody(self%bodies))//' coordinates, more than '// &
             to_text(most_coordinates)
      if (acts_on_time(machine)) text = &
        'with impulses, samples of a controller or forces of the time since the start, the state at crank angle 0 does not '// &
        'determine what follows'
      if (self%has_driver) text = 'with '//trim(merge('body.impulse     ', 'drive.sample_time', allocated(machine%impulses)))// &
                                  ' the state at crank angle 0 does not determine what follows'
    end associate
  end function section_obstacle

  pure subroutine start(self, values, section)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    section%multibody = start_of_multibody(self%bodies, values)
    section%state = watched_state(self%bodies%machine, section%multibody)
  end subroutine start

  pure logical function allows(self, values) result(allowed)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t) :: section
    call self%start(values, section)
    allowed = .not. any(section%multibody%q /= section%multibody%q)
    if (allowed .and. self%has_driver) allowed = keeps_within(self%bodies%machine, section%multibody)
  end function allows

  !> All bodies keep their positions and velocities.
  pure function resume(self, before, angle) result(section)
    class(multibody_machine_t), intent(in) :: self
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    logical :: ok
    type(multibody_state_t) :: from
    call self%start([before%state%x, before%state%v, angle], section)
    if (.not. allocated(before%multibody)) return
    from = before%multibody
    associate (machine => self%bodies%machine, n => self%bodies%machine%n)
      if (self%has_driver) from%q(:n) = from%q(:n) - machine%driver%running*from%clock
      call start_multibody(self%bodies, from%q(:n), from%v(:n), angle, section%multibody, ok)
      section%multibody%slider = from%slider
      section%multibody%integral = from%integral
      section%state = watched_state(machine, section%multibody)
    end associate
    if (.not. ok) call self%start([before%state%x, before%state%v, angle], section)
  end function resume

  pure function state_at(self, point) result(section)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    if (self%by_event) then
      section%multibody = multibody_at_turn(self%bodies, point)
    else
      section%multibody = multibody_at(self%bodies, point)
    end if
    section%state = watched_state(self%bodies%machine, section%multibody)
  end function state_at

  pure function point_of(self, section) result(point)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    if (self%by_event) then
      point = self%turn_point(section)
    else
      point = multibody_point(self%bodies, section%multibody)
    end if
  end function point_of

  pure logical function fixes(self, column)
    class(multibody_machine_t), intent(in) :: self
    character(len=*), intent(in) :: column
    fixes = fixes_column(self%bodies, column)
  end function fixes

  pure function turn_point(self, section) result(point)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = multibody_turn_point(self%bodies, section%multibody)
  end function turn_point

  pure function scales(self, half_range)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    if (self%by_event) then
      scales = scales_at_turn(self%bodies, half_range)
    else
      scales = scales_of_multibody(self%bodies, half_range)
    end if
  end function scales

  pure subroutine advance(self, section, time_end, tally, reason, log)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    call advance_multibody(self%bodies, section%multibody, time_end, tally, reason, log)
    section%state = watched_state(self%bodies%machine, section%multibody)
  end subroutine advance

  pure subroutine advance_past_event(self, section, speed, time_end, tally, reason)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: speed, time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance_multibody(self%bodies, section%multibody, time_end, tally, reason, one_event=.true.)
    section%state = watched_state(self%bodies%machine, section%multibody)
  end subroutine advance_past_event

  pure subroutine advance_to_section(self, section, tally, reason, log)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (self%by_event) then
      call self%advance_to_turn(section, tally, reason)
      return
    end if
    section%lasted = self%period
    call advance_multibody_period(self%bodies, section%multibody, tally, reason, log)
    section%state = watched_state(self%bodies%machine, section%multibody)
  end subroutine advance_to_section

  pure subroutine advance_to_turn(self, section, tally, reason)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call advance_multibody_to_turn(self%bodies, section%multibody, section%lasted, tally, reason)
    section%state = watched_state(self%bodies%machine, section%multibody)
  end subroutine advance_to_turn

  pure real(wp) function energy(self, section)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    energy = energy_of_multibody(self%bodies%machine, section%multibody)
  end function energy

  pure subroutine sample(self, section, log)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(log_t), intent(inout) :: log
    call log_sample(self%bodies%machine, section%multibody, log)
  end subroutine sample

  pure subroutine without_stops(self, free, positions)
    class(multibody_machine_t), intent(in) :: self
    class(machine_t), allocatable, intent(inout) :: free
    integer, intent(out) :: positions
    type(multibody_machine_t) :: same
    same = self
    call free_multibody(self%bodies, same%bodies, positions)
    allocate (free, source=same)
  end subroutine without_stops

  pure logical function stays_clear(self, section, tally, periods, distance) result(clear)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    integer, intent(in) :: periods
    real(wp), intent(in) :: distance
    clear = keeps_clear(self%bodies, section%multibody, periods, distance)
  end function stays_clear

  pure function sample_columns(self, crank_angle, log) result(columns)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    if (self%has_driver) then
      columns = driver_columns(log%sample_driver(:, :log%samples))
    else
      columns = coordinate_columns(self%bodies%machine, log)
    end if
  end function sample_columns

  !> Those of the driving body, or the joint of each event.
  pure function event_columns(self, log) result(columns)
    class(multibody_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    if (self%has_driver) then
      columns = driver_columns(log%event_driver(:, :log%events))
    else
      columns = joint_columns(self%bodies%machine, log)
    end if
  end function event_columns

  pure function contact_forces(self, log) result(values)
    class(multibody_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    real(wp), allocatable :: position(:, :)
    position = log%sample_data(2:3, :log%samples)
    if (self%has_driver) then
      if (self%bodies%machine%driver%carries) position = position - log%sample_driver(:, :log%samples)
    end if
    values = force_on_body(contact_at_speed(self%stops, log%sample_touch(1, :log%samples)), position(1, :), position(2, :))
  end function contact_forces

  !> That of a body whose motion is given is left out.
  pure function kinetic_energies(self, log) result(values)
    class(multibody_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    values = energies_of_motion(self%bodies%machine, log)
  end function kinetic_energies

  pure logical function rests_at_end(self, amplitude, since, log) result(rests)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: amplitude, since
    type(log_t), intent(in) :: log
    rests = .false.
    if (.not. (self%has_drive_period .or. self%has_driver)) rests = is_still(self%bodies%machine, amplitude, since, log)
  end function rests_at_end

  pure logical function has_mode(self) result(fact)
    class(multibody_machine_t), intent(in) :: self
    fact = has_known_mode(self%bodies%machine)
  end function has_mode

  pure function driver(self, section) result(motion)
    class(multibody_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: motion(2)
    motion = 0
    if (self%has_driver) motion = driver_now(self%bodies%machine, section%multibody)
  end function driver

  pure function contacts_in_row(self, values) result(names)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(3)
    character(len=:), allocatable :: names
    names = names_in_row(self%bodies, values)
  end function contacts_in_row

  !> Of two bodies alone: the stops of other structures belong to their joints.
  pure subroutine contact_sizes(self, mass, force, closed_form)
    class(multibody_machine_t), intent(in) :: self
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    integer :: stop
    mass = self%sizes%mass
    force = self%bodies%machine%force_scale
    closed_form = .false.
    stop = contact_at(self%bodies%machine)
    if (stop == 0) return
    associate (machine => self%bodies%machine)
      mass = 1/sum(machine%joints(stop)%row*matmul(machine%mobility, machine%joints(stop)%row))
      closed_form = acts_as_spring(machine%joints(stop), 1)
    end associate
  end subroutine contact_sizes

  pure type(options_t) function options_now(self) result(options)
    class(multibody_machine_t), intent(in) :: self
    options = self%bodies%options
  end function options_now

  pure subroutine set_options(self, options)
    class(multibody_machine_t), intent(inout) :: self
    type(options_t), intent(in) :: options
    self%bodies%options = options
  end subroutine set_options

end module multibody_machine
