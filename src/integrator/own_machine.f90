! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The machine of equations by expressions on its section: x, v and its own states, once in a period of the drive. Without a
!> drive the section is where the body turns round, with `by_event`. Forces that depend on the time without a period have none.
module own_machine
  use constants, only: two_pi, unreachable
  use contact_law, only: barrier_positions, contact_t
  use errors, only: error_t
  use kinds, only: wp
  use law_table, only: law_choice_t, label_length, parameter_row_t, rows_of, state_family
  use machine_columns, only: machine_column_t, set_column
  use machine_type, only: machine_t, section_state_t
  use motion_state, only: append_word, log_t, options_t, take_turns, tally_t, word_period
  use motor_machine, only: motor_machine_t
  use motor_motion, only: advance_motor, check_hold, prepare_motor, start_own
  use motor_system, only: w_at
  use section_size, only: most_coordinates
  use status, only: reason_time_over
  use stored_jumps, only: jump_until_now
  use tape_value, only: evaluate
  use turn_section, only: longest_return, motion_at_turn, turn_coordinate
  implicit none
  private

  public :: prepare_own_machine, start_of_states

  !> Angles of a period at which the forces are looked at.
  integer, parameter :: angles = 32

  type, extends(motor_machine_t), public :: own_machine_t
    !> Names and units of the states, and their values at the start.
    character(len=label_length), allocatable :: names(:), units(:)
    real(wp), allocatable :: starts(:)
  contains
    procedure :: coordinates
    procedure :: section_obstacle
    procedure :: start
    procedure :: resume
    procedure :: state_at
    procedure :: point_of
    procedure :: turn_point
    procedure :: scales
    procedure :: advance => advance_body
    procedure :: advance_past_event => advance_body_past_event
    procedure :: advance_to_section
    procedure :: advance_to_turn
    procedure :: without_stops
    procedure :: sample_columns
    procedure :: event_columns
    procedure :: record_end
    procedure :: has_mode
  end type own_machine_t

