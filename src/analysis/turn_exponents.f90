! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Lyapunov spectrum of a machine with a motor, or by expressions, by orthogonal directions carried from section to section.
!> Without a clock the trivial exponent 0 is left out.
module turn_exponents
  use cycle_reached, only: cycle_watch_t, note_cycle_exponents
  use direction_frame, only: log_of, orthogonalise
  use exponents, only: batches, decay_of, error_of, spectrum_t
  use hybrid_machine, only: event_t
  use kinds, only: int64, wp
  use machine_type, only: section_state_t
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, &
    mode_slip_minus, tally_t
  use motion_ending, only: note_ending, note_rest
  use status, only: reason_not_smooth, reason_step_failed
  use structure_family, only: vary_section
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: exponents_of_turns, exponents_from_point, fades_away

  !> A direction that shrinks to less than this share of the longest in a turn is rounding.
  real(wp), parameter :: digits_of_directions = 1e-13_wp
  !> Rate of change in natural sizes below which nothing moves; as a share of the largest, on so many sections in a row: that of a
  !> motion whose turns go on in the rounding.
  real(wp), parameter, public :: still = 1e-5_wp, died_away = 1e-9_wp
  integer, parameter, public :: quiet_sections = 8
  !> And above which it does not come to rest on a cycle.
  real(wp), parameter, public :: goes_on = 1e-3_wp

  !> How fast a motion changes at its sections.
  type :: pace_t
    !> In natural sizes, and the largest so far; the duration of the last return and of the longest one [s].
    real(wp) :: rate = 0, largest = 0, lasted = 0, longest = 0
    !> Sections in a row on which it has died away.
    integer :: quiet = 0
  end type pace_t

