! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The record of a tile in a working file: number, checksum and state, then each variable over a whole tile. A tile at the edge of
!> the map fills the corner of its record.
module tile_record
  use boxes, only: copy_common
  use checksum, only: crc32
  use kinds, only: int32, int64, int8, real64
  use tiles, only: tiling_t
  use value_types, only: bytes_of, from_bytes, to_bytes, type_int32, type_int8, type_uint32
  implicit none
  private

  public :: new_record, is_done

  !> The dataset of the records of all tiles.
  character(len=*), parameter, public :: tile_records = '/tiles/record'

  !> What precedes the values: names, types and where they begin.
  character(len=*), parameter, public :: head_names(3) = [character(len=8) :: 'tile', 'checksum', 'state']
  integer, parameter, public :: head_types(3) = [type_int32, type_uint32, type_int8]
  integer(int64), parameter, public :: head_begins(3) = [0_int64, 4_int64, 8_int64], head_bytes = 16

  !> The bytes of a variable's values in a block.
  type, public :: values_t
    integer(int8), allocatable :: bytes(:)
  end type values_t

  type, public :: record_t
    type(tiling_t) :: tiling
    !> Per variable: its type, and where it begins in the record.
    integer, allocatable :: types(:)
    integer(int64), allocatable :: begins(:)
    !> Length of a record.
    integer(int64) :: bytes = 0
  contains
    procedure :: encode
    procedure :: decode
    procedure :: matches
    procedure :: copy_block
  end type record_t

contains

  !> The records of the tiles of a grid with variables of these types.
  pure function new_record(tiling, types) result(record)
    type(tiling_t), intent(in) :: tiling
    integer, intent(in) :: types(:)
    type(record_t) :: record
    integer :: i
    record%tiling = tiling
    record%types = types
    allocate (record%begins(size(types)))
    record%bytes = head_bytes
    do i = 1, size(types)
      record%begins(i) = record%bytes
      record%bytes = record%bytes + product(tiling%shape)*bytes_of(types(i))
    end do
  end function new_record

  !> The record of a tile that is done. `values`: (points of the tile in its C order, variables).
  subroutine encode(self, tile, values, record)
    class(record_t), intent(in) :: self
    integer, intent(in) :: tile
    real(real64), intent(in) :: values(:, :)
    integer(int8), intent(out), contiguous :: record(:)
    integer(int64) :: lower(size(self%tiling%lengths)), extent(size(self%tiling%lengths)), checksum
    integer(int8), allocatable :: bytes(:)
    integer :: i
    call self%tiling%block_of(tile, lower, extent)
    record = 0
    checksum = 0
    do i = 1, size(self%types)
      allocate (bytes(size(values, 1, kind=int64)*bytes_of(self%types(i))))
      call to_bytes(self%types(i), values(:, i), bytes)
      checksum = crc32(bytes, checksum)
      call copy_common(bytes_of(self%types(i)), lower, extent, bytes, lower, self%tiling%shape, &
                       record(self%begins(i) + 1:self%begins(i) + stored_bytes(self, i)))
      deallocate (bytes)
    end do
    record(1:4) = transfer(int(tile, int32), record(1:4))
    call to_bytes(type_uint32, [real(checksum, real64)], record(5:8))
    record(9) = 1
  end subroutine encode

  !> The bytes of a variable in a record.
  pure integer(int64) function stored_bytes(self, variable)
    class(record_t), intent(in) :: self
    integer, intent(in) :: variable
    stored_bytes = product(self%tiling%shape)*bytes_of(self%types(variable))
  end function stored_bytes

  !> The values of a tile, as `encode` takes them.
  subroutine decode(self, tile, record, values)
    class(record_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int8), intent(in), contiguous :: record(:)
    real(real64), intent(out) :: values(:, :)
    integer(int8), allocatable :: bytes(:)
    integer :: i
    do i = 1, size(self%types)
      call take(self, tile, i, record, bytes)
      call from_bytes(self%types(i), bytes, values(:, i))
    end do
  end subroutine decode

  !> The bytes of a tile's variable, in the C order of the tile.
  subroutine take(self, tile, variable, record, bytes)
    class(record_t), intent(in) :: self
    integer, intent(in) :: tile, variable
    integer(int8), intent(in), contiguous :: record(:)
    integer(int8), allocatable, intent(out) :: bytes(:)
    integer(int64) :: lower(size(self%tiling%lengths)), extent(size(self%tiling%lengths))
    integer :: width
    width = bytes_of(self%types(variable))
    call self%tiling%block_of(tile, lower, extent)
    allocate (bytes(product(extent)*width))
    associate (stored => record(self%begins(variable) + 1:self%begins(variable) + stored_bytes(self, variable)))
      if (all(extent == self%tiling%shape)) then
        bytes = stored
      else
        call copy_common(width, lower, self%tiling%shape, stored, lower, extent, bytes)
      end if
    end associate
  end subroutine take

  !> Whether the head of a record marks its tile as done.
  pure logical function is_done(head)
    integer(int8), intent(in) :: head(:)
    is_done = head(head_begins(3) + 1) == 1
  end function is_done

  !> Whether a record holds the values of a tile that its checksum is of, which is returned.
  logical function matches(self, tile, record, checksum)
    class(record_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int8), intent(in), contiguous :: record(:)
    integer(int64), intent(out) :: checksum
    integer(int8), allocatable :: bytes(:)
    real(real64) :: expected(1)
    integer :: i
    checksum = 0
    do i = 1, size(self%types)
      call take(self, tile, i, record, bytes)
      checksum = crc32(bytes, checksum)
    end do
    call from_bytes(type_uint32, record(5:8), expected)
    matches = checksum == nint(expected(1), int64) .and. transfer(record(1:4), 0_int32) == tile
  end function matches

  !> Copies what a record has in common with a block of the grid (corner from 0) into the values of the block.
  pure subroutine copy_block(self, tile, record, lower, extent, values)
    class(record_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int8), intent(in), contiguous :: record(:)
    integer(int64), intent(in) :: lower(:), extent(:)
    type(values_t), intent(inout) :: values(:)
    integer(int64) :: corner(size(lower)), own(size(lower))
    integer :: i
    call self%tiling%block_of(tile, corner, own)
    do i = 1, size(self%types)
      call copy_common(bytes_of(self%types(i)), corner, self%tiling%shape, &
                       record(self%begins(i) + 1:self%begins(i) + stored_bytes(self, i)), lower, extent, values(i)%bytes)
    end do
  end subroutine copy_block

end module tile_record
