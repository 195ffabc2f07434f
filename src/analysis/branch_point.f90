! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Points of a branch of periodic orbits: their labels, what belongs to each, and the step from one to the next.
module branch_point
  use body_family, only: family_t
  use errors, only: error_t
  use hybrid_machine, only: hybrid_t
  use kinds, only: wp
  use margins_along, only: margins_of_machine
  use machine_family, only: machine_neighbourhood, machine_of_family
  use multipliers, only: nearly_neutral
  use orbit_margins, only: margins_t
  use periodic_orbit, only: correct_orbit, move_along, orbit_t, scales_of_orbit
  use orbit_directions, only: tangent_of
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: is_stable, move_trace, set_sizes, set_point, step_to

  !> Labels of points. GR: an orbit goes on beyond the graze with an impact more or less; GR-fold: both sides of it are on the
  !> same side of the parameter. BP: multiplier +1 where the parameter does not turn;
  !> release: a body that rests for ever does so no more; contact, crisis: module `homoclinic`. HB: cycles begin or end in an
  !> equilibrium, as a pair of its eigenvalues passes the imaginary axis; BE: an equilibrium touches a stop or lets go of one.
  !> too_long: so many points; many_impacts: so many in a row that they are the beginning of a chatter.
  integer, parameter, public :: no_label = 0, label_sn = 1, label_pd = 2, label_ns = 3, label_bp = 4, label_gr = 5, &
    label_gr_fold = 6, label_stick = 7, label_chatter = 8, label_stiction = 9, label_range = 10, label_closed = 11, &
    label_not_known = 12, label_long = 13, label_release = 14, label_homoclinic = 15, label_crisis = 16, &
    label_hb = 17, label_be = 18, label_run = 19, last_label = 19
  character(len=*), parameter, public :: label_names(0:last_label) = [character(len=18) :: 'none', 'SN', 'PD', 'NS', 'BP', &
    'GR', 'GR-fold', 'stick_onset', 'chatter_onset', 'stiction_end', 'end_of_range', 'closed', 'not_known', 'too_long', &
    'release', 'homoclinic_contact', 'boundary_crisis', 'HB', 'BE', 'many_impacts']

  type, public :: point_t
    type(orbit_t) :: orbit
    integer :: label = no_label
    real(wp) :: x_max = 0, x_min = 0
    !> The second half of the orbit is the mirror image of the first.
    logical :: symmetric = .false.
    !> Direction in which the branch goes on.
    real(wp), allocatable :: tangent(:)
  end type point_t

  !> Points in the order in which they were found; `ending` labels the last.
  type, public :: branch_t
    type(point_t), allocatable :: points(:)
    integer :: ending(2) = no_label
  end type branch_t

  !> What to follow, and how far.
  type, public :: plan_t
    real(wp) :: lowest = 0, highest = 0
    !> Largest step in natural sizes, and most points each way.
    real(wp) :: largest_step = 0.02_wp
    integer :: most_points = 2000
  end type plan_t

  !> Where a trace is.
  type, public :: trace_t
    type(point_t) :: now
    type(neighbourhood_t) :: machines
    type(margins_t) :: margins
    !> The next step, and that which led here.
    real(wp) :: step = 0, came = 0
    !> How the tangent turns per length; nothing where it is not known.
    real(wp), allocatable :: bend(:)
  end type trace_t

contains

  !> Whether all multipliers are within the unit circle, by more than what one is known to where it is 1.
  pure logical function is_stable(orbit)
    type(orbit_t), intent(in) :: orbit
    ! The largest comes first; those that are not known are smaller.
    is_stable = abs(orbit%multipliers(1)) < 1 - nearly_neutral
  end function is_stable

  !> Sets the sizes of a family: of the parameter by its range, of the state by the largest motion that the drive alone brings
  !> about at the ends of the range.
  subroutine set_sizes(plan, family, error)
    type(plan_t), intent(in) :: plan
    type(family_t), intent(inout) :: family
    type(error_t), allocatable, intent(out) :: error
    class(hybrid_t), allocatable :: machine
    real(wp) :: sizes(2)
    family%parameter_size = plan%highest - plan%lowest
    family%sizes = 0
    sizes = 0
    call machine_of_family(family, plan%lowest, machine, error)
    if (allocated(error)) return
    sizes = machine%section_sizes()
    call machine_of_family(family, plan%highest, machine, error)
    if (allocated(error)) return
    family%sizes = max(sizes, machine%section_sizes())
  end subroutine set_sizes

  !> Tangent, margins and extremes of the orbit where the trace is.
  subroutine set_point(family, trace, along, ok)
    type(family_t), intent(in) :: family
    type(trace_t), intent(inout) :: trace
    real(wp), intent(in) :: along(:)
    logical, intent(out) :: ok
    if (allocated(trace%now%tangent)) deallocate (trace%now%tangent)
    allocate (trace%now%tangent(size(along)), source=0.0_wp)
    call tangent_of(trace%machines, trace%now%orbit, family%parameter_size, along, trace%now%tangent, ok)
    trace%margins = margins_of_machine(trace%machines%centre, trace%now%orbit)
    trace%now%x_max = trace%margins%x_max
    trace%now%x_min = trace%margins%x_min
  end subroutine set_point

  !> The point `length` further along the branch, with everything that belongs to it; `roughly`: as near as rounding lets it.
  subroutine step_to(family, trace, length, next, ok, steps, roughly)
    type(family_t), intent(in) :: family
    type(trace_t), intent(in) :: trace
    real(wp), intent(in) :: length
    type(trace_t), intent(out) :: next
    logical, intent(out) :: ok
    integer, intent(out) :: steps
    logical, intent(in), optional :: roughly
    type(error_t), allocatable :: error
    real(wp) :: way(size(trace%now%tangent))
    steps = 0
    ! The machines are built anew.
    next%now = trace%now
    next%margins = trace%margins
    next%step = trace%step
    next%came = trace%came
    if (allocated(trace%bend)) next%bend = trace%bend
    way = length*trace%now%tangent
    if (allocated(trace%bend)) way = way + length**2/2*trace%bend
    call move_along(next%now%orbit, way*scales_of_orbit(trace%machines, trace%now%orbit, family%parameter_size))
    call machine_neighbourhood(family, next%now%orbit%parameter, next%machines, error)
    ok = .not. allocated(error)
    if (ok) call correct_orbit(family, next%machines, next%now%orbit, trace%now%tangent, ok, steps, roughly)
    if (ok) call set_point(family, next, trace%now%tangent, ok)
  end subroutine step_to

  !> Moves a trace, with its machines, into another one.
  pure subroutine move_trace(from, to)
    type(trace_t), intent(inout) :: from
    type(trace_t), intent(inout) :: to
    to%now = from%now
    to%margins = from%margins
    to%step = from%step
    to%came = from%came
    to%machines%step = from%machines%step
    to%machines%side = from%machines%side
    call move_alloc(from%machines%centre, to%machines%centre)
    call move_alloc(from%machines%near, to%machines%near)
    call move_alloc(from%bend, to%bend)
  end subroutine move_trace

end module branch_point
