! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tiled variables of a map, from the working file into the final one, by all ranks. Each compresses its share of the chunks;
!> rank 0 learns their lengths alone, takes their offsets in the file, and each writes its own there. A slab of the grid is read
!> once, for all variables. Who does what does not show: chunks lie in the order of slabs, variables and C order.
module map_packing
  use boxes, only: copy_common
  use byte_file, only: byte_file_t
  use checksum, only: crc32, crc32_combine
  use compress, only: compress_bytes
  use errors, only: error_t, fail
  use h5, only: deflate_level, h5_close, h5_close_dataset, h5_dataset_t, h5_file_t, h5_open, h5_open_dataset, h5_shuffles
  use h5_chunks, only: h5_read_chunk, h5_reserve_chunk
  use kinds, only: int64, int8, real64
  use slabs, only: chunk_count, chunk_corner, final_chunk, slab, slab_count
  use status, only: exit_io
  use system, only: keep_memory, monotonic_seconds
  use team, only: team_t
  use tile_record, only: values_t
  use tile_store, only: tile_store_t
  use value_types, only: bytes_of
  implicit none
  private

  !> Memory of slabs and chunks that stays with a rank from one to the next [bytes].
  integer, parameter :: kept = 2**26

  !> What is packed, and what is known of it.
  type, public :: packing_t
    private
    !> Paths and types of the variables; the lengths of each, and of its chunks.
    character(len=:), allocatable, public :: names(:)
    integer, allocatable :: types(:)
    integer(int64), allocatable :: lengths(:), chunk(:)
    !> CRC-32 of each variable's values in C order.
    integer(int64), allocatable, public :: checksums(:)
    !> Most chunks of a slab.
    integer :: most_chunks = 0
    logical, private :: is_packed = .false.
    !> Per tile what was found (module tile_store) and its checksum, if this rank has read its first point.
    integer(int64), allocatable, public :: states(:), tile_checksums(:)
    !> Slabs that this rank checks, and per variable length and checksum of their chunks.
    integer(int64), allocatable :: checked(:), expected(:, :, :)
    !> Where this rank writes chunks, from `pack` to `finish`.
    type(byte_file_t) :: file
    !> Seconds in which rank 0 took the offsets of chunks, and the others waited.
    real(real64), public :: alone = 0
  contains
    procedure :: begin => begin_packing
    procedure :: has_slab
    procedure :: pack => pack_variables
    procedure :: finish => finish_packing
    procedure :: check => check_packed
    procedure :: checked_names
  end type packing_t

