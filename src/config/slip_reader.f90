! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> One body with elements of spring and slider, in the short form of a case: its tables become those of parts, [body.body],
!> [spring.restoring], [friction.friction] and [drive.drive]. Only parts have the sticking of such elements.
module slip_reader
  use case_overrides, only: is_or_is_below, source_entry_t
  use case_source, only: case_source_t, find, report
  use law_table, only: added_families, effect_family
  use part_names, only: is_table
  use part_reader, only: has_parts
  use text, only: starts_with
  use written_names, only: of_parts_only, read_as_t
  use toml_bindings, only: toml_array, toml_float, toml_string
  implicit none
  private

  public :: write_out_slip

  !> Tables of the short form, and of the parts that they become.
  character(len=9), parameter :: tables(4) = [character(len=9) :: 'body', 'restoring', 'friction', 'drive']
  character(len=17), parameter :: parts(4) = [character(len=17) :: 'body.body', 'spring.restoring', 'friction.friction', &
    'drive.drive']
  character(len=15), parameter :: laws(2) = [character(len=15) :: 'maxwell_slip', 'elastic_coulomb']

contains

  !> Writes one body with such a friction as parts; any other case remains.
  subroutine write_out_slip(source)
    type(case_source_t), intent(inout) :: source
    character(len=:), allocatable :: drive, path
    logical :: turns, has_foot
    integer :: i
    if (all(laws /= text_of(source, 'friction.law')) .or. has_parts(source)) return
    if (find(source, 'body.law') > 0 .and. text_of(source, 'body.law') /= 'point_mass') return
    if (.not. is_admitted(source)) return
    drive = text_of(source, 'drive.law')
    turns = text_of(source, 'restoring.law') == 'pendulum'
    has_foot = drive == 'harmonic' .or. drive == 'fourier'
    call check_keys(source)
    call remove(source, 'body.law')
    if (text_of(source, 'restoring.law') == 'none') call remove(source, 'restoring')
    if (drive == 'none') call remove(source, 'drive')
    do i = 1, size(source%entries)
      path = source%entries(i)%entry%path
      if (path == 'sweep.parameter' .or. (starts_with(path, 'axis[') .and. index(path, '].name') > 0)) then
        source%entries(i)%entry%string = new_path(text_of(source, path), turns)
      end if
      if (has_foot .and. path == 'drive.law') source%entries(i)%entry%string = 'motion'
      source%entries(i)%entry%path = new_path(path, turns)
    end do
    source%tables = [(read_as_t(tables(i), parts(i)), i=1, size(tables))]
    if (turns) source%tables = [read_as_t('body.mass', 'body.body.inertia'), source%tables]
    call add_ends(source, 'friction.friction', has_foot=.false.)
    if (is_table(source, 'spring.restoring')) call add_ends(source, 'spring.restoring', has_foot)
    if (drive == 'force') call add_text(source, 'drive.drive.body', 'body')
    if (.not. has_foot) return
    call add_text(source, 'drive.drive.body', 'foot')
    call add_number(source, 'body.foot.mass')
  end subroutine write_out_slip

  !> Whether the other laws of the body can be written as parts.
  logical function is_admitted(source)
    type(case_source_t), intent(inout) :: source
    integer :: i
    is_admitted = goes('restoring', [character(len=8) :: 'none', 'linear', 'pendulum']) .and. &
                  goes('contact', [character(len=8) :: 'none']) .and. &
                  goes('drive', [character(len=8) :: 'none', 'force', 'harmonic', 'fourier', 'base'])
    is_admitted = is_admitted .and. is_table(source, 'body') .and. .not. is_table(source, effect_family)
    do i = 1, size(added_families)
      is_admitted = is_admitted .and. .not. is_table(source, trim(added_families(i)))
    end do
    ! Beside 'none' other keys are errors, which the short form reports.
    is_admitted = is_admitted .and. .not. (is_idle('restoring') .or. is_idle('drive'))
    if (text_of(source, 'drive.law') == 'harmonic' .or. text_of(source, 'drive.law') == 'fourier') then
      is_admitted = is_admitted .and. text_of(source, 'restoring.law') == 'linear' .and. find(source, 'drive.ratio') == 0
    end if

  contains

    logical function goes(table, allowed)
      character(len=*), intent(in) :: table
      character(len=8), intent(in) :: allowed(:)
      goes = .not. is_table(source, table) .or. any(allowed == text_of(source, table//'.law'))
    end function goes

    pure logical function is_idle(table)
      character(len=*), intent(in) :: table
      integer :: k
      is_idle = text_of(source, table//'.law') == 'none' .and. &
                count([(starts_with(source%entries(k)%entry%path, table//'.'), k=1, size(source%entries))]) > 1
    end function is_idle

  end function is_admitted

  !> Reports keys that only parts have, which are none of the short form, and those that it needs and parts do not.
  subroutine check_keys(source)
    type(case_source_t), intent(inout) :: source
    character(len=:), allocatable :: path
    integer :: i, k
    do i = 1, size(tables)
      do k = 1, size(of_parts_only)
        path = trim(tables(i))//'.'//trim(of_parts_only(k))
        if (find(source, path) == 0) cycle
        call report(source, path, 'unknown; allowed beside [body.NAME]')
        call remove(source, path)
      end do
    end do
    if (text_of(source, 'restoring.law') == 'linear') call need('restoring.stiffness')
    if (any(text_of(source, 'drive.law') == [character(len=8) :: 'force', 'harmonic'])) call need('drive.amplitude')

  contains

    subroutine need(key)
      character(len=*), intent(in) :: key
      if (find(source, key) == 0) call report(source, key, 'missing', missing=.true.)
    end subroutine need

  end subroutine check_keys

  !> A path of the short form as that of a part.
  pure function new_path(path, turns) result(new)
    character(len=*), intent(in) :: path
    logical, intent(in) :: turns
    character(len=:), allocatable :: new
    integer :: i
    new = path
    do i = 1, size(tables)
      if (path /= tables(i) .and. .not. starts_with(path, trim(tables(i))//'.')) cycle
      new = trim(parts(i))//path(len_trim(tables(i)) + 1:)
      if (turns .and. new == 'body.body.mass') new = 'body.body.inertia'
      return
    end do
  end function new_path

  !> The text at a path, '' if it has none.
  pure function text_of(source, path) result(text)
    type(case_source_t), intent(in) :: source
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: text
    integer :: at
    text = ''
    at = find(source, path)
    if (at == 0) return
    if (source%entries(at)%entry%kind == toml_string) text = source%entries(at)%entry%string
  end function text_of

  !> Removes a key, or a table with all its keys.
  pure subroutine remove(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(source_entry_t), allocatable :: kept(:)
    logical :: stays(size(source%entries))
    integer :: i, k
    do i = 1, size(stays)
      stays(i) = .not. is_or_is_below(source%entries(i)%entry%path, path)
    end do
    allocate (kept(count(stays)))
    k = 0
    do i = 1, size(stays)
      if (.not. stays(i)) cycle
      k = k + 1
      kept(k) = source%entries(i)
    end do
    call move_alloc(kept, source%entries)
  end subroutine remove

  !> between = ["body"] or ["foot", "body"].
  pure subroutine add_ends(source, part, has_foot)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: part
    logical, intent(in) :: has_foot
    type(source_entry_t) :: list
    list%entry%path = part//'.between'
    list%entry%kind = toml_array
    list%entry%integer = merge(2, 1, has_foot)
    list%entry%string = ''
    call append(source, list)
    if (has_foot) call add_text(source, part//'.between[1]', 'foot')
    call add_text(source, part//merge('.between[2]', '.between[1]', has_foot), 'body')
  end subroutine add_ends

  pure subroutine add_text(source, path, text)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path, text
    type(source_entry_t) :: new
    new%entry%path = path
    new%entry%kind = toml_string
    new%entry%string = text
    call append(source, new)
  end subroutine add_text

  !> A mass of 1 kg, which a body with a given motion does not use.
  pure subroutine add_number(source, path)
    type(case_source_t), intent(inout) :: source
    character(len=*), intent(in) :: path
    type(source_entry_t) :: new
    new%entry%path = path
    new%entry%kind = toml_float
    new%entry%real = 1
    new%entry%string = ''
    call append(source, new)
  end subroutine add_number

  !> Appends an entry, which comes from where its part does.
  pure subroutine append(source, new)
    type(case_source_t), intent(inout) :: source
    type(source_entry_t), intent(in) :: new
    type(source_entry_t), allocatable :: longer(:)
    integer :: n, at
    n = size(source%entries)
    allocate (longer(n + 1))
    longer(:n) = source%entries
    longer(n + 1) = new
    at = find(source, new%entry%path(:index(new%entry%path, '.', back=.true.) - 1))
    if (at > 0) longer(n + 1)%entry%line = source%entries(at)%entry%line
    if (at > 0) longer(n + 1)%override = source%entries(at)%override
    call move_alloc(longer, source%entries)
  end subroutine append

end module slip_reader
