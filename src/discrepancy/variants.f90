! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine and its neighbours: for every direction in the space of the chosen parameters the machine a step further along
!> it, and the one a step back. They are built once for all segments.
!> A difference over a step e of a natural size has the error e of the series cut off and the error s/e of the results'
!> own error s: both are least at e = sqrt(s), s being rounding for exact flights and, for adaptive ones, the part of the
!> tolerance that neighbours do not share.
module variants
  use body_machine, only: body_machine_t
  use body_segments, only: segments_of_body, sensor_paths
  use build_motion, only: bodies_of, body_of, kind_bodies, kind_body, kind_motor, kind_of, kind_own
  use effect_rows, only: acts_at_barrier
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use law_table, only: law_choice_t
  use machine_type, only: machine_t, scales_t
  use motion_state, only: flight_adaptive, options_t
  use motor_machine, only: motor_machine_t, prepare_motor_machine
  use motor_segments, only: segments_of_motor
  use multibody_machine, only: multibody_machine_t
  use natural_scale, only: natural_size
  use parameter_list, only: parameter_t, put_values
  use segment_machine, only: segment_machine_t
  use status, only: exit_bad_case
  use structure_segments, only: segments_of_structure
  implicit none
  private

  public :: prepare_family

  !> Relative error of an exact flight: rounding, somewhat grown.
  real(wp), parameter :: exact_error = 1e-14_wp
  !> Part of the tolerance of an adaptive flight by which the errors of two neighbours differ, found by comparison with
  !> flights of much smaller tolerance.
  real(wp), parameter :: uncommon = 4e-4_wp
  !> A parameter smaller than this share of its natural size is stepped as if it had that size.
  real(wp), parameter :: smallest_share = 0.1_wp

  !> Events, and steps, that a segment may take in a drive period, and more for each sample of a measured force that a step
  !> ends at. Motions of machines take some hundreds; a fit that tries a spring or barrier too stiff to have made a record must
  !> not pay for following it.
  integer(int64), parameter :: most_a_period = 20000, most_a_sample = 32

  !> A machine of which segments are flown.
  type, public :: flown_t
    class(segment_machine_t), allocatable :: machine
  end type flown_t

  !> A machine that is a step away.
  type, extends(flown_t), public :: variant_t
    !> Signed step in units of the direction; 0 where there is no such machine.
    real(wp) :: step = 0
    !> Only what happens at the barriers differs, so a motion that reaches none is the same.
    logical :: contact_only = .false.
    !> It leaves the closed form that the machine itself has, as an effect of size 0 does: it is compared with the machine
    !> flown adaptively.
    logical :: leaves_exact = .false.
  end type variant_t

  type, extends(flown_t), public :: family_t
    !> The same machine flown adaptively, where a variant needs it.
    type(flown_t), allocatable :: adaptive
    !> One per direction: a step further; and a step back.
    type(variant_t), allocatable :: further(:), back(:)
    !> Components of the directions along bias, gain and delay of the sensor, by column.
    real(wp), allocatable :: of_sensor(:, :)
    !> Steps of the numbers of a start; those that are speeds are first made larger.
    real(wp), allocatable :: start_step(:)
    logical, allocatable :: is_speed(:)
    !> Distance to a barrier [m] and speed of an impact [m/s] below which a motion grazes: there a step changes the speed of
    !> the impact by more than a hundredth.
    real(wp) :: least_clearance = 0, least_speed = 0
  end type family_t

  !> What all machines of a family have in common.
  type :: plan_t
    type(law_choice_t), allocatable :: laws(:)
    type(options_t) :: options
    type(parameter_t), allocatable :: chosen(:)
    real(wp), allocatable :: values(:), directions(:, :)
    type(scales_t) :: scales
  end type plan_t

