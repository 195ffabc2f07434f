! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The text of a case while it is read: its entries with overrides applied, the keys that may
!> occur, and the problems found so far with their positions.
module case_source
  use case_overrides, only: apply_override, is_or_is_below, source_entry_t
  use errors, only: error_t, fail
  use old_keys, only: current_key
  use status, only: exit_bad_case, exit_no_input
  use structure_data, only: structure_file_reader
  use suggest, only: nearest_word
  use text, only: join, replace_all, starts_with, to_text
  use written_names, only: as_written, of_parts_only, read_as_t
  use toml_bindings, only: read_toml, toml_array, toml_boolean, toml_entry_t, toml_float, toml_integer, toml_string, toml_table
  implicit none
  private

  public :: open_source, find, origin_of, list_size, know, know_all_below, enter_table, report, assume, forgive_missing, &
    report_unknown, problems_of, description, has_problems

  type :: problem_t
    integer :: line
    character(len=:), allocatable :: path, text
    !> Something is not there that is needed.
    logical :: missing = .false.
    !> A file that the case names cannot be opened.
    logical :: file_missing = .false.
  end type problem_t

  integer, parameter :: path_length = 96

  type, public :: case_source_t
    !> Name of the file in messages.
    character(len=:), allocatable :: name
    type(source_entry_t), allocatable :: entries(:)
    !> Paths of the keys that may occur.
    character(len=path_length), allocatable :: known(:)
    type(problem_t), allocatable :: problems(:)
    !> Tables that are read under other names.
    type(read_as_t), allocatable :: tables(:)
    !> What its readers decided that it does not state, separated by semicolons.
    character(len=:), allocatable :: assumed
    !> Reads HDF5 files of structures, where the program can.
    procedure(structure_file_reader), pointer, nopass :: structure_file => null()
  end type case_source_t

