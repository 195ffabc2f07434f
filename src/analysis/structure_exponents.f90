! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Lyapunov spectrum of a motion of a structure, by orthogonal directions carried from section to section (Benettin et al. 1980).
module structure_exponents
  use cycle_reached, only: cycle_watch_t, note_cycle, note_cycle_exponents
  use direction_frame, only: log_of, orthogonalise
  use exponents, only: batches, decay_of, error_of, lyapunov_exponents, spectrum_t
  use exponents_in_lanes, only: gather_exponents, gathers_in_lanes
  use hybrid_machine, only: event_t
  use turn_exponents, only: died_away, exponents_from_point, exponents_of_turns, fades_away, goes_on, quiet_sections, still
  use multibody_section, only: multibody_point, lay_out
  use multibody_state, only: multibody_state_t
  use kinds, only: int64, wp
  use motion, only: start_state
  use motion_state, only: state_t, tally_t
  use one_body, only: one_body_t
  use status, only: reason_not_smooth
  use structure, only: coordinates_of, structure_t
  use structure_modes, only: mode_number
  use structure_family, only: least_dimension, state_at_start, vary_section
  use structure_volumes, only: has_exact_sum, note_events, note_sum
  use structure_walk, only: advance_section, start_of_structure
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: exponents_of_structure, exponents_of_machine, exponents_from_section

  !> Section points within this share of the natural size are one.
  real(wp), parameter :: fixed = 1e-9_wp

