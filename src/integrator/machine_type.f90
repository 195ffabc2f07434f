! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine on its section: all that the layers above the event loops need. Another kind of machine is another extension of
!> `machine_t`: it implements the deferred procedures, and its builder sets the facts (`machine_facts`). The others hold for a
!> machine with neither stops nor a driving body, whose state is `state` alone; an extension overrides those that do not hold for
!> it. The layers above never ask which it is.
!> The section is that of a drive period or, with `by_event`, where the motion of a machine without a clock turns round
!> (`turn_section`).
module machine_type
  use kinds, only: int64, wp
  use machine_columns, only: machine_column_t
  use machine_facts, only: machine_facts_t
  use motion_state, only: log_t, options_t, reset_tally, tally_t
  use section_size, only: most_coordinates
  use section_state, only: copy_of, scales_t, section_state_t
  implicit none
  private

  public :: copy_of, scales_t, section_state_t

  type, abstract, extends(machine_facts_t), public :: machine_t
  contains
    procedure(count_of_machine), deferred :: coordinates
    procedure(start_interface), deferred :: start
    procedure(at_interface), deferred :: state_at
    procedure(point_interface), deferred :: point_of
    procedure(scales_interface), deferred :: scales
    procedure(advance_interface), deferred :: advance
    procedure(past_event_interface), deferred :: advance_past_event
    procedure(to_section_interface), deferred :: advance_to_section
    procedure(energy_interface), deferred :: energy
    procedure(sample_interface), deferred :: sample
    procedure(samples_interface), deferred :: kinetic_energies
    procedure :: section_obstacle
    procedure :: allows
    procedure :: resume
    procedure :: turn_point
    procedure :: advance_to_turn
    procedure :: without_stops
    procedure :: stays_clear
    procedure :: sample_columns
    procedure :: event_columns
    procedure :: contact_forces
    procedure :: has_mode
    procedure :: contact_sizes
    procedure :: free_multipliers
    procedure :: rests_at_end
    procedure :: bound_to_rest
    procedure :: driver
    procedure :: contacts_in_row
    procedure :: measured_force
    procedure :: force_at
    procedure(options_interface), deferred :: options
    procedure(set_options_interface), deferred :: set_options
    procedure :: fixes
    procedure :: limit_budgets
    procedure :: turn_on_section
    procedure :: watched_at
    procedure :: begin_tally
    procedure :: record_end
  end type machine_t

  abstract interface
    !> Number of coordinates on the section.
    pure integer function count_of_machine(self) result(n)
      import :: machine_t
      class(machine_t), intent(in) :: self
    end function count_of_machine

    !> A state at x [m], v [m/s] and the crank at an angle [rad]; a driving body as in its machine. What follows in `values` are
    !> positions and velocities of the coordinates of several bodies, in place of those of the machine; with a motor the speed of
    !> the crank [rad/s] and current [A] or integral of the control [rad].
    pure subroutine start_interface(self, values, section)
      import :: machine_t, section_state_t, wp
      class(machine_t), intent(in) :: self
      real(wp), intent(in) :: values(:)
      type(section_state_t), intent(out) :: section
    end subroutine start_interface

    !> The state on the section with the coordinates `point`; what they leave open is zero.
    pure function at_interface(self, point) result(section)
      import :: machine_t, section_state_t, wp
      class(machine_t), intent(in) :: self
      real(wp), intent(in) :: point(:)
      type(section_state_t) :: section
    end function at_interface

    !> Coordinates of a state on the section, zeros after the last.
    pure function point_interface(self, section) result(point)
      import :: machine_t, most_coordinates, section_state_t, wp
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(in) :: section
      real(wp) :: point(most_coordinates)
    end function point_interface

    !> Sizes of the coordinates in a motion over `half_range` [m] of the position, ones after the last.
    pure function scales_interface(self, half_range) result(scales)
      import :: machine_t, most_coordinates, wp
      class(machine_t), intent(in) :: self
      real(wp), intent(in) :: half_range
      real(wp) :: scales(most_coordinates)
    end function scales_interface

    !> Moves to `time_end` [s after the section, at most one period]. `reason` stays 0 unless the trajectory had to be given up
    !> (codes of module `status`).
    pure subroutine advance_interface(self, section, time_end, tally, reason, log)
      import :: log_t, machine_t, section_state_t, tally_t, wp
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(inout) :: section
      real(wp), intent(in) :: time_end
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
      type(log_t), intent(inout), optional :: log
    end subroutine advance_interface

    !> Moves past one event, if that comes before `time_end`; one body past a turn to a slip at `speed` [m/s] or faster.
    pure subroutine past_event_interface(self, section, speed, time_end, tally, reason)
      import :: machine_t, section_state_t, tally_t, wp
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(inout) :: section
      real(wp), intent(in) :: speed, time_end
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
    end subroutine past_event_interface

    !> Moves to the next section and starts the clock anew.
    pure subroutine to_section_interface(self, section, tally, reason, log)
      import :: log_t, machine_t, section_state_t, tally_t
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(inout) :: section
      type(tally_t), intent(inout) :: tally
      integer, intent(out) :: reason
      type(log_t), intent(inout), optional :: log
    end subroutine to_section_interface

    !> Energy of the machine [J].
    pure real(wp) function energy_interface(self, section) result(energy)
      import :: machine_t, section_state_t, wp
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(in) :: section
    end function energy_interface

    !> Adds a sample of a state to a log.
    pure subroutine sample_interface(self, section, log)
      import :: log_t, machine_t, section_state_t
      class(machine_t), intent(in) :: self
      class(section_state_t), intent(in) :: section
      type(log_t), intent(inout) :: log
    end subroutine sample_interface

    !> Kinetic energy [J] at the samples of a log.
    pure function samples_interface(self, log) result(values)
      import :: log_t, machine_t, wp
      class(machine_t), intent(in) :: self
      type(log_t), intent(in) :: log
      real(wp) :: values(log%samples)
    end function samples_interface

    !> How the machine is flown.
    pure type(options_t) function options_interface(self) result(options)
      import :: machine_t, options_t
      class(machine_t), intent(in) :: self
    end function options_interface

    !> Other budgets, domain or lanes; the flight stays that of the prepared machine.
    pure subroutine set_options_interface(self, options)
      import :: machine_t, options_t
      class(machine_t), intent(inout) :: self
      type(options_t), intent(in) :: options
    end subroutine set_options_interface
  end interface

