! SPDX-FileCopyrightText: The Separatrix developers
! SPDX-License-Identifier: GPL-3.0-or-later

!> HDF5 with errors that name file and object: every status is tested here, once. Names of objects
!> are absolute paths; lengths, corners and extents are in C order; data is bytes.
module h5
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use errors, only: error_t, fail
  use guard, only: end_guard
  use h5_errors, only: h5_failed
  use h5_trap, only: trap
  use h5_types, only: find_type, h5_type
  use hdf5, only: &
    h5aexists_by_name_f, &
    H5D_ALLOC_TIME_EARLY_F, H5D_FILL_TIME_NEVER_F, h5dclose_f, h5dcreate_f, h5dget_space_f, &
    h5dopen_f, h5dread_f, h5dwrite_f, h5eset_auto_f, H5F_ACC_RDONLY_F, &
    H5F_ACC_RDWR_F, H5F_ACC_TRUNC_F, H5F_LIBVER_V110_F, H5F_LIBVER_V18_F, h5fclose_f, &
    h5fcreate_f, h5fopen_f, h5gclose_f, h5gcreate_f, h5get_libversion_f, &
    h5lexists_f, h5open_f, H5P_CRT_ORDER_INDEXED_F, H5P_CRT_ORDER_TRACKED_F, &
    H5P_DATASET_CREATE_F, H5P_FILE_ACCESS_F, H5P_FILE_CREATE_F, H5P_GROUP_CREATE_F, h5pclose_f, &
    h5pcreate_f, h5pset_alignment_f, h5pset_alloc_time_f, h5pset_chunk_f, h5pset_deflate_f, h5pset_fill_time_f, &
    h5pset_libver_bounds_f, h5pset_link_creation_order_f, h5pset_meta_block_size_f, h5pset_shuffle_f, &
    h5pset_small_data_block_size_f, H5S_SCALAR_F, &
    H5S_SELECT_SET_F, h5sclose_f, h5screate_f, h5screate_simple_f, h5sget_simple_extent_dims_f, &
    h5sget_simple_extent_ndims_f, h5sselect_hyperslab_f, hid_t, hsize_t
  use kinds, only: int64, int8
  use status, only: exit_io, exit_usage
  use superblock, only: why_not_opened
  use text, only: parse_integer, to_text
  use value_types, only: is_float
  implicit none
  private

  public :: h5_create, h5_open, h5_close, h5_exists, h5_create_group, h5_create_dataset, &
    h5_open_dataset, h5_close_dataset, h5_write, h5_read, h5_failed, h5_read_alignment, h5_version, h5_shuffles

  !> An open file.
  type, public :: h5_file_t
    integer(hid_t) :: id = -1
    character(len=:), allocatable :: path
    !> Pieces of at least so many bytes get their space at multiples of it.
    integer(int64) :: alignment = 1
  end type h5_file_t

  !> An open dataset. A scalar has no lengths.
  type, public :: h5_dataset_t
    integer(hid_t) :: id = -1
    integer :: type = 0
    integer(int64), allocatable :: lengths(:)
    character(len=:), allocatable :: name, path
  end type h5_dataset_t

  !> How a dataset is stored. Without a chunk it is contiguous. `fixed`: all space is allocated and
  !> never filled, so that later writes touch no metadata.
  type, public :: h5_storage_t
    integer(int64), allocatable :: chunk(:)
    logical :: compressed = .false.
    logical :: fixed = .false.
  end type h5_storage_t

  !> How hard zlib tries: more costs much and gains little here.
  integer, parameter, public :: deflate_level = 1

  !> Space that is taken at once for what describes the data, and for small data, when a file is opened for writing.
  integer(hsize_t), parameter :: front_bytes = 2**18
  !> The alignment of files that are written, in bytes, and the most that it may be.
  character(len=*), parameter :: alignment_variable = 'SEPARATRIX_ALIGNMENT'
  integer, parameter :: most_alignment = 2**30

