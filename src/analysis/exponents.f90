! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Lyapunov exponents of a motion of one body, with standard errors and their exact sum as a check, and the 0-1 test.
module exponents
  use body_family, only: vary_period
  use constants, only: pi
  use elementary, only: logarithm
  use hybrid_machine, only: event_t
  use kinds, only: int64, wp
  use motion, only: advance_period
  use motion_state, only: event_chatter_lower, event_chatter_upper, event_impact_lower, event_impact_upper, event_stick, &
    event_touch_lower, event_touch_upper, event_turning_point, log_t, open_log, state_t, tally_t
  use one_body, only: one_body_t
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: lyapunov_exponents, error_of, zero_one_test, type_of_motion, period_of_section
  public :: conclude, decay_of, fly_on, has_exact_sum, loses_direction, note_events

  integer, parameter, public :: batches = 32
  !> Section points that the 0-1 test looks at, at most.
  integer, parameter, public :: most_points = 5000
  !> An area that shrinks to less than this share of its sides in a period is a difference of which rounding has left nothing.
  real(wp), parameter :: digits_of_areas = 1e-13_wp
  !> Frequencies of the 0-1 test.
  integer, parameter :: frequencies = 100
  !> Periods in which a direction turns to where it grows most.
  integer, parameter, public :: aligning = 100

  !> Values of the 0-1 test from and to which it decides.
  real(wp), parameter, public :: chaotic_from = 0.8_wp, regular_to = 0.2_wp

  !> A multiplier so near to the unit circle is on it.
  real(wp), parameter, public :: on_circle = 1e-10_wp

  !> What a motion may be.
  integer, parameter, public :: motion_not_known = 0, motion_contracting = 1, motion_neutral = 2, motion_chaotic = 3, &
    motion_transient = 4
  character(len=*), parameter, public :: motion_names(0:4) = [character(len=14) :: 'not_known', 'periodic', 'quasi_periodic', &
    'chaotic', 'transient']

  !> What holds a body that has come to rest.
  integer, parameter, public :: rests_nowhere = 0, rests_on_equilibrium = 1, rests_by_friction = 2, rests_on_stop = 3

  !> The end of a motion that comes to no further section.
  type, public :: ending_t
    integer :: rest = rests_nowhere
    !> How long it was waited for a section [s], and the impacts meanwhile; whether there was a motion before the rest.
    real(wp) :: lasted = 0
    integer(int64) :: impacts = 0
    logical :: moved = .true.
    !> The state at rest; of an equilibrium the eigenvalues [1/s], largest real part first.
    real(wp), allocatable :: point(:)
    complex(wp), allocatable :: eigenvalues(:)
  end type ending_t

  type, public :: spectrum_t
    !> Exponents [1/s], the largest first, -huge for a direction that is lost (sticking, completed chatter); standard errors by
    !> batch means.
    real(wp), allocatable :: exponents(:), errors(:)
    !> Power of the time with which the error of the largest falls: 1/2 for chance, up to 1 where the directions turn to and fro.
    real(wp) :: decay = 0.5_wp
    !> Sum of the exponents, and its value from damping, impacts and turning points alone; `has_sum`: whether the machine has such
    !> a formula.
    real(wp) :: sum_found = 0, sum_exact = 0
    logical :: has_sum = .false.
    !> The motion comes back to its section points, over and over.
    logical :: returns = .false.
    !> Its watched position does, and another coordinate does not.
    logical :: drifts = .false.
    !> The last section point that was kept, the number of sections of the cycle that it is on (0: none is known), and the largest
    !> modulus of the multipliers of that.
    real(wp), allocatable :: point(:)
    integer :: cycle = 0
    real(wp) :: multiplier = 0
    !> The exponents are those of the multipliers of that cycle, and `periods` its sections.
    logical :: by_multipliers = .false.
    !> Largest exponent of the first and of the second half.
    real(wp) :: halves(2) = 0
    !> What the turning of the directions may bring into exponents, where those are of many motions that turn alike [1/s].
    real(wp) :: memory = 0
    integer(int64) :: impacts = 0
    !> Sections that were used, and the time between two [s]; `known` is false if the motion was given up or met an event
    !> tangentially, for the `reason` (module `status`).
    integer :: periods = 0, reason = 0
    real(wp) :: mean_period = 0
    logical :: known = .false.
    !> Sections that a structure passed, and whether it was all but at rest then, or else comes to rest.
    integer :: passed = 0
    logical :: at_rest = .false.
    type(ending_t) :: ending
  end type spectrum_t

