! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Reads a list of starts: CSV with a header of x0, v0 and optionally ratio and the starts of further bodies, in any order.
module point_list
  use angle_units, only: unit_of
  use axis, only: name_length
  use case_parameters, only: parameter_bounds
  use case_values, only: bounds_t
  use constants, only: unreachable
  use contact_law, only: barrier_positions, beyond_barrier, contact_t
  use errors, only: error_t, fail
  use kinds, only: int64, wp
  use law_table, only: is_start_parameter, law_choice_t
  use output_check, only: is_folder
  use restoring_law, only: position_is_angle
  use status, only: exit_bad_case, exit_no_input
  use text, only: parse_number, replace_all, starts_with, to_text
  use toml_bindings, only: first_bad_byte, read_text_file
  implicit none
  private

  public :: read_point_list

  !> Some programs begin UTF-8 text with it.
  character(len=*), parameter :: byte_order_mark = char(239)//char(187)//char(191)

  type, public :: point_list_t
    !> Starts [m, m/s] and drive ratio of each.
    real(wp), allocatable :: x0(:), v0(:), ratio(:)
    !> Starts of further bodies (rows as named; points), in the units of the parameters.
    character(len=name_length), allocatable :: names(:)
    real(wp), allocatable :: further(:, :)
    integer :: points = 0
  end type point_list_t

