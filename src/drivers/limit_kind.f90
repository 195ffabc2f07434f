! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> What ends a settled motion of a machine with a motor at a limit of a sweep: the cycle is followed over the parameter to its
!> bifurcation.
module limit_kind
  use body_family, only: family_t
  use branch, only: trace_branch
  use branch_point, only: branch_t, label_chatter, label_gr, label_gr_fold, label_ns, label_pd, label_release, label_run, &
    label_sn, label_stick, label_stiction, plan_t, set_sizes
  use errors, only: error_t
  use grid, only: grid_t
  use kinds, only: wp
  use machine_family, only: machine_neighbourhood
  use motor_body, only: motor_body_t
  use orbit_motion, only: orbit_of_motion
  use periodic_orbit, only: correct_orbit, orbit_t
  use orbit_directions, only: direct
  use settling, only: settled_t
  use variations, only: neighbourhood_t
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  implicit none
  private

  public :: find_kind

  integer, parameter, public :: kind_not_known = 0, kind_fold = 1, kind_neimark_sacker = 2, kind_doubling = 3, kind_graze = 4, &
    kind_stick = 5, kind_chatter = 6, last_limit_kind = 6
  character(len=*), parameter, public :: limit_kinds(0:last_limit_kind) = [character(len=14) :: 'not_known', 'fold', &
    'neimark_sacker', 'doubling', 'graze', 'stick', 'chatter']

  !> A bifurcation may be so far from the interval in which the motion was seen to end, as a share of it: steps disturb a motion.
  real(wp), parameter :: beside = 0.25_wp
  integer, parameter :: most_points = 400

contains

  !> Follows a motion that has `settled` at `value` of the parameter `path` over `bracket`, in which it ends. `kind` is that of the
  !> first bifurcation in it that does so, `at` its value; not a number where none is found.
  subroutine find_kind(grid, path, settled, value, bracket, kind, at)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    type(settled_t), intent(in) :: settled
    real(wp), intent(in) :: value, bracket(2)
    integer, intent(out) :: kind
    real(wp), intent(out) :: at
    type(family_t) :: family
    type(plan_t) :: plan
    type(orbit_t) :: seed
    type(branch_t) :: found
    logical :: ok
    real(wp) :: room
    kind = kind_not_known
    at = ieee_value(1.0_wp, ieee_quiet_nan)
    room = beside*(bracket(2) - bracket(1)) + abs(value)*sqrt(epsilon(1.0_wp))
    family%laws = grid%laws
    family%path = path
    family%options = grid%options
    plan%lowest = min(value, bracket(1)) - room
    plan%highest = max(value, bracket(2)) + room
    plan%most_points = most_points
    call seed_of(family, plan, settled, value, seed, ok)
    if (.not. ok) return
    call trace_branch(family, plan, seed, found)
    call first_in(found, value, bracket + [-room, room], kind, at)
  end subroutine find_kind

  !> The settled cycle as an orbit.
  subroutine seed_of(family, plan, settled, value, seed, ok)
    type(family_t), intent(inout) :: family
    type(plan_t), intent(in) :: plan
    type(settled_t), intent(in) :: settled
    real(wp), intent(in) :: value
    type(orbit_t), intent(out) :: seed
    logical, intent(out) :: ok
    type(neighbourhood_t) :: machines
    type(error_t), allocatable :: error
    real(wp), allocatable :: y(:)
    ok = .false.
    if (settled%period == 0) return
    call set_sizes(plan, family, error)
    if (.not. allocated(error)) call machine_neighbourhood(family, value, machines, error)
    if (allocated(error)) return
    select type (centre => machines%centre)
    type is (motor_body_t)
      y = centre%point_of(settled%state)
      y(2) = 0
      call orbit_of_motion(machines, value, y, settled%period, seed, ok)
    end select
    if (ok) call correct_orbit(family, machines, seed, direct(seed, 1), ok)
  end subroutine seed_of

  !> The bifurcation of a branch within a range that comes first from `value`.
  pure subroutine first_in(found, value, range, kind, at)
    type(branch_t), intent(in) :: found
    real(wp), intent(in) :: value, range(2)
    integer, intent(inout) :: kind
    real(wp), intent(inout) :: at
    integer :: i, one
    do i = 1, size(found%points)
      one = kind_of(found%points(i)%label)
      associate (there => found%points(i)%orbit%parameter)
        if (one == kind_not_known .or. there < range(1) .or. there > range(2)) cycle
        if (kind /= kind_not_known .and. .not. abs(there - value) < abs(at - value)) cycle
        kind = one
        at = there
      end associate
    end do
  end subroutine first_in

  pure integer function kind_of(label) result(kind)
    integer, intent(in) :: label
    select case (label)
    case (label_sn)
      kind = kind_fold
    case (label_ns)
      kind = kind_neimark_sacker
    case (label_pd)
      kind = kind_doubling
    case (label_gr, label_gr_fold)
      kind = kind_graze
    case (label_stick, label_stiction, label_release)
      kind = kind_stick
    case (label_chatter, label_run)
      kind = kind_chatter
    case default
      kind = kind_not_known
    end select
  end function kind_of

end module limit_kind
