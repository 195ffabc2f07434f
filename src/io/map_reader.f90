! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Reading a file of Separatrix, of any format version up to that which is written.
module map_reader
  use attribute_seal, only: verify_attributes
  use byte_file, only: byte_file_t
  use errors, only: error_t, fail
  use h5, only: h5_close_dataset, h5_dataset_t, h5_open, h5_open_dataset, h5_read
  use h5_attributes, only: h5_get_numbers, h5_has_attribute, h5_read_strings
  use h5_records, only: h5_records_extent
  use h5_stored, only: h5_check_stored
  use h5_list, only: h5_children
  use kinds, only: int64, int8, real64
  use map_layout, only: path_of
  use map_schema, only: format_version, oldest_version
  use open_file, only: open_file_t
  use slabs, only: slab, slab_count
  use status, only: exit_bad_case, exit_io, exit_no_input
  use superblock, only: is_hdf5
  use files, only: file_exists, is_empty, is_special, is_text
  use output_check, only: is_folder
  use text, only: to_text
  use tile_record, only: head_bytes, is_done, tile_records
  use value_types, only: bytes_of, from_bytes, type_names, type_string
  implicit none
  private

  public :: open_final, open_reader

  !> What `variables` reports about a dataset. `group` '' is the root.
  type, public :: variable_info_t
    character(len=:), allocatable :: group, name, type
    !> Lengths in C order; none = a scalar.
    integer(int64), allocatable :: lengths(:)
  end type variable_info_t

  type, extends(open_file_t), public :: reader_t
  contains
    procedure :: variables
    procedure :: count_tiles
    procedure :: lengths
    procedure :: read_values
    procedure :: read_columns
    procedure :: read_block
    procedure :: count_codes
    procedure :: read_strings
    procedure :: read_text
  end type reader_t

