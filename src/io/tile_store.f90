! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The records of the tiles in a working file, read and written without HDF5. They lie in the order in which tiles are handed out.
!> A rank keeps those that it has computed for half a second at most, and writes neighbours at once.
module tile_store
  use byte_file, only: byte_file_t
  use errors, only: error_t
  use kinds, only: int64, int8, real64
  use system, only: monotonic_seconds
  use tile_order, only: new_tile_order, tile_order_t
  use tile_record, only: head_bytes, is_done, new_record, record_t, values_t
  use tiles, only: tiling_t
  implicit none
  private

  !> Seconds between two writes of a rank, and bytes after which it writes in any case.
  real(real64), parameter :: most_seconds = 0.5_real64
  integer(int64), parameter :: most_bytes = 4*2_int64**20

  !> What a look at a tile finds.
  integer, parameter, public :: tile_missing = 0, tile_whole = 1, tile_damaged = 2

  type, public :: tile_store_t
    type(record_t) :: record
    type(tile_order_t) :: order
    type(byte_file_t), private :: file
    !> Where the first record begins.
    integer(int64), private :: first = 0
    !> What lies in front of the records, and the length of the file, on the rank that watches over them.
    integer(int8), allocatable, private :: head(:)
    integer(int64), private :: length = 0
    !> Records that wait to be written, one behind the other, and their slots; when this rank wrote last.
    integer(int8), allocatable, private :: waiting(:)
    integer, allocatable, private :: slots(:)
    integer, private :: held = 0
    real(real64), private :: last_write = 0
    !> Calls that wrote records.
    integer(int64) :: writes = 0
  contains
    procedure :: define
    procedure :: set_offset
    procedure :: open => open_store
    procedure :: close => close_store
    procedure :: has_name
    procedure :: keep_head
    procedure :: restore_head
    procedure :: put
    procedure :: flush_due
    procedure :: flush => flush_records
    procedure :: get
    procedure :: look
    procedure :: has_done
    procedure :: drop
    procedure :: read_block
  end type tile_store_t

