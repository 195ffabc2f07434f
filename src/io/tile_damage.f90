! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> Which tiles of a damaged final file no longer match the checksums that they got when they were computed.
module tile_damage
  use checksum, only: crc32
  use errors, only: error_t, fail
  use h5, only: h5_close_dataset, h5_dataset_t, h5_exists, h5_file_t, h5_open_dataset, h5_read
  use h5_attributes, only: h5_get_text, h5_has_attribute
  use h5_stored, only: h5_check_stored
  use kinds, only: int64, int8, real64
  use status, only: exit_io
  use text, only: join, to_text
  use tiles, only: new_tiling, tiling_t
  use value_types, only: bytes_of, from_bytes, type_string
  implicit none
  private

  public :: damaged_tiles

  !> Tiles named one by one.
  integer, parameter :: most_named = 4

contains

  !> '; damaged: tile 3 at [0, 16] (8 x 8 points)': number from 1, corner from 0; '' if the file has no tiles or they are
  !> whole.
  function damaged_tiles(file) result(words)
    type(h5_file_t), intent(in) :: file
    character(len=:), allocatable :: words
    type(h5_dataset_t), allocatable :: datasets(:)
    type(tiling_t) :: tiling
    integer(int64), allocatable :: expected(:), lower(:), extent(:)
    integer :: tile, found
    words = ''
    call open_tiles(file, datasets, tiling, expected)
    if (.not. allocated(expected)) return
    allocate (lower(size(tiling%lengths)), extent(size(tiling%lengths)))
    found = 0
    do tile = 1, size(expected)
      call tiling%block_of(tile, lower, extent)
      if (is_whole(datasets, lower, extent, expected(tile))) cycle
      found = found + 1
      if (found > most_named) cycle
      if (found == 1) words = '; damaged: '
      if (found > 1) words = words//', '
      words = words//'tile '//to_text(tile)//' at ['//listed(lower, ', ')//'] ('//listed(extent, ' x ')//' points)'
    end do
    if (found > most_named) words = words//' and '//to_text(found - most_named)//' more'
    do tile = 1, size(datasets)
      call close_quietly(datasets(tile))
    end do
  end function damaged_tiles

  !> `expected` is allocated only if the file has all that is needed.
  subroutine open_tiles(file, datasets, tiling, expected)
    type(h5_file_t), intent(in) :: file
    type(h5_dataset_t), allocatable, intent(out) :: datasets(:)
    type(tiling_t), intent(out) :: tiling
    integer(int64), allocatable, intent(out) :: expected(:)
    type(error_t), allocatable :: error
    character(len=:), allocatable :: names
    integer(int64), allocatable :: shape(:), checksums(:)
    integer :: i, from, blank
    allocate (datasets(0))
    if (.not. h5_exists(file, '/tiles/checksum')) return
    if (.not. h5_has_attribute(file, '/tiles', 'variables')) return
    call h5_get_text(file, '/tiles', 'variables', names, error)
    if (.not. allocated(error)) call read_integers(file, '/tiles/tile_shape', shape, error)
    if (.not. allocated(error)) call read_integers(file, '/tiles/checksum', checksums, error)
    if (allocated(error)) return
    deallocate (datasets)
    allocate (datasets(1 + count([(names(i:i) == ' ', i=1, len(names))])))
    from = 1
    do i = 1, size(datasets)
      blank = index(names(from:)//' ', ' ')
      call h5_open_dataset(file, names(from:from + blank - 2), datasets(i), error)
      if (.not. allocated(error)) call check_numeric(datasets(i), error)
      if (allocated(error)) return
      if (size(datasets(i)%lengths) /= size(shape)) return
      if (any(datasets(i)%lengths /= datasets(1)%lengths)) return
      from = from + blank
    end do
    call new_tiling(datasets(1)%lengths, shape, tiling, error)
    if (allocated(error)) return
    if (tiling%count() == size(checksums)) call move_alloc(checksums, expected)
  end subroutine open_tiles

  subroutine read_integers(file, name, values, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer(int64), allocatable, intent(out) :: values(:)
    type(error_t), allocatable, intent(out) :: error
    type(h5_dataset_t) :: dataset
    integer(int8), allocatable :: bytes(:)
    real(real64), allocatable :: numbers(:)
    call h5_open_dataset(file, name, dataset, error)
    if (.not. allocated(error)) call check_numeric(dataset, error)
    if (allocated(error)) return
    allocate (numbers(product(dataset%lengths)), bytes(product(dataset%lengths)*bytes_of(dataset%type)))
    call h5_read(dataset, bytes, error)
    if (allocated(error)) return
    call from_bytes(dataset%type, bytes, numbers)
    values = nint(numbers, int64)
    call h5_close_dataset(dataset, error)
  end subroutine read_integers

  !> Code 74 for a dataset that is not numeric or claims more than is stored.
  subroutine check_numeric(dataset, error)
    type(h5_dataset_t), intent(in) :: dataset
    type(error_t), allocatable, intent(out) :: error
    if (dataset%type == type_string) then
      call fail(error, exit_io, ''''//dataset%name//''' of '''//dataset%path//''' is not numeric')
    else
      call h5_check_stored(dataset, error)
    end if
  end subroutine check_numeric

  !> Whether a tile can be read and matches.
  logical function is_whole(datasets, lower, extent, expected)
    type(h5_dataset_t), intent(in) :: datasets(:)
    integer(int64), intent(in) :: lower(:), extent(:), expected
    type(error_t), allocatable :: error
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: found
    integer :: i
    found = 0
    do i = 1, size(datasets)
      if (allocated(bytes)) deallocate (bytes)
      allocate (bytes(product(extent)*bytes_of(datasets(i)%type)))
      call h5_read(datasets(i), bytes, error, lower, extent)
      is_whole = .not. allocated(error)
      if (.not. is_whole) return
      found = crc32(bytes, found)
    end do
    is_whole = found == expected
  end function is_whole

  subroutine close_quietly(dataset)
    type(h5_dataset_t), intent(inout) :: dataset
    type(error_t), allocatable :: ignored
    call h5_close_dataset(dataset, ignored)
  end subroutine close_quietly

  pure function listed(numbers, separator) result(words)
    integer(int64), intent(in) :: numbers(:)
    character(len=*), intent(in) :: separator
    character(len=:), allocatable :: words
    character(len=20) :: parts(size(numbers))
    integer :: i
    do i = 1, size(numbers)
      parts(i) = to_text(numbers(i))
    end do
    words = join(parts, separator)
  end function listed

end module tile_damage