contains

  !> Exponents of the motion from `start` (see `machine_t`), after `transient` turns, over `turns` (at least 32). `series` has the
  !> position on the section.
  subroutine exponents_of_turns(machines, start, transient, turns, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: start(:)
    integer, intent(in) :: transient, turns
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: series(:)
    type(event_t), allocatable :: events(:)
    real(wp) :: point(machines%centre%n)
    logical :: ok
    series = 0
    call machines%centre%fly_to_section(start, point, events, ok)
    if (.not. ok) call note_ending(machines, start, .true., spectrum)
    if (ok) call exponents_from_point(machines, point, transient, turns, spectrum, series)
  end subroutine exponents_of_turns

  !> The same of the motion from a point of the section, which is moved on.
  subroutine exponents_from_point(machines, point, transient, turns, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(inout) :: point(:)
    integer, intent(in) :: transient, turns
    type(spectrum_t), intent(inout) :: spectrum
    real(wp), intent(out) :: series(:)
    type(event_t), allocatable :: events(:)
    real(wp) :: growth(size(point)), frame(size(point), size(point)), batch(batches, size(point)), duration, rates(turns)
    type(cycle_watch_t) :: watch
    type(pace_t) :: pace
    integer :: i, left, part, directions
    series = 0
    batch = 0
    duration = 0
    directions = size(point) - merge(0, 1, machines%centre%has_clock)
    left = directions
    call begin_frame(frame)
    do i = 1 - transient, turns
      call note_pace(machines, point, pace)
      rates(max(1, i)) = pace%rate
      spectrum%at_rest = pace%quiet >= quiet_sections .or. pace%rate < still
      spectrum%passed = transient + i
      if (pace%quiet >= quiet_sections) call note_rest(machines, point, mode_slip_minus, spectrum)
      if (pace%quiet >= quiet_sections) return
      call advance_frame(machines, point, frame, growth, events, left, spectrum%reason)
      if (spectrum%reason /= 0 .and. i < 1) then
        ! What a transient meets does not matter: the directions begin anew.
        call begin_frame(frame)
        call pass_turn(machines, point, spectrum%reason)
      else if (spectrum%reason == 0) then
        call note_return(duration_of(machines, events), pace)
      end if
      if (spectrum%reason == reason_step_failed) then
        call note_ending(machines, point, .false., spectrum)
        return
      end if
      if (spectrum%reason /= 0) return
      ! Nor what it loses.
      if (i < 1) then
        left = directions
        ! Without a clock it may be coming to rest.
        if (.not. pace%rate > goes_on) cycle
        call watch%look(machines, point(1), point)
        if (watch%sections == 0) cycle
        call pass_cycle(machines, watch, directions, pace%lasted, point, spectrum, series)
        if (spectrum%known .or. spectrum%reason /= 0) return
        cycle
      end if
      duration = duration + duration_of(machines, events)
      part = 1 + int((int(i - 1, int64)*batches)/turns)
      batch(part, :) = batch(part, :) + log_of(growth)
      spectrum%impacts = spectrum%impacts + count(events%kind == event_impact_upper .or. events%kind == event_impact_lower)
      if (i <= size(series)) series(i) = point(1)
      if (i == size(series)) spectrum%point = point
    end do
    call conclude(batch(:, :directions)*batches/duration, left, turns, duration, spectrum)
    spectrum%at_rest = .not. (machines%centre%has_clock .or. machines%centre%crank_section)
    if (spectrum%at_rest) spectrum%at_rest = fades_away(rates, -spectrum%exponents(1)*duration/2)
  end subroutine exponents_from_point

  !> Notes the pace at a point of the section. That of impacts that die out is the acceleration, which stays: they come ever
  !> faster, by as much as they are weaker.
  pure subroutine note_pace(machines, point, pace)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    type(pace_t), intent(inout) :: pace
    pace%rate = pace_of(machines, point)
    if (pace%longest > 0) pace%rate = pace%rate*(pace%lasted/pace%longest)
    pace%largest = max(pace%largest, pace%rate)
    pace%quiet = merge(pace%quiet + 1, 0, pace%rate <= died_away*pace%largest)
  end subroutine note_pace

  pure subroutine note_return(lasted, pace)
    real(wp), intent(in) :: lasted
    type(pace_t), intent(inout) :: pace
    pace%lasted = lasted
    pace%longest = max(pace%longest, lasted)
  end subroutine note_return

  !> Rate of change at a point of a section by an event, in natural sizes; endless where the section keeps the motion on.
  pure real(wp) function pace_of(machines, point) result(pace)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:)
    pace = huge(pace)
    if (machines%centre%has_clock .or. machines%centre%crank_section) return
    associate (machine => machines%centre)
      pace = norm2(machine%slope(mode_slip_minus, 0.0_wp, point)/machine%size_of)*machine%size_of_time()
    end associate
  end function pace_of

  !> Goes once round the cycle on which a motion is; its exponents are those of its multipliers. Nothing is known where these do not
  !> distinguish the directions that are left from those that are lost; the watch goes on then. `lasted` [s]: the last return of
  !> the motion, more than all those of the rest that it may come to.
  subroutine pass_cycle(machines, watch, directions, lasted, point, spectrum, series)
    type(neighbourhood_t), intent(in) :: machines
    type(cycle_watch_t), intent(inout) :: watch
    integer, intent(in) :: directions
    real(wp), intent(in) :: lasted
    real(wp), intent(inout) :: point(:)
    type(spectrum_t), intent(inout) :: spectrum
    real(wp), intent(inout) :: series(:)
    type(event_t), allocatable :: events(:)
    real(wp) :: growth(size(point)), frame(size(point), size(point)), duration, positions(watch%sections)
    integer(int64) :: impacts
    integer :: i, left
    logical :: ok
    left = directions
    duration = 0
    impacts = 0
    call begin_frame(frame)
    point = watch%point
    do i = 1, watch%sections
      call advance_frame(machines, point, frame, growth, events, left, spectrum%reason)
      if (spectrum%reason /= 0) return
      duration = duration + duration_of(machines, events)
      impacts = impacts + count(events%kind == event_impact_upper .or. events%kind == event_impact_lower)
      positions(i) = point(1)
    end do
    allocate (spectrum%exponents(directions), spectrum%errors(directions))
    ok = duration > lasted/2
    if (ok) call note_cycle_exponents(watch, duration, left, spectrum, ok)
    if (.not. ok) then
      deallocate (spectrum%exponents, spectrum%errors)
      watch%sections = 0
      return
    end if
    spectrum%impacts = impacts
    spectrum%point = point
    series = [(positions(1 + modulo(i - 1, size(positions))), i=1, size(series))]
  end subroutine pass_cycle

  !> Time from one section to the next [s].
  pure real(wp) function duration_of(machines, events) result(duration)
    type(neighbourhood_t), intent(in) :: machines
    type(event_t), intent(in) :: events(:)
    duration = machines%centre%period
    if (.not. machines%centre%has_clock) duration = events(size(events))%time
  end function duration_of

  !> Orthonormal directions, each of which has a part along every coordinate: those of coordinates that do not act on others would
  !> stay so, in whatever order they grow.
  pure subroutine begin_frame(frame)
    real(wp), intent(out) :: frame(:, :)
    real(wp), parameter :: golden = 0.6180339887498949_wp
    real(wp) :: normal(size(frame, 1))
    integer :: k
    normal = [(0.5_wp + modulo(k*golden, 1.0_wp), k=1, size(normal))]
    normal = normal/norm2(normal)
    frame = -2*spread(normal, 2, size(normal))*spread(normal, 1, size(normal))
    do k = 1, size(normal)
      frame(k, k) = frame(k, k) + 1
    end do
  end subroutine begin_frame

  !> One section without directions.
  subroutine pass_turn(machines, point, reason)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(inout) :: point(:)
    integer, intent(out) :: reason
    type(event_t), allocatable :: events(:)
    type(section_state_t) :: section
    type(tally_t) :: tally
    real(wp) :: image(size(point))
    integer :: mode
    logical :: ok
    call machines%centre%fly_sections(point, 1, .false., image, events, mode, tally, ok)
    if (.not. ok) then
      ! The instant of an event may not be certain, while the motion is.
      call machines%centre%begin(point, section, ok)
      if (ok) call machines%centre%go_on(section, image, ok)
    end if
    reason = merge(0, reason_step_failed, ok)
    if (ok) point = image
  end subroutine pass_turn

  !> One section, with orthonormal directions (columns of `frame`, in natural sizes), which grow by `growth`. `left`: directions
  !> that the motion leaves of its start.
  subroutine advance_frame(machines, point, frame, growth, events, left, reason)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(inout) :: point(:), frame(:, :)
    real(wp), intent(out) :: growth(:)
    type(event_t), allocatable, intent(out) :: events(:)
    integer, intent(inout) :: left
    integer, intent(inout) :: reason
    type(tally_t) :: tally
    real(wp) :: image(size(point)), by_start(size(point), size(point))
    integer :: k, mode
    logical :: ok
    associate (machine => machines%centre)
      call machine%fly_sections(point, 1, .false., image, events, mode, tally, ok)
      if (.not. ok) reason = reason_step_failed
      if (.not. ok) return
      ok = .not. any(events%kind == event_chatter_upper .or. events%kind == event_chatter_lower)
      if (ok) call vary_section(machines, machine, mode, point, events, 1, image, by_start, ok)
      if (.not. ok) reason = reason_not_smooth
      if (.not. ok) return
      do k = 1, size(point)
        by_start(:, k) = by_start(:, k)*machine%size_of(k)/machine%size_of
      end do
      do k = 1, size(events)
        if (machine%rests(events(k)%after)) left = min(left, size(point) - merge(1, 2, machine%has_clock))
      end do
      frame = matmul(by_start, frame)
      call orthogonalise(frame, growth)
      ! An integral that was held, or a current that follows at once, leaves nothing of a direction but rounding.
      left = min(left, count(growth > digits_of_directions*maxval(growth)))
      point = image
    end associate
  end subroutine advance_frame

  !> Whether a motion comes to rest: the paces at its sections fall from one half of them to the other as the largest exponent
  !> predicts, by `decay` as a logarithm, while those of a motion that comes to a cycle stay.
  pure logical function fades_away(pace, decay)
    real(wp), intent(in) :: pace(:), decay
    real(wp) :: fall
    integer :: half
    half = size(pace)/2
    fall = mean_log(pace(:half)) - mean_log(pace(half + 1:))
    ! The pace of a motion that dies away by a power of time falls by a share of that: a third under a cubic drag.
    fades_away = fall > decay/8 .or. (fall > 1 .and. pace(size(pace)) < still)
    ! A direction that is lost does not bound the pace.
    fades_away = fades_away .and. decay > 0 .and. decay < sqrt(huge(1.0_wp))
  end function fades_away

  pure real(wp) function mean_log(values)
    real(wp), intent(in) :: values(:)
    mean_log = sum(log_of(max(tiny(values), values)))/size(values)
  end function mean_log

  !> Means and standard errors of the batches (one column per exponent) of so many turns; directions beyond those `left` are lost.
  pure subroutine conclude(batch, left, turns, duration, spectrum)
    real(wp), intent(in) :: batch(:, :), duration
    integer, intent(in) :: left, turns
    type(spectrum_t), intent(inout) :: spectrum
    integer :: k, n
    spectrum%known = .true.
    spectrum%periods = turns
    spectrum%mean_period = duration/turns
    n = size(batch, 2)
    allocate (spectrum%exponents(n), spectrum%errors(n))
    do k = 1, n
      spectrum%exponents(k) = sum(batch(:, k))/batches
      spectrum%errors(k) = error_of(batch(:, k))
      if (k > left) spectrum%exponents(k) = -huge(1.0_wp)
    end do
    spectrum%decay = decay_of(batch(:, 1))
    spectrum%halves = 2*[sum(batch(:batches/2, 1)), sum(batch(batches/2 + 1:, 1))]/batches
    spectrum%sum_found = sum(spectrum%exponents)
  end subroutine conclude

end module turn_exponents
