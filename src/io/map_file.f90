! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The working file of a map, PATH.part: created whole by rank 0, which sends the others the offset of the tiles; then written by
!> all ranks independently. It is its own checkpoint: each tile has a state and a checksum.
module map_file
  use errors, only: error_t, fail
  use files, only: free_bytes, publish_file, remove_file, reserve_file
  use h5, only: h5_close, h5_create, h5_exists, h5_file_t, h5_open
  use h5_records, only: h5_create_records, h5_record_t, h5_records_offset
  use kinds, only: int64, real64
  use map_compare, only: check_layout
  use map_layout, only: create_objects, path_of, write_data
  use map_schema, only: schema_t, type_int64
  use output_check, only: check_create, check_resume, working_path
  use status, only: exit_cannot_create, exit_internal, exit_io, exit_other_case
  use team, only: team_t
  use text, only: to_text
  use tile_record, only: head_begins, head_names, head_types, tile_records
  use tile_store, only: tile_damaged, tile_store_t, tile_whole
  use tiles, only: new_tiling, tiling_t
  implicit none
  private

  public :: create_working, open_working, working_path

  !> Longest name of a variable.
  integer, parameter :: name_length = 128

  type, public :: map_file_t
    !> The name of the final file.
    character(len=:), allocatable :: path
    type(schema_t) :: schema
    type(tiling_t) :: tiling
    !> Positions in the schema of the tiled variables.
    integer, allocatable :: tiled(:)
    logical, private :: writable = .true.
    !> The tiles of the tiled variables, in their order.
    type(tile_store_t) :: store
    !> Per tile.
    logical, allocatable :: done(:)
    !> Tiles that this rank has written.
    integer, private :: own = 0
    !> Tiles that were done when the file was opened.
    integer, private :: earlier = 0
  contains
    procedure :: tile_count
    procedure :: tile_done
    procedure :: tile_bytes
    procedure :: names
    procedure :: types
    procedure :: write_tile
    procedure :: read_tile
    procedure :: flush => flush_tiles
    procedure :: count_left
    procedure :: check => check_part
    procedure :: keep_description
    procedure :: open => open_part
    procedure :: close => close_part
  end type map_file_t

