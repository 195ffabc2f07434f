! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The file of `separatrix boundary`.
module boundary_layout
  use boundary_lines, only: line_point_t, line_t
  use boundary_names, only: names_t
  use boundary_pieces, only: cut_lines
  use boundary_search, only: plane_t
  use edge_state, only: edge_names
  use errors, only: error_t
  use file_layout, only: axis_dimension
  use grid, only: grid_t
  use invariant_sets, only: end_names
  use kinds, only: int64, wp
  use map_reader, only: reader_t
  use map_schema, only: name_length, schema_t, type_float64, type_int16, type_int32, &
    type_int64, type_int8
  use saddle_search, only: saddle_t
  use text, only: join
  implicit none
  private

  public :: describe_boundary

  character(len=*), parameter :: group = 'saddles', set_group = 'sets'

  type :: piece_t
    integer :: first = 0, points = 0, labels(2) = 0, closed = 0, edge = 0, saddle = 0
  end type piece_t

  !> Points of the pieces one after the other with their names, pieces, and the plane of each.
  type :: table_t
    type(line_point_t), allocatable :: points(:)
    integer, allocatable :: edge(:), saddle(:), plane(:)
    type(piece_t), allocatable :: pieces(:)
  end type table_t

contains

  !> Attributes and variables: points of the pieces one after the other, the pieces, and the saddles.
  subroutine describe_boundary(reader, grid, planes, names, schema, error)
    type(reader_t), intent(in) :: reader
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: planes(:)
    type(names_t), intent(in) :: names(:)
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(table_t) :: table
    character(len=:), allocatable :: identity
    integer :: p, i, before
    call reader%text_attribute('/provenance', 'case_identity', identity, error)
    if (allocated(error)) return
    allocate (table%points(0), table%edge(0), table%saddle(0), table%pieces(0), table%plane(0))
    before = 0
    do p = 1, size(planes)
      call add_plane(planes(p), names(p), p, before, table)
      before = before + size(names(p)%saddles)
    end do
    call schema%add_attribute('', 'map', reader%path(index(reader%path, '/', back=.true.) + 1:))
    call schema%add_attribute('', 'map_identity', identity)
    call schema%add_attribute('', 'axes', axis_dimension(grid%axes(planes(1)%axes(1))%name)//' '// &
                              axis_dimension(grid%axes(planes(1)%axes(2))%name))
    call schema%add_dimension('point', size(table%points, kind=int64))
    call schema%add_dimension('piece', size(table%pieces, kind=int64))
    call add_points(grid, planes(1)%axes, table%points, schema)
    call add_names('name', 'saddle', 'point', table%edge, table%saddle, schema)
    call add_pieces(table%pieces, schema)
    call add_names('piece_name', 'piece_saddle', 'piece', table%pieces%edge, table%pieces%saddle, schema)
    do i = 1, size(grid%axes)
      if (any(planes(1)%axes == i)) cycle
      call schema%add_variable('piece_'//axis_dimension(grid%axes(i)%name), type_float64, ['piece'], &
        units=grid%axes(i)%unit, long_name=trim(grid%axes(i)%name)//' of the piece', &
        data=[(grid%axes(i)%values(planes(table%plane(p))%index(i)), p=1, size(table%plane))])
    end do
    call add_saddles(grid, planes, names, schema)
    call add_sets(names, schema)
    call copy_second_look(reader, schema, error)
  end subroutine describe_boundary

  !> From where the map searched attractors again: without it `verify` could not.
  subroutine copy_second_look(reader, schema, error)
    type(reader_t), intent(in) :: reader
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer(int64), allocatable :: lengths(:)
    if (.not. reader%has('/second_look/start')) return
    call reader%read_values('/second_look/start', values, error)
    if (.not. allocated(error)) call reader%lengths('/second_look/start', lengths, error)
    if (allocated(error)) return
    call schema%add_dimension('look', lengths(1))
    call schema%add_dimension('look_column', lengths(2))
    call schema%add_variable('start', type_int64, [character(len=name_length) :: 'look', 'look_column'], units='1', &
      group='second_look', long_name='as in the map: points from which attractors were searched again', data=values)
  end subroutine copy_second_look

  !> Adds the pieces of a plane to the table; `before` saddles belong to the planes before it.
  pure subroutine add_plane(plane, names, number, before, table)
    type(plane_t), intent(in) :: plane
    type(names_t), intent(in) :: names
    integer, intent(in) :: number, before
    type(table_t), intent(inout) :: table
    type(line_t), allocatable :: lines(:)
    type(piece_t), allocatable :: pieces(:)
    integer, allocatable :: named(:), points(:)
    integer :: l, i, total
    call cut_lines(names, plane%lines, lines, named)
    allocate (pieces(size(lines)), points(sum([(size(lines(l)%points), l=1, size(lines))])))
    total = size(table%points)
    i = 0
    do l = 1, size(lines)
      associate (own => lines(l)%points)
        pieces(l) = piece_t(first=total + i, points=size(own), labels=lines(l)%labels, closed=merge(1, 0, lines(l)%closed), &
                            edge=names%edge(named(l)), saddle=renumbered(names%saddle(named(l)), before))
        points(i + 1:i + size(own)) = own
        i = i + size(own)
      end associate
    end do
    table%points = [table%points, plane%points(points)]
    table%edge = [table%edge, names%edge(points)]
    table%saddle = [table%saddle, renumbered(names%saddle(points), before)]
    table%pieces = [table%pieces, pieces]
    table%plane = [table%plane, spread(number, 1, size(pieces))]
  end subroutine add_plane

  pure elemental integer function renumbered(saddle, before)
    integer, intent(in) :: saddle, before
    renumbered = merge(saddle + before, 0, saddle > 0)
  end function renumbered

  subroutine add_names(name, saddle, dimension, edges, saddles, schema)
    character(len=*), intent(in) :: name, saddle, dimension
    integer, intent(in) :: edges(:), saddles(:)
    type(schema_t), intent(inout) :: schema
    integer :: i
    call schema%add_variable(name, type_int8, [dimension], units='1', flag_values=[(i, i=0, ubound(edge_names, 1))], &
                             flag_meanings=join(edge_names, ' '), data=real(edges, wp), &
                             long_name='what the boundary leads to')
    call schema%add_variable(saddle, type_int32, [dimension], units='1', data=real(saddles, wp), &
                             long_name='number of the saddle of whose stable set it is part, from 1; 0 of none')
  end subroutine add_names

  !> The saddles of all planes, and their points on the section one after the other.
  subroutine add_saddles(grid, planes, names, schema)
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: planes(:)
    type(names_t), intent(in) :: names(:)
    type(schema_t), intent(inout) :: schema
    type(saddle_t), allocatable :: saddles(:)
    integer, allocatable :: plane(:), reached(:)
    character(len=name_length) :: along(1)
    integer :: p, k, i, n
    allocate (saddles(0), plane(0), reached(0))
    do p = 1, size(planes)
      saddles = [saddles, names(p)%saddles]
      plane = [plane, spread(p, 1, size(names(p)%saddles))]
      reached = [reached, names(p)%reached]
    end do
    n = 2
    if (size(saddles) > 0) n = size(saddles(1)%multipliers)
    call schema%add_dimension('orbit', size(saddles, kind=int64))
    call schema%add_dimension('multiplier', int(n, int64))
    call schema%add_dimension('section_point', int(sum(saddles%periods), int64))
    along = 'orbit'
    call schema%add_variable('period', type_int16, along, units='1', long_name='period in drive periods', group=group, &
                             data=real(saddles%periods, wp))
    call schema%add_variable('event_word', type_float64, along, units='1', group=group, data=real(saddles%word, wp), &
                             long_name='events of one period of the orbit, three bits each')
    call schema%add_variable('boundary_points', type_int32, along, units='1', group=group, data=real(reached, wp), &
                             long_name='boundary points that lead to it; 0: it lies within one basin, or beyond the map')
    call schema%add_variable('multipliers', type_float64, [along, [character(len=name_length) :: 'multiplier']], units='1', &
      long_name='multipliers over the period, largest modulus first, real part', group=group, &
      data=[((real(saddles(k)%multipliers(i), wp), i=1, n), k=1, size(saddles))])
    call schema%add_variable('multipliers_imag', type_float64, [along, [character(len=name_length) :: 'multiplier']], units='1', &
      long_name='multipliers over the period, imaginary part', group=group, &
      data=[((aimag(saddles(k)%multipliers(i)), i=1, n), k=1, size(saddles))])
    do i = 1, size(grid%axes)
      if (any(planes(1)%axes == i)) cycle
      call schema%add_variable(axis_dimension(grid%axes(i)%name), type_float64, along, units=grid%axes(i)%unit, group=group, &
        long_name=trim(grid%axes(i)%name)//' of the machine', data=[(grid%axes(i)%values(planes(plane(k))%index(i)), &
                                                                     k=1, size(saddles))])
    end do
    along = 'section_point'
    call schema%add_variable('saddle', type_int32, along, units='1', group=group, long_name='number of the saddle, from 1', &
                             data=[((real(k, wp), i=1, saddles(k)%periods), k=1, size(saddles))])
    call schema%add_variable('x', type_float64, along, units='m', group=group, &
                             data=[(saddles(k)%watched(1, :), k=1, size(saddles))], &
                             long_name='position on the section, period by period')
    call schema%add_variable('v', type_float64, along, units='m/s', group=group, &
                             data=[(saddles(k)%watched(2, :), k=1, size(saddles))], long_name='velocity on the section')
    if (n == 2) return
    call schema%add_dimension('coordinate', int(n, int64))
    call schema%add_variable('section', type_float64, [along, [character(len=name_length) :: 'coordinate']], units='SI', &
      long_name='coordinates on the section in SI units: positions [m], then speeds [m/s] of all bodies', group=group, &
      data=[((saddles(k)%points(:, i), i=1, saddles(k)%periods), k=1, size(saddles))])
  end subroutine add_saddles

  !> The curves of the stable and unstable sets, cut where they are, one after the other.
  subroutine add_sets(names, schema)
    type(names_t), intent(in) :: names(:)
    type(schema_t), intent(inout) :: schema
    character(len=name_length) :: along(1)
    real(wp), allocatable :: points(:, :)
    integer, allocatable :: saddle(:), stable(:), side(:), ending(:), piece(:), curve(:)
    integer :: p, k, before, curves
    allocate (points(2, 0), saddle(0), stable(0), side(0), ending(0), piece(0), curve(0))
    before = 0
    curves = 0
    do p = 1, size(names)
      do k = 1, size(names(p)%sets)
        associate (set => names(p)%sets(k))
          points = reshape([points, set%points], [2, size(points, 2) + size(set%points, 2)])
          curve = [curve, spread(curves, 1, size(set%piece))]
          piece = [piece, set%piece]
          saddle = [saddle, names(p)%saddle_of_set(k) + before]
          stable = [stable, merge(1, 0, set%stable)]
          side = [side, set%side]
          ending = [ending, set%ending]
          curves = curves + 1
        end associate
      end do
      before = before + size(names(p)%saddles)
    end do
    call schema%add_dimension('side', int(curves, int64))
    call schema%add_dimension('set_point', size(piece, kind=int64))
    along = 'side'
    call add('saddle', type_int32, '1', 'number of the saddle, from 1', real(saddle, wp))
    call schema%add_variable('stable', type_int8, along, units='1', flag_values=[0, 1], flag_meanings='unstable stable', &
                             group=set_group, long_name='which set of the saddle', data=real(stable, wp))
    call add('direction', type_int8, '1', 'side of the saddle, 1 or -1', real(side, wp))
    call schema%add_variable('ending', type_int8, along, units='1', flag_values=[(k, k=0, ubound(end_names, 1))], &
      flag_meanings=join(end_names, ' '), group=set_group, long_name='why the curve is no longer', data=real(ending, wp))
    along = 'set_point'
    call add('curve', type_int32, '1', 'side that the point is of, from 0', real(curve, wp))
    call add('part', type_int32, '1', 'part of that side between two cuts, from 1', real(piece, wp))
    call add('x', type_float64, 'm', 'position at crank angle 0', points(1, :))
    call add('v', type_float64, 'm/s', 'velocity at crank angle 0', points(2, :))

  contains

    subroutine add(name, type, units, long_name, values)
      character(len=*), intent(in) :: name, units, long_name
      integer, intent(in) :: type
      real(wp), intent(in) :: values(:)
      call schema%add_variable(name, type, along, units=units, long_name=long_name, group=set_group, data=values)
    end subroutine add

  end subroutine add_sets

  subroutine add_points(grid, axes, points, schema)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2)
    type(line_point_t), intent(in) :: points(:)
    type(schema_t), intent(inout) :: schema
    character(len=:), allocatable :: units
    integer :: k
    do k = 1, 2
      call schema%add_variable(axis_dimension(grid%axes(axes(k))%name), type_float64, ['point'], units=grid%axes(axes(k))%unit, &
                               long_name=trim(grid%axes(axes(k))%name)//' of the boundary', data=points%position(k))
    end do
    call schema%add_variable('across', type_int8, ['point'], units='1', flag_values=[-1, 0, 1], &
      flag_meanings='junction first_axis second_axis', long_name='axis along which the point was found', &
      data=real(points%along - 1, wp))
    call add_label('below', 'below the point along that axis', points%below)
    call add_label('above', 'above the point along that axis', points%above)
    units = trim(grid%axes(axes(1))%unit)
    if (grid%axes(axes(2))%unit /= units) units = 'SI'
    call schema%add_variable('error', type_float64, ['point'], units=units, data=points%error, long_name='half the width of '// &
      'the interval that holds the point, in the unit of that axis; at a junction half the cell')

  contains

    subroutine add_label(name, where, values)
      character(len=*), intent(in) :: name, where
      integer, intent(in) :: values(:)
      call schema%add_variable(name, type_int32, ['point'], units='1', data=real(values, wp), &
                               long_name='attractor '//where//'; 0 not known, -1 left the domain')
    end subroutine add_label

  end subroutine add_points

  subroutine add_pieces(pieces, schema)
    type(piece_t), intent(in) :: pieces(:)
    type(schema_t), intent(inout) :: schema
    character(len=name_length) :: along(1)
    along = 'piece'
    call schema%add_variable('first', type_int32, along, units='1', data=real(pieces%first, wp), long_name='first point, from 0')
    call schema%add_variable('points', type_int32, along, units='1', data=real(pieces%points, wp), &
                             long_name='number of points')
    call schema%add_variable('label_one', type_int32, along, units='1', data=real(pieces%labels(1), wp), &
                             long_name='attractor on one side; 0 not known, -1 left the domain')
    call schema%add_variable('label_two', type_int32, along, units='1', data=real(pieces%labels(2), wp), &
                             long_name='attractor on the other side')
    call schema%add_variable('closed', type_int8, along, units='1', data=real(pieces%closed, wp), flag_values=[0, 1], &
                             flag_meanings='open closed', long_name='whether the first point follows the last')
  end subroutine add_pieces

end module boundary_layout
