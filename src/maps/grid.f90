! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A map's grid: points over axes, some of which are starts (x0, v0, crank angle, positions and velocities of further bodies)
!> and the others parameters. Starts may also be drawn at random: then one axis counts them.
!> A slice is one combination of the parameters: one machine, one catalogue of attractors.
module grid
  use axis, only: axis_t, name_length
  use build_multibody, only: is_multibody, multibody_of
  use build_motion, only: machine_of, period_of
  use derived_quantities, only: derived_t
  use errors, only: error_t
  use machine_type, only: machine_t
  use multibody, only: multibody_t
  use kinds, only: int64, wp
  use law_table, only: change_parameter, is_start_parameter, law_choice_t
  use motor_choices, only: has_motor, start_of_motor
  use own_machine, only: start_of_states
  use own_names, only: has_own
  use motion_state, only: options_t
  use text, only: number_in
  implicit none
  private

  public :: make_grid, two_axes, point_start, point_laws, point_slice, slice_motion, slice_laws, slice_period, slice_starts
  public :: slice_neighbours, machine_with

  !> The axis that counts starts drawn at random.
  character(len=*), parameter, public :: sample_axis = 'sample'
  character(len=name_length), parameter :: own_starts(3) = [character(len=name_length) :: 'x0', 'v0', 'crank_angle']

  type, public :: grid_t
    type(axis_t), allocatable :: axes(:)
    !> Points along each axis.
    integer, allocatable :: shape(:)
    !> What of the start varies: x0, v0, the crank angle, then parameters of the laws. The axis of each, 0 where the start's
    !> own value is used; and its row among the values drawn, 0 where the axis has the values itself.
    character(len=name_length), allocatable :: start_names(:)
    integer, allocatable :: start_axis(:), drawn_row(:)
    !> x0 [m], v0 [m/s], crank angle [rad] where no axis gives them.
    real(wp) :: start(3) = 0
    !> Of several bodies, positions and velocities of all coordinates where what varies is 0, one pair after the other; and
    !> their change for one of each further start that varies (columns).
    real(wp), allocatable :: others(:), direction(:, :)
    !> Values drawn at random: a row for each start, a column for each point of their axis.
    real(wp), allocatable :: drawn(:, :)
    !> The other axes, in order, and the number of their combinations.
    integer, allocatable :: parameter_axes(:)
    integer(int64) :: slices = 1
    !> The machine where no axis changes it.
    type(law_choice_t), allocatable :: laws(:)
    type(options_t) :: options
    !> Quantities derived from attractors.
    type(derived_t), allocatable :: derived(:)
  end type grid_t

