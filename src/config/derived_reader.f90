! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tables [derived.NAME]: quantities derived from the motions of the machine.
module derived_reader
  use case_source, only: case_source_t, enter_table, find, know, report
  use case_type, only: case_t
  use case_values, only: take_choice, take_text
  use build_motion, only: machine_of
  use composed_units, only: composed_unit_t, known_units, read_unit
  use derived_quantities, only: compile, compiled_t, derived_kinds, derived_t, is_power, longest_derived, power_names
  use errors, only: error_t
  use law_table, only: label_length
  use machine_type, only: machine_t
  use motion_state, only: options_t
  use part_names, only: names_of
  use text, only: join, parse_integer, starts_with, to_text
  use written_names, only: as_read, column_as_written
  implicit none
  private

  public :: read_derived, check_derived

  character(len=*), parameter :: letters = 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ', &
    name_letters = letters//'0123456789_'

contains

  subroutine read_derived(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(inout) :: the_case
    character(len=label_length), allocatable :: names(:)
    integer :: i
    ! Named also where there is none and a table is misspelt.
    call know(source, 'derived.')
    names = names_of(source, 'derived')
    allocate (the_case%derived(size(names)))
    do i = 1, size(names)
      call read_one(source, trim(names(i)), the_case%derived(i))
    end do
  end subroutine read_derived

  subroutine read_one(source, name, one)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: name
    type(derived_t), intent(out) :: one
    character(len=:), allocatable :: path
    logical :: found
    path = 'derived.'//name
    call enter_table(source, path, found)
    if (verify(name, name_letters) > 0 .or. scan(name(:min(1, len(name))), letters) == 0 .or. len(name) > longest_derived) then
      call report(source, path, 'found the name "'//name//'", allowed at most '//to_text(longest_derived)// &
                  ' letters, digits and _, a letter first')
    end if
    one%name = name
    one%expression = ''
    one%unit = 'W'
    call take_choice(source, path//'.quantity', derived_kinds, one%quantity)
    if (is_power(one)) then
      call take_text(source, path//'.of', one%expression, required=.true.)
      if (len(one%expression) > 0 .and. all(power_names /= one%expression)) then
        call report(source, path//'.of', 'found "'//one%expression//'", allowed '//join(power_names, ', '))
      end if
    else
      one%unit = ''
      call take_text(source, path//'.expression', one%expression, required=.true.)
      one%expression = as_read(source%tables, one%expression)
      call take_text(source, path//'.unit', one%unit, required=.true.)
      call check_unit(source, path//'.unit', one%unit)
    end if
  end subroutine read_one

  !> Values are in SI.
  subroutine check_unit(source, path, text)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, text
    type(composed_unit_t) :: unit
    integer :: column
    if (len(text) == 0) return
    call read_unit(text, unit, column)
    if (column > 0) then
      call report(source, path, 'found "'//text//'", allowed '//known_units()// &
                  '; "1" for a pure number')
    else if (abs(unit%multiplier - unit%divisor) > 0) then
      call report(source, path, 'found "'//text//'", allowed the SI unit, "'//unit%si//'"')
    end if
  end subroutine check_unit

  !> Notes expressions that the machine of the case cannot have.
  subroutine check_derived(source, the_case)
    type(case_source_t), intent(inout) :: source
    type(case_t), intent(in) :: the_case
    class(machine_t), allocatable :: machine
    type(compiled_t) :: compiled
    type(error_t), allocatable :: error
    integer :: i, faulty
    if (size(the_case%derived) == 0) return
    do i = 1, size(the_case%derived)
      if (len_trim(the_case%derived(i)%expression) > 0) cycle
      call report(source, 'derived.'//trim(the_case%derived(i)%name)//'.expression', 'found "", allowed an expression, as in "x^2"')
    end do
    call machine_of(the_case%laws, options_t(), machine, error)
    if (allocated(error)) return
    do i = 1, size(the_case%derived)
      if (is_power(the_case%derived(i)) .or. len_trim(the_case%derived(i)%expression) == 0) cycle
      call compile(machine, the_case%laws, the_case%derived(i:i), compiled, faulty, error)
      if (allocated(error)) call report_expression(source, 'derived.'//trim(the_case%derived(i)%name)//'.expression', error%message)
    end do
  end subroutine check_derived

  !> Reports what is wrong with an expression, at its column in the file.
  subroutine report_expression(source, path, message)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, message
    character(len=*), parameter :: begin = 'column '
    integer :: column, mark, status
    mark = index(message, ':')
    status = 1
    if (starts_with(message, begin) .and. mark > 0) call parse_integer(message(len(begin) + 1:mark - 1), column, status)
    if (status /= 0) then
      call report(source, path, message)
    else
      column = column_as_written(source%tables, source%entries(find(source, path))%entry%string, column)
      call report(source, path, begin//to_text(column)//message(mark:))
    end if
  end subroutine report_expression

end module derived_reader
