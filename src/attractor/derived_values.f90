! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Values of derived quantities over a motion: Gauss quadrature between its events, and the energy balance for the powers.
module derived_values
  use attractors, only: attractor_t, find_box, kind_chaotic, kind_family, kind_not_known
  use capture, only: attractor_reached
  use constants, only: two_pi
  use derived_quantities, only: compile, compiled_t, depends_on_position, derived_t, is_fixed, is_power, power_names, &
    values_at_samples
  use errors, only: error_t
  use kinds, only: int64, wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t, section_state_t
  use motion_features, only: features_over
  use motion_state, only: closing_error, log_t, open_log, tally_t
  use single_trajectory, only: span_t
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: derive_over, derive_attractor

  !> Points of a panel: nodes and weights of Gauss and Legendre on -1 to 1, the positive half.
  integer, parameter :: points = 8
  real(wp), parameter :: half_nodes(4) = [0.18343464249564980494_wp, 0.52553240991632898582_wp, 0.79666647741362673959_wp, &
                                          0.96028985649753623168_wp]
  real(wp), parameter :: half_weights(4) = [0.36268378337836198297_wp, 0.31370664587788728734_wp, 0.22238103445337447054_wp, &
                                            0.10122853629037625915_wp]
  real(wp), parameter :: nodes(points) = [-half_nodes(4:1:-1), half_nodes]
  real(wp), parameter :: weights(points) = [half_weights(4:1:-1), half_weights]
  !> Panels in a period, doubled until two results agree to `goal` of the size of what is averaged; what does not agree to
  !> `allowed` after the last is not known. So is a power where the energy balance does not close to that.
  integer, parameter :: first_panels = 8, most_panels = 512
  real(wp), parameter :: goal = 1e-13_wp, allowed = 1e-6_wp
  !> Shorter panels, in units of the whole, are left out.
  real(wp), parameter :: shortest = 1e-13_wp