contains

  !> What the records hold: variables of these types on the tiles of a grid that is computed in so many shares.
  subroutine define(self, tiling, types, shares)
    class(tile_store_t), intent(inout) :: self
    type(tiling_t), intent(in) :: tiling
    integer, intent(in) :: types(:), shares
    self%record = new_record(tiling, types)
    self%order = new_tile_order(tiling%count(), shares)
  end subroutine define

  !> Where in the file the first record begins.
  subroutine set_offset(self, first)
    class(tile_store_t), intent(inout) :: self
    integer(int64), intent(in) :: first
    self%first = first
  end subroutine set_offset

  !> Opens the file. Code 74.
  subroutine open_store(self, path, writable, error)
    class(tile_store_t), intent(inout) :: self
    character(len=*), intent(in) :: path
    logical, intent(in) :: writable
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: most
    call self%close(error)
    if (.not. allocated(error)) call self%file%open(path, writable, error)
    most = max(1_int64, min(most_bytes/self%record%bytes, int(self%record%tiling%count(), int64)))
    if (allocated(self%slots)) deallocate (self%slots, self%waiting)
    allocate (self%slots(most), self%waiting(most*self%record%bytes))
    ! The first tile is written at once.
    self%last_write = 0
  end subroutine open_store

  !> Whether the file is still there under its name.
  logical function has_name(self)
    class(tile_store_t), intent(in) :: self
    has_name = self%file%has_name()
  end function has_name

  !> Keeps what lies in front of the records, for `restore_head`. Code 74.
  subroutine keep_head(self, error)
    class(tile_store_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    if (allocated(self%head)) deallocate (self%head)
    allocate (self%head(self%first))
    self%length = self%file%length()
    call self%file%read(self%head, 0_int64, error)
  end subroutine keep_head

  !> Writes back what another program has cut off or overwritten in front of the records, and the length of the file, so that it can
  !> be resumed. `was_damaged`: whether there was something. Code 74.
  subroutine restore_head(self, was_damaged, error)
    class(tile_store_t), intent(in) :: self
    logical, intent(out) :: was_damaged
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: found(:)
    integer(int64) :: length
    was_damaged = .false.
    length = self%file%length()
    if (.not. allocated(self%head) .or. length < 0) return
    was_damaged = length < self%length
    if (length >= self%first) then
      allocate (found(self%first))
      call self%file%read(found, 0_int64, error)
      if (allocated(error)) return
      was_damaged = was_damaged .or. any(found /= self%head)
    end if
    if (.not. was_damaged) return
    call self%file%write(self%head, 0_int64, error)
    ! Nothing is written there: other ranks may be writing their records.
    if (.not. allocated(error) .and. length < self%length) call self%file%set_length(self%length, error)
  end subroutine restore_head

  !> Writes what waits and closes the file; one that is not open stays so.
  subroutine close_store(self, error)
    class(tile_store_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: later
    call self%flush(error)
    self%held = 0
    call self%file%close(later)
    if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
  end subroutine close_store

  !> Takes a tile that is done, (points of the tile in its C order, variables), and writes what waits if it is time. Code 74.
  subroutine put(self, tile, values, error)
    class(tile_store_t), intent(inout) :: self
    integer, intent(in) :: tile
    real(real64), intent(in) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    self%held = self%held + 1
    self%slots(self%held) = self%order%slot_of(tile)
    call self%record%encode(tile, values, self%waiting((self%held - 1)*self%record%bytes + 1:self%held*self%record%bytes))
    if (self%held == size(self%slots)) then
      call self%flush(error)
    else
      call self%flush_due(error)
    end if
  end subroutine put

  !> Writes what waits if the last write is half a second ago.
  subroutine flush_due(self, error)
    class(tile_store_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    if (self%held == 0) return
    if (monotonic_seconds() - self%last_write >= most_seconds) call self%flush(error)
  end subroutine flush_due

  !> Writes what waits, neighbours at once. Code 74.
  subroutine flush_records(self, error)
    class(tile_store_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    integer :: from, to
    from = 1
    do while (from <= self%held)
      to = from
      do while (to < self%held)
        if (self%slots(to + 1) /= self%slots(to) + 1) exit
        to = to + 1
      end do
      call self%file%write(self%waiting((from - 1)*self%record%bytes + 1:to*self%record%bytes), &
                           offset_of(self, self%slots(from)), error)
      if (allocated(error)) return
      self%writes = self%writes + 1
      from = to + 1
    end do
    self%held = 0
    self%last_write = monotonic_seconds()
  end subroutine flush_records

  !> Where in the file a record begins.
  pure integer(int64) function offset_of(self, slot)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: slot
    offset_of = self%first + (slot - 1)*self%record%bytes
  end function offset_of

  !> The values of a tile that is done, as `put` takes them. Code 74.
  subroutine get(self, tile, values, error)
    class(tile_store_t), intent(inout) :: self
    integer, intent(in) :: tile
    real(real64), intent(out) :: values(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    call self%flush(error)
    if (allocated(error)) return
    allocate (bytes(self%record%bytes))
    call self%file%read(bytes, offset_of(self, self%order%slot_of(tile)), error)
    if (.not. allocated(error)) call self%record%decode(tile, bytes, values)
  end subroutine get

  !> What is known of the tiles in the slots `first` to `first + size(states) - 1`; the read ones are neighbours. Code 74.
  subroutine look(self, first, states, error)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: first
    integer, intent(out) :: states(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: checksum
    integer :: at, count, i
    at = 1
    do while (at <= size(states))
      count = int(min(max(1_int64, most_bytes/self%record%bytes), size(states) - at + 1_int64))
      allocate (bytes(count*self%record%bytes))
      call self%file%read(bytes, offset_of(self, first + at - 1), error)
      if (allocated(error)) return
      do i = 1, count
        call assess(self, self%order%tile_at(first + at + i - 2), bytes((i - 1)*self%record%bytes + 1:i*self%record%bytes), &
                   states(at + i - 1), checksum)
      end do
      deallocate (bytes)
      at = at + count
    end do
  end subroutine look

  !> Whether the file marks a tile as done; its values are not read. A file that cannot be read has none.
  logical function has_done(self, tile)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: tile
    type(error_t), allocatable :: error
    integer(int8) :: head(head_bytes)
    call self%file%read(head, offset_of(self, self%order%slot_of(tile)), error)
    has_done = .not. allocated(error)
    if (has_done) has_done = is_done(head)
  end function has_done

  !> What a record holds of its tile, and the checksum of the values in it.
  subroutine assess(self, tile, bytes, state, checksum)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: tile
    integer(int8), intent(in), contiguous :: bytes(:)
    integer, intent(out) :: state
    integer(int64), intent(out) :: checksum
    checksum = 0
    state = tile_missing
    if (.not. is_done(bytes)) return
    state = merge(tile_whole, tile_damaged, self%record%matches(tile, bytes, checksum))
  end subroutine assess

  !> Marks a tile as not done. Code 74.
  subroutine drop(self, tile, error)
    class(tile_store_t), intent(in) :: self
    integer, intent(in) :: tile
    type(error_t), allocatable, intent(out) :: error
    integer(int8), parameter :: nothing(9) = 0_int8
    call self%file%write(nothing, offset_of(self, self%order%slot_of(tile)), error)
  end subroutine drop

  !> The values of a block of the grid (corner from 0), in C order, every tile compared with its checksum. `states` and `checksums`,
  !> per tile of the map, are set for tiles whose first point is in the block. Code 74.
  subroutine read_block(self, lower, extent, values, states, checksums, error)
    class(tile_store_t), intent(in) :: self
    integer(int64), intent(in) :: lower(:), extent(:)
    type(values_t), intent(inout) :: values(:)
    integer(int64), intent(inout) :: states(:), checksums(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(lower)) :: first, last, at, corner, own
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: checksum
    integer :: tile, state, k
    allocate (bytes(self%record%bytes))
    first = lower/self%record%tiling%shape
    last = (lower + extent - 1)/self%record%tiling%shape
    at = first
    do
      tile = int(self%record%tiling%number_at(at))
      call self%file%read(bytes, offset_of(self, self%order%slot_of(tile)), error)
      if (allocated(error)) return
      call assess(self, tile, bytes, state, checksum)
      call self%record%copy_block(tile, bytes, lower, extent, values)
      call self%record%tiling%block_of(tile, corner, own)
      if (all(corner >= lower)) then
        states(tile) = state
        checksums(tile) = checksum
      end if
      do k = size(lower), 1, -1
        at(k) = at(k) + 1
        if (at(k) <= last(k)) exit
        at(k) = first(k)
      end do
      if (k < 1) exit
    end do
  end subroutine read_block

end module tile_store
