! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Folds close behind grazes of soft contacts. A touch changes what comes after it by a power 3/2 of its depth where the force
!> begins at zero, so that the branch goes on as it came, but may turn as little as 1e-8 of the parameter behind the graze; it
!> turns in the graze itself only where the force begins with a jump. Orbits with ever shorter touches show which it is.
module soft_fold
  use body_family, only: family_t
  use branch_passage, only: change_all
  use branch_point, only: label_sn, point_t, trace_t
  use kinds, only: wp
  use orbit_margins, only: margin_t, of_gap
  use periodic_orbit, only: orbit_t, scales_of_orbit
  use secant_bracket, only: bracket_t, narrow, next_trial
  use soft_graze, only: enter_for, touches_apart
  implicit none
  private

  public :: begin_touching, duration_of, gap_beside

  !> Touches that are looked at, in natural times: each a tenth of the one before.
  real(wp), parameter :: shortest = 1e-6_wp
  integer, parameter :: most_looks = 6
  !> The rise at the graze itself is known where the straight line through the last two looks gives no less than this share of the
  !> last.
  real(wp), parameter :: least_share = 0.2_wp
  integer, parameter :: most_secants = 40
  !> Nearness of a multiplier to 1 in a fold.
  real(wp), parameter :: in_fold = 1e-5_wp

  !> How a branch begins to touch: the direction of the parameter [-1, 1] away from the graze itself, 0 where it is not known, and
  !> the folds on the way, from the graze on; `all_found` is false where there is one that could not be located.
  type, public :: beginning_t
    integer :: at_graze = 0
    type(point_t), allocatable :: folds(:)
    logical :: all_found = .true.
  end type beginning_t

contains

  !> How the branch goes on into the contact from `graze`, an orbit whose gap `gap` is none and that does not touch, up to touches
  !> that are `longest` apart, in natural times.
  subroutine begin_touching(family, graze, gap, longest, beginning)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: graze
    type(margin_t), intent(in) :: gap
    real(wp), intent(in) :: longest
    type(beginning_t), intent(out) :: beginning
    type(orbit_t) :: touching
    type(trace_t) :: there
    real(wp) :: duration(most_looks), rise(most_looks), line
    integer :: k, count_looks
    logical :: ok
    allocate (beginning%folds(0))
    call change_all(graze, gap, touching, ok)
    if (ok) ok = any(abs(touches_apart(touching)) > 0)
    if (.not. ok) return
    count_looks = 0
    do k = 0, most_looks - 1
      associate (next => count_looks + 1)
        duration(next) = longest*0.1_wp**k
        if (duration(next) < shortest) exit
        call touch_for(family, graze, touching, duration(next), there, rise(next), ok)
        if (ok) count_looks = next
      end associate
    end do
    if (count_looks < 2) return
    k = count_looks
    ! The parameter goes with the square of the duration: its rise per duration is a straight line at the end.
    line = rise(k) + (rise(k) - rise(k - 1))*duration(k)/(duration(k - 1) - duration(k))
    if (line*rise(k) < least_share*rise(k)**2) return
    beginning%at_graze = nint(sign(1.0_wp, line))
    do k = count_looks, 2, -1
      if (rise(k)*rise(k - 1) >= 0) cycle
      call add_fold(family, graze, touching, bracket_t(duration(k), duration(k - 1), rise(k), rise(k - 1)), beginning)
    end do
  end subroutine begin_touching

  !> How far from the orbit `touching` at a graze, whose touches have no duration, another is whose touches last longer.
  pure real(wp) function duration_of(family, at, touching, orbit) result(duration)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: at
    type(orbit_t), intent(in) :: touching, orbit
    real(wp) :: way(size(orbit%y) + size(orbit%events) + 1)
    way = 0
    way(size(orbit%y) + 1:size(way) - 1) = orbit%events%time - touching%events%time
    duration = sum(way/scales_of_orbit(at%machines, touching, family%parameter_size)*touches_apart(touching))
  end function duration_of

  !> The orbit that touches for a time, in natural times, and the rise of the parameter there per that time.
  subroutine touch_for(family, graze, touching, duration, there, rise, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: graze
    type(orbit_t), intent(in) :: touching
    real(wp), intent(in) :: duration
    type(trace_t), intent(out) :: there
    real(wp), intent(out) :: rise
    logical, intent(out) :: ok
    rise = 0
    call enter_for(family, graze, touching, duration*touches_apart(touching), there, ok)
    if (ok) rise = there%now%tangent(size(there%now%tangent))/duration
  end subroutine touch_for

  !> Adds the fold between two durations of the touch.
  subroutine add_fold(family, graze, touching, between, beginning)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: graze
    type(orbit_t), intent(in) :: touching
    type(bracket_t), intent(in) :: between
    type(beginning_t), intent(inout) :: beginning
    type(bracket_t) :: bracket
    type(trace_t) :: there
    real(wp) :: duration, rise
    integer :: i
    logical :: ok
    bracket = between
    do i = 1, most_secants
      duration = next_trial(bracket)
      call touch_for(family, graze, touching, duration, there, rise, ok)
      if (.not. ok) exit
      call narrow(bracket, duration, rise)
      if (.not. abs(rise) > 0 .or. bracket%high - bracket%low <= 4*spacing(bracket%high)) exit
    end do
    if (ok) ok = minval(abs(there%now%orbit%multipliers - 1)) < in_fold
    beginning%all_found = beginning%all_found .and. ok
    if (.not. ok) return
    there%now%label = label_sn
    beginning%folds = [beginning%folds, there%now]
  end subroutine add_fold

  !> The margin of the gap to the barrier of `touch` where that is missed; of no kind without.
  pure type(margin_t) function gap_beside(graze, touch) result(gap)
    type(trace_t), intent(in) :: graze
    type(margin_t), intent(in) :: touch
    integer :: i
    do i = 1, size(graze%margins%list)
      associate (one => graze%margins%list(i))
        if (one%kind == of_gap .and. one%joint == touch%joint .and. one%side == touch%side) gap = one
      end associate
    end do
  end function gap_beside

end module soft_fold
