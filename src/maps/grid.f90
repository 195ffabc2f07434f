! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A map's grid: points over axes, some of which are starts (x0, v0, crank angle) and the others parameters.
!> A slice is one combination of the parameters: one machine, one catalogue of attractors.
module grid
  use axis, only: axis_t
  use build_motion, only: machine_of, period_of
  use errors, only: error_t
  use kinds, only: int64, wp
  use law_table, only: change_parameter, law_choice_t
  use motion, only: motion_t
  use motion_state, only: options_t
  implicit none
  private

  public :: make_grid, two_axes, point_start, point_slice, slice_motion, slice_laws, slice_period, slice_starts
  public :: slice_neighbours, machine_with

  type, public :: grid_t
    type(axis_t), allocatable :: axes(:)
    !> Points along each axis.
    integer, allocatable :: shape(:)
    !> Axis of x0, v0 and the crank angle; 0 where the start's own value is used.
    integer :: start_axis(3) = 0
    !> x0 [m], v0 [m/s], crank angle [rad] where no axis gives them.
    real(wp) :: start(3) = 0
    !> The other axes, in order, and the number of their combinations.
    integer, allocatable :: parameter_axes(:)
    integer(int64) :: slices = 1
    !> The machine where no axis changes it.
    type(law_choice_t), allocatable :: laws(:)
    type(options_t) :: options
  end type grid_t

contains

  !> A grid over `axes`; `start` = x0, v0, crank angle where no axis gives them.
  pure function make_grid(axes, laws, start, options) result(grid)
    type(axis_t), intent(in) :: axes(:)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: start(3)
    type(options_t), intent(in) :: options
    type(grid_t) :: grid
    integer :: i
    grid%axes = axes
    grid%laws = laws
    grid%start = start
    grid%options = options
    allocate (grid%shape(size(axes)), grid%parameter_axes(0))
    do i = 1, size(axes)
      grid%shape(i) = size(axes(i)%values)
      select case (axes(i)%name)
      case ('x0')
        grid%start_axis(1) = i
      case ('v0')
        grid%start_axis(2) = i
      case ('crank_angle')
        grid%start_axis(3) = i
      case default
        grid%parameter_axes = [grid%parameter_axes, i]
        grid%slices = grid%slices*grid%shape(i)
      end select
    end do
  end function make_grid

  !> x0, v0, crank angle of a point (`index` from 1 along each axis).
  pure function point_start(grid, index) result(start)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    real(wp) :: start(3)
    integer :: i
    start = grid%start
    do i = 1, 3
      if (grid%start_axis(i) > 0) start(i) = grid%axes(grid%start_axis(i))%values(index(grid%start_axis(i)))
    end do
  end function point_start

  !> Slice of a point, from 0, last parameter axis fastest.
  pure integer(int64) function point_slice(grid, index) result(slice)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    integer :: i
    slice = 0
    do i = 1, size(grid%parameter_axes)
      slice = slice*grid%shape(grid%parameter_axes(i)) + index(grid%parameter_axes(i)) - 1
    end do
  end function point_slice

  !> The machine of a slice, ready to move.
  pure subroutine slice_motion(grid, slice, moving, error)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: slice
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    call machine_of(slice_laws(grid, slice), grid%options, moving, error)
  end subroutine slice_motion

  !> Drive period of a slice's machine [s].
  pure subroutine slice_period(grid, slice, period, error)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: slice
    real(wp), intent(out) :: period
    type(error_t), allocatable, intent(out) :: error
    call period_of(slice_laws(grid, slice), period, error)
  end subroutine slice_period

  !> The two axes along which a map is refined: of starts if there are as many, otherwise also of parameters, the first
  !> ones first. 0 if there are no two.
  pure function two_axes(grid) result(axes)
    type(grid_t), intent(in) :: grid
    integer :: axes(2), i
    integer, allocatable :: starts(:), candidates(:)
    starts = pack([(i, i=1, size(grid%axes))], [(any(grid%start_axis == i), i=1, size(grid%axes))])
    candidates = [starts, grid%parameter_axes, 0, 0]
    axes = [minval(candidates(:2)), maxval(candidates(:2))]
  end function two_axes

  !> The laws of a slice's machine.
  pure function slice_laws(grid, slice) result(laws)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: slice
    type(law_choice_t), allocatable :: laws(:)
    integer(int64) :: rest
    integer :: i, position, along
    logical :: known
    laws = grid%laws
    rest = slice
    do i = size(grid%parameter_axes), 1, -1
      along = grid%parameter_axes(i)
      position = int(modulo(rest, int(grid%shape(along), int64)))
      rest = rest/grid%shape(along)
      call change_parameter(laws, grid%axes(along)%name, grid%axes(along)%values(position + 1), known)
    end do
  end function slice_laws

  !> The machine with one parameter 'family.parameter' changed.
  pure subroutine machine_with(grid, path, value, moving, error)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    type(motion_t), intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    type(law_choice_t), allocatable :: laws(:)
    logical :: known
    laws = grid%laws
    call change_parameter(laws, path, value, known)
    call machine_of(laws, grid%options, moving, error)
  end subroutine machine_with

  !> Slices next to `slice` along each parameter axis, last axis first: those before it, and with `both` those behind it.
  pure function slice_neighbours(grid, slice, both) result(neighbours)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: slice
    logical, intent(in) :: both
    integer(int64), allocatable :: neighbours(:)
    integer(int64) :: stride, position
    integer :: i, length
    allocate (neighbours(0))
    stride = 1
    do i = size(grid%parameter_axes), 1, -1
      length = grid%shape(grid%parameter_axes(i))
      position = modulo(slice/stride, int(length, int64))
      if (position > 0) neighbours = [neighbours, slice - stride]
      if (both .and. position < length - 1) neighbours = [neighbours, slice + stride]
      stride = stride*length
    end do
  end function slice_neighbours

  !> Starts that sample a slice: `count` points of the additive recurrence of Roberts (2018) over the ranges of
  !> the start axes, shifted by `seed`; one start if no start is an axis. Rows x0, v0, crank angle.
  pure function slice_starts(grid, count, seed) result(starts)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: count, seed
    real(wp), allocatable :: starts(:, :)
    ! Powers of 1/p for the root p of p^4 = p + 1.
    real(wp), parameter :: irrational(3) = [0.8191725133961645_wp, 0.6710436067037893_wp, &
                                            0.5497004779019703_wp]
    real(wp) :: low, high
    integer :: i, k, points
    points = merge(count, 1, any(grid%start_axis > 0))
    allocate (starts(3, points))
    do k = 1, 3
      starts(k, :) = grid%start(k)
      if (grid%start_axis(k) == 0) cycle
      low = minval(grid%axes(grid%start_axis(k))%values)
      high = maxval(grid%axes(grid%start_axis(k))%values)
      do i = 1, points
        starts(k, i) = low + (high - low)*modulo(0.5_wp + (i + seed*0.6180339887498949_wp)*irrational(k), 1.0_wp)
      end do
    end do
  end function slice_starts

end module grid
