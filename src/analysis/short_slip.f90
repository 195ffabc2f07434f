! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Slips and sticks of no duration. A body that turns round may stop again at once: where that slip is none its two ends, both
!> zeros of the speed, are one, and the equations of an orbit that has both are singular. So are those of an orbit whose stick
!> begins where its slip is slowest. Such pairs are taken out, or put in a little apart.
module short_slip
  use hybrid_machine, only: event_t, hybrid_t
  use kinds, only: wp
  use motion_state, only: event_release, event_stick, event_turning_point, mode_slip_minus, mode_slip_plus
  use one_body, only: one_body_t
  use periodic_orbit, only: orbit_t
  use structure, only: mode_number, phases_in, structure_t
  implicit none
  private

  public :: short_slip_of, without_slip, with_slip, stays_stuck, sticks_apart

  !> A slip, or a stick, that lasts for less than this in natural times is about to be none.
  real(wp), parameter :: short = 1e-3_wp, no_stick = 1e-5_wp

contains

  !> The number of a turning point of an orbit after which the joint all but stops at once; 0 without.
  pure integer function short_slip_of(machine, orbit) result(number)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    do number = 1, size(orbit%events) - 1
      associate (turn => orbit%events(number), stop => orbit%events(number + 1))
        if (turn%kind /= event_turning_point .or. stop%kind /= event_stick .or. stop%joint /= turn%joint) cycle
        if (abs(stop%time - turn%time) < short*machine%size_of_time()) return
      end associate
    end do
    number = 0
  end function short_slip_of

  !> The orbit without the slip after the turning point `k`: what sticks after it does so there.
  pure function without_slip(machine, orbit, k) result(direct)
    class(hybrid_t), intent(in) :: machine
    type(orbit_t), intent(in) :: orbit
    integer, intent(in) :: k
    type(orbit_t) :: direct
    direct = orbit
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
    type is (one_body_t)
      turn%side = -turn%side
      turn%after = merge(mode_slip_plus, mode_slip_minus, turn%side > 0)
    type is (structure_t)
      turn%after = mode_with(machine, stick%after, stick%joint, stick%side)
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
        if (.not. ((one%kind == event_turning_point .and. next%kind == event_stick) .or. &
                   (one%kind == event_stick .and. next%kind == event_release))) cycle
        apart(size(orbit%y) + k) = -1
        apart(size(orbit%y) + k + 1) = 1
      end associate
    end do
    if (any(abs(apart) > 0)) apart = apart/norm2(apart)
  end function sticks_apart

end module short_slip
