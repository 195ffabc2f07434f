! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The working file of a map, PATH.part: created whole by rank 0, then written tile by tile by all
!> ranks independently. It is its own checkpoint: each tile has a state and a checksum.
module map_file
  use checksum, only: crc32
  use errors, only: error_t, fail
  use files, only: free_bytes, publish_file, remove_file, reserve_file
  use h5, only: h5_close, h5_close_dataset, h5_create, h5_dataset_t, h5_file_t, h5_open, &
    h5_open_dataset, h5_read, h5_write
  use kinds, only: int64, int8, real64
  use map_compare, only: check_layout
  use map_layout, only: create_objects, path_of, write_data
  use map_schema, only: schema_t, type_int64, type_int8
  use output_check, only: check_create, check_resume, working_path
  use status, only: exit_cannot_create, exit_internal, exit_io
  use team, only: team_t
  use text, only: to_text
  use tile_store, only: tile_store_t
  use tiles, only: new_tiling, tiling_t
  use value_types, only: bytes_of, from_bytes, to_bytes, type_uint32
  implicit none
  private

  public :: create_working, open_working, working_path

  type, public :: map_file_t
    !> The name of the final file.
    character(len=:), allocatable :: path
    type(schema_t) :: schema
    type(tiling_t) :: tiling
    type(h5_file_t) :: part
    !> Positions in the schema of the tiled variables, and their datasets.
    integer, allocatable :: tiled(:)
    type(h5_dataset_t), allocatable, private :: datasets(:)
    type(h5_dataset_t), private :: states, checksums
    logical, private :: writable = .true.
    !> Reads the data of the tiled variables, in their order.
    type(tile_store_t) :: store
    !> Per tile.
    logical, allocatable :: done(:)
  contains
    procedure :: tile_count
    procedure :: tile_done
    procedure :: tile_bytes
    procedure :: write_tile
    procedure :: read_tile
    procedure :: recheck
    procedure :: check_name
    procedure :: open => open_part
    procedure :: close => close_part
  end type map_file_t

