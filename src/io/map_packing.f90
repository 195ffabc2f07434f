! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> The tiled variables of a map, from the working file into the final one, by all ranks. Each compresses its share of the chunks;
!> rank 0 learns their lengths alone, takes their offsets in the file, and each writes its own there. Who does what does not
!> show: chunks lie in the order of variables and C order.
module map_packing
  use boxes, only: copy_common
  use byte_file, only: byte_file_t
  use checksum, only: crc32, crc32_combine
  use compress, only: compressed
  use errors, only: error_t, fail
  use h5, only: deflate_level, h5_close, h5_close_dataset, h5_dataset_t, h5_file_t, h5_open, h5_open_dataset, h5_shuffles
  use h5_chunks, only: h5_read_chunk, h5_reserve_chunk
  use kinds, only: int64, int8, real64
  use slabs, only: chunk_count, chunk_corner, final_chunk, slab, slab_count
  use status, only: exit_io
  use system, only: monotonic_seconds
  use team, only: team_t
  use tile_store, only: tile_store_t
  use value_types, only: bytes_of
  implicit none
  private

  !> Slabs that a rank holds compressed at once.
  integer, parameter :: most_held = 4

  type :: part_t
    integer(int8), allocatable :: bytes(:)
  end type part_t

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
    !> Slabs that this rank checks, numbered over all variables, and length and checksum of their chunks.
    integer(int64), allocatable :: checked(:), expected(:, :)
    !> Seconds in which rank 0 took the offsets of chunks, and the others waited.
    real(real64), public :: alone = 0
  contains
    procedure :: begin => begin_packing
    procedure :: pack => pack_variables
    procedure :: check => check_packed
    procedure, private :: units
    procedure, private :: slab_of
  end type packing_t

