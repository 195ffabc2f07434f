! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> From a case to what the numerics take.
module case_setup
  use axis, only: axis_t, linear_values
  use case_type, only: case_t
  use grid, only: grid_t, make_grid, sample_axis, two_axes
  use kinds, only: int64, wp
  use lane_gpu, only: gpu_in_use
  use lane_types, only: widest_lanes
  use motion_state, only: flight_adaptive, flight_auto, flight_exact, options_t
  use refinement, only: refine_t
  use text, only: parse_integer
  use single_trajectory, only: span_t
  implicit none
  private

  public :: options_of, span_of, grid_of, output_path, points_of_tile, automatic_tile, sweep_axes, tile_of_blocks

  !> Doubles per vector, to try a narrower kernel than the processor allows (2, 4, 8). The results are the same.
  character(len=*), parameter :: width_variable = 'SEPARATRIX_LANE_WIDTH'

  !> Most tiles of a grid where the case leaves their shape open.
  real(wp), parameter :: most_tiles = 2.0_wp**20

contains

  !> Integrator options of a case.
  function options_of(the_case) result(options)
    type(case_t), intent(in) :: the_case
    type(options_t) :: options
    select case (the_case%integrator%flight)
    case ('exact')
      options%flight = flight_exact
    case ('adaptive')
      options%flight = flight_adaptive
    case default
      options%flight = flight_auto
    end select
    options%tolerance = the_case%integrator%tolerance
    options%event_budget = int(the_case%integrator%event_budget, int64)
    options%step_budget = int(the_case%integrator%step_budget, int64)
    options%domain = the_case%run%domain
    if (the_case%integrator%lanes == 'auto') options%lane_width = lane_width()
    options%gpu = gpu_in_use
  end function options_of

  !> The widest vectors of this processor, or what the environment asks for if that is narrower.
  integer function lane_width()
    character(len=16) :: text
    integer :: asked, status
    lane_width = widest_lanes()
    call get_environment_variable(width_variable, text, status=status)
    if (status /= 0) return
    call parse_integer(trim(text), asked, status)
    if (status == 0 .and. asked > 0) lane_width = min(lane_width, asked)
  end function lane_width

  !> Length and window of the trajectories of a case.
  pure function span_of(the_case) result(span)
    type(case_t), intent(in) :: the_case
    type(span_t) :: span
    span%duration = the_case%run%duration
    span%window = the_case%run%window
    span%whole_periods = the_case%run%average == 'whole_periods'
    span%extension = the_case%run%extension
    span%stop_when_converged = the_case%run%stop == 'captured'
  end function span_of

  !> The grid of a case over `axes`.
  function grid_of(the_case, axes) result(grid)
    type(case_t), intent(in) :: the_case
    type(axis_t), intent(in) :: axes(:)
    type(grid_t) :: grid
    associate (start => [the_case%start%x0, the_case%start%v0, the_case%start%crank_angle], sample => the_case%sample)
      if (any(axes%name == sample_axis)) then
        grid = make_grid(axes, the_case%laws, start, options_of(the_case), sample%names, sample%drawn)
      else
        grid = make_grid(axes, the_case%laws, start, options_of(the_case))
      end if
    end associate
    if (allocated(the_case%derived)) grid%derived = the_case%derived
  end function grid_of

  !> Where the output of a command goes: as asked, or the name of the case without its folder, with .COMMAND.h5.
  pure function output_path(asked, case_path, command) result(path)
    character(len=*), intent(in) :: asked, case_path, command
    character(len=:), allocatable :: path
    if (len(asked) > 0) then
      path = asked
      return
    end if
    path = case_path(index(case_path, '/', back=.true.) + 1:)
    if (len(path) > 5) then
      if (path(len(path) - 4:) == '.toml') path = path(:len(path) - 5)
    end if
    path = path//'.'//command//'.h5'
  end function output_path

  !> Points of a tile where none are given: about a thousand; where every rank has a GPU, up to a million, as a tile is all that a
  !> GPU can do at once, but some tiles for every rank.
  pure integer function points_of_tile(points, ranks, gpus)
    integer(int64), intent(in) :: points
    integer, intent(in) :: ranks, gpus
    points_of_tile = 1024
    if (gpus == ranks) points_of_tile = int(max(1024_int64, min(2_int64**20, points/(4*ranks))))
  end function points_of_tile

  !> Tile shape where the case leaves it open: about so many `points` of one slice, more on a grid that would have
  !> more than `most_tiles`, because every rank keeps a list of the tiles.
  pure function automatic_tile(grid, asked, points) result(tile)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: asked(:), points
    integer :: tile(size(grid%shape))
    logical :: free(size(grid%shape))
    integer :: i, starts
    starts = count([(any(grid%start_axis == i), i=1, size(tile))])
    do i = 1, size(tile)
      free(i) = any(grid%start_axis == i) .or. starts == 0
      if (any(grid%start_axis == i)) then
        tile(i) = max(1, nint(real(points, wp)**(1.0_wp/starts)))
      else if (starts == 0) then
        tile(i) = max(1, nint(64.0_wp**(1.0_wp/size(tile))))
      else
        tile(i) = 1
      end if
      if (i <= size(asked)) then
        if (asked(i) > 0) then
          tile(i) = asked(i)
          free(i) = .false.
        end if
      end if
      tile(i) = min(tile(i), grid%shape(i))
    end do
    do while (product(ceiling(real(grid%shape, wp)/tile)*1.0_wp) > most_tiles)
      free = free .and. tile < grid%shape
      if (.not. any(free)) exit
      i = minloc(tile, dim=1, mask=free)
      tile(i) = min(2*tile(i), grid%shape(i))
    end do
  end function automatic_tile

  !> Tile shape of a refined map: whole blocks, one unless more are asked for.
  pure function tile_of_blocks(grid, refine, asked) result(tile)
    type(grid_t), intent(in) :: grid
    type(refine_t), intent(in) :: refine
    integer, intent(in) :: asked(:)
    integer :: tile(size(grid%shape)), axes(2)
    tile = 1
    tile(:size(asked)) = max(1, asked)
    axes = two_axes(grid)
    tile(axes) = (tile(axes) + refine%block - 1)/refine%block*refine%block
    tile = min(tile, grid%shape)
  end function tile_of_blocks

  !> The axes of the many starts: the swept parameter, x0, v0.
  function sweep_axes(the_case) result(axes)
    type(case_t), intent(in) :: the_case
    type(axis_t) :: axes(3)
    associate (sweep => the_case%sweep)
      axes(1) = sweep%swept
      axes(2) = axis_t('x0', 'm', linear_values(sweep%x0(1), sweep%x0(2), sweep%starts(1)))
      axes(3) = axis_t('v0', 'm/s', linear_values(sweep%v0(1), sweep%v0(2), sweep%starts(2)))
    end associate
  end function sweep_axes

end module case_setup
