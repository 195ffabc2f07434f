! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> A machine as a sketch (SVG), so that its author sees what was understood: a column for the ground and for each body or point
!> of a structure, a row for each spring, joint and drive between them.
module sketch
  use case_type, only: case_t
  use kinds, only: wp
  use law_table, only: effect_family, is_hidden, law_choice_t, parameter_row_t, rows_of, part_family, part_kind, &
    part_law, value_of
  use text, only: replace_all, to_text
  implicit none
  private

  public :: sketch_of

  character(len=1), parameter :: nl = new_line('a')
  !> Lengths in pixels.
  integer, parameter :: first_column = 70, column_step = 150, heading = 96, row_step = 46, letter = 7

  !> What stands in a column, or acts along a row between two of them (from 0, the ground).
  type :: row_t
    character(len=10) :: kind = ''
    integer :: first = 0, second = 0
    character(len=:), allocatable :: words
  end type row_t

  type :: drawing_t
    character(len=48), allocatable :: names(:)
    type(row_t), allocatable :: rows(:)
    character(len=:), allocatable :: svg
    integer :: bottom = 0
  end type drawing_t

contains

  !> The text of the drawing.
  function sketch_of(the_case) result(svg)
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: svg, details
    type(drawing_t) :: drawing
    integer :: i, width, height
    allocate (drawing%rows(0))
    drawing%names = [character(len=48) :: 'ground']
    if (the_case%laws(1)%name == 'structure') then
      call collect_parts(the_case%laws, drawing)
    else
      call collect_families(the_case%laws, drawing)
    end if
    drawing%bottom = heading + row_step*(size(drawing%rows) + 1)
    drawing%svg = ''
    do i = 1, size(drawing%names)
      call draw_column(drawing, i - 1, the_case)
    end do
    do i = 1, size(drawing%rows)
      call draw_row(drawing, i)
    end do
    width = 560
    do i = 1, size(drawing%rows)
      width = max(width, text_x(drawing) + letter*len(drawing%rows(i)%words))
    end do
    width = max(width, 32 + 3*letter*len(the_case%title)/2)
    height = drawing%bottom + 44
    details = plain_text(16, 28, 'start', 16, the_case%title)//plain_text(16, height - 12, 'start', 11, &
      'Columns: the ground, bodies, points of structures. Rows: what acts between the dots.')
    svg = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 '//to_text(width)//' '//to_text(height)//'" width="'// &
      to_text(width)//'" height="'//to_text(height)//'" font-family="Helvetica, Arial, sans-serif" fill="none" '// &
      'stroke="#222222" stroke-width="1.4">'//nl//'<rect width="100%" height="100%" fill="white" stroke="none"/>'//nl// &
      details//drawing%svg//'</svg>'//nl
  end function sketch_of

  !> Bodies, structures, springs, joints and drives by name.
  subroutine collect_parts(laws, drawing)
    type(law_choice_t), intent(in) :: laws(:)
    type(drawing_t), intent(inout) :: drawing
    integer :: i
    do i = 1, size(laws)
      if (index(laws(i)%name, 'body:') == 1 .or. index(laws(i)%name, 'point:') == 1) drawing%names = &
        [character(len=48) :: drawing%names, laws(i)%label]
    end do
    do i = 1, size(laws)
      if (laws(i)%family /= part_family) cycle
      select case (part_kind(laws(i)%name))
      case ('body', 'point')
        continue
      case ('structure')
        call add('structure', structure_columns(laws, i))
      case ('drive')
        call add('drive', spread(nint(value_of(laws(i), 'body')), 1, 2))
      case default
        call add(part_kind(laws(i)%name), [nint(value_of(laws(i), 'first_end')), nint(value_of(laws(i), 'second_end'))])
      end select
    end do

  contains

    subroutine add(kind, ends)
      character(len=*), intent(in) :: kind
      integer, intent(in) :: ends(2)
      drawing%rows = [drawing%rows, row_t(kind, ends(1), ends(2), trim(laws(i)%label)//': '//part_law(laws(i)%name)// &
                                          parameters_text(laws(i)))]
    end subroutine add

  end subroutine collect_parts

  !> First and last column of the points of a structure.
  pure function structure_columns(laws, structure) result(ends)
    type(law_choice_t), intent(in) :: laws(:)
    integer, intent(in) :: structure
    integer :: ends(2), i, k
    ends = 0
    k = 0
    do i = 1, size(laws)
      if (index(laws(i)%name, 'body:') /= 1 .and. index(laws(i)%name, 'point:') /= 1) cycle
      k = k + 1
      if (laws(i)%label(:index(laws(i)%label, '.')) /= trim(laws(structure)%label)//'.') cycle
      if (ends(1) == 0) ends(1) = k
      ends(2) = k
    end do
  end function structure_columns

  !> The laws of a machine of one body or a pair.
  subroutine collect_families(laws, drawing)
    type(law_choice_t), intent(in) :: laws(:)
    type(drawing_t), intent(inout) :: drawing
    character(len=10) :: kind
    integer :: i, bodies, stops
    bodies = merge(2, 1, laws(1)%name /= 'point_mass')
    if (bodies == 1) drawing%names = [character(len=48) :: 'ground', 'body']
    if (bodies == 2) drawing%names = [character(len=48) :: 'ground', 'driving body', 'driven body']
    stops = merge(1, 0, laws(1)%name == 'backlash_pair')
    do i = 1, size(laws)
      if (laws(i)%name == 'none' .or. (laws(i)%family == 'body' .and. bodies == 1)) cycle
      kind = laws(i)%family
      if (kind == 'restoring') kind = 'spring'
      if (kind == 'body') kind = 'friction'
      drawing%rows = [drawing%rows, row_t(kind, 0, 1, trim(laws(i)%family)//': '//trim(laws(i)%name)//parameters_text(laws(i)))]
      associate (row => drawing%rows(size(drawing%rows)))
        if (laws(i)%family == 'contact') row%first = merge(stops, 0, bodies == 2)
        if (laws(i)%family == 'contact') row%second = bodies
        if (laws(i)%family == 'body') row%first = 1
        if (laws(i)%family == 'body') row%second = 2
        if (laws(i)%family == 'drive' .or. laws(i)%family == effect_family) row%first = 1
        ! These move the foot of the spring.
        if (any(laws(i)%name == [character(len=15) :: 'harmonic', 'fourier', 'crank_lever_rod'])) row%second = 0
        if (row%kind == 'drive' .and. row%second == 0) row%first = 0
      end associate
    end do
  end subroutine collect_families

  !> ', name value unit' of every number that is not its default.
  function parameters_text(law) result(words)
    type(law_choice_t), intent(in) :: law
    character(len=:), allocatable :: words
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    rows = rows_of(law)
    words = ''
    do i = 1, size(rows)
      if (is_hidden(rows(i)) .or. rows(i)%name == 'x0' .or. rows(i)%name == 'v0') cycle
      associate (values => law%parameters(i)%values)
        if (rows(i)%list) then
          if (size(values) > 0) words = words//', '//trim(rows(i)%name)//' '//list_text(values)//unit_text(rows(i)%unit)
        else if (abs(values(1)) < huge(1.0_wp) .and. .not. (rows(i)%optional .and. abs(values(1) - rows(i)%default) <= 0)) then
          words = words//', '//trim(rows(i)%name)//' '//short(values(1))//unit_text(rows(i)%unit)
        end if
      end associate
    end do
  end function parameters_text

  !> Six digits, without zeros at the end.
  pure function short(value) result(words)
    real(wp), intent(in) :: value
    character(len=:), allocatable :: words
    words = to_text(value, 6)
    if (index(words, '.') == 0 .or. scan(words, 'eE') > 0) return
    words = words(:verify(words, '0', back=.true.))
    words = words(:verify(words, '.', back=.true.))
  end function short

  !> Up to four numbers.
  function list_text(values) result(words)
    real(wp), intent(in) :: values(:)
    character(len=:), allocatable :: words
    integer :: i
    words = '['
    do i = 1, min(size(values), 4)
      if (i > 1) words = words//', '
      words = words//short(values(i))
    end do
    if (size(values) > 4) words = words//', ... '//to_text(size(values))//' numbers'
    words = words//']'
  end function list_text

  pure function unit_text(unit) result(words)
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: words
    words = ''
    if (unit /= '1') words = ' '//trim(unit)
  end function unit_text

  !> Where the words of the rows begin: right of all columns.
  pure integer function text_x(drawing)
    type(drawing_t), intent(in) :: drawing
    text_x = column_x(size(drawing%names) - 1) + 40
  end function text_x

  pure function beside(drawing, y, words) result(svg)
    type(drawing_t), intent(in) :: drawing
    integer, intent(in) :: y
    character(len=*), intent(in) :: words
    character(len=:), allocatable :: svg
    svg = plain_text(text_x(drawing), y + 4, 'start', 11, words)
  end function beside

  pure integer function column_x(column)
    integer, intent(in) :: column
    column_x = first_column + column_step*column
  end function column_x

  !> The ground is a hatched wall, a body a bar under its name and mass.
  subroutine draw_column(drawing, column, the_case)
    type(drawing_t), intent(inout) :: drawing
    integer, intent(in) :: column
    type(case_t), intent(in) :: the_case
    character(len=:), allocatable :: below
    integer :: x, y, i
    x = column_x(column)
    drawing%svg = drawing%svg//plain_text(x, heading - 34, 'middle', 13, trim(drawing%names(column + 1)))
    if (column == 0) then
      drawing%svg = drawing%svg//line(x, heading, x, drawing%bottom)
      do y = heading + 8, drawing%bottom, 12
        drawing%svg = drawing%svg//line(x, y - 8, x - 10, y)
      end do
      return
    end if
    below = ''
    do i = 1, size(the_case%laws)
      associate (law => the_case%laws(i))
        if (law%family == part_family .and. law%label == drawing%names(column + 1)) then
          if (part_kind(law%name) == 'body') below = trim(parameters_text(law))
          if (part_law(law%name) == 'watched') below = below//', watched'
        else if (law%family == 'body' .and. law%name == 'point_mass') then
          below = trim(parameters_text(law))
        end if
      end associate
    end do
    if (len(below) > 2) drawing%svg = drawing%svg//plain_text(x, heading - 16, 'middle', 11, below(3:))
    drawing%svg = drawing%svg//'<rect x="'//to_text(x - 6)//'" y="'//to_text(heading)//'" width="12" height="'// &
      to_text(drawing%bottom - heading)//'" fill="#dfe7ef"/>'//nl
  end subroutine draw_column

  !> What acts between two columns: its symbol in the first gap, its words beside all columns.
  subroutine draw_row(drawing, number)
    type(drawing_t), intent(inout) :: drawing
    integer, intent(in) :: number
    character(len=:), allocatable :: svg
    integer :: y, left, right, middle
    associate (row => drawing%rows(number))
      y = heading + row_step*number
      left = column_x(min(row%first, row%second))
      right = column_x(max(row%first, row%second))
      middle = left + column_step/2
      select case (row%kind)
      case ('drive', 'effect')
        svg = line(left - 46, y, left - 8, y)//line(left - 16, y - 5, left - 8, y)//line(left - 16, y + 5, left - 8, y)// &
          beside(drawing, y, row%words)
      case ('structure')
        svg = '<rect x="'//to_text(left - 14)//'" y="'//to_text(y - 4)//'" width="'//to_text(right - left + 28)// &
          '" height="8" rx="4" fill="#8aa4bd"/>'//nl//beside(drawing, y, row%words)
      case default
        svg = dot(left, y)//dot(right, y)//line(left, y, middle - 34, y)//line(middle + 34, y, right, y)// &
          symbol(trim(row%kind), middle, y)//beside(drawing, y, row%words)
      end select
    end associate
    drawing%svg = drawing%svg//svg
  end subroutine draw_row

  !> Spring: a zigzag; friction: two plates pressed together; contact: a gap.
  function symbol(kind, x, y) result(svg)
    character(len=*), intent(in) :: kind
    integer, intent(in) :: x, y
    character(len=:), allocatable :: svg
    integer :: i
    svg = ''
    select case (kind)
    case ('spring')
      svg = '<polyline points="'//to_text(x - 34)//','//to_text(y)
      do i = 0, 7
        svg = svg//' '//to_text(x - 30 + 8*i)//','//to_text(y + merge(7, -7, modulo(i, 2) == 0))
      end do
      svg = svg//' '//to_text(x + 34)//','//to_text(y)//'"/>'//nl
    case ('friction')
      svg = line(x - 34, y, x - 34, y + 3)//line(x - 34, y + 3, x + 24, y + 3)//line(x + 34, y, x + 34, y - 3)// &
        line(x - 24, y - 3, x + 34, y - 3)
      do i = -20, 20, 8
        svg = svg//line(x + i, y + 10, x + i + 6, y + 3)
      end do
    case ('contact')
      svg = line(x - 34, y, x - 8, y)//line(x + 8, y, x + 34, y)//line(x - 8, y - 9, x - 8, y + 9)// &
        line(x + 8, y - 9, x + 8, y + 9)
    case default
      svg = '<rect x="'//to_text(x - 34)//'" y="'//to_text(y - 7)//'" width="68" height="14"/>'//nl
    end select
  end function symbol

  pure function line(x1, y1, x2, y2) result(svg)
    integer, intent(in) :: x1, y1, x2, y2
    character(len=:), allocatable :: svg
    svg = '<path d="M'//to_text(x1)//' '//to_text(y1)//'L'//to_text(x2)//' '//to_text(y2)//'"/>'//nl
  end function line

  pure function dot(x, y) result(svg)
    integer, intent(in) :: x, y
    character(len=:), allocatable :: svg
    svg = '<circle cx="'//to_text(x)//'" cy="'//to_text(y)//'" r="3.5" fill="#222222"/>'//nl
  end function dot

  pure function plain_text(x, y, anchor, size, words) result(svg)
    integer, intent(in) :: x, y, size
    character(len=*), intent(in) :: anchor, words
    character(len=:), allocatable :: svg
    svg = '<text x="'//to_text(x)//'" y="'//to_text(y)//'" text-anchor="'//anchor//'" font-size="'//to_text(size)// &
      '" fill="#111111" stroke="none">'//replace_all(replace_all(replace_all(words, '&', '&amp;'), '<', '&lt;'), '>', '&gt;')// &
      '</text>'//nl
  end function plain_text

end module sketch