contains

  !> `names`: paths of datasets of the same `lengths`, in the order in which `pack` finds them in the store.
  subroutine begin_packing(self, names, types, lengths)
    class(packing_t), intent(out) :: self
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: types(:)
    integer(int64), intent(in) :: lengths(:)
    integer(int64) :: lower(size(lengths)), extent(size(lengths))
    allocate (character(len=len(names)) :: self%names(size(names)))
    self%names(:) = names
    self%types = types
    self%lengths = lengths
    self%chunk = final_chunk(lengths)
    allocate (self%checksums(size(names)), source=0_int64)
    call slab(lengths, 1_int64, lower, extent)
    self%most_chunks = int(chunk_count(self%chunk, extent))
    allocate (self%checked(0), self%expected(self%most_chunks, 0))
  end subroutine begin_packing

  !> The number of slabs of all variables.
  pure integer(int64) function units(self)
    class(packing_t), intent(in) :: self
    units = size(self%types)*slab_count(self%lengths)
  end function units

  !> Variable, corner and extent of a slab, numbered from 0 over all variables.
  pure subroutine slab_of(self, unit, variable, lower, extent)
    class(packing_t), intent(in) :: self
    integer(int64), intent(in) :: unit
    integer, intent(out) :: variable
    integer(int64), intent(out) :: lower(:), extent(:)
    variable = int(unit/slab_count(self%lengths)) + 1
    call slab(self%lengths, mod(unit, slab_count(self%lengths)) + 1, lower, extent)
  end subroutine slab_of

  !> Compresses and writes all chunks into the file `path`, which rank 0 has open as `new`, with the datasets in it. `picks`: the
  !> variables' numbers in the store. Collective; code 74, the same on all ranks.
  subroutine pack_variables(self, store, picks, path, new, team, error)
    class(packing_t), intent(inout) :: self
    type(tile_store_t), intent(in) :: store
    integer, intent(in) :: picks(:)
    character(len=*), intent(in) :: path
    type(h5_file_t), intent(in) :: new
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: later
    type(byte_file_t) :: file
    type(h5_dataset_t) :: datasets(size(picks))
    integer(int64) :: first, round, count
    integer :: i
    call file%open(path, .true., error)
    do i = 1, size(picks)
      if (team%is_root() .and. .not. allocated(error)) call h5_open_dataset(new, trim(self%names(i)), datasets(i), error)
    end do
    call team%agree(error)
    round = int(most_held, int64)*team%size()
    do first = 0, self%units() - 1, round
      if (allocated(error)) exit
      count = min(round, self%units() - first)
      call pack_round(self, store, picks, first, int(count), datasets, new, file, team, error)
    end do
    call file%close(later, durable=.not. team%is_root())
    if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
    do i = 1, size(picks)
      call h5_close_dataset(datasets(i), later)
      if (.not. allocated(error) .and. allocated(later)) call move_alloc(later, error)
    end do
    call team%agree(error)
  end subroutine pack_variables

  !> The slabs `first` to `first + count - 1`, each by the rank whose turn it is.
  subroutine pack_round(self, store, picks, first, count, datasets, new, file, team, error)
    class(packing_t), intent(inout) :: self
    type(tile_store_t), intent(in) :: store
    integer, intent(in) :: picks(:), count
    integer(int64), intent(in) :: first
    type(h5_dataset_t), intent(in) :: datasets(:)
    type(h5_file_t), intent(in) :: new
    type(byte_file_t), intent(in) :: file
    class(team_t), intent(in) :: team
    type(error_t), allocatable, intent(out) :: error
    type(part_t) :: parts(self%most_chunks, most_held)
    !> Per chunk its length and its checksum, in one number; the last row: the checksum of the slab's values.
    integer(int64), allocatable :: words(:, :), offsets(:, :), flat(:)
    real(real64) :: begun
    integer :: unit, mine, k
    allocate (words(self%most_chunks + 1, count), offsets(self%most_chunks, count), source=0_int64)
    do unit = 1, count
      if (mod(unit - 1, team%size()) /= team%rank() .or. allocated(error)) cycle
      mine = (unit - 1)/team%size() + 1
      call compress_slab(self, store, picks, first + unit - 1, parts(:, mine), words(:, unit), error)
    end do
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
      call note_checksum(self, first + unit - 1, words(:, unit))
      ! What one has written another one reads back.
      if (mod(unit, team%size()) == team%rank()) call expect(self, first + unit - 1, words(:self%most_chunks, unit))
      if (mod(unit - 1, team%size()) /= team%rank()) cycle
      do k = 1, self%most_chunks
        if (words(k, unit) == 0) cycle
        if (.not. allocated(error)) call file%write(parts(k, (unit - 1)/team%size() + 1)%bytes, offsets(k, unit), error)
      end do
    end do
    call team%agree(error)
  end subroutine pack_round

  subroutine compress_slab(self, store, picks, unit, parts, words, error)
    class(packing_t), intent(in) :: self
    type(tile_store_t), intent(in) :: store
    integer, intent(in) :: picks(:)
    integer(int64), intent(in) :: unit
    type(part_t), intent(inout) :: parts(:)
    integer(int64), intent(inout) :: words(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(self%lengths)) :: lower, extent, corner
    integer(int8), allocatable :: bytes(:), chunk(:)
    integer :: variable, width, k
    call self%slab_of(unit, variable, lower, extent)
    width = bytes_of(self%types(variable))
    allocate (bytes(product(extent)*width))
    call store%read_block(picks(variable), lower, extent, bytes, error)
    if (allocated(error)) return
    words(size(words)) = crc32(bytes, 0_int64)
    do k = 1, int(chunk_count(self%chunk, extent))
      corner = chunk_corner(self%chunk, lower, extent, k)
      allocate (chunk(product(self%chunk)*width), source=0_int8)
      call copy_common(width, lower, extent, bytes, corner, self%chunk, chunk)
      parts(k)%bytes = compressed(chunk, deflate_level, merge(width, 1, h5_shuffles(self%types(variable))))
      deallocate (chunk)
      if (size(parts(k)%bytes) == 0) then
        call fail(error, exit_io, 'there is no memory to compress '''//trim(self%names(variable))//'''')
        return
      end if
      words(k) = ior(ishft(size(parts(k)%bytes, kind=int64), 32), crc32(parts(k)%bytes, 0_int64))
    end do
  end subroutine compress_slab

  pure integer(int64) function bytes_in(word)
    integer(int64), intent(in) :: word
    bytes_in = ishft(word, -32)
  end function bytes_in

  !> Takes the offsets of the chunks of a round, in order.
  subroutine reserve(self, first, words, datasets, new, offsets, error)
    class(packing_t), intent(in) :: self
    integer(int64), intent(in) :: first, words(:, :)
    type(h5_dataset_t), intent(in) :: datasets(:)
    type(h5_file_t), intent(in) :: new
    integer(int64), intent(inout) :: offsets(:, :)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), dimension(size(self%lengths)) :: lower, extent
    integer(int8), allocatable :: nothing(:)
    integer :: unit, variable, k
    allocate (nothing(maxval(bytes_in_all(words(:self%most_chunks, :)))), source=0_int8)
    do unit = 1, size(words, 2)
      call self%slab_of(first + unit - 1, variable, lower, extent)
      do k = 1, int(chunk_count(self%chunk, extent))
        call h5_reserve_chunk(new, datasets(variable), chunk_corner(self%chunk, lower, extent, k), &
                              nothing(:bytes_in(words(k, unit))), offsets(k, unit), error)
        if (allocated(error)) return
      end do
    end do
  end subroutine reserve

  pure function bytes_in_all(words) result(bytes)
    integer(int64), intent(in) :: words(:, :)
    integer(int64) :: bytes(size(words, 1), size(words, 2))
    bytes = ishft(words, -32)
  end function bytes_in_all

  !> Adds a slab to the checksum of its variable; slabs come in C order.
  subroutine note_checksum(self, unit, words)
    class(packing_t), intent(inout) :: self
    integer(int64), intent(in) :: unit, words(:)
    integer(int64), dimension(size(self%lengths)) :: lower, extent
    integer :: variable
    call self%slab_of(unit, variable, lower, extent)
    self%checksums(variable) = crc32_combine(self%checksums(variable), words(size(words)), &
                                             product(extent)*bytes_of(self%types(variable)))
  end subroutine note_checksum

  !> Notes a slab that this rank will read back.
  subroutine expect(self, unit, words)
    class(packing_t), intent(inout) :: self
    integer(int64), intent(in) :: unit, words(:)
    self%checked = [self%checked, unit]
    self%expected = reshape([self%expected, words], [self%most_chunks, size(self%checked)])
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
    integer :: i, variable, before
    if (size(self%checked) == 0) return
    call h5_open(path, file, error)
    before = 0
    do i = 1, size(self%checked)
      if (allocated(error)) exit
      call self%slab_of(self%checked(i), variable, lower, extent)
      if (variable /= before) then
        call h5_close_dataset(dataset, error)
        if (.not. allocated(error)) call h5_open_dataset(file, trim(self%names(variable)), dataset, error)
      end if
      before = variable
      if (.not. allocated(error)) call check_slab(self, dataset, lower, extent, self%expected(:, i), error)
    end do
    call h5_close_dataset(dataset, ignored)
    call h5_close(file, ignored)
  end subroutine check_packed

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