contains

  !> Creates and opens the working file. Collective. `grid`: names of the dimensions that are cut into
  !> tiles of `tile_shape`. Code 73 if the final or the working file exists and `force` is false, the
  !> folder is missing or not writable, or the space is too small. `shares`: only one of so many shares of the tiles
  !> will be written, so that the file stays sparse (default 1).
  subroutine create_working(path, schema, grid, tile_shape, force, team, file, error, shares)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    logical, intent(in) :: force
    class(team_t), intent(in) :: team
    type(map_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    integer, intent(in), optional :: shares
    integer :: parts
    parts = 1
    if (present(shares)) parts = shares
    call prepare(path, schema, grid, tile_shape, file, error)
    if (allocated(error)) return
    if (team%is_root()) then
      call check_create(path, force, error)
      if (.not. allocated(error)) call check_space(file, parts, error)
      if (.not. allocated(error)) call build(file, parts == 1, error)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call file%open(team, error)
  end subroutine create_working

  !> Opens the working file of an interrupted run. Collective. Tiles whose data does not match their
  !> checksum count as not done. Code 76 if the file has another layout, or another `case_identity`
  !> in the group `provenance` than the schema. `only_read`: the file stays as it is.
  subroutine open_working(path, schema, grid, tile_shape, team, file, error, only_read)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    class(team_t), intent(in) :: team
    type(map_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: only_read
    integer :: mismatches
    call prepare(path, schema, grid, tile_shape, file, error)
    if (allocated(error)) return
    if (present(only_read)) file%writable = .not. only_read
    if (team%is_root()) then
      if (file%writable) call check_resume(path, error)
      if (.not. allocated(error)) call check_layout(working_path(path), file%schema, file%tiling%shape, &
                                                      .not. file%writable, error)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call file%open(team, error)
    if (allocated(error)) return
    call file%recheck(team, mismatches, error)
  end subroutine open_working

  !> Sets up the tiling, and the group `tiles` in the schema.
  subroutine prepare(path, schema, grid, tile_shape, file, error)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    type(map_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: names
    integer :: i
    file%path = path
    file%schema = schema
    call new_tiling(schema%lengths_of(grid), tile_shape, file%tiling, error)
    if (allocated(error)) return
    file%tiled = pack([(i, i=1, size(schema%variables))], [(schema%variables(i)%tiled, i=1, size(schema%variables))])
    do i = 1, size(file%tiled)
      associate (variable => schema%variables(file%tiled(i)))
        if (size(variable%dimensions) == size(grid)) then
          if (all(variable%dimensions == grid)) cycle
        end if
        call fail(error, exit_internal, 'tiled variable '//variable%name//' has not the dimensions of the grid')
        return
      end associate
    end do
    names = ''
    do i = 1, size(file%tiled)
      associate (variable => schema%variables(file%tiled(i)))
        names = trim(names//' '//path_of(variable%group, variable%name))
      end associate
    end do
    call file%schema%add_attribute('tiles', 'variables', trim(adjustl(names)))
    associate (tiles => file%tiling)
      call file%schema%add_dimension('axis', size(grid, kind=int64))
      call file%schema%add_dimension('tile', int(tiles%count(), int64))
      call file%schema%add_variable('tile_shape', type_int64, ['axis'], group='tiles', &
                                    data=real(tiles%shape, real64), long_name='points of a tile along each axis')
      call file%schema%add_variable('state', type_int8, ['tile'], group='tiles', &
                                    long_name='1 = the tile is done', flag_values=[0, 1], flag_meanings='not_done done')
      call file%schema%add_variable('checksum', type_uint32, ['tile'], group='tiles', &
                                    long_name='CRC-32 of the data of the tile, variables in file order')
    end associate
    allocate (file%done(file%tiling%count()), source=.false.)
  end subroutine prepare

  subroutine check_space(file, shares, error)
    type(map_file_t), intent(in) :: file
    integer, intent(in) :: shares
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: needed, free
    integer :: i
    needed = 0
    do i = 1, size(file%tiled)
      needed = needed + product(file%tiling%lengths)*bytes_of(file%schema%variables(file%tiled(i))%type)
    end do
    needed = needed/shares
    free = free_bytes(file%path)
    if (free >= 0 .and. free < needed) then
      call fail(error, exit_cannot_create, ''''//file%path//''' needs '//to_text(needed)//' bytes, '// &
                to_text(free)//' are free')
    end if
  end subroutine check_space

  !> Under its own name the working file exists only whole. `reserve`: takes the space of all tiles at once.
  subroutine build(file, reserve, error)
    type(map_file_t), intent(in) :: file
    logical, intent(in) :: reserve
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: new
    character(len=:), allocatable :: name
    integer :: i
    name = working_path(file%path)//'.new'
    call h5_create(name, new, error, working=.true.)
    if (.not. allocated(error)) call create_objects(new, file%schema, error, file%tiling%shape)
    do i = 1, size(file%schema%variables)
      if (allocated(error)) exit
      if (.not. file%schema%variables(i)%tiled) call write_data(new, file%schema, file%schema%variables(i), error)
    end do
    if (allocated(error)) then
      call h5_close(new, ignored)
    else
      call h5_close(new, error)
    end if
    if (.not. allocated(error) .and. reserve) call reserve_file(name, error)
    if (.not. allocated(error)) call publish_file(name, working_path(file%path), error)
    if (allocated(error)) then
      error%code = exit_cannot_create
      call remove_file(name, ignored)
    end if
  end subroutine build

  !> Opens the working file with all ranks. Collective.
  subroutine open_part(self, team, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    integer :: i
    call h5_open(working_path(self%path), self%part, error, writable=self%writable, team=team)
    if (allocated(self%datasets)) deallocate (self%datasets)
    allocate (self%datasets(size(self%tiled)))
    do i = 1, size(self%tiled)
      if (allocated(error)) exit
      associate (variable => self%schema%variables(self%tiled(i)))
        call h5_open_dataset(self%part, path_of(variable%group, variable%name), self%datasets(i), error)
      end associate
    end do
    if (.not. allocated(error)) call h5_open_dataset(self%part, '/tiles/state', self%states, error)
    if (.not. allocated(error)) call h5_open_dataset(self%part, '/tiles/checksum', self%checksums, error)
    if (.not. allocated(error)) call self%store%locate(self%datasets, self%tiling, error)
    if (.not. allocated(error)) call self%store%open(working_path(self%path), error)
    call team%agree(error)
  end subroutine open_part

  !> Code 74 if the working file has been removed or moved: what is written then is lost to whoever looks for it by its name.
  subroutine check_name(self, error)
    class(map_file_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    if (self%store%has_name()) return
    call fail(error, exit_io, "'"//working_path(self%path)//"' has been removed or moved while the run writes it; with the "// &
              'file back under this name the same command with --resume (without --force) goes on')
  end subroutine check_name

  !> Closes the working file; it can be opened again. Collective.
  subroutine close_part(self, team, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: later
    integer :: i
    call self%store%close()
    if (allocated(self%datasets)) then
      do i = 1, size(self%datasets)
        call h5_close_dataset(self%datasets(i), later)
        call keep_first(later, error)
      end do
    end if
    call h5_close_dataset(self%states, later)
    call keep_first(later, error)
    call h5_close_dataset(self%checksums, later)
    call keep_first(later, error)
    ! Collective: after an error, too, or the other ranks wait for ever.
    call h5_close(self%part, later)
    call keep_first(later, error)
    call team%agree(error)
  end subroutine close_part

  !> Keeps the first of several errors.
  subroutine keep_first(later, error)
    type(error_t), allocatable, intent(inout) :: later, error
    if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
  end subroutine keep_first

  !> The number of tiles.
  pure integer function tile_count(self)
    class(map_file_t), intent(in) :: self
    tile_count = size(self%done)
  end function tile_count

  !> Whether a tile is done: when the file was opened, or since then by this rank.
  pure logical function tile_done(self, tile)
    class(map_file_t), intent(in) :: self
    integer, intent(in) :: tile
    tile_done = self%done(tile)
  end function tile_done

  !> Bytes of the results of a tile.
  pure integer(int64) function tile_bytes(self, tile)
    class(map_file_t), intent(in) :: self
    integer, intent(in) :: tile
    integer :: i
    tile_bytes = self%tiling%points(tile)*sum([(bytes_of(self%schema%variables(self%tiled(i))%type), i=1, size(self%tiled))])
  end function tile_bytes

  !> Writes a tile and marks it done. `values`: (points of the tile in its C order, tiled variables in
  !> the order of the schema). On an error (code 74) the caller ends all ranks.
  subroutine write_tile(self, tile, values, error)
    class(map_file_t), intent(inout) :: self
    integer, intent(in) :: tile
    real(real64), intent(in) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: lower(size(self%tiling%lengths)), extent(size(self%tiling%lengths)), value
    integer(int8), allocatable :: bytes(:)
    integer :: i
    call self%tiling%block_of(tile, lower, extent)
    if (size(values, 1) /= product(extent) .or. size(values, 2) /= size(self%tiled)) then
      call fail(error, exit_internal, 'tile '//to_text(tile)//' gets values of the wrong shape')
      return
    end if
    value = 0
    do i = 1, size(self%tiled)
      bytes = bytes_in(self%datasets(i)%type, values(:, i))
      call h5_write(self%datasets(i), bytes, error, lower, extent)
      if (allocated(error)) return
      value = crc32(bytes, value)
    end do
    call mark(self, tile, 1, value, error)
    if (.not. allocated(error)) self%done(tile) = .true.
  end subroutine write_tile

  !> The values of a tile that is done, as `write_tile` takes them.
  subroutine read_tile(self, tile, values, error)
    class(map_file_t), intent(in) :: self
    integer, intent(in) :: tile
    real(real64), allocatable, intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer :: i
    allocate (values(self%tiling%points(tile), size(self%tiled)))
    do i = 1, size(self%datasets)
      call self%store%read_tile(i, tile, bytes, error)
      if (allocated(error)) return
      call from_bytes(self%datasets(i)%type, bytes, values(:, i))
    end do
  end subroutine read_tile

  function bytes_in(type, values) result(bytes)
    integer, intent(in) :: type
    real(real64), intent(in) :: values(:)
    integer(int8), allocatable :: bytes(:)
    allocate (bytes(size(values, kind=int64)*bytes_of(type)))
    call to_bytes(type, values, bytes)
  end function bytes_in

  subroutine mark(self, tile, state, value, error)
    class(map_file_t), intent(inout) :: self
    integer, intent(in) :: tile, state
    integer(int64), intent(in) :: value
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: corner(1)
    corner = tile - 1
    call h5_write(self%checksums, bytes_in(type_uint32, [real(value, real64)]), error, corner, [1_int64])
    if (allocated(error)) return
    call h5_write(self%states, [int(state, int8)], error, corner, [1_int64])
  end subroutine mark

  !> Reads the states of all tiles, and the data of the done ones, shared among the ranks. Tiles that
  !> do not match their checksum become not done; `mismatches` is their number. Collective.
  subroutine recheck(self, team, mismatches, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    integer, intent(out) :: mismatches
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: states(:), bytes(:)
    real(real64), allocatable :: expected(:)
    integer(int64), allocatable :: done(:)
    integer(int64) :: found
    integer :: tile, claimed
    mismatches = 0
    allocate (states(size(self%done)), bytes(4*size(self%done)), expected(size(self%done)))
    call h5_read(self%states, states, error)
    if (.not. allocated(error)) call h5_read(self%checksums, bytes, error)
    call team%agree(error)
    if (allocated(error)) return
    call from_bytes(type_uint32, bytes, expected)
    allocate (done(size(self%done)), source=0_int64)
    claimed = 0
    do tile = 1, size(done)
      if (states(tile) /= 1) cycle
      claimed = claimed + 1
      if (mod(claimed, team%size()) /= team%rank()) cycle
      call tile_checksum(self, tile, found, error)
      if (allocated(error)) exit
      if (found == nint(expected(tile), int64)) then
        done(tile) = 1
      else
        if (self%writable) call mark(self, tile, 0, 0_int64, error)
        if (allocated(error)) exit
      end if
    end do
    call team%agree(error)
    if (allocated(error)) return
    call team%sum(done)
    self%done = done == 1
    mismatches = claimed - count(self%done)
  end subroutine recheck

  subroutine tile_checksum(self, tile, value, error)
    class(map_file_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int64), intent(out) :: value
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer :: i
    value = 0
    do i = 1, size(self%datasets)
      call self%store%read_tile(i, tile, bytes, error)
      if (allocated(error)) return
      value = crc32(bytes, value)
    end do
  end subroutine tile_checksum

end module map_file
