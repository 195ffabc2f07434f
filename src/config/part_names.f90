! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The names in the tables of a machine of several bodies.
module part_names
  use case_source, only: case_source_t, find, report
  use law_table, only: label_length, law_choice_t, list_of
  use text, only: replace_all, starts_with, to_text
  use toml_bindings, only: toml_table
  implicit none
  private

  public :: check_columns, check_names, is_table, names_of

  !> The end of a joint that is no body.
  character(len=*), parameter, public :: ground = 'ground'
  !> Names before _x and _v that results have for their events.
  character(len=11), parameter :: columns_of_events(2) = [character(len=11) :: 'event', 'event_joint']

contains

  !> Names of the tables [kind.NAME], in the order of the text.
  pure function names_of(source, kind) result(names)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: kind
    character(len=label_length), allocatable :: names(:)
    character(len=label_length) :: found(size(source%entries)), name
    integer :: i, last, count_names
    count_names = 0
    do i = 1, size(source%entries)
      associate (path => source%entries(i)%entry%path)
        if (.not. starts_with(path, kind//'.')) cycle
        ! A key below a table that an override alone makes speaks for it, too.
        last = scan(path(len(kind) + 2:), '.[') - 1
        if (last < 0 .and. source%entries(i)%entry%kind /= toml_table) cycle
        if (last < 0) last = len(path) - len(kind) - 1
        name = path(len(kind) + 2:len(kind) + 1 + last)
        if (any(found(:count_names) == name)) cycle
        count_names = count_names + 1
        found(count_names) = name
      end associate
    end do
    names = found(:count_names)
  end function names_of

  !> Whether `path` is a table, perhaps one that keys below it alone make.
  pure logical function is_table(source, path)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    integer :: at
    at = find(source, path)
    if (at > 0) then
      is_table = source%entries(at)%entry%kind == toml_table
    else
      is_table = any([(starts_with(source%entries(at)%entry%path, path//'.'), at=1, size(source%entries))])
    end if
  end function is_table

  !> Names that are distinct in paths and messages.
  subroutine check_names(source, kind, names)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: kind
    character(len=label_length), intent(in) :: names(:)
    integer :: i
    do i = 1, size(names)
      if (verify(trim(names(i)), 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-') > 0) then
        call report(source, kind//'.'//trim(names(i)), 'found the name "'//trim(names(i))//'", allowed letters, digits, _ and -')
      else if (names(i) == 'law' .or. (kind == 'body' .and. names(i) == 'in_sequence')) then
        call report(source, kind//'.'//trim(names(i)), 'found a part with the name of a key of ['//kind// &
                    '], allowed any other name')
      else if (kind == 'body' .and. any(names(i) == columns_of_events)) then
        call report(source, 'body.'//trim(names(i)), 'found a body whose columns in results are those of the events, '// &
                    'allowed another name')
      else if (kind == 'body' .and. names(i) == ground) then
        call report(source, kind//'.'//trim(names(i)), 'found a body with the name "ground", allowed any other: it is what '// &
                    'stands still')
      end if
    end do
  end subroutine check_names

  !> Columns of results are named after the positions, and after the coordinates of structures, with _ for a dot.
  subroutine check_columns(source, names, structures)
    type(case_source_t), intent(inout) :: source
    character(len=label_length), intent(in) :: names(:)
    type(law_choice_t), intent(in) :: structures(:)
    integer :: i, k
    do i = 1, size(names)
      do k = 1, i - 1
        if (column_of(names(i)) /= column_of(names(k))) cycle
        call report(source, 'structure.'//names(i)(:index(names(i), '.') - 1), 'found the point "'//trim(names(i))// &
                    '" and a "'//trim(names(k))//'", allowed names that differ in more than a dot')
      end do
    end do
    do i = 1, size(structures)
      if (index(structures(i)%name, 'structure:') /= 1) cycle
      do k = 1, size(list_of(structures(i), 'x0'))
        call check_coordinate(column_of(trim(structures(i)%label)//'.'//to_text(k)), trim(structures(i)%label), k)
      end do
    end do

  contains

    pure function column_of(name) result(column)
      character(len=*), intent(in) :: name
      character(len=:), allocatable :: column
      column = replace_all(trim(name), '.', '_')
    end function column_of

    !> No entry has the column of coordinate number `number` of a structure.
    subroutine check_coordinate(column, structure, number)
      character(len=*), intent(in) :: column, structure
      integer, intent(in) :: number
      integer :: entry, dot
      do entry = 1, size(names)
        if (column_of(names(entry)) /= column) cycle
        dot = index(names(entry), '.')
        if (dot == 0) then
          call report(source, 'body.'//trim(names(entry)), 'found a body'//also(structure, number))
        else
          call report(source, 'structure.'//names(entry)(:dot - 1)//'.point.'//trim(names(entry)(dot + 1:)), &
                      'found a point'//also(structure, number))
        end if
      end do
    end subroutine check_coordinate

    pure function also(structure, number) result(text)
      character(len=*), intent(in) :: structure
      integer, intent(in) :: number
      character(len=:), allocatable :: text
      text = ' whose columns in results are those of coordinate '//to_text(number)//' of [structure.'//structure// &
             '], allowed another name'
    end function also

  end subroutine check_columns

end module part_names
