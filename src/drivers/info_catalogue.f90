! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The catalogue of a file as shown by `separatrix info`.
module info_catalogue
  use attractors, only: kind_chaotic, kind_family, kind_names, kind_not_known, last_kind, regime_names
  use errors, only: error_t
  use event_words, only: word_text
  use journal, only: json_number, json_text
  use kinds, only: int64, wp
  use map_reader, only: reader_t
  use text, only: starts_with, to_text
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  implicit none
  private

  public :: add_catalogue

  character(len=*), parameter :: columns(8) = [character(len=18) :: 'attractor', 'slice', 'regime', &
    'period', 'event_word', 'amplitude', 'impacts_per_period', 'count']

  type :: derived_column_t
    character(len=:), allocatable :: name
    real(wp), allocatable :: values(:)
  end type derived_column_t

contains

  !> Adds the attractors of a file, one line or JSON object each, to `body`; nothing where there is no catalogue.
  subroutine add_catalogue(reader, json, body, error)
    type(reader_t), intent(in) :: reader
    logical, intent(in) :: json
    character(len=:), allocatable, intent(inout) :: body
    type(error_t), allocatable, intent(out) :: error
    real(wp), allocatable :: table(:, :), kinds_of_entries(:), rotations(:)
    character(len=:), allocatable :: line
    type(derived_column_t), allocatable :: derived(:)
    integer :: i, k
    if (.not. reader%has('/catalogue/attractor')) return
    call reader%read_columns([('/catalogue/'//columns(k), k=1, size(columns))], table, error)
    ! Older files do not have it.
    if (.not. allocated(error)) call read_if_there(reader, 'kind', size(table, 1), kinds_of_entries, error)
    ! Of an angle.
    if (.not. allocated(error)) call read_if_there(reader, 'rotation_number', size(table, 1), rotations, error)
    if (.not. allocated(error)) call read_derived(reader, size(table, 1), derived, error)
    if (allocated(error)) return
    if (json) body = body//', "catalogue": ['
    if (.not. json) body = body//new_line('a')//'  catalogue (R, L: impact at upper, lower barrier; S: stick; '// &
      'C, D: chatter; . : end of a period):'
    do i = 1, size(table, 1)
      line = marks_text(table(i, :), json)
      if (allocated(rotations)) line = line//rotation_text(rotations(i), json)
      do k = 1, size(derived)
        line = line//derived_text(derived(k), i, json)
      end do
      if (allocated(kinds_of_entries)) line = line//kind_text(whole(kinds_of_entries(i)), json)
      if (json) body = body//trim(merge(', ', '  ', i > 1))//'{'//line//'}'
      if (.not. json) body = body//new_line('a')//'    '//line
    end do
    if (json) body = body//']'
  end subroutine add_catalogue

  !> The derived quantities of the attractors.
  subroutine read_derived(reader, length, derived, error)
    type(reader_t), intent(in) :: reader
    integer, intent(in) :: length
    type(derived_column_t), allocatable, intent(out) :: derived(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names(:)
    logical, allocatable :: are_groups(:)
    type(derived_column_t) :: column
    integer :: i
    allocate (derived(0))
    call reader%children('/catalogue', names, are_groups, error)
    if (allocated(error)) return
    do i = 1, size(names)
      if (.not. starts_with(names(i), 'derived_')) cycle
      column%name = trim(names(i))
      call read_if_there(reader, column%name, length, column%values, error)
      if (allocated(error)) return
      if (allocated(column%values)) derived = [derived, column]
    end do
  end subroutine read_derived

  function derived_text(column, entry, json) result(text)
    type(derived_column_t), intent(in) :: column
    integer, intent(in) :: entry
    logical, intent(in) :: json
    character(len=:), allocatable :: text
    if (json) then
      text = ', '//json_text(column%name)//': '//json_number(column%values(entry))
    else if (ieee_is_nan(column%values(entry))) then
      text = ', '//column%name//' not known'
    else
      text = ', '//column%name//' '//to_text(column%values(entry), 6)
    end if
  end function derived_text

  !> A column of the catalogue; not allocated where the file has none, or one of another length.
  subroutine read_if_there(reader, name, length, values, error)
    type(reader_t), intent(in) :: reader
    character(len=*), intent(in) :: name
    integer, intent(in) :: length
    real(wp), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    if (.not. reader%has('/catalogue/'//name)) return
    call reader%read_values('/catalogue/'//name, values, error)
    if (.not. allocated(values)) return
    if (size(values) /= length) deallocate (values)
  end subroutine read_if_there

  !> What every file has of an attractor: its values in the order of `columns`.
  function marks_text(values, json) result(line)
    real(wp), intent(in) :: values(:)
    logical, intent(in) :: json
    character(len=:), allocatable :: line
    integer :: k
    line = ''
    do k = 1, size(columns)
      if (len(line) > 0) line = line//', '
      if (json) line = line//json_text(trim(columns(k)))//': '
      if (.not. json) line = line//trim(columns(k))//' '
      select case (columns(k))
      case ('regime')
        line = line//quoted(regime_text(values(k)))
      case ('event_word')
        line = line//quoted(word_text(whole(values(k))))
      case ('amplitude', 'impacts_per_period')
        line = line//to_text(values(k), 6)
      case default
        line = line//to_text(whole(values(k)))
      end select
    end do

  contains

    function quoted(text)
      character(len=*), intent(in) :: text
      character(len=:), allocatable :: quoted
      quoted = text
      if (json) quoted = json_text(text)
    end function quoted

  end function marks_text

  !> The name of a regime, or 'unknown' in a file that is not sound.
  function regime_text(code) result(name)
    real(wp), intent(in) :: code
    character(len=:), allocatable :: name
    name = 'unknown'
    if (code >= lbound(regime_names, 1) .and. code <= ubound(regime_names, 1)) name = trim(regime_names(nint(code)))
  end function regime_text

  !> Rotation number, where there is one.
  function rotation_text(rotation, json) result(text)
    real(wp), intent(in) :: rotation
    logical, intent(in) :: json
    character(len=:), allocatable :: text
    text = ''
    if (json) then
      text = ', "rotation_number": null'
      if (.not. ieee_is_nan(rotation)) text = ', "rotation_number": '//to_text(rotation)
    else if (abs(rotation) > 0) then
      text = ', rotation_number '//to_text(rotation, 4)
    end if
  end function rotation_text

  !> The kind of an attractor; in words only what is no cycle and no rest.
  function kind_text(kind, json) result(text)
    integer(int64), intent(in) :: kind
    logical, intent(in) :: json
    character(len=:), allocatable :: text
    text = ''
    if (kind < 1 .or. kind > last_kind) return
    if (json) then
      text = ', "kind": '//json_text(trim(kind_names(kind)))
    else if (kind == kind_chaotic) then
      text = ', chaotic'
    else if (kind == kind_family) then
      text = ', a family of cycles'
    else if (kind == kind_not_known) then
      text = ', not known to be periodic: perhaps a long transient'
    end if
  end function kind_text

  !> The nearest integer; 0 for what has none.
  pure integer(int64) function whole(value)
    real(wp), intent(in) :: value
    whole = 0
    if (abs(value) < 2.0_wp**62) whole = nint(value, int64)
  end function whole

end module info_catalogue
