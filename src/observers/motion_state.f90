! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What a moving machine is between two events (mode and state), what is counted on the way (tally),
!> and what is written down when asked (log).
module motion_state
  use circle, only: nearest_turn
  use kinds, only: int64, wp
  implicit none
  private

  public :: sample_time, sample_due, samples_before, make_room, closing_error, reset_tally, sticks_in, note_position, &
    position_of, take_turns, move_turn, append_word, open_log, record_event, put_in_order, record_sample, put_sample_balance, &
    put_column, watches_between_events

  !> Modes. While slipping the velocity keeps its sign; a turning point starts a new flight.
  integer, parameter, public :: mode_slip_plus = 1, mode_slip_minus = 2, mode_stick = 3, &
    mode_upper_barrier = 4, mode_lower_barrier = 5
  !> Of two bodies only: both at rest, the driven one on its stop. Slips are those of the driving body over the driven one.
  integer, parameter, public :: mode_held = 6

  !> Events.
  integer, parameter, public :: event_impact_upper = 1, event_impact_lower = 2, event_stick = 3, &
    event_release = 4, event_turning_point = 5, event_chatter_upper = 6, event_chatter_lower = 7, &
    event_barrier_release = 8, event_touch_upper = 9, event_touch_lower = 10, event_separation = 11, event_impulse = 12
  character(len=*), parameter, public :: event_names(12) = [character(len=15) :: 'impact_upper', &
    'impact_lower', 'stick', 'release', 'turning_point', 'chatter_upper', 'chatter_lower', &
    'barrier_release', 'touch_upper', 'touch_lower', 'separation', 'impulse']

  !> Symbols of event words, three bits each.
  integer, parameter, public :: word_upper = 1, word_lower = 2, word_stick = 3, &
    word_chatter_upper = 4, word_chatter_lower = 5, word_overflow = 6, word_period = 7
  integer, parameter :: word_capacity = 17

  !> Which flight is used: exact wherever it exists, exact only, adaptive only.
  integer, parameter, public :: flight_auto = 0, flight_exact = 1, flight_adaptive = 2

  !> State of the body. `time` runs within one drive period, from the stroboscopic section at crank
  !> angle 0.
  type, public :: state_t
    real(wp) :: x = 0, v = 0, time = 0
    integer :: mode = 0
    !> Force of Dahl's friction against the body [N], where that is.
    real(wp) :: z = 0
    !> Speed at which the last contact with a soft barrier began [m/s].
    real(wp) :: touch_speed = 0
    !> Of an angle: what has been taken off x, whole turns [rad].
    real(wp) :: turned = 0
  end type state_t

  type, public :: options_t
    integer :: flight = flight_auto
    !> Relative tolerance of the adaptive flight.
    real(wp) :: tolerance = 1e-13_wp
    !> Events after which a trajectory is given up.
    integer(int64) :: event_budget = 1000000_int64
    !> Steps of adaptive flights after which a trajectory is given up.
    integer(int64) :: step_budget = 5000000_int64
    !> |x| beyond which the body has left the domain [m].
    real(wp) :: domain = 1e6_wp
    !> Doubles per vector where many bodies fly together; 0 = one by one.
    integer :: lane_width = 0
    !> The GPU on which many bodies fly together; -1: in vectors.
    integer :: gpu = -1
  end type options_t

  !> Counts and extremes since the last reset.
  type, public :: tally_t
    !> Flights, and steps of adaptive ones.
    integer(int64) :: events = 0, steps = 0
    integer(int64) :: impacts = 0, chatters = 0, sticks = 0, slips = 0
    real(wp) :: impact_speed_sum = 0, last_impact_speed = 0
    real(wp) :: x_max = -huge(1.0_wp), x_min = huge(1.0_wp), v_max = -huge(1.0_wp)
    !> Smallest distance to a barrier at a turning point that missed it [m].
    real(wp) :: grazing_margin = huge(1.0_wp)
    integer(int64) :: word = 0
    integer :: word_length = 0
    !> Turns of an angle, upwards.
    integer(int64) :: turns = 0
    !> The largest velocity costs a search in every flight: only when asked.
    logical :: needs_v_max = .false.
  end type tally_t

  !> Where the energy went since the start [J]: lost to dry friction, to viscous damping, to contacts; put in by the drive.
  type, public :: energy_balance_t
    real(wp) :: friction = 0, damping = 0, contact = 0, work = 0
    !> Energy of the machine then and now.
    real(wp) :: at_start = 0, at_end = 0
    !> Whether anybody will read it.
    logical :: kept = .true.
  end type energy_balance_t

  !> Every event and samples, equidistant or at chosen instants, in absolute time. Storage grows as needed.
  type, public :: log_t
    !> Absolute time of the start of the current drive period [s].
    real(wp) :: origin = 0
    !> Distance of samples within a period [s]; 0 = no samples.
    real(wp) :: sample_interval = 0
    !> Instants of the samples [s], ascending, in place of the equidistant ones.
    real(wp), allocatable :: instants(:)
    integer :: events = 0, samples = 0
    !> Index of the next sample, from 0: within the current period, or of the chosen instants.
    integer :: next_sample = 0
    integer, allocatable :: event_kind(:), sample_mode(:)
    !> Rows: time, x, v before, v after.
    real(wp), allocatable :: event_data(:, :)
    !> Rows: time, x, v.
    real(wp), allocatable :: sample_data(:, :)
    !> Soft barriers: largest force [N] and penetration [m], work done on them [J].
    real(wp) :: peak_force = 0, peak_penetration = 0, contact_work = 0
    !> Position and velocity of the driving body of two, at events and at samples.
    real(wp), allocatable :: event_driver(:, :), sample_driver(:, :)
    !> Energy balance until now, and until each sample: rows as in `energy_balance_t`, `at_end` being the energy then.
    type(energy_balance_t) :: balance
    real(wp), allocatable :: sample_balance(:, :)
    !> Energy of a spring whose foot may jump [J], as the motion so far left it.
    real(wp) :: stored = 0
    logical :: has_stored = .false.
    !> Speed at which the last contact with a soft barrier began, at samples; one row.
    real(wp), allocatable :: sample_touch(:, :)
    !> Of several bodies: coordinates and speeds at samples; number, coordinate, and speed before and after of the joint of an
    !> event.
    real(wp), allocatable :: sample_coordinates(:, :), event_joint(:, :)
  end type log_t

