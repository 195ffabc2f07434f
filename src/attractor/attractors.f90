! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an attractor is here, and whether a state on the stroboscopic section has converged to one.
module attractors
  use circle, only: nearest_turn, point_near
  use kinds, only: int64, wp
  use motion_state, only: tally_t
  use section_size, only: most_coordinates
  implicit none
  private

  public :: most_coordinates, regime_of, wrap_range, make_points, find_capture, find_box, squared_distance, pack_attractor, &
    packed_length, packed_layout, unpack_attractor, metric_numbers, is_packed

  !> Regimes of a motion; stuck are two bodies that move as one.
  integer, parameter, public :: regime_unresolved = 0, regime_non_impact = 1, regime_impact = 2, &
    regime_sticking = 3, regime_mixed = 4, regime_chattering = 5, regime_at_rest = 6, &
    regime_stuck = 7, last_regime = 7
  character(len=*), parameter, public :: regime_names(0:last_regime) = [character(len=10) :: 'unresolved', &
    'non_impact', 'impact', 'sticking', 'mixed', 'chattering', 'at_rest', &
    'stuck']

  !> What an entry of a catalogue is: a cycle; the positions of rest; a motion that is not periodic, for neighbouring motions
  !> drift apart; one that is neither known to be periodic nor seen to be anything else, perhaps a long transient; cycles side by
  !> side that neither attract nor repel each other, so that every start has its own.
  integer, parameter, public :: kind_cycle = 1, kind_rest = 2, kind_chaotic = 3, kind_not_known = 4, kind_family = 5, last_kind = 5
  character(len=*), parameter, public :: kind_names(last_kind) = [character(len=9) :: 'cycle', 'rest', 'chaotic', 'not_known', &
    'family']

  !> Longest period in drive periods that is looked for near a return of the motion, and of one that returns to the bit.
  integer, parameter, public :: longest_period = 64, longest_exact_period = 1024

  integer, parameter :: packed_scalars = 27
  !> Share of its size by which a box of section points is widened on each side.
  real(wp), parameter :: box_margin = 0.05_wp
  !> Fewest numbers of a packed attractor.
  integer, parameter, public :: least_packed = packed_scalars

  !> What a motion looks like over one of its periods, or over the statistics window.
  type, public :: features_t
    integer :: regime = regime_unresolved
    integer(int64) :: word = 0
    real(wp) :: impacts_per_period = 0, mean_impact_speed = 0
    real(wp) :: amplitude = 0, x_max = 0, x_min = 0, v_max = 0
    real(wp) :: grazing_margin = huge(1.0_wp)
    !> Turns of an angle per drive period, upwards.
    real(wp) :: rotation = 0
  end type features_t

  !> One attractor: a stable cycle of the stroboscopic map, the set of all positions of rest
  !> (`rests`), or a motion that is not periodic (period 0), known by the box of its section points.
  type, public :: attractor_t
    !> Label, carried along the parameter axes.
    integer :: id = 0
    integer :: period = 0
    logical :: rests = .false.
    integer :: kind = kind_cycle
    type(features_t) :: features
    !> Multipliers of a cycle, and the largest of their moduli; of what is not periodic the mean factor in a drive period by which
    !> neighbouring motions drift apart.
    complex(wp) :: multipliers(most_coordinates) = 0
    real(wp) :: multiplier = 0
    !> State at the first section point, for the reader: x, v, and those of the driving body of two, or the angle of a crank that
    !> is at rest [rad].
    real(wp) :: section(4) = 0
    !> Number of coordinates on the section.
    integer :: coordinates = 2
    !> The first coordinate repeats after this [rad]; 0 = never.
    real(wp) :: turn = 0
    !> A motion between stops, which it does not touch: it may be anywhere. The coordinates are those after the first
    !> `positions`.
    logical :: any_position = .false.
    integer :: positions = 0
    !> A cycle of a machine without a clock: its section is where the watched coordinate turns round, see `turn_section`.
    logical :: by_event = .false.
    !> Time that one cycle takes, of a family each [s]; 0 of what is none.
    real(wp) :: duration = 0
    !> Section points, zeros after the last coordinate, canonical one first; for period 0 lower and upper corner of the box.
    real(wp), allocatable :: points(:, :)
    !> Scales of the coordinates, and for each point the metric in scaled coordinates in which the map contracts:
    !> the upper triangle of its matrix, column by column.
    real(wp) :: scale(most_coordinates) = 1
    real(wp), allocatable :: metric(:, :)
    !> Radius in that metric within which contraction was verified.
    real(wp) :: capture_radius = 0
  end type attractor_t

