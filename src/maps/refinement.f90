! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which points of a map are computed and which are inferred: one square block at a time, a pure function of the settings, the
!> position of the block and the values asked for. The caller computes the points of `next_points`, passes them to `learn_points`,
!> and once no more are wanted takes the whole block out with `block_content`. docs/theory.md states what can be missed.
module refinement
  use kinds, only: int64, wp
  use random, only: uniform
  implicit none
  private

  public :: automatic_block, open_block, next_points, learn_points, block_content, probes_drawn, wrong_share_factor

  !> What the settings may be.
  integer, parameter, public :: largest_step = 256, largest_block = 2048, most_probes = 256

  type, public :: refine_t
    logical :: active = .false.
    !> Points from one line of the coarse lattice to the next, and points of a side of a block, a multiple of them; 0 =
    !> automatic.
    integer :: step = 16, block = 0
    !> A cell with a longer side than `contrast_side` points is also divided where settling takes longer at one of its
    !> points than at another by more than `contrast` [drive periods].
    real(wp) :: contrast = 1.5_wp
    integer :: contrast_side = 4
    !> Random points per cell of the coarse lattice that are computed to look for what was missed.
    integer :: probes = 1
    integer :: seed = 1
  end type refine_t

  !> Where the values of a point come from: computed; a probe that found what had been inferred; one that found
  !> something else; inferred from the corners of a cell with sides of at most 2, 4, ... 256 points.
  integer, parameter, public :: origin_computed = 0, origin_agreed = 1, origin_contradicted = 2, last_origin = 10
  character(len=*), parameter, public :: origin_names(0:last_origin) = [character(len=18) :: 'computed', 'probe_agreed', &
    'probe_contradicted', 'inferred_2', 'inferred_4', 'inferred_8', 'inferred_16', 'inferred_32', 'inferred_64', &
    'inferred_128', 'inferred_256']

  !> Kind of a point that is not known.
  integer, parameter :: unknown = huge(1)

  !> An automatic block has a side of so many steps, or fewer where it would be longer than so many points or the map
  !> would have too few blocks to share out.
  integer, parameter :: most_steps = 32, fewest_steps = 4, long_side = 512, enough_blocks = 64

  !> What a block asks for next. The repair goes on dividing with what the probes found.
  integer, parameter :: stage_lattice = 0, stage_division = 1, stage_probes = 2, stage_repair = 3

  type, public :: block_t
    type(refine_t) :: settings
    !> First and last point of the block, and of it with the first lines of the blocks behind it.
    integer :: own(2, 2) = 0, region(2, 2) = 0
    !> Sides of the region beyond which the map goes on.
    logical :: framed(2, 2) = .false.
    !> The probes of the map's cells have numbers of their own: that of the first cell, and cells along the second axis.
    integer(int64) :: first_cell = 0, cells_along = 0
    !> Kinds of points found so far: (values, kinds).
    real(wp), allocatable :: kinds_found(:, :)
    !> Over the region: kind, or `unknown`; settling time; origin.
    integer, allocatable :: kind(:, :), origin(:, :)
    real(wp), allocatable :: settling(:, :)
    !> Undivided cells: first and last point along the first and the second axis.
    integer, allocatable :: cells(:, :)
    integer :: stage = stage_lattice
    !> Kinds that were inferred where probes are under way.
    integer, allocatable :: expected(:)
  end type block_t