contains

  !> Why the state on the section does not determine what follows; '' if it does.
  pure function section_obstacle(self) result(text)
    class(machine_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
  end function section_obstacle

  !> Whether no body starts beyond a rigid stop: values as in `start`.
  pure logical function allows(self, values) result(allowed)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    allowed = .true.
  end function allows

  !> The state of another machine given to this one, on the section with the crank at an angle [rad]; a driving body whose
  !> motion is given has that of the new machine. What was never moved starts as in the new machine.
  pure function resume(self, before, angle) result(section)
    class(machine_t), intent(in) :: self
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    call self%start([before%state%x, before%state%v, angle], section)
  end function resume

  !> Coordinates of a state where the motion turns round.
  pure function turn_point(self, section) result(point)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    point = self%point_of(section)
  end function turn_point

  !> Moves a machine without a clock to where it turns round; `reason` is `reason_time_over` if it does not.
  pure subroutine advance_to_turn(self, section, tally, reason)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    call self%advance_to_section(section, tally, reason)
  end subroutine advance_to_turn

  !> The same machine without stops, not allocated on entry, and how many first coordinates, positions, this takes away; -1 if it
  !> takes away others.
  pure subroutine without_stops(self, free, positions)
    class(machine_t), intent(in) :: self
    class(machine_t), allocatable, intent(inout) :: free
    integer, intent(out) :: positions
    positions = 0
    allocate (free, source=self)
  end subroutine without_stops

  !> Whether a motion on the section comes no nearer to a stop than `distance` [m] in the next `periods`; of one body the tally
  !> has by how much it missed them.
  pure logical function stays_clear(self, section, tally, periods, distance) result(clear)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(in) :: tally
    integer, intent(in) :: periods
    real(wp), intent(in) :: distance
    clear = distance < tally%grazing_margin
  end function stays_clear

  !> What a log holds beside time, position and velocity, at the samples of a motion that began with the crank at `crank_angle`
  !> [rad].
  pure function sample_columns(self, crank_angle, log) result(columns)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    allocate (columns(0))
  end function sample_columns

  !> The same at the events.
  pure function event_columns(self, log) result(columns)
    class(machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    allocate (columns(0))
  end function event_columns

  !> Forces of soft stops [N] at the samples of a log.
  pure function contact_forces(self, log) result(values)
    class(machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    real(wp) :: values(log%samples)
    values = 0
  end function contact_forces

  !> Whether the section of a machine without a drive is a period of its slowest mode; else it is only a unit of time.
  pure logical function has_mode(self) result(fact)
    class(machine_t), intent(in) :: self
    fact = .false.
  end function has_mode

  !> What presses a soft stop: the mass that an impact feels [kg], the size of the forces [N], and whether the contact is flown
  !> in closed form.
  pure subroutine contact_sizes(self, mass, force, closed_form)
    class(machine_t), intent(in) :: self
    real(wp), intent(out) :: mass, force
    logical, intent(out) :: closed_form
    mass = self%sizes%mass
    force = 0
    closed_form = .false.
  end subroutine contact_sizes

  !> Multipliers of the motion of a machine that is `linear` over some drive periods.
  pure function free_multipliers(self, periods) result(multipliers)
    class(machine_t), intent(in) :: self
    integer, intent(in) :: periods
    complex(wp) :: multipliers(2)
    multipliers = 0
  end function free_multipliers

  !> Whether a machine that nothing drives has come to rest over the samples of a log after `since` [s], in a motion of this
  !> `amplitude` [m].
  pure logical function rests_at_end(self, amplitude, since, log) result(rests)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: amplitude, since
    type(log_t), intent(in) :: log
    rests = .false.
  end function rests_at_end

  !> Whether a motion that comes to no section is at rest or will be, for good.
  pure logical function bound_to_rest(self, section) result(rests)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    rests = .false.
  end function bound_to_rest

  !> Position and velocity of the driving body of two [m, m/s], zeros without one.
  pure function driver(self, section) result(motion)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: motion(2)
    motion = 0
  end function driver

  !> Names of the rigid contacts that are closed at the `start` (x [m], v [m/s], crank angle [rad] of the watched body) and whose
  !> impacts change the speed of another one, as 'ab, bc'; '' if there are none, or if impacts come one after the other.
  pure function contacts_in_row(self, values) result(names)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: values(3)
    character(len=:), allocatable :: names
    names = ''
  end function contacts_in_row

  !> Whether a point on the section determines a column of the samples: bodies on which nothing depends may be anywhere.
  pure logical function fixes(self, column)
    class(machine_t), intent(in) :: self
    character(len=*), intent(in) :: column
    fixes = .true.
  end function fixes

  !> The samples of a measured force [N].
  pure function measured_force(self) result(force)
    class(machine_t), intent(in) :: self
    real(wp) :: force(self%force_samples)
    force = 0
  end function measured_force

  !> The measured force [N] that drives a machine, at `times` [s since the start at `crank_angle` [rad]].
  pure function force_at(self, crank_angle, times) result(force)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle, times(:)
    real(wp) :: force(size(times))
    force = 0
  end function force_at

  !> So many events and steps a trajectory may take at most, or fewer where it may take fewer already.
  pure subroutine limit_budgets(self, events, steps)
    class(machine_t), intent(inout) :: self
    integer(int64), intent(in) :: events, steps
    type(options_t) :: options
    options = self%options()
    options%event_budget = min(options%event_budget, events)
    options%step_budget = min(options%step_budget, steps)
    call self%set_options(options)
  end subroutine limit_budgets

  !> What the first coordinate repeats after on the section.
  pure real(wp) function turn_on_section(self) result(turn)
    class(machine_t), intent(in) :: self
    turn = merge(0.0_wp, self%turn, self%by_event)
  end function turn_on_section

  !> x, v at a point of the section, and those of the driving body of two (0 of one).
  pure function watched_at(self, point) result(state)
    class(machine_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    real(wp) :: state(4)
    type(section_state_t) :: section
    section = self%state_at(point)
    state = [section%state%x, section%state%v, self%driver(section)]
  end function watched_at

  !> Begins the counts of a motion anew where it is now.
  pure subroutine begin_tally(self, section, tally)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    type(tally_t), intent(inout) :: tally
    call reset_tally(tally, section%state, self%has_driver)
  end subroutine begin_tally

  !> Closes the balance of a log, with a last sample if it has any.
  pure subroutine record_end(self, section, sampled, log)
    class(machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    logical, intent(in) :: sampled
    type(log_t), intent(inout) :: log
    log%balance%at_end = self%energy(section)
    if (sampled) call self%sample(section, log)
  end subroutine record_end

end module machine_type