contains

  !> A grid over `axes`; `start` = x0, v0, crank angle where no axis gives them. With `drawn` (rows of the starts in
  !> `drawn_names`) the axis `sample_axis` counts its columns.
  pure function make_grid(axes, laws, start, options, drawn_names, drawn) result(grid)
    type(axis_t), intent(in) :: axes(:)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), intent(in) :: start(3)
    type(options_t), intent(in) :: options
    character(len=name_length), intent(in), optional :: drawn_names(:)
    real(wp), intent(in), optional :: drawn(:, :)
    type(grid_t) :: grid
    integer :: i, k
    grid%axes = axes
    grid%laws = laws
    grid%start = start
    grid%options = options
    allocate (grid%shape(size(axes)), grid%parameter_axes(0), grid%derived(0))
    grid%start_names = own_starts
    grid%start_axis = [0, 0, 0]
    grid%drawn_row = [0, 0, 0]
    do i = 1, size(axes)
      grid%shape(i) = size(axes(i)%values)
      if (axes(i)%name == sample_axis .and. present(drawn)) then
        grid%drawn = drawn
        do k = 1, size(drawn_names)
          call vary(grid, drawn_names(k), i, k)
        end do
      else if (any(axes(i)%name == own_starts) .or. is_start_parameter(axes(i)%name)) then
        call vary(grid, axes(i)%name, i, 0)
      else
        grid%parameter_axes = [grid%parameter_axes, i]
        grid%slices = grid%slices*grid%shape(i)
      end if
    end do
    call find_directions(grid)
  end function make_grid

  !> Notes that a start varies along an axis.
  pure subroutine vary(grid, name, axis, row)
    type(grid_t), intent(inout) :: grid
    character(len=*), intent(in) :: name
    integer, intent(in) :: axis, row
    integer :: k
    k = number_in(grid%start_names, name)
    if (k == 0) then
      grid%start_names = [character(len=name_length) :: grid%start_names, name]
      grid%start_axis = [grid%start_axis, axis]
      grid%drawn_row = [grid%drawn_row, row]
    else
      grid%start_axis(k) = axis
      grid%drawn_row(k) = row
    end if
  end subroutine vary

  !> How the start of a motor, or of all coordinates of several bodies, depends on what varies: linearly.
  pure subroutine find_directions(grid)
    type(grid_t), intent(inout) :: grid
    type(law_choice_t), allocatable :: laws(:)
    integer :: k, extra
    logical :: known
    extra = size(grid%start_axis) - 3
    allocate (grid%others(0), grid%direction(0, extra))
    if (extra == 0) return
    if (.not. (is_multibody(grid%laws) .or. has_motor(grid%laws) .or. has_own(grid%laws))) return
    laws = grid%laws
    do k = 4, 3 + extra
      call change_parameter(laws, grid%start_names(k), 0.0_wp, known)
    end do
    grid%others = starts_of(laws)
    deallocate (grid%direction)
    allocate (grid%direction(size(grid%others), extra))
    do k = 4, 3 + extra
      call change_one(laws, grid%start_names(k), grid%others, grid%direction(:, k - 3))
    end do
  end subroutine find_directions

  !> The change of the start for one of the parameter `name`, which is 0 in `laws`.
  pure subroutine change_one(laws, name, others, direction)
    type(law_choice_t), intent(in) :: laws(:)
    character(len=*), intent(in) :: name
    real(wp), intent(in) :: others(:)
    real(wp), intent(out) :: direction(:)
    type(law_choice_t), allocatable :: changed(:)
    logical :: known
    changed = laws
    call change_parameter(changed, name, 1.0_wp, known)
    direction = starts_of(changed) - others
  end subroutine change_one

  !> Position and velocity of every coordinate at the start, one after the other, or the start of a motor; none of laws that are
  !> refused.
  pure function starts_of(laws) result(starts)
    type(law_choice_t), intent(in) :: laws(:)
    real(wp), allocatable :: starts(:)
    type(multibody_t) :: machine
    type(error_t), allocatable :: error
    if (has_motor(laws)) then
      starts = start_of_motor(laws)
      return
    else if (has_own(laws)) then
      starts = start_of_states(laws)
      return
    end if
    call multibody_of(laws, machine, error)
    allocate (starts(0))
    if (.not. allocated(error)) starts = reshape(machine%start, [2*machine%n])
  end function starts_of

  !> Value of the start `k` at a point.
  pure real(wp) function start_value(grid, k, index)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: k, index(:)
    associate (along => grid%start_axis(k))
      if (grid%drawn_row(k) > 0) then
        start_value = grid%drawn(grid%drawn_row(k), index(along))
      else
        start_value = grid%axes(along)%values(index(along))
      end if
    end associate
  end function start_value

  !> x0, v0, crank angle of a point (`index` from 1 along each axis); where starts of further bodies vary, then position and
  !> velocity of every coordinate, which x0 and v0 then change.
  pure function point_start(grid, index) result(start)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    real(wp) :: start(3 + size(grid%others))
    integer :: k
    start = [grid%start, grid%others]
    do k = 1, size(grid%start_axis)
      if (grid%start_axis(k) == 0) cycle
      if (k <= 3) then
        start(k) = start_value(grid, k, index)
      else
        start(4:) = start(4:) + start_value(grid, k, index)*grid%direction(:, k - 3)
      end if
    end do
  end function point_start

  !> The laws of a point's machine with the starts of further bodies in them; x0, v0 and the crank angle are not among them.
  pure function point_laws(grid, index) result(laws)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: index(:)
    type(law_choice_t), allocatable :: laws(:)
    integer :: k
    logical :: known
    laws = slice_laws(grid, point_slice(grid, index))
    do k = 4, size(grid%start_axis)
      call change_parameter(laws, grid%start_names(k), start_value(grid, k, index), known)
    end do
  end function point_laws

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
  subroutine slice_motion(grid, slice, moving, error)
    type(grid_t), intent(in) :: grid
    integer(int64), intent(in) :: slice
    class(machine_t), allocatable, intent(out) :: moving
    type(error_t), allocatable, intent(out) :: error
    call machine_of(slice_laws(grid, slice), grid%options, moving, error)
  end subroutine slice_motion

  !> Drive period of a slice's machine [s].
  subroutine slice_period(grid, slice, period, error)
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
  subroutine machine_with(grid, path, value, moving, error)
    type(grid_t), intent(in) :: grid
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: value
    class(machine_t), allocatable, intent(out) :: moving
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
  !> the start axes, shifted by `seed`; one start if no start is an axis; of starts that are drawn the first ones. Rows as
  !> `point_start` has them.
  pure function slice_starts(grid, count, seed) result(starts)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: count, seed
    real(wp), allocatable :: starts(:, :)
    ! Powers of 1/p for the root p of p^4 = p + 1.
    real(wp), parameter :: irrational(3) = [0.8191725133961645_wp, 0.6710436067037893_wp, &
                                            0.5497004779019703_wp]
    ! Square roots of these for further starts.
    integer, parameter :: primes(32) = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, &
                                        89, 97, 101, 103, 107, 109, 113, 127, 131]
    real(wp) :: low, high, step, value
    integer :: i, k, points
    points = merge(count, 1, any(grid%start_axis > 0))
    if (allocated(grid%drawn)) points = min(points, size(grid%drawn, 2))
    allocate (starts(3 + size(grid%others), points))
    starts = spread([grid%start, grid%others], 2, points)
    do k = 1, size(grid%start_axis)
      if (grid%start_axis(k) == 0) cycle
      low = minval(grid%axes(grid%start_axis(k))%values)
      high = maxval(grid%axes(grid%start_axis(k))%values)
      if (k <= 3) step = irrational(k)
      if (k > 3) step = modulo(sqrt(real(primes(modulo(k - 4, size(primes)) + 1), wp)), 1.0_wp)
      do i = 1, points
        value = low + (high - low)*modulo(0.5_wp + (i + seed*0.6180339887498949_wp)*step, 1.0_wp)
        if (grid%drawn_row(k) > 0) value = grid%drawn(grid%drawn_row(k), i)
        if (k <= 3) starts(k, i) = value
        if (k > 3) starts(4:, i) = starts(4:, i) + value*grid%direction(:, k - 3)
      end do
    end do
  end function slice_starts

end module grid