contains

  !> Side of a block where the settings leave it open: long, because the lines between blocks are computed.
  pure integer function automatic_block(settings, lengths, layers) result(side)
    type(refine_t), intent(in) :: settings
    integer, intent(in) :: lengths(2)
    integer(int64), intent(in) :: layers
    integer :: steps
    side = settings%block
    if (side > 0) return
    steps = most_steps
    do
      side = steps*settings%step
      if (steps == fewest_steps) return
      if (side <= long_side .and. layers*product((int(lengths, int64) - 1)/side + 1) >= enough_blocks) return
      steps = steps/2
    end do
  end function automatic_block

  !> A block that begins at `lower` (from 0, a multiple of its side) of a map of `lengths` points. `layer` (from 0)
  !> numbers maps that lie above each other along further axes.
  pure subroutine open_block(settings, lengths, lower, layer, block)
    type(refine_t), intent(in) :: settings
    integer, intent(in) :: lengths(2), lower(2)
    integer(int64), intent(in) :: layer
    type(block_t), intent(out) :: block
    block%settings = settings
    block%own(1, :) = lower
    block%own(2, :) = min(lower + settings%block, lengths) - 1
    block%region(1, :) = lower
    block%region(2, :) = min(lower + settings%block, lengths - 1)
    block%framed(1, :) = lower > 0
    block%framed(2, :) = lower + settings%block < lengths
    block%cells_along = (lengths(2) - 1)/settings%step + 1
    block%first_cell = layer*cells_of(settings, lengths)
    associate (first => block%region(1, :), last => block%region(2, :))
      allocate (block%kind(first(1):last(1), first(2):last(2)), source=unknown)
      allocate (block%origin(first(1):last(1), first(2):last(2)), source=origin_computed)
      allocate (block%settling(first(1):last(1), first(2):last(2)), source=0.0_wp)
    end associate
    allocate (block%cells(4, 0))
  end subroutine open_block

  !> Cells of the coarse lattice of one map.
  pure integer(int64) function cells_of(settings, lengths)
    type(refine_t), intent(in) :: settings
    integer, intent(in) :: lengths(2)
    cells_of = product((int(lengths, int64) - 1)/settings%step + 1)
  end function cells_of

  !> Random points drawn over all `layers` of a map.
  pure integer(int64) function probes_drawn(settings, lengths, layers)
    type(refine_t), intent(in) :: settings
    integer, intent(in) :: lengths(2)
    integer(int64), intent(in) :: layers
    probes_drawn = settings%probes*layers*cells_of(settings, lengths)
  end function probes_drawn

  !> The upper limit of a share of the probes drawn, times this, is one of the share of the map's points: cells reach beyond
  !> the last point of an axis, and so do the probes drawn.
  pure real(wp) function wrong_share_factor(settings, lengths)
    type(refine_t), intent(in) :: settings
    integer, intent(in) :: lengths(2)
    wrong_share_factor = real(cells_of(settings, lengths), wp)*settings%step**2/product(real(lengths, wp))
  end function wrong_share_factor

  !> The points (2, points), from 0, whose values the block needs next; none when it is done.
  pure subroutine next_points(block, points)
    type(block_t), intent(inout) :: block
    integer, allocatable, intent(out) :: points(:, :)
    logical, allocatable :: wanted(:, :)
    integer :: first(2)
    logical :: divided
    associate (region => block%region)
      allocate (wanted(region(1, 1):region(2, 1), region(1, 2):region(2, 2)), source=.false.)
    end associate
    if (block%stage == stage_lattice) then
      call lay_lattice(block, wanted)
      block%stage = stage_division
    else
      do
        call divide_cells(block, wanted, divided)
        if (any(wanted)) exit
        if (divided) cycle
        if (block%stage == stage_repair) exit
        call draw_probes(block, wanted)
        block%stage = merge(stage_probes, stage_repair, any(wanted))
        exit
      end do
    end if
    first = block%region(1, :)
    points = list_of(wanted, first)
    if (block%stage == stage_probes) block%expected = inferred_kinds(block, points)
  end subroutine next_points

  !> Takes the values (points, values) that distinguish kinds of points, and the settling times [drive periods] of the points that
  !> `next_points` wanted.
  pure subroutine learn_points(block, points, values, settling)
    type(block_t), intent(inout) :: block
    integer, intent(in) :: points(:, :)
    real(wp), intent(in) :: values(:, :), settling(:)
    integer :: i, kind
    do i = 1, size(points, 2)
      associate (a => points(1, i), b => points(2, i))
        call find_kind(block, values(i, :), kind)
        block%kind(a, b) = kind
        block%settling(a, b) = settling(i)
        if (block%stage == stage_probes) block%origin(a, b) = &
          merge(origin_agreed, origin_contradicted, kind == block%expected(i))
      end associate
    end do
    if (block%stage == stage_probes) block%stage = stage_repair
  end subroutine learn_points

  !> The values (points, values) of all points of a block that is done, the last axis fastest, and their origins.
  pure subroutine block_content(block, values, origin)
    type(block_t), intent(in) :: block
    real(wp), intent(out) :: values(:, :)
    integer, intent(out) :: origin(:)
    integer, allocatable :: kind(:, :), origins(:, :)
    integer :: a, b, point
    call infer(block, kind, origins)
    point = 0
    do a = block%own(1, 1), block%own(2, 1)
      do b = block%own(1, 2), block%own(2, 2)
        point = point + 1
        values(point, :) = block%kinds_found(:, kind(a, b))
        origin(point) = origins(a, b)
      end do
    end do
  end subroutine block_content

  !> Lines of the lattice are those of the whole map: multiples of the step, and the last point of an axis.
  pure subroutine lay_lattice(block, wanted)
    type(block_t), intent(inout) :: block
    logical, intent(inout), allocatable :: wanted(:, :)
    integer, allocatable :: along(:), across(:)
    integer :: i, j
    along = lines(block%region(:, 1), block%settings%step)
    across = lines(block%region(:, 2), block%settings%step)
    wanted(along, across) = .true.
    ! Two blocks know the whole line between them, so that no boundary crosses it unseen.
    associate (first => block%region(1, :), last => block%region(2, :), framed => block%framed)
      if (framed(1, 1)) wanted(first(1), :) = .true.
      if (framed(2, 1)) wanted(last(1), :) = .true.
      if (framed(1, 2)) wanted(:, first(2)) = .true.
      if (framed(2, 2)) wanted(:, last(2)) = .true.
    end associate
    ! An axis of one point has cells without width.
    if (size(along) == 1) along = [along, along]
    if (size(across) == 1) across = [across, across]
    block%cells = reshape([((along(i), along(i + 1), across(j), across(j + 1), &
                             i=1, size(along) - 1), j=1, size(across) - 1)], &
                          [4, (size(along) - 1)*(size(across) - 1)])
  end subroutine lay_lattice

  pure function lines(range, step)
    integer, intent(in) :: range(2), step
    integer, allocatable :: lines(:)
    integer :: i
    lines = [(i, i=range(1), range(2), step)]
    if (lines(size(lines)) < range(2)) lines = [lines, range(2)]
  end function lines

  !> Halves each side of every cell that is not uniform, and requests the new corners that are not known.
  pure subroutine divide_cells(block, wanted, divided)
    type(block_t), intent(inout) :: block
    logical, intent(inout), allocatable :: wanted(:, :)
    logical, intent(out) :: divided
    integer, allocatable :: cells(:, :), along(:), across(:)
    integer :: c, i, j, count
    allocate (cells(4, 4*size(block%cells, 2)))
    count = 0
    divided = .false.
    do c = 1, size(block%cells, 2)
      associate (cell => block%cells(:, c))
        if (is_uniform(block, cell)) then
          count = count + 1
          cells(:, count) = cell
          cycle
        end if
        divided = .true.
        along = halves(cell(1:2))
        across = halves(cell(3:4))
      end associate
      do j = 1, size(across) - 1
        do i = 1, size(along) - 1
          count = count + 1
          cells(:, count) = [along(i:i + 1), across(j:j + 1)]
        end do
      end do
      do j = 1, size(across)
        do i = 1, size(along)
          if (block%kind(along(i), across(j)) == unknown) wanted(along(i), across(j)) = .true.
        end do
      end do
    end do
    block%cells = cells(:, :count)
  end subroutine divide_cells

  pure function halves(side)
    integer, intent(in) :: side(2)
    integer, allocatable :: halves(:)
    if (side(2) - side(1) > 1) then
      halves = [side(1), (side(1) + side(2))/2, side(2)]
    else
      halves = side
    end if
  end function halves

  !> Whether all known points of a cell, its edge included, are of one kind and settle about equally fast; or it has no
  !> points but its corners.
  pure logical function is_uniform(block, cell)
    type(block_t), intent(in) :: block
    integer, intent(in) :: cell(4)
    real(wp) :: fastest, slowest
    integer :: a, b
    is_uniform = cell(2) - cell(1) <= 1 .and. cell(4) - cell(3) <= 1
    if (is_uniform) return
    fastest = block%settling(cell(1), cell(3))
    slowest = fastest
    do b = cell(3), cell(4)
      do a = cell(1), cell(2)
        if (block%kind(a, b) == unknown) cycle
        if (block%kind(a, b) /= block%kind(cell(1), cell(3))) return
        fastest = min(fastest, block%settling(a, b))
        slowest = max(slowest, block%settling(a, b))
      end do
    end do
    is_uniform = slowest - fastest <= block%settings%contrast .or. &
                 max(cell(2) - cell(1), cell(4) - cell(3)) <= block%settings%contrast_side
  end function is_uniform

  !> The probes of the cells of the coarse lattice, uniform over the cell. What is known already, or lies beyond the map,
  !> needs no probe.
  pure subroutine draw_probes(block, wanted)
    type(block_t), intent(in) :: block
    logical, intent(inout), allocatable :: wanted(:, :)
    real(wp) :: numbers(2*block%settings%probes)
    integer :: i, j, k, point(2)
    associate (step => block%settings%step, seed => int(block%settings%seed, int64), region => block%region)
      do i = region(1, 1)/step, region(2, 1)/step
        do j = region(1, 2)/step, region(2, 2)/step
          call uniform(seed, block%first_cell + i*block%cells_along + j, numbers)
          do k = 1, block%settings%probes
            point = [i, j]*step + int(numbers(2*k - 1:2*k)*step)
            if (any(point > region(2, :))) cycle
            if (block%kind(point(1), point(2)) == unknown) wanted(point(1), point(2)) = .true.
          end do
        end do
      end do
    end associate
  end subroutine draw_probes

  pure function list_of(wanted, first) result(points)
    logical, intent(in) :: wanted(:, :)
    integer, intent(in) :: first(2)
    integer, allocatable :: points(:, :)
    integer :: a, b, n
    allocate (points(2, count(wanted)))
    n = 0
    do a = 1, size(wanted, 1)
      do b = 1, size(wanted, 2)
        if (.not. wanted(a, b)) cycle
        n = n + 1
        points(:, n) = first + [a, b] - 1
      end do
    end do
  end function list_of

  pure function inferred_kinds(block, points) result(kinds)
    type(block_t), intent(in) :: block
    integer, intent(in) :: points(:, :)
    integer, allocatable :: kinds(:)
    integer, allocatable :: kind(:, :), origin(:, :)
    integer :: i
    call infer(block, kind, origin)
    kinds = [(kind(points(1, i), points(2, i)), i=1, size(points, 2))]
  end function inferred_kinds

  !> Kind and origin of every point of the region: what is not known is as the corners of its cell.
  pure subroutine infer(block, kind, origin)
    type(block_t), intent(in) :: block
    integer, allocatable, intent(out) :: kind(:, :), origin(:, :)
    integer :: a, b, c, level
    kind = block%kind
    origin = block%origin
    do c = 1, size(block%cells, 2)
      associate (cell => block%cells(:, c))
        level = origin_contradicted + ceiling_of_logarithm(max(cell(2) - cell(1), cell(4) - cell(3)))
        do b = cell(3), cell(4)
          do a = cell(1), cell(2)
            if (block%kind(a, b) /= unknown) cycle
            ! On the edge of two cells the smaller one speaks.
            if (kind(a, b) == unknown .or. level < origin(a, b)) origin(a, b) = level
            kind(a, b) = block%kind(cell(1), cell(3))
          end do
        end do
      end associate
    end do
  end subroutine infer

  !> Least n with 2^n >= `number`.
  pure integer function ceiling_of_logarithm(number) result(n)
    integer, intent(in) :: number
    n = 0
    do while (2**n < number)
      n = n + 1
    end do
  end function ceiling_of_logarithm

  !> The number of the kind with these values; a new one if there is none.
  pure subroutine find_kind(block, values, kind)
    type(block_t), intent(inout) :: block
    real(wp), intent(in) :: values(:)
    integer, intent(out) :: kind
    real(wp), allocatable :: longer(:, :)
    if (.not. allocated(block%kinds_found)) allocate (block%kinds_found(size(values), 0))
    do kind = 1, size(block%kinds_found, 2)
      if (all(abs(block%kinds_found(:, kind) - values) <= 0)) return
    end do
    allocate (longer(size(values), kind))
    longer(:, :kind - 1) = block%kinds_found
    longer(:, kind) = values
    call move_alloc(longer, block%kinds_found)
  end subroutine find_kind

end module refinement
