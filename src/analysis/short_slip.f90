! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Slips and sticks of no duration. A body that turns round may stop again at once: where that slip is none its two ends, both
!> zeros of the speed, are one, and the equations of an orbit that has both are singular. So are those of an orbit whose stick
!> begins where its slip is slowest, or whose slip within a stick begins where the force only just reaches friction: the force is
!> e - c t^2 beyond it, the slip lasts from -s to 2 s with s^2 = e/c, and goes with s^4. Such pairs are taken out, or put in a
!> little apart.
module short_slip
  use guards, only: slide_ends
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion_state, only: event_release, event_stick, event_turning_point, mode_slip_minus, mode_slip_plus
  use orbit_margins, only: margin_t, margins_t, of_hold, of_slip, of_stick
  use periodic_orbit, only: orbit_t
  use structure, only: structure_t
  use structure_modes, only: mode_number, phases_in
  implicit none
  private

  public :: short_slip_of, without_slips, onset_without, with_slip, slips_on, stays_stuck, has_slip_in_stick, sticks_apart

  !> A slip after a turning point, one within a stick or a stick within a slip, or a stick at its end, that lasts for less than this
  !> in natural times is about to be none.
  real(wp), parameter :: short = 1e-3_wp, short_between = 1e-2_wp, no_stick = 1e-5_wp
  !> Slips whose lengths differ by less than this share are twins.
  real(wp), parameter :: as_long = 1e-3_wp
  !> A body with this acceleration, in natural sizes, gathers speed.
  real(wp), parameter :: no_acceleration = 1e-6_wp

