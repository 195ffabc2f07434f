! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine and its neighbours: for every chosen parameter the machine with that parameter a step further, and the one with
!> it a step back. They are built once for all segments.
!> A difference over a step e of a natural size has the error e of the series cut off and the error s/e of the results'
!> own error s: both are least at e = sqrt(s), s being rounding for exact flights and the tolerance for adaptive ones.
module variants
  use build_motion, only: machine_of
  use errors, only: error_t, fail
  use kinds, only: wp
  use law_table, only: law_choice_t
  use motion, only: motion_t
  use motion_state, only: options_t
  use natural_scale, only: natural_size, scales_of, scales_t
  use parameter_list, only: parameter_t, put_values
  use status, only: exit_bad_case
  implicit none
  private

  public :: prepare_family

  !> Relative error of an exact flight: rounding, somewhat grown.
  real(wp), parameter :: exact_error = 1e-14_wp
  !> A parameter smaller than this share of its natural size is stepped as if it had that size.
  real(wp), parameter :: smallest_share = 0.1_wp

  !> A machine one parameter of which is a step away.
  type, public :: variant_t
    type(motion_t) :: moving
    !> Signed step of the parameter, SI.
    real(wp) :: step = 0
    !> Only what happens at the barriers differs, so a motion that reaches none is the same.
    logical :: contact_only = .false.
  end type variant_t

  type, public :: family_t
    type(motion_t) :: moving
    !> One per chosen parameter: a step further; and a step back, with step 0 where the bounds forbid it.
    type(variant_t), allocatable :: further(:), back(:)
    !> Steps of x [m], v [m/s] and crank angle [rad] of a start.
    real(wp) :: start_step(3) = 0
  end type family_t

contains

  !> Builds the machine of `laws` with `values` in the parameters `chosen`, and its neighbours if `derivatives`. Code 65 if
  !> a machine cannot be built or has two bodies.
  pure subroutine prepare_family(laws, options, chosen, values, derivatives, family, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    logical, intent(in) :: derivatives
    type(family_t), intent(out) :: family
    type(error_t), allocatable, intent(out) :: error
    type(scales_t) :: scales
    real(wp) :: share, step
    integer :: i
    call build(laws, options, chosen, values, family%moving, error)
    if (allocated(error)) return
    if (allocated(family%moving%pair)) then
      call fail(error, exit_bad_case, 'body.law: found "'//trim(laws(1)%name)//'", allowed for segments point_mass')
      return
    end if
    if (.not. derivatives) return
    scales = scales_of(family%moving%machine)
    share = sqrt(exact_error)
    if (.not. all_exact(family%moving)) share = sqrt(max(exact_error, options%tolerance))
    family%start_step = share*[scales%length, scales%length/scales%time, 1.0_wp]
    allocate (family%further(size(chosen)), family%back(size(chosen)))
    do i = 1, size(chosen)
      step = share*max(abs(values(i)), smallest_share*natural_size(trim(chosen(i)%unit), scales))
      if (.not. inside(values(i) + step, chosen(i))) step = -step
      call build_variant(laws, options, chosen, values, i, step, family%further(i), error)
      if (allocated(error)) return
      if (inside(values(i) - step, chosen(i))) then
        call build_variant(laws, options, chosen, values, i, -step, family%back(i), error)
      end if
      if (allocated(error)) return
    end do
  end subroutine prepare_family

  !> Whether no mode of a machine is flown adaptively.
  pure logical function all_exact(moving)
    type(motion_t), intent(in) :: moving
    all_exact = moving%exact .and. .not. moving%layer > 0 .and. .not. moving%machine%contact%soft
  end function all_exact

  pure logical function inside(value, parameter)
    real(wp), intent(in) :: value
    type(parameter_t), intent(in) :: parameter
    inside = value >= parameter%lower .and. value <= parameter%upper
  end function inside

  pure subroutine build(laws, options, chosen, values, moving, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:)
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t) :: changed(size(laws))
    changed = laws
    call put_values(changed, chosen, values)
    call machine_of(changed, options, moving, error)
  end subroutine build

  pure subroutine build_variant(laws, options, chosen, values, which, step, variant, error)
    type(law_choice_t), intent(in) :: laws(:)
    type(options_t), intent(in) :: options
    type(parameter_t), intent(in) :: chosen(:)
    real(wp), intent(in) :: values(:), step
    integer, intent(in) :: which
    type(variant_t), intent(out) :: variant
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: moved(size(values))
    moved = values
    moved(which) = values(which) + step
    variant%step = moved(which) - values(which)
    call build(laws, options, chosen, moved, variant%moving, error)
    variant%contact_only = chosen(which)%path(:8) == 'contact.'
  end subroutine build_variant

end module variants
