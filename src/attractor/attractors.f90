! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an attractor is here, and whether a state on the stroboscopic section has been captured by one.
module attractors
  use kinds, only: int64, wp
  use motion_state, only: tally_t
  implicit none
  private

  public :: regime_of, find_capture, find_box, squared_distance, pack_attractor, unpack_attractor

  !> Regimes of a motion; stuck are two bodies that move as one.
  integer, parameter, public :: regime_unresolved = 0, regime_non_impact = 1, regime_impact = 2, &
    regime_sticking = 3, regime_mixed = 4, regime_chattering = 5, regime_at_rest = 6, &
    regime_stuck = 7, last_regime = 7
  character(len=*), parameter, public :: regime_names(0:last_regime) = [character(len=10) :: 'unresolved', &
    'non_impact', 'impact', 'sticking', 'mixed', 'chattering', 'at_rest', &
    'stuck']

  !> Longest period in drive periods that is looked for.
  integer, parameter, public :: longest_period = 64

  !> Most coordinates of a point on the section: x and v of one body, up to five of two.
  integer, parameter, public :: most_coordinates = 5
  !> Numbers of a metric: the upper triangle of its matrix, column by column.
  integer, parameter, public :: metric_numbers = (most_coordinates*(most_coordinates + 1))/2

  integer, parameter :: packed_scalars = 20 + most_coordinates
  !> Share of its size by which a box of section points is widened on each side.
  real(wp), parameter :: box_margin = 0.05_wp
  !> Length of a packed attractor.
  integer, parameter, public :: packed_size = packed_scalars + (most_coordinates + metric_numbers)*longest_period

  !> What a motion looks like over one of its periods, or over the statistics window.
  type, public :: features_t
    integer :: regime = regime_unresolved
    integer(int64) :: word = 0
    real(wp) :: impacts_per_period = 0, mean_impact_speed = 0
    real(wp) :: amplitude = 0, x_max = 0, x_min = 0, v_max = 0
    real(wp) :: grazing_margin = huge(1.0_wp)
  end type features_t

  !> One attractor: a stable cycle of the stroboscopic map, the set of all positions of rest
  !> (`rests`), or a motion that is not periodic (period 0), known by the box of its section points.
  type, public :: attractor_t
    !> Label, carried along the parameter axes.
    integer :: id = 0
    integer :: period = 0
    logical :: rests = .false.
    type(features_t) :: features
    !> Largest modulus of the multipliers.
    real(wp) :: multiplier = 0
    !> State at the first section point, for the reader: x, v, and those of the driving body of two.
    real(wp) :: section(4) = 0
    !> Number of coordinates on the section.
    integer :: coordinates = 2
    !> A motion of two bodies between their stops, which it does not touch: it may be anywhere. The coordinates are those
    !> after the first.
    logical :: any_place = .false.
    !> Section points, canonical one first; for period 0 lower and upper corner of the box.
    real(wp) :: points(most_coordinates, longest_period) = 0
    !> Scales of the coordinates, and for each point the metric in scaled coordinates in which the map contracts.
    real(wp) :: scale(most_coordinates) = 1
    real(wp) :: metric(metric_numbers, longest_period) = 0
    !> Radius in that metric within which contraction was verified.
    real(wp) :: capture_radius = 0
  end type attractor_t

contains

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

  !> Index of the attractor whose verified neighbourhood holds a point on the section; 0 if none.
  !> `slipped` tells whether the body moved during the last whole period.
  pure integer function find_capture(catalogue, point, slipped) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    logical, intent(in) :: slipped
    integer :: k, i
    found = 0
    do k = 1, size(catalogue)
      associate (attractor => catalogue(k))
        if (attractor%any_place) cycle
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
      d(:2) = (point(:2) - attractor%points(:2, i))*(1/attractor%scale(:2))
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

  !> Index of the motion that is not periodic whose regime is `regime` and whose box of section points holds `point`, or
  !> of two bodies that go on moving as one, or that has been reached at any place; 0 if none.
  pure integer function find_box(catalogue, point, regime) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    real(wp), intent(in) :: point(:)
    integer, intent(in) :: regime
    real(wp) :: margin(most_coordinates)
    integer :: k, i, n
    found = 0
    do k = 1, size(catalogue)
      if (catalogue(k)%features%regime /= regime) cycle
      if (catalogue(k)%rests .and. regime == regime_stuck) found = k
      if (catalogue(k)%any_place) then
        do i = 1, catalogue(k)%period
          if (squared_distance(catalogue(k), i, point(2:)) <= catalogue(k)%capture_radius**2) found = k
        end do
      end if
      if (found > 0) return
      if (catalogue(k)%period /= 0 .or. catalogue(k)%rests) cycle
      n = catalogue(k)%coordinates
      margin = box_margin*(catalogue(k)%points(:, 2) - catalogue(k)%points(:, 1))
      if (all(point(:n) >= catalogue(k)%points(:n, 1) - margin(:n) .and. &
              point(:n) <= catalogue(k)%points(:n, 2) + margin(:n))) then
        found = k
        return
      end if
    end do
  end function find_box

  !> An attractor as plain numbers, to be sent between ranks.
  pure function pack_attractor(attractor) result(packed)
    type(attractor_t), intent(in) :: attractor
    real(wp) :: packed(packed_size)
    associate (f => attractor%features)
      packed = [real(attractor%id, wp), real(attractor%period, wp), real(attractor%coordinates, wp), &
        merge(1.0_wp, 0.0_wp, attractor%rests), real(f%regime, wp), real(f%word, wp), &
        f%impacts_per_period, f%mean_impact_speed, f%amplitude, f%x_max, f%x_min, f%v_max, &
        f%grazing_margin, attractor%multiplier, attractor%capture_radius, attractor%section, &
        merge(1.0_wp, 0.0_wp, attractor%any_place), attractor%scale, &
        reshape(attractor%points, [size(attractor%points)]), reshape(attractor%metric, [size(attractor%metric)])]
    end associate
  end function pack_attractor

  !> The inverse of `pack_attractor`.
  pure function unpack_attractor(packed) result(attractor)
    real(wp), intent(in) :: packed(packed_size)
    type(attractor_t) :: attractor
    integer :: metric
    attractor%id = nint(packed(1))
    attractor%period = nint(packed(2))
    attractor%coordinates = nint(packed(3))
    attractor%rests = packed(4) > 0
    attractor%features = features_t(nint(packed(5)), nint(packed(6), int64), packed(7), packed(8), packed(9), packed(10), &
                                    packed(11), packed(12), packed(13))
    attractor%multiplier = packed(14)
    attractor%capture_radius = packed(15)
    attractor%section = packed(16:19)
    attractor%any_place = packed(20) > 0
    attractor%scale = packed(21:packed_scalars)
    metric = packed_scalars + size(attractor%points)
    attractor%points = reshape(packed(packed_scalars + 1:metric), shape(attractor%points))
    attractor%metric = reshape(packed(metric + 1:), shape(attractor%metric))
  end function unpack_attractor

end module attractors
