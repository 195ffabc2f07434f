! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Grazes of a branch that its own equations do not lead through: where derivatives are too large, where a soft contact is left, and
!> where several begin at once; onsets of sticking where a slip comes to be none.
module graze_passage
  use body_family, only: family_t
  use branch_passage, only: change_all, enter_sequence
  use branch_point, only: label_gr, label_gr_fold, label_not_known, label_stick, no_label, plan_t, point_t, trace_t
  use kinds, only: wp
  use orbit_margins, only: margin_t, of_gap, of_impact
  use orbit_sections, only: section_points
  use short_slip, only: onset_without, short_slip_of, without_slips
  use soft_graze, only: is_touch, locate_missed_graze
  implicit none
  private

  public :: leave_by_graze, leave_by_stick, grazes_twice, is_repeated

  !> Nearness to a graze, in speed, at the end of a branch; and where equations with an impact may already fail.
  real(wp), parameter, public :: at_graze = 1e-6_wp
  real(wp), parameter :: beside_graze = 1e-4_wp
  !> The graze is as near in the parameter, as a share of its size.
  real(wp), parameter :: near_in_parameter = 1e-5_wp

contains

  !> Where no step leads on and an impact has next to no speed: without it the branch goes on, and that shows where the graze is.
  !> The same of a slip. `ending`: not known if that is not so; a graze if the orbit is one of a shorter period there.
  subroutine leave_by_graze(family, plan, trace, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(inout) :: trace
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: at, beyond, graze
    type(margin_t) :: lost
    real(wp) :: rise_before, rise_after
    integer :: i
    logical :: ok
    ending = label_not_known
    ok = .false.
    at = trace
    do i = 1, size(at%margins%list)
      associate (one => at%margins%list(i))
        if (one%kind /= of_impact .or. .not. abs(one%value) < beside_graze .or. is_touch(at%now%orbit, one)) cycle
        one%value = 0
        lost = one
        lost%side = at%now%orbit%events(one%event)%side
        lost%joint = at%now%orbit%events(one%event)%joint
        ok = .true.
      end associate
    end do
    if (ok) call change_all(at, lost, beyond%now%orbit, ok)
    if (ok) call enter_sequence(family, at, 0.1_wp*plan%largest_step, beyond, ok)
    if (ok) call locate_missed_graze(family, beyond, lost, at%now%orbit%parameter, graze, ok)
    if (ok) ok = abs(graze%now%orbit%parameter - at%now%orbit%parameter) < near_in_parameter*family%parameter_size
    if (.not. ok) then
      i = 0
      do
        i = short_slip_of(trace%machines%centre, trace%now%orbit, i + 1)
        if (i == 0) return
        call leave_by_stick(family, plan, trace, i, points, ending)
        if (ending == no_label) return
      end do
    end if
    ending = merge(label_gr, no_label, is_repeated(graze))
    graze%now%label = label_gr
    if (ending == label_gr) then
      points = [points, graze%now]
      return
    end if
    rise_before = graze%now%orbit%parameter - points(size(points))%orbit%parameter
    rise_after = beyond%now%orbit%parameter - graze%now%orbit%parameter
    if (rise_before*rise_after < 0) graze%now%label = label_gr_fold
    points = [points, graze%now, beyond%now]
    trace = beyond
  end subroutine leave_by_graze

  !> Where the slip, or stick, after the event `k` is next to none: without it the branch goes on, and that shows where the onset
  !> is. `ending`: not known if that is not so.
  subroutine leave_by_stick(family, plan, trace, k, points, ending)
    type(family_t), intent(in) :: family
    type(plan_t), intent(in) :: plan
    type(trace_t), intent(inout) :: trace
    integer, intent(in) :: k
    type(point_t), allocatable, intent(inout) :: points(:)
    integer, intent(out) :: ending
    type(trace_t) :: beyond, onset
    type(margin_t) :: stick
    logical :: ok
    ending = label_not_known
    if (slip_grows(trace, k)) return
    beyond%now%orbit = without_slips(trace%machines%centre, trace%now%orbit, k)
    call enter_sequence(family, trace, 0.1_wp*plan%largest_step, beyond, ok)
    if (.not. ok) return
    stick = onset_without(trace%now%orbit, k, beyond%margins)
    if (stick%kind == 0) return
    call locate_missed_graze(family, beyond, stick, trace%now%orbit%parameter, onset, ok)
    if (ok) ok = abs(onset%now%orbit%parameter - trace%now%orbit%parameter) < near_in_parameter*family%parameter_size
    if (.not. ok) return
    ending = no_label
    onset%now%label = label_stick
    points = [points, onset%now, beyond%now]
    trace = beyond
  end subroutine leave_by_stick

  !> Whether the slip after the event `k` lasts longer further on: the branch has just come from where it is none.
  pure logical function slip_grows(trace, k)
    type(trace_t), intent(in) :: trace
    integer, intent(in) :: k
    associate (n => size(trace%now%orbit%y))
      slip_grows = trace%now%tangent(n + k + 1) > trace%now%tangent(n + k)
    end associate
  end function slip_grows

  !> Whether an impact loses its speed where another barrier is just missed: an orbit and its mirror image become one there, and
  !> all that touches in other sequences begins there too. A barrier that is missed beside an impact that loses its speed is that
  !> impact's own.
  pure logical function grazes_twice(trace)
    type(trace_t), intent(in) :: trace
    logical :: lost(size(trace%margins%list))
    integer :: i, k
    grazes_twice = .false.
    associate (list => trace%margins%list, events => trace%now%orbit%events)
      do i = 1, size(list)
        lost(i) = list(i)%kind == of_impact .and. abs(list(i)%value) < at_graze
        if (lost(i)) lost(i) = .not. is_touch(trace%now%orbit, list(i))
      end do
      if (.not. any(lost)) return
      do k = 1, size(list)
        if (list(k)%kind /= of_gap .or. .not. abs(list(k)%value) < at_graze) cycle
        grazes_twice = .true.
        do i = 1, size(list)
          if (.not. lost(i)) cycle
          if (events(list(i)%event)%side == list(k)%side .and. events(list(i)%event)%joint == list(k)%joint) grazes_twice = .false.
        end do
        if (grazes_twice) return
      end do
    end associate
  end function grazes_twice

  !> Whether an orbit is one of a shorter period, run through several times: in the graze of that the branch ends.
  pure logical function is_repeated(trace)
    type(trace_t), intent(in) :: trace
    real(wp) :: points(size(trace%now%orbit%y), trace%now%orbit%periods)
    integer :: i
    is_repeated = .false.
    points = section_points(trace%machines, trace%now%orbit)
    do i = 2, trace%now%orbit%periods
      is_repeated = is_repeated .or. norm2((points(:, i) - points(:, 1))/trace%machines%centre%size_of) < at_graze
    end do
  end function is_repeated

end module graze_passage
