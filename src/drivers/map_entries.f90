! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The entries of a map's catalogue that have no period, each with a start of the map that led to it.
module map_entries
  use attractors, only: kind_family, kind_rest
  use case_reader, only: load_case_text
  use case_setup, only: grid_of
  use case_type, only: case_t
  use errors, only: error_t, fail
  use grid, only: grid_t, point_slice
  use kinds, only: int64, wp
  use map_reader, only: open_final, reader_t
  use map_verify, only: probe_file, verify_file
  use status, only: exit_bad_case
  use team, only: team_t
  implicit none
  private

  public :: read_entries

  !> An entry without a period, and a start of the map that converged to it.
  type, public :: entry_t
    integer :: label = 0
    integer(int64) :: slice = 0
    integer, allocatable :: index(:)
  end type entry_t

contains

  !> What `read_map` finds, on every rank, of a file whose checksums rank 0 has verified.
  subroutine read_entries(path, team, the_case, grid, entries, total, error)
    character(len=*), intent(in) :: path
    class(team_t), intent(in) :: team
    type(case_t), intent(out) :: the_case
    type(grid_t), intent(out) :: grid
    type(entry_t), allocatable, intent(out) :: entries(:)
    integer, intent(out) :: total
    type(error_t), allocatable, intent(out) :: error
    type(reader_t) :: reader
    type(error_t), allocatable :: ignored
    integer :: datasets
    total = 0
    if (team%is_root()) then
      ! A trial in another process cannot be made beside MPI.
      if (team%size() == 1) call probe_file(path, error)
      ! What is no file of Separatrix is not called damaged.
      if (.not. allocated(error)) call open_final(path, reader, error)
      if (.not. allocated(error)) call reader%close(error)
      if (.not. allocated(error)) call verify_file(path, error, datasets)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call open_final(path, reader, error)
    if (.not. allocated(error)) then
      call read_map(reader, the_case, grid, entries, total, error)
      call reader%close(ignored)
    end if
    call team%agree(error)
  end subroutine read_entries

  !> The case of a map, its grid, and the entries without a period among the `total`.
  subroutine read_map(reader, the_case, grid, entries, total, error)
    type(reader_t), intent(in) :: reader
    type(case_t), intent(out) :: the_case
    type(grid_t), intent(out) :: grid
    type(entry_t), allocatable, intent(out) :: entries(:)
    integer, intent(out) :: total
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: kind, resolved
    character(len=128) :: no_overrides(0)
    real(wp), allocatable :: columns(:, :), kinds(:)
    logical, allocatable :: wanted(:)
    logical :: has_catalogue
    integer :: i
    integer, allocatable :: rows(:)
    total = 0
    call reader%text_attribute('/', 'kind', kind, error)
    if (allocated(error)) return
    has_catalogue = reader%has('/catalogue/period')
    if (kind /= 'basin' .or. .not. has_catalogue) then
      call fail(error, exit_bad_case, ''''//reader%path//''' is a file of kind '//kind// &
                ', allowed a map (basin) with a catalogue, or a case')
      return
    end if
    call reader%read_text('/provenance/resolved_case', resolved, error)
    if (.not. allocated(error)) call load_case_text(resolved, reader%path//' (resolved case)', no_overrides, the_case, error)
    if (.not. allocated(error)) call reader%read_columns([character(len=20) :: '/catalogue/slice', '/catalogue/attractor', &
                                                          '/catalogue/period'], columns, error)
    if (allocated(error)) return
    grid = grid_of(the_case, the_case%axes)
    total = size(columns, 1)
    wanted = nint(columns(:, 3)) == 0
    if (reader%has('/catalogue/kind')) then
      call reader%read_values('/catalogue/kind', kinds, error)
      if (allocated(error)) return
      wanted = wanted .and. nint(kinds) /= kind_rest .and. nint(kinds) /= kind_family
    end if
    rows = pack([(i, i=1, total)], wanted)
    allocate (entries(size(rows)))
    do i = 1, size(rows)
      entries(i)%slice = nint(columns(rows(i), 1), int64)
      entries(i)%label = nint(columns(rows(i), 2))
    end do
    if (size(entries) > 0) call find_starts(reader, grid, entries, error)
  end subroutine read_map

  !> For each entry the first point of the map that converged to it; none is left without an index where there is one.
  subroutine find_starts(reader, grid, entries, error)
    type(reader_t), intent(in) :: reader
    type(grid_t), intent(in) :: grid
    type(entry_t), intent(inout) :: entries(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: lengths(:), lower(:), extent(:)
    real(wp), allocatable :: labels(:)
    integer :: row, i, n, left
    integer, allocatable :: index(:)
    call reader%lengths('/attractor', lengths, error)
    if (allocated(error)) return
    n = size(lengths)
    if (n /= size(grid%axes)) then
      call fail(error, exit_bad_case, ''''//reader%path//''' has not the axes of its case')
      return
    end if
    lower = 0*lengths
    extent = lengths
    extent(1) = 1
    left = size(entries)
    do row = 0, int(lengths(1)) - 1
      lower(1) = row
      call reader%read_block('/attractor', lower, extent, labels, error)
      if (allocated(error)) return
      do i = 1, size(entries)
        if (allocated(entries(i)%index)) cycle
        call look_for(entries(i), grid, labels, int(lengths), row, index)
        if (.not. allocated(index)) cycle
        entries(i)%index = index
        left = left - 1
      end do
      if (left == 0) return
    end do
  end subroutine find_starts

  !> The index of the first of the `labels` of a row of the first axis that is the entry's, in its slice; not allocated without.
  pure subroutine look_for(entry, grid, labels, lengths, row, index)
    type(entry_t), intent(in) :: entry
    type(grid_t), intent(in) :: grid
    real(wp), intent(in) :: labels(:)
    integer, intent(in) :: lengths(:), row
    integer, allocatable, intent(out) :: index(:)
    integer :: here(size(lengths)), k, at, rest
    do at = 1, size(labels)
      if (nint(labels(at)) /= entry%label) cycle
      rest = at - 1
      do k = size(lengths), 2, -1
        here(k) = 1 + modulo(rest, lengths(k))
        rest = rest/lengths(k)
      end do
      here(1) = row + 1
      if (point_slice(grid, here) /= entry%slice) cycle
      index = here
      return
    end do
  end subroutine look_for

end module map_entries
