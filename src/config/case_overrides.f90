! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Values from the command line on top of the entries of a case's text.
module case_overrides
  use errors, only: error_t, fail
  use old_keys, only: current_key
  use status, only: exit_bad_case
  use text, only: replace_all
  use toml_bindings, only: read_toml, toml_array, toml_entry_t, toml_table
  implicit none
  private

  public :: apply_override, is_or_is_below

  type, public :: source_entry_t
    type(toml_entry_t) :: entry
    !> The override `key=value` that gave it; not allocated for the file.
    character(len=:), allocatable :: override
  end type source_entry_t

contains

  !> Puts `override`, 'key.path=value' with a value in TOML, on top of the entries. An element of a list goes by its index,
  !> axis[1].count, or by its name, axis.x0.count.
  subroutine apply_override(entries, override, error)
    type(source_entry_t), allocatable, intent(inout) :: entries(:)
    character(len=*), intent(in) :: override
    type(error_t), allocatable, intent(out) :: error
    type(toml_entry_t), allocatable :: added(:)
    character(len=:), allocatable :: key, problem
    integer :: mark
    mark = index(override, '=')
    key = placed(entries, trim(adjustl(override(1:max(mark - 1, 0)))))
    problem = key_problem(entries, key)
    if (mark == 0) problem = 'found no ''='', allowed KEY=VALUE'
    if (len(problem) == 0) then
      ! The value is parsed under a short name: 'axis[1].count' is a path, not a TOML key.
      call read_toml('v = '//override(mark + 1:), '', added, error)
      if (allocated(error)) then
        problem = replace_all(error%message(index(error%message, ': ') + 2:), "'v", "'"//key)
      else if (any_other_key(added)) then
        problem = 'found more than one value'
      end if
    end if
    if (len(problem) > 0) then
      call fail(error, exit_bad_case, '--set '//override//': '//problem)
      return
    end if
    call put(entries, current_key(key, of_table=added(1)%kind == toml_table), added, override)
  end subroutine apply_override

  !> The key with the index of an element instead of its name.
  pure function placed(entries, key)
    type(source_entry_t), intent(in) :: entries(:)
    character(len=*), intent(in) :: key
    character(len=:), allocatable :: placed, named
    integer :: i, at
    placed = key
    do i = 1, size(entries)
      at = name_end(entries(i)%entry)
      if (at == 0) cycle
      named = list_of(entries(i)%entry)//'.'//entries(i)%entry%string
      if (is_or_is_below(key, named)) placed = entries(i)%entry%path(:at)//key(len(named) + 1:)
    end do
  end function placed

  !> Where the index of an element ends in the path of its name, axis[1].name; 0 for every other entry.
  pure integer function name_end(entry)
    type(toml_entry_t), intent(in) :: entry
    name_end = index(entry%path, '].name', back=.true.)
    if (name_end + 5 /= len(entry%path) .or. .not. allocated(entry%string)) name_end = 0
  end function name_end

  !> The list that a path with an index belongs to.
  pure function list_of(entry)
    type(toml_entry_t), intent(in) :: entry
    character(len=:), allocatable :: list_of
    list_of = entry%path(:index(entry%path, '[', back=.true.) - 1)
  end function list_of

  pure logical function any_other_key(entries)
    type(toml_entry_t), intent(in) :: entries(:)
    integer :: i
    any_other_key = .false.
    do i = 1, size(entries)
      if (.not. is_or_is_below(entries(i)%path, 'v')) any_other_key = .true.
    end do
  end function any_other_key

  !> What is wrong with the key of an override, '' if nothing.
  pure function key_problem(entries, key) result(problem)
    type(source_entry_t), intent(in) :: entries(:)
    character(len=*), intent(in) :: key
    character(len=:), allocatable :: problem
    integer :: i
    problem = ''
    if (len(key) == 0) problem = 'the key is missing'
    if (verify(key, 'abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.[]') > 0) then
      problem = 'found the key '''//key//''', allowed letters, digits, _ and the index of a list'
    end if
    do i = 1, len(key)
      if (key(i:i) == ']' .and. index_of(entries, key(1:i)) == 0) then
        problem = 'there is no element '''//key(1:i)//''' to change'
      else if (key(i:i) == '.' .and. is_list(entries, key(1:i - 1))) then
        problem = 'there is no element '''//key//''' to change; allowed '//elements(entries, key(1:i - 1))
        return
      end if
    end do
  end function key_problem

  pure logical function is_list(entries, path)
    type(source_entry_t), intent(in) :: entries(:)
    character(len=*), intent(in) :: path
    integer :: at
    at = index_of(entries, path)
    is_list = .false.
    if (at > 0) is_list = entries(at)%entry%kind == toml_array
  end function is_list

  !> The elements of the list at `path`, by name where they have one.
  pure function elements(entries, path) result(text)
    type(source_entry_t), intent(in) :: entries(:)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer :: i
    text = path//'[1] ...'
    do i = size(entries), 1, -1
      if (name_end(entries(i)%entry) == 0) cycle
      if (list_of(entries(i)%entry) == path) text = path//'.'//entries(i)%entry%string//', '//text
    end do
  end function elements

  !> Puts the entries of a value 'v' in place of `key` and of everything below it.
  subroutine put(entries, key, values, override)
    type(source_entry_t), allocatable, intent(inout) :: entries(:)
    character(len=*), intent(in) :: key, override
    type(toml_entry_t), intent(in) :: values(:)
    type(source_entry_t) :: added(size(values))
    logical :: kept(size(entries))
    integer :: i, at
    do i = 1, size(values)
      added(i)%entry = values(i)
      added(i)%entry%path = key//values(i)%path(2:)
      added(i)%override = override
    end do
    at = index_of(entries, key)
    if (at == 0) at = size(entries) + 1
    do i = 1, size(kept)
      kept(i) = .not. is_or_is_below(entries(i)%entry%path, key)
    end do
    entries = [pack(entries(:at - 1), kept(:at - 1)), added, pack(entries(at:), kept(at:))]
  end subroutine put

  !> Position of a path in the entries, 0 if it is absent.
  pure integer function index_of(entries, path)
    type(source_entry_t), intent(in) :: entries(:)
    character(len=*), intent(in) :: path
    do index_of = 1, size(entries)
      if (entries(index_of)%entry%path == path) return
    end do
    index_of = 0
  end function index_of

  !> Whether `path` is `above` or lies in it: 'drive.sine[2]' is below 'drive.sine' and 'drive'.
  pure logical function is_or_is_below(path, above)
    character(len=*), intent(in) :: path, above
    is_or_is_below = path == above
    if (is_or_is_below .or. len(path) <= len(above)) return
    if (path(1:len(above)) /= above) return
    is_or_is_below = scan(path(len(above) + 1:len(above) + 1), '.[') == 1
  end function is_or_is_below

end module case_overrides