contains

  !> `names`: paths of datasets of the same `lengths`, in the order of the store; `tiles`: their number.
  subroutine begin_packing(self, names, types, lengths, tiles)
    class(packing_t), intent(out) :: self
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: types(:), tiles
    integer(int64), intent(in) :: lengths(:)
    integer(int64) :: lower(size(lengths)), extent(size(lengths))
    allocate (character(len=len(names)) :: self%names(size(names)))
    self%names(:) = names
    self%types = types
    self%lengths = lengths
    self%chunk = final_chunk(lengths)
    allocate (self%checksums(size(names)), self%states(tiles), self%tile_checksums(tiles), source=0_int64)
    call slab(lengths, 1_int64, lower, extent)
    self%most_chunks = int(chunk_count(self%chunk, extent))
    allocate (self%checked(0), self%expected(self%most_chunks, size(names), 0))
  end subroutine begin_packing

  !> Whether a rank packs anything.
  pure logical function has_slab(self, rank)
    class(packing_t), intent(in) :: self
    integer, intent(in) :: rank
    has_slab = rank < slab_count(self%lengths)
  end function has_slab

  !> Compresses and writes all chunks into the file `path`, which rank 0 has open as `new`, with the datasets in it. Collective;
  !> code 74, the same on all ranks. `finish` follows.
  subroutine pack_variables(self, store, path, new, team, error)
    class(packing_t), intent(inout) :: self
    type(tile_store_t), intent(in) :: store
    character(len=*), intent(in) :: path
    type(h5_file_t), intent(in) :: new
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: later
    type(h5_dataset_t) :: datasets(size(self%types))
    integer(int64) :: first, count
    integer :: i
    self%is_packed = .true.
    call keep_memory(kept)
    if (self%has_slab(team%rank())) call self%file%open(path, .true., error)
    do i = 1, size(datasets)
      if (team%is_root() .and. .not. allocated(error)) call h5_open_dataset(new, trim(self%names(i)), datasets(i), error)
    end do
    call team%agree(error)
    do first = 1, slab_count(self%lengths), team%size()
      if (allocated(error)) exit
      count = min(int(team%size(), int64), slab_count(self%lengths) - first + 1)
      call pack_round(self, store, first, int(count), datasets, new, team, error)
    end do
    do i = 1, size(datasets)
      call h5_close_dataset(datasets(i), later)
      if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
    end do
    call team%agree(error)
  end subroutine pack_variables

  !> After `pack`, also where that has failed: what this rank has written is on the disk. `durable`: else another one syncs.
  subroutine finish_packing(self, durable, error)
    class(packing_t), intent(inout) :: self
    logical, intent(in) :: durable
    type(error_t), allocatable, intent(inout) :: error
    type(error_t), allocatable :: later
    call self%file%close(later, durable=durable)
    if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
  end subroutine finish_packing

  !> The slabs `first` to `first + count - 1`, one for each rank.
  subroutine pack_round(self, store, first, count, datasets, new, team, error)
    class(packing_t), intent(inout) :: self
    type(tile_store_t), intent(in) :: store
    integer(int64), intent(in) :: first
    integer, intent(in) :: count
    type(h5_dataset_t), intent(in) :: datasets(:)
    type(h5_file_t), intent(in) :: new
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(values_t) :: parts(self%most_chunks, size(self%types))
    !> Per chunk its length and its checksum, in one number; the last row: the checksums of the slab's values.
    integer(int64), allocatable :: words(:, :, :), offsets(:, :, :), flat(:)
    real(real64) :: begun
    integer :: unit, mine, v, k
    allocate (words(self%most_chunks + 1, size(self%types), count), offsets(self%most_chunks, size(self%types), count), &
              source=0_int64)
    mine = team%rank() + 1
    if (mine <= count) call compress_slab(self, store, first + mine - 1, parts, words(:, :, mine), error)
    flat = reshape(words, [size(words)])
    call team%sum(flat)
    words = reshape(flat, shape(words))
    call team%agree(error)
    if (allocated(error)) return
    begun = monotonic_seconds()
    if (team%is_root()) call reserve(self, first, words, datasets, new, offsets, error)
    self%alone = self%alone + (monotonic_seconds() - begun)
    call team%agree(error)
    if (allocated(error)) return
    flat = reshape(offsets, [size(offsets)])
    call team%broadcast(flat)
    offsets = reshape(flat, shape(offsets))
    do unit = 1, count
      call note_checksums(self, first + unit - 1, words(self%most_chunks + 1, :, unit))
      ! What one has written another one reads back.
      if (mod(unit, team%size()) == team%rank()) call expect(self, first + unit - 1, words(:self%most_chunks, :, unit))
    end do
    do v = 1, size(self%types)
      do k = 1, self%most_chunks
        if (mine > count .or. allocated(error)) exit
        if (words(k, v, mine) > 0) call self%file%write(parts(k, v)%bytes, offsets(k, v, mine), error)
      end do
    end do
    call team%agree(error)
  end subroutine pack_round

  subroutine compress_slab(self, store, number, parts, words, error)
    class(packing_t), intent(inout) :: self
    type(tile_store_t), intent(in) :: store
    integer(int64), intent(in) :: number
    type(values_t), intent(inout) :: parts(:, :)
    integer(int64), intent(inout) :: words(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(self%lengths)) :: lower, extent, corner
    type(values_t) :: values(size(self%types))
    integer(int8), allocatable :: chunk(:)
    integer :: v, width, k
    call slab(self%lengths, number, lower, extent)
    do v = 1, size(values)
      allocate (values(v)%bytes(product(extent)*bytes_of(self%types(v))))
    end do
    call store%read_block(lower, extent, values, self%states, self%tile_checksums, error)
    if (allocated(error)) return
    do v = 1, size(values)
      width = bytes_of(self%types(v))
      words(size(words, 1), v) = crc32(values(v)%bytes, 0_int64)
      do k = 1, int(chunk_count(self%chunk, extent))
        corner = chunk_corner(self%chunk, lower, extent, k)
        allocate (chunk(product(self%chunk)*width))
        ! What lies beyond the map.
        if (any(corner + self%chunk > lower + extent)) chunk = 0
        call copy_common(width, lower, extent, values(v)%bytes, corner, self%chunk, chunk)
        call compress_bytes(chunk, deflate_level, merge(width, 1, h5_shuffles(self%types(v))), parts(k, v)%bytes)
        deallocate (chunk)
        if (size(parts(k, v)%bytes) == 0) then
          call fail(error, exit_io, 'there is no memory to compress '''//trim(self%names(v))//'''')
          return
        end if
        words(k, v) = ior(ishft(size(parts(k, v)%bytes, kind=int64), 32), crc32(parts(k, v)%bytes, 0_int64))
      end do
      deallocate (values(v)%bytes)
    end do
  end subroutine compress_slab

  pure integer(int64) function bytes_in(word)
    integer(int64), intent(in) :: word
    bytes_in = ishft(word, -32)
  end function bytes_in

  !> Takes the offsets of the chunks of a round, in order.
  subroutine reserve(self, first, words, datasets, new, offsets, error)
    class(packing_t), intent(in) :: self
    integer(int64), intent(in) :: first, words(:, :, :)
    type(h5_dataset_t), intent(in) :: datasets(:)
    type(h5_file_t), intent(in) :: new
    integer(int64), intent(inout) :: offsets(:, :, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(self%lengths)) :: lower, extent
    integer(int8), allocatable :: nothing(:)
    integer :: unit, v, k
    allocate (nothing(bytes_in(maxval(words(:self%most_chunks, :, :)))), source=0_int8)
    do unit = 1, size(words, 3)
      call slab(self%lengths, first + unit - 1, lower, extent)
      do v = 1, size(datasets)
        do k = 1, int(chunk_count(self%chunk, extent))
          call h5_reserve_chunk(new, datasets(v), chunk_corner(self%chunk, lower, extent, k), &
                                nothing(:bytes_in(words(k, v, unit))), offsets(k, v, unit), error)
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine reserve

  !> Adds a slab to the checksums of the variables; slabs come in C order.
  subroutine note_checksums(self, number, found)
    class(packing_t), intent(inout) :: self
    integer(int64), intent(in) :: number, found(:)
    integer(int64), dimension(size(self%lengths)) :: lower, extent
    integer :: v
    call slab(self%lengths, number, lower, extent)
    do v = 1, size(found)
      self%checksums(v) = crc32_combine(self%checksums(v), found(v), product(extent)*bytes_of(self%types(v)))
    end do
  end subroutine note_checksums

  !> Notes a slab that this rank will read back.
  subroutine expect(self, number, words)
    class(packing_t), intent(inout) :: self
    integer(int64), intent(in) :: number, words(:, :)
    self%checked = [self%checked, number]
    self%expected = reshape([self%expected, words], [self%most_chunks, size(self%types), size(self%checked)])
  end subroutine expect

  !> Reads back, from the finished file, this rank's share of the chunks and compares them with what was to be written; code 74.
  subroutine check_packed(self, path, error)
    class(packing_t), intent(in) :: self
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: ignored
    type(h5_file_t) :: file
    type(h5_dataset_t) :: dataset
    integer(int64), dimension(size(self%lengths)) :: lower, extent
    integer :: i, v
    if (size(self%checked) == 0) return
    call h5_open(path, file, error)
    do v = 1, size(self%types)
      if (.not. allocated(error)) call h5_open_dataset(file, trim(self%names(v)), dataset, error)
      do i = 1, size(self%checked)
        if (allocated(error)) exit
        call slab(self%lengths, self%checked(i), lower, extent)
        call check_slab(self, dataset, lower, extent, self%expected(:, v, i), error)
      end do
      call h5_close_dataset(dataset, ignored)
    end do
    call h5_close(file, ignored)
  end subroutine check_packed

  !> The datasets that `check` reads back: all, or none where nothing was packed.
  pure function checked_names(self) result(names)
    class(packing_t), intent(in) :: self
    character(len=len(self%names)), allocatable :: names(:)
    if (self%is_packed) then
      names = self%names
    else
      allocate (names(0))
    end if
  end function checked_names

  subroutine check_slab(self, dataset, lower, extent, words, error)
    class(packing_t), intent(in) :: self
    type(h5_dataset_t), intent(in) :: dataset
    integer(int64), intent(in) :: lower(:), extent(:), words(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int8), allocatable :: bytes(:)
    integer :: k
    do k = 1, int(chunk_count(self%chunk, extent))
      if (allocated(bytes)) deallocate (bytes)
      allocate (bytes(bytes_in(words(k))))
      call h5_read_chunk(dataset, chunk_corner(self%chunk, lower, extent, k), bytes, error)
      if (allocated(error)) return
      if (ior(ishft(size(bytes, kind=int64), 32), crc32(bytes, 0_int64)) == words(k)) cycle
      call fail(error, exit_io, 'dataset '''//dataset%name//''' of '''//dataset%path//''' is not as it was written')
      return
    end do
  end subroutine check_slab

end module map_packing