contains

  !> Whether a log holds more of a motion than its events.
  pure logical function watches_between_events(log)
    type(log_t), intent(in) :: log
    watches_between_events = log%balance%kept .or. log%sample_interval > 0
  end function watches_between_events

  !> Time of the next sample [s after the section].
  pure real(wp) function sample_time(log)
    type(log_t), intent(in) :: log
    if (.not. allocated(log%instants)) then
      sample_time = log%next_sample*log%sample_interval
    else if (log%next_sample < size(log%instants)) then
      sample_time = log%instants(log%next_sample + 1) - log%origin
    else
      sample_time = huge(1.0_wp)
    end if
  end function sample_time

  !> Whether the next sample comes before `until` [s after the section] by more than rounding: the end of a period is the
  !> first sample of the next.
  pure logical function sample_due(log, until)
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: until
    sample_due = sample_time(log) < until*(1 - 8*epsilon(until))
  end function sample_due

  !> Number of the chosen instants that come before `until` [s after the section], in the sense of `sample_due`.
  pure integer function samples_before(log, until) result(last)
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: until
    real(wp) :: limit
    limit = until*(1 - 8*epsilon(until))
    last = log%next_sample
    do while (last < size(log%instants))
      if (.not. log%instants(last + 1) - log%origin < limit) exit
      last = last + 1
    end do
  end function samples_before

  !> What is missing in an energy balance [J].
  pure elemental real(wp) function closing_error(balance)
    type(energy_balance_t), intent(in) :: balance
    closing_error = balance%at_start + balance%work - balance%friction - balance%damping - balance%contact - balance%at_end
  end function closing_error

  !> Whether a mode is a stick phase. Two bodies stick where the one does not slide over the other: not where the driven one
  !> rests on its stop while the driving one slides on.
  pure elemental logical function sticks_in(mode, two_bodies)
    integer, intent(in) :: mode
    logical, intent(in) :: two_bodies
    sticks_in = mode == mode_stick .or. mode == mode_held .or. &
      ((mode == mode_upper_barrier .or. mode == mode_lower_barrier) .and. .not. two_bodies)
  end function sticks_in

  !> Starts counting anew from a state, of a body or the driven one of two; keeps what was asked for.
  pure subroutine reset_tally(tally, state, two_bodies)
    type(tally_t), intent(inout) :: tally
    type(state_t), intent(in) :: state
    logical, intent(in) :: two_bodies
    logical :: needs_v_max
    integer(int64) :: events, steps
    needs_v_max = tally%needs_v_max
    events = tally%events
    steps = tally%steps
    tally = tally_t()
    tally%needs_v_max = needs_v_max
    tally%events = events
    tally%steps = steps
    call note_position(tally, state)
    tally%v_max = state%v
    if (sticks_in(state%mode, two_bodies)) tally%sticks = 1
  end subroutine reset_tally

  !> Position since the start; of an angle with the turns that it has made.
  pure real(wp) function position_of(state) result(x)
    type(state_t), intent(in) :: state
    x = state%x
    if (abs(state%turned) > 0) x = x + state%turned
  end function position_of

  !> Takes whole turns off an angle, so that it keeps its digits however often it goes round. The extremes go with it.
  pure subroutine take_turns(turn, state, tally)
    real(wp), intent(in) :: turn
    type(state_t), intent(inout) :: state
    type(tally_t), intent(inout), optional :: tally
    real(wp) :: taken
    if (.not. turn > 0) return
    taken = state%x - nearest_turn(state%x, 0.0_wp, turn)
    if (abs(taken) > turn/2) call move_turn(turn, taken, state, tally)
  end subroutine take_turns

  !> Takes `taken`, whole turns, off an angle.
  pure subroutine move_turn(turn, taken, state, tally)
    real(wp), intent(in) :: turn, taken
    type(state_t), intent(inout) :: state
    type(tally_t), intent(inout), optional :: tally
    state%x = state%x - taken
    state%turned = state%turned + taken
    if (.not. present(tally)) return
    tally%x_max = tally%x_max - taken
    tally%x_min = tally%x_min - taken
    tally%turns = tally%turns + nint(taken/turn, int64)
  end subroutine move_turn

  !> Extremes of the position are taken at the ends of flights: between them x is monotone.
  pure subroutine note_position(tally, state)
    type(tally_t), intent(inout) :: tally
    type(state_t), intent(in) :: state
    tally%x_max = max(tally%x_max, state%x)
    tally%x_min = min(tally%x_min, state%x)
  end subroutine note_position

  !> Adds a symbol to the event word.
  pure subroutine append_word(tally, symbol)
    type(tally_t), intent(inout) :: tally
    integer, intent(in) :: symbol
    integer :: shift
    if (tally%word_length >= word_capacity) return
    shift = 3*tally%word_length
    tally%word_length = tally%word_length + 1
    if (tally%word_length == word_capacity) then
      tally%word = ior(tally%word, ishft(int(word_overflow, int64), shift))
    else
      tally%word = ior(tally%word, ishft(int(symbol, int64), shift))
    end if
  end subroutine append_word

  !> An empty log, whose arrays can be read as they are, with samples `interval` [s] apart within a drive period; 0 = none.
  pure subroutine open_log(log, interval)
    type(log_t), intent(out) :: log
    real(wp), intent(in) :: interval
    log%sample_interval = interval
    allocate (log%event_kind(256), log%event_data(4, 256), log%sample_mode(4096), log%sample_data(3, 4096))
    allocate (log%event_driver(2, 256), log%sample_driver(2, 256), log%sample_balance(5, 256), log%sample_touch(1, 256))
  end subroutine open_log

  !> Writes an event down: state just before it and the velocity just after; `driver` is x, v of the driving body of two.
  pure subroutine record_event(log, kind, state, v_after, driver)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: kind
    type(state_t), intent(in) :: state
    real(wp), intent(in) :: v_after
    real(wp), intent(in), optional :: driver(2)
    integer, allocatable :: kinds_grown(:)
    real(wp), allocatable :: data_grown(:, :)
    if (.not. allocated(log%event_kind)) allocate (log%event_kind(256), log%event_data(4, 256))
    if (log%events == size(log%event_kind)) then
      allocate (kinds_grown(2*log%events), data_grown(4, 2*log%events))
      kinds_grown(:log%events) = log%event_kind
      data_grown(:, :log%events) = log%event_data
      call move_alloc(kinds_grown, log%event_kind)
      call move_alloc(data_grown, log%event_data)
    end if
    log%events = log%events + 1
    log%event_kind(log%events) = kind
    log%event_data(:, log%events) = [log%origin + state%time, position_of(state), state%v, v_after]
    if (present(driver)) call put_column(log%event_driver, log%events, driver)
  end subroutine record_event

  !> Puts the last event before those that end after it: a chatter is reported when it is completed, at the time when it is over.
  pure subroutine put_in_order(log)
    type(log_t), intent(inout) :: log
    integer :: k
    do k = log%events, 2, -1
      if (.not. log%event_data(1, k) < log%event_data(1, k - 1)) exit
      log%event_kind(k - 1:k) = log%event_kind(k:k - 1:-1)
      log%event_data(:, k - 1:k) = log%event_data(:, k:k - 1:-1)
      call swap_columns(log%event_driver, k)
      call swap_columns(log%event_joint, k)
    end do
  end subroutine put_in_order

  !> Swaps a column with the one before it, where there is one: a machine without a driving body has room for it and fills none.
  pure subroutine swap_columns(columns, k)
    real(wp), allocatable, intent(inout) :: columns(:, :)
    integer, intent(in) :: k
    if (.not. allocated(columns)) return
    if (k <= size(columns, 2)) columns(:, k - 1:k) = columns(:, k:k - 1:-1)
  end subroutine swap_columns

  !> Writes one sample down and moves on to the next; `driver` is x, v of the driving body of two, `balance` the energy.
  pure subroutine record_sample(log, state, driver, balance)
    type(log_t), intent(inout) :: log
    type(state_t), intent(in) :: state
    real(wp), intent(in), optional :: driver(2)
    type(energy_balance_t), intent(in), optional :: balance
    call make_room(log, log%samples + 1)
    log%samples = log%samples + 1
    log%next_sample = log%next_sample + 1
    log%sample_mode(log%samples) = state%mode
    log%sample_data(:, log%samples) = [log%origin + state%time, position_of(state), state%v]
    if (log%balance%kept) call put_column(log%sample_touch, log%samples, [state%touch_speed])
    if (present(driver)) call put_column(log%sample_driver, log%samples, driver)
    if (present(balance)) call put_sample_balance(log, log%samples, balance)
  end subroutine record_sample

  !> Room for `count` samples.
  pure subroutine make_room(log, count)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: count
    integer, allocatable :: modes_grown(:)
    real(wp), allocatable :: data_grown(:, :)
    if (.not. allocated(log%sample_mode)) allocate (log%sample_mode(4096), log%sample_data(3, 4096))
    if (count <= size(log%sample_mode)) return
    allocate (modes_grown(2*count), data_grown(3, 2*count))
    modes_grown(:log%samples) = log%sample_mode(:log%samples)
    data_grown(:, :log%samples) = log%sample_data(:, :log%samples)
    call move_alloc(modes_grown, log%sample_mode)
    call move_alloc(data_grown, log%sample_data)
  end subroutine make_room

  !> Writes down where the energy went until sample number `sample`, in order.
  pure subroutine put_sample_balance(log, sample, balance)
    type(log_t), intent(inout) :: log
    integer, intent(in) :: sample
    type(energy_balance_t), intent(in) :: balance
    call put_column(log%sample_balance, sample, [balance%friction, balance%damping, balance%contact, balance%work, balance%at_end])
  end subroutine put_sample_balance

  !> Puts values into column `column`, the one after the last.
  pure subroutine put_column(columns, column, values)
    real(wp), allocatable, intent(inout) :: columns(:, :)
    integer, intent(in) :: column
    real(wp), intent(in) :: values(:)
    real(wp), allocatable :: grown(:, :)
    if (.not. allocated(columns)) allocate (columns(size(values), 256))
    if (column > size(columns, 2)) then
      allocate (grown(size(values), 2*size(columns, 2)))
      grown(:, :size(columns, 2)) = columns
      call move_alloc(grown, columns)
    end if
    columns(:, column) = values
  end subroutine put_column

end module motion_state