contains

  !> Prepares the machine that `choices` describe. Code 65 and the key if an expression is not understood.
  pure subroutine prepare_own_machine(choices, options, machine, error)
    type(law_choice_t), intent(in) :: choices(:)
    type(options_t), intent(in) :: options
    type(own_machine_t), intent(out) :: machine
    type(error_t), allocatable, intent(out) :: error
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    call prepare_motor(choices, options, machine%motor, error)
    if (allocated(error)) return
    machine%starts = start_of_states(choices)
    machine%names = pack(choices%label, choices%family == state_family)
    allocate (machine%units(0))
    do i = 1, size(choices)
      if (choices(i)%family /= state_family) cycle
      rows = rows_of(choices(i))
      machine%units = [character(len=label_length) :: machine%units, rows(findloc(rows%name == 'start', .true., dim=1))%unit]
    end do
    call set_facts(machine)
  end subroutine prepare_own_machine

  !> Values of the states at the start.
  pure function start_of_states(choices) result(starts)
    type(law_choice_t), intent(in) :: choices(:)
    real(wp), allocatable :: starts(:)
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    allocate (starts(0))
    do i = 1, size(choices)
      if (choices(i)%family /= state_family) cycle
      rows = rows_of(choices(i))
      starts = [starts, choices(i)%parameters(findloc(rows%name == 'start', .true., dim=1))%values(1)]
    end do
  end function start_of_states

  !> What the layers above have to know.
  pure subroutine set_facts(machine)
    type(own_machine_t), intent(inout) :: machine
    real(wp) :: force, stiffness
    associate (system => machine%motor%system)
      call look_at_forces(machine, force, stiffness)
      machine%period = system%period
      machine%turn = system%turn
      if (.not. machine%period > 0) machine%period = merge(two_pi/sqrt(max(stiffness/system%mass, tiny(1.0_wp))), 1.0_wp, &
                                                           stiffness > 0)
      machine%drive_frequency = two_pi/machine%period
      machine%has_drive_period = system%period > 0
      machine%undriven = .not. system%period > 0 .and. .not. system%aperiodic
      machine%has_clock = .not. machine%undriven
      machine%has_section = .not. system%aperiodic
      machine%rest_lasts = .not. system%aperiodic .and. size(machine%starts) == 0
      machine%stops = system%contact
      machine%lower = system%contact%lower
      machine%upper = system%contact%upper
      machine%has_stops = any(abs(barrier_positions(system%contact)) < unreachable)
      machine%sizes%time = 1/machine%drive_frequency
      machine%sizes%mass = system%mass
      if (stiffness > 0 .and. force > 0) machine%sizes%length = force/stiffness
      machine%smallest_motion = 1e-3_wp*machine%sizes%length
    end associate
  end subroutine set_facts

  !> Largest force on the body at the origin over a period [N], and its stiffness there [N/m]; 0 where it is not defined.
  pure subroutine look_at_forces(machine, force, stiffness)
    type(own_machine_t), intent(in) :: machine
    real(wp), intent(out) :: force, stiffness
    real(wp), allocatable :: value(:)
    real(wp) :: z(machine%motor%system%variables)
    integer, allocatable :: fault(:)
    integer :: i
    force = 0
    stiffness = 0
    associate (system => machine%motor%system)
      allocate (value(system%sheet%tape%count), fault(system%sheet%tape%count))
      do i = 1, angles
        z = 0
        z(:w_at) = [system%period, two_pi]*i/angles
        call evaluate(system%sheet%tape, z, system%sheet%parameters, value, fault)
        force = max(force, abs(value(system%rest_friction)) + sum(abs(value(system%forces))))
        stiffness = max(stiffness, -value(system%force_slope))
      end do
    end associate
  end subroutine look_at_forces

  pure integer function coordinates(self) result(n)
    class(own_machine_t), intent(in) :: self
    n = merge(1, 2, self%by_event) + size(self%starts)
  end function coordinates

  pure function section_obstacle(self) result(text)
    class(own_machine_t), intent(in) :: self
    character(len=:), allocatable :: text
    text = ''
    if (.not. self%has_section) text = 'forces depend on the time t, and no drive.period states after which time they repeat'
  end function section_obstacle

  pure subroutine start(self, values, section)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:)
    type(section_state_t), intent(out) :: section
    real(wp) :: all(2 + size(self%starts))
    all = [0.0_wp, 0.0_wp, self%starts]
    all(:2) = values(:2)
    if (size(values) > 3) all(3:) = values(4:)
    section = begin(self, all, merge(modulo(values(min(3, size(values))), two_pi)/two_pi*self%period, 0.0_wp, self%has_clock))
  end subroutine start

  pure function begin(self, values, time) result(section)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: values(:), time
    type(section_state_t) :: section
    call start_own(self%motor, values, time, section%state, section%motor)
    ! Where nothing repeats, the time begins at the start.
    if (self%motor%system%aperiodic) section%motor%phi = -time
    call take_turns(self%turn, section%state)
    ! At half a turn, downwards, it has just passed from the other side.
    if (self%turn > 0 .and. section%state%v < 0 .and. section%state%x <= -self%turn/2) section%state%x = self%turn/2
  end function begin

  pure function resume(self, before, angle) result(section)
    class(own_machine_t), intent(in) :: self
    type(section_state_t), intent(in) :: before
    real(wp), intent(in) :: angle
    type(section_state_t) :: section
    call self%start([before%state%x, before%state%v, angle, before%motor%own(:size(self%starts))], section)
  end function resume

  pure function state_at(self, point) result(section)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: point(:)
    type(section_state_t) :: section
    if (self%by_event) then
      section = begin(self, [motion_at_turn(self%turn, self%drive_frequency, point(1)), point(2:1 + size(self%starts))], 0.0_wp)
    else
      section = begin(self, point(:2 + size(self%starts)), 0.0_wp)
    end if
  end function state_at

  pure function point_of(self, section) result(point)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    integer :: n
    if (self%by_event) then
      point = self%turn_point(section)
      return
    end if
    n = size(self%starts)
    point = 0
    point(:2 + n) = [section%state%x, section%state%v, section%motor%own(:n)]
  end function point_of

  pure function turn_point(self, section) result(point)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    real(wp) :: point(most_coordinates)
    integer :: n
    n = size(self%starts)
    point = 0
    point(1) = turn_coordinate(self%turn, self%drive_frequency, section%state%x, section%state%v)
    point(2:1 + n) = section%motor%own(:n)
  end function turn_point

  pure function scales(self, half_range)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: half_range
    real(wp) :: scales(most_coordinates)
    integer :: n
    n = size(self%starts)
    scales = 1
    if (self%by_event) then
      scales(:1 + n) = [half_range, sizes_of_states(self, half_range)]
    else
      scales(:2 + n) = [half_range, half_range*self%drive_frequency, sizes_of_states(self, half_range)]
    end if
  end function scales

  !> Sizes of the states in a motion over `half_range` [m]: what their rates change them by in a radian of the period, at the
  !> corners of the motion about the origin and the start.
  pure function sizes_of_states(self, half_range) result(sizes)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: half_range
    real(wp) :: sizes(size(self%starts))
    real(wp), allocatable :: value(:)
    real(wp) :: z(self%motor%system%variables)
    integer, allocatable :: fault(:)
    integer :: i
    sizes = abs(self%starts)
    associate (system => self%motor%system)
      allocate (value(system%sheet%tape%count), fault(system%sheet%tape%count))
      do i = 0, 3
        z = [0.0_wp, 0.0_wp, merge(half_range, -half_range, btest(i, 0)), &
             self%drive_frequency*merge(half_range, -half_range, btest(i, 1)), 0*self%starts]
        call evaluate(system%sheet%tape, z, system%sheet%parameters, value, fault)
        sizes = max(sizes, abs(value(system%flights(1, 0)%rates(5:)))/self%drive_frequency)
      end do
    end associate
    where (.not. sizes > 0) sizes = 1
  end function sizes_of_states

  pure subroutine advance_body(self, section, time_end, tally, reason, log)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    section%passed = .false.
    call advance_motor(self%motor, section%state, section%motor, time_end, section%passed, tally, reason, log)
  end subroutine advance_body

  !> Past one event; none is the section.
  pure subroutine advance_body_past_event(self, section, speed, time_end, tally, reason)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    real(wp), intent(in) :: speed, time_end
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    section%passed = .false.
    call advance_motor(self%motor, section%state, section%motor, time_end, section%passed, tally, reason, one_event=.true.)
  end subroutine advance_body_past_event

  pure subroutine advance_to_section(self, section, tally, reason, log)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    type(log_t), intent(inout), optional :: log
    if (self%by_event) then
      call self%advance_to_turn(section, tally, reason)
      return
    end if
    section%lasted = self%period
    call self%advance(section, self%period, tally, reason, log)
    if (reason /= 0) return
    section%state%time = 0
    call take_turns(self%turn, section%state, tally)
    if (self%motor%system%aperiodic) section%motor%phi = section%motor%phi + self%period
    if (present(log)) log%origin = log%origin + self%period
    call check_hold(self%motor%system, section%state, section%motor, log)
    call append_word(tally, word_period)
    if (.not. present(log)) return
    if (.not. allocated(log%instants)) log%next_sample = 0
  end subroutine advance_to_section

  !> Moves to where the body turns round and starts the clock anew.
  pure subroutine advance_to_turn(self, section, tally, reason)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(inout) :: section
    type(tally_t), intent(inout) :: tally
    integer, intent(out) :: reason
    real(wp) :: start
    start = section%state%time
    section%passed = .true.
    call advance_motor(self%motor, section%state, section%motor, start + longest_return*self%period, section%passed, tally, reason)
    if (reason == 0 .and. .not. section%passed) reason = reason_time_over
    section%lasted = section%state%time - start
    section%state%time = 0
    call append_word(tally, word_period)
  end subroutine advance_to_turn

  pure subroutine without_stops(self, free, positions)
    class(own_machine_t), intent(in) :: self
    class(machine_t), allocatable, intent(inout) :: free
    integer, intent(out) :: positions
    type(own_machine_t) :: same
    same = self
    same%motor%system%contact = contact_t()
    call set_facts(same)
    positions = 0
    allocate (free, source=same)
  end subroutine without_stops

  !> Position of the foot of the spring, and the states, at the samples.
  pure function sample_columns(self, crank_angle, log) result(columns)
    class(own_machine_t), intent(in) :: self
    real(wp), intent(in) :: crank_angle
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    real(wp) :: values(6 + size(self%starts), log%samples)
    integer :: i
    ! A motion that was given up at its start has no samples.
    if (log%samples > 0) values = log%sample_coordinates(:size(values, 1), :log%samples)
    allocate (columns(1 + size(self%starts)))
    call set_column(columns(1), 'drive', 'm', 'position of the foot of the spring', values(6, :))
    do i = 1, size(self%starts)
      call set_column(columns(1 + i), 'state_'//trim(self%names(i)), trim(self%units(i)), 'state '//trim(self%names(i)), &
                      values(6 + i, :))
    end do
  end function sample_columns

  !> Closes the balance of a log: a jump of the foot at this instant has been, or not, as the energy has it.
  pure subroutine record_end(self, section, sampled, log)
    class(own_machine_t), intent(in) :: self
    class(section_state_t), intent(in) :: section
    logical, intent(in) :: sampled
    type(log_t), intent(inout) :: log
    call self%motor_machine_t%record_end(section, sampled, log)
    log%balance%work = log%balance%work + jump_until_now(self%motor%system, section%state, section%motor, log)
  end subroutine record_end

  pure function event_columns(self, log) result(columns)
    class(own_machine_t), intent(in) :: self
    type(log_t), intent(in) :: log
    type(machine_column_t), allocatable :: columns(:)
    allocate (columns(0))
  end function event_columns

  !> Whether the period without a drive is that of the spring at the origin.
  pure logical function has_mode(self) result(fact)
    class(own_machine_t), intent(in) :: self
    real(wp) :: force, stiffness
    call look_at_forces(self, force, stiffness)
    fact = stiffness > 0
  end function has_mode

end module own_machine