contains

  !> Numbers of a metric.
  pure elemental integer function metric_numbers(coordinates)
    integer, intent(in) :: coordinates
    metric_numbers = (coordinates*(coordinates + 1))/2
  end function metric_numbers

  !> Room for the section points of an attractor of known `coordinates`, all 0.
  pure subroutine make_points(attractor, count)
    type(attractor_t), intent(inout) :: attractor
    integer, intent(in) :: count
    if (allocated(attractor%points)) deallocate (attractor%points, attractor%metric)
    allocate (attractor%points(most_coordinates, count), attractor%metric(metric_numbers(attractor%coordinates), count), &
              source=0.0_wp)
  end subroutine make_points

  !> Features of what was counted over `periods` drive periods (not necessarily a whole number).
  pure function regime_of(tally, periods) result(features)
    type(tally_t), intent(in) :: tally
    real(wp), intent(in) :: periods
    type(features_t) :: features
    if (tally%chatters > 0) then
      features%regime = regime_chattering
    else if (tally%impacts > 0) then
      features%regime = merge(regime_mixed, regime_impact, tally%sticks > 0)
    else if (tally%slips == 0) then
      features%regime = regime_at_rest
    else
      features%regime = merge(regime_sticking, regime_non_impact, tally%sticks > 0)
    end if
    features%word = tally%word
    features%impacts_per_period = real(tally%impacts, wp)/periods
    if (tally%impacts > 0) features%mean_impact_speed = tally%impact_speed_sum/real(tally%impacts, wp)
    features%x_max = tally%x_max
    features%x_min = tally%x_min
    features%amplitude = (tally%x_max - tally%x_min)/2
    features%v_max = tally%v_max
    features%grazing_margin = tally%grazing_margin
  end function regime_of

  !> Puts the range of an angle into one turn: the whole circle for a motion that goes round.
  pure subroutine wrap_range(features, turn)
    type(features_t), intent(inout) :: features
    real(wp), intent(in) :: turn
    real(wp) :: middle, shift
    if (.not. turn > 0) return
    ! A motion that goes round once in its window ends where it began but for rounding.
    if (features%x_max - features%x_min < turn*(1 - 1e-9_wp)) then
      middle = (features%x_max + features%x_min)/2
      shift = nearest_turn(middle, 0.0_wp, turn) - middle
      features%x_max = features%x_max + shift
      features%x_min = features%x_min + shift
    else
      features%x_max = turn/2
      features%x_min = -turn/2
      features%amplitude = turn/2
    end if
  end subroutine wrap_range

  !> Index of the attractor whose verified neighbourhood holds a point on the section; 0 if none.
  !> `slipped`: whether the body moved during the last whole period. With `by_event` the point is on the section of a machine
  !> without a clock, and only cycles known there are looked at; else only the others.
  pure integer function find_capture(catalogue, point, slipped, by_event) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    logical, intent(in) :: slipped
    logical, intent(in), optional :: by_event
    logical :: events
    integer :: k, i
    found = 0
    events = .false.
    if (present(by_event)) events = by_event
    do k = 1, size(catalogue)
      associate (attractor => catalogue(k))
        if (attractor%any_position .or. (attractor%by_event .neqv. events)) cycle
        if (attractor%rests) then
          if (.not. slipped) found = k
        else
          do i = 1, attractor%period
            if (squared_distance(attractor, i, point) <= attractor%capture_radius**2) found = k
            if (found > 0) return
          end do
        end if
      end associate
      if (found > 0) return
    end do
  end function find_capture

  !> Square of the distance from the `i`-th point of an attractor in its metric.
  pure real(wp) function squared_distance(attractor, i, point) result(square)
    type(attractor_t), intent(in) :: attractor
    integer, intent(in) :: i
    real(wp), intent(in) :: point(:)
    real(wp) :: d(most_coordinates)
    integer :: n, j, k
    n = attractor%coordinates
    if (n == 2) then
      ! One body: the same operations as in lanes.
      d(:2) = (point_near(point(:2), attractor%points(:2, i), attractor%turn) - attractor%points(:2, i))*(1/attractor%scale(:2))
      square = attractor%metric(1, i)*d(1)*d(1) + 2*attractor%metric(2, i)*d(2)*d(1) + attractor%metric(3, i)*d(2)*d(2)
      return
    end if
    d(:n) = (point(:n) - attractor%points(:n, i))/attractor%scale(:n)
    square = 0
    do j = 1, n
      do k = 1, j
        square = square + merge(1, 2, j == k)*attractor%metric((j*(j - 1))/2 + k, i)*d(j)*d(k)
      end do
    end do
  end function squared_distance

  !> Index of the motion that is not periodic whose box of section points holds `point` and in which the events of `regime` occur,
  !> first those of the same regime, or of two bodies that go on moving as one, or that exists at any position; 0 if none.
  pure integer function find_box(catalogue, point, regime) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: regime
    integer :: k, i
    found = 0
    do k = 1, size(catalogue)
      if (catalogue(k)%features%regime /= regime) cycle
      if (catalogue(k)%rests .and. regime == regime_stuck) found = k
      if (catalogue(k)%any_position) then
        do i = 1, catalogue(k)%period
          if (squared_distance(catalogue(k), i, point(catalogue(k)%positions + 1:)) <= catalogue(k)%capture_radius**2) found = k
        end do
      end if
      if (found == 0 .and. in_box(catalogue(k), point)) found = k
      if (found > 0) return
    end do
    do k = 1, size(catalogue)
      if (.not. occurs_in(regime, catalogue(k)%features%regime)) cycle
      if (in_box(catalogue(k), point)) found = k
      if (found > 0) return
    end do
  end function find_box

  !> Whether a point on the section lies in the box of a motion that is not periodic.
  pure logical function in_box(attractor, point)
    type(attractor_t), intent(in) :: attractor
    real(wp), intent(in) :: point(:)
    real(wp) :: margin(most_coordinates), near(size(point))
    integer :: n
    in_box = .false.
    if (attractor%period /= 0 .or. attractor%rests) return
    n = attractor%coordinates
    margin = box_margin*(attractor%points(:, 2) - attractor%points(:, 1))
    near = point_near(point, (attractor%points(:, 1) + attractor%points(:, 2))/2, attractor%turn)
    in_box = all(near(:n) >= attractor%points(:n, 1) - margin(:n) .and. near(:n) <= attractor%points(:n, 2) + margin(:n))
  end function in_box

  !> Whether a segment of a motion of regime `whole` may be of regime `part`: without some of its events.
  pure logical function occurs_in(part, whole)
    integer, intent(in) :: part, whole
    select case (whole)
    case (regime_chattering)
      occurs_in = any(part == [regime_non_impact, regime_impact, regime_sticking, regime_mixed])
    case (regime_mixed)
      occurs_in = any(part == [regime_non_impact, regime_impact, regime_sticking])
    case (regime_impact, regime_sticking)
      occurs_in = part == regime_non_impact
    case default
      occurs_in = .false.
    end select
  end function occurs_in

  !> Numbers of an attractor that `pack_attractor` packs.
  pure integer function packed_length(attractor)
    type(attractor_t), intent(in) :: attractor
    packed_length = packed_scalars + 3*attractor%coordinates
    if (allocated(attractor%points)) packed_length = packed_length + packed_per_point(attractor%coordinates)* &
                                                     size(attractor%points, 2)
  end function packed_length

  pure integer function packed_per_point(coordinates)
    integer, intent(in) :: coordinates
    packed_per_point = coordinates + metric_numbers(coordinates)
  end function packed_per_point

  !> Whether numbers, of which there are the `least_packed`, can be those of an attractor.
  pure logical function is_packed(packed)
    real(wp), intent(in) :: packed(:)
    integer :: n
    is_packed = packed(4) >= 0 .and. packed(4) <= most_coordinates
    if (.not. is_packed) return
    n = nint(packed(4))
    is_packed = size(packed) >= packed_scalars + 3*n
    if (is_packed .and. n > 0) is_packed = modulo(size(packed) - packed_scalars - 3*n, packed_per_point(n)) == 0
  end function is_packed

  !> An attractor as plain numbers, to be sent between ranks; the first is their count.
  pure function pack_attractor(attractor) result(packed)
    type(attractor_t), intent(in) :: attractor
    real(wp) :: packed(packed_length(attractor))
    associate (f => attractor%features, n => attractor%coordinates)
      packed(:packed_scalars + 3*n) = [real(size(packed), wp), real(attractor%id, wp), real(attractor%period, wp), &
        real(attractor%coordinates, wp), merge(1.0_wp, 0.0_wp, attractor%rests), real(f%regime, wp), real(f%word, wp), &
        f%impacts_per_period, f%mean_impact_speed, f%amplitude, f%x_max, f%x_min, f%v_max, &
        f%grazing_margin, attractor%multiplier, attractor%capture_radius, attractor%section, &
        merge(1.0_wp, 0.0_wp, attractor%any_position), real(attractor%kind, wp), attractor%turn, &
        f%rotation, merge(1.0_wp, 0.0_wp, attractor%by_event), attractor%duration, real(attractor%positions, wp), &
        attractor%scale(:n), real(attractor%multipliers(:n)), aimag(attractor%multipliers(:n))]
    end associate
    if (.not. allocated(attractor%points)) return
    associate (points => attractor%points(:attractor%coordinates, :), metric => attractor%metric)
      packed(packed_scalars + 3*attractor%coordinates + 1:) = &
        [reshape(points, [size(points)]), reshape(metric, [size(metric)])]
    end associate
  end function pack_attractor

  !> A number that two builds share if they pack attractors alike: made of where the values of one attractor are.
  pure integer(int64) function packed_layout() result(layout)
    type(attractor_t) :: marked
    real(wp), allocatable :: packed(:)
    integer :: i
    marked%coordinates = 2
    marked%id = 3
    marked%period = 5
    marked%scale(:2) = [7.0_wp, 11.0_wp]
    call make_points(marked, 1)
    marked%points(:2, 1) = [13.0_wp, 17.0_wp]
    marked%metric(:, 1) = [19.0_wp, 23.0_wp, 29.0_wp]
    packed = pack_attractor(marked)
    layout = size(packed)
    do i = 1, size(packed)
      if (abs(packed(i)) < 100) layout = mod(131*layout + abs(nint(packed(i))), 2_int64**31 - 1)
    end do
  end function packed_layout

  !> The inverse of `pack_attractor`.
  pure function unpack_attractor(packed) result(attractor)
    real(wp), intent(in) :: packed(:)
    type(attractor_t) :: attractor
    integer :: count, n, last
    attractor%id = nint(packed(2))
    attractor%period = nint(packed(3))
    attractor%coordinates = nint(packed(4))
    attractor%rests = packed(5) > 0
    attractor%features = features_t(nint(packed(6)), nint(packed(7), int64), packed(8), packed(9), packed(10), packed(11), &
                                    packed(12), packed(13), packed(14), packed(24))
    attractor%multiplier = packed(15)
    attractor%capture_radius = packed(16)
    attractor%section = packed(17:20)
    attractor%any_position = packed(21) > 0
    attractor%kind = nint(packed(22))
    attractor%turn = packed(23)
    attractor%by_event = packed(25) > 0
    attractor%duration = packed(26)
    attractor%positions = nint(packed(27))
    n = attractor%coordinates
    last = packed_scalars
    attractor%scale(:n) = packed(last + 1:last + n)
    attractor%multipliers(:n) = cmplx(packed(last + n + 1:last + 2*n), packed(last + 2*n + 1:last + 3*n), wp)
    last = last + 3*n
    if (size(packed) == last) return
    count = (size(packed) - last)/packed_per_point(n)
    call make_points(attractor, count)
    attractor%points(:n, :) = reshape(packed(last + 1:last + n*count), [n, count])
    attractor%metric = reshape(packed(last + n*count + 1:), shape(attractor%metric))
  end function unpack_attractor

end module attractors
