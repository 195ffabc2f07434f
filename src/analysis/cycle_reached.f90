! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The cycle that a motion is on at its section points: its period and multipliers decide what errors of long means cannot, whether
!> a motion that contracts very slowly is periodic. The exponents of a motion on a cycle are those of its multipliers, which spares
!> the means.
module cycle_reached
  use direction_frame, only: log_of
  use exponents, only: on_circle, period_of_section, spectrum_t
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use matrices, only: solve
  use motion_state, only: tally_t
  use multipliers, only: multipliers_of
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: note_cycle, note_cycle_exponents

  !> Section points come back within this share of their range. In natural sizes: one so near to a cycle is on it, so near it may
  !> come to it; and Newton's method has converged where its steps are no longer.
  real(wp), parameter :: same = 1e-7_wp, on_cycle = 1e-6_wp, beside_cycle = 1, converged = 1e-11_wp
  integer, parameter :: most_newton = 12
  !> In natural sizes: a coordinate that differs by more when the watched position has come back drifts.
  real(wp), parameter :: no_drift = 1e-4_wp
  !> Of a motion that has not come back yet: the longest cycle that it may come to, in how many sections the distance must shrink,
  !> taken as the largest of so many, and by how much, as a logarithm, the multiplier lets it at least.
  integer, parameter :: longest = 32, watched_sections = 20000, block = 256
  real(wp), parameter :: least_decay = 0.05_wp
  !> Section points that show the period of a cycle. A cycle is looked for after so many sections, and whenever they have doubled.
  integer, parameter :: last_points = 64
  !> Moduli from which on a multiplier is known to the digits of an exponent, and up to which it is that of a lost direction.
  real(wp), parameter :: known_from = 1e-6_wp, lost_to = 1e-9_wp

  !> A motion that is watched in its transient, until it is on a cycle that attracts.
  type, public :: cycle_watch_t
    !> Sections of the cycle, 0: none is known; its section point and multipliers.
    integer :: sections = 0
    real(wp), allocatable :: point(:)
    complex(wp), allocatable :: multipliers(:)
    integer, private :: passed = 0, next = last_points
    real(wp), private :: positions(last_points) = 0
  contains
    procedure :: look => look_for_cycle
  end type cycle_watch_t