contains

  !> Exponents of the motion of a machine, of whatever kind, from `start` (see `machine_t`): those of module `exponents` for
  !> one body.
  subroutine exponents_of_machine(machines, start, transient, sections, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: start(:)
    integer, intent(in) :: transient, sections
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: series(:)
    type(state_t) :: state
    type(multibody_state_t) :: multibody
    select type (machine => machines%centre)
    type is (one_body_t)
      state = start_state(machine%moving, start(1), start(2), start(3))
      if (gathers_in_lanes(machine, sections)) then
        call gather_exponents(machines, machine, state, transient, sections, spectrum, series)
      else
        call lyapunov_exponents(machines, state, transient, sections, spectrum, series)
      end if
      call look_at_section(machines, series, spectrum)
    type is (structure_t)
      multibody = state_at_start(machine, start)
      call exponents_of_structure(machines, machine, multibody, transient, sections, spectrum, series)
    class default
      call exponents_of_turns(machines, start, transient, sections, spectrum, series)
      call look_at_section(machines, series, spectrum)
    end select
  end subroutine exponents_of_machine

  !> Notes whether the section points come back, and the cycle that they are of.
  subroutine look_at_section(machines, series, spectrum)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(inout) :: series(:)
    type(spectrum_t), intent(inout) :: spectrum
    if (.not. spectrum%known) return
    ! Of a fixed point only the rounding moves.
    if (maxval(series) - minval(series) <= fixed*machines%centre%size_of(1)) series = series(1)
    call note_cycle(machines, series, spectrum)
  end subroutine look_at_section

  !> Exponents of the motion from a point of the section; not known for one beyond a stop.
  subroutine exponents_from_section(machines, point, transient, sections, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: transient, sections
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: series(:)
    type(multibody_state_t) :: multibody
    real(wp) :: from(size(point))
    logical :: ok
    select type (machine => machines%centre)
    type is (structure_t)
      call start_of_structure(machine, point, multibody, ok)
      if (ok) call exponents_of_structure(machines, machine, multibody, transient, sections, spectrum, series)
    type is (one_body_t)
      call exponents_of_machine(machines, [point, 0.0_wp], transient, sections, spectrum, series)
    class default
      from = point
      call exponents_from_point(machines, from, transient, sections, spectrum, series)
      call look_at_section(machines, series, spectrum)
    end select
  end subroutine exponents_from_section

  !> Exponents of the motion that starts at `state`, after `transient` sections, over `sections` (at least 32). `series` has the
  !> watched position on the section. Without a clock they are those across the motion: the trivial 0 is left out.
  subroutine exponents_of_structure(machines, structure, state, transient, sections, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    integer, intent(in) :: transient, sections
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: series(:)
    real(wp) :: frame(structure%n, structure%n), batch(batches, structure%n), growth(structure%n), duration, lasted, pace(sections)
    real(wp) :: rate, largest_rate
    type(event_t), allocatable :: events(:)
    type(cycle_watch_t) :: watch
    integer :: i, k, part, mode, left, quiet
    series = 0
    batch = 0
    duration = 0
    left = structure%n
    largest_rate = 0
    quiet = 0
    frame = 0
    do k = 1, structure%n
      frame(k, k) = 1
    end do
    spectrum%has_sum = has_exact_sum(structure)
    allocate (spectrum%exponents(structure%n), spectrum%errors(structure%n), source=0.0_wp)
    ! To the first section.
    call advance_alone(structure, state, events, lasted, spectrum%reason)
    if (spectrum%reason /= 0) return
    do i = 1 - transient, sections
      call bring_back(structure, state)
      mode = mode_number(structure%frame%moving%machine, state%phase)
      spectrum%passed = transient + i
      rate = pace_of(structure, mode, coordinates_of(structure, state))
      pace(max(1, i)) = rate
      largest_rate = max(largest_rate, rate)
      quiet = merge(quiet + 1, 0, rate <= died_away*largest_rate)
      spectrum%at_rest = .not. structure%has_clock .and. (rate < still .or. quiet >= quiet_sections)
      if (.not. structure%has_clock .and. quiet >= quiet_sections) return
      call advance_with_frame(machines, structure, state, frame, growth, events, lasted, spectrum%reason)
      if (spectrum%reason /= 0) return
      if (i < 1) then
        ! Without a clock it may be coming to rest.
        if (structure%has_clock .or. rate > goes_on) call look_for_cycle(machines, structure, watch, state, spectrum, series)
        if (spectrum%known .or. spectrum%reason /= 0) return
        cycle
      end if
      left = min(left, least_dimension(structure, mode, events))
      duration = duration + lasted
      part = 1 + int((int(i - 1, int64)*batches)/sections)
      where (growth > 0) batch(part, :) = batch(part, :) + log_of(growth)
      call note_events(structure, events, spectrum)
      if (i <= size(series)) series(i) = position_of(structure, state)
      if (i == size(series)) spectrum%point = coordinates_of(structure, state)
    end do
    spectrum%known = .true.
    spectrum%periods = sections
    spectrum%mean_period = duration/sections
    call conclude(structure, batch*batches/duration, duration, left, spectrum)
    spectrum%at_rest = .not. structure%has_clock .and. fades_away(pace, -spectrum%exponents(1)*duration/2)
    call look_at_section(machines, series, spectrum)
  end subroutine exponents_of_structure

  !> Looks at the next section point of a transient; on a cycle that attracts the exponents are those of its multipliers.
  subroutine look_for_cycle(machines, structure, watch, state, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    type(structure_t), intent(in) :: structure
    type(cycle_watch_t), intent(inout) :: watch
    type(multibody_state_t), intent(inout) :: state
    type(spectrum_t), intent(inout) :: spectrum
    real(wp), intent(inout) :: series(:)
    call watch%look(machines, position_of(structure, state), coordinates_of(structure, state))
    if (watch%sections > 0) call pass_cycle(structure, watch, state, spectrum, series)
  end subroutine look_for_cycle

  !> Goes once round the cycle on which a motion is; its exponents are those of its multipliers. Nothing is known where these do not
  !> distinguish the directions that are left from those that are lost; the watch goes on then.
  subroutine pass_cycle(structure, watch, state, spectrum, series)
    type(structure_t), intent(in) :: structure
    type(cycle_watch_t), intent(inout) :: watch
    type(multibody_state_t), intent(inout) :: state
    type(spectrum_t), intent(inout) :: spectrum
    real(wp), intent(inout) :: series(:)
    type(spectrum_t) :: before
    type(multibody_state_t) :: there
    type(event_t), allocatable :: events(:)
    real(wp) :: duration, lasted, positions(watch%sections)
    integer :: i, mode, left
    logical :: ok
    call start_of_structure(structure, watch%point, there, ok)
    if (ok) state = there
    before = spectrum
    duration = 0
    left = structure%n
    do i = 1, watch%sections
      call bring_back(structure, state)
      mode = mode_number(structure%frame%moving%machine, state%phase)
      call advance_alone(structure, state, events, lasted, spectrum%reason)
      if (spectrum%reason /= 0) return
      left = min(left, least_dimension(structure, mode, events))
      duration = duration + lasted
      call note_events(structure, events, spectrum)
      positions(i) = position_of(structure, state)
    end do
    if (.not. structure%has_clock) then
      left = min(left, structure%n - 1)
      spectrum%exponents = spectrum%exponents(:structure%n - 1)
      spectrum%errors = spectrum%errors(:structure%n - 1)
    end if
    call note_cycle_exponents(watch, duration, left, spectrum, ok)
    if (.not. ok) then
      spectrum = before
      watch%sections = 0
      return
    end if
    call note_sum(structure, duration, left, spectrum)
    spectrum%point = coordinates_of(structure, state)
    series = [(positions(1 + modulo(i - 1, size(positions))), i=1, size(series))]
  end subroutine pass_cycle

  !> Rate of change at a point of the section, in natural sizes. Where it is next to nothing the next section may be one of
  !> rounding.
  pure real(wp) function pace_of(structure, mode, point) result(pace)
    type(structure_t), intent(in) :: structure
    integer, intent(in) :: mode
    real(wp), intent(in) :: point(:)
    pace = norm2(structure%slope(mode, 0.0_wp, point)/structure%size_of)*structure%size_of_time()
  end function pace_of

  !> Takes from a structure that nothing ties to the ground the drift of the whole, which would run out of its digits.
  pure subroutine bring_back(structure, state)
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    real(wp), dimension(structure%frame%moving%machine%n) :: q, v
    associate (moving => structure%frame%moving)
      if (structure%positions == size(q) .and. structure%frame%speeds == size(q)) return
      call lay_out(moving, multibody_point(moving, state), q, v)
      state%q(:size(q)) = q
      state%v(:size(v)) = v
    end associate
  end subroutine bring_back

  !> Takes a motion on to its next section, `lasted` [s] later, with the events on the way. `reason` is not 0 if it had to be given
  !> up; `smooth` where a transition is not known to be smooth.
  subroutine advance_alone(structure, state, events, lasted, reason, smooth)
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    type(event_t), allocatable, intent(inout) :: events(:)
    real(wp), intent(out) :: lasted
    integer, intent(out) :: reason
    logical, intent(out), optional :: smooth
    type(tally_t) :: tally
    integer :: count_events
    logical :: certain
    if (.not. allocated(events)) allocate (events(8))
    count_events = 0
    lasted = 0
    certain = .true.
    ! Budgets are those of a section, as for one body.
    call advance_section(structure, state, lasted, events, count_events, tally, reason, certain)
    events = events(:count_events)
    if (present(smooth)) smooth = certain
  end subroutine advance_alone

  !> The same with orthonormal directions (columns of `frame`, in natural sizes), which grow by `growth`. `reason` is not 0 also
  !> where the derivatives are not known.
  subroutine advance_with_frame(machines, structure, state, frame, growth, events, lasted, reason)
    type(neighbourhood_t), intent(in) :: machines
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(inout) :: state
    real(wp), intent(inout) :: frame(:, :)
    real(wp), intent(out) :: growth(:), lasted
    type(event_t), allocatable, intent(inout) :: events(:)
    integer, intent(out) :: reason
    real(wp) :: point(structure%n), by_start(structure%n, structure%n)
    integer :: k, mode
    logical :: smooth, ok
    point = coordinates_of(structure, state)
    mode = mode_number(structure%frame%moving%machine, state%phase)
    call advance_alone(structure, state, events, lasted, reason, smooth)
    if (reason /= 0) return
    ok = smooth
    if (ok) call vary_section(machines, structure, mode, point, events, 1, coordinates_of(structure, state), by_start, ok)
    if (.not. ok) reason = reason_not_smooth
    if (.not. ok) return
    do k = 1, structure%n
      by_start(:, k) = by_start(:, k)*structure%size_of(k)/structure%size_of
    end do
    frame = matmul(by_start, frame)
    call orthogonalise(frame, growth)
  end subroutine advance_with_frame

  !> The watched position; what may be anywhere is watched by what does not run away.
  pure real(wp) function position_of(structure, state) result(position)
    type(structure_t), intent(in) :: structure
    type(multibody_state_t), intent(in) :: state
    real(wp) :: point(structure%n)
    position = state%q(structure%frame%moving%machine%watched)
    if (structure%positions == structure%frame%moving%machine%n) return
    point = coordinates_of(structure, state)
    position = point(1)
  end function position_of

  !> Means and standard errors of the batches (one column per exponent) of a motion of so long a duration [s] that leaves as many
  !> directions as are `left`.
  subroutine conclude(structure, batch, duration, left, spectrum)
    type(structure_t), intent(in) :: structure
    real(wp), intent(in) :: batch(:, :), duration
    integer, intent(in) :: left
    type(spectrum_t), intent(inout) :: spectrum
    integer :: k
    do k = 1, structure%n
      spectrum%exponents(k) = sum(batch(:, k))/batches
      spectrum%errors(k) = error_of(batch(:, k))
      if (k > left) spectrum%exponents(k) = -huge(1.0_wp)
    end do
    if (.not. structure%has_clock) then
      spectrum%exponents = spectrum%exponents(:structure%n - 1)
      spectrum%errors = spectrum%errors(:structure%n - 1)
    end if
    spectrum%decay = decay_of(batch(:, 1))
    spectrum%halves = 2*[sum(batch(:batches/2, 1)), sum(batch(batches/2 + 1:, 1))]/batches
    spectrum%sum_found = sum(batch)/batches
    call note_sum(structure, duration, left, spectrum)
  end subroutine conclude

end module structure_exponents
