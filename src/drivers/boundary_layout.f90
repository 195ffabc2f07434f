! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The file of `separatrix boundary`.
module boundary_layout
  use bisection, only: label_left_domain
  use boundary_lines, only: line_point_t
  use boundary_search, only: plane_t
  use errors, only: error_t
  use file_layout, only: axis_dimension
  use grid, only: grid_t
  use kinds, only: int64, wp
  use map_reader, only: reader_t
  use map_schema, only: name_length, schema_t, type_float64, type_int32, type_int8
  implicit none
  private

  public :: describe_boundary

contains

  !> Attributes and variables: points of the pieces one after the other, and the pieces.
  subroutine describe_boundary(reader, grid, planes, schema, error)
    type(reader_t), intent(in) :: reader
    type(grid_t), intent(in) :: grid
    type(plane_t), intent(in) :: planes(:)
    type(schema_t), intent(inout) :: schema
    type(error_t), allocatable, intent(out) :: error
    type(line_point_t), allocatable :: points(:)
    character(len=:), allocatable :: identity
    integer, allocatable :: first(:), count(:), plane(:), one(:), two(:), closed(:)
    integer :: p, l, i, pieces
    call reader%text_attribute('/provenance', 'case_identity', identity, error)
    if (allocated(error)) return
    pieces = sum([(size(planes(p)%lines), p=1, size(planes))])
    allocate (points(sum([((size(planes(p)%lines(l)%points), l=1, size(planes(p)%lines)), p=1, size(planes))])))
    allocate (first(pieces), count(pieces), plane(pieces), one(pieces), two(pieces), closed(pieces))
    i = 0
    pieces = 0
    do p = 1, size(planes)
      do l = 1, size(planes(p)%lines)
        associate (line => planes(p)%lines(l))
          pieces = pieces + 1
          first(pieces) = i
          count(pieces) = size(line%points)
          plane(pieces) = p
          one(pieces) = line%labels(1)
          two(pieces) = line%labels(2)
          closed(pieces) = merge(1, 0, line%closed)
          points(i + 1:i + count(pieces)) = planes(p)%points(line%points)
          i = i + count(pieces)
        end associate
      end do
    end do
    call schema%add_attribute('', 'map', reader%path(index(reader%path, '/', back=.true.) + 1:))
    call schema%add_attribute('', 'map_identity', identity)
    call schema%add_attribute('', 'axes', axis_dimension(grid%axes(planes(1)%axes(1))%name)//' '// &
                              axis_dimension(grid%axes(planes(1)%axes(2))%name))
    call schema%add_dimension('point', size(points, kind=int64))
    call schema%add_dimension('piece', int(pieces, int64))
    call add_points(grid, planes(1)%axes, points, schema)
    call add_pieces(first, count, one, two, closed, schema)
    do i = 1, size(grid%axes)
      if (any(planes(1)%axes == i)) cycle
      call schema%add_variable('piece_'//axis_dimension(grid%axes(i)%name), type_float64, ['piece'], &
        units=grid%axes(i)%unit, long_name=trim(grid%axes(i)%name)//' of the piece', &
        data=[(grid%axes(i)%values(planes(plane(l))%index(i)), l=1, pieces)])
    end do
  end subroutine describe_boundary

  subroutine add_points(grid, axes, points, schema)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2)
    type(line_point_t), intent(in) :: points(:)
    type(schema_t), intent(inout) :: schema
    integer :: k
    do k = 1, 2
      call schema%add_variable(axis_dimension(grid%axes(axes(k))%name), type_float64, ['point'], units=grid%axes(axes(k))%unit, &
                               long_name=trim(grid%axes(axes(k))%name)//' of the boundary', data=points%place(k))
    end do
    call schema%add_variable('across', type_int8, ['point'], units='1', flag_values=[-1, 0, 1], &
      flag_meanings='junction first_axis second_axis', long_name='axis along which the point was found', &
      data=real(points%along - 1, wp))
    call add_label('below', 'below the point along that axis', points%below)
    call add_label('above', 'above the point along that axis', points%above)
    call schema%add_variable('error', type_float64, ['point'], units='1', data=points%error, long_name='half the width of '// &
      'the interval that holds the point, in the unit of that axis; at a junction half the cell')

  contains

    subroutine add_label(name, where, values)
      character(len=*), intent(in) :: name, where
      integer, intent(in) :: values(:)
      call schema%add_variable(name, type_int32, ['point'], units='1', data=real(values, wp), &
                               long_name='attractor '//where//'; 0 not known, -1 left the domain')
    end subroutine add_label

  end subroutine add_points

  subroutine add_pieces(first, count, one, two, closed, schema)
    integer, intent(in) :: first(:), count(:), one(:), two(:), closed(:)
    type(schema_t), intent(inout) :: schema
    character(len=name_length) :: along(1)
    along = 'piece'
    call schema%add_variable('first', type_int32, along, units='1', data=real(first, wp), long_name='first point, from 0')
    call schema%add_variable('points', type_int32, along, units='1', data=real(count, wp), long_name='number of points')
    call schema%add_variable('label_one', type_int32, along, units='1', data=real(one, wp), &
                             long_name='attractor on one side; 0 not known, -1 left the domain')
    call schema%add_variable('label_two', type_int32, along, units='1', data=real(two, wp), &
                             long_name='attractor on the other side')
    call schema%add_variable('closed', type_int8, along, units='1', data=real(closed, wp), flag_values=[0, 1], &
                             flag_meanings='open closed', long_name='whether the first point follows the last')
  end subroutine add_pieces

end module boundary_layout