contains

  !> Reads `path`; without a column `ratio` every point has `default_ratio`. `laws` determine which bodies there are. Errors name
  !> the line, what was found and what is allowed: code 66 for a file that cannot be read, 65 for its content.
  subroutine read_point_list(path, default_ratio, contact, laws, list, error)
    character(len=*), intent(in) :: path
    real(wp), intent(in) :: default_ratio
    type(contact_t), intent(in) :: contact
    type(law_choice_t), intent(in) :: laws(:)
    type(point_list_t), intent(out) :: list
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text, line, unit
    real(wp), allocatable :: row(:)
    integer, allocatable :: columns(:)
    integer :: number, width
    integer(int64) :: from, length
    allocate (list%x0(0), list%v0(0), list%ratio(0), list%names(0), list%further(0, 0))
    if (is_folder(path)) then
      call fail(error, exit_no_input, "list of points '"//path//"': it is a folder")
      return
    end if
    call read_text_file(path, text, error)
    if (allocated(error)) then
      error%message = 'list of points '//error%message
      return
    end if
    from = first_bad_byte(text)
    if (from > 0) then
      call fail(error, exit_bad_case, path//':'//to_text(1 + count_lines(text(:from - 1)))// &
                ': found a byte that is no text, allowed UTF-8')
      return
    end if
    unit = ' '//unit_of('m', position_is_angle(laws))
    number = 0
    from = 1
    if (starts_with(text, byte_order_mark)) from = 1 + len(byte_order_mark)
    do while (from <= len(text, int64))
      length = index(text(from:), new_line('a'), kind=int64) - 1
      if (length < 0) length = len(text, int64) - from + 1
      line = trim(replace_all(text(from:from + length - 1), achar(13), ''))
      from = from + length + 1
      number = number + 1
      if (len(line) == 0 .or. starts_with(line, '#')) cycle
      if (.not. allocated(columns)) then
        call read_header(path, number, line, laws, columns, list%names, width, error)
        if (.not. allocated(error)) list%further = reshape([real(wp) ::], [size(list%names), 0])
      else
        call read_row(path, number, line, columns, list%names, width, default_ratio, contact, unit, row, error)
        if (.not. allocated(error)) call append(list, row)
      end if
      if (allocated(error)) exit
    end do
    if (allocated(error)) return
    if (list%points == 0) call fail(error, exit_bad_case, path// &
      ': found no points, needed is a header x0,v0 (optionally ratio) and a line per point')
    list%x0 = list%x0(:list%points)
    list%v0 = list%v0(:list%points)
    list%ratio = list%ratio(:list%points)
    list%further = list%further(:, :list%points)
  end subroutine read_point_list

  !> Number of line feeds.
  pure integer function count_lines(text)
    character(len=*), intent(in) :: text
    integer(int64) :: i
    count_lines = 0
    do i = 1, len(text, int64)
      if (text(i:i) == new_line('a')) count_lines = count_lines + 1
    end do
  end function count_lines

  !> Positions of x0, v0, ratio and the further `names` in the header; 0 for an absent ratio.
  subroutine read_header(path, number, line, laws, columns, names, width, error)
    character(len=*), intent(in) :: path, line
    integer, intent(in) :: number
    type(law_choice_t), intent(in) :: laws(:)
    integer, allocatable, intent(out) :: columns(:)
    character(len=name_length), allocatable, intent(out) :: names(:)
    integer, intent(out) :: width
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: name
    type(bounds_t) :: bounds
    logical :: known
    integer :: column
    columns = [0, 0, 0]
    allocate (names(0))
    width = count_fields(line)
    do column = 1, width
      name = field(line, column)
      select case (name)
      case ('x0')
        call take(1)
      case ('v0')
        call take(2)
      case ('ratio')
        call take(3)
      case default
        known = is_start_parameter(name) .and. len(name) <= name_length
        if (known) call parameter_bounds(laws, name, bounds, known)
        if (.not. known) then
          call fail(error, exit_bad_case, path//':'//to_text(number)//": found column '"//name// &
                    "', allowed are x0, v0, ratio, and of several bodies body.NAME.x0, body.NAME.v0 ...")
          return
        end if
        if (any(names == name)) then
          call take(3 + findloc(names == name, .true., 1))
        else
          names = [character(len=name_length) :: names, name]
          columns = [columns, column]
        end if
      end select
    end do
    if (.not. allocated(error) .and. any(columns(:2) == 0)) call fail(error, exit_bad_case, path//':'// &
      to_text(number)//": found the header '"//line//"', needed are the columns x0 and v0")

  contains

    subroutine take(which)
      integer, intent(in) :: which
      if (columns(which) > 0) call fail(error, exit_bad_case, path//':'//to_text(number)//": column '"//name// &
                                        "' is repeated")
      columns(which) = column
    end subroutine take

  end subroutine read_header

  subroutine read_row(path, number, line, columns, further, width, default_ratio, contact, unit, row, error)
    character(len=*), intent(in) :: path, line
    integer, intent(in) :: number, columns(:), width
    character(len=*), intent(in) :: further(:)
    real(wp), intent(in) :: default_ratio
    type(contact_t), intent(in) :: contact
    character(len=*), intent(in) :: unit
    real(wp), allocatable, intent(out) :: row(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: word
    integer :: k, status
    allocate (row(size(columns)), source=0.0_wp)
    row(3) = default_ratio
    if (count_fields(line) /= width) then
      call fail(error, exit_bad_case, where_found()//'found '//to_text(count_fields(line))//' values, the header has '// &
                to_text(width)//' columns')
      return
    end if
    do k = 1, size(columns)
      if (columns(k) == 0) cycle
      word = field(line, columns(k))
      call parse_number(word, row(k), status)
      if (status /= 0) then
        call fail(error, exit_bad_case, where_found()//name_of(k)//": found '"//word//"', allowed a finite number")
        return
      end if
    end do
    if (beyond_barrier(contact, row(1))) then
      call fail(error, exit_bad_case, where_found()//'x0: found '//to_text(row(1))//unit// &
                ', allowed '//between_barriers(contact, unit))
    else if (columns(3) > 0 .and. .not. row(3) > 0) then
      call fail(error, exit_bad_case, where_found()//'ratio: found '//to_text(row(3))//', allowed a number above 0')
    else if (columns(3) > 0 .and. .not. default_ratio > 0) then
      call fail(error, exit_bad_case, where_found()//'ratio: the drive of the case has no ratio')
    end if

  contains

    !> Texts cost more than the numbers of a row: they are made where one is to be shown.
    function where_found()
      character(len=:), allocatable :: where_found
      where_found = path//':'//to_text(number)//': '
    end function where_found

    function name_of(column)
      integer, intent(in) :: column
      character(len=:), allocatable :: name_of
      character(len=name_length) :: names(size(columns))
      names = [character(len=name_length) :: 'x0', 'v0', 'ratio', further]
      name_of = trim(names(column))
    end function name_of

  end subroutine read_row

  pure function between_barriers(contact, unit) result(words)
    type(contact_t), intent(in) :: contact
    character(len=*), intent(in) :: unit
    character(len=:), allocatable :: words
    real(wp) :: barriers(2)
    barriers = barrier_positions(contact)
    words = ''
    if (barriers(2) > -unreachable) words = 'at least the lower barrier '//to_text(barriers(2))//unit
    if (barriers(1) > unreachable) return
    if (len(words) > 0) words = words//', '
    words = words//'at most the upper barrier '//to_text(barriers(1))//unit
  end function between_barriers

  pure integer function count_fields(line)
    character(len=*), intent(in) :: line
    integer :: i
    count_fields = 1
    do i = 1, len(line)
      if (line(i:i) == ',') count_fields = count_fields + 1
    end do
  end function count_fields

  !> The words between commas, without blanks around them.
  pure function field(line, number) result(word)
    character(len=*), intent(in) :: line
    integer, intent(in) :: number
    character(len=:), allocatable :: word
    integer :: from, i, comma
    from = 1
    do i = 2, number
      from = from + index(line(from:), ',')
    end do
    comma = index(line(from:)//',', ',')
    word = trim(adjustl(line(from:from + comma - 2)))
  end function field

  !> Adds a point; storage doubles when it is full.
  subroutine append(list, row)
    type(point_list_t), intent(inout) :: list
    real(wp), intent(in) :: row(:)
    integer :: more
    if (list%points == size(list%x0)) then
      more = max(64, list%points)
      list%x0 = [list%x0, spread(0.0_wp, 1, more)]
      list%v0 = [list%v0, spread(0.0_wp, 1, more)]
      list%ratio = [list%ratio, spread(0.0_wp, 1, more)]
      list%further = reshape(list%further, [size(list%names), list%points + more], pad=[0.0_wp])
    end if
    list%points = list%points + 1
    list%x0(list%points) = row(1)
    list%v0(list%points) = row(2)
    list%ratio(list%points) = row(3)
    list%further(:, list%points) = row(4:)
  end subroutine append

end module point_list
