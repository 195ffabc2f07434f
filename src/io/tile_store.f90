! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The data of the tiles in a working file, read without HDF5: its variables are stored tile after tile, each whole, which is
!> how HDF5 lays out chunks of fixed size that are allocated at once.
module tile_store
  use boxes, only: copy_common
  use byte_file, only: byte_file_t
  use errors, only: error_t, fail
  use h5, only: h5_dataset_t
  use h5_chunks, only: h5_chunk_offset
  use kinds, only: int64, int8
  use status, only: exit_io
  use tiles, only: tiling_t
  use value_types, only: bytes_of
  implicit none
  private

  type, public :: tile_store_t
    private
    type(tiling_t) :: tiling
    type(byte_file_t) :: file
    !> Per variable: where the first tile is, and the bytes of a value.
    integer(int64), allocatable :: first(:)
    integer, allocatable :: width(:)
  contains
    procedure :: locate
    procedure :: open => open_store
    procedure :: close => close_store
    procedure :: has_name
    procedure :: read_tile
    procedure :: read_block
  end type tile_store_t

contains

  !> Finds out where the data of some datasets lies. Code 74 if it lies otherwise than in a working file.
  subroutine locate(self, datasets, tiling, error)
    class(tile_store_t), intent(inout) :: self
    type(h5_dataset_t), intent(in) :: datasets(:)
    type(tiling_t), intent(in) :: tiling
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: corner(size(tiling%lengths)), last_tile
    integer :: i
    self%tiling = tiling
    if (allocated(self%first)) deallocate (self%first, self%width)
    allocate (self%first(size(datasets)), self%width(size(datasets)))
    do i = 1, size(datasets)
      self%width(i) = bytes_of(datasets(i)%type)
      corner = 0
      call h5_chunk_offset(datasets(i), corner, self%first(i), error)
      if (allocated(error)) return
      corner = (tiling%lengths - 1)/tiling%shape*tiling%shape
      call h5_chunk_offset(datasets(i), corner, last_tile, error)
      if (allocated(error)) return
      if (last_tile == offset_of(self, i, tiling%count())) cycle
      call fail(error, exit_io, 'the tiles of '''//datasets(i)%name//''' in '''//datasets(i)%path// &
                ''' do not lie one after the other')
      return
    end do
  end subroutine locate

  !> Opens the file for reading. Code 74.
  subroutine open_store(self, path, error)
    class(tile_store_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    call self%close()
    call self%file%open(path, .false., error)
  end subroutine open_store

  !> Whether the file is still there under its name.
  logical function has_name(self)
    class(tile_store_t), intent(in) :: self
    has_name = self%file%has_name()
  end function has_name

  !> Closes the file; one that is not open stays so.
  subroutine close_store(self)
    class(tile_store_t), intent(inout) :: self
    type(error_t), allocatable :: ignored
    call self%file%close(ignored)
  end subroutine close_store

  !> Where in the file a tile (from 1) of a variable begins.
  pure integer(int64) function offset_of(self, variable, tile)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: variable, tile
    offset_of = self%first(variable) + (tile - 1)*product(self%tiling%shape)*self%width(variable)
  end function offset_of

  !> The bytes of a tile's values, in the C order of the tile. Code 74.
  subroutine read_tile(self, variable, tile, bytes, error)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: variable, tile
    integer(int8), allocatable, intent(out) :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: lower(size(self%tiling%lengths)), extent(size(self%tiling%lengths))
    integer(int8), allocatable :: stored(:)
    call self%tiling%block_of(tile, lower, extent)
    allocate (stored(product(self%tiling%shape)*self%width(variable)))
    call self%file%read(stored, offset_of(self, variable, tile), error)
    if (allocated(error)) return
    if (all(extent == self%tiling%shape)) then
      call move_alloc(stored, bytes)
    else
      allocate (bytes(product(extent)*self%width(variable)))
      call copy_common(self%width(variable), lower, self%tiling%shape, stored, lower, extent, bytes)
    end if
  end subroutine read_tile

  !> The bytes of the values of a block of the grid (corner from 0), in C order. Code 74.
  subroutine read_block(self, variable, lower, extent, bytes, error)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: variable
    integer(int64), intent(in) :: lower(:), extent(:)
    integer(int8), intent(inout), contiguous :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: first(size(lower)), last(size(lower)), tile(size(lower))
    integer :: k
    first = lower/self%tiling%shape
    last = (lower + extent - 1)/self%tiling%shape
    tile = first
    do
      call read_row(self, variable, tile, last(size(lower)), lower, extent, bytes, error)
      if (allocated(error)) return
      do k = size(lower) - 1, 1, -1
        tile(k) = tile(k) + 1
        if (tile(k) <= last(k)) exit
        tile(k) = first(k)
      end do
      if (k < 1) exit
    end do
  end subroutine read_block

  !> What a row of tiles along the last axis, which lie one after the other, holds of a block. `tile`: the first of them, counted
  !> in tiles from 0 along each axis; `last`: the last of them along the last axis.
  subroutine read_row(self, variable, tile, last, lower, extent, bytes, error)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: variable
    integer(int64), intent(in) :: tile(:), last, lower(:), extent(:)
    integer(int8), intent(inout), contiguous :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: stored(:)
    integer(int64) :: corner(size(tile)), tile_bytes, number, i
    associate (tiling => self%tiling)
      tile_bytes = product(tiling%shape)*self%width(variable)
      number = tiling%number_at(tile)
      allocate (stored((last - tile(size(tile)) + 1)*tile_bytes))
      call self%file%read(stored, offset_of(self, variable, int(number)), error)
      if (allocated(error)) return
      do i = 0, last - tile(size(tile))
        corner = tile*tiling%shape
        corner(size(tile)) = corner(size(tile)) + i*tiling%shape(size(tile))
        call copy_common(self%width(variable), corner, tiling%shape, stored(i*tile_bytes + 1:(i + 1)*tile_bytes), lower, extent, &
                         bytes)
      end do
    end associate
  end subroutine read_row

end module tile_store
