! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> `separatrix laws`: the table of laws, for people and as JSON.
module laws_driver
  use journal, only: json_text
  use kinds, only: wp
  use law_row, only: law_row_t
  use law_table, only: added_families, effect_family, families, force_family, is_hidden, laws, &
    parameter_row_t, parameters_of, part_family, part_kind, &
    part_law, state_family, table_of
  use text, only: to_text
  use, intrinsic :: iso_fortran_env, only: output_unit
  implicit none
  private

  public :: run_laws

contains

  !> Prints every law with parameters, units, bounds and source.
  subroutine run_laws(json)
    logical, intent(in) :: json
    character(len=len(families)), parameter :: listed(*) = [families, [character(len=len(families)) :: added_families, &
      force_family, state_family, part_family, effect_family]]
    integer :: i, k
    logical :: first
    if (json) write (output_unit, '(a)') '['
    first = .true.
    do k = 1, size(listed)
      if (.not. json) write (output_unit, '(a)') '['//trim(listed(k))//']'
      do i = 1, size(laws)
        if (laws(i)%family /= listed(k)) cycle
        if (json) then
          call print_json(i, first)
        else
          call print_plain(i)
        end if
        first = .false.
      end do
    end do
    if (json) write (output_unit, '(a)') ']'
  end subroutine run_laws

  subroutine print_plain(law)
    integer, intent(in) :: law
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    associate (row => laws(law))
      if (row%family == effect_family) then
        write (output_unit, '(a)') '  ['//table_of(row%family, row%name)//']: '//trim(row%meaning)
      else if (row%family == part_family) then
        write (output_unit, '(a)') '  '//part_text(trim(row%name))//': '//trim(row%meaning)
      else
        write (output_unit, '(a)') '  law = "'//trim(row%name)//'": '//trim(row%meaning)
      end if
      if (len_trim(row%source) > 0) write (output_unit, '(a)') '    source: '//trim(row%source)
      rows = shown_rows(row)
    end associate
    do i = 1, size(rows)
      write (output_unit, '(4x,a20,1x,a9,1x,a)') rows(i)%name, rows(i)%unit, &
        range_text(rows(i))//default_text(rows(i))//': '//trim(rows(i)%meaning)
    end do
  end subroutine print_plain

  !> The parameters that a case may set by a number.
  pure function shown_rows(law) result(rows)
    type(law_row_t), intent(in) :: law
    type(parameter_row_t), allocatable :: rows(:)
    integer :: i
    rows = parameters_of(trim(law%family), trim(law%name))
    rows = pack(rows, [(.not. is_hidden(rows(i)), i=1, size(rows))])
  end function shown_rows

  !> How a part is written down.
  pure function part_text(law) result(text)
    character(len=*), intent(in) :: law
    character(len=:), allocatable :: text
    text = '['//part_kind(law)//'.NAME]'
    select case (part_kind(law))
    case ('body')
      return
    case ('drive')
      if (law /= 'drive:base') text = text//' body = "BODY",'
    case default
      text = text//' between = ["BODY", "BODY" or "ground"],'
    end select
    text = text//' law = "'//part_law(law)//'"'
  end function part_text

  subroutine print_json(law, first)
    integer, intent(in) :: law
    logical, intent(in) :: first
    type(parameter_row_t), allocatable :: rows(:)
    character(len=:), allocatable :: list
    integer :: i
    associate (row => laws(law))
      rows = shown_rows(row)
      list = ''
      do i = 1, size(rows)
        if (i > 1) list = list//', '
        list = list//'{"name": '//json_text(trim(rows(i)%name))//', "unit": '//json_text(trim(rows(i)%unit))// &
          ', "lower": '//bound_json(rows(i)%range%lower)//', "upper": '//bound_json(rows(i)%range%upper)// &
          ', "lower_open": '//to_text(rows(i)%range%lower_open)//', "list": '//to_text(rows(i)%list)// &
          ', "optional": '//to_text(rows(i)%optional)//', "default": '//default_json(rows(i))// &
          ', "meaning": '//json_text(trim(rows(i)%meaning))//'}'
      end do
      write (output_unit, '(a)') trim(merge('  ', ', ', first))//'{"family": '//json_text(trim(row%family))// &
        ', "law": '//json_text(trim(row%name))//', "row": '//to_text(law)//', "meaning": '// &
        json_text(trim(row%meaning))//', "source": '// &
        json_text(trim(row%source))//', "parameters": ['//list//']}'
    end associate
  end subroutine print_json

  pure function bound_json(bound) result(text)
    real(wp), intent(in) :: bound
    character(len=:), allocatable :: text
    text = 'null'
    if (abs(bound) < huge(bound)) text = to_text(bound)
  end function bound_json

  !> The number that an absent parameter takes; null if it must be given, or its absence means something else.
  pure function default_json(row) result(text)
    type(parameter_row_t), intent(in) :: row
    character(len=:), allocatable :: text
    text = 'null'
    if (row%optional .and. row%default >= row%range%lower .and. abs(row%default) < huge(row%default)) text = to_text(row%default)
  end function default_json

  pure function range_text(row) result(text)
    type(parameter_row_t), intent(in) :: row
    character(len=:), allocatable :: text
    text = ''
    associate (range => row%range)
      if (range%lower > -huge(range%lower)) text = trim(merge('> ', '>=', range%lower_open))//' '//to_text(range%lower)
      if (range%upper < huge(range%upper)) then
        if (len(text) > 0) text = text//', '
        text = text//'<= '//to_text(range%upper)
      end if
    end associate
    if (len(text) == 0) text = 'any'
    if (row%list) text = 'list, each '//text
  end function range_text

  pure function default_text(row) result(text)
    type(parameter_row_t), intent(in) :: row
    character(len=:), allocatable :: text
    text = ''
    if (.not. row%optional) return
    text = ' (optional'
    if (row%default >= row%range%lower .and. abs(row%default) < huge(row%default)) text = text//', default '//to_text(row%default)
    text = text//')'
  end function default_text

end module laws_driver