contains

  !> Parses `text` and puts the overrides ('key.path=value' in TOML syntax) on top of it.
  subroutine open_source(source, text, name, overrides, error)
    type(case_source_t), intent(out) :: source
    character(len=*), intent(in) :: text, name, overrides(:)
    type(error_t), allocatable, intent(out) :: error
    type(toml_entry_t), allocatable :: entries(:)
    integer :: i
    source%name = name
    source%assumed = ''
    allocate (source%known(0), source%problems(0), source%tables(0))
    call read_toml(text, name, entries, error)
    if (allocated(error)) return
    allocate (source%entries(size(entries)))
    do i = 1, size(entries)
      source%entries(i)%entry = entries(i)
    end do
    call rename_old_keys(source)
    do i = 1, size(overrides)
      call apply_override(source%entries, trim(overrides(i)), error)
      if (allocated(error)) return
      call rename_old_keys(source)
    end do
    call report_old_keys(source)
  end subroutine open_source

  !> Gives keys of older case files their current names, where those are not there as well.
  subroutine rename_old_keys(source)
    type(case_source_t), intent(inout) :: source
    character(len=:), allocatable :: current
    integer :: i
    do i = 1, size(source%entries)
      associate (entry => source%entries(i)%entry)
        current = current_key(entry%path, of_table=entry%kind == toml_table)
        if (current == entry%path) cycle
        if (find(source, current) == 0) entry%path = current
      end associate
    end do
  end subroutine rename_old_keys

  !> A key that is there under both names is an error.
  subroutine report_old_keys(source)
    type(case_source_t), intent(inout) :: source
    character(len=:), allocatable :: current, path
    integer :: i
    do i = 1, size(source%entries)
      path = source%entries(i)%entry%path
      current = current_key(path, of_table=source%entries(i)%entry%kind == toml_table)
      if (current == path .or. path(len(path):) == ']') cycle
      call report(source, path, 'found beside '''//current//''', its current name; allowed one of them')
      call know(source, path)
      call know_all_below(source, path)
    end do
  end subroutine report_old_keys

  !> Position of a path in the entries, 0 if it is absent; the search may begin at `from`.
  pure integer function find(source, path, from)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    integer, intent(in), optional :: from
    integer :: i, first
    first = 1
    if (present(from)) first = from
    do i = first, size(source%entries)
      find = i
      if (source%entries(i)%entry%path == path) return
    end do
    find = 0
  end function find

  !> Number of elements of the list at `path`, 0 if there is none.
  pure integer function list_size(source, path)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    integer :: at
    list_size = 0
    at = find(source, path)
    if (at == 0) return
    if (source%entries(at)%entry%kind == toml_array) list_size = int(source%entries(at)%entry%integer)
  end function list_size

  !> Declares that the key `path` may occur.
  pure subroutine know(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    call append(source%known, path)
  end subroutine know

  pure subroutine append(list, word)
    character(len=path_length), allocatable, intent(inout) :: list(:)
    character(len=*), intent(in) :: word
    character(len=path_length), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    longer(size(longer)) = word
    call move_alloc(longer, list)
  end subroutine append

  !> Accepts every key of a table whose contents cannot be checked.
  pure subroutine know_all_below(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    integer :: i
    do i = 1, size(source%entries)
      if (is_or_is_below(source%entries(i)%entry%path, path)) call know(source, source%entries(i)%entry%path)
    end do
  end subroutine know_all_below

  !> Notes what is assumed where the source has no value.
  pure subroutine assume(source, what)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: what
    if (len(source%assumed) > 0 .and. len(what) > 0) source%assumed = source%assumed//'; '
    source%assumed = source%assumed//what
  end subroutine assume

  !> Whether the table `path` is in the source; anything else under that name is a problem.
  subroutine enter_table(source, path, found)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    logical, intent(out) :: found
    integer :: at
    at = find(source, path)
    found = at > 0
    do at = 1, size(source%entries)
      if (starts_with(source%entries(at)%entry%path, path//'.')) found = .true.
    end do
    at = find(source, path)
    if (at == 0) return
    if (source%entries(at)%entry%kind == toml_table) return
    call report(source, path, 'found '//description(source%entries(at)%entry)//', allowed a table ['//path//']')
    call know_all_below(source, path)
  end subroutine enter_table

  !> Notes a problem with the key `path` (or the table that lacks it); `shown` replaces the key in
  !> the message. `missing`: something that is needed is not there; `file_missing`: a file that cannot be opened.
  subroutine report(source, path, problem, shown, missing, file_missing)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, problem
    character(len=*), intent(in), optional :: shown
    logical, intent(in), optional :: missing, file_missing
    type(problem_t) :: new
    character(len=:), allocatable :: above, location
    integer :: line
    call location_of_key(source, path, location, line)
    above = path
    if (present(shown)) above = shown
    new = problem_t(line, path, location//': '//as_written(source%tables, 'key '''//above//''': '//problem))
    if (present(missing)) new%missing = missing
    if (present(file_missing)) new%file_missing = file_missing
    call insert(source, new)
  end subroutine report

  !> Where the key `path`, or the table that lacks it, comes from: file and line, or the `--set` that gave it; `line` is 0 without
  !> any, `huge` for an override.
  pure subroutine location_of_key(source, path, location, line)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: location
    integer, intent(out) :: line
    character(len=:), allocatable :: above
    integer :: at
    above = path
    do
      at = find(source, above)
      if (at > 0 .or. len(above) == 0) exit
      above = above(1:max(scan(above, '.[', back=.true.) - 1, 0))
    end do
    location = source%name
    line = 0
    if (at == 0) return
    line = source%entries(at)%entry%line
    location = location//':'//to_text(line)
    if (.not. allocated(source%entries(at)%override)) return
    line = huge(line)
    location = '--set '//source%entries(at)%override
  end subroutine location_of_key

  !> Where a key comes from, in the words of messages.
  pure function origin_of(source, path) result(location)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: location
    integer :: line
    call location_of_key(source, path, location, line)
  end function origin_of

  !> Takes back what is missing below a table; `lacks`: whether anything was.
  subroutine forgive_missing(source, table, lacks)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: table
    logical, intent(out) :: lacks
    logical :: kept(size(source%problems))
    integer :: i
    do i = 1, size(kept)
      kept(i) = .not. (source%problems(i)%missing .and. is_or_is_below(source%problems(i)%path, table))
    end do
    lacks = .not. all(kept)
    source%problems = pack(source%problems, kept)
  end subroutine forgive_missing

  !> Keeps the problems in the order of the lines, overrides last.
  subroutine insert(source, problem)
    type(case_source_t), intent(inout) :: source
    type(problem_t), intent(in) :: problem
    integer :: at
    at = count(source%problems%line <= problem%line)
    source%problems = [source%problems(:at), problem, source%problems(at + 1:)]
  end subroutine insert

  !> Whether a problem has been noted, with `below` one of this key, or below it.
  pure logical function has_problems(source, below)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in), optional :: below
    integer :: i
    has_problems = size(source%problems) > 0
    if (.not. present(below)) return
    has_problems = .false.
    do i = 1, size(source%problems)
      has_problems = has_problems .or. is_or_is_below(source%problems(i)%path, below)
    end do
  end function has_problems

  !> The problems as one error, a line each; none leaves `error` unallocated. Code 65, or 66 if files are missing and all else
  !> is well.
  subroutine problems_of(source, error)
    type(case_source_t), intent(in) :: source
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: message
    integer :: i
    if (.not. has_problems(source)) return
    message = source%problems(1)%text
    do i = 2, size(source%problems)
      message = message//new_line('a')//source%problems(i)%text
    end do
    call fail(error, merge(exit_no_input, exit_bad_case, all(source%problems%file_missing)), message)
  end subroutine problems_of

  !> Notes every entry that no reader has asked for.
  subroutine report_unknown(source)
    type(case_source_t), intent(inout) :: source
    character(len=:), allocatable :: path, refused
    integer :: i
    refused = ''
    do i = 1, size(source%entries)
      path = source%entries(i)%entry%path
      if (is_known(source, path)) cycle
      if (len(refused) > 0) then
        if (is_or_is_below(path, refused)) cycle
      end if
      refused = unknown_part(source, path)
      call report(source, path, unknown_text(source, refused), refused)
    end do
  end subroutine report_unknown

  !> The highest table of a path that is unknown, or the path itself.
  pure function unknown_part(source, path) result(part)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: part
    integer :: i
    logical :: in_quotes
    in_quotes = .false.
    do i = 1, len(path)
      if (path(i:i) == '"') in_quotes = .not. in_quotes
      if (path(i:i) /= '.' .or. in_quotes) cycle
      part = path(1:i - 1)
      if (.not. is_known(source, part)) return
    end do
    part = path
  end function unknown_part

  !> A known key, a table that holds one, or a part of a known key's value.
  pure logical function is_known(source, path)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    integer :: i
    is_known = .true.
    do i = 1, size(source%known)
      if (is_or_is_below(path, trim(source%known(i)))) return
      if (is_or_is_below(trim(source%known(i)), path)) return
    end do
    is_known = .false.
  end function is_known

  pure function unknown_text(source, path) result(text)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text, above, meant
    character(len=path_length), allocatable :: allowed(:)
    integer :: mark
    mark = scan(path(1:index(path//'"', '"') - 1), '.', back=.true.)
    above = path(1:mark)
    allowed = names_below(source, above)
    text = 'unknown'
    meant = nearest_word(path(mark + 1:), allowed)
    if (len(meant) > 0) text = text//' (did you mean '''//meant//'''?)'
    if (size(allowed) > 0) then
      text = text//'; allowed '//join(allowed, ', ')
    else
      ! A family of tables, each with a name of its own.
      text = text//'; allowed tables ['//above//'NAME]'
    end if
  end function unknown_text

  !> The names that may follow `above` ('' or a table's path with its dot).
  pure function names_below(source, above) result(names)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: above
    character(len=path_length), allocatable :: names(:)
    character(len=path_length) :: name
    integer :: i
    allocate (names(0))
    do i = 1, size(source%known)
      if (.not. starts_with(source%known(i), above)) cycle
      name = source%known(i)(len(above) + 1:)
      name = name(1:scan(trim(name)//'.', '.[') - 1)
      if (len_trim(name) == 0) cycle
      if (any(source%tables%read == above(:max(0, len(above) - 1))) .and. any(of_parts_only == name)) cycle
      if (all(names /= name)) call append(names, trim(name))
    end do
  end function names_below

  !> What an entry holds, for messages.
  pure function description(entry) result(text)
    type(toml_entry_t), intent(in) :: entry
    character(len=:), allocatable :: text
    select case (entry%kind)
    case (toml_integer)
      text = to_text(entry%integer)
    case (toml_float)
      text = to_text(entry%real)
    case (toml_string)
      text = '"'//replace_all(entry%string, new_line('a'), '\n')//'"'
    case (toml_boolean)
      text = to_text(entry%integer == 1)
    case (toml_table)
      text = 'a table'
    case (toml_array)
      text = 'a list'
    case default
      text = 'a date'
    end select
  end function description

end module case_source