contains

  !> Starts the library (again is harmless) without its own error output.
  subroutine start_library(path, error)
    character(len=*), intent(in) :: path
    type(error_t), allocatable, intent(inout) :: error
    integer :: status
    call h5open_f(status)
    if (h5_failed(status, 'start for', '', path, error)) return
    call h5eset_auto_f(0, status)
    if (h5_failed(status, 'start for', '', path, error)) return
  end subroutine start_library

  !> The version of the library, as 1.10.8.
  function h5_version() result(text)
    character(len=:), allocatable :: text
    type(error_t), allocatable :: error
    integer :: major, minor, release, status
    text = 'unknown'
    call start_library('', error)
    if (allocated(error)) return
    call h5get_libversion_f(major, minor, release, status)
    if (status == 0) text = to_text(major)//'.'//to_text(minor)//'.'//to_text(release)
  end function h5_version

  !> Creates a file in this process alone, replacing one of the same name; code 73. `working`: a file that opens again
  !> after its process was killed. A file begun in the format of HDF5 1.10 carries a mark while it is open for
  !> writing and is refused with it; one begun in that of 1.8 does not. What is in it has the format of 1.10 in both
  !> cases, whose index of chunks takes no memory to speak of.
  subroutine h5_create(path, file, error, working)
    character(len=*), intent(in) :: path
    type(h5_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: working
    integer(hid_t) :: access, creation
    integer :: status, ignored, oldest
    file%path = path
    oldest = H5F_LIBVER_V110_F
    if (present(working)) oldest = merge(H5F_LIBVER_V18_F, H5F_LIBVER_V110_F, working)
    call start_library(path, error)
    if (allocated(error)) return
    call h5pcreate_f(H5P_FILE_ACCESS_F, access, status)
    if (h5_failed(status, 'create the file', '', path, error)) return
    call h5pcreate_f(H5P_FILE_CREATE_F, creation, status)
    ! Readers with HDF5 1.10 open the file.
    if (status >= 0) call h5pset_libver_bounds_f(access, oldest, H5F_LIBVER_V110_F, status)
    ! Data gets its space at the end of the file, each piece by itself (module h5_chunks).
    if (status >= 0) call h5pset_small_data_block_size_f(access, 0_hsize_t, status)
    if (status >= 0) call align(access, file, status, error)
    if (status >= 0) call h5pset_link_creation_order_f(creation, ior(H5P_CRT_ORDER_TRACKED_F, H5P_CRT_ORDER_INDEXED_F), status)
    if (status >= 0) call h5fcreate_f(path, H5F_ACC_TRUNC_F, file%id, status, creation, access)
    if (h5_failed(status, 'create the file', '', path, error)) return
    call h5pclose_f(creation, ignored)
    call h5pclose_f(access, ignored)
    if (oldest == H5F_LIBVER_V110_F) return
    call h5_close(file, error)
    if (.not. allocated(error)) call h5_open(path, file, error, writable=.true.)
  end subroutine h5_create

  !> The alignment that the environment asks for, in bytes; 1: none. Code 64 for one that is no number of bytes.
  subroutine h5_read_alignment(bytes, error)
    integer, intent(out) :: bytes
    type(error_t), allocatable, intent(inout) :: error
    character(len=32) :: text
    integer :: length, absent, status
    bytes = 1
    call get_environment_variable(alignment_variable, text, length, absent)
    if (absent == 1 .or. length == 0) return
    call parse_integer(trim(text), bytes, status)
    if (absent /= 0 .or. status /= 0 .or. bytes < 1 .or. bytes > most_alignment) then
      call fail(error, exit_usage, alignment_variable//': found '//trim(text)//', allowed a number of bytes from 1 to '// &
                to_text(most_alignment))
    end if
  end subroutine h5_read_alignment

  !> Sets that alignment for a file that is written.
  subroutine align(access, file, status, error)
    integer(hid_t), intent(in) :: access
    type(h5_file_t), intent(inout) :: file
    integer, intent(out) :: status
    type(error_t), allocatable, intent(inout) :: error
    integer :: bytes
    status = -1
    call h5_read_alignment(bytes, error)
    if (allocated(error)) return
    file%alignment = bytes
    call h5pset_alignment_f(access, int(bytes, hsize_t), int(bytes, hsize_t), status)
  end subroutine align

  !> Opens a file in this process alone. Code 74.
  subroutine h5_open(path, file, error, writable)
    character(len=*), intent(in) :: path
    type(h5_file_t), intent(out) :: file
    type(error_t), allocatable, intent(out) :: error
    logical, intent(in), optional :: writable
    integer(hid_t) :: access
    integer :: status, flags, ignored
    file%path = path
    flags = H5F_ACC_RDONLY_F
    call start_library(path, error)
    if (allocated(error)) return
    if (present(writable)) flags = merge(H5F_ACC_RDWR_F, H5F_ACC_RDONLY_F, writable)
    call h5pcreate_f(H5P_FILE_ACCESS_F, access, status)
    if (status >= 0) call h5pset_libver_bounds_f(access, H5F_LIBVER_V110_F, H5F_LIBVER_V110_F, status)
    if (status >= 0) call h5pset_meta_block_size_f(access, front_bytes, status)
    if (status >= 0) call h5pset_small_data_block_size_f(access, front_bytes, status)
    if (status >= 0 .and. flags == H5F_ACC_RDWR_F) call align(access, file, status, error)
    call trap('its beginning', path, endless=.true.)
    if (status >= 0) call h5fopen_f(path, flags, file%id, status, access)
    call end_guard()
    if (status < 0 .and. .not. allocated(error)) call fail(error, exit_io, why_not_opened(path))
    call h5pclose_f(access, ignored)
  end subroutine h5_open

  !> Closes the file; a file that is not open stays so.
  subroutine h5_close(file, error)
    type(h5_file_t), intent(inout) :: file
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    if (file%id < 0) return
    call h5fclose_f(file%id, status)
    file%id = -1
    if (h5_failed(status, 'close', '', file%path, error)) return
  end subroutine h5_close

  !> Whether an object of this name is in the root or in a group of the root.
  logical function h5_exists(file, name)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer :: status, slash
    h5_exists = .true.
    slash = index(name, '/', back=.true.)
    call trap(name, file%path, endless=.true.)
    if (slash > 1) call h5lexists_f(file%id, name(:slash - 1), h5_exists, status)
    if (h5_exists) call h5lexists_f(file%id, name, h5_exists, status)
    call end_guard()
  end function h5_exists

  !> Creates a group unless it exists.
  subroutine h5_create_group(file, name, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: group, creation
    integer :: status, ignored
    if (h5_exists(file, name)) return
    call h5pcreate_f(H5P_GROUP_CREATE_F, creation, status)
    if (status >= 0) call h5pset_link_creation_order_f(creation, ior(H5P_CRT_ORDER_TRACKED_F, H5P_CRT_ORDER_INDEXED_F), status)
    if (status >= 0) call h5gcreate_f(file%id, name, group, status, gcpl_id=creation)
    if (h5_failed(status, 'create', name, file%path, error)) return
    call h5gclose_f(group, ignored)
    call h5pclose_f(creation, ignored)
  end subroutine h5_create_group

  !> Creates a dataset and opens it.
  subroutine h5_create_dataset(file, name, type, lengths, storage, dataset, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    integer, intent(in) :: type
    integer(int64), intent(in) :: lengths(:)
    type(h5_storage_t), intent(in) :: storage
    type(h5_dataset_t), intent(out) :: dataset
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: space, creation
    integer :: status, ignored
    dataset%name = name
    dataset%path = file%path
    dataset%type = type
    dataset%lengths = lengths
    call storage_of(storage, type, creation, status)
    if (status >= 0) call space_of(lengths, space, status)
    if (status >= 0) call h5dcreate_f(file%id, name, h5_type(type), space, dataset%id, status, creation)
    if (h5_failed(status, 'create', name, file%path, error)) return
    call h5sclose_f(space, ignored)
    call h5pclose_f(creation, ignored)
  end subroutine h5_create_dataset

  !> Whether values of a type are shuffled before they are compressed: that helps numbers with an exponent and does nothing for
  !> small integers.
  pure logical function h5_shuffles(type)
    integer, intent(in) :: type
    h5_shuffles = is_float(type)
  end function h5_shuffles

  subroutine storage_of(storage, type, creation, status)
    type(h5_storage_t), intent(in) :: storage
    integer, intent(in) :: type
    integer(hid_t), intent(out) :: creation
    integer, intent(out) :: status
    call h5pcreate_f(H5P_DATASET_CREATE_F, creation, status)
    if (allocated(storage%chunk) .and. status >= 0) then
      call h5pset_chunk_f(creation, size(storage%chunk), reversed(storage%chunk), status)
      if (storage%compressed .and. h5_shuffles(type) .and. status >= 0) call h5pset_shuffle_f(creation, status)
      if (storage%compressed .and. status >= 0) call h5pset_deflate_f(creation, deflate_level, status)
    end if
    if (storage%fixed .and. status >= 0) then
      call h5pset_fill_time_f(creation, H5D_FILL_TIME_NEVER_F, status)
      if (status >= 0) call h5pset_alloc_time_f(creation, H5D_ALLOC_TIME_EARLY_F, status)
    end if
  end subroutine storage_of

  subroutine space_of(lengths, space, status)
    integer(int64), intent(in) :: lengths(:)
    integer(hid_t), intent(out) :: space
    integer, intent(out) :: status
    if (size(lengths) == 0) then
      call h5screate_f(H5S_SCALAR_F, space, status)
    else
      call h5screate_simple_f(size(lengths), reversed(lengths), space, status)
    end if
  end subroutine space_of

  !> HDF5's Fortran interface lists dimensions backwards.
  pure function reversed(lengths) result(sizes)
    integer(int64), intent(in) :: lengths(:)
    integer(hsize_t) :: sizes(size(lengths))
    sizes = lengths(size(lengths):1:-1)
  end function reversed

  !> That there is no object of this name, which a result never lacks.
  function missing_text(file, name) result(text)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text
    logical :: is_result
    integer :: status
    call h5aexists_by_name_f(file%id, '/', 'format', is_result, status)
    text = "'"//file%path//"' has no '"//name//"'"
    if (status >= 0 .and. is_result) text = "'"//file%path//"' is damaged ('"//name//"' is missing)"
  end function missing_text

  !> Opens a dataset and finds its type and lengths.
  subroutine h5_open_dataset(file, name, dataset, error)
    type(h5_file_t), intent(in) :: file
    character(len=*), intent(in) :: name
    type(h5_dataset_t), intent(out) :: dataset
    type(error_t), allocatable, intent(out) :: error
    integer(hid_t) :: space
    integer(hsize_t), allocatable :: sizes(:), most(:)
    integer :: status, rank
    dataset%name = name
    dataset%path = file%path
    call trap(name, file%path, endless=.true.)
    call h5dopen_f(file%id, name, dataset%id, status)
    if (status >= 0) call h5dget_space_f(dataset%id, space, status)
    if (status >= 0) call h5sget_simple_extent_ndims_f(space, rank, status)
    call end_guard()
    if (status < 0) then
      if (.not. h5_exists(file, name)) call fail(error, exit_io, missing_text(file, name))
    end if
    if (h5_failed(status, 'open', name, file%path, error)) return
    allocate (sizes(rank), most(rank))
    if (rank > 0) call h5sget_simple_extent_dims_f(space, sizes, most, status)
    dataset%lengths = sizes(rank:1:-1)
    if (status >= 0) call h5sclose_f(space, status)
    if (status >= 0) call find_type(dataset%id, dataset%type, status)
    if (h5_failed(status, 'open', name, file%path, error)) return
  end subroutine h5_open_dataset

  !> Closes a dataset; one that is not open stays so.
  subroutine h5_close_dataset(dataset, error)
    type(h5_dataset_t), intent(inout) :: dataset
    type(error_t), allocatable, intent(out) :: error
    integer :: status
    if (dataset%id < 0) return
    call h5dclose_f(dataset%id, status)
    dataset%id = -1
    if (h5_failed(status, 'close', dataset%name, dataset%path, error)) return
  end subroutine h5_close_dataset

  !> Writes the values of a block (corner from 0), or of the whole dataset.
  subroutine h5_write(dataset, bytes, error, lower, extent)
    type(h5_dataset_t), intent(in) :: dataset
    integer(int8), intent(in), contiguous, target :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), intent(in), optional :: lower(:), extent(:)
    integer(hid_t) :: memory, space
    integer :: status, ignored
    if (size(bytes) == 0) return
    call select_block(dataset, memory, space, status, lower, extent)
    if (status >= 0) call h5dwrite_f(dataset%id, h5_type(dataset%type), c_loc(bytes), status, memory, space)
    if (h5_failed(status, 'write', dataset%name, dataset%path, error)) return
    call h5sclose_f(memory, ignored)
    call h5sclose_f(space, ignored)
  end subroutine h5_write

  !> Reads the values of a block (corner from 0), or of the whole dataset.
  subroutine h5_read(dataset, bytes, error, lower, extent)
    type(h5_dataset_t), intent(in) :: dataset
    integer(int8), intent(out), contiguous, target :: bytes(:)
    type(error_t), allocatable, intent(out) :: error
    integer(int64), intent(in), optional :: lower(:), extent(:)
    integer(hid_t) :: memory, space
    integer :: status, ignored
    type(c_ptr) :: address
    if (size(bytes) == 0) return
    address = c_loc(bytes)
    call select_block(dataset, memory, space, status, lower, extent)
    call trap(dataset%name, dataset%path, endless=.false.)
    if (status >= 0) call h5dread_f(dataset%id, h5_type(dataset%type), address, status, memory, space)
    call end_guard()
    if (h5_failed(status, 'read', dataset%name, dataset%path, error)) return
    call h5sclose_f(memory, ignored)
    call h5sclose_f(space, ignored)
  end subroutine h5_read

  subroutine select_block(dataset, memory, space, status, lower, extent)
    type(h5_dataset_t), intent(in) :: dataset
    integer(hid_t), intent(out) :: memory, space
    integer, intent(out) :: status
    integer(int64), intent(in), optional :: lower(:), extent(:)
    call h5dget_space_f(dataset%id, space, status)
    if (status < 0) return
    if (present(lower)) then
      call space_of(extent, memory, status)
      if (status >= 0) call h5sselect_hyperslab_f(space, H5S_SELECT_SET_F, reversed(lower), reversed(extent), status)
    else
      call space_of(dataset%lengths, memory, status)
    end if
  end subroutine select_block

end module h5