contains

  !> Values of `wanted` over `lasts` [s] from `start`, which are so many `periods`; not a number where one is not known.
  pure subroutine derive_over(machine, laws, wanted, start, lasts, periods, values)
    class(machine_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: laws(:)
    type(derived_t), intent(in) :: wanted(:)
    type(section_state_t), intent(in) :: start
    real(wp), intent(in) :: lasts, periods
    real(wp), intent(out) :: values(:)
    type(compiled_t) :: compiled
    type(error_t), allocatable :: error
    type(log_t) :: log
    real(wp), allocatable :: ends(:, :)
    integer :: i, faulty
    logical :: ok, known(size(wanted))
    values = ieee_value(1.0_wp, ieee_quiet_nan)
    call compile(machine, laws, wanted, compiled, faulty, error)
    if (allocated(error) .or. .not. lasts > 0) return
    call open_log(log, lasts)
    call fly(machine, start, lasts, [0.0_wp], .true., log, ok)
    if (.not. ok) return
    do i = 1, size(wanted)
      if (is_power(wanted(i))) values(i) = power_of(wanted(i), log, lasts)
    end do
    call values_at_samples(machine, compiled, angle_at(machine, start), log, ends, known)
    do i = 1, size(wanted)
      if (wanted(i)%quantity == 'drift' .and. known(i)) values(i) = (ends(i, size(ends, 2)) - ends(i, 1))/periods
    end do
    if (any(wanted%quantity == 'mean' .or. wanted%quantity == 'rms')) then
      call average(machine, compiled, wanted, start, lasts, periods, log, values)
    end if
  end subroutine derive_over

  !> Angle of a crank that turns at the given frequency [rad].
  pure real(wp) function angle_at(machine, start)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    angle_at = 0
    if (machine%timed) angle_at = two_pi*start%state%time/machine%period
  end function angle_at

  !> Moves on for `lasts` [s], with samples at `instants` since the start, and with `at_end` one at the end.
  pure subroutine fly(machine, start, lasts, instants, at_end, log, ok)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    real(wp), intent(in) :: lasts, instants(:)
    logical, intent(in) :: at_end
    type(log_t), intent(inout) :: log
    logical, intent(out) :: ok
    type(section_state_t) :: section
    type(tally_t) :: tally
    integer :: reason
    section = start
    call machine%begin_tally(section, tally)
    log%balance%at_start = machine%energy(section)
    log%origin = -section%state%time
    log%instants = instants
    reason = 0
    do while (machine%timed .and. lasts - log%origin >= machine%period*(1 - 8*epsilon(lasts)) .and. reason == 0)
      call machine%advance_to_section(section, tally, reason, log)
      ! Budgets are of one period.
      tally%events = 0
      tally%steps = 0
    end do
    do while (reason == 0 .and. lasts - log%origin > section%state%time + 8*epsilon(lasts)*lasts)
      call machine%advance(section, lasts - log%origin, tally, reason, log)
      if (machine%timed .or. .not. section%passed) exit
    end do
    ok = reason == 0
    if (ok) call machine%record_end(section, at_end, log)
  end subroutine fly

  !> Mean power [W]: put in by the drive, lost elsewhere.
  pure real(wp) function power_of(one, log, lasts) result(power)
    type(derived_t), intent(in) :: one
    type(log_t), intent(in) :: log
    real(wp), intent(in) :: lasts
    real(wp) :: size_of_energy
    associate (b => log%balance)
      size_of_energy = maxval(abs([b%friction, b%damping, b%contact, b%work, b%at_start, b%at_end]))
      power = ieee_value(1.0_wp, ieee_quiet_nan)
      if (.not. abs(closing_error(b)) <= allowed*size_of_energy) return
      power = dot_product([b%friction, b%damping, b%contact, b%work], merge(1.0_wp, 0.0_wp, power_names == one%expression))/lasts
    end associate
  end function power_of

  !> Means and rms values, from panels between the events of a `log`.
  pure subroutine average(machine, compiled, wanted, start, lasts, periods, log, values)
    class(machine_t), intent(in) :: machine
    type(compiled_t), intent(in) :: compiled
    type(derived_t), intent(in) :: wanted(:)
    type(section_state_t), intent(in) :: start
    real(wp), intent(in) :: lasts, periods
    type(log_t), intent(in) :: log
    real(wp), intent(inout) :: values(:)
    real(wp), dimension(size(wanted)) :: means, squares, before, before_squares, difference
    integer :: panels
    logical :: ok, known(size(wanted)), averaged(size(wanted))
    averaged = wanted%quantity == 'mean' .or. wanted%quantity == 'rms'
    panels = first_panels
    difference = huge(1.0_wp)
    do while (panels <= most_panels)
      call integrate(machine, compiled, start, lasts, breaks_of(machine, start, lasts, log), lasts/periods/panels, means, squares, &
                     known, ok)
      averaged = averaged .and. known
      if (.not. ok .or. .not. any(averaged)) return
      if (panels > first_panels) then
        difference = abs(means - before)
        where (wanted%quantity == 'rms') difference = abs(sqrt(squares) - sqrt(before_squares))
        if (.not. any(averaged .and. difference > goal*sqrt(squares))) exit
      end if
      before = means
      before_squares = squares
      panels = 2*panels
    end do
    where (averaged .and. difference <= allowed*sqrt(squares))
      values = merge(means, sqrt(squares), wanted%quantity == 'mean')
    end where
  end subroutine average

  !> Where the motion may not be smooth: start, sections, events, end [s], ascending.
  pure function breaks_of(machine, start, lasts, log) result(breaks)
    class(machine_t), intent(in) :: machine
    type(section_state_t), intent(in) :: start
    real(wp), intent(in) :: lasts
    type(log_t), intent(in) :: log
    real(wp), allocatable :: breaks(:)
    real(wp) :: next
    integer :: i
    breaks = [0.0_wp]
    next = machine%period - start%state%time
    if (.not. machine%timed) next = huge(next)
    do i = 1, log%events
      do while (next <= log%event_data(1, i))
        breaks = [breaks, next]
        next = next + machine%period
      end do
      if (log%event_data(1, i) >= breaks(size(breaks)) .and. log%event_data(1, i) < lasts) breaks = [breaks, log%event_data(1, i)]
    end do
    do while (next < lasts)
      breaks = [breaks, next]
      next = next + machine%period
    end do
    breaks = [breaks, lasts]
  end function breaks_of

  !> Mean of each expression that is defined at all points, and of its square, with panels of at most `longest` [s].
  pure subroutine integrate(machine, compiled, start, lasts, breaks, longest, means, squares, known, ok)
    class(machine_t), intent(in) :: machine
    type(compiled_t), intent(in) :: compiled
    type(section_state_t), intent(in) :: start
    real(wp), intent(in) :: lasts, breaks(:), longest
    real(wp), intent(out) :: means(:), squares(:)
    logical, intent(out) :: known(:), ok
    type(log_t) :: log
    real(wp), allocatable :: instants(:), weight(:), values(:, :)
    real(wp) :: length
    integer :: i, k, count, at, pass
    do pass = 1, 2
      at = 0
      do i = 2, size(breaks)
        length = breaks(i) - breaks(i - 1)
        if (length <= shortest*lasts) cycle
        count = max(1, ceiling(length/longest*(1 - 1e-9_wp)))
        do k = 1, count
          if (pass == 2) then
            instants(at + 1:at + points) = breaks(i - 1) + length*(k - 0.5_wp + 0.5_wp*nodes)/count
            weight(at + 1:at + points) = 0.5_wp*weights*length/count
          end if
          at = at + points
        end do
      end do
      if (pass == 1) allocate (instants(at), weight(at))
    end do
    call open_log(log, lasts)
    log%balance%kept = .false.
    call fly(machine, start, lasts, instants, .false., log, ok)
    ok = ok .and. log%samples == size(instants)
    if (.not. ok) return
    call values_at_samples(machine, compiled, angle_at(machine, start), log, values, known)
    means = matmul(values, weight)/lasts
    squares = matmul(values**2, weight)/lasts
  end subroutine integrate

  !> Values of `wanted` on attractor `k` of a catalogue, as far as it determines them: over its cycle; of one body in chaotic
  !> motion, or in one not known to be periodic, over the window of `span`. Not numbers for a family of cycles.
  pure subroutine derive_attractor(machine, laws, wanted, catalogue, k, span, values)
    class(machine_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: laws(:)
    type(derived_t), intent(in) :: wanted(:)
    type(attractor_t), intent(in) :: catalogue(:)
    integer, intent(in) :: k
    type(span_t), intent(in) :: span
    real(wp), intent(out) :: values(:)
    class(machine_t), allocatable :: on_section
    type(section_state_t) :: start
    real(wp) :: lasts
    integer :: i
    values = ieee_value(1.0_wp, ieee_quiet_nan)
    if (catalogue(k)%kind == kind_family .or. catalogue(k)%any_position) return
    if (catalogue(k)%kind == kind_chaotic .or. catalogue(k)%kind == kind_not_known) then
      call derive_over_window(machine, laws, wanted, catalogue, k, span, values)
      return
    end if
    allocate (on_section, source=machine)
    on_section%by_event = catalogue(k)%by_event
    start = on_section%state_at(catalogue(k)%points(:catalogue(k)%coordinates, 1))
    lasts = merge(catalogue(k)%duration, machine%period*max(1, catalogue(k)%period), catalogue(k)%duration > 0)
    call derive_over(machine, laws, wanted, start, lasts, real(max(1, catalogue(k)%period), wp), values)
    do i = 1, size(wanted)
      if (.not. is_fixed(machine, wanted(i))) values(i) = ieee_value(1.0_wp, ieee_quiet_nan)
      if (is_power(wanted(i)) .or. .not. catalogue(k)%rests) cycle
      if (depends_on_position(machine, wanted(i))) values(i) = ieee_value(1.0_wp, ieee_quiet_nan)
    end do
  end subroutine derive_attractor

  !> The same of a motion without a period, from a corner of its box, or between them, that leads onto it.
  pure subroutine derive_over_window(machine, laws, wanted, catalogue, k, span, values)
    class(machine_t), intent(in) :: machine
    type(law_choice_t), intent(in) :: laws(:)
    type(derived_t), intent(in) :: wanted(:)
    type(attractor_t), intent(in) :: catalogue(:)
    integer, intent(in) :: k
    type(span_t), intent(in) :: span
    real(wp), intent(inout) :: values(:)
    type(section_state_t) :: begins, section
    type(tally_t) :: tally
    integer(int64) :: slips
    integer :: i, n, window, transient, reason, share
    if (catalogue(k)%coordinates /= 2 .or. .not. machine%timed .or. machine%by_event) return
    window = max(1, nint(span%window/machine%period))
    transient = ceiling((span%duration - span%window)/machine%period)
    do share = 0, 2
      section = machine%state_at((1 - 0.5_wp*share)*catalogue(k)%points(:2, 1) + 0.5_wp*share*catalogue(k)%points(:2, 2))
      call machine%begin_tally(section, tally)
      do i = 1, transient + window
        if (i == transient + 1) begins = section
        if (i == transient + 1) call machine%begin_tally(section, tally)
        slips = tally%slips
        call machine%advance_to_section(section, tally, reason)
        if (reason /= 0) exit
        if (attractor_reached(machine, catalogue, section, tally%slips > slips) > 0) exit
      end do
      if (i <= transient + window) cycle
      associate (features => features_over(machine, tally, real(window, wp)))
        n = find_box(catalogue, machine%point_of(section), features%regime)
      end associate
      if (n /= k) cycle
      call derive_over(machine, laws, wanted, begins, window*machine%period, real(window, wp), values)
      return
    end do
  end subroutine derive_over_window

end module derived_values