contains

  !> Creates and opens the working file. Collective. `grid`: names of the dimensions that are cut into tiles of `tile_shape`. Code
  !> 73 if the final or the working file exists and `force` is false, the folder is missing or not writable, or the space is too
  !> small. The file of one of several shares (attribute `shares` of the group `shard`) stays sparse.
  subroutine create_working(path, schema, grid, tile_shape, force, team, file, error)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    logical, intent(in) :: force
    class(team_t), intent(in) :: team
    type(map_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    integer :: shares
    call prepare(path, schema, grid, tile_shape, file, error)
    if (allocated(error)) return
    shares = shares_of(schema)
    if (team%is_root()) then
      call check_create(path, force, error)
      if (.not. allocated(error)) call check_space(file, shares, error)
      if (.not. allocated(error)) call build(file, shares == 1, error)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call file%open(team, error)
  end subroutine create_working

  !> Opens the working file of an interrupted run. Collective. Tiles whose data does not match their checksum count as not done.
  !> Code 76 if the file has another layout, or another `case_identity` in the group `provenance` than the schema. `only_read`: the
  !> file stays as it is.
  subroutine open_working(path, schema, grid, tile_shape, team, file, error, only_read)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    class(team_t), intent(in) :: team
    type(map_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: only_read
    call prepare(path, schema, grid, tile_shape, file, error)
    if (allocated(error)) return
    if (present(only_read)) file%writable = .not. only_read
    if (team%is_root()) then
      if (file%writable) call check_resume(path, error)
      if (.not. allocated(error)) call check_layout(working_path(path), file%schema, file%tiling%shape, error)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call file%open(team, error)
    if (.not. allocated(error)) call look_at_tiles(file, team, error)
  end subroutine open_working

  !> Of how many shares the file of a schema is one; 1 if of none.
  pure integer function shares_of(schema)
    type(schema_t), intent(in) :: schema
    shares_of = max(1, nint(schema%find_number('shard', 'shares')))
  end function shares_of

  !> Sets up the tiling, the group `tiles` in the schema, and the records.
  subroutine prepare(path, schema, grid, tile_shape, file, error)
    character(len=*), intent(in) :: path
    type(schema_t), intent(in) :: schema
    character(len=*), intent(in) :: grid(:)
    integer(int64), intent(in) :: tile_shape(:)
    type(map_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: listed
    character(len=name_length) :: name
    integer :: i
    file%path = path
    file%schema = schema
    call new_tiling(schema%lengths_of(grid), tile_shape, file%tiling, error)
    if (allocated(error)) return
    file%tiled = pack([(i, i=1, size(schema%variables))], [(schema%variables(i)%tiled, i=1, size(schema%variables))])
    listed = ''
    do i = 1, size(file%tiled)
      associate (variable => schema%variables(file%tiled(i)))
        name = path_of(variable%group, variable%name)
        listed = trim(listed//' '//trim(name))
        if (size(variable%dimensions) == size(grid)) then
          if (all(variable%dimensions == grid)) cycle
        end if
        call fail(error, exit_internal, 'tiled variable '//variable%name//' has not the dimensions of the grid')
        return
      end associate
    end do
    call file%schema%add_attribute('tiles', 'variables', trim(adjustl(listed)))
    call file%schema%add_dimension('axis', size(grid, kind=int64))
    call file%schema%add_variable('tile_shape', type_int64, ['axis'], group='tiles', data=real(file%tiling%shape, real64), &
                                  long_name='points of a tile along each axis')
    call file%store%define(file%tiling, file%types(), shares_of(schema))
    allocate (file%done(file%tiling%count()), source=.false.)
  end subroutine prepare

  !> Paths of the tiled variables.
  pure function names(self)
    class(map_file_t), intent(in) :: self
    character(len=name_length) :: names(size(self%tiled))
    integer :: i
    do i = 1, size(self%tiled)
      associate (variable => self%schema%variables(self%tiled(i)))
        names(i) = path_of(variable%group, variable%name)
      end associate
    end do
  end function names

  !> Types of the tiled variables.
  pure function types(self)
    class(map_file_t), intent(in) :: self
    integer :: types(size(self%tiled)), i
    types = [(self%schema%variables(self%tiled(i))%type, i=1, size(self%tiled))]
  end function types

  !> What HDF5 has to know of a record.
  function described(file) result(record)
    type(map_file_t), intent(in) :: file
    type(h5_record_t) :: record
    character(len=name_length) :: paths(size(file%tiled))
    integer :: i
    paths = file%names()
    record%names = [character(len=name_length) :: head_names, [(paths(i)(2:), i=1, size(paths))]]
    record%types = [head_types, file%store%record%types]
    record%begins = [head_begins, file%store%record%begins]
    record%shape = file%tiling%shape
    record%scalars = size(head_names)
    record%bytes = file%store%record%bytes
  end function described

  subroutine check_space(file, shares, error)
    type(map_file_t), intent(in) :: file
    integer, intent(in) :: shares
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: needed, free
    needed = file%tiling%count()*file%store%record%bytes/shares
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
    if (.not. allocated(error)) call create_objects(new, file%schema, working=.true., error=error)
    do i = 1, size(file%schema%variables)
      if (allocated(error)) exit
      if (.not. file%schema%variables(i)%tiled) call write_data(new, file%schema, file%schema%variables(i), error)
    end do
    ! The last, so that a tail that is cut off costs tiles only.
    if (.not. allocated(error)) call h5_create_records(new, tile_records, described(file), int(file%tiling%count(), int64), error)
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

  !> Opens the working file on all ranks; rank 0 alone reads what describes it. Collective.
  subroutine open_part(self, team, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: part
    integer(int64) :: first(1)
    first = 0
    if (team%is_root()) then
      call h5_open(working_path(self%path), part, error)
      if (.not. allocated(error)) then
        if (.not. h5_exists(part, tile_records)) call fail(error, exit_other_case, ''''//working_path(self%path)// &
          ''' has no '//tile_records//': the program that began it finishes it')
      end if
      if (.not. allocated(error)) call h5_records_offset(part, tile_records, described(self), int(self%tiling%count(), int64), &
                                                         first(1), error)
      call h5_close(part, ignored)
    end if
    call team%agree(error)
    if (allocated(error)) return
    call team%broadcast_integers(first)
    call self%store%set_offset(first(1))
    call self%store%open(working_path(self%path), self%writable, error)
    if (team%is_root() .and. self%writable .and. .not. allocated(error)) call self%store%keep_head(error)
    call team%agree(error)
  end subroutine open_part

  !> Code 74 if another program has removed, moved or truncated the working file: what is written then is lost to whoever looks for
  !> it by its name. After a truncation the file can be resumed. Only rank 0 notices it.
  subroutine check_part(self, error)
    class(map_file_t), intent(in) :: self
    type(error_t), allocatable, intent(out) :: error
    logical :: was_damaged
    if (.not. self%store%has_name()) then
      call fail(error, exit_io, "'"//working_path(self%path)//"' has been removed or moved while the run writes it; with the "// &
                'file back under this name the same command with --resume (without --force) goes on')
      return
    end if
    call self%store%restore_head(was_damaged, error)
    if (was_damaged .and. .not. allocated(error)) call fail(error, exit_io, "'"//working_path(self%path)// &
      "' has been truncated or overwritten while the run writes it; the same command with --resume (without --force) computes "// &
      'the lost tiles again')
  end subroutine check_part

  !> What describes the working file is as it is now: after this run itself has changed it. On rank 0. Code 74.
  subroutine keep_description(self, error)
    class(map_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    call self%store%keep_head(error)
  end subroutine keep_description

  !> Writes what waits and closes the working file; it can be opened again. Collective.
  subroutine close_part(self, team, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    call self%store%close(error)
    call team%agree(error)
  end subroutine close_part

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
    tile_bytes = self%tiling%points(tile)*self%schema%bytes_of_point()
  end function tile_bytes

  !> Takes a tile that is done; it is in the file within half a second, or after `flush`. `values`: (points of the tile in its C
  !> order, tiled variables in the order of the schema). On an error (code 74) the caller ends all ranks.
  subroutine write_tile(self, tile, values, error)
    class(map_file_t), intent(inout) :: self
    integer, intent(in) :: tile
    real(real64), intent(in) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    if (size(values, 1) /= self%tiling%points(tile) .or. size(values, 2) /= size(self%tiled)) then
      call fail(error, exit_internal, 'tile '//to_text(tile)//' gets values of the wrong shape')
      return
    end if
    call self%store%put(tile, values, error)
    if (allocated(error)) return
    if (.not. self%done(tile)) self%own = self%own + 1
    self%done(tile) = .true.
  end subroutine write_tile

  !> Writes the tiles that wait; with `only_due` only if they wait for half a second. Code 74.
  subroutine flush_tiles(self, error, only_due)
    class(map_file_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: only_due
    logical :: all
    all = .true.
    if (present(only_due)) all = .not. only_due
    if (all) then
      call self%store%flush(error)
    else
      call self%store%flush_due(error)
    end if
  end subroutine flush_tiles

  !> The values of a tile that is done, as `write_tile` takes them.
  subroutine read_tile(self, tile, values, error)
    class(map_file_t), intent(inout) :: self
    integer, intent(in) :: tile
    real(real64), allocatable, intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    allocate (values(self%tiling%points(tile), size(self%tiled)))
    call self%store%get(tile, values, error)
  end subroutine read_tile

  !> The number of tiles that no rank has done. Collective.
  integer function count_left(self, team) result(left)
    class(map_file_t), intent(in) :: self
    class(team_t), intent(in) :: team
    integer(int64) :: own(1)
    own = self%own
    call team%sum(own)
    left = self%tile_count() - self%earlier - int(own(1))
  end function count_left

  !> Reads all tiles, each rank its part, and marks those as not done that do not match their checksum. Collective.
  subroutine look_at_tiles(self, team, error)
    class(map_file_t), intent(inout) :: self
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    integer(int64), allocatable :: done(:)
    integer, allocatable :: states(:)
    integer :: first, last, i, tile
    allocate (done(self%tile_count()), source=0_int64)
    first = int(team%rank()*int(self%tile_count(), int64)/team%size()) + 1
    last = int((team%rank() + 1)*int(self%tile_count(), int64)/team%size())
    allocate (states(max(0, last - first + 1)))
    call self%store%look(first, states, error)
    do i = 1, size(states)
      if (allocated(error)) exit
      tile = self%store%order%tile_at(first + i - 1)
      if (states(i) == tile_whole) done(tile) = 1
      if (states(i) == tile_damaged .and. self%writable) call self%store%drop(tile, error)
    end do
    call team%agree(error)
    if (allocated(error)) return
    call team%sum(done)
    self%done = done == 1
    self%earlier = count(self%done)
    self%own = 0
  end subroutine look_at_tiles

end module map_file