contains

  !> Looks at the next section point, with the watched position there.
  subroutine look_for_cycle(self, machines, position, point)
    class(cycle_watch_t), intent(inout) :: self
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: position, point(:)
    integer :: sections
    self%positions = [self%positions(2:), position]
    self%passed = self%passed + 1
    if (self%passed < self%next) return
    self%next = 2*self%next
    call find_cycle(machines, nearest_period(self%positions), point, self%point, sections, self%multipliers)
    if (sections == 0) return
    if (maxval(abs(self%multipliers)) >= 1 - on_circle .or. distance(machines%centre, self%point, point) > on_cycle) return
    self%sections = sections
  end subroutine look_for_cycle

  !> Exponents of a motion on a watched cycle that takes a `duration` [s] and leaves so many directions as are `left`. `ok`: the
  !> multipliers distinguish the directions that are left from those that are lost.
  subroutine note_cycle_exponents(watch, duration, left, spectrum, ok)
    type(cycle_watch_t), intent(in) :: watch
    real(wp), intent(in) :: duration
    integer, intent(in) :: left
    type(spectrum_t), intent(inout) :: spectrum
    logical, intent(out) :: ok
    real(wp) :: sizes(size(watch%multipliers))
    sizes = abs(watch%multipliers)
    ok = all(sizes(:left) > known_from) .and. all(sizes(left + 1:) < lost_to)
    if (.not. ok) return
    spectrum%exponents(:left) = log_of(sizes(:left))/duration
    spectrum%exponents(left + 1:) = -huge(1.0_wp)
    spectrum%errors = 0
    spectrum%halves = spectrum%exponents(1)
    spectrum%sum_found = sum(spectrum%exponents)
    spectrum%cycle = watch%sections
    spectrum%multiplier = maxval(sizes)
    spectrum%by_multipliers = .true.
    spectrum%returns = .true.
    spectrum%known = .true.
    spectrum%periods = watch%sections
    spectrum%mean_period = duration/watch%sections
  end subroutine note_cycle_exponents

  !> Notes in `spectrum` whether the section points come back, and the cycle that the last of them (`spectrum%point`, of which
  !> `series` has the watched position) is on, if Newton's method finds one.
  subroutine note_cycle(machines, series, spectrum)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: series(:)
    type(spectrum_t), intent(inout) :: spectrum
    real(wp), allocatable :: point(:)
    complex(wp), allocatable :: values(:)
    integer :: period, sections
    period = period_of_section(series, same)
    spectrum%returns = period > 0
    if (.not. allocated(spectrum%point)) return
    if (spectrum%returns) spectrum%drifts = .not. comes_back(machines%centre, spectrum%point, period, no_drift)
    if (spectrum%drifts) spectrum%returns = .false.
    if (.not. spectrum%returns) period = nearest_period(series)
    call find_cycle(machines, period, spectrum%point, point, sections, values)
    if (sections == 0) return
    if (distance(machines%centre, point, spectrum%point) > on_cycle) then
      if (.not. approaches(machines, point, spectrum%point, sections, maxval(abs(values)))) return
    end if
    spectrum%cycle = sections
    spectrum%multiplier = maxval(abs(values))
  end subroutine note_cycle

  !> The cycle next to `start` that comes back after a `period` of so many sections, or a divisor: its section point, `sections` (0:
  !> there is none) and multipliers.
  subroutine find_cycle(machines, period, start, point, sections, values)
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: period
    real(wp), intent(in) :: start(:)
    real(wp), allocatable, intent(out) :: point(:)
    integer, intent(out) :: sections
    complex(wp), allocatable, intent(out) :: values(:)
    real(wp), allocatable :: matrix(:, :)
    integer :: k
    logical :: ok
    sections = 0
    call refine(machines, period, start, point, matrix, ok)
    if (.not. ok) return
    do k = 1, period
      if (modulo(period, k) /= 0) cycle
      if (comes_back(machines%centre, point, k, same)) exit
    end do
    ! Newton's method came to an orbit too unstable to come back to the digits it is known to.
    if (k > period) return
    if (k < period) call refine(machines, k, start, point, matrix, ok)
    if (.not. ok) return
    values = multipliers_of(matrix)
    ! One that rounding hides is not known.
    if (all(abs(values) < huge(1.0_wp))) sections = k
  end subroutine find_cycle

  !> The number of sections, up to `longest`, after which the last positions come back the nearest.
  pure integer function nearest_period(series) result(period)
    real(wp), intent(in) :: series(:)
    real(wp) :: miss(min(longest, size(series)/2))
    integer :: p
    associate (n => size(series))
      miss = [(maxval(abs(series(n - size(miss) + 1:) - series(n - size(miss) + 1 - p:n - p))), p=1, size(miss))]
    end associate
    period = minloc(miss, 1)
  end function nearest_period

  !> Whether the motion from `start` comes nearer to the cycle through `point`, at least half as fast as its multiplier has it in
  !> the end.
  logical function approaches(machines, point, start, period, multiplier)
    type(neighbourhood_t), intent(in) :: machines
    real(wp), intent(in) :: point(:), start(:), multiplier
    integer, intent(in) :: period
    type(event_t), allocatable :: events(:)
    type(tally_t) :: tally
    real(wp) :: here(size(start)), image(size(start)), farthest(2), decay
    integer :: i, mode, rounds
    rounds = watched_sections/period
    decay = -(rounds - block)*log(min(1.0_wp, max(tiny(1.0_wp), multiplier)))
    approaches = decay >= least_decay .and. distance(machines%centre, point, start) <= beside_cycle
    if (.not. approaches) return
    here = start
    farthest = 0
    do i = 1, rounds
      call machines%centre%fly_sections(here, period, .false., image, events, mode, tally, approaches)
      if (.not. approaches) return
      here = image
      if (i <= block) farthest(1) = max(farthest(1), distance(machines%centre, point, here))
      if (i > rounds - block) farthest(2) = max(farthest(2), distance(machines%centre, point, here))
    end do
    approaches = farthest(2) <= max(on_cycle, exp(-decay/2)*farthest(1))
  end function approaches

  !> The fixed point of the map over `sections` next to `start`, and its derivative.
  subroutine refine(machines, sections, start, point, matrix, ok)
    type(neighbourhood_t), intent(in) :: machines
    integer, intent(in) :: sections
    real(wp), intent(in) :: start(:)
    real(wp), allocatable, intent(out) :: point(:), matrix(:, :)
    logical, intent(out) :: ok
    type(tally_t) :: tally
    real(wp) :: image(size(start)), step(size(start)), slopes(size(start), size(start))
    integer :: i, k
    point = start
    allocate (matrix(size(start), size(start)))
    associate (machine => machines%centre)
      do i = 1, most_newton
        call machines%centre%map(machines, point, sections, image, matrix, tally, ok)
        if (.not. ok) return
        slopes = matrix
        do k = 1, size(start)
          slopes(k, k) = slopes(k, k) - 1
        end do
        call solve(slopes, point - machine%nearest_copy(image, point), step, ok)
        if (.not. ok) return
        point = point + step
        ok = distance(machine, point, start) <= beside_cycle
        if (.not. ok .or. norm2(step/machine%size_of) <= converged) return
      end do
      ok = .false.
    end associate
  end subroutine refine

  !> Whether a point of the section comes back after `sections` to within `room` in natural sizes.
  logical function comes_back(machine, point, sections, room) result(back)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: point(:), room
    integer, intent(in) :: sections
    type(event_t), allocatable :: events(:)
    type(tally_t) :: tally
    real(wp) :: image(size(point))
    integer :: mode
    call machine%fly_sections(point, sections, .false., image, events, mode, tally, back)
    if (back) back = distance(machine, image, point) <= room
  end function comes_back

  !> In natural sizes.
  pure real(wp) function distance(machine, one, other)
    class(hybrid_t), intent(in) :: machine
    real(wp), intent(in) :: one(:), other(:)
    distance = norm2((machine%nearest_copy(one, other) - other)/machine%size_of)
  end function distance

end module cycle_reached