contains

  !> Builds the machine of `laws` with `values` in the parameters `chosen`, and if `derivatives` its neighbours: column j of
  !> `directions` is direction j, its change of each chosen parameter (in the unit of that) per unit of the way along it.
  !> Code 65 if a machine cannot be built.
  subroutine prepare_family(laws, options, chosen, values, directions, derivatives, family, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:), directions(:, :)
    logical, intent(in) :: derivatives
    type(family_t), intent(out) :: family
    type(error_t), allocatable, intent(out) :: error
    type(plan_t) :: plan
    real(wp) :: share, unit(3)
    integer :: i, at
    plan = plan_t(laws, options, chosen, values, directions)
    call build(plan, values, .false., family%flown_t, error)
    if (allocated(error)) return
    if (.not. derivatives) return
    plan%scales = family%machine%sizes
    share = share_of(options, family%machine%closed_form)
    unit = share*[plan%scales%length, plan%scales%length/plan%scales%time, 1.0_wp]
    allocate (family%start_step(family%machine%start_numbers), family%is_speed(family%machine%start_numbers))
    call family%machine%set_steps(unit, family%start_step, family%is_speed)
    family%least_clearance = 10*unit(1)
    family%least_speed = 10*sqrt(share)*plan%scales%length/plan%scales%time
    allocate (family%further(size(directions, 2)), family%back(size(directions, 2)))
    allocate (family%of_sensor(size(sensor_paths), size(directions, 2)), source=0.0_wp)
    do i = 1, size(sensor_paths)
      at = findloc(chosen%path == sensor_paths(i), .true., dim=1)
      if (at == 0) cycle
      family%of_sensor(i, :) = directions(at, :)
      plan%directions(at, :) = 0
    end do
    do i = 1, size(directions, 2)
      if (.not. any(abs(plan%directions(:, i)) > 0)) cycle
      call build_neighbours(plan, i, family%machine%closed_form, family%further(i), family%back(i), error)
      if (allocated(error)) return
      if (.not. (family%further(i)%leaves_exact .or. family%back(i)%leaves_exact) .or. allocated(family%adaptive)) cycle
      allocate (family%adaptive)
      call build(plan, values, .true., family%adaptive, error)
      if (allocated(error)) return
    end do
  end subroutine prepare_family

  !> Step relative to the size of a quantity.
  pure real(wp) function share_of(options, exact) result(share)
    type(options_t), intent(in) :: options
    logical, intent(in) :: exact
    share = sqrt(merge(exact_error, max(exact_error, uncommon*options%tolerance), exact))
  end function share_of

  subroutine build(plan, values, adaptive, flown, error)
    type(plan_t), intent(in) :: plan
    real(wp), intent(in) :: values(:)
    logical, intent(in) :: adaptive
    type(flown_t), intent(inout) :: flown
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t) :: changed(size(plan%laws))
    type(options_t) :: options
    type(body_machine_t) :: body
    type(multibody_machine_t) :: several
    type(motor_machine_t) :: driven
    changed = plan%laws
    call put_values(changed, plan%chosen, values)
    options = plan%options
    if (adaptive) options%flight = flight_adaptive
    if (allocated(flown%machine)) deallocate (flown%machine)
    select case (kind_of(changed))
    case (kind_motor)
      call prepare_motor_machine(changed, options, driven, error)
      if (allocated(error)) return
      call limit(driven)
      allocate (flown%machine, source=segments_of_motor(driven))
      call take_facts(driven, flown%machine)
    case (kind_bodies)
      call bodies_of(changed, options, several, error)
      if (allocated(error)) return
      call limit(several)
      allocate (flown%machine, source=segments_of_structure(several))
      call take_facts(several, flown%machine)
    case (kind_body, kind_own)
      ! The second is refused with the keys that it has.
      call body_of(changed, options, body, error)
      if (allocated(error)) return
      call limit(body)
      allocate (flown%machine, source=segments_of_body(body))
      call take_facts(body, flown%machine)
    case default
      call fail(error, exit_bad_case, 'the segments of this kind of machine are not known')
    end select
  end subroutine build

  !> Limits the budgets of a machine.
  subroutine limit(machine)
    class(machine_t), intent(inout) :: machine
    integer(int64) :: budget
    budget = most_a_period + most_a_sample*machine%force_samples
    call machine%limit_budgets(budget, budget)
  end subroutine limit

  subroutine take_facts(machine, segments)
    class(machine_t), intent(in) :: machine
    class(segment_machine_t), intent(inout) :: segments
    segments%sizes = machine%sizes
    segments%period = machine%period
    segments%closed_form = machine%closed_form
  end subroutine take_facts

  !> The neighbours along direction `which`. If the first cannot be built, the other replaces it.
  subroutine build_neighbours(plan, which, exact, further, back, error)
    type(plan_t), intent(in) :: plan
    integer, intent(in) :: which
    logical, intent(in) :: exact
    type(variant_t), intent(out) :: further, back
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: no_other
    call build_variant(plan, which, 1, exact, further, error)
    call build_variant(plan, which, -1, exact, back, no_other)
    if (.not. allocated(error)) return
    if (allocated(no_other)) return
    deallocate (error)
    further = back
    back%step = 0
  end subroutine build_neighbours

  subroutine build_variant(plan, which, sense, exact, variant, error)
    type(plan_t), intent(in) :: plan
    integer, intent(in) :: which, sense
    logical, intent(in) :: exact
    type(variant_t), intent(out) :: variant
    type(error_t), allocatable, intent(out) :: error
    call take_step(plan, which, sense, share_of(plan%options, exact), .false., variant, error)
    if (allocated(error)) return
    if (exact .and. .not. variant%machine%closed_form) then
      variant%leaves_exact = .true.
      call take_step(plan, which, sense, share_of(plan%options, .false.), .true., variant, error)
    end if
    variant%contact_only = all(abs(plan%directions(:, which)) <= 0 .or. of_contact(plan%chosen%path))
  end subroutine build_variant

  pure elemental logical function of_contact(path)
    character(len=*), intent(in) :: path
    character(len=*), parameter :: effect = 'effect.'
    integer :: last
    last = index(path, '.', back=.true.) - 1
    of_contact = path(:last) == 'contact'
    if (index(path, effect) == 1) of_contact = acts_at_barrier(path(len(effect) + 1:last))
  end function of_contact

  subroutine take_step(plan, which, sense, share, adaptive, variant, error)
    type(plan_t), intent(in) :: plan
    integer, intent(in) :: which, sense
    real(wp), intent(in) :: share
    logical, intent(in) :: adaptive
    type(variant_t), intent(inout) :: variant
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: moved(size(plan%values))
    integer :: i
    associate (direction => plan%directions(:, which))
      variant%step = huge(share)
      do i = 1, size(direction)
        if (.not. abs(direction(i)) > 0) cycle
        variant%step = min(variant%step, natural_step(plan%chosen(i), plan%values(i))/abs(direction(i)))
      end do
      variant%step = sense*variant%step
      moved = plan%values + variant%step*direction
    end associate
    call check_bounds(plan%chosen, moved, error)
    if (allocated(error)) variant%step = 0
    if (allocated(error)) return
    call build(plan, moved, adaptive, variant%flown_t, error)
    if (allocated(error)) variant%step = 0
  contains
    !> Size of a step of one parameter.
    pure real(wp) function natural_step(one, value)
      type(parameter_t), intent(in) :: one
      real(wp), intent(in) :: value
      natural_step = share
      ! A neighbour that goes another way shares no error: whole exponents are powers by products, and a table of contact forces
      ! has its own steps. Of the table the values between are so little that only a long step shows them.
      if (index(one%path, 'exponent') > 0) natural_step = max(share, sqrt(plan%options%tolerance))
      if (index(one%path, 'hardening') > 0) natural_step = max(share, sqrt(plan%options%tolerance))
      if (index(one%path, 'contact_curve') > 0) natural_step = max(share, sqrt(sqrt(plan%options%tolerance)))
      natural_step = natural_step*max(abs(value), smallest_share*natural_size(trim(one%unit), plan%scales))
    end function natural_step
  end subroutine take_step

  !> Code 65 if a step has left the bounds of a parameter.
  pure subroutine check_bounds(chosen, moved, error)
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: moved(:)
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    do i = 1, size(chosen)
      associate (one => chosen(i), value => moved(i))
        if (value < one%lower .or. value > one%upper .or. (one%lower_open .and. value <= one%lower)) then
          call fail(error, exit_bad_case, 'parameter '//trim(one%path)//': no room for a step within its bounds')
          return
        end if
      end associate
    end do
  end subroutine check_bounds

end module variants
