! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Stable and unstable sets of a saddle on the section. Each side grows from the saddle level by level: the points of a level are
!> images of those of the level before under the map over the orbit's period, or, of a stable set, their preimages: what
!> Newton's method with the map's exact derivative finds beside the neighbour. No inverse of the machine is needed; where there
!> is none (sticking, completed chatter) the curve ends. Points are put in where neighbours are too far apart or the curve bends (D.
!> Hobson, J. Comput. Phys. 104 (1993)), at the level before first; what stays apart is a cut.
module invariant_sets
  use body_family, only: map_with_variation
  use kinds, only: wp
  use motion_state, only: tally_t
  use one_body, only: one_body_t
  use saddle_search, only: distance_to_saddle, saddle_t, section_distance
  use section_preimages, only: preimage_beside, scan_t, scan_window
  use variations, only: neighbourhood_t
  implicit none
  private

  public :: grow_set

  !> Why a curve is no longer.
  integer, parameter, public :: end_converged = 0, end_left = 1, end_no_preimage = 2, end_too_long = 3
  character(len=*), parameter, public :: end_names(0:3) = [character(len=12) :: 'converged', 'left_window', 'no_preimage', &
    'too_long']

  integer, parameter :: most_levels = 80, most_points = 6000
  !> Of natural sizes: distance from the saddle at which a set begins, and between neighbours.
  real(wp), parameter :: first_step = 1e-6_wp, spacing = 1e-2_wp
  !> Largest angle between neighbouring chords [rad] where these are longer than the share of the spacing; least step of the
  !> position.
  real(wp), parameter :: most_angle = 0.3_wp, straight = 0.1_wp, least_step = 1e-9_wp

  !> One side of a set.
  type, public :: set_t
    logical :: stable = .false.
    integer :: side = 1, ending = end_converged
    !> Columns x [m], v [m/s] at crank angle 0; the piece between cuts that each belongs to.
    real(wp), allocatable :: points(:, :)
    integer, allocatable :: piece(:)
  end type set_t

  !> A point of a level: its position 0 to 1 along the level; `there` is false where the map or its preimage is not to be had.
  type :: node_t
    real(wp) :: position = 0, y(2) = 0
    logical :: there = .true.
  end type node_t

  type :: level_t
    type(node_t), allocatable :: nodes(:)
  end type level_t

  !> What a set is grown with: base point, direction, growth until it comes to itself and the levels (drive periods) until then,
  !> window.
  type :: growth_t
    logical :: stable = .false.
    real(wp) :: origin(2) = 0, direction(2) = 0, factor = 1, low(2) = 0, high(2) = 0
    integer :: turns = 1
    type(scan_t) :: scan
  end type growth_t

