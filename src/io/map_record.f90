! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Whole numbers that a run writes down in its working file on the way, row by row, so that it goes on the same way after an
!> interruption. The last of a row checks the others: a row that was not written whole counts as not written.
module map_record
  use checksum, only: crc32
  use errors, only: error_t
  use h5, only: h5_close, h5_close_dataset, h5_dataset_t, h5_file_t, h5_open, h5_open_dataset, h5_read, h5_write
  use kinds, only: int64, int8, real64
  use map_file, only: map_file_t, working_path
  use map_layout, only: path_of
  use map_schema, only: schema_t, type_int64
  use team, only: team_t
  use value_types, only: bytes_of, to_bytes
  implicit none
  private

  public :: add_record, read_record, rows_of, write_row

contains

  !> Adds the empty record `/group/name` with the dimensions `rows` and `columns`, whose lengths the schema has.
  subroutine add_record(schema, group, name, rows, columns, long_name)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: group, name, rows, columns, long_name
    character(len=64) :: dimensions(2)
    dimensions = [character(len=64) :: rows, columns]
    call schema%add_variable(name, type_int64, dimensions, group=group, long_name=long_name, &
                             data=spread(0.0_real64, 1, int(product(schema%lengths_of(dimensions)))))
  end subroutine add_record

  !> The rows (columns less the last, rows) of a record that were written. Collective.
  subroutine read_record(file, team, group, name, rows, error)
    type(map_file_t), intent(inout) :: file
    class(team_t), intent(in) :: team
    character(len=*), intent(in) :: group, name
    integer(int64), allocatable, intent(out) :: rows(:, :)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: part
    type(h5_dataset_t) :: dataset
    integer(int8), allocatable :: bytes(:)
    integer(int64), allocatable :: lengths(:), stored(:)
    integer :: i
    lengths = lengths_of(file%schema, group, name)
    allocate (bytes(product(lengths)*bytes_of(type_int64)), stored(product(lengths)))
    if (team%is_root()) then
      call h5_open(working_path(file%path), part, error)
      if (.not. allocated(error)) call h5_open_dataset(part, path_of(group, name), dataset, error)
      if (.not. allocated(error)) call h5_read(dataset, bytes, error)
      if (.not. allocated(error)) call h5_close_dataset(dataset, error)
      call h5_close(part, ignored)
      if (.not. allocated(error)) stored = transfer(bytes, stored)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call team%broadcast_integers(stored)
    rows = rows_of(real(stored, real64), int(lengths(2)))
    do i = 1, size(rows, 2)
      call keep_row(file%schema, group, name, i, rows(:, i))
    end do
  end subroutine read_record

  !> The rows that were written, of the values of a record of so many columns.
  function rows_of(values, columns) result(rows)
    real(real64), intent(in) :: values(:)
    integer, intent(in) :: columns
    integer(int64), allocatable :: rows(:, :)
    integer(int64) :: all_rows(columns, size(values)/columns)
    integer :: i, count
    all_rows = reshape(nint(values, int64), shape(all_rows))
    count = 0
    do i = 1, size(all_rows, 2)
      if (all_rows(columns, i) /= check_of(all_rows(:columns - 1, i))) exit
      count = i
    end do
    rows = all_rows(:columns - 1, :count)
  end function rows_of

  !> Writes row number `row` of a record, in the file and in the schema of what becomes of it. Collective: when it returns, the
  !> row is there for all.
  subroutine write_row(file, team, group, name, row, values, error)
    type(map_file_t), intent(inout) :: file
    class(team_t), intent(in) :: team
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: row
    integer(int64), intent(in) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_file_t) :: part
    type(h5_dataset_t) :: dataset
    type(error_t), allocatable :: ignored
    integer(int8) :: bytes(8*(size(values) + 1))
    integer(int64) :: lower(2)
    if (team%is_root()) then
      call h5_open(working_path(file%path), part, error, writable=.true.)
      if (.not. allocated(error)) call h5_open_dataset(part, path_of(group, name), dataset, error)
      call to_bytes(type_int64, real([values, check_of(values)], real64), bytes)
      lower = [int(row - 1, int64), 0_int64]
      if (.not. allocated(error)) call h5_write(dataset, bytes, error, lower, [1_int64, size(values, kind=int64) + 1])
      if (.not. allocated(error)) call h5_close_dataset(dataset, error)
      if (allocated(error)) call h5_close(part, ignored)
      if (.not. allocated(error)) call h5_close(part, error)
      if (.not. allocated(error)) call file%keep_description(error)
    end if
    call team%agree(error)
    if (.not. allocated(error)) call keep_row(file%schema, group, name, row, values)
  end subroutine write_row

  !> Rows and columns of a record.
  pure function lengths_of(schema, group, name) result(lengths)
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: group, name
    integer(int64) :: lengths(2)
    integer :: i
    lengths = 0
    do i = 1, size(schema%variables)
      associate (variable => schema%variables(i))
        if (variable%group == group .and. variable%name == name) lengths = schema%lengths_of(variable%dimensions)
      end associate
    end do
  end function lengths_of

  !> Puts a row that is in the working file into the schema, from which the final file takes it.
  subroutine keep_row(schema, group, name, row, values)
    type(schema_t), intent(inout) :: schema
    character(len=*), intent(in) :: group, name
    integer, intent(in) :: row
    integer(int64), intent(in) :: values(:)
    integer :: i, columns
    columns = size(values) + 1
    do i = 1, size(schema%variables)
      if (schema%variables(i)%group /= group .or. schema%variables(i)%name /= name) cycle
      schema%variables(i)%data((row - 1)*columns + 1:row*columns) = real([values, check_of(values)], real64)
    end do
  end subroutine keep_row

  !> Number by which a row is recognised; never 0.
  integer(int64) function check_of(values) result(check)
    integer(int64), intent(in) :: values(:)
    integer(int8) :: bytes(8*size(values))
    call to_bytes(type_int64, real(values, real64), bytes)
    check = 1 + crc32(bytes, 0_int64)
  end function check_of

end module map_record
