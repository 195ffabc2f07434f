! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix boundary`: the boundaries between the basins of a finished map, as curves.
module boundary_driver
  use axis, only: axis_t
  use basin, only: catalogue_t, open_ensemble
  use boundary_layout, only: describe_boundary
  use boundary_search, only: plane_t, search_lines
  use boundary_lines, only: crossed_edges
  use boundary_names, only: name_points, names_t
  use boundary_pieces, only: bridge_gaps
  use boundary_sets, only: grow_sets
  use case_setup, only: grid_of, span_of
  use catalogue_search, only: check_slices
  use checkpoint, only: checkpoint_t
  use checksum, only: crc32
  use command_line, only: command_t
  use edge_state, only: edge_names, edge_texts
  use endings, only: assess_file
  use errors, only: error_t, fail
  use event_words, only: word_text
  use grid, only: grid_t, point_slice, two_axes
  use invariant_sets, only: end_names
  use journal, only: json_number, json_text
  use kinds, only: int64, int8, wp
  use map_final, only: write_whole
  use map_reader, only: reader_t
  use map_schema, only: schema_t
  use session, only: describe_file, identity_of, session_t
  use signals, only: end_time_limit, set_farewell
  use status, only: exit_bad_case, exit_done
  use stop_check, only: nothing_kept
  use stored_map, only: open_map_session, read_labels, restore_catalogues
  use text, only: replace_all, to_text
  use trajectory_slots, only: describe_regime
  use written_check, only: check_written
  implicit none
  private

  public :: run_boundary

contains

  !> Runs the command; ends the program with the exit code on errors.
  subroutine run_boundary(command)
    type(command_t), intent(in) :: command
    type(session_t) :: session
    type(reader_t) :: reader
    type(grid_t) :: grid
    type(catalogue_t), allocatable :: catalogues(:)
    type(plane_t), allocatable :: planes(:)
    type(names_t), allocatable :: names(:)
    type(schema_t) :: schema
    type(checkpoint_t) :: kept
    type(error_t), allocatable :: error
    character(len=:), allocatable :: path
    integer :: i
    call open_map_session(command, session, reader)
    grid = grid_of(session%the_case, session%the_case%axes)
    call open_planes(session, reader, grid, planes)
    path = result_path(command)
    if (command%validate .or. command%dry_run) then
      call session%journal%line('plan', command%path//': '//to_text(sum([(size(planes(i)%edges), i=1, size(planes))]))// &
                                ' edges between points of different labels')
      call session%end_with(exit_done)
    end if
    call assess_file(session%journal, reader, command%partial, error)
    call session%stop_if(error)
    call session%begin(path, tiled=.true.)
    call set_farewell('stopped within one long trajectory; '//nothing_kept)
    call restore_catalogues(reader, session%team, session%journal, grid, session%the_case, catalogues, error)
    if (.not. allocated(error)) call kept%open(session, path, work_identity(session, planes, catalogues), &
                                               'following the boundary', error)
    call session%stop_if(error)
    allocate (names(size(planes)))
    do i = 1, size(planes)
      associate (slice => point_slice(grid, planes(i)%index))
        call open_ensemble(grid, span_of(session%the_case), slice, describe_regime, planes(i)%ensemble, error)
        call session%stop_if(error)
        planes(i)%attractors = catalogues(slice + 1)%attractors
      end associate
      call search_lines(session, kept, grid, planes(i))
      call name_points(session, kept, grid, planes(i), names(i))
      call bridge_gaps(planes(i), names(i))
      call grow_sets(session, kept, grid, planes(i), command%grow, names(i))
    end do
    if (command%resume) call session%journal%line('resumed', to_text(kept%recalled)//' parts of the work were done before', &
                                                  '"parts": '//to_text(kept%recalled))
    call report(session, planes)
    call report_names(session, planes, names)
    call describe_file(session, 'boundary', schema)
    if (session%team%is_root()) call describe_boundary(reader, grid, planes, names, schema, error)
    call session%stop_if(error)
    call session%provenance%finish(schema)
    call end_time_limit()
    ! A run that was begun with --force may end after --resume.
    if (session%team%is_root()) call write_whole(path, schema, command%force .or. kept%taken_up, error)
    call session%stop_if(error)
    call check_written(session, path)
    if (session%team%is_root()) call kept%remove(error)
    call session%stop_if(error)
    call session%journal%line('written', 'wrote '//path)
    call session%end_with(exit_done)
  end subroutine run_boundary

  !> The planes of a map, one for each value of its other axes: their labels, and the edges between neighbours of different ones.
  subroutine open_planes(session, reader, grid, planes)
    type(session_t), intent(inout) :: session
    type(reader_t), intent(inout) :: reader
    type(grid_t), intent(in) :: grid
    type(plane_t), allocatable, intent(out) :: planes(:)
    type(error_t), allocatable :: error
    integer :: axes(2), i
    call check_axes(session%command%path, grid, axes, error)
    if (.not. allocated(error)) call check_slices(grid, span_of(session%the_case), error)
    call session%stop_if(error)
    allocate (planes(product(pack(grid%shape, [(.not. any(axes == i), i=1, size(grid%shape))]))))
    do i = 1, size(planes)
      call open_plane(grid, axes, i - 1, planes(i))
      call read_labels(reader, grid%shape, axes, planes(i)%index, planes(i)%labels, planes(i)%inferred, error)
      call session%stop_if(error)
      call crossed_edges(planes(i)%labels, planes(i)%edges)
    end do
  end subroutine open_planes

  !> What decides the curves: the case of the map with its axes, its labels and attractors, how far sets are grown, and the program.
  function work_identity(session, planes, catalogues) result(identity)
    type(session_t), intent(in) :: session
    type(plane_t), intent(in) :: planes(:)
    type(catalogue_t), intent(in) :: catalogues(:)
    character(len=:), allocatable :: identity
    integer(int64) :: sum_of_labels
    integer :: i, k
    sum_of_labels = 0
    do i = 1, size(planes)
      sum_of_labels = crc32(transfer(planes(i)%labels, [0_int8]), sum_of_labels)
    end do
    do i = 1, size(catalogues)
      do k = 1, size(catalogues(i)%attractors)
        sum_of_labels = crc32(transfer(catalogues(i)%attractors(k)%points, [0_int8]), sum_of_labels)
      end do
    end do
    identity = identity_of(session%the_case, 'basin')//' '//to_text(sum_of_labels)//' '//to_text(session%command%grow)//' '// &
               session%provenance%version//' '//session%provenance%commit
  end function work_identity

  !> Where the curves go: as asked, or NAME.boundary.h5 for NAME.basin.h5.
  pure function result_path(command) result(path)
    type(command_t), intent(in) :: command
    character(len=:), allocatable :: path
    path = command%output
    if (len(path) > 0) return
    path = command%path(index(command%path, '/', back=.true.) + 1:)
    call take_off('.h5')
    call take_off('.basin')
    path = path//'.boundary.h5'

  contains

    pure subroutine take_off(ending)
      character(len=*), intent(in) :: ending
      if (len(path) <= len(ending)) return
      if (path(len(path) - len(ending) + 1:) == ending) path = path(:len(path) - len(ending))
    end subroutine take_off

  end function result_path

  !> The two axes of the planes: both have to be of starts, in the order of the map. Code 65 naming what was found.
  subroutine check_axes(path, grid, axes, error)
    character(len=*), intent(in) :: path
    type(grid_t), intent(in) :: grid
    integer, intent(out) :: axes(2)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: found
    integer :: i
    axes = two_axes(grid)
    found = ''
    do i = 1, size(grid%axes)
      if (i > 1) found = found//' and '
      found = found//trim(grid%axes(i)%name)
    end do
    if (allocated(grid%drawn)) then
      call fail(error, exit_bad_case, "'"//path//"': found starts drawn at random, allowed a map over two axes of starts")
    else if (any(axes == 0)) then
      call fail(error, exit_bad_case, "'"//path//"': found the axes "//found//', allowed a map over two axes of starts')
    else if (.not. (any(grid%start_axis == axes(1)) .and. any(grid%start_axis == axes(2)))) then
      call fail(error, exit_bad_case, "'"//path//"': found the axes "//found//', allowed are two axes of starts (x0, v0, '// &
                'crank_angle, ...) and any others: between two values of a parameter lie other machines with other attractors')
    end if
  end subroutine check_axes

  !> The plane number `number` (from 0, the last of the other axes fastest).
  pure subroutine open_plane(grid, axes, number, plane)
    type(grid_t), intent(in) :: grid
    integer, intent(in) :: axes(2), number
    type(plane_t), intent(inout) :: plane
    integer :: i, rest
    plane%axes = axes
    plane%index = [(1, i=1, size(grid%shape))]
    rest = number
    do i = size(grid%shape), 1, -1
      if (any(axes == i)) cycle
      plane%index(i) = 1 + modulo(rest, grid%shape(i))
      rest = rest/grid%shape(i)
    end do
    plane%first = grid%axes(axes(1))%values
    plane%second = grid%axes(axes(2))%values
  end subroutine open_plane

  !> What was found.
  subroutine report(session, planes)
    type(session_t), intent(inout) :: session
    type(plane_t), intent(in) :: planes(:)
    integer :: points, lines, corrected, i, coarse
    points = sum([(size(planes(i)%intervals), i=1, size(planes))])
    lines = sum([(size(planes(i)%lines), i=1, size(planes))])
    corrected = sum(planes%corrected)
    if (corrected > 0) call session%journal%line('corrected', to_text(corrected)// &
      ' points beside the boundary had been inferred wrongly by the refined map; their labels were computed', &
      '"points": '//to_text(corrected))
    if (points == 0) then
      call session%journal%line('found', 'no boundary: all points of the map have the same label', '"points": 0, "lines": 0')
      return
    end if
    coarse = 0
    do i = 1, size(planes)
      if (size(planes(i)%points) == 0) cycle
      coarse = coarse + count(planes(i)%points%along == 0)
    end do
    call session%journal%line('found', to_text(points)//' boundary points on '//to_text(lines)//' lines, '//to_text(coarse)// &
      ' junctions', '"points": '//to_text(points)//', "lines": '//to_text(lines)//', "junctions": '//to_text(coarse))
  end subroutine report

  !> The saddles, and what the boundary points are.
  subroutine report_names(session, planes, names)
    type(session_t), intent(inout) :: session
    type(plane_t), intent(in) :: planes(:)
    type(names_t), intent(in) :: names(:)
    integer :: i, k, edge, number, points
    character(len=:), allocatable :: name
    if (len(names(1)%problem) > 0) then
      call session%journal%line('unnamed', 'what the boundary leads to is not known: '//names(1)%problem)
      return
    end if
    number = 0
    do i = 1, size(names)
      do k = 1, size(names(i)%saddles)
        number = number + 1
        associate (saddle => names(i)%saddles(k))
          call session%journal%line('saddle', 'saddle '//to_text(number)//': period '//to_text(saddle%periods)//', '// &
            word_text(saddle%word)//', multipliers '//multipliers_text(saddle%multipliers)// &
            ', '//to_text(names(i)%reached(k))//' boundary points lead to it', '"number": '//to_text(number)//', "period": '// &
            to_text(saddle%periods)//', "word": '//json_text(word_text(saddle%word))//', "x": '// &
            json_number(saddle%watched(1, 1))//', "v": '//json_number(saddle%watched(2, 1))// &
            ', "multipliers": '//multipliers_json(saddle%multipliers)//', "points": '//to_text(names(i)%reached(k)))
        end associate
      end do
      call report_sets(session, names(i), number - size(names(i)%saddles))
    end do
    do edge = 0, ubound(edge_names, 1)
      points = 0
      do i = 1, size(planes)
        if (size(planes(i)%points) > 0) points = points + count(names(i)%edge == edge .and. planes(i)%points%along > 0)
      end do
      if (points == 0) cycle
      name = trim(edge_names(edge))
      call session%journal%line('name', '  '//trim(edge_texts(edge))//': '//to_text(points)//' points', '"name": '// &
                                json_text(name)//', "points": '//to_text(points))
    end do
  end subroutine report_names

  !> Multipliers one after the other.
  pure function multipliers_text(multipliers) result(text)
    complex(wp), intent(in) :: multipliers(:)
    character(len=:), allocatable :: text
    integer :: i
    text = ''
    do i = 1, size(multipliers)
      if (i > 1) text = text//', '
      text = text//to_text(real(multipliers(i)), 9)
      if (abs(aimag(multipliers(i))) > 0) text = text//merge('+', '-', aimag(multipliers(i)) > 0)// &
                                                 to_text(abs(aimag(multipliers(i))), 9)//'i'
    end do
  end function multipliers_text

  !> The same as pairs of real and imaginary parts.
  pure function multipliers_json(multipliers) result(text)
    complex(wp), intent(in) :: multipliers(:)
    character(len=:), allocatable :: text
    integer :: i
    text = '['
    do i = 1, size(multipliers)
      if (i > 1) text = text//', '
      text = text//'['//json_number(real(multipliers(i)))//', '//json_number(aimag(multipliers(i)))//']'
    end do
    text = text//']'
  end function multipliers_json

  !> How far the stable and unstable sets were grown; `before` saddles belong to the planes before this.
  subroutine report_sets(session, names, before)
    type(session_t), intent(inout) :: session
    type(names_t), intent(in) :: names
    integer, intent(in) :: before
    character(len=:), allocatable :: which, ending
    integer :: k
    do k = 1, size(names%sets)
      associate (set => names%sets(k), saddle => names%saddle_of_set(k) + before)
        which = trim(merge('stable  ', 'unstable', set%stable))
        ending = trim(end_names(set%ending))
        call session%journal%line('set', '  saddle '//to_text(saddle)//', side '//to_text(set%side)//' of the '//which// &
          ' set: '//to_text(size(set%piece))//' points, '//replace_all(ending, '_', ' '), '"saddle": '//to_text(saddle)// &
          ', "set": '//json_text(which)//', "side": '//to_text(set%side)//', "points": '//to_text(size(set%piece))// &
          ', "ending": '//json_text(ending))
      end associate
    end do
  end subroutine report_sets

end module boundary_driver