contains

  !> One side (+1, -1) of the stable or unstable set of a saddle, within the window from `low` to `high` (x, v); of a longer
  !> orbit that of all its points.
  subroutine grow_set(machines, body, saddle, stable, side, low, high, set)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddle
    logical, intent(in) :: stable
    integer, intent(in) :: side
    real(wp), intent(in) :: low(2), high(2)
    type(set_t), intent(out) :: set
    type(growth_t) :: growth
    type(level_t), allocatable :: levels(:)
    integer :: k, total, last
    set%stable = stable
    set%side = side
    call set_growth(body, saddle, stable, side, low, high, growth)
    if (stable) call scan_window(machines, body, low, high, growth%scan)
    allocate (levels(0:most_levels*growth%turns))
    levels(0)%nodes = [base(growth, 0.0_wp), base(growth, 1.0_wp)]
    set%ending = end_too_long
    total = 0
    last = 0
    do k = 1, ubound(levels, 1)
      if (total > most_points) exit
      call next_level(machines, body, growth, saddle, levels, k)
      last = k
      total = total + size(levels(k)%nodes)
      if (.not. any(levels(k)%nodes%there)) then
        set%ending = end_no_preimage
        exit
      else if (.not. any(is_inside(growth, levels(k)%nodes))) then
        set%ending = end_left
        exit
      else if (.not. stable .and. k > 10*growth%turns .and. has_converged(body, saddle, levels(k)%nodes)) then
        set%ending = end_converged
        exit
      end if
    end do
    allocate (set%points(2, 0), set%piece(0))
    do k = 0, min(growth%turns - 1, last)
      call append_branch(body, growth, saddle, levels(:last), k, set)
    end do
  end subroutine grow_set

  !> Direction and growth at the saddle; with a negative multiplier a side comes to itself after two periods of the orbit.
  pure subroutine set_growth(body, saddle, stable, side, low, high, growth)
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddle
    logical, intent(in) :: stable
    integer, intent(in) :: side
    real(wp), intent(in) :: low(2), high(2)
    type(growth_t), intent(out) :: growth
    real(wp) :: root, first(2), second(2)
    root = real(saddle%multipliers(merge(2, 1, stable)), wp)
    associate (m => saddle%matrix)
      first = [m(1, 2), root - m(1, 1)]
      second = [root - m(2, 2), m(2, 1)]
    end associate
    if (norm2(second/body%size_of) > norm2(first/body%size_of)) first = second
    growth%stable = stable
    growth%origin = saddle%points(:, 1)
    growth%direction = side*first/norm2(first/body%size_of)
    growth%turns = saddle%periods
    if (root < 0) growth%turns = 2*saddle%periods
    growth%factor = abs(root)
    if (root < 0) growth%factor = root**2
    if (stable) growth%factor = 1/growth%factor
    growth%low = low
    growth%high = high
  end subroutine set_growth

  !> A point beside the saddle, along the eigenvector.
  pure type(node_t) function base(growth, position)
    type(growth_t), intent(in) :: growth
    real(wp), intent(in) :: position
    base = node_t(position=position, y=growth%origin + first_step*growth%factor**position*growth%direction)
  end function base

  pure elemental logical function is_inside(growth, node) result(inside)
    type(growth_t), intent(in) :: growth
    type(node_t), intent(in) :: node
    inside = node%there .and. all(node%y >= growth%low .and. node%y <= growth%high)
  end function is_inside

  !> The images of all points of the level before, and points between them.
  subroutine next_level(machines, body, growth, saddle, levels, k)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(saddle_t), intent(in) :: saddle
    type(level_t), intent(inout) :: levels(0:)
    integer, intent(in) :: k
    type(node_t) :: node, guess
    integer :: i
    logical :: again
    allocate (levels(k)%nodes(0))
    ! The curve goes on where it was so many levels ago.
    if (k < growth%turns) then
      guess%y = saddle%points(:, orbit_point(growth, saddle, k))
    else
      associate (before => levels(k - growth%turns)%nodes)
        guess = before(size(before))
        if (.not. guess%there) guess = levels(k - 1)%nodes(1)
      end associate
    end if
    do i = 1, size(levels(k - 1)%nodes)
      call map_node(machines, body, growth, levels(k - 1)%nodes(i), guess, node)
      levels(k)%nodes = [levels(k)%nodes, node]
      if (node%there) guess = node
    end do
    i = 1
    do while (i < size(levels(k)%nodes))
      if (size(levels(k)%nodes) >= most_points) return
      if (growth%stable .and. (levels(k)%nodes(i)%there .neqv. levels(k)%nodes(i + 1)%there)) then
        call retry(machines, body, growth, levels, k, i, again)
        if (again) i = max(1, i - 1)
        if (again) cycle
      end if
      if (.not. needs_middle(body, growth, levels(k)%nodes, i)) then
        i = i + 1
        cycle
      end if
      associate (nodes => levels(k)%nodes)
        node%position = nodes(i)%position + (nodes(i + 1)%position - nodes(i)%position)/2
        guess = merge_guess(nodes(i), nodes(i + 1))
      end associate
      call map_node(machines, body, growth, point_at(machines, body, growth, levels, k - 1, node%position), guess, node)
      levels(k)%nodes = [levels(k)%nodes(:i), node, levels(k)%nodes(i + 1:)]
    end do
  end subroutine next_level

  !> Of two neighbours the one that is missing, looked for beside the other. `found`: whether it is there now.
  subroutine retry(machines, body, growth, levels, k, i, found)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(level_t), intent(inout) :: levels(0:)
    integer, intent(in) :: k, i
    logical, intent(out) :: found
    type(node_t) :: from, node
    integer :: missing
    missing = merge(i + 1, i, levels(k)%nodes(i)%there)
    from = point_at(machines, body, growth, levels, k - 1, levels(k)%nodes(missing)%position)
    call map_node(machines, body, growth, from, levels(k)%nodes(2*i + 1 - missing), node)
    found = node%there
    if (found) levels(k)%nodes(missing) = node
  end subroutine retry

  !> The point of the orbit from which a level starts.
  pure integer function orbit_point(growth, saddle, k) result(point)
    type(growth_t), intent(in) :: growth
    type(saddle_t), intent(in) :: saddle
    integer, intent(in) :: k
    point = 1 + modulo(merge(-k, k, growth%stable), saddle%periods)
  end function orbit_point

  !> A guess between two neighbours.
  pure type(node_t) function merge_guess(one, other) result(guess)
    type(node_t), intent(in) :: one, other
    guess = one
    if (.not. one%there) guess = other
    if (one%there .and. other%there) guess%y = (one%y + other%y)/2
  end function merge_guess

  !> The point of a level at a position, computed through all levels below it, beside the neighbours there.
  recursive function point_at(machines, body, growth, levels, k, position) result(node)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(level_t), intent(in) :: levels(0:)
    integer, intent(in) :: k
    real(wp), intent(in) :: position
    type(node_t) :: node, below
    integer :: i
    if (k == 0) then
      node = base(growth, position)
      return
    end if
    i = count(levels(k)%nodes%position <= position)
    if (abs(levels(k)%nodes(i)%position - position) <= 0) then
      node = levels(k)%nodes(i)
      return
    end if
    below = point_at(machines, body, growth, levels, k - 1, position)
    call map_node(machines, body, growth, below, merge_guess(levels(k)%nodes(i), levels(k)%nodes(i + 1)), node)
  end function point_at

  !> Image of a point, or of a stable set its preimage near a guess. What has left the window is not followed.
  subroutine map_node(machines, body, growth, from, guess, node)
    type(neighbourhood_t), intent(in) :: machines
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(node_t), intent(in) :: from, guess
    type(node_t), intent(inout) :: node
    type(tally_t) :: tally
    real(wp) :: slopes(2, 2)
    node = node_t(position=from%position, y=from%y, there=.false.)
    if (.not. is_inside(growth, from)) return
    if (growth%stable) then
      call preimage_beside(machines, body, growth%scan, from%y, guess%y, node%y, node%there)
    else
      call map_with_variation(machines, from%y, 1, node%y, slopes, tally, node%there)
      ! The derivative is not needed here.
      node%there = tally%events > 0 .and. all(abs(node%y) < huge(1.0_wp))
    end if
  end subroutine map_node

  !> Whether a point is to be put in behind the i-th of a level.
  pure logical function needs_middle(body, growth, nodes, i) result(needs)
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(node_t), intent(in) :: nodes(:)
    integer, intent(in) :: i
    real(wp) :: length, one(2), other(2)
    needs = .false.
    if (nodes(i + 1)%position - nodes(i)%position < least_step) return
    if (.not. (nodes(i)%there .or. nodes(i + 1)%there)) return
    if (nodes(i)%there .neqv. nodes(i + 1)%there) then
      ! The end is located, more coarsely.
      needs = nodes(i + 1)%position - nodes(i)%position > 1e-4_wp
      return
    end if
    ! Beyond the window only the way out matters.
    if (.not. (is_inside(growth, nodes(i)) .or. is_inside(growth, nodes(i + 1)))) return
    length = section_distance(body, nodes(i)%y, nodes(i + 1)%y)
    needs = length > spacing
    if (needs .or. length < straight*spacing .or. i == 1) return
    if (.not. nodes(i - 1)%there) return
    one = (nodes(i)%y - nodes(i - 1)%y)/body%size_of
    other = (nodes(i + 1)%y - nodes(i)%y)/body%size_of
    if (.not. norm2(one) > 0) return
    needs = norm2(one/norm2(one) - other/norm2(other)) > most_angle
  end function needs_middle

  !> Whether a level is much shorter than the spacing, and has left the saddle: it has come to an attractor.
  pure logical function has_converged(body, saddle, nodes) result(converged)
    type(one_body_t), intent(in) :: body
    type(saddle_t), intent(in) :: saddle
    type(node_t), intent(in) :: nodes(:)
    real(wp) :: length
    integer :: i
    converged = distance_to_saddle(body, saddle, nodes(1)%y) > spacing
    if (.not. converged) return
    length = 0
    do i = 1, size(nodes) - 1
      length = length + section_distance(body, nodes(i)%y, nodes(i + 1)%y)
    end do
    converged = length < straight*spacing
  end function has_converged

  !> Appends the curve of every `turns`-th level from the first-th on, from its point of the orbit. A new piece begins where
  !> neighbours are apart.
  pure subroutine append_branch(body, growth, saddle, levels, first, set)
    type(one_body_t), intent(in) :: body
    type(growth_t), intent(in) :: growth
    type(saddle_t), intent(in) :: saddle
    type(level_t), intent(in) :: levels(0:)
    integer, intent(in) :: first
    type(set_t), intent(inout) :: set
    real(wp), allocatable :: points(:, :)
    integer, allocatable :: piece(:)
    real(wp) :: last(2)
    integer :: k, i, count, number
    logical :: joined
    allocate (points(2, 1 + sum([(size(levels(k)%nodes), k=first, ubound(levels, 1), growth%turns)])))
    allocate (piece(size(points, 2)))
    number = 1 + maxval([0, set%piece])
    last = saddle%points(:, orbit_point(growth, saddle, first))
    points(:, 1) = last
    piece(1) = number
    count = 1
    do k = first, ubound(levels, 1), growth%turns
      joined = .true.
      do i = 1, size(levels(k)%nodes)
        associate (node => levels(k)%nodes(i))
          joined = joined .and. is_inside(growth, node)
          if (.not. is_inside(growth, node)) cycle
          if (.not. joined .or. section_distance(body, last, node%y) > 2*spacing) number = number + 1
          joined = .true.
          last = node%y
          count = count + 1
          points(:, count) = last
          piece(count) = number
        end associate
      end do
    end do
    set%points = reshape([set%points, points(:, :count)], [2, size(set%points, 2) + count])
    set%piece = [set%piece, piece(:count)]
  end subroutine append_branch

end module invariant_sets