contains

  !> The number of the first turning point of an orbit, or release, after which the joint all but stops at once, or stick after
  !> which it all but slips on at once, of those from a number on; 0 without.
  pure integer function short_slip_of(machine, orbit, from) result(number)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in), optional :: from
    real(wp) :: shortest
    integer :: first
    first = 1
    if (present(from)) first = from
    do number = first, size(orbit%events) - 1
      associate (one => orbit%events(number), next => orbit%events(number + 1))
        if (one%joint /= next%joint) cycle
        if (.not. ((any(one%kind == [event_turning_point, event_release]) .and. next%kind == event_stick) .or. &
                   (one%kind == event_stick .and. next%kind == event_release .and. one%side == next%side))) cycle
        shortest = merge(short, short_between, one%kind == event_turning_point)*machine%size_of_time()
        if (abs(next%time - one%time) < shortest) return
      end associate
    end do
    number = 0
  end function short_slip_of

  !> The margin that is zero where the slip, or stick, that an orbit has after its event `k` comes to be none, of the margins of the
  !> orbit without it; of kind 0 without.
  pure type(margin_t) function onset_without(orbit, k, margins) result(onset)
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(margins_t), intent(in) :: margins
    integer :: i
    associate (first => orbit%events(k))
      do i = 1, size(margins%list)
        associate (one => margins%list(i))
          select case (first%kind)
          case (event_release)
            if (one%kind /= of_hold .or. one%joint /= first%joint .or. one%side /= first%side) cycle
          case (event_stick)
            if (one%kind /= of_slip .or. one%joint /= first%joint) cycle
          case default
            if (one%kind /= of_stick .or. one%event /= k) cycle
          end select
          onset = one
          return
        end associate
      end do
    end associate
  end function onset_without

  !> The orbit without the slip, or stick, after the event `k`, and without all later ones of its kind that last as long: a
  !> symmetric orbit has two.
  pure function without_slips(machine, orbit, k) result(direct)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(orbit_t) :: direct
    integer :: i
    direct = without_slip(machine, orbit, k)
    i = k
    do
      i = short_slip_of(machine, direct, i)
      if (i == 0) return
      if (direct%events(i)%kind == orbit%events(k)%kind .and. abs(length_of(direct, i) - length_of(orbit, k)) <= &
          as_long*abs(length_of(orbit, k))) then
        direct = without_slip(machine, direct, i)
      else
        i = i + 1
      end if
    end do

  contains

    pure real(wp) function length_of(from, number)
      type(orbit_t), intent(in) :: from
      integer, intent(in) :: number
      length_of = from%events(number + 1)%time - from%events(number)%time
    end function length_of

  end function without_slips

  !> The orbit without the slip, or stick, after the event `k`: what sticks after a turning point does so there.
  pure function without_slip(machine, orbit, k) result(direct)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(orbit_t) :: direct
    direct = orbit
    if (orbit%events(k)%kind /= event_turning_point) then
      direct%events = [orbit%events(:k - 1), orbit%events(k + 2:)]
      return
    end if
    direct%events = [orbit%events(:k - 1), orbit%events(k + 1:)]
    associate (turn => orbit%events(k), stick => direct%events(k))
      stick%time = (turn%time + stick%time)/2
      stick%before = turn%before
      stick%side = -turn%side
      ! Of a structure a turning point has the direction before it.
      select type (machine)
      type is (structure_t)
        stick%side = turn%side
      end select
    end associate
  end function without_slip

  !> The orbit with a turning point and a slip of no duration before the stick `k`.
  pure function with_slip(machine, orbit, k) result(longer)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(orbit_t) :: longer
    type(event_t) :: turn, stick
    longer = orbit
    stick = orbit%events(k)
    turn = stick
    turn%kind = event_turning_point
    stick%side = -stick%side
    select type (machine)
    type is (structure_t)
      turn%after = mode_with(machine, stick%after, stick%joint, stick%side)
    class default
      turn%side = -turn%side
      turn%after = merge(mode_slip_plus, mode_slip_minus, turn%side > 0)
    end select
    stick%before = turn%after
    longer%events = [orbit%events(:k - 1), turn, stick, orbit%events(k + 1:)]
  end function with_slip

  !> A mode of a structure with another phase of one joint.
  pure integer function mode_with(machine, mode, joint, phase)
    type(structure_t), intent(in) :: machine
    integer, intent(in) :: mode, joint, phase
    associate (own => machine%frame%moving%machine)
      mode_with = mode_number(own, changed(phases_in(own, mode)))
    end associate

  contains

    pure function changed(phases)
      integer, intent(in) :: phases(:)
      integer :: changed(size(phases))
      changed = phases
      changed(joint) = phase
    end function changed

  end function mode_with

  !> Whether a joint that is let go of where the margin `hold` of a stick is zero gathers speed, as where friction holds more than
  !> it brakes: the slip that begins there is none of no duration.
  pure logical function slips_on(machine, orbit, hold)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    type(margin_t), intent(in) :: hold
    type(event_t) :: stop
    real(wp), dimension(size(orbit%y)) :: y, reached, by_state
    real(wp) :: from, value, by_time
    integer :: after, mode
    after = -hold%event - 1
    y = orbit%y
    mode = orbit%mode
    from = 0
    if (after > 0) then
      y = orbit%events(after)%departure(:size(y))
      mode = orbit%events(after)%after
      from = orbit%events(after)%time
    end if
    call machine%fly(mode, from, y, hold%time, reached)
    stop = event_t(kind=event_stick, side=hold%side, joint=hold%joint, guard=slide_ends)
    select type (machine)
    type is (structure_t)
      stop%before = mode_with(machine, mode, hold%joint, hold%side)
    class default
      stop%before = merge(mode_slip_plus, mode_slip_minus, hold%side > 0)
    end select
    call machine%guard(stop, hold%time, reached, value, by_state, by_time)
    associate (rate => sum(by_state*machine%slope(stop%before, hold%time, reached)) + by_time)
      slips_on = abs(rate)*machine%size_of_time() > no_acceleration*sum(abs(by_state)*machine%size_of)
    end associate
  end function slips_on

  !> Whether the stick `k` lasts: friction that cannot hold at its beginning does so later.
  pure logical function stays_stuck(machine, orbit, k)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    integer :: i
    stays_stuck = orbit%events(k)%kind == event_stick
    do i = k + 1, size(orbit%events)
      if (.not. stays_stuck) return
      if (orbit%events(i)%joint /= orbit%events(k)%joint) cycle
      stays_stuck = orbit%events(i)%time - orbit%events(k)%time > no_stick*machine%size_of_time()
      return
    end do
  end function stays_stuck

  !> Whether an orbit has a slip of no duration within a stick.
  pure logical function has_slip_in_stick(orbit) result(has)
    type(orbit_t), intent(in) :: orbit
    integer :: k
    has = .false.
    do k = 1, size(orbit%events) - 1
      associate (one => orbit%events(k), next => orbit%events(k + 1))
        has = has .or. (one%kind == event_release .and. next%kind == event_stick .and. one%joint == next%joint .and. &
                        .not. abs(next%time - one%time) > 0)
      end associate
    end do
  end function has_slip_in_stick

  !> The direction over state, instants and parameter in which slips and sticks of no duration of an orbit last longer; 0 without
  !> any.
  pure function sticks_apart(orbit) result(apart)
    type(orbit_t), intent(in) :: orbit
    real(wp) :: apart(size(orbit%y) + size(orbit%events) + 1)
    integer :: k
    apart = 0
    do k = 1, size(orbit%events) - 1
      associate (one => orbit%events(k), next => orbit%events(k + 1))
        if (one%joint /= next%joint .or. abs(next%time - one%time) > 0) cycle
        if (.not. ((any(one%kind == [event_turning_point, event_release]) .and. next%kind == event_stick) .or. &
                   (one%kind == event_stick .and. next%kind == event_release))) cycle
        apart(size(orbit%y) + k) = -1
        apart(size(orbit%y) + k + 1) = merge(2, 1, one%kind == event_release)
      end associate
    end do
    if (any(abs(apart) > 0)) apart = apart/norm2(apart)
  end function sticks_apart

end module short_slip