contains

  !> Opens a file for reading, also a working file. Code 66 if there is none, 74 if it is not HDF5 or
  !> not one of Separatrix, 65 if it is of a later format.
  subroutine open_final(path, reader, error)
    character(len=*), intent(in) :: path
    type(reader_t), intent(out) :: reader
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: format
    call open_reader(path, 'a file that Separatrix wrote', reader, error)
    if (allocated(error)) return
    format = ''
    if (reader%has_attribute('/', 'format')) call reader%text_attribute('/', 'format', format, error)
    if (.not. allocated(error) .and. format /= 'separatrix') call check_foreign(reader, error)
    if (.not. allocated(error)) call check_version(reader, error)
  end subroutine open_final

  !> What to call a file without the attribute that distinguishes a result: damaged where it has the provenance of one, or cannot
  !> be read.
  subroutine check_foreign(reader, error)
    type(reader_t), intent(in) :: reader
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names(:)
    logical, allocatable :: are_groups(:)
    call reader%children('/', names, are_groups, error)
    if (allocated(error)) return
    if (reader%has_attribute('/provenance', 'case_identity')) then
      call fail(error, exit_io, "'"//reader%path//"' is damaged (the attribute 'format' of '/' is missing or changed)")
    else
      call fail(error, exit_io, "'"//reader%path//"' is not a file of Separatrix")
    end if
  end subroutine check_foreign

  subroutine check_version(reader, error)
    type(reader_t), intent(in) :: reader
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: broken
    character(len=:), allocatable :: doubt
    real(real64) :: version
    if (.not. reader%has_attribute('/', 'format_version')) return
    call reader%number_attribute('/', 'format_version', version, error)
    if (allocated(error)) return
    if (version >= oldest_version .and. version <= format_version) return
    call verify_attributes(reader%file, broken)
    doubt = ''
    if (allocated(broken)) doubt = '; or it is damaged: '//broken%message
    call fail(error, exit_bad_case, ''''//reader%path//''': found format_version '//to_text(nint(version))// &
              ', this program reads '//to_text(oldest_version)//' to '//to_text(format_version)//doubt)
  end subroutine check_version

  !> Opens any HDF5 file for reading. Code 66 if there is no regular file, 65 if it is a text where `allowed` is asked
  !> for, 74 if it is not HDF5.
  subroutine open_reader(path, allowed, reader, error)
    character(len=*), intent(in) :: path, allowed
    type(reader_t), intent(out) :: reader
    type(error_t), allocatable, intent(out) :: error
    reader%path = path
    if (.not. file_exists(path)) then
      call fail(error, exit_no_input, 'there is no file '''//path//'''')
    else if (is_folder(path)) then
      call fail(error, exit_no_input, ''''//path//''' is a folder')
    else if (is_special(path)) then
      call fail(error, exit_no_input, ''''//path//''' is not a regular file')
    else if (is_text(path)) then
      call fail(error, exit_bad_case, ''''//path//''' is a text, allowed '//allowed)
    else if (is_empty(path)) then
      call fail(error, exit_io, ''''//path//''' is empty, allowed '//allowed)
    else if (.not. is_hdf5(path)) then
      call fail(error, exit_io, ''''//path//''' is no HDF5 file, or its beginning is damaged; allowed '//allowed)
    end if
    if (allocated(error)) return
    call h5_open(path, reader%file, error)
  end subroutine open_reader

  !> The variables of the root and of its groups in the order of the file, without dimensions that have
  !> no coordinates.
  subroutine variables(self, list, error)
    class(reader_t), intent(in) :: self
    type(variable_info_t), allocatable, intent(out) :: list(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names(:)
    logical, allocatable :: are_groups(:)
    integer :: i
    allocate (list(0))
    call add_group(self, '', list, error)
    if (allocated(error)) return
    call h5_children(self%file, '/', names, are_groups, error)
    if (allocated(error)) return
    do i = 1, size(names)
      if (are_groups(i)) call add_group(self, trim(names(i)), list, error)
      if (allocated(error)) return
    end do
  end subroutine variables

  subroutine add_group(self, group, list, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: group
    type(variable_info_t), allocatable, intent(inout) :: list(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names(:), path
    logical, allocatable :: are_groups(:)
    type(h5_dataset_t) :: dataset
    integer :: i
    call h5_children(self%file, '/'//group, names, are_groups, error)
    if (allocated(error)) return
    do i = 1, size(names)
      if (are_groups(i)) cycle
      path = path_of(group, trim(names(i)))
      if (is_bare_dimension(self, path) .or. path == tile_records) cycle
      call h5_open_dataset(self%file, path, dataset, error)
      if (allocated(error)) return
      call push(list, group, trim(names(i)), dataset)
      call h5_close_dataset(dataset, error)
      if (allocated(error)) return
    end do
  end subroutine add_group

  subroutine push(list, group, name, dataset)
    type(variable_info_t), allocatable, intent(inout) :: list(:)
    character(len=*), intent(in) :: group, name
    type(h5_dataset_t), intent(in) :: dataset
    type(variable_info_t), allocatable :: longer(:)
    allocate (longer(size(list) + 1))
    longer(:size(list)) = list
    associate (last => longer(size(longer)))
      last%group = group
      last%name = name
      last%type = trim(type_names(dataset%type))
      last%lengths = dataset%lengths
    end associate
    call move_alloc(longer, list)
  end subroutine push

  !> A dimension scale without coordinates has neither a checksum nor a unit.
  logical function is_bare_dimension(self, path)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    is_bare_dimension = h5_has_attribute(self%file, path, 'CLASS')
    if (is_bare_dimension) is_bare_dimension = .not. h5_has_attribute(self%file, path, 'checksum')
    if (is_bare_dimension) is_bare_dimension = .not. h5_has_attribute(self%file, path, 'units')
  end function is_bare_dimension

  !> How many of a working file's tiles are done. Code 74.
  subroutine count_tiles(self, done, tiles, error)
    class(reader_t), intent(in) :: self
    integer, intent(out) :: done, tiles
    type(error_t), allocatable, intent(out) :: error
    type(byte_file_t) :: file
    integer(int8) :: head(head_bytes)
    integer(int64) :: offset, bytes, count
    type(error_t), allocatable :: ignored
    done = 0
    tiles = 0
    call h5_records_extent(self%file, tile_records, offset, bytes, count, error)
    if (.not. allocated(error)) call file%open(self%path, .false., error)
    if (allocated(error)) return
    do tiles = 1, int(count)
      call file%read(head, offset + (tiles - 1)*bytes, error)
      if (allocated(error)) exit
      if (is_done(head)) done = done + 1
    end do
    tiles = int(count)
    call file%close(ignored)
  end subroutine count_tiles

  !> The lengths of a variable in C order.
  subroutine lengths(self, path, values, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(int64), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    call h5_open_dataset(self%file, path, dataset, error)
    if (allocated(error)) return
    values = dataset%lengths
    call h5_close_dataset(dataset, error)
  end subroutine lengths

  !> The values of a numeric variable in C order.
  subroutine read_values(self, path, values, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    real(real64), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    integer(int8), allocatable :: bytes(:)
    call h5_open_dataset(self%file, path, dataset, error)
    if (allocated(error)) return
    if (dataset%type == type_string) then
      call fail(error, exit_io, ''''//path//''' of '''//self%path//''' is not numeric')
      return
    end if
    call h5_check_stored(dataset, error)
    if (allocated(error)) return
    allocate (values(product(dataset%lengths)))
    allocate (bytes(size(values, kind=int64)*bytes_of(dataset%type)))
    call h5_read(dataset, bytes, error)
    if (allocated(error)) return
    call from_bytes(dataset%type, bytes, values)
    call h5_close_dataset(dataset, error)
  end subroutine read_values

  !> Numeric variables of one length as the columns of a table; code 74 if they differ in length.
  subroutine read_columns(self, paths, columns, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: paths(:)
    real(real64), allocatable, intent(out) :: columns(:, :)
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: values(:)
    integer :: k
    do k = 1, size(paths)
      call self%read_values(trim(paths(k)), values, error)
      if (allocated(error)) return
      if (k == 1) allocate (columns(size(values), size(paths)))
      if (size(values) /= size(columns, 1)) then
        call fail(error, exit_io, ''''//trim(paths(k))//''' of '''//self%path//''' has '//to_text(size(values))// &
                  ' values, '''//trim(paths(1))//''' has '//to_text(size(columns, 1)))
        return
      end if
      columns(:, k) = values
    end do
  end subroutine read_columns

  !> The values of a block of a numeric variable in C order; `lower` from 0.
  subroutine read_block(self, path, lower, extent, values, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: lower(:), extent(:)
    real(real64), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    integer(int8), allocatable :: bytes(:)
    call h5_open_dataset(self%file, path, dataset, error)
    if (allocated(error)) return
    if (dataset%type == type_string .or. size(dataset%lengths) /= size(extent)) then
      call fail(error, exit_io, ''''//path//''' of '''//self%path//''' is not numeric, or has other dimensions')
      return
    end if
    call h5_check_stored(dataset, error)
    if (allocated(error)) return
    allocate (values(product(extent)), bytes(product(extent)*bytes_of(dataset%type)))
    call h5_read(dataset, bytes, error, lower, extent)
    if (allocated(error)) return
    call from_bytes(dataset%type, bytes, values)
    call h5_close_dataset(dataset, error)
  end subroutine read_block

  !> How often each code from 0 occurs in a variable; codes outside the table are not counted.
  subroutine count_codes(self, path, counts, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    integer(int64), intent(out) :: counts(0:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: lengths(:), lower(:), extent(:)
    real(real64), allocatable :: values(:)
    integer(int64) :: k
    integer :: i
    counts = 0
    call self%lengths(path, lengths, error)
    if (allocated(error)) return
    allocate (lower(size(lengths)), extent(size(lengths)))
    do k = 1, slab_count(lengths)
      call slab(lengths, k, lower, extent)
      call self%read_block(path, lower, extent, values, error)
      if (allocated(error)) return
      do i = 0, ubound(counts, 1)
        counts(i) = counts(i) + count(abs(values - i) < 0.5_real64)
      end do
    end do
  end subroutine count_codes

  !> The texts of a variable: the meanings of its codes, or what it has in a file of version 1, strings.
  subroutine read_strings(self, path, strings, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: strings(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    call h5_open_dataset(self%file, path, dataset, error)
    if (allocated(error)) return
    if (dataset%type == type_string) call h5_read_strings(dataset, strings, error)
    if (allocated(error)) return
    if (dataset%type /= type_string) call read_meanings(self, path, strings, error)
    if (allocated(error)) return
    call h5_close_dataset(dataset, error)
  end subroutine read_strings

  !> The meanings of the codes of a variable.
  subroutine read_meanings(self, path, strings, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: strings(:)
    type(error_t), allocatable, intent(out) :: error
    character(len=*), parameter :: unknown = 'unknown'
    real(real64), allocatable :: codes(:), values(:)
    character(len=:), allocatable :: meanings
    integer :: i, code
    if (.not. self%has_attribute(path, 'flag_meanings')) then
      call fail(error, exit_io, ''''//path//''' of '''//self%path//''' is not text')
      return
    end if
    call self%read_values(path, values, error)
    if (.not. allocated(error)) call h5_get_numbers(self%file, path, 'flag_values', codes, error)
    if (.not. allocated(error)) call self%text_attribute(path, 'flag_meanings', meanings, error)
    if (allocated(error)) return
    allocate (character(len=max(len(meanings), len(unknown))) :: strings(size(values)))
    do i = 1, size(values)
      code = findloc(abs(codes - values(i)) <= 0, .true., 1)
      strings(i) = unknown
      if (code > 0) strings(i) = word_of(meanings, code)
    end do
  end subroutine read_meanings

  !> Word number `number` of a text whose words are parted by blanks.
  pure function word_of(text, number) result(word)
    character(len=*), intent(in) :: text
    integer, intent(in) :: number
    character(len=:), allocatable :: word
    integer :: i
    word = text
    do i = 2, number
      word = adjustl(word(min(index(word//' ', ' '), len(word) + 1):))
    end do
    word = word(:index(word//' ', ' ') - 1)
  end function word_of

  !> The text '/provenance/case_text': an attribute of its group, in a file of version 1 a scalar dataset.
  subroutine read_text(self, path, text, error)
    class(reader_t), intent(in) :: self
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: strings(:)
    integer :: slash
    slash = index(path, '/', back=.true.)
    if (.not. self%has(path)) then
      call self%text_attribute(path(:slash - 1), path(slash + 1:), text, error)
      return
    end if
    call self%read_strings(path, strings, error)
    if (allocated(error)) return
    if (size(strings) /= 1) then
      call fail(error, exit_io, ''''//path//''' of '''//self%path//''' is not one text')
      return
    end if
    text = strings(1)
  end subroutine read_text

end module map_reader
