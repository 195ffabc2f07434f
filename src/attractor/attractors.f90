! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What an attractor is here, and whether a state on the stroboscopic section has been captured by one.
module attractors
  use kinds, only: int64, wp
  use motion_state, only: state_t, tally_t
  implicit none
  private

  public :: regime_of, find_capture, find_box, pack_attractor, unpack_attractor

  !> Regimes of a motion; stuck are two bodies that move as one.
  integer, parameter, public :: regime_unresolved = 0, regime_non_impact = 1, regime_impact = 2, &
    regime_sticking = 3, regime_mixed = 4, regime_chattering = 5, regime_at_rest = 6, &
    regime_stuck = 7, last_regime = 7
  character(len=*), parameter, public :: regime_names(0:last_regime) = [character(len=10) :: 'unresolved', &
    'non_impact', 'impact', 'sticking', 'mixed', 'chattering', 'at_rest', &
    'stuck']

  !> Longest period in drive periods that is looked for.
  integer, parameter, public :: longest_period = 64

  integer, parameter :: packed_scalars = 16
  !> Share of its size by which a box of section points is widened on each side.
  real(wp), parameter :: box_margin = 0.05_wp
  !> Length of a packed attractor.
  integer, parameter, public :: packed_size = packed_scalars + 5*longest_period

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
    !> Section points (x, v), canonical one first; for period 0 lower and upper corner of the box.
    real(wp) :: points(2, longest_period) = 0
    !> Scales of x and v, and for each point the metric (s11, s12, s22) in scaled coordinates in which
    !> the map contracts.
    real(wp) :: scale(2) = 1
    real(wp) :: metric(3, longest_period) = 0
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

  !> Index of the attractor whose verified neighbourhood holds a state on the section; 0 if none.
  !> `slipped` tells whether the body moved during the last whole period.
  pure integer function find_capture(catalogue, state, slipped) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    type(state_t), intent(in) :: state
    logical, intent(in) :: slipped
    real(wp) :: x, v
    integer :: k, i
    found = 0
    do k = 1, size(catalogue)
      associate (attractor => catalogue(k))
        if (attractor%rests) then
          if (.not. slipped) found = k
        else
          do i = 1, attractor%period
            x = (state%x - attractor%points(1, i))/attractor%scale(1)
            v = (state%v - attractor%points(2, i))/attractor%scale(2)
            if (attractor%metric(1, i)*x**2 + 2*attractor%metric(2, i)*x*v + attractor%metric(3, i)*v**2 &
                <= attractor%capture_radius**2) found = k
            if (found > 0) return
          end do
        end if
      end associate
      if (found > 0) return
    end do
  end function find_capture

  !> Index of the motion that is not periodic whose regime is `regime` and whose box of section points holds a state; 0
  !> if none.
  pure integer function find_box(catalogue, state, regime) result(found)
    type(attractor_t), intent(in) :: catalogue(:)
    type(state_t), intent(in) :: state
    integer, intent(in) :: regime
    real(wp) :: point(2), margin(2)
    integer :: k
    found = 0
    point = [state%x, state%v]
    do k = 1, size(catalogue)
      if (catalogue(k)%period /= 0 .or. catalogue(k)%rests .or. catalogue(k)%features%regime /= regime) cycle
      margin = box_margin*(catalogue(k)%points(:, 2) - catalogue(k)%points(:, 1))
      if (all(point >= catalogue(k)%points(:, 1) - margin .and. point <= catalogue(k)%points(:, 2) + margin)) then
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
      packed(:packed_scalars) = [real(attractor%id, wp), real(attractor%period, wp), &
        merge(1.0_wp, 0.0_wp, attractor%rests), real(f%regime, wp), real(f%word, wp), &
        f%impacts_per_period, f%mean_impact_speed, f%amplitude, f%x_max, f%x_min, f%v_max, &
        f%grazing_margin, attractor%multiplier, attractor%scale, attractor%capture_radius]
    end associate
    packed(packed_scalars + 1:packed_scalars + 2*longest_period) = reshape(attractor%points, [2*longest_period])
    packed(packed_scalars + 2*longest_period + 1:packed_scalars + 5*longest_period) = &
      reshape(attractor%metric, [3*longest_period])
  end function pack_attractor

  !> The inverse of `pack_attractor`.
  pure function unpack_attractor(packed) result(attractor)
    real(wp), intent(in) :: packed(packed_size)
    type(attractor_t) :: attractor
    attractor%id = nint(packed(1))
    attractor%period = nint(packed(2))
    attractor%rests = packed(3) > 0
    attractor%features = features_t(nint(packed(4)), nint(packed(5), int64), packed(6), packed(7), &
                                    packed(8), packed(9), packed(10), packed(11), packed(12))
    attractor%multiplier = packed(13)
    attractor%scale = packed(14:15)
    attractor%capture_radius = packed(16)
    attractor%points = reshape(packed(packed_scalars + 1:packed_scalars + 2*longest_period), [2, longest_period])
    attractor%metric = reshape(packed(packed_scalars + 2*longest_period + 1:packed_scalars + 5*longest_period), &
                               [3, longest_period])
  end function unpack_attractor

end module attractors