contains

  !> Exponents of the motion that starts at `state`, after `transient` drive periods, over `periods` (at least 32). `section` has
  !> the positions on the section.
  subroutine lyapunov_exponents(machines, state, transient, periods, spectrum, section)
    type(neighbourhood_t), intent(in) :: machines
    type(state_t), intent(inout) :: state
    integer, intent(in) :: transient, periods
    type(spectrum_t), intent(out) :: spectrum
    real(wp), intent(out) :: section(:)
    type(log_t) :: log
    type(event_t), allocatable :: events(:)
    real(wp) :: by_start(2, 2), direction(2), growth, batch(batches), lost(batches), determinant, duration
    integer :: i, part
    logical :: singular, dead, drowned
    section = 0
    spectrum%exponents = [0.0_wp, 0.0_wp]
    spectrum%errors = [0.0_wp, 0.0_wp]
    direction = [0.6_wp, 0.8_wp]
    batch = 0
    lost = 0
    singular = .false.
    dead = .false.
    drowned = .false.
    select type (body => machines%centre)
    type is (one_body_t)
      call open_log(log, 0.0_wp)
      log%balance%kept = .false.
      spectrum%has_sum = has_exact_sum(body)
      call fly_on(body, state, log, transient - aligning, spectrum%reason)
      if (spectrum%reason /= 0) return
      do i = 1 - min(transient, aligning), periods
        call vary_period(machines, body, state, log, events, by_start, spectrum%reason)
        if (spectrum%reason /= 0) return
        ! In units in which both coordinates are alike.
        by_start(1, 2) = by_start(1, 2)*body%size_of(2)/body%size_of(1)
        by_start(2, 1) = by_start(2, 1)*body%size_of(1)/body%size_of(2)
        call map_direction(by_start, direction, growth)
        if (i < 1) cycle
        dead = dead .or. .not. growth > 0
        determinant = abs(by_start(1, 1)*by_start(2, 2) - by_start(1, 2)*by_start(2, 1))
        singular = singular .or. any(loses_direction(events))
        drowned = drowned .or. .not. determinant > digits_of_areas*sum(by_start**2)
        part = 1 + int((int(i - 1, int64)*batches)/periods)
        if (growth > 0) batch(part) = batch(part) + logarithm(growth)
        if (determinant > 0) lost(part) = lost(part) + logarithm(determinant)
        call note_events(body, events, spectrum)
        if (i <= size(section)) section(i) = state%x
        if (i == size(section)) spectrum%point = [state%x, state%v]
      end do
      duration = periods*body%period
      spectrum%sum_exact = spectrum%sum_exact/duration - body%moving%machine%friction%damping/body%moving%machine%mass
      call conclude(batch*batches/duration, lost*batches/duration, singular .or. (drowned .and. .not. spectrum%has_sum), dead, &
                    spectrum)
      if (drowned .and. spectrum%has_sum .and. .not. dead) call take_exact_sum(spectrum)
    end select
    spectrum%known = .true.
    spectrum%periods = periods
    spectrum%mean_period = machines%centre%period
  end subroutine lyapunov_exponents

  !> Maps a direction and makes it a unit vector again; `growth` is its length in between. One that vanishes begins anew.
  pure subroutine map_direction(by_start, direction, growth)
    real(wp), intent(in) :: by_start(2, 2)
    real(wp), intent(inout) :: direction(2)
    real(wp), intent(out) :: growth
    direction = matmul(by_start, direction)
    growth = norm2(direction)
    if (growth > 0) then
      direction = direction/growth
    else
      direction = [0.6_wp, 0.8_wp]
    end if
  end subroutine map_direction

  !> Moves a body that starts at another crank angle on to the first section, and from there over `periods`, if any. `reason` is
  !> not 0 if it had to be given up.
  subroutine fly_on(body, state, log, periods, reason)
    type(one_body_t), intent(in) :: body
    type(state_t), intent(inout) :: state
    type(log_t), intent(inout) :: log
    integer, intent(in) :: periods
    integer, intent(out) :: reason
    type(tally_t) :: tally
    integer :: i
    reason = 0
    do i = merge(0, 1, state%time > 0), max(0, periods)
      tally = tally_t()
      log%events = 0
      log%origin = 0
      call advance_period(body%moving, state, tally, reason, log)
      if (reason /= 0) return
    end do
  end subroutine fly_on

  !> Whether an event leaves less of the start than came to it: sticking and an impact without rebound one direction, completed
  !> chatter none.
  pure elemental logical function loses_direction(event)
    type(event_t), intent(in) :: event
    loses_direction = any(event%kind == [event_stick, event_chatter_upper, event_chatter_lower]) .or. &
      (any(event%kind == [event_impact_upper, event_impact_lower]) .and. .not. abs(event%departure(2)) > 0)
  end function loses_direction

  !> Means and standard errors of the batches.
  pure subroutine conclude(largest, both, singular, dead, spectrum)
    real(wp), intent(in) :: largest(batches), both(batches)
    logical, intent(in) :: singular, dead
    type(spectrum_t), intent(inout) :: spectrum
    spectrum%exponents(1) = sum(largest)/batches
    spectrum%errors(1) = error_of(largest)
    spectrum%decay = decay_of(largest)
    spectrum%sum_found = sum(both)/batches
    spectrum%exponents(2) = spectrum%sum_found - spectrum%exponents(1)
    spectrum%errors(2) = error_of(both - largest)
    spectrum%halves = 2*[sum(largest(:batches/2)), sum(largest(batches/2 + 1:))]/batches
    spectrum%has_sum = spectrum%has_sum .and. .not. singular
    if (singular) spectrum%exponents(2) = -huge(1.0_wp)
    if (dead) spectrum%exponents = -huge(1.0_wp)
  end subroutine conclude

  !> The second exponent from the sum that the formula gives.
  pure subroutine take_exact_sum(spectrum)
    type(spectrum_t), intent(inout) :: spectrum
    spectrum%sum_found = spectrum%sum_exact
    spectrum%exponents(2) = spectrum%sum_exact - spectrum%exponents(1)
    spectrum%errors(2) = spectrum%errors(1)
  end subroutine take_exact_sum

  pure real(wp) function error_of(values)
    real(wp), intent(in) :: values(batches)
    error_of = norm2(values - sum(values)/batches)/sqrt(real(batches, wp)*(batches - 1))
  end function error_of

  !> Power of the time with which the error of a mean falls, from that of batches twice as long.
  pure real(wp) function decay_of(values) result(decay)
    real(wp), intent(in) :: values(batches)
    real(wp) :: twice(batches/2), spread(2)
    twice = (values(::2) + values(2::2))/2
    spread = [norm2(values - sum(values)/batches)/sqrt(batches - 1.0_wp), &
              norm2(twice - sum(twice)/size(twice))/sqrt(size(twice) - 1.0_wp)]
    decay = 0.5_wp
    if (all(spread > 0)) decay = min(1.0_wp, max(0.5_wp, logarithm(spread(1)/spread(2))/logarithm(2.0_wp)))
  end function decay_of

  !> Whether areas change by a formula: viscous damping, a constant restitution, friction that does not depend on the speed.
  pure logical function has_exact_sum(body)
    type(one_body_t), intent(in) :: body
    associate (machine => body%moving%machine)
      has_exact_sum = body%moving%exact .and. .not. body%moving%layer > 0 .and. .not. machine%contact%soft .and. &
                      machine%contact%kind == 0 .and. .not. machine%effects%present
    end associate
  end function has_exact_sum

  !> Adds the logarithms by which the events of a period change areas.
  pure subroutine note_events(body, events, spectrum)
    type(one_body_t), intent(in) :: body
    type(event_t), intent(in) :: events(:)
    type(spectrum_t), intent(inout) :: spectrum
    real(wp) :: before(2), after(2), e
    integer :: k
    e = body%moving%machine%contact%restitution
    do k = 1, size(events)
      associate (event => events(k))
        select case (event%kind)
        case (event_impact_upper, event_impact_lower)
          spectrum%impacts = spectrum%impacts + 1
          if (e > 0) spectrum%sum_exact = spectrum%sum_exact + 2*logarithm(e)
        case (event_touch_upper, event_touch_lower)
          spectrum%impacts = spectrum%impacts + 1
        case (event_turning_point)
          before = body%slope(event%before, event%time, event%arrival(:2))
          after = body%slope(event%after, event%time, event%departure(:2))
          spectrum%sum_exact = spectrum%sum_exact + logarithm(abs(after(2)/before(2)))
        end select
      end associate
    end do
  end subroutine note_events

  !> The 0-1 test of Gottwald and Melbourne (SIAM J. Appl. Dyn. Syst. 8, 2009), with their correction for the oscillating term:
  !> median over frequencies of the correlation of the mean square displacement with the time. Near 0 for regular motions,
  !> near 1 for chaotic ones.
  pure real(wp) function zero_one_test(series) result(k)
    real(wp), intent(in) :: series(:)
    real(wp) :: p(0:size(series)), q(0:size(series)), correlations(frequencies), c, mean, least
    real(wp), allocatable :: displacement(:)
    integer :: i, j, n, cut, at
    real(wp), parameter :: golden = (sqrt(5.0_wp) - 1)/2
    n = size(series)
    cut = n/10
    allocate (displacement(cut))
    mean = sum(series)/n
    do i = 1, frequencies
      ! Away from 0 and pi, where resonances are.
      c = pi/5 + 3*pi/5*modulo(i*golden, 1.0_wp)
      p = 0
      q = 0
      do j = 1, n
        p(j) = p(j - 1) + series(j)*cos(j*c)
        q(j) = q(j - 1) + series(j)*sin(j*c)
      end do
      ! Instant by instant: sums side by side are vectors.
      displacement = 0
      do j = 1, n - cut
        displacement = displacement + ((p(j + 1:j + cut) - p(j))**2 + (q(j + 1:j + cut) - q(j))**2)
      end do
      do j = 1, cut
        displacement(j) = displacement(j)/(n - cut) - mean**2*(1 - cos(j*c))/(1 - cos(c))
      end do
      correlations(i) = correlation(displacement)
    end do
    do i = 1, frequencies/2
      at = i - 1 + minloc(correlations(i:), 1)
      least = correlations(at)
      correlations(at) = correlations(i)
      correlations(i) = least
    end do
    k = least
  end function zero_one_test

  !> Correlation of values with their index.
  pure real(wp) function correlation(values)
    real(wp), intent(in) :: values(:)
    real(wp) :: x(size(values)), y(size(values))
    integer :: i
    x = [(real(i, wp), i=1, size(values))]
    x = x - sum(x)/size(x)
    y = values - sum(values)/size(values)
    correlation = 0
    if (norm2(y) > 0) correlation = sum(x*y)/(norm2(x)*norm2(y))
  end function correlation

  !> Smallest number of drive periods after which positions on the section come back over as many, 0: none up to half of them.
  !> They agree within `tolerance` of their range.
  pure integer function period_of_section(section, tolerance) result(period)
    real(wp), intent(in) :: section(:), tolerance
    integer :: n
    n = size(section)
    associate (room => tolerance*(maxval(section) - minval(section)))
      do period = 1, n/2
        if (abs(section(n) - section(n - period)) > room) cycle
        if (all(abs(section(n - period + 1:) - section(n - 2*period + 1:n - period)) <= room)) return
      end do
    end associate
    period = 0
  end function period_of_section

  !> The type of a motion by the cycle that it is on, or else by its largest exponent and the 0-1 test `k`, at three standard
  !> errors; not known where they disagree, or where it comes to rest. A neutral one must be so within the errors alone, and they
  !> must distinguish it from a cycle all of whose directions contract alike.
  pure integer function type_of_motion(spectrum, k) result(motion)
    type(spectrum_t), intent(in) :: spectrum
    real(wp), intent(in) :: k
    !> Of a logarithm over a section.
    real(wp), parameter :: rounding = 10*epsilon(1.0_wp)
    motion = motion_not_known
    if (.not. spectrum%known .or. spectrum%at_rest .or. spectrum%drifts) return
    associate (largest => spectrum%exponents(1), error => spectrum%errors(1), room => 3*spectrum%errors(1) + spectrum%memory)
      if (spectrum%cycle > 0 .and. spectrum%multiplier < 1 - on_circle) then
        if (k < regular_to) motion = motion_contracting
      else if (abs(spectrum%halves(1) - spectrum%halves(2)) > 2*sqrt(2.0_wp)*room + 1e-9_wp*abs(largest) .and. error > 0) then
        motion = motion_transient
      else if (largest > room .and. k > chaotic_from) then
        motion = motion_chaotic
      else if (largest < -room .and. largest < 0 .and. k < regular_to) then
        motion = motion_contracting
      else if (abs(largest)*spectrum%mean_period <= 3*error*spectrum%mean_period + rounding .and. k < regular_to) then
        ! One of a family of cycles is a cycle.
        motion = merge(motion_contracting, motion_neutral, spectrum%returns)
        if (.not. spectrum%returns .and. all_alike(spectrum) .and. spectrum%sum_exact < 0) motion = motion_not_known
      end if
    end associate
  end function type_of_motion

  !> Whether exponents that are all the same are within the errors.
  pure logical function all_alike(spectrum)
    type(spectrum_t), intent(in) :: spectrum
    all_alike = spectrum%has_sum .and. abs(spectrum%exponents(1) - spectrum%sum_exact/size(spectrum%exponents)) <= &
      3*spectrum%errors(1) + spectrum%memory
  end function all_alike

end module exponents
